//! Pruning of a solid's tree: the pieces that can decide its sign in a region.
//!
//! If a child of a minimum is negative throughout the region, so is the minimum, and its other
//! children do not matter; a child that is positive throughout does not matter to the minimum. For
//! maxima the signs are exchanged. The remaining pieces are those whose change can change the sign;
//! without remaining pieces the sign is certain. Multiple occurrences of a piece in the tree are
//! treated as independent: a piece that does not matter may therefore be reported, but never the
//! reverse.

use isoform_geom::{Aabb, Csg, Point3, Solid};
use isoform_num::Interval;
use std::collections::HashSet;
use std::sync::Arc;

/// Returns the range of the tree's value for the ranges `ranges` of its pieces, and appends the
/// pieces that can decide its sign to `out`, each once, in the order of the tree.
///
/// No piece is appended if and only if the range has one sign (inside is ≥ 0: \[0, 1\] is certain,
/// \[−1, 0\] is not).
///
/// ```
/// use isoform_geom::Csg;
/// use isoform_mesh::decide::decisive;
/// use isoform_num::Interval;
///
/// // The minimum of a piece that is positive and one of undetermined sign.
/// let tree = Csg::Min(vec![Csg::Piece(0), Csg::Piece(1)]);
/// let ranges = [Interval::new(1.0, 2.0), Interval::new(-1.0, 3.0)];
/// let mut pieces = Vec::new();
/// let range = decisive(&tree, &|i| ranges[i as usize], &mut pieces);
/// assert_eq!((range, pieces), (Interval::new(-1.0, 2.0), vec![1]));
/// ```
pub fn decisive(tree: &Csg, ranges: &impl Fn(u32) -> Interval, out: &mut Vec<u32>) -> Interval {
    let first = out.len();
    let (lo, hi) = collect(tree, ranges, out);
    keep_first(out, first);
    Interval::new(lo, hi)
}

/// Maximum number of pieces that are compared pairwise; above it a hash set is used.
const MAX_PAIRWISE_PIECES: usize = 16;

/// Removes duplicates from index `first` on, keeping the first of each, in linear time.
fn keep_first(out: &mut Vec<u32>, first: usize) {
    let mut kept = first;
    let mut seen = (out.len() - first > MAX_PAIRWISE_PIECES).then(HashSet::new);
    for at in first..out.len() {
        let piece = out[at];
        let is_new = match &mut seen {
            Some(seen) => seen.insert(piece),
            None => !out[first..kept].contains(&piece),
        };
        if is_new {
            out[kept] = piece;
            kept += 1;
        }
    }
    out.truncate(kept);
}

/// Prunes like [`decisive`], but appends each piece once per occurrence.
fn collect(tree: &Csg, ranges: &impl Fn(u32) -> Interval, out: &mut Vec<u32>) -> (f64, f64) {
    let start = out.len();
    let (lo, hi) = match tree {
        Csg::Piece(i) => {
            let r = ranges(*i);
            if r.lo() < 0.0 && r.hi() >= 0.0 {
                out.push(*i);
            }
            return (r.lo(), r.hi());
        }
        Csg::Min(children) => {
            children
                .iter()
                .fold((f64::INFINITY, f64::INFINITY), |(lo, hi), child| {
                    let r = collect(child, ranges, out);
                    (lo.min(r.0), hi.min(r.1))
                })
        }
        Csg::Max(children) => {
            children
                .iter()
                .fold((f64::NEG_INFINITY, f64::NEG_INFINITY), |(lo, hi), child| {
                    let r = collect(child, ranges, out);
                    (lo.max(r.0), hi.max(r.1))
                })
        }
    };
    if lo >= 0.0 || hi < 0.0 {
        out.truncate(start);
    }
    (lo, hi)
}

/// Sign of a solid in a region.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Inside throughout.
    Inside,
    /// Outside throughout.
    Outside,
    /// Undecided: a tree of the decisive pieces that has the solid's sign in the region.
    Mixed(Csg),
}

/// Removes from a tree everything that cannot decide its sign if the pieces have the ranges
/// `ranges`.
pub fn reduced(tree: &Csg, ranges: &impl Fn(u32) -> Interval) -> Sign {
    let join = |children: &[Csg], is_min: bool| {
        let mut rest = Vec::new();
        for child in children {
            match (reduced(child, ranges), is_min) {
                (Sign::Inside, true) | (Sign::Outside, false) => {}
                (Sign::Outside, true) => return Sign::Outside,
                (Sign::Inside, false) => return Sign::Inside,
                (Sign::Mixed(Csg::Min(mut inner)), true)
                | (Sign::Mixed(Csg::Max(mut inner)), false) => rest.append(&mut inner),
                (Sign::Mixed(tree), _) => rest.push(tree),
            }
        }
        match (rest.len(), is_min) {
            (0, true) => Sign::Inside,
            (0, false) => Sign::Outside,
            (1, _) => Sign::Mixed(rest.swap_remove(0)),
            (_, true) => Sign::Mixed(Csg::Min(rest)),
            (_, false) => Sign::Mixed(Csg::Max(rest)),
        }
    };
    match tree {
        Csg::Piece(i) => {
            let r = ranges(*i);
            if r.lo() >= 0.0 {
                Sign::Inside
            } else if r.hi() < 0.0 {
                Sign::Outside
            } else {
                Sign::Mixed(Csg::Piece(*i))
            }
        }
        Csg::Min(children) => join(children, true),
        Csg::Max(children) => join(children, false),
    }
}

/// Part of a solid's tree that matters in a region.
#[derive(Clone, Debug)]
pub(crate) struct Local {
    /// Tree with the sign of the solid throughout the region.
    pub(crate) tree: Arc<Csg>,
    /// Pieces of the tree, without duplicates.
    pub(crate) pieces: Arc<[u32]>,
}

/// Result of [`Local::narrow`].
#[derive(Clone, Debug)]
pub(crate) enum NarrowedTree {
    Inside,
    Outside,
    Mixed(Local),
}

/// Buffers of [`Local::narrow`] and [`Local::value`].
#[derive(Debug)]
pub(crate) struct Scratch {
    ranges: Vec<Interval>,
    by_piece: Vec<Interval>,
    values: Vec<f64>,
    value_of: Vec<f64>,
    out: Vec<u32>,
}

impl Scratch {
    pub(crate) fn new(solid: &dyn Solid) -> Self {
        // A tree with pieces beyond the list of names would be an invalid solid; the arrays are
        // nevertheless long enough for it.
        let n = solid
            .tree()
            .pieces()
            .iter()
            .map(|i| *i as usize + 1)
            .max()
            .unwrap_or(0)
            .max(solid.names().len());
        Self {
            ranges: vec![Interval::ALL; n],
            by_piece: vec![Interval::ALL; n],
            values: vec![0.0; n],
            value_of: vec![0.0; n],
            out: Vec::with_capacity(n),
        }
    }
}

impl Scratch {
    /// Returns the range of a piece in the region of the last [`Local::narrow`].
    pub(crate) fn range(&self, piece: u32) -> Interval {
        self.by_piece[piece as usize]
    }
}

impl Local {
    /// Returns the whole tree of a solid.
    pub(crate) fn everywhere(solid: &dyn Solid) -> Self {
        let mut pieces = solid.tree().pieces();
        let mut seen = std::collections::BTreeSet::new();
        pieces.retain(|i| seen.insert(*i));
        Self {
            tree: Arc::new(solid.tree().clone()),
            pieces: pieces.into(),
        }
    }

    /// Prunes the tree further for a part of the region.
    pub(crate) fn narrow(
        &self,
        solid: &dyn Solid,
        region: Aabb,
        scratch: &mut Scratch,
    ) -> NarrowedTree {
        let n = self.pieces.len();
        solid.bounds(&self.pieces, region, &mut scratch.ranges[..n]);
        for (i, r) in self.pieces.iter().zip(&scratch.ranges) {
            scratch.by_piece[*i as usize] = *r;
        }
        let by_piece = &scratch.by_piece;
        let ranges = |i: u32| by_piece[i as usize];
        scratch.out.clear();
        let range = decisive(&self.tree, &ranges, &mut scratch.out);
        if range.lo() >= 0.0 {
            NarrowedTree::Inside
        } else if range.hi() < 0.0 {
            NarrowedTree::Outside
        } else if scratch.out.len() == n {
            NarrowedTree::Mixed(self.clone())
        } else {
            match reduced(&self.tree, &ranges) {
                Sign::Inside => NarrowedTree::Inside,
                Sign::Outside => NarrowedTree::Outside,
                Sign::Mixed(tree) => NarrowedTree::Mixed(Self {
                    tree: Arc::new(tree),
                    pieces: scratch.out.as_slice().into(),
                }),
            }
        }
    }

    /// Returns a value with the sign of the solid at a point of the region.
    pub(crate) fn value(&self, solid: &dyn Solid, p: Point3, scratch: &mut Scratch) -> f64 {
        let n = self.pieces.len();
        solid.values(&self.pieces, &[p], &mut scratch.values[..n]);
        for (i, v) in self.pieces.iter().zip(&scratch.values) {
            scratch.value_of[*i as usize] = *v;
        }
        let value_of = &scratch.value_of;
        self.tree.value(&|i| value_of[i as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tree() -> impl Strategy<Value = Csg> {
        (0u32..6)
            .prop_map(Csg::Piece)
            .prop_recursive(4, 16, 3, |inner| {
                let many = prop::collection::vec(inner, 1..4);
                (many, any::<bool>())
                    .prop_map(|(c, min)| if min { Csg::Min(c) } else { Csg::Max(c) })
            })
    }

    proptest! {
        /// The pieces left out cannot change the sign, the reduced tree has the sign of the whole,
        /// and its pieces are the decisive ones.
        #[test]
        fn what_is_left_out_does_not_matter(
            tree in tree(),
            bounds in prop::collection::vec((-1.0..1.0f64, 0.0..1.5f64), 6),
            samples in prop::collection::vec(prop::collection::vec(0.0..=1.0f64, 6), 8),
        ) {
            let ranges = |i: u32| { let (lo, w) = bounds[i as usize]; Interval::new(lo, lo + w) };
            let mut out = Vec::new();
            let range = decisive(&tree, &ranges, &mut out);
            prop_assert_eq!(range, tree.range(&ranges));
            prop_assert_eq!(out.is_empty(), range.lo() >= 0.0 || range.hi() < 0.0);
            let rest = reduced(&tree, &ranges);
            for s in samples {
                let at = |i: u32| { let r = ranges(i); (r.lo() + s[i as usize] * r.width()).clamp(r.lo(), r.hi()) };
                let inside = tree.value(&at) >= 0.0;
                let fixed = |i: u32| if out.contains(&i) { at(i) } else { ranges(i).lo() };
                prop_assert_eq!(inside, tree.value(&fixed) >= 0.0);
                prop_assert_eq!(inside, match &rest {
                    Sign::Inside => true,
                    Sign::Outside => false,
                    Sign::Mixed(tree) => tree.value(&at) >= 0.0,
                });
            }
            if let Sign::Mixed(tree) = rest {
                let (mut a, mut b) = (tree.pieces(), out.clone());
                a.sort_unstable();
                a.dedup();
                b.sort_unstable();
                prop_assert_eq!(a, b);
            }
        }
    }
}
