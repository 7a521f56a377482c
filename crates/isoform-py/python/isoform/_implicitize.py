"""Smooth functions through points."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _isoform
from ._call import Progress, asked, whole
from ._document import Documented, Shown
from ._points import Path, Points, as_cloud, as_points


class Implicit(Documented, Shown):
    """A function of space that was fitted to points: f = 0 is their surface, f >= 0 inside.

    `implicitize` makes it; `mesh`, `parameterize`, `compare` and `view` take it as a model.
    """

    def __init__(self, native: _isoform.Fitted) -> None:
        self._native = native
        self._document = native.document
        self.name = "surface"

    def __call__(self, points: Points) -> npt.NDArray[np.float64]:
        """Evaluate the function at points, (n, 3); (n,) values, positive inside."""
        return self._native.values(as_points(points))

    def gradient(self, points: Points) -> npt.NDArray[np.float64]:
        """Evaluate the gradient at points, (n, 3); (n, 3), pointing inside."""
        return self._native.gradients(as_points(points))

    def metric(self, points: Points) -> npt.NDArray[np.float64]:
        """Measure signed distances to first order at points, (n, 3); (n,), positive inside."""
        return self._native.distances(as_points(points))

    def save(self, path: Path) -> None:
        """Write the function as JSON, which every verb of the program takes as a model."""
        self._native.save(os.fspath(path))

    def __repr__(self) -> str:
        report = self.to_dict()
        return f"<isoform.Implicit: degree {report['degree']}, rms {report['rms']:.4g}>"


def implicitize(
    points: Points,
    degree: int = 3,
    tol: float | None = None,
    cells: int | None = None,
    *,
    polynomial: int | None = None,
    normals: str = "auto",
    smoothing: float | None = None,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Implicit:
    """Fit a smooth function to points, without a template.

    Parameters
    ----------
    points : array_like or PointCloud
        (n, 3); the normals and triangles of a cloud are taken.
    degree : int
        Of the spline in each variable, 2 to 5.
    tol : float, optional
        Smaller cells where points are farther than this from the surface.
    cells : int, optional
        At most this many cells hold points, all of one size; no more than half the points.
    polynomial : int, optional
        One polynomial of at most this total degree in the place of a spline.
    normals : str
        ``"auto"``, ``"given"`` or ``"estimate"``.
    smoothing : float, optional
        The weight of smoothness.
    threads : int, optional
        How many to use, by default all cores.
    time_limit : float, optional
        Seconds after which the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done. True shows a bar.

    Returns
    -------
    Implicit
        A function of points (n, 3), positive inside.

    Raises
    ------
    IsoformError
        If the points have no surface.
    """
    cloud, _ = as_cloud(points)
    wanted = {
        "degree": whole("degree", degree, 1),
        "cells": None if cells is None else whole("cells", cells, 1),
        "tol": tol,
        "polynomial": None if polynomial is None else whole("polynomial", polynomial, 1),
        "normals": normals,
        "smoothing": smoothing,
    }
    with asked(threads, time_limit, progress) as limits:
        return Implicit(_isoform.implicitize(cloud, wanted, limits))
