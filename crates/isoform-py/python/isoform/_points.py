"""Clouds of points from files and arrays."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Protocol, Union

import numpy as np
import numpy.typing as npt

from . import _isoform
from ._errors import IsoformError

#: Types accepted as a path.
Path = Union[str, "os.PathLike[str]"]
#: Types accepted as points.
Points = Union["PointCloud", npt.NDArray[Any], Sequence[Sequence[float]], "HasArray"]


class HasArray(Protocol):
    """Object that numpy converts to an array, such as a table of pandas or a tensor."""

    def __array__(self) -> Any: ...



def as_points(points: Any) -> npt.NDArray[np.float64]:
    """Convert points to an array (n, 3) of float64, without a copy if possible."""
    if isinstance(points, PointCloud):
        return points.points
    array = np.asarray(points)
    if array.dtype != np.float64 or not array.dtype.isnative:
        if array.dtype.kind not in "biuf" and array.size:
            raise TypeError(f"points: numbers are expected, not {_kind(points, array)}")
        array = array.astype(np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise IsoformError(
            f"points are (n, 3), not {array.shape}", "shape", "an array of rows x, y, z"
        )
    return array


def _kind(points: Any, array: npt.NDArray[Any]) -> str:
    """Describe an argument that was given as points."""
    return type(points).__name__ if array.ndim == 0 else f"an array of {array.dtype}"


class PointCloud:
    """Points of a file, with their attributes.

    `read_points` creates it. Every function of the package accepts it in place of an array, and
    `numpy.asarray` returns its points.

    Attributes
    ----------
    points : numpy.ndarray
        The points, (n, 3), float64, in the coordinates and the unit of the file.
    normals : numpy.ndarray or None
        Unit normals, (n, 3), float64.
    colors : numpy.ndarray or None
        Red, green and blue, (n, 3), uint8.
    triangles : numpy.ndarray or None
        Corners of triangles between the points, (m, 3), uint32; None if the file is not a mesh.
    columns : dict
        Further values of each point, (n,), by name.
    unit : str or None
        Unit of length stated by the file: ``"mm"``, ``"m"``, ...
    format : str
        The format of the file.
    warnings : list of str
        Warnings about the file.
    """

    def __init__(self, native: _isoform.Cloud, name: str = "") -> None:
        self._native = native
        self.name = name
        self.unit, self.format, self.warnings = native.about
        self.points: npt.NDArray[np.float64] = native.points()
        self.normals: npt.NDArray[np.float64] | None = native.normals()
        self.colors: npt.NDArray[np.uint8] | None = native.colors()
        self.triangles: npt.NDArray[np.uint32] | None = native.triangles()
        self.columns: dict[str, npt.NDArray[np.float64]] = {
            k: np.array(v) for k, v in native.columns()
        }
        # Computations use the compiled copy, which changes here would not reach.
        self.points.setflags(write=False)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        array = np.asarray(self.points, dtype=dtype)
        return array.copy() if copy else array

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        unit = f" in {self.unit}" if self.unit else ""
        return f"<isoform.PointCloud {self.name!r}: {len(self)} points{unit}>"


def read_points(
    path: Path, format: str | None = None, max_points: int | None = None, seed: int = 1
) -> PointCloud:
    """Read points from a file; of a mesh the vertices.

    Parameters
    ----------
    path : str or os.PathLike
        PLY, XYZ, CSV, OBJ, OFF, STL, 3MF, PCD, LAS, LAZ or E57.
    format : str, optional
        The format, if neither name nor content reveal it.
    max_points : int, optional
        Maximum number of points; larger files are sampled at random.
    seed : int
        Random seed of the sample.

    Returns
    -------
    PointCloud
        With ``.points``, (n, 3) float64 in the unit of the file, ``.normals``, ``.colors`` and
        ``.unit``, each None if the file lacks it.

    Raises
    ------
    IsoformError
        If the file is missing or cannot be read; with line and column in texts.

    Examples
    --------
    >>> import isoform, pathlib, tempfile
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "two.xyz"
    >>> _ = path.write_text("0 0 0\\n1 2 3\\n")
    >>> isoform.read_points(path).points
    array([[0., 0., 0.],
           [1., 2., 3.]])
    """
    from ._call import whole

    if max_points is not None:
        max_points = whole("max_points", max_points, 1)
    native = _isoform.read_points(os.fspath(path), format, max_points, whole("seed", seed))
    return PointCloud(native, os.fspath(path))
