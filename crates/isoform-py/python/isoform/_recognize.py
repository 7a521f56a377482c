"""Planes, spheres, cylinders, cones and tori of scans."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _isoform
from ._call import Progress, asked, whole
from ._document import Documented
from ._model import Model
from ._points import Points, as_cloud


class Recognition(Documented):
    """What a scan consists of.

    Attributes
    ----------
    entities : list of dict
        Each with ``type``, ``parameters``, ``sd``, ``n_points`` and ``rms``.
    faces : list of dict
        Connected pieces of the entities, each with ``entity``, ``n_points`` and ``beside``: the
        indices of the faces at its boundary.
    labels : numpy.ndarray
        (n,) int64: the index of the entity of each point, -1 for none.
    face_labels : numpy.ndarray
        (n,) int64: the index of the face of each point, -1 for none.
    points : numpy.ndarray
        (n, 3) float64: the points that were looked at, further ones on the faces of a CAD mesh
        included.
    """

    def __init__(self, native: _isoform.Entities) -> None:
        self._native = native
        self._document = native.document
        self.entities: list[dict[str, Any]] = self.to_dict()["entities"]
        self.faces: list[dict[str, Any]] = self.to_dict()["faces"]
        self.labels: npt.NDArray[np.int64] = native.labels()
        self.face_labels: npt.NDArray[np.int64] = native.face_labels()
        self.points: npt.NDArray[np.float64] = native.points()

    def template(self, title: str = "Proposed") -> Model:
        """Propose a model of the entities, for `fit` to polish.

        Parameters
        ----------
        title : str
            Its title.

        Returns
        -------
        Model
            A program whose parameters are the dimensions.
        """
        program, _ = self._native.template(title)
        return Model(program, name="proposal")

    def __repr__(self) -> str:
        kinds = [e["type"] for e in self.entities]
        counts = ", ".join(f"{kinds.count(k)} {k}" for k in dict.fromkeys(kinds))
        return f"<isoform.Recognition: {counts or 'nothing'}>"


def recognize(
    points: Points,
    tol: float | None = None,
    min_points: int | None = None,
    snap: bool = False,
    *,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Recognition:
    """Find the planes, spheres, cylinders, cones and tori that a scan consists of.

    Parameters
    ----------
    points : array_like or PointCloud
        (n, 3); of a mesh its triangles are looked at, too.
    tol : float, optional
        How far points lie from their surface: the standard deviation; by default as they show.
    min_points : int, optional
        Minimum number of points of an entity, by default as many as are evidence of it.
    snap : bool
        Refit all entities together so that their relations hold exactly.
    threads : int, optional
        How many to use, by default all cores.
    time_limit : float, optional
        Seconds after which the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done. True shows a bar.

    Returns
    -------
    Recognition
        Entities with standard deviations; ``.labels`` is (n,).

    Raises
    ------
    IsoformError
        If there are too few points, or they lie on one line.
    """
    cloud, _ = as_cloud(points)
    if min_points is not None:
        min_points = whole("min_points", min_points)
    with asked(threads, time_limit, progress) as limits:
        return Recognition(_isoform.recognize(cloud, tol, min_points, bool(snap), limits))
