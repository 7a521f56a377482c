//! Functions of the HyperFun library that are single nodes of expressions: primitives, blends,
//! signed distances.
//!
//! A new primitive is one variant here, with arms in [`Library::arity`], [`Library::algebraic`]
//! and, if its distance has a closed form, [`Library::metric`]; if it has kinks, `has_kink` must
//! name it. Its HyperFun name and the types of its arguments are listed in the table of
//! `hyperfun::functions`. Formulas: HyperFun library (f ≥ 0 inside), ../../../docs/hyperfun.md;
//! u = x − c throughout.

use crate::imported::Imported;
use crate::native;
use isoform_num::{Interval, Real};

/// A coordinate axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the axis of its name")]
pub enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    /// Returns the indices (p, q, axis) of the other two axes and of this one, a right-handed
    /// triple.
    pub fn indices(self) -> (usize, usize, usize) {
        match self {
            Self::X => (1, 2, 0),
            Self::Y => (2, 0, 1),
            Self::Z => (0, 1, 2),
        }
    }
}

/// Library function that is one node of an expression. Arguments are flat, in HyperFun's order; a
/// point is three arguments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Library {
    /// x, c, R: R² − |u|²
    Sphere,
    /// x, c, a, b, d: 1 − (u₁/a)² − (u₂/b)² − (u₃/d)²
    Ellipsoid,
    /// x, c, R, r: r² − |u|² − R² + 2 R p, p the distance to the axis
    Torus(Axis),
    /// x, c, R: R² − p²
    Cylinder(Axis),
    /// x, c, a, b: 1 − (first other coordinate / a)² − (second / b)²
    EllipticCylinder(Axis),
    /// x, v, dx, dy, dz: R-intersection of the slabs (xᵢ − vᵢ)(vᵢ + dᵢ − xᵢ)
    Block,
    /// x, c, R: h² − (p/R)², double cone
    Cone(Axis),
    /// x, c, a, b: h² − (first other coordinate / a)² − (second / b)²
    EllipticCone(Axis),
    /// x, c, a, b, d, s1, s2: 1 − (|u₁/a|^(2/s2) + |u₂/b|^(2/s2))^(s2/s1) − |u₃/d|^(2/s1)
    Superellipsoid,
    /// f1, f2, a0, a1, a2: f1 | f2 + a0 / (1 + (f1/a1)² + (f2/a2)²)
    BlendUnion,
    /// f1, f2, a0, a1, a2: f1 & f2 + a0 / (1 + (f1/a1)² + (f2/a2)²)
    BlendIntersection,
    /// f1, f2, r: circular blend of max
    DistanceBlendUnion,
    /// f1, f2, r: circular blend of min
    DistanceBlendIntersection,
    /// f1, f2, R, alpha: SARDF union (Fayolle, Pasko, Schmitt)
    SardfUnion,
    /// f1, f2, R, alpha: SARDF intersection
    SardfIntersection,
    /// x, c, R: signed distance to the double cone
    DistanceCone(Axis),
    /// x, c, dir, R: R − |dir × u| / |dir|
    DistanceCylinder,
    /// x, c, R, r: r − √((p − R)² + h²)
    DistanceTorus(Axis),
    /// x, c, a, b, d: signed distance to the ellipsoid
    DistanceEllipsoid,
}

/// Family of library functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Family {
    /// A function of a point.
    Primitive,
    /// A set operation of two functions with a displacement added.
    Displaced,
    /// A set operation of two distances with a circular blend.
    Circular {
        /// True for a union.
        is_union: bool,
    },
    /// A signed-distance set operation of two functions.
    Sardf {
        /// True for a union.
        is_union: bool,
    },
}

/// Functions without a formula: computed by iteration, evaluated in any number type by Newton steps
/// on the whole jet, or given by data.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Native {
    /// u₁, u₂, u₃, a, b, d: signed distance of u to the ellipsoid about 0, positive inside
    EllipsoidDistance,
    /// f1, f2, R: second largest real root of m⁴ − 4√R m³ − 4R m² + 4√R (f1+f2) m − (f1²+f2²)
    SardfRoot,
    /// u, v: C's fmod
    Fmod,
    /// x, y, z: Perlin's gradient noise with a fixed permutation, in about \[−1, 1\]
    PerlinNoise,
    /// x, y, z: a function of a file
    Imported(Imported),
}

impl Native {
    /// Evaluates the function in any number type.
    pub fn eval<R: Real>(&self, args: &[R]) -> R {
        match self {
            Self::EllipsoidDistance => native::ellipsoid_distance(args),
            Self::SardfRoot => native::sardf_root(args),
            Self::Fmod => native::fmod(args),
            Self::PerlinNoise => native::perlin(args),
            Self::Imported(of) => of.eval(args),
        }
    }

    /// Returns an interval that contains the function for all arguments in the given ones, or the
    /// whole line: an iteration does not enclose its values if it runs on intervals.
    pub(crate) fn range(&self, args: &[Interval]) -> Interval {
        match self {
            Self::Imported(of) => of.range(args),
            Self::EllipsoidDistance | Self::SardfRoot | Self::Fmod | Self::PerlinNoise => {
                Interval::ALL
            }
        }
    }
}

impl Library {
    /// Returns the number of flat arguments.
    pub fn arity(self) -> usize {
        match self {
            Self::Sphere | Self::Cylinder(_) | Self::Cone(_) | Self::DistanceCone(_) => 7,
            Self::EllipticCylinder(_)
            | Self::EllipticCone(_)
            | Self::Torus(_)
            | Self::DistanceTorus(_) => 8,
            Self::Ellipsoid | Self::Block | Self::DistanceEllipsoid => 9,
            Self::DistanceCylinder => 10,
            Self::Superellipsoid => 11,
            Self::BlendUnion | Self::BlendIntersection => 5,
            Self::DistanceBlendUnion | Self::DistanceBlendIntersection => 3,
            Self::SardfUnion | Self::SardfIntersection => 4,
        }
    }

    /// Returns the family, which determines how a tree that contains the function is decomposed.
    pub(crate) fn family(self) -> Family {
        match self {
            Self::Sphere
            | Self::Ellipsoid
            | Self::Torus(_)
            | Self::Cylinder(_)
            | Self::EllipticCylinder(_)
            | Self::Block
            | Self::Cone(_)
            | Self::EllipticCone(_)
            | Self::Superellipsoid
            | Self::DistanceCone(_)
            | Self::DistanceCylinder
            | Self::DistanceTorus(_)
            | Self::DistanceEllipsoid => Family::Primitive,
            Self::BlendUnion | Self::BlendIntersection => Family::Displaced,
            Self::DistanceBlendUnion => Family::Circular { is_union: true },
            Self::DistanceBlendIntersection => Family::Circular { is_union: false },
            Self::SardfUnion => Family::Sardf { is_union: true },
            Self::SardfIntersection => Family::Sardf { is_union: false },
        }
    }

    /// Returns true for primitives, whose first three arguments are the point of evaluation.
    pub fn is_primitive(self) -> bool {
        self.family() == Family::Primitive
    }

    /// Returns true if the formula has kinks.
    pub(crate) fn has_kink(self) -> bool {
        match self {
            Self::DistanceCone(_)
            | Self::Superellipsoid
            | Self::SardfUnion
            | Self::SardfIntersection => true,
            Self::Sphere
            | Self::Ellipsoid
            | Self::Torus(_)
            | Self::Cylinder(_)
            | Self::EllipticCylinder(_)
            | Self::Block
            | Self::Cone(_)
            | Self::EllipticCone(_)
            | Self::BlendUnion
            | Self::BlendIntersection
            | Self::DistanceBlendUnion
            | Self::DistanceBlendIntersection
            | Self::DistanceCylinder
            | Self::DistanceTorus(_)
            | Self::DistanceEllipsoid => false,
        }
    }
}
