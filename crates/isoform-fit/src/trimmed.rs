//! A second search for data of which a good part fits nothing: clustered outliers, which a filter
//! of isolated points does not detect.
//!
//! Least trimmed squares by concentration (Rousseeuw and Van Driessen 2006, Data Min. Knowl. Disc.
//! 12:29–45): from each start the algebraic sum is minimised, then again over the four fifths of
//! the points with the smallest metric residuals, and so on. The results are compared by truncated
//! sums, which do not depend on how far off an outlier is.

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
    pub(crate) evaluations: usize,
}

impl MinimumSearch<'_> {
    /// Returns the best result of trimmed fits, from a start and from 32 informed ones, with the
    /// evaluations of all.
    pub(crate) fn trimmed(&self, first: Vec<f64>, spacing: f64) -> TrimmedFit {
        let drawn = (0..32).map(|i| self.drawn(i));
        let starts: Vec<Vec<f64>> = [first].into_iter().chain(drawn).collect();
        let mut found = self.concentrated(starts, 40);
        let mut best = self.lowest(&found, spacing);
        let mut random = fastrand::Rng::with_seed(self.options.seed ^ 0x7_2133);
        for _ in 0..2 {
            if self.control.is_stopped() {
                break;
            }
            let thrown = self.thrown(&found[best].x, &mut random);
            found.extend(self.concentrated(thrown, MAX_LATER_EVALUATIONS));
            let next = self.lowest(&found, spacing);
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

    fn concentrated(&self, starts: Vec<Vec<f64>>, first: usize) -> Vec<TrimmedFit> {
        starts
            .into_par_iter()
            .map(|x| self.concentrate(x, first))
            .collect()
    }

    /// Runs concentration steps from a start, the first with at most `first` evaluations.
    fn concentrate(&self, x: Vec<f64>, first: usize) -> TrimmedFit {
        let mut trimmed = TrimmedFit {
            x,
            off: Vec::new(),
            evaluations: 0,
        };
        let mut weights = Vec::new();
        for step in 0..=CONCENTRATION_STEPS {
            let most = if step == 0 {
                first
            } else {
                MAX_LATER_EVALUATIONS
            };
            let m = self.weighted(&weights, trimmed.x.clone(), most);
            trimmed.evaluations += m.iterations;
            trimmed.x = m.x;
            trimmed.off = self.off(&trimmed.x);
            if self.control.is_stopped() {
                break;
            }
            let limit = trimmed.limit(step);
            let is_kept = |off: &f64| f64::from(u8::from(*off <= limit));
            weights = trimmed.off.iter().map(is_kept).collect();
        }
        trimmed
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

    /// Returns the index of the result with the least truncated sum.
    fn lowest(&self, found: &[TrimmedFit], spacing: f64) -> usize {
        let scales = found.iter().map(TrimmedFit::scale);
        let cut = (CUT_DEVIATIONS * scales.fold(f64::INFINITY, f64::min)).max(0.25 * spacing);
        let score = |k: &usize| -> f64 {
            let off = found[*k].off.iter();
            off.map(|v| v.min(cut).powi(2)).sum()
        };
        (0..found.len())
            .min_by(|i, j| score(i).total_cmp(&score(j)))
            .unwrap_or(0)
    }
}

impl TrimmedFit {
    /// Returns the robust deviation of the residuals.
    fn scale(&self) -> f64 {
        robust_deviation(&mut self.off.clone())
    }

    /// Returns the distance within which points are kept after a step: four fifths of them, which
    /// tolerates a fifth of clustered outliers; after the last step all that are near enough.
    fn limit(&self, step: usize) -> f64 {
        let mut sorted = self.off.clone();
        if step + 1 < CONCENTRATION_STEPS {
            let at = ((0.8 * sorted.len() as f64) as usize).min(sorted.len() - 1);
            *sorted.select_nth_unstable_by(at, f64::total_cmp).1
        } else {
            DEVIATION_PER_MEDIAN * CUT_DEVIATIONS * median(&mut sorted)
        }
    }
}
