//! Identifiability: which parameters the data determine.
//!
//! The covariance is s² (JᵀJ)⁻¹ of the metric residual; for robust losses it is the sandwich
//! estimate. It is a local measure: a face that no point supports can seem determined by a few
//! noisy points of its neighbours' rims that happen to touch it. Each parameter is therefore also
//! moved by ten of its standard deviations, while the others follow along the valley: if the sum of
//! squares does not rise by a fair share of what the quadratic model predicts, on either side, the
//! parameter is open.

mod covariance;
mod local_fit;

pub(crate) use self::covariance::student95;
pub(crate) use self::local_fit::ExaminedFit;

use self::local_fit::MIN_CURVATURE_SHARE;
use crate::matrix::{inverse, largest};
use crate::residuals::sum_of_squares;
use isoform_geom::Point3;

/// Number of standard deviations by which a parameter is moved.
const PROBE_DEVIATIONS: f64 = 10.0;

/// A subset of the points that represents all.
struct PointSubset {
    points: Vec<Point3>,
    weights: Vec<f64>,
    /// Number of points that each represents.
    share: f64,
    /// Weighted sum of squares at the fit.
    base: f64,
}

/// A direction in which variables can move at almost no cost.
pub(crate) struct OpenDirection {
    /// The variable to hold.
    pub(crate) variable: usize,
    /// Moves of all variables, scaled to 1 for that one.
    pub(crate) direction: Vec<f64>,
    /// Sense (±1) in which the sum of squares rises least.
    pub(crate) sense: f64,
}

/// Identifiability of the variables.
pub(crate) struct Knowledge {
    /// Groups of open variables, each along one direction.
    pub(crate) open: Vec<Vec<usize>>,
    pub(crate) directions: Vec<OpenDirection>,
    /// Matrix of the normal equations at the fit.
    pub(crate) normal: Vec<f64>,
}

/// State of the examination, in which variables are moved one after the other.
struct Examination<'a> {
    at: &'a ExaminedFit<'a>,
    tested: PointSubset,
    /// Matrix of the normal equations.
    normal: Vec<f64>,
    /// Smallest curvature that counts.
    floor: f64,
    held: Vec<bool>,
    /// Inverse of the normal matrix without the held variables.
    inverse: Vec<f64>,
}

/// A variable that can be moved at almost no cost.
#[derive(Clone, Copy)]
struct FlatDirection {
    /// Sense that costs least.
    sense: f64,
    /// Standard deviation of the variable.
    deviation: f64,
}

impl ExaminedFit<'_> {
    /// Selects a subset of the points with their weights at x.
    fn tested(&self, weights: &[f64]) -> PointSubset {
        let step = self.points.len().div_ceil(self.tested.max(1)).max(1);
        let points: Vec<Point3> = self.points.iter().copied().step_by(step).collect();
        let mut tested = PointSubset {
            weights: weights.iter().copied().step_by(step).collect(),
            share: self.points.len() as f64 / points.len().max(1) as f64,
            points,
            base: 0.0,
        };
        tested.base = self.sum(self.x, &tested);
        tested
    }

    /// Returns the sum of squares at x.
    fn sum(&self, x: &[f64], tested: &PointSubset) -> f64 {
        let a = self.space.parameters(x);
        tested.share * sum_of_squares(self.field, &tested.points, &tested.weights, &a)
    }

    /// Returns the knowledge without moving any variable: none is called open.
    pub(crate) fn without_moves(&self, normal: Option<Vec<f64>>) -> Knowledge {
        Knowledge {
            open: Vec::new(),
            directions: Vec::new(),
            normal: normal.unwrap_or_else(|| self.weighted_normal()),
        }
    }

    /// Finds the open directions. Only variables that `suspect` names, or that are weak, are moved,
    /// since each move costs two sums over the points. `normal` is the matrix of the normal
    /// equations, if known. At the end of the time limit the directions found so far are returned.
    pub(crate) fn knowledge(
        &self,
        suspect: &dyn Fn(usize) -> bool,
        normal: Option<Vec<f64>>,
    ) -> Knowledge {
        let m = self.space.len();
        let weights = self.weights();
        let normal = normal.unwrap_or_else(|| self.normal(&weights));
        let mut moving = Examination::new(self, normal, self.tested(&weights));
        let mut open = Vec::new();
        let mut directions = Vec::new();
        let mut flat_at_first: Option<Vec<bool>> = None;
        while !self.control.is_stopped() {
            let flats: Vec<Option<FlatDirection>> =
                (0..m).map(|k| moving.flat(k, suspect)).collect();
            let first =
                flat_at_first.get_or_insert_with(|| flats.iter().map(Option::is_some).collect());
            let Some((k, flat)) = freest(&flats) else {
                break;
            };
            let direction = moving.direction(k);
            // Another open variable belongs to the group if it moves by 5 % of the first one.
            let belongs = |j: &usize| *j == k || (first[*j] && direction[*j].abs() > 0.05);
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

impl<'a> Examination<'a> {
    fn new(at: &'a ExaminedFit<'a>, normal: Vec<f64>, tested: PointSubset) -> Self {
        let m = at.space.len();
        let mut moving = Self {
            at,
            tested,
            floor: MIN_CURVATURE_SHARE * largest(&normal, m),
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

    /// Returns the flat direction of variable k if there is reason to examine it and it can be
    /// moved at almost no cost.
    fn flat(&self, k: usize, suspect: &dyn Fn(usize) -> bool) -> Option<FlatDirection> {
        let is_asked = !self.held[k] && (self.is_weak(k) || suspect(k));
        is_asked.then(|| self.flatness(k)).flatten()
    }

    fn spread(&self, k: usize) -> f64 {
        self.inverse[k * self.at.space.len() + k]
    }

    /// Returns the deviation of variable k while the others follow along the valley.
    fn deviation(&self, k: usize) -> f64 {
        self.at.deviation() * self.spread(k).sqrt()
    }

    /// Returns true if the points say little about variable k: its deviation is above 0.002 units
    /// of the search, or its curvature is rounding.
    fn is_weak(&self, k: usize) -> bool {
        let is_blind = self.normal[k * self.held.len() + k] < self.floor;
        let deviation = self.deviation(k);
        is_blind || deviation.is_nan() || deviation >= 2e-3
    }

    /// Returns the move of variable j along the valley, per move of variable k times its spread.
    fn along(&self, k: usize, j: usize) -> f64 {
        self.inverse[j * self.at.space.len() + k]
    }

    /// Returns the valley of variable k, without the held variables.
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

    /// Moves variable k in both senses. If it costs almost nothing in one, returns the sense that
    /// costs least and the variable's deviation.
    fn flatness(&self, k: usize) -> Option<FlatDirection> {
        let spread = self.spread(k);
        if !(spread > 0.0 && spread.is_finite()) {
            return Some(FlatDirection {
                sense: 1.0,
                deviation: f64::INFINITY,
            });
        }
        let deviation = self.deviation(k);
        let (mut sense, mut least) = (1.0, f64::INFINITY);
        for s in [1.0, -1.0] {
            let t = self.reach(k, s);
            // At a bound this side says nothing, unless the variable is very vague.
            if t < 2.0 * deviation && deviation < 0.2 {
                continue;
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
        // Nonlinear but determined parameters stay above 0.3 of the predicted rise.
        (least < 0.1).then_some(FlatDirection { sense, deviation })
    }

    /// Returns the distance by which variable k is moved in a sense: at most half of its range or
    /// unit, since an open direction is flat there, too, and no farther than a bound.
    fn reach(&self, k: usize, sense: f64) -> f64 {
        let (limits, spread) = (self.at.space.limits(), self.spread(k));
        let mut t = (PROBE_DEVIATIONS * self.deviation(k))
            .min(0.5 * limits.range(k))
            .min(0.5);
        for j in 0..self.at.x.len() {
            let by = sense * self.along(k, j) / spread;
            if by.abs() > 0.0 {
                t = t.min(limits.gap(self.at.x, j, by) / by.abs());
            }
        }
        t
    }

    /// Returns the rise of the sum of squares when variable k moves by t.
    fn rise(&self, k: usize, t: f64) -> f64 {
        let spread = self.spread(k);
        let moved = self.at.x.iter().enumerate();
        let moved = moved.map(|(j, x)| x + t * self.along(k, j) / spread);
        self.at.sum(&moved.collect::<Vec<_>>(), &self.tested) - self.tested.base
    }

    /// Returns the rise that the quadratic model predicts, or that of a few deviations for almost
    /// no curvature.
    fn predicted(&self, k: usize, t: f64) -> f64 {
        let s = self.at.deviation();
        let share = (t / (PROBE_DEVIATIONS * self.deviation(k)))
            .min(1.0)
            .powi(2);
        (t * t / self.spread(k))
            .max(s * s * PROBE_DEVIATIONS * PROBE_DEVIATIONS * 0.25 * share)
            .max(s * s)
    }
}

/// Adds a group of open variables to others, and joins groups that share a variable.
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

/// Returns the flat variable with the largest deviation; the first one among equals.
fn freest(flats: &[Option<FlatDirection>]) -> Option<(usize, FlatDirection)> {
    let all = flats.iter().enumerate();
    all.filter_map(|(k, flat)| Some((k, (*flat)?)))
        .max_by(|a, b| {
            let by_deviation = a.1.deviation.total_cmp(&b.1.deviation);
            by_deviation.then(b.0.cmp(&a.0))
        })
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
