//! How fast a patch grows, and what Newton steps make of it in between.

use crate::options::Options;
use crate::solver::Stop;

/// The largest extrapolation at one side, in edges of the patch.
pub(crate) const MOST_GROWTH: f64 = 0.16;

/// How fast a patch grows, and what Newton steps make of it in between.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    /// Newton steps after an extrapolation, far from the bound.
    pub(super) few_steps: Stop,
    /// Newton steps near the bound.
    pub(super) many_steps: Stop,
    /// The most that a patch grows by in each direction, in half edges.
    pub(super) most_in_direction: f64,
    /// The most that a patch grows by at one side, in edges: where only one side moves, it moves by
    /// what two would.
    pub(super) most_at_side: f64,
    /// With a tolerance distances count more towards the border, by (4u(1 − u)) to this power,
    /// negative, in each direction.
    pub(super) border: f64,
}

impl Pace {
    /// For a bound on S.
    pub(crate) const QUICK: Self = Self {
        few_steps: Stop {
            steps: 3,
            decrease: 0.2,
        },
        many_steps: Stop {
            steps: 12,
            decrease: 4e-3,
        },
        most_in_direction: MOST_GROWTH,
        most_at_side: MOST_GROWTH,
        border: 0.0,
    };
    /// For a tolerance: distances are small against the patch and rise faster with its size, and
    /// the shape terms are so small that steps have far to go along the valleys that
    /// parameterizations make.
    pub(crate) const STEADY: Self = Self {
        many_steps: Stop {
            steps: 80,
            decrease: 3e-3,
        },
        most_in_direction: 0.5 * MOST_GROWTH,
        ..Self::QUICK
    };
    /// For a tolerance, with weights for which least squares come near the least maximum, as
    /// Chebyshev's do.
    pub(crate) const EVEN: Self = Self {
        border: 0.5,
        ..Self::STEADY
    };

    /// The best one for most patches.
    pub(crate) fn of(options: &Options) -> Self {
        if options.tolerance.is_some() {
            Self::EVEN
        } else {
            Self::QUICK
        }
    }
}
