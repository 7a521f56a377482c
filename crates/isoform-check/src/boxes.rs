//! A bounding volume hierarchy: finds the boxes that meet a given one, and the pairs that meet.
//!
//! The boxes are sorted along the Morton curve of their centres; a complete binary tree stands over
//! runs of [`BOXES_PER_LEAF`] of them. Building takes one sort, the shape of the tree depends only
//! on the number of boxes, and no pointers are stored.

use isoform_geom::{Aabb, Point3};
use rayon::prelude::*;

/// Number of boxes in a leaf. Values from 2 to 8 differ by less than a third in time.
const BOXES_PER_LEAF: usize = 4;
/// Maximum coordinate in a Morton key: 21 bits, so that three of them fit 64 bits.
const MAX_KEY_COORDINATE: u64 = 0x1f_ffff;

/// Bounding volume hierarchy of an array of boxes.
#[derive(Debug)]
pub(super) struct BoxTree {
    /// Indices of the boxes in Morton order.
    order: Vec<u32>,
    /// Boxes in Morton order.
    boxes: Vec<Aabb>,
    /// Bounding box of each node; node k has the children 2k and 2k + 1, and the leaves are the
    /// last `leaves` nodes.
    nodes: Vec<Aabb>,
    /// Number of leaves, a power of two; the last ones may be empty.
    leaves: usize,
}

/// Returns true if two closed boxes have a point in common.
fn meet(a: &Aabb, b: &Aabb) -> bool {
    (0..3).all(|i| a.lo[i] <= b.hi[i]) && (0..3).all(|i| b.lo[i] <= a.hi[i])
}

/// Returns the smallest box around two boxes.
fn join(a: &Aabb, b: &Aabb) -> Aabb {
    Aabb {
        lo: std::array::from_fn(|i| a.lo[i].min(b.lo[i])),
        hi: std::array::from_fn(|i| a.hi[i].max(b.hi[i])),
    }
}

/// Spreads the lowest 21 bits of `v`, two zeros after each.
fn spread(v: u64) -> u64 {
    let mut x = v & MAX_KEY_COORDINATE;
    for (shift, mask) in [
        (32, 0x1f_0000_0000_ffff),
        (16, 0x1f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        x = (x | x << shift) & mask;
    }
    x
}

/// Returns the indices of the boxes in the Morton order of their centres.
fn morton_order(boxes: &[Aabb]) -> Vec<u32> {
    let centers: Vec<Point3> = boxes.par_iter().map(Aabb::center).collect();
    let all = Aabb::from_points(&centers);
    let scale = all.size().map(|s| {
        if s > 0.0 {
            MAX_KEY_COORDINATE as f64 / s
        } else {
            0.0
        }
    });
    // The cast saturates, so that any number gives a valid key, infinite ones too.
    let key = |p: &Point3| {
        (0..3).fold(0, |k, i| {
            k | spread(((p[i] - all.lo[i]) * scale[i]) as u64) << i
        })
    };
    let mut keys: Vec<(u64, u32)> = centers
        .par_iter()
        .enumerate()
        .map(|(i, p)| (key(p), i as u32))
        .collect();
    keys.par_sort_unstable();
    keys.into_iter().map(|(_, i)| i).collect()
}

impl BoxTree {
    /// Builds the tree over fewer than 2³² boxes. No coordinate may be NaN; nothing meets an empty
    /// box.
    pub(super) fn new(boxes: &[Aabb]) -> Self {
        let order = morton_order(boxes);
        let boxes: Vec<Aabb> = order.iter().map(|&i| boxes[i as usize]).collect();
        let leaves = boxes.len().div_ceil(BOXES_PER_LEAF).next_power_of_two();
        let mut nodes = vec![Aabb::EMPTY; 2 * leaves];
        for (node, run) in nodes[leaves..].iter_mut().zip(boxes.chunks(BOXES_PER_LEAF)) {
            *node = run.iter().fold(Aabb::EMPTY, |a, b| join(&a, b));
        }
        for k in (1..leaves).rev() {
            nodes[k] = join(&nodes[2 * k], &nodes[2 * k + 1]);
        }
        Self {
            order,
            boxes,
            nodes,
            leaves,
        }
    }

    /// Visits the leaves whose boxes meet `b`, from index `from` on, in ascending order.
    fn leaves_meeting(&self, b: &Aabb, from: usize, mut visit: impl FnMut(usize)) {
        let mut stack = [0u32; 72];
        let mut depth = 1;
        stack[0] = 1;
        while depth > 0 {
            depth -= 1;
            let node = stack[depth] as usize;
            // The last leaf below this node.
            let levels = self.leaves.ilog2() - node.ilog2();
            let last = ((node + 1) << levels) - 1 - self.leaves;
            if last < from || !meet(&self.nodes[node], b) {
                continue;
            }
            if node >= self.leaves {
                visit(node - self.leaves);
            } else {
                stack[depth] = 2 * node as u32 + 1;
                stack[depth + 1] = 2 * node as u32;
                depth += 2;
            }
        }
    }

    /// Returns the range of a leaf's boxes in `boxes`.
    fn run(&self, leaf: usize) -> std::ops::Range<usize> {
        let from = (leaf * BOXES_PER_LEAF).min(self.boxes.len());
        from..(from + BOXES_PER_LEAF).min(self.boxes.len())
    }

    /// Visits the boxes that meet `b`, in an order that depends only on the boxes of the tree.
    pub(super) fn query(&self, b: &Aabb, mut visit: impl FnMut(u32)) {
        self.leaves_meeting(b, 0, |leaf| {
            for k in self.run(leaf) {
                if meet(&self.boxes[k], b) {
                    visit(self.order[k]);
                }
            }
        });
    }

    /// Returns the number of leaves, for [`Self::pairs_of_leaf`].
    pub(super) fn leaves(&self) -> usize {
        self.boxes.len().div_ceil(BOXES_PER_LEAF)
    }

    /// Visits the pairs of boxes that meet, one of them in this leaf and the other in this leaf or
    /// a later one.
    pub(super) fn pairs_of_leaf(&self, leaf: usize, mut visit: impl FnMut(u32, u32)) {
        let own = self.run(leaf);
        self.leaves_meeting(&self.nodes[self.leaves + leaf], leaf, |other| {
            for i in own.clone() {
                for j in self.run(other).filter(|&j| j > i) {
                    if meet(&self.boxes[i], &self.boxes[j]) {
                        visit(self.order[i], self.order[j]);
                    }
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn some_box() -> impl Strategy<Value = Aabb> {
        (
            prop::array::uniform3(0..20i32),
            prop::array::uniform3(0..6i32),
        )
            .prop_map(|(lo, size)| Aabb {
                lo: lo.map(f64::from),
                hi: std::array::from_fn(|i| f64::from(lo[i] + size[i])),
            })
    }

    proptest! {
        #[test]
        fn the_pairs_are_all_the_pairs(boxes in prop::collection::vec(some_box(), 0..60), q in some_box()) {
            let tree = BoxTree::new(&boxes);
            let mut found = Vec::new();
            for leaf in 0..tree.leaves() {
                tree.pairs_of_leaf(leaf, |a, b| found.push((a.min(b), a.max(b))));
            }
            found.sort_unstable();
            let n = boxes.len() as u32;
            let at = |i: u32| &boxes[i as usize];
            let all: Vec<(u32, u32)> = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))).filter(|&(a, b)| meet(at(a), at(b))).collect();
            prop_assert_eq!(found, all);
            let mut hits = Vec::new();
            tree.query(&q, |i| hits.push(i));
            hits.sort_unstable();
            prop_assert_eq!(hits, (0..n).filter(|&i| meet(at(i), &q)).collect::<Vec<_>>());
        }
    }
}
