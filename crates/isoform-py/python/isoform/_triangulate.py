"""Triangles of rational surfaces."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _isoform
from ._call import Progress, asked, whole
from ._document import Documented
from ._errors import IsoformError
from ._mesh import Triangles
from ._parameterize import read_text
from ._points import Path

#: A number that is taken exactly: 0.1 is a tenth, and so are "1/10" and Fraction(1, 10).
Exact = Union[int, float, str, Fraction]


class Triangulation(Triangles, Documented):
    """Triangles of a rational surface, with what is proved of them.

    Attributes
    ----------
    points : numpy.ndarray
        (n, 3) float64.
    triangles : numpy.ndarray
        (m, 3) uint32.
    parameters : numpy.ndarray
        (n, 2) float64: s and t of each point; infinite ones are inf or NaN.
    report : dict
        What is known of the surface: the document of ``isoform triangulate --report``.
    """

    def __init__(self, native: _isoform.Triangulation) -> None:
        super().__init__(native.mesh())
        self._native = native
        self._document, report = native.documents()
        self.parameters: npt.NDArray[np.float64] = native.parameters()
        self.report: dict[str, Any] = json.loads(report)

    def __repr__(self) -> str:
        counts = f"{len(self.points)} points, {len(self.triangles)} triangles"
        return f"<isoform.Triangulation: {counts}>"


def triangulate(
    map: Mapping[str, str] | Path,
    box: Exact | None = None,
    tol: float | None = None,
    *,
    rectangle: Sequence[Exact] | None = None,
    polygon: Sequence[Sequence[Exact]] | None = None,
    longest: float | None = None,
    triangles: int | None = None,
    mode: str | None = None,
    reduce: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Triangulation:
    """Triangulate a rational surface in a box; what is proved of it is said.

    Parameters
    ----------
    map : dict or path
        ``{"X": "2*s", "Y": "2*t", "Z": "s^2 + t^2 - 1", "W": "s^2 + t^2 + 1"}``: polynomials in s
        and t with rational coefficients; or a file of them, or of patches.
    box : int, float, str or fractions.Fraction, optional
        Half the width of the box around the origin, taken exactly as written; patches and regions
        without poles need none.
    tol : float, optional
        Largest distance of the middles of triangles and edges from the surface.
    rectangle : sequence, optional
        Draw only parameters with s0 <= s <= s1 and t0 <= t <= t1: (s0, s1, t0, t1).
    polygon : sequence, optional
        Draw only parameters in a polygon with these corners, (n, 2).
    longest : float, optional
        Largest length of edges.
    triangles : int, optional
        Stop refining at about so many triangles.
    mode : str, optional
        ``"glued"`` (sheets that cross are joined) or ``"normalised"``.
    reduce : bool
        Divide X, Y, Z and W by their common factor instead of refusing the map.
    threads : int, optional
        How many to use, by default all cores.
    time_limit : float, optional
        Seconds; exact computations take some 60 % of them at most.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done. True shows a bar.

    Returns
    -------
    Triangulation
        With ``.points`` (n, 3), ``.triangles`` (m, 3) and ``.parameters`` (n, 2).

    Raises
    ------
    IsoformError
        If the map is none, or has no triangle in the box.

    Examples
    --------
    >>> import isoform
    >>> sphere = {"X": "2*s", "Y": "2*t", "Z": "s^2 + t^2 - 1", "W": "s^2 + t^2 + 1"}
    >>> isoform.triangulate(sphere, box=2, tol=0.01).to_dict()["ok"]
    True
    """
    if isinstance(map, Mapping):
        text, name = json.dumps(dict(map)), "map"
    else:
        name = os.fspath(map)
        text = read_text(name)
    wanted = {
        "half_width": None if box is None else _exact(box),
        "corners": _corners(rectangle, polygon),
        "tol": tol,
        "longest": longest,
        "triangles": None if triangles is None else whole("triangles", triangles, 1),
        "mode": mode,
        "reduce": reduce,
    }
    with asked(threads, time_limit, progress) as limits:
        return Triangulation(_isoform.triangulate(text, name, wanted, limits))


def _exact(number: Exact) -> str:
    """A number as it is written."""
    return repr(float(number)) if isinstance(number, float) else str(number)


def _corners(
    rectangle: Sequence[Exact] | None, polygon: Sequence[Sequence[Exact]] | None
) -> list[list[str]]:
    """Corners of the region: two of a rectangle, or all of a polygon."""
    if rectangle is not None:
        if polygon is not None or len(rectangle) != 4:
            raise IsoformError("rectangle: s0, s1, t0, t1 are expected, and no polygon")
        s0, s1, t0, t1 = (_exact(v) for v in rectangle)
        return [[s0, t0], [s1, t1]]
    corners = [[_exact(v) for v in corner] for corner in polygon or ()]
    if polygon is not None and len(corners) < 3:
        raise IsoformError("polygon: three corners are needed")
    return corners
