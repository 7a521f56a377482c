//! Images of rays: points of seams, and of the surface near to them.

use super::Fan;
use super::direction::Direction;
use crate::surface::Point3;
use isoform_geom::{dot, sub};
use std::f64::consts::PI;

/// Distance from its node at which the bend of a ray is determined, in the node's coordinates.
const BENT: f64 = 1e-3;
/// The largest curvature: rays that would need more stay straight.
const MOST_BENT: f64 = 8.0;
/// Newton steps to the curvature.
const BENDING_STEPS: usize = 8;
/// The difference of directions, to both sides, from which a seam's tangent is taken.
const TANGENT_STEP: f64 = 1e-4;
/// The difference beside a ray from which derivatives are taken, in shares of the distance from the
/// node, for its curvature.
const BEND_STEP: f64 = 1e-3;
/// The difference beside a ray from which derivatives are taken, in shares of the distance from the
/// node, where a face of the box is approached.
const FACE_STEP: f64 = 1e-6;
/// Newton steps to a face of the box.
const FACE_STEPS: usize = 20;
/// Where points of a seam begin, in shares of their distance: at no direction that is special.
const FIRST_POINT: f64 = 0.31;

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
            let angle = PI * (k as f64 + FIRST_POINT) / count as f64;
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
        let [ahead, behind] =
            [TANGENT_STEP, -TANGENT_STEP].map(|x| affine(node.seam_at([a - x * b, b + x * a])));
        let (tangent, foot) = (sub(ahead, behind), affine(node.seam_at(d.at)));
        // Displacement of the image along the seam.
        let along = |left: f64| dot(sub(affine(node.value(d.beside(BENT, left))), foot), tangent);
        let (mut left, step) = (0.0, BEND_STEP * BENT);
        for _ in 0..BENDING_STEPS {
            left -= along(left) * 2.0 * step / (along(left + step) - along(left - step));
        }
        let bend = left / (BENT * BENT);
        if bend.abs() < MOST_BENT {
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
        let step = FACE_STEP * distance;
        for _ in 0..FACE_STEPS {
            let slope = (beyond(left + step) - beyond(left - step)) / (2.0 * step);
            left -= beyond(left) / slope;
        }
        let mut p = affine(value(left));
        p[face / 2] = bound;
        p
    }
}
