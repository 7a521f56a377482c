//! Uniform B-splines of one variable.
//!
//! The functions that are not 0 on the cell \[k, k + 1\] are numbered k, …, k + d: function m has
//! the support \[m − d, m + 1\]. On the cell they are polynomials of degree d in t = x − k, the
//! j-th of them
//!
//! ```text
//! bᵈⱼ(t) = ((t + d − j) bᵈ⁻¹ⱼ₋₁(t) + (1 + j − t) bᵈ⁻¹ⱼ(t)) / d,      b⁰₀ = 1
//! ```
//!
//! (de Boor 1978, ch. X, for knots at the integers).

/// Maximum degree of a spline. A cell then has (d + 1)³ = 216 coefficients.
pub const MAX_DEGREE: usize = 5;

/// One value per function on a cell; entries beyond the degree are 0.
pub(crate) type SplineRow = [f64; MAX_DEGREE + 1];

/// Returns the values of the d + 1 functions at t in their cell.
#[inline]
pub(crate) fn values(degree: usize, t: f64) -> SplineRow {
    let mut b = [0.0; MAX_DEGREE + 1];
    b[0] = 1.0;
    for d in 1..=degree {
        raise(&mut b, d, t);
    }
    b
}

/// Raises the degree of the values from d − 1 to d, in place.
#[inline]
fn raise(b: &mut SplineRow, d: usize, t: f64) {
    let inverse = 1.0 / d as f64;
    for j in (0..=d).rev() {
        let left = if j > 0 {
            (t + (d - j) as f64) * b[j - 1]
        } else {
            0.0
        };
        let right = if j < d {
            ((1 + j) as f64 - t) * b[j]
        } else {
            0.0
        };
        b[j] = (left + right) * inverse;
    }
}

/// Returns values, first and second derivatives by t of the d + 1 functions at t in their cell.
#[inline]
pub(crate) fn jets(degree: usize, t: f64) -> [SplineRow; 3] {
    let mut rows = [[0.0; MAX_DEGREE + 1]; 3];
    let mut b = [0.0; MAX_DEGREE + 1];
    b[0] = 1.0;
    for d in 1..=degree + 1 {
        // After degree − k raises, k differences give the k-th derivative.
        let missing = degree + 1 - d;
        if missing <= 2 {
            rows[missing] = b;
        }
        if d <= degree {
            raise(&mut b, d, t);
        }
    }
    for (order, row) in rows.iter_mut().enumerate() {
        if order > degree {
            *row = [0.0; MAX_DEGREE + 1];
        }
        for step in 0..order.min(degree) {
            difference(row, degree - order + step + 1);
        }
    }
    rows
}

/// Replaces coefficients of functions of degree d − 1 by those of degree d for the derivative: Nᵈₘ'
/// = Nᵈ⁻¹ₘ₋₁ − Nᵈ⁻¹ₘ in the numbering of a cell.
#[inline]
fn difference(row: &mut SplineRow, d: usize) {
    for j in (0..=d).rev() {
        let left = if j > 0 { row[j - 1] } else { 0.0 };
        let right = if j < d { row[j] } else { 0.0 };
        row[j] = left - right;
    }
}

/// Returns the two-scale weight of fine function n in coarse function m, for half the spacing: 2⁻ᵈ
/// times the binomial coefficient of d + 1 over n − 2m + d; 0 if the latter is outside 0, …, d + 1.
pub(crate) fn two_scale(degree: usize, coarse: i64, fine: i64) -> f64 {
    let j = fine - 2 * coarse + degree as i64;
    if !(0..=degree as i64 + 1).contains(&j) {
        return 0.0;
    }
    let binomial = (0..j).fold(1.0, |c, i| {
        c * (degree as i64 + 1 - i) as f64 / (i + 1) as f64
    });
    binomial / f64::from(1u32 << degree)
}

/// Coarse functions that contain a fine one in their two-scale relation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parents {
    /// Index of the first coarse function, minus half the fine index rounded down.
    pub(crate) first: i64,
    /// Number of coarse functions.
    pub(crate) count: usize,
    /// Two-scale weights of the coarse functions.
    pub(crate) weights: SplineRow,
}

/// Returns the parents of fine functions with even and with odd index.
pub(crate) fn parents(degree: usize) -> [Parents; 2] {
    std::array::from_fn(|parity| {
        let fine = 2 * (degree as i64) + parity as i64;
        let mut found: Option<Parents> = None;
        for coarse in 0..=2 * degree as i64 + 2 {
            let weight = two_scale(degree, coarse, fine);
            if weight > 0.0 {
                let p = found.get_or_insert(Parents {
                    first: coarse - degree as i64,
                    count: 0,
                    weights: [0.0; MAX_DEGREE + 1],
                });
                p.weights[p.count] = weight;
                p.count += 1;
            }
        }
        found.expect("every fine function has a parent")
    })
}

/// Returns the Bernstein coefficients of the d + 1 functions on a cell: `[j][k]` is the k-th
/// coefficient of the j-th function.
pub(crate) fn bernstein(degree: usize) -> [SplineRow; MAX_DEGREE + 1] {
    let mut b = [[0.0; MAX_DEGREE + 1]; MAX_DEGREE + 1];
    b[0][0] = 1.0;
    for d in 1..=degree {
        let before = b;
        for j in 0..=d {
            // A factor that is α at t = 0 and β at t = 1, times degree d − 1.
            let mut sum = [0.0; MAX_DEGREE + 1];
            let mut add = |row: &SplineRow, at_0: f64, at_1: f64| {
                for k in 0..=d {
                    let a = if k < d {
                        (d - k) as f64 * at_0 * row[k]
                    } else {
                        0.0
                    };
                    let c = if k > 0 {
                        k as f64 * at_1 * row[k - 1]
                    } else {
                        0.0
                    };
                    sum[k] += (a + c) / (d * d) as f64;
                }
            };
            if j > 0 {
                add(&before[j - 1], (d - j) as f64, (d - j + 1) as f64);
            }
            if j < d {
                add(&before[j], (1 + j) as f64, j as f64);
            }
            b[j] = sum;
        }
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubic_functions_are_the_textbook_ones() {
        let t = 0.3;
        let want = [
            (1.0f64 - t).powi(3) / 6.0,
            (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
            (-3.0 * t * t * t + 3.0 * t * t + 3.0 * t + 1.0) / 6.0,
            t * t * t / 6.0,
        ];
        let got = jets(3, t);
        for j in 0..4 {
            assert!((got[0][j] - want[j]).abs() < 1e-15);
        }
        let slopes = [
            -0.5 * (1.0 - t) * (1.0 - t),
            1.5 * t * t - 2.0 * t,
            -1.5 * t * t + t + 0.5,
            0.5 * t * t,
        ];
        let bends = [1.0 - t, 3.0 * t - 2.0, 1.0 - 3.0 * t, t];
        for j in 0..4 {
            assert!((got[1][j] - slopes[j]).abs() < 1e-15, "{j}");
            assert!((got[2][j] - bends[j]).abs() < 1e-15, "{j}");
        }
    }

    #[test]
    fn functions_sum_to_one_and_refine() {
        for degree in 1..=MAX_DEGREE {
            for t in [0.0, 0.21, 0.77, 1.0] {
                let sum: f64 = values(degree, t).iter().sum();
                assert!((sum - 1.0).abs() < 1e-14);
                // A coarse function in cell 4 at t is the weighted sum of fine ones in cell 8 or 9.
                let (cell, s) = if t < 0.5 {
                    (8, 2.0 * t)
                } else {
                    (9, 2.0 * t - 1.0)
                };
                let (coarse, fine) = (values(degree, t), values(degree, s));
                for j in 0..=degree {
                    let m = 4 + j as i64;
                    let v: f64 = (0..=degree)
                        .map(|k| two_scale(degree, m, cell + k as i64) * fine[k])
                        .sum();
                    assert!((v - coarse[j]).abs() < 1e-14, "degree {degree}, t {t}, {j}");
                }
            }
        }
    }

    #[test]
    fn bernstein_coefficients_give_the_values() {
        for degree in 1..=MAX_DEGREE {
            let t: f64 = 0.37;
            let (rows, want) = (bernstein(degree), values(degree, t));
            for j in 0..=degree {
                let mut c = rows[j];
                for n in (1..=degree).rev() {
                    for k in 0..n {
                        c[k] = (1.0 - t) * c[k] + t * c[k + 1];
                    }
                }
                assert!((c[0] - want[j]).abs() < 1e-15);
            }
        }
    }
}
