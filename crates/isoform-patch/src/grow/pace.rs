//! Step sizes of growing and the Newton steps in between.

use crate::options::Options;
use crate::solver::StopRule;

/// Maximum extrapolation at one side, in edges of the patch.
pub(crate) const MAX_EXTRAPOLATION: f64 = 0.16;

/// Step sizes of growing and the Newton steps in between.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepSizePolicy {
    /// Stopping rule of Newton steps after an extrapolation, far from the bound.
    pub(super) few_steps: StopRule,
    /// Stopping rule of Newton steps near the bound.
    pub(super) many_steps: StopRule,
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

impl StepSizePolicy {
    /// Policy for a bound on S.
    pub(crate) const QUICK: Self = Self {
        few_steps: StopRule {
            steps: 3,
            decrease: 0.2,
        },
        many_steps: StopRule {
            steps: 12,
            decrease: 4e-3,
        },
        most_in_direction: MAX_EXTRAPOLATION,
        most_at_side: MAX_EXTRAPOLATION,
        border: 0.0,
    };
    /// Policy for a tolerance: distances are small compared with the patch and grow faster with its
    /// size, and the shape terms are so small that steps go far along the valleys that
    /// reparameterizations form.
    pub(crate) const STEADY: Self = Self {
        many_steps: StopRule {
            steps: 80,
            decrease: 3e-3,
        },
        most_in_direction: 0.5 * MAX_EXTRAPOLATION,
        ..Self::QUICK
    };
    /// Policy for a tolerance with weights for which the least-squares solution is near the minimax
    /// solution, like the Chebyshev weight.
    pub(crate) const EVEN: Self = Self {
        border: 0.5,
        ..Self::STEADY
    };

    /// Returns the policy that suits most patches.
    pub(crate) fn for_options(options: &Options) -> Self {
        if options.tolerance.is_some() {
            Self::EVEN
        } else {
            Self::QUICK
        }
    }
}
