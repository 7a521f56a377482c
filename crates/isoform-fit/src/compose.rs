//! Composition of the result of a fit from what the stages found.

mod estimates;
mod open;
mod parts;
mod statistics;

use self::estimates::Intervals;
use crate::by_point::ByPoint;
use crate::clock::Clock;
use crate::evidence::Clusters;
use crate::minimum::FitMinimum;
use crate::polish::weight;
use crate::report::evidence::Evidence;
use crate::report::finding::Verdict;
use crate::report::{Fit, OtherMinimum};
use crate::search::{SearchMinimum, SearchOutcome};
use crate::settle::FinalFit;
use crate::tally::PointStatistics;
use crate::task::Task;
use crate::thresholds::OUTLIER_DEVIATIONS;
use crate::vector::distance;
use crate::{Loss, vector};

impl Task<'_> {
    /// Composes the result of a fit, with its verdict.
    pub(crate) fn report(&self, mut fitted: FinalFit, mut clock: Clock) -> Fit {
        let a = self.space.parameters(&fitted.found.x);
        let limit = self.outlier_limit(fitted.noise, fitted.found.loss);
        let points = self.by_point(&mut fitted, limit);
        let mut told = self.statistics(&a, &points, limit, self.summed_at(&fitted.found, &a));
        let clusters = self.clusters(&points);
        let mut evidence = self.evidence(&a, &points, &fitted.surface, &fitted.open_parts);
        evidence.clustered = clusters.share;
        evidence.rms_of_all = told.rms_of_all.unwrap_or(evidence.rms_of_all);
        let stats = self.part_statistics(std::mem::take(&mut told.parts), &fitted.surface);
        let local = [
            self.misplaced(&points, &stats, fitted.noise),
            self.misshapen(&points, &stats, fitted.noise),
            self.together(&points, &told),
        ];
        let undetermined = self.open(&fitted.knowledge, &a, &fitted.surface, &stats);
        let with_repeats = told.with_repeats;
        let mut fit = self.unjudged(fitted, points, told, (&a, &clusters));
        fit.part_statistics = stats;
        fit.undetermined = undetermined;
        fit.evidence = evidence;
        self.judge(&mut fit, local.into_iter().flatten());
        if let Some((points, outliers)) = with_repeats {
            (fit.n_points, fit.n_outliers) = (points, outliers);
            fit.n_used = points - outliers;
        }
        clock.lap("report");
        fit.seconds = clock.seconds.0;
        fit.seconds.insert(0, ("outliers", self.scan.seconds));
        self.control.report("report", 1.0);
        fit
    }

    /// Computes the results by point; takes the measured distances.
    fn by_point(&self, fitted: &mut FinalFit, limit: f64) -> ByPoint {
        let (noise, loss) = (fitted.noise, fitted.found.loss);
        let measured = std::mem::take(&mut fitted.measured);
        let scale = noise.max(f64::MIN_POSITIVE);
        let weight = |(r, is_open): (&f64, bool)| match r.is_finite() && !is_open {
            true => weight(loss, r / scale),
            false => 0.0,
        };
        let is_open = measured.on(&fitted.open_parts);
        let weights = measured.residuals.iter().zip(is_open).map(weight).collect();
        ByPoint {
            weights,
            parts: measured.parts(),
            outliers: outliers(&measured.residuals, limit),
            residuals: measured.residuals,
            at: measured.at,
        }
    }

    /// Returns the distance beyond which points are outliers; infinite if the loss does not allow
    /// for any. Edges rounded by a mesher or a scanner, off by less than 0.3 spacings, are not
    /// outliers.
    fn outlier_limit(&self, noise: f64, loss: Loss) -> f64 {
        if loss.is_robust() {
            (OUTLIER_DEVIATIONS * noise).max(0.3 * self.near.spacing)
        } else {
            f64::INFINITY
        }
    }

    /// Returns the covariance of the parameters, widened by outliers on surfaces of their own.
    fn covariance(&self, fitted: &FinalFit, clusters: &Clusters) -> Vec<f64> {
        let scale = fitted.noise.max(self.rounding());
        let widened = 1.0 + clusters.misfit / (scale * scale);
        let mut covariance = self.space.push_forward(&fitted.covariance);
        vector::scale(&mut covariance, widened);
        covariance
    }

    /// Composes the result without statistics of parts, evidence, open groups, verdict and times.
    fn unjudged(
        &self,
        fitted: FinalFit,
        points: ByPoint,
        told: PointStatistics,
        (a, clusters): (&[f64], &Clusters),
    ) -> Fit {
        let covariance = self.covariance(&fitted, clusters);
        let found = fitted.found;
        let intervals = Intervals {
            x: &found.x,
            a,
            covariance: &covariance,
            weighted: fitted.fitted.min(weighted(&points.weights)),
        };
        let best = found.outcome.minima.first();
        Fit {
            parameters: self.estimates(&intervals, &fitted.knowledge),
            sum_f2: told.algebraic[0],
            rms: told.data_to_model.rms,
            noise: fitted.noise,
            n_points: told.n_points,
            n_used: told.n_points - told.n_outliers,
            n_fitted: fitted.fitted,
            n_outliers: told.n_outliers,
            n_left_out: 0,
            isolated: self.scan.isolated,
            spacing: self.near.spacing,
            data_to_model: told.data_to_model,
            model_to_data: fitted.surface.summary,
            starts: found.outcome.starts,
            hits: best.map_or(0, |m| m.hits),
            evaluations: found.evaluations,
            other_minima: self.others(&found, &told.algebraic[1..]),
            undetermined: Vec::new(),
            warnings: Vec::new(),
            verdict: Verdict::Accepted,
            findings: Vec::new(),
            acceptable: true,
            reasons: Vec::new(),
            loss: found.loss,
            neighbour_correlation: self
                .correlation(&found.x, &points.residuals, |i| !points.outliers[i]),
            residuals: points.residuals,
            weights: points.weights,
            outliers: points.outliers,
            parts: points.parts,
            part_statistics: Vec::new(),
            correlation: fitted.correlation,
            evidence: Evidence::default(),
            certain: found.outcome.certain,
            misfit: clusters.misfit.sqrt(),
            correction: fitted
                .correction
                .map_or_else(Vec::new, |c| self.in_parameters(&c)),
            covariance,
            history: found.history,
            stop: found.stop,
            seconds: Vec::new(),
            complete: found.complete,
        }
    }

    /// Transforms a step of the variables to the parameters.
    fn in_parameters(&self, step: &[f64]) -> Vec<f64> {
        let mut by = vec![0.0; self.template.parameters().len()];
        self.space.add_step(step, &mut by);
        by
    }

    /// Returns the parameters at which the algebraic sum is computed: the result, then other
    /// minima.
    fn summed_at(&self, found: &FitMinimum, a: &[f64]) -> Vec<Vec<f64>> {
        let others = others(&found.outcome, &found.x);
        let others = others.map(|m| self.space.parameters(&m.x));
        std::iter::once(a.to_vec()).chain(others).collect()
    }

    /// Returns the minima without the nearest one to the result, with their sums.
    fn others(&self, found: &FitMinimum, sums: &[f64]) -> Vec<OtherMinimum> {
        let told = |(m, sum): (&SearchMinimum, &f64)| OtherMinimum {
            sum_f2: *sum,
            parameters: self.space.parameters(&m.x),
            hits: m.hits,
        };
        let others = others(&found.outcome, &found.x);
        others.zip(sums).map(told).collect()
    }
}

/// Returns the first five minima without the nearest one to the result.
fn others<'a>(outcome: &'a SearchOutcome, x: &[f64]) -> impl Iterator<Item = &'a SearchMinimum> {
    let off: Vec<f64> = outcome.minima.iter().map(|m| distance(&m.x, x)).collect();
    let chosen = (0..off.len()).min_by(|i, j| off[*i].total_cmp(&off[*j]));
    let all = outcome.minima.iter().enumerate();
    let others = all.filter(move |(k, _)| Some(*k) != chosen);
    others.map(|(_, m)| m).take(5)
}

/// Returns the number of points with a weight.
pub(crate) fn weighted(weights: &[f64]) -> usize {
    weights.iter().filter(|w| **w > 0.0).count()
}

/// Flags the points beyond the limit.
fn outliers(residuals: &[f64], limit: f64) -> Vec<bool> {
    let is_outlier = |r: &f64| !r.is_finite() || r.abs() > limit;
    residuals.iter().map(is_outlier).collect()
}
