//! Octree over the region, whose cells store the parts that may determine the surface in them.

use super::Whole;
use crate::places::wider_by_share;
use isoform_geom::{Aabb, Csg};
use isoform_num::Interval;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Parts that matter in a cell.
#[derive(Clone)]
pub(super) struct LocalParts {
    pub(super) tree: Csg,
    /// Pieces of the tree, each with those of its parts that may be valid.
    pub(super) pieces: Vec<(u32, Vec<usize>)>,
}

impl LocalParts {
    /// Returns the parts of a piece.
    pub(super) fn parts(&self, piece: u32) -> &[usize] {
        let found = self.pieces.iter().find(|p| p.0 == piece);
        found.map_or(&[], |p| &p.1)
    }
}

/// Cell of the octree.
pub(super) struct OctreeCell {
    pub(super) region: Aabb,
    pub(super) local: Arc<LocalParts>,
    /// Index of the first of eight consecutive children; `None` for a leaf.
    children: Option<usize>,
}

impl OctreeCell {
    pub(super) fn new(region: Aabb, local: LocalParts) -> Self {
        Self {
            region,
            local: Arc::new(local),
            children: None,
        }
    }

    /// Returns true if the cell contains a region.
    fn holds(&self, region: &Aabb) -> bool {
        let own = &self.region;
        (0..3).all(|k| own.lo[k] <= region.lo[k] && region.hi[k] <= own.hi[k])
    }

    /// Returns an octant of the cell, with the parts of the cell.
    fn octant(&self, octant: usize) -> Self {
        let region = self.region;
        let middle = |k: usize| 0.5 * (region.lo[k] + region.hi[k]);
        let upper = |k: usize| octant >> k & 1 == 1;
        let octant = Aabb {
            lo: std::array::from_fn(|k| if upper(k) { middle(k) } else { region.lo[k] }),
            hi: std::array::from_fn(|k| if upper(k) { region.hi[k] } else { middle(k) }),
        };
        Self {
            region: octant,
            local: self.local.clone(),
            children: None,
        }
    }
}

/// Returns the box of the octree for a region: larger than the region, as patches extend beyond it.
pub(super) fn around(region: &Aabb) -> Aabb {
    wider_by_share(region, 0.3)
}

/// Cells of the octree; the root is the first one.
pub(super) struct Octree(Vec<OctreeCell>);

impl Octree {
    pub(super) fn of_one(root: OctreeCell) -> Self {
        Self(vec![root])
    }

    pub(super) fn leaves(&self) -> impl Iterator<Item = &OctreeCell> {
        self.0.iter().filter(|c| c.children.is_none())
    }

    /// Returns the smallest cell that contains a region; `None` if the root does not.
    fn smallest(&self, region: &Aabb) -> Option<&OctreeCell> {
        let mut at = self.0.first().filter(|root| root.holds(region))?;
        while let Some(first) = at.children {
            let mut octants = self.0[first..first + 8].iter();
            let Some(child) = octants.find(|c| c.holds(region)) else {
                break;
            };
            at = child;
        }
        Some(at)
    }
}

impl Whole<'_> {
    /// Divides a cell until at most two parts are left, by up to six halvings.
    pub(super) fn divide(&mut self, cell: usize, depth: usize) {
        let region = self.octree.0[cell].region;
        // A cell without surface keeps the parts of its parent.
        let Some(local) = self.narrow(&self.octree.0[cell].local, region) else {
            return;
        };
        let parts: usize = local.pieces.iter().map(|p| p.1.len()).sum();
        let cells = &mut self.octree.0;
        cells[cell].local = Arc::new(local);
        if parts <= 2 || depth == 6 {
            return;
        }
        let first = cells.len();
        cells[cell].children = Some(first);
        for octant in 0..8 {
            let octant = cells[cell].octant(octant);
            cells.push(octant);
        }
        for child in first..first + 8 {
            self.divide(child, depth + 1);
        }
    }

    /// Restricts the parts that matter in a region to a subregion; `None` if it contains no
    /// surface.
    pub(super) fn narrow(&self, of: &LocalParts, region: Aabb) -> Option<LocalParts> {
        let known: Vec<(u32, Vec<usize>, Interval)> = of
            .pieces
            .iter()
            .map(|(piece, parts)| {
                let parts = self.possible(parts, region);
                let range = self.hull(&parts, region);
                (*piece, parts, range)
            })
            .collect();
        let find = |piece: u32| known.iter().find(|k| k.0 == piece);
        let range = |piece: u32| find(piece).map_or(Interval::ALL, |k| k.2);
        let tree = narrowed(&of.tree, &range).ok()?;
        let left: BTreeSet<u32> = tree.pieces().into_iter().collect();
        let pieces = known.into_iter().filter(|k| left.contains(&k.0));
        Some(LocalParts {
            tree,
            pieces: pieces.map(|k| (k.0, k.1)).collect(),
        })
    }

    /// Returns the parts that matter in the smallest cell that contains a region.
    pub(super) fn local(&self, region: Aabb) -> &LocalParts {
        let cell = self.octree.smallest(&region);
        cell.map_or(&self.all, |cell| &cell.local)
    }
}

/// Removes from a tree the pieces whose sign does not change on the given ranges. If the sign of
/// the whole tree does not change, returns that sign as an error: true if positive.
fn narrowed(tree: &Csg, range: &impl Fn(u32) -> Interval) -> Result<Csg, bool> {
    let (children, is_min) = match tree {
        Csg::Piece(i) => {
            let r = range(*i);
            let sign = (r.lo() > 0.0).then_some(true);
            let sign = sign.or((r.hi() < 0.0).then_some(false));
            return sign.map_or_else(|| Ok(tree.clone()), Err);
        }
        Csg::Min(children) => (children, true),
        Csg::Max(children) => (children, false),
    };
    let mut kept = Vec::new();
    for child in children {
        match narrowed(child, range) {
            Ok(child) => kept.push(child),
            // A minimum is positive if all children are, and negative if one is.
            Err(positive) if positive != is_min => return Err(positive),
            Err(_) => {}
        }
    }
    match kept.len() {
        0 => Err(is_min),
        1 => Ok(kept.remove(0)),
        _ => Ok(if is_min {
            Csg::Min(kept)
        } else {
            Csg::Max(kept)
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If a is positive, min(a, max(b, c)) reduces to the maximum; if b is negative as well, to c.
    #[test]
    fn trees_are_narrowed() {
        let tree = Csg::Min(vec![
            Csg::Piece(0),
            Csg::Max(vec![Csg::Piece(1), Csg::Piece(2)]),
        ]);
        let of = |ranges: [(f64, f64); 3]| {
            narrowed(&tree, &|i| {
                let (lo, hi) = ranges[i as usize];
                Interval::new(lo, hi)
            })
        };
        let open = (-1.0, 1.0);
        let inner = Csg::Max(vec![Csg::Piece(1), Csg::Piece(2)]);
        assert_eq!(of([(1.0, 2.0), open, open]), Ok(inner));
        assert_eq!(of([(1.0, 2.0), (-2.0, -1.0), open]), Ok(Csg::Piece(2)));
        assert_eq!(of([(-2.0, -1.0), open, open]), Err(false));
        assert_eq!(of([(1.0, 2.0), open, (1.0, 2.0)]), Err(true));
    }
}
