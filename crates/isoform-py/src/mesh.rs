//! Meshes: arrays of nodes and elements, and files.

use crate::arrays::rows;
use crate::error::CallError;
use crate::run;
use isoform::geom::Mesh;
use isoform::io::{MeshWriteOptions, write_mesh_path};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// Mesh with its unit of length.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct MeshData {
    pub(crate) mesh: Arc<Mesh>,
    pub(crate) unit: Option<String>,
}

impl MeshData {
    pub(crate) fn new(mesh: Mesh, unit: Option<String>) -> Self {
        Self {
            mesh: Arc::new(mesh),
            unit,
        }
    }
}

#[pymethods]
impl MeshData {
    /// Returns the names of the parts, of the regions and of the feature curves.
    #[getter]
    fn names(&self) -> (Vec<String>, Vec<String>, Vec<String>) {
        let curves = self.mesh.curves.iter().map(|c| c.name.clone());
        (
            self.mesh.parts.clone(),
            self.mesh.regions.clone(),
            curves.collect(),
        )
    }
    /// Returns the coordinates of the nodes.
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.mesh.points.clone())
    }
    /// Returns the nodes of the triangles: corners, then mid-edge nodes.
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let (corners, mids) = (&self.mesh.triangles, &self.mesh.triangle_mids);
        if mids.is_empty() {
            return rows(py, corners.clone());
        }
        let both = corners.iter().zip(mids);
        let whole = |(c, m): (&[u32; 3], &[u32; 3])| [c[0], c[1], c[2], m[0], m[1], m[2]];
        rows(py, both.map(whole).collect())
    }
    /// Returns the nodes of the tetrahedra: corners, then mid-edge nodes.
    fn tetrahedra<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let (corners, mids) = (&self.mesh.tets, &self.mesh.tet_mids);
        if mids.is_empty() {
            return rows(py, corners.clone());
        }
        let whole = |(c, m): (&[u32; 4], &[u32; 6])| {
            [c[0], c[1], c[2], c[3], m[0], m[1], m[2], m[3], m[4], m[5]]
        };
        rows(py, corners.iter().zip(mids).map(whole).collect())
    }
    /// Returns the nodes of the wedges.
    fn wedges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        rows(py, self.mesh.wedges.clone())
    }
    /// Returns the nodes of the quadrilaterals.
    fn quads<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        rows(py, self.mesh.quads.clone())
    }
    /// Returns the part of each quadrilateral.
    fn quad_parts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, &self.mesh.quad_parts)
    }
    /// Returns the mesh with wedges split into tetrahedra and quadrilaterals into triangles.
    fn simplices(&self) -> Self {
        Self {
            mesh: Arc::new(self.mesh.simplices().into_owned()),
            unit: self.unit.clone(),
        }
    }
    /// Returns the part of each triangle.
    fn triangle_parts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, &self.mesh.triangle_parts)
    }
    /// Returns the region of each tetrahedron.
    fn regions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, &self.mesh.tet_regions)
    }
    /// Returns pairs of corresponding nodes on the lower and upper side of a unit cell, by axis of
    /// repetition.
    fn opposite<'py>(&self, py: Python<'py>) -> PyResult<Vec<(usize, Bound<'py, PyArray2<u32>>)>> {
        let sides = self.mesh.opposite.iter();
        sides
            .map(|sides| Ok((sides.axis, rows(py, sides.nodes.clone())?)))
            .collect()
    }
    /// Writes a file. The format is given by `format` or by the ending of the name; returns
    /// warnings.
    fn save(&self, py: Python<'_>, path: PathBuf, format: Option<&str>) -> PyResult<Vec<String>> {
        let options = MeshWriteOptions {
            units: self.unit.clone(),
            ..MeshWriteOptions::default()
        };
        let report = run::shortly(py, || {
            write_mesh_path(&self.mesh, &path, format, &options).map_err(CallError::from)
        })??;
        Ok(report.warnings)
    }
}
