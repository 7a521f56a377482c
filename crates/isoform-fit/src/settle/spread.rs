//! Covariance of the variables, in two parts: of independent noise, which falls with the number of
//! points, and of misfit that neighbours share, which does not.

use super::state::MinimumState;
use crate::bias::Bias;
use crate::correlation::Correlation;
use crate::matrix::product;
use crate::minimum::FitMinimum;
use crate::polish::weight;
use crate::task::Task;
use crate::vector::{add, scale};
use isoform_geom::Point3;

/// Covariance of the variables.
pub(super) struct Spread {
    /// Inverse of the Hessian.
    pub(super) inverse: Vec<f64>,
    independent: Vec<f64>,
    shared: Vec<f64>,
    pub(super) total: Vec<f64>,
    /// Correlation of the residuals of neighbours; 0 for none.
    pub(super) correlation: f64,
}

impl Spread {
    /// Returns the number of variables.
    fn dim(&self) -> usize {
        (self.independent.len() as f64).sqrt().round() as usize
    }

    /// Returns the variances of variable i: independent and shared.
    fn variances(&self, i: usize) -> (f64, f64) {
        let at = i * self.dim() + i;
        (self.independent[at], self.shared[at].max(0.0))
    }

    /// Sets the total covariance: never less than for independent points.
    fn join(&mut self) {
        let m = self.dim();
        let factor = |i: usize| match self.variances(i) {
            (own, shared) if own > 0.0 => (1.0 + shared / own).sqrt(),
            _ => 1.0,
        };
        let factor: Vec<f64> = (0..m).map(factor).collect();
        let joined = |at: usize| factor[at / m] * factor[at % m] * self.independent[at];
        self.total = (0..m * m).map(joined).collect();
    }

    /// Returns true if some standard deviation would fall below 90 % with 1 / `share` times as many
    /// points.
    pub(super) fn gains(&self, share: f64) -> bool {
        (0..self.dim()).any(|i| {
            let (own, shared) = self.variances(i);
            own * share + shared < 0.9 * 0.9 * (own + shared)
        })
    }

    /// Returns true if all components of a correction are below half of their standard deviations.
    pub(super) fn hides(&self, correction: &[f64]) -> bool {
        let m = correction.len();
        (0..m).all(|k| correction[k].powi(2) < 0.5 * 0.5 * self.total[k * m + k])
    }

    /// Scales the independent part for 1 / `share` times as many points.
    pub(super) fn scale_independent(&mut self, share: f64) {
        scale(&mut self.independent, share);
        scale(&mut self.inverse, share);
        self.join();
    }

    /// Adds the covariance of a bias that was removed, and the share `unsure` of the bias itself,
    /// since the noise may not be isotropic.
    pub(super) fn add_correction(&mut self, bias: &Bias, unsure: f64) {
        add(&mut self.total, &bias.covariance);
        let m = bias.correction.len();
        for (k, by) in bias.correction.iter().enumerate() {
            self.total[k * m + k] += (unsure * by).powi(2);
        }
    }
}

impl Task<'_> {
    /// Computes the covariance of the variables, including misfit that neighbours share. `normal`
    /// is the matrix of the normal equations, if it is known.
    pub(super) fn spread(
        &self,
        points: &[Point3],
        found: &FitMinimum,
        state: &MinimumState,
        held: &[bool],
        normal: Option<&[f64]>,
    ) -> Spread {
        let m = self.space.len();
        let at = self.at(points, found, state);
        let (independent, inverse) = at.covariance_without(held, normal);
        let mut spread = Spread {
            total: independent.clone(),
            inverse,
            independent,
            shared: vec![0.0; m * m],
            correlation: 0.0,
        };
        if let Some(c) = self.shared_misfit(points.len(), found, state) {
            let cross = c.cross(self.measure(), &self.space, &found.x);
            let half = product(&spread.inverse, &cross, m);
            spread.shared = product(&half, &spread.inverse, m);
            spread.correlation = c.nearest;
            spread.join();
        }
        spread
    }

    /// Estimates the correlation of weighted residuals; `None` for exact points, for neighbours
    /// that are not significantly correlated, and at the end of the time limit.
    fn shared_misfit(
        &self,
        count: usize,
        found: &FitMinimum,
        state: &MinimumState,
    ) -> Option<Correlation> {
        if state.noise <= self.rounding() || state.noise.is_nan() || self.control.is_stopped() {
            return None;
        }
        let weighted = self.weighted(found, state);
        // The first points in the random order are themselves in a random order.
        let first: Vec<u32> = (0..count as u32).collect();
        let is_all = count == self.points.len();
        let order = if is_all { self.order } else { &first };
        Correlation::estimate(&state.at, &weighted, order, self.size())
    }

    /// Returns the residuals times mask and weight of the loss; zero for those that are not finite.
    fn weighted(&self, found: &FitMinimum, state: &MinimumState) -> Vec<f64> {
        let scale = state.noise.max(self.rounding());
        let weighted = |(i, r): (usize, &f64)| {
            let mask = state.mask.get(i).copied().unwrap_or(1.0);
            if r.is_finite() {
                mask * weight(found.loss, r / scale) * r
            } else {
                0.0
            }
        };
        state.residuals.iter().enumerate().map(weighted).collect()
    }
}
