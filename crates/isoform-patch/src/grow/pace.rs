//! Step sizes of growing and the Newton steps in between.

use crate::options::Options;
use crate::solver::Stop;

/// Largest extrapolation at one side, in edges of the patch.
pub(crate) const MOST_GROWTH: f64 = 0.16;

/// Step sizes of growing and the Newton steps in between.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    /// Stopping rule of Newton steps after an extrapolation, far from the bound.
    pub(super) few_steps: Stop,
    /// Stopping rule of Newton steps near the bound.
    pub(super) many_steps: Stop,
    /// Half of the maximum growth in each direction, in edges: the growth at each of two moving
    /// sides.
    pub(super) most_in_direction: f64,
    /// Maximum growth at one side, in edges. With a tolerance it is twice `most_in_direction`, so
    /// that a single moving side moves as far as two sides together.
    pub(super) most_at_side: f64,
    /// Negative exponent of 4u(1 − u) in each direction in the weight of distances: with a
    /// tolerance they count more near the border.
    pub(super) border: f64,
}

impl Pace {
    /// Policy for a bound on S.
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
    /// Policy for a tolerance: distances are small compared with the patch and grow faster with its
    /// size, and the shape terms are so small that steps go far along the valleys that
    /// reparameterizations form.
    pub(crate) const STEADY: Self = Self {
        many_steps: Stop {
            steps: 80,
            decrease: 3e-3,
        },
        most_in_direction: 0.5 * MOST_GROWTH,
        ..Self::QUICK
    };
    /// Policy for a tolerance with weights for which the least-squares solution is near the minimax
    /// solution, like the Chebyshev weight.
    pub(crate) const EVEN: Self = Self {
        border: 0.5,
        ..Self::STEADY
    };

    /// Returns the policy that suits most patches.
    pub(crate) fn of(options: &Options) -> Self {
        if options.tolerance.is_some() {
            Self::EVEN
        } else {
            Self::QUICK
        }
    }
}
