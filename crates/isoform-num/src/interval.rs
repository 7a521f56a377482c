//! Closed intervals with outward rounding.
//!
//! Every operation returns an interval that contains all its values over the arguments: sums and
//! products are widened by one unit in the last place on each side (round-to-nearest is off by half
//! a unit at most), library functions by four, since the platform's `libm` is trusted to two. If
//! the function is undefined on part of the argument, the result is the hull of the values on the
//! rest, or [`Interval::ALL`]; if the true range is unbounded, so is the result.

use crate::Real;
use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Closed interval \[lo, hi\] of real numbers. Bounds are never NaN; an unknown bound is −∞ or ∞.
///
/// ```
/// use isoform_num::{Interval, Real};
///
/// // x² − x on [0, 1] has the range [−1/4, 0]; intervals find a range around it.
/// let x = Interval::new(0.0, 1.0);
/// let range = x.square() - x;
/// assert!(range.contains(-0.25) && range.contains(0.0) && range.width() < 2.0001);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    lo: f64,
    hi: f64,
}

/// Outward widening of results of `libm`, in units in the last place. The documented errors of
/// glibc, musl and Apple's library are below 2 units; 4 leave a factor of two.
const LIBM_ULPS: u32 = 4;

impl Interval {
    /// The interval from −∞ to ∞.
    pub const ALL: Self = Self {
        lo: f64::NEG_INFINITY,
        hi: f64::INFINITY,
    };

    /// Returns the interval from `lo` to `hi`; [`Interval::ALL`] if either is NaN.
    ///
    /// # Panics
    /// If lo > hi.
    #[inline]
    pub fn new(lo: f64, hi: f64) -> Self {
        if lo.is_nan() || hi.is_nan() {
            return Self::ALL;
        }
        assert!(lo <= hi, "interval bounds out of order: {lo} > {hi}");
        Self { lo, hi }
    }

    /// Returns the lower bound.
    #[inline]
    pub fn lo(&self) -> f64 {
        self.lo
    }
    /// Returns the upper bound.
    #[inline]
    pub fn hi(&self) -> f64 {
        self.hi
    }
    /// Returns hi − lo, rounded to nearest.
    pub fn width(&self) -> f64 {
        self.hi - self.lo
    }
    /// Returns (lo + hi)/2 in rounded arithmetic: a number near the exact midpoint.
    pub fn middle(&self) -> f64 {
        0.5 * self.lo + 0.5 * self.hi
    }
    /// Returns an upper bound, rounded up, of |x − [`middle`](Self::middle)| over all x of the
    /// interval.
    pub fn radius(&self) -> f64 {
        let m = self.middle();
        (self.hi - m).max(m - self.lo).next_up()
    }
    /// Returns the largest |x| of the interval.
    pub fn magnitude(&self) -> f64 {
        self.lo.abs().max(self.hi.abs())
    }
    /// Returns true if `v` lies in the interval.
    #[inline]
    pub fn contains(&self, v: f64) -> bool {
        self.lo <= v && v <= self.hi
    }
    /// Returns the smallest interval that contains both.
    pub fn hull(&self, o: &Self) -> Self {
        Self {
            lo: self.lo.min(o.lo),
            hi: self.hi.max(o.hi),
        }
    }

    /// Returns \[lo, hi\] widened by `ulps` units in the last place on both sides; a bound that is
    /// NaN becomes infinite.
    #[inline]
    fn out(lo: f64, hi: f64, ulps: u32) -> Self {
        let (mut l, mut h) = (lo, hi);
        if l.is_nan() {
            l = f64::NEG_INFINITY;
        }
        if h.is_nan() {
            h = f64::INFINITY;
        }
        for _ in 0..ulps {
            l = l.next_down();
            h = h.next_up();
        }
        Self { lo: l, hi: h }
    }

    /// Returns the range of an increasing function f over the interval, widened by [`LIBM_ULPS`].
    fn increasing(&self, f: impl Fn(f64) -> f64) -> Self {
        Self::out(f(self.lo), f(self.hi), LIBM_ULPS)
    }

    /// Returns the range of the cosine: that of the end points, with ±1 added if a multiple of π
    /// may lie inside.
    fn cosine(&self) -> Self {
        let full = Self { lo: -1.0, hi: 1.0 };
        if !(self.lo.abs() < 1e9 && self.hi.abs() < 1e9) || self.width() >= 2.0 * PI {
            return full;
        }
        // First and last multiple of π inside, widened so that an extremum near an end counts as
        // inside.
        let slack = 1e-6;
        let (k0, k1) = (
            ((self.lo - slack) / PI).ceil(),
            ((self.hi + slack) / PI).floor(),
        );
        let (c0, c1) = (self.lo.cos(), self.hi.cos());
        let mut r = Self::out(c0.min(c1), c0.max(c1), LIBM_ULPS);
        let mut k = k0;
        while k <= k1 {
            if k.rem_euclid(2.0) == 0.0 {
                r.hi = 1.0;
            } else {
                r.lo = -1.0;
            }
            k += 1.0;
        }
        Self {
            lo: r.lo.max(-1.0),
            hi: r.hi.min(1.0),
        }
    }

    fn map_monotone_clamped(&self, lo: f64, hi: f64, f: impl Fn(f64) -> f64) -> Option<Self> {
        let (l, h) = (self.lo.max(lo), self.hi.min(hi));
        (l <= h).then(|| Self::out(f(l), f(h), LIBM_ULPS))
    }
}

impl Add for Interval {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self::out(self.lo + o.lo, self.hi + o.hi, 1)
    }
}

impl Sub for Interval {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self::out(self.lo - o.hi, self.hi - o.lo, 1)
    }
}

impl Neg for Interval {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self {
            lo: -self.hi,
            hi: -self.lo,
        }
    }
}

/// Returns the product of two bounds, with 0·∞ = 0: an infinite bound means "arbitrarily large" and
/// is not a value of the interval.
fn times(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 { 0.0 } else { a * b }
}

impl Mul for Interval {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        let mut p = [
            self.lo * o.lo,
            self.lo * o.hi,
            self.hi * o.lo,
            self.hi * o.hi,
        ];
        if p.iter().any(|v| v.is_nan()) {
            p = [
                times(self.lo, o.lo),
                times(self.lo, o.hi),
                times(self.hi, o.lo),
                times(self.hi, o.hi),
            ];
        }
        let (least, most) = (
            |a: f64, b: f64| if a < b { a } else { b },
            |a: f64, b: f64| if a > b { a } else { b },
        );
        Self::out(
            least(least(p[0], p[1]), least(p[2], p[3])),
            most(most(p[0], p[1]), most(p[2], p[3])),
            1,
        )
    }
}

impl Div for Interval {
    type Output = Self;
    #[allow(
        clippy::suspicious_arithmetic_impl,
        reason = "a quotient is a product with the reciprocal's range"
    )]
    fn div(self, o: Self) -> Self {
        if o.contains(0.0) {
            if o.lo == 0.0 && o.hi > 0.0 {
                return self
                    * Self {
                        lo: (1.0 / o.hi).next_down(),
                        hi: f64::INFINITY,
                    };
            }
            if o.hi == 0.0 && o.lo < 0.0 {
                return self
                    * Self {
                        lo: f64::NEG_INFINITY,
                        hi: (1.0 / o.lo).next_up(),
                    };
            }
            return Self::ALL;
        }
        let q = [
            self.lo / o.lo,
            self.lo / o.hi,
            self.hi / o.lo,
            self.hi / o.hi,
        ];
        if q.iter().any(|v| v.is_nan()) {
            return Self::ALL;
        }
        Self::out(
            q.iter().copied().fold(f64::INFINITY, f64::min),
            q.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            1,
        )
    }
}

impl Real for Interval {
    #[inline]
    fn constant(c: f64) -> Self {
        if c.is_nan() {
            Self::ALL
        } else {
            Self { lo: c, hi: c }
        }
    }
    fn value(&self) -> f64 {
        if self.lo.is_finite() && self.hi.is_finite() {
            0.5 * self.lo + 0.5 * self.hi
        } else {
            f64::NAN
        }
    }
    #[inline]
    fn sqrt(&self) -> Self {
        if self.hi < 0.0 {
            return Self::ALL;
        }
        let r = Self::out(self.lo.max(0.0).sqrt(), self.hi.sqrt(), 1);
        Self {
            lo: r.lo.max(0.0),
            hi: r.hi,
        }
    }
    fn exp(&self) -> Self {
        let r = self.increasing(f64::exp);
        Self {
            lo: r.lo.max(0.0),
            hi: r.hi,
        }
    }
    fn ln(&self) -> Self {
        self.map_monotone_clamped(0.0, f64::INFINITY, f64::ln)
            .unwrap_or(Self::ALL)
    }
    fn sin(&self) -> Self {
        // The shift by π/2 is itself rounded; `cosine` widens the search for extremes by far more,
        // and near an end the value moves by at most the shift's error.
        let c = (*self
            - Self {
                lo: FRAC_PI_2.next_down(),
                hi: FRAC_PI_2.next_up(),
            })
        .cosine();
        Self {
            lo: c.lo.max(-1.0),
            hi: c.hi.min(1.0),
        }
    }
    fn cos(&self) -> Self {
        self.cosine()
    }
    fn tan(&self) -> Self {
        let k0 = ((self.lo - FRAC_PI_2) / PI - 1e-6).floor();
        let k1 = ((self.hi - FRAC_PI_2) / PI + 1e-6).floor();
        if k0 == k1 && self.lo.abs() < 1e9 {
            self.increasing(f64::tan)
        } else {
            Self::ALL
        }
    }
    fn asin(&self) -> Self {
        self.map_monotone_clamped(-1.0, 1.0, f64::asin)
            .unwrap_or(Self::ALL)
    }
    fn acos(&self) -> Self {
        let r = (-*self).map_monotone_clamped(-1.0, 1.0, |v| (-v).acos());
        r.unwrap_or(Self::ALL)
    }
    fn atan(&self) -> Self {
        self.increasing(f64::atan)
    }
    fn sinh(&self) -> Self {
        self.increasing(f64::sinh)
    }
    fn cosh(&self) -> Self {
        let a = self.abs();
        let r = a.increasing(f64::cosh);
        Self {
            lo: r.lo.max(1.0),
            hi: r.hi,
        }
    }
    fn tanh(&self) -> Self {
        self.increasing(f64::tanh)
    }
    #[inline]
    fn abs(&self) -> Self {
        if self.lo >= 0.0 {
            *self
        } else if self.hi <= 0.0 {
            -*self
        } else {
            Self {
                lo: 0.0,
                hi: self.hi.max(-self.lo),
            }
        }
    }
    #[inline]
    fn square(&self) -> Self {
        let a = self.abs();
        let r = Self::out(a.lo * a.lo, a.hi * a.hi, 1);
        Self {
            lo: r.lo.max(0.0),
            hi: r.hi,
        }
    }
    fn powi(&self, n: i32) -> Self {
        if n == 0 {
            return Self::constant(1.0);
        }
        // A power by multiplications loses at most half a unit per product, and there are fewer
        // than 64 of them.
        let k = n.unsigned_abs();
        let base = if k.is_multiple_of(2) {
            self.abs()
        } else {
            *self
        };
        let power = |v: f64| Real::powi(&v, k as i32);
        let mut r = Self::out(power(base.lo), power(base.hi), 64.min(k));
        if k.is_multiple_of(2) {
            r.lo = r.lo.max(0.0);
        }
        if n < 0 { Self::constant(1.0) / r } else { r }
    }
    fn powf(&self, v: &Self) -> Self {
        if self.lo < 0.0 {
            return Self::ALL;
        }
        if self.lo == 0.0 {
            // 0^v = 0 for v > 0; the rest follows from monotonicity in the base.
            if v.lo <= 0.0 {
                return Self::ALL;
            }
            let top = (Self {
                lo: self.hi.max(f64::MIN_POSITIVE),
                hi: self.hi.max(f64::MIN_POSITIVE),
            }
            .ln()
                * *v)
                .exp();
            return Self {
                lo: 0.0,
                hi: top.hi,
            };
        }
        (self.ln() * *v).exp()
    }
    fn atan2(&self, x: &Self) -> Self {
        if x.lo > 0.0 {
            return (*self / *x).atan();
        }
        if self.lo > 0.0 {
            return Self {
                lo: FRAC_PI_2.next_down(),
                hi: FRAC_PI_2.next_up(),
            } - (*x / *self).atan();
        }
        if self.hi < 0.0 {
            return Self {
                lo: -FRAC_PI_2.next_up(),
                hi: -FRAC_PI_2.next_down(),
            } - (*x / *self).atan();
        }
        Self {
            lo: -PI.next_up(),
            hi: PI.next_up(),
        }
    }
    fn floor(&self) -> Self {
        Self {
            lo: self.lo.floor(),
            hi: self.hi.floor(),
        }
    }
    fn ceil(&self) -> Self {
        Self {
            lo: self.lo.ceil(),
            hi: self.hi.ceil(),
        }
    }
    fn trunc(&self) -> Self {
        Self {
            lo: self.lo.trunc(),
            hi: self.hi.trunc(),
        }
    }
    fn sign(&self) -> Self {
        Self {
            lo: Real::sign(&self.lo),
            hi: Real::sign(&self.hi),
        }
    }
    #[inline]
    fn min(&self, o: &Self) -> Self {
        Self {
            lo: self.lo.min(o.lo),
            hi: self.hi.min(o.hi),
        }
    }
    #[inline]
    fn max(&self, o: &Self) -> Self {
        Self {
            lo: self.lo.max(o.lo),
            hi: self.hi.max(o.hi),
        }
    }
    fn less(&self, o: &Self) -> Self {
        if self.hi < o.lo {
            Self::constant(1.0)
        } else if self.lo >= o.hi {
            Self::constant(0.0)
        } else {
            Self { lo: 0.0, hi: 1.0 }
        }
    }
    fn less_eq(&self, o: &Self) -> Self {
        if self.hi <= o.lo {
            Self::constant(1.0)
        } else if self.lo > o.hi {
            Self::constant(0.0)
        } else {
            Self { lo: 0.0, hi: 1.0 }
        }
    }
    fn select(&self, a: &Self, b: &Self) -> Self {
        if !self.contains(0.0) {
            *a
        } else if self.lo == 0.0 && self.hi == 0.0 {
            *b
        } else {
            a.hull(b)
        }
    }
    fn r_union(&self, v: &Self) -> Self {
        // Increasing in both arguments (1 + u/h ≥ 0), so the ends give the range.
        let f = |a: f64, b: f64| a + b + (a * a + b * b).sqrt();
        Self::out_r(f(self.lo, v.lo), f(self.hi, v.hi), self, v)
    }
    fn r_intersection(&self, v: &Self) -> Self {
        let f = |a: f64, b: f64| a + b - (a * a + b * b).sqrt();
        Self::out_r(f(self.lo, v.lo), f(self.hi, v.hi), self, v)
    }
}

impl Interval {
    /// Widens \[lo, hi\] by the rounding error of an R-function, whose intermediate sums can be
    /// larger than the result.
    fn out_r(lo: f64, hi: f64, u: &Self, v: &Self) -> Self {
        let m = |a: f64, b: f64| 4.0 * f64::EPSILON * (a.abs() + b.abs()) + f64::MIN_POSITIVE;
        Self::out(lo - m(u.lo, v.lo), hi + m(u.hi, v.hi), 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pair() -> impl Strategy<Value = (Interval, f64)> {
        (-1e3..1e3f64, 0.0..10.0f64, 0.0..=1.0f64)
            .prop_map(|(lo, w, t)| (Interval::new(lo, lo + w), (lo + w * t).clamp(lo, lo + w)))
    }

    proptest! {
        #[test]
        fn contains_every_value((x, v) in pair(), (y, w) in pair(), n in -4i32..6) {
            let hold = |i: Interval, f: f64, what: &str| {
                prop_assert!(!f.is_finite() || i.contains(f), "{what}: {f} outside {i:?} for {v} {w}");
                Ok(())
            };
            hold(x + y, v + w, "+")?;
            hold(x - y, v - w, "-")?;
            hold(x * y, v * w, "*")?;
            hold(x / y, v / w, "/")?;
            hold(x.square(), v * v, "square")?;
            hold(x.powi(n), Real::powi(&v, n), "powi")?;
            hold(x.sqrt(), v.sqrt(), "sqrt")?;
            hold(Real::sin(&x), v.sin(), "sin")?;
            hold(Real::cos(&x), v.cos(), "cos")?;
            hold(Real::tan(&x), v.tan(), "tan")?;
            hold(Real::atan(&x), v.atan(), "atan")?;
            hold(Real::atan2(&x, &y), v.atan2(w), "atan2")?;
            hold(Real::abs(&x), v.abs(), "abs")?;
            hold(Real::exp(&(x / Interval::constant(100.0))), (v / 100.0).exp(), "exp")?;
            hold(Real::ln(&x), v.ln(), "ln")?;
            hold(x.r_union(&y), v.r_union(&w), "r_union")?;
            hold(x.r_intersection(&y), v.r_intersection(&w), "r_intersection")?;
            hold(Real::min(&x, &y), v.min(w), "min")?;
            hold(Real::max(&x, &y), v.max(w), "max")?;
            hold(Real::abs(&x).powf(&y), v.abs().powf(w), "powf")?;
        }
    }

    #[test]
    fn division_across_zero_is_everything() {
        assert_eq!(
            Interval::new(1.0, 2.0) / Interval::new(-1.0, 1.0),
            Interval::ALL
        );
        assert!((Interval::new(1.0, 2.0) / Interval::new(0.0, 1.0)).lo() > 0.99);
    }

    #[test]
    fn middle_and_radius_hold_the_interval() {
        let i = Interval::new(-1.0, 3.0);
        assert_eq!((i.middle(), i.magnitude()), (1.0, 3.0));
        assert_eq!(i.radius(), 2f64.next_up());
        // The sum of the ends exceeds all doubles.
        let large = Interval::new(f64::MAX, f64::MAX);
        assert_eq!(large.middle(), f64::MAX);
    }
}
