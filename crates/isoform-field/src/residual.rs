//! A compiled model as the residual of a fit: values, Jacobians, and the normal equations JᵀWJ and
//! JᵀWf, in blocks of points and on several threads.
//!
//! Sums are accumulated over batches of [`BATCH_POINTS`] points and then over the batches in order,
//! so that they do not depend on the number of threads.

use crate::block::{Block, GradientInputs, LANES, Lane, Plan};
use crate::jets::{self, JetBlock};
use crate::partition;
use crate::tape::Tape;
use isoform_geom::{Aabb, Expansion, Field, ParamField, Point3};
use isoform_num::{Interval, IntervalJet, Jet2, Jet3, Real, dispatch};
use rayon::prelude::*;

/// Number of points in a batch of work. Another number changes the order of summation, and hence
/// the last digits of sums.
const BATCH_POINTS: usize = 32 * LANES;

/// Evaluator of a tape in x, y, z and parameters, in blocks of points, on all threads of the
/// current pool for large inputs.
#[derive(Clone, Debug)]
pub struct Residual {
    /// The compiled function.
    tape: Tape,
    /// The plan of derivatives by the parameters.
    by_params: Plan,
    /// The plan of derivatives by the coordinates.
    by_space: Plan,
}

impl Residual {
    /// Creates the residual f(x; a), the first result of the tape.
    pub fn new(tape: Tape) -> Self {
        Self {
            by_params: Plan::new(&tape, GradientInputs::Params),
            by_space: Plan::new(&tape, GradientInputs::Space),
            tape,
        }
    }
    /// Returns the tape.
    pub fn tape(&self) -> &Tape {
        &self.tape
    }

    /// Computes values and the derivatives by all inputs, one row of `points.len()` numbers per
    /// input: x, y, z, then the parameters; on one thread.
    ///
    /// # Panics
    /// If `out` or `rows` is too short.
    pub fn all_gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], rows: &mut [f64]) {
        let plan = Plan::new(&self.tape, GradientInputs::All);
        let mut block = Block::gradients(&self.tape, &plan);
        block.bind(a);
        let n = points.len();
        for (k, chunk) in points.chunks(LANES).enumerate() {
            let at = k * LANES;
            block.load(chunk);
            out[at..][..chunk.len()].copy_from_slice(&block.forward()[..chunk.len()]);
            block.reverse();
            for (i, row) in block.by_space().iter().chain(block.by_params()).enumerate() {
                rows[i * n + at..][..chunk.len()].copy_from_slice(&row.0[..chunk.len()]);
            }
        }
    }
}

/// Calls `work(range, part of out, part of rows)` for each batch of points, on several threads if
/// there are several batches.
fn for_pieces(
    n: usize,
    out: &mut [f64],
    rows: &mut [f64],
    width: usize,
    work: impl Fn(std::ops::Range<usize>, &mut [f64], &mut [f64]) + Sync,
) {
    if n == 0 {
        return;
    }
    let piece = |k: usize, out: &mut [f64], rows: &mut [f64]| {
        let from = k * BATCH_POINTS;
        work(from..from + out.len(), out, rows);
    };
    let (out, rows) = (&mut out[..n], &mut rows[..n * width]);
    if n <= BATCH_POINTS || rayon::current_num_threads() == 1 {
        work(0..n, out, rows);
    } else if width == 0 {
        out.par_chunks_mut(BATCH_POINTS)
            .enumerate()
            .for_each(|(k, o)| piece(k, o, &mut []));
    } else {
        out.par_chunks_mut(BATCH_POINTS)
            .zip(rows.par_chunks_mut(BATCH_POINTS * width))
            .enumerate()
            .for_each(|(k, (o, r))| piece(k, o, r));
    }
}

/// Weighted products of the rows of (J, f) over some points, accumulated eight lanes wide, in
/// squares of two rows by two.
struct ProductSums {
    products: Vec<[f64; 8]>,
}

impl ProductSums {
    /// Creates empty sums, for an even number of rows.
    fn new(rows: usize) -> Self {
        let pairs = rows / 2;
        Self {
            products: vec![[0.0; 8]; pairs * (pairs + 1) / 2 * 4],
        }
    }
    /// Returns the sums for row m with itself, for row m with the rows before it, and for each pair
    /// of these.
    fn list(&self, m: usize) -> Vec<f64> {
        let gradient = (0..m).map(|i| self.get(m, i));
        let hessian = (0..m).flat_map(|i| (0..=i).map(move |j| (i, j)));
        std::iter::once(self.get(m, m))
            .chain(gradient)
            .chain(hessian.map(|(i, j)| self.get(i, j)))
            .collect()
    }
    /// Returns the sum for rows i ≥ j.
    fn get(&self, i: usize, j: usize) -> f64 {
        total(&self.products[(i / 2 * (i / 2 + 1) / 2 + j / 2) * 4 + i % 2 * 2 + j % 2])
    }
}

dispatch! {
    /// Adds a block of rows (an even number of them) with weights `w`, 0 in unused lanes.
    fn accumulate(sums: &mut ProductSums, rows: &[Lane<LANES>], w: &[f64; LANES]) = accumulate_body
}

/// Adds the four products of two rows each, lane by lane: every row is loaded once for two
/// products.
#[inline(always)]
fn dot_pairs(into: [&mut [f64; 8]; 4], a: [&[f64; LANES]; 2], b: [&[f64; LANES]; 2]) {
    let [into00, into01, into10, into11] = into;
    let (mut s00, mut s01, mut s10, mut s11) = (*into00, *into01, *into10, *into11);
    for c in 0..LANES / 8 {
        for l in 0..8 {
            let (u, v, p, q) = (
                a[0][8 * c + l],
                a[1][8 * c + l],
                b[0][8 * c + l],
                b[1][8 * c + l],
            );
            s00[l] += u * p;
            s01[l] += u * q;
            s10[l] += v * p;
            s11[l] += v * q;
        }
    }
    (*into00, *into01, *into10, *into11) = (s00, s01, s10, s11);
}

/// Multiplies two rows by the weights, lane by lane.
#[inline(always)]
fn weighted(rows: [&Lane<LANES>; 2], w: &[f64; LANES]) -> [Lane<LANES>; 2] {
    let mut weighted = [Lane([0.0; LANES]); 2];
    for (to, row) in weighted.iter_mut().zip(rows) {
        for l in 0..LANES {
            to.0[l] = w[l] * row.0[l];
        }
    }
    weighted
}

/// Accumulates the products of all pairs of rows, in squares of two by two. Rows 0 to n − 1 are the
/// derivatives, row n the values. A product above the diagonal is computed with its square and
/// never read.
#[inline(always)]
fn accumulate_body(sums: &mut ProductSums, rows: &[Lane<LANES>], w: &[f64; LANES]) {
    let n = rows.len();
    for i in (0..n).step_by(2) {
        let pair = [&rows[i], &rows[i + 1]];
        let weighted = weighted(pair, w);
        for j in (0..=i).step_by(2) {
            let at = (i / 2 * (i / 2 + 1) / 2 + j / 2) * 4;
            let [s00, s01, s10, s11] = &mut sums.products[at..at + 4] else {
                unreachable!("four sums a square")
            };
            dot_pairs(
                [s00, s01, s10, s11],
                [&weighted[0].0, &weighted[1].0],
                [&rows[j].0, &rows[j + 1].0],
            );
        }
    }
}

/// Returns the sum over eight lanes, in a fixed order.
fn total(v: &[f64; 8]) -> f64 {
    ((v[0] + v[4]) + (v[1] + v[5])) + ((v[2] + v[6]) + (v[3] + v[7]))
}

impl Residual {
    /// Returns the weights of a chunk by lane, 0 in unused lanes.
    fn lane_weights(weights: &[f64], from: usize, n: usize) -> [f64; LANES] {
        let mut w = [0.0; LANES];
        if weights.is_empty() {
            w[..n].fill(1.0);
        } else {
            w[..n].copy_from_slice(&weights[from..from + n]);
        }
        w
    }

    /// Returns the weighted products of all pairs of columns of (J, f) over some points: f·f, then
    /// J·f by parameter, then the lower triangle of J·J by rows.
    fn products(&self, points: &[Point3], weights: &[f64], from: usize, a: &[f64]) -> Vec<f64> {
        let m = self.tape.n_params;
        let mut block = Block::gradients(&self.tape, &self.by_params);
        block.bind(a);
        let even = (m + 1).next_multiple_of(2);
        let (mut sums, mut rows) = (ProductSums::new(even), vec![Lane([0.0; LANES]); even]);
        for (k, chunk) in points.chunks(LANES).enumerate() {
            block.load(chunk);
            block.forward();
            block.reverse();
            rows[..m].copy_from_slice(block.by_params());
            rows[m].0 = *block.result(0);
            let weights = Self::lane_weights(weights, from + k * LANES, chunk.len());
            accumulate(&mut sums, &rows, &weights);
        }
        sums.list(m)
    }

    /// Sums vectors over the batches of points, each computed by `work`, in the order of the
    /// batches.
    fn reduce(
        &self,
        n: usize,
        len: usize,
        work: impl Fn(std::ops::Range<usize>) -> Vec<f64> + Sync,
    ) -> Vec<f64> {
        let pieces = n.div_ceil(BATCH_POINTS);
        let range = |k: usize| k * BATCH_POINTS..((k + 1) * BATCH_POINTS).min(n);
        let mut sum = vec![0.0; len];
        let mut add = |part: Vec<f64>| sum.iter_mut().zip(part).for_each(|(s, p)| *s += p);
        if pieces <= 1 || rayon::current_num_threads() == 1 {
            (0..pieces).for_each(|k| add(work(range(k))));
        } else {
            let parts: Vec<Vec<f64>> = (0..pieces)
                .into_par_iter()
                .map(|k| work(range(k)))
                .collect();
            parts.into_iter().for_each(add);
        }
        sum
    }
}

impl ParamField for Residual {
    fn dim(&self) -> usize {
        self.tape.n_params
    }

    fn values(&self, points: &[Point3], a: &[f64], out: &mut [f64]) {
        if partition::pays(&self.tape, points) {
            return partition::values(&self.tape, points, a, out);
        }
        for_pieces(points.len(), out, &mut [], 0, |range, out, _| {
            let mut block = Block::values(&self.tape);
            block.bind(a);
            for (chunk, out) in points[range].chunks(LANES).zip(out.chunks_mut(LANES)) {
                block.load(chunk);
                out.copy_from_slice(&block.forward()[..chunk.len()]);
            }
        });
    }

    fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], jac: &mut [f64]) {
        let m = self.tape.n_params;
        for_pieces(points.len(), out, jac, m, |range, out, jac| {
            let mut block = Block::gradients(&self.tape, &self.by_params);
            block.bind(a);
            for (k, chunk) in points[range].chunks(LANES).enumerate() {
                block.load(chunk);
                out[k * LANES..][..chunk.len()].copy_from_slice(&block.forward()[..chunk.len()]);
                block.reverse();
                for (l, to) in jac[k * LANES * m..]
                    .chunks_exact_mut(m.max(1))
                    .enumerate()
                    .take(chunk.len())
                {
                    to.iter_mut()
                        .zip(block.by_params())
                        .for_each(|(v, row)| *v = row.0[l]);
                }
            }
        });
    }

    fn normal_equations(
        &self,
        points: &[Point3],
        weights: &[f64],
        a: &[f64],
        gradient: &mut [f64],
        hessian: &mut [f64],
    ) -> f64 {
        let m = self.tape.n_params;
        let sum = self.reduce(points.len(), 1 + m + m * (m + 1) / 2, |range| {
            let from = range.start;
            self.products(&points[range], weights, from, a)
        });
        gradient[..m].copy_from_slice(&sum[1..=m]);
        let mut at = m + 1;
        for i in 0..m {
            for j in 0..=i {
                hessian[i * m + j] = sum[at];
                hessian[j * m + i] = sum[at];
                at += 1;
            }
        }
        sum[0]
    }

    fn gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], gradients: &mut [Point3]) {
        for_pieces(
            points.len(),
            out,
            gradients.as_flattened_mut(),
            3,
            |range, out, grad| {
                let mut block = Block::gradients(&self.tape, &self.by_space);
                block.bind(a);
                for (k, chunk) in points[range].chunks(LANES).enumerate() {
                    block.load(chunk);
                    out[k * LANES..][..chunk.len()]
                        .copy_from_slice(&block.forward()[..chunk.len()]);
                    block.reverse();
                    let rows = block.by_space();
                    for l in 0..chunk.len() {
                        for (i, row) in rows.iter().enumerate().take(3) {
                            grad[(k * LANES + l) * 3 + i] = row.0[l];
                        }
                    }
                }
            },
        );
    }

    fn sum_of_squares(&self, points: &[Point3], weights: &[f64], a: &[f64]) -> f64 {
        let sum = self.reduce(points.len(), 1, |range| {
            let mut block = Block::values(&self.tape);
            block.bind(a);
            let (mut sums, mut rows) = (ProductSums::new(2), [Lane([0.0; LANES]); 2]);
            for (k, chunk) in points[range.clone()].chunks(LANES).enumerate() {
                block.load(chunk);
                rows[0].0 = *block.forward();
                accumulate(
                    &mut sums,
                    &rows,
                    &Self::lane_weights(weights, range.start + k * LANES, chunk.len()),
                );
            }
            vec![sums.get(0, 0)]
        });
        sum[0]
    }
}

/// Function of space: a model with fixed values of its parameters.
#[derive(Clone, Debug)]
pub struct Bound {
    residual: Residual,
    /// The values of the parameters.
    a: Vec<f64>,
}

impl Bound {
    /// Fixes the parameters of f(x; a).
    ///
    /// # Panics
    /// If `a` has the wrong length.
    pub fn new(residual: Residual, a: &[f64]) -> Self {
        assert_eq!(a.len(), residual.dim(), "one value per parameter");
        Self {
            residual,
            a: a.to_vec(),
        }
    }
    /// Returns the values of the parameters.
    pub fn parameters(&self) -> &[f64] {
        &self.a
    }

    /// Evaluates f in any number type.
    fn run<R: Real>(&self, x: [R; 3]) -> R {
        let a: Vec<R> = self.a.iter().map(|&v| R::constant(v)).collect();
        self.residual.tape.eval(&x, &a, &mut Vec::new())
    }

    /// Computes 2-jets (value, gradient and Hessian) at many points, in blocks, on all threads of
    /// the current pool for large inputs.
    ///
    /// # Panics
    /// If `out` is shorter than `points`.
    pub fn jets(&self, points: &[Point3], out: &mut [Jet2]) {
        let out = &mut out[..points.len()];
        let piece = |points: &[Point3], out: &mut [Jet2]| {
            let mut block = JetBlock::new(&self.residual.tape, &self.a);
            for (p, o) in points.chunks(jets::LANES).zip(out.chunks_mut(jets::LANES)) {
                block.eval(p, o);
            }
        };
        if points.len() <= BATCH_POINTS || rayon::current_num_threads() == 1 {
            piece(points, out);
        } else {
            points
                .par_chunks(BATCH_POINTS)
                .zip(out.par_chunks_mut(BATCH_POINTS))
                .for_each(|(p, o)| piece(p, o));
        }
    }

    /// Returns a box and the parameters as intervals.
    fn intervals(&self, region: Aabb) -> ([Interval; 3], Vec<Interval>) {
        let x = std::array::from_fn(|i| Interval::new(region.lo[i], region.hi[i]));
        (x, self.a.iter().map(|&v| Interval::new(v, v)).collect())
    }

    /// Bounds f over a box; also returns f with a shorter tape, valid in the box, if some of its
    /// branches are decided there.
    pub fn bounds_and_rest(&self, region: Aabb) -> (Interval, Option<Self>) {
        let (x, a) = self.intervals(region);
        let (range, rest) = self.residual.tape.bounds(&x, &a);
        (
            range,
            rest.map(|tape| Self {
                residual: Residual::new(tape),
                a: self.a.clone(),
            }),
        )
    }
}

impl Field for Bound {
    fn value(&self, p: Point3) -> f64 {
        self.residual.tape.eval(&p, &self.a, &mut Vec::new())
    }
    fn jet(&self, p: Point3) -> Jet2 {
        let x: [Jet2; 3] = std::array::from_fn(|i| Jet2::variable(p[i], i));
        let a: Vec<Jet2> = self.a.iter().map(|&v| Real::constant(v)).collect();
        self.residual.tape.eval(&x, &a, &mut Vec::new())
    }
    fn bounds(&self, region: Aabb) -> Interval {
        let (x, a) = self.intervals(region);
        self.residual.tape.range(&x, &a, &mut Vec::new())
    }
    fn values(&self, points: &[Point3], out: &mut [f64]) {
        ParamField::values(&self.residual, points, &self.a, out);
    }
    fn jets(&self, points: &[Point3], out: &mut [Jet2]) {
        Self::jets(self, points, out);
    }
    fn jet3(&self, p: Point3) -> Option<Jet3> {
        Some(self.run(std::array::from_fn(|i| Jet3::variable(p[i], i))))
    }
    fn expansion(&self, at: Point3, region: Aabb) -> Option<Expansion> {
        if self.residual.tape.has_natives() {
            return None;
        }
        let point = self.run(std::array::from_fn(|i| {
            <IntervalJet>::variable(Interval::new(at[i], at[i]), i)
        }));
        let whole = self.run(std::array::from_fn(|i| {
            <IntervalJet>::variable(Interval::new(region.lo[i], region.hi[i]), i)
        }));
        Some(Expansion {
            value: point.v,
            gradient: point.g,
            hessian: point.h,
            third: whole.t,
        })
    }
}
