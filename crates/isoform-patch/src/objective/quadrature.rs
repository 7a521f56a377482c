//! Quadrature on the unit square: Gauss-Legendre rules with the Bernstein basis at their nodes.

use crate::MAX_PATCH_DEGREE;
use crate::node::Node;
use isoform_geom::bernstein;
use isoform_num::gauss_legendre;

/// Rule in one direction with the Bernstein basis of one degree at its nodes.
#[derive(Clone, Debug)]
pub(super) struct Basis {
    pub(super) weights: Vec<f64>,
    /// Values B and derivatives B′ by node and index.
    pub(super) b: Vec<[Vec<f64>; 2]>,
}

impl Basis {
    fn new(degree: usize, nodes: usize) -> Self {
        let (x, weights) = gauss_legendre(nodes);
        let b = x
            .iter()
            .map(|&t| bernstein(degree, t))
            .map(|(b, d)| [b, d])
            .collect();
        Self { weights, b }
    }
}

/// Curve in v at one u with its derivative by u, as control points: p* and p*ᵤ.
type CurveAtNode = [[[f64; 4]; 2]; MAX_PATCH_DEGREE + 1];

/// Product of a rule in u and one in v; nodes with equal u are consecutive.
#[derive(Clone, Debug)]
pub(super) struct QuadratureRule {
    pub(super) u: Basis,
    pub(super) v: Basis,
}

impl QuadratureRule {
    /// Creates the rule with `nodes` nodes in each direction, for patches of degree (m, n).
    pub(super) fn new((m, n): (usize, usize), nodes: usize) -> Self {
        Self {
            u: Basis::new(m, nodes),
            v: Basis::new(n, nodes),
        }
    }

    /// Returns the number of nodes in each direction.
    pub(super) fn nodes_per_direction(&self) -> usize {
        self.u.weights.len()
    }

    /// Returns the weights of all nodes.
    pub(super) fn weights(&self) -> impl Iterator<Item = f64> + '_ {
        let in_v = &self.v.weights;
        let row = move |wu: &f64| {
            let wu = *wu;
            in_v.iter().map(move |wv| wu * wv)
        };
        self.u.weights.iter().flat_map(row)
    }

    /// Evaluates a patch with these control points at the nodes; `None` if w ≤ 0 at a node.
    pub(super) fn nodes(&self, control: &[[f64; 4]]) -> Option<Vec<Node>> {
        let all = self.homogeneous(control);
        all.into_iter().map(Node::new).collect()
    }

    /// Returns (p*, p*ᵤ, p*ᵥ) at all nodes for these control points.
    pub(super) fn homogeneous(&self, control: &[[f64; 4]]) -> Vec<[f64; 12]> {
        let mut nodes = Vec::with_capacity(self.u.b.len() * self.v.b.len());
        let count = self.v.b[0][0].len();
        for basis in &self.u.b {
            let curve = curve_at(basis, control, count);
            nodes.extend(
                self.v
                    .b
                    .iter()
                    .map(|basis| on_curve(&curve[..count], basis)),
            );
        }
        nodes
    }
}

/// Returns the curve at one node in u of a net with `count` control points in v.
fn curve_at([a, da]: &[Vec<f64>; 2], control: &[[f64; 4]], count: usize) -> CurveAtNode {
    let mut curve: CurveAtNode = [[[0.0; 4]; 2]; MAX_PATCH_DEGREE + 1];
    for (i, controls) in control.chunks(count).enumerate() {
        for (point, c) in curve[..count].iter_mut().zip(controls) {
            for k in 0..4 {
                point[0][k] += a[i] * c[k];
                point[1][k] += da[i] * c[k];
            }
        }
    }
    curve
}

/// Returns z at one node in v of a curve.
fn on_curve(curve: &[[[f64; 4]; 2]], [b, db]: &[Vec<f64>; 2]) -> [f64; 12] {
    let mut z = [0.0; 12];
    for (j, point) in curve.iter().enumerate() {
        for k in 0..4 {
            z[k] += b[j] * point[0][k];
            z[4 + k] += b[j] * point[1][k];
            z[8 + k] += db[j] * point[0][k];
        }
    }
    z
}
