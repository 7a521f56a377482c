//! Options of parameterization and covering, and the errors of both.

use crate::terms::{Inner, Method, Weights};
use isoform_control::Stopped;
use isoform_geom::{Aabb, Point3};
use std::ops::RangeInclusive;

/// Bound on S of all examples of the paper.
pub const PAPER_LIMIT: f64 = 1e-6;
/// Range of the number of quadrature nodes in each direction: one node is blind to curvature, and
/// more than 64 only take time.
pub const NODES: RangeInclusive<usize> = 2..=64;

/// Options of a patch. Lengths are in model units.
///
/// ```
/// use isoform_geom::Aabb;
/// use isoform_patch::{Method, Options};
///
/// let region = Aabb { lo: [-1.0; 3], hi: [1.0; 3] };
/// let options = Options { seed: 7, ..Options::new((3, 3), 1e-4, region) };
/// assert_eq!(options.tolerance, Some(1e-4));
/// assert_eq!(options.method, Method::GaussNewton);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Degrees (m, n) in u and v, each from 1 to [`crate::MAX_PATCH_DEGREE`].
    pub degree: (usize, usize),
    /// Box in which the surface is parameterized: seeds lie in it, and sides of the patch that have
    /// left it do not grow.
    pub region: Aabb,
    /// Point near the surface at which to start; `None` lets `seed` choose one.
    pub seed_point: Option<Point3>,
    /// Random seed of start points and angles; equal seeds give equal patches.
    pub seed: u64,
    /// Method of the solver.
    pub method: Method,
    /// Integrand of L.
    pub inner: Inner,
    /// Number of quadrature nodes in each direction, in the range [`NODES`]; `None` chooses the
    /// number with which J is exact.
    pub nodes: Option<usize>,
    /// Factors ω at the start, none of them negative.
    pub start: Weights,
    /// Thresholds to which the factors ω are lowered, none of them negative.
    pub floor: Weights,
    /// Upper bound on S, for lengths in units of the largest edge of the region.
    pub limit: f64,
    /// Maximum distance of the patch from the surface, which is proved; it replaces the limit on S.
    pub tolerance: Option<f64>,
    /// True if the grown patch is to be brought onto the surface to rounding, if its degree admits
    /// that.
    pub exact: bool,
    /// Maximum number of extrapolations.
    pub most_extrapolations: usize,
    /// Maximum total number of Newton steps.
    pub most_steps: usize,
}

impl Options {
    /// Returns options for patches of a degree that stay within a tolerance of the surface in a
    /// region.
    pub fn new(degree: (usize, usize), tolerance: f64, region: Aabb) -> Self {
        Self {
            tolerance: Some(tolerance),
            ..Self::paper(degree, region)
        }
    }

    /// Returns the paper's settings (Table 2, S ≤ 10⁻⁶) for patches of a degree in a region.
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
            most_extrapolations: 200,
            most_steps: 1500,
        }
    }

    /// Returns the options with thresholds proportional to D² for a tolerance D, so that the shape
    /// terms do not weigh more than errors of size D.
    pub(crate) fn relaxed(&self) -> Self {
        let Some(tolerance) = self.tolerance else {
            return *self;
        };
        // With larger thresholds the shape terms cost as much as errors of size D.
        let share = (0.1 * (tolerance / self.edge()).powi(2) / PAPER_LIMIT).min(1.0);
        let floor = self.floor.scaled(share);
        Self {
            floor: Weights {
                // J then counts control weights, and growing raises ω_J where they become too
                // small.
                j: 1e-4 * floor.j,
                ..floor
            },
            // Long valleys of S take more Newton steps.
            most_steps: self.most_steps.saturating_mul(4),
            ..*self
        }
    }

    /// Returns the largest edge of the region.
    pub(crate) fn edge(&self) -> f64 {
        self.region.size().into_iter().fold(0.0, f64::max)
    }

    /// Returns true if a proved distance keeps the tolerance, or if no tolerance is set.
    pub(crate) fn is_kept_by(&self, bound: f64) -> bool {
        self.tolerance.is_none_or(|t| bound <= t)
    }

    /// Checks that all options are in range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let (m, n) = self.degree;
        let range = 1..=crate::MAX_PATCH_DEGREE;
        if !range.contains(&m) || !range.contains(&n) {
            return Err(Error::Degree(m, n));
        }
        let size = self.region.size();
        if !size.iter().all(|s| *s > 0.0 && s.is_finite()) {
            return Err(Error::Region);
        }
        positive("the bound on S", Some(self.limit))?;
        positive("the tolerance", self.tolerance)?;
        if let Some(nodes) = self.nodes.filter(|n| !NODES.contains(n)) {
            return Err(Error::Nodes(nodes));
        }
        self.start.check(START_NAMES)?;
        self.floor.check(FLOOR_NAMES)?;
        match self.seed_point {
            Some(at) if !at.iter().all(|v| v.is_finite()) => Err(Error::NotFinite { at }),
            _ => Ok(()),
        }
    }
}

/// Names in errors of the factors of [`Options::start`], in the order of [`Weights`].
const START_NAMES: [&str; 4] = [
    "the factor of J at the start",
    "the factor of L at the start",
    "the factor of R at the start",
    "the factor of E at the start",
];
/// Names in errors of the factors of [`Options::floor`], in the order of [`Weights`].
const FLOOR_NAMES: [&str; 4] = [
    "the threshold for the factor of J",
    "the threshold for the factor of L",
    "the threshold for the factor of R",
    "the threshold for the factor of E",
];

impl Weights {
    /// Rejects factors that are negative or not finite.
    fn check(&self, names: [&'static str; 4]) -> Result<(), Error> {
        let &Self { j, l, r, e } = self;
        let all = names.into_iter().zip([j, l, r, e]);
        for (name, value) in all {
            if !(value.is_finite() && value >= 0.0) {
                return Err(Error::Option { name, value });
            }
        }
        Ok(())
    }
}

/// Options of a cover.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covering {
    /// Maximum number of patches, at least 1.
    pub most: usize,
    /// Depth at which every point of the surface in the region must lie inside some patch, which is
    /// proved: its straight distance from the patch's border, in model units. `None` requires no
    /// depth.
    pub margin: Option<f64>,
    /// Radius around singular points of the surface, where ∇F = 0, within which surface without a
    /// patch is left out; `None` means a hundredth of the region's largest edge.
    pub apart: Option<f64>,
}

impl Default for Covering {
    fn default() -> Self {
        Self {
            most: 1000,
            margin: None,
            apart: None,
        }
    }
}

impl Covering {
    /// Checks that all options are in range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        positive("the number of patches", Some(self.most as f64))?;
        positive("the margin", self.margin)?;
        positive("the distance from singular points", self.apart)
    }
}

/// Rejects a given number that is not finite and positive.
fn positive(name: &'static str, value: Option<f64>) -> Result<(), Error> {
    match value {
        Some(value) if !(value.is_finite() && value > 0.0) => Err(Error::Option { name, value }),
        _ => Ok(()),
    }
}

/// Reason why no patch was made.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// A degree is out of range.
    #[error("degree {0},{1}: both must be between 1 and {max}", max = crate::MAX_PATCH_DEGREE)]
    Degree(usize, usize),
    /// An option is out of range.
    #[error("{name} is {value}, which is out of range")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// Value of the option.
        value: f64,
    },
    /// The number of quadrature nodes is not in the range [`NODES`].
    #[error("{0} nodes: there must be from {least} to {most} in each direction",
        least = NODES.start(), most = NODES.end())]
    Nodes(usize),
    /// The control stopped the work before there was a patch.
    #[error("stopped")]
    Stopped,
    /// The region is empty or not finite.
    #[error("the region is empty or not finite")]
    Region,
    /// No point of the surface was found in the region.
    #[error("no point of the surface was found in the region")]
    NoSurface,
    /// No point of the surface in the region is reached from the given point.
    #[error("no point of the surface in the region is reached from ({}, {}, {})", at[0], at[1], at[2])]
    FarSeed {
        /// Given point.
        at: Point3,
    },
    /// The gradient vanishes at the seed.
    #[error("the surface has no tangent plane at ({}, {}, {}), or is too small for the box", at[0], at[1], at[2])]
    Singular {
        /// Seed point.
        at: Point3,
    },
    /// The function or its derivatives are not finite near the seed.
    #[error("the function or a derivative of it is not finite at ({}, {}, {})", at[0], at[1], at[2])]
    NotFinite {
        /// Point of evaluation.
        at: Point3,
    },
    /// The exact Hessian needs third derivatives, which the function lacks.
    #[error("the function has no third derivatives, which Newton's method needs")]
    NoThirdDerivatives,
    /// Every patch that was tried folds over.
    #[error("every patch about ({}, {}, {}) folds over", at[0], at[1], at[2])]
    Folded {
        /// Seed point.
        at: Point3,
    },
    /// Even the smallest start patch exceeds the limit.
    #[error("even the smallest patch about ({}, {}, {}) exceeds the limit", at[0], at[1], at[2])]
    NoPatch {
        /// Seed point.
        at: Point3,
    },
}

impl From<Stopped> for Error {
    fn from(Stopped: Stopped) -> Self {
        Self::Stopped
    }
}
