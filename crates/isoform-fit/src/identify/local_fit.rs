//! A fit whose identifiability is examined.

use crate::polish::weight;
use crate::residuals::normal_equations;
use crate::space::Space;
use crate::{Control, Loss};
use isoform_geom::{ParamField, Point3};

/// Smallest curvature of a direction, relative to the largest; anything less is rounding.
pub(super) const MIN_CURVATURE_SHARE: f64 = 1e-10;

/// A fit whose identifiability is examined.
pub(crate) struct ExaminedFit<'a> {
    pub(crate) field: &'a dyn ParamField,
    pub(crate) points: &'a [Point3],
    pub(crate) space: &'a Space,
    pub(crate) x: &'a [f64],
    pub(crate) residuals: &'a [f64],
    /// 0 for points left out, else 1; empty for none left out.
    pub(crate) mask: &'a [f64],
    pub(crate) loss: Loss,
    /// Robust deviation, or the root mean square.
    pub(crate) scale: f64,
    /// Least deviation: smaller ones are rounding, and the data exact.
    pub(crate) least_scale: f64,
    /// Largest rounding error of a coordinate.
    pub(crate) rounding: f64,
    /// Number of points that represent all when a variable is moved.
    pub(crate) tested: usize,
    pub(crate) control: &'a Control<'a>,
}

impl ExaminedFit<'_> {
    /// Returns the deviation of the residuals, or that of rounding if it is larger.
    pub(super) fn deviation(&self) -> f64 {
        self.scale.max(self.least_scale)
    }

    /// Returns the matrix of the normal equations with the weights of the loss.
    pub(super) fn weighted_normal(&self) -> Vec<f64> {
        self.normal(&self.weights())
    }

    /// Returns the weights of the points in the loss.
    pub(super) fn weights(&self) -> Vec<f64> {
        let s = self.deviation();
        self.masked(|r| weight(self.loss, r / s))
    }

    /// Returns Jᵀ W J of all points, in the variables.
    pub(super) fn normal(&self, weights: &[f64]) -> Vec<f64> {
        let (n, m) = (self.field.dim(), self.space.len());
        let (mut ga, mut ha) = (vec![0.0; n], vec![0.0; n * n]);
        let (mut g, mut h) = (vec![0.0; m], vec![0.0; m * m]);
        let a = self.space.parameters(self.x);
        normal_equations(self.field, self.points, weights, &a, &mut ga, &mut ha);
        self.space.pull_back(&ga, &ha, &mut g, &mut h);
        h
    }

    /// Returns a weight per point, zero if it is left out; empty if all are 1.
    pub(super) fn masked(&self, weight: impl Fn(f64) -> f64) -> Vec<f64> {
        if self.mask.is_empty() && !self.loss.is_robust() {
            return Vec::new();
        }
        let mut weights: Vec<f64> = self.residuals.iter().map(|r| weight(*r)).collect();
        weights.iter_mut().zip(self.mask).for_each(|(w, m)| *w *= m);
        weights
    }
}
