//! Forward-mode derivatives: truncated Taylor expansions.
//!
//! Compositions h(u) follow Faà di Bruno's formula, products Leibniz' rule. [`Jet1`] carries N
//! first derivatives, [`Jet2`] and [`Jet3`] all derivatives in x, y, z to order 2 and 3 (each mixed
//! derivative is stored once).

use crate::Real;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Pairs i ≤ j in the order in which the second derivatives ∂²f/∂xᵢ∂xⱼ are stored: xx, xy, xz, yy,
/// yz, zz. [`SECOND`] is the inverse.
pub const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
/// Index of ∂²f/∂xᵢ∂xⱼ among the six second derivatives.
pub const SECOND: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
/// Triples i ≤ j ≤ k in the order in which the third derivatives ∂³f/∂xᵢ∂xⱼ∂xₖ are stored: xxx,
/// xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz. [`THIRD`] is the inverse.
pub const TRIPLES: [(usize, usize, usize); 10] = [
    (0, 0, 0),
    (0, 0, 1),
    (0, 0, 2),
    (0, 1, 1),
    (0, 1, 2),
    (0, 2, 2),
    (1, 1, 1),
    (1, 1, 2),
    (1, 2, 2),
    (2, 2, 2),
];
/// Index of ∂³f/∂xᵢ∂xⱼ∂xₖ among the ten third derivatives.
pub const THIRD: [[[usize; 3]; 3]; 3] = [
    [[0, 1, 2], [1, 3, 4], [2, 4, 5]],
    [[1, 3, 4], [3, 6, 7], [4, 7, 8]],
    [[2, 4, 5], [4, 7, 8], [5, 8, 9]],
];

/// Orders of differentiation by x, y and z of the 20 numbers of a 3-jet, in the order in which they
/// are stored: value, first, second and third derivatives. The first ten are those of a 2-jet.
pub const ORDERS: [[usize; 3]; 20] = [
    [0, 0, 0],
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [2, 0, 0],
    [1, 1, 0],
    [1, 0, 1],
    [0, 2, 0],
    [0, 1, 1],
    [0, 0, 2],
    [3, 0, 0],
    [2, 1, 0],
    [2, 0, 1],
    [1, 2, 0],
    [1, 1, 1],
    [1, 0, 2],
    [0, 3, 0],
    [0, 2, 1],
    [0, 1, 2],
    [0, 0, 3],
];

/// Returns the symmetric 3 × 3 matrix of six second derivatives, row by row.
///
/// ```
/// let h = isoform_num::hessian(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
/// assert_eq!(h, [1.0, 2.0, 3.0, 2.0, 4.0, 5.0, 3.0, 5.0, 6.0]);
/// ```
pub fn hessian(h: &[f64; 6]) -> [f64; 9] {
    std::array::from_fn(|k| h[SECOND[k / 3][k % 3]])
}

/// Value and first derivatives with respect to N variables.
///
/// ```
/// use isoform_num::{Jet1, Real};
///
/// // sin at π/6, with its derivative cos.
/// let x = Jet1::<1>::variable(std::f64::consts::FRAC_PI_6, 0);
/// let s = x.sin();
/// assert!((s.v - 0.5).abs() < 1e-15 && (s.g[0] - 0.75f64.sqrt()).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet1<const N: usize> {
    /// Value.
    pub v: f64,
    /// First derivatives.
    pub g: [f64; N],
}

/// Value, gradient and Hessian in x, y, z.
///
/// ```
/// use isoform_num::{Jet2, Real};
///
/// // The distance √(x² + y² + z²) at (2, 3, 6): the gradient is the unit vector there, and the
/// // Laplacian is 2/7.
/// let [x, y, z] = [2.0, 3.0, 6.0];
/// let [x, y, z] = [Jet2::variable(x, 0), Jet2::variable(y, 1), Jet2::variable(z, 2)];
/// let d = (x.square() + y.square() + z.square()).sqrt();
/// assert_eq!((d.v, d.g[1]), (7.0, 3.0 / 7.0));
/// let laplacian = d.second(0, 0) + d.second(1, 1) + d.second(2, 2);
/// assert!((laplacian - 2.0 / 7.0).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet2 {
    /// Value.
    pub v: f64,
    /// Gradient.
    pub g: [f64; 3],
    /// Second derivatives xx, xy, xz, yy, yz, zz.
    pub h: [f64; 6],
}

/// Value and all derivatives to order 3 in x, y, z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet3 {
    /// Value.
    pub v: f64,
    /// Gradient.
    pub g: [f64; 3],
    /// Second derivatives xx, xy, xz, yy, yz, zz.
    pub h: [f64; 6],
    /// Third derivatives xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz.
    pub t: [f64; 10],
}

impl<const N: usize> Jet1<N> {
    /// Returns the `i`-th variable, with the value `v`.
    pub fn variable(v: f64, i: usize) -> Self {
        let mut g = [0.0; N];
        g[i] = 1.0;
        Self { v, g }
    }
    fn chain(&self, [f0, f1, ..]: [f64; 4]) -> Self {
        Self {
            v: f0,
            g: self.g.map(|u| f1 * u),
        }
    }
    fn linear(&self, o: &Self, a: f64, b: f64) -> Self {
        Self {
            v: a * self.v + b * o.v,
            g: std::array::from_fn(|i| a * self.g[i] + b * o.g[i]),
        }
    }
    fn product(&self, o: &Self) -> Self {
        Self {
            v: self.v * o.v,
            g: std::array::from_fn(|i| self.v * o.g[i] + self.g[i] * o.v),
        }
    }
    fn flat(v: f64) -> Self {
        Self { v, g: [0.0; N] }
    }
}

impl Jet2 {
    /// Returns the jet with respect to coordinates q, where p = `unit` q + a constant: derivatives
    /// of order k are multiplied by `unit`ᵏ.
    #[must_use]
    pub fn in_units(&self, unit: f64) -> Self {
        Self {
            v: self.v,
            g: self.g.map(|g| unit * g),
            h: self.h.map(|h| unit * unit * h),
        }
    }
    /// Returns the coordinate `i` (0 = x, 1 = y, 2 = z), with the value `v`.
    pub fn variable(v: f64, i: usize) -> Self {
        let mut g = [0.0; 3];
        g[i] = 1.0;
        Self { v, g, h: [0.0; 6] }
    }
    /// Returns ∂²/∂xᵢ∂xⱼ.
    pub fn second(&self, i: usize, j: usize) -> f64 {
        self.h[SECOND[i][j]]
    }
    /// Returns the Hessian as a full matrix, row by row, the form of
    /// [`symmetric_eigen`](crate::linalg::symmetric_eigen).
    pub fn hessian(&self) -> [f64; 9] {
        hessian(&self.h)
    }
    fn chain(&self, [f0, f1, f2, _]: [f64; 4]) -> Self {
        let h = std::array::from_fn(|k| {
            let (i, j) = PAIRS[k];
            f1 * self.h[k] + f2 * self.g[i] * self.g[j]
        });
        Self {
            v: f0,
            g: self.g.map(|u| f1 * u),
            h,
        }
    }
    fn linear(&self, o: &Self, a: f64, b: f64) -> Self {
        Self {
            v: a * self.v + b * o.v,
            g: std::array::from_fn(|i| a * self.g[i] + b * o.g[i]),
            h: std::array::from_fn(|i| a * self.h[i] + b * o.h[i]),
        }
    }
    fn product(&self, o: &Self) -> Self {
        let h = std::array::from_fn(|k| {
            let (i, j) = PAIRS[k];
            self.v * o.h[k] + self.g[i] * o.g[j] + self.g[j] * o.g[i] + self.h[k] * o.v
        });
        Self {
            v: self.v * o.v,
            g: std::array::from_fn(|i| self.v * o.g[i] + self.g[i] * o.v),
            h,
        }
    }
    fn flat(v: f64) -> Self {
        Self {
            v,
            g: [0.0; 3],
            h: [0.0; 6],
        }
    }
}

impl Jet3 {
    /// Returns the jet with respect to coordinates q, where p = `unit` q + a constant: derivatives
    /// of order k are multiplied by `unit`ᵏ.
    #[must_use]
    pub fn in_units(&self, unit: f64) -> Self {
        Self {
            v: self.v,
            g: self.g.map(|g| unit * g),
            h: self.h.map(|h| unit * unit * h),
            t: self.t.map(|t| unit * unit * unit * t),
        }
    }
    /// Returns the coordinate `i` (0 = x, 1 = y, 2 = z), with the value `v`.
    pub fn variable(v: f64, i: usize) -> Self {
        let mut g = [0.0; 3];
        g[i] = 1.0;
        Self {
            v,
            g,
            h: [0.0; 6],
            t: [0.0; 10],
        }
    }
    /// Returns ∂²/∂xᵢ∂xⱼ.
    pub fn second(&self, i: usize, j: usize) -> f64 {
        self.h[SECOND[i][j]]
    }
    fn order2(&self) -> Jet2 {
        Jet2 {
            v: self.v,
            g: self.g,
            h: self.h,
        }
    }
    fn chain(&self, f: [f64; 4]) -> Self {
        let low = self.order2().chain(f);
        let [_, f1, f2, f3] = f;
        let (g, s) = (&self.g, |i: usize, j: usize| self.h[SECOND[i][j]]);
        let t = std::array::from_fn(|n| {
            let (i, j, k) = TRIPLES[n];
            f1 * self.t[n]
                + f2 * (s(i, j) * g[k] + s(i, k) * g[j] + s(j, k) * g[i])
                + f3 * g[i] * g[j] * g[k]
        });
        Self {
            v: low.v,
            g: low.g,
            h: low.h,
            t,
        }
    }
    fn linear(&self, o: &Self, a: f64, b: f64) -> Self {
        let low = self.order2().linear(&o.order2(), a, b);
        Self {
            v: low.v,
            g: low.g,
            h: low.h,
            t: std::array::from_fn(|i| a * self.t[i] + b * o.t[i]),
        }
    }
    fn product(&self, o: &Self) -> Self {
        let low = self.order2().product(&o.order2());
        let (u, v) = (
            |i: usize, j: usize| self.h[SECOND[i][j]],
            |i: usize, j: usize| o.h[SECOND[i][j]],
        );
        let t = std::array::from_fn(|n| {
            let (i, j, k) = TRIPLES[n];
            self.v * o.t[n]
                + self.g[i] * v(j, k)
                + self.g[j] * v(i, k)
                + self.g[k] * v(i, j)
                + u(i, j) * o.g[k]
                + u(i, k) * o.g[j]
                + u(j, k) * o.g[i]
                + self.t[n] * o.v
        });
        Self {
            v: low.v,
            g: low.g,
            h: low.h,
            t,
        }
    }
    fn flat(v: f64) -> Self {
        Self {
            v,
            g: [0.0; 3],
            h: [0.0; 6],
            t: [0.0; 10],
        }
    }
}

/// Returns (uⁿ, n uⁿ⁻¹, n(n−1) uⁿ⁻², n(n−1)(n−2) uⁿ⁻³), each 0 if its factor in n is 0.
fn power_derivatives(u: f64, n: i32) -> [f64; 4] {
    let mut r = [0.0; 4];
    let mut factor = 1.0;
    for (k, r) in r.iter_mut().enumerate() {
        *r = if factor == 0.0 {
            0.0
        } else {
            factor * Real::powi(&u, n - k as i32)
        };
        factor *= f64::from(n - k as i32);
    }
    r
}

macro_rules! jet_is_real {
    ([$($generic:tt)*] $jet:ty) => {
        impl<$($generic)*> Add for $jet {
            type Output = Self;
            fn add(self, o: Self) -> Self { self.linear(&o, 1.0, 1.0) }
        }
        impl<$($generic)*> Sub for $jet {
            type Output = Self;
            fn sub(self, o: Self) -> Self { self.linear(&o, 1.0, -1.0) }
        }
        impl<$($generic)*> Neg for $jet {
            type Output = Self;
            fn neg(self) -> Self { self.chain([-self.v, -1.0, 0.0, 0.0]) }
        }
        impl<$($generic)*> Mul for $jet {
            type Output = Self;
            fn mul(self, o: Self) -> Self { self.product(&o) }
        }
        impl<$($generic)*> Div for $jet {
            type Output = Self;
            #[allow(clippy::suspicious_arithmetic_impl, reason = "u / v = u · v⁻¹")]
            fn div(self, o: Self) -> Self {
                let r = 1.0 / o.v;
                let mut q = self.product(&o.chain([r, -r * r, 2.0 * r * r * r, -6.0 * r * r * r * r]));
                q.v = self.v / o.v;
                q
            }
        }
        impl<$($generic)*> Real for $jet {
            fn constant(c: f64) -> Self { Self::flat(c) }
            fn value(&self) -> f64 { self.v }
            fn sqrt(&self) -> Self {
                let s = self.v.sqrt();
                // At 0 the derivative is unbounded; it is set to 0, which keeps steps of descent
                // methods finite.
                if s == 0.0 { return Self::flat(0.0); }
                let d = 0.5 / s;
                self.chain([s, d, -0.5 * d / self.v, 0.75 * d / (self.v * self.v)])
            }
            fn exp(&self) -> Self { let e = self.v.exp(); self.chain([e; 4]) }
            fn ln(&self) -> Self {
                let r = 1.0 / self.v;
                self.chain([self.v.ln(), r, -r * r, 2.0 * r * r * r])
            }
            fn sin(&self) -> Self { let (s, c) = (self.v.sin(), self.v.cos()); self.chain([s, c, -s, -c]) }
            fn cos(&self) -> Self { let (s, c) = (self.v.sin(), self.v.cos()); self.chain([c, -s, -c, s]) }
            fn tan(&self) -> Self {
                let t = self.v.tan();
                let q = 1.0 + t * t;
                self.chain([t, q, 2.0 * t * q, 2.0 * q * (1.0 + 3.0 * t * t)])
            }
            fn asin(&self) -> Self {
                let (u, q) = (self.v, 1.0 - self.v * self.v);
                let r = 1.0 / q.sqrt();
                self.chain([u.asin(), r, u * r / q, (1.0 + 2.0 * u * u) * r / (q * q)])
            }
            fn acos(&self) -> Self {
                let a = self.asin();
                let mut r = -a;
                r.v = self.v.acos();
                r
            }
            fn atan(&self) -> Self {
                let (u, q) = (self.v, 1.0 / (1.0 + self.v * self.v));
                self.chain([u.atan(), q, -2.0 * u * q * q, (6.0 * u * u - 2.0) * q * q * q])
            }
            fn sinh(&self) -> Self { let (s, c) = (self.v.sinh(), self.v.cosh()); self.chain([s, c, s, c]) }
            fn cosh(&self) -> Self { let (s, c) = (self.v.sinh(), self.v.cosh()); self.chain([c, s, c, s]) }
            fn tanh(&self) -> Self {
                let t = self.v.tanh();
                let q = 1.0 - t * t;
                self.chain([t, q, -2.0 * t * q, q * (6.0 * t * t - 2.0)])
            }
            fn abs(&self) -> Self { self.chain([self.v.abs(), Real::sign(&self.v), 0.0, 0.0]) }
            fn square(&self) -> Self { self.chain([self.v * self.v, 2.0 * self.v, 2.0, 0.0]) }
            fn powi(&self, n: i32) -> Self { self.chain(power_derivatives(self.v, n)) }
            fn powf(&self, v: &Self) -> Self {
                let mut r = (self.ln() * v.clone()).exp();
                if self.v == 0.0 { return Self::flat(self.v.powf(v.v)); }
                r.v = self.v.powf(v.v);
                r
            }
            fn atan2(&self, x: &Self) -> Self {
                // The angle differs from atan(y/x) or −atan(x/y) by a constant only.
                let mut r = if x.v.abs() >= self.v.abs() { (self.clone() / x.clone()).atan() } else { -(x.clone() / self.clone()).atan() };
                r.v = self.v.atan2(x.v);
                r
            }
            fn floor(&self) -> Self { Self::flat(self.v.floor()) }
            fn ceil(&self) -> Self { Self::flat(self.v.ceil()) }
            fn trunc(&self) -> Self { Self::flat(self.v.trunc()) }
            fn sign(&self) -> Self { Self::flat(Real::sign(&self.v)) }
            fn min(&self, o: &Self) -> Self { if o.v < self.v { o.clone() } else { self.clone() } }
            fn max(&self, o: &Self) -> Self { if o.v > self.v { o.clone() } else { self.clone() } }
            fn less(&self, o: &Self) -> Self { Self::flat(Real::less(&self.v, &o.v)) }
            fn less_eq(&self, o: &Self) -> Self { Self::flat(Real::less_eq(&self.v, &o.v)) }
            fn select(&self, a: &Self, b: &Self) -> Self { if self.v != 0.0 { a.clone() } else { b.clone() } }
        }
    };
}

jet_is_real!([const N: usize] Jet1<N>);
jet_is_real!([] Jet2);
jet_is_real!([] Jet3);

#[cfg(test)]
mod tests {
    use super::*;

    /// Evaluates a formula that uses every smooth operation, at a point where all are defined.
    fn formula<R: Real>(x: &R, y: &R, z: &R) -> R {
        let c = R::constant;
        let a = (x.square() + y.square() + c(0.5)).sqrt() * z.sin() / (y.cosh() + c(1.0));
        let b = (x.clone() * y.clone()).exp() - (z.square() + c(1.0)).ln() + x.atan() * y.tanh();
        let d = x.powi(3) - z.powi(-2)
            + (y.clone() * c(0.3)).asin()
            + (x.clone() * c(0.2)).acos()
            + z.sinh() * x.cos();
        let e = (x.square() + c(1.0)).powf(&(y.clone() + c(0.7)))
            + y.atan2(&(x.clone() - c(3.0)))
            + z.tan();
        a + b.r_union(&d) * e.r_intersection(&x.abs())
    }

    const AT: [f64; 3] = [0.7, -0.4, 0.9];

    /// Compares each order with central differences of the order below.
    #[test]
    fn derivatives_agree_with_differences() {
        let jet = |p: [f64; 3]| {
            let [x, y, z] = std::array::from_fn(|i| Jet3::variable(p[i], i));
            formula(&x, &y, &z)
        };
        let here = jet(AT);
        let step = 1e-5;
        for axis in 0..3 {
            let moved = |s: f64| {
                let mut p = AT;
                p[axis] += s;
                jet(p)
            };
            let (u, l) = (moved(step), moved(-step));
            let near = |d: f64, want: f64, what: &str| {
                assert!(
                    (d - want).abs() < 1e-7 * (1.0 + want.abs()),
                    "{what} by axis {axis}: {d} against {want}"
                );
            };
            near((u.v - l.v) / (2.0 * step), here.g[axis], "first");
            for j in 0..3 {
                near(
                    (u.g[j] - l.g[j]) / (2.0 * step),
                    here.second(axis, j),
                    "second",
                );
            }
            for (k, &(i, j)) in PAIRS.iter().enumerate() {
                let mut t = [axis, i, j];
                t.sort_unstable();
                let n = TRIPLES
                    .iter()
                    .position(|&q| q == (t[0], t[1], t[2]))
                    .expect("sorted triple");
                near((u.h[k] - l.h[k]) / (2.0 * step), here.t[n], "third");
            }
        }
    }

    #[test]
    fn lower_orders_are_the_heads_of_higher_ones() {
        let [x, y, z] = std::array::from_fn(|i| Jet3::variable(AT[i], i));
        let three = formula(&x, &y, &z);
        let [x, y, z] = std::array::from_fn(|i| Jet2::variable(AT[i], i));
        let two = formula(&x, &y, &z);
        let [x, y, z] = std::array::from_fn(|i| Jet1::<3>::variable(AT[i], i));
        let one = formula(&x, &y, &z);
        assert_eq!((three.v, three.g, three.h), (two.v, two.g, two.h));
        assert_eq!((one.v, one.g), (two.v, two.g));
        assert_eq!(one.v, formula(&AT[0], &AT[1], &AT[2]));
    }

    #[test]
    fn tables_lead_back_to_where_derivatives_are_stored() {
        for i in 0..3 {
            for j in 0..3 {
                assert_eq!(PAIRS[SECOND[i][j]], (i.min(j), i.max(j)));
                for k in 0..3 {
                    let mut sorted = [i, j, k];
                    sorted.sort_unstable();
                    let [a, b, c] = sorted;
                    assert_eq!(TRIPLES[THIRD[i][j][k]], (a, b, c));
                }
            }
        }
    }
}
