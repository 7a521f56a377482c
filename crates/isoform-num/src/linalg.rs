//! Solvers of small dense symmetric systems: n up to a few dozen, matrices row-major.

/// Replaces A (row-major n × n) by its lower Cholesky factor L, A = L Lᵀ. Returns `false` if A is
/// not positive definite to working precision; A is then partly overwritten.
///
/// ```
/// use isoform_num::linalg::{cholesky, cholesky_solve};
///
/// // 4 x + 2 y = 8, 2 x + 3 y = 8.
/// let mut a = [4.0, 2.0, 2.0, 3.0];
/// let mut x = [8.0, 8.0];
/// assert!(cholesky(&mut a, 2));
/// cholesky_solve(&a, 2, &mut x);
/// assert!((x[0] - 1.0).abs() < 1e-15 && (x[1] - 2.0).abs() < 1e-15);
/// ```
pub fn cholesky(a: &mut [f64], n: usize) -> bool {
    // Meanwhile Lᵀ is kept in the upper triangle: its rows are contiguous in memory.
    transpose(a, n);
    for j in 0..n {
        let (done, row) = a.split_at_mut(j * n);
        let row = &mut row[j..n];
        for above in done.chunks(n) {
            let f = above[j];
            for (x, y) in row.iter_mut().zip(&above[j..]) {
                *x -= f * y;
            }
        }
        if !(row[0] > 0.0 && row[0].is_finite()) {
            return false;
        }
        let d = row[0].sqrt();
        row[0] = d;
        row[1..].iter_mut().for_each(|x| *x /= d);
    }
    transpose(a, n);
    true
}

fn transpose(a: &mut [f64], n: usize) {
    for i in 0..n {
        for j in 0..i {
            a.swap(i * n + j, j * n + i);
        }
    }
}

/// Solves L Lᵀ x = b for a factor L from [`cholesky`]; x replaces b.
pub fn cholesky_solve(l: &[f64], n: usize, b: &mut [f64]) {
    for i in 0..n {
        let mut s = b[i];
        for k in 0..i {
            s -= l[i * n + k] * b[k];
        }
        b[i] = s / l[i * n + i];
    }
    for i in (0..n).rev() {
        let mut s = b[i];
        for k in i + 1..n {
            s -= l[k * n + i] * b[k];
        }
        b[i] = s / l[i * n + i];
    }
}

/// Solves A x = b for a symmetric positive definite band matrix by Cholesky's method; x replaces b.
/// Row i of `a` holds the entries of columns i to i + `band`, with 0 beyond the last column, and is
/// overwritten. Returns `false` if A is not positive definite to working precision.
///
/// ```
/// use isoform_num::linalg::banded_solve;
///
/// // 4 x + 2 y = 8, 2 x + 3 y = 8.
/// let mut x = [8.0, 8.0];
/// assert!(banded_solve(&mut [4.0, 2.0, 3.0, 0.0], 1, &mut x));
/// assert!((x[0] - 1.0).abs() < 1e-15 && (x[1] - 2.0).abs() < 1e-15);
/// ```
pub fn banded_solve(a: &mut [f64], band: usize, b: &mut [f64]) -> bool {
    let (n, width) = (b.len(), band + 1);
    for i in 0..n {
        let (done, below) = a.split_at_mut((i + 1) * width);
        let row = &mut done[i * width..];
        if !(row[0] > 0.0 && row[0].is_finite()) {
            return false;
        }
        let d = row[0].sqrt();
        row.iter_mut().for_each(|v| *v /= d);
        for (k, &f) in row.iter().enumerate().skip(1).take(n - 1 - i) {
            if f != 0.0 {
                let other = &mut below[(k - 1) * width..][..width - k];
                for (x, y) in other.iter_mut().zip(&row[k..]) {
                    *x -= f * y;
                }
            }
        }
    }
    for i in 0..n {
        let row = &a[i * width..][..width];
        b[i] /= row[0];
        let value = b[i];
        for (x, f) in b[i + 1..].iter_mut().zip(&row[1..]) {
            *x -= f * value;
        }
    }
    for i in (0..n).rev() {
        let row = &a[i * width..][..width];
        let known: f64 = b[i + 1..].iter().zip(&row[1..]).map(|(x, f)| x * f).sum();
        b[i] = (b[i] - known) / row[0];
    }
    true
}

/// Returns the eigenvalues, ascending, and the eigenvectors (row k of the second result belongs to
/// eigenvalue k) of a symmetric matrix, by cyclic Jacobi rotations: slow for large n, but accurate
/// to the last digits also for tiny eigenvalues of graded matrices.
///
/// ```
/// let (values, vectors) = isoform_num::linalg::symmetric_eigen(&[2.0, 1.0, 1.0, 2.0], 2);
/// assert!((values[0] - 1.0).abs() < 1e-15 && (values[1] - 3.0).abs() < 1e-15);
/// assert!((vectors[0] + vectors[1]).abs() < 1e-15, "(1, −1) belongs to 1");
/// ```
pub fn symmetric_eigen(a: &[f64], n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut a = a.to_vec();
    let mut v = vec![0.0; n * n];
    diagonalize(&mut a, &mut v, n);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&i, &j| a[i * n + i].total_cmp(&a[j * n + j]));
    let values = order.iter().map(|&i| a[i * n + i]).collect();
    let vectors = order
        .iter()
        .flat_map(|&i| (0..n).map(|k| v[k * n + i]).collect::<Vec<_>>())
        .collect();
    (values, vectors)
}

/// Returns the eigenvalues and eigenvectors of a 3 × 3 matrix: those of [`symmetric_eigen`], in a
/// third of the time.
///
/// ```
/// use isoform_num::linalg::symmetric_eigen_3;
///
/// let (values, vectors) = symmetric_eigen_3(&[[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 3.0]]);
/// assert_eq!(values, [1.0, 2.0, 3.0]);
/// assert_eq!(vectors[0], [0.0, 1.0, 0.0]);
/// ```
pub fn symmetric_eigen_3(a: &[[f64; 3]; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let (mut a, mut v) = (*a, [[0.0; 3]; 3]);
    diagonalize(a.as_flattened_mut(), v.as_flattened_mut(), 3);
    let mut order = [0, 1, 2];
    order.sort_by(|&i: &usize, &j| a[i][i].total_cmp(&a[j][j]));
    (order.map(|i| a[i][i]), order.map(|i| v.map(|row| row[i])))
}

/// Replaces a symmetric matrix `a` by the diagonal matrix of its eigenvalues and `v`, zero before,
/// by the matrix whose columns are its eigenvectors.
#[inline(always)]
fn diagonalize(a: &mut [f64], v: &mut [f64], n: usize) {
    for i in 0..n {
        v[i * n + i] = 1.0;
    }
    // Convergence is quadratic once the off-diagonal entries are small; the bound of 60 sweeps is
    // not reached in practice.
    for _ in 0..60 {
        let off: f64 = (0..n)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .map(|(i, j)| a[i * n + j] * a[i * n + j])
            .sum();
        let diagonal: f64 = (0..n).map(|i| a[i * n + i] * a[i * n + i]).sum();
        if off <= 1e-32 * diagonal || off == 0.0 || !off.is_finite() {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                rotate(a, v, n, p, q);
            }
        }
    }
}

/// Applies the Jacobi rotation that makes a\[p\]\[q\] zero.
#[inline(always)]
fn rotate(a: &mut [f64], v: &mut [f64], n: usize, p: usize, q: usize) {
    let apq = a[p * n + q];
    if apq == 0.0 {
        return;
    }
    let rotation = Rotation::diagonalizing(a[p * n + p], a[q * n + q], apq);
    for row in a.chunks_mut(n) {
        (row[p], row[q]) = rotation.rotate(row[p], row[q]);
    }
    let (low, high) = a.split_at_mut(q * n);
    rotation.apply(&mut low[p * n..][..n], &mut high[..n]);
    for row in v.chunks_mut(n) {
        (row[p], row[q]) = rotation.rotate(row[p], row[q]);
    }
}

/// Rotation of the plane by an angle of at most 45°.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rotation {
    cos: f64,
    sin: f64,
}

impl Rotation {
    /// Returns the Jacobi rotation that makes \[\[pp, pq\], \[pq, qq\]\] diagonal, pq ≠ 0: with ζ =
    /// cot 2φ = (qq − pp)/(2 pq), t = tan φ is the smaller root of t² + 2 ζ t = 1.
    #[inline]
    pub(crate) fn diagonalizing(pp: f64, qq: f64, pq: f64) -> Self {
        let zeta = (qq - pp) / (2.0 * pq);
        let sign = if zeta >= 0.0 { 1.0 } else { -1.0 };
        let t = sign / (zeta.abs() + (zeta * zeta + 1.0).sqrt());
        let cos = 1.0 / (t * t + 1.0).sqrt();
        Self { cos, sin: t * cos }
    }

    /// Rotates the point (x, y).
    #[inline]
    fn rotate(self, x: f64, y: f64) -> (f64, f64) {
        (self.cos * x - self.sin * y, self.sin * x + self.cos * y)
    }

    /// Rotates the pairs (xₖ, yₖ) of the components of two vectors.
    #[inline]
    pub(crate) fn apply(self, x: &mut [f64], y: &mut [f64]) {
        for (x, y) in x.iter_mut().zip(y) {
            (*x, *y) = self.rotate(*x, *y);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hilbert(n: usize) -> Vec<f64> {
        (0..n * n)
            .map(|k| 1.0 / (k / n + k % n + 1) as f64)
            .collect()
    }

    #[test]
    fn matrices_of_three_rows_have_the_vectors_of_any() {
        let a = [[4.0, 1.0, -2.0], [1.0, 3.0, 0.5], [-2.0, 0.5, 5.0]];
        let (values, vectors) = symmetric_eigen_3(&a);
        let (same, of_any) = symmetric_eigen(a.as_flattened(), 3);
        assert_eq!(values.as_slice(), same);
        assert_eq!(vectors.as_flattened(), of_any);
        for (value, v) in values.iter().zip(vectors) {
            for (row, x) in a.iter().zip(v) {
                let product: f64 = row.iter().zip(v).map(|(a, x)| a * x).sum();
                assert!((product - value * x).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn cholesky_solves_what_was_multiplied() {
        let n = 6;
        let a = hilbert(n);
        let x: Vec<f64> = (0..n).map(|i| i as f64 - 2.5).collect();
        let mut b: Vec<f64> = (0..n)
            .map(|i| (0..n).map(|j| a[i * n + j] * x[j]).sum())
            .collect();
        let mut l = a;
        assert!(cholesky(&mut l, n));
        cholesky_solve(&l, n, &mut b);
        for (u, v) in b.iter().zip(&x) {
            assert!((u - v).abs() < 1e-8, "{u} against {v}");
        }
    }

    #[test]
    fn a_band_is_solved_as_the_whole_matrix() {
        let (n, band) = (9, 3);
        let entry = |i: usize, j: usize| match i.abs_diff(j) {
            0 => 4.0 + i as f64,
            d if d <= band => 1.0 / (1.0 + (d + i.min(j)) as f64),
            _ => 0.0,
        };
        let mut whole: Vec<f64> = (0..n * n).map(|k| entry(k / n, k % n)).collect();
        let mut narrow: Vec<f64> = (0..n * (band + 1))
            .map(|k| (k / (band + 1), k / (band + 1) + k % (band + 1)))
            .map(|(i, j)| if j < n { entry(i, j) } else { 0.0 })
            .collect();
        let mut x: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
        let mut expected = x.clone();
        assert!(cholesky(&mut whole, n));
        cholesky_solve(&whole, n, &mut expected);
        assert!(banded_solve(&mut narrow, band, &mut x));
        assert!(x.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-15));
        assert!(!banded_solve(&mut [1.0, 2.0, 1.0, 0.0], 1, &mut [0.0; 2]));
    }

    #[test]
    fn cholesky_refuses_an_indefinite_matrix() {
        assert!(!cholesky(&mut [1.0, 2.0, 2.0, 1.0], 2));
    }

    #[test]
    fn eigenvectors_rebuild_the_matrix() {
        let n = 7;
        let a = hilbert(n);
        let (w, v) = symmetric_eigen(&a, n);
        for i in 0..n {
            for j in 0..n {
                let sum: f64 = (0..n).map(|k| w[k] * v[k * n + i] * v[k * n + j]).sum();
                assert!((sum - a[i * n + j]).abs() < 1e-14);
            }
        }
        // The determinant of the 7 × 7 Hilbert matrix in closed form.
        let det: f64 = w.iter().product();
        assert!(
            (det / 4.835_802_623_926_117e-25 - 1.0).abs() < 1e-6,
            "{det:e}"
        );
    }
}
