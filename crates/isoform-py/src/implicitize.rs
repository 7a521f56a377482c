//! Implicit functions fitted to points.

use crate::arrays::{PointsArg, rows};
use crate::error::CallError;
use crate::model::of_points;
use crate::run;
use isoform::geom::{Field, ParamField, Point3};
use isoform::io::write_atomic;
use isoform::{Implicit, SplineDistance};
use isoform_verbs::function_file;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// Implicit function fitted to points.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Fitted {
    pub(crate) metric: Arc<SplineDistance>,
}

impl Fitted {
    pub(crate) fn new(function: Implicit) -> Self {
        Self {
            metric: Arc::new(SplineDistance(function)),
        }
    }
    fn function(&self) -> &Implicit {
        &self.metric.0
    }
}

#[pymethods]
impl Fitted {
    /// Returns the values of the function at points.
    fn values<'py>(
        &self,
        py: Python<'py>,
        points: PointsArg<'py>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let values = of_points(py, &points, |block: &[Point3], out: &mut [f64]| {
            self.function().values(block, out);
        })?;
        Ok(PyArray1::from_vec(py, values))
    }
    /// Returns the gradients of the function at points.
    fn gradients<'py>(
        &self,
        py: Python<'py>,
        points: PointsArg<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let gradients = of_points(py, &points, |block: &[Point3], out: &mut [Point3]| {
            for (p, g) in block.iter().zip(out) {
                *g = self.function().jet(*p).g;
            }
        })?;
        rows(py, gradients)
    }
    /// Returns the signed distances of points from the zero set, to first order.
    fn distances<'py>(
        &self,
        py: Python<'py>,
        points: PointsArg<'py>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let values = of_points(py, &points, |block: &[Point3], out: &mut [f64]| {
            self.metric.values(block, &[], out);
        })?;
        Ok(PyArray1::from_vec(py, values))
    }
    /// Writes the function to a file.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let written = run::shortly(py, || {
            let bytes = function_file(self.function());
            write_atomic(&path, |out| out.write_all(&bytes))
        })?;
        Ok(written.map_err(CallError::from)?)
    }
    /// Returns the content of its file as text.
    fn text(&self) -> String {
        String::from_utf8_lossy(&function_file(self.function())).into_owned()
    }
}
