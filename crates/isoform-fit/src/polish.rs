//! The last stage: a residual close to a distance on all points, first the metric reading, which is
//! cheap, then the distance itself.
//!
//! Least squares where residuals look like noise; otherwise iteratively reweighted least squares,
//! Cauchy's loss first (it has one minimum) and Tukey's biweight then (it forgets gross outliers),
//! the scale from the median absolute residual. Each level starts from the one before, so that all
//! points are seen a few times only.

use crate::objective::{Residuals, values};
use crate::outliers::median;
use crate::search::Step;
use crate::space::Space;
use crate::{Control, Loss, Objective, lm};
use isoform_geom::{ParamField, Point3};

/// Cauchy's constant: 95 % efficiency for Gaussian noise.
const CAUCHY: f64 = 2.385;
/// Tukey's constant: 95 % efficiency.
const TUKEY: f64 = 4.685;
/// Share of residuals beyond 4.5 robust deviations (7e-6 for Gaussian noise) from which tails count
/// as heavy.
const HEAVY: f64 = 0.005;
/// A robust scale below this share of the data's size is rounding, not noise.
const ROUNDING: f64 = 1e-11;

/// State of the polish on some points.
pub(crate) struct Polished {
    pub(crate) x: Vec<f64>,
    pub(crate) weights: Vec<f64>,
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
        let mut a = vec![0.0; self.field.dim()];
        self.space.parameters_at(x, &mut a);
        let mut r = vec![0.0; points.len()];
        values(self.field, points, &a, &mut r);
        r
    }

    /// 1.4826 times the median absolute residual.
    pub(crate) fn scale(r: &[f64]) -> f64 {
        let mut v: Vec<f64> = r
            .iter()
            .map(|r| r.abs())
            .filter(|r| r.is_finite())
            .collect();
        1.4826 * median(&mut v)
    }

    /// Cauchy's loss from x, the scale falling with the fit: a rough robust fit for few points. The
    /// result says in `loss` what the residuals call for.
    pub(crate) fn rough(&self, points: &[Point3], x: Vec<f64>, has_outliers: bool) -> Polished {
        let mut p = self.reweighted(points, &[], x, Loss::Cauchy, 4);
        let r = self.residuals(points, &p.x);
        p.scale = Self::scale(&r);
        let beyond =
            r.iter().filter(|r| r.abs() > 4.5 * p.scale).count() as f64 / r.len().max(1) as f64;
        let heavy = p.scale > ROUNDING * self.size && (has_outliers || beyond > HEAVY);
        p.loss = if heavy { Loss::Tukey } else { Loss::Squares };
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
            return self.reweighted(points, mask, x, loss, rounds);
        }
        self.descend(points, mask, x, 12)
    }

    /// At most `most` evaluations with given weights.
    fn descend(&self, points: &[Point3], weights: &[f64], x: Vec<f64>, most: usize) -> Polished {
        let mut history = Vec::new();
        let count = points.len().max(1) as f64;
        let mut objective = Held {
            inner: Residuals::new(self.field, points, weights, self.space),
            held: &self.held,
        };
        // 1e-4 / n of the sum is a hundredth of a standard deviation of the parameters.
        let settings = lm::Options {
            max_iterations: most,
            decrease: 1e-4 / count,
            radius: 1.0,
            ..lm::Options::default()
        };
        let m = lm::minimize(
            &mut objective,
            x,
            &self.space.lo,
            &self.space.hi,
            &settings,
            &mut |iteration, _, value| {
                history.push(Step {
                    start: self.start,
                    iteration,
                    rms: (value / count).sqrt(),
                });
                !self.control.is_stopped()
            },
        );
        Polished {
            x: m.x,
            weights: weights.to_vec(),
            scale: 0.0,
            loss: Loss::Squares,
            normal: m.normal,
            evaluations: m.iterations,
            history,
        }
    }

    fn reweighted(
        &self,
        points: &[Point3],
        mask: &[f64],
        x: Vec<f64>,
        loss: Loss,
        rounds: usize,
    ) -> Polished {
        let mut out = Polished {
            x,
            weights: Vec::new(),
            scale: 0.0,
            loss,
            normal: None,
            evaluations: 0,
            history: Vec::new(),
        };
        for round in 0..rounds {
            let r = self.residuals(points, &out.x);
            // The scale follows the fit at first; frozen later, so that the rounds have something
            // to converge to.
            if round < 3 {
                out.scale = Self::scale(&r).max(ROUNDING * self.size);
            }
            out.weights = r.iter().map(|r| weight(loss, r / out.scale)).collect();
            out.weights.iter_mut().zip(mask).for_each(|(w, m)| *w *= m);
            let weights = std::mem::take(&mut out.weights);
            let p = self.descend(points, &weights, out.x.clone(), 2);
            out.weights = weights;
            let moved =
                p.x.iter()
                    .zip(&out.x)
                    .map(|(u, v)| (u - v).abs())
                    .fold(0.0, f64::max);
            out.evaluations += p.evaluations;
            out.history.extend(p.history.last().cloned());
            out.x = p.x;
            // A small share of a standard deviation of the best known parameter.
            let small = 0.05 * out.scale / (self.size * (points.len() as f64).sqrt());
            if (round >= 3 && moved < small) || self.control.is_stopped() {
                break;
            }
        }
        out
    }
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
