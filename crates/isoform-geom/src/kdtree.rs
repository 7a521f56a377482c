//! Nearest-neighbour search in space.

use crate::point::check_points;
use crate::{Point3, distance_squared};

/// Maximum number of points per leaf. Query times for 8 to 32 differ by less than a tenth.
const MAX_LEAF_POINTS: usize = 12;

/// Balanced, immutable kd-tree of points. It is built deterministically; of points at equal
/// distances the one with the lower index comes first.
///
/// ```
/// use isoform_geom::KdTree;
///
/// let tree = KdTree::new(&[[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [9.0, 0.0, 0.0]]);
/// assert_eq!(tree.nearest([3.0, 0.0, 0.0]), Some((0, 9.0)));
/// let mut found = Vec::new();
/// tree.nearest_k([3.0, 3.0, 0.0], 2, &mut found);
/// assert_eq!(found, [(1.0, 1), (18.0, 0)]);
/// ```
#[derive(Clone, Debug)]
pub struct KdTree {
    points: Vec<Point3>,
    index: Vec<u32>,
    /// Split axis of each node, stored at the index of the node's median point.
    axis: Vec<u8>,
}

impl KdTree {
    /// Builds the tree; O(n log n).
    ///
    /// # Panics
    /// If there are 2³² points or more, or a coordinate is not finite.
    pub fn new(points: &[Point3]) -> Self {
        check_points(points);
        let mut items: Vec<(Point3, u32)> = points.iter().copied().zip(0..).collect();
        let mut axis = vec![0; points.len()];
        build(&mut items, &mut axis);
        let (points, index) = items.into_iter().unzip();
        Self {
            points,
            index,
            axis,
        }
    }

    /// Returns the number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }
    /// Returns true if the tree is empty.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Returns the index and squared distance of the nearest point; `None` for an empty tree.
    pub fn nearest(&self, q: Point3) -> Option<(usize, f64)> {
        let mut best = (f64::INFINITY, u32::MAX);
        self.near(q, f64::INFINITY, &mut |d, i| {
            if (d, i) < best {
                best = (d, i);
            }
            best.0
        });
        (best.1 != u32::MAX).then_some((best.1 as usize, best.0))
    }

    /// Writes the `k` nearest points to `found` as (squared distance, index), nearest first.
    pub fn nearest_k(&self, q: Point3, k: usize, found: &mut Vec<(f64, u32)>) {
        found.clear();
        found.resize(k.min(self.points.len()), (f64::INFINITY, u32::MAX));
        if !found.is_empty() {
            self.near(q, f64::INFINITY, &mut |d, i| insert(found, (d, i)));
        }
    }

    /// Calls `visit` with the squared distance and the index of every point whose squared distance
    /// from `q` is at most `squared`, in the nearer half of each node first. `visit` returns the
    /// squared distance that bounds the rest of the search.
    pub fn near(&self, q: Point3, squared: f64, visit: &mut impl FnMut(f64, u32) -> f64) {
        self.near_in(q, squared, 0, self.points.len(), [0.0; 3], visit);
    }

    /// Searches a range of the points, the nearer half first. `off` is the offset of `q` from the
    /// cell of the range along each axis, from which the exact distance from the cell follows.
    fn near_in(
        &self,
        q: Point3,
        mut reach: f64,
        from: usize,
        to: usize,
        off: Point3,
        visit: &mut impl FnMut(f64, u32) -> f64,
    ) -> f64 {
        if to - from <= MAX_LEAF_POINTS {
            for at in from..to {
                let d = distance_squared(q, self.points[at]);
                if d <= reach {
                    reach = visit(d, self.index[at]);
                }
            }
            return reach;
        }
        let mid = from + (to - from) / 2;
        let axis = usize::from(self.axis[mid]);
        let gap = q[axis] - self.points[mid][axis];
        let d = distance_squared(q, self.points[mid]);
        if d <= reach {
            reach = visit(d, self.index[mid]);
        }
        let mut far = off;
        far[axis] = gap;
        let halves = if gap < 0.0 {
            [(from, mid), (mid + 1, to)]
        } else {
            [(mid + 1, to), (from, mid)]
        };
        reach = self.near_in(q, reach, halves[0].0, halves[0].1, off, visit);
        let bound = far[0] * far[0] + far[1] * far[1] + far[2] * far[2];
        if bound <= reach {
            reach = self.near_in(q, reach, halves[1].0, halves[1].1, far, visit);
        }
        reach
    }
}

/// Inserts an item into the sorted list of the nearest ones and drops the farthest. Returns the
/// squared distance of the farthest one left.
fn insert(found: &mut [(f64, u32)], item: (f64, u32)) -> f64 {
    let is_before = |other: (f64, u32)| item.0 < other.0 || (item.0 == other.0 && item.1 < other.1);
    let last = found.len() - 1;
    if is_before(found[last]) {
        let mut at = last;
        while at > 0 && is_before(found[at - 1]) {
            found[at] = found[at - 1];
            at -= 1;
        }
        found[at] = item;
    }
    found[last].0
}

fn build(items: &mut [(Point3, u32)], split: &mut [u8]) {
    if items.len() <= MAX_LEAF_POINTS {
        return;
    }
    let size = crate::Aabb::from_points(items.iter().map(|item| &item.0)).size();
    let axis = (0..3).fold(0, |best, i| if size[i] > size[best] { i } else { best });
    let mid = items.len() / 2;
    match axis {
        0 => halve::<0>(items, mid),
        1 => halve::<1>(items, mid),
        _ => halve::<2>(items, mid),
    }
    split[mid] = axis as u8;
    let (low, high) = items.split_at_mut(mid);
    let (low_split, high_split) = split.split_at_mut(mid);
    build(low, low_split);
    build(&mut high[1..], &mut high_split[1..]);
}

/// Partitions items along an axis around their median, which is placed at `mid`.
fn halve<const AXIS: usize>(items: &mut [(Point3, u32)], mid: usize) {
    items.select_nth_unstable_by(mid, |a, b| {
        a.0[AXIS].total_cmp(&b.0[AXIS]).then(a.1.cmp(&b.1))
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_brute_force(points in prop::collection::vec(prop::array::uniform3(-5i8..5), 1..200), k in 1usize..12) {
            // Small integers: many ties and duplicates.
            let points: Vec<Point3> = points.iter().map(|p| p.map(f64::from)).collect();
            let tree = KdTree::new(&points);
            let q = [0.25, -0.5, 1.0];
            let mut want: Vec<(f64, u32)> = points.iter().enumerate().map(|(i, p)| (distance_squared(q, *p), i as u32)).collect();
            want.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
            want.truncate(k);
            let mut found = Vec::new();
            tree.nearest_k(q, k, &mut found);
            prop_assert_eq!(&found, &want);
            prop_assert_eq!(tree.nearest(q), want.first().map(|w| (w.1 as usize, w.0)));
            let mut within = Vec::new();
            tree.near(q, 4.0, &mut |d, i| {
                within.push((d, i));
                4.0
            });
            within.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
            want.retain(|w| w.0 <= 4.0);
            if want.len() < k {
                prop_assert_eq!(within, want);
            }
        }
    }
}
