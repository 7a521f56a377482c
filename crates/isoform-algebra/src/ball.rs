//! Real numbers as fixed-point midpoints with error bounds, of any precision.

use dashu_base::Abs;
use dashu_int::IBig;
use std::cmp::Ordering;

/// Numbers within radius/2^precision of middle/2^precision; the caller keeps the precision.
#[derive(Clone, Debug)]
pub(crate) struct Ball {
    pub(crate) middle: IBig,
    pub(crate) radius: IBig,
}

impl Ball {
    /// Returns the ball of an exact number.
    pub(crate) fn exact(middle: IBig) -> Self {
        Self {
            middle,
            radius: IBig::ZERO,
        }
    }
    /// Returns the ball of an integer at a precision.
    pub(crate) fn integer(n: &IBig, precision: usize) -> Self {
        Self::exact(n << precision)
    }
    /// Returns the sign, if all numbers of the ball have one sign.
    pub(crate) fn sign(&self) -> Option<Ordering> {
        if self.radius.is_zero() || (&self.middle).abs() > self.radius {
            Some(crate::upoly::sign(&self.middle))
        } else {
            None
        }
    }
    /// Returns the sum; errors add up.
    pub(crate) fn add(&self, o: &Self) -> Self {
        Self {
            middle: &self.middle + &o.middle,
            radius: &self.radius + &o.radius,
        }
    }
    /// Returns the difference; errors add up.
    pub(crate) fn sub(&self, o: &Self) -> Self {
        Self {
            middle: &self.middle - &o.middle,
            radius: &self.radius + &o.radius,
        }
    }
    /// Returns the product, rounded, with one unit of error for the rounding, and another one if
    /// the factors have errors.
    pub(crate) fn mul(&self, o: &Self, precision: usize) -> Self {
        let middle = (&self.middle * &o.middle) >> precision;
        if self.radius.is_zero() && o.radius.is_zero() {
            return Self {
                middle,
                radius: IBig::ONE,
            };
        }
        let radius = (&self.middle).abs() * &o.radius
            + (&o.middle).abs() * &self.radius
            + &self.radius * &o.radius;
        Self {
            middle,
            radius: (radius >> precision) + 2,
        }
    }
    /// Returns the quotient; `None` if the divisor may be zero.
    pub(crate) fn div(&self, o: &Self, precision: usize) -> Option<Self> {
        let far = (&o.middle).abs();
        if far <= o.radius {
            return None;
        }
        let near = &far - &o.radius;
        let error = ((&self.middle).abs() * &o.radius + &far * &self.radius) << precision;
        Some(Self {
            middle: (&self.middle << precision) / &o.middle,
            radius: error / (far * near) + 2,
        })
    }
    /// Returns an upper and a lower bound of the absolute values.
    pub(crate) fn magnitude(&self) -> (IBig, IBig) {
        let m = (&self.middle).abs();
        (&m + &self.radius, (m - &self.radius).max(IBig::ZERO))
    }
}

/// Returns the value of a polynomial at a ball, by Horner's rule.
pub(crate) fn eval(coefficients: &[Ball], x: &Ball, precision: usize) -> Ball {
    let zero = Ball::exact(IBig::ZERO);
    coefficients
        .iter()
        .rev()
        .fold(zero, |sum, c| sum.mul(x, precision).add(c))
}

/// Returns the polynomial a(x + c).
pub(crate) fn shift(coefficients: &[Ball], c: &Ball, precision: usize) -> Vec<Ball> {
    let mut a = coefficients.to_vec();
    for i in 0..a.len() {
        for j in (i..a.len() - 1).rev() {
            a[j] = a[j].add(&a[j + 1].mul(c, precision));
        }
    }
    a
}
