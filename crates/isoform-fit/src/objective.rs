//! Functions to be minimised.

use crate::vector::is_finite;

/// A function to be minimised: half of Σ wᵢ rᵢ(x)², or any other with a gradient and a positive
/// semidefinite model.
pub trait Objective {
    /// Number of variables.
    fn dim(&self) -> usize;
    /// Returns twice the cost, i.e. Σ w r²; a value that is not finite counts as infinite.
    fn value(&mut self, x: &[f64]) -> f64;
    /// Returns the value, and sets Jᵀ W r and Jᵀ W J (row-major): gradient and Gauss-Newton matrix
    /// of half of it.
    fn model(&mut self, x: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64;
    /// Returns the greatest share of step `p` from `x` that is allowed in addition to the bounds.
    fn step_limit(&self, _x: &[f64], _p: &[f64]) -> f64 {
        1.0
    }
}

/// Variables with the value, gradient and matrix of an objective there.
pub(crate) struct ModelPoint {
    pub(crate) x: Vec<f64>,
    pub(crate) value: f64,
    pub(crate) gradient: Vec<f64>,
    pub(crate) matrix: Vec<f64>,
}

impl ModelPoint {
    /// Makes a point whose model is not evaluated yet.
    pub(crate) fn new(x: Vec<f64>, n: usize) -> Self {
        Self {
            x,
            value: f64::INFINITY,
            gradient: vec![0.0; n],
            matrix: vec![0.0; n * n],
        }
    }

    /// Evaluates the model of an objective at x.
    pub(crate) fn evaluate(&mut self, objective: &mut dyn Objective) {
        self.value = objective.model(&self.x, &mut self.gradient, &mut self.matrix);
    }

    /// Returns true if value and gradient are finite.
    pub(crate) fn has_gradient(&self) -> bool {
        self.value.is_finite() && is_finite(&self.gradient)
    }

    /// Returns true if value, gradient and matrix are finite.
    pub(crate) fn is_finite(&self) -> bool {
        self.has_gradient() && is_finite(&self.matrix)
    }
}
