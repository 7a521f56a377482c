//! Products of three polynomials of degree (m, n) in the Bernstein basis.

use crate::MAX_PATCH_DEGREE;
use crate::compose::binomial;
use crate::sized::{chunk, sized};

/// Tables for products of polynomials of degree (m, n).
pub(super) struct Products {
    degree: (usize, usize),
    /// Coefficients for products of two, in u and in v.
    two: [Shares; 2],
    /// Coefficients for products of a product of two with a third, in u and in v.
    three: [Shares; 2],
}

/// Factors by (i, k) with which bᵢ cₖ enters coefficient i + k of a product.
type Shares = Vec<Vec<f64>>;

/// Four numbers per control point: a polynomial's four coordinates, or a product of two with each
/// of four.
type Four = [f64; 4];

/// Products of two: a·b for four b, and the square of the last coordinate of a.
struct Pairs {
    products: Vec<Four>,
    squares: Vec<f64>,
}

/// Returns the factors for degrees l and n.
fn shares(l: usize, n: usize) -> Shares {
    let share = |i: usize, k: usize| binomial(l, i) * binomial(n, k) / binomial(l + n, i + k);
    (0..=l)
        .map(|i| (0..=n).map(|k| share(i, k)).collect())
        .collect()
}

/// Returns Σ pₖ qₖ at one index of four rows, in a fixed order of summation.
#[inline(always)]
fn product<const N: usize>(p: &Four, q: [&[f64; N]; 4], at: usize) -> f64 {
    p[0] * q[0][at] + p[1] * q[1][at] + (p[2] * q[2][at] + p[3] * q[3][at])
}

impl Products {
    pub(super) fn new(degree: (usize, usize)) -> Self {
        let (m, n) = degree;
        Self {
            degree,
            two: [shares(m, m), shares(n, n)],
            three: [shares(2 * m, m), shares(2 * n, n)],
        }
    }

    /// Returns the number of roundings of a coefficient, in units of ε times the sum of its terms:
    /// half a unit for each operation of the terms and of their sum, in both products, and as many
    /// for w³.
    pub(super) fn roundings(&self) -> f64 {
        let (m, n) = self.degree;
        (48 + 2 * (m + 1) * (n + 1)) as f64
    }

    /// Returns the coefficients of Σₖ aₖ Σᵢ aᵢ bᵢₖ, of degree (3m, 3n), each with the coefficient
    /// of the cube of the last coordinate of a: `a[c][k]` is coefficient c of aₖ, `b[c][i][k]` that
    /// of bᵢₖ.
    pub(super) fn triple(&self, a: &[Four], b: &[[Four; 4]]) -> Vec<[f64; 2]> {
        sums(self, a, b)
    }

    #[inline(always)]
    fn pairs(&self, a: &[Four], b: &[[Four; 4]]) -> Pairs {
        let (m, n) = self.degree;
        let size = (2 * m + 1) * (2 * n + 1);
        let (mut products, mut squares) = (vec![[0.0; 4]; size], vec![0.0; size]);
        let places = a.iter().zip(0..);
        for (p, i, j) in places.map(|(p, at)| (p, at / (n + 1), at % (n + 1))) {
            for k in 0..=m {
                let (fu, fv) = (self.two[0][i][k], &self.two[1][j]);
                let start = (i + k) * (2 * n + 1) + j;
                let (products, squares) = (&mut products[start..], &mut squares[start..]);
                let (a, b) = (&a[k * (n + 1)..][..n + 1], &b[k * (n + 1)..][..n + 1]);
                for l in 0..=n {
                    let (f, [q0, q1, q2, q3]) = (fu * fv[l], &b[l]);
                    let out = &mut products[l];
                    for at in 0..4 {
                        out[at] += f * product(p, [q0, q1, q2, q3], at);
                    }
                    squares[l] += f * p[3] * a[l][3];
                }
            }
        }
        Pairs { products, squares }
    }
}

isoform_num::dispatch! {
    /// See [`Products::triple`].
    fn sums(products: &Products, a: &[Four], b: &[[Four; 4]]) -> Vec<[f64; 2]> = sums_body
}

#[inline(always)]
fn sums_body(products: &Products, a: &[Four], b: &[[Four; 4]]) -> Vec<[f64; 2]> {
    let two = products.pairs(a, b);
    // Patches from files may have any degree.
    let count = products.degree.1 + 1;
    let count = if count <= MAX_PATCH_DEGREE + 1 {
        count
    } else {
        1
    };
    sized!(count, times_one_more(products, &two, a))
}

/// Multiplies pairs by one more polynomial, for N coefficients in v at a time.
#[inline(always)]
fn times_one_more<const N: usize>(products: &Products, two: &Pairs, a: &[Four]) -> Vec<[f64; 2]> {
    let (m, n) = products.degree;
    let size = (3 * m + 1) * (3 * n + 1);
    let (mut sums, mut cubes) = (vec![0.0; size], vec![0.0; size]);
    // Rows by coordinate instead of by control point.
    let row = |k: usize| -> Vec<f64> { a.iter().map(|p| p[k]).collect() };
    let [q0, q1, q2, q3] = [row(0), row(1), row(2), row(3)];
    for (at, (p, square)) in two.products.iter().zip(&two.squares).enumerate() {
        let (i, j) = (at / (2 * n + 1), at % (2 * n + 1));
        for (k, fu) in products.three[0][i].iter().enumerate() {
            for l in (0..=n).step_by(N) {
                let fv: &[f64; N] = chunk(&products.three[1][j][l..]);
                let (from, to) = (k * (n + 1) + l, (i + k) * (3 * n + 1) + j + l);
                let q: [&[f64; N]; 4] = [
                    chunk(&q0[from..]),
                    chunk(&q1[from..]),
                    chunk(&q2[from..]),
                    chunk(&q3[from..]),
                ];
                // Copies tell the compiler that writing sums does not change the values that are
                // read.
                let mut sum: [f64; N] = *chunk(&sums[to..]);
                let mut cube: [f64; N] = *chunk(&cubes[to..]);
                for l in 0..N {
                    sum[l] += fu * fv[l] * product(p, q, l);
                    cube[l] += fu * fv[l] * square * q[3][l];
                }
                sums[to..to + N].copy_from_slice(&sum);
                cubes[to..to + N].copy_from_slice(&cube);
            }
        }
    }
    sums.into_iter()
        .zip(cubes)
        .map(|(sum, cube)| [sum, cube])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Degrees that patches here have, and one that only patches from files have.
    #[test]
    fn products_are_products() {
        for degree in [(2, 1), (1, 3), (3, 8), (1, 10)] {
            products_are_right(degree);
        }
    }

    fn products_are_right((m, n): (usize, usize)) {
        let products = Products::new((m, n));
        let list = |seed: f64| -> Vec<[f64; 4]> {
            (0..(m + 1) * (n + 1))
                .map(|i| std::array::from_fn(|k| (seed + i as f64 * 1.3 + k as f64).sin()))
                .collect()
        };
        let a = list(0.2);
        let value = |c: &dyn Fn(usize) -> f64, m: usize, n: usize| {
            let (bu, bv) = (
                isoform_geom::bernstein(m, 0.3).0,
                isoform_geom::bernstein(n, 0.8).0,
            );
            (0..=m)
                .map(|i| {
                    (0..=n)
                        .map(|j| bu[i] * bv[j] * c(i * (n + 1) + j))
                        .sum::<f64>()
                })
                .sum::<f64>()
        };
        // Four lists from other seeds.
        let all: Vec<[[f64; 4]; 4]> = (0..a.len())
            .map(|i| [0.9, 0.4, 2.1, 3.3].map(|seed| list(seed)[i]))
            .collect();
        let product = products.triple(&a, &all);
        let of_a = |k: usize| value(&|i| a[i][k], m, n);
        let want: f64 = (0..4)
            .map(|k| {
                let scalar = |l: usize| of_a(l) * value(&|i| all[i][l][k], m, n);
                of_a(k) * (0..4).map(scalar).sum::<f64>()
            })
            .sum();
        let got = |k: usize| value(&|i| product[i][k], 3 * m, 3 * n);
        assert!((got(0) - want).abs() < 1e-14, "({m}, {n})");
        assert!((got(1) - of_a(3).powi(3)).abs() < 1e-14, "({m}, {n})");
    }
}
