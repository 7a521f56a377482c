//! Accuracy of the surfaces of a segmentation.

use crate::chart::{MAX_PARAMETERS, ParameterRow, Primitive, PrimitiveKind};
use crate::cloud::Cloud;
use crate::fit::{mean, squares};
use crate::relations::UncertainSurface;
use crate::segment::Segmentation;
use isoform_geom::Point3;

/// Returns the degrees of freedom of the distances from a fitted surface, at least 1.
pub(crate) fn degrees_of_freedom(surface: &Primitive, points: usize) -> f64 {
    points.saturating_sub(surface.kind.parameters()).max(1) as f64
}

/// Returns the variance of the distances of its points from a surface.
pub(crate) fn variance(
    found: &Segmentation,
    label: usize,
    surface: &Primitive,
    points: &[Point3],
) -> f64 {
    match found.is_form || !found.is_explained(label) {
        // Some objects of a scan follow their surfaces up to the noise, even if others need a
        // tolerance of form.
        true => squares(surface, points) / degrees_of_freedom(surface, points.len()),
        false => found.noise * found.noise,
    }
}

/// Returns a surface about the centroid of its points, with its covariance: infinite if it is
/// undetermined.
pub(crate) fn uncertain_surface(
    cloud: &Cloud,
    found: &Segmentation,
    members: &[u32],
    label: usize,
) -> UncertainSurface {
    let points = cloud.at(members);
    let surface = found.surfaces[label].about(mean(&points));
    let variance = variance(found, label, &surface, &points);
    let mut known = UncertainSurface::from_points(surface, &points, variance);
    known.covariance = with_rounding(known.covariance, surface.kind, found.rounding);
    known
}

/// Adds to a covariance of the parameters the rounding, in diagonals, that the coordinates of one
/// face may all have in one direction, which no average removes.
pub(crate) fn with_rounding(
    mut covariance: [ParameterRow; MAX_PARAMETERS],
    kind: PrimitiveKind,
    rounding: f64,
) -> [ParameterRow; MAX_PARAMETERS] {
    for k in kind.lengths() {
        covariance[k][k] += rounding * rounding / 3.0;
    }
    covariance
}
