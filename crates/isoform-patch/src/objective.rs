//! The objective S = I + ω_J J + ω_L L + ω_R R + ω_E E (Wurm, Jüttler and Kim 2003, equation (1))
//! with its derivatives.
//!
//! - I = ∬ F²/|∇F|² du dv, the mean squared Sampson distance (3)
//! - J = ∬ (w − 1)ᴷ du dv with K = 8, section 2.3
//! - L = ∬ (g₁₁ − l₁)² + (g₂₂ − l₂)² du dv and R = ∬ g₁₂² du dv, section 2.4
//! - E = Σ |p(uᵢ, vᵢ) − Pᵢ|² over the four corners, section 2.5
//!
//! Remark 1's functional (5), a choice, is ∫ (|D(φ)|² − 1)² dφ for the tangent vectors
//!
//! D(φ) = cos φ pᵤ/√l₁ + sin φ pᵥ/√l₂,
//!
//! which are unit vectors where p is an isometric rectangle; the paper prints l₂ and l₁ in place
//! of 1/l₁ and 1/l₂, with which they are not, and omits a plus sign. With a = g₁₁/l₁ − 1 and
//! b = g₂₂/l₂ − 1 the functional is π (a²/2 + b²/2 + (a + b)²/4 + g₁₂²/(l₁l₂)). Multiplied by
//! l₁l₂/π, its last term is R's integrand; the others replace L's integrand.
//!
//! Every integrand is a function of the twelve numbers z = (p*, p*ᵤ, p*ᵥ) at a node, so its
//! derivatives by the control points follow from the 12 first and 12 × 12 second derivatives by z
//! through the Bernstein basis.

mod bending;
mod derivatives;
mod quadrature;
mod sides;
mod tensor;

use crate::node::Node;
use crate::terms::{CORNERS, Inner, K, Method, ShapeSettings, Targets, Terms, Weights};
use isoform_geom::{Field, Point3, RationalPatch, cross, distance_squared, dot};
use isoform_num::{Jet2, gauss_legendre};
use quadrature::QuadratureRule;

/// Objective for patches of one degree on one surface.
pub struct Objective<'f> {
    field: &'f dyn Field,
    pub(crate) method: Method,
    degree: (usize, usize),
    rule: QuadratureRule,
    /// Rule with fewer nodes for L and R, if their values need not be accurate.
    shape_rule: Option<QuadratureRule>,
    pub(crate) inner: Inner,
    /// Factors ω of the terms.
    pub weights: Weights,
    /// Target lengths and corners.
    pub targets: Targets,
    /// Functions that must vanish along the sides u = 0, u = 1, v = 0, v = 1; `None` for free
    /// sides.
    pub(crate) sides: [Option<&'f dyn Field>; 4],
    /// Value of I below which factors are not lowered further.
    pub(crate) little: f64,
    /// True if J is the mean of (w − 1)ᴷ over the control points, which keeps all their weights
    /// positive.
    is_by_control: bool,
    /// True if steps follow the bends of valleys. Not used with a bound on S: shape terms keep
    /// valleys wide there, so little is gained, and rounding has more influence at the start, where
    /// the scale of S is unknown.
    pub(crate) bends: bool,
    /// Factors of squared distances at the nodes; empty if all are 1.
    importance: Vec<f64>,
}

/// Samples of a patch at the nodes.
#[derive(Clone, Debug, Default)]
struct Samples {
    nodes: Vec<Node>,
    /// Nodes of the rule for L and R, if that differs.
    shape: Vec<Node>,
    points: Vec<Point3>,
    jets: Vec<Jet2>,
}

/// Value of the objective for a patch, with the data from which its derivatives are computed.
#[derive(Clone, Debug, Default)]
pub struct Evaluated {
    /// Terms of S.
    pub terms: Terms,
    samples: Samples,
}

/// Gradient and symmetric second derivatives (row-major) of S by the unknowns, in the order x of
/// all control points, then y, z, w.
#[derive(Clone, Debug, Default)]
pub struct Derivatives {
    /// First derivatives ∂S/∂α.
    pub gradient: Vec<f64>,
    /// Second derivatives ∂²S/∂α∂β, or their Gauss-Newton approximation.
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
    /// Creates the objective for patches of degree (m, n) from 1 to [`crate::MAX_PATCH_DEGREE`], with
    /// `nodes` quadrature nodes in each direction; `None` chooses the number with which J is exact,
    /// K max(m, n)/2 + 1.
    ///
    /// # Panics
    ///
    /// If a degree is out of its range.
    pub fn new(
        field: &'f dyn Field,
        degree: (usize, usize),
        method: Method,
        nodes: Option<usize>,
    ) -> Self {
        let range = 1..=crate::MAX_PATCH_DEGREE;
        assert!(
            range.contains(&degree.0) && range.contains(&degree.1),
            "degree {degree:?}"
        );
        let exact = K as usize / 2 * degree.0.max(degree.1) + 1;
        Self {
            field,
            method,
            degree,
            rule: QuadratureRule::new(degree, nodes.unwrap_or(exact).max(2)),
            shape_rule: None,
            inner: Inner::default(),
            weights: Weights::START,
            targets: Targets {
                l1: 1.0,
                l2: 1.0,
                corners: [[0.0; 3]; 4],
            },
            sides: [None; 4],
            little: 0.0,
            is_by_control: false,
            bends: false,
            importance: Vec::new(),
        }
    }

    /// Returns the objective with another integrand of L.
    pub fn with_inner(self, inner: Inner) -> Self {
        Self { inner, ..self }
    }
    /// Returns the number of quadrature nodes in each direction.
    pub fn nodes_per_direction(&self) -> usize {
        self.rule.nodes_per_direction()
    }
    /// Replaces the quadrature rule.
    pub(crate) fn set_nodes(&mut self, nodes: usize) {
        self.rule = QuadratureRule::new(self.degree, nodes);
    }
    /// Adapts the objective to a tolerance: J by control points, and L and R, which only keep a
    /// patch in shape, with fewer nodes than the distance needs.
    pub(crate) fn keep_shape_loosely(&mut self) {
        self.is_by_control = true;
        // The integrands of L and R are nearly squares of polynomials of this degree less one; with
        // two nodes less, patches get smaller.
        let nodes = self.degree.0.max(self.degree.1) + 3;
        self.shape_rule =
            (nodes < self.nodes_per_direction()).then(|| QuadratureRule::new(self.degree, nodes));
    }
    /// Returns true if J is a mean over the control points.
    pub(crate) fn is_by_control(&self) -> bool {
        self.is_by_control
    }
    /// Collects the data, other than the patch, on which the integrands of J, L and R depend.
    fn shape(&self) -> ShapeSettings {
        ShapeSettings {
            method: self.method,
            inner: self.inner,
            weights: self.weights,
            targets: self.targets,
            is_by_control: self.is_by_control,
        }
    }
    /// Returns the number of unknowns, 4 (m + 1)(n + 1).
    pub fn unknowns(&self) -> usize {
        4 * (self.degree.0 + 1) * (self.degree.1 + 1)
    }
    /// Returns the function that vanishes on the surface.
    pub fn field(&self) -> &'f dyn Field {
        self.field
    }
    /// Returns S for the given values of its terms.
    pub fn sum(&self, terms: &Terms) -> f64 {
        terms.sum(&self.weights)
    }

    /// Evaluates the terms for a patch; `None` if w ≤ 0 at a node or F is not finite.
    pub fn evaluate(&self, patch: &RationalPatch) -> Option<Evaluated> {
        self.evaluate_with(patch, &self.targets)
    }

    /// Evaluates the terms for a patch with other targets.
    pub(crate) fn evaluate_with(
        &self,
        patch: &RationalPatch,
        targets: &Targets,
    ) -> Option<Evaluated> {
        let samples = self.samples(patch)?;
        let terms = self.terms(patch, targets, &samples)?;
        Some(Evaluated { terms, samples })
    }

    /// Re-evaluates an evaluated patch with other targets.
    pub(crate) fn with_targets(
        &self,
        patch: &RationalPatch,
        at: Evaluated,
        targets: &Targets,
    ) -> Option<Evaluated> {
        let terms = self.terms(patch, targets, &at.samples)?;
        Some(Evaluated { terms, ..at })
    }

    fn samples(&self, patch: &RationalPatch) -> Option<Samples> {
        let nodes = self.rule.nodes(patch.control())?;
        let shape = match &self.shape_rule {
            Some(rule) => rule.nodes(patch.control())?,
            None => Vec::new(),
        };
        let points: Vec<Point3> = nodes.iter().map(|z| z.point).collect();
        let zero = Jet2 {
            v: 0.0,
            g: [0.0; 3],
            h: [0.0; 6],
        };
        let mut jets = vec![zero; points.len()];
        self.field.jets(&points, &mut jets);
        Some(Samples {
            nodes,
            shape,
            points,
            jets,
        })
    }

    /// Returns the means of g₁₁ and g₂₂: as l₁ and l₂ they minimise L.
    pub(crate) fn mean_lengths(&self, at: &Evaluated) -> (f64, f64) {
        self.mean(&at.samples.nodes)
    }
    /// Returns the means of g₁₁ and g₂₂ of a patch without its other terms; `None` if w ≤ 0 at
    /// a node.
    pub(crate) fn lengths(&self, patch: &RationalPatch) -> Option<(f64, f64)> {
        Some(self.mean(&self.rule.nodes(patch.control())?))
    }
    fn mean(&self, nodes: &[Node]) -> (f64, f64) {
        let (mut l1, mut l2) = (0.0, 0.0);
        for (weight, node) in self.rule.weights().zip(nodes) {
            let [pu, pv] = node.tangents;
            l1 += weight * dot(pu, pu);
            l2 += weight * dot(pv, pv);
        }
        (l1, l2)
    }
    /// Returns the area of the patch.
    pub(crate) fn area(&self, at: &Evaluated) -> f64 {
        let mut sum = 0.0;
        for (weight, node) in self.rule.weights().zip(&at.samples.nodes) {
            let n = cross(node.tangents[0], node.tangents[1]);
            sum += weight * dot(n, n).sqrt();
        }
        sum
    }

    /// Computes the terms from samples; `None` if one is not finite or w ≤ 0 at a corner.
    fn terms(&self, patch: &RationalPatch, t: &Targets, samples: &Samples) -> Option<Terms> {
        let (l, r) = self.shape_terms(t, samples);
        let terms = Terms {
            i: self.squared_distance(samples),
            j: self.weight_term(patch, &samples.nodes),
            l,
            r,
            e: self.corner_term(patch, t)?,
            sides: self.side_term(patch)?,
        };
        terms.are_finite().then_some(terms)
    }

    /// Computes I.
    fn squared_distance(&self, samples: &Samples) -> f64 {
        let all = samples.nodes.iter().zip(&samples.jets).enumerate();
        let mut sum = 0.0;
        for (weight, (k, (node, jet))) in self.rule.weights().zip(all) {
            let distance = node.distance(jet);
            sum += weight * self.importance(k) * distance * distance;
        }
        sum
    }

    /// Computes J.
    fn weight_term(&self, patch: &RationalPatch, nodes: &[Node]) -> f64 {
        let mut sum = 0.0;
        if self.is_by_control {
            let all = patch.control();
            return all.iter().map(|c| (c[3] - 1.0).powi(K)).sum::<f64>() / all.len() as f64;
        }
        for (weight, node) in self.rule.weights().zip(nodes) {
            sum += weight * (node.weight() - 1.0).powi(K);
        }
        sum
    }

    /// Computes L and R.
    fn shape_terms(&self, t: &Targets, samples: &Samples) -> (f64, f64) {
        let (rule, nodes) = match &self.shape_rule {
            Some(rule) => (rule, &samples.shape),
            None => (&self.rule, &samples.nodes),
        };
        let factors = self.inner.factors(t);
        let (mut lengths, mut angles) = (0.0, 0.0);
        for (weight, node) in rule.weights().zip(nodes) {
            let r = node.residuals(t);
            let both = r.u / t.l1 + r.v / t.l2;
            lengths += weight
                * (factors[0] * r.u * r.u + factors[1] * r.v * r.v + factors[2] * both * both);
            angles += weight * r.angle * r.angle;
        }
        (lengths, angles)
    }

    /// Computes E; `None` if w ≤ 0 at a corner.
    fn corner_term(&self, patch: &RationalPatch, t: &Targets) -> Option<f64> {
        let mut sum = 0.0;
        for (&corner, target) in CORNERS.iter().zip(t.corners) {
            let c = patch.control()[self.corner(corner)];
            if c[3] <= 0.0 {
                return None;
            }
            sum += distance_squared([c[0] / c[3], c[1] / c[3], c[2] / c[3]], target);
        }
        Some(sum)
    }

    /// Returns the index of the control point at a corner.
    fn corner(&self, (u, v): (f64, f64)) -> usize {
        let (m, n) = self.degree;
        (if u > 0.5 { m * (n + 1) } else { 0 }) + if v > 0.5 { n } else { 0 }
    }

    /// Returns the factor of the squared distance at a node.
    fn importance(&self, node: usize) -> f64 {
        self.importance.get(node).copied().unwrap_or(1.0)
    }

    /// Weights squared distances by (4u(1 − u))^−power in each direction, normalised to the mean 1,
    /// so that they count more near the border.
    pub(crate) fn weigh_border(&mut self, power: f64) {
        let of = |x: &f64| (4.0 * x * (1.0 - x)).powf(-power);
        let (x, _) = gauss_legendre(self.nodes_per_direction());
        let all: Vec<f64> = x
            .iter()
            .flat_map(|u| x.iter().map(move |v| of(u) * of(v)))
            .collect();
        let mean: f64 = all
            .iter()
            .zip(self.rule.weights())
            .map(|(i, w)| i * w)
            .sum();
        self.importance = all.into_iter().map(|i| i / mean).collect();
    }
}
