//! Implicit functions fitted to points.

use crate::arrays::{PointsArg, rows};
use crate::error::CallError;
use crate::model::of_points;
use crate::run::{self, CallLimits};
use isoform::geom::{Aabb, Field, ParamField, Point3};
use isoform::io::write_atomic;
use isoform::spline::{SampleAccuracy, SampleError, sample_function};
use isoform::{Implicit, SplineDistance};
use isoform_verbs::function_file;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

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

/// Ratio of the margin around the box of a sampled function to the longest side. The spline bends
/// sharply at the end of its region, where the caps of a mesh that ends at the box would lie.
const MARGIN: f64 = 1.0 / 16.0;

/// Samples a function of Python in a box, given by the lower and the upper corner; returns it with
/// the accuracy and the number of its coefficients. The function maps points (n, 3) to values (n,).
#[pyfunction]
pub(crate) fn sample(
    py: Python<'_>,
    function: Py<PyAny>,
    region: [Point3; 2],
    accuracy: Option<f64>,
    limits: CallLimits<'_>,
) -> PyResult<(Fitted, f64, usize)> {
    let raised: Arc<Mutex<Option<PyErr>>> = Arc::default();
    let noted = raised.clone();
    let [lo, hi] = region;
    let region = Aabb { lo, hi };
    let accuracy = SampleAccuracy::of_distance(accuracy, region.diagonal());
    let region = region.widened(MARGIN * region.size().into_iter().fold(0.0, f64::max));
    let values = move |points: &[Point3], out: &mut [f64]| {
        let note = || noted.lock().unwrap_or_else(PoisonError::into_inner);
        if note().is_some() {
            return out.fill(f64::NAN);
        }
        let called = Python::attach(|py| -> PyResult<()> {
            let found = function.call1(py, (rows(py, points.to_vec())?,))?;
            let found: PyReadonlyArray1<'_, f64> = found.extract(py)?;
            let found = found.as_array();
            if found.len() != out.len() {
                let message = format!(
                    "the function gave {} values for {} points",
                    found.len(),
                    out.len()
                );
                return Err(CallError::new("shape", message).into());
            }
            for (v, out) in found.iter().zip(out.iter_mut()) {
                *out = *v;
            }
            Ok(())
        });
        if let Err(error) = called {
            out.fill(f64::NAN);
            note().get_or_insert(error);
        }
    };
    let sampled = run::run(py, &limits, move |control| {
        sample_function(region, accuracy, &[], control, values)
    })?;
    if let Some(error) = raised.lock().unwrap_or_else(PoisonError::into_inner).take() {
        return Err(error);
    }
    let spline = sampled.map_err(|error| match error {
        SampleError::Stopped => CallError::stopped(error),
        SampleError::TooFine => CallError::new("accuracy", error).hint("a larger accuracy"),
        SampleError::NotFinite(_) => {
            CallError::new("undefined", error).hint("a box in which it is a number")
        }
        _ => CallError::usage(error),
    })?;
    let unknowns = spline.unknowns();
    Ok((
        Fitted::new(Implicit::Spline(spline)),
        accuracy.absolute,
        unknowns,
    ))
}
