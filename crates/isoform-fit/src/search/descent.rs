//! A single run of the search.

use super::{Minimum, Search, Step};
use crate::lm;
use crate::objective::Residuals;

/// A run whose variables are all this near to the best minimum (in units), with a low sum, is taken
/// to have arrived there.
const NEAR: f64 = 0.01;
/// A run ends when a step lowers its sum by less than this share.
const DECREASE: f64 = 1e-5;
/// A sum below this many times that of the best minimum is low.
const NEAR_SUM: f64 = 1.5;
/// A sum below this share of its first one is low where the best minimum is nought.
const NEAR_NOUGHT: f64 = 1e-4;
/// Steps that tell together whether a run still falls.
const WINDOW: usize = 10;
/// A run that falls by less than this share in [`WINDOW`] steps has all but stopped.
const FALLING: f64 = 0.02;
/// A run that has all but stopped is not awaited above this many times the best sum.
const HOPELESS: f64 = 4.0;

/// Where a run ended.
pub(super) struct Run {
    pub(super) x: Vec<f64>,
    pub(super) value: f64,
    /// Value at the start.
    pub(super) first: f64,
    pub(super) evaluations: usize,
    pub(super) history: Vec<Step>,
}

/// Monitor of a run.
struct Watch<'a> {
    known: Option<&'a Minimum>,
    /// Sum below which all sums count as zero.
    nought: f64,
    /// Sums at the points accepted so far.
    values: Vec<f64>,
    has_arrived: bool,
}

impl<'a> Watch<'a> {
    fn new(known: Option<&'a Minimum>, nought: f64) -> Self {
        Self {
            known,
            nought,
            values: Vec::new(),
            has_arrived: false,
        }
    }

    /// Returns true if the run should continue.
    fn is_worth(&mut self, x: &[f64], value: f64) -> bool {
        self.values.push(value);
        if let Some(known) = self.known {
            self.has_arrived = self.is_low(known, value) && is_near(&known.x, x);
            if self.has_arrived || self.is_hopeless(known, value) {
                return false;
            }
        }
        value > self.nought
    }

    fn is_low(&self, known: &Minimum, value: f64) -> bool {
        value < NEAR_SUM * known.value
            || (known.value <= self.nought && value < NEAR_NOUGHT * self.first())
    }

    /// Returns true if a run far above the best minimum has almost stopped: it fell by less than 2
    /// % in the last ten steps.
    fn is_hopeless(&self, known: &Minimum, value: f64) -> bool {
        let before = self.values.iter().rev().nth(WINDOW);
        before.is_some_and(|v| v - value < FALLING * value) && value > HOPELESS * known.value
    }

    /// Returns the result of a run: the known minimum, if it has arrived there.
    fn end(&self, m: lm::Minimum) -> (Vec<f64>, f64) {
        match self.known.filter(|_| self.has_arrived) {
            Some(known) => (known.x.clone(), known.value),
            None => (m.x, m.value),
        }
    }

    fn first(&self) -> f64 {
        self.values.first().copied().unwrap_or(f64::INFINITY)
    }
}

/// Returns true if all variables are within 0.01 units of each other.
fn is_near(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(u, v)| (u - v).abs() < NEAR)
}

impl Search<'_> {
    /// Runs one descent; it ends early at a known minimum, or if it is hopeless.
    pub(super) fn descend(
        &self,
        x: Vec<f64>,
        known: Option<&Minimum>,
        nought: f64,
        start: usize,
    ) -> Run {
        let field = self.template.algebraic();
        let mut objective = Residuals::new(field, self.points, &[], self.space);
        let count = self.points.len().max(1) as f64;
        let mut history = Vec::new();
        let mut watch = Watch::new(known, nought);
        let mut monitor = |iteration: usize, x: &[f64], value: f64| {
            history.push(Step::new(start, iteration, value, count));
            watch.is_worth(x, value) && !self.control.is_stopped()
        };
        let settings = lm::Options {
            decrease: DECREASE,
            ..lm::Options::default()
        };
        let m = self
            .space
            .minimize(&mut objective, x, &settings, &mut monitor);
        let evaluations = m.iterations;
        let (x, value) = watch.end(m);
        Run {
            x,
            value,
            first: watch.first(),
            evaluations,
            history,
        }
    }
}
