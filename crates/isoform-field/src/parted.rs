//! Values at many points, by shorter functions for parts of them.
//!
//! Points are parted by halves of their box. In every eighth of a box, what does not decide there
//! is left out of the function ([`Tape::bounds`]): of a union of many thousand balls some ten are
//! left for a handful of points. What is left computes the same bits, so that values do not tell
//! how points were parted.

use crate::block::{Block, LANES};
use crate::ops::SetOp;
use crate::tape::{Op, Tape};
use isoform_geom::{Aabb, Point3};
use isoform_num::Interval;

/// Operations of a function from which on it is parted. Below, to sort the points costs as much as
/// is saved; far above, functions of middling size stay slow.
const LONG: usize = 1000;
/// Points from which on they are parted. Of ten thousand each part has so few that to look through
/// its function costs what it saves.
const CROWD: usize = 1 << 15;
/// Operations that are not looked through any more.
const SHORT: usize = 64;
/// Least points in a part for which a function is looked through that did become shorter before.
/// That costs as much as some four blocks of its values.
const FEW: usize = 160;
/// The same where it did not, but may do in smaller boxes. Fewer cost more where it never does: a
/// tenth at this number.
const MANY: usize = 1024;
/// Share of the operations to which a function must shrink to be worth parts of [`FEW`] points. Of
/// balls side by side, whose functions are distances, the first eighth of the box leaves four in
/// five, the next one in five; of what never shrinks all are left.
const SHRUNK: f64 = 0.9;
/// Halvings after which the function is looked through: one along each axis of a cube.
const HALVINGS: usize = 3;

/// Whether to part the points may save more than it costs.
pub(crate) fn pays(tape: &Tape, points: &[Point3]) -> bool {
    let decides = |op: &Op| matches!(op, Op::Select | Op::Set(SetOp::Max | SetOp::Min));
    points.len() >= CROWD
        && tape.len() >= LONG
        && tape.code.iter().any(|i| decides(&i.op))
        && points.as_flattened().iter().all(|v| v.is_finite())
}

/// The values of the first result.
///
/// # Panics
/// If `a` is shorter than the tape's parameters, or a point is not finite.
pub(crate) fn values(tape: &Tape, points: &[Point3], a: &[f64], out: &mut [f64]) {
    let search = Search {
        points,
        a,
        ranges: a.iter().map(|&v| Interval::new(v, v)).collect(),
    };
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    let mut found = vec![0.0; points.len()];
    search.values(tape, Course::default(), &mut order, &mut found);
    for (i, value) in order.into_iter().zip(found) {
        out[i as usize] = value;
    }
}

/// How some points came to be parted from the others.
#[derive(Clone, Copy, Default)]
struct Course {
    /// Halvings since the function was looked through.
    halvings: usize,
    /// Whether it became much shorter then.
    shrunk: bool,
}

struct Search<'a> {
    points: &'a [Point3],
    a: &'a [f64],
    /// The parameters.
    ranges: Vec<Interval>,
}

impl Search<'_> {
    /// Values at the points `order`, which is put into another order meanwhile: `out` is in that.
    fn values(&self, tape: &Tape, course: Course, order: &mut [u32], out: &mut [f64]) {
        let enough = if course.shrunk { FEW } else { MANY };
        if order.len() < enough << (HALVINGS - course.halvings) || tape.len() <= SHORT {
            return self.computed(tape, order, out);
        }
        let cell = Aabb::of(order.iter().map(|&i| &self.points[i as usize]));
        if course.halvings < HALVINGS {
            return self.halves(tape, course, cell, order, out);
        }
        let shorter = self.deciding(tape, cell);
        let rest = shorter.as_ref().unwrap_or(tape);
        let course = Course {
            halvings: 0,
            shrunk: (rest.len() as f64) < SHRUNK * tape.len() as f64,
        };
        self.values(rest, course, order, out);
    }

    /// The values in the two halves of a cell.
    fn halves(&self, tape: &Tape, course: Course, cell: Aabb, order: &mut [u32], out: &mut [f64]) {
        let (size, middle) = (cell.size(), cell.center());
        let axis = (0..3).fold(0, |best, i| if size[i] > size[best] { i } else { best });
        let is_above = |i: &u32| self.points[*i as usize][axis] > middle[axis];
        order.sort_unstable_by_key(is_above);
        let half = order.partition_point(|i| !is_above(i));
        let ((lower, upper), (below, above)) = (order.split_at_mut(half), out.split_at_mut(half));
        if lower.is_empty() || upper.is_empty() {
            // All in one place.
            return self.computed(tape, order, out);
        }
        let course = Course {
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

    /// The function without what does not decide in a cell.
    fn deciding(&self, tape: &Tape, cell: Aabb) -> Option<Tape> {
        let x: [Interval; 3] = std::array::from_fn(|i| Interval::new(cell.lo[i], cell.hi[i]));
        tape.bounds(&x, &self.ranges).1
    }

    /// Values at the points `order`, block by block.
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
