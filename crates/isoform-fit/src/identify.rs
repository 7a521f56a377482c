//! What the data say about each parameter, and what they leave open.
//!
//! The covariance is s² (JᵀJ)⁻¹ of the metric residual, for robust losses the sandwich. That is
//! local, and a face which no point supports can look determined by the few noisy points of its
//! neighbours' rims that happen to touch it. Therefore each parameter is also moved by ten of its
//! standard deviations, the others following along the valley: where the sum of squares does not
//! rise by a fair share of what the quadratic model says, on either side, the parameter is open.

mod covariance;

pub(crate) use self::covariance::{product, student95};

use self::covariance::inverse;
use crate::objective::{normal_equations, sum_of_squares};
use crate::polish::weight;
use crate::space::Space;
use crate::{Control, Loss};
use isoform_geom::{ParamField, Point3};

/// Standard deviations that a parameter is moved by.
const MOVE: f64 = 10.0;
/// A parameter is moved no farther than this share of its range, or of a unit: an open direction is
/// as flat there.
const FARTHEST: f64 = 0.5;
/// Share of the predicted rise that must be seen on both sides. Nonlinear but determined parameters
/// keep above 0.3.
const RISE: f64 = 0.1;
/// Curvature of a direction below this share of the largest is none: rounding.
const NO_CURVATURE: f64 = 1e-10;
/// Share of a direction that makes another open variable part of its group.
const SHARE: f64 = 0.05;
/// A variable with a smaller deviation, in units of the search, is moved only if there is a reason
/// to doubt it.
const SURE: f64 = 2e-3;
/// A variable whose deviation is above this, in units of the search, is moved however short the way
/// to its bound is.
const VAGUE: f64 = 0.2;

/// Points that stand for all.
struct Tested {
    points: Vec<Point3>,
    weights: Vec<f64>,
    /// Points that each stands for.
    share: f64,
    /// Their weighted sum of squares at the fit.
    base: f64,
}

/// A direction in which variables can move at next to no cost.
pub(crate) struct OpenDirection {
    /// The variable to hold.
    pub(crate) variable: usize,
    /// The moves of all variables, scaled to 1 for that one.
    pub(crate) direction: Vec<f64>,
    /// The sense (±1) in which nothing is lost.
    pub(crate) sense: f64,
}

/// Uncertainty of the variables.
pub(crate) struct Knowledge {
    /// Open variables: each group lies along one direction.
    pub(crate) open: Vec<Vec<usize>>,
    pub(crate) directions: Vec<OpenDirection>,
    /// The matrix of the normal equations where this was asked.
    pub(crate) normal: Vec<f64>,
}

/// The fit at which knowledge is asked for.
pub(crate) struct At<'a> {
    pub(crate) field: &'a dyn ParamField,
    pub(crate) points: &'a [Point3],
    pub(crate) space: &'a Space,
    pub(crate) x: &'a [f64],
    pub(crate) residuals: &'a [f64],
    /// 0 for points left out; empty for none.
    pub(crate) mask: &'a [f64],
    pub(crate) loss: Loss,
    /// Robust deviation, or the root mean square.
    pub(crate) scale: f64,
    /// Smallest deviation worth the name: below it data are exact.
    pub(crate) least_scale: f64,
    /// Largest rounding error of a coordinate.
    pub(crate) rounding: f64,
    /// Points that stand for all where a variable is moved: that many, spread over them.
    pub(crate) tested: usize,
    pub(crate) control: &'a Control<'a>,
}

/// Variables to be moved, one after the other.
struct Moving<'a> {
    at: &'a At<'a>,
    tested: Tested,
    /// The matrix of the normal equations.
    normal: Vec<f64>,
    /// Curvature below this is none.
    floor: f64,
    held: Vec<bool>,
    /// Inverse of the normal matrix without what is held.
    inverse: Vec<f64>,
}

/// A variable that can be moved at next to no cost.
#[derive(Clone, Copy)]
struct Flat {
    /// The sense that costs least.
    sense: f64,
    /// The variable's deviation.
    deviation: f64,
}

impl At<'_> {
    /// Deviation of the residuals, rounding at least.
    fn deviation(&self) -> f64 {
        self.scale.max(self.least_scale)
    }

    /// The matrix of the normal equations, by the loss.
    fn weighted_normal(&self) -> Vec<f64> {
        self.normal(&self.weights())
    }

    /// Weights of the points in the loss.
    fn weights(&self) -> Vec<f64> {
        let s = self.deviation();
        self.masked(|r| weight(self.loss, r / s))
    }

    /// Jᵀ W J of all points, in the variables.
    fn normal(&self, weights: &[f64]) -> Vec<f64> {
        let (n, m) = (self.field.dim(), self.space.len());
        let (mut ga, mut ha) = (vec![0.0; n], vec![0.0; n * n]);
        let (mut g, mut h) = (vec![0.0; m], vec![0.0; m * m]);
        let a = self.space.parameters(self.x);
        normal_equations(self.field, self.points, weights, &a, &mut ga, &mut ha);
        self.space.pull_back(&ga, &ha, &mut g, &mut h);
        h
    }

    /// A weight per point, nought where it is left out; empty where all would be 1.
    fn masked(&self, weight: impl Fn(f64) -> f64) -> Vec<f64> {
        if self.mask.is_empty() && !self.loss.is_robust() {
            return Vec::new();
        }
        let mut weights: Vec<f64> = self.residuals.iter().map(|r| weight(*r)).collect();
        weights.iter_mut().zip(self.mask).for_each(|(w, m)| *w *= m);
        weights
    }

    /// Some of the points with their weights (as at x), and how many each stands for.
    fn tested(&self, weights: &[f64]) -> Tested {
        let step = self.points.len().div_ceil(self.tested.max(1)).max(1);
        let points: Vec<Point3> = self.points.iter().copied().step_by(step).collect();
        let mut tested = Tested {
            weights: weights.iter().copied().step_by(step).collect(),
            share: self.points.len() as f64 / points.len().max(1) as f64,
            points,
            base: 0.0,
        };
        tested.base = self.sum(self.x, &tested);
        tested
    }

    /// Sum of squares after a move.
    fn sum(&self, x: &[f64], tested: &Tested) -> f64 {
        let a = self.space.parameters(x);
        tested.share * sum_of_squares(self.field, &tested.points, &tested.weights, &a)
    }

    /// Knowledge without any variable moved: nothing is called open.
    pub(crate) fn unasked(&self, normal: Option<Vec<f64>>) -> Knowledge {
        Knowledge {
            open: Vec::new(),
            directions: Vec::new(),
            normal: normal.unwrap_or_else(|| self.weighted_normal()),
        }
    }

    /// Open directions and the covariance of what is determined. Only variables that `suspect`
    /// names, or that are weak, are moved: each move costs two sums over the points.
    /// `normal` is the matrix of the normal equations, if it is known. What was found so far is all
    /// once time is over.
    pub(crate) fn knowledge(
        &self,
        suspect: &dyn Fn(usize) -> bool,
        normal: Option<Vec<f64>>,
    ) -> Knowledge {
        let m = self.space.len();
        let weights = self.weights();
        let normal = normal.unwrap_or_else(|| self.normal(&weights));
        let mut moving = Moving::new(self, normal, self.tested(&weights));
        let mut open = Vec::new();
        let mut directions = Vec::new();
        let mut flat_at_first: Option<Vec<bool>> = None;
        while !self.control.is_stopped() {
            let flats: Vec<Option<Flat>> = (0..m).map(|k| moving.flat(k, suspect)).collect();
            let first =
                flat_at_first.get_or_insert_with(|| flats.iter().map(Option::is_some).collect());
            let Some((k, flat)) = freest(&flats) else {
                break;
            };
            let direction = moving.direction(k);
            let belongs = |j: &usize| *j == k || (first[*j] && direction[*j].abs() > SHARE);
            add_group(&mut open, (0..m).filter(belongs).collect());
            moving.hold(k);
            directions.push(OpenDirection {
                variable: k,
                direction,
                sense: flat.sense,
            });
        }
        Knowledge {
            open,
            directions,
            normal: moving.normal,
        }
    }
}

impl<'a> Moving<'a> {
    fn new(at: &'a At<'a>, normal: Vec<f64>, tested: Tested) -> Self {
        let m = at.space.len();
        let mut moving = Self {
            at,
            tested,
            floor: NO_CURVATURE * largest(&normal, m),
            normal,
            held: vec![false; m],
            inverse: Vec::new(),
        };
        moving.invert();
        moving
    }

    fn invert(&mut self) {
        self.inverse = inverse(&self.normal, self.held.len(), &self.held, self.floor);
    }

    /// Holds a variable from now on.
    fn hold(&mut self, k: usize) {
        self.held[k] = true;
        self.invert();
    }

    /// Whether variable k can be moved at next to no cost, if there is a reason to ask.
    fn flat(&self, k: usize, suspect: &dyn Fn(usize) -> bool) -> Option<Flat> {
        let is_asked = !self.held[k] && (self.is_weak(k) || suspect(k));
        is_asked.then(|| self.flatness(k)).flatten()
    }

    fn spread(&self, k: usize) -> f64 {
        self.inverse[k * self.at.space.len() + k]
    }

    /// Deviation of variable k, the others following along the valley.
    fn deviation(&self, k: usize) -> f64 {
        self.at.deviation() * self.spread(k).sqrt()
    }

    /// Whether the points say little of variable k.
    fn is_weak(&self, k: usize) -> bool {
        let is_blind = self.normal[k * self.held.len() + k] < self.floor;
        let deviation = self.deviation(k);
        is_blind || deviation.is_nan() || deviation >= SURE
    }

    /// The move of variable j along the valley, per move of variable k times its spread.
    fn along(&self, k: usize, j: usize) -> f64 {
        self.inverse[j * self.at.space.len() + k]
    }

    /// The valley of variable k, without what is held.
    fn direction(&self, k: usize) -> Vec<f64> {
        let spread = self.spread(k);
        let along = |j: usize| {
            if self.held[j] {
                0.0
            } else {
                self.along(k, j) / spread
            }
        };
        (0..self.held.len()).map(along).collect()
    }

    /// If moving variable k costs next to nothing: the sense that costs least, and the variable's
    /// deviation.
    fn flatness(&self, k: usize) -> Option<Flat> {
        let spread = self.spread(k);
        if !(spread > 0.0 && spread.is_finite()) {
            return Some(Flat {
                sense: 1.0,
                deviation: f64::INFINITY,
            });
        }
        let deviation = self.deviation(k);
        let (mut sense, mut least) = (1.0, f64::INFINITY);
        for s in [1.0, -1.0] {
            let t = self.reach(k, s);
            if t < 2.0 * deviation && deviation < VAGUE {
                continue; // at a bound: nothing can be said on this side
            }
            let ratio = self.rise(k, s * t) / self.predicted(k, t);
            if ratio < least || ratio.is_nan() {
                sense = s;
                least = if ratio.is_nan() {
                    f64::NEG_INFINITY
                } else {
                    ratio
                };
            }
        }
        (least < RISE).then_some(Flat { sense, deviation })
    }

    /// How far variable k is moved in a sense. A bound in the way shortens the move.
    fn reach(&self, k: usize, sense: f64) -> f64 {
        let (limits, spread) = (self.at.space.limits(), self.spread(k));
        let mut t = (MOVE * self.deviation(k))
            .min(FARTHEST * limits.range(k))
            .min(FARTHEST);
        for j in 0..self.at.x.len() {
            let by = sense * self.along(k, j) / spread;
            if by.abs() > 0.0 {
                t = t.min(limits.gap(self.at.x, j, by) / by.abs());
            }
        }
        t
    }

    /// How much the sum of squares rises when variable k moves by t.
    fn rise(&self, k: usize, t: f64) -> f64 {
        let spread = self.spread(k);
        let moved = self.at.x.iter().enumerate();
        let moved = moved.map(|(j, x)| x + t * self.along(k, j) / spread);
        self.at.sum(&moved.collect::<Vec<_>>(), &self.tested) - self.tested.base
    }

    /// The rise that the quadratic model foretells. For next to no curvature that is next to
    /// nothing; then a fair rise is one of a few deviations.
    fn predicted(&self, k: usize, t: f64) -> f64 {
        let s = self.at.deviation();
        let share = (t / (MOVE * self.deviation(k))).min(1.0).powi(2);
        (t * t / self.spread(k))
            .max(s * s * MOVE * MOVE * 0.25 * share)
            .max(s * s)
    }
}

/// Adds a group of open variables to others. Groups that share a variable are one statement.
fn add_group(open: &mut Vec<Vec<usize>>, group: Vec<usize>) {
    let meets = |known: &&mut Vec<usize>| known.iter().any(|j| group.contains(j));
    match open.iter_mut().find(meets) {
        Some(known) => {
            known.extend(group);
            known.sort_unstable();
            known.dedup();
        }
        None => open.push(group),
    }
}

/// The flat variable with the largest deviation, the first of equals.
fn freest(flats: &[Option<Flat>]) -> Option<(usize, Flat)> {
    let all = flats.iter().enumerate();
    all.filter_map(|(k, flat)| Some((k, (*flat)?)))
        .max_by(|a, b| {
            let by_deviation = a.1.deviation.total_cmp(&b.1.deviation);
            by_deviation.then(b.0.cmp(&a.0))
        })
}

/// Largest diagonal element of a matrix of m rows.
fn largest(h: &[f64], m: usize) -> f64 {
    (0..m).map(|i| h[i * m + i]).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_that_meet_are_one() {
        let mut open = Vec::new();
        add_group(&mut open, vec![3, 1]);
        add_group(&mut open, vec![0]);
        add_group(&mut open, vec![2, 3]);
        assert_eq!(open, [vec![1, 2, 3], vec![0]]);
    }
}
