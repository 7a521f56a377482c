//! The search for corners and curves in the cells that may hold some.

use super::newton::{branch, normalised, onto_three, onto_touching, onto_two};
use super::octree::{self, Leaf, Octree};
use super::trace::{Junction, Traced, Tracer};
use super::{Corner, CornerKind, FeatureCurve, FeatureOptions, Features};
use crate::decide::Local;
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid, cross, dot, norm};
use rayon::prelude::*;

/// The region begins and ends this many sizes farther out. That is off the round numbers which
/// solids like: a face of the solid is not to lie on the cells' faces.
const SHIFT: [f64; 2] = [0.0137, 0.0211];
/// Share of the size below which a piece vanishes, and the number of roundings of the largest
/// coordinate that are added to it.
const VANISHING: [f64; 2] = [1e-9, 64.0];
/// Determinant of three normals above which their pieces meet in a point and do not touch.
const TRANSVERSAL: f64 = 1e-3;
/// Sine below which a piece that touches a curve is parallel to one of the curve's pieces.
const PARALLEL: f64 = 0.01;
/// Sine between two normals at a cell's centre below which they may be parallel somewhere in it.
const NEARLY_PARALLEL: f64 = 0.6;
/// Distance from a leaf's centre within which corners are sought, in diagonals.
const CORNER_REACH: f64 = 1.5;
/// Distance within which points of curves are sought, in diagonals.
const CURVE_REACH: f64 = 0.75;
/// Distance from a known curve, in chordal errors, within which a point is on that curve.
const COVERED: f64 = 2.5;

/// What the parts of the search share.
pub(crate) struct Search<'a> {
    pub(super) solid: &'a dyn Solid,
    pub(super) octree: Octree,
    pub(super) options: FeatureOptions,
    region: Aabb,
    pub(super) control: &'a Control<'a>,
    /// Pieces nearer than this vanish.
    pub(super) tolerance: f64,
    /// Sine of the smallest angle.
    pub(super) sine: f64,
}

impl<'a> Search<'a> {
    pub(super) fn new(
        solid: &'a dyn Solid,
        region: Aabb,
        options: &FeatureOptions,
        control: &'a Control<'a>,
    ) -> Self {
        let size = options.size;
        let region = Aabb {
            lo: region.lo.map(|v| v - SHIFT[0] * size),
            hi: region.hi.map(|v| v + SHIFT[1] * size),
        };
        let bounds = region.lo.iter().chain(&region.hi);
        let far = bounds.fold(0.0, |m: f64, v| m.max(v.abs()));
        Self {
            solid,
            octree: Octree::new(solid, region, size, options.cells, control),
            options: options.clone(),
            region,
            control,
            tolerance: VANISHING[0] * size + VANISHING[1] * f64::EPSILON * far,
            sine: options.smallest_angle.sin(),
        }
    }
}

impl Search<'_> {
    pub(super) fn size(&self) -> f64 {
        self.options.size
    }

    pub(super) fn holds(&self, p: Point3) -> bool {
        octree::holds(&self.region, p)
    }

    /// Corners first, then the curves from corner to corner, then those without a corner.
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

    /// Where corners may be: common points of three surfaces, and points where two have a common
    /// normal.
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

    /// The point in which three surfaces meet, or one touches the curve of the others.
    fn meeting(&self, leaf: &Leaf, [a, b, c]: [u32; 3]) -> Option<(Point3, CornerKind)> {
        let reach = CORNER_REACH * leaf.cell.diagonal();
        let (p, det) = onto_three(self.solid, [a, b, c], leaf.cell.center(), reach)?;
        if det.abs() > TRANSVERSAL {
            return Some((p, CornerKind::Meeting));
        }
        let sine = |a: u32, b: u32| self.angle_at(p, [a, b]).map_or(0.0, f64::sin);
        [[a, b, c], [b, c, a], [c, a, b]]
            .into_iter()
            .find_map(|[i, j, k]| {
                // k touches the curve of i and j; it is parallel to one of them.
                if sine(i, j) > self.sine && sine(i, k).min(sine(j, k)) < PARALLEL {
                    let q = onto_touching(self.solid, [i, j], k, p, reach)?;
                    return Some((q, CornerKind::Tangent));
                }
                None
            })
    }

    /// The point in which two curves of the same surfaces cross.
    fn branch_in(&self, leaf: &Leaf, [i, j]: [u32; 2]) -> Option<(Point3, CornerKind)> {
        let center = leaf.cell.center();
        let a = normalised(self.solid, i, center)?;
        let b = normalised(self.solid, j, center)?;
        if norm(cross(a.n, b.n)) >= NEARLY_PARALLEL {
            return None;
        }
        let reach = CORNER_REACH * leaf.cell.diagonal();
        let (p, _) = branch(self.solid, [i, j], center, reach)?;
        Some((p, CornerKind::Branch))
    }

    /// Follows the curves of a cell that are not known yet.
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

    /// Follows the curve of two surfaces in a cell, if it is not known yet.
    fn seed_pair(&self, leaf: &Leaf, pair: [u32; 2], tracer: &mut Tracer<'_>) {
        let (center, side) = (leaf.cell.center(), octree::longest(&leaf.cell));
        if leaf.simple && tracer.passes(center, 0.5 * side, Some(pair)) {
            return;
        }
        let reach = CURVE_REACH * leaf.cell.diagonal();
        let Some((p, _)) = onto_two(self.solid, pair, center, reach) else {
            return;
        };
        let covered = COVERED * self.options.chord * self.size();
        if !tracer.passes(p, covered, None)
            && tracer.corner_at(p, covered).is_none()
            && self.holds(p)
        {
            tracer.trace_seed(p, pair);
            tracer.trace_corners();
        }
    }

    /// The tips of the pieces that matter in a cell.
    fn apexes_in(&self, cell: Aabb, local: &Local) -> Vec<(Point3, u32)> {
        let one = octree::surfaces(self.solid, &local.pieces, cell);
        one.into_iter()
            .filter_map(|k| self.apex(cell, k).map(|p| (p, k)))
            .collect()
    }

    /// The angle between the normals of two pieces.
    pub(super) fn angle_at(&self, p: Point3, [i, j]: [u32; 2]) -> Option<f64> {
        let (a, b) = (
            normalised(self.solid, i, p)?.n,
            normalised(self.solid, j, p)?.n,
        );
        Some(norm(cross(a, b)).atan2(dot(a, b)))
    }
}

fn corner(found: Junction) -> Corner {
    Corner {
        point: found.point,
        pieces: found.pieces,
        kind: found.kind,
    }
}

fn curve(found: Traced) -> FeatureCurve {
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
