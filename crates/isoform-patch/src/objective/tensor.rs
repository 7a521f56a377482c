//! From derivatives by z at the nodes to derivatives by the control points: first over the nodes in
//! v, then over those in u, which costs a quarter of summing node by node.
//!
//! Control points are numbered i N + j for i in u and j in v. An entry of the Hessian belongs to
//! two coordinates k ≤ l and two control points; blocks with k > l are left to the caller.

use super::Derivatives;
use super::quadrature::{Basis, Rule};
use crate::local::Local;

/// Kinds of numbers in z: p*, p*ᵤ, p*ᵥ.
const KINDS: usize = 3;
/// The orders of the derivatives in u and in v from which a kind is made: (0, 0) for p*, (1, 0) for
/// p*ᵤ and (0, 1) for p*ᵥ.
const ORDERS: [(usize, usize); KINDS] = [(0, 0), (1, 0), (0, 1)];

/// Calls a function with the number of control points in a row as a constant, which lets its loops
/// be unrolled.
macro_rules! sized {
    ($n:expr, $f:ident($($argument:expr),*)) => {
        match $n {
            2 => $f::<2>($($argument),*),
            3 => $f::<3>($($argument),*),
            4 => $f::<4>($($argument),*),
            5 => $f::<5>($($argument),*),
            6 => $f::<6>($($argument),*),
            7 => $f::<7>($($argument),*),
            8 => $f::<8>($($argument),*),
            _ => $f::<9>($($argument),*),
        }
    };
}

/// A residual that depends on p* alone, with its derivatives by p* and twice its weight.
pub(super) struct PointResidual {
    pub(super) value: f64,
    pub(super) first: [f64; 4],
    pub(super) weight: f64,
}

/// Adds squares of residuals by Gauss-Newton. As these depend on p* alone, there is one product of
/// basis functions instead of nine. `residual` is asked of each node with its number and weight.
pub(super) fn add_squares(
    rule: &Rule,
    d: &mut Derivatives,
    residual: impl FnMut(usize, f64) -> PointResidual,
) {
    let (m, n) = (rule.u.b[0][0].len(), rule.v.b[0][0].len());
    sized!(n, add_sized_squares(rule, m, d, residual));
}

/// Adds the sums over the nodes of a rule of what `local` tells of each for its number and weight;
/// none where `local` is none.
pub(super) fn add_locals(
    rule: &Rule,
    d: &mut Derivatives,
    mut local: impl FnMut(usize, f64) -> Option<Local>,
) -> Option<()> {
    let (m, n) = (rule.u.b[0][0].len(), rule.v.b[0][0].len());
    let mut inner = vec![0.0; 4 * 16 * n * n];
    let mut side = vec![0.0; 2 * 4 * n];
    let mut k = 0;
    for (a, wu) in rule.u.b.iter().zip(&rule.u.weights) {
        let mut locals = Vec::with_capacity(rule.v.b.len());
        for wv in &rule.v.weights {
            locals.push(local(k, wu * wv)?);
            k += 1;
        }
        sized!(n, over_v(&locals, &rule.v.b, &mut inner, &mut side));
        sized!(n, over_u(a, m, &inner, &side, d));
    }
    Some(())
}

/// The sums over v at one u of Gauss-Newton's terms.
struct Squares<const N: usize> {
    /// By coordinate and control point in v.
    side: [[f64; N]; 4],
    /// By two coordinates k ≤ l and two control points in v.
    inner: [[[[f64; N]; N]; 4]; 4],
}

/// M control points in u, N in v.
fn add_sized_squares<const N: usize>(
    rule: &Rule,
    m: usize,
    d: &mut Derivatives,
    mut residual: impl FnMut(usize, f64) -> PointResidual,
) {
    let basis: Vec<[f64; N]> = values(&rule.v);
    let mut k = 0;
    for ([a, _], wu) in rule.u.b.iter().zip(&rule.u.weights) {
        let mut sums = Squares::<N>::zero();
        for (b, wv) in basis.iter().zip(&rule.v.weights) {
            sums.add(b, &residual(k, 2.0 * wu * wv));
            k += 1;
        }
        sums.add_to(a, m, d);
    }
}

/// B at the nodes.
fn values<const N: usize>(basis: &Basis) -> Vec<[f64; N]> {
    let at = |[b, _]: &[Vec<f64>; 2]| std::array::from_fn(|j| b[j]);
    basis.b.iter().map(at).collect()
}

impl<const N: usize> Squares<N> {
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
            let x: [f64; N] = std::array::from_fn(|j| weight * first[k] * b[j]);
            for j in 0..N {
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
    fn add_to(&self, a: &[f64], m: usize, d: &mut Derivatives) {
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
    /// Gradient and Hessian in rows of N control points.
    #[inline(always)]
    fn rows_of<const N: usize>(&mut self) -> (&mut [[f64; N]], &mut [[f64; N]]) {
        (
            self.gradient.as_chunks_mut::<N>().0,
            self.hessian.as_chunks_mut::<N>().0,
        )
    }
}

/// The sums over v at one u. `inner` holds, by the orders (a, a′) in u and the coordinates (k, l),
/// an N × N matrix; `side` by a and k a vector.
fn over_v<const N: usize>(
    locals: &[Local],
    basis: &[[Vec<f64>; 2]],
    inner: &mut [f64],
    side: &mut [f64],
) {
    let (inner, side) = (inner.as_chunks_mut::<N>().0, side.as_chunks_mut::<N>().0);
    let basis: Vec<[[f64; N]; 2]> = basis
        .iter()
        .map(|b| [0, 1].map(|order| std::array::from_fn(|j| b[order][j])))
        .collect();
    gradients_over_v(locals, &basis, side);
    let all = || locals.iter().zip(&basis);
    for k in 0..4 {
        for l in k..4 {
            let c = |local: &Local, s: usize, t: usize| local.hessian[4 * s + k][4 * t + l];
            // By the orders in u: the sum of what multiplies B, and B′, from the left.
            let mut put = |orders: usize, sum: [[f64; N]; N]| {
                inner[(orders * 16 + 4 * k + l) * N..][..N].copy_from_slice(&sum)
            };
            put(
                0,
                sums(all().map(|(h, b)| (b, [c(h, 0, 0), c(h, 2, 0), c(h, 0, 2), c(h, 2, 2)]))),
            );
            put(
                1,
                sums(all().map(|(h, b)| (b, [c(h, 0, 1), c(h, 2, 1), 0.0, 0.0]))),
            );
            put(
                2,
                sums(all().map(|(h, b)| (b, [c(h, 1, 0), 0.0, c(h, 1, 2), 0.0]))),
            );
            put(
                3,
                sums(all().map(|(h, b)| (b, [c(h, 1, 1), 0.0, 0.0, 0.0]))),
            );
        }
    }
}

/// The sums of gradients over v at one u.
#[inline(always)]
fn gradients_over_v<const N: usize>(
    locals: &[Local],
    basis: &[[[f64; N]; 2]],
    side: &mut [[f64; N]],
) {
    side.fill([0.0; N]);
    for (local, b) in locals.iter().zip(basis) {
        for (s, &(a, bs)) in ORDERS.iter().enumerate() {
            for k in 0..4 {
                let (g, out) = (local.gradient[4 * s + k], &mut side[a * 4 + k]);
                for j in 0..N {
                    out[j] += g * b[bs][j];
                }
            }
        }
    }
}

/// Σ (p B + q B′) Bᵀ + (r B + s B′) B′ᵀ over the nodes in v, with B, B′ and [p, q, r, s] at each.
#[inline(always)]
fn sums<'b, const N: usize>(
    terms: impl Iterator<Item = (&'b [[f64; N]; 2], [f64; 4])>,
) -> [[f64; N]; N] {
    let mut sum = [[0.0; N]; N];
    for ([b, d], [p, q, r, s]) in terms {
        for i in 0..N {
            let (x, y) = (p * b[i] + q * d[i], r * b[i] + s * d[i]);
            for j in 0..N {
                sum[i][j] += x * b[j] + y * d[j];
            }
        }
    }
    sum
}

/// Adds the sums over v at one u to the derivatives; m control points in u, N in v.
fn over_u<const N: usize>(
    a: &[Vec<f64>; 2],
    m: usize,
    inner: &[f64],
    side: &[f64],
    d: &mut Derivatives,
) {
    let (inner, side) = (inner.as_chunks::<N>().0, side.as_chunks::<N>().0);
    let (gradient, hessian) = d.rows_of::<N>();
    for k in 0..4 {
        for i in 0..m {
            for j in 0..N {
                gradient[k * m + i][j] += a[0][i] * side[k][j] + a[1][i] * side[4 + k][j];
            }
        }
        for l in k..4 {
            let block = |orders: usize| &inner[(orders * 16 + 4 * k + l) * N..][..N];
            let blocks = [block(0), block(1), block(2), block(3)];
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
                        add_rows(out, f, blocks.map(|rows| &rows[j]));
                    }
                }
            }
        }
    }
}

/// Adds Σ f r over four rows.
#[inline(always)]
fn add_rows<const N: usize>(out: &mut [f64; N], f: [f64; 4], rows: [&[f64; N]; 4]) {
    let [r0, r1, r2, r3] = rows;
    for j in 0..N {
        out[j] += f[0] * r0[j] + f[1] * r1[j] + f[2] * r2[j] + f[3] * r3[j];
    }
}
