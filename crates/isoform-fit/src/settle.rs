//! From the metric minimum to the result: the distance itself, what the points support, and the
//! bias of noise beside edges.

use crate::bias::{Bias, Biased};
use crate::correlation::Correlation;
use crate::deviation::{self, Data, Surface};
use crate::feet::KeptFeet;
use crate::fit::{Clock, EXACT, Found, OUTLIER_DEVIATIONS, Task};
use crate::identify::{At, Knowledge, product};
use crate::objective::values;
use crate::polish::{Polish, weight};
use crate::rims::rims;
use crate::{Loss, Template};
use isoform_geom::{Foot, Nearby, ParamField, Point3};

/// Points that settle the minimum and its intervals at first. More are taken where they would
/// shrink an interval (see [`GAIN`]).
const SETTLING: usize = 20_000;
/// Most points that are ever fitted: beyond, intervals of a few parts in a million are the least
/// of a scan's errors.
const MOST_FITTED: usize = 1 << 20;
/// More points are taken only where they shrink some standard deviation to less than this share.
const GAIN: f64 = 0.9;
/// Points whose sums tell whether a variable that is moved leaves the data.
const TESTED: usize = 4096;
/// A part has data of its own when it has this share of the points that its area would have
/// elsewhere. Faces that the end of a scan runs along get points of their neighbours' rims, some
/// noise × perimeter / area.
const OWN_DATA: f64 = 0.12;
/// ... or when no more than this share of its area is bare: sparse is not absent.
const BARE: f64 = 0.2;
/// Fewest samples of a part that say anything of it.
const FEWEST: usize = 6;
/// Points off edges that a part may have by accident, at most: noise of its neighbours, strays.
const ACCIDENTAL: usize = 2;
/// Least probability of so few points on a part for which chance is believed.
const CHANCE: f64 = 1e-4;
/// Deviations of the noise within which points on an edge are taken for those of either face.
const RIM: f64 = 3.0;
/// A bias above this many standard deviations is asked for again after it was taken away.
const LARGE: f64 = 0.5;
/// Share of the bias that stays in the intervals as its own uncertainty.
const UNSURE: f64 = 0.2;
/// Rounds of asking for the bias, at most.
const ROUNDS: usize = 3;
/// Feet computed at a time, to bound memory.
const BATCH: usize = 1 << 16;

/// A fit with what the data say of it.
pub(crate) struct Fitted {
    pub(crate) found: Found,
    /// Robust standard deviation of the residuals.
    pub(crate) noise: f64,
    pub(crate) measured: Measured,
    pub(crate) surface: Surface,
    /// Parts of the model that no data support.
    pub(crate) open_parts: Vec<bool>,
    pub(crate) knowledge: Knowledge,
    /// Covariance of the variables.
    pub(crate) covariance: Vec<f64>,
    /// Correlation of the residuals of neighbours that was reckoned with; 0 for none.
    pub(crate) correlation: f64,
    /// Points that were fitted.
    pub(crate) fitted: usize,
    /// What was added to the variables against the bias of noise.
    pub(crate) correction: Option<Vec<f64>>,
}

/// Every point's signed distance and part of the model.
#[derive(Default)]
pub(crate) struct Measured {
    pub(crate) residuals: Vec<f64>,
    /// Parts that meet at the nearest place of the model, the first one the part of the point.
    pub(crate) pieces: Vec<[u32; 3]>,
    /// The nearest places of the model; the points themselves where it has none. Who is whose
    /// neighbour is asked of these: noise makes points neighbours that are off alike.
    pub(crate) at: Vec<Point3>,
}

impl Measured {
    /// The part that each point is on.
    pub(crate) fn parts(&self) -> Vec<u32> {
        self.pieces.iter().map(|met| met[0]).collect()
    }

    /// Whether each point's nearest place is on one of the flagged parts, or on its rim.
    pub(crate) fn on<'a>(&'a self, flagged: &'a [bool]) -> impl Iterator<Item = bool> + 'a {
        let is_on = |part: &u32| flagged.get(*part as usize) == Some(&true);
        self.pieces.iter().map(move |met| met.iter().any(is_on))
    }

    /// 0 for points on open parts, else 1; empty where all are 1.
    fn mask(&self, open: &[bool]) -> Vec<f64> {
        if !open.contains(&true) {
            return Vec::new();
        }
        self.on(open).map(|o| f64::from(u8::from(!o))).collect()
    }
}

impl Task<'_> {
    /// The distance itself; the metric reading where the template has none.
    pub(crate) fn measure(&self) -> &dyn ParamField {
        match &self.distance {
            Some(distance) => distance,
            None => self.template.metric(),
        }
    }

    /// The points that the last stages work on.
    pub(crate) fn settling(&self) -> Vec<Point3> {
        if self.points.len() <= 2 * SETTLING {
            self.points.to_vec()
        } else {
            self.some(SETTLING)
        }
    }

    /// Minimises the distance from the metric minimum, leaves alone what no data support, and takes
    /// the bias away.
    pub(crate) fn settle(&self, mut found: Found, clock: &mut Clock) -> Fitted {
        let points = self.settling();
        let mut exact = self.polish_with(self.measure(), found.outcome.starts + 1);
        let mut normal = self.descend(&exact, &points, &[], &mut found);
        clock.lap("polish");
        self.control.report("report", 0.0);
        let mut state = self.state(&points, &found);
        if !state.mask.is_empty() {
            // Points on the rims of a part that has none of its own would hold it.
            normal = self.descend(&exact, &points, &state.mask, &mut found);
            let mask = std::mem::take(&mut state.mask);
            state = self.state(&points, &found);
            normal = normal.filter(|_| state.mask == mask);
        }
        let knowledge = self.knowledge(&points, &found, &state, normal);
        if !knowledge.directions.is_empty() {
            // Off the data first: an open face that touches noisy points of its neighbours would
            // pull at those.
            let before = found.x.clone();
            for (k, direction, sense) in &knowledge.directions {
                self.step_clear(&mut found.x, *k, direction, *sense, state.noise);
                exact.held[*k] = true;
            }
            let step: Vec<f64> = found.x.iter().zip(&before).map(|(x, b)| x - b).collect();
            self.descend(&exact, &points, &state.mask, &mut found);
            // And back: where the data end is the best that can be said of an open face.
            found.x.iter_mut().zip(&step).for_each(|(x, s)| *x -= s);
            self.space.into_interior(&mut found.x, 1e-12);
            state = self.state(&points, &found);
        }
        clock.lap("open");
        let is_unmoved = knowledge.directions.is_empty();
        let normal = is_unmoved.then_some(&knowledge.normal[..]);
        let spread = self.spread(&points, &found, &state, &exact.held, normal);
        clock.lap("spread");
        self.finish(points, found, state, knowledge, spread, &exact, clock)
    }

    /// What is known of a fit that stays where it is.
    pub(crate) fn ask(&self, found: Found) -> Fitted {
        let points = self.settling();
        let state = self.state(&points, &found);
        let knowledge = self.knowledge(&points, &found, &state, None);
        let held = vec![false; self.space.len()];
        let normal = Some(&knowledge.normal[..]);
        let spread = self.spread(&points, &found, &state, &held, normal);
        self.fitted(found, state, knowledge, spread, points.len(), None)
    }

    /// All points where they tell more than some; the correction of the bias.
    #[allow(
        clippy::too_many_arguments,
        reason = "the last step of one stage, called once"
    )]
    fn finish(
        &self,
        mut points: Vec<Point3>,
        mut found: Found,
        mut state: State,
        knowledge: Knowledge,
        mut spread: Spread,
        exact: &Polish<'_>,
        clock: &mut Clock,
    ) -> Fitted {
        let most = self.points.len().min(MOST_FITTED);
        if points.len() < most && spread.gains(points.len() as f64 / most as f64) {
            let share = points.len() as f64 / most as f64;
            points = self.some(most);
            let mask = self.measured(&points, &found.x).mask(&state.open_parts);
            self.descend(exact, &points, &mask, &mut found);
            spread.scale_independent(share);
            state.mask = mask;
        }
        clock.lap("all points");
        let correction = self.unbiased(&points, &mut found, &state, &mut spread);
        clock.lap("bias");
        self.fitted(found, state, knowledge, spread, points.len(), correction)
    }

    /// Takes the bias of noise away; what was added to the variables.
    fn unbiased(
        &self,
        points: &[Point3],
        found: &mut Found,
        state: &State,
        spread: &mut Spread,
    ) -> Option<Vec<f64>> {
        let distance = self.template.distance()?;
        let alike = spread.correlation.clamp(0.0, 1.0);
        let minimum = found.x.clone();
        let mut a = vec![0.0; self.template.parameters().len()];
        let mut last: Option<Bias> = None;
        // The bias at the minimum is not quite that at the place which is left when it is taken
        // away: where it is large it is asked for once more, there.
        let mut noise = state.noise * (1.0 - alike).sqrt();
        for _ in 0..ROUNDS {
            self.space.parameters_at(&found.x, &mut a);
            let asked = Biased {
                distance,
                space: &self.space,
                x: &found.x,
                points,
                noise,
                loss: found.loss,
                scale: state.noise,
                inverse: &spread.inverse,
                frame: self.template.frame(&a),
                seed: self.options.seed,
            };
            let Some(bias) = asked.bias() else {
                break;
            };
            found.x.clone_from(&minimum);
            let moved = found.x.iter_mut().zip(&bias.correction);
            moved.for_each(|(x, c)| *x += c);
            self.space.into_interior(&mut found.x, 1e-12);
            // Distances beside edges are smaller than the noise that made them.
            if last.is_none() {
                noise /= bias.shrunk.clamp(0.5, 1.0);
            }
            let is_small = spread.hides(&bias.correction);
            last = Some(bias);
            if is_small {
                break;
            }
        }
        let Bias {
            correction,
            covariance,
            ..
        } = last?;
        let total = spread.total.iter_mut().zip(covariance);
        total.for_each(|(s, v)| *s += v);
        // What is taken away is known to a share only: noise may not be quite isotropic.
        let m = correction.len();
        for (k, by) in correction.iter().enumerate() {
            spread.total[k * m + k] += (UNSURE * by).powi(2);
        }
        Some(correction)
    }

    fn fitted(
        &self,
        found: Found,
        state: State,
        mut knowledge: Knowledge,
        spread: Spread,
        fitted: usize,
        correction: Option<Vec<f64>>,
    ) -> Fitted {
        let measured = self.measured(self.points, &found.x);
        // A variable that no sum depends on has no variance to tell; at a bound it has none either.
        let m = self.space.len();
        let is_told = |k: usize| {
            self.space.is_at_bound(&found.x, k, 0.0)
                || knowledge.open.iter().any(|group| group.contains(&k))
        };
        let untold = (0..m).filter(|&k| spread.total[k * m + k] <= 0.0 && !is_told(k));
        let untold: Vec<Vec<usize>> = untold.map(|k| vec![k]).collect();
        knowledge.open.extend(untold);
        Fitted {
            noise: state.noise,
            measured,
            surface: state.surface,
            open_parts: state.open_parts,
            knowledge,
            covariance: spread.total,
            correlation: spread.correlation,
            fitted,
            correction,
            found,
        }
    }

    /// Minimises from where `found` is; never ends at a worse place. Gives the matrix of the normal
    /// equations where it ends, if that is known.
    fn descend(
        &self,
        exact: &Polish<'_>,
        points: &[Point3],
        mask: &[f64],
        found: &mut Found,
    ) -> Option<Vec<f64>> {
        let from = found.x.clone();
        let rounds = if found.loss.is_robust() { 8 } else { 1 };
        let mut fine = exact.fine(points, mask, from, found.loss, rounds);
        found.evaluations += fine.evaluations;
        found.history.append(&mut fine.history);
        if found.loss.is_robust() {
            // Rounds of reweighting have no sum that falls: compare by the loss at one scale.
            let before = exact.residuals(points, &found.x);
            let after = exact.residuals(points, &fine.x);
            let scale = Polish::scale(&after).max(Polish::scale(&before));
            if robust_sum(&after, mask, scale) > robust_sum(&before, mask, scale) {
                return None;
            }
        }
        found.x = fine.x;
        fine.normal
    }

    /// Noise, supported parts and the mask at a minimum.
    fn state(&self, points: &[Point3], found: &Found) -> State {
        let measured = self.measured(points, &found.x);
        let noise = if found.loss.is_robust() {
            Polish::scale(&measured.residuals)
        } else {
            let finite = measured.residuals.iter().filter(|r| r.is_finite());
            let sum: f64 = finite.map(|r| r * r).sum();
            let degrees = points.len().saturating_sub(self.space.len()).max(1);
            (sum / degrees as f64).sqrt()
        };
        let mut a = vec![0.0; self.template.parameters().len()];
        self.space.parameters_at(&found.x, &mut a);
        let data = Data {
            bounds: self.data,
            near: self.near,
            noise,
        };
        let surface =
            deviation::model_to_data(self.template, &a, &data, self.options.surface_samples);
        let open_parts = self.open_parts(&measured, &a, noise, &surface);
        let mut mask = measured.mask(&open_parts);
        if mask.is_empty() && self.template.distance().is_none() {
            // Minima and maxima see points beyond a rim from the wrong piece.
            if noise > EXACT * self.data.diagonal() {
                mask = rims(self.template, points, &a, noise);
            }
        }
        State {
            residuals: measured.residuals,
            at: measured.at,
            noise,
            surface,
            open_parts,
            mask,
        }
    }

    /// Parts without data of their own: few points on them for their area, and either much of it
    /// bare or most of the points near them off them; or no points but those of their neighbours'
    /// rims.
    fn open_parts(
        &self,
        measured: &Measured,
        a: &[f64],
        noise: f64,
        surface: &Surface,
    ) -> Vec<bool> {
        let names = self.template.part_names().len();
        let (mut samples, mut bare) = (vec![0_usize; names], vec![0_usize; names]);
        for (part, is_bare) in surface.parts.iter().zip(&surface.bare) {
            if let Some(count) = samples.get_mut(*part as usize) {
                *count += 1;
                bare[*part as usize] += usize::from(*is_bare);
            }
        }
        let limit = OUTLIER_DEVIATIONS * noise.max(EXACT * self.data.diagonal());
        let (mut on, mut off) = (vec![0_usize; names], vec![0_usize; names]);
        for (met, r) in measured.pieces.iter().zip(&measured.residuals) {
            let count = if r.abs() <= limit { &mut on } else { &mut off };
            if let Some(count) = count.get_mut(met[0] as usize) {
                *count += 1;
            }
        }
        let covered = surface.bare.iter().filter(|b| !**b).count().max(1);
        let density = measured.residuals.len() as f64 / covered as f64;
        (0..names)
            .map(|k| {
                let expected = density * samples[k] as f64;
                let is_bare = bare[k] as f64 > BARE * samples[k] as f64;
                // A part with all its points beside it is at a wrong place, not unseen.
                let near = on[k] + off[k];
                let is_shunned = off[k] > on[k] && (near as f64) < 0.5 * expected;
                let is_open = samples[k] >= FEWEST
                    && (on[k] as f64) < OWN_DATA * expected
                    && (is_bare || is_shunned);
                is_open
                    || (2.0 * (on[k] as f64) < expected
                        && self.is_empty_off_edges(k, measured, a, noise, surface, density))
            })
            .collect()
    }

    /// Whether a part has points beside its edges only, where chance does not explain that: a hole
    /// between the points of a face, which is no larger than their distances. `density` is that of
    /// points among the samples of the surface.
    fn is_empty_off_edges(
        &self,
        part: usize,
        measured: &Measured,
        a: &[f64],
        noise: f64,
        surface: &Surface,
        density: f64,
    ) -> bool {
        let Some(distance) = self.template.distance() else {
            return false;
        };
        let is_on = |parts: &[u32; 3]| parts[0] as usize == part;
        let count_off_edges = |places: &[Foot]| {
            let reach = RIM * noise;
            let around = distance.nearby(places, a, reach, reach);
            around.iter().filter(|n| **n == Nearby::Face).count()
        };
        let samples = surface
            .points
            .iter()
            .zip(&surface.inward)
            .zip(&surface.parts);
        let samples: Vec<Foot> = samples
            .filter(|(_, p)| **p as usize == part)
            .map(|((at, inward), p)| Foot::on_face(*at, *inward, *p))
            .collect();
        let least = |count: usize| density * (count as f64 - (count as f64).sqrt());
        if chance_of_few(0, least(samples.len())) > CHANCE {
            return false;
        }
        let limit = OUTLIER_DEVIATIONS * noise.max(EXACT * self.data.diagonal());
        let near = measured
            .pieces
            .iter()
            .zip(&measured.residuals)
            .zip(&measured.at);
        let near: Vec<Point3> = near
            .filter(|((met, r), _)| is_on(met) && r.abs() <= limit)
            .map(|(_, at)| *at)
            .collect();
        let mut feet = vec![Foot::NONE; near.len()];
        distance.feet(&near, a, &mut feet);
        feet.retain(|foot| foot.order == 1 && is_on(&foot.pieces));
        let count = count_off_edges(&feet);
        count <= ACCIDENTAL && chance_of_few(count, least(count_off_edges(&samples))) <= CHANCE
    }

    /// Distances and parts of points.
    pub(crate) fn measured(&self, points: &[Point3], x: &[f64]) -> Measured {
        let mut a = vec![0.0; self.template.parameters().len()];
        self.space.parameters_at(x, &mut a);
        measured(self.template, self.distance.as_ref(), points, &a)
    }

    /// `normal` is the matrix of the normal equations, if it is known.
    fn knowledge(
        &self,
        points: &[Point3],
        found: &Found,
        state: &State,
        normal: Option<Vec<f64>>,
    ) -> Knowledge {
        // Variables that move parts with bare surface are asked whether anything holds them.
        let mut bare = vec![false; self.template.part_names().len()];
        for (part, is_bare) in state.surface.parts.iter().zip(&state.surface.bare) {
            if let Some(b) = bare.get_mut(*part as usize) {
                *b |= is_bare;
            }
        }
        let moved = self.moves(found, &state.surface, &bare);
        self.at(points, found, state)
            .knowledge(&|k| moved[k], normal)
    }

    /// Whether each variable moves a place of the surface on one of the flagged parts.
    fn moves(&self, found: &Found, surface: &Surface, flagged: &[bool]) -> Vec<bool> {
        let (n, m) = (self.template.parameters().len(), self.space.len());
        let mut a = vec![0.0; n];
        self.space.parameters_at(&found.x, &mut a);
        let at: Vec<Point3> = surface
            .points
            .iter()
            .zip(&surface.parts)
            .filter(|(_, part)| flagged.get(**part as usize) == Some(&true))
            .map(|(p, _)| *p)
            .collect();
        let (mut f, mut jac) = (vec![0.0; at.len()], vec![0.0; at.len() * n]);
        self.template.metric().jacobian(&at, &a, &mut f, &mut jac);
        (0..m)
            .map(|k| {
                jac.chunks_exact(n.max(1)).any(|row| {
                    let by: f64 = self.space.column(k).iter().map(|&(i, c)| c * row[i]).sum();
                    by.abs() > 1e-6
                })
            })
            .collect()
    }

    fn at<'b>(&'b self, points: &'b [Point3], found: &'b Found, state: &'b State) -> At<'b> {
        At {
            field: self.measure(),
            points,
            space: &self.space,
            x: &found.x,
            residuals: &state.residuals,
            mask: &state.mask,
            loss: found.loss,
            scale: state.noise,
            least_scale: EXACT * self.data.diagonal(),
            tested: TESTED,
        }
    }

    /// The covariance of the variables, with what neighbours share.
    fn spread(
        &self,
        points: &[Point3],
        found: &Found,
        state: &State,
        held: &[bool],
        normal: Option<&[f64]>,
    ) -> Spread {
        let m = self.space.len();
        let (independent, inverse) = self
            .at(points, found, state)
            .covariance_without(held, normal);
        let scale = state.noise.max(EXACT * self.data.diagonal());
        let weighted: Vec<f64> = state
            .residuals
            .iter()
            .enumerate()
            .map(|(i, r)| {
                let mask = state.mask.get(i).copied().unwrap_or(1.0);
                if r.is_finite() {
                    mask * weight(found.loss, r / scale) * r
                } else {
                    0.0
                }
            })
            .collect();
        let order: Vec<u32> = if points.len() == self.points.len() {
            self.order.to_vec()
        } else {
            (0..points.len() as u32).collect()
        };
        let correlation = if state.noise > EXACT * self.data.diagonal() {
            Correlation::of(&state.at, &weighted, &order, self.data.diagonal())
        } else {
            None
        };
        let mut spread = Spread {
            total: independent.clone(),
            inverse: inverse.clone(),
            independent,
            shared: vec![0.0; m * m],
            correlation: 0.0,
        };
        if let Some(c) = correlation {
            spread.correlation = c.nearest;
            let cross = c.cross(self.measure(), &self.space, &found.x);
            let half = product(&inverse, &cross, m);
            spread.shared = product(&half, &inverse, m);
            spread.join();
        }
        spread
    }

    /// Moves along an open direction by a few noise deviations, within bounds.
    fn step_clear(&self, x: &mut [f64], k: usize, direction: &[f64], sense: f64, noise: f64) {
        let mut t = (6.0 * noise).max(0.25 * self.near.spacing) / self.space.unit(k);
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
}

/// The probability of no more than some points where another number is expected (Poisson).
fn chance_of_few(points: usize, expected: f64) -> f64 {
    let mut term = (-expected.max(0.0)).exp();
    let mut sum = term;
    for k in 1..=points {
        term *= expected / k as f64;
        sum += term;
    }
    sum
}

/// Distances and parts of points, by the template's own distance if it has one.
pub(crate) fn measured(
    template: &dyn Template,
    distance: Option<&KeptFeet<'_>>,
    points: &[Point3],
    a: &[f64],
) -> Measured {
    let Some(distance) = distance else {
        return by_metric(template, points, a);
    };
    let mut out = Measured {
        residuals: Vec::with_capacity(points.len()),
        pieces: Vec::with_capacity(points.len()),
        at: Vec::with_capacity(points.len()),
    };
    for batch in points.chunks(BATCH) {
        for foot in &distance.at(batch, a).feet {
            out.residuals.push(foot.distance);
            out.pieces.push(foot.pieces);
            out.at.push(foot.at);
        }
    }
    out
}

/// Metric residuals and parts of points, which stand for their nearest places.
fn by_metric(template: &dyn Template, points: &[Point3], a: &[f64]) -> Measured {
    let mut residuals = vec![0.0; points.len()];
    values(template.metric(), points, a, &mut residuals);
    let mut parts = vec![0; points.len()];
    template.parts(points, a, &mut parts);
    Measured {
        residuals,
        pieces: parts.into_iter().map(|part| [part; 3]).collect(),
        at: points.to_vec(),
    }
}

/// What is known at a minimum.
struct State {
    residuals: Vec<f64>,
    /// Nearest places of the model, by point.
    at: Vec<Point3>,
    noise: f64,
    surface: Surface,
    open_parts: Vec<bool>,
    /// 0 for points on open parts; empty for none.
    mask: Vec<f64>,
}

/// Covariance of the variables in two shares: of noise that points have for themselves, which
/// falls with their number, and of misfit that neighbours share, which does not.
struct Spread {
    /// Inverse of the Hessian.
    inverse: Vec<f64>,
    independent: Vec<f64>,
    shared: Vec<f64>,
    total: Vec<f64>,
    correlation: f64,
}

impl Spread {
    /// The total: never less than for independent points.
    fn join(&mut self) {
        let m = (self.independent.len() as f64).sqrt().round() as usize;
        let factor: Vec<f64> = (0..m)
            .map(|i| {
                let own = self.independent[i * m + i];
                if own > 0.0 {
                    (1.0 + self.shared[i * m + i].max(0.0) / own).sqrt()
                } else {
                    1.0
                }
            })
            .collect();
        self.total = (0..m * m)
            .map(|at| factor[at / m] * factor[at % m] * self.independent[at])
            .collect();
    }

    /// Whether some deviation would shrink noticeably if the points' number grew by 1 / `share`.
    fn gains(&self, share: f64) -> bool {
        let m = (self.independent.len() as f64).sqrt().round() as usize;
        (0..m).any(|i| {
            let (own, shared) = (self.independent[i * m + i], self.shared[i * m + i].max(0.0));
            own * share + shared < GAIN * GAIN * (own + shared)
        })
    }

    /// Whether all numbers of a correction are small beside their deviations.
    fn hides(&self, correction: &[f64]) -> bool {
        let m = correction.len();
        (0..m).all(|k| correction[k].powi(2) < LARGE * LARGE * self.total[k * m + k])
    }

    /// After the points' number grew by 1 / `share`.
    fn scale_independent(&mut self, share: f64) {
        let all = self.independent.iter_mut().chain(&mut self.inverse);
        all.for_each(|v| *v *= share);
        self.join();
    }
}

/// Σ ρ(r / s) with the loss of Tukey, whose terms are at most 1.
fn robust_sum(r: &[f64], mask: &[f64], scale: f64) -> f64 {
    r.iter()
        .enumerate()
        .map(|(i, r)| {
            let z = r / scale.max(f64::MIN_POSITIVE);
            let w = weight(Loss::Tukey, z);
            // 1 − (1 − (z/c)²)³ by the weight (1 − (z/c)²)².
            mask.get(i).copied().unwrap_or(1.0) * (1.0 - w * w.sqrt())
        })
        .sum()
}
