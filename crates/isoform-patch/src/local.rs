//! Integrands of the objective as functions of z at one node, with their derivatives.
//!
//! A residual r with the factor s adds s r², the gradient 2 s r ∇r and the second derivatives 2 s
//! (∇r ∇rᵀ + r ∇²r); the term with ∇²r is used by Newton's method only.

mod bend;
mod form;

pub(crate) use bend::{bend_of_distance, bend_of_shape};

use crate::node::{Node, hessian_times, slope_of_distance};
use crate::terms::{K, Method, ShapeSettings};
use form::Form;
use isoform_geom::{Expansion, Point3, dot};
use isoform_num::{Jet2, Jet3};

/// Gradient and second derivatives of the integrand of S by z, times the quadrature weight.
#[derive(Clone, Debug)]
pub(crate) struct NodeDerivatives {
    pub(crate) gradient: [f64; 12],
    pub(crate) hessian: [[f64; 12]; 12],
}

isoform_num::dispatch! {
    /// Adds the integrands of the shape terms at several nodes, each with its weight.
    pub(crate) fn add_shapes_at(nodes: &[Node], shape: &ShapeSettings, weights: &[f64], to: &mut [NodeDerivatives]) =
        shapes_at
}

#[inline(always)]
fn shapes_at(nodes: &[Node], shape: &ShapeSettings, weights: &[f64], to: &mut [NodeDerivatives]) {
    for ((node, weight), local) in nodes.iter().zip(weights).zip(to) {
        local.add_shape(node, shape, *weight);
    }
}

isoform_num::dispatch! {
    /// Adds the integrand of I at several nodes, each with its weight, in the Gauss-Newton
    /// approximation.
    pub(crate) fn add_distances_at(
        nodes: &[Node],
        jets: &[Jet2],
        method: Method,
        weights: &[f64],
        to: &mut [NodeDerivatives],
    ) = distances_at
}

#[inline(always)]
fn distances_at(
    nodes: &[Node],
    jets: &[Jet2],
    method: Method,
    weights: &[f64],
    to: &mut [NodeDerivatives],
) {
    for (((node, jet), weight), local) in nodes.iter().zip(jets).zip(weights).zip(to) {
        local.add_distance(node, jet, None, method, *weight);
    }
}

impl Default for NodeDerivatives {
    fn default() -> Self {
        Self {
            gradient: [0.0; 12],
            hessian: [[0.0; 12]; 12],
        }
    }
}

impl NodeDerivatives {
    /// Adds the integrand F²/|∇F|² of I; `third` is used by Newton's method only.
    #[inline(always)]
    pub(crate) fn add_distance(
        &mut self,
        node: &Node,
        jet: &Jet2,
        third: Option<&Jet3>,
        method: Method,
        weight: f64,
    ) {
        if dot(jet.g, jet.g).sqrt() == 0.0 {
            return;
        }
        let r = node.distance(jet);
        // With frozen gradients the remainder is 0, whose subtraction changes no bits.
        let slope = slope_of_distance(jet, if method == Method::Frozen { 0.0 } else { r });
        let first = node.by_homogeneous(slope);
        let second = third.map(|third| {
            let by_point = second_of_distance(jet, third);
            second_by_homogeneous(node, slope, &by_point)
        });
        self.square(r, &first, second.as_ref(), weight);
    }

    /// Adds the integrands of L and R, and that of J if J is an integral.
    #[inline(always)]
    fn add_shape(&mut self, node: &Node, shape: &ShapeSettings, weight: f64) {
        let (targets, factors) = (&shape.targets, &shape.weights);
        let r = node.residuals(targets);
        if !shape.is_by_control {
            let x = node.weight() - 1.0;
            let k = f64::from(K);
            self.gradient[3] += weight * factors.j * k * x.powi(K - 1);
            self.hessian[3][3] += weight * factors.j * k * (k - 1.0) * x.powi(K - 2);
        }
        let is_exact = shape.method == Method::Newton;
        let [x, y, both] = shape.inner.factors(targets);
        let g11 = Form::new(node, (0, 0), is_exact);
        let g22 = Form::new(node, (1, 1), is_exact);
        self.form(r.u, &g11, weight * factors.l * x);
        self.form(r.v, &g22, weight * factors.l * y);
        if both > 0.0 {
            let sum = g11.blend(1.0 / targets.l1, &g22, 1.0 / targets.l2);
            let r = r.u / targets.l1 + r.v / targets.l2;
            self.form(r, &sum, weight * factors.l * both);
        }
        let g12 = Form::new(node, (0, 1), is_exact);
        self.form(r.angle, &g12, weight * factors.r);
    }

    /// Adds s r² for a residual that depends on p* alone.
    #[inline(always)]
    fn square(&mut self, r: f64, first: &[f64; 4], second: Option<&[[f64; 4]; 4]>, s: f64) {
        for a in 0..4 {
            self.gradient[a] += 2.0 * s * r * first[a];
            for b in 0..4 {
                let curved = second.map_or(0.0, |h| r * h[a][b]);
                self.hessian[a][b] += 2.0 * s * (first[a] * first[b] + curved);
            }
        }
    }

    /// Adds s r² for a residual that depends on all of z.
    #[inline(always)]
    fn form(&mut self, r: f64, form: &Form, s: f64) {
        for (a, row) in self.hessian.iter_mut().enumerate() {
            let x = 2.0 * s * form.first[a];
            self.gradient[a] += r * x;
            for b in 0..12 {
                row[b] += x * form.first[b];
            }
        }
        let Some(second) = &form.second else { return };
        for (row, h) in self.hessian.iter_mut().zip(second.iter()) {
            for b in 0..12 {
                row[b] += 2.0 * s * r * h[b];
            }
        }
    }
}

/// Returns the second derivatives of F/|∇F| by p.
fn second_of_distance(jet: &Jet2, third: &Jet3) -> [[f64; 3]; 3] {
    let g = jet.g;
    let length = dot(g, g).sqrt();
    let hg = hessian_times(jet, g);
    let s3 = 1.0 / (length * length * length);
    let entry = |i: usize, j: usize| {
        let t = |k: usize| third.t[Expansion::THIRD[i][j][k]];
        let tg: f64 = (0..3).map(|k| t(k) * g[k]).sum();
        let hh: f64 = (0..3).map(|k| jet.second(i, k) * jet.second(k, j)).sum();
        let s_ij = -s3 * (tg + hh) + 3.0 * s3 * hg[i] * hg[j] / (length * length);
        jet.second(i, j) / length - s3 * (g[i] * hg[j] + g[j] * hg[i]) + jet.v * s_ij
    };
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// Transforms first and second derivatives by p to second derivatives by p*.
fn second_by_homogeneous(node: &Node, first: Point3, by_point: &[[f64; 3]; 3]) -> [[f64; 4]; 4] {
    let (w, p) = (node.weight(), node.point);
    // ∂p/∂z: the identity over w for N, −p/w for w; ∂²p_k/∂N_k∂w = −1/w², ∂²p_k/∂w² = 2 p_k/w².
    let along = |i: usize, k: usize| {
        if i == 3 {
            -p[k] / w
        } else {
            f64::from(u8::from(i == k)) / w
        }
    };
    let mut second = [[0.0; 4]; 4];
    for (a, row) in second.iter_mut().enumerate() {
        for (b, sum) in row.iter_mut().enumerate() {
            for i in 0..3 {
                for j in 0..3 {
                    *sum += along(a, i) * by_point[i][j] * along(b, j);
                }
            }
        }
    }
    for k in 0..3 {
        second[k][3] -= first[k] / (w * w);
        second[3][k] -= first[k] / (w * w);
        second[3][3] += 2.0 * first[k] * p[k] / (w * w);
    }
    second
}
