//! The objective S = I + ω_J J + ω_L L + ω_R R + ω_E E (Wurm, Jüttler and Kim 2003, equation (1))
//! with its derivatives.
//!
//! - I = ∬ F²/|∇F|² du dv, the mean squared Sampson distance (3)
//! - J = ∬ (w − 1)ᴷ du dv with K = 8, section 2.3
//! - L = ∬ (g₁₁ − l₁)² + (g₂₂ − l₂)² du dv and R = ∬ g₁₂² du dv, section 2.4
//! - E = Σ |p(uᵢ, vᵢ) − Pᵢ|² over the four corners, section 2.5
//!
//! Remark 1's functional (5), a choice, is ∫ (|D(φ)|² − 1)² dφ for the tangent vectors D(φ) = cos φ
//! pᵤ/√l₁ + sin φ pᵥ/√l₂, unit vectors where p is an isometric rectangle; the paper prints l₂ and
//! l₁ in place of 1/l₁ and 1/l₂, with which they are not, and loses a plus sign. With a = g₁₁/l₁ −
//! 1 and b = g₂₂/l₂ − 1 it is π (a²/2 + b²/2 + (a + b)²/4 + g₁₂²/(l₁l₂)). Times l₁l₂/π the last
//! term is R's integrand: the others take the place of L's.
//!
//! Every integrand is a function of the twelve numbers z = (p*, p*ᵤ, p*ᵥ) at a node, so that its
//! derivatives by the control points are those by z, 12 and 12 × 12 of them, carried over by the
//! Bernstein basis. That last step uses the tensor product: first over the nodes in v, then over
//! those in u, which costs a quarter of summing node by node.

use crate::local::{Local, Node, bend_of_distance, bend_of_shape};
use isoform_geom::{Field, Point3, RationalPatch, bernstein, cross, distance_squared, dot, sub};
use isoform_num::{Jet2, Jet3, gauss_legendre};

/// The exponent K of J (section 2.3).
pub const K: i32 = 8;
/// Nodes where only these three kinds of numbers occur: p*, p*ᵤ, p*ᵥ.
const KINDS: usize = 3;
/// Nodes for L and R beyond the degree, in each direction: their integrands are nearly squares of
/// polynomials of that degree less one. With two less patches get smaller.
const SHAPE_NODES: usize = 3;
/// The corner parameters (uᵢ, vᵢ) of E, in the order of [`Targets::corners`].
pub(crate) const CORNERS: [(f64, f64); 4] = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];

/// Calls a function with the number of control points in a row as a constant, which lets its loops
/// be unrolled.
macro_rules! sized {
    ($n:expr, $f:ident($($argument:expr),*)) => {
        match $n {
            2 => $f::<2>($($argument),*),
            3 => $f::<3>($($argument),*),
            4 => $f::<4>($($argument),*),
            5 => $f::<5>($($argument),*),
            6 => $f::<6>($($argument),*),
            7 => $f::<7>($($argument),*),
            8 => $f::<8>($($argument),*),
            _ => $f::<9>($($argument),*),
        }
    };
}

/// The factors ω of equation (1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// ω_J.
    pub j: f64,
    /// ω_L.
    pub l: f64,
    /// ω_R.
    pub r: f64,
    /// ω_E.
    pub e: f64,
}

impl Weights {
    /// The values at the start of Table 2.
    pub const START: Self = Self {
        j: 100.0,
        l: 1.0,
        r: 1.0,
        e: 1e-2,
    };
    /// The lower thresholds of Table 2.
    pub const FLOOR: Self = Self {
        j: 1e-1,
        l: 1e-5,
        r: 1e-5,
        e: 1e-4,
    };
    /// All factors times `s`.
    pub fn scaled(self, s: f64) -> Self {
        Self {
            j: s * self.j,
            l: s * self.l,
            r: s * self.r,
            e: s * self.e,
        }
    }
}

/// The values of the terms of equation (1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms {
    /// I.
    pub i: f64,
    /// J.
    pub j: f64,
    /// L.
    pub l: f64,
    /// R.
    pub r: f64,
    /// E.
    pub e: f64,
    /// The mean squared distances of sides from the edges that they shall lie on.
    pub sides: f64,
}

impl Terms {
    /// S = I + ω_J J + ω_L L + ω_R R + ω_E E, and what sides add.
    pub fn sum(&self, w: &Weights) -> f64 {
        self.i + w.j * self.j + w.l * self.l + w.r * self.r + w.e * self.e + self.sides
    }
}

/// What a patch is drawn to: the squared lengths l₁, l₂ of L and the points Pᵢ of E (section 3.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Targets {
    /// l₁, the aim of g₁₁.
    pub l1: f64,
    /// l₂, the aim of g₂₂.
    pub l2: f64,
    /// Pᵢ for the corners (0,0), (1,0), (0,1), (1,1).
    pub corners: [Point3; 4],
}

/// What measures the lengths of tangents in L.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Inner {
    /// (g₁₁ − l₁)² + (g₂₂ − l₂)², section 2.4.
    #[default]
    Lengths,
    /// Remark 1: tangents in all directions; with a = g₁₁/l₁ − 1 and b = g₂₂/l₂ − 1, l₁l₂ (a²/2 +
    /// b²/2 + (a + b)²/4).
    Tangents,
}

impl Inner {
    /// L's integrand as a sum of three squares for x = g₁₁ − l₁ and y = g₂₂ − l₂: the factors of
    /// x², y² and (x/l₁ + y/l₂)².
    pub(crate) fn factors(self, t: &Targets) -> [f64; 3] {
        match self {
            Self::Lengths => [1.0, 1.0, 0.0],
            Self::Tangents => [0.5 * t.l2 / t.l1, 0.5 * t.l1 / t.l2, 0.25 * t.l1 * t.l2],
        }
    }
}

/// How second derivatives of S are had.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Gauss-Newton with the residual F/|∇F|, whose gradient contains second derivatives of F.
    #[default]
    GaussNewton,
    /// Gauss-Newton with |∇F| taken as constant: first derivatives of F only.
    Frozen,
    /// The paper's Newton method: all second derivatives, with third derivatives of F.
    Newton,
}

/// A quadrature rule with the Bernstein basis at its nodes, for one degree.
#[derive(Clone, Debug)]
struct Basis {
    weights: Vec<f64>,
    /// By node and index: B, then B′.
    b: Vec<[Vec<f64>; 2]>,
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

/// The objective for patches of one degree on one surface.
pub struct Objective<'f> {
    field: &'f dyn Field,
    pub(crate) method: Method,
    degree: (usize, usize),
    u: Basis,
    v: Basis,
    /// A rule of fewer nodes for L and R, where their values do not matter in themselves.
    shape: Option<[Basis; 2]>,
    pub(crate) inner: Inner,
    /// The factors ω.
    pub weights: Weights,
    /// Lengths and corners.
    pub targets: Targets,
    /// What shall vanish along the sides u = 0, u = 1, v = 0, v = 1.
    pub(crate) sides: [Option<&'f dyn Field>; 4],
    /// I below this is no reason to lower factors.
    pub(crate) little: f64,
    /// J is the mean of (w − 1)ᴷ over the control points, which keeps all their weights positive.
    by_control: bool,
    /// Steps follow the bends of valleys. With a bound on S, where shape terms keep these wide,
    /// little is gained, and rounding at the start, where S does not know its scale, has more say.
    pub(crate) bends: bool,
    /// How much the distance counts at the nodes; none: as much everywhere.
    pub(crate) importance: Vec<f64>,
}

/// The objective's value at a patch, with what its derivatives need.
#[derive(Clone, Debug, Default)]
pub struct Evaluated {
    /// The terms.
    pub terms: Terms,
    nodes: Vec<Node>,
    /// Those of the rule for L and R, if they have one of their own.
    shape: Vec<Node>,
    points: Vec<Point3>,
    jets: Vec<Jet2>,
}

/// Gradient and symmetric second derivatives (row-major) of S by the unknowns, in the order x of
/// all control points, then y, z, w.
#[derive(Clone, Debug, Default)]
pub struct Derivatives {
    /// ∂S/∂α.
    pub gradient: Vec<f64>,
    /// ∂²S/∂α∂β or what stands for it.
    pub hessian: Vec<f64>,
}

impl std::fmt::Debug for Objective<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Objective")
            .field("degree", &self.degree)
            .field("method", &self.method)
            .finish_non_exhaustive()
    }
}

impl<'f> Objective<'f> {
    /// For patches of degree (m, n) from 1 to [`crate::MOST_DEGREE`], with `nodes` quadrature nodes
    /// in each direction; none: as many as make J exact, K max(m, n)/2 + 1.
    ///
    /// # Panics
    /// If a degree is out of its range.
    pub fn new(
        field: &'f dyn Field,
        degree: (usize, usize),
        method: Method,
        nodes: Option<usize>,
    ) -> Self {
        let range = 1..=crate::MOST_DEGREE;
        assert!(
            range.contains(&degree.0) && range.contains(&degree.1),
            "degree {degree:?}"
        );
        let nodes = nodes
            .unwrap_or(K as usize / 2 * degree.0.max(degree.1) + 1)
            .max(2);
        let targets = Targets {
            l1: 1.0,
            l2: 1.0,
            corners: [[0.0; 3]; 4],
        };
        let (u, v) = (Basis::new(degree.0, nodes), Basis::new(degree.1, nodes));
        Self {
            field,
            method,
            degree,
            u,
            v,
            shape: None,
            inner: Inner::default(),
            weights: Weights::START,
            targets,
            sides: [None; 4],
            little: 0.0,
            by_control: false,
            bends: false,
            importance: Vec::new(),
        }
    }

    /// The same with another L.
    pub fn with_inner(self, inner: Inner) -> Self {
        Self { inner, ..self }
    }
    /// Quadrature nodes in each direction.
    pub fn nodes_per_direction(&self) -> usize {
        self.u.weights.len()
    }
    /// Chooses another rule.
    pub(crate) fn set_nodes(&mut self, nodes: usize) {
        (self.u, self.v) = (
            Basis::new(self.degree.0, nodes),
            Basis::new(self.degree.1, nodes),
        );
    }
    /// For a tolerance: J by control points, and L and R, which only keep a patch in shape, with
    /// fewer nodes than the distance needs.
    pub(crate) fn keep_shape_loosely(&mut self) {
        self.by_control = true;
        let nodes = self.degree.0.max(self.degree.1) + SHAPE_NODES;
        self.shape = (nodes < self.u.weights.len()).then(|| {
            [
                Basis::new(self.degree.0, nodes),
                Basis::new(self.degree.1, nodes),
            ]
        });
    }
    /// Whether J is that of control points.
    pub(crate) fn is_by_control(&self) -> bool {
        self.by_control
    }
    /// The rule for L and R.
    fn shape_rule(&self) -> [&Basis; 2] {
        self.shape
            .as_ref()
            .map_or([&self.u, &self.v], |[u, v]| [u, v])
    }
    /// The number of unknowns, 4 (m + 1)(n + 1).
    pub fn unknowns(&self) -> usize {
        4 * (self.degree.0 + 1) * (self.degree.1 + 1)
    }
    /// The surface.
    pub fn field(&self) -> &'f dyn Field {
        self.field
    }
    /// S at the terms' values.
    pub fn sum(&self, terms: &Terms) -> f64 {
        terms.sum(&self.weights)
    }

    /// The terms at a patch; none where w ≤ 0 at a node or F is not finite.
    pub fn evaluate(&self, patch: &RationalPatch) -> Option<Evaluated> {
        let nodes = self.nodes(patch)?;
        let shape = match &self.shape {
            Some(rule) => Self::nodes_of([&rule[0], &rule[1]], patch)?,
            None => Vec::new(),
        };
        let points: Vec<Point3> = nodes.iter().map(|z| z.point).collect();
        let mut jets = vec![
            Jet2 {
                v: 0.0,
                g: [0.0; 3],
                h: [0.0; 6]
            };
            points.len()
        ];
        self.field.jets(&points, &mut jets);
        self.terms(patch, &self.targets, (nodes, shape), points, jets)
    }

    /// The terms at a patch with other targets.
    pub(crate) fn evaluate_with(
        &self,
        patch: &RationalPatch,
        targets: &Targets,
    ) -> Option<Evaluated> {
        let at = self.evaluate(patch)?;
        self.with_targets(patch, at, targets)
    }

    /// The same patch's value with other targets.
    pub(crate) fn with_targets(
        &self,
        patch: &RationalPatch,
        at: Evaluated,
        targets: &Targets,
    ) -> Option<Evaluated> {
        self.terms(patch, targets, (at.nodes, at.shape), at.points, at.jets)
    }

    /// The means of g₁₁ and g₂₂: with these l₁ and l₂ a patch has the least L.
    pub(crate) fn mean_lengths(&self, at: &Evaluated) -> (f64, f64) {
        self.mean(&at.nodes)
    }
    /// The same of a patch that is not evaluated; none where w ≤ 0.
    pub(crate) fn lengths(&self, patch: &RationalPatch) -> Option<(f64, f64)> {
        Some(self.mean(&self.nodes(patch)?))
    }
    /// The area of the patch.
    pub(crate) fn area(&self, at: &Evaluated) -> f64 {
        let mut nodes = at.nodes.iter();
        let mut sum = 0.0;
        for wu in &self.u.weights {
            for (wv, node) in self.v.weights.iter().zip(&mut nodes) {
                let n = cross(node.tangents[0], node.tangents[1]);
                sum += wu * wv * dot(n, n).sqrt();
            }
        }
        sum
    }
    fn mean(&self, nodes: &[Node]) -> (f64, f64) {
        let mut nodes = nodes.iter();
        let (mut l1, mut l2) = (0.0, 0.0);
        for wu in &self.u.weights {
            for (wv, node) in self.v.weights.iter().zip(&mut nodes) {
                let [pu, pv] = node.tangents;
                l1 += wu * wv * dot(pu, pu);
                l2 += wu * wv * dot(pv, pv);
            }
        }
        (l1, l2)
    }

    fn terms(
        &self,
        patch: &RationalPatch,
        t: &Targets,
        (nodes, shape): (Vec<Node>, Vec<Node>),
        points: Vec<Point3>,
        jets: Vec<Jet2>,
    ) -> Option<Evaluated> {
        let mut terms = Terms::default();
        let mut all = nodes.iter().zip(&jets).enumerate();
        for wu in &self.u.weights {
            for (wv, (k, (node, jet))) in self.v.weights.iter().zip(&mut all) {
                let (weight, distance) = (wu * wv, node.distance(jet));
                terms.i += weight * self.importance(k) * distance * distance;
                if !self.by_control {
                    terms.j += weight * (node.z[3] - 1.0).powi(K);
                }
            }
        }
        let ([u, v], factors) = (self.shape_rule(), self.inner.factors(t));
        let mut all = if self.shape.is_some() { &shape } else { &nodes }.iter();
        for wu in &u.weights {
            for (wv, node) in v.weights.iter().zip(&mut all) {
                let (weight, r) = (wu * wv, node.residuals(t));
                let both = r.u / t.l1 + r.v / t.l2;
                terms.l += weight
                    * (factors[0] * r.u * r.u + factors[1] * r.v * r.v + factors[2] * both * both);
                terms.r += weight * r.angle * r.angle;
            }
        }
        if self.by_control {
            let all = patch.control();
            terms.j = all.iter().map(|c| (c[3] - 1.0).powi(K)).sum::<f64>() / all.len() as f64;
        }
        for (i, &(u, v)) in CORNERS.iter().enumerate() {
            let c = patch.control()[self.corner(u, v)];
            if c[3] <= 0.0 {
                return None;
            }
            terms.e += distance_squared([c[0] / c[3], c[1] / c[3], c[2] / c[3]], t.corners[i]);
        }
        for (side, edge) in self.sides.iter().enumerate() {
            let Some(edge) = edge else { continue };
            for (_, weight, z) in self.along(patch, side) {
                let r = Self::residual(*edge, z)?.0;
                terms.sides += weight * r * r;
            }
        }
        let finite = [terms.i, terms.j, terms.l, terms.r, terms.e, terms.sides]
            .iter()
            .all(|t| t.is_finite());
        finite.then_some(Evaluated {
            terms,
            nodes,
            shape,
            points,
            jets,
        })
    }

    /// How much the distance counts at a node.
    fn importance(&self, node: usize) -> f64 {
        self.importance.get(node).copied().unwrap_or(1.0)
    }

    /// Lets distances count more towards the border: by (4u(1 − u))^−power in each direction, 1 in
    /// the mean.
    pub(crate) fn weigh_border(&mut self, power: f64) {
        let of = |x: &f64| (4.0 * x * (1.0 - x)).powf(-power);
        let (u, v) = (
            gauss_legendre(self.u.weights.len()).0,
            gauss_legendre(self.v.weights.len()).0,
        );
        let all: Vec<f64> = u
            .iter()
            .flat_map(|u| v.iter().map(move |v| of(u) * of(v)))
            .collect();
        let mean: f64 = all
            .iter()
            .zip(
                self.u
                    .weights
                    .iter()
                    .flat_map(|a| self.v.weights.iter().map(move |b| a * b)),
            )
            .map(|(i, w)| i * w)
            .sum();
        self.importance = all.into_iter().map(|i| i / mean).collect();
    }

    /// The index of the control point at a corner.
    fn corner(&self, u: f64, v: f64) -> usize {
        let (m, n) = self.degree;
        (if u > 0.5 { m * (n + 1) } else { 0 }) + if v > 0.5 { n } else { 0 }
    }

    /// The nodes, those of one u after the other; none where w ≤ 0.
    fn nodes(&self, patch: &RationalPatch) -> Option<Vec<Node>> {
        Self::nodes_of([&self.u, &self.v], patch)
    }

    /// The same of a rule.
    fn nodes_of(rule: [&Basis; 2], patch: &RationalPatch) -> Option<Vec<Node>> {
        Self::homogeneous(rule, patch.control())
            .into_iter()
            .map(Node::new)
            .collect()
    }

    /// p*, p*ᵤ, p*ᵥ at all nodes of a rule for these control points.
    fn homogeneous(rule: [&Basis; 2], control: &[[f64; 4]]) -> Vec<[f64; 12]> {
        let [in_u, in_v] = rule;
        let n = in_v.b[0][0].len() - 1;
        let mut nodes = Vec::with_capacity(in_u.b.len() * in_v.b.len());
        for [a, da] in &in_u.b {
            // The curve over v at this u, and its derivative by u.
            let mut row = [[[0.0; 4]; 2]; crate::MOST_DEGREE + 1];
            let row = &mut row[..=n];
            for (i, controls) in control.chunks(n + 1).enumerate() {
                for (row, c) in row.iter_mut().zip(controls) {
                    for k in 0..4 {
                        row[0][k] += a[i] * c[k];
                        row[1][k] += da[i] * c[k];
                    }
                }
            }
            for [b, db] in &in_v.b {
                let mut z = [0.0; 12];
                for (j, row) in row.iter().enumerate() {
                    for k in 0..4 {
                        z[k] += b[j] * row[0][k];
                        z[4 + k] += b[j] * row[1][k];
                        z[8 + k] += db[j] * row[0][k];
                    }
                }
                nodes.push(z);
            }
        }
        nodes
    }

    /// How residuals bend along a step of the unknowns: the gradient of S, were every residual its
    /// second derivative along that step. Those of J, which has no residuals to speak of, and of
    /// sides are left out.
    pub(crate) fn bending(&self, patch: &RationalPatch, at: &Evaluated, step: &[f64]) -> Vec<f64> {
        let (m, n) = self.degree;
        let count = (m + 1) * (n + 1);
        let moved: Vec<[f64; 4]> = (0..count)
            .map(|i| std::array::from_fn(|k| step[k * count + i]))
            .collect();
        let mut sums = vec![0.0; 4 * count];
        let rule = [&self.u, &self.v];
        let mut all = at.nodes.iter().zip(&at.jets).enumerate();
        self.add_bending(rule, &moved, &mut sums, |weight, by| {
            let (k, (node, jet)) = all.next().expect("a node for each of the rule");
            let own = bend_of_distance(node, by, jet, self, weight * self.importance(k));
            // Where there is one rule for all.
            match self.shape {
                Some(_) => own,
                None => {
                    let shape = bend_of_shape(node, by, self, weight);
                    std::array::from_fn(|i| own[i] + shape[i])
                }
            }
        });
        if self.shape.is_some() {
            let mut all = at.shape.iter();
            self.add_bending(self.shape_rule(), &moved, &mut sums, |weight, by| {
                let node = all.next().expect("a node for each of the rule");
                bend_of_shape(node, by, self, weight)
            });
        }
        self.corner_bending(patch, &moved, &mut sums);
        sums
    }

    /// Adds the sums over the nodes of a rule of what `bend` tells of each by z, for its weight and
    /// what z moves by.
    fn add_bending(
        &self,
        rule: [&Basis; 2],
        moved: &[[f64; 4]],
        sums: &mut [f64],
        mut bend: impl FnMut(f64, &[f64; 12]) -> [f64; 12],
    ) {
        let (m, n) = self.degree;
        let count = (m + 1) * (n + 1);
        let motion = Self::homogeneous(rule, moved);
        let (mut motion, [in_u, in_v]) = (motion.iter(), rule);
        for ([a, da], wu) in in_u.b.iter().zip(&in_u.weights) {
            let mut row = [[[0.0; 4]; 2]; crate::MOST_DEGREE + 1];
            for (([b, db], wv), by) in in_v.b.iter().zip(&in_v.weights).zip(&mut motion) {
                let g = bend(wu * wv, by);
                for (j, row) in row[..=n].iter_mut().enumerate() {
                    for d in 0..4 {
                        row[0][d] += g[d] * b[j] + g[8 + d] * db[j];
                        row[1][d] += g[4 + d] * b[j];
                    }
                }
            }
            for i in 0..=m {
                for (j, row) in row[..=n].iter().enumerate() {
                    for d in 0..4 {
                        sums[d * count + i * (n + 1) + j] += a[i] * row[0][d] + da[i] * row[1][d];
                    }
                }
            }
        }
    }

    /// Adds what ω_E E contributes.
    fn corner_bending(&self, patch: &RationalPatch, moved: &[[f64; 4]], sums: &mut [f64]) {
        let count = moved.len();
        for &(u, v) in &CORNERS {
            let at = self.corner(u, v);
            let (c, by) = (patch.control()[at], moved[at]);
            for k in 0..3 {
                let p = c[k] / c[3];
                let second = -2.0 * (by[k] - p * by[3]) * by[3] / (c[3] * c[3]);
                sums[k * count + at] += 2.0 * self.weights.e * second / c[3];
                sums[3 * count + at] -= 2.0 * self.weights.e * second * p / c[3];
            }
        }
    }

    /// Gradient and second derivatives of S. None if Newton's method is asked of a field without
    /// third derivatives.
    pub fn derivatives(&self, patch: &RationalPatch, at: &Evaluated) -> Option<Derivatives> {
        let (m, n) = self.degree;
        let count = (m + 1) * (n + 1);
        let size = 4 * count;
        let mut d = Derivatives {
            gradient: vec![0.0; size],
            hessian: vec![0.0; size * size],
        };
        if self.shape.is_some() && self.method != Method::Newton {
            sized!(n + 1, distance_terms(self, at, m + 1, &mut d));
        } else {
            self.node_terms([&self.u, &self.v], &mut d, |k, weight| {
                let node = &at.nodes[k];
                let third: Option<Jet3> = if self.method == Method::Newton {
                    Some(self.field.jet3(at.points[k])?)
                } else {
                    None
                };
                let mut local = Local::default();
                let importance = weight * self.importance(k);
                local.add_distance(node, &at.jets[k], third.as_ref(), self, importance);
                if self.shape.is_none() {
                    local.add_shape(node, self, weight);
                }
                Some(local)
            })?;
        }
        if self.shape.is_some() {
            self.node_terms(self.shape_rule(), &mut d, |k, weight| {
                let mut local = Local::default();
                local.add_shape(&at.shape[k], self, weight);
                Some(local)
            })?;
        }
        if self.by_control {
            self.control_terms(patch, &mut d);
        }
        self.corner_terms(patch, &mut d);
        self.side_terms(patch, &mut d);
        // Blocks of coordinates k > l are the transposes of those with k < l.
        for row in 0..size {
            for column in 0..row / count * count {
                d.hessian[row * size + column] = d.hessian[column * size + row];
            }
        }
        Some(d)
    }

    /// Adds the sums over the nodes of a rule of what `local` tells of each, for its number and its
    /// weight; none where that is none.
    fn node_terms(
        &self,
        [in_u, in_v]: [&Basis; 2],
        d: &mut Derivatives,
        mut local: impl FnMut(usize, f64) -> Option<Local>,
    ) -> Option<()> {
        let (m, n) = self.degree;
        let mut inner = vec![0.0; 4 * 16 * (n + 1) * (n + 1)];
        let mut side = vec![0.0; 2 * 4 * (n + 1)];
        let mut k = 0;
        for (a, wu) in in_u.b.iter().zip(&in_u.weights) {
            let mut locals = Vec::with_capacity(in_v.b.len());
            for wv in &in_v.weights {
                locals.push(local(k, wu * wv)?);
                k += 1;
            }
            sized!(n + 1, over_v(&locals, &in_v.b, &mut inner, &mut side));
            sized!(n + 1, over_u(a, m + 1, &inner, &side, d));
        }
        Some(())
    }

    /// The residuals √weight F/|∇F| at all nodes and their derivatives by the unknowns with |∇F|
    /// taken as constant, row by row.
    pub(crate) fn distance_rows(&self, at: &Evaluated) -> (Vec<f64>, Vec<f64>) {
        let (m, n) = self.degree;
        let count = (m + 1) * (n + 1);
        let (mut rows, mut residuals) = (
            Vec::with_capacity(at.nodes.len() * 4 * count),
            Vec::with_capacity(at.nodes.len()),
        );
        let mut nodes = at.nodes.iter().zip(&at.jets);
        for ([a, _], wu) in self.u.b.iter().zip(&self.u.weights) {
            for (([b, _], wv), (node, jet)) in self.v.b.iter().zip(&self.v.weights).zip(&mut nodes)
            {
                let root = (wu * wv).sqrt();
                residuals.push(root * node.distance(jet));
                let first = node.distance_gradient(jet);
                for f in first {
                    for x in a {
                        rows.extend(b.iter().map(|y| root * f * x * y));
                    }
                }
            }
        }
        (rows, residuals)
    }

    /// The control points of a side.
    fn side(&self, side: usize) -> Vec<usize> {
        let (m, n) = self.degree;
        match side {
            0 | 1 => (0..=n).map(|j| side * m * (n + 1) + j).collect(),
            _ => (0..=m).map(|i| i * (n + 1) + (side - 2) * n).collect(),
        }
    }

    /// Basis, weight and homogeneous point at the nodes along a side.
    fn along<'s>(
        &'s self,
        patch: &RationalPatch,
        side: usize,
    ) -> impl Iterator<Item = (&'s [f64], f64, [f64; 4])> + use<'s, 'f> {
        let basis = if side < 2 { &self.v } else { &self.u };
        let control: Vec<[f64; 4]> = self
            .side(side)
            .into_iter()
            .map(|k| patch.control()[k])
            .collect();
        basis
            .b
            .iter()
            .zip(&basis.weights)
            .map(move |([b, _], weight)| {
                let z =
                    std::array::from_fn(|k| b.iter().zip(&control).map(|(b, c)| b * c[k]).sum());
                (b.as_slice(), *weight, z)
            })
    }

    /// B/|∇B| at a homogeneous point, and its derivatives with |∇B| taken as constant.
    fn residual(edge: &dyn Field, z: [f64; 4]) -> Option<(f64, [f64; 4])> {
        let w = z[3];
        let p: Point3 = std::array::from_fn(|k| z[k] / w);
        let j = edge.jet(p);
        let length = dot(j.g, j.g).sqrt();
        let d = j.g.map(|g| g / (length * w));
        let r = j.v / length;
        (w > 0.0 && r.is_finite()).then_some((r, [d[0], d[1], d[2], -dot(d, p)]))
    }

    /// Adds what sides contribute.
    fn side_terms(&self, patch: &RationalPatch, d: &mut Derivatives) {
        let count = d.gradient.len() / 4;
        let size = 4 * count;
        for (side, edge) in self.sides.iter().enumerate() {
            let Some(edge) = edge else { continue };
            let places = self.side(side);
            for (b, weight, z) in self.along(patch, side) {
                let Some((r, first)) = Self::residual(*edge, z) else {
                    continue;
                };
                let by: Vec<(usize, f64)> = (0..4)
                    .flat_map(|k| {
                        places
                            .iter()
                            .zip(b)
                            .map(move |(at, b)| (k * count + at, first[k] * b))
                    })
                    .collect();
                for &(row, a) in &by {
                    d.gradient[row] += 2.0 * weight * r * a;
                    for &(column, b) in &by {
                        d.hessian[row * size + column] += 2.0 * weight * a * b;
                    }
                }
            }
        }
    }

    /// Adds ω_J J by control points.
    fn control_terms(&self, patch: &RationalPatch, d: &mut Derivatives) {
        let count = patch.control().len();
        let (size, k, factor) = (4 * count, f64::from(K), self.weights.j / count as f64);
        for (at, c) in patch.control().iter().enumerate() {
            let (x, row) = (c[3] - 1.0, 3 * count + at);
            d.gradient[row] += factor * k * x.powi(K - 1);
            d.hessian[row * size + row] += factor * k * (k - 1.0) * x.powi(K - 2);
        }
    }

    /// Adds ω_E E.
    fn corner_terms(&self, patch: &RationalPatch, d: &mut Derivatives) {
        let count = d.gradient.len() / 4;
        let size = 4 * count;
        for (i, &(u, v)) in CORNERS.iter().enumerate() {
            let at = self.corner(u, v);
            let c = patch.control()[at];
            let w = c[3];
            let p = [c[0] / w, c[1] / w, c[2] / w];
            let r = sub(p, self.targets.corners[i]);
            for k in 0..3 {
                // r_k by c_k and by w, and its second derivatives by (c_k, w) and (w, w).
                let places = [k * count + at, 3 * count + at];
                let first = [1.0 / w, -p[k] / w];
                let curved = if self.method == Method::Newton {
                    1.0
                } else {
                    0.0
                };
                let second = [
                    [0.0, -1.0 / (w * w)],
                    [-1.0 / (w * w), 2.0 * p[k] / (w * w)],
                ];
                for (a, &row) in places.iter().enumerate() {
                    d.gradient[row] += 2.0 * self.weights.e * r[k] * first[a];
                    for (b, &column) in places.iter().enumerate() {
                        d.hessian[row * size + column] += 2.0
                            * self.weights.e
                            * (first[a] * first[b] + curved * r[k] * second[a][b]);
                    }
                }
            }
        }
    }
}

/// Adds what I contributes, by Gauss-Newton: residuals depend on p* alone, so that there is one
/// product of basis functions instead of nine. M control points in u, N in v.
fn distance_terms<const N: usize>(
    objective: &Objective<'_>,
    at: &Evaluated,
    m: usize,
    d: &mut Derivatives,
) {
    let (gradient, hessian) = (
        d.gradient.as_chunks_mut::<N>().0,
        d.hessian.as_chunks_mut::<N>().0,
    );
    let basis: Vec<[f64; N]> = (objective.v.b.iter())
        .map(|[b, _]| std::array::from_fn(|j| b[j]))
        .collect();
    let mut nodes = at.nodes.iter().zip(&at.jets).enumerate();
    for ([a, _], wu) in objective.u.b.iter().zip(&objective.u.weights) {
        let mut side = [[0.0; N]; 4];
        let mut inner = [[[[0.0; N]; N]; 4]; 4];
        for ((b, wv), (k, (node, jet))) in (basis.iter().zip(&objective.v.weights)).zip(&mut nodes)
        {
            let weight = 2.0 * wu * wv * objective.importance(k);
            let (r, first) = (
                node.distance(jet),
                node.distance_slope(jet, objective.method),
            );
            for k in 0..4 {
                let x: [f64; N] = std::array::from_fn(|j| weight * first[k] * b[j]);
                for j in 0..N {
                    side[k][j] += r * x[j];
                }
                for l in k..4 {
                    for (out, x) in inner[k][l].iter_mut().zip(x) {
                        let x = x * first[l];
                        for j in 0..N {
                            out[j] += x * b[j];
                        }
                    }
                }
            }
        }
        for k in 0..4 {
            for i in 0..m {
                for j in 0..N {
                    gradient[k * m + i][j] += a[i] * side[k][j];
                }
            }
            for l in k..4 {
                for i in 0..m {
                    for (j, row) in inner[k][l].iter().enumerate() {
                        let start = (k * m * N + i * N + j) * 4 * m + l * m;
                        for (i2, out) in hessian[start..][..m].iter_mut().enumerate() {
                            let f = a[i] * a[i2];
                            for j2 in 0..N {
                                out[j2] += f * row[j2];
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The derivative in u and in v that a kind of numbers is made with: p* has (0, 0), p*ᵤ (1, 0), p*ᵥ
/// (0, 1).
const ORDERS: [(usize, usize); KINDS] = [(0, 0), (1, 0), (0, 1)];

/// The sums over v at one u. `inner` holds, by the orders (a, a′) in u and the coordinates (k, l),
/// an N × N matrix; `side` by a and k a vector.
fn over_v<const N: usize>(
    locals: &[Local],
    basis: &[[Vec<f64>; 2]],
    inner: &mut [f64],
    side: &mut [f64],
) {
    let (inner, side) = (inner.as_chunks_mut::<N>().0, side.as_chunks_mut::<N>().0);
    let basis: Vec<[[f64; N]; 2]> = basis
        .iter()
        .map(|b| [0, 1].map(|order| std::array::from_fn(|j| b[order][j])))
        .collect();
    let all = || locals.iter().zip(&basis);
    side.fill([0.0; N]);
    for (local, b) in all() {
        for (s, &(a, bs)) in ORDERS.iter().enumerate() {
            for k in 0..4 {
                let (g, out) = (local.gradient[4 * s + k], &mut side[a * 4 + k]);
                for j in 0..N {
                    out[j] += g * b[bs][j];
                }
            }
        }
    }
    for k in 0..4 {
        for l in k..4 {
            let c = |local: &Local, s: usize, t: usize| local.hessian[4 * s + k][4 * t + l];
            // By the orders in u: the sum of what multiplies B, and B′, from the left.
            let mut put = |orders: usize, sum: [[f64; N]; N]| {
                inner[(orders * 16 + 4 * k + l) * N..][..N].copy_from_slice(&sum)
            };
            put(
                0,
                sums(all().map(|(h, b)| (b, [c(h, 0, 0), c(h, 2, 0), c(h, 0, 2), c(h, 2, 2)]))),
            );
            put(
                1,
                sums(all().map(|(h, b)| (b, [c(h, 0, 1), c(h, 2, 1), 0.0, 0.0]))),
            );
            put(
                2,
                sums(all().map(|(h, b)| (b, [c(h, 1, 0), 0.0, c(h, 1, 2), 0.0]))),
            );
            put(
                3,
                sums(all().map(|(h, b)| (b, [c(h, 1, 1), 0.0, 0.0, 0.0]))),
            );
        }
    }
}

/// Σ (p B + q B′) Bᵀ + (r B + s B′) B′ᵀ over the nodes in v, with B, B′ and [p, q, r, s] at each.
#[inline(always)]
fn sums<'b, const N: usize>(
    terms: impl Iterator<Item = (&'b [[f64; N]; 2], [f64; 4])>,
) -> [[f64; N]; N] {
    let mut sum = [[0.0; N]; N];
    for ([b, d], [p, q, r, s]) in terms {
        for i in 0..N {
            let (x, y) = (p * b[i] + q * d[i], r * b[i] + s * d[i]);
            for j in 0..N {
                sum[i][j] += x * b[j] + y * d[j];
            }
        }
    }
    sum
}

/// Adds the sums over v at one u to the derivatives; m control points in u, N in v.
fn over_u<const N: usize>(
    a: &[Vec<f64>; 2],
    m: usize,
    inner: &[f64],
    side: &[f64],
    d: &mut Derivatives,
) {
    let (inner, side) = (inner.as_chunks::<N>().0, side.as_chunks::<N>().0);
    let count = m * N;
    let (gradient, hessian) = (
        d.gradient.as_chunks_mut::<N>().0,
        d.hessian.as_chunks_mut::<N>().0,
    );
    for k in 0..4 {
        for i in 0..m {
            for j in 0..N {
                gradient[k * m + i][j] += a[0][i] * side[k][j] + a[1][i] * side[4 + k][j];
            }
        }
        for l in k..4 {
            let block = |orders: usize| &inner[(orders * 16 + 4 * k + l) * N..][..N];
            let (r0, r1, r2, r3) = (block(0), block(1), block(2), block(3));
            for i in 0..m {
                for i2 in 0..m {
                    let f = [
                        a[0][i] * a[0][i2],
                        a[0][i] * a[1][i2],
                        a[1][i] * a[0][i2],
                        a[1][i] * a[1][i2],
                    ];
                    for j in 0..N {
                        let out = &mut hessian[(k * count + i * N + j) * 4 * m + l * m + i2];
                        for j2 in 0..N {
                            out[j2] += f[0] * r0[j][j2]
                                + f[1] * r1[j][j2]
                                + f[2] * r2[j][j2]
                                + f[3] * r3[j][j2];
                        }
                    }
                }
            }
        }
    }
}
