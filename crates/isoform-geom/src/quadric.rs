//! Surfaces for which CAD systems have names: those of degree 2, and the torus.

use crate::Point3;

/// Surface for which CAD systems have a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quadric {
    /// Plane n·x = d with |n| = 1.
    Plane {
        /// Unit normal n.
        normal: Point3,
        /// Offset d, in model units.
        offset: f64,
    },
    /// Points at the distance `radius` from the centre.
    Sphere {
        /// Centre.
        center: Point3,
        /// Radius, in model units.
        radius: f64,
    },
    /// Points at the distance `radius` from the axis.
    Cylinder {
        /// Point of the axis; for a cylinder found on a patch, the nearest to the patch's centre.
        point: Point3,
        /// Direction of the axis, of length 1.
        axis: Point3,
        /// Radius, in model units.
        radius: f64,
    },
    /// Lines through the apex at an angle to the axis.
    Cone {
        /// Apex.
        apex: Point3,
        /// Direction of the axis, of length 1.
        axis: Point3,
        /// Angle between the lines and the axis, in radians.
        half_angle: f64,
    },
    /// Points at the distance `minor` from a circle: a surface of degree 4 that CAD systems treat
    /// like quadrics.
    Torus {
        /// Centre of the circle.
        center: Point3,
        /// Normal of the circle's plane, of length 1.
        axis: Point3,
        /// Radius of the circle, in model units.
        major: f64,
        /// Radius of the tube, in model units.
        minor: f64,
    },
    /// Other quadric Σ aᵢ mᵢ = 0 with the monomials x², y², z², xy, yz, zx, x, y, z, 1 in
    /// coordinates about `origin`, in units of `scale`.
    Other {
        /// Kind and measures; `None` if rounding errors hide them.
        form: Option<NormalForm>,
        /// Origin of the coordinates, near the patch on which the quadric was found.
        origin: Point3,
        /// Unit of the coordinates, in model units.
        scale: f64,
        /// Coefficients a, of length 1.
        coefficients: [f64; 10],
    },
}

impl Quadric {
    /// Returns the name of the kind of surface, such as `cone`.
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

/// Normal form of a quadric in coordinates x, y, z along its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalForm {
    /// Kind of quadric, which determines the equation.
    pub kind: QuadricKind,
    /// Origin of the axes: the centre, the apex of a cone, the vertex of a paraboloid; for
    /// cylinders a point of the line of centres or vertices.
    pub center: Point3,
    /// Orthonormal directions of x, y and z.
    pub axes: [Point3; 3],
    /// Measures a, b and c of the equation; 0 for those that it lacks.
    pub measures: [f64; 3],
}

/// Kinds of quadrics other than spheres and cylinders and cones of revolution.
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
    /// Returns the name of the kind.
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
    /// Returns the number of measures in the equation.
    pub fn measures(self) -> usize {
        match self {
            Self::Ellipsoid | Self::HyperboloidOfOneSheet | Self::HyperboloidOfTwoSheets => 3,
            Self::ParabolicCylinder => 1,
            _ => 2,
        }
    }
}
