//! Transformation of derivatives by z at the nodes to derivatives by the control points: summed
//! first over the nodes in v, then over those in u, which costs a quarter of summing node by node.
//!
//! Control points are numbered i N + j for i in u and j in v. An entry of the Hessian belongs to
//! two coordinates k ≤ l and two control points; blocks with k > l are left to the caller.

use super::Derivatives;
use super::quadrature::QuadratureRule;
use crate::local::NodeDerivatives;
use crate::sized::{chunk, sized};
use std::ops::Range;

/// Orders of the derivatives in u and in v of the three kinds of numbers in z: (0, 0) for p*, (1,
/// 0) for p*ᵤ and (0, 1) for p*ᵥ.
const DERIVATIVE_ORDERS: [(usize, usize); 3] = [(0, 0), (1, 0), (0, 1)];

/// Residual that depends on p* alone, with its derivatives by p* and twice its weight.
pub(super) struct PointResidual {
    pub(super) value: f64,
    pub(super) first: [f64; 4],
    pub(super) weight: f64,
}

/// Adds squares of residuals in the Gauss-Newton approximation. As these depend on p* alone, there
/// is one product of basis functions instead of nine. `residual` is called for each node with its
/// index and twice its weight.
pub(super) fn add_squares(
    rule: &QuadratureRule,
    d: &mut Derivatives,
    mut residual: impl FnMut(usize, f64) -> PointResidual,
) {
    let mut k = 0;
    let mut residuals = Vec::with_capacity(rule.v.b.len());
    for (a, wu) in rule.u.b.iter().zip(&rule.u.weights) {
        residuals.clear();
        for wv in &rule.v.weights {
            residuals.push(residual(k, 2.0 * wu * wv));
            k += 1;
        }
        add_row_of_squares(&residuals, &rule.v.b, &a[0], d);
    }
}

/// Adds the integrands at the nodes of a rule. For the nodes at one u, `locals` gets their indices
/// and weights and adds their integrands; returns `None` if `locals` does.
pub(super) fn add_locals(
    rule: &QuadratureRule,
    d: &mut Derivatives,
    mut locals: impl FnMut(Range<usize>, &[f64], &mut [NodeDerivatives]) -> Option<()>,
) -> Option<()> {
    let n = rule.v.b[0][0].len();
    let mut sums = RowSums {
        inner: vec![0.0; 4 * 16 * n * n],
        side: vec![0.0; 2 * 4 * n],
    };
    let count = rule.v.b.len();
    let (mut row, mut weights) = (vec![NodeDerivatives::default(); count], vec![0.0; count]);
    for (k, (a, wu)) in rule.u.b.iter().zip(&rule.u.weights).enumerate() {
        row.fill(NodeDerivatives::default());
        for (weight, wv) in weights.iter_mut().zip(&rule.v.weights) {
            *weight = wu * wv;
        }
        locals(k * count..(k + 1) * count, &weights, &mut row)?;
        add_row_of_locals(&row, &rule.v.b, a, &mut sums, d);
    }
    Some(())
}

isoform_num::dispatch! {
    /// Adds the squares at the nodes of one u; `a` is B there.
    fn add_row_of_squares(
        residuals: &[PointResidual],
        basis: &[[Vec<f64>; 2]],
        a: &[f64],
        d: &mut Derivatives,
    ) = row_of_squares
}

isoform_num::dispatch! {
    /// Adds the integrands at the nodes of one u; `a` is B and B′ there.
    fn add_row_of_locals(
        locals: &[NodeDerivatives],
        basis: &[[Vec<f64>; 2]],
        a: &[Vec<f64>; 2],
        sums: &mut RowSums,
        d: &mut Derivatives,
    ) = row_of_locals
}

#[inline(always)]
fn row_of_squares(
    residuals: &[PointResidual],
    basis: &[[Vec<f64>; 2]],
    a: &[f64],
    d: &mut Derivatives,
) {
    sized!(
        basis[0][0].len(),
        sized_row_of_squares(residuals, basis, a, d)
    );
}

#[inline(always)]
fn row_of_locals(
    locals: &[NodeDerivatives],
    basis: &[[Vec<f64>; 2]],
    a: &[Vec<f64>; 2],
    sums: &mut RowSums,
    d: &mut Derivatives,
) {
    sized!(
        basis[0][0].len(),
        sized_row_of_locals(locals, basis, a, sums, d)
    );
}

/// Adds the squares for N control points in v.
#[inline(always)]
fn sized_row_of_squares<const N: usize>(
    residuals: &[PointResidual],
    basis: &[[Vec<f64>; 2]],
    a: &[f64],
    d: &mut Derivatives,
) {
    let mut sums = SquareSums::<N>::zero();
    for ([b, _], residual) in basis.iter().zip(residuals) {
        sums.add(chunk(b), residual);
    }
    sums.add_to(a, d);
}

/// Adds the integrands for N control points in v.
#[inline(always)]
fn sized_row_of_locals<const N: usize>(
    locals: &[NodeDerivatives],
    basis: &[[Vec<f64>; 2]],
    a: &[Vec<f64>; 2],
    sums: &mut RowSums,
    d: &mut Derivatives,
) {
    sums.take::<N>(locals, basis);
    sums.add_to::<N>(a, d);
}

/// Sums over v at one u.
struct RowSums {
    /// Hessians as N × N matrices, by the orders (a, a′) in u and the coordinates (k, l).
    inner: Vec<f64>,
    /// Gradients as vectors, by a and k.
    side: Vec<f64>,
}

/// Sums over v at one u of the Gauss-Newton terms.
struct SquareSums<const N: usize> {
    /// Gradients by coordinate and control point in v.
    side: [[f64; N]; 4],
    /// Hessians by two coordinates k ≤ l and two control points in v.
    inner: [[[[f64; N]; N]; 4]; 4],
}

impl<const N: usize> SquareSums<N> {
    #[inline(always)]
    fn zero() -> Self {
        Self {
            side: [[0.0; N]; 4],
            inner: [[[[0.0; N]; N]; 4]; 4],
        }
    }

    /// Adds a node.
    #[inline(always)]
    fn add(&mut self, b: &[f64; N], residual: &PointResidual) {
        let PointResidual {
            value: r,
            first,
            weight,
        } = residual;
        for k in 0..4 {
            let mut x = [0.0; N];
            for j in 0..N {
                x[j] = weight * first[k] * b[j];
                self.side[k][j] += r * x[j];
            }
            for l in k..4 {
                for (out, x) in self.inner[k][l].iter_mut().zip(x) {
                    let x = x * first[l];
                    for j in 0..N {
                        out[j] += x * b[j];
                    }
                }
            }
        }
    }

    /// Adds the sums to the derivatives, for the basis a in u.
    #[inline(always)]
    fn add_to(&self, a: &[f64], d: &mut Derivatives) {
        let m = a.len();
        let (gradient, hessian) = d.rows_of::<N>();
        for k in 0..4 {
            for i in 0..m {
                for j in 0..N {
                    gradient[k * m + i][j] += a[i] * self.side[k][j];
                }
            }
            for l in k..4 {
                for i in 0..m {
                    for (j, row) in self.inner[k][l].iter().enumerate() {
                        let start = (k * m * N + i * N + j) * 4 * m + l * m;
                        for (i2, out) in hessian[start..][..m].iter_mut().enumerate() {
                            let f = a[i] * a[i2];
                            for j2 in 0..N {
                                out[j2] += f * row[j2];
                            }
                        }
                    }
                }
            }
        }
    }
}

impl Derivatives {
    /// Returns gradient and Hessian in rows of N control points.
    #[inline(always)]
    fn rows_of<const N: usize>(&mut self) -> (&mut [[f64; N]], &mut [[f64; N]]) {
        (
            self.gradient.as_chunks_mut::<N>().0,
            self.hessian.as_chunks_mut::<N>().0,
        )
    }
}

impl RowSums {
    /// Sums over the nodes at one u.
    #[inline(always)]
    fn take<const N: usize>(&mut self, locals: &[NodeDerivatives], basis: &[[Vec<f64>; 2]]) {
        self.take_gradients::<N>(locals, basis);
        let inner = self.inner.as_chunks_mut::<N>().0;
        for k in 0..4 {
            for l in k..4 {
                for (orders, sum) in second_sums::<N>(locals, basis, k, l).iter().enumerate() {
                    inner[(orders * 16 + 4 * k + l) * N..][..N].copy_from_slice(sum);
                }
            }
        }
    }

    #[inline(always)]
    fn take_gradients<const N: usize>(
        &mut self,
        locals: &[NodeDerivatives],
        basis: &[[Vec<f64>; 2]],
    ) {
        let side = self.side.as_chunks_mut::<N>().0;
        side.fill([0.0; N]);
        for (local, b) in locals.iter().zip(basis) {
            for (s, &(a, bs)) in DERIVATIVE_ORDERS.iter().enumerate() {
                let b: &[f64; N] = chunk(&b[bs]);
                for k in 0..4 {
                    let (g, out) = (local.gradient[4 * s + k], &mut side[a * 4 + k]);
                    for j in 0..N {
                        out[j] += g * b[j];
                    }
                }
            }
        }
    }

    /// Adds the sums to the derivatives, for B and B′ in u.
    #[inline(always)]
    fn add_to<const N: usize>(&self, a: &[Vec<f64>; 2], d: &mut Derivatives) {
        let m = a[0].len();
        let (inner, side) = (self.inner.as_chunks::<N>().0, self.side.as_chunks::<N>().0);
        let (gradient, hessian) = d.rows_of::<N>();
        for k in 0..4 {
            for i in 0..m {
                for j in 0..N {
                    gradient[k * m + i][j] += a[0][i] * side[k][j] + a[1][i] * side[4 + k][j];
                }
            }
            for l in k..4 {
                let block = |orders: usize| &inner[(orders * 16 + 4 * k + l) * N..][..N];
                let (b0, b1, b2, b3) = (block(0), block(1), block(2), block(3));
                for i in 0..m {
                    for i2 in 0..m {
                        let f = [
                            a[0][i] * a[0][i2],
                            a[0][i] * a[1][i2],
                            a[1][i] * a[0][i2],
                            a[1][i] * a[1][i2],
                        ];
                        for j in 0..N {
                            let out = &mut hessian[(k * m * N + i * N + j) * 4 * m + l * m + i2];
                            add_rows(out, f, [&b0[j], &b1[j], &b2[j], &b3[j]]);
                        }
                    }
                }
            }
        }
    }
}

/// Sums over the nodes at one u the second derivatives by coordinates k and l of z, separately for
/// the orders (a, a′) in u: with B and B′ at a node, and the derivative c(s, t) by components s and
/// t of z,
///
/// ```text
/// (0, 0)  (c(0,0) B + c(2,0) B′) Bᵀ + (c(0,2) B + c(2,2) B′) B′ᵀ
/// (0, 1)  (c(0,1) B + c(2,1) B′) Bᵀ
/// (1, 0)  c(1,0) B Bᵀ + c(1,2) B B′ᵀ
/// (1, 1)  c(1,1) B Bᵀ
/// ```
#[inline(always)]
fn second_sums<const N: usize>(
    locals: &[NodeDerivatives],
    basis: &[[Vec<f64>; 2]],
    k: usize,
    l: usize,
) -> [[[f64; N]; N]; 4] {
    let mut sums = [[[0.0; N]; N]; 4];
    for (local, [b, d]) in locals.iter().zip(basis) {
        let c = |s: usize, t: usize| local.hessian[4 * s + k][4 * t + l];
        let (b, d): (&[f64; N], &[f64; N]) = (chunk(b), chunk(d));
        for i in 0..N {
            let x = [
                c(0, 0) * b[i] + c(2, 0) * d[i],
                c(0, 1) * b[i] + c(2, 1) * d[i],
                c(1, 0) * b[i],
                c(1, 1) * b[i],
            ];
            let y = [c(0, 2) * b[i] + c(2, 2) * d[i], c(1, 2) * b[i]];
            for j in 0..N {
                sums[0][i][j] += x[0] * b[j] + y[0] * d[j];
                sums[1][i][j] += x[1] * b[j];
                sums[2][i][j] += x[2] * b[j] + y[1] * d[j];
                sums[3][i][j] += x[3] * b[j];
            }
        }
    }
    sums
}

/// Adds Σ f r over four rows.
#[inline(always)]
fn add_rows<const N: usize>(out: &mut [f64; N], f: [f64; 4], rows: [&[f64; N]; 4]) {
    let [r0, r1, r2, r3] = rows;
    for j in 0..N {
        out[j] += f[0] * r0[j] + f[1] * r1[j] + f[2] * r2[j] + f[3] * r3[j];
    }
}
