"""Rational patches on the surfaces of models."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from . import _isoform
from ._call import Progress, asked, whole
from ._document import Documented, Shown
from ._errors import IsoformError
from ._implicitize import Implicit
from ._mesh import _shape
from ._model import Model, Values
from ._points import Path
from ._region import Box, corners


class Patch:
    """A rational patch over the unit square.

    Attributes
    ----------
    control : numpy.ndarray
        (m+1, n+1, 4) float64: homogeneous control points, x, y and z multiplied by the weight.
    bound : float or None
        Proved bound on its distance from the surface; None where none is proved.
    """

    def __init__(self, native: _isoform.Patches, index: int) -> None:
        self._native = native
        self._index = index
        m, n = native.degree(index)
        control = native.control(index).reshape(m + 1, n + 1, 4)
        self.control: npt.NDArray[np.float64] = control
        self.bound: float | None = native.bound(index)

    def evaluate(self, u: npt.ArrayLike, v: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Evaluate the patch.

        Parameters
        ----------
        u, v : array_like
            Parameters in [0, 1]; they are broadcast.

        Returns
        -------
        numpy.ndarray
            (..., 3) float64.
        """
        us, vs = np.broadcast_arrays(np.asarray(u, float), np.asarray(v, float))
        at = np.stack([us.ravel(), vs.ravel()], axis=1)
        return self._native.evaluate(self._index, at).reshape(*us.shape, 3)

    def __repr__(self) -> str:
        m, n = self.control.shape[0] - 1, self.control.shape[1] - 1
        return f"<isoform.Patch of degree ({m}, {n}), bound {self.bound}>"


class Patches(Sequence[Patch], Documented, Shown):
    """Rational patches on one surface, as a sequence."""

    def __init__(self, native: _isoform.Patches) -> None:
        self._native = native
        self._document = native.document
        self._list = [Patch(native, i) for i in range(len(native))]

    @overload
    def __getitem__(self, index: int) -> Patch: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Patch]: ...
    def __getitem__(self, index: int | slice) -> Patch | Sequence[Patch]:
        return self._list[index]

    def __len__(self) -> int:
        return len(self._list)

    def __iter__(self) -> Iterator[Patch]:
        return iter(self._list)

    def save(self, path: Path, units: str | None = None, grid: int = 32) -> None:
        """Write the patches as .json, .step or .stp, else their triangles.

        Parameters
        ----------
        path : str or os.PathLike
            Its ending names the format.
        units : str, optional
            Unit of length that the file states; mm in STEP by default.
        grid : int
            Triangles come from so many squares along each side of a patch.
        """
        self._native.save(os.fspath(path), units, grid)

    def __repr__(self) -> str:
        return f"<isoform.Patches: {len(self)}>"


def parameterize(
    model: Model | Implicit | Mapping[str, str] | Path,
    degree: tuple[int, int] = (3, 3),
    box: Box = 0.5,
    tol: float | None = None,
    cover: bool = False,
    *,
    params: Values = None,
    seed: int = 1,
    seed_point: Sequence[float] | None = None,
    exact: bool = False,
    margin: float | None = None,
    singular: float | None = None,
    most: int = 1000,
    method: str = "gauss-newton",
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Patches:
    """Find rational patches on the surface of a model, with a proved bound on their distance.

    Parameters
    ----------
    model : Model, Implicit, dict or path
        The surface: a model, or a polynomial ``{"F": "x^2 + y^2 + z^2 - 1/4"}``, or a file of one.
    degree : tuple of int
        In u and in v.
    box : float or sequence
        Where surface is wanted: half the width of a box around the origin, or its two corners.
    tol : float, optional
        As large as possible within this distance of the surface, proved.
    cover : bool
        As many patches as it takes until all of the surface in the box lies on one, within tol.
    params : dict or sequence of float, optional
        Values of the model's parameters.
    seed : int
        Of everything random.
    seed_point : sequence of float, optional
        Start at the point of the surface near this one, (x, y, z).
    exact : bool
        Afterwards bring the patch onto the surface to rounding, where its degree admits that.
    margin : float, optional
        With cover: every point of the surface so deep inside of some patch, proved.
    singular : float, optional
        With cover: what is nearer than this to a singular point may be left out.
    most : int
        At most so many patches, with cover.
    method : str
        ``"gauss-newton"``, ``"frozen"`` or ``"newton"``.
    threads : int, optional
        How many to use, by default all cores.
    time_limit : float, optional
        Seconds after which the best so far is taken.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done. True shows a bar.

    Returns
    -------
    Patches
        A sequence; each has ``.control`` (m+1, n+1, 4), ``.bound`` and ``.evaluate(u, v)`` to
        (..., 3), as (n, 3) for n parameters.

    Raises
    ------
    IsoformError
        If there is no patch.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.

    Examples
    --------
    >>> import isoform
    >>> patches = isoform.parameterize({"F": "x^2 + y^2 + z^2 - 1/4"}, (2, 2), tol=1e-3)
    >>> patches[0].control.shape, patches[0].bound <= 1e-3
    ((3, 3, 4), True)
    """
    m, n = (whole("degree", d, 1) for d in degree)
    surface, name = _surface(model, params)
    wanted = {
        "degree": (m, n),
        "region": corners(box),
        "tol": tol,
        "cover": cover,
        "exact": exact,
        "seed": whole("seed", seed),
        "seed_point": None if seed_point is None else [float(v) for v in seed_point],
        "margin": margin,
        "singular": singular,
        "most": whole("most", most, 1),
        "method": method,
    }
    with asked(threads, time_limit, progress) as limits:
        return Patches(_isoform.parameterize(surface, name, wanted, limits))


def _surface(model: Any, params: Values) -> tuple[Any, str]:
    """A surface as the compiled half takes it, and its name."""
    if isinstance(model, (Model, Implicit)):
        return _shape(model, params), model.name
    name = "polynomial"
    if not isinstance(model, Mapping):
        name = os.fspath(model)
        model = read_json(name)
    formula = model.get("F")
    if not isinstance(formula, str):
        raise IsoformError(
            "there is no text under the key F", "key", '{"F": "x^2 + y^2 + z^2 - 1/4"}'
        )
    return formula, name


def read_text(path: str) -> str:
    """A file as text."""
    try:
        return FilePath(path).read_text(encoding="utf-8", errors="replace")
    except OSError as e:
        raise IsoformError(f"cannot read {path}: {e.strerror or e}", "file") from None


def read_json(path: str) -> Mapping[str, Any]:
    """A file of one object."""
    try:
        document = json.loads(read_text(path))
    except json.JSONDecodeError as e:
        raise IsoformError(
            f"{path}:{e.lineno}:{e.colno}: not JSON: {e.msg}", "json", None, e.lineno, e.colno
        ) from None
    if not isinstance(document, Mapping):
        raise IsoformError(f"{path}: an object is expected", "json")
    return document
