//! `recognize`: planes, spheres, cylinders, cones and tori of a scan.

use crate::arrays::rows;
use crate::document;
use crate::error::Trouble;
use crate::points::Cloud;
use crate::region::length;
use crate::run::{self, Asked};
use isoform::report::{RecognizeReport, SnapReport};
use isoform::{RecognizeError, RecognizeOptions, Recognized, recognize_scan};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use std::borrow::Cow;

/// What was recognised in points.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Entities {
    found: Recognized<'static>,
    document: String,
}

#[pymethods]
impl Entities {
    /// The document of `recognize --json`, as text.
    #[getter]
    fn document(&self) -> &str {
        &self.document
    }
    /// The index of the entity of each point, -1 for none.
    fn labels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        indices(py, &self.found.recognition.labels)
    }
    /// The index of the face of each point, -1 for none.
    fn face_labels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        indices(py, &self.found.recognition.face_labels)
    }
    /// The points that were looked at, further ones on the faces of a CAD mesh included.
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let scan = &self.found.scan;
        let place = |i| scan.absolute(i);
        rows(py, (0..scan.points.len()).map(place).collect())
    }
    /// A program of the entities, for fits, and what it lacks.
    fn template(&self, py: Python<'_>, title: &str) -> PyResult<(String, Vec<String>)> {
        let asked = Asked::default();
        let proposal = run::scoped(py, &asked, |control| self.found.template(title, control))?;
        let proposal = proposal.map_err(|e| Trouble::new("no-template", e))?;
        let gaps = proposal.gaps.iter().map(ToString::to_string).collect();
        Ok((proposal.program, gaps))
    }
}

/// Indices as an array, -1 for none.
fn indices<'py>(py: Python<'py>, of: &[Option<u32>]) -> Bound<'py, PyArray1<i64>> {
    PyArray1::from_iter(py, of.iter().map(|l| l.map_or(-1, i64::from)))
}

/// Recognises entities in points.
#[pyfunction]
pub(crate) fn recognize(
    py: Python<'_>,
    cloud: Py<Cloud>,
    tol: Option<f64>,
    min_points: Option<usize>,
    snap: bool,
    asked: Asked<'_>,
) -> PyResult<Entities> {
    let options = RecognizeOptions {
        noise: length("tol", tol)?,
        min_points,
    };
    let made = run::run(py, &asked, move |control| -> Result<_, RecognizeError> {
        let mut found = recognize_scan(&cloud.get().cloud, &options, control)?;
        let snapped = match snap {
            true => Some(
                found
                    .snap(control)
                    .map_err(isoform::recognize::Error::from)?,
            ),
            false => None,
        };
        let found = Recognized {
            scan: Cow::Owned(found.scan.into_owned()),
            recognition: found.recognition,
            supports: found.supports,
        };
        Ok((found, snapped))
    })?;
    let (found, snapped) = made.map_err(Trouble::from)?;
    let mut report = RecognizeReport::new(&found.recognition, 0.0);
    report.snap = snapped.as_ref().map(SnapReport::new);
    Ok(Entities {
        document: document::text(&report),
        found,
    })
}
