"""Meshes: labelled surfaces and tetrahedra, with a certificate."""

from __future__ import annotations

import math
import os
import warnings
from functools import cached_property
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from . import _isoform
from ._call import Progress, asked, whole
from ._document import Documented, Shown
from ._errors import IsoformError
from ._implicitize import Implicit
from ._model import Model, Values
from ._optional import need
from ._points import Path
from ._region import Box, corners

Region: TypeAlias = Model | tuple[Model, Values]


class Triangles(Shown):
    """What has nodes and triangles, and goes to files.

    Attributes
    ----------
    points : numpy.ndarray
        (n, 3) float64.
    triangles : numpy.ndarray
        (m, 3) uint32, or (m, 6) with nodes in the middles of edges; counterclockwise from outside.
    triangle_parts : numpy.ndarray
        (m,) uint32: which of ``part_names`` each triangle is of.
    part_names : list of str
        Names of the parts of the surface.
    """

    def __init__(self, native: _isoform.MeshData) -> None:
        self._mesh = native
        self.part_names, self.region_names, self.curve_names = native.names

    @cached_property
    def points(self) -> npt.NDArray[np.float64]:
        """The nodes, (n, 3)."""
        return _kept(self._mesh.points())

    @cached_property
    def triangles(self) -> npt.NDArray[np.uint32]:
        """The nodes of the triangles, (m, 3) or (m, 6)."""
        return _kept(self._mesh.triangles())

    @cached_property
    def triangle_parts(self) -> npt.NDArray[np.uint32]:
        """The part of each triangle, (m,)."""
        return _kept(self._mesh.triangle_parts())

    def save(self, path: Path, format: str | None = None) -> None:
        """Write a file.

        Parameters
        ----------
        path : str or os.PathLike
            Its ending names the format: .msh, .vtu, .inp, .obj, .ply, .stl, .glb, ...
        format : str, optional
            The format, where the ending does not tell it.

        Raises
        ------
        IsoformError
            If it cannot be written, or there is no such format.
        """
        for warning in self._mesh.save(os.fspath(path), format):
            warnings.warn(f"{os.fspath(path)}: {warning}", stacklevel=2)

    def to_trimesh(self) -> Any:
        """Give the surface as a mesh of trimesh.

        Returns
        -------
        trimesh.Trimesh
            The triangles by their corners, quadrilaterals as two; nodes that no triangle has are
            left out.
        """
        trimesh = need("trimesh")
        flat = self._simplices().triangles[:, :3].astype(np.int64)
        used, faces = np.unique(flat, return_inverse=True)
        return trimesh.Trimesh(self.points[used], faces.reshape(-1, 3), process=False)

    def to_meshio(self) -> Any:
        """Give all elements as a mesh of meshio, with the numbers of parts and regions.

        Returns
        -------
        meshio.Mesh
            The same nodes; ``cell_data["part"]`` counts as ``part_names`` do.
        """
        meshio = need("meshio")
        cells, data = self._cells()
        return meshio.Mesh(self.points, cells, cell_data={"part": data})

    def to_pyvista(self) -> Any:
        """Give all elements as a grid of PyVista.

        Returns
        -------
        pyvista.UnstructuredGrid
            The same nodes; ``cell_data["part"]`` counts as ``part_names`` do.
        """
        pyvista = need("pyvista")
        kinds = {"triangle": 5, "triangle6": 22, "quad": 9, "tetra": 10, "tetra10": 24, "wedge": 13}
        cells, data = self._cells()
        rows = [np.insert(nodes, 0, nodes.shape[1], axis=1).ravel() for _, nodes in cells]
        types = [np.full(len(nodes), kinds[kind], np.uint8) for kind, nodes in cells]
        grid = pyvista.UnstructuredGrid(
            np.concatenate(rows), np.concatenate(types), self.points.copy()
        )
        grid.cell_data["part"] = np.concatenate(data)
        return grid

    def _simplices(self) -> Triangles:
        """The same mesh of triangles and tetrahedra alone."""
        return self

    def _cells(self) -> tuple[list[tuple[str, npt.NDArray[Any]]], list[npt.NDArray[Any]]]:
        """Elements by kind, and the part or region of each."""
        triangles = self.triangles.astype(np.int64)
        kind = "triangle6" if triangles.shape[1] == 6 else "triangle"
        parts = self.triangle_parts if len(self.triangle_parts) else np.zeros(len(triangles))
        return [(kind, triangles)], [parts.astype(np.int64)]


def _kept(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """An array that shows what is saved, and is not to be changed."""
    array.setflags(write=False)
    return array


class Mesh(Triangles, Documented):
    """The mesh of a model: nodes, labelled triangles of its surface, tetrahedra, a certificate.

    Attributes
    ----------
    points : numpy.ndarray
        (n, 3) float64, in the model's unit.
    triangles : numpy.ndarray
        (m, 3) uint32, or (m, 6) of order 2; counterclockwise from outside.
    tetrahedra : numpy.ndarray
        (k, 4) uint32, or (k, 10) of order 2; of positive volume.
    wedges : numpy.ndarray
        (w, 6) uint32, of boundary layers: the three nodes nearer to the surface, then those over
        them; of positive volume.
    quads : numpy.ndarray
        (q, 4) uint32: quadrilaterals of the surface, where layers end; counterclockwise from
        outside.
    triangle_parts : numpy.ndarray
        (m,) uint32: which of ``part_names`` each triangle is of.
    quad_parts : numpy.ndarray
        (q,) uint32: which of ``part_names`` each quadrilateral is of.
    part_names : list of str
        Names of the parts of the surface.
    regions : numpy.ndarray
        (k,) uint32: which of ``region_names`` each tetrahedron is of.
    opposite : dict of numpy.ndarray
        Of a unit cell, (n, 2) uint32 for each axis along which it repeats, as ``"x"``: the nodes
        on its lower side, and those at the same places on the upper one.
    certificate : dict
        What is proved of the mesh.
    """

    def __init__(self, native: _isoform.MeshData) -> None:
        super().__init__(native)
        self._document = native.document
        self.certificate: dict[str, Any] = self.to_dict().get("certificate", {})

    @cached_property
    def tetrahedra(self) -> npt.NDArray[np.uint32]:
        """The nodes of the tetrahedra, (k, 4) or (k, 10)."""
        return _kept(self._mesh.tetrahedra())

    @cached_property
    def wedges(self) -> npt.NDArray[np.uint32]:
        """The nodes of the wedges of boundary layers, (w, 6)."""
        return _kept(self._mesh.wedges())

    @cached_property
    def quads(self) -> npt.NDArray[np.uint32]:
        """The nodes of the quadrilaterals where layers end, (q, 4)."""
        return _kept(self._mesh.quads())

    @cached_property
    def quad_parts(self) -> npt.NDArray[np.uint32]:
        """The part of each quadrilateral, (q,)."""
        return _kept(self._mesh.quad_parts())

    @cached_property
    def regions(self) -> npt.NDArray[np.uint32]:
        """The region of each tetrahedron, (k,)."""
        return _kept(self._mesh.regions())

    @cached_property
    def opposite(self) -> dict[str, npt.NDArray[np.uint32]]:
        """The nodes on opposite sides of a unit cell by axis, (n, 2) each."""
        return {"xyz"[axis]: _kept(nodes) for axis, nodes in self._mesh.opposite()}

    def to_skfem(self) -> Any:
        """Give the tetrahedra as a mesh of scikit-fem, with its boundaries named.

        Returns
        -------
        skfem.MeshTet
            Nodes as columns, boundaries by the names of the parts. A wedge is three tetrahedra.
        """
        skfem = need("skfem")
        flat = self._simplices()
        corners = np.ascontiguousarray(flat.tetrahedra[:, :4].T, np.int64)
        made = skfem.MeshTet(np.ascontiguousarray(self.points.T), corners)
        facets = {tuple(f): i for i, f in enumerate(np.sort(made.facets, axis=0).T.tolist())}
        faces = [facets[tuple(t)] for t in np.sort(flat.triangles[:, :3], axis=1).tolist()]
        numbers = np.array(faces, dtype=np.int64)
        named = {
            name: numbers[flat.triangle_parts == i] for i, name in enumerate(self.part_names)
        }
        return made.with_boundaries(named)

    def _simplices(self) -> Mesh:
        if not len(self.wedges) and not len(self.quads):
            return self
        return Mesh(self._mesh.simplices())

    def _cells(self) -> tuple[list[tuple[str, npt.NDArray[Any]]], list[npt.NDArray[Any]]]:
        cells, data = super()._cells()
        if len(self.quads):
            cells.append(("quad", self.quads.astype(np.int64)))
            data.append(self.quad_parts.astype(np.int64))
        if len(self.wedges):
            cells.insert(0, ("wedge", self.wedges.astype(np.int64)))
            data.insert(0, np.zeros(len(self.wedges), np.int64))
        tetrahedra = self.tetrahedra.astype(np.int64)
        if len(tetrahedra):
            kind = "tetra10" if tetrahedra.shape[1] == 10 else "tetra"
            cells.insert(0, (kind, tetrahedra))
            data.insert(0, self.regions.astype(np.int64))
        return cells, data

    def __repr__(self) -> str:
        counts = f"{len(self.points)} nodes, {len(self.triangles)} triangles"
        wedges = f", {len(self.wedges)} wedges" if len(self.wedges) else ""
        return f"<isoform.Mesh: {counts}, {len(self.tetrahedra)} tetrahedra{wedges}>"


def mesh(
    model: Model | Implicit,
    size: float | None = None,
    order: int = 1,
    surface_only: bool = False,
    threads: int | None = None,
    *,
    params: Values = None,
    regions: Mapping[str, Region] | None = None,
    box: Box = None,
    periodic: str | None = None,
    layers: str | Sequence[str] | None = None,
    first: float | None = None,
    growth: float = 1.2,
    layer_count: int = 5,
    grade: float | None = None,
    angles: tuple[float, float] | None = None,
    memory: float | None = None,
    close: bool = False,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Mesh:
    """Mesh a model: tetrahedra with their labelled surface, and a certificate.

    Parameters
    ----------
    model : Model or Implicit
        What to mesh.
    size : float, optional
        Length of edges in the model's unit, the largest one where sizes vary; by default a
        fortieth of the diagonal.
    order : int
        2 for elements with nodes in the middles of their edges, on the true surface.
    surface_only : bool
        Only the surface, as triangles.
    threads : int, optional
        How many to use, by default all cores. The result does not depend on it.
    params : dict or sequence of float, optional
        Values of the model's parameters by name, or in their order.
    regions : dict of Model, optional
        Mesh in regions with common nodes: each name takes what of the model lies in its own model
        and in none before it; what is left is called ``rest``. A model with values for its
        parameters is a tuple of both. Triangles between regions belong to parts called ``a|b``.
    box : float or sequence, optional
        Mesh what lies in it: half the width of a box around the origin, or its two corners.
    periodic : str, optional
        The axes along which the box is a unit cell, as ``"xyz"``: opposite sides have one and the
        same triangles, node for node. The function in the box must fit to itself there.
    layers : str or sequence of str, optional
        Grow layers of wedges inward from these parts of the surface, for flow near walls: their
        names, in which ``*`` stands for any characters, as ``"wall*"``.
    first : float, optional
        Thickness of the layer on the surface; ``layers`` need it.
    growth : float
        How many times as thick as the one before each layer is.
    layer_count : int
        How many layers there are.
    grade : float, optional
        Smaller edges where a face would leave the surface by more than this length.
    angles : tuple of float, optional
        Bounds of dihedral angles, degrees: worked towards, and required in the certificate.
    memory : float, optional
        Refuse a mesh that takes more than this many GiB, by estimate; by default 16, or what the
        machine has.
    close : bool
        Of a function fitted to points, keep the surface where there are no points.
    time_limit : float, optional
        Seconds after which the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done. True shows a bar.

    Returns
    -------
    Mesh
        With ``.points`` (n, 3), ``.triangles`` (m, 3), ``.tetrahedra`` (k, 4); with layers also
        ``.wedges`` (w, 6) and ``.quads`` (q, 4).

    Raises
    ------
    IsoformError
        If there is no mesh.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.

    Examples
    --------
    >>> import isoform
    >>> ball = isoform.mesh(isoform.template("sphere"), size=0.3, params={"radius": 1})
    >>> ball.certificate["ok"], round(ball.certificate["volume"])
    (True, 4)

    Regions are objects of a program, or models of their own.

    >>> core = isoform.template("sphere"), {"radius": 0.5}
    >>> ball = isoform.template("sphere")
    >>> ball = isoform.mesh(ball, 0.3, params={"radius": 1}, regions={"core": core})
    >>> ball.region_names, [r["certificate"]["ok"] for r in ball.to_dict()["region_certificates"]]
    (['core', 'rest'], [True, True])

    A unit cell has the same nodes on opposite sides.

    >>> bars = "bars(x[3], a[1]) { bars = (0.1 - x[2]^2 - x[3]^2) | (0.1 - x[1]^2 - x[3]^2); }"
    >>> cell = isoform.mesh(isoform.Model(bars), 0.2, box=0.5, periodic="xyz")
    >>> lower, upper = cell.points[cell.opposite["x"].T]
    >>> len(lower) > 9, bool((lower + [1, 0, 0] == upper).all())
    (True, True)
    """
    if regions and surface_only:
        raise IsoformError("regions do not go with surface_only", "usage")
    others = {
        "regions": regions,
        "periodic": periodic,
        "surface_only": surface_only,
        "order=2": order == 2,
    }
    for name in (name for name, given in others.items() if layers and given):
        raise IsoformError(f"layers do not go with {name}", "usage")
    wanted = {
        "size": size,
        "order": whole("order", order, 1),
        "surface_only": bool(surface_only),
        "region": corners(box),
        "periodic": _axes(periodic),
        "layers": _layers(layers, first, growth, layer_count),
        "grade": grade,
        "angles": None if angles is None else [float(v) for v in angles],
        "memory": _memory(memory),
        "close": close,
    }
    with asked(threads, time_limit, progress) as limits:
        native = _isoform.mesh(
            _shape(model, params), model.name, _regions(regions), wanted, limits
        )
    return Mesh(native)


def _regions(regions: Mapping[str, Region] | None) -> list[tuple[str, Any]]:
    """Regions as the compiled half takes them."""
    found = []
    for name, region in (regions or {}).items():
        model, params = region if isinstance(region, tuple) else (region, None)
        found.append((name, _shape(model, params)))
    return found


def _axes(periodic: str | None) -> list[bool]:
    """Axes as the compiled half takes them."""
    letters = "" if periodic is None else periodic.lower()
    if any(c not in "xyz" for c in letters) or len({*letters}) < len(letters):
        raise IsoformError(f"periodic is {periodic!r}: letters of x, y and z, each once", "usage")
    return [axis in letters for axis in "xyz"]


def _layers(
    layers: str | Sequence[str] | None, first: float | None, growth: float, count: int
) -> tuple[list[str], float, float, int] | None:
    """Layers of wedges as the compiled half takes them."""
    parts = [layers] if isinstance(layers, str) else list(layers or [])
    if not parts:
        if first is not None:
            raise IsoformError("first needs layers", "usage", "layers='wall*': the parts")
        return None
    if first is None:
        raise IsoformError("layers need the thickness of the first one", "usage", "first=0.01")
    if not all(part.strip() for part in parts):
        raise IsoformError("layers has an empty name", "usage", "layers=['wall', 'bore*']")
    for name, given in (("first", first), ("growth", growth)):
        if not 0 < given < math.inf:
            raise IsoformError(f"{name} is {given}: a positive number is expected", "usage")
    return parts, float(first), float(growth), whole("layer_count", count, 1)


def _memory(asked: float | None) -> float | None:
    """GiB that are there: where memory ends, an interpreter ends."""
    if asked is None or not hasattr(os, "sysconf"):
        return asked
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / (1 << 30)
    if asked > there:
        raise IsoformError(f"memory is {asked} GiB: this machine has {there:.1f}", "memory")
    return asked


def _shape(model: Any, params: Values) -> Any:
    """A model as the compiled half takes it."""
    if isinstance(model, Implicit):
        return model._native
    if not isinstance(model, Model):
        raise TypeError(f"model: a Model is expected, not {type(model).__name__}")
    return model._native, model._given(params)
