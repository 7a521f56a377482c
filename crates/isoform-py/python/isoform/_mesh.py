"""Meshes: labelled surfaces and tetrahedra, with a certificate."""

from __future__ import annotations

import os
import warnings
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _isoform
from ._call import Answer
from ._document import Documented, Shown
from ._optional import need
from ._points import Path


class Triangles(Shown):
    """Mesh with nodes and triangles that can be saved and converted.

    Attributes
    ----------
    points : numpy.ndarray
        (n, 3) float64.
    triangles : numpy.ndarray
        (m, 3) uint32, or (m, 6) with nodes in the middles of edges; counterclockwise from outside.
    triangle_parts : numpy.ndarray
        (m,) uint32: part of each triangle, an index into ``part_names``.
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
            The format, if the ending does not determine it.

        Raises
        ------
        IsoformError
            If the file cannot be written, or the format is unknown.
        """
        for warning in self._mesh.save(os.fspath(path), format):
            warnings.warn(f"{os.fspath(path)}: {warning}", stacklevel=2)

    def to_trimesh(self) -> Any:
        """Convert the surface to a mesh of trimesh.

        Returns
        -------
        trimesh.Trimesh
            Triangles by their corners, with quadrilaterals split in two; nodes that no triangle
            uses are omitted.
        """
        trimesh = need("trimesh")
        flat = self._simplices().triangles[:, :3].astype(np.int64)
        used, faces = np.unique(flat, return_inverse=True)
        return trimesh.Trimesh(self.points[used], faces.reshape(-1, 3), process=False)

    def to_meshio(self) -> Any:
        """Convert all elements to a mesh of meshio, with the indices of parts and regions.

        Returns
        -------
        meshio.Mesh
            With identical nodes; ``cell_data["part"]`` are indices into ``part_names``.
        """
        meshio = need("meshio")
        cells, data = self._cells()
        return meshio.Mesh(self.points, cells, cell_data={"part": data})

    def to_pyvista(self) -> Any:
        """Convert all elements to a grid of PyVista.

        Returns
        -------
        pyvista.UnstructuredGrid
            With identical nodes; ``cell_data["part"]`` are indices into ``part_names``.
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

    def _handed(self) -> tuple[str, Any]:
        """Return the name of the file in memory, and the compiled object."""
        return "mesh", self._mesh

    def _simplices(self) -> Triangles:
        """Convert to a mesh of triangles and tetrahedra only."""
        return self

    def _cells(self) -> tuple[list[tuple[str, npt.NDArray[Any]]], list[npt.NDArray[Any]]]:
        """Return the elements by kind, and the part or region of each."""
        triangles = self.triangles.astype(np.int64)
        kind = "triangle6" if triangles.shape[1] == 6 else "triangle"
        parts = self.triangle_parts if len(self.triangle_parts) else np.zeros(len(triangles))
        return [(kind, triangles)], [parts.astype(np.int64)]


def _kept(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Make an array read-only, since changes would not be saved."""
    array.setflags(write=False)
    return array


class Mesh(Triangles, Documented):
    """Mesh of a model: nodes, labelled triangles of its surface, tetrahedra, a certificate.

    Attributes
    ----------
    points : numpy.ndarray
        (n, 3) float64, in the model's unit.
    triangles : numpy.ndarray
        (m, 3) uint32, or (m, 6) of order 2; counterclockwise from outside.
    tetrahedra : numpy.ndarray
        (k, 4) uint32, or (k, 10) of order 2; of positive volume.
    wedges : numpy.ndarray
        (w, 6) uint32, in boundary layers: the three nodes nearer to the surface, then the
        corresponding three; of positive volume.
    quads : numpy.ndarray
        (q, 4) uint32: quadrilaterals of the surface, where layers end; counterclockwise from
        outside.
    triangle_parts : numpy.ndarray
        (m,) uint32: part of each triangle, an index into ``part_names``.
    quad_parts : numpy.ndarray
        (q,) uint32: part of each quadrilateral, an index into ``part_names``.
    part_names : list of str
        Names of the parts of the surface.
    regions : numpy.ndarray
        (k,) uint32: region of each tetrahedron, an index into ``region_names``.
    opposite : dict of numpy.ndarray
        For a unit cell, (n, 2) uint32 for each axis of repetition, such as ``"x"``: the nodes on
        its lower side, and the corresponding ones on the upper side.
    certificate : dict
        Verified properties of the mesh; ``walls`` tells the elements through the walls, and
        ``facets`` how coarsely triangles follow each part.
    warnings : list of str
        Possible problems.
    """

    def __init__(self, answer: Answer) -> None:
        super().__init__(answer.native)
        self._document = answer.document
        self.warnings = answer.warnings
        self.certificate: dict[str, Any] = self.to_dict().get("certificate", {})

    @property
    def volume(self) -> float | None:
        """The volume within the surface; None if it was not measured."""
        return self.certificate.get("volume")

    @property
    def area(self) -> float | None:
        """The area of the surface; None if it was not measured."""
        return self.certificate.get("area")

    @property
    def quality(self) -> dict[str, Any] | None:
        """The aspect ratios and scaled Jacobians of the tetrahedra, as Verdict and VTK define them,
        with the ten worst elements by each; None without tetrahedra."""
        return self.certificate.get("quality")

    @property
    def is_watertight(self) -> bool:
        """True if the certificate states that the surface is closed and manifold."""
        return bool(self.certificate.get("closed") and self.certificate.get("manifold"))

    @property
    def bounds(self) -> npt.NDArray[np.float64]:
        """The lower and the upper corner of the bounding box of the nodes, (2, 3)."""
        return np.array([self.points.min(axis=0), self.points.max(axis=0)])

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
        """Convert the tetrahedra to a mesh of scikit-fem with named boundaries.

        Returns
        -------
        skfem.MeshTet
            Nodes as columns, boundaries named after the parts. A wedge becomes three tetrahedra.
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
        return Mesh(Answer(self._document, [], self._mesh.simplices()))

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
