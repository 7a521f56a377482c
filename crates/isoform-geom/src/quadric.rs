//! Surfaces that CAD systems have a name for: those of degree 2, and the torus.

use crate::Point3;

/// A surface that CAD systems have a name for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quadric {
    /// n·x = d with |n| = 1.
    Plane {
        /// n.
        normal: Point3,
        /// d.
        offset: f64,
    },
    /// All points at a distance from one.
    Sphere {
        /// The one.
        center: Point3,
        /// The distance.
        radius: f64,
    },
    /// All points at a distance from a line.
    Cylinder {
        /// A point of the axis: of those that were found on a patch, the nearest to its centre.
        point: Point3,
        /// The direction of the axis, of length 1.
        axis: Point3,
        /// The distance.
        radius: f64,
    },
    /// All lines through a point at an angle to another.
    Cone {
        /// The point.
        apex: Point3,
        /// The direction of the axis, of length 1.
        axis: Point3,
        /// The angle, in radians.
        half_angle: f64,
    },
    /// All points at a distance from a circle: of degree 4, but a name of CAD systems like the
    /// others.
    Torus {
        /// The middle of the circle.
        center: Point3,
        /// The normal of its plane, of length 1.
        axis: Point3,
        /// Its radius.
        major: f64,
        /// The distance.
        minor: f64,
    },
    /// Another quadric Σ aᵢ mᵢ = 0 with the monomials x², y², z², xy, yz, zx, x, y, z, 1 in
    /// coordinates about `center`, in units of `scale`.
    Other {
        /// Where the coordinates begin.
        center: Point3,
        /// Their unit.
        scale: f64,
        /// a, of length 1.
        coefficients: [f64; 10],
    },
}

impl Quadric {
    /// Its name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Plane { .. } => "plane",
            Self::Sphere { .. } => "sphere",
            Self::Cylinder { .. } => "cylinder",
            Self::Cone { .. } => "cone",
            Self::Torus { .. } => "torus",
            Self::Other { .. } => "quadric",
        }
    }
}
