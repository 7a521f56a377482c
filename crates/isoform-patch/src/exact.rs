//! From near the surface onto it.
//!
//! On a quadric (and other rational surfaces of low degree) there are patches with I = 0, and more of them than unknowns less
//! equations: the system F∘p = 0 is singular at its solutions, which form a manifold. Gauss-Newton steps with damping that falls with
//! the squared residual (Yamashita and Fukushima 2001) still converge quadratically there, to a nearby solution: directions along the
//! manifold, whose singular values are of the order of the error, are left alone. Normal equations would square the small singular
//! values that matter, so that steps come from a QR factorisation.

use crate::objective::Objective;
use isoform_geom::RationalPatch;

/// Steps; where there is a solution some twenty are needed, as convergence is linear until the error is small.
const STEPS: usize = 80;
/// A step that leaves less than this share of the best value makes progress.
const PROGRESS: f64 = 0.9;
/// The least damping, relative to the largest column: beyond what rounding leaves.
const LEAST_DAMPING: f64 = 1e-14;
/// After so many steps without progress there is nothing more to be had.
const PATIENCE: usize = 5;
/// Below this, relative to the largest coordinate, there is only rounding.
const ENOUGH: f64 = 3e-16;

/// The patch nearest by with the least I that such steps lead to, and the root of that I.
pub(crate) fn onto(objective: &Objective<'_>, patch: &RationalPatch) -> (RationalPatch, f64) {
    let mut patch = patch.clone();
    let Some(mut at) = objective.evaluate(&patch) else { return (patch, f64::INFINITY) };
    let mut best = (patch.clone(), at.terms.i.sqrt());
    let (n, mut since) = (objective.unknowns(), 0);
    for _ in 0..STEPS {
        let (rows, residuals) = objective.distance_rows(&at);
        let column = (0..n).map(|k| rows.chunks(n).map(|row| row[k] * row[k]).sum::<f64>()).fold(0.0, f64::max).sqrt();
        let scale = patch.control().iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
        let damping = column * (at.terms.i.sqrt() / scale).max(LEAST_DAMPING);
        let Some(x) = damped_least_squares(rows, &residuals, n, damping) else { break };
        let mut next = patch.clone();
        for (i, c) in next.control_mut().iter_mut().enumerate() {
            for k in 0..4 {
                c[k] -= x[k * n / 4 + i];
            }
        }
        let Some(value) = objective.evaluate(&next) else { break };
        (patch, at) = (next, value);
        let root = at.terms.i.sqrt();
        since = if root < PROGRESS * best.1 { 0 } else { since + 1 };
        if root < best.1 {
            best = (patch.clone(), root);
        }
        if since >= PATIENCE || root <= ENOUGH * scale {
            break;
        }
    }
    best
}

/// The x with the least |A x − b|² + d² |x|², for A given by its rows of `n` numbers: Householder's QR of A above d times the identity.
fn damped_least_squares(rows: Vec<f64>, b: &[f64], n: usize, d: f64) -> Option<Vec<f64>> {
    let m = b.len() + n;
    // Column by column, so that reflections run along memory.
    let mut a = vec![0.0; m * (n + 1)];
    for (i, row) in rows.chunks(n).enumerate() {
        for (k, v) in row.iter().enumerate() {
            a[k * m + i] = *v;
        }
    }
    for k in 0..n {
        a[k * m + b.len() + k] = d;
    }
    a[n * m..n * m + b.len()].copy_from_slice(b);
    for k in 0..n {
        let (done, rest) = a.split_at_mut((k + 1) * m);
        let v = &mut done[k * m + k..];
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let alpha = if v[0] > 0.0 { -length } else { length };
        v[0] -= alpha;
        let norm2: f64 = v.iter().map(|x| x * x).sum();
        for column in rest.chunks_mut(m) {
            let c = &mut column[k..];
            let f = 2.0 * v.iter().zip(c.iter()).map(|(x, y)| x * y).sum::<f64>() / norm2;
            for (y, x) in c.iter_mut().zip(v.iter()) {
                *y -= f * x;
            }
        }
        // The diagonal of R; the reflection is no longer needed.
        v[0] = alpha;
    }
    let mut x: Vec<f64> = a[n * m..n * m + n].to_vec();
    for k in (0..n).rev() {
        x[k] /= a[k * m + k];
        for i in 0..k {
            x[i] -= a[k * m + i] * x[k];
        }
    }
    x.iter().all(|v| v.is_finite()).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_squares_solve_the_normal_equations() {
        let rows = vec![1.0, 2.0, 0.5, -1.0, 0.3, 2.0, 4.0, 1.0, 1.0, 0.0, 1.0, -1.0];
        let (b, d) = ([1.0, -2.0, 0.5, 3.0], 0.1);
        let x = damped_least_squares(rows.clone(), &b, 3, d).expect("a solution");
        for k in 0..3 {
            let g: f64 = rows.chunks(3).zip(&b).map(|(r, b)| r[k] * (r[0] * x[0] + r[1] * x[1] + r[2] * x[2] - b)).sum();
            assert!((g + d * d * x[k]).abs() < 1e-14);
        }
        assert_eq!(damped_least_squares(vec![0.0; 6], &[1.0, 1.0], 3, 0.0), None);
    }
}
