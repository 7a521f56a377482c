//! One curve of an arrangement, prepared for exact and for floating-point queries.

use super::{ArrangementError, U, V};
use crate::fibre::Fibres;
use crate::float_roots::{Bounded, Number, Wide, all_roots, certain_bernstein, stretched};
use crate::modular::bits;
use crate::poly::Poly;
use crate::roots::{RealRoot, real_roots};
use crate::upoly::UPoly;
use dashu_int::UBig;
use dashu_ratio::RBig;
use isoform_control::Control;
use isoform_num::Interval;

/// Curve without the lines that are handled separately.
pub(super) struct Curve {
    /// Polynomial without sides and vertical lines.
    pub(super) rest: Poly,
    /// Product of its vertical lines, as a polynomial in u.
    pub(super) vertical: UPoly,
    pub(super) fibres: Option<Fibres>,
    /// Polynomials on v = 0 and on u + v = 1.
    pub(super) on_lower: UPoly,
    pub(super) on_upper: UPoly,
    /// Terms for floating-point tests: coefficients as intervals of doubles, multiplied by a power
    /// of two.
    pub(super) terms: Terms<Interval>,
    /// Terms with twice as many digits, multiplied by that power of two, too.
    pub(super) wide: Terms<Wide>,
}

/// Exponents of u and v, and coefficients.
pub(super) type Terms<T> = Vec<([usize; 2], T)>;

/// Maximum number of bits of coefficients in floating point; larger ones are divided by a power of
/// two. Half of the range of exponents leaves room for sums of products.
const COEFFICIENT_BITS: usize = 500;

/// Returns the coefficients, at least one, of powers of one variable where the other one, of index
/// `fixed`, has a value.
pub(super) fn over<T: Bounded>(terms: &Terms<T>, fixed: usize, value: T) -> Vec<T> {
    let degree = terms.iter().map(|t| t.0[1 - fixed]).max().unwrap_or(0);
    let mut coefficients = vec![T::exact(0.0); 1 + degree];
    let mut powers = vec![T::exact(1.0)];
    for (exponents, c) in terms {
        let (i, j) = (exponents[fixed], exponents[1 - fixed]);
        while powers.len() <= i {
            powers.push(powers[powers.len() - 1] * value);
        }
        coefficients[j] = coefficients[j] + *c * powers[i];
    }
    coefficients
}

/// Returns a polynomial in which v was eliminated, or has a value.
pub(super) fn over_u(p: &Poly) -> UPoly {
    p.to_upoly(U).expect("no variable but u is left")
}
/// Returns a polynomial in which u has a value.
pub(super) fn over_v(p: &Poly) -> UPoly {
    p.to_upoly(V).expect("no variable but v is left")
}

/// Returns the roots over a rational u that lie between the sides v = 0 and v = `top`, ascending.
pub(super) fn roots_between_sides(
    f: &Poly,
    u: &RBig,
    top: &RBig,
) -> impl Iterator<Item = RealRoot> {
    let inside = |r: &RealRoot| r.cmp_rational(&RBig::ZERO).is_gt() && r.cmp_rational(top).is_lt();
    let roots = real_roots(&over_v(&f.set(U, u)));
    let inside: Vec<RealRoot> = roots.into_iter().filter(inside).collect();
    inside.into_iter()
}

impl Curve {
    pub(super) fn new(rest: Poly, control: &Control<'_>) -> Result<Self, ArrangementError> {
        let content = rest.content_in(V);
        let rest = rest.div_exact(&content).expect("the content divides");
        let rest = rest.primitive();
        let vertical = over_u(&content);
        let fibres = if rest.degree(V) > 0 {
            Some(Fibres::new(&rest, V, control)?)
        } else {
            None
        };
        let on = |by: &Poly| over_u(&rest.substitute(V, by));
        let (on_lower, on_upper) = (on(&Poly::zero()), on(&(Poly::one() - Poly::var(U))));
        let size = rest.terms().iter().map(|(_, c)| bits(c)).max();
        let excess = size.unwrap_or(0).saturating_sub(COEFFICIENT_BITS);
        let (mut terms, mut wide) = (Terms::new(), Terms::new());
        for (e, c) in rest.terms() {
            let c = RBig::from_parts(c.clone(), UBig::ONE << excess);
            let exponents = [usize::from(e[U]), usize::from(e[V])];
            let near = c.to_f64().value();
            terms.push((exponents, Interval::new(near.next_down(), near.next_up())));
            wide.push((exponents, Wide::between(&c, &c)));
        }
        Ok(Self {
            rest,
            vertical,
            fibres,
            on_lower,
            on_upper,
            terms,
            wide,
        })
    }

    /// Returns the roots between the sides over a u that is known within bounds, if floating point
    /// proves all of them, each simple, in disjoint intervals.
    pub(super) fn roots_over(&self, u: Wide) -> Option<Vec<[RBig; 2]>> {
        let top = Wide::exact(1.0) + Wide::exact(-1.0) * u;
        let coefficients = stretched(&over(&self.wide, U, u), top);
        // From fractions of the height to heights.
        let top = top.bounds();
        let height = |x: f64, top: f64, outward: fn(f64) -> f64| RBig::try_from(outward(x * top));
        all_roots(&coefficients)?
            .into_iter()
            .map(|[lo, hi]| {
                let lo = height(lo, top[0], f64::next_down).ok()?;
                let hi = height(hi, top[1], f64::next_up).ok()?;
                Some([lo, hi])
            })
            .collect()
    }

    /// Returns true if the polynomial provably has no zero on v = c for u between two numbers.
    pub(super) fn misses(&self, [from, to]: [&RBig; 2], c: &RBig) -> bool {
        let length = to - from;
        let (from, length) = (Wide::between(from, from), Wide::between(&length, &length));
        let mut coefficients = over(&self.wide, V, Wide::between(c, c));
        // In fractions of the interval.
        let n = coefficients.len();
        for i in 0..n {
            for j in (i..n - 1).rev() {
                coefficients[j] = coefficients[j] + coefficients[j + 1] * from;
            }
        }
        certain_bernstein(&stretched(&coefficients, length)).is_some_and(|b| {
            let mut signs = b.into_iter().map(Wide::sign);
            let first = signs.next();
            first != Some(0) && signs.all(|s| Some(s) == first)
        })
    }
}
