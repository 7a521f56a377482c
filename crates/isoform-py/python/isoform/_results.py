"""Results of verbs, except meshes."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from . import _isoform
from ._call import Answer, Progress, asked
from ._document import Documented, Shown
from ._errors import IsoformError
from ._mesh import Triangles
from ._model import Model
from ._points import Path, PointCloud, Points, as_points


class Report(Documented):
    """Document of a verb.

    Attributes
    ----------
    warnings : list of str
        Possible problems.
    native : object
        Result of the compiled half; None without one.
    """

    def __init__(self, answer: Answer) -> None:
        self._document = answer.document
        self.warnings = answer.warnings
        self._native = answer.native

    def __getitem__(self, key: str) -> Any:
        return self.to_dict()[key]

    def __repr__(self) -> str:
        return f"<isoform.Report: {', '.join(self.to_dict())}>"[:200]


class FitResult(Documented, Shown):
    """Template fitted to points.

    Attributes
    ----------
    values, sd, ci95, status : dict
        By parameter: its value, standard deviation (None if the points do not determine it), 95 %
        confidence interval and status, in the unit of the points.
    rms : float
        Root mean square distance of the points used, in their unit.
    verdict : str
        ``"accepted"``, ``"doubtful"`` or ``"refused"``.
    acceptable : bool
        True if the fit is accepted.
    reasons : list of str
        Reasons against acceptance.
    warnings : list of str
        Possible problems.
    deviation : numpy.ndarray
        (n,) float64: signed distance of each point from the model, positive outside.
    points : numpy.ndarray
        (n, 3) float64: fitted points.
    outliers : numpy.ndarray
        (n,) bool: True for points excluded as outliers.
    model : Model
        The template with the fitted values, in the pose of the points.
    """

    def __init__(self, answer: Answer) -> None:
        self._native: _isoform.Fit | None = answer.native
        self._document = answer.document
        self.warnings = answer.warnings
        document = self.to_dict()
        self._name: str = document["template"]["name"]
        rows = document["parameters"]
        self.values: dict[str, float] = {p["name"]: p["value"] for p in rows}
        self.sd: dict[str, float | None] = {p["name"]: p["sd"] for p in rows}
        self.ci95: dict[str, list[float] | None] = {p["name"]: p["ci95"] for p in rows}
        self.status: dict[str, str] = {p["name"]: p["status"] for p in rows}
        self.rms: float = document["rms"]
        self.verdict: str = document["verdict"]
        self.acceptable: bool = document["acceptable"]
        self.reasons: list[str] = document["reasons"]

    @property
    def _here(self) -> _isoform.Fit:
        """The compiled object."""
        assert self._native is not None, "what was sent has been asked before"
        return self._native

    @cached_property
    def deviation(self) -> npt.NDArray[np.float64]:
        """The signed distance of each point from the model, (n,), positive outside."""
        return self._here.deviation()

    @cached_property
    def outliers(self) -> npt.NDArray[np.bool_]:
        """True for each point excluded as an outlier, (n,)."""
        return self._here.outliers()

    @cached_property
    def points(self) -> npt.NDArray[np.float64]:
        """The fitted points, (n, 3)."""
        return self._here.points()

    @cached_property
    def _program(self) -> str:
        """The fitted program."""
        return self._here.program()

    @property
    def model(self) -> Model:
        """The template with the fitted values, in the pose of the points."""
        return Model(self._program, name=self._name)

    def save(
        self, path: Path, *, time_limit: float | None = None, progress: Progress = None
    ) -> None:
        """Write a file of the fit.

        Parameters
        ----------
        path : str or os.PathLike
            Its ending selects the content: .hf the fitted program, .step or .brep.json a solid,
            .py or .scad a program for CAD, .ply, .xyz or .csv the points with their deviations,
            .html a report, .json the document.
        time_limit : float, optional
            Time limit for a solid, in seconds.
        progress : callable or bool, optional
            Called with the name of a phase and its completed share. True shows a bar.

        Raises
        ------
        IsoformError
            If the ending is unknown, or the solid cannot be constructed.
        """
        if self._native is None:
            raise IsoformError("a fit that was sent here is saved where it was made", "usage")
        with asked(None, time_limit, progress) as limits:
            self._native.save(os.fspath(path), limits)

    def to_frame(self) -> Any:
        """Convert the parameters to a table of pandas.

        Returns
        -------
        pandas.DataFrame
            A row for each parameter, with its value, sd, bounds, status and unit.
        """
        from ._optional import need

        pandas = need("pandas")
        return pandas.DataFrame(self.to_dict()["parameters"]).set_index("name")

    def plot(self) -> Any:
        """Draw a histogram of the deviations, with matplotlib.

        Returns
        -------
        matplotlib.figure.Figure
            A histogram; lengths are in the unit of the points.
        """
        from ._optional import need

        figure = need("matplotlib.figure").Figure(figsize=(6, 3.5), layout="constrained")
        axes = figure.subplots()
        axes.hist(self.deviation[~self.outliers], bins=60)
        unit = self.to_dict()["units"]
        axes.set_xlabel("deviation, positive outside" + (f" ({unit})" if unit else ""))
        axes.set_ylabel("points")
        axes.set_title(f"{self.verdict}: rms {self.rms:.4g}")
        return figure

    def _layers(self) -> list[Any]:
        """Return the layers of a page or picture: the points, if held here, and the model."""
        model = self.model
        if self._native is None:
            return [model]
        return [PointCloud(self._native.cloud(), "points"), model]

    def _handed(self) -> tuple[str, Any]:
        """Return the fitted model as a file in memory."""
        return self.model._handed()

    def __getstate__(self) -> dict[str, Any]:
        # The compiled object cannot be pickled; its arrays and program are.
        told = {k: getattr(self, k) for k in ("deviation", "outliers", "points", "_program")}
        return {**self.__dict__, **told, "_native": None}

    def __repr__(self) -> str:
        values = ", ".join(f"{k} {v:.6g}" for k, v in list(self.values.items())[:6])
        return f"<isoform.FitResult {self.verdict}, rms {self.rms:.4g}: {values}>"


class Implicit(Documented, Shown):
    """Implicit function fitted to points, or sampled: f = 0 is the surface, f >= 0 inside.

    `implicitize` and `sample` create it; `mesh`, `parameterize`, `compare` and `view` accept it as
    a model.
    """

    def __init__(self, answer: Answer) -> None:
        self._native: _isoform.Fitted = answer.native
        self._document = answer.document
        self.warnings = answer.warnings
        self.name = "surface"

    def __call__(self, points: Points) -> npt.NDArray[np.float64]:
        """Evaluate the function at points, (n, 3): (n,) values, positive inside."""
        return self._native.values(as_points(points))

    def gradient(self, points: Points) -> npt.NDArray[np.float64]:
        """Evaluate the gradient at points, (n, 3): (n, 3) vectors, pointing inside."""
        return self._native.gradients(as_points(points))

    def metric(self, points: Points) -> npt.NDArray[np.float64]:
        """Compute signed distances to first order at points, (n, 3): (n,), positive inside."""
        return self._native.distances(as_points(points))

    def save(self, path: Path) -> None:
        """Write the function as JSON, which every verb of the program accepts as a model."""
        self._native.save(os.fspath(path))

    def _handed(self) -> tuple[str, Any]:
        """Return the name of the file in memory, and the compiled object."""
        return self.name, self._native

    def __repr__(self) -> str:
        report = self.to_dict()
        name = "rms" if "rms" in report else "accuracy"
        return f"<isoform.Implicit: degree {report['degree']}, {name} {report[name]:.4g}>"


class Patch:
    """Rational patch over the unit square.

    Attributes
    ----------
    control : numpy.ndarray
        (m+1, n+1, 4) float64: homogeneous control points, x, y and z multiplied by the weight.
    bound : float or None
        Proved bound on its distance from the surface; None without a proof.
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
            Parameters in [0, 1], broadcast against each other.

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

    def __init__(self, answer: Answer) -> None:
        self._native: _isoform.Patches = answer.native
        self._document = answer.document
        self.warnings = answer.warnings
        self._list = [Patch(self._native, i) for i in range(len(self._native))]

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
            Unit of length stated in the file; mm in STEP by default.
        grid : int
            Number of squares along each side of a patch, each split into two triangles.
        """
        self._native.save(os.fspath(path), units, grid)

    def _handed(self) -> tuple[str, Any]:
        """Return the name of the file in memory, and the compiled object."""
        return "patches", self._native

    def __repr__(self) -> str:
        return f"<isoform.Patches: {len(self)}>"


class Triangulation(Triangles, Documented):
    """Triangulated rational surface, with its verified properties.

    Attributes
    ----------
    points : numpy.ndarray
        (n, 3) float64.
    triangles : numpy.ndarray
        (m, 3) uint32.
    parameters : numpy.ndarray
        (n, 2) float64: s and t of each point; infinite ones are inf or NaN.
    report : dict
        Analysis of the surface: the document of ``isoform triangulate --report``.
    """

    def __init__(self, answer: Answer) -> None:
        native: _isoform.Triangulation = answer.native
        super().__init__(native.mesh())
        self._native = native
        self._document = answer.document
        self.warnings = answer.warnings
        self.parameters: npt.NDArray[np.float64] = native.parameters()
        self.report: dict[str, Any] = json.loads(native.report)

    @property
    def _map(self) -> _isoform.Triangulation:
        """The compiled object with the map, which pages display."""
        return self._native

    def __repr__(self) -> str:
        counts = f"{len(self.points)} points, {len(self.triangles)} triangles"
        return f"<isoform.Triangulation: {counts}>"


class Recognition(Documented):
    """Geometric entities recognised in a scan.

    Attributes
    ----------
    entities : list of dict
        Each with ``type``, ``parameters``, ``sd``, ``n_points`` and ``rms``; of labels given by
        hand also ``label``, and ``explained``, False if it does not explain its points.
    faces : list of dict
        Connected pieces of the entities, each with ``entity``, ``n_points`` and ``beside``, the
        indices of adjacent faces.
    labels : numpy.ndarray
        (n,) int64: the index of the entity of each point, -1 for none.
    face_labels : numpy.ndarray
        (n,) int64: the index of the face of each point, -1 for none.
    points : numpy.ndarray
        (n, 3) float64: the examined points, including those added on the faces of a CAD mesh.
    """

    def __init__(self, answer: Answer) -> None:
        native: _isoform.Entities = answer.native
        self._native = native
        self._document = answer.document
        self.warnings = answer.warnings
        self.entities: list[dict[str, Any]] = self.to_dict()["entities"]
        self.faces: list[dict[str, Any]] = self.to_dict()["faces"]
        self.labels: npt.NDArray[np.int64] = native.labels()
        self.face_labels: npt.NDArray[np.int64] = native.face_labels()
        self.points: npt.NDArray[np.float64] = native.points()

    def template(self, title: str = "Proposed") -> Model:
        """Propose a model of the entities, as a template for `fit`.

        Parameters
        ----------
        title : str
            Title of the model.

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


class Brep(Documented, Shown):
    """Solids of exact faces, with a certificate.

    Attributes
    ----------
    volume, area : float
        Volume and surface area, in cubic and square units of the model.
    faces : list of dict
        Each with ``part``, ``kind``, ``area`` and ``max_distance``.
    certificate : dict
        Verified properties.
    """

    def __init__(self, answer: Answer) -> None:
        self._native: _isoform.Solids = answer.native
        self._document = answer.document
        self.warnings = answer.warnings
        told = self.to_dict()
        self.volume: float = told["volume"]
        self.area: float = told["area"]
        self.faces: list[dict[str, Any]] = told["faces"]
        self.certificate: dict[str, Any] = told["certificate"]

    def save(self, path: Path, units: str | None = None, ap214: bool = False) -> None:
        """Write a STEP file, or the lossless native form if the name ends in .brep.json.

        Parameters
        ----------
        path : str or os.PathLike
            The file.
        units : str, optional
            Unit of length stated in the file; by default as annotated, else mm.
        ap214 : bool
            True for the older AP214 instead of AP242.
        """
        self._native.save(os.fspath(path), units, ap214)

    def _handed(self) -> tuple[str, Any]:
        """Return the name of the file in memory, and the compiled object."""
        return "solid", self._native

    def __repr__(self) -> str:
        return f"<isoform.Brep: {len(self.faces)} faces, volume {self.volume:.6g}>"


class Comparison(Documented):
    """Distances between two shapes in both directions.

    Attributes
    ----------
    first_to_second, second_to_first : dict
        ``rms``, ``mean``, ``p95``, ``max``, ``samples`` and ``undefined``; lengths are in the unit
        of the shapes.
    faces : list of dict
        The same of the first shape from each ``face`` of the second, a solid or the parts of a
        model, with ``within_tolerance``: None without a tolerance or without points.
    within_tolerance : bool
        True if no distance exceeds the tolerance, if one was given.
    """

    def __init__(self, answer: Answer) -> None:
        self._document = answer.document
        self.warnings = answer.warnings
        told = self.to_dict()
        self.first_to_second: dict[str, Any] = told["first_to_second"]
        self.second_to_first: dict[str, Any] = told["second_to_first"]
        self.faces: list[dict[str, Any]] = told["faces"]
        self.within_tolerance: bool = told["within_tolerance"]

    def __repr__(self) -> str:
        there, back = self.first_to_second["max"], self.second_to_first["max"]
        return f"<isoform.Comparison: at most {there} there, {back} back>"


class View:
    """Interactive page of shapes, which notebooks display.

    Attributes
    ----------
    warnings : list of str
        Possible problems.
    height : int
        Height of the frame in a notebook, in pixels.
    """

    warnings: list[str] = []

    def __init__(self, page: bytes) -> None:
        self._page = page.decode()
        self.height = 560

    def save(self, path: Path) -> None:
        """Write the page as one self-contained file."""
        _write(path, self._page.encode())

    def _repr_html_(self) -> str:
        page = html.escape(self._page, quote=True)
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe srcdoc="{page}" style="{style}" sandbox="allow-scripts"></iframe>'

    def __repr__(self) -> str:
        return f"<isoform.View: {len(self._page)} bytes>"


class Picture:
    """Picture as the bytes of a file, which notebooks display.

    Attributes
    ----------
    data : bytes
        Content of the file: PNG or SVG.
    warnings : list of str
        Possible problems.
    """

    warnings: list[str] = []

    def __init__(self, data: bytes) -> None:
        self.data = data
        self._svg = not data.startswith(b"\x89PNG")

    def save(self, path: Path) -> None:
        """Write the file, whose ending must match the format: .png or .svg."""
        ending = ".svg" if self._svg else ".png"
        if not os.fspath(path).lower().endswith(ending):
            raise IsoformError(f"{path}: this picture is written as {ending}", "usage")
        _write(path, self.data)

    def _repr_png_(self) -> bytes | None:
        return None if self._svg else self.data

    def _repr_svg_(self) -> str | None:
        return self.data.decode() if self._svg else None

    def __repr__(self) -> str:
        return f"<isoform.Picture: {'SVG' if self._svg else 'PNG'}, {len(self.data)} bytes>"


def _write(path: Path, content: bytes) -> None:
    """Write a file."""
    try:
        FilePath(path).write_bytes(content)
    except OSError as e:
        raise IsoformError(f"cannot write {path}: {e.strerror or e}", "not-writable") from None
