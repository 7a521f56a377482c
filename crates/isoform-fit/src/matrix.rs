//! Dense square matrices, row-major.

use isoform_num::linalg::{cholesky, cholesky_solve};

/// Returns true if h + floor I is positive definite.
pub(crate) fn is_positive(h: &[f64], m: usize, floor: f64) -> bool {
    let mut l = h.to_vec();
    (0..m).for_each(|i| l[i * m + i] += floor);
    cholesky(&mut l, m)
}

/// Inverts h + floor I without the held rows (those are zero). The floor is raised until the matrix
/// is positive definite.
pub(crate) fn inverse(h: &[f64], m: usize, held: &[bool], floor: f64) -> Vec<f64> {
    let free: Vec<usize> = (0..m).filter(|&i| !held[i]).collect();
    let k = free.len();
    let l = factor(h, m, &free, floor.max(f64::MIN_POSITIVE));
    let mut out = vec![0.0; m * m];
    for (c, &j) in free.iter().enumerate() {
        let mut e = vec![0.0; k];
        e[c] = 1.0;
        cholesky_solve(&l, k, &mut e);
        for (r, &i) in free.iter().enumerate() {
            out[i * m + j] = e[r];
        }
    }
    out
}

/// Factors the free rows and columns of h, with the least floor that allows it.
fn factor(h: &[f64], m: usize, free: &[usize], mut floor: f64) -> Vec<f64> {
    let k = free.len();
    let mut l = vec![0.0; k * k];
    loop {
        for (r, &i) in free.iter().enumerate() {
            for (c, &j) in free.iter().enumerate() {
                l[r * k + c] = h[i * m + j];
            }
            l[r * k + r] += floor;
        }
        if cholesky(&mut l, k) || !floor.is_finite() {
            return l;
        }
        floor *= 10.0;
    }
}

/// Multiplies two matrices with m rows and columns.
pub(crate) fn product(a: &[f64], b: &[f64], m: usize) -> Vec<f64> {
    let mut c = vec![0.0; m * m];
    for i in 0..m {
        for k in 0..m {
            for j in 0..m {
                c[i * m + j] += a[i * m + k] * b[k * m + j];
            }
        }
    }
    c
}

/// Returns the largest diagonal element of a matrix with m rows.
pub(crate) fn largest(h: &[f64], m: usize) -> f64 {
    (0..m).map(|i| h[i * m + i]).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn held_rows_are_left_out_of_an_inverse() {
        let h = [4.0, 1.0, 0.0, 1.0, 9.0, 0.0, 0.0, 0.0, 2.0];
        let c = inverse(&h, 3, &[false, true, false], 0.0);
        let expected = [0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5];
        assert!(crate::vector::distance(&c, &expected) < 1e-15);
        let all = inverse(&h, 3, &[false; 3], 0.0);
        let one = product(&h, &all, 3);
        assert!((0..9).all(|k| (one[k] - if k % 4 == 0 { 1.0 } else { 0.0 }).abs() < 1e-15));
    }
}
