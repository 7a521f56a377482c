//! Polynomials with ball coefficients: division, isolation of simple roots, counting of multiple
//! ones. Every function returns `None` rather than an uncertain result.

use crate::ball::{self, Ball};
use dashu_base::BitTest;
use dashu_int::IBig;
use std::cmp::Ordering;

/// Number of bits of the interval's ends at the start of bisection: enough to keep its points off
/// simple numbers, which are often roots.
const GRAIN_BITS: usize = 64;

/// Returns the last remainder before the one known to vanish, of a polynomial and its derivative,
/// made monic; `None` if its degree may differ from 1.
pub(super) fn euclid(f: &[Ball], precision: usize) -> Option<Vec<Ball>> {
    let derivative = f.iter().enumerate().skip(1).map(|(i, c)| Ball {
        middle: &c.middle * IBig::from(i),
        radius: &c.radius * IBig::from(i),
    });
    let (mut a, mut b) = (
        f.to_vec(),
        monic(&derivative.collect::<Vec<_>>(), precision)?,
    );
    while b.len() > 2 {
        let r = remainder(a, &b, precision);
        a = std::mem::replace(&mut b, monic(&r, precision)?);
    }
    Some(b)
}

/// Returns a polynomial divided by its leading coefficient; `None` if that may vanish.
fn monic(p: &[Ball], precision: usize) -> Option<Vec<Ball>> {
    let lead = p.last()?;
    let rest: Option<Vec<Ball>> = p[..p.len() - 1]
        .iter()
        .map(|c| c.div(lead, precision))
        .collect();
    Some(
        rest?
            .into_iter()
            .chain([Ball::exact(IBig::ONE << precision)])
            .collect(),
    )
}

/// Returns the remainder by a monic polynomial, of one degree less than the latter.
fn remainder(mut a: Vec<Ball>, b: &[Ball], precision: usize) -> Vec<Ball> {
    let n = b.len() - 1;
    while a.len() > n {
        let q = a.pop().expect("longer than the divisor");
        let at = a.len() - n;
        for (x, c) in a[at..].iter_mut().zip(b) {
            *x = x.sub(&q.mul(c, precision));
        }
    }
    a
}

/// Returns the quotient by a divisor whose leading coefficient is certain. The divisor is made
/// monic first: subresultants are huge, and a quotient by them would vanish in the last place.
pub(super) fn divide(f: &[Ball], g: &[Ball], precision: usize) -> Option<Vec<Ball>> {
    let n = g.len() - 1;
    let monic: Option<Vec<Ball>> = g[..n].iter().map(|c| c.div(&g[n], precision)).collect();
    let monic = monic?;
    let mut rest = f.to_vec();
    let mut quotient = vec![Ball::exact(IBig::ZERO); f.len() - n];
    for i in (0..quotient.len()).rev() {
        let q = rest[i + n].clone();
        for (j, c) in monic.iter().enumerate() {
            rest[i + j] = rest[i + j].sub(&q.mul(c, precision));
        }
        quotient[i] = q;
    }
    Some(quotient)
}

/// Returns open intervals with one real root each, in total all, of a polynomial with simple roots;
/// their ends are not roots.
pub(super) fn isolate_simple(
    p: &[Ball],
    precision: usize,
    attempt: usize,
) -> Option<Vec<(IBig, IBig)>> {
    let bisection = Bisection::new(p, precision, attempt)?;
    let found = bisection.isolate(bisection.on_unit(p))?;
    // Refinement begins with the signs at the ends.
    let sign = |x: &IBig| ball::eval(p, &Ball::exact(x.clone()), precision).sign();
    for (lo, hi) in &found {
        if sign(lo)? == sign(hi)? {
            return None;
        }
    }
    Some(found)
}

/// Returns a bound on the number of bits of the roots of a polynomial: Fujiwara's bound 2 max
/// |aᵢ/aₙ|^(1/(n−i)) on bit lengths.
fn root_bits(p: &[Ball]) -> usize {
    let n = p.len() - 1;
    let top = crate::modular::bits(&p[n].magnitude().1);
    let size = |i: usize| {
        (crate::modular::bits(&p[i].magnitude().0) + 1)
            .saturating_sub(top)
            .div_ceil(n - i)
    };
    (0..n).map(size).max().unwrap_or(0) + 1
}

/// Bisection of an interval that contains all real roots, by Descartes' rule of signs.
struct Bisection {
    precision: usize,
    start: IBig,
    width: IBig,
    /// Number of bisections after which places are not exact any more.
    deepest: usize,
}

impl Bisection {
    /// Ends on both sides of all roots, in 17ths of the bound: neither symmetric nor round, so that
    /// bisection does not hit simple roots.
    const ODD: [(u32, u32); 5] = [(22, 23), (31, 20), (24, 37), (29, 43), (41, 19)];

    /// Creates the bisection; `None` if the roots have too many bits for the precision.
    fn new(p: &[Ball], precision: usize, attempt: usize) -> Option<Self> {
        let bound = root_bits(p);
        if bound + GRAIN_BITS > precision {
            return None;
        }
        let (left, right) = Self::ODD[attempt % Self::ODD.len()];
        // A multiple of 2^deepest, so that the points of bisection are exact.
        let deepest = precision - GRAIN_BITS;
        let unit: IBig = ((IBig::ONE << (GRAIN_BITS + bound)) / 17) << deepest;
        Some(Self {
            precision,
            start: &unit * IBig::from(left) * -1,
            width: unit * IBig::from(left + right),
            deepest,
        })
    }

    /// Returns q(x) = p(start + width·x), for (0, 1).
    fn on_unit(&self, p: &[Ball]) -> Vec<Ball> {
        let mut q = ball::shift(p, &Ball::exact(self.start.clone()), self.precision);
        let width = Ball::exact(self.width.clone());
        let mut scale = Ball::exact(IBig::ONE << self.precision);
        for c in &mut q {
            *c = c.mul(&scale, self.precision);
            scale = scale.mul(&width, self.precision);
        }
        q
    }

    /// Returns the place c/2^depth of (0, 1).
    fn place(&self, c: &IBig, depth: usize) -> IBig {
        &self.start + ((&self.width * c) >> depth)
    }

    /// Returns intervals with one root each, ascending; `None` if the precision does not decide.
    fn isolate(&self, q: Vec<Ball>) -> Option<Vec<(IBig, IBig)>> {
        let mut found = Vec::new();
        let mut stack = vec![(q, IBig::ZERO, 0usize)];
        while let Some((q, c, depth)) = stack.pop() {
            match variations_in_unit(&q) {
                Some(0) => {}
                Some(1) => found.push((self.place(&c, depth), self.place(&(&c + 1), depth))),
                _ if depth >= self.deepest => return None,
                _ => {
                    let [left, right] = halves(&q)?;
                    stack.push((right, (&c << 1) + 1, depth + 1));
                    stack.push((left, c << 1, depth + 1));
                }
            }
        }
        Some(found)
    }
}

/// Returns the polynomial on (0, 1/2) and on (1/2, 1), each stretched to (0, 1); `None` if 1/2 may
/// be a root.
fn halves(q: &[Ball]) -> Option<[Vec<Ball>; 2]> {
    let n = q.len() - 1;
    // 2ⁿ q(x/2) would grow: halve the higher coefficients instead, rounding outwards.
    let left: Vec<Ball> = q.iter().enumerate().map(|(i, v)| halve(v, i)).collect();
    let mut right = left.clone();
    for i in 0..=n {
        for j in (i..n).rev() {
            right[j] = right[j].add(&right[j + 1]);
        }
    }
    right[0].sign().filter(|s| s.is_ne())?;
    Some([left, right])
}

fn halve(v: &Ball, times: usize) -> Ball {
    let lost = if times == 0 || v.middle.trailing_zeros().is_none_or(|z| z >= times) {
        IBig::ZERO
    } else {
        IBig::ONE
    };
    let radius = if v.radius.is_zero() {
        lost
    } else {
        (&v.radius >> times) + 2
    };
    Ball {
        middle: &v.middle >> times,
        radius,
    }
}

/// Returns the number of sign changes of (1 + x)ⁿ q(1/(1 + x)), counted up to two; `None` if a sign
/// is uncertain before that.
fn variations_in_unit(q: &[Ball]) -> Option<usize> {
    let mut r: Vec<Ball> = q.iter().rev().cloned().collect();
    let n = r.len();
    let mut last = Ordering::Equal;
    let mut changes = 0;
    for i in 0..n {
        for j in (i..n - 1).rev() {
            r[j] = r[j].add(&r[j + 1]);
        }
        let s = r[i].sign()?;
        if s.is_ne() {
            changes += usize::from(last.is_ne() && s != last);
            last = s;
            if changes > 1 {
                return Some(changes);
            }
        }
    }
    Some(changes)
}

/// Returns a part of an interval with a sign change, at most 2^−bits wide, in which the sign
/// changes; `None` if a sign is uncertain.
///
/// Bisection, and where chords predict well the cells of finer and finer grids (J. Abbott's
/// quadratic interval refinement).
pub(super) fn narrow(
    p: &[Ball],
    (mut lo, mut hi): (IBig, IBig),
    bits: usize,
    precision: usize,
) -> Option<(IBig, IBig)> {
    let value = |x: &IBig| ball::eval(p, &Ball::exact(x.clone()), precision);
    let (mut at_lo, mut at_hi) = (value(&lo), value(&hi));
    let left = at_lo.sign()?;
    if left.is_eq() || at_hi.sign()? != left.reverse() {
        return None;
    }
    let mut gear = 1usize;
    while (&hi - &lo) << bits > IBig::ONE << precision {
        if gear > 1 {
            match predicted((&lo, &at_lo), (&hi, &at_hi), gear, &value) {
                Some([a, b]) => {
                    ((lo, at_lo), (hi, at_hi)) = (a, b);
                    gear = (2 * gear).min(precision);
                }
                None => gear /= 2,
            }
            continue;
        }
        // The middle may be a root: other places of the inner half are tried.
        let width = &hi - &lo;
        let inner = [8, 7, 9, 6, 10]
            .into_iter()
            .map(|k| &lo + ((&width * k) >> 4usize));
        let (point, at, s) = inner
            .map(|x| (value(&x), x))
            .find_map(|(at, x)| at.sign().filter(|s| s.is_ne()).map(|s| (x, at, s)))?;
        if point <= lo || point >= hi {
            return None;
        }
        if s == left {
            (lo, at_lo) = (point, at);
        } else {
            (hi, at_hi) = (point, at);
        }
        gear = 2;
    }
    Some((lo, hi))
}

/// Place, with the value there.
type At = (IBig, Ball);

/// Returns the cell of a grid of 2^gear cells in which the chord vanishes, if signs at its ends
/// prove that it contains the zero.
fn predicted(
    (lo, at_lo): (&IBig, &Ball),
    (hi, at_hi): (&IBig, &Ball),
    gear: usize,
    value: &dyn Fn(&IBig) -> Ball,
) -> Option<[At; 2]> {
    let width = hi - lo;
    let slope = &at_lo.middle - &at_hi.middle;
    if width.bit_len() <= gear + 1 || slope.is_zero() {
        return None;
    }
    let parts = IBig::ONE << gear;
    let guess = ((&at_lo.middle << gear) / slope).clamp(IBig::ONE, &parts - IBig::ONE);
    let place = |k: &IBig| lo + ((&width * k) >> gear);
    let point = place(&guess);
    let at = value(&point);
    let (left, s) = (at_lo.sign()?, at.sign().filter(|s| s.is_ne())?);
    let next = if s == left {
        guess + IBig::ONE
    } else {
        guess - IBig::ONE
    };
    let other = place(&next);
    let at_other = value(&other);
    if at_other.sign()? != s.reverse() {
        return None;
    }
    let (point, other) = ((point, at), (other, at_other));
    Some(if s == left {
        [point, other]
    } else {
        [other, point]
    })
}

/// Returns upper and lower bounds of the absolute values cₖ·radius^k, where cₖ are the coefficients
/// of the expansion around a centre.
fn sizes_on_circle(
    p: &[Ball],
    centre: &Ball,
    radius: &Ball,
    precision: usize,
) -> Vec<(IBig, IBig)> {
    let mut scale = Ball::exact(IBig::ONE << precision);
    let expanded = ball::shift(p, centre, precision);
    let scaled = expanded.iter().map(|c| {
        let term = c.mul(&scale, precision);
        scale = scale.mul(radius, precision);
        term.magnitude()
    });
    scaled.collect()
}

/// Returns the number of roots of f in a disk that contains the interval and exactly one root of
/// the polynomial with simple roots.
pub(super) fn pellet(
    f: &[Ball],
    simple: &[Ball],
    lo: &IBig,
    hi: &IBig,
    precision: usize,
) -> Option<usize> {
    let centre = Ball::exact((lo + hi) >> 1usize);
    // 64 times the distance of the root from the centre: its power of the largest multiplicity then
    // dominates.
    let radius = Ball::exact((hi - lo + IBig::ONE) << 5usize);
    let dominant = |p: &[Ball]| {
        let t = sizes_on_circle(p, &centre, &radius, precision);
        let total: IBig = t.iter().map(|(above, _)| above).sum();
        // The lower bound of one term exceeds the sum of the upper bounds of the others.
        t.iter().position(|(above, below)| *below > &total - above)
    };
    (dominant(simple)? == 1)
        .then(|| dominant(f))
        .flatten()
        .filter(|&m| m > 0)
}
