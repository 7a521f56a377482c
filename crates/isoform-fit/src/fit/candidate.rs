//! The default method up to a minimum of the metric residual: search, comparison, polish, and
//! perturbation of pieces if the minimum is uncertain.

use crate::chunks::{PointSet, Reading, ResidualSizes};
use crate::clock::Clock;
use crate::minimum::FitMinimum;
use crate::outliers::MIN_OUTLIER_SHARE;
use crate::polish::{Polish, PolishResult};
use crate::search::{MinimumSearch, SearchMinimum, SearchOutcome};
use crate::task::Task;
use crate::thresholds::OUTLIER_DEVIATIONS;
use crate::{FitError, Loss, Options};
use isoform_geom::Point3;

/// Number of robust deviations beyond which a point is stray: noise exceeds it once in 10¹⁵.
const STRAY_DEVIATIONS: f64 = 8.0;
/// Squares of stray points over those of all others from which a sum of squares is dominated by
/// them: one point with a tenth of the sum moves the values by a third of their deviations.
const DOMINANT_STRAY_SHARE: f64 = 0.1;
/// Correlation of neighbouring residuals below which they count as noise: four standard deviations
/// of chance among 2000 points. With 0.2 a flange with its six holes in a wrong position passed.
const MAX_NOISE_CORRELATION: f64 = 0.1;

impl Task<'_> {
    /// Returns the best minimum that the default method finds.
    pub(crate) fn candidate(&self, clock: &mut Clock) -> Result<FitMinimum, FitError> {
        let measured = self.measured_candidate();
        clock.lap("polish");
        if let Some(found) = measured {
            return Ok(found);
        }
        let mut kept = self.kept();
        self.control.report("search", 0.0);
        let outcome = self.searched(&mut kept)?;
        clock.lap("search");
        self.control.report("polish", 0.0);
        let search = self.search_on(&kept, self.options);
        let found = self.polished(&search, outcome, &kept);
        clock.lap("polish");
        Ok(found)
    }

    /// Returns the minimum to which a measured start leads, if the residuals there are noise: no
    /// search can find a better one.
    fn measured_candidate(&self) -> Option<FitMinimum> {
        let polish = self.polish(0);
        let start = self.comparison(&polish).measured_start(self)?.polished;
        let outcome = SearchOutcome {
            starts: 1,
            certain: true,
            minima: vec![SearchMinimum {
                x: start.x.clone(),
                value: 0.0,
                hits: 1,
            }],
            ..SearchOutcome::default()
        };
        let found = self.finely_polished(&polish, start, outcome).0;
        // Of exact points, those of a misplaced piece are few.
        let r = polish.residuals(self.points, &found.x);
        let sizes = self.sizes(&r, &found.x);
        let is_whole = sizes.rms < self.rounding() || !has_tail(sizes);
        let is_defined = r.iter().all(|r| r.is_finite());
        (found.is_at_noise && is_whole && is_defined).then_some(found)
    }

    /// Returns the points of the search.
    fn kept(&self) -> Vec<Point3> {
        if self.scan.kept.len() < 2 * self.space.len() {
            self.some(self.scan.wanted)
        } else {
            self.scan.kept.clone()
        }
    }

    /// Sets up a search on the first of some points.
    fn search_on<'b>(&'b self, points: &'b [Point3], options: &'b Options) -> MinimumSearch<'b> {
        MinimumSearch {
            template: self.template,
            space: &self.space,
            points: &points[..options.search_points.min(points.len())],
            options,
            control: self.control,
        }
    }

    /// Returns the minima of the algebraic residual. Outliers that a first model reveals are
    /// removed from `kept`.
    fn searched(&self, kept: &mut Vec<Point3>) -> Result<SearchOutcome, FitError> {
        let mut outcome = self.search_on(kept, self.options).run(self.first());
        if self.scan.isolated > MIN_OUTLIER_SHARE && outcome.can_go_on() {
            self.drop_lone(kept, &outcome);
            outcome = self.search_on(kept, self.options).run_again(outcome);
        }
        if outcome.can_go_on() && self.is_poor(kept, &outcome) {
            // Recurrence proves a wide basin, not a good minimum: if the best one is far off the
            // data, more starts are run.
            let patient = Options {
                least_starts: 32,
                ..self.options.clone()
            };
            outcome = self.search_on(kept, &patient).run_again(outcome);
        }
        match outcome {
            SearchOutcome { ref minima, .. } if !minima.is_empty() => Ok(outcome),
            SearchOutcome { stopped: true, .. } => Err(FitError::Stopped),
            SearchOutcome { starts, .. } => Err(FitError::NoFiniteStart { starts }),
        }
    }

    /// Drops outliers near the surface, which can decide between minima. With a model, most of them
    /// can be told from data: the neighbours of data have similar residuals.
    fn drop_lone(&self, kept: &mut Vec<Point3>, outcome: &SearchOutcome) {
        let polish = self.polish(0);
        let x = polish.rough(kept, outcome.minima[0].x.clone(), true).x;
        let scale = Polish::scale(&polish.residuals(kept, &x)).max(self.rounding());
        let residuals = |points: &[Point3]| polish.residuals(points, &x);
        self.near
            .drop_lone(kept, OUTLIER_DEVIATIONS * scale, &residuals);
    }

    /// Returns true if the best minimum of the search lies far off the points: by more than 0.5 %
    /// of the diagonal and than the noise. A misfit below 1.3 times the deviation of points from
    /// planes through their neighbours is noise: no minimum can be better. (That deviation includes
    /// curvature.)
    fn is_poor(&self, kept: &[Point3], outcome: &SearchOutcome) -> bool {
        let r = self.polish(0).residuals(kept, &outcome.minima[0].x);
        Polish::scale(&r) > (0.005 * self.size()).max(1.3 * self.scan.local_noise)
    }

    /// Returns the minimum of the metric residual to which the search leads.
    fn polished(
        &self,
        search: &MinimumSearch<'_>,
        outcome: SearchOutcome,
        kept: &[Point3],
    ) -> FitMinimum {
        let polish = self.polish(outcome.starts);
        let rough = self.compared(search, &outcome, kept, &polish);
        self.control.report("polish", 0.3);
        let (mut found, rounds) = self.finely_polished(&polish, rough, outcome);
        let is_settled = found.outcome.certain && found.is_at_noise;
        if found.complete && self.options.refine && !is_settled {
            self.refine(search, &mut found);
            // A better minimum has another scale.
            self.fine(&polish, &mut found, rounds);
        }
        found
    }

    /// Polishes a rough minimum with the loss that suits it. Returns it with the number of rounds.
    fn finely_polished(
        &self,
        polish: &Polish<'_>,
        rough: PolishResult,
        outcome: SearchOutcome,
    ) -> (FitMinimum, usize) {
        let mut found = FitMinimum {
            loss: self.loss(polish, &rough),
            x: Vec::new(),
            evaluations: outcome.evaluations,
            history: outcome.history.clone(),
            outcome,
            stop: None,
            complete: true,
            is_at_noise: false,
        };
        found.take(rough);
        let rounds = self.reweighted_on_some(polish, &mut found);
        self.fine(polish, &mut found, rounds);
        found.complete = !found.outcome.stopped && !self.control.is_stopped();
        (found, rounds)
    }

    /// Returns the loss of the fine polish: the caller's, or the one that suits the residuals.
    fn loss(&self, polish: &Polish<'_>, rough: &PolishResult) -> Loss {
        let is_misfit = self.options.is_start_measured && rough.scale <= self.rounding();
        match self.options.loss {
            Loss::Auto if rough.loss == Loss::Squares || is_misfit => {
                self.loss_at(polish, &rough.x)
            }
            Loss::Auto => rough.loss,
            said => said,
        }
    }

    /// Returns the loss that suits the residuals of all points.
    fn loss_at(&self, polish: &Polish<'_>, x: &[f64]) -> Loss {
        let r = polish.residuals(self.points, x);
        let Some(cloud) = self.scan.cloud() else {
            return self.loss_of(x, &r);
        };
        let asked = (Reading::Metric, &self.space.parameters(x)[..]);
        let scale = self.sizes(&r, x).scale;
        let (strays, others) = cloud.split(self.template, asked, STRAY_DEVIATIONS * scale);
        self.loss_with(x, &r, scale, strays > DOMINANT_STRAY_SHARE * others)
    }

    /// Returns the loss that suits the residuals of points in memory.
    fn loss_of(&self, x: &[f64], r: &[f64]) -> Loss {
        let scale = Polish::scale(r);
        self.loss_with(x, r, scale, has_strays(r, scale))
    }

    /// Returns least squares, unless residuals of a robust deviation include stray points or are
    /// systematic.
    ///
    /// Deviations of exact points are misfit of shape, and count in full, unless the start was
    /// measured. Then some points lie on faces that the template lacks, and least squares would
    /// move all dimensions by them. Tukey's biweight would ignore the points of a hole that is off
    /// by any distance; with Cauchy's loss these still determine it, since no others do.
    fn loss_with(&self, x: &[f64], r: &[f64], scale: f64, has_strays: bool) -> Loss {
        match scale <= self.rounding() {
            true if has_strays && self.options.is_start_measured => Loss::Cauchy,
            false if has_strays || self.is_systematic(x, r) => Loss::Tukey,
            _ => Loss::Squares,
        }
    }

    /// Returns true if residuals are misfit of a shape that the template lacks (rounded edges, a
    /// bulge) rather than noise: neighbours have similar residuals. Least squares would spread the
    /// misfit over all dimensions; a robust loss leaves it local.
    fn is_systematic(&self, x: &[f64], r: &[f64]) -> bool {
        self.correlation(x, r, |_| true) > 0.5
    }

    /// Reweights on a subset if there are many points, since it takes many rounds. Returns the
    /// number of rounds left for all points.
    fn reweighted_on_some(&self, polish: &Polish<'_>, found: &mut FitMinimum) -> usize {
        let count = self.options.confirm_points;
        if found.loss == Loss::Squares || self.points.len() <= count.saturating_mul(2) {
            return 12;
        }
        let x = std::mem::take(&mut found.x);
        let some = self.some(count);
        let middle = polish.fine(&polish.here(&some, &[]), x, found.loss, 10);
        found.x = middle.x;
        found.evaluations += middle.evaluations;
        6
    }

    /// Polishes on the points of the final fit, and decides if the residuals are noise.
    fn fine(&self, polish: &Polish<'_>, found: &mut FitMinimum, rounds: usize) {
        let x = std::mem::take(&mut found.x);
        let settling = self.settling();
        let points = polish.here(&settling, &[]);
        let is_exact = || Polish::scale(&polish.residuals(&settling, &x)) <= self.rounding();
        found.take(match found.loss == Loss::Cauchy && is_exact() {
            true => polish.narrowed(&points, x, self.rounding()),
            false => polish.fine(&points, x, found.loss, rounds),
        });
        found.is_at_noise = self.is_noise(polish, &found.x);
    }

    /// Returns true if the remaining distances of neighbouring points are not correlated and have
    /// no tail. For noise of some thousand points the root mean square is up to 1.05 robust
    /// deviations, with one per cent of the points in a misplaced hole 1.2.
    fn is_noise(&self, polish: &Polish<'_>, x: &[f64]) -> bool {
        let r = polish.residuals(self.points, x);
        let sizes = self.sizes(&r, x);
        sizes.scale < self.rounding()
            || (!has_tail(sizes) && self.correlation(x, &r, |_| true) < MAX_NOISE_CORRELATION)
    }

    /// Returns the sizes of the metric residuals of all points.
    fn sizes(&self, r: &[f64], x: &[f64]) -> ResidualSizes {
        match self.scan.cloud() {
            None => ResidualSizes::from_residuals(r),
            Some(cloud) => {
                let asked = (Reading::Metric, &self.space.parameters(x)[..]);
                cloud.sizes(self.template, asked, PointSet::Distinct, r)
            }
        }
    }
}

/// Returns true if residuals have a tail: a misplaced piece leaves one, however few points it has.
fn has_tail(sizes: ResidualSizes) -> bool {
    sizes.rms > 1.1 * sizes.scale
}

/// Returns true if a few stray points, fewer than make tails, dominate the sum of squares: one
/// among three hundred.
fn has_strays(r: &[f64], scale: f64) -> bool {
    let limit = STRAY_DEVIATIONS * scale;
    let (mut strays, mut others) = (0.0, 0.0);
    for r in r.iter().filter(|r| !r.is_nan()) {
        let is_far = r.abs() > limit;
        let sum = if is_far { &mut strays } else { &mut others };
        *sum += r * r;
    }
    strays > DOMINANT_STRAY_SHARE * others
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_stray_point_rules_a_sum_and_a_tail_within_limits_does_not() {
        let mut r = vec![1.0; 300];
        assert!(!has_strays(&r, 1.0));
        // 30 of 299: just more than a tenth of the others' squares.
        r[0] = 30f64.sqrt();
        assert!(!has_strays(&r, 1.0) && has_strays(&r, 0.5));
    }
}
