//! Images of rays: points of seams, and of the surface near to them.

use super::Fan;
use super::direction::Direction;
use crate::surface::Point3;
use isoform_geom::{dot, sub};
use std::f64::consts::PI;

/// Distance from its node at which the bend of a ray is determined, in the node's coordinates.
const BEND_DISTANCE: f64 = 1e-3;

/// Returns the point (X/W, Y/W, Z/W).
#[inline]
fn affine([x, y, z, w]: [f64; 4]) -> Point3 {
    [x / w, y / w, z / w]
}

impl Fan {
    /// Returns the coordinate of a face of the box.
    fn face_at(&self, face: usize) -> f64 {
        if face.is_multiple_of(2) {
            -self.half_width
        } else {
            self.half_width
        }
    }
    /// Returns the point of the seam, moved onto the faces of the box on which it is known to lie.
    pub(crate) fn seam(&self, d: &Direction) -> Point3 {
        let mut p = affine(self.nodes[d.node].seam_at(d.at));
        for face in (0..6).filter(|f| d.faces >> f & 1 == 1) {
            p[face / 2] = self.face_at(face);
        }
        p
    }
    /// Returns points of the seam of a node, in equally spaced directions.
    pub(crate) fn seam_points(&self, node: usize, count: usize) -> Vec<Point3> {
        let direction = |k: usize| {
            // The offset of 0.31 avoids special directions.
            let angle = PI * (k as f64 + 0.31) / count as f64;
            Direction::new(node, [angle.cos(), angle.sin()])
        };
        (0..count).map(|k| self.seam(&direction(k))).collect()
    }

    /// Bends a ray of a tree so that its image leaves the seam at a right angle. Images of unbent
    /// rays sweep along the seam, the faster the deeper their node is in the tree.
    pub(super) fn bent(&self, mut d: Direction) -> Direction {
        let node = &self.nodes[d.node];
        if !self.is_tree || d.node == 0 || node.is_constant || self.is_side(&d) {
            return d;
        }
        let [a, b] = d.at;
        // Difference of directions, to both sides.
        let [ahead, behind] = [1e-4, -1e-4].map(|x| affine(node.seam_at([a - x * b, b + x * a])));
        let (tangent, foot) = (sub(ahead, behind), affine(node.seam_at(d.at)));
        // Displacement of the image along the seam.
        let along = |left: f64| {
            dot(
                sub(affine(node.value(d.beside(BEND_DISTANCE, left))), foot),
                tangent,
            )
        };
        // The step of difference quotients is a thousandth of the distance.
        let (mut left, step) = (0.0, 1e-3 * BEND_DISTANCE);
        // Newton steps to the curvature.
        for _ in 0..8 {
            left -= along(left) * 2.0 * step / (along(left + step) - along(left - step));
        }
        let bend = left / (BEND_DISTANCE * BEND_DISTANCE);
        // Rays that would need a larger curvature stay straight.
        if bend.abs() < 8.0 {
            d.bend = bend;
        }
        d
    }

    /// Returns the image of a point of a ray at a distance in the coordinates of its node. If
    /// `face` is given, it is the image of a point next to the ray that lies on that face of the
    /// box.
    pub(crate) fn image_on_ray(
        &self,
        d: &Direction,
        backward: bool,
        distance: f64,
        face: Option<usize>,
    ) -> Point3 {
        let node = &self.nodes[d.node];
        let value = |left: f64| node.value(d.at_distance(backward, distance, left));
        let Some(face) = face else {
            return affine(value(0.0));
        };
        let bound = self.face_at(face);
        let beyond = |left: f64| {
            let x = value(left);
            x[face / 2] - bound * x[3]
        };
        let mut left = 0.0;
        // Step of the difference quotients across the ray.
        let step = 1e-6 * distance;
        // Newton steps to the face of the box.
        for _ in 0..20 {
            let slope = (beyond(left + step) - beyond(left - step)) / (2.0 * step);
            left -= beyond(left) / slope;
        }
        let mut p = affine(value(left));
        p[face / 2] = bound;
        p
    }
}
