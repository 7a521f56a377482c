//! The last stage: a residual close to a distance on all points; first the metric reading, which is
//! cheap, then the distance itself.
//!
//! Least squares if residuals look like noise; otherwise iteratively reweighted least squares,
//! first with Cauchy's loss (which has one minimum), then with Tukey's biweight (which ignores
//! gross outliers), with the scale from the median absolute residual. Each level starts from the
//! previous one, so that sums over all points are needed a few times only.

use crate::deviation::newton_step;
use crate::outliers::robust_deviation;
use crate::residuals::{Residuals, values};
use crate::search::ConvergenceStep;
use crate::space::Space;
use crate::vector::{distance, is_finite};
use crate::{Control, Loss, Objective, lm};
use isoform_geom::{ParamField, Point3};

/// Tuning constant of Cauchy's loss, for 95 % efficiency with Gaussian noise.
const CAUCHY_TUNING: f64 = 2.385;
/// Tuning constant of Tukey's biweight, for 95 % efficiency with Gaussian noise.
const TUKEY_TUNING: f64 = 4.685;
/// Robust scale, as a share of the data's size, below which residuals are rounding, not noise.
const ROUNDING_SHARE: f64 = 1e-11;
/// Number of rounds of reweighting in which the scale follows the fit.
const FREE_SCALE_ROUNDS: usize = 3;

/// Result of the polish on some points.
pub(crate) struct PolishResult {
    pub(crate) x: Vec<f64>,
    /// Robust standard deviation of the residuals; 0 after least squares.
    pub(crate) scale: f64,
    pub(crate) loss: Loss,
    /// Matrix Jᵀ W J there; `None` after rounds with other weights.
    pub(crate) normal: Option<Vec<f64>>,
    pub(crate) evaluations: usize,
    pub(crate) history: Vec<ConvergenceStep>,
}

/// Settings of a polish.
pub(crate) struct Polish<'a> {
    pub(crate) field: &'a dyn ParamField,
    pub(crate) space: &'a Space,
    /// Size of the data, relative to which rounding is judged.
    pub(crate) size: f64,
    pub(crate) control: &'a Control<'a>,
    /// Number of the polish in the history.
    pub(crate) start: usize,
    /// Flags of the variables that are held.
    pub(crate) held: Vec<bool>,
}

/// Points over which a polish sums: in memory, or in chunks.
pub(crate) trait PolishSums {
    /// Returns the number of points.
    fn count(&self) -> usize;
    /// Returns Σ r².
    fn squares(&self) -> Box<dyn Objective + '_>;
    /// Returns Σ w r² with the weights of a loss by the residuals at x, and the scale of that loss.
    /// `scale` computes it from the residuals' robust deviation, which is passed if `is_free`.
    fn reweighted(
        &self,
        x: &[f64],
        loss: Loss,
        scale: &dyn Fn(Option<f64>) -> f64,
        is_free: bool,
    ) -> (f64, Box<dyn Objective + '_>);
    /// Returns Σ of Tukey's loss at two points with one scale, the larger of their robust
    /// deviations.
    fn losses(&self, places: [&[f64]; 2]) -> [f64; 2];
}

/// Points in memory.
pub(crate) struct InMemorySums<'a> {
    pub(crate) field: &'a dyn ParamField,
    pub(crate) space: &'a Space,
    pub(crate) points: &'a [Point3],
    /// Empty, or 0 for points that are left out and 1 for others.
    pub(crate) mask: &'a [f64],
}

impl InMemorySums<'_> {
    fn residuals(&self, x: &[f64]) -> Vec<f64> {
        let mut r = vec![0.0; self.points.len()];
        values(self.field, self.points, &self.space.parameters(x), &mut r);
        r
    }
}

impl PolishSums for InMemorySums<'_> {
    fn count(&self) -> usize {
        self.points.len()
    }
    fn squares(&self) -> Box<dyn Objective + '_> {
        let Self {
            field,
            points,
            mask,
            space,
        } = *self;
        Box::new(Residuals::new(field, points, mask, space))
    }
    fn reweighted(
        &self,
        x: &[f64],
        loss: Loss,
        scale: &dyn Fn(Option<f64>) -> f64,
        is_free: bool,
    ) -> (f64, Box<dyn Objective + '_>) {
        let r = self.residuals(x);
        let scale = scale(is_free.then(|| Polish::scale(&r)));
        let weights = weights(&r, scale, loss, self.mask);
        let sum = Residuals::weighted(self.field, self.points, weights, self.space);
        (scale, Box::new(sum))
    }
    fn losses(&self, places: [&[f64]; 2]) -> [f64; 2] {
        let [before, after] = places.map(|x| self.residuals(x));
        let scale = Polish::scale(&after).max(Polish::scale(&before));
        [before, after].map(|r| tukey_sum(&r, self.mask, scale))
    }
}

/// An objective with some variables held.
struct HeldObjective<'a> {
    inner: Box<dyn Objective + 'a>,
    held: &'a [bool],
}

impl Objective for HeldObjective<'_> {
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
    /// Returns the residuals at x.
    pub(crate) fn residuals(&self, points: &[Point3], x: &[f64]) -> Vec<f64> {
        let mut r = vec![0.0; points.len()];
        values(self.field, points, &self.space.parameters(x), &mut r);
        r
    }

    /// Returns the feet of points on the surface f(·, a) = 0, to first order: p − f ∇f/|∇f|². A
    /// point whose foot is not finite is its own foot.
    pub(crate) fn feet(&self, points: &[Point3], x: &[f64]) -> Vec<Point3> {
        let (mut f, mut rows) = (vec![0.0; points.len()], vec![[0.0; 3]; points.len()]);
        let a = self.space.parameters(x);
        self.field.gradients(points, &a, &mut f, &mut rows);
        let foot = |((p, f), g): ((&Point3, &f64), &Point3)| {
            let mut at = *p;
            newton_step(&mut at, *f, *g);
            if is_finite(&at) { at } else { *p }
        };
        points.iter().zip(&f).zip(&rows).map(foot).collect()
    }

    /// Returns the robust standard deviation of finite residuals.
    pub(crate) fn scale(r: &[f64]) -> f64 {
        let off = r.iter().map(|r| r.abs());
        let mut finite: Vec<f64> = off.filter(|r| r.is_finite()).collect();
        robust_deviation(&mut finite)
    }

    /// Minimises Cauchy's loss from x, with a scale that follows the fit: a rough robust fit for
    /// few points. `loss` of the result is the loss that suits the residuals.
    pub(crate) fn rough(&self, points: &[Point3], x: Vec<f64>, has_outliers: bool) -> PolishResult {
        let here = self.here(points, &[]);
        let mut p = self.reweighted(&here, x, Loss::Cauchy, 4);
        let r = self.residuals(points, &p.x);
        p.scale = Self::scale(&r);
        // Gaussian noise exceeds 4.5 deviations with probability 7e-6.
        let beyond = r.iter().filter(|r| r.abs() > 4.5 * p.scale).count();
        let is_heavy = has_outliers || beyond as f64 / r.len().max(1) as f64 > 0.005;
        p.loss = if p.scale > ROUNDING_SHARE * self.size && is_heavy {
            Loss::Tukey
        } else {
            Loss::Squares
        };
        p
    }

    /// Makes the sums over points in memory; `mask` (empty or 0 and 1) leaves points out.
    pub(crate) fn here<'b>(&'b self, points: &'b [Point3], mask: &'b [f64]) -> InMemorySums<'b> {
        InMemorySums {
            field: self.field,
            space: self.space,
            points,
            mask,
        }
    }

    /// Fits with the given loss, to convergence.
    pub(crate) fn fine(
        &self,
        points: &dyn PolishSums,
        x: Vec<f64>,
        loss: Loss,
        rounds: usize,
    ) -> PolishResult {
        if loss.is_robust() {
            self.reweighted(points, x, loss, rounds)
        } else {
            self.descend(points.squares(), points.count(), x, 12)
        }
    }

    /// Fits exact points, some of which lie on faces that the field lacks: by Cauchy's loss, with a
    /// scale that falls by decades from the root mean square to the rounding (graduated
    /// non-convexity). At the scale of the rounding alone, faces that are off by more would have no
    /// weight.
    pub(crate) fn narrowed(
        &self,
        points: &dyn PolishSums,
        x: Vec<f64>,
        rounding: f64,
    ) -> PolishResult {
        let mut out = PolishResult::new(x, Loss::Cauchy);
        let squares = points.squares().value(&out.x);
        out.scale = (squares / points.count().max(1) as f64).sqrt();
        loop {
            let scale = out.scale;
            let (_, sum) = points.reweighted(&out.x, out.loss, &|_| scale, false);
            out.take(self.descend(sum, points.count(), out.x.clone(), 3));
            if scale <= rounding || scale.is_nan() || self.control.is_stopped() {
                return out;
            }
            out.scale = (0.1 * scale).max(rounding);
        }
    }

    /// Minimises a sum over `count` points with at most `most` evaluations.
    fn descend(
        &self,
        sum: Box<dyn Objective + '_>,
        count: usize,
        x: Vec<f64>,
        most: usize,
    ) -> PolishResult {
        let mut history = Vec::new();
        let count = count.max(1) as f64;
        let mut objective = HeldObjective {
            inner: sum,
            held: &self.held,
        };
        let mut monitor = |iteration: usize, _: &[f64], value: f64| {
            history.push(ConvergenceStep::new(self.start, iteration, value, count));
            !self.control.is_stopped()
        };
        let settings = lm::LmOptions {
            max_iterations: most,
            // A hundredth of a standard deviation of the parameters.
            decrease: 1e-4 / count,
            radius: 1.0,
            ..lm::LmOptions::default()
        };
        let m = self
            .space
            .minimize(&mut objective, x, &settings, &mut monitor);
        PolishResult {
            normal: m.normal,
            evaluations: m.iterations,
            history,
            ..PolishResult::new(m.x, Loss::Squares)
        }
    }

    /// Runs rounds of least squares, each with weights by the residuals of the previous one.
    fn reweighted(
        &self,
        points: &dyn PolishSums,
        x: Vec<f64>,
        loss: Loss,
        rounds: usize,
    ) -> PolishResult {
        let mut out = PolishResult::new(x, loss);
        for round in 0..rounds {
            // The scale follows the fit at first and is frozen later, so that the rounds converge.
            let frozen = out.scale;
            let scale =
                |seen: Option<f64>| seen.map_or(frozen, |s| s.max(ROUNDING_SHARE * self.size));
            let is_free = round < FREE_SCALE_ROUNDS;
            let (scale, sum) = points.reweighted(&out.x, loss, &scale, is_free);
            out.scale = scale;
            let moved = out.take(self.descend(sum, points.count(), out.x.clone(), 2));
            // Below a share of a standard deviation of the best known parameter.
            let small = 0.05 * out.scale / (self.size * (points.count() as f64).sqrt());
            if (round >= FREE_SCALE_ROUNDS && moved < small) || self.control.is_stopped() {
                break;
            }
        }
        out
    }
}

impl PolishResult {
    /// Makes a result without any evaluation.
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

    /// Takes over a round of reweighting. Returns the largest move of a variable.
    fn take(&mut self, round: Self) -> f64 {
        let moved = distance(&round.x, &self.x);
        self.evaluations += round.evaluations;
        self.history.extend(round.history.last().cloned());
        self.x = round.x;
        moved
    }
}

/// Returns the weights of residuals in a loss of this scale; 0 for masked points.
pub(crate) fn weights(r: &[f64], scale: f64, loss: Loss, mask: &[f64]) -> Vec<f64> {
    let mut weights: Vec<f64> = r.iter().map(|r| weight(loss, r / scale)).collect();
    weights.iter_mut().zip(mask).for_each(|(w, m)| *w *= m);
    weights
}

/// Returns Σ ρ(r / s) with Tukey's loss, whose terms are at most 1.
pub(crate) fn tukey_sum(r: &[f64], mask: &[f64], scale: f64) -> f64 {
    r.iter()
        .enumerate()
        .map(|(i, r)| {
            let w = weight(Loss::Tukey, r / scale.max(f64::MIN_POSITIVE));
            // 1 − (1 − (z/c)²)³ from the weight (1 − (z/c)²)².
            mask.get(i).copied().unwrap_or(1.0) * (1.0 - w * w.sqrt())
        })
        .sum()
}

/// Returns the weight ψ(z)/z of a residual of z deviations.
pub(crate) fn weight(loss: Loss, z: f64) -> f64 {
    match loss {
        Loss::Squares | Loss::Auto => 1.0,
        Loss::Cauchy => 1.0 / (1.0 + (z / CAUCHY_TUNING).powi(2)),
        Loss::Tukey => {
            let t = 1.0 - (z / TUKEY_TUNING).powi(2);
            if t > 0.0 { t * t } else { 0.0 }
        }
    }
}

/// Returns ψ′(z).
pub(crate) fn slope(loss: Loss, z: f64) -> f64 {
    match loss {
        Loss::Squares | Loss::Auto => 1.0,
        Loss::Cauchy => {
            let t = (z / CAUCHY_TUNING).powi(2);
            (1.0 - t) / (1.0 + t).powi(2)
        }
        Loss::Tukey => {
            let t = (z / TUKEY_TUNING).powi(2);
            if t < 1.0 {
                (1.0 - t) * (1.0 - 5.0 * t)
            } else {
                0.0
            }
        }
    }
}
