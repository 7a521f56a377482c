//! A map in floating point on a unit triangle, and the proof that W keeps its sign on a part of it.

use crate::fan::Form;
use crate::map::{MAX_MAP_DEGREE, Map};
use crate::surface::Point3;
use isoform_algebra::{Poly, QUADRANTS, RBig};
use isoform_geom::{dot, norm, sub};
use isoform_num::DoubleDouble;
use std::collections::BTreeMap;

/// A map evaluated in floating point on one of the unit triangles.
pub(super) struct Chart {
    signs: [f64; 2],
    /// Exponents, with the coefficients of X, Y, Z, W.
    terms: Vec<([u8; 3], [f64; 4])>,
    /// Low parts of these coefficients: the differences to the exact values, as doubles.
    low: Vec<[f64; 4]>,
    degree: usize,
    /// Maximum error of values computed in doubles; above it, double-double arithmetic is used.
    precision: f64,
    /// Bernstein coefficients of W on the triangle (1,0,0), (0,1,0), (0,0,1).
    w: Vec<f64>,
}

/// Minimum cosine of the angle between directions that count as near.
const MIN_TURN_COSINE: f64 = 0.97;
/// Number of powers for low degrees, up to 8, which fit a short array.
const LOW_DEGREE_POWERS: usize = 9;
/// Number of powers for the maximum degree.
const MAX_POWERS: usize = MAX_MAP_DEGREE + 1;

impl Chart {
    /// Creates the chart; `size` is the unit of lengths in its tolerances.
    pub(super) fn new(map: &Map, quadrant: usize, size: f64) -> Self {
        let terms = split_terms(map.forms());
        Self {
            signs: QUADRANTS[quadrant].map(|s| s as f64),
            low: terms.values().map(|both| both[1]).collect(),
            terms: terms.into_iter().map(|(e, both)| (e, both[0])).collect(),
            degree: map.degree(),
            // Values with a larger rounding error, in units of the box, are computed with more
            // digits.
            precision: 1e-13 * size,
            w: bernstein_base(&map.forms()[3]),
        }
    }
    /// Returns the powers of (s, t, w) up to the degree.
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
    /// Returns the values of the forms, and the sums of the absolute values of their terms.
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
        let [[x, y, z, w], size] = if self.degree < LOW_DEGREE_POWERS {
            self.forms::<LOW_DEGREE_POWERS>(at)
        } else {
            self.forms::<MAX_POWERS>(at)
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
        let [s, t] = self.signs;
        let last = exact(1.0) + exact(-u) + exact(-v);
        let x = [exact(s * u), exact(t * v), last];
        let powers = x.map(|x| powers_of(x, self.degree));
        let mut sum = [exact(0.0); 4];
        for ((e, high), low) in self.terms.iter().zip(&self.low) {
            let [i, j, k] = e.map(usize::from);
            let m = powers[0][i] * powers[1][j] * powers[2][k];
            for l in (0..4).filter(|&l| high[l] != 0.0) {
                sum[l] = sum[l] + m * DoubleDouble::new(high[l], low[l]);
            }
        }
        [0, 1, 2].map(|k| sum[k].value() / sum[3].value())
    }
    /// Returns the forms and their derivatives by u and v.
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
    /// Returns the image and its derivatives by u and v.
    pub(super) fn tangents(&self, at: [f64; 2]) -> [Point3; 3] {
        let [p, by_u, by_v] = if self.degree < LOW_DEGREE_POWERS {
            self.derivatives::<LOW_DEGREE_POWERS>(at)
        } else {
            self.derivatives::<MAX_POWERS>(at)
        };
        let tangent = |d: [f64; 4]| [0, 1, 2].map(|k| (d[k] - p[k] / p[3] * d[3]) / p[3]);
        [[0, 1, 2].map(|k| p[k] / p[3]), tangent(by_u), tangent(by_v)]
    }
    /// Returns the Gauss–Newton step that brings the image nearest to a point; `None` if the
    /// tangents are parallel.
    pub(super) fn step(&self, at: [f64; 2], to: Point3) -> Option<[f64; 2]> {
        let [p, x, y] = self.tangents(at);
        let off = sub(to, p);
        let (xx, xy, yy, x, y) = (dot(x, x), dot(x, y), dot(y, y), dot(x, off), dot(y, off));
        let det = xx * yy - xy * xy;
        (det > 1e-12 * xx * yy).then(|| [(yy * x - xy * y) / det, (xx * y - xy * x) / det])
    }
    /// Returns the point on the perpendicular bisector of a chord at which the image is that of a
    /// contracted curve, by Newton's method; `None` if there is none nearby.
    pub(super) fn beside_chord(&self, [a, b]: [[f64; 2]; 2], image: Point3) -> Option<[f64; 2]> {
        let across = [a[1] - b[1], b[0] - a[0]];
        let mut off = 0.0f64;
        for _ in 0..8 {
            let at = [0, 1].map(|k| 0.5 * (a[k] + b[k]) + off * across[k]);
            let [p, x, y] = self.tangents(at);
            // The point is on the curve up to rounding. Where derivatives vanish along all of it,
            // further steps would lead anywhere.
            // A thousandth of the precision is rounding.
            if norm(sub(image, p)) <= 1e-3 * self.precision {
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
    /// Returns true if the surface leaves the common image of a contracted curve in directions that
    /// differ by more than about 14 degrees between three places of it.
    pub(super) fn turns(&self, [a, m, b]: [[f64; 2]; 3]) -> bool {
        let length = (a[0] - b[0]).hypot(a[1] - b[1]);
        // The step from which the direction is taken, if there is room for it.
        let share = length.min(1e-3) / length;
        // A finite step rather than a derivative, which may vanish along the whole curve.
        let leaving = |at: [f64; 2]| {
            let beside = [at[0] + share * (a[1] - b[1]), at[1] + share * (b[0] - a[0])];
            let d = sub(self.at(beside), self.at(at));
            d.map(|c| c / norm(d))
        };
        let [p, q, r] = [a, m, b].map(leaving);
        dot(p, q) < MIN_TURN_COSINE || dot(q, r) < MIN_TURN_COSINE
    }
    /// Returns true if the Bernstein coefficients of W on a triangle have one sign beyond rounding.
    /// Coefficients that vanish because W has a zero of the given multiplicity in the first corner
    /// are left out.
    ///
    /// The corners are (±u : ±v : 1 − (u + v)) as computed here, and identically in [`Chart::at`]:
    /// triangles with equal u and v share that corner.
    pub(super) fn keeps_sign(&self, at: [[f64; 2]; 3], multiplicity: usize) -> bool {
        let corners = at.map(|[u, v]| [self.signs[0] * u, self.signs[1] * v, 1.0 - (u + v)]);
        let (lo, hi, error) = bernstein_range(&self.w, self.degree, corners, multiplicity);
        lo > error || hi < -error
    }
}

/// Returns the index of (i, j, n − i − j) among the coefficients of a ternary form of degree n.
fn slot(n: usize, i: usize, j: usize) -> usize {
    i * (n + 1) - i * i.saturating_sub(1) / 2 + j
}

/// Returns the Bernstein coefficients of a ternary form on the triangle (1,0,0), (0,1,0), (0,0,1).
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

/// Minimum magnitude for a proof: below it underflow is not negligible against the bound on
/// rounding. A coefficient takes fewer than 2¹⁸ products, each with an underflow error below
/// 2⁻¹⁰⁷⁴, together below 2⁻¹⁰⁵⁶.
const MIN_PROOF_MAGNITUDE: f64 = f64::from_bits((1023 - 960) << 52);

/// Returns the minimum and maximum Bernstein coefficient on a triangle given by its corners, and a
/// bound on their rounding errors, which is infinite if a coefficient is not finite. Coefficients
/// that vanish because the first corner is a zero of the given multiplicity are left out. The
/// corners are taken as the exact values of their doubles; their coordinates add up to at most
/// about 1, in absolute values.
///
/// Derivation of the bound, with u = ε/2 = 2⁻⁵³: each term of a coefficient is rounded once when
/// the base is made, and in each of at most n steps once by its product and at most twice by the
/// sum of three. So its relative error is θ with |θ| ≤ γ₃ₙ₊₁, where γₖ = k u/(1 − k u) (N. Higham,
/// *Accuracy and Stability of Numerical Algorithms*, 2002, lemma 3.1), and the error of the
/// coefficient is at most γ₃ₙ₊₁ M with M the sum of the absolute values of the terms. The magnitude
/// that is computed along with it follows these steps without cancellation, so that M ≤ (1 +
/// 2γ₃ₙ₊₁) magnitude. Both together are less than (3n + 2) u magnitude for all degrees of maps; 4 ε
/// (n + 2) = (8n + 16) u is more than twice that, which covers the rounding of this product and of
/// comparisons.
fn bernstein_range(
    base: &[f64],
    n: usize,
    corners: [[f64; 3]; 3],
    multiplicity: usize,
) -> (f64, f64, f64) {
    let (mut lo, mut hi, mut size) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64);
    let mut is_known = true;
    each_coefficient(base, n, corners, multiplicity, |value, magnitude| {
        (lo, hi, size) = (lo.min(value), hi.max(value), size.max(magnitude));
        // Minima and maxima ignore NaN.
        is_known &= magnitude.is_finite();
    });
    let error = 4.0 * f64::EPSILON * (n + 2) as f64 * size;
    match is_known && size >= MIN_PROOF_MAGNITUDE {
        true => (lo, hi, error),
        false => (lo, hi, f64::INFINITY),
    }
}

/// Performs a step of de Casteljau's algorithm on a form of degree d: returns the coefficients of
/// its polar form with one argument set, each with the sum of the absolute values of its terms.
#[inline]
fn polar_step(b: &[[f64; 2]], d: usize, p: [f64; 3]) -> Vec<[f64; 2]> {
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
}

/// Calls a function with each Bernstein coefficient and the sum of the absolute values of its
/// terms, computed by the polar form, one argument at a time.
fn each_coefficient(
    base: &[f64],
    n: usize,
    corners: [[f64; 3]; 3],
    multiplicity: usize,
    mut look: impl FnMut(f64, f64),
) {
    let mut first: Vec<[f64; 2]> = base.iter().map(|&b| [b, b.abs()]).collect();
    for i in 0..=n.saturating_sub(multiplicity) {
        let mut second = first.clone();
        for j in 0..=n - i {
            let mut third = second.clone();
            for d in (1..=n - i - j).rev() {
                third = polar_step(&third, d, corners[2]);
            }
            let [value, magnitude] = third[0];
            look(value, magnitude);
            if j < n - i {
                second = polar_step(&second, n - i - j, corners[1]);
            }
        }
        if i < n.saturating_sub(multiplicity) {
            first = polar_step(&first, n - i, corners[0]);
        }
    }
}

/// A triangle in the proof that a polynomial keeps its sign.
struct ProofTriangle {
    corners: [[f64; 2]; 3],
    /// True if the first corner is the origin.
    at_origin: bool,
    /// Number of bisections left.
    depth: usize,
}

impl ProofTriangle {
    /// Divides the triangle: into one nearer to the origin and two others, or into halves at the
    /// longest edge.
    fn divided(&self) -> Vec<Self> {
        let part = |corners, at_origin| Self {
            corners,
            at_origin,
            depth: self.depth - 1,
        };
        let half = |a: [f64; 2], b: [f64; 2]| [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        let [a, b, c] = self.corners;
        if self.at_origin {
            let (p, q) = (half(a, b), half(a, c));
            return vec![
                part([a, p, q], true),
                part([p, b, c], false),
                part([p, c, q], false),
            ];
        }
        let [a, b, c] = longest_first(self.corners);
        let m = half(a, b);
        vec![part([a, m, c], false), part([m, b, c], false)]
    }
}

/// Returns the Bernstein coefficients of a polynomial in two variables, as a form in (u, v, 1), and
/// its degree.
fn bernstein_of(form: &Form) -> (Vec<f64>, usize) {
    let degrees = form.terms.iter().map(|([i, j], _)| i + j);
    let n = degrees.max().unwrap_or(0);
    let factorial = |k: usize| (1..=k).map(|k| k as f64).product::<f64>();
    let mut base = vec![0.0; (n + 1) * (n + 2) / 2];
    for ([i, j], c) in &form.terms {
        base[slot(n, *i, *j)] =
            c * factorial(*i) * factorial(*j) * factorial(n - i - j) / factorial(n);
    }
    (base, n)
}

/// Returns true if a polynomial in two variables is proved to keep its sign on a triangle, by
/// bisection. If `at_origin`, the first corner is the origin, where the polynomial has a zero of
/// its order.
pub(super) fn keeps_sign_on(form: &Form, corners: [[f64; 2]; 3], at_origin: bool) -> bool {
    let (base, n) = bernstein_of(form);
    let mut signs = [false; 2];
    let mut stack = vec![ProofTriangle {
        corners,
        at_origin,
        // At most six bisections.
        depth: 6,
    }];
    while let Some(part) = stack.pop() {
        let places = part.corners.map(|[u, v]| [u, v, 1.0]);
        let order = if part.at_origin { form.order } else { 0 };
        let (lo, hi, error) = bernstein_range(&base, n, places, order);
        // The coefficients themselves are rounded, too: by 2n + 5 more factors.
        let error = 4.0 * error;
        if lo > error || hi < -error {
            signs[usize::from(hi < -error)] = true;
        } else if part.depth == 0 {
            return false;
        } else {
            stack.extend(part.divided());
        }
        if signs == [true; 2] {
            return false;
        }
    }
    true
}

/// Rotates the corners of a triangle so that the longest edge comes first.
#[inline]
fn longest_first([a, b, c]: [[f64; 2]; 3]) -> [[f64; 2]; 3] {
    let long = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    match [long(a, b), long(b, c), long(c, a)] {
        [x, y, z] if x >= y && x >= z => [a, b, c],
        [_, y, z] if y >= z => [b, c, a],
        _ => [c, a, b],
    }
}

/// Returns the powers of a number from exponent 0 up to a degree.
#[inline]
fn powers_of(x: DoubleDouble, degree: usize) -> Vec<DoubleDouble> {
    let mut powers = vec![DoubleDouble::from(1.0); degree + 1];
    for k in 1..=degree {
        powers[k] = powers[k - 1] * x;
    }
    powers
}

/// Returns the coefficients of four forms by exponents, each as the sum of two doubles.
fn split_terms(forms: &[Poly; 4]) -> BTreeMap<[u8; 3], [[f64; 4]; 2]> {
    let mut terms: BTreeMap<[u8; 3], [[f64; 4]; 2]> = BTreeMap::new();
    for (form, f) in forms.iter().enumerate() {
        for (e, c) in f.terms() {
            let [high, low] = split(RBig::from_parts(c.clone(), f.denominator().clone()));
            let both = terms.entry([0, 1, 2].map(|k| e[k] as u8)).or_default();
            (both[0][form], both[1][form]) = (high, low);
        }
    }
    terms
}

/// Splits a number into its nearest double and the rest.
fn split(c: RBig) -> [f64; 2] {
    let high = c.to_f64().value();
    let low = RBig::try_from(high).map_or(0.0, |high| (c - high).to_f64().value());
    [high, low]
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_algebra::{IBig, UBig};

    /// Converts a double to an integer multiple of 2^−`shift`.
    fn scaled(x: f64, shift: usize) -> IBig {
        let exact = RBig::try_from(x).expect("finite") * RBig::from(UBig::ONE << shift);
        assert_eq!(
            *exact.denominator(),
            UBig::ONE,
            "{x} in units of 2^-{shift}"
        );
        exact.numerator().clone()
    }

    /// Returns the Bernstein coefficients in the order of [`each_coefficient`], in units of 2^(−n ·
    /// shift) of the common denominator of `base`.
    fn exact_coefficients(base: &[IBig], n: usize, corners: [[IBig; 3]; 3]) -> Vec<IBig> {
        let step = |b: &[IBig], d: usize, p: &[IBig; 3]| -> Vec<IBig> {
            let at = |i, j| &b[slot(d, i, j)];
            (0..d)
                .flat_map(|i| (0..d - i).map(move |j| (i, j)))
                .map(|(i, j)| at(i + 1, j) * &p[0] + at(i, j + 1) * &p[1] + at(i, j) * &p[2])
                .collect()
        };
        let mut found = Vec::new();
        let mut first = base.to_vec();
        for i in 0..=n {
            let mut second = first.clone();
            for j in 0..=n - i {
                let mut third = second.clone();
                for d in (1..=n - i - j).rev() {
                    third = step(&third, d, &corners[2]);
                }
                found.push(third.swap_remove(0));
                if j < n - i {
                    second = step(&second, n - i - j, &corners[1]);
                }
            }
            if i < n {
                first = step(&first, n - i, &corners[0]);
            }
        }
        found
    }

    /// Returns the Bernstein coefficients of a form as integers over one denominator.
    fn exact_base(form: &Poly) -> (Vec<IBig>, UBig) {
        let n = form.total_degree();
        let factorial = |k: usize| (1..=k).fold(IBig::ONE, |p, k| p * IBig::from(k));
        let mut base = vec![IBig::ZERO; (n + 1) * (n + 2) / 2];
        for (e, c) in form.terms() {
            let [i, j, k] = [0, 1, 2].map(|x| usize::from(e[x]));
            base[slot(n, i, j)] = c * factorial(i) * factorial(j) * factorial(k);
        }
        let denominator = IBig::from(form.denominator().clone()) * factorial(n);
        (base, UBig::try_from(denominator).expect("positive"))
    }

    /// Returns W as a product of linear forms, the first of which nearly vanishes at the returned
    /// place, so that values cancel there; or as a dense form.
    fn attacked(random: &mut fastrand::Rng, signs: [f64; 2]) -> (Poly, [f64; 2]) {
        let center = [0.05 + 0.4 * random.f64(), 0.05 + 0.4 * random.f64()];
        let number = |random: &mut fastrand::Rng| RBig::from(random.i64(-999..=999));
        if random.u8(0..4) == 0 {
            let n = random.u16(1..=8);
            let exponents = (0..=n).flat_map(|i| (0..=n - i).map(move |j| [i, j, n - i - j, 0]));
            let terms: Vec<_> = exponents.map(|e| (e, number(random))).collect();
            return (Poly::from_terms(terms), center);
        }
        let mut w = Poly::one();
        for k in 0..random.usize(1..=4) {
            let [a, b, mut c] = [(); 3].map(|()| number(random));
            if k == 0 {
                let [p, q] = [&a, &b].map(|c| c.to_f64().value());
                let [u, v] = [signs[0] * center[0], signs[1] * center[1]];
                c = RBig::try_from(-(p * u + q * v) / (1.0 - center[0] - center[1]))
                    .expect("finite");
            }
            w = w * crate::deck::linear(&[a, b, c]);
        }
        (w, center)
    }

    /// Returns a triangle near a place, in u and v.
    fn cell(random: &mut fastrand::Rng, center: [f64; 2]) -> [[f64; 2]; 3] {
        let size = 0.5f64.powi(random.i32(2..=50));
        [(); 3].map(|()| center.map(|x| (x + size * (random.f64() - 0.5)).clamp(0.0, 0.49)))
    }

    /// The bound on rounding holds for every coefficient of many cells, near and across zeros of W;
    /// where a sign is certified, exact arithmetic agrees.
    #[test]
    fn the_bound_on_rounding_holds() {
        let wanted = isoform_testdata::cases(100_000, 10_000);
        let mut random = fastrand::Rng::with_seed(20_261_123);
        let (mut cells, mut certified, mut worst) = (0, 0, 0.0f64);
        while cells < wanted {
            let quadrant = QUADRANTS[random.usize(0..4)].map(|s| s as f64);
            let (w, center) = attacked(&mut random, quadrant);
            if w.is_zero() {
                continue;
            }
            let n = w.total_degree();
            let (base, denominator) = exact_base(&w);
            let rounded = bernstein_base(&w);
            for _ in 0..100 {
                let corners = cell(&mut random, center)
                    .map(|[u, v]| [quadrant[0] * u, quadrant[1] * v, 1.0 - (u + v)]);
                let shift = 110;
                let exact =
                    exact_coefficients(&base, n, corners.map(|p| p.map(|x| scaled(x, shift))));
                let (lo, hi, error) = bernstein_range(&rounded, n, corners, 0);
                let mut exact_ones = exact.iter();
                each_coefficient(&rounded, n, corners, 0, |value, _| {
                    let exact = exact_ones.next().expect("as many");
                    let unit = &denominator << (n * shift);
                    let off = RBig::try_from(value).expect("finite")
                        - RBig::from_parts(exact.clone(), unit);
                    let share = off.to_f64().value().abs() / error;
                    worst = worst.max(share);
                });
                if lo > error || hi < -error {
                    certified += 1;
                    let signs = exact.iter().map(IBig::sign);
                    let is_one = exact.iter().all(|c| !c.is_zero()) && {
                        let mut signs = signs;
                        let first = signs.next();
                        signs.all(|s| Some(s) == first)
                    };
                    assert!(is_one, "{} on {corners:?}", w.display(&["s", "t", "w"]));
                }
                cells += 1;
            }
        }
        println!("{certified} of {cells} certified, errors up to {worst} of the bound");
        assert!(worst <= 1.0, "{worst} times the bound");
        // A test that comes nowhere near the bound, or near zeros, would prove nothing.
        assert!(worst > 0.02, "{worst} of the bound");
        assert!(
            (wanted / 10..9 * wanted / 10).contains(&certified),
            "{certified}"
        );
    }

    /// Away from zeros a sign is proved, also next to a zero in the corner; across a zero, or with
    /// a wrong order of the zero in the corner, it is not.
    #[test]
    fn signs_of_polynomials_are_proved_by_bisection() {
        let form = |terms: &[([usize; 2], f64)], order: usize| Form {
            terms: terms.to_vec(),
            order,
        };
        let corner = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.1]];
        let circle = [([2, 0], 1.0), ([0, 2], 1.0)];
        assert!(keeps_sign_on(&form(&circle, 2), corner, true));
        assert!(!keeps_sign_on(&form(&circle, 2), corner, false));
        let saddle = [([2, 0], 1.0), ([0, 2], -1.0)];
        assert!(!keeps_sign_on(&form(&saddle, 2), corner, true));
        assert!(keeps_sign_on(
            &form(&saddle, 2),
            [[0.0, 0.0], [0.1, 0.0], [0.1, 0.05]],
            true
        ));
        // The polynomial 1/4 − u on either side of u = 1/4, and across it.
        let line = form(&[([0, 0], 0.25), ([1, 0], -1.0)], 0);
        let at = |u: f64| [[u, 0.0], [u + 0.125, 0.0], [u, 0.5]];
        let signs = [0.0, 0.1875, 0.375].map(|u| keeps_sign_on(&line, at(u), false));
        assert_eq!(signs, [true, false, true]);
    }

    /// NaN and infinity prove nothing, nor does a value that is affected by underflow.
    #[test]
    fn what_is_no_number_proves_nothing() {
        let corners = [[0.5, 0.5, 0.0], [0.25, 0.5, 0.25], [0.5, 0.25, 0.25]];
        let proves = |base: &[f64]| {
            let (lo, hi, error) = bernstein_range(base, 1, corners, 0);
            lo > error || hi < -error
        };
        assert!(proves(&[1.0, 2.0, 3.0]));
        for wrong in [f64::INFINITY, f64::NAN] {
            assert!(!proves(&[wrong, 2.0, 3.0]) && !proves(&[1.0, 2.0, wrong]));
        }
        assert!(proves(&[1e-280; 3]) && !proves(&[1e-300; 3]));
    }
}
