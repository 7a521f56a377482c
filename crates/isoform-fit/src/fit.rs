//! The one way through: outliers, search, comparison of candidates, polish, report.

use crate::deviation::{self, Data};
use crate::feet::KeptFeet;
use crate::objective::Residuals;
use crate::outliers::{HAS_OUTLIERS, Neighbourhood};
use crate::polish::{Polish, Polished};
use crate::report::Fit;
use crate::scan::Scan;
use crate::search::{Outcome, Search, Step};
use crate::space::Space;
use crate::{Control, FitError, Loss, Method, Options, Template, lm};
use isoform_geom::{Aabb, ParamField, Point3};
use rayon::prelude::*;
use std::time::Instant;

/// A point is an outlier when it lies this many robust deviations off the model...
pub(crate) const OUTLIER_DEVIATIONS: f64 = 6.0;
/// Share of points far off the best candidate from which a trimmed search is tried...
const MANY_FAR: f64 = 0.03;
/// ... far meaning outliers by deviations, and this share of the spacing.
const FAR_SPACINGS: f64 = 0.5;
/// Noise below this share of the size is taken for rounding when deviations are judged.
pub(crate) const EXACT: f64 = 1e-9;
/// A robust misfit of the best minimum above this share of the diagonal asks for more starts, at
/// least so many.
const POOR: f64 = 0.005;
const PATIENT_STARTS: usize = 32;
/// A misfit below this many times the deviation of points from planes through their neighbours is
/// noise: no place of the template can do better. (That deviation counts curvature, too.)
const NOISY: f64 = 1.3;
/// Root mean square over robust deviation from which distances have a tail: noise of some thousand
/// points shows up to 1.05, a hole of one per cent of the points astray 1.2.
const TAIL: f64 = 1.1;
/// Noise has no point farther off than this many robust deviations: one of 10¹⁵...
const STRAY: f64 = 8.0;
/// ... and the squares of points that are come to this share of all others' before they are given
/// less weight: a tenth of them in one point moves the values by a third of their deviations.
const RULING: f64 = 0.1;
/// Distances beyond this share of the diagonal do not make a candidate worse.
const CUT: f64 = 0.05;
/// A correlation of neighbouring residuals below this is none that a wrong model would show: two
/// of its deviations by chance. With 0.2 a flange with its six holes at a wrong place passed.
const ALIKE: f64 = 0.1;
/// Throws of pieces when a minimum is refined by distances: at least, at most, side by side.
const LEAST_REFINED: usize = 16;
const MOST_REFINED: usize = 80;
const REFINED_TOGETHER: usize = 4;
/// Turns of each piece.
const TURNS: usize = 3;
/// How often the best place must be met in them.
const REFINED_HITS: usize = 2;
/// Sums of squared distances that differ by less than this share are one minimum.
const SAME_SCORE: f64 = 1e-2;
/// A sum lower by this share is taken, even if it is of one and the same minimum.
const BETTER_SCORE: f64 = 1e-3;
/// Distances count no more than this share of the diagonal in such a sum, so that a bound on the
/// sum is no matter of a few points.
const FAR_SHARE: f64 = 0.1;
/// A share of a candidate's surface without data above this is no right place: another way to stand
/// is looked for. Half scans are above it, and cost the time of that search.
const COVERED: f64 = 0.1;
/// In a robust sum they count no more than this many robust deviations: of two places the one that
/// more points meet is taken, however far the others are. At 4.5 a tie of two floors of a cup was
/// decided by chance.
const NEAR_DEVIATIONS: f64 = 3.0;
/// Correlation of neighbouring residuals from which they are a shape rather than noise.
const CORRELATED: f64 = 0.5;

/// Fits a template to points.
///
/// # Errors
/// Points, start or bounds that make no sense; a template without finite values; or cancellation
/// before any result.
pub fn fit(
    points: &[Point3],
    template: &dyn Template,
    options: &Options,
    control: &Control,
) -> Result<Fit, FitError> {
    if points.is_empty() {
        let is_free = |p: &&crate::Parameter| p.fixed.is_none() && p.tie.is_none();
        let free = template.parameters().iter().filter(is_free).count();
        return Err(FitError::TooFewPoints { found: 0, free });
    }
    let scan = Scan::new(points, options, control)?;
    match options.method {
        Method::Default => {
            let task = Task::new(&scan, template, options, control)?;
            let mut clock = Clock::new();
            let found = task.candidate(&mut clock)?;
            let fitted = task.settle(found, &mut clock);
            Ok(scan.expand(task.report(fitted, clock)))
        }
        method => {
            let task = Task::new(&scan, template, options, control)?;
            Ok(scan.expand(task.classical(method)?))
        }
    }
}

/// A minimum of the search, and how well it does: what is needed to choose between templates, or
/// between the ways that one may stand, before the best is settled.
pub struct Candidate {
    pub(crate) found: Found,
    /// Root of the mean square distance of the points from the model, far ones cut, times one plus
    /// the share of the model's surface without data: lower is better.
    pub misfit: f64,
    /// Whether most of the model's surface has data.
    is_covered: bool,
    values: Vec<f64>,
    seconds: Vec<(&'static str, f64)>,
}

impl Candidate {
    /// The parameter vector.
    pub fn values(&self) -> &[f64] {
        &self.values
    }
    /// Whether the search found this place again and again.
    pub fn is_certain(&self) -> bool {
        self.found.outcome.certain
    }
    /// Whether the misfit is as low as the noise that neighbouring points show by themselves.
    pub fn is_at_noise(&self) -> bool {
        self.is_covered && self.found.is_at_noise
    }
    /// Tells that another search, of another seed or frame, came to a place as good as this one.
    pub fn confirm(&mut self) {
        self.found.outcome.certain = true;
    }
    /// Counts the time of candidates that were dropped as this one's.
    pub fn add_seconds(&mut self, dropped: &Self) {
        add_all_seconds(&mut self.seconds, &dropped.seconds);
    }
}

/// Searches for the template's best place in the scan.
///
/// # Errors
/// As [`fit`].
pub fn search(
    scan: &Scan<'_>,
    template: &dyn Template,
    options: &Options,
    control: &Control,
) -> Result<Candidate, FitError> {
    let task = Task::new(scan, template, options, control)?;
    let mut clock = Clock::new();
    let found = task.candidate(&mut clock)?;
    Ok(task.assess(found, clock))
}

/// Takes a candidate to the result: the least distance, intervals, verdict.
///
/// # Errors
/// As [`fit`].
pub fn settle(
    scan: &Scan<'_>,
    template: &dyn Template,
    options: &Options,
    control: &Control,
    candidate: Candidate,
) -> Result<Fit, FitError> {
    let task = Task::new(scan, template, options, control)?;
    let mut clock = Clock::new();
    clock.seconds = candidate.seconds;
    let fitted = task.settle(candidate.found, &mut clock);
    Ok(scan.expand(task.report(fitted, clock)))
}

/// Seconds by phase.
#[derive(Clone)]
pub(crate) struct Clock {
    pub(crate) last: Instant,
    pub(crate) seconds: Vec<(&'static str, f64)>,
}

impl Clock {
    pub(crate) fn new() -> Self {
        Self {
            last: Instant::now(),
            seconds: Vec::new(),
        }
    }
    pub(crate) fn lap(&mut self, phase: &'static str) {
        let now = Instant::now();
        add_seconds(&mut self.seconds, phase, (now - self.last).as_secs_f64());
        self.last = now;
    }
}

/// Adds phases to those of the same names.
pub(crate) fn add_all_seconds(all: &mut Vec<(&'static str, f64)>, more: &[(&'static str, f64)]) {
    for (phase, seconds) in more {
        add_seconds(all, phase, *seconds);
    }
}

/// Adds to a phase, which several stages may share.
fn add_seconds(all: &mut Vec<(&'static str, f64)>, phase: &'static str, seconds: f64) {
    match all.iter_mut().find(|(p, _)| *p == phase) {
        Some((_, s)) => *s += seconds,
        None => all.push((phase, seconds)),
    }
}

pub(crate) struct Task<'a> {
    pub(crate) scan: &'a Scan<'a>,
    /// The distinct points of the scan.
    pub(crate) points: &'a [Point3],
    pub(crate) near: &'a Neighbourhood,
    pub(crate) order: &'a [u32],
    pub(crate) data: Aabb,
    pub(crate) template: &'a dyn Template,
    pub(crate) options: &'a Options,
    pub(crate) control: &'a Control<'a>,
    pub(crate) space: Space,
    /// The template's distance, if it has one.
    pub(crate) distance: Option<KeptFeet<'a>>,
}

/// What came of refining a minimum.
#[derive(Clone, Copy, Debug, Default)]
struct Refined {
    /// The best place was met again and again.
    recurred: bool,
    /// It is another place than before.
    elsewhere: bool,
}

/// A minimum of the metric residual (the algebraic one for the paper's methods).
pub(crate) struct Found {
    pub(crate) x: Vec<f64>,
    pub(crate) loss: Loss,
    pub(crate) outcome: Outcome,
    pub(crate) evaluations: usize,
    pub(crate) history: Vec<Step>,
    pub(crate) stop: Option<lm::Stop>,
    pub(crate) complete: bool,
    /// Whether what is left of the distances looks like noise.
    pub(crate) is_at_noise: bool,
}

impl<'a> Task<'a> {
    pub(crate) fn new(
        scan: &'a Scan<'a>,
        template: &'a dyn Template,
        options: &'a Options,
        control: &'a Control<'a>,
    ) -> Result<Self, FitError> {
        let parameters = template.parameters();
        let lengths = [
            ("the start", options.start.as_ref().map(Vec::len)),
            ("bounds", Some(options.bounds.len()).filter(|n| *n > 0)),
        ];
        for (what, found) in lengths {
            if let Some(found) = found.filter(|n| *n != parameters.len()) {
                return Err(FitError::Length {
                    what,
                    found,
                    expected: parameters.len(),
                });
            }
        }
        if let Some(index) = options
            .start
            .as_ref()
            .and_then(|s| s.iter().position(|v| !v.is_finite()))
        {
            return Err(FitError::NotFinite {
                what: "the start",
                index,
            });
        }
        let free = parameters
            .iter()
            .filter(|p| p.fixed.is_none() && p.tie.is_none())
            .count();
        let found = scan.points().len();
        if found < free.max(1) {
            return Err(FitError::TooFewPoints { found, free });
        }
        let space = Space::new(parameters, &options.bounds, scan.data)?;
        Ok(Self {
            scan,
            points: scan.points(),
            near: &scan.near,
            order: &scan.order,
            data: scan.data,
            template,
            options,
            control,
            space,
            distance: template.distance().map(KeptFeet::new),
        })
    }

    /// The points of the search.
    fn kept(&self) -> Vec<Point3> {
        if self.scan.kept.len() < 2 * self.space.len() {
            self.some(self.scan.wanted)
        } else {
            self.scan.kept.clone()
        }
    }

    /// Whether the best minimum of the search lies far off the points.
    fn is_poor(&self, kept: &[Point3], outcome: &Outcome) -> bool {
        let r = self.polish(0).residuals(kept, &outcome.minima[0].x);
        Polish::scale(&r) > (POOR * self.data.diagonal()).max(NOISY * self.scan.local_noise)
    }

    /// Whether residuals are no noise but a shape that the template lacks (rounded edges, a bulge):
    /// neighbours are off alike. Least squares would spread the misfit over all dimensions; a
    /// robust loss leaves it where it is.
    fn is_systematic(&self, r: &[f64]) -> bool {
        const PROBES: usize = 250;
        self.correlation(r, &self.order[..PROBES.min(self.order.len())]) > CORRELATED
    }

    pub(crate) fn some(&self, count: usize) -> Vec<Point3> {
        self.order
            .iter()
            .take(count)
            .map(|&i| self.points[i as usize])
            .collect()
    }

    /// The caller's start, else the template's, as far as they go; the middle of the data-informed
    /// ranges for the rest.
    pub(crate) fn first(&self) -> Option<Vec<f64>> {
        let parameters = self.template.parameters();
        if let Some(start) = &self.options.start {
            return Some(self.space.variables_at(start));
        }
        let is_told =
            (0..self.space.len()).any(|k| parameters[self.space.parameter(k)].start.is_some());
        let mut x: Vec<f64> = (0..self.space.len())
            .map(|k| match parameters[self.space.parameter(k)].start {
                Some(v) => v / self.space.unit(k),
                None => 0.5 * (self.space.start_lo[k] + self.space.start_hi[k]),
            })
            .collect();
        self.space.into_interior(&mut x, 1e-4);
        is_told.then_some(x)
    }

    /// The default method, up to a minimum of the metric residual.
    fn candidate(&self, clock: &mut Clock) -> Result<Found, FitError> {
        let (options, control) = (self.options, self.control);
        let (near, isolated) = (self.near, self.scan.isolated);
        let mut kept = self.kept();
        control.report("search", 0.0);
        let count = options.search_points;
        let search_on = |points: &[Point3], first| {
            Search {
                template: self.template,
                space: &self.space,
                points: &points[..count.min(points.len())],
                options,
                control,
            }
            .run(first)
        };
        let mut outcome = search_on(&kept, self.first());
        if isolated > HAS_OUTLIERS && !outcome.stopped && !outcome.minima.is_empty() {
            // Outliers near the surface decide between minima. With a model at hand most can be
            // told from data, whose neighbours share their lot; and once more on what is left.
            let polish = self.polish(0);
            let x = polish.rough(&kept, outcome.minima[0].x.clone(), true).x;
            let limit = OUTLIER_DEVIATIONS
                * Polish::scale(&polish.residuals(&kept, &x)).max(EXACT * self.data.diagonal());
            near.drop_lone(&mut kept, limit, &|points| polish.residuals(points, &x));
            let mut again = search_on(&kept, Some(outcome.minima[0].x.clone()));
            again.evaluations += outcome.evaluations;
            outcome = again;
        }
        if !outcome.stopped && !outcome.minima.is_empty() && self.is_poor(&kept, &outcome) {
            // Recurrence proves a wide basin, not a good one: where the best minimum is far off the
            // data, more starts decide.
            let patient = Options {
                least_starts: PATIENT_STARTS,
                ..options.clone()
            };
            let points = &kept[..count.min(kept.len())];
            let search = Search {
                template: self.template,
                space: &self.space,
                points,
                options: &patient,
                control,
            };
            let mut again = search.run(Some(outcome.minima[0].x.clone()));
            again.evaluations += outcome.evaluations;
            outcome = again;
        }
        let search = Search {
            template: self.template,
            space: &self.space,
            points: &kept[..count.min(kept.len())],
            options,
            control,
        };
        if outcome.minima.is_empty() {
            return Err(if outcome.stopped {
                FitError::Stopped
            } else {
                FitError::NoFiniteStart {
                    starts: outcome.starts,
                }
            });
        }
        clock.lap("search");
        control.report("polish", 0.0);
        let mut evaluations = outcome.evaluations;
        let mut history = outcome.history.clone();
        let polish = self.polish(outcome.starts);
        let rough = self.compare(&search, &outcome, &kept, &polish, &mut evaluations);
        history.extend(rough.history.iter().cloned());
        control.report("polish", 0.3);
        let loss = match options.loss {
            Loss::Auto if rough.loss == Loss::Squares => {
                let r = polish.residuals(self.points, &rough.x);
                let scale = Polish::scale(&r);
                // What is off exact points is a shape, and weighs as such.
                let is_exact = scale <= EXACT * self.data.diagonal();
                if is_exact || !(has_strays(&r, scale) || self.is_systematic(&r)) {
                    Loss::Squares
                } else {
                    Loss::Tukey
                }
            }
            Loss::Auto => rough.loss,
            said => said,
        };
        let mut x = rough.x.clone();
        let mut rounds = 12;
        if loss != Loss::Squares && self.points.len() > 2 * options.confirm_points {
            // Reweighting takes many rounds: most of them on few points.
            let some = self.some(options.confirm_points);
            let middle = polish.fine(&some, &[], x, loss, 10);
            x = middle.x;
            evaluations += middle.evaluations;
            rounds = 6;
        }
        let mut fine = polish.fine(&self.settling(), &[], x, loss, rounds);
        evaluations += fine.evaluations;
        history.append(&mut fine.history);
        let complete = !outcome.stopped && !control.is_stopped();
        let mut x = fine.x;
        let mut is_at_noise = self.looks_like_noise(&x);
        if complete && self.options.refine && !(outcome.certain && is_at_noise) {
            let refined = self.refine(&search, &mut x, loss, &mut evaluations);
            // What the search had found is as sure as it was, unless there was better.
            outcome.certain = refined.recurred || (outcome.certain && !refined.elsewhere);
            // What was better has its own scale.
            let mut again = polish.fine(&self.settling(), &[], x, loss, rounds);
            evaluations += again.evaluations;
            history.append(&mut again.history);
            x = again.x;
            is_at_noise = self.looks_like_noise(&x);
        }
        clock.lap("polish");
        Ok(Found {
            x,
            loss,
            outcome,
            evaluations,
            history,
            stop: None,
            complete,
            is_at_noise,
        })
    }

    /// Whether what is left of the points' distances is not shared by neighbours.
    fn looks_like_noise(&self, x: &[f64]) -> bool {
        let r = self.polish(0).residuals(self.points, x);
        if Polish::scale(&r) < EXACT * self.data.diagonal() {
            return true;
        }
        let squares = r.iter().filter(|r| r.is_finite()).map(|r| r * r);
        let rms = (squares.sum::<f64>() / r.len() as f64).sqrt();
        // A piece astray leaves a tail, however small its share of the points.
        if rms > TAIL * Polish::scale(&r) {
            return false;
        }
        self.correlation(&r, self.order) < ALIKE
    }

    /// Correlation of the residuals of neighbours, from the first points of an order.
    fn correlation(&self, r: &[f64], order: &[u32]) -> f64 {
        let none = vec![false; r.len()];
        deviation::neighbour_correlation(self.points, r, &none, &self.near.tree, order)
    }

    /// The search once more, by distances: the pieces of the minimum are thrown elsewhere one by
    /// one, and led back by the metric residual on more points than the search sees. Sums of
    /// squares of R-functions are ruled by the large pieces of a part; a hole or a sink of a few
    /// points decides little there, but shows in distances.
    fn refine(
        &self,
        search: &Search<'_>,
        x: &mut Vec<f64>,
        loss: Loss,
        evaluations: &mut usize,
    ) -> Refined {
        let points = self.some(self.options.confirm_points);
        let polish = self.polish(0);
        let mut random = fastrand::Rng::with_seed(self.options.seed ^ 0x9EF1);
        let score = |x: &[f64], cut: f64| -> f64 {
            let r = polish.residuals(&points, x);
            let cut = cut * cut;
            r.iter()
                .map(|r| if r.is_nan() { cut } else { (r * r).min(cut) })
                .sum()
        };
        let far = FAR_SHARE * self.data.diagonal();
        let cut = if loss.is_robust() {
            (NEAR_DEVIATIONS * Polish::scale(&polish.residuals(&points, x))).min(far)
        } else {
            far
        };
        let mut best = score(x, cut);
        let (mut hits, mut tried, mut since) = (1, 0, 0);
        let mut refined = Refined::default();
        while tried < MOST_REFINED && !self.control.is_stopped() {
            let groups = search.groups(x);
            if groups.is_empty() {
                break;
            }
            let starts: Vec<(Vec<bool>, Vec<f64>)> = (0..REFINED_TOGETHER)
                .map(|k| {
                    let mut held = vec![true; x.len()];
                    let mut from = x.clone();
                    let second = random.usize(0..groups.len());
                    let first = (tried + k) % groups.len();
                    // Every other throw moves two pieces: a hole that hides in another one.
                    let both = if k % 2 == 0 {
                        vec![first]
                    } else {
                        vec![first, second]
                    };
                    for &i in both.iter().flat_map(|g| &groups[*g]) {
                        let (lo, hi) = (self.space.start_lo[i], self.space.start_hi[i]);
                        from[i] = lo + (hi - lo) * random.f64();
                        held[i] = false;
                    }
                    self.space.into_interior(&mut from, 1e-3);
                    (held, from)
                })
                .collect();
            let ends: Vec<(Vec<f64>, usize)> = starts
                .into_par_iter()
                .map(|(held, from)| self.led_back(&points, held, from, loss))
                .collect();
            tried += REFINED_TOGETHER;
            for (end, spent) in ends {
                *evaluations += spent;
                let value = score(&end, cut);
                if value < (1.0 - BETTER_SCORE) * best {
                    if value < (1.0 - SAME_SCORE) * best {
                        (hits, since) = (0, tried);
                        refined.elsewhere = true;
                    }
                    (*x, best, hits) = (end, value, hits + 1);
                } else if value < (1.0 + SAME_SCORE) * best {
                    hits += 1;
                }
            }
            // Every piece had its turn since there was something better.
            let least = LEAST_REFINED.max(TURNS * groups.len());
            if hits >= REFINED_HITS && tried - since >= least {
                refined.recurred = true;
                break;
            }
        }
        refined
    }

    /// The metric minimum from a thrown start, its thrown variables first; and the evaluations.
    fn led_back(
        &self,
        points: &[Point3],
        held: Vec<bool>,
        from: Vec<f64>,
        loss: Loss,
    ) -> (Vec<f64>, usize) {
        let mut polish = self.polish(0);
        polish.held = held;
        let first = polish.fine(points, &[], from, Loss::Squares, 1);
        polish.held.fill(false);
        let loss = if loss.is_robust() { Loss::Cauchy } else { loss };
        let then = polish.fine(points, &[], first.x, loss, 5);
        (then.x, first.evaluations + then.evaluations)
    }

    /// How well a minimum does.
    fn assess(&self, found: Found, clock: Clock) -> Candidate {
        let some = self.some(self.options.confirm_points);
        let r = self.measured(&some, &found.x).residuals;
        let cut = CUT * self.data.diagonal();
        let off = |r: &f64| if r.is_nan() { cut } else { r.abs().min(cut) };
        let rms = (r.iter().map(|r| off(r).powi(2)).sum::<f64>() / r.len().max(1) as f64).sqrt();
        let mut values = vec![0.0; self.template.parameters().len()];
        self.space.parameters_at(&found.x, &mut values);
        let data = Data {
            bounds: self.data,
            near: self.near,
            noise: rms,
        };
        let samples = self.options.surface_samples / 4;
        let surface = deviation::model_to_data(self.template, &values, &data, samples);
        let bare = if surface.summary.samples == 0 {
            1.0
        } else {
            surface.summary.share_uncovered
        };
        Candidate {
            misfit: rms * (1.0 + bare),
            is_covered: bare < COVERED,
            found,
            values,
            seconds: clock.seconds,
        }
    }

    pub(crate) fn polish(&self, start: usize) -> Polish<'_> {
        self.polish_with(self.template.metric(), start)
    }

    /// A polish of the given residual.
    pub(crate) fn polish_with<'b>(&'b self, field: &'b dyn ParamField, start: usize) -> Polish<'b> {
        let held = vec![false; self.space.len()];
        Polish {
            field,
            space: &self.space,
            size: self.data.diagonal(),
            control: self.control,
            start,
            held,
        }
    }

    /// Candidates of near-equal sums, each led on to the metric residual on more points; the best
    /// one by a truncated sum. Where that leaves many points far off, a trimmed search takes part.
    fn compare(
        &self,
        search: &Search,
        outcome: &Outcome,
        kept: &[Point3],
        polish: &Polish,
        evaluations: &mut usize,
    ) -> Polished {
        let all = self.some(self.options.confirm_points.max(self.options.search_points));
        let has_outliers = self.scan.isolated > HAS_OUTLIERS;
        let mut lead_on = |x: Vec<f64>| {
            let p = polish.rough(&all, x, has_outliers);
            *evaluations += p.evaluations;
            let r = polish.residuals(&all, &p.x);
            (p, r)
        };
        let mut spent = 0;
        let mut found: Vec<(Polished, Vec<f64>)> = search
            .candidates(outcome)
            .iter()
            .map(|m| {
                let mut objective =
                    Residuals::new(self.template.algebraic(), kept, &[], &self.space);
                let settings = lm::Options {
                    max_iterations: 12,
                    decrease: 1e-4,
                    ..lm::Options::default()
                };
                let (lo, hi) = (&self.space.lo, &self.space.hi);
                let confirmed = lm::minimize(
                    &mut objective,
                    m.x.clone(),
                    lo,
                    hi,
                    &settings,
                    &mut |_, _, _| !self.control.is_stopped(),
                );
                spent += confirmed.iterations;
                lead_on(confirmed.x)
            })
            .collect();
        let mut best = self.least_truncated(&found);
        let limit =
            (OUTLIER_DEVIATIONS * found[best].0.scale).max(FAR_SPACINGS * self.near.spacing);
        let far =
            found[best].1.iter().filter(|r| r.abs() > limit).count() as f64 / all.len() as f64;
        let isolated = if has_outliers {
            1.5 * self.scan.isolated
        } else {
            0.0
        };
        if far > MANY_FAR + isolated && !self.control.is_stopped() {
            let (more, evaluations) =
                search.trimmed(std::slice::from_ref(&found[best].0.x), self.near.spacing);
            spent += evaluations;
            found.extend(more.into_iter().map(lead_on));
            best = self.least_truncated(&found);
        }
        *evaluations += spent;
        found.swap_remove(best).0
    }

    /// The candidate with the least sum of squares, cut at what the best scale of all allows.
    fn least_truncated(&self, found: &[(Polished, Vec<f64>)]) -> usize {
        let least = found
            .iter()
            .map(|f| f.0.scale)
            .fold(f64::INFINITY, f64::min)
            .max(EXACT * self.data.diagonal());
        let cut = (4.5 * least).powi(2);
        let score = |r: &[f64]| {
            r.iter()
                .map(|v| if v.is_nan() { cut } else { (v * v).min(cut) })
                .sum::<f64>()
        };
        // The first candidate has the lowest sum; another must be better beyond doubt.
        (1..found.len()).fold(0, |best, k| {
            if score(&found[k].1) < 0.999 * score(&found[best].1) {
                k
            } else {
                best
            }
        })
    }
}

/// Whether few points far off, fewer than make tails, would rule a sum of squares: one stray point
/// among three hundred.
fn has_strays(r: &[f64], scale: f64) -> bool {
    let limit = STRAY * scale;
    let (mut strays, mut others) = (0.0, 0.0);
    for r in r.iter().filter(|r| !r.is_nan()) {
        let sum = if r.abs() > limit {
            &mut strays
        } else {
            &mut others
        };
        *sum += r * r;
    }
    strays > RULING * others
}
