//! A second search for data of which a good part fits nothing: clustered outliers, which a filter
//! of isolated points does not detect.
//!
//! Least trimmed squares by concentration (Rousseeuw and Van Driessen 2006, Data Min. Knowl. Disc.
//! 12:29–45): from each start the algebraic sum is minimised, then again over the four fifths of
//! the points with the smallest metric residuals, and so on. All starts make two such steps, and
//! the best ten go on (section 3.2 of the paper). The results are compared by truncated sums, which
//! do not depend on how far off an outlier is.

use crate::lm;
use crate::outliers::{DEVIATION_PER_MEDIAN, median, robust_deviation};
use crate::residuals::{Residuals, values};
use crate::search::MinimumSearch;
use rayon::prelude::*;

/// Number of concentration steps; they converge after three to five.
const CONCENTRATION_STEPS: usize = 6;
/// Number of robust deviations of the best result at which residuals are truncated.
const CUT_DEVIATIONS: f64 = 6.0;
/// Maximum number of evaluations of the later minimisations, and of the first one after a
/// perturbation.
const MAX_LATER_EVALUATIONS: usize = 15;

/// Result of a trimmed fit.
pub(crate) struct TrimmedFit {
    pub(crate) x: Vec<f64>,
    /// Absolute metric residuals; infinite where a residual is not finite.
    off: Vec<f64>,
    /// 1 for the points of the last minimisation, 0 for others; empty if it was over all points.
    weights: Vec<f64>,
    /// Number of concentration steps.
    step: usize,
    pub(crate) evaluations: usize,
}

impl MinimumSearch<'_> {
    /// Returns the best result of trimmed fits, from a start and from 32 informed ones, with the
    /// evaluations of all.
    pub(crate) fn trimmed(&self, first: Vec<f64>, spacing: f64) -> TrimmedFit {
        let drawn = (0..32).map(|i| self.drawn(i));
        let starts: Vec<Vec<f64>> = [first].into_iter().chain(drawn).collect();
        let mut found = self.concentrated(starts, 40, spacing);
        let mut best = lowest(&found, spacing);
        let mut random = fastrand::Rng::with_seed(self.options.seed ^ 0x7_2133);
        for _ in 0..2 {
            if self.control.is_stopped() {
                break;
            }
            let thrown = self.thrown(&found[best].x, &mut random);
            found.extend(self.concentrated(thrown, MAX_LATER_EVALUATIONS, spacing));
            let next = lowest(&found, spacing);
            if next == best {
                break;
            }
            best = next;
        }
        TrimmedFit {
            evaluations: found.iter().map(|f| f.evaluations).sum(),
            ..found.swap_remove(best)
        }
    }

    /// Returns twelve copies of a point, each with one of its four pieces with the fewest points
    /// drawn anew.
    fn thrown(&self, x: &[f64], random: &mut fastrand::Rng) -> Vec<Vec<f64>> {
        let groups = self.groups(x);
        let group = |k: usize| groups.get(k % groups.len().clamp(1, 4));
        (0..12)
            .map(|k| self.throw_group(x, group(k).map_or(&[], Vec::as_slice), random))
            .collect()
    }

    /// Returns the trimmed fits from the best of some starts; the first minimisations take at most
    /// `first` evaluations.
    fn concentrated(&self, starts: Vec<Vec<f64>>, first: usize, spacing: f64) -> Vec<TrimmedFit> {
        let begun: Vec<TrimmedFit> = starts
            .into_par_iter()
            .map(|x| self.begun(x, first))
            .collect();
        let scores = scores(&begun, spacing);
        let mut sorted = scores.clone();
        sorted.sort_by(f64::total_cmp);
        let tenth = sorted.get(9).copied().unwrap_or(f64::INFINITY);
        begun
            .into_par_iter()
            .zip(scores)
            .map(|(fit, score)| match score <= tenth {
                true => self.concentrate(fit, CONCENTRATION_STEPS),
                false => fit,
            })
            .collect()
    }

    /// Minimises over all points from a start, and runs the first concentration steps.
    fn begun(&self, x: Vec<f64>, first: usize) -> TrimmedFit {
        let m = self.weighted(&[], x, first);
        let fit = TrimmedFit {
            off: self.off(&m.x),
            x: m.x,
            weights: Vec::new(),
            step: 0,
            evaluations: m.iterations,
        };
        self.concentrate(fit, 2)
    }

    /// Runs concentration steps up to the `last` one, except those over the points of the previous
    /// one.
    fn concentrate(&self, mut fit: TrimmedFit, last: usize) -> TrimmedFit {
        while fit.step < last {
            let step = fit.step + 1;
            let weights = fit.weights(step);
            if self.control.is_stopped() {
                break;
            }
            fit.step = step;
            if weights == fit.weights {
                continue;
            }
            let m = self.weighted(&weights, fit.x, MAX_LATER_EVALUATIONS);
            fit = TrimmedFit {
                step,
                off: self.off(&m.x),
                x: m.x,
                weights,
                evaluations: fit.evaluations + m.iterations,
            };
        }
        fit
    }

    /// Minimises the weighted algebraic sum.
    fn weighted(&self, weights: &[f64], x: Vec<f64>, most: usize) -> lm::Minimum {
        let field = self.template.algebraic();
        let mut objective = Residuals::new(field, self.points, weights, self.space);
        let settings = lm::LmOptions {
            max_iterations: most,
            decrease: 1e-4,
            ..lm::LmOptions::default()
        };
        self.space
            .minimize(&mut objective, x, &settings, &mut |_, _, _| true)
    }

    /// Returns the absolute metric residuals of the points; infinite where a residual is not
    /// finite.
    fn off(&self, x: &[f64]) -> Vec<f64> {
        let mut r = vec![0.0; self.points.len()];
        let a = self.space.parameters(x);
        values(self.template.metric(), self.points, &a, &mut r);
        let off = |v: &f64| {
            if v.is_finite() {
                v.abs()
            } else {
                f64::INFINITY
            }
        };
        r.iter().map(off).collect()
    }
}

/// Returns the truncated sums of results.
fn scores(found: &[TrimmedFit], spacing: f64) -> Vec<f64> {
    let scales = found.iter().map(TrimmedFit::scale);
    let cut = (CUT_DEVIATIONS * scales.fold(f64::INFINITY, f64::min)).max(0.25 * spacing);
    let score = |fit: &TrimmedFit| fit.off.iter().map(|v| v.min(cut).powi(2)).sum();
    found.iter().map(score).collect()
}

/// Returns the index of the result with the least truncated sum.
fn lowest(found: &[TrimmedFit], spacing: f64) -> usize {
    let scores = scores(found, spacing);
    (0..found.len())
        .min_by(|i, j| scores[*i].total_cmp(&scores[*j]))
        .unwrap_or(0)
}

impl TrimmedFit {
    /// Returns the robust deviation of the residuals.
    fn scale(&self) -> f64 {
        robust_deviation(&mut self.off.clone())
    }

    /// Returns the weights of the points for a step: 1 within a limit, 0 beyond it.
    fn weights(&self, step: usize) -> Vec<f64> {
        let limit = self.limit(step);
        let is_kept = |off: &f64| f64::from(u8::from(*off <= limit));
        self.off.iter().map(is_kept).collect()
    }

    /// Returns the distance within which points are kept for a step: four fifths of them, which
    /// tolerates a fifth of clustered outliers; for the last step all that are near enough.
    fn limit(&self, step: usize) -> f64 {
        let mut sorted = self.off.clone();
        if step < CONCENTRATION_STEPS {
            let at = ((0.8 * sorted.len() as f64) as usize).min(sorted.len() - 1);
            *sorted.select_nth_unstable_by(at, f64::total_cmp).1
        } else {
            DEVIATION_PER_MEDIAN * CUT_DEVIATIONS * median(&mut sorted)
        }
    }
}
