//! What is asked for, and why it may not be had.

use crate::objective::{Inner, Method, Weights};
use isoform_geom::{Aabb, Point3};
use std::time::Instant;

/// The bound on S of all of the paper's examples.
pub const PAPER_LIMIT: f64 = 1e-6;

/// How a patch is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// The degrees (m, n) in u and v.
    pub degree: (usize, usize),
    /// Where surface is wanted: seeds lie in it, and sides of the patch that left it do not grow.
    pub region: Aabb,
    /// A point near the surface to start at; none: chosen by `seed`.
    pub seed_point: Option<Point3>,
    /// Which of the tool's own points and angles to start with.
    pub seed: u64,
    /// The solver.
    pub method: Method,
    /// What L is: that of section 2.4, or Remark 1's.
    pub inner: Inner,
    /// Quadrature nodes in each direction; none: as many as make J exact.
    pub nodes: Option<usize>,
    /// The factors ω at the start.
    pub start: Weights,
    /// What they are lowered to.
    pub floor: Weights,
    /// The largest S, for lengths in units of the largest edge of the region.
    pub limit: f64,
    /// The largest distance of the patch from the surface, proved; it takes the place of the limit
    /// on S.
    pub tolerance: Option<f64>,
    /// Afterwards bring the patch onto the surface to rounding, where its degree admits that.
    pub exact: bool,
    /// When to stop growing.
    pub deadline: Option<Instant>,
    /// The most extrapolations.
    pub most_extrapolations: usize,
    /// The most Newton steps altogether.
    pub most_steps: usize,
}

impl Options {
    /// The paper's settings (Table 2, S ≤ 10⁻⁶) for patches of that degree in a region.
    pub fn paper(degree: (usize, usize), region: Aabb) -> Self {
        Self {
            degree,
            region,
            seed_point: None,
            seed: 1,
            method: Method::default(),
            inner: Inner::default(),
            nodes: None,
            start: Weights::START,
            floor: Weights::FLOOR,
            limit: PAPER_LIMIT,
            tolerance: None,
            exact: false,
            deadline: None,
            most_extrapolations: 200,
            most_steps: 1500,
        }
    }
}

impl Options {
    /// With a tolerance D the shape terms may not weigh more than errors of its size do: their
    /// thresholds fall with D².
    pub(crate) fn relaxed(&self) -> Self {
        let Some(tolerance) = self.tolerance else {
            return *self;
        };
        let unit = self.region.size().into_iter().fold(0.0, f64::max);
        let share = (RELAXED * (tolerance / unit).powi(2) / PAPER_LIMIT).min(1.0);
        let floor = self.floor.scaled(share);
        Self {
            floor: Weights {
                j: BARRIER * floor.j,
                ..floor
            },
            most_steps: self.most_steps.saturating_mul(MORE_STEPS),
            ..*self
        }
    }
}

/// The thresholds of the factors for a tolerance D, in those for S ≤ D²;
const RELAXED: f64 = 0.1;
/// and of that of J, which counts control weights then, in these. Growing raises it where they get
/// too small.
const BARRIER: f64 = 1e-4;

/// With a tolerance there may be so many times as many Newton steps.
const MORE_STEPS: usize = 4;

/// Why there is no patch.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// A degree that no patch has.
    #[error("degree {0},{1}: both must be between 1 and {max}", max = crate::MOST_DEGREE)]
    Degree(usize, usize),
    /// A number among the options that is out of its range.
    #[error("{name} is {value}, which is out of range")]
    Option {
        /// What it is.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The region is empty or not finite.
    #[error("the region is empty or not finite")]
    Region,
    /// No point of the surface was found in the region.
    #[error("no point of the surface was found in the region")]
    NoSurface,
    /// From the point given no point of the surface in the region is reached.
    #[error("no point of the surface in the region is reached from ({}, {}, {})", at[0], at[1], at[2])]
    FarSeed {
        /// The point given.
        at: Point3,
    },
    /// The gradient vanishes at the seed.
    #[error("the surface has no tangent plane at ({}, {}, {}), or is too small for the box", at[0], at[1], at[2])]
    Singular {
        /// The seed.
        at: Point3,
    },
    /// The function or its derivatives are not finite near the seed.
    #[error("the function or a derivative of it is not finite at ({}, {}, {})", at[0], at[1], at[2])]
    NotFinite {
        /// Where.
        at: Point3,
    },
    /// The exact Hessian needs third derivatives of the function.
    #[error("the function has no third derivatives, which Newton's method needs")]
    NoThirdDerivatives,
    /// Every patch that was tried folds over.
    #[error("every patch about ({}, {}, {}) folds over", at[0], at[1], at[2])]
    Folded {
        /// The seed.
        at: Point3,
    },
    /// Not even the smallest start patch keeps the limit.
    #[error("even the smallest patch about ({}, {}, {}) exceeds the limit", at[0], at[1], at[2])]
    NoPatch {
        /// The seed.
        at: Point3,
    },
}
