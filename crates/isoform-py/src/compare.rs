//! `compare`: how far two shapes are apart, both ways.

use crate::document;
use crate::error::Trouble;
use crate::implicitize::Fitted;
use crate::mesh::MeshData;
use crate::model::Program;
use crate::points::Cloud;
use crate::region::{Corners, some_region};
use crate::run::{self, Asked};
use isoform::geom::PointCloud;
use isoform::report::{CompareReport, SideReport};
use isoform::{Side, surface_of};
use pyo3::prelude::*;

/// One of the shapes.
#[derive(FromPyObject)]
pub(crate) enum Given {
    #[pyo3(transparent)]
    Points(Py<Cloud>),
    #[pyo3(transparent)]
    Mesh(Py<MeshData>),
    #[pyo3(transparent)]
    Fitted(Py<Fitted>),
    /// A program with the values of its first parameters.
    Model(Py<Program>, Vec<f64>),
}

/// The surface of a mesh, and the values of a model.
type Prepared = (Option<PointCloud>, Vec<f64>);

impl Given {
    fn prepared(&self) -> Result<Prepared, Trouble> {
        Ok(match self {
            Self::Mesh(mesh) => (Some(surface_of(&mesh.get().mesh)), Vec::new()),
            Self::Model(program, given) => (None, program.get().values_of(given)?),
            Self::Points(_) | Self::Fitted(_) => (None, Vec::new()),
        })
    }

    fn side<'a>(&'a self, (surface, values): &'a Prepared) -> Result<Side<'a>, Trouble> {
        let of_cloud = |cloud: &'a PointCloud| match cloud.triangles.is_empty() {
            true => Side::Points(cloud),
            false => Side::Mesh(cloud),
        };
        Ok(match self {
            Self::Points(cloud) => of_cloud(&cloud.get().cloud),
            Self::Mesh(_) => of_cloud(surface.as_ref().expect("it was prepared")),
            Self::Fitted(fitted) => Side::Spline(fitted.get().metric()),
            Self::Model(program, _) => Side::Model(program.get().template()?, values),
        })
    }
}

/// What a side is compared as.
fn kind(side: &Side<'_>) -> &'static str {
    match side {
        Side::Points(_) => "points",
        Side::Mesh(_) => "mesh",
        Side::Model(..) | Side::Spline(_) => "model",
        Side::Solid(_) => "solid",
    }
}

/// Compares two shapes; the document of `compare --json`, as text.
#[pyfunction]
pub(crate) fn compare(
    py: Python<'_>,
    shapes: (Given, Given),
    names: (String, String),
    wanted: (Option<Corners>, usize, Option<f64>),
    asked: Asked<'_>,
) -> PyResult<String> {
    let (corners, samples, tolerance) = wanted;
    let region = some_region(corners)?;
    let compared = run::run(py, &asked, move |_| -> Result<_, Trouble> {
        let prepared = (shapes.0.prepared()?, shapes.1.prepared()?);
        let first = shapes.0.side(&prepared.0)?;
        let second = shapes.1.side(&prepared.1)?;
        let kinds = [kind(&first), kind(&second)];
        Ok((kinds, isoform::compare(first, second, region, samples)?))
    })?;
    let ([first, second], distances) = compared?;
    let side = |file: String, kind: &'static str| SideReport { file, kind };
    let sides = [side(names.0, first), side(names.1, second)];
    let report = CompareReport::new(sides, distances, tolerance);
    Ok(document::text(&report))
}
