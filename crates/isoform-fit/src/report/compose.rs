//! The report of a fit, put together from what the stages found.

use super::estimates::Intervals;
use super::{Fit, OtherMinimum};
use crate::clock::Clock;
use crate::deviation;
use crate::evidence::{Clusters, Evidence};
use crate::judge::Verdict;
use crate::objective::sum_of_squares;
use crate::polish::weight;
use crate::search::{Minimum, Outcome};
use crate::settle::Fitted;
use crate::task::{OUTLIER_DEVIATIONS, Task};
use crate::vector::distance;
use crate::{Loss, vector};
use isoform_geom::Point3;

/// An outlier is farther off than this share of the point spacing, too: edges rounded by a mesher
/// or a scanner are no outliers.
const OUTLIER_SPACINGS: f64 = 0.3;
/// Most other minima told of.
const MOST_MINIMA: usize = 5;

/// What a fit says of each point.
pub(crate) struct ByPoint {
    /// Metric residuals.
    pub(crate) residuals: Vec<f64>,
    pub(crate) outliers: Vec<bool>,
    /// Weights in the polish.
    pub(crate) weights: Vec<f64>,
    /// Pieces of the model.
    pub(crate) parts: Vec<u32>,
    /// Nearest places of the model.
    pub(crate) at: Vec<Point3>,
}

impl ByPoint {
    fn n_outliers(&self) -> usize {
        self.outliers.iter().filter(|v| **v).count()
    }
}

impl Task<'_> {
    /// The report of a fit, judged.
    pub(crate) fn report(&self, mut fitted: Fitted, mut clock: Clock) -> Fit {
        let a = self.space.parameters(&fitted.found.x);
        let points = self.by_point(&mut fitted);
        let clusters = self.clusters(&points);
        let mut evidence = self.evidence(&a, &points, &fitted.surface, &fitted.open_parts);
        evidence.clustered = clusters.share;
        let stats = self.part_statistics(&points, &fitted.surface);
        let local = [
            self.misplaced(&points, &stats, fitted.noise),
            self.together(&points),
        ];
        let undetermined = self.open(&fitted.knowledge, &a, &fitted.surface, &stats);
        let mut fit = self.unjudged(fitted, points, &a, &clusters);
        fit.part_statistics = stats;
        fit.undetermined = undetermined;
        fit.evidence = evidence;
        self.judge(&mut fit, local.into_iter().flatten());
        clock.lap("report");
        fit.seconds = clock.seconds.0;
        fit.seconds.insert(0, ("outliers", self.scan.seconds));
        self.control.report("report", 1.0);
        fit
    }

    /// Looks at each point; takes the measured distances.
    fn by_point(&self, fitted: &mut Fitted) -> ByPoint {
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
            outliers: self.outliers(&measured.residuals, noise, loss),
            residuals: measured.residuals,
            at: measured.at,
        }
    }

    /// Which points are outliers: too far off, where the loss allows for any.
    fn outliers(&self, residuals: &[f64], noise: f64, loss: Loss) -> Vec<bool> {
        let limit = (OUTLIER_DEVIATIONS * noise).max(OUTLIER_SPACINGS * self.near.spacing);
        let is_outlier = |r: &f64| !r.is_finite() || (loss.is_robust() && r.abs() > limit);
        residuals.iter().map(is_outlier).collect()
    }

    /// Covariance of the parameters, widened by outliers that lie on surfaces of their own.
    fn covariance(&self, fitted: &Fitted, clusters: &Clusters) -> Vec<f64> {
        let scale = fitted.noise.max(self.rounding());
        let widened = 1.0 + clusters.misfit / (scale * scale);
        let mut covariance = self.space.push_forward(&fitted.covariance);
        vector::scale(&mut covariance, widened);
        covariance
    }

    /// The report without statistics of parts, evidence, open groups, verdict and times.
    fn unjudged(&self, fitted: Fitted, points: ByPoint, a: &[f64], clusters: &Clusters) -> Fit {
        let covariance = self.covariance(&fitted, clusters);
        let found = fitted.found;
        let intervals = Intervals {
            x: &found.x,
            a,
            covariance: &covariance,
            fitted: fitted.fitted,
        };
        let data_to_model = deviation::data_to_model(&points.residuals, &points.outliers);
        let n_outliers = points.n_outliers();
        let best = found.outcome.minima.first();
        Fit {
            parameters: self.estimates(&intervals, &fitted.knowledge),
            sum_f2: self.algebraic_sum(&points.outliers, a),
            rms: data_to_model.rms,
            noise: fitted.noise,
            n_points: self.points.len(),
            n_used: self.points.len() - n_outliers,
            n_fitted: fitted.fitted,
            n_outliers,
            n_left_out: 0,
            isolated: self.scan.isolated,
            spacing: self.near.spacing,
            data_to_model,
            model_to_data: fitted.surface.summary,
            starts: found.outcome.starts,
            hits: best.map_or(0, |m| m.hits),
            evaluations: found.evaluations,
            other_minima: self.others(&found.outcome, &found.x, &points.outliers),
            undetermined: Vec::new(),
            warnings: Vec::new(),
            verdict: Verdict::Accepted,
            findings: Vec::new(),
            acceptable: true,
            reasons: Vec::new(),
            loss: found.loss,
            neighbour_correlation: self.correlation_but(&points),
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

    /// Correlation of neighbouring residuals, outliers left out.
    fn correlation_but(&self, points: &ByPoint) -> f64 {
        let (residuals, outliers) = (&points.residuals, &points.outliers);
        deviation::neighbour_correlation(
            self.points,
            residuals,
            outliers,
            &self.near.tree,
            self.order,
        )
    }

    /// A step of the variables in the parameters.
    fn in_parameters(&self, step: &[f64]) -> Vec<f64> {
        let mut by = vec![0.0; self.template.parameters().len()];
        self.space.add_step(step, &mut by);
        by
    }

    /// Σ f² over the points that are no outliers, NaN left out.
    fn algebraic_sum(&self, outliers: &[bool], a: &[f64]) -> f64 {
        let field = self.template.algebraic();
        if !outliers.contains(&true) {
            return sum_of_squares(field, self.points, &[], a);
        }
        let used = self.points.iter().zip(outliers).filter(|(_, o)| !**o);
        let kept: Vec<Point3> = used.map(|(p, _)| *p).collect();
        sum_of_squares(field, &kept, &[], a)
    }

    /// The minima but for the nearest one to the result.
    fn others(&self, outcome: &Outcome, x: &[f64], outliers: &[bool]) -> Vec<OtherMinimum> {
        let off: Vec<f64> = outcome.minima.iter().map(|m| distance(&m.x, x)).collect();
        let chosen = (0..off.len()).min_by(|i, j| off[*i].total_cmp(&off[*j]));
        let all = outcome.minima.iter().enumerate();
        let others = all.filter(|(k, _)| Some(*k) != chosen).take(MOST_MINIMA);
        let told = |m: &Minimum| {
            let parameters = self.space.parameters(&m.x);
            OtherMinimum {
                sum_f2: self.algebraic_sum(outliers, &parameters),
                parameters,
                hits: m.hits,
            }
        };
        others.map(|(_, m)| told(m)).collect()
    }
}
