//! Clouds of points from files and arrays.

use crate::arrays::{PointRows, PointsArg, rows};
use crate::error::CallError;
use crate::run::{self, CallLimits};
use isoform::geom::{Column, PointCloud};
use isoform::io::{MeshPoints, ReadError, ReadOptions, ReadReport, Source, read};
use numpy::PyArray2;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// Point cloud with the report of its reader.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Cloud {
    pub(crate) cloud: Arc<PointCloud>,
    pub(crate) report: Arc<ReadReport>,
}

impl Cloud {
    pub(crate) fn from_parts(cloud: PointCloud, report: ReadReport) -> Self {
        Self {
            cloud: Arc::new(cloud),
            report: Arc::new(report),
        }
    }
}

#[pymethods]
impl Cloud {
    /// Copies the points of an array, which must be finite.
    #[new]
    fn new(py: Python<'_>, points: PointsArg<'_>) -> PyResult<Self> {
        let rows = PointRows::new(&points)?;
        let points = run::shortly(py, || rows.to_points())??;
        let report = ReadReport::of_memory("array", points.len());
        // Recentred like clouds read from files.
        let cloud = PointCloud::from_points(points).recentred();
        Ok(Self::from_parts(cloud, report))
    }

    /// Returns the points in the coordinates of the file.
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let cloud = &self.cloud;
        let place = |i| cloud.absolute(i);
        rows(py, (0..cloud.points.len()).map(place).collect())
    }

    /// Returns the normals; `None` if the file has none.
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let normals = &self.cloud.normals;
        let there = !normals.is_empty();
        there.then(|| rows(py, normals.clone())).transpose()
    }

    /// Returns the colours; `None` if the file has none.
    fn colors<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<u8>>>> {
        let colors = &self.cloud.colors;
        let there = !colors.is_empty();
        there.then(|| rows(py, colors.clone())).transpose()
    }

    /// Returns the triangles; `None` if the file is not a mesh.
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<u32>>>> {
        let triangles = &self.cloud.triangles;
        let there = !triangles.is_empty();
        there.then(|| rows(py, triangles.clone())).transpose()
    }

    /// Returns the names and values of further columns of the file.
    fn columns(&self) -> Vec<(String, Vec<f64>)> {
        let columns = self.cloud.columns.iter();
        columns
            .map(|c| (c.name.clone(), c.values.clone()))
            .collect()
    }

    /// Returns the unit of length of the file, its format, and warnings.
    #[getter]
    fn about(&self) -> (Option<&str>, &str, Vec<String>) {
        let report = &self.report;
        (
            report.units.as_deref(),
            report.format,
            report.warnings.clone(),
        )
    }

    /// Returns the points with a further column; there have to be as many values as points.
    fn with_column(&self, name: String, values: Vec<f64>) -> PyResult<Self> {
        let points = self.cloud.points.len();
        if values.len() != points {
            let message = format!("{name}: {} values for {points} points", values.len());
            return Err(CallError::new("shape", message).into());
        }
        let mut cloud = PointCloud::clone(&self.cloud);
        cloud.columns.retain(|column| column.name != name);
        cloud.columns.push(Column { name, values });
        Ok(Self::from_parts(cloud, (*self.report).clone()))
    }

    fn __len__(&self) -> usize {
        self.cloud.points.len()
    }
}

/// Reads points; of meshes, the vertices.
#[pyfunction]
pub(crate) fn read_points(
    py: Python<'_>,
    path: PathBuf,
    format: Option<&str>,
    max_points: Option<usize>,
    seed: u64,
) -> PyResult<Cloud> {
    let options = ReadOptions {
        max_points,
        seed,
        mesh: MeshPoints::Vertices,
        ..ReadOptions::default()
    };
    let format = format.map(str::to_owned);
    run::run(py, &CallLimits::default(), move |_| {
        let (cloud, report) = read(Source::Path(&path), format.as_deref(), &options)?;
        Ok(Cloud::from_parts(cloud, report))
    })?
    .map_err(|e: ReadError| CallError::from(&e).into())
}
