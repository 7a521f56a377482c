//! The report of an implicit spline.

use isoform_spline::{Implicitized, Source};
use serde::Serialize;

/// What was fitted to a scan; lengths in its unit.
#[derive(Clone, Debug, Serialize)]
pub struct ImplicitizeReport {
    /// `implicitize`.
    pub verb: &'static str,
    /// The points fitted.
    pub points: usize,
    /// Coefficients that do not follow from others.
    pub unknowns: usize,
    /// Cells of the finest level about them that hold data: the polynomial pieces fitted.
    pub cells: usize,
    /// The tri-degree.
    pub degree: usize,
    /// Levels of the hierarchy.
    pub levels: usize,
    /// The edge of the finest cells.
    pub spacing: f64,
    /// Distances of the points: root mean square.
    pub rms: f64,
    /// 95 % of the points are at most this far.
    pub p95: f64,
    /// The largest distance.
    pub max: f64,
    /// Where normals came from.
    pub normals: NormalsReport,
    /// Pieces of the surface with data.
    pub components: usize,
    /// Pieces without.
    pub components_without_data: usize,
    /// The time that it took.
    pub seconds: f64,
}

/// Where normals came from.
#[derive(Clone, Debug, Serialize)]
pub struct NormalsReport {
    /// `given`, `turned` (given, but their sides contradicted one another) or `estimated`.
    pub source: &'static str,
    /// The share of neighbours whose normals point to one side.
    pub oriented_share: f64,
    /// Pieces of the cloud whose outside was decided by us.
    pub pieces: usize,
}

impl ImplicitizeReport {
    /// The report of a fit that took some seconds.
    pub fn new(made: &Implicitized, points: usize, seconds: f64) -> Self {
        let spline = &made.spline;
        Self {
            verb: "implicitize",
            points,
            unknowns: spline.unknowns(),
            cells: spline.data_cells(),
            degree: spline.degree(),
            levels: spline.depth(),
            spacing: spline.spacing(),
            rms: made.distances.rms,
            p95: made.distances.p95,
            max: made.distances.max,
            normals: NormalsReport {
                source: match made.sides.source {
                    Source::Given => "given",
                    Source::Turned => "turned",
                    _ => "estimated",
                },
                oriented_share: made.sides.oriented_share,
                pieces: made.sides.pieces,
            },
            components: made.components.with_data,
            components_without_data: made.components.without_data,
            seconds,
        }
    }
}
