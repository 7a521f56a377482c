//! Damped least squares by Householder's QR factorisation: normal equations would square the small
//! singular values that matter.

/// Returns the x that minimises |A x − b|² + d² |x|², for A given by its rows of `n` numbers, by
/// Householder's QR factorisation of A above d times the identity; `None` if a column vanishes or a
/// number is not finite.
pub(crate) fn damped_least_squares(
    rows: Vec<f64>,
    b: &[f64],
    n: usize,
    d: f64,
) -> Option<Vec<f64>> {
    let m = b.len() + n;
    let mut a = columns(&rows, b, n, d);
    for k in 0..n {
        let (done, rest) = a.split_at_mut((k + 1) * m);
        reflect(&mut done[k * m + k..], rest, k, m)?;
    }
    let x = back_substituted(&a, n, m);
    x.iter().all(|v| v.is_finite()).then_some(x)
}

/// Returns A above d times the identity, and b above zeros, in column-major order, so that
/// reflections access memory in sequence.
fn columns(rows: &[f64], b: &[f64], n: usize, d: f64) -> Vec<f64> {
    let m = b.len() + n;
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
    a
}

/// Applies to the columns after column k the reflection that maps column k, from its diagonal on,
/// to a multiple of the first unit vector. The diagonal entry of R overwrites the first entry of
/// the reflection vector.
fn reflect(v: &mut [f64], rest: &mut [f64], k: usize, m: usize) -> Option<()> {
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
    v[0] = alpha;
    Some(())
}

/// Solves R x = c for R and c in columns of m numbers.
fn back_substituted(a: &[f64], n: usize, m: usize) -> Vec<f64> {
    let mut x: Vec<f64> = a[n * m..n * m + n].to_vec();
    for k in (0..n).rev() {
        x[k] /= a[k * m + k];
        for i in 0..k {
            x[i] -= a[k * m + i] * x[k];
        }
    }
    x
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
            let g: f64 = rows
                .chunks(3)
                .zip(&b)
                .map(|(r, b)| r[k] * (r[0] * x[0] + r[1] * x[1] + r[2] * x[2] - b))
                .sum();
            assert!((g + d * d * x[k]).abs() < 1e-14);
        }
        assert_eq!(
            damped_least_squares(vec![0.0; 6], &[1.0, 1.0], 3, 0.0),
            None
        );
    }
}
