//! Gradient and second derivatives of S by the control points.

use super::tensor::{PointResidual, add_locals, add_squares};
use super::{Derivatives, Evaluated, Objective};
use crate::local::{add_distances_at, add_shapes_at};
use crate::terms::{CORNERS, K, Method};
use isoform_geom::{RationalPatch, sub};

impl Objective<'_> {
    /// Computes gradient and second derivatives of S; `None` if Newton's method is selected and the
    /// field has no third derivatives.
    pub fn derivatives(&self, patch: &RationalPatch, at: &Evaluated) -> Option<Derivatives> {
        let size = self.unknowns();
        let mut d = Derivatives {
            gradient: vec![0.0; size],
            hessian: vec![0.0; size * size],
        };
        if self.shape_rule.is_some() && self.method != Method::Newton {
            self.add_distances(at, &mut d);
        } else {
            self.add_nodes(at, &mut d)?;
        }
        if let Some(rule) = &self.shape_rule {
            let shape = self.shape();
            add_locals(rule, &mut d, |row, weights, locals| {
                add_shapes_at(&at.samples.shape[row], &shape, weights, locals);
                Some(())
            })?;
        }
        if self.is_by_control {
            self.add_control_terms(patch, &mut d);
        }
        self.add_corner_terms(patch, &mut d);
        self.add_side_terms(patch, &mut d);
        d.complete();
        Some(d)
    }

    /// Adds I in the Gauss-Newton approximation.
    fn add_distances(&self, at: &Evaluated, d: &mut Derivatives) {
        let samples = &at.samples;
        add_squares(&self.rule, d, |k, weight| {
            let (node, jet) = (&samples.nodes[k], &samples.jets[k]);
            PointResidual {
                value: node.distance(jet),
                first: node.distance_slope(jet, self.method),
                weight: weight * self.importance(k),
            }
        });
    }

    /// Adds I, and the integrals of the shape terms if they share its rule.
    fn add_nodes(&self, at: &Evaluated, d: &mut Derivatives) -> Option<()> {
        let (samples, shape) = (&at.samples, self.shape());
        add_locals(&self.rule, d, |row, weights, locals| {
            let (nodes, jets) = (&samples.nodes[row.clone()], &samples.jets[row.clone()]);
            let factors = weights.iter().zip(row.clone());
            let factors: Vec<f64> = factors.map(|(w, k)| w * self.importance(k)).collect();
            if self.method == Method::Newton {
                for (i, k) in row.enumerate() {
                    let third = self.field.jet3(samples.points[k])?;
                    let (jet, third) = (&jets[i], Some(&third));
                    locals[i].add_distance(&nodes[i], jet, third, self.method, factors[i]);
                }
            } else {
                add_distances_at(nodes, jets, self.method, &factors, locals);
            }
            if self.shape_rule.is_none() {
                add_shapes_at(nodes, &shape, weights, locals);
            }
            Some(())
        })
    }

    /// Adds ω_J J by control points.
    fn add_control_terms(&self, patch: &RationalPatch, d: &mut Derivatives) {
        let count = patch.control().len();
        let (size, k, factor) = (4 * count, f64::from(K), self.weights.j / count as f64);
        for (at, c) in patch.control().iter().enumerate() {
            let (x, row) = (c[3] - 1.0, 3 * count + at);
            d.gradient[row] += factor * k * x.powi(K - 1);
            d.hessian[row * size + row] += factor * k * (k - 1.0) * x.powi(K - 2);
        }
    }

    /// Adds ω_E E.
    fn add_corner_terms(&self, patch: &RationalPatch, d: &mut Derivatives) {
        let count = patch.control().len();
        for (&corner, target) in CORNERS.iter().zip(self.targets.corners) {
            let at = self.corner(corner);
            let c = patch.control()[at];
            let w = c[3];
            let p = [c[0] / w, c[1] / w, c[2] / w];
            let r = sub(p, target);
            for k in 0..3 {
                let places = [k * count + at, 3 * count + at];
                self.add_corner_coordinate(d, places, w, p[k], r[k]);
            }
        }
    }

    /// Adds ω_E r² for a coordinate p of a corner with the weight w. The unknowns at the two
    /// indices are that coordinate of the control point and its weight.
    fn add_corner_coordinate(
        &self,
        d: &mut Derivatives,
        places: [usize; 2],
        w: f64,
        p: f64,
        r: f64,
    ) {
        let size = d.gradient.len();
        let first = [1.0 / w, -p / w];
        let curved = if self.method == Method::Newton {
            1.0
        } else {
            0.0
        };
        let second = [[0.0, -1.0 / (w * w)], [-1.0 / (w * w), 2.0 * p / (w * w)]];
        for (a, &row) in places.iter().enumerate() {
            d.gradient[row] += 2.0 * self.weights.e * r * first[a];
            for (b, &column) in places.iter().enumerate() {
                d.hessian[row * size + column] +=
                    2.0 * self.weights.e * (first[a] * first[b] + curved * r * second[a][b]);
            }
        }
    }

    /// Returns the derivatives of the residuals √weight F/|∇F| at all nodes by the unknowns, row by
    /// row, with |∇F| taken as constant, and the residuals.
    pub(crate) fn distance_rows(&self, at: &Evaluated) -> (Vec<f64>, Vec<f64>) {
        let samples = &at.samples;
        let mut rows = Vec::with_capacity(samples.nodes.len() * self.unknowns());
        let mut residuals = Vec::with_capacity(samples.nodes.len());
        let mut nodes = samples.nodes.iter().zip(&samples.jets);
        let (u, v) = (&self.rule.u, &self.rule.v);
        for ([a, _], wu) in u.b.iter().zip(&u.weights) {
            for (([b, _], wv), (node, jet)) in v.b.iter().zip(&v.weights).zip(&mut nodes) {
                let root = (wu * wv).sqrt();
                residuals.push(root * node.distance(jet));
                for f in node.distance_gradient(jet) {
                    for x in a {
                        rows.extend(b.iter().map(|y| root * f * x * y));
                    }
                }
            }
        }
        (rows, residuals)
    }
}

impl Derivatives {
    /// Copies the transposed blocks of coordinates k < l to the blocks with k > l.
    fn complete(&mut self) {
        let size = self.gradient.len();
        let count = size / 4;
        for row in 0..size {
            for column in 0..row / count * count {
                self.hessian[row * size + column] = self.hessian[column * size + row];
            }
        }
    }
}
