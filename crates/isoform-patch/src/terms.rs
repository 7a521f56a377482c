//! Terms of S = I + ω_J J + ω_L L + ω_R R + ω_E E, their factors ω and their targets (Wurm, Jüttler
//! and Kim 2003, equation (1) and section 2).

use isoform_geom::Point3;

/// Exponent K of J (section 2.3).
pub const K: i32 = 8;
/// Parameters (uᵢ, vᵢ) of the corners in E, in the order of [`Targets::corners`].
pub(crate) const CORNERS: [(f64, f64); 4] = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];

/// Factors ω of equation (1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Factor ω_J.
    pub j: f64,
    /// Factor ω_L.
    pub l: f64,
    /// Factor ω_R.
    pub r: f64,
    /// Factor ω_E.
    pub e: f64,
}

impl Weights {
    /// Initial values of Table 2.
    pub const START: Self = Self {
        j: 100.0,
        l: 1.0,
        r: 1.0,
        e: 1e-2,
    };
    /// Lower thresholds of Table 2.
    pub const FLOOR: Self = Self {
        j: 1e-1,
        l: 1e-5,
        r: 1e-5,
        e: 1e-4,
    };
    /// Multiplies all factors by `s`.
    pub fn scaled(self, s: f64) -> Self {
        Self {
            j: s * self.j,
            l: s * self.l,
            r: s * self.r,
            e: s * self.e,
        }
    }
}

/// Values of the terms of equation (1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms {
    /// Mean squared Sampson distance I.
    pub i: f64,
    /// Term J of the weights.
    pub j: f64,
    /// Term L of the lengths of tangents.
    pub l: f64,
    /// Term R of the angles between tangents.
    pub r: f64,
    /// Term E of the corners.
    pub e: f64,
    /// Mean squared distances of sides from the edges of the surface on which they are held.
    pub sides: f64,
}

impl Terms {
    /// Returns S = I + ω_J J + ω_L L + ω_R R + ω_E E plus the term of the sides.
    pub fn sum(&self, w: &Weights) -> f64 {
        // All fields are named here and below, so that a new field is a compile error.
        let &Self {
            i,
            j,
            l,
            r,
            e,
            sides,
        } = self;
        i + w.j * j + w.l * l + w.r * r + w.e * e + sides
    }

    /// Returns true if every term is finite.
    pub(crate) fn are_finite(&self) -> bool {
        let &Self {
            i,
            j,
            l,
            r,
            e,
            sides,
        } = self;
        [i, j, l, r, e, sides].iter().all(|t| t.is_finite())
    }
}

/// Targets of a patch: the squared lengths l₁, l₂ of L and the points Pᵢ of E (section 3.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Targets {
    /// Target l₁ of g₁₁.
    pub l1: f64,
    /// Target l₂ of g₂₂.
    pub l2: f64,
    /// Points Pᵢ of the corners (0,0), (1,0), (0,1), (1,1).
    pub corners: [Point3; 4],
}

impl Targets {
    /// Returns √l₁ and √l₂, the edges of the patch.
    pub(crate) fn edges(&self) -> [f64; 2] {
        [self.l1, self.l2].map(|l| l.max(f64::MIN_POSITIVE).sqrt())
    }
}

/// Integrand of L, which measures the lengths of tangents.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Inner {
    /// Two directions, section 2.4: (g₁₁ − l₁)² + (g₂₂ − l₂)².
    #[default]
    Lengths,
    /// All directions, Remark 1: with a = g₁₁/l₁ − 1 and b = g₂₂/l₂ − 1, l₁l₂ (a²/2 + b²/2 + (a +
    /// b)²/4).
    Tangents,
}

impl Inner {
    /// Returns L's integrand as a sum of three squares for x = g₁₁ − l₁ and y = g₂₂ − l₂: the
    /// factors of x², y² and (x/l₁ + y/l₂)².
    pub(crate) fn factors(self, t: &Targets) -> [f64; 3] {
        match self {
            Self::Lengths => [1.0, 1.0, 0.0],
            Self::Tangents => [0.5 * t.l2 / t.l1, 0.5 * t.l1 / t.l2, 0.25 * t.l1 * t.l2],
        }
    }
}

/// Method for the second derivatives of S.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Gauss-Newton with the residual F/|∇F|, whose gradient contains second derivatives of F.
    #[default]
    GaussNewton,
    /// Gauss-Newton with |∇F| taken as constant, which needs first derivatives of F only.
    Frozen,
    /// The paper's Newton method: all second derivatives, with third derivatives of F.
    Newton,
}

/// Data, other than the patch, on which the integrands of J, L and R depend.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShapeSettings {
    pub(crate) method: Method,
    pub(crate) inner: Inner,
    pub(crate) weights: Weights,
    pub(crate) targets: Targets,
    /// True if J is a mean over the control points instead of an integral.
    pub(crate) is_by_control: bool,
}
