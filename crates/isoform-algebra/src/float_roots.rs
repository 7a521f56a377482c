//! Real roots in floating point, proved by sign changes: if their number is known, most samples of
//! a curve need no exact arithmetic.

use dashu_ratio::RBig;
use isoform_num::{DoubleDouble, Interval};
use std::ops::{Add, Mul};

/// Maximum number of bisections of the range in the search for roots.
const MAX_ROOT_BISECTIONS: usize = 40;
/// Maximum width of a bracket that proves a root, relative to the root.
const MAX_BRACKET_WIDTH: f64 = 1e-13;

/// Maximum degree at which binomial coefficients, and the products that lead to them, are exact, as
/// they are below 2⁵³; above it no sign is certain.
const MAX_EXACT_DEGREE: usize = 51;

/// Number type of Bernstein coefficients.
pub(crate) trait Number: Copy + Add<Output = Self> + Mul<Output = Self> {
    /// Returns a double as an exact number.
    fn exact(x: f64) -> Self;
    /// Returns 1/x of a non-zero double.
    fn reciprocal(x: f64) -> Self;
}

/// Number type for the search for roots, without bounds.
pub(crate) trait Approximate: Number {
    /// Returns the number rounded to a double.
    fn rounded(self) -> f64;
}

impl Number for f64 {
    fn exact(x: f64) -> Self {
        x
    }
    fn reciprocal(x: f64) -> Self {
        newton_reciprocal(x)
    }
}

impl Approximate for f64 {
    fn rounded(self) -> f64 {
        self
    }
}

impl Number for DoubleDouble {
    fn exact(x: f64) -> Self {
        x.into()
    }
    fn reciprocal(x: f64) -> Self {
        newton_reciprocal(x)
    }
}

impl Approximate for DoubleDouble {
    fn rounded(self) -> f64 {
        self.value()
    }
}

/// Returns 1/x, by one step of Newton's iteration from the rounded quotient.
fn newton_reciprocal<T: Number>(x: f64) -> T {
    let near = T::exact(1.0 / x);
    near * (T::exact(2.0) + T::exact(-x) * near)
}

/// Number type with error bounds.
pub(crate) trait Bounded: Number {
    /// Number type without bounds with which roots are searched.
    type Middle: Approximate;
    /// Returns a number within the bounds.
    fn middle(self) -> Self::Middle;
    /// Returns −1 or 1 if all numbers within the bounds have that sign, otherwise 0.
    fn sign(self) -> i8;
}

impl Number for Interval {
    fn exact(x: f64) -> Self {
        Self::new(x, x)
    }
    fn reciprocal(x: f64) -> Self {
        Self::new((1.0 / x).next_down(), (1.0 / x).next_up())
    }
}

impl Bounded for Interval {
    type Middle = f64;
    fn middle(self) -> f64 {
        0.5 * (self.lo() + self.hi())
    }
    fn sign(self) -> i8 {
        i8::from(self.lo() > 0.0) - i8::from(self.hi() < 0.0)
    }
}

/// Numbers within `radius` of a sum of two doubles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wide {
    middle: DoubleDouble,
    radius: f64,
}

/// Relative error bound of a sum or product of two sums of doubles: the algorithms used are within
/// 3 and 7 times 2^−106 (M. Joldes, J.-M. Muller, V. Popescu, ACM Trans. Math. Softw. 44, 2017,
/// theorems 3.1 and 5.1); the rest covers rounding of the radii.
const WIDE_ERROR: f64 = f64::EPSILON * f64::EPSILON * 16.0;

impl Wide {
    fn new(middle: DoubleDouble, radius: f64) -> Self {
        Self { middle, radius }
    }
    /// Returns the range between two numbers.
    pub(crate) fn between(lo: &RBig, hi: &RBig) -> Self {
        let near = lo.to_f64().value();
        let Ok(exact) = RBig::try_from(near) else {
            return Self::new(near.into(), f64::NAN);
        };
        let [below, above] = [lo - &exact, hi - exact].map(|x| x.to_f64().value());
        // Both are rounded, or below the smallest double.
        let rounding = (below.abs() + above.abs()) * f64::EPSILON;
        let radius = (above - below) + rounding + f64::MIN_POSITIVE;
        Self::new(DoubleDouble::new(near, below), radius)
    }
    /// Returns doubles below and above all numbers of the range.
    pub(crate) fn bounds(self) -> [f64; 2] {
        let at = self.middle.value();
        let beyond = (self.radius + 2.0 * f64::EPSILON * at.abs()).next_up();
        [(at - beyond).next_down(), (at + beyond).next_up()]
    }
    /// Returns a result with a bound on its radius that is safe against underflow.
    fn around(middle: DoubleDouble, size: f64, radius: f64) -> Self {
        let radius = radius * (1.0 + 8.0 * f64::EPSILON) + size * WIDE_ERROR + f64::MIN_POSITIVE;
        Self { middle, radius }
    }
}

impl Add for Wide {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        let size = self.middle.value().abs() + o.middle.value().abs();
        Self::around(self.middle + o.middle, size, self.radius + o.radius)
    }
}

impl Mul for Wide {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        let [a, b] = [self, o].map(|x| x.middle.value().abs());
        // Middles exceed their first doubles by less than one part in 2^52.
        let radius = a * o.radius + b * self.radius + self.radius * o.radius;
        Self::around(self.middle * o.middle, a * b, radius)
    }
}

impl Number for Wide {
    fn exact(x: f64) -> Self {
        Self::new(x.into(), 0.0)
    }
    fn reciprocal(x: f64) -> Self {
        let middle = DoubleDouble::reciprocal(x);
        // The iteration squares the error of a double, and rounds three times.
        Self::around(middle, 4.0 * middle.value().abs(), 0.0)
    }
}

impl Bounded for Wide {
    type Middle = DoubleDouble;
    fn middle(self) -> DoubleDouble {
        self.middle
    }
    fn sign(self) -> i8 {
        let at = self.middle.value();
        // The second double of the sum is below one part in 2^52 of the first.
        let beyond = self.radius + 2.0 * f64::EPSILON * at.abs();
        i8::from(at > beyond) - i8::from(at < -beyond)
    }
}

/// Returns the roots in (0, `top`) of a polynomial with coefficients c₀, c₁, … that are known up to
/// rounding, if there are `count` of them, each simple.
///
/// As many disjoint brackets with certain sign changes as there are roots hold one each, so that
/// the search itself (Descartes' rule on Bernstein coefficients) needs no proof. `None` where
/// rounding leaves a doubt.
pub(crate) fn proved_roots<T: Bounded>(
    coefficients: &[T],
    top: f64,
    count: usize,
) -> Option<Vec<f64>> {
    if count == 0 {
        return Some(Vec::new());
    }
    let near: Vec<T::Middle> = coefficients.iter().map(|c| c.middle()).collect();
    let mut roots = Vec::new();
    let mut last = 0.0;
    for cell in isolate(&near, top, count)? {
        let (v, width) = bracket(coefficients, cell)?;
        if v - width <= last || v + width >= top {
            return None;
        }
        last = v + width;
        roots.push(v);
    }
    Some(roots)
}

/// Returns a root in a cell, with the distance to both sides at which the signs differ.
fn bracket<T: Bounded>(coefficients: &[T], (lo, hi): (f64, f64)) -> Option<(f64, f64)> {
    let middles = || coefficients.iter().map(|c| c.middle());
    let value = |v: f64| value_at(middles(), T::Middle::exact(v)).rounded();
    let sign = |v: f64| value_at(coefficients.iter().copied(), T::exact(v)).sign();
    let v = refine(&value, lo, hi);
    let mut width = 4.0 * f64::EPSILON * v;
    loop {
        if sign(v - width) * sign(v + width) < 0 {
            return Some((v, width));
        }
        width *= 4.0;
        // Next to zero no width is left, and what is not a number has none.
        if !(width > 0.0 && width <= MAX_BRACKET_WIDTH * v) {
            return None;
        }
    }
}

/// Returns the value of a polynomial, by Horner's rule.
fn value_at<T: Number>(coefficients: impl DoubleEndedIterator<Item = T>, v: T) -> T {
    coefficients.rev().fold(T::exact(0.0), |sum, c| sum * v + c)
}

/// Returns all roots in (0, 1) of a polynomial with coefficients c₀, c₁, … that are known within
/// bounds, as disjoint open intervals in ascending order; `None` if the bounds do not decide.
/// Otherwise 0 and 1 are not roots, and all roots in between are simple.
///
/// Descartes' rule on Bernstein coefficients whose signs are certain (after A. Eigenwillig and
/// others, CASC 2005).
pub(crate) fn all_roots<T: Bounded>(coefficients: &[T]) -> Option<Vec<[f64; 2]>> {
    let mut found = Vec::new();
    let mut last = 0.0;
    let mut stack = vec![(0.0, 1.0, certain_bernstein(coefficients)?, 0)];
    while let Some((lo, hi, b, depth)) = stack.pop() {
        let ends = [b[0].sign(), b[b.len() - 1].sign()];
        if ends.contains(&0) {
            return None;
        }
        match variations(&b) {
            Some(0) => {}
            Some(1) => {
                let (v, width) = bracket(coefficients, (lo, hi))?;
                if v - width <= last || v + width >= 1.0 {
                    return None;
                }
                last = v + width;
                found.push([v - width, v + width]);
            }
            _ if depth == MAX_ROOT_BISECTIONS => return None,
            _ => {
                let middle = 0.5 * (lo + hi);
                let (left, right) = halves(b);
                stack.push((middle, hi, right, depth + 1));
                stack.push((lo, middle, left, depth + 1));
            }
        }
    }
    Some(found)
}

/// Returns the coefficients of p(`by` x) of a polynomial p.
pub(crate) fn stretched<T: Number>(coefficients: &[T], by: T) -> Vec<T> {
    let mut scale = T::exact(1.0);
    let stretched = coefficients.iter().map(|&c| {
        let product = c * scale;
        scale = scale * by;
        product
    });
    stretched.collect()
}

/// Returns the Bernstein coefficients on \[0, 1\], whose signs are certain; `None` if the degree is
/// too high for that.
pub(crate) fn certain_bernstein<T: Bounded>(coefficients: &[T]) -> Option<Vec<T>> {
    (coefficients.len() <= MAX_EXACT_DEGREE + 1).then(|| in_bernstein(coefficients))
}

/// Returns the Bernstein coefficients on \[0, 1\]: b_j is the sum of C(j, m)/C(n, m) c_m.
fn in_bernstein<T: Number>(coefficients: &[T]) -> Vec<T> {
    let n = coefficients.len() - 1;
    let mut bernstein = vec![T::exact(0.0); n + 1];
    for (m, &c) in coefficients.iter().enumerate() {
        let all = (0..m).fold(1.0, |p, k| p * (n - k) as f64 / (k + 1) as f64);
        let part = c * T::reciprocal(all);
        let mut ways = 1.0;
        for (j, b) in bernstein.iter_mut().enumerate().skip(m) {
            if j > m {
                ways = ways * j as f64 / (j - m) as f64;
            }
            *b = *b + part * T::exact(ways);
        }
    }
    bernstein
}

/// Returns the number of sign changes, if it does not depend on uncertain signs or is at least two.
fn variations<T: Bounded>(b: &[T]) -> Option<usize> {
    let (mut changes, mut last, mut open) = (0, 0, 0);
    for sign in b.iter().map(|x| x.sign()) {
        if sign == 0 {
            open += 1;
            continue;
        }
        // Between two of one sign there may be two changes more, and between two of different signs
        // if there is room for as many.
        if open > usize::from(sign != last) {
            return None;
        }
        changes += usize::from(sign == -last);
        (last, open) = (sign, 0);
    }
    Some(changes)
}

/// Returns the coefficients on both halves, by de Casteljau's algorithm.
fn halves<T: Number>(b: Vec<T>) -> (Vec<T>, Vec<T>) {
    let half = T::exact(0.5);
    let n = b.len() - 1;
    let (mut left, mut right) = (Vec::with_capacity(n + 1), b);
    for k in 0..=n {
        left.push(right[0]);
        for i in 0..n - k {
            right[i] = half * (right[i] + right[i + 1]);
        }
    }
    (left, right)
}

/// Returns intervals in (0, `top`) with one sign variation of the Bernstein coefficients each,
/// ascending; `None` if their number is not `count`.
fn isolate<T: Approximate>(near: &[T], top: f64, count: usize) -> Option<Vec<(f64, f64)>> {
    let changes_sign = |w: &&[T]| (w[0].rounded() < 0.0) != (w[1].rounded() < 0.0);
    let variations = |b: &[T]| b.windows(2).filter(changes_sign).count();
    let bernstein = in_bernstein(&stretched(near, T::exact(top)));
    let mut found = Vec::new();
    let mut stack = vec![(0.0, top, bernstein, 0)];
    while let Some((lo, hi, b, depth)) = stack.pop() {
        match variations(&b) {
            0 => {}
            1 => found.push((lo, hi)),
            _ if depth == MAX_ROOT_BISECTIONS || b.iter().any(|x| x.rounded().is_nan()) => {
                return None;
            }
            _ => {
                let middle = 0.5 * (lo + hi);
                let (left, right) = halves(b);
                stack.push((middle, hi, right, depth + 1));
                stack.push((lo, middle, left, depth + 1));
            }
        }
    }
    (found.len() == count).then_some(found)
}

/// Returns a zero between two places with different signs, by bisection, and by secants where they
/// are better.
fn refine(value: &dyn Fn(f64) -> f64, mut lo: f64, mut hi: f64) -> f64 {
    let (mut at_lo, mut at_hi) = (value(lo), value(hi));
    for round in 0..200 {
        let middle = 0.5 * (lo + hi);
        if middle <= lo || middle >= hi {
            break;
        }
        let chord = lo + (hi - lo) * (at_lo / (at_lo - at_hi));
        // Every third step halves, so that it always ends.
        let v = if round % 3 != 2 && chord > lo && chord < hi {
            chord
        } else {
            middle
        };
        let at = value(v);
        if at == 0.0 {
            return v;
        }
        if (at < 0.0) == (at_lo < 0.0) {
            (lo, at_lo) = (v, at);
        } else {
            (hi, at_hi) = (v, at);
        }
    }
    if at_lo.abs() < at_hi.abs() { lo } else { hi }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exact(c: &[f64]) -> Vec<Interval> {
        c.iter().map(|&c| Interval::new(c, c)).collect()
    }

    #[test]
    fn simple_roots_are_found_and_proved() {
        // (v - 1/8)(v - 1/4)(v - 1/2)(v - 2), none of them where the range is halved.
        let c = [1.0 / 32.0, -29.0 / 64.0, 63.0 / 32.0, -23.0 / 8.0, 1.0];
        let roots = proved_roots(&exact(&c), 0.9, 3).expect("three simple roots");
        for (v, r) in roots.iter().zip([0.125, 0.25, 0.5]) {
            assert!((v - r).abs() <= 1e-15, "{v} is not {r}");
        }
    }

    #[test]
    fn doubt_is_said() {
        // (v - 1/2)²: no sign change.
        assert_eq!(proved_roots(&exact(&[0.25, -1.0, 1.0]), 1.0, 1), None);
        // A wrong count.
        assert_eq!(proved_roots(&exact(&[-0.5, 1.0]), 1.0, 2), None);
        // Coefficients that are hardly known: roots between 0.4 and 0.6.
        assert_eq!(
            proved_roots(
                &[Interval::new(-0.6, -0.4), Interval::new(1.0, 1.0)],
                1.0,
                1
            ),
            None
        );
        // Nearer to zero than brackets can be: this went on for ever.
        assert_eq!(proved_roots(&exact(&[-1e-320, 1.0]), 1.0, 1), None);
        // Two roots 1e-15 apart cannot be told apart.
        assert_eq!(
            proved_roots(&exact(&[0.25 * (1.0 + 2e-15), -1.0 - 1e-15, 1.0]), 1.0, 2),
            None
        );
    }

    /// Returns the product of v − k/(n + 1), k = 1 … n, with coefficients rounded to sums of two
    /// doubles.
    fn comb(n: i64) -> (Vec<RBig>, Vec<Wide>) {
        let mut exact = vec![RBig::ONE];
        for k in 1..=n {
            let root = RBig::from(k) / RBig::from(n + 1);
            exact.insert(0, RBig::ZERO);
            for i in 0..exact.len() - 1 {
                let next = &exact[i + 1] * &root;
                exact[i] -= next;
            }
        }
        let near = exact.iter().map(|c| Wide::between(c, c)).collect();
        (exact, near)
    }

    #[test]
    fn all_roots_are_found_or_doubt_is_said() {
        let (_, near) = comb(20);
        let found = all_roots(&near).expect("twenty simple roots");
        assert_eq!(found.len(), 20);
        for (k, [lo, hi]) in found.into_iter().enumerate() {
            let root = (k + 1) as f64 / 21.0;
            assert!(
                lo < root && root < hi && hi - lo < 1e-12,
                "{lo} {root} {hi}"
            );
        }
        // In doubles these coefficients determine no sign between the roots in the middle.
        let doubles: Vec<Interval> = near
            .iter()
            .map(|c| Interval::new(c.bounds()[0], c.bounds()[1]))
            .collect();
        assert_eq!(all_roots(&doubles), None);
        // None in (0, 1), two of them complex; one at an end; a double one.
        let roots = |c: &[f64]| all_roots(&exact(c));
        assert_eq!(roots(&[5.0, -4.0, 1.0]), Some(vec![]));
        assert_eq!(roots(&[0.0, 1.0]), None);
        assert_eq!(roots(&[0.1, -0.6, 0.9]), None);
    }

    /// An uncertain sign counts as either: one coefficient between different signs does not matter,
    /// two may add two changes.
    #[test]
    fn changes_of_sign() {
        let of = |signs: &str| {
            let one = |c| match c {
                '+' => Interval::new(1.0, 2.0),
                '-' => Interval::new(-2.0, -1.0),
                _ => Interval::new(-1.0, 1.0),
            };
            variations(&signs.chars().map(one).collect::<Vec<_>>())
        };
        assert_eq!(
            [of("+++"), of("++--"), of("+-+")],
            [Some(0), Some(1), Some(2)]
        );
        assert_eq!([of("+?-"), of("+?+"), of("+??-")], [Some(1), None, None]);
    }

    /// Binomial coefficients by these products agree with Pascal's triangle up to the claimed
    /// degree.
    #[test]
    fn binomial_coefficients_are_exact() {
        let mut row = vec![1u128];
        for n in 1..=MAX_EXACT_DEGREE {
            row = (0..=n)
                .map(|m| {
                    [m.wrapping_sub(1), m]
                        .iter()
                        .filter_map(|&k| row.get(k))
                        .sum()
                })
                .collect();
            for (m, &exact) in row.iter().enumerate() {
                let all = (0..m).fold(1.0, |p, k| p * (n - k) as f64 / (k + 1) as f64);
                let ways = (m + 1..=n).fold(1.0, |p, j| p * j as f64 / (j - m) as f64);
                assert_eq!([all as u128, ways as u128], [exact; 2], "{n} {m}");
            }
        }
        let is_certain = |n: usize| certain_bernstein(&exact(&vec![1.0; n + 1])).is_some();
        assert!(is_certain(MAX_EXACT_DEGREE) && !is_certain(MAX_EXACT_DEGREE + 1));
    }

    /// Both ends of a range are within the bounds, even if they are rounded.
    #[test]
    fn ranges_are_within_the_bounds() {
        let mut rng = fastrand::Rng::with_seed(3);
        let exactly = |x: f64| RBig::try_from(x).expect("finite");
        for _ in 0..20_000 {
            // Coefficients have digits beyond a double, at about this number of bits.
            let mut draw = |bits: i32| {
                let size = 2f64.powi(-bits);
                exactly((1.0 + rng.f64()) * size) + exactly(rng.f64() * size * 2f64.powi(-53))
            };
            let lo = draw(0) - draw(54);
            let hi = &lo + draw(52);
            for [lo, hi] in [[&lo, &lo], [&lo, &hi]] {
                let wide = Wide::between(lo, hi);
                let second = (wide.middle + DoubleDouble::from(-wide.middle.value())).value();
                let middle = exactly(wide.middle.value()) + exactly(second);
                let radius = exactly(wide.radius);
                assert!(
                    &middle - &radius <= *lo && *hi <= middle + radius,
                    "{lo} {hi}"
                );
            }
        }
    }

    /// Sums, products and reciprocals agree with exact arithmetic within the bounds.
    #[test]
    fn bounds_hold() {
        let mut rng = fastrand::Rng::with_seed(7);
        let exactly = |x: f64| RBig::try_from(x).expect("finite");
        for _ in 0..20_000 {
            let mut draw = || {
                let size = 2f64.powi(rng.i32(-40..40));
                (rng.f64() - 0.5) * size
            };
            let (a, b, c) = (draw(), draw(), draw());
            let [x, y, z] = [a, b, c].map(exactly);
            let sum = Wide::exact(a) * Wide::exact(b) + Wide::exact(c);
            let product = sum * sum * Wide::exact(a) + Wide::reciprocal(b);
            let total = &x * &y + &z;
            let value = &total * &total * &x + RBig::ONE / &y;
            let [lo, hi] = product.bounds().map(exactly);
            assert!(lo <= value && value <= hi, "{a} {b} {c}");
            // The middle is a sum of two doubles: what is left is far below the last place.
            let left = value - exactly(product.middle.value());
            let second = (product.middle + DoubleDouble::from(-product.middle.value())).value();
            let off = left - exactly(second);
            let within = exactly(product.radius + second.abs() * f64::EPSILON);
            assert!(off <= within && -off <= within, "{a} {b} {c}");
        }
    }
}
