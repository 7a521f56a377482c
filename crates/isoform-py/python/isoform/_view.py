"""Pages that show shapes, offline, in notebooks and files."""

from __future__ import annotations

import html
import os
from pathlib import Path as FilePath
from typing import Any

from . import _isoform
from ._brep import Brep
from ._call import asked
from ._compare import opened
from ._errors import IsoformError
from ._fit import FitResult
from ._implicitize import Implicit
from ._mesh import Triangles
from ._model import Model, Values
from ._parameterize import Patches
from ._points import Path, as_cloud
from ._region import Box, corners
from ._triangulate import Triangulation


class View:
    """A page that shows shapes; a notebook shows it as it is."""

    def __init__(self, page: str, height: int) -> None:
        self._page = page
        self._height = height

    def save(self, path: Path) -> None:
        """Write the page: one file that fetches nothing and can be sent."""
        path = os.fspath(path)
        try:
            FilePath(path).write_text(self._page, encoding="utf-8")
        except OSError as e:
            raise IsoformError(f"cannot write {path}: {e.strerror or e}", "not-writable") from None

    def _repr_html_(self) -> str:
        page = html.escape(self._page, quote=True)
        style = f"width: 100%; height: {self._height}px; border: 0"
        return f'<iframe srcdoc="{page}" style="{style}" sandbox="allow-scripts"></iframe>'

    def __repr__(self) -> str:
        return f"<isoform.View: {len(self._page)} bytes>"


def view(
    obj: Any,
    *others: Any,
    title: str | None = None,
    params: Values = None,
    box: Box = None,
    height: int = 560,
) -> View:
    """Show shapes in a notebook, or as a page.

    Parameters
    ----------
    obj : object
        Points, a model, a fit, a mesh, patches, a triangulation, a solid, or the path of points
        or of a program.
    *others : object
        More of them, as further layers.
    title : str, optional
        The title of the page.
    params : dict or sequence of float, optional
        Values of the parameters of models.
    box : float or sequence, optional
        What models without an end are looked at in.
    height : int
        Pixels of the frame in a notebook.

    Returns
    -------
    View
        A notebook shows it; ``.save("page.html")`` writes it.

    Raises
    ------
    IsoformError
        If there is nothing to show.

    Examples
    --------
    >>> import isoform
    >>> page = isoform.view(isoform.template("sphere"), params={"radius": 1})
    >>> page._repr_html_().startswith("<iframe")
    True
    """
    layers = [_layer(shape, params) for shape in (obj, *others)]
    name = title or ", ".join(dict.fromkeys(name for name, _ in layers))
    with asked(None, None, None) as limits:
        return View(_isoform.page(name, layers, corners(box), limits), height)


def _layer(shape: Any, params: Values) -> tuple[str, Any]:
    """The name of a layer, and what is shown, as the compiled half takes it."""
    if isinstance(shape, (str, os.PathLike)):
        shape = opened(shape)
    if isinstance(shape, FitResult):
        # A fit that was sent here has left its points with its sender.
        return shape._name, shape._native or (shape.model._native, [])
    if isinstance(shape, Model):
        return shape.name, (shape._native, shape._given(params))
    if isinstance(shape, Triangulation):
        return "surface", shape._native
    if isinstance(shape, Triangles):
        return "mesh", shape._mesh
    if isinstance(shape, (Implicit, Patches, Brep)):
        return type(shape).__name__.lower(), shape._native
    cloud, name = as_cloud(shape)
    return os.path.basename(name), cloud
