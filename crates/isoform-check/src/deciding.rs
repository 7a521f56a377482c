//! The piece that decides a solid's value, at many points.
//!
//! Points are split recursively by halves of their box, and intervals prune the tree in each box
//! (Duff, Interval arithmetic and recursive subdivision, SIGGRAPH 1992): of a union of thousands of
//! balls about ten remain for a handful of points. The pruned tree gives the value of the whole
//! tree, bit for bit.

use isoform_control::Control;
use isoform_geom::{Aabb, Csg, Point3, Solid};
use isoform_num::Interval;
use rayon::prelude::*;

/// Number of points evaluated in one call.
const POINTS_PER_CALL: usize = 256;
/// Number of points that are not split further: bounding a piece costs as much as about ten values.
const MAX_LEAF_POINTS: usize = 32;
/// Number of pieces that are not pruned further.
const MAX_LEAF_PIECES: usize = 8;

/// Returns the piece that decides at each point, the first in the tree if several do; an arbitrary
/// one for points not reached before a stop.
pub(crate) fn deciding_pieces(
    solid: &dyn Solid,
    points: &[Point3],
    control: &Control<'_>,
) -> Vec<u32> {
    let search = DecidingSearch {
        solid,
        points,
        control,
    };
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    let mut out = vec![0; points.len()];
    for (i, piece) in search.pieces(&mut order, &PrunedTree::new(solid.tree().clone())) {
        out[i as usize] = piece;
    }
    out
}

/// Part of a tree that decides in a box.
struct PrunedTree {
    tree: Csg,
    /// Pieces of the tree, sorted, without duplicates.
    pieces: Vec<u32>,
}

impl PrunedTree {
    fn new(tree: Csg) -> Self {
        let mut pieces = tree.pieces();
        pieces.sort_unstable();
        pieces.dedup();
        Self { tree, pieces }
    }

    /// Returns the position of a piece in the list.
    fn at(&self, piece: u32) -> usize {
        let at = self.pieces.binary_search(&piece);
        at.expect("the pieces are those of the tree")
    }
}

struct DecidingSearch<'a> {
    solid: &'a dyn Solid,
    points: &'a [Point3],
    control: &'a Control<'a>,
}

impl DecidingSearch<'_> {
    /// Returns pairs of point index and deciding piece for the points in `order`, in any order.
    fn pieces(&self, order: &mut [u32], room: &PrunedTree) -> Vec<(u32, u32)> {
        if self.control.is_stopped() {
            return Vec::new();
        }
        if room.pieces.len() <= MAX_LEAF_PIECES || order.len() <= MAX_LEAF_POINTS {
            let tasks = order.par_chunks(POINTS_PER_CALL);
            return tasks.flat_map_iter(|task| self.asked(task, room)).collect();
        }
        let place = |i: &u32| self.points[*i as usize];
        let of_order: Vec<Point3> = order.iter().map(place).collect();
        let cell = Aabb::from_points(&of_order);
        let room = self.narrowed(room, cell);
        let (size, middle) = (cell.size(), cell.center());
        let axis = (0..3).fold(0, |best, i| if size[i] > size[best] { i } else { best });
        order.sort_unstable_by_key(|i| (place(i)[axis] > middle[axis], *i));
        let half = order.partition_point(|i| place(i)[axis] <= middle[axis]);
        let (lower, upper) = order.split_at_mut(half);
        if lower.is_empty() || upper.is_empty() {
            // All points coincide.
            let tasks = order.par_chunks(POINTS_PER_CALL);
            return tasks
                .flat_map_iter(|task| self.asked(task, &room))
                .collect();
        }
        let (mut found, rest) =
            rayon::join(|| self.pieces(lower, &room), || self.pieces(upper, &room));
        found.extend(rest);
        found
    }

    /// Returns the part of a pruned tree that can decide in a cell.
    fn narrowed(&self, room: &PrunedTree, cell: Aabb) -> PrunedTree {
        let mut ranges = vec![Interval::ALL; room.pieces.len()];
        self.solid.value_bounds(&room.pieces, cell, &mut ranges);
        PrunedTree::new(room.tree.deciding(&|piece| ranges[room.at(piece)]))
    }

    /// Returns the deciding piece of each of some points, from the values of all pieces of a pruned
    /// tree.
    fn asked(&self, task: &[u32], room: &PrunedTree) -> Vec<(u32, u32)> {
        let points: Vec<Point3> = task.iter().map(|&i| self.points[i as usize]).collect();
        let mut values = vec![0.0; room.pieces.len() * points.len()];
        self.solid.values(&room.pieces, &points, &mut values);
        let piece = |k: usize| {
            let value = |piece: u32| values[room.at(piece) * points.len() + k];
            room.tree.value_and_piece(&value).1
        };
        task.iter()
            .enumerate()
            .map(|(k, &i)| (i, piece(k)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_num::{Jet2, Random, Real};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A union of balls in a row, some of them NaN on one side, that counts its evaluations.
    struct Balls {
        names: Vec<String>,
        tree: Csg,
        values: AtomicUsize,
    }

    impl Balls {
        fn new(n: u32) -> Self {
            Self {
                names: (0..n).map(|k| k.to_string()).collect(),
                tree: Csg::Max((0..n).map(Csg::Piece).collect()),
                values: AtomicUsize::new(0),
            }
        }
        fn value<R: Real>(piece: u32, p: [R; 3]) -> R {
            let [x, y, z] = p;
            let off = x - R::constant(f64::from(piece));
            let g = R::constant(0.5) - off.square() - y.square() - z.square();
            if piece % 50 == 7 {
                (g + R::constant(100.0)).sqrt() - R::constant(10.0)
            } else {
                g
            }
        }
    }

    impl Solid for Balls {
        fn names(&self) -> &[String] {
            &self.names
        }
        fn tree(&self) -> &Csg {
            &self.tree
        }
        fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
            self.values
                .fetch_add(which.len() * points.len(), Ordering::Relaxed);
            for (row, &piece) in which.iter().enumerate() {
                for (i, p) in points.iter().enumerate() {
                    out[row * points.len() + i] = Self::value(piece, *p);
                }
            }
        }
        fn gradient(&self, _: u32, _: Point3) -> (f64, Point3) {
            unreachable!("values are enough")
        }
        fn jet(&self, _: u32, _: Point3) -> Jet2 {
            unreachable!("values are enough")
        }
        fn bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
            for (&piece, out) in which.iter().zip(out) {
                let at = |i: usize| Interval::new(region.lo[i], region.hi[i]);
                *out = Self::value(piece, [at(0), at(1), at(2)]);
            }
        }
        fn value_bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
            self.bounds(which, region, out);
            for (&piece, out) in which.iter().zip(out) {
                if piece % 50 == 7 {
                    *out = Interval::ALL;
                }
            }
        }
        fn sign_values(&self, _: &[Point3], _: &mut [f64]) {
            unreachable!("values are enough")
        }
    }

    fn points(n: usize, length: f64) -> Vec<Point3> {
        let mut random = Random::new(5);
        let mut places: Vec<Point3> = (0..n)
            .map(|_| [random.unit() * length, random.unit(), random.unit()])
            .collect();
        places[n / 2] = places[0];
        places
    }

    /// The piece is that of the whole tree, also where the value of a piece is NaN.
    #[test]
    fn what_is_left_out_does_not_decide() {
        let balls = Balls::new(300);
        let points = points(2000, 300.0);
        let found = deciding_pieces(&balls, &points, &Control::default());
        for (p, found) in points.iter().zip(found) {
            let value = |piece| Balls::value(piece, *p);
            assert_eq!(found, balls.tree.value_and_piece(&value).1, "{p:?}");
        }
    }

    /// Eight times as many balls with eight times as many points cost eight times as much.
    #[test]
    fn the_cost_per_point_does_not_grow_with_the_pieces() {
        let cost = |n: u32| {
            let mut balls = Balls::new(n);
            balls.tree = Csg::Max((0..n).filter(|k| k % 50 != 7).map(Csg::Piece).collect());
            let points = points(20 * n as usize, f64::from(n));
            deciding_pieces(&balls, &points, &Control::default());
            balls.values.into_inner() as f64 / points.len() as f64
        };
        let [few, many] = [320, 2560].map(cost);
        assert!(
            few < 20.0 && many < 1.2 * few,
            "{few} and {many} values per point"
        );
    }
}
