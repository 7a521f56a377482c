//! The terms of S = I + ω_J J + ω_L L + ω_R R + ω_E E, their factors ω, and what they draw a patch
//! to (Wurm, Jüttler and Kim 2003, equation (1) and section 2).

use isoform_geom::Point3;

/// The exponent K of J (section 2.3).
pub const K: i32 = 8;
/// The corner parameters (uᵢ, vᵢ) of E, in the order of [`Targets::corners`].
pub(crate) const CORNERS: [(f64, f64); 4] = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];

/// The factors ω of equation (1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// ω_J.
    pub j: f64,
    /// ω_L.
    pub l: f64,
    /// ω_R.
    pub r: f64,
    /// ω_E.
    pub e: f64,
}

impl Weights {
    /// The values at the start of Table 2.
    pub const START: Self = Self {
        j: 100.0,
        l: 1.0,
        r: 1.0,
        e: 1e-2,
    };
    /// The lower thresholds of Table 2.
    pub const FLOOR: Self = Self {
        j: 1e-1,
        l: 1e-5,
        r: 1e-5,
        e: 1e-4,
    };
    /// All factors times `s`.
    pub fn scaled(self, s: f64) -> Self {
        Self {
            j: s * self.j,
            l: s * self.l,
            r: s * self.r,
            e: s * self.e,
        }
    }
}

/// The values of the terms of equation (1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms {
    /// I.
    pub i: f64,
    /// J.
    pub j: f64,
    /// L.
    pub l: f64,
    /// R.
    pub r: f64,
    /// E.
    pub e: f64,
    /// The mean squared distances of sides from the edges of the surface on which they shall lie.
    pub sides: f64,
}

impl Terms {
    /// S = I + ω_J J + ω_L L + ω_R R + ω_E E, and what sides add.
    pub fn sum(&self, w: &Weights) -> f64 {
        // Here and below each field is named, so that a further one does not compile unseen.
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

    /// Whether every term is a finite number.
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

/// What a patch is drawn to: the squared lengths l₁, l₂ of L and the points Pᵢ of E (section 3.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Targets {
    /// l₁, the aim of g₁₁.
    pub l1: f64,
    /// l₂, the aim of g₂₂.
    pub l2: f64,
    /// Pᵢ for the corners (0,0), (1,0), (0,1), (1,1).
    pub corners: [Point3; 4],
}

impl Targets {
    /// √l₁ and √l₂, the edges of the patch.
    pub(crate) fn edges(&self) -> [f64; 2] {
        [self.l1, self.l2].map(|l| l.max(f64::MIN_POSITIVE).sqrt())
    }
}

/// What measures the lengths of tangents in L.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Inner {
    /// (g₁₁ − l₁)² + (g₂₂ − l₂)², section 2.4.
    #[default]
    Lengths,
    /// Remark 1: tangents in all directions; with a = g₁₁/l₁ − 1 and b = g₂₂/l₂ − 1, l₁l₂ (a²/2 +
    /// b²/2 + (a + b)²/4).
    Tangents,
}

impl Inner {
    /// L's integrand as a sum of three squares for x = g₁₁ − l₁ and y = g₂₂ − l₂: the factors of
    /// x², y² and (x/l₁ + y/l₂)².
    pub(crate) fn factors(self, t: &Targets) -> [f64; 3] {
        match self {
            Self::Lengths => [1.0, 1.0, 0.0],
            Self::Tangents => [0.5 * t.l2 / t.l1, 0.5 * t.l1 / t.l2, 0.25 * t.l1 * t.l2],
        }
    }
}

/// How second derivatives of S are computed.
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

/// What the integrands of J, L and R depend on besides the patch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    pub(crate) method: Method,
    pub(crate) inner: Inner,
    pub(crate) weights: Weights,
    pub(crate) targets: Targets,
    /// Whether J is a mean over the control points, and no integral.
    pub(crate) is_by_control: bool,
}
