//! Double-double arithmetic, for the few computations in which a double has too few digits.

use std::ops::{Add, Mul};

/// Unevaluated sum of two doubles with some 31 decimal digits (T. J. Dekker, Numer. Math. 18, 1971,
/// pages 224–242). The range of exponents is that of doubles: below about 1e-290 products lose the
/// second double, above 1e290 they overflow.
///
/// ```
/// use isoform_num::DoubleDouble;
/// let tiny = DoubleDouble::from(1.0) * DoubleDouble::from(1e-20);
/// assert_eq!((DoubleDouble::from(1.0) + tiny + DoubleDouble::from(-1.0)).value(), 1e-20);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubleDouble {
    hi: f64,
    lo: f64,
}

/// Returns the rounded sum and its exact rounding error (D. E. Knuth's two-sum).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let c = sum - a;
    (sum, (a - (sum - c)) + (b - c))
}

/// Returns the exact sum of a number and one of smaller magnitude.
fn quick_two_sum(a: f64, b: f64) -> DoubleDouble {
    let hi = a + b;
    DoubleDouble {
        hi,
        lo: b - (hi - a),
    }
}

/// Returns the rounded product and its exact rounding error (T. J. Dekker's product with G. W.
/// Veltkamp's splitting).
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let split = |x: f64| {
        let c = 134_217_729.0 * x;
        let hi = c - (c - x);
        (hi, x - hi)
    };
    let product = a * b;
    let ((ah, al), (bh, bl)) = (split(a), split(b));
    (product, ((ah * bh - product) + ah * bl + al * bh) + al * bl)
}

impl DoubleDouble {
    /// Returns the sum of a number and a correction of it, without rounding.
    pub fn new(a: f64, b: f64) -> Self {
        let (hi, lo) = two_sum(a, b);
        Self { hi, lo }
    }
    /// Returns the value rounded to a double.
    pub fn value(self) -> f64 {
        self.hi
    }
}

impl From<f64> for DoubleDouble {
    fn from(x: f64) -> Self {
        Self { hi: x, lo: 0.0 }
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (sum, error) = two_sum(self.hi, other.hi);
        let (low, low_error) = two_sum(self.lo, other.lo);
        let next = quick_two_sum(sum, error + low);
        quick_two_sum(next.hi, next.lo + low_error)
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let (product, error) = two_product(self.hi, other.hi);
        quick_two_sum(product, error + (self.hi * other.lo + self.lo * other.hi))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (1 + x)⁸ − 1 by the binomial theorem, whose terms of x = 1e-9 are known: plain doubles lose
    /// nine digits of it.
    #[test]
    fn cancellation() {
        let x = 1e-9;
        let one = DoubleDouble::new(1.0, x);
        let power = (0..7).fold(one, |p, _| p * one);
        let exact = 8.0 * x + 28.0 * x * x + 56.0 * x * x * x;
        let found = (power + DoubleDouble::from(-1.0)).value();
        assert!((found / exact - 1.0).abs() < 1e-15, "{found:e}");
        assert!(
            (((1.0f64 + x).powi(8) - 1.0) / exact - 1.0).abs() > 1e-9,
            "doubles would do"
        );
    }
}
