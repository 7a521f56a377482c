//! Null vectors of matrices with many rows, by Hestenes' one-sided Jacobi method: the columns of
//! the matrix are rotated until they are orthogonal. The normal equations would square the small
//! singular values and lose half of the digits.

/// Returns the unit vector a with a·m = 0 for all rows m if it is unique up to sign, else `None`;
/// singular values of at most `zero` times the largest count as 0.
pub(crate) fn null<const N: usize>(mut rows: Vec<[f64; N]>, zero: f64) -> Option<[f64; N]> {
    let mut v: [[f64; N]; N] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    // About ten sweeps suffice.
    for _ in 0..40 {
        if !sweep(&mut rows, &mut v) {
            break;
        }
    }
    let sizes: [f64; N] =
        std::array::from_fn(|k| rows.iter().map(|r| r[k] * r[k]).sum::<f64>().sqrt());
    let most = sizes.iter().fold(0.0f64, |m, v| m.max(*v));
    let small: Vec<usize> = (0..N).filter(|&k| sizes[k] <= zero * most).collect();
    match small.as_slice() {
        &[k] => Some(std::array::from_fn(|i| v[i][k])),
        _ => None,
    }
}

/// Makes each pair of columns orthogonal in turn and applies the rotations to v as well; returns
/// true if any pair was not orthogonal.
fn sweep<const N: usize>(rows: &mut [[f64; N]], v: &mut [[f64; N]; N]) -> bool {
    let mut rotated = false;
    for p in 0..N {
        for q in p + 1..N {
            let Some((c, s)) = rotation(rows, p, q) else {
                continue;
            };
            rotated = true;
            for r in rows.iter_mut().chain(v.iter_mut()) {
                (r[p], r[q]) = (c * r[p] - s * r[q], s * r[p] + c * r[q]);
            }
        }
    }
    rotated
}

/// Returns the cosine and sine of the rotation that makes two columns orthogonal; `None` if they
/// are.
fn rotation<const N: usize>(rows: &[[f64; N]], p: usize, q: usize) -> Option<(f64, f64)> {
    let (mut pp, mut qq, mut pq) = (0.0, 0.0, 0.0);
    for r in rows {
        (pp, qq, pq) = (pp + r[p] * r[p], qq + r[q] * r[q], pq + r[p] * r[q]);
    }
    // Cosines below this are rounding errors.
    if pq.abs() <= 1e-15 * (pp * qq).sqrt() {
        return None;
    }
    let zeta = (qq - pp) / (2.0 * pq);
    let t = if zeta >= 0.0 { 1.0 } else { -1.0 } / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
    let c = 1.0 / (1.0 + t * t).sqrt();
    Some((c, c * t))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows orthogonal to (2, −1, 2)/3 only; rows that span space; and parallel rows, to which more
    /// than one vector is orthogonal.
    #[test]
    fn null_vectors_are_found() {
        let rows = vec![[1.0, 2.0, 0.0], [0.0, 2.0, 1.0], [1.0, 4.0, 1.0]];
        let a = null(rows, 1e-13).expect("a null vector");
        let sign = a[0].signum();
        for (a, want) in a.into_iter().zip([2.0, -1.0, 2.0]) {
            assert!((sign * a - want / 3.0).abs() < 1e-14);
        }
        let all = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(null(all, 1e-13), None);
        assert_eq!(null(vec![[1.0, 0.0, 0.0]; 4], 1e-13), None);
    }
}
