//! Blobby models, noise, Bézier volumes and other shapes.

use super::{Call, FormulaError, Outcome};
use crate::hyperfun::formula::{E, norm2};
use crate::hyperfun::machine::Machine;
use crate::library::Library;
use std::f64::consts::{PI, TAU};

/// Returns the squared distance to element `k` of the arrays x0, y0, z0, arguments 1 to 3.
fn distance2<'c, M: Machine>(c: &Call<'c, M>, k: usize) -> E<'c, M> {
    norm2(&std::array::from_fn(|i| c.item(0, i) - c.item(i + 1, k)))
}

/// Returns Σ b exp(−a r²) − T.
pub(super) fn blobby<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let mut sum = -c.n(6);
    for k in 0..c.len(1) {
        sum = sum + c.item(5, k) * (-(c.item(4, k) * distance2(c, k))).exp();
    }
    Ok(sum)
}

/// Returns Σ w(q) − T with q = r/d and w = b (1 − 3q²) for q ≤ 1/3, 1.5 b (1 − q)² for q < 1, else
/// 0.
pub(super) fn metaball<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let mut sum = -c.n(6);
    let (zero, one) = (c.c(0.0), c.c(1.0));
    for k in 0..c.len(1) {
        let (b, d) = (c.item(4, k), c.item(5, k));
        let there = zero.less(&d);
        let q = distance2(c, k).sqrt() / there.select(&d, &one);
        let core = &b * &(1.0 - 3.0 * q.square());
        let skirt = 1.5 * (&b * &(1.0 - &q).square());
        let value = q
            .at_most(1.0 / 3.0)
            .select(&core, &q.below(1.0).select(&skirt, &zero));
        sum = sum + there.select(&value, &zero);
    }
    Ok(sum)
}

/// Returns Σ w(q) − T with q = (r/d)² and w = 1 − 22q/9 + 17q²/9 − 4q³/9 for q ≤ 1, else 0.
pub(super) fn soft<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let mut sum = -c.n(5);
    let zero = c.c(0.0);
    for k in 0..c.len(1) {
        let q = distance2(c, k) / c.item(4, k).square();
        let value = 1.0 - (22.0 / 9.0) * &q + (17.0 / 9.0) * q.square() - (4.0 / 9.0) * q.powi(3);
        sum = sum + q.at_most(1.0).select(&value, &zero);
    }
    Ok(sum)
}

/// Returns g₁g₂g₃ with gᵢ = A sin wᵢ + k sin(wᵢ/1.35 + P sin wⱼ), k = A/1.17, w = F x and j = 3, 1,
/// 2.
pub(super) fn noise_g<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let (amplitude, frequency, phase) = (c.n(1), c.n(2), c.n(3));
    Ok(noise(c, &amplitude, &frequency, &phase))
}

/// Returns the noise of [`noise_g`] for an amplitude, frequency and phase.
pub(super) fn noise<'c, M: Machine>(
    c: &Call<'c, M>,
    a: &E<'c, M>,
    f: &E<'c, M>,
    p: &E<'c, M>,
) -> E<'c, M> {
    let w = c.point(0).map(|x| f * x);
    let s = [w[0].sin(), w[1].sin(), w[2].sin()];
    let k = a / 1.17;
    let g = |i: usize, j: usize| a * &s[i] + &k * (&w[i] / 1.35 + p * &s[j]).sin();
    g(0, 2) * g(1, 0) * g(2, 1)
}

/// Maximum number of control values in one direction, as in the reference implementation.
const MAX_CONTROL_VALUES: usize = 21;

/// Returns Σ Bᵢ(t₁) Bⱼ(t₃) Bₖ(t₂) w[(i m + j) n + k], R-intersected with the box; m belongs to z
/// and n to y.
pub(super) fn bezier_volume<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let [l, m, n] = control_counts(c)?;
    let x = c.point(0);
    let (low, high) = (|i: usize| c.item(4, i), |i: usize| c.item(4, i + 3));
    let t: Vec<E<'c, M>> = (0..3)
        .map(|i| (&x[i] - low(i)) / (high(i) - low(i)))
        .collect();
    let (bu, bv, bw) = (
        bernstein(l, &t[0]),
        bernstein(m, &t[2]),
        bernstein(n, &t[1]),
    );
    let mut sum = c.c(0.0);
    for (i, bu) in bu.iter().enumerate() {
        for (j, bv) in bv.iter().enumerate() {
            let b = bu * bv;
            for (k, bw) in bw.iter().enumerate() {
                sum = sum + &b * bw * c.item(5, (i * m + j) * n + k);
            }
        }
    }
    let slab = |i: usize| (&x[i] - low(i)) * (high(i) - &x[i]);
    Ok(slab(0)
        .intersection(&slab(1))
        .intersection(&slab(2))
        .intersection(&sum))
}

/// Reads the numbers of control values in the three directions; fails if the array has fewer.
fn control_counts<M: Machine>(c: &mut Call<'_, M>) -> Result<[usize; 3], FormulaError> {
    let mut counts = [0; 3];
    for (i, count) in counts.iter_mut().enumerate() {
        let n = (c.need(i + 1, "a number of control values")? + 0.5).floor();
        if !(1.0..=MAX_CONTROL_VALUES as f64).contains(&n) {
            return c.fail(format!(
                "{n} control values in one direction; 1 to {MAX_CONTROL_VALUES} are possible"
            ));
        }
        *count = n as usize;
    }
    let [l, m, n] = counts;
    if c.len(5) < l * m * n {
        return c.fail(format!(
            "{l} x {m} x {n} control values are needed, the array has {}",
            c.len(5)
        ));
    }
    c.spend((l * m * n) as u64)?;
    Ok(counts)
}

/// Returns the `count` Bernstein polynomials of degree count − 1.
fn bernstein<'c, M: Machine>(count: usize, t: &E<'c, M>) -> Vec<E<'c, M>> {
    let rest = 1.0 - t;
    let mut binomial = 1.0;
    (0..count)
        .map(|i| {
            let b = binomial * (t.powi(i as i32) * rest.powi((count - 1 - i) as i32));
            binomial = binomial * (count - 1 - i) as f64 / (i + 1) as f64;
            b
        })
        .collect()
}

/// Returns hfDInt(f1, −f2).
pub(super) fn sardf_difference<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    Ok(c.n(0)
        .library(Library::SardfIntersection, &[&-c.n(1), &c.n(2), &c.n(3)]))
}

/// Returns 0 for n ≤ 1, else 2/(aπ) (1/2 − Σ sin(2π i f t)/i) for i = 1 … n − 1.
pub(super) fn sawtooth<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let n = c.need(1, "the number of terms")?.trunc();
    if n.is_nan() || n <= 1.0 {
        return Ok(c.c(0.0));
    }
    c.spend(n as u64)?;
    let angle = TAU * (c.n(3) * c.n(0));
    let mut sum = c.c(0.5);
    for i in 1..n as u64 {
        sum = sum - (i as f64 * &angle).sin() / i as f64;
    }
    Ok(2.0 / (PI * c.n(2)) * sum)
}
