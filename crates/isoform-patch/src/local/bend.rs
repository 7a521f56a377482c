//! Second derivatives of residuals along a step of the control points.
//!
//! p* is a linear function of the control points; p, its tangents, the distance F/|∇F| and the
//! first fundamental form are not. The solver's acceleration is computed from their second
//! derivatives by the time t of the motion.

use super::form::{Form, Pair};
use crate::node::{Node, hessian_times};
use crate::terms::{Method, ShapeSettings};
use isoform_geom::{Point3, dot};
use isoform_num::Jet2;

/// Motion of a node: first and second derivatives of p, pᵤ and pᵥ by time.
struct Motion {
    point: [Point3; 2],
    tangents: [[Point3; 2]; 2],
}

impl Motion {
    /// Returns the motion in which z has the derivative `by`.
    fn new(node: &Node, by: &[f64; 12]) -> Self {
        let (w, dw) = (node.weight(), by[3]);
        let p = node.point;
        let dp: Point3 = std::array::from_fn(|k| (by[k] - p[k] * dw) / w);
        let ddp = dp.map(|v| -2.0 * v * dw / w);
        // The first and second derivatives of N_u = p w_u + p_u w by t.
        let tangents = [0, 1].map(|a| {
            let (wa, dwa, t) = (node.z[7 + 4 * a], by[7 + 4 * a], node.tangents[a]);
            let first: Point3 = std::array::from_fn(|k| {
                (by[4 + 4 * a + k] - dp[k] * wa - p[k] * dwa - t[k] * dw) / w
            });
            let second = std::array::from_fn(|k| {
                -(ddp[k] * wa + 2.0 * dp[k] * dwa + 2.0 * first[k] * dw) / w
            });
            [first, second]
        });
        Self {
            point: [dp, ddp],
            tangents,
        }
    }

    /// Returns the second derivative of F/|∇F| where F is small.
    fn distance(&self, jet: &Jet2, method: Method) -> f64 {
        let ([d, dd], g) = (self.point, jet.g);
        let length = dot(g, g).sqrt();
        if length == 0.0 {
            return 0.0;
        }
        let hd = hessian_times(jet, d);
        let turned = if method == Method::Frozen {
            0.0
        } else {
            2.0 * dot(g, d) * dot(g, hd) / (length * length)
        };
        (dot(d, hd) + dot(g, dd) - turned) / length
    }

    /// Returns the second derivative of ⟨pₐ, p_b⟩.
    fn form(&self, node: &Node, (a, b): Pair) -> f64 {
        let ([da, dda], [db, ddb]) = (self.tangents[a], self.tangents[b]);
        dot(dda, node.tangents[b]) + 2.0 * dot(da, db) + dot(node.tangents[a], ddb)
    }
}

/// Returns twice the weight times the gradient of the distance by z times the second derivative of
/// the distance along a step in which z moves by `by`.
pub(crate) fn bend_of_distance(
    node: &Node,
    by: &[f64; 12],
    jet: &Jet2,
    method: Method,
    weight: f64,
) -> [f64; 12] {
    let second = Motion::new(node, by).distance(jet, method);
    let mut sum = [0.0; 12];
    for (s, first) in sum.iter_mut().zip(node.distance_gradient(jet)) {
        *s = 2.0 * weight * second * first;
    }
    sum
}

/// Returns the corresponding sum over the residuals of L and R, with their factors.
pub(crate) fn bend_of_shape(
    node: &Node,
    by: &[f64; 12],
    shape: &ShapeSettings,
    weight: f64,
) -> [f64; 12] {
    let (targets, factors) = (&shape.targets, &shape.weights);
    let motion = Motion::new(node, by);
    let mut sum = [0.0; 12];
    let mut add = |factor: f64, second: f64, form: &Form| {
        for (s, first) in sum.iter_mut().zip(form.first) {
            *s += 2.0 * weight * factor * second * first;
        }
    };
    let form = |pair: Pair| Form::new(node, pair, false);
    let [x, y, both] = shape.inner.factors(targets);
    let (g11, g22) = (form((0, 0)), form((1, 1)));
    let (u, v) = (motion.form(node, (0, 0)), motion.form(node, (1, 1)));
    add(factors.l * x, u, &g11);
    add(factors.l * y, v, &g22);
    if both > 0.0 {
        let sum = g11.blend(1.0 / targets.l1, &g22, 1.0 / targets.l2);
        add(factors.l * both, u / targets.l1 + v / targets.l2, &sum);
    }
    add(factors.r, motion.form(node, (0, 1)), &form((0, 1)));
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::Polynomial;
    use isoform_geom::Field;

    /// Second derivatives along a step equal those from differences: of points, tangents, their
    /// products, and of the distance on the surface.
    #[test]
    fn motions_bend_as_differences_say() {
        // Vanishes at (0.2, 0.3, −0.1), the position of the node.
        let field = Polynomial::new([
            ([2, 0, 0], 1.0),
            ([0, 1, 1], 2.0),
            ([0, 3, 0], 1.0),
            ([0, 0, 0], -0.04 + 0.06 - 0.027),
        ]);
        let w = 1.3;
        let z = [
            0.2 * w,
            0.3 * w,
            -0.1 * w,
            w,
            0.9,
            -0.2,
            0.4,
            0.3,
            0.1,
            0.8,
            -0.5,
            -0.2,
        ];
        let by = [
            0.3, -0.7, 0.5, 0.4, -0.6, 0.2, 0.9, -0.3, 0.8, 0.1, -0.4, 0.7,
        ];
        let node = |t: f64| {
            Node::new(std::array::from_fn(|k| z[k] + t * by[k])).expect("a positive weight")
        };
        let motion = Motion::new(&node(0.0), &by);
        let h = 1e-4;
        let second =
            |f: &dyn Fn(&Node) -> f64| (f(&node(h)) - 2.0 * f(&node(0.0)) + f(&node(-h))) / (h * h);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-5, "{a} {b}");
        for k in 0..3 {
            near(motion.point[1][k], second(&|n| n.point[k]));
            for a in 0..2 {
                near(motion.tangents[a][1][k], second(&|n| n.tangents[a][k]));
            }
        }
        for (a, b) in [(0, 0), (0, 1), (1, 1)] {
            let product = |n: &Node| dot(n.tangents[a], n.tangents[b]);
            near(motion.form(&node(0.0), (a, b)), second(&product));
        }
        let distance = |n: &Node| n.distance(&field.jet(n.point));
        assert!(distance(&node(0.0)).abs() < 1e-15);
        let jet = field.jet(node(0.0).point);
        near(
            motion.distance(&jet, Method::GaussNewton),
            second(&distance),
        );
    }
}
