//! What a caller asks for, and the errors that say why it cannot be had.

use crate::terms::{Inner, Method, Weights};
use isoform_control::Stopped;
use isoform_geom::{Aabb, Point3};
use std::ops::RangeInclusive;

/// The bound on S of all of the paper's examples.
pub const PAPER_LIMIT: f64 = 1e-6;
/// The numbers of quadrature nodes that may be asked for: one node sees no curvature, and more than
/// these only take time.
pub const NODES: RangeInclusive<usize> = 2..=64;
/// Thresholds of the factors ω for a tolerance D, relative to the paper's thresholds for S ≤ D².
/// With larger ones the shape terms cost as much as errors of size D.
const RELAXED: f64 = 0.1;
/// The threshold of ω_J for a tolerance, relative to the other thresholds. J then counts control
/// weights, and growing raises ω_J where they become too small.
const BARRIER: f64 = 1e-4;
/// The factor by which [`Options::most_steps`] is raised for a tolerance: long valleys of S take
/// more Newton steps.
const MORE_STEPS: usize = 4;

/// How a patch is made. Lengths are in model units.
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
    /// The degrees (m, n) in u and v, each from 1 to [`crate::MOST_DEGREE`].
    pub degree: (usize, usize),
    /// The box in which surface is wanted: seeds lie in it, and sides of the patch that have left
    /// it do not grow.
    pub region: Aabb,
    /// A point near the surface to start at; with none, `seed` chooses one.
    pub seed_point: Option<Point3>,
    /// The number that chooses start points and angles; equal numbers give equal patches.
    pub seed: u64,
    /// The solver.
    pub method: Method,
    /// What L measures.
    pub inner: Inner,
    /// Quadrature nodes in each direction, in the range [`NODES`]; with none, as many as make J
    /// exact.
    pub nodes: Option<usize>,
    /// The factors ω at the start, none of them negative.
    pub start: Weights,
    /// The thresholds to which the factors ω are lowered, none of them negative.
    pub floor: Weights,
    /// The largest S, for lengths in units of the largest edge of the region.
    pub limit: f64,
    /// The largest distance of the patch from the surface, which is proved; it takes the place of
    /// the limit on S.
    pub tolerance: Option<f64>,
    /// Whether the grown patch is brought onto the surface to rounding, where its degree admits
    /// that.
    pub exact: bool,
    /// The most extrapolations.
    pub most_extrapolations: usize,
    /// The most Newton steps altogether.
    pub most_steps: usize,
}

impl Options {
    /// Patches of a degree that stay within a tolerance of the surface in a region.
    pub fn new(degree: (usize, usize), tolerance: f64, region: Aabb) -> Self {
        Self {
            tolerance: Some(tolerance),
            ..Self::paper(degree, region)
        }
    }

    /// The paper's settings (Table 2, S ≤ 10⁻⁶) for patches of a degree in a region.
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

    /// The options with thresholds that fall with D² for a tolerance D: the shape terms may not
    /// weigh more than errors of size D do.
    pub(crate) fn relaxed(&self) -> Self {
        let Some(tolerance) = self.tolerance else {
            return *self;
        };
        let share = (RELAXED * (tolerance / self.edge()).powi(2) / PAPER_LIMIT).min(1.0);
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

    /// The largest edge of the region.
    pub(crate) fn edge(&self) -> f64 {
        self.region.size().into_iter().fold(0.0, f64::max)
    }

    /// Whether a proved distance keeps the tolerance; true for every one if none is asked for.
    pub(crate) fn is_kept_by(&self, bound: f64) -> bool {
        self.tolerance.is_none_or(|t| bound <= t)
    }

    /// Refuses what is out of range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let (m, n) = self.degree;
        let range = 1..=crate::MOST_DEGREE;
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

/// The factors of [`Options::start`] in errors, in the order of [`Weights`].
const START_NAMES: [&str; 4] = [
    "the factor of J at the start",
    "the factor of L at the start",
    "the factor of R at the start",
    "the factor of E at the start",
];
/// Those of [`Options::floor`].
const FLOOR_NAMES: [&str; 4] = [
    "the threshold for the factor of J",
    "the threshold for the factor of L",
    "the threshold for the factor of R",
    "the threshold for the factor of E",
];

impl Weights {
    /// Refuses factors that are negative or not finite, by their names.
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

/// How a surface is covered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covering {
    /// The most patches, at least 1.
    pub most: usize,
    /// The depth at which every point of the surface in the region shall lie inside of some patch,
    /// which is proved: its straight distance from the patch's border, in model units.
    pub margin: Option<f64>,
    /// The distance from singular points of the surface, where ∇F = 0, within which surface without
    /// a patch is left out; with none, a hundredth of the region's largest edge.
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
    /// Refuses what is out of range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        positive("the number of patches", Some(self.most as f64))?;
        positive("the margin", self.margin)?;
        positive("the distance from singular points", self.apart)
    }
}

/// Refuses a number that is given and is not finite and positive.
fn positive(name: &'static str, value: Option<f64>) -> Result<(), Error> {
    match value {
        Some(value) if !(value.is_finite() && value > 0.0) => Err(Error::Option { name, value }),
        _ => Ok(()),
    }
}

/// Why there is no patch.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// A degree that no patch has.
    #[error("degree {0},{1}: both must be between 1 and {max}", max = crate::MOST_DEGREE)]
    Degree(usize, usize),
    /// A number among the options is out of its range.
    #[error("{name} is {value}, which is out of range")]
    Option {
        /// The option.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A number of quadrature nodes that is not in the range [`NODES`].
    #[error("{0} nodes: there must be from {least} to {most} in each direction",
        least = NODES.start(), most = NODES.end())]
    Nodes(usize),
    /// The control ended the work before there was a patch.
    #[error("stopped")]
    Stopped,
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
        /// The place.
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

impl From<Stopped> for Error {
    fn from(Stopped: Stopped) -> Self {
        Self::Stopped
    }
}
