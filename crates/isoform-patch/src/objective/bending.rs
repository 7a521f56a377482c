//! Second derivatives of residuals along a step, summed over the nodes, for the solver's
//! acceleration.

use super::quadrature::QuadratureRule;
use super::{Evaluated, Objective};
use crate::MAX_PATCH_DEGREE;
use crate::local::{bend_of_distance, bend_of_shape};
use crate::terms::CORNERS;
use isoform_geom::RationalPatch;

/// Sums over v at one u, by control point in v: the factors of B and of B′ in u.
type FactorRow = [[[f64; 4]; 2]; MAX_PATCH_DEGREE + 1];

impl Objective<'_> {
    /// Returns the gradient of S with every residual replaced by its second derivative along a step
    /// of the unknowns. J, which is not a sum of squared residuals, and the sides are left out.
    pub(crate) fn bending(&self, patch: &RationalPatch, at: &Evaluated, step: &[f64]) -> Vec<f64> {
        let count = patch.control().len();
        let moved: Vec<[f64; 4]> = (0..count)
            .map(|i| std::array::from_fn(|k| step[k * count + i]))
            .collect();
        let mut sums = vec![0.0; 4 * count];
        let samples = &at.samples;
        let shape = self.shape();
        let mut all = samples.nodes.iter().zip(&samples.jets).enumerate();
        self.add_bending(&self.rule, &moved, &mut sums, |weight, by| {
            let (k, (node, jet)) = all.next().expect("a node for each of the rule");
            let own = bend_of_distance(node, by, jet, self.method, weight * self.importance(k));
            // Shape terms are added here if there is one rule for all.
            match self.shape_rule {
                Some(_) => own,
                None => {
                    let shape = bend_of_shape(node, by, &shape, weight);
                    std::array::from_fn(|i| own[i] + shape[i])
                }
            }
        });
        if let Some(rule) = &self.shape_rule {
            let mut all = samples.shape.iter();
            self.add_bending(rule, &moved, &mut sums, |weight, by| {
                let node = all.next().expect("a node for each of the rule");
                bend_of_shape(node, by, &shape, weight)
            });
        }
        self.add_corner_bending(patch, &moved, &mut sums);
        sums
    }

    /// Adds the sums over the nodes of a rule of the gradients by z that `bend` returns for each
    /// node's weight and the derivative of its z.
    fn add_bending(
        &self,
        rule: &QuadratureRule,
        moved: &[[f64; 4]],
        sums: &mut [f64],
        mut bend: impl FnMut(f64, &[f64; 12]) -> [f64; 12],
    ) {
        let (_, n) = self.degree;
        let motion = rule.homogeneous(moved);
        let mut motion = motion.iter();
        for (in_u, wu) in rule.u.b.iter().zip(&rule.u.weights) {
            let mut row: FactorRow = [[[0.0; 4]; 2]; MAX_PATCH_DEGREE + 1];
            for ((in_v, wv), by) in rule.v.b.iter().zip(&rule.v.weights).zip(&mut motion) {
                add_node(&mut row[..=n], in_v, &bend(wu * wv, by));
            }
            add_row(sums, in_u, &row[..=n]);
        }
    }

    /// Adds the contribution of the corners, ω_E E.
    fn add_corner_bending(&self, patch: &RationalPatch, moved: &[[f64; 4]], sums: &mut [f64]) {
        let count = moved.len();
        for &corner in &CORNERS {
            let at = self.corner(corner);
            let (c, by) = (patch.control()[at], moved[at]);
            for k in 0..3 {
                let p = c[k] / c[3];
                let second = -2.0 * (by[k] - p * by[3]) * by[3] / (c[3] * c[3]);
                sums[k * count + at] += 2.0 * self.weights.e * second / c[3];
                sums[3 * count + at] -= 2.0 * self.weights.e * second * p / c[3];
            }
        }
    }
}

/// Adds a node with the gradient g by z to the sums over v.
#[inline]
fn add_node(row: &mut [[[f64; 4]; 2]], [b, db]: &[Vec<f64>; 2], g: &[f64; 12]) {
    for (j, row) in row.iter_mut().enumerate() {
        for d in 0..4 {
            row[0][d] += g[d] * b[j] + g[8 + d] * db[j];
            row[1][d] += g[4 + d] * b[j];
        }
    }
}

/// Adds the sums over v at one u to the sums by the unknowns.
#[inline]
fn add_row(sums: &mut [f64], [a, da]: &[Vec<f64>; 2], row: &[[[f64; 4]; 2]]) {
    let (count, in_row) = (sums.len() / 4, row.len());
    for i in 0..a.len() {
        for (j, row) in row.iter().enumerate() {
            for d in 0..4 {
                sums[d * count + i * in_row + j] += a[i] * row[0][d] + da[i] * row[1][d];
            }
        }
    }
}
