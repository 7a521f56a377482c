//! Implicit splines and polynomials of scans.

use crate::GlobalPolynomial;
use isoform_control::Control;
use isoform_geom::{Point3, PointCloud, PolynomialData, SplineData, vertex_normals};
use isoform_spline::{
    Components, Distances, Error, ImplicitSpline, NormalReport, Normals, Options, SplineFit,
    implicitize, implicitize_globally,
};
use std::borrow::Cow;

/// Source of normals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NormalsFrom {
    /// Normals of the file, else of its triangles, else estimates.
    #[default]
    Auto,
    /// Normals of the file, or of its triangles.
    Given,
    /// Estimates from the points.
    Estimate,
}

/// Options of fitting an implicit spline to a scan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImplicitizeOptions {
    /// Source of the normals.
    pub normals: NormalsFrom,
    /// All other options.
    pub spline: Options,
}

/// Reason why a scan has no implicit spline.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ImplicitizeError {
    /// Normals of the file were requested, and it has none.
    #[error("the scan has no normals")]
    NoNormals,
    /// The fit has no result.
    #[error(transparent)]
    Spline(#[from] Error),
}

/// Fits an implicit spline to a scan: a function f whose zero set is the surface, positive inside,
/// in the coordinates of the file.
///
/// ```
/// use isoform::geom::{Field, PointCloud};
/// use isoform::{Control, ImplicitizeOptions, implicitize_scan};
/// // Points of a unit sphere about (10, 0, 0).
/// let point = |i: u32| {
///     let (t, z) = (f64::from(i) * 2.4, f64::from(i) / 500.0 - 1.0);
///     let r = (1.0 - z * z).sqrt();
///     [10.0 + r * t.cos(), r * t.sin(), z]
/// };
/// let scan = PointCloud::from_points((0..1000).map(point).collect());
/// let made = implicitize_scan(&scan, &ImplicitizeOptions::default(), &Control::default())?;
/// assert!(made.spline.value([10.0, 0.0, 0.9]) > 0.0);
/// assert!(made.spline.value([10.0, 0.0, 1.1]) < 0.0);
/// # Ok::<(), isoform::ImplicitizeError>(())
/// ```
///
/// # Errors
/// [`ImplicitizeError`] if requested normals are missing, the fit has no result, or on a stop.
pub fn implicitize_scan(
    scan: &PointCloud,
    options: &ImplicitizeOptions,
    control: &Control<'_>,
) -> Result<SplineFit, ImplicitizeError> {
    let given = given_normals(scan, options.normals)?;
    let mut made = implicitize(&scan.points, known(&given), &options.spline, control)?;
    if scan.origin != [0.0; 3] {
        made.spline = moved(&made.spline, scan);
    }
    Ok(made)
}

/// Returns the normals of a scan, or of its triangles if the file has none; `None` if they have to
/// be estimated.
fn given_normals(
    scan: &PointCloud,
    from: NormalsFrom,
) -> Result<Option<Cow<'_, [Point3]>>, ImplicitizeError> {
    Ok(match from {
        NormalsFrom::Estimate => None,
        _ if !scan.normals.is_empty() => Some(Cow::Borrowed(&scan.normals)),
        _ if !scan.triangles.is_empty() => {
            Some(Cow::Owned(vertex_normals(&scan.points, &scan.triangles)))
        }
        NormalsFrom::Given => return Err(ImplicitizeError::NoNormals),
        NormalsFrom::Auto => None,
    })
}

fn known<'a>(given: &'a Option<Cow<'_, [Point3]>>) -> Normals<'a> {
    given.as_deref().map_or(Normals::Unknown, Normals::Given)
}

/// Polynomial fitted to a scan.
#[derive(Clone, Debug)]
pub struct GlobalFit {
    /// Fitted polynomial f; the solid is f ≥ 0.
    pub polynomial: GlobalPolynomial,
    /// Distances of the points from f = 0.
    pub distances: Distances,
    /// Source and orientation of the normals.
    pub sides: NormalReport,
    /// Connected components of the surface within the box of the points.
    pub components: Components,
}

/// Fits a single polynomial of a total degree to a scan: a function f whose zero set is the
/// surface, positive inside, in the coordinates of the file.
///
/// ```
/// use isoform::geom::{Field, PointCloud};
/// use isoform::{Control, Implicit, NormalsFrom, implicitize_scan_globally};
/// // Points of a unit sphere about (10, 0, 0).
/// let point = |i: u32| {
///     let (t, z) = (f64::from(i) * 2.4, f64::from(i) / 500.0 - 1.0);
///     let r = (1.0 - z * z).sqrt();
///     [10.0 + r * t.cos(), r * t.sin(), z]
/// };
/// let scan = PointCloud::from_points((0..1000).map(point).collect());
/// let made = implicitize_scan_globally(&scan, NormalsFrom::Auto, 2, &Control::default())?;
/// let ball = Implicit::Polynomial(made.polynomial);
/// assert!(ball.value([10.0, 0.0, 0.999]) > 0.0 && ball.value([10.0, 0.0, 1.001]) < 0.0);
/// # Ok::<(), isoform::ImplicitizeError>(())
/// ```
///
/// # Errors
/// [`ImplicitizeError`] if requested normals are missing, the points do not determine a polynomial,
/// or on a stop.
pub fn implicitize_scan_globally(
    scan: &PointCloud,
    normals: NormalsFrom,
    degree: usize,
    control: &Control<'_>,
) -> Result<GlobalFit, ImplicitizeError> {
    let given = given_normals(scan, normals)?;
    let made = implicitize_globally(&scan.points, known(&given), degree, control)?;
    let moved = |p: Point3| std::array::from_fn(|k| p[k] + scan.origin[k]);
    let data = PolynomialData {
        origin: moved(made.polynomial.origin),
        corner: moved(made.polynomial.corner),
        ..made.polynomial
    };
    // A constant polynomial would have no gradient, but the mean gradient along normals is −1.
    let polynomial = GlobalPolynomial::from_data(data).map_err(|_| Error::Undetermined)?;
    Ok(GlobalFit {
        polynomial,
        distances: made.distances,
        sides: made.sides,
        components: made.components,
    })
}

/// Returns the spline in the coordinates of the scan's file.
fn moved(spline: &ImplicitSpline, scan: &PointCloud) -> ImplicitSpline {
    let data = spline.data();
    let corner = std::array::from_fn(|k| data.corner[k] + scan.origin[k]);
    ImplicitSpline::from_data(&SplineData { corner, ..data }).expect("it was a spline before")
}
