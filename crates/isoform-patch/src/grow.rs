//! Patch growing (Wurm, Jüttler and Kim 2003, section 3.2): from a small patch on the tangent
//! plane, Newton steps and extrapolations alternate until the bound on S is reached.
//! Choices that the paper leaves open:
//! - Corners are returned to the surface along the normal of the patch, not along ∇F: at a
//!   self-intersection ∇F turns and leads to the wrong branch.
//! - The size at which the bound is reached is predicted from S at earlier sizes, as S is nearly a
//!   power of the size; so few extrapolations fail.
//! - If Newton steps shorten one direction more than the other, the next extrapolation keeps the
//!   new proportions: patches take the proportions that suit them.
//! - After an extrapolation that proves too large the patch is shortened, which counts as an
//!   extrapolation in the trace.
//!
//! Terms: the *load* of a patch is its S, or its distance from the surface, as a fraction of the
//! allowed value; a *side* is one of u = 0, u = 1, v = 0 and v = 1; an *edge* is where the part of
//! the surface on which the patch grows ends; *targets* are the lengths and corners towards which S
//! pulls the patch.

mod course;
mod edges;
mod extrapolate;
mod keep;
mod pace;
mod start;

pub(crate) use edges::SideState;
pub(crate) use pace::{MAX_EXTRAPOLATION, StepSizePolicy};
pub(crate) use start::GrowthStart;

use crate::distance::{sampled, sampled_on};
use crate::fold;
use crate::grown::{Grown, Phase, Row, area_within};
use crate::objective::{Evaluated, Objective};
use crate::options::Options;
use crate::places::{contains, normalized, wider_by_share};
use crate::solver::{Minimiser, StopRule};
use crate::stretch::longer;
use crate::surface::{Seed, project, project_along};
use crate::terms::{CORNERS, Targets, Terms, Weights};
use crate::whole::GrowthPart;
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, RationalPatch, distance_squared, norm};

/// Phase of growing in reports of progress.
pub(crate) const GROWING: &str = "grow";
/// Fraction of the region's size by which a side may leave the region before it stops.
const SIDE_STOP_EXCESS: f64 = 0.2;
/// Minimum control weight of a patch: CAD systems silently drop faces with negative ones, and
/// quotients by small ones are large.
pub(crate) const MIN_CONTROL_WEIGHT: f64 = 0.02;

/// Growing patch and its settings.
pub(crate) struct Growth<'f> {
    pub(crate) objective: Objective<'f>,
    pub(crate) patch: RationalPatch,
    pub(crate) at: Evaluated,
    pub(crate) trace: Vec<Row>,
    /// True if time ran out while the patch could still grow.
    pub(crate) is_late: bool,
    /// Number of times it was shortened for the proof of its tolerance.
    pub(crate) shortenings: usize,
    /// Last patch that kept the bound.
    good: Option<PatchState<'f>>,
    pub(crate) options: Options,
    /// Control that may stop growing.
    pub(crate) control: Control<'f>,
    /// Range of the phase's progress that growing covers.
    shares: [f64; 2],
    pace: StepSizePolicy,
    minimiser: Minimiser,
    seed: Seed,
    /// Edge of the region: the unit of length of bounds.
    pub(crate) unit: f64,
    /// Part of the surface on which the patch grows.
    on: GrowthPart<'f>,
    /// States of the sides u = 0, u = 1, v = 0, v = 1.
    sides: [SideState<'f>; 4],
}

/// Patch with the targets and factors with which it was found.
#[derive(Clone)]
pub(crate) struct PatchState<'f> {
    patch: RationalPatch,
    at: Evaluated,
    targets: Targets,
    weights: Weights,
    sides: [SideState<'f>; 4],
}

impl<'f> Growth<'f> {
    /// Returns the part on which the patch grows.
    pub(crate) fn on(&self) -> GrowthPart<'f> {
        self.on
    }
    /// Returns the surface point at which the patch was started.
    pub(crate) fn seed_point(&self) -> Point3 {
        self.seed.point
    }
    /// Returns the area of the patch within a region, to a few per cent.
    pub(crate) fn area(&self, region: &Aabb) -> f64 {
        area_within(&self.patch, region)
    }

    /// Returns the bound on S.
    pub(crate) fn limit(&self) -> f64 {
        self.options.limit * self.unit * self.unit
    }

    /// Returns true if S keeps its bound.
    pub(crate) fn is_within_limit(&self) -> bool {
        self.sum() <= self.limit()
    }

    /// Returns S.
    pub(crate) fn sum(&self) -> f64 {
        self.objective.sum(&self.at.terms)
    }

    /// Returns the load: S, or the distance from the surface, as a fraction of the allowed value; a
    /// very large number for a patch that folds over.
    fn load(&self) -> f64 {
        if fold::seen(&self.patch).is_some() {
            return 1e6;
        }
        let Some(tolerance) = self.options.tolerance else {
            return self.sum() / self.limit();
        };
        let samples = 17;
        let distance = sampled(self.objective.field(), &self.patch, samples).0;
        if self.on.whole.is_single() {
            // The proof exceeds the sampled distance by a few per cent.
            return distance / (0.93 * tolerance);
        }
        let whole = sampled_on(self.on.whole, &self.patch, samples).0;
        // At edges the proof may add nearly as much again.
        (distance.max(whole) / (0.6 * tolerance)).max(self.off_edges(self.on) / self.overlap())
    }

    /// Returns the distance by which the patch may extend beyond edges, a fraction of the
    /// tolerance.
    fn overlap(&self) -> f64 {
        0.3 * self.options.tolerance.unwrap_or(self.limit().sqrt())
    }

    fn set_sides(&mut self, sides: [SideState<'f>; 4]) {
        self.sides = sides;
        self.objective.sides = sides.map(SideState::edge);
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

    /// Computes target lengths and corners for a patch (section 3.3), and its value with them;
    /// `None` if a corner has no foot nearby.
    pub(crate) fn retargeted(&self, patch: &RationalPatch) -> Option<(Targets, Evaluated)> {
        let at = self.objective.evaluate(patch)?;
        let (l1, l2) = self.objective.mean_lengths(&at);
        let edge = l1.max(l2).sqrt();
        let mut corners = [[0.0; 3]; 4];
        for (corner, &place) in corners.iter_mut().zip(&CORNERS) {
            *corner = self.corner_foot(patch, place, edge)?;
        }
        let targets = Targets { l1, l2, corners };
        let at = self.objective.with_targets(patch, at, &targets)?;
        Some((targets, at))
    }

    /// Projects a corner to the surface, along the normal of the patch if possible; `None` if no
    /// foot is near.
    fn corner_foot(&self, patch: &RationalPatch, (u, v): (f64, f64), edge: f64) -> Option<Point3> {
        let field = self.objective.field();
        let t = patch.tangents(u, v);
        let n = t.normal();
        // A patch whose corners have no feet within this distance has left the surface.
        let reach = 0.25 * edge;
        let along = (norm(n) > 0.0)
            .then(|| project_along(field, t.point, normalized(n), reach))
            .flatten();
        let near = |q: &Point3| distance_squared(*q, t.point) <= reach.powi(2);
        along.or_else(|| project(field, t.point, edge).filter(near))
    }

    /// Takes Newton steps until `stop`.
    fn descend(&mut self, stop: StopRule) {
        let at = std::mem::take(&mut self.at);
        let trace = &mut self.trace;
        let taken = trace.iter().filter(|r| r.phase == Phase::Newton).count();
        let left = self.options.most_steps.saturating_sub(taken);
        let stop = StopRule {
            steps: stop.steps.min(left),
            ..stop
        };
        let mut each = |o: &Objective<'_>, t: &Terms| trace.push(Self::row(o, Phase::Newton, t));
        self.minimiser.floor = self.options.floor;
        self.at =
            (self.minimiser).minimise(&mut self.objective, &mut self.patch, at, stop, &mut each);
    }

    /// Replaces the patch, as a start for Newton's method.
    pub(crate) fn take(&mut self, patch: RationalPatch, targets: Targets, at: Evaluated) {
        (self.patch, self.at, self.objective.targets) = (patch, at, targets);
        self.trace
            .push(Self::row(&self.objective, Phase::Grow, &self.at.terms));
    }

    /// Replaces the patch and computes its targets; returns false if it has no targets.
    fn retake(&mut self, patch: RationalPatch) -> bool {
        let Some((targets, at)) = self.retargeted(&patch) else {
            return false;
        };
        self.take(patch, targets, at);
        true
    }

    pub(crate) fn state(&self) -> PatchState<'f> {
        PatchState {
            patch: self.patch.clone(),
            at: self.at.clone(),
            targets: self.objective.targets,
            weights: self.objective.weights,
            sides: self.sides,
        }
    }

    /// Returns true if the patch equals that of a state.
    pub(crate) fn is_as(&self, state: &PatchState<'f>) -> bool {
        state.patch == self.patch
    }

    /// Returns to an earlier patch unless it equals the current one.
    pub(crate) fn settle(&mut self, to: PatchState<'f>) {
        if !self.is_as(&to) {
            self.set_sides(to.sides);
            self.objective.weights = to.weights;
            self.take(to.patch, to.targets, to.at);
        }
    }

    /// Returns the region widened by a fraction of its size at each side.
    pub(crate) fn wider(&self, share: f64) -> Aabb {
        wider_by_share(&self.options.region, share)
    }

    /// Returns, for the sides u = 0, u = 1, v = 0, v = 1 of a patch, true if most of the side lies
    /// in the region and none of it far outside.
    pub(crate) fn sides_inside(&self, patch: &RationalPatch) -> [bool; 4] {
        let (region, wider) = (self.options.region, self.wider(SIDE_STOP_EXCESS));
        let samples = 9;
        std::array::from_fn(|side| {
            let at = |i: usize| {
                let t = i as f64 / (samples - 1) as f64;
                let (u, v) = [(0.0, t), (1.0, t), (t, 0.0), (t, 1.0)][side];
                patch.point(u, v)
            };
            let inside = (0..samples).filter(|&i| contains(&region, at(i)));
            2 * inside.count() > samples && (0..samples).all(|i| contains(&wider, at(i)))
        })
    }

    /// Extends the patch by fractions of its edges at its four sides.
    pub(crate) fn longer(&self, by: [f64; 4]) -> RationalPatch {
        longer(&self.patch, by)
    }

    /// Returns true if time is over, and records that.
    pub(crate) fn late(&mut self) -> bool {
        self.is_late |= self.is_over();
        self.is_late
    }

    /// Returns true if time is over.
    pub(crate) fn is_over(&self) -> bool {
        self.control.is_stopped()
    }

    /// Returns the roots of the means of g₁₁ and g₂₂.
    fn edges(&self) -> [f64; 2] {
        let (l1, l2) = self.objective.mean_lengths(&self.at);
        [
            l1.max(f64::MIN_POSITIVE).sqrt(),
            l2.max(f64::MIN_POSITIVE).sqrt(),
        ]
    }

    /// Ends growing and returns the result.
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
