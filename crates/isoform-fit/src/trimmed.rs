//! The search again when a good part of the points fits nothing: clustered outliers, which no
//! filter of isolated points sees.
//!
//! Least trimmed squares by concentration (Rousseeuw and Van Driessen 2006, Data Min. Knowl. Disc.
//! 12:29–45): from each start the algebraic sum is minimised, then again over the [`KEPT`] share of
//! the points with the smallest metric residuals, and so on. The results are compared by truncated
//! sums, which do not care how far off an outlier is.

use crate::lm;
use crate::objective::{Residuals, values};
use crate::outliers::median;
use crate::search::Search;
use rayon::prelude::*;

/// Share of the points that a concentration step keeps. Survives a fifth of clustered outliers.
const KEPT: f64 = 0.8;
/// Concentration steps; they settle after three to five.
const STEPS: usize = 6;
/// Starts.
const STARTS: usize = 32;
/// Throws of single pieces of the best result.
const THROWS: usize = 12;
/// Residuals are cut at this many robust deviations of the best result.
const CUT: f64 = 6.0;

/// A result: variables and absolute metric residuals.
struct Trimmed {
    x: Vec<f64>,
    off: Vec<f64>,
}

impl Search<'_> {
    /// The best results of trimmed fits, from `firsts` and from informed starts; and the
    /// evaluations spent.
    pub(crate) fn trimmed(&self, firsts: &[Vec<f64>], spacing: f64) -> (Vec<Vec<f64>>, usize) {
        let starts: Vec<Vec<f64>> = firsts
            .iter()
            .cloned()
            .chain((0..STARTS).map(|i| self.drawn(i)))
            .collect();
        let mut found: Vec<(Trimmed, usize)> = starts
            .into_par_iter()
            .map(|x| self.concentrate(x, 40))
            .collect();
        let mut evaluations: usize = found.iter().map(|f| f.1).sum();
        let mut best = self.lowest(&found, spacing);
        let mut random = fastrand::Rng::with_seed(self.options.seed ^ 0x7_2133);
        for _ in 0..2 {
            if self.control.is_stopped() {
                break;
            }
            let groups = self.groups(&found[best].0.x);
            let thrown: Vec<Vec<f64>> = (0..THROWS)
                .map(|k| {
                    let mut x = found[best].0.x.clone();
                    for &i in groups
                        .get(k % groups.len().clamp(1, 4))
                        .into_iter()
                        .flatten()
                    {
                        x[i] = self.space.start_lo[i]
                            + (self.space.start_hi[i] - self.space.start_lo[i]) * random.f64();
                    }
                    self.space.into_interior(&mut x, 1e-3);
                    x
                })
                .collect();
            let more: Vec<(Trimmed, usize)> = thrown
                .into_par_iter()
                .map(|x| self.concentrate(x, 15))
                .collect();
            evaluations += more.iter().map(|f| f.1).sum::<usize>();
            found.extend(more);
            let next = self.lowest(&found, spacing);
            if next == best {
                break;
            }
            best = next;
        }
        (vec![found.swap_remove(best).0.x], evaluations)
    }

    fn concentrate(&self, x: Vec<f64>, first: usize) -> (Trimmed, usize) {
        let mut weights = Vec::new();
        let mut evaluations = 0;
        let (mut x, mut most) = (x, first);
        let mut off = Vec::new();
        for step in 0..=STEPS {
            let mut objective =
                Residuals::new(self.template.algebraic(), self.points, &weights, self.space);
            let settings = lm::Options {
                max_iterations: most,
                decrease: 1e-4,
                ..lm::Options::default()
            };
            let m = lm::minimize(
                &mut objective,
                x.clone(),
                &self.space.lo,
                &self.space.hi,
                &settings,
                &mut |_, _, _| true,
            );
            evaluations += m.iterations;
            x = m.x;
            most = 15;
            off = self.off(&x);
            if self.control.is_stopped() {
                break;
            }
            let mut sorted = off.clone();
            let limit = if step + 1 < STEPS {
                let at = ((KEPT * off.len() as f64) as usize).min(off.len() - 1);
                *sorted.select_nth_unstable_by(at, f64::total_cmp).1
            } else {
                // The last step asks all points that are near enough.
                1.4826 * CUT * median(&mut sorted)
            };
            weights = off
                .iter()
                .map(|v| if *v <= limit { 1.0 } else { 0.0 })
                .collect();
        }
        (Trimmed { x, off }, evaluations)
    }

    fn off(&self, x: &[f64]) -> Vec<f64> {
        let mut a = vec![0.0; self.template.parameters().len()];
        self.space.parameters_at(x, &mut a);
        let mut r = vec![0.0; self.points.len()];
        values(self.template.metric(), self.points, &a, &mut r);
        r.iter()
            .map(|v| {
                if v.is_finite() {
                    v.abs()
                } else {
                    f64::INFINITY
                }
            })
            .collect()
    }

    /// The least truncated sum.
    fn lowest(&self, found: &[(Trimmed, usize)], spacing: f64) -> usize {
        let scale = found
            .iter()
            .map(|f| 1.4826 * median(&mut f.0.off.clone()))
            .fold(f64::INFINITY, f64::min);
        let cut = (CUT * scale).max(0.25 * spacing);
        let score = |t: &Trimmed| t.off.iter().map(|v| v.min(cut).powi(2)).sum::<f64>();
        (0..found.len())
            .min_by(|&i, &j| score(&found[i].0).total_cmp(&score(&found[j].0)))
            .unwrap_or(0)
    }
}
