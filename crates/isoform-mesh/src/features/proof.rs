//! Proof that no feature was missed: intervals decide the cells away from the features found.

use super::context::FeatureContext;
use super::newton::{normalised, onto_one};
use super::octree::{self, Leaf};
use super::trace::Tracer;
use crate::decide::{Local, NarrowedTree, Scratch};
use isoform_geom::{Aabb, Point3, cross, norm};
use rayon::prelude::*;

/// Maximum number of times that a cell is split to prove that it holds no feature.
const MAX_PROOF_LEVELS: u32 = 3;
/// Distance, in sizes of a cell, within which nearly parallel surfaces run along each other.
const TANGENTIAL_DISTANCE: f64 = 0.2;

/// A part of a leaf in which the proof is still missing.
struct OpenCell {
    cell: Aabb,
    local: Local,
    depth: u32,
}

impl FeatureContext<'_> {
    /// Returns the cells away from all features in which intervals prove nothing; the flag is true
    /// if surfaces run along each other there.
    pub(super) fn unproved(&self, tracer: &Tracer<'_>) -> Vec<(Aabb, bool)> {
        let leaves = self.octree.leaves.par_iter();
        let left = |scratch: &mut Scratch, leaf: &Leaf| {
            let is_tangential = self.find_unknown_feature(leaf, tracer, scratch)?;
            Some((leaf.cell, is_tangential))
        };
        let found: Vec<Option<_>> = leaves.map_init(|| Scratch::new(self.solid), left).collect();
        found.into_iter().flatten().collect()
    }

    /// Returns true if the features found come near a cell.
    fn is_known(&self, cell: &Aabb, tracer: &Tracer<'_>) -> bool {
        let (c, reach) = (cell.center(), self.size());
        tracer.passes(c, reach, None) || tracer.corner_at(c, reach).is_some()
    }

    /// Searches a leaf for unknown features. Returns `None` if it holds none; otherwise true if
    /// surfaces run along each other in it.
    fn find_unknown_feature(
        &self,
        leaf: &Leaf,
        tracer: &Tracer<'_>,
        scratch: &mut Scratch,
    ) -> Option<bool> {
        if self.control.is_stopped() || leaf.surfaces.len() < 2 || self.is_known(&leaf.cell, tracer)
        {
            return None;
        }
        if self.runs_along(
            &leaf.surfaces,
            leaf.cell,
            &octree::CELL_PROBES,
            TANGENTIAL_DISTANCE,
        ) {
            return Some(true);
        }
        let mut open = vec![OpenCell {
            cell: leaf.cell,
            local: leaf.local.clone(),
            depth: 0,
        }];
        while let Some(part) = open.pop() {
            if self.control.is_stopped() {
                return Some(false);
            }
            for next in self.undecided_parts(part, tracer, scratch) {
                let is_last = next.depth == MAX_PROOF_LEVELS;
                // Cells of the last level are not split further: a wider distance decides.
                let near = if is_last { 1.0 } else { TANGENTIAL_DISTANCE };
                let here = |k: &u32| next.local.pieces.contains(k);
                let surfaces: Vec<u32> = leaf.surfaces.iter().copied().filter(here).collect();
                let probe = &octree::CELL_PROBES[..1];
                let is_tangential = self.runs_along(&surfaces, next.cell, probe, near);
                if is_tangential || is_last {
                    return Some(is_tangential);
                }
                open.push(next);
            }
        }
        None
    }

    /// Returns the parts of a cell that neither intervals decide nor known features explain.
    fn undecided_parts<'p>(
        &'p self,
        OpenCell { cell, local, depth }: OpenCell,
        tracer: &'p Tracer<'_>,
        scratch: &'p mut Scratch,
    ) -> impl Iterator<Item = OpenCell> + 'p {
        octree::split(cell).filter_map(move |cell| {
            let NarrowedTree::Mixed(local) = local.narrow(self.solid, octree::slack(cell), scratch)
            else {
                return None;
            };
            let is_decided = local.pieces.len() < 2
                || self.is_known(&cell, tracer)
                || octree::is_one_function(self.solid, &local.pieces, cell, scratch);
            (!is_decided).then_some(OpenCell {
                cell,
                local,
                depth: depth + 1,
            })
        })
    }

    /// Returns true if two of the surfaces are near each other and nearly parallel at one of the
    /// probes.
    ///
    /// "Near" is a distance of `near` times the cell's size, "nearly parallel" a sine of `near`/2.
    fn runs_along(&self, surfaces: &[u32], cell: Aabb, probes: &[Point3], near: f64) -> bool {
        let side = octree::longest(&cell);
        probes.iter().any(|at| {
            let p = octree::inside(&cell, *at);
            (0..surfaces.len()).any(|x| {
                let others = &surfaces[x + 1..];
                self.has_parallel_surface(surfaces[x], others, p, near, side)
                    .unwrap_or(false)
            })
        })
    }

    /// Returns true if one of the other surfaces runs along a surface near `p`; `None` if the
    /// surface is not found there.
    fn has_parallel_surface(
        &self,
        surface: u32,
        others: &[u32],
        p: Point3,
        near: f64,
        side: f64,
    ) -> Option<bool> {
        // The surface may lie outside of the cell.
        let q = onto_one(self.solid, surface, p, 2.0 * side)?;
        let a = normalised(self.solid, surface, q)?;
        let along = |k: &u32| {
            normalised(self.solid, *k, q)
                .is_some_and(|b| b.d.abs() < near * side && norm(cross(a.n, b.n)) < 0.5 * near)
        };
        Some(others.iter().any(along))
    }
}
