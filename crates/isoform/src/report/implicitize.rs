//! The report of an implicit spline or polynomial.

use crate::GlobalFit;
use crate::implicit::is_inside_out;
use isoform_spline::{NormalReport, NormalSource, SplineFit};
use serde::Serialize;

/// What was fitted to a scan; lengths in its unit.
#[derive(Clone, Debug, Serialize)]
pub struct ImplicitizeReport {
    /// `implicitize`.
    pub verb: &'static str,
    /// The points fitted.
    pub points: usize,
    /// Points that belong to no surface, and were left out of the fit and of the distances.
    pub outliers: usize,
    /// Coefficients that do not follow from others.
    pub unknowns: usize,
    /// Cells of the finest level about them that hold data: the polynomial pieces fitted.
    pub cells: usize,
    /// The tri-degree, or of one polynomial the total degree.
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
    /// True if the function is positive all around: the solid is what lies outside of the surface.
    pub inside_out: bool,
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
    pub fn new(made: &SplineFit, points: usize, seconds: f64) -> Self {
        let spline = &made.spline;
        Self {
            verb: "implicitize",
            points,
            outliers: made.outliers,
            unknowns: spline.unknowns(),
            cells: spline.data_cells(),
            degree: spline.degree(),
            levels: spline.depth(),
            spacing: spline.spacing(),
            rms: made.distances.rms,
            p95: made.distances.p95,
            max: made.distances.max,
            normals: NormalsReport::new(made.sides),
            components: made.components.with_data,
            components_without_data: made.components.without_data,
            inside_out: is_inside_out(spline, spline.domain()),
            seconds,
        }
    }

    /// The report of one polynomial. It counts as one cell, the box about the points.
    pub fn of_polynomial(made: &GlobalFit, points: usize, seconds: f64) -> Self {
        let data = made.polynomial.data();
        let longest = data.count.into_iter().max().unwrap_or(1);
        Self {
            verb: "implicitize",
            points,
            outliers: 0,
            unknowns: data.coefficients.len(),
            cells: 1,
            degree: data.degree,
            levels: 1,
            spacing: data.spacing * f64::from(longest),
            rms: made.distances.rms,
            p95: made.distances.p95,
            max: made.distances.max,
            normals: NormalsReport::new(made.sides),
            components: made.components.with_data,
            components_without_data: made.components.without_data,
            inside_out: is_inside_out(made.polynomial.field(), made.polynomial.domain()),
            seconds,
        }
    }
}

impl NormalsReport {
    fn new(sides: NormalReport) -> Self {
        Self {
            source: match sides.source {
                NormalSource::Given => "given",
                NormalSource::Turned => "turned",
                _ => "estimated",
            },
            oriented_share: sides.oriented_share,
            pieces: sides.pieces,
        }
    }
}
