//! Sums of squared residuals over points, as functions of the free variables.

use crate::objective::Objective;
use crate::space::Space;
use isoform_geom::{NormalEquations, ParamField, Point3, add_normal_equations};
use rayon::prelude::*;
use std::borrow::Cow;

/// Derivative of a residual by a variable, in units of the search, above which the variable moves
/// the surface; smaller ones are rounding.
pub(crate) const MOVING_DERIVATIVE: f64 = 1e-6;
/// Number of points per block of a parallel sum. It is fixed, so that sums have equal bits for any
/// number of threads, and large enough that a block (some hundred µs) pays for its dispatch.
const PARALLEL_BLOCK_POINTS: usize = 16_384;

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
        &weights[k * PARALLEL_BLOCK_POINTS..((k + 1) * PARALLEL_BLOCK_POINTS).min(weights.len())]
    }
}

/// Returns Σ w f², in parallel over fixed blocks.
pub(crate) fn sum_of_squares(
    field: &dyn ParamField,
    points: &[Point3],
    weights: &[f64],
    a: &[f64],
) -> f64 {
    if points.len() <= PARALLEL_BLOCK_POINTS {
        return field.sum_of_squares(points, weights, a);
    }
    let parts: Vec<f64> = points
        .par_chunks(PARALLEL_BLOCK_POINTS)
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
    if points.len() <= PARALLEL_BLOCK_POINTS {
        return field.normal_equations(points, weights, a, gradient, hessian);
    }
    let n = field.dim();
    let parts: Vec<NormalEquations> = points
        .par_chunks(PARALLEL_BLOCK_POINTS)
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
    if points.len() <= PARALLEL_BLOCK_POINTS {
        field.values(points, a, out);
    } else {
        points
            .par_chunks(PARALLEL_BLOCK_POINTS)
            .zip(out.par_chunks_mut(PARALLEL_BLOCK_POINTS))
            .for_each(|(p, o)| field.values(p, a, o));
    }
}
