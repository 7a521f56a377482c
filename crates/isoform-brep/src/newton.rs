//! Intersection points of several surfaces.

use crate::locus::Distance;
use isoform_geom::{Point3, dot, norm};
use isoform_num::linalg::symmetric_eigen;

/// Distance below which a point lies on a surface, and two points are one, in sizes of the model:
/// readers merge points a hundred times as far apart.
pub(crate) const POINT_TOLERANCE: f64 = 1e-9;
/// Rounding of the iteration times a hundred, in sizes of the model.
pub(crate) const MEETING_ROUNDING: f64 = 1e-12;

/// Returns the point near `start` that lies on all the surfaces, or as nearly as the iteration
/// gets: Gauss–Newton steps, of minimal norm where the point is not determined.
pub(crate) fn meet<'s, S: Distance + ?Sized + 's>(
    surfaces: impl IntoIterator<Item = &'s S> + Clone,
    start: Point3,
) -> Point3 {
    let mut p = start;
    // Some five steps suffice if surfaces cross, more are needed if they nearly touch.
    for _ in 0..40 {
        let Some(step) = step(surfaces.clone(), p) else {
            break;
        };
        p = std::array::from_fn(|k| p[k] - step[k]);
        if norm(step) <= 4.0 * f64::EPSILON * norm(p) {
            break;
        }
    }
    p
}

/// Returns the largest distance of a point from the surfaces.
pub(crate) fn gap<'s, S: Distance + ?Sized + 's>(
    surfaces: impl IntoIterator<Item = &'s S>,
    p: Point3,
) -> f64 {
    let each = surfaces.into_iter().map(|s| s.distance(p).0.abs());
    // NaN means that the point is on no surface; the maximum alone would ignore it.
    each.fold(
        0.0,
        |m: f64, d| if d.is_nan() { f64::INFINITY } else { m.max(d) },
    )
}

/// Returns the least-squares step; `None` if it is zero or not finite.
fn step<'s, S: Distance + ?Sized + 's>(
    surfaces: impl IntoIterator<Item = &'s S>,
    p: Point3,
) -> Option<Point3> {
    let (mut matrix, mut right) = ([0.0; 9], [0.0; 3]);
    for surface in surfaces {
        let (value, normal) = surface.distance(p);
        for i in 0..3 {
            right[i] += normal[i] * value;
            for j in 0..3 {
                matrix[3 * i + j] += normal[i] * normal[j];
            }
        }
    }
    if right == [0.0; 3] || right.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let (values, vectors) = symmetric_eigen(&matrix, 3);
    let most = values.iter().fold(0.0f64, |m, v| m.max(*v));
    let mut step = [0.0; 3];
    // Along directions in which the distances hardly change (a ratio of 1e-5 to the largest change,
    // squared here) the point is not determined, and takes no step.
    for (k, value) in values.iter().enumerate().filter(|v| *v.1 > 1e-10 * most) {
        let vector: Point3 = std::array::from_fn(|i| vectors[3 * k + i]);
        let along = dot(vector, right) / value;
        (0..3).for_each(|i| step[i] += along * vector[i]);
    }
    Some(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::brep::{Axes, Surface};

    #[test]
    fn a_cylinder_a_sphere_and_a_plane_meet() {
        let z = Axes::along([0.0; 3], [0.0, 0.0, 1.0]);
        let x = Axes::along([0.0; 3], [1.0, 0.0, 0.0]);
        let surfaces = [
            Surface::Cylinder(z, 0.6),
            Surface::Sphere(z, 1.0),
            Surface::Plane(x),
        ];
        let p = meet(&surfaces, [0.1, 0.5, 0.9]);
        assert!(norm([p[0], p[1] - 0.6, p[2] - 0.8]) < 1e-15, "{p:?}");
        assert!(gap(&surfaces, p) < 1e-15);
    }
}
