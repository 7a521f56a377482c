//! F∘p for a polynomial F of degree d and a patch p of degree (m, n): w^d F(X/w, Y/w, Z/w) is a
//! polynomial of degree (d m, d n). The quotients of its Bernstein coefficients by those of w^d
//! bound |F∘p| where w is positive.
//!
//! On patches that lie on the surface to rounding, this bound is of the order of rounding;
//! expansions about points achieve that only for quadrics. The rounding error is bounded along with
//! the values: every coefficient carries the sum of the absolute values of its terms and the number
//! of roundings that led to it.

use isoform_geom::{RationalPatch, Terms};

/// Maximum degree d m or d n of a composition that is computed: higher degrees take long, and
/// rounding errors grow with the degree.
const MAX_COMPOSITION_DEGREE: usize = 32;

/// Scaled Bernstein coefficients (multiplied by binomials, so that products are convolutions) of
/// degree (m, n).
#[derive(Clone)]
struct ScaledPolynomial {
    degree: (usize, usize),
    /// Coefficients, each with the sum of the absolute values of its terms.
    values: Vec<[f64; 2]>,
    /// Number of roundings behind each coefficient; each is at most ε times its sum of absolute
    /// values.
    roundings: usize,
}

impl ScaledPolynomial {
    /// The constant 1.
    fn one() -> Self {
        Self {
            degree: (0, 0),
            values: vec![[1.0; 2]],
            roundings: 0,
        }
    }
    /// Returns X, Y, Z (k = 0, 1, 2) or w (k = 3) of a patch, in the coordinates of the polynomial.
    fn coordinate(patch: &RationalPatch, k: usize, terms: &Terms<'_>) -> Self {
        let (m, n) = patch.degree();
        let at = |i: usize| {
            let c = &patch.control()[i];
            let (factor, shift) = if k == 3 {
                (1.0, 0.0)
            } else {
                (terms.unit, terms.origin[k])
            };
            let (a, b) = (factor * c[k], shift * c[3]);
            let share = binomial(m, i / (n + 1)) * binomial(n, i % (n + 1));
            [(a + b) * share, (a.abs() + b.abs()) * share]
        };
        Self {
            degree: (m, n),
            values: (0..(m + 1) * (n + 1)).map(at).collect(),
            roundings: 4,
        }
    }
    /// Returns the powers from 0 to d.
    fn powers(&self, d: usize) -> Vec<Self> {
        let mut list = vec![Self::one()];
        for i in 0..d {
            list.push(list[i].times(self));
        }
        list
    }
    /// Multiplies two polynomials by convolution, and their sums of absolute values likewise.
    fn times(&self, other: &Self) -> Self {
        let ((m, n), (k, l)) = (self.degree, other.degree);
        let mut values = vec![[0.0; 2]; (m + k + 1) * (n + l + 1)];
        for (i, a) in self.values.iter().enumerate() {
            for (j, b) in other.values.iter().enumerate() {
                let row = i / (n + 1) + j / (l + 1);
                let out = &mut values[row * (n + l + 1) + i % (n + 1) + j % (l + 1)];
                out[0] += a[0] * b[0];
                out[1] += a[1] * b[1];
            }
        }
        let sums = (m.min(k) + 1) * (n.min(l) + 1);
        Self {
            degree: (m + k, n + l),
            values,
            roundings: self.roundings + other.roundings + sums + 1,
        }
    }
}

/// Returns the binomial coefficient n over k.
pub(crate) fn binomial(n: usize, k: usize) -> f64 {
    (0..k).fold(1.0, |b, i| b * (n - i) as f64 / (i + 1) as f64)
}

/// Returns an upper bound on |F| over a patch for F = Σ c xⁱyʲzᵏ, rounding included; `None` if the
/// degree is too high or a control weight is not positive.
pub(crate) fn largest(terms: &Terms<'_>, patch: &RationalPatch) -> Option<f64> {
    let degree = |e: &[u16; 3]| e.iter().map(|v| usize::from(*v)).sum::<usize>();
    let d = terms.list.iter().map(|(e, _)| degree(e)).max()?;
    let (m, n) = patch.degree();
    if d * m.max(n) > MAX_COMPOSITION_DEGREE || patch.control_weights().0 <= 0.0 {
        return None;
    }
    let powers: [Vec<ScaledPolynomial>; 4] =
        std::array::from_fn(|k| ScaledPolynomial::coordinate(patch, k, terms).powers(d));
    let composed = composed(terms, &powers, d);
    let whole = &powers[3][d];
    let roundings = composed.roundings.max(whole.roundings) + terms.list.len() + 2;
    let rounding = roundings as f64 * f64::EPSILON;
    let quotient = |(sum, w): (&[f64; 2], &[f64; 2])| {
        (sum[0].abs() + rounding * sum[1]) / (w[0] * (1.0 - rounding))
    };
    let quotients = composed.values.iter().zip(&whole.values).map(quotient);
    let most = quotients.fold(0.0, f64::max) * (1.0 + 1e-12);
    most.is_finite().then_some(most)
}

/// Composes w^d F(X/w, Y/w, Z/w) from the powers of X, Y, Z and w.
fn composed(terms: &Terms<'_>, powers: &[Vec<ScaledPolynomial>; 4], d: usize) -> ScaledPolynomial {
    let whole = &powers[3][d];
    let mut sum = ScaledPolynomial {
        degree: whole.degree,
        values: vec![[0.0; 2]; whole.values.len()],
        roundings: 0,
    };
    for (e, c) in terms.list {
        let [i, j, k] = e.map(usize::from);
        let product = powers[0][i]
            .times(&powers[1][j])
            .times(&powers[2][k])
            .times(&powers[3][d - i - j - k]);
        for (sum, v) in sum.values.iter_mut().zip(&product.values) {
            sum[0] += c * v[0];
            sum[1] += (c * v[1]).abs();
        }
        sum.roundings = sum.roundings.max(product.roundings);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// z − c on a plane z = h is h − c; x y² on that square of side 1 is at most 1, and its
    /// coefficients show it.
    #[test]
    fn bounds_of_compositions() {
        let mut patch =
            RationalPatch::planar((2, 3), [0.0, 0.0, 0.25], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        // A common factor of the weights changes no point.
        patch
            .control_mut()
            .iter_mut()
            .for_each(|c| *c = c.map(|v| 1.7 * v));
        type List<'a> = &'a [([u16; 3], f64)];
        let of = |list: List<'_>, origin: [f64; 3], unit: f64| {
            largest(&Terms { list, origin, unit }, &patch)
        };
        let at = |list: List<'_>| of(list, [0.0; 3], 1.0).expect("a bound");
        assert!((at(&[([0, 0, 1], 1.0), ([0, 0, 0], -0.2)]) - 0.05).abs() < 1e-12);
        assert!((at(&[([1, 2, 0], -3.0)]) - 3.0).abs() < 1e-11);
        let zero = at(&[([0, 0, 2], 1.0), ([0, 0, 0], -0.0625)]);
        assert!(zero > 0.0 && zero < 1e-13, "{zero}");
        assert_eq!(of(&[([40, 0, 0], 1.0)], [0.0; 3], 1.0), None);
        // x y² about (3, 2, 1) in units of 2, at the far corner: (3 + 2)(2 + 2)².
        let moved = of(&[([1, 2, 0], 1.0)], [3.0, 2.0, 1.0], 2.0).expect("a bound");
        assert!((moved - 80.0).abs() < 1e-9, "{moved}");
    }
}
