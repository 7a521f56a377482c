//! Comparison of the search's minima by distances, which nearly equal sums of the algebraic
//! residual cannot replace.

use crate::lm;
use crate::outliers::MIN_OUTLIER_SHARE;
use crate::polish::{Polish, PolishResult};
use crate::residuals::Residuals;
use crate::search::{MinimumSearch, SearchOutcome};
use crate::task::Task;
use crate::thresholds::OUTLIER_DEVIATIONS;
use isoform_geom::Point3;

/// Number of robust deviations of the best candidate at which residuals are truncated.
const TRUNCATION_DEVIATIONS: f64 = 4.5;

/// A candidate with its metric residuals at the points of the comparison.
pub(super) struct ComparedMinimum {
    pub(super) polished: PolishResult,
    residuals: Vec<f64>,
}

/// Common data of a comparison of candidates.
pub(super) struct Comparison<'a> {
    polish: &'a Polish<'a>,
    points: Vec<Point3>,
    has_outliers: bool,
}

impl Comparison<'_> {
    /// Polishes a minimum by the metric residual.
    fn rival(&self, x: Vec<f64>, spent: usize) -> ComparedMinimum {
        let mut polished = self.polish.rough(&self.points, x, self.has_outliers);
        polished.evaluations += spent;
        ComparedMinimum {
            residuals: self.polish.residuals(&self.points, &polished.x),
            polished,
        }
    }

    /// Polishes a start that was measured: the search's sum over all points spoils values that some
    /// of them have.
    pub(super) fn measured_start(&self, task: &Task<'_>) -> Option<ComparedMinimum> {
        let start = task.first().filter(|_| task.options.is_start_measured)?;
        Some(self.rival(start, 0))
    }
}

impl Task<'_> {
    /// Sets up a comparison of candidates.
    pub(super) fn comparison<'b>(&'b self, polish: &'b Polish<'b>) -> Comparison<'b> {
        let options = self.options;
        Comparison {
            polish,
            points: self.some(options.confirm_points.max(options.search_points)),
            has_outliers: self.scan.isolated > MIN_OUTLIER_SHARE,
        }
    }

    /// Polishes candidates with nearly equal sums by the metric residual on more points and returns
    /// the best by a truncated sum, with the evaluations of all. If many points are far off it, a
    /// trimmed search takes part.
    pub(super) fn compared(
        &self,
        search: &MinimumSearch<'_>,
        outcome: &SearchOutcome,
        kept: &[Point3],
        polish: &Polish<'_>,
    ) -> PolishResult {
        let comparison = self.comparison(polish);
        let minima = search.candidates(outcome).iter();
        let confirmed = minima.map(|m| self.confirmed(kept, m.x.clone()));
        let mut rivals: Vec<ComparedMinimum> = confirmed
            .map(|m| comparison.rival(m.x, m.iterations))
            .collect();
        rivals.extend(comparison.measured_start(self));
        let mut best = self.least_truncated(&rivals);
        if self.has_many_far(&rivals[best]) && !self.control.is_stopped() {
            let first = rivals[best].polished.x.clone();
            let trimmed = search.trimmed(first, self.near.spacing);
            rivals.push(comparison.rival(trimmed.x, trimmed.evaluations));
            best = self.least_truncated(&rivals);
        }
        let evaluations = rivals.iter().map(|r| r.polished.evaluations).sum();
        PolishResult {
            evaluations,
            ..rivals.swap_remove(best).polished
        }
    }

    /// Minimises the algebraic sum on more points than the search uses.
    fn confirmed(&self, points: &[Point3], x: Vec<f64>) -> lm::Minimum {
        let field = self.template.algebraic();
        let mut objective = Residuals::new(field, points, &[], &self.space);
        let settings = lm::LmOptions {
            max_iterations: 12,
            decrease: 1e-4,
            ..lm::LmOptions::default()
        };
        let mut monitor = |_, _: &[f64], _| !self.control.is_stopped();
        self.space
            .minimize(&mut objective, x, &settings, &mut monitor)
    }

    /// Returns true if more points are far off a candidate than isolated ones explain, with a
    /// margin of a half and 3 % of the points. A far point is off by half a spacing, too.
    fn has_many_far(&self, rival: &ComparedMinimum) -> bool {
        let scale = rival.polished.scale;
        let limit = (OUTLIER_DEVIATIONS * scale).max(0.5 * self.near.spacing);
        let far = rival.residuals.iter().filter(|r| r.abs() > limit).count();
        let isolated = if self.scan.isolated > MIN_OUTLIER_SHARE {
            1.5 * self.scan.isolated
        } else {
            0.0
        };
        far as f64 / rival.residuals.len() as f64 > 0.03 + isolated
    }

    /// Returns the candidate with the least truncated sum of squares. The first one has the lowest
    /// algebraic sum; another must be better by a thousandth.
    fn least_truncated(&self, rivals: &[ComparedMinimum]) -> usize {
        let scales = rivals.iter().map(|r| r.polished.scale);
        let least = scales.fold(f64::INFINITY, f64::min).max(self.rounding());
        let cut = (TRUNCATION_DEVIATIONS * least).powi(2);
        let score = |k: usize| truncated_sum(&rivals[k].residuals, cut);
        let is_better = |k: usize, best: usize| score(k) < 0.999 * score(best);
        (1..rivals.len()).fold(0, |best, k| if is_better(k, best) { k } else { best })
    }
}

/// Returns Σ min(r², cut); NaN counts as cut.
pub(super) fn truncated_sum(r: &[f64], cut: f64) -> f64 {
    r.iter()
        .map(|r| if r.is_nan() { cut } else { (r * r).min(cut) })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn truncated_sums_do_not_care_how_far_off_an_outlier_is() {
        assert_eq!(truncated_sum(&[1.0, -2.0, 9.0, f64::NAN], 16.0), 37.0);
        assert_eq!(truncated_sum(&[1.0, -2.0, 9e9, f64::NAN], 16.0), 37.0);
    }
}
