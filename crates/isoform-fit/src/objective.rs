//! Sums of squared residuals over points, as functions of the free variables.

use crate::space::Space;
use crate::vector::is_finite;
use isoform_geom::{NormalEquations, ParamField, Point3, add_normal_equations};
use rayon::prelude::*;
use std::borrow::Cow;

/// Points per piece of a parallel sum. The number is fixed, so that sums have equal bits for any
/// number of threads, and large enough that a piece (some hundred µs) pays for its dispatch.
const PIECE: usize = 16_384;

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
pub(crate) struct Place {
    pub(crate) x: Vec<f64>,
    pub(crate) value: f64,
    pub(crate) gradient: Vec<f64>,
    pub(crate) matrix: Vec<f64>,
}

impl Place {
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

/// Residuals of a field over points, with optional weights.
pub struct Residuals<'a> {
    field: &'a dyn ParamField,
    points: &'a [Point3],
    weights: Cow<'a, [f64]>,
    space: &'a Space,
    a: Vec<f64>,
    ga: Vec<f64>,
    ha: Vec<f64>,
}

impl<'a> Residuals<'a> {
    /// Makes residuals with borrowed weights; all are 1 if `weights` is empty.
    pub fn new(
        field: &'a dyn ParamField,
        points: &'a [Point3],
        weights: &'a [f64],
        space: &'a Space,
    ) -> Self {
        Self::with(field, points, Cow::Borrowed(weights), space)
    }

    /// Makes residuals with owned weights.
    pub(crate) fn weighted(
        field: &'a dyn ParamField,
        points: &'a [Point3],
        weights: Vec<f64>,
        space: &'a Space,
    ) -> Self {
        Self::with(field, points, Cow::Owned(weights), space)
    }

    fn with(
        field: &'a dyn ParamField,
        points: &'a [Point3],
        weights: Cow<'a, [f64]>,
        space: &'a Space,
    ) -> Self {
        let n = field.dim();
        Self {
            field,
            points,
            weights,
            space,
            a: vec![0.0; n],
            ga: vec![0.0; n],
            ha: vec![0.0; n * n],
        }
    }
}

impl Objective for Residuals<'_> {
    fn dim(&self) -> usize {
        self.space.len()
    }
    fn value(&mut self, x: &[f64]) -> f64 {
        self.space.parameters_at(x, &mut self.a);
        sum_of_squares(self.field, self.points, &self.weights, &self.a)
    }
    fn model(&mut self, x: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64 {
        self.space.parameters_at(x, &mut self.a);
        let f = normal_equations(
            self.field,
            self.points,
            &self.weights,
            &self.a,
            &mut self.ga,
            &mut self.ha,
        );
        self.space.pull_back(&self.ga, &self.ha, gradient, hessian);
        f
    }
    fn step_limit(&self, x: &[f64], p: &[f64]) -> f64 {
        self.space.step_limit(x, p)
    }
}

fn piece(weights: &[f64], k: usize) -> &[f64] {
    if weights.is_empty() {
        weights
    } else {
        &weights[k * PIECE..((k + 1) * PIECE).min(weights.len())]
    }
}

/// Returns Σ w f², in parallel over fixed blocks.
pub(crate) fn sum_of_squares(
    field: &dyn ParamField,
    points: &[Point3],
    weights: &[f64],
    a: &[f64],
) -> f64 {
    if points.len() <= PIECE {
        return field.sum_of_squares(points, weights, a);
    }
    let parts: Vec<f64> = points
        .par_chunks(PIECE)
        .enumerate()
        .map(|(k, p)| field.sum_of_squares(p, piece(weights, k), a))
        .collect();
    parts.iter().sum()
}

/// Computes the normal equations in the parameters, in parallel over fixed blocks.
pub(crate) fn normal_equations(
    field: &dyn ParamField,
    points: &[Point3],
    weights: &[f64],
    a: &[f64],
    gradient: &mut [f64],
    hessian: &mut [f64],
) -> f64 {
    if points.len() <= PIECE {
        return field.normal_equations(points, weights, a, gradient, hessian);
    }
    let n = field.dim();
    let parts: Vec<NormalEquations> = points
        .par_chunks(PIECE)
        .enumerate()
        .map(|(k, p)| {
            let (mut g, mut h) = (vec![0.0; n], vec![0.0; n * n]);
            let f = field.normal_equations(p, piece(weights, k), a, &mut g, &mut h);
            (f, g, h)
        })
        .collect();
    add_normal_equations(parts, gradient, hessian)
}

/// Returns the derivatives of f(pᵢ, a) by the parameters, point by point.
pub(crate) fn jacobian(field: &dyn ParamField, points: &[Point3], a: &[f64]) -> Vec<f64> {
    let mut f = vec![0.0; points.len()];
    let mut jac = vec![0.0; points.len() * field.dim()];
    field.jacobian(points, a, &mut f, &mut jac);
    jac
}

/// Evaluates f(pᵢ, a), in parallel.
pub(crate) fn values(field: &dyn ParamField, points: &[Point3], a: &[f64], out: &mut [f64]) {
    if points.len() <= PIECE {
        field.values(points, a, out);
    } else {
        points
            .par_chunks(PIECE)
            .zip(out.par_chunks_mut(PIECE))
            .for_each(|(p, o)| field.values(p, a, o));
    }
}
