//! Evaluation at many points by simplified functions for subsets of them.
//!
//! Points are partitioned by bisection of their box. In every eighth of a box the function is
//! simplified ([`Tape::bounds`]): of a union of many thousand balls about ten are left for a
//! handful of points. The simplified function computes bitwise identical values, so that results do
//! not depend on the partition.

use crate::block::{Block, LANES};
use crate::ops::SetOp;
use crate::tape::{Op, Tape};
use isoform_geom::{Aabb, Point3};
use isoform_num::Interval;

/// Minimum number of operations of a function for which points are partitioned. For smaller
/// functions sorting the points costs as much as it saves; a much larger value would leave
/// functions of medium size slow.
const MIN_OPERATIONS: usize = 1000;
/// Minimum number of points for a partition. With ten thousand, the subsets are so small that
/// simplification costs as much as it saves.
const MIN_PARTITIONED_POINTS: usize = 1 << 15;
/// Number of operations up to which a function is not simplified further.
const MAX_FINAL_OPERATIONS: usize = 64;
/// Minimum number of points in a subset for simplification if the previous simplification
/// succeeded. A simplification costs as much as about four blocks of values.
const MIN_POINTS_AFTER_SUCCESS: usize = 160;
/// Minimum number of points in a subset for simplification if the previous simplification failed,
/// but may succeed in smaller boxes. The cost of failures is about a tenth of the evaluation at
/// this number and higher at a smaller one.
const MIN_POINTS_AFTER_FAILURE: usize = 1024;
/// Fraction of the operations below which a simplification counts as successful, which permits
/// subsets of [`MIN_POINTS_AFTER_SUCCESS`] points. For a union of disjoint balls given by
/// distances, the first eighth of the box leaves four fifths of the operations, the next one a
/// fifth; a function that cannot be simplified keeps all.
const SUCCESS_FRACTION: f64 = 0.9;
/// Number of bisections between simplifications: one along each axis of a cube.
const BISECTIONS_PER_ROUND: usize = 3;

/// Returns true if partitioning the points may save more than it costs.
pub(crate) fn pays(tape: &Tape, points: &[Point3]) -> bool {
    let decides = |op: &Op| matches!(op, Op::Select | Op::Set(SetOp::Max | SetOp::Min));
    points.len() >= MIN_PARTITIONED_POINTS
        && tape.len() >= MIN_OPERATIONS
        && tape.code.iter().any(|i| decides(&i.op))
        && points.as_flattened().iter().all(|v| v.is_finite())
}

/// Evaluates the first result at the points.
///
/// # Panics
/// If `a` is shorter than the tape's parameters, or a point is not finite.
pub(crate) fn values(tape: &Tape, points: &[Point3], a: &[f64], out: &mut [f64]) {
    let search = PartitionedEvaluation {
        points,
        a,
        ranges: a.iter().map(|&v| Interval::new(v, v)).collect(),
    };
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    let mut found = vec![0.0; points.len()];
    search.values(tape, PartitionState::default(), &mut order, &mut found);
    for (i, value) in order.into_iter().zip(found) {
        out[i as usize] = value;
    }
}

/// History of a subset of the points.
#[derive(Clone, Copy, Default)]
struct PartitionState {
    /// Number of bisections since the last simplification.
    halvings: usize,
    /// True if that simplification succeeded.
    shrunk: bool,
}

struct PartitionedEvaluation<'a> {
    points: &'a [Point3],
    a: &'a [f64],
    /// Parameters as intervals.
    ranges: Vec<Interval>,
}

impl PartitionedEvaluation<'_> {
    /// Computes values at the points `order`, which is permuted; `out` is in the new order.
    fn values(&self, tape: &Tape, course: PartitionState, order: &mut [u32], out: &mut [f64]) {
        let enough = if course.shrunk {
            MIN_POINTS_AFTER_SUCCESS
        } else {
            MIN_POINTS_AFTER_FAILURE
        };
        if order.len() < enough << (BISECTIONS_PER_ROUND - course.halvings)
            || tape.len() <= MAX_FINAL_OPERATIONS
        {
            return self.computed(tape, order, out);
        }
        let cell = Aabb::from_points(order.iter().map(|&i| &self.points[i as usize]));
        if course.halvings < BISECTIONS_PER_ROUND {
            return self.halves(tape, course, cell, order, out);
        }
        let shorter = self.deciding(tape, cell);
        let rest = shorter.as_ref().unwrap_or(tape);
        let course = PartitionState {
            halvings: 0,
            shrunk: (rest.len() as f64) < SUCCESS_FRACTION * tape.len() as f64,
        };
        self.values(rest, course, order, out);
    }

    /// Computes the values in the two halves of a cell.
    fn halves(
        &self,
        tape: &Tape,
        course: PartitionState,
        cell: Aabb,
        order: &mut [u32],
        out: &mut [f64],
    ) {
        let (size, middle) = (cell.size(), cell.center());
        let axis = (0..3).fold(0, |best, i| if size[i] > size[best] { i } else { best });
        let is_above = |i: &u32| self.points[*i as usize][axis] > middle[axis];
        order.sort_unstable_by_key(is_above);
        let half = order.partition_point(|i| !is_above(i));
        let ((lower, upper), (below, above)) = (order.split_at_mut(half), out.split_at_mut(half));
        if lower.is_empty() || upper.is_empty() {
            // All points coincide.
            return self.computed(tape, order, out);
        }
        let course = PartitionState {
            halvings: course.halvings + 1,
            ..course
        };
        let both = [(lower, below), (upper, above)];
        let [mut work, mut rest] =
            both.map(|(order, out)| move || self.values(tape, course, order, out));
        if rayon::current_num_threads() == 1 {
            work();
            rest();
        } else {
            rayon::join(work, rest);
        }
    }

    /// Simplifies the function for a cell.
    fn deciding(&self, tape: &Tape, cell: Aabb) -> Option<Tape> {
        let x: [Interval; 3] = std::array::from_fn(|i| Interval::new(cell.lo[i], cell.hi[i]));
        tape.bounds(&x, &self.ranges).1
    }

    /// Computes values at the points `order`, block by block.
    fn computed(&self, tape: &Tape, order: &[u32], out: &mut [f64]) {
        Block::with_kept_rows(tape, |block| {
            block.bind(self.a);
            let mut points = Vec::with_capacity(LANES);
            for (order, out) in order.chunks(LANES).zip(out.chunks_mut(LANES)) {
                points.clear();
                points.extend(order.iter().map(|&i| self.points[i as usize]));
                block.load(&points);
                out.copy_from_slice(&block.forward()[..out.len()]);
            }
        });
    }
}
