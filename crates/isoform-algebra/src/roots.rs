//! Real roots of integer polynomials: isolation, and exact computation with them.
//!
//! Isolation bisects with Descartes' rule of signs (G. E. Collins, A. G. Akritas, SYMSAC 1976): the
//! sign changes of (1 + x)ⁿ q(1/(1 + x)) bound the number of roots of q in (0, 1), and 0 and 1 are
//! the exact number. Refinement is by quadratic interval refinement (J. Abbott, *Quadratic interval
//! refinement for real roots*, 2006/2012), which is bisection that becomes as fast as Newton's
//! iteration. All ends of intervals are dyadic numbers, and all decisions are exact.

use crate::modular::bits;
use crate::precision::MAX_PRECISION_BITS;
use crate::upoly::{UPoly, sign};
use dashu_base::{Abs, Signed};
use dashu_int::{IBig, UBig};
use dashu_ratio::RBig;
use isoform_num::Interval;
use std::cmp::Ordering;
use std::sync::Arc;

/// Real algebraic number: a squarefree polynomial and an interval that contains exactly one of its
/// roots.
///
/// Comparisons are exact, also between roots of different polynomials.
///
/// ```
/// use isoform_algebra::{UPoly, real_roots};
/// let roots = real_roots(&UPoly::from_i64(&[-2, 0, 1]));
/// assert_eq!(roots[1].to_f64(), 2f64.sqrt());
/// assert!(roots[0] < roots[1]);
/// ```
#[derive(Clone, Debug)]
pub struct RealRoot {
    poly: Arc<UPoly>,
    /// Lower end: the root is lo/2^shift if lo = hi; otherwise it lies strictly between lo/2^shift
    /// and hi/2^shift, where the polynomial has different signs, both non-zero.
    lo: IBig,
    hi: IBig,
    shift: usize,
    /// Number of bits of the next refinement: it divides the interval into 2^gear parts.
    gear: usize,
}

/// Returns the distinct real roots of a polynomial in ascending order; `None` for constants.
///
/// # Panics
/// For the zero polynomial.
pub fn real_roots(p: &UPoly) -> Vec<RealRoot> {
    assert!(
        !p.is_zero(),
        "every number is a root of the zero polynomial"
    );
    let p = p.squarefree_part();
    if p.degree() == 0 {
        return Vec::new();
    }
    let poly = Arc::new(p);
    let bound = root_bound_bits(&poly);
    let zero_is_root = poly.coefficients()[0].is_zero();
    let rest = UPoly::new(poly.coefficients()[usize::from(zero_is_root)..].to_vec());
    let mut roots = Vec::new();
    for (lo, hi, shift) in isolate_positive(&mirrored(&rest), bound).into_iter().rev() {
        roots.push(RealRoot::isolated(&poly, -hi, -lo, shift));
    }
    if zero_is_root {
        roots.push(RealRoot::isolated(&poly, IBig::ZERO, IBig::ZERO, 0));
    }
    for (lo, hi, shift) in isolate_positive(&rest, bound) {
        roots.push(RealRoot::isolated(&poly, lo, hi, shift));
    }
    roots
}

/// Returns the polynomial p(−x).
fn mirrored(p: &UPoly) -> UPoly {
    let coefficients = p.coefficients().iter().enumerate();
    let signed = coefficients.map(|(i, c)| if i % 2 == 1 { -c } else { c.clone() });
    UPoly::new(signed.collect())
}

/// Returns the number of distinct real roots in the open interval.
pub fn count_roots_between(p: &UPoly, lo: &RBig, hi: &RBig) -> usize {
    real_roots(p)
        .iter()
        .filter(|r| r.cmp_rational(lo).is_gt() && r.cmp_rational(hi).is_lt())
        .count()
}

/// Returns a number k ≥ 0 such that all roots are below 2^k in absolute value, by M. Fujiwara's
/// bound 2 max |aᵢ/aₙ|^(1/(n−i)) on bit lengths.
fn root_bound_bits(p: &UPoly) -> usize {
    let c = p.coefficients();
    let n = p.degree();
    let top = bits(&c[n]);
    let exponent = |i: usize| (bits(&c[i]) + 1).saturating_sub(top).div_ceil(n - i);
    (0..n)
        .filter(|&i| !c[i].is_zero())
        .map(exponent)
        .max()
        .unwrap_or(0)
        + 1
}

/// Returns the intervals (lo, hi)/2^shift, in ascending order, with one positive root each, of a
/// squarefree polynomial all of whose roots are below 2^bound, and 0 is not a root; an interval
/// with lo = hi is a root.
fn isolate_positive(p: &UPoly, bound: usize) -> Vec<(IBig, IBig, usize)> {
    let n = p.degree();
    let coefficients = p.coefficients().iter().enumerate();
    let mut found = Vec::new();
    let mut stack = vec![BisectionCell {
        poly: coefficients.map(|(i, c)| c << (bound * i)).collect(),
        number: IBig::ZERO,
        depth: 0,
    }];
    while let Some(mut cell) = stack.pop() {
        let depth = cell.depth;
        if cell.is_point() {
            found.push(cell.scaled(bound));
            continue;
        }
        drop_common_twos(&mut cell.poly);
        match variations_in_unit(&cell.poly) {
            0 => {}
            1 => found.push(cell.scaled(bound)),
            _ => stack.extend(cell.halves()),
        }
        debug_assert!(
            stack.len() <= 64 * (n + 1) + depth * 3,
            "bisection of a squarefree polynomial ends"
        );
    }
    found
}

/// Cell (c, c + 1)/2^depth of the bisection of the unit interval, or its point c/2^depth.
struct BisectionCell {
    /// Polynomial with roots in (0, 1) where the bisected one has roots in the cell; without
    /// coefficients for a root that bisection hit.
    poly: Vec<IBig>,
    /// Integer c.
    number: IBig,
    depth: usize,
}

impl BisectionCell {
    /// Returns true if this is a root that bisection hit.
    fn is_point(&self) -> bool {
        self.poly.is_empty()
    }
    /// Returns the interval (lo, hi, shift) of the cell within the interval (0, 2^bound).
    fn scaled(self, bound: usize) -> (IBig, IBig, usize) {
        let end = match self.is_point() {
            true => self.number.clone(),
            false => &self.number + IBig::ONE,
        };
        if self.depth >= bound {
            (self.number, end, self.depth - bound)
        } else {
            let up = bound - self.depth;
            (self.number << up, end << up, 0)
        }
    }
    /// Iterates over the right half, the middle if it is a root, and the left half.
    fn halves(self) -> impl Iterator<Item = Self> {
        let mut left = self.poly;
        let depth = self.depth + 1;
        let degree = left.len() - 1;
        for (i, v) in left.iter_mut().enumerate() {
            *v <<= degree - i;
        }
        let mut right = left.clone();
        shift_by_one(&mut right);
        let middle: IBig = (self.number.clone() << 1usize) + IBig::ONE;
        let is_hit = right[0].is_zero();
        if is_hit {
            // Both halves lose the root between them.
            right.remove(0);
            left = divide_by_x_minus_one(&left);
        }
        let cell = |poly, number| Self {
            poly,
            number,
            depth,
        };
        let hit = is_hit.then(|| cell(Vec::new(), middle.clone()));
        [
            Some(cell(right, middle)),
            hit,
            Some(cell(left, self.number << 1usize)),
        ]
        .into_iter()
        .flatten()
    }
}

/// Divides all coefficients by the largest power of two that divides them.
fn drop_common_twos(q: &mut [IBig]) {
    let common = q.iter().filter_map(IBig::trailing_zeros).min().unwrap_or(0);
    if common > 0 {
        for c in q {
            *c >>= common;
        }
    }
}

/// Replaces q(x) by q(x + 1).
fn shift_by_one(q: &mut [IBig]) {
    let n = q.len();
    for i in 0..n {
        for j in (i..n - 1).rev() {
            let (low, high) = q.split_at_mut(j + 1);
            low[j] += &high[0];
        }
    }
}

/// Returns the quotient of q by x − 1, of which it is a multiple.
fn divide_by_x_minus_one(q: &[IBig]) -> Vec<IBig> {
    let mut quotient = q[1..].to_vec();
    for i in (0..quotient.len().saturating_sub(1)).rev() {
        let (low, high) = quotient.split_at_mut(i + 1);
        low[i] += &high[0];
    }
    quotient
}

/// Returns the number of sign changes in the coefficients of (1 + x)ⁿ q(1/(1 + x)), counted up to
/// two.
fn variations_in_unit(q: &[IBig]) -> usize {
    let count = |q: &[IBig]| {
        let mut last = Ordering::Equal;
        let mut changes = 0;
        for c in q.iter().map(sign).filter(|s| s.is_ne()) {
            changes += usize::from(last.is_ne() && c != last);
            last = c;
        }
        changes
    };
    if count(q) == 0 {
        return 0;
    }
    let mut r: Vec<IBig> = q.iter().rev().cloned().collect();
    let n = r.len();
    // Coefficients of the shifted polynomial become final one by one from below.
    let mut last = Ordering::Equal;
    let mut changes = 0;
    for i in 0..n {
        for j in (i..n - 1).rev() {
            let (low, high) = r.split_at_mut(j + 1);
            low[j] += &high[0];
        }
        let s = sign(&r[i]);
        if s.is_ne() {
            changes += usize::from(last.is_ne() && s != last);
            last = s;
            if changes > 1 {
                return changes;
            }
        }
    }
    changes
}

/// Limit of the number of bits of any number: beyond it lies an internal error.
/// [`refine_until`](crate::precision::refine_until) requests numbers with somewhat more bits than
/// it computes with; comparisons refine numbers that are known to differ without such a loop, and
/// end here, too.
const MAX_SHIFT: usize = 8 * MAX_PRECISION_BITS;

/// Maximum gear: 2^16 bits are gained in one step, and more would not be faster.
const MAX_GEAR: usize = 1 << 16;

/// Isolating interval of a root, divided into 2^gear parts for a step of quadratic interval
/// refinement; numbers are in units of 2^−shift.
struct RefinementGrid {
    lo: IBig,
    hi: IBig,
    /// Width of a part.
    part: IBig,
    shift: usize,
    /// Sign of the polynomial at the lower end.
    left: Ordering,
}

impl RefinementGrid {
    /// Returns the part next to an inner point of the grid on the side of the sign change, with
    /// true if it contains the root; otherwise the rest of the interval beyond that part.
    fn narrowed(self, point: IBig, poly: &UPoly) -> (IBig, IBig, bool) {
        let Self {
            lo,
            hi,
            part,
            shift,
            left,
        } = self;
        let at_point = poly.sign_dyadic(&point, shift);
        if at_point.is_eq() {
            return (point.clone(), point, true);
        }
        let neighbour = if at_point == left {
            &point + &part
        } else {
            &point - &part
        };
        let at_neighbour = if neighbour == lo {
            left
        } else if neighbour == hi {
            left.reverse()
        } else {
            poly.sign_dyadic(&neighbour, shift)
        };
        match (at_neighbour, at_point == left) {
            (Ordering::Equal, _) => (neighbour.clone(), neighbour, true),
            (s, true) if s != left => (point, neighbour, true),
            (s, false) if s == left => (neighbour, point, true),
            (_, true) => (neighbour, hi, false),
            (_, false) => (lo, neighbour, false),
        }
    }
}

/// Returns the zero of the secant through the values at the ends of an interval of 2^gear parts, as
/// the index of the nearest point of the grid inside the interval.
fn secant_zero(at_lo: IBig, at_hi: IBig, gear: usize) -> IBig {
    let parts = IBig::ONE << gear;
    let slope = &at_lo - at_hi;
    let doubled: IBig = (at_lo << (gear + 1)) / slope;
    ((doubled + IBig::ONE) >> 1usize).clamp(IBig::ONE, parts - IBig::ONE)
}

impl RealRoot {
    /// Returns the root in an open interval that contains exactly one, and whose ends may be other
    /// roots.
    fn isolated(poly: &Arc<UPoly>, lo: IBig, hi: IBig, shift: usize) -> Self {
        let mut root = Self {
            poly: Arc::clone(poly),
            lo,
            hi,
            shift,
            gear: 1,
        };
        let at = |x: &IBig, shift: usize| poly.sign_dyadic(x, shift);
        while root.lo != root.hi
            && (at(&root.lo, root.shift).is_eq() || at(&root.hi, root.shift).is_eq())
        {
            // Just right of a root at lo the polynomial has the sign of its derivative there.
            let mut left = at(&root.lo, root.shift);
            if left.is_eq() {
                left = poly.derivative().sign_dyadic(&root.lo, root.shift);
            }
            root.double();
            let middle = (&root.lo + &root.hi) >> 1;
            match at(&middle, root.shift) {
                Ordering::Equal => (root.lo, root.hi) = (middle.clone(), middle),
                s if s == left => root.lo = middle,
                _ => root.hi = middle,
            }
        }
        root
    }
    /// Scales the ends of the interval to one more binary digit.
    fn double(&mut self) {
        self.lo <<= 1;
        self.hi <<= 1;
        self.shift += 1;
    }

    /// Creates a rational number.
    pub fn from_rational(r: &RBig) -> Self {
        let poly = Arc::new(UPoly::new(vec![
            -r.numerator(),
            IBig::from(r.denominator().clone()),
        ]));
        if dashu_base::PowerOfTwo::is_power_of_two(r.denominator()) {
            let shift = r.denominator().trailing_zeros().unwrap_or(0);
            return Self {
                poly,
                lo: r.numerator().clone(),
                hi: r.numerator().clone(),
                shift,
                gear: 1,
            };
        }
        let lo = floor(r);
        Self {
            poly,
            hi: &lo + 1,
            lo,
            shift: 0,
            gear: 1,
        }
    }
    /// Returns the squarefree primitive polynomial of the root; it need not be irreducible.
    pub fn poly(&self) -> &UPoly {
        &self.poly
    }
    /// Returns the ends of the isolating interval: either both are the root, or the root is
    /// strictly between them.
    pub fn interval(&self) -> (RBig, RBig) {
        (self.dyadic(&self.lo), self.dyadic(&self.hi))
    }
    /// Returns the number n/2^shift.
    fn dyadic(&self, n: &IBig) -> RBig {
        RBig::from_parts(n.clone(), UBig::ONE << self.shift)
    }
    /// Returns true if the number is known exactly; it is dyadic then.
    fn is_exact(&self) -> bool {
        self.lo == self.hi
    }
    /// Returns true if two numbers are equal, given the overlap of their intervals: a common root
    /// lies in both intervals, where the common divisor of the polynomials changes its sign there
    /// and only there.
    fn is_root_of_both(&self, other: &Self, [lo, hi]: [RBig; 2]) -> bool {
        let common = if Arc::ptr_eq(&self.poly, &other.poly) {
            (*self.poly).clone()
        } else {
            self.poly.gcd(&other.poly)
        };
        common.degree() > 0 && common.sign_at(&lo) != common.sign_at(&hi)
    }

    /// Narrows the interval to a width of at most 2^−bits.
    pub fn refine(&mut self, bits: usize) {
        while (&self.hi - &self.lo) << bits > IBig::ONE << self.shift {
            self.step();
        }
    }
    /// Performs one step of quadratic interval refinement, unless the root is known exactly.
    fn step(&mut self) {
        if self.is_exact() {
            return;
        }
        assert!(
            self.shift < MAX_SHIFT,
            "a number is asked for to {MAX_SHIFT} bits: an error of the exact kernel"
        );
        let gear = self.gear;
        let (at_lo, at_hi) = self.at_ends();
        let grid = RefinementGrid {
            lo: &self.lo << gear,
            hi: &self.hi << gear,
            part: &self.hi - &self.lo,
            shift: self.shift + gear,
            left: sign(&at_lo),
        };
        let shift = grid.shift;
        let point = &grid.lo + secant_zero(at_lo, at_hi, gear) * &grid.part;
        let (lo, hi, is_hit) = grid.narrowed(point, &self.poly);
        // In the lowest gear the two parts are always decided.
        self.gear = if is_hit {
            (2 * gear).min(MAX_GEAR)
        } else {
            (gear / 2).max(1)
        };
        (self.lo, self.hi, self.shift) = (lo, hi, shift);
    }

    /// Returns the values at the ends up to a common factor: their signs are certain, and their
    /// errors are smaller than the parts of the next refinement.
    fn at_ends(&self) -> (IBig, IBig) {
        let mut precision = 64 + self.shift + self.gear;
        while precision < self.poly.whole_precision(self.shift) {
            let ends = [&self.lo, &self.hi].map(|x| self.poly.eval_near(x, self.shift, precision));
            if ends
                .iter()
                .all(|(value, error)| value.clone().abs() > error << (self.gear + 2))
            {
                return ends.map(|e| e.0).into();
            }
            precision *= 2;
        }
        [&self.lo, &self.hi]
            .map(|x| self.poly.eval_dyadic(x, self.shift))
            .into()
    }

    /// Returns the sign of a polynomial at this number; exact.
    pub fn sign_of(&self, g: &UPoly) -> Ordering {
        if g.degree() == 0 {
            return sign(&g.leading());
        }
        let mut root = self.clone();
        for round in 0.. {
            if root.is_exact() {
                return g.sign_dyadic(&root.lo, root.shift);
            }
            if let Some(sign) = root.sign_on_interval(g) {
                return sign;
            }
            if round == 1 {
                // The most frequent case of a zero: g is a multiple of the polynomial, up to a
                // constant factor.
                if g.primitive().div_exact(&root.poly.primitive()).is_some() {
                    return Ordering::Equal;
                }
                let h = root.poly.gcd(g);
                let changes = |h: &UPoly| {
                    h.sign_dyadic(&root.lo, root.shift) != h.sign_dyadic(&root.hi, root.shift)
                };
                // A common divisor has only simple roots and none at the ends.
                if h.degree() > 0 && changes(&h) {
                    return Ordering::Equal;
                }
            }
            root.step();
        }
        unreachable!("the interval shrinks until the sign is decided")
    }

    /// Returns the sign of a polynomial on the interval, if it provably has one there.
    fn sign_on_interval(&self, g: &UPoly) -> Option<Ordering> {
        // |g(x) − g(m)| ≤ (hi − lo)/2 Σ i|gᵢ| R^(i−1) on the interval around its middle m, R the
        // larger absolute end.
        let shift = self.shift + 1;
        let middle = &self.lo + &self.hi;
        let far = (&self.lo).abs().max((&self.hi).abs()) << 1;
        let mut precision = 64 + shift;
        loop {
            let (value, error) = g.eval_near(&middle, shift, precision);
            let reach =
                ((g.slope_bound(&far, shift, precision) * (&self.hi - &self.lo)) >> shift) + 1;
            if (&value).abs() > &reach + &error {
                return Some(sign(&value));
            }
            if error <= reach || precision > g.whole_precision(shift) {
                return None;
            }
            precision *= 2;
        }
    }

    /// Compares with a rational number; exact.
    pub fn cmp_rational(&self, r: &RBig) -> Ordering {
        if self.dyadic(&self.lo) >= *r {
            return if self.is_exact() && self.dyadic(&self.lo) == *r {
                Ordering::Equal
            } else {
                Ordering::Greater
            };
        }
        if self.dyadic(&self.hi) <= *r {
            return Ordering::Less;
        }
        // lo < r < hi: the root is right of r if the sign at r is that at lo.
        match self.poly.sign_at(r) {
            Ordering::Equal => Ordering::Equal,
            s if s == self.poly.sign_dyadic(&self.lo, self.shift) => Ordering::Greater,
            _ => Ordering::Less,
        }
    }

    /// Returns the rational value, if this is a rational number.
    pub fn to_rational(&self) -> Option<RBig> {
        let mut root = self.clone();
        if root.poly.degree() == 1 {
            return Some(RBig::from_parts_signed(
                -&root.poly.coefficients()[0],
                root.poly.leading(),
            ));
        }
        // A rational root's denominator divides the leading coefficient a: a·root is an integer.
        let lead = root.poly.leading();
        root.refine(bits(&lead) + 1);
        if root.is_exact() {
            return Some(root.dyadic(&root.lo));
        }
        let scaled = (RBig::from(lead.clone()) * (root.dyadic(&root.lo) + root.dyadic(&root.hi)))
            / RBig::from(2);
        let nearest = floor(&(scaled + RBig::from_parts(IBig::ONE, UBig::from(2u8))));
        let candidate = RBig::from_parts_signed(nearest, lead);
        let inside = root.dyadic(&root.lo) < candidate && candidate < root.dyadic(&root.hi);
        (inside && root.poly.sign_at(&candidate).is_eq()).then_some(candidate)
    }

    /// Returns the nearest `f64`, ties to even.
    pub fn to_f64(&self) -> f64 {
        let mut root = self.clone();
        if let Some(r) = (root.poly.degree() == 1)
            .then(|| root.to_rational())
            .flatten()
        {
            return r.to_f64().value();
        }
        for precision in (60..).step_by(60) {
            root.refine(precision);
            let (lo, hi) = root.interval();
            let (lo, hi) = (lo.to_f64().value(), hi.to_f64().value());
            // Zeros of both signs count as one number here.
            if lo == hi {
                return lo;
            }
            // The root may be halfway between two doubles: the interval might shrink for ever
            // around it.
            if lo.next_up() == hi
                && let (Ok(a), Ok(b)) = (RBig::try_from(lo), RBig::try_from(hi))
            {
                let tie = (a + b) / RBig::from(2);
                return match root.cmp_rational(&tie) {
                    Ordering::Less => lo,
                    Ordering::Greater => hi,
                    Ordering::Equal => tie.to_f64().value(),
                };
            }
        }
        unreachable!(
            "the interval shrinks until both ends round to the same number or to neighbours"
        )
    }
    /// Returns an interval with `f64` ends, adjacent or equal, that contains the number.
    pub fn to_interval(&self) -> Interval {
        let nearest = self.to_f64();
        match RBig::try_from(nearest).map(|r| self.cmp_rational(&r)) {
            Ok(Ordering::Equal) => Interval::new(nearest, nearest),
            Ok(Ordering::Less) => Interval::new(nearest.next_down(), nearest),
            Ok(Ordering::Greater) => Interval::new(nearest, nearest.next_up()),
            Err(_) if nearest > 0.0 => Interval::new(f64::MAX, f64::INFINITY),
            Err(_) => Interval::new(f64::NEG_INFINITY, f64::MIN),
        }
    }

    /// Returns the rational number of least denominator (of these the least in absolute value)
    /// strictly between the refined intervals of this number and a larger one.
    ///
    /// # Panics
    /// If the other number is not larger.
    pub fn rational_below(&self, larger: &Self) -> RBig {
        let (mut a, mut b) = (self.clone(), larger.clone());
        assert!(a < b, "numbers out of order");
        loop {
            let (lo, hi) = (a.dyadic(&a.hi), b.dyadic(&b.lo));
            if lo < hi {
                return simplest_between(&lo, &hi);
            }
            a.step();
            b.step();
        }
    }
}

impl PartialEq for RealRoot {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for RealRoot {}

impl PartialOrd for RealRoot {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for RealRoot {
    fn cmp(&self, other: &Self) -> Ordering {
        let (mut a, mut b) = (self.clone(), other.clone());
        let mut distinct = false;
        for round in 0.. {
            if a.is_exact() {
                return b.cmp_rational(&a.dyadic(&a.lo)).reverse();
            }
            if b.is_exact() {
                return a.cmp_rational(&b.dyadic(&b.lo));
            }
            let (a_lo, a_hi) = a.interval();
            let (b_lo, b_hi) = b.interval();
            if a_hi <= b_lo {
                return Ordering::Less;
            }
            if b_hi <= a_lo {
                return Ordering::Greater;
            }
            if !distinct && round > 0 {
                if a.is_root_of_both(&b, [a_lo.max(b_lo), a_hi.min(b_hi)]) {
                    return Ordering::Equal;
                }
                distinct = true;
            }
            a.step();
            b.step();
        }
        unreachable!("intervals of different numbers shrink until they are disjoint")
    }
}

/// Returns ⌊r⌋.
pub(crate) fn floor(r: &RBig) -> IBig {
    let d = IBig::from(r.denominator().clone());
    let q = r.numerator() / &d;
    if r.is_negative() && &q * &d != *r.numerator() {
        q - 1
    } else {
        q
    }
}

/// Returns the rational number of least denominator strictly between two numbers, of these the one
/// of least absolute value (Stern–Brocot).
///
/// # Panics
/// If lo ≥ hi.
pub fn simplest_between(lo: &RBig, hi: &RBig) -> RBig {
    assert!(lo < hi, "an empty interval");
    match (lo.cmp(&RBig::ZERO), hi.cmp(&RBig::ZERO)) {
        (Ordering::Less, Ordering::Greater) => RBig::ZERO,
        (_, Ordering::Greater) => simplest_positive(lo, hi),
        _ => -simplest_positive(&-hi, &-lo),
    }
}

/// Returns the simplest number between 0 ≤ lo < hi, by the common beginning of their continued
/// fractions, in a loop, as these may have as many terms as the numbers have digits.
fn simplest_positive(lo: &RBig, hi: &RBig) -> RBig {
    let (mut lo, mut hi) = (lo.clone(), hi.clone());
    let mut wholes = Vec::new();
    let mut tail = loop {
        let whole = floor(&lo);
        let next = RBig::from(&whole + 1);
        if next < hi {
            break next;
        }
        // Both numbers are in [whole, whole + 1]: the fractional parts are inverted; the upper end
        // of the inverse may be infinite.
        let whole = RBig::from(whole);
        let (lo_part, hi_part) = (&lo - &whole, &hi - &whole);
        wholes.push(whole);
        lo = RBig::ONE / hi_part;
        if lo_part.is_zero() {
            break RBig::from(floor(&lo) + 1);
        }
        hi = RBig::ONE / lo_part;
    };
    for whole in wholes.into_iter().rev() {
        tail = whole + RBig::ONE / tail;
    }
    tail
}
