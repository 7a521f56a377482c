//! Pairs of points within a distance of each other.

use crate::point::check_points;
use crate::{Aabb, Point3, distance_squared};

/// Indices of a cell: layer, row and position in the row.
type CellIndex = [i64; 3];
/// Relative margin of the cell size above the reach, so that rounding never places near points two
/// cells apart. It is far above the rounding error of indices up to [`MAX_CELLS_PER_AXIS`], and too
/// small to add noticeable work.
const CELL_SIZE_MARGIN: f64 = 1e-9;
/// Maximum number of cells along an axis: the relative rounding error of cell indices is then far
/// below [`CELL_SIZE_MARGIN`].
const MAX_CELLS_PER_AXIS: f64 = 1e6;

/// Rows of cells after a cell's own row whose points may be near, as offsets of layer and row.
const ROWS_AFTER: [[i64; 2]; 4] = [[0, 1], [1, -1], [1, 0], [1, 1]];

/// Calls `visit` with the indices of every pair of points that are at most `reach` apart, once each
/// with the lower index first, and with their squared distance. The order of the calls depends on
/// the points alone.
///
/// Points are sorted into cells of the size of `reach`: O(n log n) and the pairs in neighbouring
/// cells.
///
/// ```
/// let points = [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
/// let mut pairs = Vec::new();
/// isoform_geom::near_pairs(&points, 2.0, |i, j, squared| pairs.push((i, j, squared)));
/// assert_eq!(pairs, [(0, 2, 4.0)]);
/// ```
///
/// # Panics
/// If there are 2³² points or more, or a coordinate is not finite.
pub fn near_pairs(points: &[Point3], reach: f64, mut visit: impl FnMut(usize, usize, f64)) {
    check_points(points);
    let bounds = Aabb::from_points(points);
    let size = (reach * (1.0 + CELL_SIZE_MARGIN)).max(bounds.diagonal() / MAX_CELLS_PER_AXIS);
    // A cast maps NaN to 0: if sizes overflow, all points are in one cell.
    let number = |p: Point3, axis: usize| ((p[axis] - bounds.lo[axis]) / size) as i64;
    let cell = |p: Point3| [number(p, 2), number(p, 1), number(p, 0)];
    let mut sorted: Vec<(CellIndex, u32, Point3)> = points
        .iter()
        .zip(0..)
        .map(|(p, i)| (cell(*p), i, *p))
        .collect();
    sorted.sort_unstable_by_key(|item| (item.0, item.1));
    let mut meet = |a: &(CellIndex, u32, Point3), b: &(CellIndex, u32, Point3)| {
        let squared = distance_squared(a.2, b.2);
        if squared <= reach * reach {
            let (i, j) = (a.1.min(b.1), a.1.max(b.1));
            visit(i as usize, j as usize, squared);
        }
    };
    // Index of the first point of each row that may be near the current one; it never decreases.
    let mut from = [0; ROWS_AFTER.len()];
    for (k, a) in sorted.iter().enumerate() {
        let [layer, row, at] = a.0;
        let own = &sorted[k + 1..];
        let is_near = |b: &&(CellIndex, u32, Point3)| b.0 <= [layer, row, at + 1];
        own.iter().take_while(is_near).for_each(|b| meet(a, b));
        for (from, [up, along]) in from.iter_mut().zip(ROWS_AFTER) {
            let beside = |at: i64| [layer + up, row + along, at];
            while sorted.get(*from).is_some_and(|b| b.0 < beside(at - 1)) {
                *from += 1;
            }
            let is_near = |b: &&(CellIndex, u32, Point3)| b.0 <= beside(at + 1);
            let row = sorted[*from..].iter().take_while(is_near);
            row.for_each(|b| meet(a, b));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Finds near pairs by testing all pairs.
    fn all_pairs(points: &[Point3], reach: f64) -> Vec<(usize, usize)> {
        let pairs = (0..points.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        let is_near =
            |&(i, j): &(usize, usize)| distance_squared(points[i], points[j]) <= reach * reach;
        let mut near: Vec<(usize, usize)> = pairs.filter(is_near).collect();
        near.sort_unstable();
        near
    }

    fn found(points: &[Point3], reach: f64) -> Vec<(usize, usize)> {
        let mut pairs = Vec::new();
        near_pairs(points, reach, |i, j, squared| {
            assert_eq!(squared, distance_squared(points[i], points[j]));
            pairs.push((i, j));
        });
        pairs.sort_unstable();
        pairs
    }

    proptest! {
        /// Compares with all pairs, for points on a lattice (with distances equal to the reach), in
        /// a plane and scattered.
        #[test]
        fn each_near_pair_is_met_once(
            points in prop::collection::vec(prop::array::uniform3(-6i32..6), 0..60),
            spread in 0.0..1.0f64,
            flat in 0usize..3,
            reach in prop::sample::select(vec![0.0, 0.3, 1.0, 2.0, 3.7, 40.0]),
        ) {
            let shift = |k: usize, i: usize| spread * (((k * 31 + i * 17) % 13) as f64 / 13.0);
            let place = |(k, p): (usize, &[i32; 3])| -> Point3 {
                std::array::from_fn(|i| match i < flat {
                    true => 1.0,
                    false => f64::from(p[i]) + shift(k, i),
                })
            };
            let points: Vec<Point3> = points.iter().enumerate().map(place).collect();
            prop_assert_eq!(found(&points, reach), all_pairs(&points, reach));
        }
    }

    /// Tests reaches far below and far above the extent of the points.
    #[test]
    fn extreme_reaches() {
        let points = [
            [0.0; 3],
            [1e300, 0.0, 0.0],
            [1e300, 1.0, 0.0],
            [0.0, 0.0, 0.0],
        ];
        assert_eq!(found(&points, 1e-300), [(0, 3)]);
        assert_eq!(found(&points, f64::INFINITY).len(), 6);
        assert_eq!(found(&[], 1.0), []);
    }
}
