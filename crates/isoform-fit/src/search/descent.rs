//! A single run of the search.

use super::minima::{ConvergenceStep, RunResult, SearchMinimum, is_low, is_near};
use super::problem::MinimumSearch;
use crate::lm;
use crate::residuals::Residuals;

/// Monitor of a run.
struct RunMonitor<'a> {
    known: Option<&'a SearchMinimum>,
    /// Sum below which all sums count as zero.
    nought: f64,
    /// Sums at the points accepted so far.
    values: Vec<f64>,
    has_arrived: bool,
}

impl<'a> RunMonitor<'a> {
    fn new(known: Option<&'a SearchMinimum>, nought: f64) -> Self {
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
            let is_zero = known.value <= self.nought && value < 1e-4 * self.first();
            self.has_arrived = (is_low(value, known.value) || is_zero) && is_near(&known.x, x);
            if self.has_arrived || self.is_hopeless(known, value) {
                return false;
            }
        }
        value > self.nought
    }

    /// Returns true if a run far above the best minimum has almost stopped: it fell by less than 2
    /// % in the last ten steps.
    fn is_hopeless(&self, known: &SearchMinimum, value: f64) -> bool {
        let before = self.values.iter().rev().nth(10);
        before.is_some_and(|v| v - value < 0.02 * value) && value > 4.0 * known.value
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

impl MinimumSearch<'_> {
    /// Runs one descent; it ends early at a known minimum, or if it is hopeless.
    pub(super) fn descend(
        &self,
        x: Vec<f64>,
        known: Option<&SearchMinimum>,
        nought: f64,
        start: usize,
    ) -> RunResult {
        let field = self.template.algebraic();
        let mut objective = Residuals::new(field, self.points, &[], self.space);
        let count = self.points.len().max(1) as f64;
        let mut history = Vec::new();
        let mut watch = RunMonitor::new(known, nought);
        let mut monitor = |iteration: usize, x: &[f64], value: f64| {
            history.push(ConvergenceStep::new(start, iteration, value, count));
            watch.is_worth(x, value) && !self.control.is_stopped()
        };
        let settings = lm::LmOptions {
            decrease: 1e-5,
            ..lm::LmOptions::default()
        };
        let m = self
            .space
            .minimize(&mut objective, x, &settings, &mut monitor);
        let evaluations = m.iterations;
        let (x, value) = watch.end(m);
        RunResult {
            x,
            value,
            first: watch.first(),
            evaluations,
            history,
        }
    }
}
