//! Implicit splines of scans.

use isoform_control::Control;
use isoform_geom::{PointCloud, SplineData, vertex_normals};
use isoform_spline::{Error, ImplicitSpline, Implicitized, Normals, Options, implicitize};

/// Whose normals are taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NormalsFrom {
    /// The file's own ones, else of its triangles, else estimated.
    #[default]
    Auto,
    /// The file's own ones, or of its triangles.
    Given,
    /// Estimated from the points.
    Estimate,
}

/// How an implicit spline is fitted to a scan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImplicitizeOptions {
    /// Whose normals are taken.
    pub normals: NormalsFrom,
    /// Everything else.
    pub spline: Options,
}

/// Why a scan has no implicit spline.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ImplicitizeError {
    /// Given normals were asked for, and there are none.
    #[error("the scan has no normals")]
    NoNormals,
    /// The stage has no result.
    #[error(transparent)]
    Spline(#[from] Error),
}

/// Fits an implicit spline to a scan: a function of space whose zero set is the surface, inside
/// where f ≥ 0, in the coordinates of the file.
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
/// [`ImplicitizeError`].
pub fn implicitize_scan(
    scan: &PointCloud,
    options: &ImplicitizeOptions,
    control: &Control<'_>,
) -> Result<Implicitized, ImplicitizeError> {
    let of_triangles;
    let normals = match options.normals {
        NormalsFrom::Estimate => Normals::Unknown,
        _ if !scan.normals.is_empty() => Normals::Given(&scan.normals),
        _ if !scan.triangles.is_empty() => {
            of_triangles = vertex_normals(&scan.points, &scan.triangles);
            Normals::Given(&of_triangles)
        }
        NormalsFrom::Given => return Err(ImplicitizeError::NoNormals),
        NormalsFrom::Auto => Normals::Unknown,
    };
    let mut made = implicitize(&scan.points, normals, &options.spline, control)?;
    if scan.origin != [0.0; 3] {
        made.spline = moved(&made.spline, scan);
    }
    Ok(made)
}

/// The spline in the coordinates of the scan's file.
fn moved(spline: &ImplicitSpline, scan: &PointCloud) -> ImplicitSpline {
    let data = spline.data();
    let corner = std::array::from_fn(|k| data.corner[k] + scan.origin[k]);
    ImplicitSpline::from_data(&SplineData { corner, ..data }).expect("it was a spline before")
}
