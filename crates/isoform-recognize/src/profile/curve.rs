//! Curves of profiles.

use crate::chart::MIN_RADIUS_DEVIATIONS;

/// A point of a profile; for a body of revolution its coordinate along the axis and its distance
/// from it.
pub(crate) type PlanePoint = [f64; 2];

/// A piece of a profile: a straight line or a circle.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ProfileCurve {
    /// A point and the unit direction.
    Line(PlanePoint, PlanePoint),
    /// Centre and radius.
    Circle(PlanePoint, f64),
}

impl ProfileCurve {
    /// Returns the signed distance of a point.
    pub(crate) fn distance(&self, p: PlanePoint) -> f64 {
        match self {
            Self::Line(place, [a, b]) => {
                let d = minus(p, *place);
                d[1] * a - d[0] * b
            }
            Self::Circle(center, radius) => norm(minus(p, *center)) - radius,
        }
    }

    /// Returns true if the radius can be distinguished from noise, as [`Primitive::is_wider_than`]
    /// does.
    ///
    /// [`Primitive::is_wider_than`]: crate::chart::Primitive::is_wider_than
    pub(super) fn is_wider_than(&self, noise: f64) -> bool {
        !matches!(self, Self::Circle(_, radius) if *radius < MIN_RADIUS_DEVIATIONS * noise)
    }
}

/// Family of curves that a piece may belong to.
#[derive(Clone, Copy, Debug)]
pub(crate) enum CurveFamily {
    /// A line along the first axis.
    Along,
    /// A line along the second axis.
    Across,
    Line,
    Circle,
    /// A circle with its centre on the first axis.
    Centred,
}

impl CurveFamily {
    /// Returns the number of parameters, as priced.
    pub(super) fn numbers(self) -> usize {
        match self {
            Self::Along | Self::Across => 1,
            Self::Line => 2,
            // A circle centred on the axis has two, but zones of spheres are rare compared with
            // chamfers, which short ones resemble.
            Self::Centred | Self::Circle => 3,
        }
    }
}

/// Returns the difference of two points.
pub(super) fn minus(a: PlanePoint, b: PlanePoint) -> PlanePoint {
    [a[0] - b[0], a[1] - b[1]]
}

/// Returns the scalar product of two vectors.
pub(super) fn inner(a: PlanePoint, b: PlanePoint) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Returns the length of a vector.
pub(super) fn norm(a: PlanePoint) -> f64 {
    a[0].hypot(a[1])
}
