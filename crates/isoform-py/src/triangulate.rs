//! `triangulate`: triangles of a rational surface in a box, with what is proved of them.

use crate::arrays::rows;
use crate::document;
use crate::error::Trouble;
use crate::fit::named;
use crate::mesh::MeshData;
use crate::region::length;
use crate::run::{self, Asked};
use isoform::algebra::RBig;
use isoform::report::{SurfaceReport, TriangulateReport, mode_name};
use isoform::tess::{Domain, Mode};
use isoform::{PatchesError, RationalSurface, SurfaceBox, TriangulatedSurface, exact_number};
use numpy::PyArray2;
use pyo3::prelude::*;
use std::time::Duration;

/// What becomes of sheets that cross; reports have their names.
const MODES: [Mode; 2] = [Mode::Glued, Mode::Normalised];

/// What is wanted of a surface, as Python says it; numbers as text, since they are exact.
#[derive(FromPyObject)]
pub(crate) struct Wanted {
    #[pyo3(item)]
    half_width: Option<String>,
    #[pyo3(item)]
    corners: Vec<[String; 2]>,
    #[pyo3(item)]
    tol: Option<f64>,
    #[pyo3(item)]
    longest: Option<f64>,
    #[pyo3(item)]
    triangles: Option<usize>,
    #[pyo3(item)]
    mode: Option<String>,
    #[pyo3(item)]
    reduce: bool,
}

impl Wanted {
    /// The region of parameters: two corners are a rectangle's, more a polygon's.
    fn domain(&self) -> Result<Option<Domain>, Trouble> {
        let corner = |c: &[String; 2]| Ok::<_, Trouble>([exact(&c[0])?, exact(&c[1])?]);
        let corners: Vec<[RBig; 2]> = self.corners.iter().map(corner).collect::<Result<_, _>>()?;
        let domain = match <[[RBig; 2]; 2]>::try_from(corners) {
            Ok([[s0, t0], [s1, t1]]) => Domain::rectangle([s0, s1], [t0, t1]),
            Err(corners) if corners.is_empty() => return Ok(None),
            Err(corners) => Domain::polygon(corners),
        };
        domain.map(Some).map_err(Trouble::usage)
    }

    /// The box, and whether it was chosen here.
    fn around(
        &self,
        surface: &RationalSurface,
        domain: Option<&Domain>,
    ) -> Result<(SurfaceBox, bool), Trouble> {
        let Some(text) = &self.half_width else {
            let chosen = surface.bounds(domain).map(|around| (around, true));
            let missing = || {
                Trouble::usage("box is needed: the surface is not proved to have bounds")
                    .hint("box=, half the width of a box around the origin")
            };
            return chosen.ok_or_else(missing);
        };
        let half_width = exact(text)?;
        let size = half_width.to_f64_fast();
        if !(size > 0.0 && size.is_normal()) {
            let message = format!("box is {text}: a positive number is expected");
            return Err(Trouble::usage(message));
        }
        Ok((SurfaceBox { half_width, size }, false))
    }
}

/// A number exactly as it is written.
fn exact(text: &str) -> Result<RBig, Trouble> {
    let wrong = || {
        Trouble::usage(format!(
            "{text}: a decimal number or a fraction is expected"
        ))
    };
    exact_number(text).ok_or_else(wrong)
}

/// A triangulated surface.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Triangulation {
    pub(crate) drawn: TriangulatedSurface,
    name: String,
}

#[pymethods]
impl Triangulation {
    /// The triangles.
    fn mesh(&self) -> MeshData {
        MeshData::new(self.drawn.mesh(), None, String::from("{}"))
    }
    /// The parameters s and t of the vertices.
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.drawn.parameters())
    }
    /// The document of `triangulate --json`, and the report that it writes, as texts.
    fn documents(&self) -> (String, String) {
        let about = self.drawn.about(&self.name);
        let report = document::text(&TriangulateReport::new(&about, Vec::new()));
        (report, document::file(&SurfaceReport::new(&about)))
    }
}

/// Triangulates the surface of a map, or patches, out of a text of JSON; the name is for documents.
#[pyfunction]
pub(crate) fn triangulate(
    py: Python<'_>,
    text: &str,
    name: String,
    wanted: Wanted,
    asked: Asked<'_>,
) -> PyResult<Triangulation> {
    let surface = RationalSurface::parse(text, wanted.reduce).map_err(Trouble::from)?;
    let domain = wanted.domain()?;
    if !surface.is_map() && domain.is_some() {
        return Err(Trouble::usage("patches are drawn over their own parameters").into());
    }
    let (around, is_chosen) = wanted.around(&surface, domain.as_ref())?;
    let seconds = asked.time_limit.map(Duration::try_from_secs_f64);
    let mut options = surface.options(&around, seconds.and_then(Result::ok));
    options.domain = domain;
    if let Some(mode) = &wanted.mode {
        options.mode = named("mode", mode, MODES.map(|m| (mode_name(m), m)))?;
    }
    let mesh = &mut options.mesh;
    mesh.tolerance = length("tol", wanted.tol)?.unwrap_or(mesh.tolerance);
    mesh.longest = length("longest", wanted.longest)?.unwrap_or(mesh.longest);
    mesh.triangles = wanted.triangles.unwrap_or(mesh.triangles);
    let drawn = run::run(py, &asked, move |control| {
        surface.triangulate(options, is_chosen, control)
    })?;
    let drawn = drawn.map_err(|e| match e {
        PatchesError::Stopped => Trouble::stopped("stopped before there were triangles"),
        e => Trouble::usage(e),
    })?;
    if drawn.surface.triangles.is_empty() {
        let message = if drawn.surface.is_outside {
            "no triangle of the surface lies in the box"
        } else {
            "no triangle could be made of the surface in the box"
        };
        return Err(Trouble::new("empty", message).hint("a larger box").into());
    }
    Ok(Triangulation { drawn, name })
}
