//! The operations a number type must offer.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number type that formulas can be evaluated in: `f64`, [`crate::Interval`], jets.
///
/// Branches are taken through [`Real::select`] and the comparisons, which return 1 or 0 (an
/// interval may return \[0, 1\]), so that one formula serves all types.
pub trait Real:
    Clone
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The constant `c`: derivatives zero, interval of width zero.
    fn constant(c: f64) -> Self;
    /// A representative value: the value of a jet, the midpoint of an interval.
    fn value(&self) -> f64;
    /// √self.
    fn sqrt(&self) -> Self;
    /// e^self.
    fn exp(&self) -> Self;
    /// Natural logarithm.
    fn ln(&self) -> Self;
    /// Sine, argument in radians.
    fn sin(&self) -> Self;
    /// Cosine, argument in radians.
    fn cos(&self) -> Self;
    /// Tangent, argument in radians.
    fn tan(&self) -> Self;
    /// Arc sine.
    fn asin(&self) -> Self;
    /// Arc cosine.
    fn acos(&self) -> Self;
    /// Arc tangent.
    fn atan(&self) -> Self;
    /// Hyperbolic sine.
    fn sinh(&self) -> Self;
    /// Hyperbolic cosine.
    fn cosh(&self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(&self) -> Self;
    /// |self|; the derivative at 0 is taken as 0.
    fn abs(&self) -> Self;
    /// self².
    fn square(&self) -> Self;
    /// self^n for an integer n.
    fn powi(&self, n: i32) -> Self;
    /// self^v = exp(v ln self) for self > 0.
    fn powf(&self, v: &Self) -> Self;
    /// Angle of the point (x = `x`, y = self), in (−π, π].
    fn atan2(&self, x: &Self) -> Self;
    /// Largest integer not above; derivative 0.
    fn floor(&self) -> Self;
    /// Smallest integer not below; derivative 0.
    fn ceil(&self) -> Self;
    /// Truncation towards zero; derivative 0.
    fn trunc(&self) -> Self;
    /// −1, 0 or 1; derivative 0.
    fn sign(&self) -> Self;
    /// The smaller; the first where both are equal.
    fn min(&self, other: &Self) -> Self;
    /// The larger; the first where both are equal.
    fn max(&self, other: &Self) -> Self;
    /// 1 where self < other, else 0.
    fn less(&self, other: &Self) -> Self;
    /// 1 where self ≤ other, else 0.
    fn less_eq(&self, other: &Self) -> Self;
    /// `a` where the condition self is not 0, `b` elsewhere.
    fn select(&self, a: &Self, b: &Self) -> Self;

    /// R0-union u + v + √(u² + v²).
    fn r_union(&self, v: &Self) -> Self {
        self.clone() + v.clone() + (self.square() + v.square()).sqrt()
    }
    /// R0-intersection u + v − √(u² + v²).
    fn r_intersection(&self, v: &Self) -> Self {
        self.clone() + v.clone() - (self.square() + v.square()).sqrt()
    }
}

impl Real for f64 {
    #[inline]
    fn constant(c: f64) -> Self {
        c
    }
    #[inline]
    fn value(&self) -> f64 {
        *self
    }
    #[inline]
    fn sqrt(&self) -> Self {
        Self::sqrt(*self)
    }
    fn exp(&self) -> Self {
        Self::exp(*self)
    }
    fn ln(&self) -> Self {
        Self::ln(*self)
    }
    fn sin(&self) -> Self {
        Self::sin(*self)
    }
    fn cos(&self) -> Self {
        Self::cos(*self)
    }
    fn tan(&self) -> Self {
        Self::tan(*self)
    }
    fn asin(&self) -> Self {
        Self::asin(*self)
    }
    fn acos(&self) -> Self {
        Self::acos(*self)
    }
    fn atan(&self) -> Self {
        Self::atan(*self)
    }
    fn sinh(&self) -> Self {
        Self::sinh(*self)
    }
    fn cosh(&self) -> Self {
        Self::cosh(*self)
    }
    fn tanh(&self) -> Self {
        Self::tanh(*self)
    }
    #[inline]
    fn abs(&self) -> Self {
        Self::abs(*self)
    }
    #[inline]
    fn square(&self) -> Self {
        *self * *self
    }
    fn powi(&self, n: i32) -> Self {
        // By repeated multiplication in a fixed order: the same bits on every platform and in every
        // evaluator.
        let mut r = 1.0;
        let mut base = *self;
        let mut k = n.unsigned_abs();
        while k > 0 {
            if k & 1 == 1 {
                r *= base;
            }
            base *= base;
            k >>= 1;
        }
        if n < 0 { 1.0 / r } else { r }
    }
    fn powf(&self, v: &Self) -> Self {
        Self::powf(*self, *v)
    }
    fn atan2(&self, x: &Self) -> Self {
        Self::atan2(*self, *x)
    }
    fn floor(&self) -> Self {
        Self::floor(*self)
    }
    fn ceil(&self) -> Self {
        Self::ceil(*self)
    }
    fn trunc(&self) -> Self {
        Self::trunc(*self)
    }
    fn sign(&self) -> Self {
        if *self > 0.0 {
            1.0
        } else if *self < 0.0 {
            -1.0
        } else {
            *self * 0.0
        }
    }
    #[inline]
    fn min(&self, other: &Self) -> Self {
        if *other < *self { *other } else { *self }
    }
    #[inline]
    fn max(&self, other: &Self) -> Self {
        if *other > *self { *other } else { *self }
    }
    #[inline]
    fn less(&self, other: &Self) -> Self {
        Self::from(u8::from(*self < *other))
    }
    #[inline]
    fn less_eq(&self, other: &Self) -> Self {
        Self::from(u8::from(*self <= *other))
    }
    #[inline]
    fn select(&self, a: &Self, b: &Self) -> Self {
        if *self != 0.0 { *a } else { *b }
    }
}
