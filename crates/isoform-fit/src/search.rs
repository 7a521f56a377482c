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
mod minima;
mod perturb;
mod problem;

pub use self::minima::ConvergenceStep;
pub(crate) use self::minima::{SearchMinimum, SearchOutcome, is_low, is_near};
pub(crate) use self::problem::MinimumSearch;

use self::minima::RunResult;
use rayon::prelude::*;

/// Number of starts per batch, which may run in parallel. Larger batches feed more threads, but a
/// single thread learns later when to stop a hopeless run.
const BATCH_STARTS: usize = 4;

impl MinimumSearch<'_> {
    /// Searches from `first` (if any) and from further starts until the best minimum recurs.
    pub(crate) fn run(&self, first: Option<Vec<f64>>) -> SearchOutcome {
        let mut out = SearchOutcome::default();
        let most = self.options.most_starts.max(1);
        let mut k = 0;
        while k < most {
            // The first start runs alone: its minimum can end the other runs early.
            let size = if k == 0 {
                1
            } else {
                BATCH_STARTS.min(most - k)
            };
            if self.batch(k, size, first.as_deref(), &mut out) {
                break;
            }
            k += size;
        }
        out
    }

    /// Searches again from the best minimum of an outcome, whose evaluations are added.
    pub(crate) fn run_again(&self, before: SearchOutcome) -> SearchOutcome {
        let first = before.minima.into_iter().next().map(|m| m.x);
        let mut again = self.run(first);
        again.evaluations += before.evaluations;
        again
    }

    /// Runs `size` starts from the k-th on. Returns true if the search is over.
    fn batch(&self, k: usize, size: usize, first: Option<&[f64]>, out: &mut SearchOutcome) -> bool {
        let best = out.minima.first().map(|m| &m.x[..]);
        let starts: Vec<Vec<f64>> = (k..k + size).map(|i| self.start(i, first, best)).collect();
        let known = out.minima.first().cloned();
        let nought = out.nought();
        let run = |(i, x): (usize, Vec<f64>)| self.descend(x, known.as_ref(), nought, k + i);
        // A single thread runs one start after the other, and may omit the rest.
        if rayon::current_num_threads() > 1 {
            let runs: Vec<RunResult> = starts.into_par_iter().enumerate().map(run).collect();
            runs.into_iter().any(|run| self.is_over(run, out))
        } else {
            let mut runs = starts.into_iter().enumerate().map(run);
            runs.any(|run| self.is_over(run, out))
        }
    }

    /// Adds a run. Returns true if the search is over.
    fn is_over(&self, run: RunResult, out: &mut SearchOutcome) -> bool {
        out.count(run);
        let share = out.starts as f64 / self.options.least_starts.max(1) as f64;
        self.control.report("search", share.min(0.99));
        out.stopped = self.control.is_stopped();
        if out.stopped {
            return true;
        }
        out.certain = self.has_recurred(out) && self.perturb_pieces(out);
        out.certain
    }

    /// Returns true if the best minimum recurred in independent starts.
    fn has_recurred(&self, out: &SearchOutcome) -> bool {
        let hits = out.minima.first().map(|m| m.hits);
        out.starts >= self.options.least_starts
            && hits.is_some_and(|hits| hits >= self.options.recurrences)
    }

    /// Returns start i. After two batches without agreement half of the starts keep a part of the
    /// best minimum.
    fn start(&self, i: usize, first: Option<&[f64]>, best: Option<&[f64]>) -> Vec<f64> {
        match (first, best) {
            (Some(x), _) if i == 0 => x.to_vec(),
            (_, Some(best)) if i > 2 * BATCH_STARTS && i.is_multiple_of(2) => self.mixed(best, i),
            (Some(_), _) => self.drawn(i - 1),
            (None, _) => self.drawn(i),
        }
    }
}
