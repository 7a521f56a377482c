//! The last stage: a residual close to a distance on all points, first the metric reading, which is
//! cheap, then the distance itself.
//!
//! Least squares where residuals look like noise; otherwise iteratively reweighted least squares,
//! Cauchy's loss first (it has one minimum) and Tukey's biweight then (it forgets gross outliers),
//! the scale from the median absolute residual. Each level starts from the one before, so that all
//! points are seen a few times only.

use crate::objective::{Residuals, values};
use crate::outliers::robust_deviation;
use crate::search::Step;
use crate::space::Space;
use crate::vector::distance;
use crate::{Control, Loss, Objective, lm};
use isoform_geom::{ParamField, Point3};

/// Cauchy's constant: 95 % efficiency for Gaussian noise.
const CAUCHY: f64 = 2.385;
/// Tukey's constant: 95 % efficiency.
const TUKEY: f64 = 4.685;
/// Residuals beyond this many robust deviations are in the tails: 7e-6 of Gaussian noise.
const TAIL: f64 = 4.5;
/// Share of residuals in the tails from which these count as heavy.
const HEAVY: f64 = 0.005;
/// A robust scale below this share of the data's size is rounding, not noise.
const ROUNDING: f64 = 1e-11;
/// A round of least squares ends when a step lowers the sum by less than this over the number of
/// points, as a share: a hundredth of a standard deviation of the parameters.
const DECREASE: f64 = 1e-4;
/// Evaluations of one round of least squares, at most.
const MOST_EVALUATIONS: usize = 12;
/// Rounds of reweighting of a rough fit.
const ROUGH_ROUNDS: usize = 4;
/// Rounds of reweighting whose scale follows the fit.
const FREE_ROUNDS: usize = 3;
/// Rounds of reweighting end when no variable moves by this share of a standard deviation of the
/// best known parameter.
const SETTLED: f64 = 0.05;

/// State of the polish on some points.
pub(crate) struct Polished {
    pub(crate) x: Vec<f64>,
    /// Robust standard deviation of the residuals; 0 after least squares.
    pub(crate) scale: f64,
    pub(crate) loss: Loss,
    /// The matrix Jᵀ W J there; none after rounds of other weights.
    pub(crate) normal: Option<Vec<f64>>,
    pub(crate) evaluations: usize,
    pub(crate) history: Vec<Step>,
}

/// What the polish works on.
pub(crate) struct Polish<'a> {
    pub(crate) field: &'a dyn ParamField,
    pub(crate) space: &'a Space,
    /// Size of the data, for what counts as rounding.
    pub(crate) size: f64,
    pub(crate) control: &'a Control<'a>,
    /// Number of the polish in the history.
    pub(crate) start: usize,
    /// Variables that stay where they are.
    pub(crate) held: Vec<bool>,
}

/// An objective some of whose variables stay where they are.
struct Held<'a> {
    inner: Residuals<'a>,
    held: &'a [bool],
}

impl Objective for Held<'_> {
    fn dim(&self) -> usize {
        self.inner.dim()
    }
    fn value(&mut self, x: &[f64]) -> f64 {
        self.inner.value(x)
    }
    fn model(&mut self, x: &[f64], g: &mut [f64], h: &mut [f64]) -> f64 {
        let value = self.inner.model(x, g, h);
        let n = g.len();
        for k in (0..n).filter(|&k| self.held[k]) {
            g[k] = 0.0;
            for j in 0..n {
                h[k * n + j] = 0.0;
                h[j * n + k] = 0.0;
            }
            h[k * n + k] = 1.0;
        }
        value
    }
    fn step_limit(&self, x: &[f64], p: &[f64]) -> f64 {
        self.inner.step_limit(x, p)
    }
}

impl Polish<'_> {
    /// Residuals at x.
    pub(crate) fn residuals(&self, points: &[Point3], x: &[f64]) -> Vec<f64> {
        let mut r = vec![0.0; points.len()];
        values(self.field, points, &self.space.parameters(x), &mut r);
        r
    }

    /// Robust standard deviation of residuals, what is no number left out.
    pub(crate) fn scale(r: &[f64]) -> f64 {
        let off = r.iter().map(|r| r.abs());
        let mut finite: Vec<f64> = off.filter(|r| r.is_finite()).collect();
        robust_deviation(&mut finite)
    }

    /// Cauchy's loss from x, the scale falling with the fit: a rough robust fit for few points. The
    /// result says in `loss` what the residuals call for.
    pub(crate) fn rough(&self, points: &[Point3], x: Vec<f64>, has_outliers: bool) -> Polished {
        let mut p = self.reweighted(points, &[], x, Loss::Cauchy, ROUGH_ROUNDS);
        let r = self.residuals(points, &p.x);
        p.scale = Self::scale(&r);
        let beyond = r.iter().filter(|r| r.abs() > TAIL * p.scale).count();
        let is_heavy = has_outliers || beyond as f64 / r.len().max(1) as f64 > HEAVY;
        p.loss = if p.scale > ROUNDING * self.size && is_heavy {
            Loss::Tukey
        } else {
            Loss::Squares
        };
        p
    }

    /// The fit with the given loss, to convergence; `mask` (empty or 0 and 1) leaves points out.
    pub(crate) fn fine(
        &self,
        points: &[Point3],
        mask: &[f64],
        x: Vec<f64>,
        loss: Loss,
        rounds: usize,
    ) -> Polished {
        if loss.is_robust() {
            self.reweighted(points, mask, x, loss, rounds)
        } else {
            self.descend(points, mask, x, MOST_EVALUATIONS)
        }
    }

    /// At most `most` evaluations with given weights.
    fn descend(&self, points: &[Point3], weights: &[f64], x: Vec<f64>, most: usize) -> Polished {
        let mut history = Vec::new();
        let count = points.len().max(1) as f64;
        let mut objective = Held {
            inner: Residuals::new(self.field, points, weights, self.space),
            held: &self.held,
        };
        let mut monitor = |iteration: usize, _: &[f64], value: f64| {
            history.push(Step::new(self.start, iteration, value, count));
            !self.control.is_stopped()
        };
        let settings = lm::Options {
            max_iterations: most,
            decrease: DECREASE / count,
            radius: 1.0,
            ..lm::Options::default()
        };
        let m = self
            .space
            .minimize(&mut objective, x, &settings, &mut monitor);
        Polished {
            normal: m.normal,
            evaluations: m.iterations,
            history,
            ..Polished::new(m.x, Loss::Squares)
        }
    }

    /// Rounds of least squares, each with weights by the residuals of the one before.
    fn reweighted(
        &self,
        points: &[Point3],
        mask: &[f64],
        x: Vec<f64>,
        loss: Loss,
        rounds: usize,
    ) -> Polished {
        let mut out = Polished::new(x, loss);
        for round in 0..rounds {
            let r = self.residuals(points, &out.x);
            // The scale follows the fit at first; it is frozen later, so that the rounds have
            // something to converge to.
            if round < FREE_ROUNDS {
                out.scale = Self::scale(&r).max(ROUNDING * self.size);
            }
            let weights = weights(&r, out.scale, loss, mask);
            let moved = out.take(self.descend(points, &weights, out.x.clone(), 2));
            let small = SETTLED * out.scale / (self.size * (points.len() as f64).sqrt());
            if (round >= FREE_ROUNDS && moved < small) || self.control.is_stopped() {
                break;
            }
        }
        out
    }
}

impl Polished {
    /// Nothing done yet.
    fn new(x: Vec<f64>, loss: Loss) -> Self {
        Self {
            x,
            scale: 0.0,
            loss,
            normal: None,
            evaluations: 0,
            history: Vec::new(),
        }
    }

    /// Takes a round of reweighting; the largest move of a variable.
    fn take(&mut self, round: Self) -> f64 {
        let moved = distance(&round.x, &self.x);
        self.evaluations += round.evaluations;
        self.history.extend(round.history.last().cloned());
        self.x = round.x;
        moved
    }
}

/// Weights of residuals in a loss of this scale; 0 where the mask is.
fn weights(r: &[f64], scale: f64, loss: Loss, mask: &[f64]) -> Vec<f64> {
    let mut weights: Vec<f64> = r.iter().map(|r| weight(loss, r / scale)).collect();
    weights.iter_mut().zip(mask).for_each(|(w, m)| *w *= m);
    weights
}

/// Weight of a residual of z deviations: ψ(z)/z.
pub(crate) fn weight(loss: Loss, z: f64) -> f64 {
    match loss {
        Loss::Squares | Loss::Auto => 1.0,
        Loss::Cauchy => 1.0 / (1.0 + (z / CAUCHY).powi(2)),
        Loss::Tukey => {
            let t = 1.0 - (z / TUKEY).powi(2);
            if t > 0.0 { t * t } else { 0.0 }
        }
    }
}

/// ψ′(z).
pub(crate) fn slope(loss: Loss, z: f64) -> f64 {
    match loss {
        Loss::Squares | Loss::Auto => 1.0,
        Loss::Cauchy => {
            let t = (z / CAUCHY).powi(2);
            (1.0 - t) / (1.0 + t).powi(2)
        }
        Loss::Tukey => {
            let t = (z / TUKEY).powi(2);
            if t < 1.0 {
                (1.0 - t) * (1.0 - 5.0 * t)
            } else {
                0.0
            }
        }
    }
}
