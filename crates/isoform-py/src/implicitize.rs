//! `implicitize`: an implicit spline, or one polynomial, of a scan.

use crate::arrays::{PointsArg, rows};
use crate::document;
use crate::error::Trouble;
use crate::fit::named;
use crate::model::of_points;
use crate::points::Cloud;
use crate::region::length;
use crate::run::{self, Asked};
use isoform::geom::{Field, ParamField, Point3};
use isoform::io::{write_atomic, write_polynomial, write_spline};
use isoform::report::ImplicitizeReport;
use isoform::spline::{Fineness, Options};
use isoform::{
    Implicit, ImplicitizeError, ImplicitizeOptions, NormalsFrom, SplineDistance, implicitize_scan,
    implicitize_scan_globally,
};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Whose normals are taken, by name.
const NORMALS: [(&str, NormalsFrom); 3] = [
    ("auto", NormalsFrom::Auto),
    ("given", NormalsFrom::Given),
    ("estimate", NormalsFrom::Estimate),
];

/// How a function is fitted, as Python says it.
#[derive(FromPyObject)]
pub(crate) struct Wanted {
    #[pyo3(item)]
    degree: usize,
    #[pyo3(item)]
    cells: Option<usize>,
    #[pyo3(item)]
    tol: Option<f64>,
    #[pyo3(item)]
    polynomial: Option<usize>,
    #[pyo3(item)]
    normals: String,
    #[pyo3(item)]
    smoothing: Option<f64>,
}

impl Wanted {
    fn options(&self) -> Result<ImplicitizeOptions, Trouble> {
        let fineness = match (self.cells, length("tol", self.tol)?) {
            (Some(cells), _) => Fineness::Cells(cells),
            (None, Some(tolerance)) => Fineness::Tolerance(tolerance),
            (None, None) => Fineness::Data,
        };
        let smoothing = length("smoothing", self.smoothing)?;
        Ok(ImplicitizeOptions {
            normals: named("normals", &self.normals, NORMALS)?,
            spline: Options {
                degree: self.degree,
                fineness,
                smoothing: smoothing.unwrap_or(Options::default().smoothing),
            },
        })
    }
}

/// A function fitted to points.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Fitted {
    metric: SplineDistance,
    document: String,
}

impl Fitted {
    pub(crate) fn new(function: Implicit, document: String) -> Self {
        Self {
            metric: SplineDistance(function),
            document,
        }
    }
    pub(crate) fn metric(&self) -> &SplineDistance {
        &self.metric
    }
    pub(crate) fn function(&self) -> &Implicit {
        &self.metric.0
    }
    /// Its file.
    fn bytes(&self) -> Vec<u8> {
        match self.function() {
            Implicit::Spline(spline) => write_spline(&spline.data()),
            Implicit::Polynomial(polynomial) => write_polynomial(polynomial.data()),
        }
    }
}

#[pymethods]
impl Fitted {
    /// The document of `implicitize --json`, as text.
    #[getter]
    fn document(&self) -> &str {
        &self.document
    }
    /// The values of the function.
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
    /// The gradients of the function.
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
    /// The near signed distances from its surface.
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
    /// Writes the file.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let written = run::shortly(py, || {
            let bytes = self.bytes();
            write_atomic(&path, |out| out.write_all(&bytes))
        })?;
        Ok(written.map_err(Trouble::from)?)
    }
    /// The file, as text.
    fn text(&self) -> String {
        String::from_utf8_lossy(&self.bytes()).into_owned()
    }
}

/// Fits a function to points.
#[pyfunction]
pub(crate) fn implicitize(
    py: Python<'_>,
    cloud: Py<Cloud>,
    wanted: Wanted,
    asked: Asked<'_>,
) -> PyResult<Fitted> {
    let (options, degree) = (wanted.options()?, wanted.polynomial);
    let made = run::run(py, &asked, move |control| -> Result<_, ImplicitizeError> {
        let scan = &cloud.get().cloud;
        let points = scan.points.len();
        Ok(match degree {
            None => {
                let made = implicitize_scan(scan, &options, control)?;
                let report = ImplicitizeReport::new(&made, points, 0.0);
                (Implicit::from(made.spline), report)
            }
            Some(degree) => {
                let made = implicitize_scan_globally(scan, options.normals, degree, control)?;
                let report = ImplicitizeReport::of_polynomial(&made, points, 0.0);
                (Implicit::Polynomial(made.polynomial), report)
            }
        })
    })?;
    let (function, report) = made.map_err(Trouble::from)?;
    Ok(Fitted::new(function, document::text(&report)))
}
