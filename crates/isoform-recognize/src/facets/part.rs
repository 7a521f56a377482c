//! Parts of a mesh that one surface explains: the test whether a triangle follows a surface, and
//! the growth of a part along edges.
//!
//! Vertices lie on the surface up to rounding, facets are its chords. The normal of a facet differs
//! from that of the surface by at most the curvature times the circumradius, to first order (K.
//! Kobayashi and T. Tsuchiya, A Babuška–Aziz type proof of the circumradius condition, Japan J.
//! Indust. Appl. Math. 31, 2014); the normals at its corners give the curvature times the longest
//! side.

use super::mesh::Facets;
use crate::chart::{Primitive, PrimitiveKind, unit};
use crate::fit::{Precision, fit};
use isoform_geom::{Point3, cross, dot, middle, norm, sub};

/// Cosine of the maximum angle by which a surface turns over one of its facets, 40°. A polygon of 9
/// sides turns by 40° from side to side and one of 10 by 36°: fewer than 10 sides are planes.
/// Modellers allow 30° at most by default, and designers draw hexagons and octagons; a smaller
/// angle would lose coarse bores, a larger one would round off octagons.
pub(crate) const MIN_FACET_COSINE: f64 = 0.766_05;
/// Maximum angle between a facet's normal and the mean normal of its surface beyond what the
/// circumradius explains: the sum of an angle (radians) and a number of tolerances over the height
/// of the facet.
const NORMAL_ANGLE_TOLERANCE: (f64, f64) = (2e-3, 3.0);
/// Growth of a part between two fits: a factor, and a number of triangles that is added.
const PART_GROWTH: (f64, usize) = (1.7, 4);
/// Maximum number of triangles whose corners are fitted; all vertices are exact, so that more add
/// little.
pub(crate) const MAX_FITTED_TRIANGLES: usize = 70;

/// Triangles that one surface explains.
#[derive(Clone, Debug)]
pub(crate) struct FacetPart {
    pub(crate) surface: Primitive,
    /// Triangles in ascending order.
    pub(crate) triangles: Vec<u32>,
}

/// Returns true if a triangle is a facet of the surface.
pub(crate) fn follows(mesh: &Facets, surface: &Primitive, t: u32) -> bool {
    follows_within(mesh, surface, t, mesh.tolerance)
}

fn follows_within(mesh: &Facets, surface: &Primitive, t: u32, tolerance: f64) -> bool {
    let corners = mesh.corners(t);
    if corners
        .iter()
        .any(|p| surface.distance(*p).abs() > tolerance)
    {
        return false;
    }
    let height = mesh.heights[t as usize];
    let normals = normals(surface, corners, tolerance);
    let turn = turn(normals);
    let most = match surface.kind {
        // √2 · 40° from corner to corner of a facet, which excludes the icosahedron, whose corners
        // turn by 63°.
        PrimitiveKind::Sphere | PrimitiveKind::Torus => 0.551,
        _ => MIN_FACET_COSINE,
    };
    if turn < most || !is_chord(surface, corners, angle(turn), tolerance) {
        return false;
    }
    // The normal of a lower triangle is undetermined.
    if height < 20.0 * tolerance {
        return true;
    }
    let mean = unit(std::array::from_fn(|k| normals.iter().map(|n| n[k]).sum()));
    let off = dot(mean, mesh.normals[t as usize]).abs();
    let allowed = || {
        roundness(corners) * angle(turn)
            + NORMAL_ANGLE_TOLERANCE.0
            + NORMAL_ANGLE_TOLERANCE.1 * tolerance / height
    };
    off >= turn || off >= most && angle(off) <= allowed()
}

/// Returns the cosine of the largest angle between the surface's normals at the corners of a facet.
pub(crate) fn turn([a, b, c]: [Point3; 3]) -> f64 {
    dot(a, b).min(dot(b, c)).min(dot(c, a)).min(1.0)
}

/// Returns the surface's normals at the corners of a facet. The tip of a cone has no normal: the
/// mean of the other two replaces it.
pub(crate) fn normals(surface: &Primitive, corners: [Point3; 3], tolerance: f64) -> [Point3; 3] {
    let mut normals = corners.map(|p| surface.normal(p));
    if surface.kind == PrimitiveKind::Cone {
        let (apex, near) = (surface.apex(), tolerance / surface.other.sin().abs());
        if let Some(tip) = (0..3).find(|k| norm(sub(corners[*k], apex)) <= near) {
            let [m, n] = [1, 2].map(|k| normals[(tip + k) % 3]);
            normals[tip] = unit(std::array::from_fn(|k| m[k] + n[k]));
        }
    }
    normals
}

/// Returns true if the distance of the surface from a facet is at most that of a chord along which
/// it turns by `turn`: side × angle / 8 on circles, twice that in general. Three points on the
/// circle in which a plane touches a torus have one normal, but their plane leaves the torus.
fn is_chord(surface: &Primitive, [a, b, c]: [Point3; 3], turn: f64, tolerance: f64) -> bool {
    let sides = [[a, b], [b, c], [c, a]];
    let longest = sides
        .map(|[p, q]| norm(sub(p, q)))
        .into_iter()
        .fold(0.0, f64::max);
    let most = longest * turn / 4.0 + 2.0 * tolerance;
    let middles = sides.map(middle);
    let mut places = middles.into_iter().chain([middle([a, b, c])]);
    places.all(|p| surface.distance(p).abs() <= most)
}

/// Returns the circumradius of a triangle over its longest side, at least 1.
fn roundness([a, b, c]: [Point3; 3]) -> f64 {
    let sides = [sub(b, a), sub(c, b), sub(a, c)];
    let [p, q, r] = sides.map(norm);
    let double = norm(cross(sides[0], sides[1]));
    (p * q * r / (2.0 * double * p.max(q).max(r))).max(1.0)
}

fn angle(cosine: f64) -> f64 {
    cosine.clamp(-1.0, 1.0).acos()
}

/// Grows a part from triangles that a surface was fitted to, along free triangles.
pub(crate) fn grow(
    mesh: &Facets,
    seed: &[u32],
    surface: Primitive,
    is_free: &(impl Fn(u32) -> bool + Sync),
) -> Option<FacetPart> {
    let mut part = FacetPart {
        surface,
        triangles: seed.to_vec(),
    };
    let (mut is_seen, mut is_whole) = (vec![false; mesh.triangles.len()], false);
    // A million triangles are reached after 30 fits.
    for _ in 0..60 {
        let most = (part.triangles.len() as f64 * PART_GROWTH.0) as usize + PART_GROWTH.1;
        let (new, reached_end) = collect(mesh, &part, most, &mut is_seen, is_free);
        new.iter().for_each(|t| is_seen[*t as usize] = false);
        if new.is_empty() || new.len() * 2 < part.triangles.len() {
            return None;
        }
        let stands = reached_end && is_whole && new == part.triangles;
        is_whole = reached_end;
        part.triangles = new;
        if stands {
            return Some(part);
        }
        part.surface = exact(mesh, &part.surface, &part.triangles)?;
    }
    Some(part)
}

/// Returns the surface fitted to the corners of a sample of triangles, if all of these lie on it.
pub(crate) fn exact(mesh: &Facets, start: &Primitive, of: &[u32]) -> Option<Primitive> {
    let points = corners(mesh, of);
    let (surface, _) = fit(start, &points, Precision::Full)?;
    let is_on = |p: &Point3| surface.distance(*p).abs() <= mesh.tolerance;
    points.iter().all(is_on).then_some(surface)
}

/// Returns true if only few of the free triangles beyond the border of a part leave its surface
/// gradually. Triangles of other parts lie on surfaces of their own.
pub(crate) fn ends_clearly(mesh: &Facets, part: &FacetPart, is_free: impl Fn(u32) -> bool) -> bool {
    let is_outside = |t: &u32| part.triangles.binary_search(t).is_err();
    let follows = |t: u32, tolerance| follows_within(mesh, &part.surface, t, tolerance);
    let nearly = |t: u32| {
        // In a fine mesh of another shape facets leave the surface gradually. Fewer tolerances
        // would take patches of free forms, more would lose faces of fine meshes that continue
        // smoothly into others.
        follows(t, 10.0 * mesh.tolerance)
            && !follows(t, mesh.tolerance)
            && !bends_away(&part.surface, mesh.corners(t))
    };
    let near = part.triangles.iter().flat_map(|t| mesh.near(*t));
    let (mut vague, mut all) = (0.0, 0.0);
    for t in near.filter(|t| is_outside(t)) {
        all += 1.0;
        vague += f64::from(u8::from(is_free(*t) && nearly(*t)));
    }
    // The part has to end clearly along 80 % of its border.
    vague <= (1.0 - 0.8) * all
}

/// Returns true if a facet beyond the border leaves a curved surface as one of another curvature
/// does: by more than a quarter of the distance to which the surface's tangent planes leave it over
/// the facet's height.
fn bends_away(surface: &Primitive, corners: [Point3; 3]) -> bool {
    let distances = corners.map(|p| surface.distance(p).abs());
    let far = (0..3).fold(0, |m, k| if distances[k] > distances[m] { k } else { m });
    let [p, a, b] = [0, 1, 2].map(|k| corners[(far + k) % 3]);
    let (side, way) = (sub(b, a), sub(p, a));
    let height = norm(cross(side, way)) / norm(side);
    let curvature = surface.curvature(p);
    curvature > 0.0 && distances[far] > curvature * height * height / 8.0
}

/// Returns the corners of at most [`MAX_FITTED_TRIANGLES`] of some triangles.
pub(crate) fn corners(mesh: &Facets, of: &[u32]) -> Vec<Point3> {
    let step = of.len().div_ceil(MAX_FITTED_TRIANGLES).max(1);
    let some = of.iter().step_by(step);
    some.flat_map(|t| mesh.corners(*t)).collect()
}

/// Returns the triangles that follow the surface, reached from those of a part along edges, in
/// ascending order, and a flag: true if all were reached before there were `most`. `is_seen` is
/// left true for the triangles returned, false for all others.
fn collect(
    mesh: &Facets,
    part: &FacetPart,
    most: usize,
    is_seen: &mut [bool],
    is_free: &(impl Fn(u32) -> bool + Sync),
) -> (Vec<u32>, bool) {
    let takes = |t: u32| is_free(t) && follows(mesh, &part.surface, t);
    let from = part.triangles.iter().copied();
    let mut ring: Vec<u32> = from.filter(|t| takes(*t)).collect();
    ring.iter().for_each(|t| is_seen[*t as usize] = true);
    let (mut all, mut refused) = (ring.clone(), Vec::new());
    while !ring.is_empty() && all.len() < most {
        let mut next = Vec::new();
        for t in &ring {
            for u in mesh.near(*t) {
                if is_seen[*u as usize] {
                    continue;
                }
                is_seen[*u as usize] = true;
                if takes(*u) {
                    next.push(*u);
                } else {
                    refused.push(*u);
                }
            }
        }
        all.extend(&next);
        ring = next;
    }
    refused.iter().for_each(|t| is_seen[*t as usize] = false);
    all.sort_unstable();
    (all, ring.is_empty())
}
