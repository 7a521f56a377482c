//! Polynomials in x, y, z with floating-point coefficients.
//!
//! f = Σ c x^a y^b z^c is evaluated term by term. Ranges over a box are interval sums; the value at
//! a point is enclosed by a bound on the rounding error, γ Σ |c x^a y^b z^c|.

use isoform_geom::{Aabb, Expansion, Field, Point3, Terms};
use isoform_num::{Interval, Jet2, Jet3, ORDERS, Real, TRIPLES};

/// A polynomial, as a function of space.
///
/// ```
/// use isoform_field::Polynomial;
/// use isoform_geom::Field;
/// // 1 − x² − y² − z²
/// let ball = Polynomial::new([([0, 0, 0], 1.0), ([2, 0, 0], -1.0), ([0, 2, 0], -1.0), ([0, 0, 2], -1.0)]);
/// assert_eq!(ball.value([0.0, 0.5, 0.5]), 0.5);
/// assert_eq!(ball.jet([0.0, 0.5, 0.5]).g, [0.0, -1.0, -1.0]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Polynomial {
    terms: Vec<([u16; 3], f64)>,
    /// The largest exponent of each coordinate.
    degrees: [usize; 3],
}

/// The powers of the three coordinates, in any number type.
struct PowerTable<R> {
    /// Powers, by axis and exponent.
    of: [Vec<R>; 3],
}

impl<R: Real> PowerTable<R> {
    fn new(at: [R; 3], degrees: [usize; 3]) -> Self {
        let mut axis = 0;
        let of = at.map(|x| {
            let mut powers = vec![R::constant(1.0)];
            for k in 1..=degrees[axis] {
                // Even powers are computed as squares, which are nonnegative for intervals around
                // 0.
                let next = if k % 2 == 0 {
                    powers[k / 2].square()
                } else {
                    powers[k - 1].clone() * x.clone()
                };
                powers.push(next);
            }
            axis += 1;
            powers
        });
        Self { of }
    }
    /// Computes the derivative of x^a y^b z^c of the orders d; `None` if it vanishes identically.
    fn derivative(&self, exponents: &[u16; 3], d: [usize; 3]) -> Option<R> {
        let mut factor = 1.0;
        let mut product: Option<R> = None;
        for k in 0..3 {
            let e = usize::from(exponents[k]);
            if e < d[k] {
                return None;
            }
            factor *= (e - d[k] + 1..=e).map(|v| v as f64).product::<f64>();
            if e > d[k] {
                let power = self.of[k][e - d[k]].clone();
                product = Some(match product {
                    Some(p) => p * power,
                    None => power,
                });
            }
        }
        let factor = R::constant(factor);
        Some(product.map_or(factor.clone(), |p| p * factor))
    }
    /// Sums the derivatives of the orders d over all terms.
    fn sum(&self, terms: &[([u16; 3], f64)], d: [usize; 3]) -> R {
        let mut sum = R::constant(0.0);
        for (e, c) in terms {
            if let Some(term) = self.derivative(e, d) {
                sum = sum + R::constant(*c) * term;
            }
        }
        sum
    }
}

/// Counts the occurrences of each coordinate among `axes`.
fn orders(axes: &[usize]) -> [usize; 3] {
    let mut d = [0; 3];
    for &a in axes {
        d[a] += 1;
    }
    d
}

impl Polynomial {
    /// Creates the sum of the terms c x^a y^b z^c, given as ([a, b, c], c).
    pub fn new(terms: impl IntoIterator<Item = ([u16; 3], f64)>) -> Self {
        let terms: Vec<_> = terms.into_iter().filter(|t| t.1 != 0.0).collect();
        let degrees =
            std::array::from_fn(|k| terms.iter().map(|t| usize::from(t.0[k])).max().unwrap_or(0));
        Self { terms, degrees }
    }
    /// Returns the terms.
    pub fn terms(&self) -> &[([u16; 3], f64)] {
        &self.terms
    }
    /// Returns the total degree.
    pub fn degree(&self) -> usize {
        self.terms
            .iter()
            .map(|t| t.0.iter().map(|&e| usize::from(e)).sum())
            .max()
            .unwrap_or(0)
    }
}

/// Powers of the coordinates with their derivatives up to order 3, by axis and exponent.
struct DerivativeTable {
    of: [Vec<[f64; 4]>; 3],
}

impl DerivativeTable {
    fn new(at: Point3, degrees: [usize; 3]) -> Self {
        let mut all = Self {
            of: degrees.map(|n| vec![[0.0; 4]; n + 1]),
        };
        all.set(at);
        all
    }
    /// Computes the powers of another point.
    fn set(&mut self, at: Point3) {
        for (powers, x) in self.of.iter_mut().zip(at) {
            powers[0] = [1.0, 0.0, 0.0, 0.0];
            for n in 1..powers.len() {
                // Derivative d of xⁿ is n times derivative d − 1 of xⁿ⁻¹.
                let [v, d1, d2, _] = powers[n - 1];
                let f = n as f64;
                powers[n] = [v * x, f * v, f * d1, f * d2];
            }
        }
    }
    /// Returns the three factors of a monomial, each with its derivatives.
    fn factors(&self, e: &[u16; 3]) -> [[f64; 4]; 3] {
        std::array::from_fn(|k| self.of[k][usize::from(e[k])])
    }
}

impl Polynomial {
    /// Bounds the rounding error of a sum of terms, relative to the sum of their absolute values:
    /// one unit for each product in a power, three for each derivative's factor, four for the term
    /// and one for each addition, all doubled.
    fn rounding(&self) -> f64 {
        (self.degrees.iter().sum::<usize>() + self.terms.len() + 16) as f64 * f64::EPSILON
    }
    /// Computes the value, gradient and Hessian from the derivatives of the powers.
    fn jet_of(&self, d: &DerivativeTable) -> Jet2 {
        let mut j = Jet2 {
            v: 0.0,
            g: [0.0; 3],
            h: [0.0; 6],
        };
        for (e, c) in &self.terms {
            let [x, y, z] = d.factors(e);
            let yz = c * y[0] * z[0];
            let (cx0, cx1) = (c * x[0], c * x[1]);
            j.v += x[0] * yz;
            j.g[0] += x[1] * yz;
            j.g[1] += cx0 * y[1] * z[0];
            j.g[2] += cx0 * y[0] * z[1];
            j.h[0] += x[2] * yz;
            j.h[1] += cx1 * y[1] * z[0];
            j.h[2] += cx1 * y[0] * z[1];
            j.h[3] += cx0 * y[2] * z[0];
            j.h[4] += cx0 * y[1] * z[1];
            j.h[5] += cx0 * y[0] * z[2];
        }
        j
    }
    /// Encloses the exact value at a point by the computed one and a bound on its rounding error.
    fn enclosed(&self, at: Point3) -> Interval {
        let d = [0; 3];
        let (here, near) = (
            PowerTable::new(at, self.degrees),
            PowerTable::new(at.map(f64::abs), self.degrees),
        );
        let (mut sum, mut absolute) = (0.0, 0.0);
        for (e, c) in &self.terms {
            if let (Some(h), Some(n)) = (here.derivative(e, d), near.derivative(e, d)) {
                sum += c * h;
                absolute += c.abs() * n;
            }
        }
        let r = self.rounding() * absolute;
        Interval::new((sum - r).next_down(), (sum + r).next_up())
    }
}

/// Sums over the terms, for each derivative of [`ORDERS`].
struct TermSums {
    /// The derivatives at a point.
    signed: [f64; 20],
    /// The sums of absolute values at the point.
    absolute: [f64; 20],
    /// The sums of absolute values of third derivatives at the farthest corner of a region.
    wide: [f64; 10],
}

impl Polynomial {
    /// Computes the sums of the terms, and of their absolute values, for a point and for the
    /// farthest corner of a region.
    fn sums(&self, at: Point3, region: Aabb) -> TermSums {
        let reach: Point3 =
            std::array::from_fn(|k| (region.hi[k] - at[k]).max(at[k] - region.lo[k]).next_up());
        let [here, near, far] = [
            at,
            at.map(f64::abs),
            std::array::from_fn(|k| (at[k].abs() + reach[k]).next_up()),
        ]
        .map(|p| DerivativeTable::new(p, self.degrees));
        let (mut signed, mut absolute, mut wide) = ([0.0f64; 20], [0.0f64; 20], [0.0f64; 10]);
        for (e, c) in &self.terms {
            let (h, n, f) = (here.factors(e), near.factors(e), far.factors(e));
            for (k, d) in ORDERS.iter().enumerate() {
                let product = |t: &[[f64; 4]; 3]| t[0][d[0]] * t[1][d[1]] * t[2][d[2]];
                signed[k] += c * product(&h);
                let size = c.abs() * product(&n);
                absolute[k] += size;
                if k >= 10 {
                    wide[k - 10] += c.abs() * product(&f);
                }
            }
        }
        TermSums {
            signed,
            absolute,
            wide,
        }
    }
}

impl Field for Polynomial {
    fn terms(&self) -> Option<Terms<'_>> {
        Some(Terms {
            list: &self.terms,
            origin: [0.0; 3],
            unit: 1.0,
        })
    }
    fn value(&self, p: Point3) -> f64 {
        PowerTable::new(p, self.degrees).sum(&self.terms, [0; 3])
    }
    fn jet(&self, p: Point3) -> Jet2 {
        self.jet_of(&DerivativeTable::new(p, self.degrees))
    }
    fn jets(&self, points: &[Point3], out: &mut [Jet2]) {
        let mut derivatives = DerivativeTable::new([0.0; 3], self.degrees);
        for (p, j) in points.iter().zip(out) {
            derivatives.set(*p);
            *j = self.jet_of(&derivatives);
        }
    }
    fn bounds(&self, region: Aabb) -> Interval {
        if region.lo == region.hi {
            return self.enclosed(region.lo);
        }
        let at = region.sides();
        PowerTable::new(at, self.degrees).sum(&self.terms, [0; 3])
    }
    fn jet3(&self, p: Point3) -> Option<Jet3> {
        let powers = PowerTable::new(p, self.degrees);
        let low = self.jet(p);
        let t = TRIPLES.map(|(i, j, k)| powers.sum(&self.terms, orders(&[i, j, k])));
        Some(Jet3 {
            v: low.v,
            g: low.g,
            h: low.h,
            t,
        })
    }
    fn expansion(&self, at: Point3, region: Aabb) -> Option<Expansion> {
        let TermSums {
            signed: sums,
            absolute,
            wide,
        } = self.sums(at, region);
        let rounding = self.rounding();
        let ball = |m: f64, r: f64| Interval::new((m - r).next_down(), (m + r).next_up());
        let point = |k: usize| ball(sums[k], rounding * absolute[k]);
        // A monomial with a positive factor differs in the region from its value at the point by no
        // more than it does, taken with absolute values of the coordinates, at the farthest corner.
        let third = |k: usize| {
            ball(
                sums[10 + k],
                (wide[k] - absolute[10 + k]) + 4.0 * rounding * wide[k],
            )
        };
        Some(Expansion {
            value: point(0),
            gradient: std::array::from_fn(|k| point(1 + k)),
            hessian: std::array::from_fn(|k| point(4 + k)),
            third: std::array::from_fn(third),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2x³y − xyz² + 3z⁴ − 5, written as a formula.
    fn formula<R: Real>(x: &R, y: &R, z: &R) -> R {
        let c = R::constant;
        c(2.0) * x.powi(3) * y.clone() - x.clone() * y.clone() * z.square() + c(3.0) * z.powi(4)
            - c(5.0)
    }
    fn polynomial() -> Polynomial {
        Polynomial::new([
            ([3, 1, 0], 2.0),
            ([1, 1, 2], -1.0),
            ([0, 0, 4], 3.0),
            ([0, 0, 0], -5.0),
            ([9, 9, 9], 0.0),
        ])
    }

    #[test]
    fn derivatives_are_those_of_the_formula() {
        let (p, at) = (polynomial(), [0.3, -1.2, 0.8]);
        let [x, y, z] = std::array::from_fn(|i| Jet3::variable(at[i], i));
        let want = formula(&x, &y, &z);
        let got = p.jet3(at).expect("polynomials have third derivatives");
        let pairs = got
            .g
            .iter()
            .zip(&want.g)
            .chain(got.h.iter().zip(&want.h))
            .chain(got.t.iter().zip(&want.t));
        for (a, b) in pairs {
            assert!((a - b).abs() < 1e-13, "{a} against {b}");
        }
        assert!((p.value(at) - want.v).abs() < 1e-14 && p.jet(at).v == got.v);
        assert_eq!(p.degree(), 4);
    }

    #[test]
    fn expansions_hold_what_is_near() {
        let (p, at) = (polynomial(), [0.3, -1.2, 0.8]);
        let region = Aabb {
            lo: at.map(|v| v - 0.1),
            hi: at.map(|v| v + 0.1),
        };
        let e = p.expansion(at, region).expect("an expansion");
        let here = p.jet3(at).expect("a jet");
        assert!(
            e.value.contains(here.v)
                && (0..3).all(|k| e.gradient[k].contains(here.g[k]))
                && (0..6).all(|k| e.hessian[k].contains(here.h[k]))
        );
        assert!(e.value.width() < 1e-12);
        for corner in 0..8 {
            let q: Point3 = std::array::from_fn(|k| {
                if corner >> k & 1 == 1 {
                    region.hi[k]
                } else {
                    region.lo[k]
                }
            });
            let there = p.jet3(q).expect("a jet");
            assert!((0..10).all(|k| e.third[k].contains(there.t[k])));
            assert!(p.bounds(region).contains(p.value(q)));
        }
    }
}
