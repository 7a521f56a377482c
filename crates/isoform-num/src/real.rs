//! Operations of the number types in which formulas can be evaluated.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Number type in which formulas can be evaluated: `f64`, [`crate::Interval`], jets.
///
/// Formulas branch by [`Real::select`] and the comparisons, which return 1 or 0 (an interval may
/// return \[0, 1\]), so that one formula serves all types.
pub trait Real:
    Clone
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Returns the constant `c`: a jet with derivatives 0, an interval of width 0.
    fn constant(c: f64) -> Self;
    /// Returns a representative value: the value of a jet, the midpoint of an interval.
    fn value(&self) -> f64;
    /// Returns √self.
    fn sqrt(&self) -> Self;
    /// Returns e^self.
    fn exp(&self) -> Self;
    /// Returns the natural logarithm.
    fn ln(&self) -> Self;
    /// Returns the sine; the argument is in radians.
    fn sin(&self) -> Self;
    /// Returns the cosine; the argument is in radians.
    fn cos(&self) -> Self;
    /// Returns the tangent; the argument is in radians.
    fn tan(&self) -> Self;
    /// Returns the arc sine, in radians.
    fn asin(&self) -> Self;
    /// Returns the arc cosine, in radians.
    fn acos(&self) -> Self;
    /// Returns the arc tangent, in radians.
    fn atan(&self) -> Self;
    /// Returns the hyperbolic sine.
    fn sinh(&self) -> Self;
    /// Returns the hyperbolic cosine.
    fn cosh(&self) -> Self;
    /// Returns the hyperbolic tangent.
    fn tanh(&self) -> Self;
    /// Returns |self|; the derivative at 0 is taken as 0.
    fn abs(&self) -> Self;
    /// Returns self².
    fn square(&self) -> Self;
    /// Returns self^n for an integer n.
    fn powi(&self, n: i32) -> Self;
    /// Returns self^v = exp(v ln self) for self > 0.
    fn powf(&self, v: &Self) -> Self;
    /// Returns the angle of the point (x = `x`, y = self), in (−π, π] radians.
    fn atan2(&self, x: &Self) -> Self;
    /// Returns the largest integer not above; its derivative is 0.
    fn floor(&self) -> Self;
    /// Returns the smallest integer not below; its derivative is 0.
    fn ceil(&self) -> Self;
    /// Rounds towards zero; the derivative is 0.
    fn trunc(&self) -> Self;
    /// Returns the sign −1, 0 or 1; its derivative is 0.
    fn sign(&self) -> Self;
    /// Returns the smaller one; `self` if both are equal.
    fn min(&self, other: &Self) -> Self;
    /// Returns the larger one; `self` if both are equal.
    fn max(&self, other: &Self) -> Self;
    /// Returns 1 if self < other, else 0.
    fn less(&self, other: &Self) -> Self;
    /// Returns 1 if self ≤ other, else 0.
    fn less_eq(&self, other: &Self) -> Self;
    /// Returns `a` if the condition `self` is not 0, else `b`.
    fn select(&self, a: &Self, b: &Self) -> Self;

    /// Returns the R0-union u + v + √(u² + v²).
    fn r_union(&self, v: &Self) -> Self {
        self.clone() + v.clone() + (self.square() + v.square()).sqrt()
    }
    /// Returns the R0-intersection u + v − √(u² + v²).
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
        // Repeated multiplication in a fixed order gives identical bits on every platform and in
        // every evaluator.
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
