//! Feature curves and corners of a solid, and its box.
//!
//! A feature curve is where two pieces vanish together, both bound the solid, and their normals
//! differ. [`find`] looks for them in three steps. Cells of an octree are dropped where intervals
//! prove that fewer than two pieces can decide the sign (`octree`), so that the cost grows with the
//! curves' length and not with the volume. In the cells that are left Newton's method finds
//! corners, where three pieces or two curves meet, and points of curves (`newton`); what they are
//! is read off the tree with the pieces made linear (`junction`). From corner to corner, and from
//! points that no curve has come by yet, curves are followed (`trace`).

mod apex;
mod extent;
mod junction;
mod newton;
mod octree;
mod trace;

pub use extent::{Extent, ExtentError, START, extent, extent_within};

use crate::decide::{Local, Narrowed, Scratch};
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid, cross, norm};
use newton::{branch, normalised, onto_one, onto_three, onto_touching, onto_two};
use octree::{Leaf, Octree};
use rayon::prelude::*;
use trace::Tracer;

/// What [`find`] is to do.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureOptions {
    /// Typical distance of mesh points to come: cells are half as large.
    pub size: f64,
    /// By how much the chords of a curve's points may miss it, as a part of the size.
    pub chord: f64,
    /// Normals that differ by less make no feature (radians).
    pub smallest_angle: f64,
    /// Cells that may be looked at.
    pub cells: usize,
}

impl Default for FeatureOptions {
    fn default() -> Self {
        Self {
            size: 0.1,
            chord: 4e-4,
            smallest_angle: 2.0_f64.to_radians(),
            cells: 20_000_000,
        }
    }
}

/// Why a point is a corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CornerKind {
    /// Three or more pieces meet.
    Meeting,
    /// A piece touches the curve of two others.
    Tangent,
    /// Curves of the same two pieces cross, where the pieces have a common normal.
    Branch,
    /// A piece goes over smoothly into another one beside the curve.
    Seam,
    /// The curve fades out: the pieces' normals become equal.
    Fading,
    /// The tip of a cone: the gradient of a piece vanishes or jumps. It may have no curve.
    Apex,
}

/// A point where curves end.
#[derive(Clone, Debug, PartialEq)]
pub struct Corner {
    /// Where.
    pub point: Point3,
    /// The pieces that vanish there and matter, ascending.
    pub pieces: Vec<u32>,
    /// Why.
    pub kind: CornerKind,
}

/// A curve where two pieces meet at an angle.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureCurve {
    /// The pieces, ascending; of pieces that coincide along the curve the first.
    pub pieces: [u32; 2],
    /// Points in order, on both pieces to rounding; of a closed curve the last is the first again.
    pub points: Vec<Point3>,
    /// Whether it ends where it began.
    pub closed: bool,
    /// The corners at its ends: none of a closed curve without a corner and where it leaves the
    /// region.
    pub corners: [Option<u32>; 2],
    /// Least and greatest angle between the pieces' normals (radians): 0 is smooth, π a knife's
    /// edge or a slit.
    pub angles: [f64; 2],
}

/// What [`find`] found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Features {
    /// Ends of curves.
    pub corners: Vec<Corner>,
    /// The curves.
    pub curves: Vec<FeatureCurve>,
    /// Whether intervals prove that there is no feature farther than one and a half sizes from
    /// those found. It does not prove that no two curves run closer together than that, and pieces
    /// that coincide at samples count as one.
    pub certified: bool,
    /// Cells where the proof is missing.
    pub uncertified: Vec<Aabb>,
    /// Cells where the proof is missing because two pieces run along each other, as at the seams of
    /// blends. At samples they meet without an angle; intervals of values cannot tell.
    pub tangential: Vec<Aabb>,
    /// Whether the search came to its end: not stopped, the budget not spent, no curve given up.
    pub complete: bool,
    /// Cells looked at.
    pub cells: usize,
}

/// What the parts of the search share.
pub(crate) struct Search<'a> {
    solid: &'a dyn Solid,
    octree: Octree,
    options: FeatureOptions,
    region: Aabb,
    control: &'a Control<'a>,
    /// Pieces nearer than this vanish.
    tolerance: f64,
    /// Sine of the smallest angle.
    sine: f64,
}

impl Search<'_> {
    fn size(&self) -> f64 {
        self.options.size
    }
    fn holds(&self, p: Point3) -> bool {
        octree::holds(&self.region, p)
    }
}

/// All feature curves and corners of a solid in a region.
///
/// Features much smaller than size/32 can be missed within a cell that intervals do not decide; see
/// [`Features::certified`].
pub fn find(
    solid: &dyn Solid,
    region: Aabb,
    options: &FeatureOptions,
    control: &Control<'_>,
) -> Features {
    let size = options.size;
    if region.is_empty()
        || !(size > 0.0 && size.is_finite())
        || !region.lo.iter().chain(&region.hi).all(|v| v.is_finite())
    {
        return Features::default();
    }
    // Off the round numbers that solids like: a face of the solid is not to lie on the cells'
    // faces.
    let region = Aabb {
        lo: region.lo.map(|v| v - 0.0137 * size),
        hi: region.hi.map(|v| v + 0.0211 * size),
    };
    let far = region
        .lo
        .iter()
        .chain(&region.hi)
        .fold(0.0, |m: f64, v| m.max(v.abs()));
    let octree = Octree::new(solid, region, size, options.cells, control);
    let tolerance = 1e-9 * size + 64.0 * f64::EPSILON * far;
    let search = Search {
        solid,
        octree,
        options: options.clone(),
        region,
        control,
        tolerance,
        sine: options.smallest_angle.sin(),
    };
    let mut tracer = Tracer::new(&search);
    let candidates: Vec<Vec<(Point3, CornerKind)>> = search
        .octree
        .leaves
        .par_iter()
        .map(|leaf| search.corners_in(leaf))
        .collect();
    for (p, kind) in candidates.into_iter().flatten() {
        if control.is_stopped() {
            break;
        }
        tracer.add_corner(p, kind);
    }
    for (p, piece) in search
        .octree
        .coarse
        .par_iter()
        .flat_map_iter(|(cell, local)| match control.is_stopped() {
            true => Vec::new(),
            false => search.apexes_in(*cell, local),
        })
        .collect::<Vec<_>>()
    {
        if control.is_stopped() {
            break;
        }
        tracer.add_apex(p, piece);
    }
    tracer.trace_corners();
    for leaf in &search.octree.leaves {
        if control.is_stopped() {
            break;
        }
        search.seed(leaf, &mut tracer);
    }
    let near = search.unproved(&tracer);
    let complete = search.octree.skipped.is_empty() && !tracer.lost && !control.is_stopped();
    let mut uncertified = search.octree.skipped.clone();
    let mut tangential = Vec::new();
    for (cell, is_tangential) in near {
        if is_tangential {
            tangential.push(cell)
        } else {
            uncertified.push(cell)
        }
    }
    let corners = tracer
        .corners
        .iter()
        .map(|c| Corner {
            point: c.point,
            pieces: c.pieces.clone(),
            kind: c.kind,
        })
        .collect();
    let curves = tracer.curves.into_iter().map(|c| {
        let first = |s: &[u32]| s.iter().copied().min().unwrap_or(0);
        let mut pieces = [first(&c.a), first(&c.b)];
        pieces.sort_unstable();
        FeatureCurve {
            pieces,
            points: c.points,
            closed: c.closed,
            corners: c.corners,
            angles: c.angles,
        }
    });
    let curves = curves.collect();
    Features {
        corners,
        curves,
        certified: complete && uncertified.is_empty() && tangential.is_empty(),
        uncertified,
        tangential,
        complete,
        cells: search.octree.visited,
    }
}

impl Search<'_> {
    /// Where corners may be: common points of three surfaces, and points where two have a common
    /// normal.
    fn corners_in(&self, leaf: &Leaf) -> Vec<(Point3, CornerKind)> {
        let mut found = Vec::new();
        let (center, reach) = (leaf.cell.center(), 1.5 * leaf.cell.diagonal());
        let s = &leaf.surfaces;
        for x in 0..s.len() {
            for y in x + 1..s.len() {
                if self.control.is_stopped() {
                    return Vec::new();
                }
                for z in y + 1..s.len() {
                    let Some((p, det)) = onto_three(self.solid, [s[x], s[y], s[z]], center, reach)
                    else {
                        continue;
                    };
                    if det.abs() > 1e-3 {
                        found.push((p, CornerKind::Meeting));
                        continue;
                    }
                    for [i, j, k] in [[s[x], s[y], s[z]], [s[y], s[z], s[x]], [s[z], s[x], s[y]]] {
                        // k touches the curve of i and j; it is parallel to one of them.
                        let sine = |a: u32, b: u32| self.angle_at(p, [a, b]).map_or(0.0, f64::sin);
                        if sine(i, j) > self.sine
                            && sine(i, k).min(sine(j, k)) < 0.01
                            && let Some(q) = onto_touching(self.solid, [i, j], k, p, reach)
                        {
                            found.push((q, CornerKind::Tangent));
                            break;
                        }
                    }
                }
                let (Some(a), Some(b)) = (
                    normalised(self.solid, s[x], center),
                    normalised(self.solid, s[y], center),
                ) else {
                    continue;
                };
                if norm(cross(a.n, b.n)) < 0.6
                    && let Some((p, _)) = branch(self.solid, [s[x], s[y]], center, reach)
                {
                    found.push((p, CornerKind::Branch));
                }
            }
        }
        found.retain(|(p, _)| self.holds(*p));
        found
    }

    /// Follows the curves of a cell that are not known yet.
    fn seed(&self, leaf: &Leaf, tracer: &mut Tracer<'_>) {
        let (center, side) = (leaf.cell.center(), octree::longest(&leaf.cell));
        let s = &leaf.surfaces;
        for x in 0..s.len() {
            for y in x + 1..s.len() {
                let pair = [s[x], s[y]];
                if self.control.is_stopped() {
                    return;
                }
                if leaf.simple && tracer.passes(center, 0.5 * side, Some(pair)) {
                    continue;
                }
                let Some((p, _)) = onto_two(self.solid, pair, center, 0.75 * leaf.cell.diagonal())
                else {
                    continue;
                };
                let covered = 2.5 * self.options.chord * self.size();
                if !tracer.passes(p, covered, None)
                    && tracer.corner_at(p, covered).is_none()
                    && self.holds(p)
                {
                    tracer.trace_seed(p, pair);
                    tracer.trace_corners();
                }
            }
        }
    }

    /// The tips of the pieces that matter in a cell.
    fn apexes_in(&self, cell: Aabb, local: &Local) -> Vec<(Point3, u32)> {
        let one = octree::surfaces(self.solid, &local.pieces, cell);
        one.into_iter()
            .filter_map(|k| self.apex(cell, k).map(|p| (p, k)))
            .collect()
    }

    /// Whether two of the surfaces are near each other and nearly parallel at one of the probes.
    ///
    /// Near is within `near` of the cell's size, nearly is by a sine of `near`/2.
    fn runs_along(&self, surfaces: &[u32], cell: Aabb, probes: &[Point3], near: f64) -> bool {
        let side = octree::longest(&cell);
        probes.iter().any(|at| {
            let p = octree::inside(&cell, *at);
            surfaces.iter().enumerate().any(|(x, i)| {
                let Some(q) = onto_one(self.solid, *i, p, 2.0 * side) else {
                    return false;
                };
                let Some(a) = normalised(self.solid, *i, q) else {
                    return false;
                };
                let along = |k: &u32| {
                    normalised(self.solid, *k, q).is_some_and(|b| {
                        b.d.abs() < near * side && norm(cross(a.n, b.n)) < 0.5 * near
                    })
                };
                surfaces[x + 1..].iter().any(along)
            })
        })
    }

    /// Cells away from all features in which intervals prove nothing, and whether surfaces run
    /// along each other there.
    fn unproved(&self, tracer: &Tracer<'_>) -> Vec<(Aabb, bool)> {
        let reach = self.size();
        let is_known = |cell: &Aabb| {
            let c = cell.center();
            tracer.passes(c, reach, None) || tracer.corner_at(c, reach).is_some()
        };
        let proof = |scratch: &mut Scratch, leaf: &Leaf| {
            if self.control.is_stopped() || leaf.surfaces.len() < 2 || is_known(&leaf.cell) {
                return None;
            }
            if self.runs_along(&leaf.surfaces, leaf.cell, &octree::PROBES, 0.2) {
                return Some((leaf.cell, true));
            }
            let mut open = vec![(leaf.cell, leaf.local.clone(), 0)];
            while let Some((cell, local, depth)) = open.pop() {
                if self.control.is_stopped() {
                    return Some((leaf.cell, false));
                }
                for part in octree::split(cell) {
                    let Narrowed::Mixed(local) =
                        local.narrow(self.solid, octree::slack(part), scratch)
                    else {
                        continue;
                    };
                    if local.pieces.len() < 2
                        || is_known(&part)
                        || octree::is_one_function(self.solid, &local.pieces, part, scratch)
                    {
                        continue;
                    }
                    let surfaces: Vec<u32> = leaf
                        .surfaces
                        .iter()
                        .copied()
                        .filter(|k| local.pieces.contains(k))
                        .collect();
                    let is_last = depth + 1 == PROOF_LEVELS;
                    let is_tangential = self.runs_along(
                        &surfaces,
                        part,
                        &octree::PROBES[..1],
                        if is_last { 1.0 } else { 0.2 },
                    );
                    if is_tangential || is_last {
                        return Some((leaf.cell, is_tangential));
                    }
                    open.push((part, local, depth + 1));
                }
            }
            None
        };
        let rest = self
            .octree
            .leaves
            .par_iter()
            .map_init(|| Scratch::new(self.solid), proof);
        rest.collect::<Vec<_>>().into_iter().flatten().collect()
    }
}

/// How often a cell is split to prove that it holds no feature.
const PROOF_LEVELS: u32 = 3;
