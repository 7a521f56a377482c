//! Search for corners and curves in the cells that may hold some.

use super::context::FeatureContext;
use super::newton::{branch, normalised, onto_three, onto_touching, onto_two};
use super::octree::{self, Leaf};
use super::trace::{Junction, TracedCurve, Tracer};
use super::{Corner, CornerKind, FeatureCurve, Features};
use crate::decide::Local;
use isoform_geom::{Aabb, Point3, cross, norm};
use rayon::prelude::*;

/// Maximum distance of corners from the centre of the leaf in which they are sought, in diagonals.
const CORNER_SEARCH_DIAGONALS: f64 = 1.5;

impl FeatureContext<'_> {
    /// Finds all features: corners first, then the curves from corner to corner, then closed curves
    /// without a corner.
    pub(super) fn run(&self) -> Features {
        let mut tracer = Tracer::new(self);
        self.add_corners(&mut tracer);
        self.add_apexes(&mut tracer);
        tracer.trace_corners();
        for leaf in &self.octree.leaves {
            if self.control.is_stopped() {
                break;
            }
            self.seed(leaf, &mut tracer);
        }
        let unproved = self.unproved(&tracer);
        let is_stopped = self.control.is_stopped();
        let complete = self.octree.skipped.is_empty() && !tracer.lost && !is_stopped;
        let mut uncertified = self.octree.skipped.clone();
        let mut tangential = Vec::new();
        for (cell, is_tangential) in unproved {
            if is_tangential {
                tangential.push(cell);
            } else {
                uncertified.push(cell);
            }
        }
        Features {
            corners: tracer.corners.into_iter().map(corner).collect(),
            curves: tracer.curves.into_iter().map(curve).collect(),
            certified: complete && uncertified.is_empty() && tangential.is_empty(),
            uncertified,
            tangential,
            complete,
            cells: self.octree.visited,
        }
    }

    fn add_corners(&self, tracer: &mut Tracer<'_>) {
        let leaves = self.octree.leaves.par_iter();
        let candidates: Vec<Vec<(Point3, CornerKind)>> =
            leaves.map(|leaf| self.corners_in(leaf)).collect();
        for (p, kind) in candidates.into_iter().flatten() {
            if self.control.is_stopped() {
                break;
            }
            tracer.add_corner(p, kind);
        }
    }

    fn add_apexes(&self, tracer: &mut Tracer<'_>) {
        let cells = self.octree.coarse.par_iter();
        let tips: Vec<(Point3, u32)> = cells
            .flat_map_iter(|(cell, local)| {
                if self.control.is_stopped() {
                    Vec::new()
                } else {
                    self.apexes_in(*cell, local)
                }
            })
            .collect();
        for (p, piece) in tips {
            if self.control.is_stopped() {
                break;
            }
            tracer.add_apex(p, piece);
        }
    }

    /// Returns candidates for corners: common points of three surfaces, and points where two have a
    /// common normal.
    fn corners_in(&self, leaf: &Leaf) -> Vec<(Point3, CornerKind)> {
        let mut found = Vec::new();
        let s = &leaf.surfaces;
        for x in 0..s.len() {
            for y in x + 1..s.len() {
                if self.control.is_stopped() {
                    return Vec::new();
                }
                for z in y + 1..s.len() {
                    found.extend(self.meeting(leaf, [s[x], s[y], s[z]]));
                }
                found.extend(self.branch_in(leaf, [s[x], s[y]]));
            }
        }
        found.retain(|(p, _)| self.holds(*p));
        found
    }

    /// Returns the point in which three surfaces meet, or one touches the curve of the others.
    fn meeting(&self, leaf: &Leaf, [a, b, c]: [u32; 3]) -> Option<(Point3, CornerKind)> {
        let reach = CORNER_SEARCH_DIAGONALS * leaf.cell.diagonal();
        let (p, det) = onto_three(self.solid, [a, b, c], leaf.cell.center(), reach)?;
        // The pieces meet transversally; otherwise they touch.
        if det.abs() > 1e-3 {
            return Some((p, CornerKind::Meeting));
        }
        let sine = |a: u32, b: u32| self.angle_at(p, [a, b]).map_or(0.0, f64::sin);
        [[a, b, c], [b, c, a], [c, a, b]]
            .into_iter()
            .find_map(|[i, j, k]| {
                // k touches the curve of i and j; it is parallel to one of them.
                if sine(i, j) > self.sine && sine(i, k).min(sine(j, k)) < 0.01 {
                    let q = onto_touching(self.solid, [i, j], k, p, reach)?;
                    return Some((q, CornerKind::Tangent));
                }
                None
            })
    }

    /// Returns the point in which two curves of the two surfaces cross.
    fn branch_in(&self, leaf: &Leaf, [i, j]: [u32; 2]) -> Option<(Point3, CornerKind)> {
        let center = leaf.cell.center();
        let a = normalised(self.solid, i, center)?;
        let b = normalised(self.solid, j, center)?;
        // The normals may be parallel elsewhere in the cell only if they are nearly so at its
        // centre.
        if norm(cross(a.n, b.n)) >= 0.6 {
            return None;
        }
        let reach = CORNER_SEARCH_DIAGONALS * leaf.cell.diagonal();
        let (p, _) = branch(self.solid, [i, j], center, reach)?;
        Some((p, CornerKind::Branch))
    }

    /// Traces the curves of a cell that are not known yet.
    fn seed(&self, leaf: &Leaf, tracer: &mut Tracer<'_>) {
        let s = &leaf.surfaces;
        for x in 0..s.len() {
            for y in x + 1..s.len() {
                if self.control.is_stopped() {
                    return;
                }
                self.seed_pair(leaf, [s[x], s[y]], tracer);
            }
        }
    }

    /// Traces the curve of two surfaces in a cell, if it is not known yet.
    fn seed_pair(&self, leaf: &Leaf, pair: [u32; 2], tracer: &mut Tracer<'_>) {
        let (center, side) = (leaf.cell.center(), octree::longest(&leaf.cell));
        if leaf.simple && tracer.passes(center, 0.5 * side, Some(pair)) {
            return;
        }
        // Points of curves are sought a little beyond the cell.
        let reach = 0.75 * leaf.cell.diagonal();
        let Some((p, _)) = onto_two(self.solid, pair, center, reach) else {
            return;
        };
        // Points this near, in chordal errors, are on a known curve.
        let covered = 2.5 * self.options.chord * self.size();
        if !tracer.passes(p, covered, None)
            && tracer.corner_at(p, covered).is_none()
            && self.holds(p)
        {
            tracer.trace_seed(p, pair);
            tracer.trace_corners();
        }
    }

    /// Returns the tips of the pieces that matter in a cell.
    fn apexes_in(&self, cell: Aabb, local: &Local) -> Vec<(Point3, u32)> {
        let one = octree::surfaces(self.solid, &local.pieces, cell);
        one.into_iter()
            .filter_map(|k| self.apex(cell, k).map(|p| (p, k)))
            .collect()
    }
}

fn corner(found: Junction) -> Corner {
    Corner {
        point: found.point,
        pieces: found.pieces,
        kind: found.kind,
    }
}

fn curve(found: TracedCurve) -> FeatureCurve {
    let first = |s: &[u32]| s.iter().copied().min().unwrap_or(0);
    let mut pieces = [first(&found.a), first(&found.b)];
    pieces.sort_unstable();
    FeatureCurve {
        pieces,
        points: found.points,
        closed: found.closed,
        corners: found.corners,
        angles: found.angles,
    }
}
