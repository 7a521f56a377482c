"""How far two shapes are apart."""

from __future__ import annotations

import os
from typing import Any, Union

from . import _isoform
from ._call import Progress, asked, whole
from ._document import Documented
from ._implicitize import Implicit
from ._mesh import Triangles
from ._model import Model, Values
from ._points import Path, PointCloud, Points, as_cloud, read_points
from ._region import Box, corners

#: What can be compared.
Shape = Union[Points, Triangles, Model, Implicit, Path]


class Comparison(Documented):
    """Distances between two shapes, both ways.

    Attributes
    ----------
    first_to_second, second_to_first : dict
        ``rms``, ``mean``, ``p95``, ``max``, ``samples`` and ``undefined``; lengths are in the unit
        of the shapes.
    within_tolerance : bool
        Whether no distance is larger than the tolerance, if there was one.
    """

    def __init__(self, document: str) -> None:
        self._document = document
        told = self.to_dict()
        self.first_to_second: dict[str, Any] = told["first_to_second"]
        self.second_to_first: dict[str, Any] = told["second_to_first"]
        self.within_tolerance: bool = told["within_tolerance"]

    def __repr__(self) -> str:
        there, back = self.first_to_second["max"], self.second_to_first["max"]
        return f"<isoform.Comparison: at most {there} there, {back} back>"


def compare(
    a: Shape,
    b: Shape,
    *,
    params: Values = None,
    box: Box = None,
    samples: int = 20_000,
    tolerance: float | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Comparison:
    """Measure how far two shapes are apart, both ways.

    Parameters
    ----------
    a, b : array_like, PointCloud, Mesh, Model, Implicit or path
        Points (n, 3), a mesh, a model, or a file of one.
    params : dict or sequence of float, optional
        Values of the parameters of a model.
    box : float or sequence, optional
        Where models are looked at; by default the box of the other side.
    samples : int
        About how many points are taken of a mesh and of a model.
    tolerance : float, optional
        The largest distance that is allowed.
    threads : int, optional
        How many to use, by default all cores.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done. True shows a bar.

    Returns
    -------
    Comparison
        Distances of the first from the second and back, of (n,) samples each.

    Raises
    ------
    IsoformError
        If there is nothing to compare.

    Examples
    --------
    >>> import isoform
    >>> isoform.compare([[0, 0, 0], [1, 0, 0]], [[0, 0, 1], [1, 0, 1]]).first_to_second["max"]
    1.0
    """
    (first, name_a), (second, name_b) = _side(a, params), _side(b, params)
    wanted = (corners(box), whole("samples", samples, 10), tolerance)
    with asked(threads, None, progress) as limits:
        shapes, names = (first, second), (name_a, name_b)
        return Comparison(_isoform.compare(shapes, names, wanted, limits))


def _side(shape: Any, params: Values) -> tuple[Any, str]:
    """A shape as the compiled half takes it, and its name."""
    if isinstance(shape, (str, os.PathLike)):
        shape = opened(shape)
    if isinstance(shape, Model):
        return (shape._native, shape._given(params)), shape.name
    if isinstance(shape, Implicit):
        return shape._native, shape.name
    if isinstance(shape, Triangles):
        return shape._mesh, "mesh"
    return as_cloud(shape)


def opened(path: Path) -> Model | PointCloud:
    """What a file holds: a program by its ending, else points, or a mesh of them."""
    path = os.fspath(path)
    if path.lower().endswith(".hf"):
        return Model.load(path)
    return read_points(path)
