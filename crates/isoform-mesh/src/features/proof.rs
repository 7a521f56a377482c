//! The proof that no feature was left out: intervals decide the cells away from those found.

use super::newton::{normalised, onto_one};
use super::octree::{self, Leaf};
use super::search::Search;
use super::trace::Tracer;
use crate::decide::{Local, Narrowed, Scratch};
use isoform_geom::{Aabb, Point3, cross, norm};
use rayon::prelude::*;

/// How often a cell is split to prove that it holds no feature.
const LEVELS: u32 = 3;
/// Distance, in sizes of a cell, within which surfaces that are nearly parallel run along each
/// other.
const ALONG: f64 = 0.2;
/// The distance for cells that are not split any more.
const ALONG_AT_LAST: f64 = 1.0;
/// Distance from a probe, in sizes of a cell, within which a surface must be.
const REACH: f64 = 2.0;

/// A part of a leaf in which the proof is missing yet.
struct Part {
    cell: Aabb,
    local: Local,
    depth: u32,
}

impl Search<'_> {
    /// Cells away from all features in which intervals prove nothing, and whether surfaces run
    /// along each other there.
    pub(super) fn unproved(&self, tracer: &Tracer<'_>) -> Vec<(Aabb, bool)> {
        let leaves = self.octree.leaves.par_iter();
        let left = |scratch: &mut Scratch, leaf: &Leaf| {
            let is_tangential = self.what_is_left(leaf, tracer, scratch)?;
            Some((leaf.cell, is_tangential))
        };
        let found: Vec<Option<_>> = leaves.map_init(|| Scratch::new(self.solid), left).collect();
        found.into_iter().flatten().collect()
    }

    /// Whether the features found come near a cell.
    fn is_known(&self, cell: &Aabb, tracer: &Tracer<'_>) -> bool {
        let (c, reach) = (cell.center(), self.size());
        tracer.passes(c, reach, None) || tracer.corner_at(c, reach).is_some()
    }

    /// None if a leaf holds no feature that is not known; else whether surfaces run along each
    /// other in it.
    fn what_is_left(
        &self,
        leaf: &Leaf,
        tracer: &Tracer<'_>,
        scratch: &mut Scratch,
    ) -> Option<bool> {
        if self.control.is_stopped() || leaf.surfaces.len() < 2 || self.is_known(&leaf.cell, tracer)
        {
            return None;
        }
        if self.runs_along(&leaf.surfaces, leaf.cell, &octree::PROBES, ALONG) {
            return Some(true);
        }
        let mut open = vec![Part {
            cell: leaf.cell,
            local: leaf.local.clone(),
            depth: 0,
        }];
        while let Some(part) = open.pop() {
            if self.control.is_stopped() {
                return Some(false);
            }
            for next in self.undecided_parts(part, tracer, scratch) {
                let is_last = next.depth == LEVELS;
                let near = if is_last { ALONG_AT_LAST } else { ALONG };
                let here = |k: &u32| next.local.pieces.contains(k);
                let surfaces: Vec<u32> = leaf.surfaces.iter().copied().filter(here).collect();
                let probe = &octree::PROBES[..1];
                let is_tangential = self.runs_along(&surfaces, next.cell, probe, near);
                if is_tangential || is_last {
                    return Some(is_tangential);
                }
                open.push(next);
            }
        }
        None
    }

    /// The parts of a cell that intervals do not decide, and features found do not explain, one
    /// after the other.
    fn undecided_parts<'p>(
        &'p self,
        Part { cell, local, depth }: Part,
        tracer: &'p Tracer<'_>,
        scratch: &'p mut Scratch,
    ) -> impl Iterator<Item = Part> + 'p {
        octree::split(cell).filter_map(move |cell| {
            let Narrowed::Mixed(local) = local.narrow(self.solid, octree::slack(cell), scratch)
            else {
                return None;
            };
            let is_decided = local.pieces.len() < 2
                || self.is_known(&cell, tracer)
                || octree::is_one_function(self.solid, &local.pieces, cell, scratch);
            (!is_decided).then_some(Part {
                cell,
                local,
                depth: depth + 1,
            })
        })
    }

    /// Whether two of the surfaces are near each other and nearly parallel at one of the probes.
    ///
    /// Near is within `near` of the cell's size, nearly is by a sine of `near`/2.
    fn runs_along(&self, surfaces: &[u32], cell: Aabb, probes: &[Point3], near: f64) -> bool {
        let side = octree::longest(&cell);
        probes.iter().any(|at| {
            let p = octree::inside(&cell, *at);
            (0..surfaces.len()).any(|x| {
                let others = &surfaces[x + 1..];
                self.has_beside(surfaces[x], others, p, near, side)
                    .unwrap_or(false)
            })
        })
    }

    /// Whether a surface near `p` has others along it there.
    fn has_beside(
        &self,
        surface: u32,
        others: &[u32],
        p: Point3,
        near: f64,
        side: f64,
    ) -> Option<bool> {
        let q = onto_one(self.solid, surface, p, REACH * side)?;
        let a = normalised(self.solid, surface, q)?;
        let along = |k: &u32| {
            normalised(self.solid, *k, q)
                .is_some_and(|b| b.d.abs() < near * side && norm(cross(a.n, b.n)) < 0.5 * near)
        };
        Some(others.iter().any(along))
    }
}
