//! The global search: Levenberg-Marquardt from many starts on a few hundred points, until the best
//! minimum recurs.
//!
//! The algebraic residual is used, because its basins are wide. Start 0 is the caller's; further
//! ones are drawn, in seeded Latin hypercubes, from the ranges that the data suggest and (every
//! fourth) from the whole bounds. Once the best minimum has recurred, single primitives are
//! perturbed, those first that explain the fewest points: a typical false minimum has one misplaced
//! piece. Candidates with nearly equal sums are then compared on more points, by the metric
//! residual.
//!
//! Starts are run in batches of fixed size whose runs depend only on earlier batches, and results
//! are read in the order of starts. The outcome therefore does not depend on the number of threads.

mod descent;
mod throw;

use self::descent::Run;
use crate::bounds::Bounds;
use crate::space::Space;
use crate::{Control, Options, Template};
use isoform_geom::Point3;
use rayon::prelude::*;

/// Runs that may go side by side. Larger batches feed more threads, but a lone thread learns later
/// when to stop a hopeless run.
const BATCH: usize = 4;
/// Starts of one Latin hypercube.
const CUBE: usize = 16;
/// Two sums are of one minimum when they differ by less than this share: converged runs agree to
/// 1e-6, distinct minima of the noise differ by more than 2 % on 512 points, and the near-equal
/// ones of nested R-functions (1e-4) are meant to count as one.
const SAME: f64 = 5e-3;
/// Sums below this share of the typical first one all count as zero: the data have no noise.
const NOUGHT: f64 = 1e-10;
/// Candidates within this factor of the best sum are compared on more points.
const RIVAL: f64 = 2.0;
/// Most candidates compared.
const CANDIDATES: usize = 4;
/// One of this many starts is drawn from the whole bounds, the others from where the data are.
const WIDE: usize = 4;

/// A minimum of the algebraic sum over the search points.
#[derive(Clone, Debug)]
pub(crate) struct Minimum {
    pub(crate) x: Vec<f64>,
    pub(crate) value: f64,
    /// Number of starts that led there.
    pub(crate) hits: usize,
}

/// One line of the convergence history.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Start of the step; the polish has its own number, one past the last.
    pub start: usize,
    /// Number of the evaluation.
    pub iteration: usize,
    /// Root mean square of the residual: algebraic in the search, metric in the polish.
    pub rms: f64,
}

impl Step {
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
pub(crate) struct Outcome {
    /// Distinct minima, best first.
    pub(crate) minima: Vec<Minimum>,
    pub(crate) starts: usize,
    pub(crate) evaluations: usize,
    /// True if the best minimum recurred as often as required.
    pub(crate) certain: bool,
    pub(crate) stopped: bool,
    pub(crate) history: Vec<Step>,
    /// Sums at the first points of runs with a finite result.
    pub(crate) firsts: Vec<f64>,
}

impl Outcome {
    /// Returns true if there is a minimum to continue from, and time.
    pub(crate) fn can_go_on(&self) -> bool {
        !self.stopped && !self.minima.is_empty()
    }

    /// Returns the sum below which all sums count as zero: the data have no noise.
    fn nought(&self) -> f64 {
        NOUGHT * median(&self.firsts)
    }

    /// Adds a run from a start.
    fn count(&mut self, run: Run) {
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
    fn insert(&mut self, x: Vec<f64>, value: f64, nought: f64, counts: bool) -> usize {
        let is_same = |m: &Minimum| {
            (m.value - value).abs() <= SAME * m.value.min(value)
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
        self.minima.insert(at, Minimum { x, value, hits });
        at
    }

    fn best(&self) -> f64 {
        self.minima.first().map_or(f64::INFINITY, |m| m.value)
    }
}

/// Data of a search.
pub(crate) struct Search<'a> {
    pub(crate) template: &'a dyn Template,
    pub(crate) space: &'a Space,
    pub(crate) points: &'a [Point3],
    pub(crate) options: &'a Options,
    pub(crate) control: &'a Control<'a>,
}

impl Search<'_> {
    /// Searches from `first` (if any) and from further starts until the best minimum recurs.
    pub(crate) fn run(&self, first: Option<Vec<f64>>) -> Outcome {
        let mut out = Outcome::default();
        let most = self.options.most_starts.max(1);
        let mut k = 0;
        while k < most {
            // The first start goes alone: it may tell when the others can stop.
            let size = if k == 0 { 1 } else { BATCH.min(most - k) };
            if self.batch(k, size, first.as_deref(), &mut out) {
                break;
            }
            k += size;
        }
        out
    }

    /// Searches again from the best minimum of an outcome, whose evaluations are added.
    pub(crate) fn run_again(&self, before: Outcome) -> Outcome {
        let first = before.minima.into_iter().next().map(|m| m.x);
        let mut again = self.run(first);
        again.evaluations += before.evaluations;
        again
    }

    /// Runs `size` starts from the k-th on. Returns true if the search is over.
    fn batch(&self, k: usize, size: usize, first: Option<&[f64]>, out: &mut Outcome) -> bool {
        let best = out.minima.first().map(|m| &m.x[..]);
        let starts: Vec<Vec<f64>> = (k..k + size).map(|i| self.start(i, first, best)).collect();
        let known = out.minima.first().cloned();
        let nought = out.nought();
        let run = |(i, x): (usize, Vec<f64>)| self.descend(x, known.as_ref(), nought, k + i);
        // A single thread runs one start after the other, and may omit the rest.
        if rayon::current_num_threads() > 1 {
            let runs: Vec<Run> = starts.into_par_iter().enumerate().map(run).collect();
            runs.into_iter().any(|run| self.is_over(run, out))
        } else {
            let mut runs = starts.into_iter().enumerate().map(run);
            runs.any(|run| self.is_over(run, out))
        }
    }

    /// Adds a run. Returns true if the search is over.
    fn is_over(&self, run: Run, out: &mut Outcome) -> bool {
        out.count(run);
        let share = out.starts as f64 / self.options.least_starts.max(1) as f64;
        self.control.report("search", share.min(0.99));
        out.stopped = self.control.is_stopped();
        if out.stopped {
            return true;
        }
        out.certain = self.has_recurred(out) && self.throw(out);
        out.certain
    }

    /// Returns true if the best minimum recurred in independent starts.
    fn has_recurred(&self, out: &Outcome) -> bool {
        let hits = out.minima.first().map(|m| m.hits);
        out.starts >= self.options.least_starts
            && hits.is_some_and(|hits| hits >= self.options.recurrences)
    }

    /// Returns start i. After two batches without agreement half of the starts keep a part of the
    /// best minimum.
    fn start(&self, i: usize, first: Option<&[f64]>, best: Option<&[f64]>) -> Vec<f64> {
        match (first, best) {
            (Some(x), _) if i == 0 => x.to_vec(),
            (_, Some(best)) if i > 2 * BATCH && i.is_multiple_of(2) => self.mixed(best, i),
            (Some(_), _) => self.drawn(i - 1),
            (None, _) => self.drawn(i),
        }
    }

    /// Returns start i of the seeded Latin hypercubes: three of four are drawn from the ranges that
    /// the data suggest, one from the whole bounds.
    pub(crate) fn drawn(&self, i: usize) -> Vec<f64> {
        let is_wide = i % WIDE == WIDE - 1;
        let Bounds { lo, hi } = if is_wide {
            self.space.limits()
        } else {
            self.space.start_limits()
        };
        let mut row = CubeRow::new(self.options.seed, i);
        let ranges = lo.iter().zip(hi);
        let mut x: Vec<f64> = ranges.map(|(lo, hi)| lo + (hi - lo) * row.next()).collect();
        self.space.into_interior(&mut x, 1e-3);
        x
    }

    /// Returns the minima to be compared on more points: at most four with sums up to twice the
    /// best.
    pub(crate) fn candidates<'o>(&self, out: &'o Outcome) -> &'o [Minimum] {
        let limit = RIVAL * out.best();
        let first = out.minima.iter().take(CANDIDATES);
        let k = first.take_while(|m| m.value <= limit).count();
        &out.minima[..k.max(1).min(out.minima.len())]
    }
}

/// A row of a seeded Latin hypercube: coordinates in [0, 1) such that the rows of a cube lie in
/// different sixteenths along each axis.
struct CubeRow {
    row: usize,
    order: Vec<usize>,
    random: fastrand::Rng,
}

impl CubeRow {
    /// Makes the row of start i; each cube serves [`CUBE_STARTS`] starts.
    fn new(seed: u64, i: usize) -> Self {
        let cube = (i / CUBE) as u64;
        Self {
            row: i % CUBE,
            order: (0..CUBE).collect(),
            random: fastrand::Rng::with_seed(seed.wrapping_add(cube)),
        }
    }

    /// Returns the coordinate along the next axis.
    fn next(&mut self) -> f64 {
        self.random.shuffle(&mut self.order);
        let offsets: [f64; CUBE] = std::array::from_fn(|_| self.random.f64());
        (self.order[self.row] as f64 + offsets[self.row]) / CUBE as f64
    }
}

/// Returns the upper median.
fn median(v: &[f64]) -> f64 {
    crate::outliers::median(&mut v.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_a_cube_share_no_sixteenth() {
        let mut rows: Vec<CubeRow> = (0..CUBE).map(|i| CubeRow::new(7, i)).collect();
        for _ in 0..3 {
            let along = rows
                .iter_mut()
                .map(|row| (CUBE as f64 * row.next()) as usize);
            let mut slots: Vec<usize> = along.collect();
            slots.sort_unstable();
            assert_eq!(slots, (0..CUBE).collect::<Vec<_>>());
        }
    }
}
