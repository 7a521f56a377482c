//! The default method up to a minimum of the metric residual: search, comparison, polish, and
//! perturbation of pieces if the minimum is uncertain.

use crate::chunks::{Reading, Sizes, Which};
use crate::clock::Clock;
use crate::deviation;
use crate::lm;
use crate::outliers::HAS_OUTLIERS;
use crate::polish::{Polish, Polished};
use crate::search::{Outcome, Search, Step};
use crate::task::{OUTLIER_DEVIATIONS, Task};
use crate::{FitError, Loss, Options};
use isoform_geom::Point3;

/// A robust misfit of the best minimum above this share of the diagonal asks for more starts.
const POOR: f64 = 0.005;
/// Starts of that search, at least.
const PATIENT_STARTS: usize = 32;
/// A misfit below this many times the deviation of points from planes through their neighbours is
/// noise: no place of the template can do better. (That deviation counts curvature, too.)
const NOISY: f64 = 1.3;
/// Root mean square over robust deviation from which distances have a tail: noise of some thousand
/// points shows up to 1.05, a hole of one per cent of the points astray 1.2.
const TAIL: f64 = 1.1;
/// Noise has no point farther off than this many robust deviations: one of 10¹⁵.
const STRAY: f64 = 8.0;
/// Squares of such points that come to this share of all others' rule a sum of squares: a tenth of
/// them in one point moves the values by a third of their deviations.
const RULING: f64 = 0.1;
/// A correlation of neighbouring residuals below this is none that a wrong model would show: two
/// of its deviations by chance. With 0.2 a flange with its six holes at a wrong place passed.
const ALIKE: f64 = 0.1;
/// Correlation of neighbouring residuals from which they are a shape rather than noise.
const CORRELATED: f64 = 0.5;
/// Points whose neighbours tell whether residuals are a shape.
const PROBES: usize = 250;
/// Rounds of the polish on all points.
const ROUNDS: usize = 12;
/// Rounds of reweighting on some points, and on all points after them.
const ROUNDS_ON_SOME: (usize, usize) = (10, 6);

/// A minimum of the metric residual (of the algebraic one for the methods of paper C).
pub(crate) struct Found {
    pub(crate) x: Vec<f64>,
    pub(crate) loss: Loss,
    pub(crate) outcome: Outcome,
    pub(crate) evaluations: usize,
    pub(crate) history: Vec<Step>,
    pub(crate) stop: Option<lm::Stop>,
    pub(crate) complete: bool,
    /// True if the remaining distances look like noise.
    pub(crate) is_at_noise: bool,
}

impl Found {
    /// Takes over the variables, the evaluations and the history of a polish.
    fn take(&mut self, polished: Polished) {
        self.x = polished.x;
        self.evaluations += polished.evaluations;
        self.history.extend(polished.history);
    }
}

impl Task<'_> {
    /// Returns the best minimum that the default method finds.
    pub(crate) fn candidate(&self, clock: &mut Clock) -> Result<Found, FitError> {
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

    /// Returns the points of the search.
    fn kept(&self) -> Vec<Point3> {
        if self.scan.kept.len() < 2 * self.space.len() {
            self.some(self.scan.wanted)
        } else {
            self.scan.kept.clone()
        }
    }

    /// Sets up a search on the first of some points.
    fn search_on<'b>(&'b self, points: &'b [Point3], options: &'b Options) -> Search<'b> {
        Search {
            template: self.template,
            space: &self.space,
            points: &points[..options.search_points.min(points.len())],
            options,
            control: self.control,
        }
    }

    /// Returns the minima of the algebraic residual. Outliers that a first model reveals are
    /// removed from `kept`.
    fn searched(&self, kept: &mut Vec<Point3>) -> Result<Outcome, FitError> {
        let mut outcome = self.search_on(kept, self.options).run(self.first());
        if self.scan.isolated > HAS_OUTLIERS && outcome.can_go_on() {
            self.drop_lone(kept, &outcome);
            outcome = self.search_on(kept, self.options).run_again(outcome);
        }
        if outcome.can_go_on() && self.is_poor(kept, &outcome) {
            // Recurrence proves a wide basin, not a good minimum: if the best one is far off the
            // data, more starts are run.
            let patient = Options {
                least_starts: PATIENT_STARTS,
                ..self.options.clone()
            };
            outcome = self.search_on(kept, &patient).run_again(outcome);
        }
        match outcome {
            Outcome { ref minima, .. } if !minima.is_empty() => Ok(outcome),
            Outcome { stopped: true, .. } => Err(FitError::Stopped),
            Outcome { starts, .. } => Err(FitError::NoFiniteStart { starts }),
        }
    }

    /// Drops outliers near the surface, which can decide between minima. With a model, most of them
    /// can be told from data: the neighbours of data have similar residuals.
    fn drop_lone(&self, kept: &mut Vec<Point3>, outcome: &Outcome) {
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
    fn is_poor(&self, kept: &[Point3], outcome: &Outcome) -> bool {
        let r = self.polish(0).residuals(kept, &outcome.minima[0].x);
        Polish::scale(&r) > (POOR * self.size()).max(NOISY * self.scan.local_noise)
    }

    /// Returns the minimum of the metric residual to which the search leads.
    fn polished(&self, search: &Search<'_>, outcome: Outcome, kept: &[Point3]) -> Found {
        let polish = self.polish(outcome.starts);
        let rough = self.compared(search, &outcome, kept, &polish);
        self.control.report("polish", 0.3);
        let mut found = Found {
            loss: self.loss(&polish, &rough),
            x: Vec::new(),
            evaluations: outcome.evaluations,
            history: outcome.history.clone(),
            outcome,
            stop: None,
            complete: true,
            is_at_noise: false,
        };
        found.take(rough);
        let rounds = self.reweighted_on_some(&polish, &mut found);
        self.fine(&polish, &mut found, rounds);
        found.complete = !found.outcome.stopped && !self.control.is_stopped();
        let is_settled = found.outcome.certain && found.is_at_noise;
        if found.complete && self.options.refine && !is_settled {
            self.refine(search, &mut found);
            // A better minimum has another scale.
            self.fine(&polish, &mut found, rounds);
        }
        found
    }

    /// Returns the loss of the fine polish: the caller's, or the one that suits the residuals.
    fn loss(&self, polish: &Polish<'_>, rough: &Polished) -> Loss {
        match self.options.loss {
            Loss::Auto if rough.loss == Loss::Squares => self.loss_at(polish, &rough.x),
            Loss::Auto => rough.loss,
            said => said,
        }
    }

    /// Returns the loss that suits the residuals of all points.
    fn loss_at(&self, polish: &Polish<'_>, x: &[f64]) -> Loss {
        let r = polish.residuals(self.points, x);
        let Some(cloud) = self.scan.cloud() else {
            return self.loss_of(&r);
        };
        let asked = (Reading::Metric, &self.space.parameters(x)[..]);
        let scale = cloud.sizes(self.template, asked, Which::Distinct, &r).scale;
        if scale <= self.rounding() {
            return Loss::Squares;
        }
        let (strays, others) = cloud.split(self.template, asked, STRAY * scale);
        if strays > RULING * others || self.is_systematic(&r) {
            Loss::Tukey
        } else {
            Loss::Squares
        }
    }

    /// Returns least squares, unless residuals include stray points or are systematic.
    fn loss_of(&self, r: &[f64]) -> Loss {
        let scale = Polish::scale(r);
        // Deviations of exact points are misfit of shape, and count in full.
        let is_exact = scale <= self.rounding();
        if is_exact || !(has_strays(r, scale) || self.is_systematic(r)) {
            Loss::Squares
        } else {
            Loss::Tukey
        }
    }

    /// Returns true if residuals are misfit of a shape that the template lacks (rounded edges, a
    /// bulge) rather than noise: neighbours have similar residuals. Least squares would spread the
    /// misfit over all dimensions; a robust loss leaves it local.
    fn is_systematic(&self, r: &[f64]) -> bool {
        self.correlation(r, PROBES) > CORRELATED
    }

    /// Reweights on a subset if there are many points, since it takes many rounds. Returns the
    /// number of rounds left for all points.
    fn reweighted_on_some(&self, polish: &Polish<'_>, found: &mut Found) -> usize {
        let count = self.options.confirm_points;
        if found.loss == Loss::Squares || self.points.len() <= count.saturating_mul(2) {
            return ROUNDS;
        }
        let x = std::mem::take(&mut found.x);
        let some = self.some(count);
        let middle = polish.fine(&polish.here(&some, &[]), x, found.loss, ROUNDS_ON_SOME.0);
        found.x = middle.x;
        found.evaluations += middle.evaluations;
        ROUNDS_ON_SOME.1
    }

    /// Polishes on the points of the final fit, and decides if the residuals are noise.
    fn fine(&self, polish: &Polish<'_>, found: &mut Found, rounds: usize) {
        let x = std::mem::take(&mut found.x);
        let settling = self.settling();
        found.take(polish.fine(&polish.here(&settling, &[]), x, found.loss, rounds));
        found.is_at_noise = self.is_noise(polish, &found.x);
    }

    /// Returns true if the remaining distances of neighbouring points are not correlated and have
    /// no tail. For noise of some thousand points the root mean square is up to 1.05 robust
    /// deviations, with one per cent of the points in a misplaced hole 1.2.
    fn is_noise(&self, polish: &Polish<'_>, x: &[f64]) -> bool {
        let r = polish.residuals(self.points, x);
        let Sizes { scale, rms } = match self.scan.cloud() {
            None => Sizes::of(&r),
            Some(cloud) => {
                let asked = (Reading::Metric, &self.space.parameters(x)[..]);
                cloud.sizes(self.template, asked, Which::Distinct, &r)
            }
        };
        // A misplaced piece leaves a tail, however few points it has.
        scale < self.rounding()
            || (rms <= TAIL * scale && self.correlation(&r, deviation::PROBES) < ALIKE)
    }
}

/// Returns true if a few stray points, fewer than make tails, dominate the sum of squares: one
/// among three hundred.
fn has_strays(r: &[f64], scale: f64) -> bool {
    let limit = STRAY * scale;
    let (mut strays, mut others) = (0.0, 0.0);
    for r in r.iter().filter(|r| !r.is_nan()) {
        let is_far = r.abs() > limit;
        let sum = if is_far { &mut strays } else { &mut others };
        *sum += r * r;
    }
    strays > RULING * others
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
