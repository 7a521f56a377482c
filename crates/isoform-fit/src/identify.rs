//! What the data say about each parameter, and what they leave open.
//!
//! The covariance is s² (JᵀJ)⁻¹ of the metric residual, for robust losses the sandwich. That is
//! local, and a face which no point supports can look determined by the few noisy points of its
//! neighbours' rims that happen to touch it. Therefore each parameter is also moved by ten of its
//! standard deviations, the others following along the valley: where the sum of squares does not
//! rise by a fair share of what the quadratic model says, on either side, the parameter is open.

use crate::Loss;
use crate::objective::{normal_equations, sum_of_squares};
use crate::polish::{slope, weight};
use crate::space::Space;
use isoform_geom::{ParamField, Point3};
use isoform_num::linalg::{cholesky, cholesky_solve};

/// Standard deviations that a parameter is moved by.
const MOVE: f64 = 10.0;
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

/// Points that stand for all.
struct Tested {
    points: Vec<Point3>,
    weights: Vec<f64>,
    /// Points that each stands for.
    share: f64,
    /// Their weighted sum of squares at the fit.
    base: f64,
}

/// Uncertainty of the variables.
pub(crate) struct Knowledge {
    /// Open variables: each group lies along one direction.
    pub(crate) open: Vec<Vec<usize>>,
    /// For each group the variable to hold and the direction, scaled to 1 there, with the sense
    /// (±1) in which nothing is lost.
    pub(crate) directions: Vec<(usize, Vec<f64>, f64)>,
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
    /// Points that stand for all where a variable is moved: that many, spread over them.
    pub(crate) tested: usize,
}

impl At<'_> {
    fn normal(&self, points: &[Point3], weights: &[f64]) -> Vec<f64> {
        let (n, m) = (self.field.dim(), self.space.len());
        let (mut a, mut ga, mut ha) = (vec![0.0; n], vec![0.0; n], vec![0.0; n * n]);
        let (mut g, mut h) = (vec![0.0; m], vec![0.0; m * m]);
        self.space.parameters_at(self.x, &mut a);
        normal_equations(self.field, points, weights, &a, &mut ga, &mut ha);
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
        let every = |v: &[f64]| v.iter().copied().step_by(step).collect::<Vec<_>>();
        let points: Vec<Point3> = self.points.iter().copied().step_by(step).collect();
        let share = self.points.len() as f64 / points.len().max(1) as f64;
        let mut tested = Tested {
            points,
            weights: every(weights),
            share,
            base: 0.0,
        };
        tested.base = self.sum(self.x, &tested);
        tested
    }

    /// Sum of squares after a move.
    fn sum(&self, x: &[f64], tested: &Tested) -> f64 {
        let mut a = vec![0.0; self.field.dim()];
        self.space.parameters_at(x, &mut a);
        tested.share * sum_of_squares(self.field, &tested.points, &tested.weights, &a)
    }

    /// Open directions and the covariance of what is determined. Only variables that `suspect`
    /// names, or that are weak, are moved: each move costs two sums over the points.
    /// `normal` is the matrix of the normal equations, if it is known.
    pub(crate) fn knowledge(
        &self,
        suspect: &dyn Fn(usize) -> bool,
        normal: Option<Vec<f64>>,
    ) -> Knowledge {
        let m = self.space.len();
        let s = self.scale.max(self.least_scale);
        let weights = self.masked(|r| weight(self.loss, r / s));
        let h = normal.unwrap_or_else(|| self.normal(self.points, &weights));
        let largest = (0..m).map(|i| h[i * m + i]).fold(0.0, f64::max);
        let mut held = vec![false; m];
        let mut open: Vec<Vec<usize>> = Vec::new();
        let mut directions = Vec::new();
        let tested = self.tested(&weights);
        let mut flat_at_first: Option<Vec<bool>> = None;
        loop {
            let inverse = inverse(&h, m, &held, NO_CURVATURE * largest);
            let tests: Vec<Option<(f64, f64)>> = (0..m)
                .map(|k| {
                    let spread = inverse[k * m + k];
                    let deviation = s * spread.sqrt();
                    let is_blind = h[k * m + k] < NO_CURVATURE * largest;
                    let is_weak = is_blind || deviation.is_nan() || deviation >= SURE;
                    if held[k] || !(is_weak || suspect(k)) {
                        None
                    } else {
                        self.flatness(k, &inverse, s, &tested)
                    }
                })
                .collect();
            let first =
                flat_at_first.get_or_insert_with(|| tests.iter().map(Option::is_some).collect());
            // The freest first.
            let Some((k, sense)) = (0..m)
                .filter_map(|k| tests[k].map(|t| (k, t)))
                .max_by(|a, b| a.1.1.total_cmp(&b.1.1).then(b.0.cmp(&a.0)))
                .map(|(k, t)| (k, t.0))
            else {
                break;
            };
            let spread = inverse[k * m + k];
            let direction: Vec<f64> = (0..m)
                .map(|j| {
                    if held[j] {
                        0.0
                    } else {
                        inverse[j * m + k] / spread
                    }
                })
                .collect();
            let group: Vec<usize> = (0..m)
                .filter(|&j| j == k || (first[j] && direction[j].abs() > SHARE))
                .collect();
            held[k] = true;
            // Groups that share a variable are one statement.
            if let Some(known) = open
                .iter_mut()
                .find(|g| g.iter().any(|j| group.contains(j)))
            {
                known.extend(
                    group
                        .iter()
                        .filter(|j| !known.contains(j))
                        .copied()
                        .collect::<Vec<_>>(),
                );
                known.sort_unstable();
            } else {
                open.push(group);
            }
            directions.push((k, direction, sense));
        }
        Knowledge {
            open,
            directions,
            normal: h,
        }
    }

    /// If moving variable k costs next to nothing: the sense that costs least, and the variable's
    /// deviation.
    fn flatness(&self, k: usize, inverse: &[f64], s: f64, tested: &Tested) -> Option<(f64, f64)> {
        let m = self.space.len();
        let spread = inverse[k * m + k];
        if !(spread > 0.0 && spread.is_finite()) {
            return Some((1.0, f64::INFINITY));
        }
        let deviation = s * spread.sqrt();
        let mut worst = (1.0, f64::INFINITY);
        for sense in [1.0, -1.0] {
            // No farther than half of the range: an open direction is as flat there. A bound in the
            // way shortens the move.
            let mut t: f64 = (MOVE * deviation)
                .min(0.5 * (self.space.hi[k] - self.space.lo[k]))
                .min(0.5);
            for j in 0..m {
                let by = sense * inverse[j * m + k] / spread;
                let gap = if by > 0.0 {
                    self.space.hi[j] - self.x[j]
                } else {
                    self.x[j] - self.space.lo[j]
                };
                if by.abs() > 0.0 {
                    t = t.min(gap / by.abs());
                }
            }
            if t < 2.0 * deviation && deviation < 0.2 {
                continue; // at a bound: nothing can be said on this side
            }
            let x: Vec<f64> = (0..m)
                .map(|j| self.x[j] + sense * t * inverse[j * m + k] / spread)
                .collect();
            let rise = self.sum(&x, tested) - tested.base;
            // For next to no curvature the prediction itself is next to nothing; then a fair rise
            // is one of a few deviations.
            let predicted = (t * t / spread)
                .max(s * s * MOVE * MOVE * 0.25 * (t / (MOVE * deviation)).min(1.0).powi(2))
                .max(s * s);
            let ratio = rise / predicted;
            if ratio < worst.1 || ratio.is_nan() {
                worst = (
                    sense,
                    if ratio.is_nan() {
                        f64::NEG_INFINITY
                    } else {
                        ratio
                    },
                );
            }
        }
        (worst.1 < RISE).then_some((worst.0, deviation))
    }

    /// Covariance of the variables that are not held, for independent residuals, and the inverse of
    /// their normal matrix.
    /// `normal` is the matrix of [`Knowledge`] if that was asked at this very fit.
    pub(crate) fn covariance_without(
        &self,
        held: &[bool],
        normal: Option<&[f64]>,
    ) -> (Vec<f64>, Vec<f64>) {
        let m = self.space.len();
        let robust = self.loss.is_robust();
        let s = self.scale.max(self.least_scale);
        let h = normal.map_or_else(
            || {
                let weights = self.masked(|r| weight(self.loss, r / s));
                self.normal(self.points, &weights)
            },
            <[f64]>::to_vec,
        );
        let largest = (0..m).map(|i| h[i * m + i]).fold(0.0, f64::max);
        self.covariance(&h, held, robust, s, largest)
    }

    fn covariance(
        &self,
        h: &[f64],
        held: &[bool],
        robust: bool,
        s: f64,
        largest: f64,
    ) -> (Vec<f64>, Vec<f64>) {
        let m = self.space.len();
        let free = held.iter().filter(|v| !**v).count();
        let n = if self.mask.is_empty() {
            self.residuals.len()
        } else {
            self.mask.iter().filter(|m| **m > 0.0).count()
        };
        let degrees = (n as f64 - free as f64).max(1.0);
        let floor = NO_CURVATURE * largest;
        if !robust {
            let used = self
                .residuals
                .iter()
                .enumerate()
                .filter(|(i, r)| r.is_finite() && self.mask.get(*i) != Some(&0.0));
            let sum: f64 = used.map(|(_, r)| r * r).sum();
            let c = inverse(h, m, held, floor);
            let variance = (sum / degrees).max(self.least_scale.powi(2));
            return (c.iter().map(|v| v * variance).collect(), c);
        }
        // The sandwich: A⁻¹ B A⁻¹ with A = Σ ψ′ J Jᵀ and B = Σ ψ² J Jᵀ.
        let slopes = self.masked(|r| slope(self.loss, r / s));
        // Points that the model meets exactly are still known to rounding only.
        let least = (s * s - self.scale * self.scale).max(0.0);
        let squares = self.masked(|r| weight(self.loss, r / s).powi(2) * (r * r + least));
        // Negative weights mean nothing to normal equations that take their roots: two sums.
        let plus: Vec<f64> = slopes.iter().map(|v| v.max(0.0)).collect();
        let minus: Vec<f64> = slopes.iter().map(|v| (-v).max(0.0)).collect();
        let mut a = self.normal(self.points, &plus);
        a.iter_mut()
            .zip(self.normal(self.points, &minus))
            .for_each(|(p, q)| *p -= q);
        let b = self.normal(self.points, &squares);
        // Where the slopes do not make a positive matrix (few points, gross misfit), the weights
        // do.
        let sound = {
            let mut t = a.clone();
            (0..m).for_each(|i| t[i * m + i] += floor);
            cholesky(&mut t, m)
        };
        let c = inverse(if sound { &a } else { h }, m, held, floor);
        let cb = product(&c, &b, m);
        let mut out = product(&cb, &c, m);
        let share = n as f64 / degrees;
        out.iter_mut().for_each(|v| *v *= share);
        (out, c)
    }
}

/// Inverse of h + floor I without the rows that are held (those are nought).
pub(crate) fn inverse(h: &[f64], m: usize, held: &[bool], floor: f64) -> Vec<f64> {
    let free: Vec<usize> = (0..m).filter(|&i| !held[i]).collect();
    let k = free.len();
    let mut l = vec![0.0; k * k];
    let mut floor = floor.max(f64::MIN_POSITIVE);
    loop {
        for (r, &i) in free.iter().enumerate() {
            for (c, &j) in free.iter().enumerate() {
                l[r * k + c] = h[i * m + j];
            }
            l[r * k + r] += floor;
        }
        if cholesky(&mut l, k) || !floor.is_finite() {
            break;
        }
        floor *= 10.0;
    }
    let mut out = vec![0.0; m * m];
    for (c, &j) in free.iter().enumerate() {
        let mut e = vec![0.0; k];
        e[c] = 1.0;
        cholesky_solve(&l, k, &mut e);
        for (r, &i) in free.iter().enumerate() {
            out[i * m + j] = e[r];
        }
    }
    out
}

pub(crate) fn product(a: &[f64], b: &[f64], m: usize) -> Vec<f64> {
    let mut c = vec![0.0; m * m];
    for i in 0..m {
        for k in 0..m {
            for j in 0..m {
                c[i * m + j] += a[i * m + k] * b[k * m + j];
            }
        }
    }
    c
}

/// Half width of a 95 % interval in standard deviations: Student's t with the given degrees of
/// freedom.
pub(crate) fn student95(degrees: f64) -> f64 {
    const Z: f64 = 1.959_963_984_540_054;
    let v = degrees.max(1.0);
    if v < 3.0 {
        return if v < 2.0 { 12.706 } else { 4.303 };
    }
    // Cornish-Fisher, good to 1e-3 from 4 degrees on.
    let z2 = Z * Z;
    Z + Z * (z2 + 1.0) / (4.0 * v)
        + Z * ((5.0 * z2 + 16.0) * z2 + 3.0) / (96.0 * v * v)
        + Z * (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / (384.0 * v * v * v)
}
