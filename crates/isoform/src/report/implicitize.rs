//! Report of an implicit spline or polynomial.

use crate::GlobalFit;
use crate::implicit::is_inside_out;
use isoform_spline::{NormalReport, NormalSource, SplineFit};
use serde::Serialize;

/// Report of `implicitize`: a function fitted to a scan. Lengths are in the scan's unit.
#[derive(Clone, Debug, Serialize)]
pub struct ImplicitizeReport {
    /// Name of the verb: `implicitize`.
    pub verb: &'static str,
    /// Number of points fitted.
    pub points: usize,
    /// Number of outliers, which were left out of the fit and of the distances.
    pub outliers: usize,
    /// Number of free coefficients.
    pub unknowns: usize,
    /// Number of cells with data on the finest level around them: the polynomial pieces that were
    /// fitted.
    pub cells: usize,
    /// Degree in each variable; of a single polynomial, the total degree.
    pub degree: usize,
    /// Number of levels of the hierarchy.
    pub levels: usize,
    /// Edge length of the finest cells.
    pub spacing: f64,
    /// Root mean square distance of the points from the surface.
    pub rms: f64,
    /// 95th percentile of these distances.
    pub p95: f64,
    /// Largest of these distances.
    pub max: f64,
    /// Source and orientation of the normals.
    pub normals: NormalsReport,
    /// Number of connected components of the surface that have data.
    pub components: usize,
    /// Number of connected components of the surface without data.
    pub components_without_data: usize,
    /// True if the function is positive all around: the solid is then the outside of the surface.
    pub inside_out: bool,
    /// Computing time, in seconds.
    pub seconds: f64,
}

/// Source and orientation of the normals.
#[derive(Clone, Debug, Serialize)]
pub struct NormalsReport {
    /// Source of the normals: `given`, `turned` (given, but their sides contradicted one another
    /// and were decided anew) or `estimated`.
    pub source: &'static str,
    /// Share of neighbouring points whose normals point to one side.
    pub oriented_share: f64,
    /// Number of connected pieces of the cloud whose outer side had to be decided.
    pub pieces: usize,
}

impl ImplicitizeReport {
    /// Creates the report of a spline fitted to `points` points in `seconds`.
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

    /// Creates the report of a single polynomial, which counts as one cell: the box of the points.
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
