//! Taylor expansions with interval coefficients: enclosures of all derivatives up to order 3 over a
//! box.
//!
//! If a kink (of a minimum, maximum or absolute value) may lie in the box, the gradient is the hull
//! of those of both branches, which contains Clarke's generalised gradient, and higher derivatives
//! are unbounded intervals.

use crate::jet::{PAIRS, SECOND, TRIPLES};
use crate::{Interval, Real};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Intervals that contain a function and its derivatives in x, y, z over a box, up to order 3, or
/// up to `ORDER` at less cost; the fields of higher orders then have no meaning.
///
/// ```
/// use isoform_num::{Interval, IntervalJet};
///
/// // x y over [1, 2] × [3, 4]: ∂/∂x = y, ∂²/∂x∂y = 1.
/// let x: IntervalJet = IntervalJet::variable(Interval::new(1.0, 2.0), 0);
/// let y: IntervalJet = IntervalJet::variable(Interval::new(3.0, 4.0), 1);
/// let product = x * y;
/// assert!(product.v.contains(3.0) && product.v.contains(8.0));
/// assert!(product.g[0].contains(3.5) && product.h[1].contains(1.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntervalJet<const ORDER: usize = 3> {
    /// Value.
    pub v: Interval,
    /// Gradient.
    pub g: [Interval; 3],
    /// Second derivatives xx, xy, xz, yy, yz, zz.
    pub h: [Interval; 6],
    /// Third derivatives xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz.
    pub t: [Interval; 10],
}

fn c(v: f64) -> Interval {
    Interval::constant(v)
}

fn is_zero(v: Interval) -> bool {
    v.lo() == 0.0 && v.hi() == 0.0
}
/// Returns a b, exactly 0 if a factor is 0, as most derivatives are: widening would make the
/// product subnormal, and arithmetic with subnormal numbers is slow.
fn times(a: Interval, b: Interval) -> Interval {
    if is_zero(a) || is_zero(b) {
        c(0.0)
    } else {
        a * b
    }
}
/// Returns a + b, without widening if a summand is 0.
fn plus(a: Interval, b: Interval) -> Interval {
    if is_zero(a) {
        b
    } else if is_zero(b) {
        a
    } else {
        a + b
    }
}

impl<const ORDER: usize> IntervalJet<ORDER> {
    /// Returns the coordinate `i` (0 = x, 1 = y, 2 = z) with the range `v`.
    pub fn variable(v: Interval, i: usize) -> Self {
        let mut j = Self::flat(v);
        j.g[i] = c(1.0);
        j
    }
    fn flat(v: Interval) -> Self {
        Self {
            v,
            g: [c(0.0); 3],
            h: [c(0.0); 6],
            t: [c(0.0); 10],
        }
    }
    /// Returns the second derivatives, or zeros if `ORDER` is below 2.
    fn second(derivative: impl Fn(usize) -> Interval) -> [Interval; 6] {
        if ORDER < 2 {
            return [c(0.0); 6];
        }
        std::array::from_fn(derivative)
    }
    /// Returns the third derivatives, or zeros if `ORDER` is below 3.
    fn third(derivative: impl Fn(usize) -> Interval) -> [Interval; 10] {
        if ORDER < 3 {
            return [c(0.0); 10];
        }
        std::array::from_fn(derivative)
    }
    /// Returns the composition f(self), where the derivatives of f of order 0 to 3 have the ranges
    /// given.
    fn chain(&self, [f0, f1, f2, f3]: [Interval; 4]) -> Self {
        let (g, s) = (&self.g, |i: usize, j: usize| self.h[SECOND[i][j]]);
        Self {
            v: f0,
            g: g.map(|u| times(f1, u)),
            h: Self::second(|n| {
                let (i, j) = PAIRS[n];
                plus(times(f1, self.h[n]), times(times(f2, g[i]), g[j]))
            }),
            t: Self::third(|n| {
                let (i, j, k) = TRIPLES[n];
                let mixed = plus(
                    plus(times(s(i, j), g[k]), times(s(i, k), g[j])),
                    times(s(j, k), g[i]),
                );
                plus(
                    plus(times(f1, self.t[n]), times(f2, mixed)),
                    times(times(times(f3, g[i]), g[j]), g[k]),
                )
            }),
        }
    }
    fn map2(&self, o: &Self, f: impl Fn(Interval, Interval) -> Interval) -> Self {
        Self {
            v: f(self.v, o.v),
            g: std::array::from_fn(|i| f(self.g[i], o.g[i])),
            h: Self::second(|i| f(self.h[i], o.h[i])),
            t: Self::third(|i| f(self.t[i], o.t[i])),
        }
    }
    fn product(&self, o: &Self) -> Self {
        let (a, b) = (
            |i: usize, j: usize| self.h[SECOND[i][j]],
            |i: usize, j: usize| o.h[SECOND[i][j]],
        );
        fn sum<const N: usize>(products: [(Interval, Interval); N]) -> Interval {
            products
                .into_iter()
                .fold(c(0.0), |s, (a, b)| plus(s, times(a, b)))
        }
        Self {
            v: self.v * o.v,
            g: std::array::from_fn(|i| plus(times(self.v, o.g[i]), times(self.g[i], o.v))),
            h: Self::second(|n| {
                let (i, j) = PAIRS[n];
                sum([
                    (self.v, o.h[n]),
                    (self.g[i], o.g[j]),
                    (self.g[j], o.g[i]),
                    (self.h[n], o.v),
                ])
            }),
            t: Self::third(|n| {
                let (i, j, k) = TRIPLES[n];
                sum([
                    (self.v, o.t[n]),
                    (self.g[i], b(j, k)),
                    (self.g[j], b(i, k)),
                    (self.g[k], b(i, j)),
                    (a(i, j), o.g[k]),
                    (a(i, k), o.g[j]),
                    (a(j, k), o.g[i]),
                    (self.t[n], o.v),
                ])
            }),
        }
    }
    /// Returns a continuous function with the range `v` that equals either of two branches at each
    /// point.
    fn either(&self, o: &Self, v: Interval) -> Self {
        Self {
            v,
            g: std::array::from_fn(|i| self.g[i].hull(&o.g[i])),
            h: [Interval::ALL; 6],
            t: [Interval::ALL; 10],
        }
    }
    /// Returns a function with the range `v` that may be discontinuous: all derivatives are
    /// unbounded.
    fn unknown(v: Interval) -> Self {
        Self {
            v,
            g: [Interval::ALL; 3],
            h: [Interval::ALL; 6],
            t: [Interval::ALL; 10],
        }
    }
    /// Returns a step function with the range `v`: its derivatives are 0 if it takes one value
    /// only, else unbounded.
    fn step(v: Interval) -> Self {
        if v.lo() == v.hi() {
            Self::flat(v)
        } else {
            Self::unknown(v)
        }
    }
}

impl<const ORDER: usize> Add for IntervalJet<ORDER> {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        self.map2(&o, plus)
    }
}
impl<const ORDER: usize> Sub for IntervalJet<ORDER> {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self.map2(&o, |a, b| plus(a, -b))
    }
}
impl<const ORDER: usize> Neg for IntervalJet<ORDER> {
    type Output = Self;
    fn neg(self) -> Self {
        self.map2(&self, |a, _| -a)
    }
}
impl<const ORDER: usize> Mul for IntervalJet<ORDER> {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        self.product(&o)
    }
}
impl<const ORDER: usize> Div for IntervalJet<ORDER> {
    type Output = Self;
    #[allow(clippy::suspicious_arithmetic_impl, reason = "u / v = u · v⁻¹")]
    fn div(self, o: Self) -> Self {
        let r = c(1.0) / o.v;
        let mut q =
            self.product(&o.chain([r, -r.square(), c(2.0) * r.powi(3), c(-6.0) * r.powi(4)]));
        q.v = self.v / o.v;
        q
    }
}

impl<const ORDER: usize> Real for IntervalJet<ORDER> {
    fn constant(v: f64) -> Self {
        Self::flat(c(v))
    }
    fn value(&self) -> f64 {
        self.v.value()
    }
    fn sqrt(&self) -> Self {
        let s = self.v.sqrt();
        if self.v.lo() <= 0.0 {
            return Self::unknown(s);
        }
        let d = c(0.5) / s;
        self.chain([s, d, c(-0.5) * d / self.v, c(0.75) * d / self.v.square()])
    }
    fn exp(&self) -> Self {
        self.chain([self.v.exp(); 4])
    }
    fn ln(&self) -> Self {
        if self.v.lo() <= 0.0 {
            return Self::unknown(self.v.ln());
        }
        let r = c(1.0) / self.v;
        self.chain([self.v.ln(), r, -r.square(), c(2.0) * r.powi(3)])
    }
    fn sin(&self) -> Self {
        let (s, k) = (self.v.sin(), self.v.cos());
        self.chain([s, k, -s, -k])
    }
    fn cos(&self) -> Self {
        let (s, k) = (self.v.sin(), self.v.cos());
        self.chain([k, -s, -k, s])
    }
    fn tan(&self) -> Self {
        let t = self.v.tan();
        let q = c(1.0) + t.square();
        self.chain([
            t,
            q,
            c(2.0) * t * q,
            c(2.0) * q * (c(1.0) + c(3.0) * t.square()),
        ])
    }
    fn asin(&self) -> Self {
        if self.v.lo() <= -1.0 || self.v.hi() >= 1.0 {
            return Self::unknown(self.v.asin());
        }
        let q = c(1.0) - self.v.square();
        let r = c(1.0) / q.sqrt();
        self.chain([
            self.v.asin(),
            r,
            self.v * r / q,
            (c(1.0) + c(2.0) * self.v.square()) * r / q.square(),
        ])
    }
    fn acos(&self) -> Self {
        let mut r = -self.asin();
        r.v = self.v.acos();
        r
    }
    fn atan(&self) -> Self {
        let (u, q) = (self.v, c(1.0) / (c(1.0) + self.v.square()));
        self.chain([
            u.atan(),
            q,
            c(-2.0) * u * q.square(),
            (c(6.0) * u.square() - c(2.0)) * q.powi(3),
        ])
    }
    fn sinh(&self) -> Self {
        let (s, k) = (self.v.sinh(), self.v.cosh());
        self.chain([s, k, s, k])
    }
    fn cosh(&self) -> Self {
        let (s, k) = (self.v.sinh(), self.v.cosh());
        self.chain([k, s, k, s])
    }
    fn tanh(&self) -> Self {
        let t = self.v.tanh();
        let q = c(1.0) - t.square();
        self.chain([t, q, c(-2.0) * t * q, q * (c(6.0) * t.square() - c(2.0))])
    }
    fn abs(&self) -> Self {
        if self.v.lo() >= 0.0 {
            *self
        } else if self.v.hi() <= 0.0 {
            -*self
        } else {
            self.either(&-*self, self.v.abs())
        }
    }
    fn square(&self) -> Self {
        self.chain([self.v.square(), c(2.0) * self.v, c(2.0), c(0.0)])
    }
    fn powi(&self, n: i32) -> Self {
        let mut factor = 1.0;
        self.chain(std::array::from_fn(|k| {
            let k = k as i32;
            let r = if factor == 0.0 {
                c(0.0)
            } else {
                c(factor) * self.v.powi(n - k)
            };
            factor *= f64::from(n - k);
            r
        }))
    }
    fn powf(&self, e: &Self) -> Self {
        if self.v.lo() <= 0.0 {
            return Self::unknown(self.v.powf(&e.v));
        }
        let mut r = (self.ln() * *e).exp();
        r.v = self.v.powf(&e.v);
        r
    }
    fn atan2(&self, x: &Self) -> Self {
        let v = self.v.atan2(&x.v);
        let mut r = if !x.v.contains(0.0) {
            (*self / *x).atan()
        } else if !self.v.contains(0.0) {
            -(*x / *self).atan()
        } else {
            return Self::unknown(v);
        };
        // The angle is discontinuous across the negative x axis.
        if x.v.lo() < 0.0 && self.v.contains(0.0) {
            return Self::unknown(v);
        }
        r.v = v;
        r
    }
    fn floor(&self) -> Self {
        Self::step(self.v.floor())
    }
    fn ceil(&self) -> Self {
        Self::step(self.v.ceil())
    }
    fn trunc(&self) -> Self {
        Self::step(self.v.trunc())
    }
    fn sign(&self) -> Self {
        Self::step(self.v.sign())
    }
    fn min(&self, o: &Self) -> Self {
        if self.v.hi() <= o.v.lo() {
            *self
        } else if o.v.hi() <= self.v.lo() {
            *o
        } else {
            self.either(o, self.v.min(&o.v))
        }
    }
    fn max(&self, o: &Self) -> Self {
        if self.v.lo() >= o.v.hi() {
            *self
        } else if o.v.lo() >= self.v.hi() {
            *o
        } else {
            self.either(o, self.v.max(&o.v))
        }
    }
    fn less(&self, o: &Self) -> Self {
        Self::step(self.v.less(&o.v))
    }
    fn less_eq(&self, o: &Self) -> Self {
        Self::step(self.v.less_eq(&o.v))
    }
    fn select(&self, a: &Self, b: &Self) -> Self {
        if !self.v.contains(0.0) {
            *a
        } else if self.v.lo() == 0.0 && self.v.hi() == 0.0 {
            *b
        } else {
            Self::unknown(a.v.hull(&b.v))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Jet3;

    fn formula<R: Real>(x: &R, y: &R, z: &R) -> R {
        let c = R::constant;
        let a = (x.square() + y.square() + c(0.5)).sqrt() * z.sin() / (y.cosh() + c(1.0));
        let b = (x.clone() * y.clone()).exp() - (z.square() + c(1.0)).ln() + x.atan() * y.tanh();
        let d = x.powi(3) - z.powi(-2)
            + (y.clone() * c(0.3)).asin()
            + (x.clone() * c(0.2)).acos()
            + z.sinh() * x.cos();
        let e = (x.square() + c(1.0)).powf(&(y.clone() + c(0.7)))
            + y.atan2(&(x.clone() + c(3.0)))
            + z.tan();
        a + b.r_union(&d) * e.max(&x.abs())
    }

    /// Intervals over a box hold the jets at its points, and shrink to them with the box.
    #[test]
    fn jets_of_points_lie_inside() {
        let centre = [0.7, -0.4, 0.9];
        for radius in [0.0, 1e-6, 1e-3, 0.05] {
            let [x, y, z] = std::array::from_fn(|i| {
                <IntervalJet>::variable(Interval::new(centre[i] - radius, centre[i] + radius), i)
            });
            let all = formula(&x, &y, &z);
            for corner in 0..8 {
                let at: [f64; 3] = std::array::from_fn(|i| {
                    centre[i]
                        + if corner >> i & 1 == 1 {
                            radius
                        } else {
                            -radius
                        }
                });
                let [x, y, z] = std::array::from_fn(|i| Jet3::variable(at[i], i));
                let one = formula(&x, &y, &z);
                assert!(all.v.contains(one.v));
                assert!((0..3).all(|i| all.g[i].contains(one.g[i])));
                assert!((0..6).all(|i| all.h[i].contains(one.h[i])));
                // Plain jets round, too: a hundred units in the last place.
                assert!(
                    (0..10)
                        .all(|i| one.t[i] > all.t[i].lo() - 1e-11
                            && one.t[i] < all.t[i].hi() + 1e-11)
                );
            }
            if radius <= 1e-3 {
                assert!(
                    all.t.iter().all(|t| t.width() <= 1e-9 + 1e5 * radius),
                    "{radius}: {:?}",
                    all.t
                );
            }
        }
    }

    #[test]
    fn kinks_are_not_passed_over() {
        let x = <IntervalJet>::variable(Interval::new(-1.0, 1.0), 0);
        let a = x.abs();
        assert_eq!((a.v.lo(), a.v.hi()), (0.0, 1.0));
        assert_eq!((a.g[0].lo(), a.g[0].hi()), (-1.0, 1.0));
        assert_eq!(a.h[0], Interval::ALL);
        let y = <IntervalJet>::variable(Interval::new(2.0, 3.0), 1);
        assert_eq!(x.max(&y), y);
    }
}
