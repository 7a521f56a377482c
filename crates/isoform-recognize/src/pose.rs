//! Canonical pose of a scan, so that results do not depend on its orientation.
//!
//! Regions grow from seeds in an order, and fits take samples of points by their index: if two
//! descriptions are nearly equally good, that order decides.

use crate::chart::{Primitive, unit};
use isoform_geom::{Point3, cross, dot, sub};
use isoform_num::linalg::symmetric_eigen;

/// Two vectors in general position, by which the scan is rotated away from its principal axes:
/// faces are often perpendicular to these, and rounding would decide on the order of their points
/// by coordinates.
const TILTED_AXES: [Point3; 2] = [[0.81, 0.37, -0.29], [-0.23, 0.71, 0.53]];

/// A rotation: the axes of the new frame in the old one.
pub(crate) struct Pose([Point3; 3]);

impl Pose {
    /// Returns the pose from the principal axes of points, directed towards their longer tails; it
    /// turns with the points.
    pub(crate) fn from_points(points: &[Point3]) -> Self {
        let count = points.len().max(1) as f64;
        let sum = |of: &dyn Fn(&Point3) -> f64| points.iter().map(of).sum::<f64>();
        let center: Point3 = std::array::from_fn(|k| sum(&|p| p[k]) / count);
        let moment =
            |k: usize| sum(&|p| (p[k / 3] - center[k / 3]) * (p[k % 3] - center[k % 3])) / count;
        let moments: [f64; 9] = std::array::from_fn(moment);
        let (_, vectors) = symmetric_eigen(&moments, 3);
        let axis = |k: usize| -> Point3 {
            let v: Point3 = std::array::from_fn(|i| vectors[3 * k + i]);
            let tail = sum(&|p| dot(sub(*p, center), v).powi(3));
            v.map(|x| if tail < 0.0 { -x } else { x })
        };
        let (long, middle) = (axis(2), axis(1));
        let axes = [long, middle, cross(long, middle)];
        let turned = |v: Point3| -> Point3 {
            std::array::from_fn(|k| (0..3).map(|i| v[i] * axes[i][k]).sum())
        };
        let first = unit(turned(TILTED_AXES[0]));
        let third = unit(cross(first, turned(TILTED_AXES[1])));
        Self([first, cross(third, first), third])
    }

    /// Maps a vector to the new frame.
    pub(crate) fn turn(&self, v: Point3) -> Point3 {
        self.0.map(|axis| dot(axis, v))
    }

    /// Maps a vector of the new frame to the old one.
    pub(crate) fn back(&self, v: Point3) -> Point3 {
        std::array::from_fn(|k| (0..3).map(|i| v[i] * self.0[i][k]).sum())
    }

    /// Maps a surface of the new frame to the old one.
    pub(crate) fn surface_back(&self, surface: &Primitive) -> Primitive {
        Primitive {
            place: self.back(surface.place),
            axis: self.back(surface.axis),
            ..*surface
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::norm;
    use isoform_num::Random;

    fn points() -> Vec<Point3> {
        let mut random = Random::new(3);
        let mut point = || {
            let [x, y, z] = [random.unit(), random.unit(), random.unit()];
            [3.0 * x * x, 2.0 * y * y, z * z]
        };
        (0..500).map(|_| point()).collect()
    }

    #[test]
    fn turned_points_come_to_lie_as_they_did() {
        let points = points();
        let other =
            Pose::from_points(&[[1.0, 0.2, 0.1], [0.0; 3], [-2.0, 1.5, 0.3], [0.1, 0.3, 0.9]]);
        let turned: Vec<Point3> = points.iter().map(|p| other.turn(*p)).collect();
        let (one, two) = (Pose::from_points(&points), Pose::from_points(&turned));
        for (p, q) in points.iter().zip(&turned) {
            assert!(norm(sub(one.turn(*p), two.turn(*q))) < 1e-12);
            assert!(norm(sub(one.back(one.turn(*p)), *p)) < 1e-14);
        }
    }
}
