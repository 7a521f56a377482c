//! Polynomials of three variables up to a total degree, as sums of products of Legendre
//! polynomials.
//!
//! On \[−1, 1\]³ these products are orthogonal and of about one size, so that a least-squares
//! problem in their coefficients is as well determined as its points make it.

use isoform_geom::{Point3, PolynomialData};

/// Products of Legendre polynomials up to a total degree.
#[derive(Clone, Debug)]
pub(crate) struct LegendreBasis {
    degree: usize,
    /// Degrees of the three factors.
    pub(crate) exponents: Vec<[u16; 3]>,
}

/// Values of all basis products at a point, and their derivatives in the frame of its normal.
#[derive(Clone, Debug)]
pub(crate) struct BasisRows {
    /// Values.
    pub(crate) value: Vec<f64>,
    /// Derivatives in two orthogonal tangential directions.
    pub(crate) tangents: [Vec<f64>; 2],
    /// First derivatives in the normal direction.
    pub(crate) normal: Vec<f64>,
    pub(crate) bend: Vec<f64>,
}

/// Values, first and second derivatives of the Legendre polynomials at a point, by degree.
type LegendreJets = Vec<[f64; 3]>;

impl LegendreBasis {
    pub(crate) fn new(degree: usize) -> Self {
        Self {
            degree,
            exponents: PolynomialData::exponents(degree),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.exponents.len()
    }

    pub(crate) fn rows(&self) -> BasisRows {
        let zeros = || vec![0.0; self.len()];
        BasisRows {
            value: zeros(),
            tangents: [zeros(), zeros()],
            normal: zeros(),
            bend: zeros(),
        }
    }

    /// Evaluates the basis at `q` in the frame of the unit normal `n`; if `n` is 0, all derivatives
    /// are 0.
    pub(crate) fn fill(&self, q: Point3, n: Point3, rows: &mut BasisRows) {
        let [x, y, z] = q.map(|t| legendre(self.degree, t));
        let [s, t] = tangents(n);
        for (at, [i, j, k]) in self.exponents.iter().enumerate() {
            let (a, b, c) = (x[*i as usize], y[*j as usize], z[*k as usize]);
            let g = [a[1] * b[0] * c[0], a[0] * b[1] * c[0], a[0] * b[0] * c[1]];
            let along = |d: Point3| d[0] * g[0] + d[1] * g[1] + d[2] * g[2];
            rows.value[at] = a[0] * b[0] * c[0];
            rows.tangents[0][at] = along(s);
            rows.tangents[1][at] = along(t);
            rows.normal[at] = along(n);
            rows.bend[at] = n[0] * n[0] * a[2] * b[0] * c[0]
                + n[1] * n[1] * a[0] * b[2] * c[0]
                + n[2] * n[2] * a[0] * b[0] * c[2]
                + 2.0
                    * (n[0] * n[1] * a[1] * b[1] * c[0]
                        + n[0] * n[2] * a[1] * b[0] * c[1]
                        + n[1] * n[2] * a[0] * b[1] * c[1]);
        }
    }

    /// Converts coefficients of the products to those of monomials, in the order of
    /// [`PolynomialData::exponents`].
    pub(crate) fn monomials(&self, c: &[f64]) -> Vec<f64> {
        let table = legendre_coefficients(self.degree);
        let place = |e: [usize; 3]| {
            let wanted = e.map(|v| v as u16);
            self.exponents.iter().position(|e| *e == wanted)
        };
        let mut out = vec![0.0; c.len()];
        for (c, e) in c.iter().zip(&self.exponents) {
            let [a, b, d] = e.map(|v| &table[usize::from(v)]);
            for (k, z) in d.iter().enumerate().filter(|v| *v.1 != 0.0) {
                for (j, y) in b.iter().enumerate().filter(|v| *v.1 != 0.0) {
                    for (i, x) in a.iter().enumerate().filter(|v| *v.1 != 0.0) {
                        let at = place([i, j, k]).expect("lower degrees are there");
                        out[at] += c * x * y * z;
                    }
                }
            }
        }
        out
    }
}

/// Returns two orthogonal unit tangents of a unit normal; zero vectors if the normal is 0.
fn tangents(n: Point3) -> [Point3; 2] {
    if n == [0.0; 3] {
        return [[0.0; 3]; 2];
    }
    let least = (0..3).fold(0, |m, k| if n[k].abs() < n[m].abs() { k } else { m });
    let mut axis = [0.0; 3];
    axis[least] = 1.0;
    let s = isoform_geom::cross(n, axis);
    let length = isoform_geom::norm(s);
    let s = s.map(|v| v / length);
    [s, isoform_geom::cross(n, s)]
}

/// Returns the Legendre polynomials up to a degree with two derivatives at t, by the recurrence
/// (k + 1) Pₖ₊₁ = (2k + 1) t Pₖ − k Pₖ₋₁.
fn legendre(degree: usize, t: f64) -> LegendreJets {
    let mut p = vec![[1.0, 0.0, 0.0], [t, 1.0, 0.0]];
    for k in 1..degree {
        let (a, b) = (p[k], p[k - 1]);
        let (m, w) = (k as f64, (2 * k + 1) as f64);
        // Derivatives of t Pₖ: t Pₖ' + Pₖ and t Pₖ'' + 2 Pₖ'.
        let raised = [t * a[0], t * a[1] + a[0], t * a[2] + 2.0 * a[1]];
        p.push(std::array::from_fn(|o| {
            (w * raised[o] - m * b[o]) / (m + 1.0)
        }));
    }
    p
}

/// Returns the monomial coefficients of the Legendre polynomials, by degree and power.
fn legendre_coefficients(degree: usize) -> Vec<Vec<f64>> {
    let mut table = vec![vec![1.0], vec![0.0, 1.0]];
    for k in 1..degree {
        let (m, w) = (k as f64, (2 * k + 1) as f64);
        let next = (0..=k + 1).map(|i| {
            let raised = if i > 0 { table[k][i - 1] } else { 0.0 };
            let before = table[k - 1].get(i).copied().unwrap_or(0.0);
            (w * raised - m * before) / (m + 1.0)
        });
        let next = next.collect();
        table.push(next);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_derivatives_along_normal_and_tangents() {
        let basis = LegendreBasis::new(5);
        let (q, n) = ([0.3, -0.7, 0.5], [0.48, 0.6, 0.64]);
        let at = |q: Point3| {
            let mut rows = basis.rows();
            basis.fill(q, n, &mut rows);
            rows
        };
        let h = 1e-4;
        let moved = |d: Point3, s: f64| at(std::array::from_fn(|k| q[k] + s * h * d[k])).value;
        let here = at(q);
        let slope = |d: Point3, i: usize| (moved(d, 1.0)[i] - moved(d, -1.0)[i]) / (2.0 * h);
        let [s, t] = tangents(n);
        for i in 0..basis.len() {
            assert!((slope(s, i) - here.tangents[0][i]).abs() < 1e-5);
            assert!((slope(t, i) - here.tangents[1][i]).abs() < 1e-5);
            assert!((slope(n, i) - here.normal[i]).abs() < 1e-5);
            let bend = moved(n, 1.0)[i] - 2.0 * here.value[i] + moved(n, -1.0)[i];
            assert!((bend / (h * h) - here.bend[i]).abs() < 1e-4);
        }
    }

    #[test]
    fn monomials_have_the_same_values() {
        let basis = LegendreBasis::new(6);
        let c: Vec<f64> = (0..basis.len())
            .map(|i| ((i * 7) % 11) as f64 - 5.0)
            .collect();
        let q: Point3 = [0.4, -0.9, 0.2];
        let mut rows = basis.rows();
        basis.fill(q, [0.0; 3], &mut rows);
        let want: f64 = c.iter().zip(&rows.value).map(|(c, v)| c * v).sum();
        let terms = basis.monomials(&c).into_iter().zip(&basis.exponents);
        let got: f64 = terms
            .map(|(c, e)| c * (0..3).map(|k| q[k].powi(i32::from(e[k]))).product::<f64>())
            .sum();
        assert!((got - want).abs() < 1e-12 * want.abs().max(1.0));
    }
}
