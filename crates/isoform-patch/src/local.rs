//! The integrands of the objective as functions of z = (p*, p*ᵤ, p*ᵥ) ∈ ℝ¹² at one node.
//!
//! With N the first three coordinates of p* and w its last: p = N/w and pᵤ = (Nᵤ − p wᵤ)/w, the
//! same for v.

use crate::objective::{K, Method, Objective, Targets};
use isoform_geom::{Point3, dot};
use isoform_num::{Jet2, Jet3};

/// z with the point and the tangents it stands for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub(crate) z: [f64; 12],
    pub(crate) point: Point3,
    pub(crate) tangents: [Point3; 2],
}

/// The residuals whose squares make L and R.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Residuals {
    /// g₁₁ − l₁.
    pub(crate) u: f64,
    /// g₂₂ − l₂.
    pub(crate) v: f64,
    /// g₁₂.
    pub(crate) angle: f64,
}

impl Node {
    /// None where w ≤ 0.
    pub(crate) fn new(z: [f64; 12]) -> Option<Self> {
        let w = z[3];
        if w.is_nan() || w <= 0.0 {
            return None;
        }
        let point: Point3 = std::array::from_fn(|k| z[k] / w);
        let tangents =
            [4, 8].map(|t| std::array::from_fn(|k| (z[t + k] - point[k] * z[t + 3]) / w));
        Some(Self { z, point, tangents })
    }

    /// F/|∇F|, 0 where both vanish.
    pub(crate) fn distance(&self, jet: &Jet2) -> f64 {
        if jet.v == 0.0 {
            0.0
        } else {
            jet.v / dot(jet.g, jet.g).sqrt()
        }
    }

    pub(crate) fn residuals(&self, targets: &Targets) -> Residuals {
        let [pu, pv] = self.tangents;
        Residuals {
            u: dot(pu, pu) - targets.l1,
            v: dot(pv, pv) - targets.l2,
            angle: dot(pu, pv),
        }
    }

    /// The derivatives of F/|∇F| by p*, with |∇F| taken as constant; 0 where that is 0.
    pub(crate) fn distance_gradient(&self, jet: &Jet2) -> [f64; 4] {
        let (w, length) = (self.z[3], dot(jet.g, jet.g).sqrt());
        if length == 0.0 {
            return [0.0; 4];
        }
        let d = jet.g.map(|g| g / length);
        [d[0] / w, d[1] / w, d[2] / w, -dot(d, self.point) / w]
    }

    /// The derivatives of F/|∇F| by p*, of the second kind only if the method has them; 0 where
    /// |∇F| is.
    pub(crate) fn distance_slope(&self, jet: &Jet2, method: Method) -> [f64; 4] {
        let (w, g) = (self.z[3], jet.g);
        let length = dot(g, g).sqrt();
        if length == 0.0 || method == Method::Frozen {
            return self.distance_gradient(jet);
        }
        let d = along(jet, self.distance(jet));
        [d[0] / w, d[1] / w, d[2] / w, -dot(d, self.point) / w]
    }

    /// The places in z that pᵤ,ₖ (or pᵥ,ₖ) depends on: Nₖ, w, N_{k,u}, wᵤ; and its derivatives by
    /// them.
    fn tangent(&self, which: usize, k: usize) -> ([usize; 4], [f64; 4]) {
        let (w, offset) = (self.z[3], 4 + 4 * which);
        let (wu, p, pu) = (self.z[offset + 3], self.point[k], self.tangents[which][k]);
        (
            [k, 3, offset + k, offset + 3],
            [-wu / (w * w), (p * wu / w - pu) / w, 1.0 / w, -p / w],
        )
    }
    /// The second derivatives of the same.
    fn tangent_second(&self, which: usize, k: usize) -> [[f64; 4]; 4] {
        let (w, offset) = (self.z[3], 4 + 4 * which);
        let (n, nu, wu) = (self.z[k], self.z[offset + k], self.z[offset + 3]);
        let (w2, w3) = (w * w, w * w * w);
        let (n_w, w_w, w_nu, w_wu) = (
            2.0 * wu / w3,
            2.0 * nu / w3 - 6.0 * n * wu / (w3 * w),
            -1.0 / w2,
            2.0 * n / w3,
        );
        [
            [0.0, n_w, 0.0, -1.0 / w2],
            [n_w, w_w, w_nu, w_wu],
            [0.0, w_nu, 0.0, 0.0],
            [-1.0 / w2, w_wu, 0.0, 0.0],
        ]
    }
}

/// How a node moves with a step of the control points, of which p* is a linear function: p, pᵤ and
/// pᵥ at the time t have these first and second derivatives by t.
struct Motion {
    point: [Point3; 2],
    tangents: [[Point3; 2]; 2],
}

impl Motion {
    /// `by` is the derivative of z.
    fn new(node: &Node, by: &[f64; 12]) -> Self {
        let (w, dw) = (node.z[3], by[3]);
        let p = node.point;
        let dp: Point3 = std::array::from_fn(|k| (by[k] - p[k] * dw) / w);
        let ddp = dp.map(|v| -2.0 * v * dw / w);
        // N_u = p w_u + p_u w, once and twice by t.
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

    /// The second derivative of F/|∇F| where F is small.
    fn distance(&self, jet: &Jet2, method: Method) -> f64 {
        let ([d, dd], g) = (self.point, jet.g);
        let length = dot(g, g).sqrt();
        if length == 0.0 {
            return 0.0;
        }
        let hd: Point3 = std::array::from_fn(|i| (0..3).map(|j| jet.second(i, j) * d[j]).sum());
        let turned = if method == Method::Frozen {
            0.0
        } else {
            2.0 * dot(g, d) * dot(g, hd) / (length * length)
        };
        (dot(d, hd) + dot(g, dd) - turned) / length
    }

    /// The second derivative of ⟨pₐ, p_b⟩.
    fn form(&self, node: &Node, (a, b): (usize, usize)) -> f64 {
        let ([da, dda], [db, ddb]) = (self.tangents[a], self.tangents[b]);
        dot(dda, node.tangents[b]) + 2.0 * dot(da, db) + dot(node.tangents[a], ddb)
    }
}

/// ∇(F/|∇F|) = ∇F/|∇F| − F H∇F/|∇F|³ with F/|∇F| = r.
fn along(jet: &Jet2, r: f64) -> Point3 {
    let g = jet.g;
    let length = dot(g, g).sqrt();
    let bent = r / (length * length);
    std::array::from_fn(|i| {
        let hg: f64 = (0..3).map(|j| jet.second(i, j) * g[j]).sum();
        g[i] / length - bent * hg
    })
}

/// The gradient of the distance by z times its second derivative along a step, where z moves by
/// `by`; twice the weight times that.
pub(crate) fn bend_of_distance(
    node: &Node,
    by: &[f64; 12],
    jet: &Jet2,
    objective: &Objective<'_>,
    weight: f64,
) -> [f64; 12] {
    let second = Motion::new(node, by).distance(jet, objective.method);
    let mut sum = [0.0; 12];
    for (s, first) in sum.iter_mut().zip(node.distance_gradient(jet)) {
        *s = 2.0 * weight * second * first;
    }
    sum
}

/// The same of what makes L and R, with their factors.
pub(crate) fn bend_of_shape(
    node: &Node,
    by: &[f64; 12],
    objective: &Objective<'_>,
    weight: f64,
) -> [f64; 12] {
    let (targets, factors) = (&objective.targets, &objective.weights);
    let motion = Motion::new(node, by);
    let mut sum = [0.0; 12];
    let mut add = |factor: f64, second: f64, form: &Form| {
        for (s, first) in sum.iter_mut().zip(form.first) {
            *s += 2.0 * weight * factor * second * first;
        }
    };
    let [x, y, both] = objective.inner.factors(targets);
    let (g11, g22) = (
        Form::new(node, (0, 0), false),
        Form::new(node, (1, 1), false),
    );
    let (u, v) = (motion.form(node, (0, 0)), motion.form(node, (1, 1)));
    add(factors.l * x, u, &g11);
    add(factors.l * y, v, &g22);
    if both > 0.0 {
        let sum = g11.blend(1.0 / targets.l1, &g22, 1.0 / targets.l2);
        add(factors.l * both, u / targets.l1 + v / targets.l2, &sum);
    }
    let angle = motion.form(node, (0, 1));
    add(factors.r, angle, &Form::new(node, (0, 1), false));
    sum
}

/// Gradient and second derivatives of the integrand of S by z, times the quadrature weight.
#[derive(Clone, Debug)]
pub(crate) struct Local {
    pub(crate) gradient: [f64; 12],
    pub(crate) hessian: [[f64; 12]; 12],
}

impl Default for Local {
    fn default() -> Self {
        Self {
            gradient: [0.0; 12],
            hessian: [[0.0; 12]; 12],
        }
    }
}

impl Local {
    /// Adds I's integrand; `third` is used by Newton's method only.
    pub(crate) fn add_distance(
        &mut self,
        node: &Node,
        jet: &Jet2,
        third: Option<&Jet3>,
        objective: &Objective<'_>,
        weight: f64,
    ) {
        self.distance(
            node,
            jet,
            third,
            objective.method,
            node.distance(jet),
            weight,
        );
    }

    /// Adds those of L, R, and of J where that is an integral.
    pub(crate) fn add_shape(&mut self, node: &Node, objective: &Objective<'_>, weight: f64) {
        let (method, targets, factors) = (objective.method, &objective.targets, &objective.weights);
        let r = node.residuals(targets);
        if !objective.is_by_control() {
            let x = node.z[3] - 1.0;
            let k = f64::from(K);
            self.gradient[3] += weight * factors.j * k * x.powi(K - 1);
            self.hessian[3][3] += weight * factors.j * k * (k - 1.0) * x.powi(K - 2);
        }
        let exact = method == Method::Newton;
        let [x, y, both] = objective.inner.factors(targets);
        let mut add = |r: f64, s: f64, form: &Form| self.form(r, form, s);
        let (g11, g22) = (
            Form::new(node, (0, 0), exact),
            Form::new(node, (1, 1), exact),
        );
        add(r.u, weight * factors.l * x, &g11);
        add(r.v, weight * factors.l * y, &g22);
        if both > 0.0 {
            let sum = g11.blend(1.0 / targets.l1, &g22, 1.0 / targets.l2);
            add(
                r.u / targets.l1 + r.v / targets.l2,
                weight * factors.l * both,
                &sum,
            );
        }
        add(r.angle, weight * factors.r, &Form::new(node, (0, 1), exact));
    }

    /// Adds a residual with value, gradient and, where it counts, second derivatives: s r² with 2 s
    /// (∇r ∇rᵀ + r ∇²r).
    fn square<const N: usize>(
        &mut self,
        places: &[usize; N],
        r: f64,
        first: &[f64; N],
        second: Option<&[[f64; N]; N]>,
        s: f64,
    ) {
        for a in 0..N {
            self.gradient[places[a]] += 2.0 * s * r * first[a];
            for b in 0..N {
                let curved = second.map_or(0.0, |h| r * h[a][b]);
                self.hessian[places[a]][places[b]] += 2.0 * s * (first[a] * first[b] + curved);
            }
        }
    }

    /// The same with all of z.
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

    /// F²/|∇F|².
    fn distance(
        &mut self,
        node: &Node,
        jet: &Jet2,
        third: Option<&Jet3>,
        method: Method,
        r: f64,
        weight: f64,
    ) {
        let (w, p, g) = (node.z[3], node.point, jet.g);
        let length = dot(g, g).sqrt();
        if length == 0.0 {
            return;
        }
        // ∇(F/|∇F|) = ∇F/|∇F| − F H∇F/|∇F|³.
        let hg: Point3 = std::array::from_fn(|i| (0..3).map(|j| jet.second(i, j) * g[j]).sum());
        let bent = if method == Method::Frozen {
            0.0
        } else {
            r / (length * length)
        };
        let d: Point3 = std::array::from_fn(|i| g[i] / length - bent * hg[i]);
        // By p*: N enters as N/w.
        let first = [d[0] / w, d[1] / w, d[2] / w, -dot(d, p) / w];
        let Some(third) = third else {
            self.square(&[0, 1, 2, 3], r, &first, None, weight);
            return;
        };
        let t = third_derivatives(third);
        let s3 = 1.0 / (length * length * length);
        let mut second_p = [[0.0; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                let tg: f64 = (0..3).map(|k| t[i][j][k] * g[k]).sum();
                let hh: f64 = (0..3).map(|k| jet.second(i, k) * jet.second(k, j)).sum();
                let s_ij = -s3 * (tg + hh) + 3.0 * s3 * hg[i] * hg[j] / (length * length);
                second_p[i][j] =
                    jet.second(i, j) / length - s3 * (g[i] * hg[j] + g[j] * hg[i]) + jet.v * s_ij;
            }
        }
        // ∂p/∂z: the identity over w for N, −p/w for w; ∂²p_k/∂N_k∂w = −1/w², ∂²p_k/∂w² = 2 p_k/w².
        let along = |i: usize, k: usize| {
            if i == 3 {
                -p[k] / w
            } else {
                f64::from(u8::from(i == k)) / w
            }
        };
        let mut second = [[0.0; 4]; 4];
        for a in 0..4 {
            for b in 0..4 {
                for i in 0..3 {
                    for j in 0..3 {
                        second[a][b] += along(a, i) * second_p[i][j] * along(b, j);
                    }
                }
            }
        }
        for k in 0..3 {
            second[k][3] -= d[k] / (w * w);
            second[3][k] -= d[k] / (w * w);
            second[3][3] += 2.0 * d[k] * p[k] / (w * w);
        }
        self.square(&[0, 1, 2, 3], r, &first, Some(&second), weight);
    }
}

/// The derivatives of ⟨pₐ, p_b⟩ by z; second ones only where they are asked for.
struct Form {
    first: [f64; 12],
    second: Option<Box<[[f64; 12]; 12]>>,
}

impl Form {
    /// For a, b ∈ {u, v}.
    fn new(node: &Node, (a, b): (usize, usize), exact: bool) -> Self {
        let q = 1.0 / node.z[3];
        let (p, ta, tb, in_a, in_b) = (
            node.point,
            node.tangents[a],
            node.tangents[b],
            4 + 4 * a,
            4 + 4 * b,
        );
        let (wa, wb, along_a, along_b) = (
            q * node.z[in_a + 3],
            q * node.z[in_b + 3],
            dot(p, ta),
            dot(p, tb),
        );
        let mut first = [0.0; 12];
        for k in 0..3 {
            first[k] = -q * (wa * tb[k] + wb * ta[k]);
            first[in_a + k] += q * tb[k];
            first[in_b + k] += q * ta[k];
        }
        first[3] = q * (wa * along_b + wb * along_a - 2.0 * dot(ta, tb));
        first[in_a + 3] -= q * along_b;
        first[in_b + 3] -= q * along_a;
        Self {
            first,
            second: exact.then(|| Box::new(Self::second(node, (a, b)))),
        }
    }

    fn second(node: &Node, (a, b): (usize, usize)) -> [[f64; 12]; 12] {
        let mut second = [[0.0; 12]; 12];
        for k in 0..3 {
            let ((places_a, da), (places_b, db)) = (node.tangent(a, k), node.tangent(b, k));
            let (pa, pb) = (node.tangents[a][k], node.tangents[b][k]);
            let (ha, hb) = (node.tangent_second(a, k), node.tangent_second(b, k));
            for i in 0..4 {
                for j in 0..4 {
                    second[places_a[i]][places_a[j]] += pb * ha[i][j];
                    second[places_b[i]][places_b[j]] += pa * hb[i][j];
                    second[places_a[i]][places_b[j]] += da[i] * db[j];
                    second[places_b[j]][places_a[i]] += da[i] * db[j];
                }
            }
        }
        second
    }

    /// s self + t other.
    fn blend(&self, s: f64, other: &Self, t: f64) -> Self {
        let sum = |a: &[f64; 12], b: &[f64; 12]| std::array::from_fn(|k| s * a[k] + t * b[k]);
        let both = self.second.as_ref().zip(other.second.as_ref());
        let second = both.map(|(a, b)| Box::new(std::array::from_fn(|k| sum(&a[k], &b[k]))));
        Self {
            first: sum(&self.first, &other.first),
            second,
        }
    }
}

/// All third derivatives as a full array.
fn third_derivatives(j: &Jet3) -> [[[f64; 3]; 3]; 3] {
    // Places of the sorted triples xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz.
    let place = |mut t: [usize; 3]| {
        t.sort_unstable();
        match t {
            [0, 0, k] => k,
            [0, 1, k] => 2 + k,
            [0, ..] => 5,
            [1, 1, k] => 5 + k,
            [1, ..] => 8,
            _ => 9,
        }
    };
    std::array::from_fn(|a| std::array::from_fn(|b| std::array::from_fn(|c| j.t[place([a, b, c])])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::Polynomial;
    use isoform_geom::Field;

    /// Second derivatives along a step are those of differences: of points, tangents, their
    /// products, and of the distance on the surface.
    #[test]
    fn motions_bend_as_differences_say() {
        // Vanishes at (0.2, 0.3, −0.1), where the node is.
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
