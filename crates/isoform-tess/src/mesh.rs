//! From the region to triangles: arcs and sides as polylines on the surface, a constrained Delaunay
//! triangulation of each unit triangle, and refinement until every triangle is near the surface and
//! W keeps its sign on it.
//!
//! Between two walls of an arrangement the polylines of arcs have their vertices at equal values of
//! u, in the order of the arcs. They cannot cross, and they bound the region up to isotopy. Four
//! charts sampled on the unit triangle, and the opening of base points in directions, are due to C.
//! L. Bajaj, A. Royappa, *Triangulation and display of rational parametric surfaces* (1994).
//!
//! # Stages
//!
//! Each stage is a value computed from the stages before it; later stages do not change it:
//!
//! ```text
//! Region, Map ─> Atlas ─> SpecialCurves ─> Openings ─> Glued ─> four Units ─> Refined ─> Surface
//! ```
//!
//! # Words
//!
//! ```text
//!     v
//!     |\                 unit triangle   u, v >= 0, u + v <= 1; (s : t : w) = (±u : ±v : 1-u-v)
//!     | \                                in one of four quadrants; two of them share each side
//!     |  \   wall        wall, slab      u where the arcs change, and what lies between two walls
//!     |...\..:           arc             a piece of a curve over a slab, from wall to wall
//!     |   :\ :
//!     | __:_\:  arc      site            a base point in a unit triangle, on a wall
//!     |/  :  \           fan             the directions in which it is approached, with the
//!     B---:---\-- u                      sectors between them
//!         slab           ray             a direction, forward or backward, into a unit triangle
//!                        seam            the curve on the surface that a base point is blown up to
//!     +--------/--+      ring            the vertices on a rectangle around a site, in which rays
//!     | strip /   |                      leave it; larger ones lie around that
//!     |  B---/----+ ray  strip           what is between two rays, from the rectangle to the seam
//!     +-----------+
//! ```
//!
//! In terms of blow-ups: the seam is the image of the exceptional divisor, which is parametrized by
//! the directions. An arc that ends in a site meets the divisor where its strict transform does, in
//! the tangent. Fans of infinitely near points are trees, with a node for each blow-up and its
//! coordinates, its chart. A corner is the intersection of two exceptional divisors. Contracted
//! curves are the converse: curves of parameters with one image.

mod atlas;
mod border;
mod chart;
mod closing;
mod contraction;
mod curves;
mod drawing;
mod filling;
pub(crate) mod fineness;
mod folds;
mod geometry;
mod glued;
mod gluing;
mod in_chart;
pub(crate) mod matching;
mod names;
mod neighbours;
mod opening;
mod places;
mod plane;
mod sides;
mod special;
mod stretch;
mod strips;
mod surface_builder;
pub(crate) mod traced;
mod triangles;
mod unit;

use crate::analysis::Analysis;
use crate::claim::OF_MESH;
use crate::finding::Finding;
use crate::map::Map;
use crate::region::Region;
use crate::surface::{MeshOptions, Point3, Surface};
use atlas::Atlas;
use closing::finish;
pub(crate) use curves::Curves;
use drawing::drawn_unit;
use fineness::Fineness;
use glued::Glued;
use isoform_control::Control;
use matching::InsertionPlace;
use opening::{Fans, Openings};
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use special::SpecialCurves;
use unit::{Refined, Unit};

/// Name of the phase in which the triangles are made, for progress reports.
pub(crate) const TRIANGLES: &str = "triangles";
/// Progress of that phase when curves are found, base points opened, sheets matched and unit
/// triangles drawn; the rest is refinement, which mostly takes longest.
const SHARES: [f64; 4] = [0.1, 0.2, 0.3, 0.4];
/// Maximum number of bisections of a contracted curve because curves that leave it turn; the limit
/// is needed as the turn may be abrupt.
const MAX_TURN_BISECTIONS: usize = 10;
/// Maximum number of bisections of an interval of an arc or side: ends with vertical tangents are
/// approached to 2⁻⁴⁰ of the interval.
const MAX_BISECTIONS: usize = 40;
/// Maximum number of bisections of an interval if a base point is left open: no fineness suffices
/// there, and the result is not certified anyway.
const MAX_OPEN_BISECTIONS: usize = 12;
/// Maximum number of triangles if a base point is left open: more of them would not help, either.
const MAX_OPEN_TRIANGLES: usize = 100_000;
/// Maximum number of vertices of an interval: more of them arise only along a curve on which the
/// map is not continuous.
const MAX_INTERVAL_VERTICES: usize = 1 << 14;

/// Changes to the next mesh, where triangles of the last one crossed.
#[derive(Default)]
pub(crate) struct Changes {
    pub(crate) fineness: Fineness,
    /// Further vertices.
    pub(crate) matched: Vec<InsertionPlace>,
}

/// Triangulates the part of the surface that is in the box. The region is decomposed by `curves`,
/// too. Everything that could not be opened, joined or refined becomes a finding.
pub(crate) fn mesh(
    map: &Map,
    region: &Region,
    analysis: &Analysis,
    curves: &Curves,
    options: &MeshOptions,
    changes: &Changes,
    control: &Control<'_>,
) -> Surface {
    let tell = |stage: usize| control.report(TRIANGLES, SHARES[stage]);
    let atlas = Atlas::new(map, region, options, &changes.fineness, control);
    let mut special = SpecialCurves::new(&atlas, map, curves);
    let fans = Fans::new(
        &atlas,
        analysis.base_points.as_deref().unwrap_or_default(),
        &map.forms()[3],
    );
    special.add_images(&fans.contracted());
    tell(0);
    let openings = Openings::new(&atlas, &special, fans);
    tell(1);
    let mut glued = Glued::new(&openings, curves);
    tell(2);
    let drawn: Vec<Unit> = (0..4)
        .into_par_iter()
        .filter_map(|q| drawn_unit(&glued, q))
        .collect();
    tell(3);
    let refined = Refined::new(&glued, drawn, &changes.matched);
    let mut surface = refined.joined(&glued);
    surface.is_double_curve_known = curves.glued
        && !glued.gluing.is_stopped
        && (curves.traced.is_some()
            || analysis
                .singular
                .as_ref()
                .is_some_and(|s| s.double.is_some()));
    surface.double_curve = std::mem::take(&mut glued.gluing.arcs);
    surface.findings.append(&mut glued.gluing.findings);
    surface.decisions.decide(OF_MESH, glued.verdicts(curves));
    let tolerance = |p: Point3| atlas.tolerance_at(p);
    let mut surface = finish(surface, atlas.half_width, curves.glued, &tolerance);
    // Contracted curves with one image are one vertex, and what is joined to it is identified by
    // its image alone: if sheets are not to be joined, it may belong to another sheet.
    if curves.deck.is_some() && !curves.glued {
        let count = closing::pinched(&surface);
        if count > 0 {
            surface.findings.push(Finding::PinchedVertices(count));
        }
    }
    surface
}
