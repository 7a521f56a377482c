//! Patch growing (Wurm, Jüttler and Kim 2003, section 3.2): from a small patch on the tangent
//! plane, Newton steps and extrapolations in turn, until the bound on S is reached.
//!
//! Departures from the paper, which leaves these things open:
//! - Corners are put back along the normal of the patch, not along ∇F: at a self-intersection ∇F
//!   turns and leads to the wrong branch.
//! - The bound is approached from what S was at the sizes before: S is nearly a power of the size,
//!   so that few extrapolations fail.
//! - Where a direction is shortened more by Newton steps, the next extrapolation leaves it so:
//!   patches take the proportions that suit them.
//! - After an extrapolation that proves too large the patch is shortened, which counts as an
//!   extrapolation and is seen in the trace.

mod edges;

pub(crate) use edges::Side;

use crate::distance::{Effort, proof, sampled, sampled_on};
use crate::fold;
use crate::objective::{CORNERS, Evaluated, Method, Objective, Targets, Terms, Weights};
use crate::options::{Error, Options};
use crate::solver::{Stop, first_damping, minimise};
use crate::surface::{Seed, contains, project, project_along};
use crate::whole::{NearSingular, On};
use edges::OVERLAP;
use isoform_geom::{Aabb, Field, Point3, RationalPatch, dot, norm};
use std::time::Instant;

/// Edge of the start patch, in edges of the region.
const START_SIZE: f64 = 0.1;
/// The start patch is halved until its planar self has at most so many times the allowed S.
const START_EXCESS: f64 = 10.0;
/// A side no longer grows when a place of it is farther beyond the region than this share of that.
const SPILL: f64 = 0.2;
/// Halvings of the start patch: 2⁻³⁰ of the region is beyond any use.
const HALVINGS: usize = 30;
/// The largest extrapolation at one side, in edges of the patch.
pub(crate) const MOST_GROWTH: f64 = 0.16;
/// S after an extrapolation, before Newton steps, may be this many times its bound.
const MOST_EXCESS: f64 = 30.0;
/// The load of a patch that is folded over.
const FOLDED: f64 = 1e6;
/// A patch that is longer by this factor has come near a pole. On a plane its distance would not
/// show it.
const MOST_LONGER: f64 = 2.5;
/// Secant steps towards the size that an extrapolation aims at.
const SECANTS: usize = 4;
/// Bisections of an extrapolation until it is a start for Newton's method.
const BISECTIONS: usize = 6;
/// The share of the bound on S that the last extrapolations aim at.
const AIM: f64 = 0.997;
/// A patch with S above this share of the bound is as large as it gets.
const FULL: f64 = 0.985;
/// Shortenings in a row before the last good patch is taken.
const SHORTENINGS: usize = 4;
/// Patches in a row that keep the bound and are no larger than another one before them. Twice as
/// many take a quarter more steps for patches of the same area.
const STALE: usize = 3;
/// With a tolerance, a root mean square distance below this share of it is no reason to let go of
/// the patch's shape.
const LITTLE: f64 = 0.05;
/// Before a side stops for a fold, L and R get more weight so often,
const EVENINGS: usize = 3;
/// each time by this factor: a fold takes away what they cost.
const MORE_EVEN: f64 = 30.0;
/// Times that J gets more weight after an extrapolation, for control weights,
const RAISES: usize = 8;
/// unless the patch exceeds what is allowed by this factor anyway.
const MOST_RAISED: f64 = 1.5;
/// The sampled distance may be this share of the tolerance: what the proof adds must fit, too.
const WITHIN: f64 = 0.93;
/// Of a part: at its edges what the proof adds may be as much as that.
const WITHIN_PART: f64 = 0.6;
/// Samples of the distance in each direction while a patch grows.
const GROWING_SAMPLES: usize = 17;
/// The least control weight of a patch: CAD systems drop faces with negative ones without a word,
/// and quotients of small ones are large.
pub(crate) const LEAST_WEIGHT: f64 = 0.02;
/// Times that a patch is made shorter for the proof of its tolerance.
const SHORTER: usize = 12;
/// The same of a surface with parts: there more is in vain.
const SHORTER_AT_EDGES: usize = 3;
/// Cells of that proof: ten times what patches on smooth surfaces take. Across self-intersections
/// there may be more; then the patch ends before them.
const PROOF_CELLS: usize = 60_000;
/// The same, and how often a patch is made shorter, where it is soon given up if it may be near
/// singular points: twice what patches on smooth surfaces take.
const TRIAL_CELLS: usize = 15_000;
const TRIALS: usize = 3;
/// The same of a surface with parts.
const PROOF_CELLS_AT_EDGES: usize = 8000;
/// Before it is proved, the distance is sampled in a finer grid; near edges proofs need some room.
const PROVED_SAMPLES: usize = 33;
const HOPELESS: f64 = 0.7;
/// By how much at each side.
const SHARE_SHORTER: f64 = 0.01;
const SHARE_SHORTER_AT_EDGES: f64 = 0.06;
/// Quadrature that is off by more than this share gets more nodes.
const UNRESOLVED: f64 = 0.02;
/// From this share of the bound on.
const RESOLVE: f64 = 0.05;
/// With so many nodes in each direction it gets no more.
const ENOUGH_NODES: usize = 20;
/// What is near the bound.
const NEAR: f64 = 0.3;

/// What a row of the trace is written after.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// A Newton step.
    Newton,
    /// An extrapolation, before the first step that follows it.
    Grow,
}

/// A row of the trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// What has happened.
    pub phase: Phase,
    /// S.
    pub sum: f64,
    /// Its terms.
    pub terms: Terms,
    /// l₁ and l₂.
    pub lengths: (f64, f64),
    /// The factors ω.
    pub weights: Weights,
}

/// A patch as large as the bound admits, with the way to it.
#[derive(Clone, Debug)]
pub struct Grown {
    /// The patch.
    pub patch: RationalPatch,
    /// The point of the surface it was started at.
    pub seed_point: Point3,
    /// The terms of S at the patch.
    pub terms: Terms,
    /// The last l₁, l₂ and corners.
    pub targets: Targets,
    /// The last factors ω.
    pub weights: Weights,
    /// All steps.
    pub trace: Vec<Row>,
}

impl Grown {
    /// S.
    pub fn sum(&self) -> f64 {
        self.terms.sum(&self.weights)
    }
    /// The area of its part in a region, to some per cent.
    pub fn area(&self, region: &Aabb) -> f64 {
        area(&self.patch, &|p| contains(region, p))
    }
    /// How many rows of the trace belong to a phase.
    pub fn count(&self, phase: Phase) -> usize {
        self.trace.iter().filter(|r| r.phase == phase).count()
    }
}

/// How fast a patch grows, and what Newton steps make of it in between.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    /// Newton steps after an extrapolation, far from the bound and near it.
    steps: (Stop, Stop),
    /// The most that a patch grows by in each direction, and at one side, in half edges and in
    /// edges of it: where only one side moves, it moves by what two would.
    most_growth: (f64, f64),
    /// With a tolerance distances count more towards the border, by (4u(1 − u)) to this power,
    /// negative, in each direction.
    border: f64,
}

impl Pace {
    /// For a bound on S.
    pub(crate) const QUICK: Self = Self {
        steps: (
            Stop {
                steps: 3,
                decrease: 0.2,
            },
            Stop {
                steps: 12,
                decrease: 4e-3,
            },
        ),
        most_growth: (MOST_GROWTH, MOST_GROWTH),
        border: 0.0,
    };
    /// For a tolerance: distances are small against the patch and rise faster with its size, and
    /// the shape terms are so small that steps have far to go along the valleys that
    /// parameterizations make.
    pub(crate) const STEADY: Self = Self {
        steps: (
            Self::QUICK.steps.0,
            Stop {
                steps: 80,
                decrease: 3e-3,
            },
        ),
        most_growth: (0.5 * MOST_GROWTH, MOST_GROWTH),
        border: 0.0,
    };
    /// The same with weights for which least squares come near the least maximum, as Chebyshev's
    /// do.
    pub(crate) const EVEN: Self = Self {
        border: 0.5,
        ..Self::STEADY
    };

    /// The best one for most patches.
    pub(crate) fn of(options: &Options) -> Self {
        if options.tolerance.is_some() {
            Self::EVEN
        } else {
            Self::QUICK
        }
    }
}

/// A growing patch.
pub(crate) struct Growth<'f> {
    pub(crate) objective: Objective<'f>,
    pub(crate) patch: RationalPatch,
    pub(crate) at: Evaluated,
    pub(crate) trace: Vec<Row>,
    /// Whether the time was over before the patch was as large as it gets.
    pub(crate) is_late: bool,
    /// How often it was made shorter for the proof of its tolerance.
    pub(crate) shortenings: usize,
    /// The last patch that kept the bound.
    good: Option<State<'f>>,
    pub(crate) options: Options,
    pace: Pace,
    damping: f64,
    seed: Seed,
    /// Edge of the region: the unit of length in which bounds hold.
    pub(crate) unit: f64,
    /// The part that the patch grows on.
    on: On<'f>,
    /// What the sides u = 0, u = 1, v = 0, v = 1 do.
    sides: [Side<'f>; 4],
}

/// A patch with the targets and factors it was found with.
#[derive(Clone)]
pub(crate) struct State<'f> {
    patch: RationalPatch,
    at: Evaluated,
    targets: Targets,
    weights: Weights,
    sides: [Side<'f>; 4],
}

impl<'f> Growth<'f> {
    /// The start patch about a seed; with `edge`, the seed lies on an edge where that vanishes, and
    /// the patch to the left of it.
    pub(crate) fn start(
        objective: Objective<'f>,
        on: On<'f>,
        seed: Seed,
        edge: Option<&'f dyn Field>,
        (options, pace): (&Options, Pace),
    ) -> Result<Self, Error> {
        let unit = options.region.size().into_iter().fold(0.0, f64::max);
        let mut growth = Self {
            patch: RationalPatch::planar(
                options.degree,
                seed.point,
                seed.tangents[0],
                seed.tangents[1],
            ),
            at: Evaluated::default(),
            objective,
            trace: Vec::new(),
            is_late: false,
            shortenings: 0,
            good: None,
            options: *options,
            pace,
            damping: first_damping(),
            seed,
            unit,
            on,
            sides: [Side::Free; 4],
        };
        growth.objective.weights = options.start;
        if let Some(tolerance) = options.tolerance {
            growth.objective.little = (LITTLE * tolerance).powi(2);
            growth.objective.keep_shape_loosely();
            growth.objective.bends = true;
            growth.objective.weigh_border(pace.border);
        }
        let mut size = START_SIZE * unit;
        for _ in 0..HALVINGS {
            let [a, b] = seed.tangents.map(|t| t.map(|v| v * size));
            let below = if edge.is_some() { 0.0 } else { 0.5 };
            let origin = std::array::from_fn(|k| seed.point[k] - (0.5 * a[k] + below * b[k]));
            let patch = RationalPatch::planar(options.degree, origin, a, b);
            if let Some((targets, at)) = growth.retargeted(&patch)
                && growth.is_start(&at)
                && !on
                    .near_singular
                    .avoided()
                    .is_some_and(|a| a.is_near(&patch))
                && (on.whole.is_single()
                    || Self::starts_within(on, &patch, growth.overlap(), edge.is_some()))
            {
                let mut sides = growth.sides;
                if let Some(edge) = edge {
                    sides[2] = Side::At(edge);
                }
                growth.set_sides(sides);
                let Some(at) = growth.objective.evaluate_with(&patch, &targets) else {
                    break;
                };
                (growth.patch, growth.at, growth.objective.targets) = (patch, at, targets);
                return Ok(growth);
            }
            size *= 0.5;
        }
        Err(Error::NoPatch { at: seed.point })
    }

    /// The part that the patch grows on.
    pub(crate) fn on(&self) -> On<'f> {
        self.on
    }
    /// The point it was started at.
    pub(crate) fn seed_point(&self) -> Point3 {
        self.seed.point
    }
    /// The area of its part in a region, to some per cent.
    pub(crate) fn area(&self, region: &Aabb) -> f64 {
        area(&self.patch, &|p| contains(region, p))
    }

    /// The bound on S.
    pub(crate) fn limit(&self) -> f64 {
        self.options.limit * self.unit * self.unit
    }

    /// Whether S keeps its bound.
    pub(crate) fn is_within_limit(&self) -> bool {
        self.sum() <= self.limit()
    }

    /// How much of what is allowed the patch makes use of: of S, or of the distance from the
    /// surface.
    fn load(&self) -> f64 {
        if fold::seen(&self.patch).is_some() {
            return FOLDED;
        }
        match self.options.tolerance {
            Some(t) if self.on.whole.is_single() => {
                sampled(self.objective.field(), &self.patch, GROWING_SAMPLES).0 / (WITHIN * t)
            }
            Some(t) => {
                let distance = sampled(self.objective.field(), &self.patch, GROWING_SAMPLES).0;
                let whole = sampled_on(self.on.whole, &self.patch, GROWING_SAMPLES).0;
                (distance.max(whole) / (WITHIN_PART * t))
                    .max(self.off_edges(self.on) / self.overlap())
            }
            None => self.sum() / self.limit(),
        }
    }

    /// How far the patch may reach beyond edges.
    fn overlap(&self) -> f64 {
        OVERLAP * self.options.tolerance.unwrap_or(self.limit().sqrt())
    }

    fn set_sides(&mut self, sides: [Side<'f>; 4]) {
        self.sides = sides;
        self.objective.sides = sides.map(|s| {
            if let Side::At(edge) = s {
                Some(edge)
            } else {
                None
            }
        });
    }

    /// Whether a planar patch is small enough to start with.
    fn is_start(&self, at: &Evaluated) -> bool {
        match self.options.tolerance {
            Some(t) => at.terms.i.sqrt() <= START_EXCESS * t,
            None => at.terms.i <= START_EXCESS * self.limit(),
        }
    }

    pub(crate) fn sum(&self) -> f64 {
        self.objective.sum(&self.at.terms)
    }

    fn row(objective: &Objective<'_>, phase: Phase, terms: &Terms) -> Row {
        let t = &objective.targets;
        Row {
            phase,
            sum: objective.sum(terms),
            terms: *terms,
            lengths: (t.l1, t.l2),
            weights: objective.weights,
        }
    }

    /// Lengths and corners for a patch (section 3.3), and its value with them; none where a corner
    /// has no foot nearby.
    pub(crate) fn retargeted(&self, patch: &RationalPatch) -> Option<(Targets, Evaluated)> {
        let at = self.objective.evaluate(patch)?;
        let (l1, l2) = self.objective.mean_lengths(&at);
        let (field, edge) = (self.objective.field(), l1.max(l2).sqrt());
        let mut corners = [[0.0; 3]; 4];
        for (corner, &(u, v)) in corners.iter_mut().zip(&CORNERS) {
            let t = patch.tangents(u, v);
            let n = t.normal();
            let length = norm(n);
            let along = (length > 0.0)
                .then(|| project_along(field, t.point, n.map(|x| x / length), 0.25 * edge))
                .flatten();
            let near =
                |q: &Point3| isoform_geom::distance_squared(*q, t.point) <= (0.25 * edge).powi(2);
            // Without a foot nearby the patch has left the surface.
            *corner = along.or_else(|| project(field, t.point, edge).filter(near))?;
        }
        let targets = Targets { l1, l2, corners };
        let at = self.objective.with_targets(patch, at, &targets)?;
        Some((targets, at))
    }

    /// Newton steps until `stop`.
    fn descend(&mut self, stop: Stop) {
        let at = std::mem::take(&mut self.at);
        let trace = &mut self.trace;
        let left = self
            .options
            .most_steps
            .saturating_sub(trace.iter().filter(|r| r.phase == Phase::Newton).count());
        let stop = Stop {
            steps: stop.steps.min(left),
            ..stop
        };
        let mut each = |o: &Objective<'_>, t: &Terms| trace.push(Self::row(o, Phase::Newton, t));
        (self.at, _) = minimise(
            &mut self.objective,
            &mut self.patch,
            at,
            &self.options.floor,
            stop,
            &mut self.damping,
            &mut each,
        );
    }

    /// Hands a patch to Newton's method.
    pub(crate) fn take(&mut self, patch: RationalPatch, targets: Targets, at: Evaluated) {
        (self.patch, self.at, self.objective.targets) = (patch, at, targets);
        self.trace
            .push(Self::row(&self.objective, Phase::Grow, &self.at.terms));
    }

    pub(crate) fn state(&self) -> State<'f> {
        State {
            patch: self.patch.clone(),
            at: self.at.clone(),
            targets: self.objective.targets,
            weights: self.objective.weights,
            sides: self.sides,
        }
    }

    /// The region with a share of it more at each side.
    pub(crate) fn wider(&self, share: f64) -> Aabb {
        let (region, far) = (
            self.options.region,
            self.options.region.size().map(|s| share * s),
        );
        Aabb {
            lo: std::array::from_fn(|k| region.lo[k] - far[k]),
            hi: std::array::from_fn(|k| region.hi[k] + far[k]),
        }
    }

    /// Which sides (u = 0, u = 1, v = 0, v = 1) of a patch still lie in the region for the most
    /// part, and nowhere far from it.
    pub(crate) fn sides_inside(&self, patch: &RationalPatch) -> [bool; 4] {
        const SAMPLES: usize = 9;
        let (region, wider) = (self.options.region, self.wider(SPILL));
        std::array::from_fn(|side| {
            let at = |i: usize| {
                let t = i as f64 / (SAMPLES - 1) as f64;
                let (u, v) = [(0.0, t), (1.0, t), (t, 0.0), (t, 1.0)][side];
                patch.point(u, v)
            };
            let inside = (0..SAMPLES).filter(|&i| contains(&region, at(i)));
            2 * inside.count() > SAMPLES && (0..SAMPLES).all(|i| contains(&wider, at(i)))
        })
    }

    /// The patch longer by shares of its edges at its four sides.
    pub(crate) fn longer(&self, by: [f64; 4]) -> RationalPatch {
        longer(&self.patch, by)
    }

    /// Whether an extrapolated patch is a start for Newton's method.
    fn is_fair(&self, at: &Evaluated) -> bool {
        match self.options.tolerance {
            Some(t) => at.terms.i.sqrt() <= MOST_EXCESS * t,
            None => self.objective.sum(&at.terms) <= MOST_EXCESS * self.limit(),
        }
    }

    /// Grows until the bound on S, or on the distance, is reached.
    pub(crate) fn grow_to_limit(&mut self) {
        self.descend(self.pace.steps.0);
        let mut history: Vec<(f64, f64)> = Vec::new();
        let (mut shortened, mut evened, mut stale, mut caution) = (0, 0, 0, 1.0);
        for _ in 0..self.options.most_extrapolations {
            if self.late() {
                break;
            }
            self.trim();
            let mut load = self.load();
            if load > NEAR {
                self.descend(self.pace.steps.1);
                self.trim();
                load = self.load();
            }
            if load > RESOLVE && self.refine() {
                self.descend(self.pace.steps.1);
                load = self.load();
            }
            for _ in 0..RAISES {
                if load > MOST_RAISED || !self.raise() {
                    break;
                }
                load = self.load();
            }
            let aims = [self.objective.targets.l1, self.objective.targets.l2]
                .map(|l| l.max(f64::MIN_POSITIVE).sqrt());
            history.push((
                0.5 * (aims[0] * aims[1]).ln(),
                load.max(f64::MIN_POSITIVE).ln(),
            ));
            let is_near = self.options.tolerance.is_none() || self.is_near_region();
            if load <= 1.0 && self.patch.control_weights().0 > LEAST_WEIGHT && is_near {
                if self
                    .good
                    .as_ref()
                    .is_none_or(|g| self.objective.area(&self.at) > self.objective.area(&g.at))
                {
                    self.good = Some(self.state());
                    stale = 0;
                } else {
                    stale += 1;
                    if stale > STALE {
                        break;
                    }
                }
                shortened = 0;
                // With a tolerance the proportions may still change, and with them the area.
                if load >= FULL && (self.options.tolerance.is_none() || stale > 0) {
                    break;
                }
            } else {
                shortened += 1;
                if shortened > SHORTENINGS {
                    break;
                }
                // Shortenings would not mend what has gone that wrong.
                if load > MOST_EXCESS
                    && let Some(good) = self.good.clone()
                {
                    let fold = fold::seen(&self.patch);
                    self.settle(good);
                    load = self.load();
                    match fold {
                        Some(_) if self.options.tolerance.is_some() && evened < EVENINGS => {
                            evened += 1;
                            self.even();
                            load = self.load();
                        }
                        Some(side) => self.stop(side),
                        None => caution *= 0.5,
                    }
                    history.clear();
                }
            }
            // The load as a power of the size, by the last two patches.
            let power = match history.as_slice() {
                [.., (x0, y0), (x1, y1)] if (x1 - x0).abs() > 1e-4 => {
                    ((y1 - y0) / (x1 - x0)).clamp(3.0, 12.0)
                }
                _ => 6.0,
            };
            let factor = (AIM / load)
                .powf(1.0 / power)
                .clamp(0.8, 1.0 + 2.0 * self.pace.most_growth.0 * caution);
            // Newton steps shorten what was extrapolated, so the aim is a size, not a share of the
            // present patch; but its proportions are those of the present one, as the steps shorten
            // that direction more in which length costs more.
            let reached = self.edges();
            let shift = ((reached[1] * aims[0]) / (reached[0] * aims[1])).sqrt();
            if !self.extrapolate([aims[0] * factor / shift, aims[1] * factor * shift]) {
                break;
            }
            self.descend(self.pace.steps.0);
        }
        if let Some(best) = self.good.take() {
            self.settle(best);
        }
    }

    /// Gives the terms of shape more weight, so that parameter lines do not crowd before a patch
    /// folds over.
    fn even(&mut self) {
        let (floor, weights) = (&mut self.options.floor, &mut self.objective.weights);
        let raised = |w: f64| (MORE_EVEN * w).min(1.0);
        (floor.l, floor.r) = (raised(weights.l), raised(weights.r));
        (weights.l, weights.r) = (floor.l, floor.r);
        let Some((targets, at)) = self.retargeted(&self.patch) else {
            return;
        };
        self.take(self.patch.clone(), targets, at);
        self.descend(self.pace.steps.1);
        self.trim();
    }

    /// Stops a side, that of the last good patch, too.
    fn stop(&mut self, side: usize) {
        self.sides[side] = Side::Stopped;
        if let Some(good) = &mut self.good {
            good.sides[side] = Side::Stopped;
        }
    }

    /// Whether the time is over, which is kept in mind.
    pub(crate) fn late(&mut self) -> bool {
        self.is_late |= self.is_over();
        self.is_late
    }

    /// Whether the time is over.
    pub(crate) fn is_over(&self) -> bool {
        self.options.deadline.is_some_and(|d| Instant::now() >= d)
    }

    /// Where a control weight is too small, gives J more weight; whether it did.
    fn raise(&mut self) -> bool {
        if !self.objective.is_by_control() || self.patch.control_weights().0 > LEAST_WEIGHT {
            return false;
        }
        let Some((targets, at)) = self.retargeted(&self.patch) else {
            return false;
        };
        self.options.floor.j *= 10.0;
        self.objective.weights.j = self.objective.weights.j.max(self.options.floor.j);
        self.take(self.patch.clone(), targets, at);
        self.descend(self.pace.steps.1);
        self.trim();
        true
    }

    /// Chooses more quadrature nodes where integrals are off by too much, as they are where
    /// integrands have kinks: across self-intersections and at tight blends. Whether it did.
    fn refine(&mut self) -> bool {
        let nodes = self.objective.nodes_per_direction();
        if self.options.nodes.is_some() || self.options.tolerance.is_some() || nodes >= ENOUGH_NODES
        {
            return false;
        }
        let mut finer = Objective::new(
            self.objective.field(),
            self.patch.degree(),
            Method::Frozen,
            Some(nodes * 9 / 5),
        );
        (finer.inner, finer.weights, finer.targets) = (
            self.objective.inner,
            self.objective.weights,
            self.objective.targets,
        );
        let (a, w, sum) = (self.at.terms, self.objective.weights, self.sum());
        let near = |a: f64, b: f64, factor: f64| {
            (a - b).abs() <= UNRESOLVED * a.max(b)
                || factor * (a - b).abs() <= 1e-3 * UNRESOLVED * sum
        };
        let resolved = finer.evaluate(&self.patch).is_some_and(|at| {
            let b = at.terms;
            let all = near(a.i, b.i, 1.0)
                && near(a.j, b.j, w.j)
                && near(a.l, b.l, w.l)
                && near(a.r, b.r, w.r);
            all && (b.sum(&w) - sum).abs() <= 0.5 * UNRESOLVED * sum
        });
        if resolved {
            return false;
        }
        self.objective.set_nodes(nodes * 8 / 5);
        match self.retargeted(&self.patch) {
            Some((targets, at)) => self.take(self.patch.clone(), targets, at),
            None => {
                self.objective.set_nodes(nodes);
                return false;
            }
        }
        true
    }

    /// Proves that the patch does not fold over; if that fails, a place where it may.
    pub(crate) fn prove_unfolded(&self) -> Result<(), (f64, f64)> {
        fold::prove_none(self.on.field(), &self.patch, self.options.deadline)
    }

    /// Shortens the patch until it is proved not to fold over, and its distance from the surface to
    /// keep the tolerance; the bound, none where that fails.
    pub(crate) fn keep_tolerance(&mut self) -> Option<f64> {
        let tolerance = self.options.tolerance?;
        let is_single = self.on.whole.is_single();
        let mut effort = Effort {
            cells: if is_single {
                PROOF_CELLS
            } else {
                PROOF_CELLS_AT_EDGES
            },
            deadline: self.options.deadline,
        };
        let (most, share) = if is_single {
            (SHORTER, SHARE_SHORTER)
        } else {
            (SHORTER_AT_EDGES, SHARE_SHORTER_AT_EDGES)
        };
        let most = if matches!(self.on.near_singular, NearSingular::Try) {
            effort.cells = effort.cells.min(TRIAL_CELLS);
            TRIALS
        } else {
            most
        };
        for _ in 0..most {
            if self.is_over() {
                return None;
            }
            let is_hopeless = !is_single
                && sampled_on(self.on.whole, &self.patch, PROVED_SAMPLES).0 > HOPELESS * tolerance;
            let proved = if is_hopeless {
                Err(None)
            } else {
                proof(self.on.whole, &self.patch, tolerance, effort)
                    .and_then(|bound| self.prove_unfolded().map(|()| bound))
                    .map_err(Some)
            };
            let left = match proved {
                Ok(bound) => return Some(bound),
                Err(Some(place)) if is_single => self.leave(place, share),
                Err(_) => self.retreat(share),
            };
            if !left {
                return None;
            }
            self.shortenings += 1;
            effort.cells = effort.cells.min(PROOF_CELLS / 3);
        }
        None
    }

    /// Whether the patch is that of a state.
    pub(crate) fn is_as(&self, state: &State<'f>) -> bool {
        state.patch == self.patch
    }

    /// Goes back to a patch, unless it is the present one.
    pub(crate) fn settle(&mut self, to: State<'f>) {
        if !self.is_as(&to) {
            self.set_sides(to.sides);
            self.objective.weights = to.weights;
            self.take(to.patch, to.targets, to.at);
        }
    }

    /// Shortens the patch by a share at each side, without Newton steps; false where that is no
    /// patch.
    pub(crate) fn retreat(&mut self, share: f64) -> bool {
        // What lies on an edge is to stay near it.
        let little = 0.5 * self.overlap();
        let edges = self.edges();
        let shorter = self.longer(std::array::from_fn(|side| {
            if self.sides[side].is_at_edge() {
                -little / edges[side / 2]
            } else {
                -share
            }
        }));
        match self.retargeted(&shorter) {
            Some((targets, at)) => self.take(shorter, targets, at),
            None => return false,
        }
        true
    }

    /// Shortens the patch by a share at each side, and at one so that a place is no longer on it:
    /// near a singular point nothing may be provable. False where that is no patch.
    pub(crate) fn leave(&mut self, (u, v): (f64, f64), share: f64) -> bool {
        let lost = [u, 1.0 - u, v, 1.0 - v];
        let side = (0..4)
            .min_by(|&a, &b| lost[a].total_cmp(&lost[b]))
            .unwrap_or(0);
        let shorter = self.longer(std::array::from_fn(|k| {
            if k == side { -lost[k] - share } else { -share }
        }));
        let Some((targets, at)) = self.retargeted(&shorter) else {
            return false;
        };
        self.take(shorter, targets, at);
        true
    }

    /// Extrapolates (or shortens) at the sides that lie in the region until √l₁ and √l₂ are the
    /// given edges; by less where the result is no start for Newton's method. False where nothing
    /// is gained.
    fn extrapolate(&mut self, edges: [f64; 2]) -> bool {
        let present = self.edges();
        let inside = self.sides_inside(&self.patch);
        // A direction in which the patch shall be shorter is so at both sides.
        let moves: [bool; 4] = std::array::from_fn(|side| {
            (inside[side] && matches!(self.sides[side], Side::Free))
                || (edges[side / 2] < present[side / 2] && !self.sides[side].is_at_edge())
        });
        let sides =
            [0, 2].map(|first| f64::from(u8::from(moves[first]) + u8::from(moves[first + 1])));
        if sides == [0.0; 2] {
            return false;
        }
        let range = |share: f64| share.clamp(-0.2, self.pace.most_growth.1);
        let mut shares = [0, 1].map(|k| {
            if sides[k] > 0.0 {
                range((edges[k] / present[k] - 1.0) / sides[k])
            } else {
                0.0
            }
        });
        let (present_patch, avoided) = (self.patch.clone(), self.on.near_singular.avoided());
        let by = |shares: [f64; 2]| {
            std::array::from_fn(|side| match (moves[side], avoided) {
                (false, _) => 0.0,
                (true, Some(avoided)) if shares[side / 2] > 0.0 => {
                    avoided.within(&present_patch, side, shares[side / 2])
                }
                (true, _) => shares[side / 2],
            })
        };
        for _ in 0..SECANTS {
            let Some(reached) = self.objective.lengths(&self.longer(by(shares))) else {
                break;
            };
            for (k, l) in [reached.0, reached.1].into_iter().enumerate() {
                let factor = (edges[k] - present[k]) / (l.sqrt() - present[k]);
                if factor > 0.1 && factor < 10.0 {
                    shares[k] = range(shares[k] * factor);
                }
            }
        }
        for _ in 0..BISECTIONS {
            let before = self.sides;
            let patch = if self.on.whole.is_single() {
                self.longer(by(shares))
            } else {
                let (patch, sides) = self.within_edges(self.on, by(shares), self.overlap());
                self.set_sides(sides);
                patch
            };
            if let Some((targets, at)) = self.retargeted(&patch)
                && (shares.iter().all(|s| *s < 0.0) || self.is_fair(&at))
                && targets.l1.sqrt() <= MOST_LONGER * present[0]
                && targets.l2.sqrt() <= MOST_LONGER * present[1]
            {
                self.take(patch, targets, at);
                return true;
            }
            self.set_sides(before);
            shares = shares.map(|s| 0.5 * s);
        }
        false
    }

    /// The roots of the means of g₁₁ and g₂₂.
    fn edges(&self) -> [f64; 2] {
        let (l1, l2) = self.objective.mean_lengths(&self.at);
        [
            l1.max(f64::MIN_POSITIVE).sqrt(),
            l2.max(f64::MIN_POSITIVE).sqrt(),
        ]
    }

    /// What was grown.
    pub(crate) fn finish(self) -> Grown {
        Grown {
            patch: self.patch,
            seed_point: self.seed.point,
            terms: self.at.terms,
            targets: self.objective.targets,
            weights: self.objective.weights,
            trace: self.trace,
        }
    }
}

/// A patch longer by shares of its edges at its four sides.
pub(crate) fn longer(patch: &RationalPatch, by: [f64; 4]) -> RationalPatch {
    balanced(patch.part((-by[0], 1.0 + by[1]), (-by[2], 1.0 + by[3])))
}

/// The same surface with control points scaled so that the least and the largest weight are as far
/// from 1, where J is least or nearly so.
fn balanced(mut patch: RationalPatch) -> RationalPatch {
    const N: usize = 6;
    let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
    for i in 0..=N {
        for j in 0..=N {
            let w = patch.homogeneous(i as f64 / N as f64, j as f64 / N as f64)[0][3];
            (lo, hi) = (lo.min(w), hi.max(w));
        }
    }
    let middle = 0.5 * (lo + hi);
    if lo > 0.0 && middle.is_finite() {
        for v in patch.control_mut().as_flattened_mut() {
            *v /= middle;
        }
    }
    patch
}

/// The area of a patch by a grid of area elements, only where `inside` holds.
pub(crate) fn area(patch: &RationalPatch, inside: &dyn Fn(Point3) -> bool) -> f64 {
    const N: usize = 24;
    let mut sum = 0.0;
    for i in 0..N {
        for j in 0..N {
            let t = patch.tangents((i as f64 + 0.5) / N as f64, (j as f64 + 0.5) / N as f64);
            if inside(t.point) {
                let n = t.normal();
                sum += dot(n, n).sqrt();
            }
        }
    }
    sum / (N * N) as f64
}
