//! The one way through: outliers, search, comparison of candidates, polish, report.

use crate::annealing;
use crate::bfgs;
use crate::deviation::{self, Surface};
use crate::identify::{At, Knowledge, student95};
use crate::objective::{Objective, Residuals, sum_of_squares};
use crate::outliers::{HAS_OUTLIERS, MOST_DROPPED, Neighbourhood};
use crate::polish::{Polish, Polished, rims, weight};
use crate::report::{Estimate, Fit, Open, OtherMinimum, PartStatistics, Status};
use crate::search::{Outcome, Search, Step};
use crate::space::Space;
use crate::{Control, FitError, Kind, Local, Loss, Method, Options, Template, lm};
use isoform_geom::{Aabb, Point3};
use std::time::Instant;

/// A point is an outlier when it lies this many robust deviations off the model...
const OUTLIER_DEVIATIONS: f64 = 6.0;
/// ... and farther than this share of the point spacing (edges rounded by a mesher or a scanner are no outliers).
const OUTLIER_SPACINGS: f64 = 0.3;
/// Share of points far off the best candidate from which a trimmed search is tried...
const MANY_FAR: f64 = 0.03;
/// ... far meaning outliers by deviations, and this share of the spacing.
const FAR_SPACINGS: f64 = 0.5;
/// Noise below this share of the size is taken for rounding when deviations are judged.
const EXACT: f64 = 1e-9;
/// A misfit above this share of the data's diagonal is refused (scanner noise is some 1e-4 to 5e-3 of it).
const BAD_RMS: f64 = 0.02;
/// A share of the model's surface without data above this is refused; half of an object, its lower side, is often unseen.
const BAD_UNCOVERED: f64 = 0.6;
/// A robust misfit of the best minimum above this share of the diagonal asks for more starts, at least so many.
const POOR: f64 = 0.005;
const PATIENT_STARTS: usize = 32;
/// A systematic misfit above this share of the diagonal together with this share of the surface without data is refused, too: the model
/// found its way around the data (a beaker on a mug: 1 % and one half).
const DOUBTFUL: (f64, f64) = (0.005, 0.25);
/// Outliers above this share are refused.
const BAD_OUTLIERS: f64 = 0.35;
/// A deviation above this share of the diagonal (0.1 rad or 0.1 for angles and ratios) makes a parameter weak.
const WEAK: f64 = 0.02;
/// Correlation of neighbouring residuals from which intervals are said to be too narrow.
const CORRELATED: f64 = 0.5;
/// Most other minima told of.
const MOST_MINIMA: usize = 5;
/// Points that flatness of directions is tested on, at most.
const MOST_TESTED: usize = 16_384;

/// Fits a template to points.
///
/// # Errors
/// Points, start or bounds that make no sense; a template without finite values; or cancellation before any result.
pub fn fit(
    points: &[Point3],
    template: &dyn Template,
    options: &Options,
    control: &Control,
) -> Result<Fit, FitError> {
    let task = Task::new(points, template, options, control)?;
    match options.method {
        Method::Default => task.searched(),
        method => task.classical(method),
    }
}

/// Seconds by phase.
#[derive(Clone)]
struct Clock {
    last: Instant,
    seconds: Vec<(&'static str, f64)>,
}

impl Clock {
    fn lap(&mut self, phase: &'static str) {
        let now = Instant::now();
        self.seconds.push((phase, (now - self.last).as_secs_f64()));
        self.last = now;
    }
}

struct Task<'a> {
    points: &'a [Point3],
    template: &'a dyn Template,
    options: &'a Options,
    control: &'a Control<'a>,
    space: Space,
    data: Aabb,
    /// A seeded random order of the points.
    order: Vec<u32>,
    near: Neighbourhood,
    /// Some points, in that order, without isolated ones.
    kept: Vec<Point3>,
    /// Share of isolated ones among those looked at.
    isolated: f64,
    clock: Clock,
}

/// What the stages before the report leave.
struct Fitted {
    x: Vec<f64>,
    loss: Loss,
    noise: f64,
    outcome: Outcome,
    isolated: f64,
    evaluations: usize,
    history: Vec<Step>,
    stop: Option<lm::Stop>,
    complete: bool,
    /// 0 for points that the polish left out because they lie on rims; empty for none.
    mask: Vec<f64>,
}

impl<'a> Task<'a> {
    fn new(
        points: &'a [Point3],
        template: &'a dyn Template,
        options: &'a Options,
        control: &'a Control<'a>,
    ) -> Result<Self, FitError> {
        let mut clock = Clock {
            last: Instant::now(),
            seconds: Vec::new(),
        };
        let parameters = template.parameters();
        if let Some(index) = points.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
            return Err(FitError::NotFinite {
                what: "a point",
                index,
            });
        }
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
        let found = distinct(points, free.max(1));
        if found < free.max(1) {
            return Err(FitError::TooFewPoints { found, free });
        }
        control.report("outliers", 0.0);
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        fastrand::Rng::with_seed(options.seed).shuffle(&mut order);
        let near = Neighbourhood::new(points, &order);
        let count = (options.confirm_points / 2).max(options.search_points);
        let (mut kept, isolated) = if options.filter_outliers {
            near.keep(points, &order, count)
        } else {
            (Vec::new(), 0.0)
        };
        if !options.filter_outliers || isolated > MOST_DROPPED || kept.len() < 2 * free {
            kept = order
                .iter()
                .take(count)
                .map(|&i| points[i as usize])
                .collect();
        }
        let data = trusted_box(points, &kept, isolated, near.spacing);
        let space = Space::new(parameters, &options.bounds, data)?;
        clock.lap("outliers");
        Ok(Self {
            points,
            template,
            options,
            control,
            space,
            data,
            order,
            near,
            kept,
            isolated,
            clock,
        })
    }

    /// Whether the best minimum of the search lies far off the points.
    fn is_poor(&self, kept: &[Point3], outcome: &Outcome) -> bool {
        let r = self.polish(0).residuals(kept, &outcome.minima[0].x);
        Polish::scale(&r) > POOR * self.data.diagonal()
    }

    /// Whether residuals are no noise but a shape that the template lacks (rounded edges, a bulge): neighbours are off alike. Least
    /// squares would spread the misfit over all dimensions; a robust loss leaves it where it is.
    fn is_systematic(&self, polish: &Polish<'_>, x: &[f64]) -> bool {
        const PROBES: usize = 250;
        let r = polish.residuals(self.points, x);
        if Polish::scale(&r) <= EXACT * self.data.diagonal() {
            return false;
        }
        let order = &self.order[..PROBES.min(self.order.len())];
        deviation::neighbour_correlation(
            self.points,
            &r,
            &vec![false; r.len()],
            &self.near.tree,
            order,
        ) > CORRELATED
    }

    fn some(&self, count: usize) -> Vec<Point3> {
        self.order
            .iter()
            .take(count)
            .map(|&i| self.points[i as usize])
            .collect()
    }

    /// The caller's start, else the template's, as far as they go; the middle of the data-informed ranges for the rest.
    fn first(&self) -> Option<Vec<f64>> {
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

    /// The default method.
    fn searched(&self) -> Result<Fit, FitError> {
        let (options, control) = (self.options, self.control);
        let (near, isolated) = (&self.near, self.isolated);
        let (mut clock, mut kept) = (self.clock.clone(), self.kept.clone());
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
            // Outliers near the surface decide between minima. With a model at hand most can be told from data, whose neighbours
            // share their lot; and once more on what is left.
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
            // Recurrence proves a wide basin, not a good one: where the best minimum is far off the data, more starts decide.
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
        let mut polish = self.polish(outcome.starts);
        let rough = self.compare(&search, &outcome, &kept, &polish, &mut evaluations);
        history.extend(rough.history.iter().cloned());
        control.report("polish", 0.3);
        let loss = match options.loss {
            Loss::Auto if rough.loss == Loss::Squares && self.is_systematic(&polish, &rough.x) => {
                Loss::Tukey
            }
            Loss::Auto => rough.loss,
            said => said,
        };
        let (mut x, mut noise) = (rough.x.clone(), rough.scale);
        let mut mask = self.mask(&x, noise);
        let mut rounds = 12;
        if loss != Loss::Squares && self.points.len() > 2 * options.confirm_points {
            // Reweighting takes many rounds: most of them on few points.
            let some = self.some(options.confirm_points);
            let middle = polish.fine(&some, &[], x, loss, 10);
            x = middle.x;
            evaluations += middle.evaluations;
            rounds = 6;
        }
        let mut fine = polish.fine(self.points, &mask, x, loss, rounds);
        evaluations += fine.evaluations;
        history.append(&mut fine.history);
        (x, noise) = (fine.x, fine.scale);
        clock.lap("polish");
        control.report("report", 0.0);
        let knowledge = self.knowledge(&x, loss, noise, &mask);
        let mut held = vec![false; self.space.len()];
        if !knowledge.directions.is_empty() {
            // Off the data first: an open face that touches noisy points of its neighbours would pull at those.
            for (k, direction, sense) in &knowledge.directions {
                self.step_clear(&mut x, *k, direction, *sense, noise, near.spacing);
                held[*k] = true;
            }
            polish.held.clone_from(&held);
            mask = self.mask(&x, noise);
            let mut again = polish.fine(self.points, &mask, x, loss, rounds);
            evaluations += again.evaluations;
            history.append(&mut again.history);
            x = again.x;
            noise = again.scale;
        }
        let complete = !outcome.stopped && !control.stops();
        let result = Fitted {
            x,
            loss,
            noise,
            outcome,
            isolated,
            evaluations,
            history,
            stop: None,
            complete,
            mask,
        };
        Ok(self.report(result, knowledge, &held, clock))
    }

    /// The paper's methods: algebraic residual on all points, no polish.
    fn classical(&self, method: Method) -> Result<Fit, FitError> {
        let mut clock = self.clock.clone();
        let control = self.control;
        let mut objective =
            Residuals::new(self.template.algebraic(), self.points, &[], &self.space);
        let count = self.points.len() as f64;
        let x = self.first().unwrap_or_else(|| {
            let mut x: Vec<f64> = self
                .space
                .start_lo
                .iter()
                .zip(&self.space.start_hi)
                .map(|(a, b)| 0.5 * (a + b))
                .collect();
            self.space.into_interior(&mut x, 1e-4);
            x
        });
        let mut outcome = Outcome {
            starts: 1,
            ..Outcome::default()
        };
        let mut history = Vec::new();
        let (mut x, mut evaluations, mut stop) = (x, 0, None);
        let then = match method {
            Method::Default => Some(Local::Lm),
            Method::Local(local) => Some(local),
            Method::Annealing | Method::Hybrid { .. } => {
                let mut settings = annealing::Options {
                    seed: self.options.seed,
                    max_evaluations: self.options.annealing_evaluations,
                    ..annealing::Options::default()
                };
                let mut then = None;
                if let Method::Hybrid { local, threshold } = method {
                    settings.threshold = threshold
                        .unwrap_or_else(|| self.threshold(&mut objective))
                        .powi(2)
                        * count;
                    then = Some(local);
                }
                let most = self.options.annealing_evaluations.max(1) as f64;
                let cooled = annealing::minimize(
                    &mut objective,
                    x,
                    &self.space.lo,
                    &self.space.hi,
                    &settings,
                    &mut |k, value| {
                        history.push(Step {
                            start: 0,
                            iteration: k,
                            rms: (value / count).sqrt(),
                        });
                        control.report("annealing", (k as f64 / most).min(1.0));
                        !control.stops()
                    },
                );
                evaluations += cooled.evaluations;
                x = cooled.x;
                self.space.into_interior(&mut x, 1e-9);
                clock.lap("annealing");
                then
            }
        };
        if let Some(local) = then {
            let mut monitor = |k: usize, _: &[f64], value: f64| {
                history.push(Step {
                    start: 0,
                    iteration: evaluations + k,
                    rms: (value / count).sqrt(),
                });
                !control.stops()
            };
            let (lo, hi) = (&self.space.lo, &self.space.hi);
            let m = match local {
                Local::Lm => lm::minimize(
                    &mut objective,
                    x,
                    lo,
                    hi,
                    &lm::Options {
                        exact: true,
                        ..lm::Options::default()
                    },
                    &mut monitor,
                ),
                Local::Bfgs => bfgs::minimize(
                    &mut objective,
                    x,
                    lo,
                    hi,
                    &bfgs::Options::default(),
                    &mut monitor,
                ),
            };
            evaluations += m.iterations;
            stop = Some(m.stop);
            if m.stop == lm::Stop::NotFinite {
                return Err(FitError::NoFiniteStart { starts: 1 });
            }
            x = m.x;
            clock.lap("local");
        }
        let value = objective.value(&x);
        if !value.is_finite() {
            return Err(FitError::NoFiniteStart { starts: 1 });
        }
        outcome.minima.push(crate::search::Found {
            x: x.clone(),
            value,
            hits: 1,
        });
        let noise = Polish::scale(&self.polish(1).residuals(self.points, &x));
        let knowledge = self.knowledge(&x, Loss::Squares, noise, &[]);
        let held = vec![false; self.space.len()];
        let complete = !control.stops();
        let result = Fitted {
            x,
            loss: Loss::Squares,
            noise,
            outcome,
            isolated: 0.0,
            evaluations,
            history,
            stop,
            complete,
            mask: Vec::new(),
        };
        Ok(self.report(result, knowledge, &held, clock))
    }

    /// The paper ends its annealing at a mean |f| of 0.04; here of the typical |f| of random starts.
    fn threshold(&self, objective: &mut Residuals) -> f64 {
        let mut random = fastrand::Rng::with_seed(self.options.seed);
        let count = self.points.len() as f64;
        let mut v: Vec<f64> = (0..15)
            .map(|_| {
                let x: Vec<f64> = self
                    .space
                    .start_lo
                    .iter()
                    .zip(&self.space.start_hi)
                    .map(|(a, b)| a + (b - a) * random.f64())
                    .collect();
                (objective.value(&x) / count).sqrt()
            })
            .filter(|v| v.is_finite())
            .collect();
        0.04 * crate::outliers::median(&mut v)
    }

    fn polish(&self, start: usize) -> Polish<'_> {
        let held = vec![false; self.space.len()];
        Polish {
            field: self.template.metric(),
            space: &self.space,
            size: self.data.diagonal(),
            control: self.control,
            start,
            held,
        }
    }

    /// Candidates of near-equal sums, each led on to the metric residual on more points; the best one by a truncated sum. Where that
    /// leaves many points far off, a trimmed search takes part.
    fn compare(
        &self,
        search: &Search,
        outcome: &Outcome,
        kept: &[Point3],
        polish: &Polish,
        evaluations: &mut usize,
    ) -> Polished {
        let all = self.some(self.options.confirm_points.max(self.options.search_points));
        let has_outliers = self.isolated > HAS_OUTLIERS;
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
                    &mut |_, _, _| !self.control.stops(),
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
            1.5 * self.isolated
        } else {
            0.0
        };
        if far > MANY_FAR + isolated && !self.control.stops() {
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

    /// Points on rims, where noise is worth the name.
    fn mask(&self, x: &[f64], noise: f64) -> Vec<f64> {
        if noise <= EXACT * self.data.diagonal() {
            return Vec::new();
        }
        let mut a = vec![0.0; self.template.parameters().len()];
        self.space.parameters_at(x, &mut a);
        rims(self.template, self.points, &a, noise)
    }

    fn knowledge(&self, x: &[f64], loss: Loss, noise: f64, mask: &[f64]) -> Knowledge {
        if self.points.len() > MOST_TESTED {
            let some = self.some(MOST_TESTED);
            let mask: Vec<f64> = if mask.is_empty() {
                Vec::new()
            } else {
                self.order[..MOST_TESTED]
                    .iter()
                    .map(|&i| mask[i as usize])
                    .collect()
            };
            let residuals = self.polish(0).residuals(&some, x);
            return self
                .at(&some, x, &residuals, loss, noise, &mask)
                .knowledge();
        }
        let residuals = self.polish(0).residuals(self.points, x);
        self.at(self.points, x, &residuals, loss, noise, mask)
            .knowledge()
    }

    fn at<'b>(
        &'b self,
        points: &'b [Point3],
        x: &'b [f64],
        residuals: &'b [f64],
        loss: Loss,
        noise: f64,
        mask: &'b [f64],
    ) -> At<'b> {
        let scale = if !loss.is_robust() {
            (residuals
                .iter()
                .filter(|r| r.is_finite())
                .map(|r| r * r)
                .sum::<f64>()
                / residuals.len().max(1) as f64)
                .sqrt()
        } else {
            noise
        };
        At {
            field: self.template.metric(),
            points,
            space: &self.space,
            x,
            residuals,
            mask,
            loss,
            scale,
            least_scale: EXACT * self.data.diagonal(),
        }
    }

    /// Moves along an open direction by a few noise deviations, within bounds.
    fn step_clear(
        &self,
        x: &mut [f64],
        k: usize,
        direction: &[f64],
        sense: f64,
        noise: f64,
        spacing: f64,
    ) {
        let mut t = (6.0 * noise).max(0.25 * spacing) / self.space.unit(k);
        for j in 0..x.len() {
            let by = sense * direction[j];
            let gap = if by > 0.0 {
                self.space.hi[j] - x[j]
            } else {
                x[j] - self.space.lo[j]
            };
            if by != 0.0 {
                t = t.min(0.5 * gap / by.abs());
            }
        }
        for j in 0..x.len() {
            x[j] += sense * t * direction[j];
        }
        self.space.into_interior(x, 1e-9);
    }

    fn report(&self, result: Fitted, knowledge: Knowledge, held: &[bool], mut clock: Clock) -> Fit {
        let Fitted {
            x,
            loss,
            noise,
            outcome,
            isolated,
            evaluations,
            history,
            stop,
            complete,
            mask,
        } = result;
        let (n, near) = (self.points.len(), &self.near);
        let mut a = vec![0.0; self.template.parameters().len()];
        self.space.parameters_at(&x, &mut a);
        let residuals = self.polish(0).residuals(self.points, &x);
        let robust = loss.is_robust();
        let limit = (OUTLIER_DEVIATIONS * noise).max(OUTLIER_SPACINGS * near.spacing);
        let outliers: Vec<bool> = residuals
            .iter()
            .map(|r| !r.is_finite() || (robust && r.abs() > limit))
            .collect();
        let n_outliers = outliers.iter().filter(|v| **v).count();
        let mut weights: Vec<f64> = residuals
            .iter()
            .map(|r| {
                if r.is_finite() {
                    weight(loss, r / noise.max(f64::MIN_POSITIVE))
                } else {
                    0.0
                }
            })
            .collect();
        weights.iter_mut().zip(&mask).for_each(|(w, m)| *w *= m);
        let used: Vec<f64> = if n_outliers > 0 {
            outliers
                .iter()
                .map(|o| if *o { 0.0 } else { 1.0 })
                .collect()
        } else {
            Vec::new()
        };
        let sum_f2 = self.algebraic_sum(&used, &outliers, &a);
        let data_to_model = deviation::data_to_model(&residuals, &outliers);
        let surface = deviation::model_to_data(
            self.template.metric(),
            &a,
            self.data,
            &near.tree,
            near.spacing,
            noise,
            self.options.surface_samples,
        );
        let mut parts = vec![0; n];
        self.template.parts(self.points, &a, &mut parts);
        let mut surface_parts = vec![0; surface.points.len()];
        self.template.parts(&surface.points, &a, &mut surface_parts);
        let part_statistics =
            self.part_statistics(&residuals, &outliers, &parts, &surface, &surface_parts);
        let covariance = if held.iter().any(|v| *v) || n > MOST_TESTED {
            self.at(self.points, &x, &residuals, loss, noise, &mask)
                .covariance_without(held)
        } else {
            knowledge.covariance.clone()
        };
        let covariance = self.space.push_forward(&covariance);
        let parameters = self.estimates(&x, &a, &covariance, &knowledge, n);
        let undetermined = self.words(&knowledge, &a, &surface, &surface_parts, &part_statistics);
        let correlation = deviation::neighbour_correlation(
            self.points,
            &residuals,
            &outliers,
            &near.tree,
            &self.order,
        );
        let other_minima = self.others(&outcome, &x, &used, &outliers);
        let hits = outcome.minima.first().map_or(0, |m| m.hits);
        let mut fit = Fit {
            parameters,
            sum_f2,
            rms: data_to_model.rms,
            noise,
            n_points: n,
            n_used: n - n_outliers,
            n_outliers,
            isolated,
            spacing: near.spacing,
            data_to_model,
            model_to_data: surface.summary,
            starts: outcome.starts,
            hits,
            evaluations,
            other_minima,
            undetermined,
            warnings: Vec::new(),
            acceptable: true,
            reasons: Vec::new(),
            loss,
            residuals,
            weights,
            outliers,
            parts,
            part_statistics,
            covariance,
            neighbour_correlation: correlation,
            history,
            stop,
            seconds: Vec::new(),
            complete,
        };
        self.judge(&mut fit, outcome.certain);
        clock.lap("report");
        fit.seconds = clock.seconds;
        self.control.report("report", 1.0);
        fit
    }

    /// Σ f² over the points used, NaN left out.
    fn algebraic_sum(&self, used: &[f64], outliers: &[bool], a: &[f64]) -> f64 {
        if used.is_empty() {
            return sum_of_squares(self.template.algebraic(), self.points, &[], a);
        }
        let kept: Vec<Point3> = self
            .points
            .iter()
            .zip(outliers)
            .filter(|(_, o)| !**o)
            .map(|(p, _)| *p)
            .collect();
        sum_of_squares(self.template.algebraic(), &kept, &[], a)
    }

    fn part_statistics(
        &self,
        r: &[f64],
        out: &[bool],
        parts: &[u32],
        surface: &Surface,
        surface_parts: &[u32],
    ) -> Vec<PartStatistics> {
        let names = self.template.part_names();
        let mut stats: Vec<PartStatistics> = names
            .iter()
            .map(|name| PartStatistics {
                name: name.clone(),
                count: 0,
                rms: 0.0,
                mean: 0.0,
                max: 0.0,
                uncovered: None,
            })
            .collect();
        for ((r, out), part) in r.iter().zip(out).zip(parts) {
            if let Some(s) = stats.get_mut(*part as usize).filter(|_| !out) {
                s.count += 1;
                s.rms += r * r;
                s.mean += r;
                s.max = s.max.max(r.abs());
            }
        }
        let mut samples = vec![(0_usize, 0_usize); names.len()];
        for (d, part) in surface.distances.iter().zip(surface_parts) {
            if let Some(s) = samples.get_mut(*part as usize) {
                s.0 += 1;
                s.1 += usize::from(*d > surface.summary.uncovered_from);
            }
        }
        for (s, (all, bare)) in stats.iter_mut().zip(samples) {
            let n = s.count.max(1) as f64;
            s.rms = (s.rms / n).sqrt();
            s.mean /= n;
            s.uncovered = (all > 0).then(|| bare as f64 / all as f64);
        }
        stats
    }

    fn estimates(
        &self,
        x: &[f64],
        a: &[f64],
        covariance: &[f64],
        knowledge: &Knowledge,
        n: usize,
    ) -> Vec<Estimate> {
        let parameters = self.template.parameters();
        let count = parameters.len();
        let width = student95(n as f64 - self.space.len() as f64);
        let mut open = vec![false; count];
        for &k in knowledge.open.iter().flatten() {
            for &(i, _) in self.space.column(k) {
                open[i] = true;
            }
        }
        let mut variable = vec![None; count];
        for k in 0..self.space.len() {
            variable[self.space.parameter(k)] = Some(k);
        }
        let moves: Vec<bool> = {
            let mut moves = vec![false; count];
            (0..self.space.len()).for_each(|k| {
                self.space
                    .column(k)
                    .iter()
                    .for_each(|&(i, _)| moves[i] = true)
            });
            moves
        };
        (0..count)
            .map(|i| {
                let p = &parameters[i];
                let sd = covariance[i * count + i].max(0.0).sqrt();
                let (lo, hi) = self.space.bounds[i];
                let at_bound = variable[i].is_some_and(|k| {
                    let range = (self.space.hi[k] - self.space.lo[k]).min(1.0);
                    let gap = (x[k] - self.space.lo[k]).min(self.space.hi[k] - x[k]);
                    gap < (1e-5 * range)
                        .max(0.01 * sd / self.space.unit(k))
                        .min(1e-2 * range)
                });
                let is_weak = match p.kind {
                    Kind::Angle | Kind::Ratio => sd > 0.1,
                    _ => sd > WEAK * self.data.diagonal().max(1e-300),
                };
                let status = if !moves[i] {
                    Status::Fixed
                } else if open[i] {
                    Status::Undetermined
                } else if at_bound {
                    Status::AtBound
                } else if is_weak || !sd.is_finite() {
                    Status::Weak
                } else {
                    Status::Determined
                };
                let known = matches!(status, Status::Determined | Status::Weak | Status::AtBound)
                    && sd.is_finite();
                let half = width * sd;
                Estimate {
                    name: p.name.clone(),
                    value: a[i],
                    sd: known.then_some(sd),
                    ci95: known.then_some((a[i] - half, a[i] + half)),
                    status,
                    bounds: (lo, hi),
                    unit: p.unit.clone(),
                }
            })
            .collect()
    }

    /// The open groups in words: pieces that these parameters move and no data support, else the bare fact.
    fn words(
        &self,
        knowledge: &Knowledge,
        a: &[f64],
        surface: &Surface,
        surface_parts: &[u32],
        stats: &[PartStatistics],
    ) -> Vec<Open> {
        let parameters = self.template.parameters();
        let n = parameters.len();
        if knowledge.open.is_empty() {
            return Vec::new();
        }
        let (mut f, mut jac) = (
            vec![0.0; surface.points.len()],
            vec![0.0; surface.points.len() * n],
        );
        self.template
            .metric()
            .jacobian(&surface.points, a, &mut f, &mut jac);
        knowledge
            .open
            .iter()
            .map(|group| {
                let indices: Vec<usize> = {
                    let mut v: Vec<usize> = group
                        .iter()
                        .flat_map(|&k| self.space.column(k).iter().map(|c| c.0))
                        .collect();
                    v.sort_unstable();
                    v.dedup();
                    v
                };
                let names: Vec<String> = indices
                    .iter()
                    .map(|&i| parameters[i].name.clone())
                    .collect();
                let mut bare: Vec<&str> = Vec::new();
                for (k, s) in stats.iter().enumerate() {
                    let moved = |row: &[f64]| indices.iter().any(|&i| row[i].abs() > 1e-6);
                    let is_moved = surface_parts
                        .iter()
                        .zip(jac.chunks_exact(n))
                        .any(|(p, row)| *p as usize == k && moved(row));
                    if is_moved && (s.count < 4 || s.uncovered.is_some_and(|u| u > 0.8)) {
                        bare.push(&s.name);
                    }
                }
                let verb = if names.len() == 1 { "is" } else { "are" };
                let why = if bare.is_empty() {
                    format!(
                        "{} {verb} not determined: the points leave {} open",
                        listed(&names),
                        if names.len() == 1 {
                            "it"
                        } else {
                            "a common direction"
                        }
                    )
                } else {
                    format!(
                        "{} {verb} not determined: no points near {}",
                        listed(&names),
                        listed(&bare)
                    )
                };
                Open {
                    parameters: names,
                    why,
                }
            })
            .collect()
    }

    fn others(
        &self,
        outcome: &Outcome,
        x: &[f64],
        used: &[f64],
        outliers: &[bool],
    ) -> Vec<OtherMinimum> {
        let distance = |m: &[f64]| {
            m.iter()
                .zip(x)
                .map(|(u, v)| (u - v).abs())
                .fold(0.0, f64::max)
        };
        let chosen = outcome
            .minima
            .iter()
            .enumerate()
            .min_by(|a, b| distance(&a.1.x).total_cmp(&distance(&b.1.x)))
            .map(|m| m.0);
        let others = outcome
            .minima
            .iter()
            .enumerate()
            .filter(|(k, _)| Some(*k) != chosen)
            .take(MOST_MINIMA);
        others
            .map(|(_, m)| {
                let mut a = vec![0.0; self.template.parameters().len()];
                self.space.parameters_at(&m.x, &mut a);
                OtherMinimum {
                    sum_f2: self.algebraic_sum(used, outliers, &a),
                    parameters: a,
                    hits: m.hits,
                }
            })
            .collect()
    }

    /// Warnings, and whether the template fits at all.
    fn judge(&self, fit: &mut Fit, certain: bool) {
        let size = self.data.diagonal();
        let share = fit.n_outliers as f64 / fit.n_points.max(1) as f64;
        if self.options.method == Method::Default && !certain {
            fit.warnings.push(format!(
                "the best minimum was found by {} of {} starts only; there may be a better one",
                fit.hits, fit.starts
            ));
        }
        if !fit.complete {
            fit.warnings
                .push("stopped early: this is the best so far".to_owned());
        }
        if fit.isolated > MOST_DROPPED {
            fit.warnings.push(format!(
                "{:.0} % of the points look isolated; none was left out of the search",
                100.0 * fit.isolated
            ));
        } else if fit.isolated > HAS_OUTLIERS {
            fit.warnings.push(format!(
                "{:.1} % of the points are isolated and were left out of the search",
                100.0 * fit.isolated
            ));
        }
        if fit.n_outliers > 0 {
            fit.warnings.push(format!(
                "{} of {} points ({:.1} %) are outliers",
                fit.n_outliers,
                fit.n_points,
                100.0 * share
            ));
        }
        if fit.neighbour_correlation > CORRELATED && fit.noise > 1e-7 * size {
            fit.warnings.push(format!(
                "residuals of neighbours are alike (correlation {:.2}): the shape differs from the template, and intervals are too narrow",
                fit.neighbour_correlation
            ));
        }
        for p in fit
            .parameters
            .iter()
            .filter(|p| p.status == Status::AtBound)
        {
            fit.warnings.push(format!(
                "{} ran into a bound ({} to {})",
                p.name, p.bounds.0, p.bounds.1
            ));
        }
        if fit.model_to_data.share_outside > 0.1 {
            fit.warnings.push(format!(
                "{:.0} % of the model's surface near the data lies outside their box",
                100.0 * fit.model_to_data.share_outside
            ));
        }
        if fit.rms > BAD_RMS * size || fit.noise > BAD_RMS * size {
            fit.reasons.push(format!(
                "the points lie {:.3} off the model (rms), more than {} % of their size",
                fit.rms.max(fit.noise),
                100.0 * BAD_RMS
            ));
        }
        let free = fit
            .parameters
            .iter()
            .filter(|p| p.status != Status::Fixed)
            .count();
        let open = fit
            .parameters
            .iter()
            .filter(|p| p.status == Status::Undetermined)
            .count();
        if 2 * open > free {
            fit.reasons.push(format!(
                "{open} of {free} parameters are not determined by the points"
            ));
        }
        if fit.model_to_data.samples == 0 {
            fit.reasons
                .push("the model has no surface near the data".to_owned());
        } else if fit.model_to_data.share_uncovered > BAD_UNCOVERED
            || (fit.model_to_data.share_uncovered > DOUBTFUL.1
                && fit.rms > DOUBTFUL.0 * size
                && fit.neighbour_correlation > CORRELATED)
        {
            fit.reasons.push(format!(
                "{:.0} % of the model's surface has no data near it",
                100.0 * fit.model_to_data.share_uncovered
            ));
        }
        if share > BAD_OUTLIERS {
            fit.reasons
                .push(format!("{:.0} % of the points are outliers", 100.0 * share));
        }
        fit.acceptable = fit.reasons.is_empty();
    }
}

/// The box of the data: of all points, or of those kept where outliers would stretch it.
fn trusted_box(points: &[Point3], kept: &[Point3], isolated: f64, spacing: f64) -> Aabb {
    let (all, mut some) = (Aabb::of(points), Aabb::of(kept));
    if isolated <= HAS_OUTLIERS && all.diagonal() < 1.5 * some.diagonal() {
        return all;
    }
    for i in 0..3 {
        some.lo[i] = (some.lo[i] - spacing).max(all.lo[i]);
        some.hi[i] = (some.hi[i] + spacing).min(all.hi[i]);
    }
    some
}

/// Distinct points, counted up to `most`.
fn distinct(points: &[Point3], most: usize) -> usize {
    let mut seen: Vec<Point3> = Vec::new();
    for p in points {
        if seen.len() >= most {
            break;
        }
        if !seen.contains(p) {
            seen.push(*p);
        }
    }
    seen.len()
}

/// "a", "a and b", "a, b and c".
fn listed<S: AsRef<str>>(names: &[S]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match names.split_last() {
        Some((last, [])) => (*last).to_owned(),
        Some((last, rest)) => format!("{} and {last}", rest.join(", ")),
        None => String::new(),
    }
}
