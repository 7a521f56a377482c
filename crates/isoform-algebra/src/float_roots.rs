//! Real roots in floating point, proved by sign changes: where it is known how many there are, many
//! samples of a curve need no exact arithmetic.

use isoform_num::Interval;

/// Halvings of the range in search of roots, and how wide a bracket that proves one may be, per
/// size of the root.
const HALVINGS: usize = 40;
const WIDTH: f64 = 1e-13;

/// The roots in (0, `top`) of a polynomial with coefficients c₀, c₁, … that are known to rounding,
/// if there are `count` of them, each simple.
///
/// As many disjoint brackets with certain sign changes as there are roots hold one each, so that
/// the search itself (Descartes' rule on Bernstein coefficients) needs no proof. None where
/// rounding leaves a doubt.
pub(crate) fn proved_roots(coefficients: &[Interval], top: f64, count: usize) -> Option<Vec<f64>> {
    if count == 0 {
        return Some(Vec::new());
    }
    let near: Vec<f64> = coefficients
        .iter()
        .map(|c| 0.5 * (c.lo() + c.hi()))
        .collect();
    let value = |v: f64| near.iter().rev().fold(0.0, |sum, c| sum * v + c);
    let sign = |v: f64| {
        let v = Interval::new(v, v);
        let at = coefficients
            .iter()
            .rev()
            .fold(Interval::new(0.0, 0.0), |sum, &c| sum * v + c);
        if at.lo() > 0.0 {
            1
        } else if at.hi() < 0.0 {
            -1
        } else {
            0
        }
    };
    let mut roots = Vec::new();
    let mut last = 0.0;
    for (lo, hi) in isolate(&near, top, count)? {
        let v = refine(&value, lo, hi);
        let mut width = 4.0 * f64::EPSILON * v;
        let bracket = loop {
            let (a, b) = (v - width, v + width);
            if sign(a) * sign(b) < 0 {
                break (a, b);
            }
            width *= 4.0;
            // Next to zero no width is left, and what is not a number has none.
            if !(width > 0.0 && width <= WIDTH * v) {
                return None;
            }
        };
        if bracket.0 <= last || bracket.1 >= top {
            return None;
        }
        last = bracket.1;
        roots.push(v);
    }
    Some(roots)
}

/// Intervals in (0, `top`) with one sign variation of the Bernstein coefficients each, ascending;
/// None if they are not `count`.
fn isolate(near: &[f64], top: f64, count: usize) -> Option<Vec<(f64, f64)>> {
    let n = near.len() - 1;
    // From powers of v / top: b_j is the sum of C(j, m) / C(n, m) a_m.
    let mut bernstein = vec![0.0; n + 1];
    let mut scale = 1.0;
    for (m, c) in near.iter().enumerate() {
        let mut share = (1..=m).fold(1.0, |p, k| p * k as f64 / (n + 1 - k) as f64);
        for (j, b) in bernstein.iter_mut().enumerate().skip(m) {
            if j > m {
                share *= j as f64 / (j - m) as f64;
            }
            *b += share * c * scale;
        }
        scale *= top;
    }
    let variations = |b: &[f64]| {
        b.windows(2)
            .filter(|w| (w[0] < 0.0) != (w[1] < 0.0))
            .count()
    };
    let mut found = Vec::new();
    let mut stack = vec![(0.0, top, bernstein, 0)];
    while let Some((lo, hi, b, depth)) = stack.pop() {
        match variations(&b) {
            0 => {}
            1 => found.push((lo, hi)),
            _ if depth == HALVINGS || b.iter().any(|x| x.is_nan()) => return None,
            _ => {
                // Both halves by de Casteljau.
                let (mut left, mut right) = (Vec::with_capacity(n + 1), b);
                for k in 0..=n {
                    left.push(right[0]);
                    for i in 0..n - k {
                        right[i] = 0.5 * (right[i] + right[i + 1]);
                    }
                }
                let middle = 0.5 * (lo + hi);
                stack.push((middle, hi, right, depth + 1));
                stack.push((lo, middle, left, depth + 1));
            }
        }
    }
    (found.len() == count).then_some(found)
}

/// A zero between two places with different signs: by halving, and by chords where they do better.
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
}
