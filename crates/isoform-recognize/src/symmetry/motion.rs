//! Reflections and rotations of surfaces.

use crate::chart::{MAX_PARAMETERS, Primitive, PrimitiveKind, turned};
use isoform_geom::{Point3, dot, norm, sub};

/// A reflection in a plane, or a rotation about the axis of a cylinder of unspecified radius.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    pub(super) element: Primitive,
    angle: f64,
    /// Order of the rotation.
    pub(super) order: Option<u32>,
}

impl Motion {
    pub(super) fn mirror(plane: Primitive) -> Self {
        Self {
            element: plane,
            angle: 0.0,
            order: None,
        }
    }

    pub(super) fn turn(line: Primitive, angle: f64, order: Option<u32>) -> Self {
        Self {
            element: line,
            angle,
            order,
        }
    }

    /// Returns the number of parameters of the plane or the axis.
    pub(super) fn freedom(&self) -> usize {
        if self.element.kind == PrimitiveKind::Plane {
            3
        } else {
            4
        }
    }

    /// Returns the motion with its plane or axis moved.
    pub(super) fn moved(&self, theta: &[f64]) -> Self {
        let mut step = [0.0; MAX_PARAMETERS];
        step[..theta.len()].copy_from_slice(theta);
        Self {
            element: self.element.moved(&step),
            ..*self
        }
    }

    /// Returns the image of a surface.
    pub(super) fn apply(&self, s: &Primitive) -> Primitive {
        let mut image = *s;
        image.place = self.point(s.place);
        image.axis = self.vector(s.axis);
        image
    }

    pub(super) fn point(&self, p: Point3) -> Point3 {
        let arm = self.vector(sub(p, self.element.place));
        std::array::from_fn(|k| self.element.place[k] + arm[k])
    }

    fn vector(&self, v: Point3) -> Point3 {
        let axis = self.element.axis;
        if self.element.kind == PrimitiveKind::Plane {
            let h = dot(v, axis);
            return std::array::from_fn(|k| v[k] - 2.0 * h * axis[k]);
        }
        turned(v, axis, self.angle)
    }

    /// Returns true if two planes or two axes are within an angle and a length about the scan's
    /// middle.
    pub(super) fn is_near(&self, other: &Self, (angle, length): (f64, f64)) -> bool {
        let [a, b] = [&self.element, &other.element].map(|s| s.about([0.0; 3]));
        let off = sub(a.place, b.place);
        a.kind == b.kind
            && dot(a.axis, b.axis).abs() >= 1.0 - angle * angle / 2.0
            && norm(off) <= length
    }
}
