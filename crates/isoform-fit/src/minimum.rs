//! The minimum from which the last stages of a fit start.

use crate::polish::PolishResult;
use crate::search::{ConvergenceStep, SearchOutcome};
use crate::{Loss, lm};

/// A minimum of the metric residual (of the algebraic one for the methods of paper C).
pub(crate) struct FitMinimum {
    pub(crate) x: Vec<f64>,
    pub(crate) loss: Loss,
    pub(crate) outcome: SearchOutcome,
    pub(crate) evaluations: usize,
    pub(crate) history: Vec<ConvergenceStep>,
    pub(crate) stop: Option<lm::Stop>,
    pub(crate) complete: bool,
    /// True if the remaining distances look like noise.
    pub(crate) is_at_noise: bool,
}

impl FitMinimum {
    /// Takes over the variables, the evaluations and the history of a polish.
    pub(crate) fn take(&mut self, polished: PolishResult) {
        self.x = polished.x;
        self.evaluations += polished.evaluations;
        self.history.extend(polished.history);
    }
}
