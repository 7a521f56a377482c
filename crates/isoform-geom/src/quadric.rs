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
    /// All points at the distance `radius` from the centre.
    Sphere {
        /// The centre.
        center: Point3,
        /// The radius, in model units.
        radius: f64,
    },
    /// All points at the distance `radius` from the axis.
    Cylinder {
        /// A point of the axis; for a cylinder found on a patch, the nearest to the patch's centre.
        point: Point3,
        /// The direction of the axis, of length 1.
        axis: Point3,
        /// The radius, in model units.
        radius: f64,
    },
    /// All lines through the apex at an angle to the axis.
    Cone {
        /// The apex.
        apex: Point3,
        /// The direction of the axis, of length 1.
        axis: Point3,
        /// The angle between the lines and the axis, in radians.
        half_angle: f64,
    },
    /// All points at the distance `minor` from a circle. It has degree 4, but CAD systems name it
    /// like quadrics.
    Torus {
        /// The centre of the circle.
        center: Point3,
        /// The normal of the circle's plane, of length 1.
        axis: Point3,
        /// The radius of the circle.
        major: f64,
        /// The radius of the tube.
        minor: f64,
    },
    /// Another quadric Σ aᵢ mᵢ = 0 with the monomials x², y², z², xy, yz, zx, x, y, z, 1 in
    /// coordinates about `origin`, in units of `scale`.
    Other {
        /// Its kind and measures, if rounding does not hide them.
        form: Option<NormalForm>,
        /// The origin of the coordinates, near the patch that the quadric was found on.
        origin: Point3,
        /// The unit of the coordinates, in model units.
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
            Self::Other { form, .. } => form.map_or("quadric", |f| f.kind.name()),
        }
    }
}

/// A quadric in coordinates x, y, z along its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalForm {
    /// Its equation.
    pub kind: QuadricKind,
    /// The point at which the axes meet: the centre, the apex of a cone, the vertex of a paraboloid;
    /// for cylinders a point of the line of centres or vertices.
    pub center: Point3,
    /// The directions of x, y and z, of length 1 and at right angles.
    pub axes: [Point3; 3],
    /// a, b and c of the equation, as many as it has; else 0.
    pub measures: [f64; 3],
}

/// The kinds of quadrics that are no spheres, and no cylinders or cones of revolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuadricKind {
    /// x²/a² + y²/b² + z²/c² = 1.
    Ellipsoid,
    /// x²/a² + y²/b² − z²/c² = 1.
    HyperboloidOfOneSheet,
    /// x²/a² + y²/b² − z²/c² = −1.
    HyperboloidOfTwoSheets,
    /// x²/a² + y²/b² = z², a and b without a unit.
    EllipticCone,
    /// x²/a² + y²/b² = 1.
    EllipticCylinder,
    /// x²/a² − y²/b² = 1.
    HyperbolicCylinder,
    /// x²/a = 2 z, with the radius of curvature a at the vertex.
    ParabolicCylinder,
    /// x²/a + y²/b = 2 z, with the radii of curvature a and b at the vertex.
    EllipticParaboloid,
    /// x²/a − y²/b = 2 z, with the radii of curvature a and b at the vertex.
    HyperbolicParaboloid,
}

impl QuadricKind {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ellipsoid => "ellipsoid",
            Self::HyperboloidOfOneSheet => "hyperboloid of one sheet",
            Self::HyperboloidOfTwoSheets => "hyperboloid of two sheets",
            Self::EllipticCone => "elliptic cone",
            Self::EllipticCylinder => "elliptic cylinder",
            Self::HyperbolicCylinder => "hyperbolic cylinder",
            Self::ParabolicCylinder => "parabolic cylinder",
            Self::EllipticParaboloid => "elliptic paraboloid",
            Self::HyperbolicParaboloid => "hyperbolic paraboloid",
        }
    }
    /// How many measures its equation has.
    pub fn measures(self) -> usize {
        match self {
            Self::Ellipsoid | Self::HyperboloidOfOneSheet | Self::HyperboloidOfTwoSheets => 3,
            Self::ParabolicCylinder => 1,
            _ => 2,
        }
    }
}
