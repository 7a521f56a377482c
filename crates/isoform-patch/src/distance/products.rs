//! Products of three polynomials of degree (m, n), by Bernstein coefficients.

use crate::compose::binomial;

/// Tables for products of polynomials of degree (m, n).
pub(super) struct Products {
    degree: (usize, usize),
    /// For products of two, in u and in v.
    two: [Shares; 2],
    /// For products of such a product with one more.
    three: [Shares; 2],
}

/// By (i, k): what bᵢ cₖ adds to coefficient i + k of a product.
type Shares = Vec<Vec<f64>>;

/// A product of two with each of four, and the square of the last.
type Pair = [f64; 5];

/// The shares for degrees l and n.
fn shares(l: usize, n: usize) -> Shares {
    let share = |i: usize, k: usize| binomial(l, i) * binomial(n, k) / binomial(l + n, i + k);
    (0..=l)
        .map(|i| (0..=n).map(|k| share(i, k)).collect())
        .collect()
}

/// a·b, in the order in which it is rounded.
#[inline(always)]
fn product(a: &[f64], b: &[f64; 4]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + (a[2] * b[2] + a[3] * b[3])
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

    /// Roundings of a coefficient, in units of ε times the sum of its terms: half a unit for each
    /// operation of the terms and of their sum, in both products, and as many for w³.
    pub(super) fn roundings(&self) -> f64 {
        let (m, n) = self.degree;
        (48 + 2 * (m + 1) * (n + 1)) as f64
    }

    /// The coefficients of Σₖ aₖ (a·bₖ) for the four polynomials aₖ and four times four bₖ, of
    /// degree (3m, 3n), each with that of the cube of the last of a.
    pub(super) fn of(&self, a: &[[f64; 4]], b: &[[[f64; 4]; 4]]) -> Vec<[f64; 2]> {
        self.times_one_more(&self.pairs(a, b), a)
    }

    /// a·bₖ and the square of the last of a.
    fn pairs(&self, a: &[[f64; 4]], b: &[[[f64; 4]; 4]]) -> Vec<Pair> {
        let (m, n) = self.degree;
        let mut two = vec![[0.0; 5]; (2 * m + 1) * (2 * n + 1)];
        let places = a.iter().zip(0..);
        for (p, i, j) in places.map(|(p, at)| (p, at / (n + 1), at % (n + 1))) {
            for k in 0..=m {
                let (fu, fv) = (self.two[0][i][k], &self.two[1][j]);
                let row = &mut two[(i + k) * (2 * n + 1) + j..][..n + 1];
                let (a, b) = (&a[k * (n + 1)..][..n + 1], &b[k * (n + 1)..][..n + 1]);
                for l in 0..=n {
                    let (f, q) = (fu * fv[l], &b[l]);
                    for (out, q) in row[l].iter_mut().zip(q) {
                        *out += f * product(p, q);
                    }
                    row[l][4] += f * p[3] * a[l][3];
                }
            }
        }
        two
    }

    fn times_one_more(&self, two: &[Pair], a: &[[f64; 4]]) -> Vec<[f64; 2]> {
        let (m, n) = self.degree;
        let mut three = vec![[0.0; 2]; (3 * m + 1) * (3 * n + 1)];
        let places = two.iter().zip(0..);
        for (p, i, j) in places.map(|(p, at)| (p, at / (2 * n + 1), at % (2 * n + 1))) {
            for k in 0..=m {
                let (fu, fv) = (self.three[0][i][k], &self.three[1][j]);
                let row = &mut three[(i + k) * (3 * n + 1) + j..][..n + 1];
                for (l, q) in a[k * (n + 1)..][..n + 1].iter().enumerate() {
                    let f = fu * fv[l];
                    row[l][0] += f * product(p, q);
                    row[l][1] += f * p[4] * q[3];
                }
            }
        }
        three
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_products() {
        let products = Products::new((2, 1));
        let list = |seed: f64| -> Vec<[f64; 4]> {
            (0..6)
                .map(|i| std::array::from_fn(|k| (seed + f64::from(i) * 1.3 + k as f64).sin()))
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
        // Four times the same list with other seeds.
        let all: Vec<[[f64; 4]; 4]> = (0..6)
            .map(|i| [0.9, 0.4, 2.1, 3.3].map(|seed| list(seed)[i]))
            .collect();
        let product = products.of(&a, &all);
        let of_a = |k: usize| value(&|i| a[i][k], 2, 1);
        let want: f64 = (0..4)
            .map(|k| {
                let scalar = |l: usize| of_a(l) * value(&|i| all[i][k][l], 2, 1);
                of_a(k) * (0..4).map(scalar).sum::<f64>()
            })
            .sum();
        assert!((value(&|i| product[i][0], 6, 3) - want).abs() < 1e-14);
        assert!((value(&|i| product[i][1], 6, 3) - of_a(3).powi(3)).abs() < 1e-14);
    }
}
