//! Dense univariate polynomials over the integers.

use crate::modular::bits;
use crate::poly::fraction_powers;
use dashu_base::{Abs, Gcd, Sign, Signed, UnsignedAbs};
use dashu_int::{IBig, UBig};
use dashu_ratio::RBig;
use std::cmp::Ordering;
use std::fmt;
use std::ops::{Add, Mul, Neg, Sub};

/// Univariate polynomial with integer coefficients, lowest first; the highest is not zero.
///
/// Roots, factors and divisors do not change by a constant factor: polynomials over Q are
/// represented by their primitive multiples.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Default)]
pub struct UPoly {
    coefficients: Vec<IBig>,
}

impl UPoly {
    /// Creates the polynomial with these coefficients, lowest first; leading zeros are dropped.
    pub fn new(mut coefficients: Vec<IBig>) -> Self {
        while coefficients.last().is_some_and(IBig::is_zero) {
            coefficients.pop();
        }
        Self { coefficients }
    }
    /// Creates the polynomial with these small coefficients, lowest first.
    pub fn from_i64(coefficients: &[i64]) -> Self {
        Self::new(coefficients.iter().map(|&c| IBig::from(c)).collect())
    }
    /// Returns 1.
    pub fn one() -> Self {
        Self::from_i64(&[1])
    }
    /// Returns the coefficients, lowest first; empty for 0.
    pub fn coefficients(&self) -> &[IBig] {
        &self.coefficients
    }
    /// Returns true if this is 0.
    pub fn is_zero(&self) -> bool {
        self.coefficients.is_empty()
    }
    /// Returns the degree; 0 for constants and for 0.
    pub fn degree(&self) -> usize {
        self.coefficients.len().saturating_sub(1)
    }
    /// Returns the leading coefficient; 0 for the zero polynomial.
    pub fn leading(&self) -> IBig {
        self.coefficients.last().cloned().unwrap_or(IBig::ZERO)
    }
    /// Returns the greatest common divisor of the coefficients.
    pub fn content(&self) -> UBig {
        let mut common = UBig::ZERO;
        for c in &self.coefficients {
            if common.is_one() {
                break;
            }
            let c = c.clone().unsigned_abs();
            common = match (common.is_zero(), c.is_zero()) {
                (true, _) => c,
                (_, true) => common,
                _ => common.gcd(c),
            };
        }
        common
    }
    /// Returns the multiple without common factor of coefficients and with positive leading
    /// coefficient.
    pub fn primitive(&self) -> Self {
        if self.is_zero() {
            return Self::default();
        }
        let mut divisor = IBig::from(self.content());
        if self.leading().is_negative() {
            divisor = -divisor;
        }
        if divisor.is_one() {
            return self.clone();
        }
        Self {
            coefficients: self.coefficients.iter().map(|c| c / &divisor).collect(),
        }
    }
    /// Returns this polynomial times a number.
    pub fn scale(&self, c: &IBig) -> Self {
        Self::new(self.coefficients.iter().map(|v| v * c).collect())
    }
    /// Returns the derivative.
    pub fn derivative(&self) -> Self {
        Self::new(
            self.coefficients
                .iter()
                .enumerate()
                .skip(1)
                .map(|(i, c)| c * i)
                .collect(),
        )
    }
    /// Returns the value at a rational number.
    pub fn eval(&self, x: &RBig) -> RBig {
        RBig::from_parts(self.eval_homogeneous(x), x.denominator().pow(self.degree()))
    }
    /// Returns the value at x times the positive number denominator(x)^degree: an integer with the
    /// sign of the value.
    fn eval_homogeneous(&self, x: &RBig) -> IBig {
        if x.denominator().is_one() {
            return self
                .coefficients
                .iter()
                .rev()
                .fold(IBig::ZERO, |s, c| s * x.numerator() + c);
        }
        fraction_powers(x, self.degree())
            .iter()
            .zip(&self.coefficients)
            .map(|(p, c)| p * c)
            .sum()
    }
    /// Returns the sign of the value at a rational number.
    pub fn sign_at(&self, x: &RBig) -> Ordering {
        sign(&self.eval_homogeneous(x))
    }
    /// Returns the value at numerator/2^shift times 2^(shift·degree).
    pub(crate) fn eval_dyadic(&self, numerator: &IBig, shift: usize) -> IBig {
        let mut sum = IBig::ZERO;
        for (i, c) in self.coefficients.iter().rev().enumerate() {
            sum = sum * numerator + (c << (shift * i));
        }
        sum
    }
    /// Returns the value at numerator/2^shift and a bound on its error, both in units of 2^(t −
    /// precision), where t is the bit length of the largest coefficient.
    pub(crate) fn eval_near(
        &self,
        numerator: &IBig,
        shift: usize,
        precision: usize,
    ) -> (IBig, IBig) {
        let (lost, gained) = self.unit(precision);
        let (mut sum, mut error) = (IBig::ZERO, IBig::ZERO);
        let size = numerator.clone().abs();
        for c in self.coefficients.iter().rev() {
            // Two that are rounded down.
            sum = ((sum * numerator) >> shift) + if lost > 0 { c >> lost } else { c << gained };
            error = ((error * &size) >> shift) + 3;
        }
        (sum, error)
    }
    /// Returns a bound on the slopes between any points up to numerator/2^shift in absolute value,
    /// in units of 2^(t − precision), too.
    pub(crate) fn slope_bound(&self, numerator: &IBig, shift: usize, precision: usize) -> IBig {
        let (lost, gained) = self.unit(precision);
        let mut sum = IBig::ZERO;
        for (i, c) in self.coefficients.iter().enumerate().skip(1).rev() {
            let c = c.clone().abs() * i;
            // Rounded up.
            sum = ((sum * numerator) >> shift) + 2 + if lost > 0 { c >> lost } else { c << gained };
        }
        sum
    }
    /// Returns the numbers of bits that coefficients lose, or gain, in units of 2^(t − precision).
    fn unit(&self, precision: usize) -> (usize, usize) {
        let top = self.coefficients.iter().map(bits).max().unwrap_or(0);
        (top.saturating_sub(precision), precision.saturating_sub(top))
    }
    /// Returns the precision at which values at numbers with that shift are exact.
    pub(crate) fn whole_precision(&self, shift: usize) -> usize {
        self.coefficients.iter().map(bits).max().unwrap_or(0) + shift * self.degree()
    }
    /// Returns the sign at numerator/2^shift; exact, by growing precision.
    pub(crate) fn sign_dyadic(&self, numerator: &IBig, shift: usize) -> Ordering {
        let mut precision = 64 + shift;
        while precision < self.whole_precision(shift) {
            let (value, error) = self.eval_near(numerator, shift, precision);
            if value.clone().abs() > error {
                return sign(&value);
            }
            precision *= 2;
        }
        sign(&self.eval_dyadic(numerator, shift))
    }
    /// Returns p(x + a) for an integer a.
    pub fn shift(&self, a: &IBig) -> Self {
        let mut c = self.coefficients.clone();
        for i in 0..c.len() {
            for j in (i..c.len() - 1).rev() {
                let step = &c[j + 1] * a;
                c[j] += step;
            }
        }
        Self::new(c)
    }
    /// Returns x^degree p(1/x).
    pub fn reversed(&self) -> Self {
        Self::new(self.coefficients.iter().rev().cloned().collect())
    }
    /// Returns the quotient over Z if `divisor` divides this polynomial over Z.
    pub fn div_exact(&self, divisor: &Self) -> Option<Self> {
        let lead = divisor.coefficients.last()?;
        if self.is_zero() {
            return Some(Self::default());
        }
        let n = divisor.degree();
        let mut rest = self.coefficients.clone();
        let mut quotient = vec![IBig::ZERO; rest.len().checked_sub(n)?];
        for i in (0..quotient.len()).rev() {
            let top = &rest[i + n];
            if top.is_zero() {
                continue;
            }
            let (q, remainder) = dashu_base::DivRem::div_rem(top, lead);
            if !remainder.is_zero() {
                return None;
            }
            for (j, c) in divisor.coefficients[..n].iter().enumerate() {
                rest[i + j] -= &q * c;
            }
            quotient[i] = q;
        }
        rest[..n]
            .iter()
            .all(IBig::is_zero)
            .then(|| Self::new(quotient))
    }
    /// Returns the remainder of lc(divisor)^k times this polynomial for some even k, so that signs
    /// are kept.
    ///
    /// # Panics
    /// If the divisor is 0.
    pub fn pseudo_remainder(&self, divisor: &Self) -> Self {
        let n = divisor.degree();
        let lead = divisor.leading();
        assert!(!lead.is_zero(), "division by the zero polynomial");
        let mut rest = self.clone();
        let mut odd = false;
        while !rest.is_zero() && rest.degree() >= n {
            let top = rest.leading();
            let at = rest.degree() - n;
            for c in &mut rest.coefficients {
                *c *= &lead;
            }
            for (j, c) in divisor.coefficients.iter().enumerate() {
                rest.coefficients[at + j] -= &top * c;
            }
            rest = Self::new(rest.coefficients);
            odd = !odd;
        }
        if odd && lead.is_negative() {
            -&rest
        } else {
            rest
        }
    }
    /// Returns this polynomial as text in a variable of that name.
    pub fn display<'a>(&'a self, name: &'a str) -> impl fmt::Display + 'a {
        let poly = crate::Poly::from_upoly(self, 0);
        fmt::from_fn(move |f| write!(f, "{}", poly.display(&[name])))
    }
}

/// Returns the sign of an integer against zero.
pub(crate) fn sign(a: &IBig) -> Ordering {
    match a.sign() {
        _ if a.is_zero() => Ordering::Equal,
        Sign::Positive => Ordering::Greater,
        Sign::Negative => Ordering::Less,
    }
}

impl Add for &UPoly {
    type Output = UPoly;
    fn add(self, o: Self) -> UPoly {
        let (long, short) = if self.coefficients.len() >= o.coefficients.len() {
            (self, o)
        } else {
            (o, self)
        };
        let mut sum = long.coefficients.clone();
        for (s, c) in sum.iter_mut().zip(&short.coefficients) {
            *s += c;
        }
        UPoly::new(sum)
    }
}

impl Neg for &UPoly {
    type Output = UPoly;
    fn neg(self) -> UPoly {
        UPoly {
            coefficients: self.coefficients.iter().map(|c| -c).collect(),
        }
    }
}

impl Sub for &UPoly {
    type Output = UPoly;
    fn sub(self, o: Self) -> UPoly {
        self + &-o
    }
}

impl Mul for &UPoly {
    type Output = UPoly;
    fn mul(self, o: Self) -> UPoly {
        if self.is_zero() || o.is_zero() {
            return UPoly::default();
        }
        let mut product = vec![IBig::ZERO; self.coefficients.len() + o.coefficients.len() - 1];
        for (i, a) in self.coefficients.iter().enumerate() {
            for (j, b) in o.coefficients.iter().enumerate() {
                product[i + j] += a * b;
            }
        }
        UPoly::new(product)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_poly() -> impl Strategy<Value = UPoly> {
        prop::collection::vec(any::<i32>(), 0..8)
            .prop_map(|c| UPoly::new(c.into_iter().map(IBig::from).collect()))
    }

    proptest! {
        #[test]
        fn products_divide(a in any_poly(), b in any_poly(), c in any_poly(), n in any::<i16>(), d in 1u16..) {
            let x = RBig::from_parts(IBig::from(n), UBig::from(d));
            let product = &a * &b;
            prop_assert_eq!(product.eval(&x), a.eval(&x) * b.eval(&x));
            prop_assert_eq!((&a - &b).eval(&x), a.eval(&x) - b.eval(&x));
            prop_assert_eq!(sign(product.eval(&x).numerator()), product.sign_at(&x));
            prop_assert_eq!(a.shift(&IBig::from(n)).eval(&RBig::from(7)), a.eval(&RBig::from(i32::from(n) + 7)));
            if !b.is_zero() {
                prop_assert_eq!(product.div_exact(&b), Some(a.clone()));
                let mixed = &product + &c;
                if c.degree() < b.degree() && !c.is_zero() {
                    prop_assert_eq!(mixed.div_exact(&b), None);
                    prop_assert_eq!(product.pseudo_remainder(&b), UPoly::default());
                    let rest = mixed.pseudo_remainder(&b);
                    prop_assert_eq!(rest.primitive(), c.primitive());
                    prop_assert_eq!(sign(&rest.leading()), sign(&c.leading()));
                }
            }
            let shifted = a.eval_dyadic(&IBig::from(n), 5);
            let at = RBig::from_parts(IBig::from(n), UBig::from(32u8));
            prop_assert_eq!(RBig::from_parts(shifted, UBig::from(32u8).pow(a.degree())), a.eval(&at));
            prop_assert_eq!(a.sign_dyadic(&IBig::from(n), 5), a.sign_at(&at));
        }

        /// Approximate values near roots, where low precisions cannot decide: errors and slopes are
        /// bounds.
        #[test]
        fn approximate_values_are_within_their_errors(a in any_poly(), root in -4000i32..4000, off in -3i32..3, shift in 5usize..40, precision in 1usize..90) {
            // A root at root/2^11.
            let p = &a * &UPoly::from_i64(&[-i64::from(root), 1 << 11]);
            let x = (IBig::from(root) << shift) + off;
            let (place, exact) = (shift + 11, p.eval_dyadic(&x, shift + 11));
            prop_assert_eq!(p.sign_dyadic(&x, place), sign(&exact));
            prop_assume!(!p.is_zero());
            let unit = |n: &IBig| {
                let top = p.coefficients().iter().map(bits).max().unwrap();
                RBig::from(n.clone()) * if top > precision { RBig::from(IBig::ONE << (top - precision)) } else { RBig::from_parts(IBig::ONE, UBig::ONE << (precision - top)) }
            };
            let scale = UBig::ONE << (place * p.degree());
            let (value, error) = p.eval_near(&x, place, precision);
            let off = unit(&value) - RBig::from_parts(exact, scale);
            prop_assert!(off.clone().abs() <= unit(&error));
            let far = x.clone().abs();
            let slope = p.derivative().eval(&RBig::from_parts(far.clone(), UBig::ONE << place)).abs();
            prop_assert!(slope <= unit(&p.slope_bound(&far, place, precision)));
        }
    }
}
