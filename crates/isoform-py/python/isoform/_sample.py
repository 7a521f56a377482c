"""Functions of Python as shapes."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _isoform
from ._call import Answer, Progress, asked, corners
from ._errors import IsoformError
from ._results import Implicit


def sample(
    function: Callable[[npt.NDArray[np.float64]], npt.ArrayLike],
    box: Any,
    *,
    accuracy: float | None = None,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Implicit:
    """Sample a function of Python: the result is a model for `mesh`, `compare`, `view`.

    It is a spline of degree 2 with continuous gradient, refined where it is far from the function.
    What is proved of its mesh holds for the spline; that the spline is near the function is tested
    at eight points of each cell.

    Parameters
    ----------
    function : callable
        Maps points, (n, 3), to values, (n,), positive inside. It is called with thousands of points
        at a time, some of them outside of the box.
    box : float or pair of points
        Region: half its width, or ((x, y, z), (x, y, z)). A sixteenth of its longest side is added
        all around, so that meshes may end at its sides; outside of it the result falls with the
        distance.
    accuracy : float, optional
        Largest error where the function is 0, in its units; a thousandth of the box's diagonal by
        default. Elsewhere a twentieth of the value is added.
    threads : int, optional
        Number of threads; all cores by default. Python runs the function in one at a time.
    time_limit : float, optional
        Seconds after which the call fails.
    progress : callable or bool, optional
        Called with the phase and its completed share; True prints a line.

    Returns
    -------
    Implicit
        The spline.

    Raises
    ------
    IsoformError
        If the function is not a number at a point, or the accuracy needs too many cells.

    Examples
    --------
    >>> import isoform, numpy as np
    >>> def ball(p):
    ...     return 1 - np.linalg.norm(p, axis=1)
    >>> mesh = isoform.mesh(isoform.sample(ball, 1.5), size=0.2, surface_only=True)
    >>> abs(mesh.volume - 4 * np.pi / 3) < 0.1
    True
    """
    numbers = corners(box)
    if numbers is None:
        raise IsoformError("no box", "usage", "half its width, or ((x, y, z), (x, y, z))")
    lower, upper = numbers[:3], numbers[3:]

    def values(points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return np.ascontiguousarray(function(points), dtype=np.float64).reshape(-1)

    with asked(threads, time_limit, progress) as limits:
        native, used, unknowns = _isoform.sample(values, [lower, upper], accuracy, limits)
    told = {"degree": 2, "accuracy": used, "unknowns": unknowns}
    return Implicit(Answer(json.dumps(told), [], native))
