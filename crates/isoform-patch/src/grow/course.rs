//! Control of growing: the actions that follow each extrapolation until the bound is reached.

use super::{GROWING, Growth, MIN_CONTROL_WEIGHT, SideState};
use crate::fold;
use crate::objective::Objective;
use crate::terms::{Method, Terms};

/// Load above which a patch counts as near its bound: it then takes more Newton steps.
const NEAR_BOUND_LOAD: f64 = 0.3;
/// Load at which extrapolations aim.
const TARGET_LOAD: f64 = 0.997;
/// Load above which a patch counts as large as possible.
const FULL_LOAD: f64 = 0.985;
/// Maximum number of consecutive shortenings; after more, growing ends with the last good patch.
const MAX_SHORTENINGS_IN_A_ROW: usize = 4;
/// Maximum number of consecutive patches that keep the bound and are not larger than an earlier one.
/// Twice as many take a quarter more steps for patches of equal area.
const MAX_STALE_PATCHES: usize = 3;
/// Maximum load after an extrapolation, before Newton steps.
pub(super) const MAX_LOAD_AFTER_EXTRAPOLATION: f64 = 30.0;
/// Relative change of the terms with more quadrature nodes above which there are too few nodes.
const QUADRATURE_TOLERANCE: f64 = 0.02;

/// State of the growth controller.
struct GrowthController {
    /// Logarithms of size and load.
    history: Vec<(f64, f64)>,
    /// Number of consecutive shortenings.
    shortened: usize,
    /// Number of times that L and R got more weight.
    evened: usize,
    /// Number of consecutive patches no larger than an earlier good one.
    stale: usize,
    /// Fraction of the fastest growth that is tried.
    caution: f64,
}

impl GrowthController {
    fn new() -> Self {
        Self {
            history: Vec::new(),
            shortened: 0,
            evened: 0,
            stale: 0,
            caution: 1.0,
        }
    }

    /// Records a patch with these edges.
    fn note(&mut self, edges: [f64; 2], load: f64) {
        self.history.push((
            0.5 * (edges[0] * edges[1]).ln(),
            load.max(f64::MIN_POSITIVE).ln(),
        ));
    }

    /// Returns the exponent p in load ∝ sizeᵖ, estimated from the last two patches if their sizes
    /// differ.
    fn power(&self) -> f64 {
        match self.history.as_slice() {
            [.., (x0, y0), (x1, y1)] if (x1 - x0).abs() > 1e-4 => {
                ((y1 - y0) / (x1 - x0)).clamp(3.0, 12.0)
            }
            _ => 6.0,
        }
    }
}

impl Growth<'_> {
    /// Grows until the bound on S, or on the distance, is reached.
    pub(crate) fn grow_to_limit(&mut self) {
        self.descend(self.pace.few_steps);
        let mut course = GrowthController::new();
        let most = self.options.most_extrapolations;
        for count in 0..=most {
            if self.late() {
                break;
            }
            let load = self.descend_near_bound();
            self.tell(load);
            let edges = self.objective.targets.edges();
            course.note(edges, load);
            let left = if self.is_good(load) {
                self.keep_good(load, &mut course)
            } else {
                self.turn_back(load, &mut course)
            };
            let Some(load) = left.filter(|_| count < most) else {
                break;
            };
            if !self.extrapolate(self.next_edges(edges, load, &course)) {
                break;
            }
            self.descend(self.pace.few_steps);
        }
        if let Some(best) = self.good.take() {
            self.settle(best);
        }
    }

    /// Reports the load as progress, as it grows with the patch.
    fn tell(&self, load: f64) {
        let [from, to] = self.shares;
        let done = from + (to - from) * load.clamp(0.0, 1.0);
        self.control.report(GROWING, done);
    }

    /// Acts after an extrapolation: near the bound more Newton steps, more quadrature nodes where
    /// needed, and more weight for J. Returns the resulting load.
    fn descend_near_bound(&mut self) -> f64 {
        self.trim();
        let mut load = self.load();
        if load > NEAR_BOUND_LOAD {
            self.descend(self.pace.many_steps);
            self.trim();
            load = self.load();
        }
        if load > 0.05 && self.refine() {
            self.descend(self.pace.many_steps);
            load = self.load();
        }
        for _ in 0..8 {
            // Above a load of 1.5 the patch is too large in any case.
            if load > 1.5 || !self.raise() {
                break;
            }
            load = self.load();
        }
        load
    }

    /// Returns true if the patch meets all requirements.
    fn is_good(&self, load: f64) -> bool {
        load <= 1.0
            && self.patch.control_weights().0 > MIN_CONTROL_WEIGHT
            && (self.options.tolerance.is_none() || self.is_near_region())
    }

    /// Stores a good patch if it is the largest so far; returns its load, `None` if growing ends.
    fn keep_good(&mut self, load: f64, course: &mut GrowthController) -> Option<f64> {
        let area = |growth: &Self, at| growth.objective.area(at);
        let is_larger =
            (self.good.as_ref()).is_none_or(|g| area(self, &self.at) > area(self, &g.at));
        if is_larger {
            self.good = Some(self.state());
            course.stale = 0;
        } else {
            course.stale += 1;
            if course.stale > MAX_STALE_PATCHES {
                return None;
            }
        }
        course.shortened = 0;
        // With a tolerance, the proportions may still change, and with them the area.
        let is_full = load >= FULL_LOAD && (self.options.tolerance.is_none() || course.stale > 0);
        (!is_full).then_some(load)
    }

    /// Returns to the last good patch if shortening would not repair the current one; returns the
    /// resulting load, `None` if growing ends.
    fn turn_back(&mut self, load: f64, course: &mut GrowthController) -> Option<f64> {
        course.shortened += 1;
        if course.shortened > MAX_SHORTENINGS_IN_A_ROW {
            return None;
        }
        let Some(good) = self
            .good
            .clone()
            .filter(|_| load > MAX_LOAD_AFTER_EXTRAPOLATION)
        else {
            return Some(load);
        };
        let fold = fold::seen(&self.patch);
        self.settle(good);
        let mut load = self.load();
        match fold {
            Some(_) if self.options.tolerance.is_some() && course.evened < 3 => {
                course.evened += 1;
                self.even();
                load = self.load();
            }
            Some(side) => self.stop(side),
            None => course.caution *= 0.5,
        }
        course.history.clear();
        Some(load)
    }

    /// Computes the edges at which the next extrapolation aims. It aims at a size, not at a
    /// fraction of the current patch, because Newton steps shorten what was extrapolated; but the
    /// proportions are those of the current patch, as the steps shorten more the direction in which
    /// length costs more.
    fn next_edges(&self, edges: [f64; 2], load: f64, course: &GrowthController) -> [f64; 2] {
        let longest = 1.0 + 2.0 * self.pace.most_in_direction * course.caution;
        let factor = (TARGET_LOAD / load)
            .powf(1.0 / course.power())
            .clamp(0.8, longest);
        let reached = self.edges();
        let shift = ((reached[1] * edges[0]) / (reached[0] * edges[1])).sqrt();
        [edges[0] * factor / shift, edges[1] * factor * shift]
    }

    /// Gives the terms of shape more weight, so that parameter lines do not crowd before a patch
    /// folds over.
    fn even(&mut self) {
        let (floor, weights) = (&mut self.options.floor, &mut self.objective.weights);
        let raised = |w: f64| (30.0 * w).min(1.0);
        (floor.l, floor.r) = (raised(weights.l), raised(weights.r));
        (weights.l, weights.r) = (floor.l, floor.r);
        if self.retake(self.patch.clone()) {
            self.descend(self.pace.many_steps);
            self.trim();
        }
    }

    /// Stops a side, also in the last accepted patch.
    fn stop(&mut self, side: usize) {
        self.sides[side] = SideState::Stopped;
        if let Some(good) = &mut self.good {
            good.sides[side] = SideState::Stopped;
        }
    }

    /// Gives J more weight if a control weight is too small; returns true if it did.
    fn raise(&mut self) -> bool {
        if !self.objective.is_by_control() || self.patch.control_weights().0 > MIN_CONTROL_WEIGHT {
            return false;
        }
        let Some((targets, at)) = self.retargeted(&self.patch) else {
            return false;
        };
        self.options.floor.j *= 10.0;
        self.objective.weights.j = self.objective.weights.j.max(self.options.floor.j);
        self.take(self.patch.clone(), targets, at);
        self.descend(self.pace.many_steps);
        self.trim();
        true
    }

    /// Increases the number of quadrature nodes if integrals are too inaccurate, as they are where
    /// integrands have kinks: across self-intersections and at tight blends. Returns true if it
    /// did.
    fn refine(&mut self) -> bool {
        let nodes = self.objective.nodes_per_direction();
        let is_fixed = self.options.nodes.is_some() || self.options.tolerance.is_some();
        if is_fixed || nodes >= 20 || self.is_resolved(nodes * 9 / 5) {
            return false;
        }
        self.objective.set_nodes(nodes * 8 / 5);
        if !self.retake(self.patch.clone()) {
            self.objective.set_nodes(nodes);
            return false;
        }
        true
    }

    /// Returns true if the terms hardly change with more nodes.
    fn is_resolved(&self, nodes: usize) -> bool {
        let own = &self.objective;
        let degree = self.patch.degree();
        let mut finer = Objective::new(own.field(), degree, Method::Frozen, Some(nodes));
        (finer.inner, finer.weights, finer.targets) = (own.inner, own.weights, own.targets);
        let at = finer.evaluate(&self.patch);
        at.is_some_and(|at| self.are_near(&at.terms))
    }

    /// Returns true if these terms are near the current ones or their differences are small
    /// compared with S.
    fn are_near(&self, b: &Terms) -> bool {
        let (a, w, sum) = (&self.at.terms, self.objective.weights, self.sum());
        let near = |a: f64, b: f64, factor: f64| {
            (a - b).abs() <= QUADRATURE_TOLERANCE * a.max(b)
                || factor * (a - b).abs() <= 1e-3 * QUADRATURE_TOLERANCE * sum
        };
        // Targets of corners and sides change in each evaluation: they enter through the sum alone.
        let &Terms {
            i,
            j,
            l,
            r,
            e: _,
            sides: _,
        } = b;
        near(a.i, i, 1.0)
            && near(a.j, j, w.j)
            && near(a.l, l, w.l)
            && near(a.r, r, w.r)
            && (b.sum(&w) - sum).abs() <= 0.5 * QUADRATURE_TOLERANCE * sum
    }
}
