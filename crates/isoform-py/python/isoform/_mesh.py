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

    def _handed(self) -> tuple[str, Any]:
        """Its name and what the compiled half holds."""
        return "mesh", self._mesh

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
    warnings : list of str
        What may be wrong.
    """

    def __init__(self, answer: Answer) -> None:
        super().__init__(answer.native)
        self._document = answer.document
        self.warnings = answer.warnings
        self.certificate: dict[str, Any] = self.to_dict().get("certificate", {})

    @property
    def volume(self) -> float | None:
        """The volume within the surface; None where it was not measured."""
        return self.certificate.get("volume")

    @property
    def area(self) -> float | None:
        """The area of the surface; None where it was not measured."""
        return self.certificate.get("area")

    @property
    def is_watertight(self) -> bool:
        """True if the surface is closed and manifold, by its certificate."""
        return bool(self.certificate.get("closed") and self.certificate.get("manifold"))

    @property
    def bounds(self) -> npt.NDArray[np.float64]:
        """The lower and the upper corner of the nodes' box, (2, 3)."""
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
