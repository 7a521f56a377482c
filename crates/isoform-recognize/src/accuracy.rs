//! Accuracy of the surfaces of a segmentation.

use crate::chart::{MAX_PARAMETERS, Primitive};
use crate::cloud::Cloud;
use crate::fit::{covariance, mean, squares};
use crate::relations::UncertainSurface;
use crate::segment::Segmentation;

/// Returns the degrees of freedom of the distances from a fitted surface, at least 1.
pub(crate) fn degrees_of_freedom(surface: &Primitive, points: usize) -> f64 {
    points.saturating_sub(surface.kind.parameters()).max(1) as f64
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
    let variance = match found.is_form || !found.is_explained(label) {
        // Some objects of a scan follow their surfaces up to the noise, even if others need a
        // tolerance of form.
        true => squares(&surface, &points) / degrees_of_freedom(&surface, points.len()),
        false => found.noise * found.noise,
    };
    let open = [[f64::INFINITY; MAX_PARAMETERS]; MAX_PARAMETERS];
    let covariance = covariance(&surface, &points);
    UncertainSurface {
        surface,
        covariance: covariance.map_or(open, |c| c.map(|row| row.map(|x| x * variance))),
    }
}
