//! A map in floating point on a unit triangle, and the proof that W keeps its sign on a part of it.

use crate::fan::Form;
use crate::map::{MAX_DEGREE, Map};
use crate::surface::Point3;
use isoform_algebra::{Poly, QUADRANTS, RBig};
use isoform_geom::{dot, norm, sub};
use isoform_num::DoubleDouble;
use std::collections::BTreeMap;

/// A map evaluated in floating point on one of the unit triangles.
pub(super) struct Chart {
    signs: [f64; 2],
    /// Exponents, and the coefficients of X, Y, Z, W.
    terms: Vec<([u8; 3], [f64; 4])>,
    /// What these coefficients lack.
    low: Vec<[f64; 4]>,
    degree: usize,
    /// Errors of values above it are not accepted.
    precision: f64,
    /// Bernstein coefficients of W on the triangle (1,0,0), (0,1,0), (0,0,1).
    w: Vec<f64>,
}

/// Least cosine of the angle between directions that count as near, and the length of the step in
/// the parameters, if there is room, that they are those of.
const TURN: f64 = 0.97;
const LEAVING: f64 = 1e-3;
/// Rounding errors of values, in units of the box, from which on they are computed with more
/// digits.
const PRECISION: f64 = 1e-13;
/// What is rounding on a contracted curve, in these.
const ON_CURVE: f64 = 1e-3;
/// One more than the degree up to which powers fit a short list; that for all degrees.
const FEW: usize = 9;
const MANY: usize = MAX_DEGREE + 1;

impl Chart {
    /// `size` is what lengths are compared with.
    pub(super) fn new(map: &Map, quadrant: usize, size: f64) -> Self {
        let mut terms: BTreeMap<[u8; 3], [[f64; 4]; 2]> = BTreeMap::new();
        for (form, f) in map.forms().iter().enumerate() {
            for (e, c) in f.terms() {
                let c = RBig::from_parts(c.clone(), f.denominator().clone());
                let high = c.to_f64().value();
                let low = RBig::try_from(high).map_or(0.0, |high| (c - high).to_f64().value());
                let both = terms.entry([0, 1, 2].map(|k| e[k] as u8)).or_default();
                (both[0][form], both[1][form]) = (high, low);
            }
        }
        let signs = QUADRANTS[quadrant].map(|s| s as f64);
        let low = terms.values().map(|both| both[1]).collect();
        let terms = terms.into_iter().map(|(e, both)| (e, both[0])).collect();
        Self {
            signs,
            terms,
            low,
            degree: map.degree(),
            precision: PRECISION * size,
            w: bernstein_base(&map.forms()[3]),
        }
    }
    /// Powers of (s, t, w) up to the degree.
    fn powers<const N: usize>(&self, [u, v]: [f64; 2]) -> [[f64; N]; 3] {
        let x = [self.signs[0] * u, self.signs[1] * v, 1.0 - (u + v)];
        let mut powers = [[1.0; N]; 3];
        for (p, x) in powers.iter_mut().zip(x) {
            for k in 1..=self.degree {
                p[k] = p[k - 1] * x;
            }
        }
        powers
    }
    /// The forms, and the sizes of what they are sums of.
    fn forms<const N: usize>(&self, at: [f64; 2]) -> [[f64; 4]; 2] {
        let [x, y, z] = self.powers::<N>(at);
        let (mut sum, mut size) = ([0.0; 4], [0.0; 4]);
        for ([i, j, k], c) in &self.terms {
            let m = x[usize::from(*i)] * y[usize::from(*j)] * z[usize::from(*k)];
            for l in 0..4 {
                sum[l] += m * c[l];
                size[l] += (m * c[l]).abs();
            }
        }
        [sum, size]
    }
    pub(super) fn at(&self, at: [f64; 2]) -> Point3 {
        let [[x, y, z, w], size] = if self.degree < FEW {
            self.forms::<FEW>(at)
        } else {
            self.forms::<MANY>(at)
        };
        let p = [x / w, y / w, z / w];
        let error = (0..3)
            .map(|k| size[k] + p[k].abs() * size[3])
            .fold(0.0, f64::max)
            * f64::EPSILON
            / w.abs();
        // Next to base points all forms cancel.
        if error > self.precision {
            self.at_precisely(at)
        } else {
            p
        }
    }
    fn at_precisely(&self, [u, v]: [f64; 2]) -> Point3 {
        let exact = DoubleDouble::from;
        let x = [
            exact(self.signs[0] * u),
            exact(self.signs[1] * v),
            exact(1.0) + exact(-u) + exact(-v),
        ];
        let powers = x.map(|x| {
            let mut powers = vec![exact(1.0); self.degree + 1];
            for k in 1..=self.degree {
                powers[k] = powers[k - 1] * x;
            }
            powers
        });
        let mut sum = [exact(0.0); 4];
        for (([i, j, k], high), low) in self.terms.iter().zip(&self.low) {
            let m = powers[0][usize::from(*i)]
                * powers[1][usize::from(*j)]
                * powers[2][usize::from(*k)];
            for l in (0..4).filter(|&l| high[l] != 0.0) {
                sum[l] = sum[l] + m * DoubleDouble::new(high[l], low[l]);
            }
        }
        [0, 1, 2].map(|k| sum[k].value() / sum[3].value())
    }
    /// The forms and their derivatives by u and v.
    fn derivatives<const N: usize>(&self, at: [f64; 2]) -> [[f64; 4]; 3] {
        let [x, y, z] = self.powers::<N>(at);
        let mut sum = [[0.0; 4]; 3];
        for ([i, j, k], c) in &self.terms {
            let [i, j, k] = [*i, *j, *k].map(usize::from);
            let lowered = |p: &[f64; N], e: usize| if e == 0 { 0.0 } else { e as f64 * p[e - 1] };
            let along_w = x[i] * y[j] * lowered(&z, k);
            let by_u = self.signs[0] * lowered(&x, i) * y[j] * z[k] - along_w;
            let by_v = self.signs[1] * x[i] * lowered(&y, j) * z[k] - along_w;
            for (s, m) in sum.iter_mut().zip([x[i] * y[j] * z[k], by_u, by_v]) {
                for (s, c) in s.iter_mut().zip(c) {
                    *s += m * c;
                }
            }
        }
        sum
    }
    /// The image and the derivatives by u and v.
    pub(super) fn tangents(&self, at: [f64; 2]) -> [Point3; 3] {
        let [p, by_u, by_v] = if self.degree < FEW {
            self.derivatives::<FEW>(at)
        } else {
            self.derivatives::<MANY>(at)
        };
        let tangent = |d: [f64; 4]| [0, 1, 2].map(|k| (d[k] - p[k] / p[3] * d[3]) / p[3]);
        [[0, 1, 2].map(|k| p[k] / p[3]), tangent(by_u), tangent(by_v)]
    }
    /// The step that brings the image nearest to a point, to first order: one of Gauss and Newton.
    /// None where the tangents are parallel.
    pub(super) fn step(&self, at: [f64; 2], to: Point3) -> Option<[f64; 2]> {
        let [p, x, y] = self.tangents(at);
        let off = sub(to, p);
        let (xx, xy, yy, x, y) = (dot(x, x), dot(x, y), dot(y, y), dot(x, off), dot(y, off));
        let det = xx * yy - xy * xy;
        (det > 1e-12 * xx * yy).then(|| [(yy * x - xy * y) / det, (xx * y - xy * x) / det])
    }
    /// The point on the perpendicular bisector of a chord with an image that is the whole of a
    /// curve's, by Newton's method. None if there is none near.
    pub(super) fn beside_chord(&self, [a, b]: [[f64; 2]; 2], image: Point3) -> Option<[f64; 2]> {
        let across = [a[1] - b[1], b[0] - a[0]];
        let mut off = 0.0f64;
        for _ in 0..8 {
            let at = [0, 1].map(|k| 0.5 * (a[k] + b[k]) + off * across[k]);
            let [p, x, y] = self.tangents(at);
            // On the curve to rounding. Where derivatives vanish all along it, steps from there
            // would lead anywhere.
            if norm(sub(image, p)) <= ON_CURVE * self.precision {
                return Some(at);
            }
            let slope: Point3 = std::array::from_fn(|k| x[k] * across[0] + y[k] * across[1]);
            let step = dot(sub(image, p), slope) / dot(slope, slope);
            off += step;
            if step.abs() <= 1e-12 {
                return Some([0, 1].map(|k| 0.5 * (a[k] + b[k]) + off * across[k]));
            }
            if off.is_nan() || off.abs() >= 0.5 {
                return None;
            }
        }
        None
    }
    /// Whether the surface leaves the one image of a contracted curve in directions that are far
    /// from each other at three places of it.
    pub(super) fn turns(&self, [a, m, b]: [[f64; 2]; 3]) -> bool {
        let length = (a[0] - b[0]).hypot(a[1] - b[1]);
        let share = LEAVING.min(length) / length;
        // A step, not a derivative: it may vanish all along the curve.
        let leaving = |at: [f64; 2]| {
            let beside = [at[0] + share * (a[1] - b[1]), at[1] + share * (b[0] - a[0])];
            let d = sub(self.at(beside), self.at(at));
            d.map(|c| c / norm(d))
        };
        let [p, q, r] = [a, m, b].map(leaving);
        dot(p, q) < TURN || dot(q, r) < TURN
    }
    /// Whether the Bernstein coefficients of W on a triangle have one sign beyond rounding, those
    /// left out that vanish because W has a zero of that multiplicity in the first corner.
    pub(super) fn keeps_sign(&self, at: [[f64; 2]; 3], multiplicity: usize) -> bool {
        let corners = at.map(|[u, v]| [self.signs[0] * u, self.signs[1] * v, 1.0 - (u + v)]);
        let (lo, hi, error) = bernstein_range(&self.w, self.degree, corners, multiplicity);
        lo > error || hi < -error
    }
}

/// Place of (i, j, n − i − j) among the coefficients of a ternary form of degree n.
fn slot(n: usize, i: usize, j: usize) -> usize {
    i * (n + 1) - i * i.saturating_sub(1) / 2 + j
}

/// Bernstein coefficients of a ternary form on the triangle (1,0,0), (0,1,0), (0,0,1).
fn bernstein_base(form: &Poly) -> Vec<f64> {
    let n = form.total_degree();
    let factorial = |k: usize| (1..=k).fold(RBig::ONE, |p, k| p * RBig::from(k));
    let mut out = vec![0.0; (n + 1) * (n + 2) / 2];
    for (e, c) in form.terms() {
        let [i, j, k] = [0, 1, 2].map(|x| usize::from(e[x]));
        let count = factorial(n) / (factorial(i) * factorial(j) * factorial(k));
        out[slot(n, i, j)] = (RBig::from(c.clone())
            / (RBig::from(form.denominator().clone()) * count))
            .to_f64()
            .value();
    }
    out
}

/// Least and greatest Bernstein coefficient on the triangle with the corners given, and a bound of
/// their rounding errors: by the polar form, one argument at a time. Those that vanish because the
/// first corner is a zero of that multiplicity are left out.
fn bernstein_range(
    base: &[f64],
    n: usize,
    corners: [[f64; 3]; 3],
    multiplicity: usize,
) -> (f64, f64, f64) {
    let step = |b: &[[f64; 2]], d: usize, p: [f64; 3]| -> Vec<[f64; 2]> {
        let mut out = Vec::with_capacity(d * (d + 1) / 2);
        for i in 0..d {
            for j in 0..d - i {
                let [x, y, z] = [b[slot(d, i + 1, j)], b[slot(d, i, j + 1)], b[slot(d, i, j)]];
                out.push([
                    x[0] * p[0] + y[0] * p[1] + z[0] * p[2],
                    x[1] * p[0].abs() + y[1] * p[1].abs() + z[1] * p[2].abs(),
                ]);
            }
        }
        out
    };
    let (mut lo, mut hi, mut size) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64);
    let mut first: Vec<[f64; 2]> = base.iter().map(|&b| [b, b.abs()]).collect();
    for i in 0..=n.saturating_sub(multiplicity) {
        let mut second = first.clone();
        for j in 0..=n - i {
            let mut third = second.clone();
            for d in (1..=n - i - j).rev() {
                third = step(&third, d, corners[2]);
            }
            let [value, magnitude] = third[0];
            (lo, hi, size) = (lo.min(value), hi.max(value), size.max(magnitude));
            if j < n - i {
                second = step(&second, n - i - j, corners[1]);
            }
        }
        if i < n.saturating_sub(multiplicity) {
            first = step(&first, n - i, corners[0]);
        }
    }
    (lo, hi, 4.0 * f64::EPSILON * (n + 2) as f64 * size)
}

/// Whether a polynomial in two variables is proved to keep its sign on a triangle, by bisection;
/// with a zero of its order in the first corner, which is the origin.
pub(super) fn keeps_sign_on(form: &Form, corners: [[f64; 2]; 3], at_origin: bool) -> bool {
    let n = form
        .terms
        .iter()
        .map(|([i, j], _)| i + j)
        .max()
        .unwrap_or(0);
    let factorial = |k: usize| (1..=k).map(|k| k as f64).product::<f64>();
    let mut base = vec![0.0; (n + 1) * (n + 2) / 2];
    for ([i, j], c) in &form.terms {
        base[slot(n, *i, *j)] =
            c * factorial(*i) * factorial(*j) * factorial(n - i - j) / factorial(n);
    }
    let mut signs = [false; 2];
    let mut stack = vec![(corners, at_origin, PROOF)];
    while let Some((t, at_origin, depth)) = stack.pop() {
        let (lo, hi, error) = bernstein_range(
            &base,
            n,
            t.map(|[u, v]| [u, v, 1.0]),
            if at_origin { form.order } else { 0 },
        );
        // The coefficients themselves are rounded, too.
        let error = 4.0 * error;
        if lo > error || hi < -error {
            signs[usize::from(hi < -error)] = true;
        } else if depth == 0 {
            return false;
        } else {
            let half = |a: [f64; 2], b: [f64; 2]| [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
            let long = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
            let [a, b, c] = t;
            if at_origin {
                // Nearer to the origin, and the rest.
                let (p, q) = (half(a, b), half(a, c));
                stack.extend([
                    ([a, p, q], true, depth - 1),
                    ([p, b, c], false, depth - 1),
                    ([p, c, q], false, depth - 1),
                ]);
            } else {
                let (a, b, c) = match [long(a, b), long(b, c), long(c, a)] {
                    [x, y, z] if x >= y && x >= z => (a, b, c),
                    [_, y, z] if y >= z => (b, c, a),
                    _ => (c, a, b),
                };
                let m = half(a, b);
                stack.extend([([a, m, c], false, depth - 1), ([m, b, c], false, depth - 1)]);
            }
        }
        if signs == [true; 2] {
            return false;
        }
    }
    true
}

/// Bisections.
const PROOF: usize = 6;
