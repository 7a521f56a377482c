//! Singular value decomposition of small matrices, with high relative accuracy.
//!
//! One-sided Jacobi rotations (M. R. Hestenes, J. SIAM 6, 1958): the columns of A are rotated in
//! pairs until all are orthogonal; A V = U Σ then has the columns uₖ σₖ, and V is the product of
//! the rotations. The matrix AᵀA is never formed: it would square the singular values, and half of
//! the digits of small ones would be lost.

use crate::linalg::Rotation;

/// Largest cosine of the angle of two columns that count as orthogonal: a few ulps. Rounding would
/// keep a smaller bound from being met; a larger one costs digits of small singular values.
const ORTHOGONALITY_TOLERANCE: f64 = 1e-15;
/// Maximum number of sweeps over all pairs of columns. Some ten are needed.
const MAX_SWEEPS: usize = 40;

/// Singular value decomposition A = U Σ Vᵀ of a matrix with N columns.
///
/// ```
/// use isoform_num::Svd;
///
/// // The columns (3, 4) and (0, 5): σ₁ σ₂ = |det A| = 15 and σ₁² + σ₂² = |A|² = 50.
/// let svd = Svd::new([[3.0, 4.0], [0.0, 5.0]]);
/// assert!((svd.values[0] - 45f64.sqrt()).abs() < 1e-14);
/// assert!((svd.values[1] - 5f64.sqrt()).abs() < 1e-14);
/// ```
#[derive(Clone, Debug)]
pub struct Svd<C, const N: usize> {
    /// Singular values σ₁ ≥ σ₂ ≥ … ≥ 0.
    pub values: [f64; N],
    /// Right singular vectors v₁, v₂, …, of length 1.
    pub right: [[f64; N]; N],
    /// Images A vₖ = σₖ uₖ of the right singular vectors.
    pub images: [C; N],
}

impl<C: AsRef<[f64]> + AsMut<[f64]> + Default, const N: usize> Svd<C, N> {
    /// Decomposes the matrix with these columns, arrays or vectors of equal length. Entries that
    /// are not finite give singular values that are not finite.
    #[must_use]
    pub fn new(mut columns: [C; N]) -> Self {
        let mut right: [[f64; N]; N] =
            std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
        for _ in 0..MAX_SWEEPS {
            if !sweep(&mut columns, &mut right) {
                break;
            }
        }
        let sizes: [f64; N] = std::array::from_fn(|k| {
            let squares = columns[k].as_ref().iter().map(|x| x * x);
            squares.sum::<f64>().sqrt()
        });
        let mut order: [usize; N] = std::array::from_fn(|k| k);
        order.sort_by(|&i, &j| sizes[j].total_cmp(&sizes[i]));
        Self {
            values: order.map(|k| sizes[k]),
            right: order.map(|k| right[k]),
            images: order.map(|k| std::mem::take(&mut columns[k])),
        }
    }

    /// Returns the component uₖ·b of a right-hand side b along the k-th left singular vector; 0 if
    /// σₖ = 0. The least-squares solution of A x = b is the sum of (uₖ·b / σₖ) vₖ.
    #[must_use]
    pub fn along(&self, k: usize, b: &[f64]) -> f64 {
        if self.values[k] > 0.0 {
            let products = self.images[k].as_ref().iter().zip(b).map(|(x, y)| x * y);
            products.sum::<f64>() / self.values[k]
        } else {
            0.0
        }
    }
}

/// Rotates every pair of columns that is not orthogonal, and the rows of `right` with them. Returns
/// true if there was such a pair.
fn sweep<C: AsRef<[f64]> + AsMut<[f64]>, const N: usize>(
    columns: &mut [C; N],
    right: &mut [[f64; N]; N],
) -> bool {
    let mut rotated = false;
    for p in 0..N {
        for q in p + 1..N {
            let (mut pp, mut qq, mut pq) = (0.0, 0.0, 0.0);
            for (x, y) in columns[p].as_ref().iter().zip(columns[q].as_ref()) {
                (pp, qq, pq) = (pp + x * x, qq + y * y, pq + x * y);
            }
            if pq.abs() <= ORTHOGONALITY_TOLERANCE * (pp * qq).sqrt() {
                continue;
            }
            rotated = true;
            let rotation = Rotation::diagonalizing(pp, qq, pq);
            let (low, high) = columns.split_at_mut(q);
            rotation.apply(low[p].as_mut(), high[0].as_mut());
            let (low, high) = right.split_at_mut(q);
            rotation.apply(&mut low[p], &mut high[0]);
        }
    }
    rotated
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Random;

    fn random_columns(random: &mut Random) -> [[f64; 5]; 4] {
        std::array::from_fn(|_| std::array::from_fn(|_| random.symmetric()))
    }

    /// A vₖ = σₖ uₖ with V orthogonal; uₖ·A vₗ = σₖ δₖₗ.
    #[test]
    fn factors_rebuild_the_matrix() {
        let mut random = Random::new(3);
        for _ in 0..50 {
            let a = random_columns(&mut random);
            let svd = Svd::new(a);
            for k in 0..4 {
                for i in 0..5 {
                    let image: f64 = (0..4).map(|j| a[j][i] * svd.right[k][j]).sum();
                    assert!((image - svd.images[k][i]).abs() < 1e-14);
                }
                for l in 0..4 {
                    let product: f64 = (0..4).map(|j| svd.right[k][j] * svd.right[l][j]).sum();
                    let expected = f64::from(u8::from(k == l));
                    assert!((product - expected).abs() < 1e-14);
                    let along = svd.along(k, &svd.images[l]);
                    assert!((along - expected * svd.values[k]).abs() < 1e-14);
                }
            }
            assert!(svd.values.windows(2).all(|w| w[0] >= w[1]));
        }
    }

    /// The values of [[1, 1], [0, 10⁻²⁰]] have the product 10⁻²⁰, which moments would lose.
    #[test]
    fn small_values_keep_their_digits() {
        let svd = Svd::new([vec![1.0, 0.0], vec![1.0, 1e-20]]);
        assert!((svd.values[0] * svd.values[1] / 1e-20 - 1.0).abs() < 1e-14);
    }

    /// The vector (1, −2, 1) is the kernel of rows in arithmetic progression.
    #[test]
    fn the_kernel_of_a_singular_matrix() {
        let svd = Svd::new([[1.0, 4.0, 7.0], [2.0, 5.0, 8.0], [3.0, 6.0, 9.0]]);
        assert!(svd.values[2] < 1e-14 && svd.values[1] > 1.0);
        let v = svd.right[2].map(|x| x / svd.right[2][0]);
        assert!((v[1] + 2.0).abs() < 1e-13 && (v[2] - 1.0).abs() < 1e-13);
    }

    #[test]
    fn a_zero_column_has_the_value_zero() {
        let svd = Svd::new([[0.0, 0.0], [3.0, 4.0]]);
        assert_eq!(svd.values, [5.0, 0.0]);
        assert_eq!(svd.along(1, &[1.0, 1.0]), 0.0);
    }
}
