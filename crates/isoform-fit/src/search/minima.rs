//! Runs of a search, and the minima that they found.

/// Relative difference of sums below which two minima count as one: converged runs agree to 1e-6,
/// distinct minima of the noise differ by more than 2 % on 512 points, and the nearly equal ones of
/// nested R-functions (1e-4) should count as one.
pub(super) const SAME_SUM_SHARE: f64 = 5e-3;

/// A minimum of the algebraic sum over the search points.
#[derive(Clone, Debug)]
pub(crate) struct SearchMinimum {
    pub(crate) x: Vec<f64>,
    pub(crate) value: f64,
    /// Number of starts that led there.
    pub(crate) hits: usize,
}

/// One line of the convergence history.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvergenceStep {
    /// Start of the step; the polish has its own number, one past the last.
    pub start: usize,
    /// Number of the evaluation.
    pub iteration: usize,
    /// Root mean square of the residual: algebraic in the search, metric in the polish.
    pub rms: f64,
}

impl ConvergenceStep {
    /// Makes a step from a sum of squares over `count` points.
    pub(crate) fn new(start: usize, iteration: usize, sum: f64, count: f64) -> Self {
        Self {
            start,
            iteration,
            rms: (sum / count).sqrt(),
        }
    }
}

/// Outcome of the search.
#[derive(Clone, Debug, Default)]
pub(crate) struct SearchOutcome {
    /// Distinct minima, best first.
    pub(crate) minima: Vec<SearchMinimum>,
    pub(crate) starts: usize,
    pub(crate) evaluations: usize,
    /// True if the best minimum recurred as often as required.
    pub(crate) certain: bool,
    pub(crate) stopped: bool,
    pub(crate) history: Vec<ConvergenceStep>,
    /// Sums at the first points of runs with a finite result.
    pub(crate) firsts: Vec<f64>,
}

impl SearchOutcome {
    /// Returns true if there is a minimum to continue from, and time.
    pub(crate) fn can_go_on(&self) -> bool {
        !self.stopped && !self.minima.is_empty()
    }

    /// Returns the sum below which all sums count as zero: the data have no noise.
    pub(super) fn nought(&self) -> f64 {
        1e-10 * median(&self.firsts)
    }

    /// Adds a run from a start.
    pub(super) fn count(&mut self, run: RunResult) {
        self.starts += 1;
        self.evaluations += run.evaluations;
        self.history.extend(run.history);
        if run.value.is_finite() {
            self.firsts.push(run.first);
            let nought = self.nought();
            self.insert(run.x, run.value, nought, true);
        }
    }

    /// Inserts a minimum and returns its index.
    pub(super) fn insert(&mut self, x: Vec<f64>, value: f64, nought: f64, counts: bool) -> usize {
        let is_same = |m: &SearchMinimum| {
            (m.value - value).abs() <= SAME_SUM_SHARE * m.value.min(value)
                || (m.value <= nought && value <= nought)
        };
        let hits = usize::from(counts);
        if let Some(at) = self.minima.iter().position(is_same) {
            let m = &mut self.minima[at];
            m.hits += hits;
            if value < m.value {
                (m.x, m.value) = (x, value);
            }
            return at;
        }
        let at = self.minima.partition_point(|m| m.value <= value);
        self.minima.insert(at, SearchMinimum { x, value, hits });
        at
    }

    pub(super) fn best(&self) -> f64 {
        self.minima.first().map_or(f64::INFINITY, |m| m.value)
    }
}

/// Returns true if a run with this sum will end at the best known minimum, if it is also near.
pub(crate) fn is_low(value: f64, best: f64) -> bool {
    value < 1.5 * best
}

/// Returns true if all variables are within 0.01 units of each other.
pub(crate) fn is_near(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(u, v)| (u - v).abs() < 0.01)
}

/// Returns the upper median.
fn median(v: &[f64]) -> f64 {
    crate::outliers::median(&mut v.to_vec())
}

/// Result of a run.
pub(super) struct RunResult {
    pub(super) x: Vec<f64>,
    pub(super) value: f64,
    /// Value at the start.
    pub(super) first: f64,
    pub(super) evaluations: usize,
    pub(super) history: Vec<ConvergenceStep>,
}
