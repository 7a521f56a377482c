//! Evidence of curved surfaces: a part counts only if more vertices lie on its surface than on any
//! surface of its kind by construction.
//!
//! Vertices of a mesh stand in rows. Any three parallel lines lie on a cylinder, and any three
//! coaxial circles on a torus: a fourth row within the tolerance is not a coincidence. Any two
//! coaxial circles lie on a sphere, which therefore needs a vertex with facets all around it. If a
//! surface continues tangentially into its neighbours, their tangent planes are further evidence
//! and replace a row.

use super::free::FreeFacets;
use super::part::{FacetPart, ends_clearly};
use crate::chart::{Primitive, PrimitiveKind};
use crate::start::plane;
use isoform_geom::{Point3, cross, dot, norm, sub};
use std::collections::BTreeMap;

/// Minimum number of rows of a cylinder and of each circle of a torus: one more than determines
/// them.
const MIN_ROWS_AROUND: usize = 4;
/// Minimum number of vertices of a sphere: twice as many as determine it, and one more than a box
/// has.
const MIN_SPHERE_VERTICES: usize = 9;
/// Maximum angle between vertices of one row, in radians: 60 000 rows to a circle.
const MAX_ROW_ANGLE: f64 = 1e-4;

/// Returns true if the vertices of a part and the surfaces next to it are evidence of its surface.
pub(crate) fn shows(free: &FreeFacets<'_>, part: &FacetPart) -> bool {
    let mesh = free.mesh;
    let surface = &part.surface;
    let points = mesh.at(&mesh.vertices(&part.triangles));
    let flat = plane(&points);
    let bend = points.iter().map(|p| flat.distance(*p).abs());
    // A bent part leaves its plane by ten tolerances.
    if bend.fold(0.0, f64::max) <= 10.0 * mesh.tolerance
        || !ends_clearly(mesh, part, |t| free.is_free(t))
    {
        return false;
    }
    let is_blend = tangent_parts(free, part) >= 2;
    let fewer = usize::from(is_blend);
    let around = |rows: usize| has_rows(points.iter().map(|p| around(surface, *p)), rows);
    match surface.kind {
        PrimitiveKind::Plane => true,
        PrimitiveKind::Cylinder => around(MIN_ROWS_AROUND - fewer),
        // A cone has a parameter more: any four rows on two rings may lie on one.
        PrimitiveKind::Cone => around(5),
        PrimitiveKind::Sphere if is_blend => points.len() > MIN_SPHERE_VERTICES / 2,
        PrimitiveKind::Sphere => {
            points.len() >= MIN_SPHERE_VERTICES && mesh.surround_a_vertex(&part.triangles)
        }
        PrimitiveKind::Torus => {
            let tube = points.iter().map(|p| section(surface, *p));
            // Twice as many vertices as determine a torus.
            points.len() >= 14 && around(MIN_ROWS_AROUND) && has_rows(tube, MIN_ROWS_AROUND - fewer)
        }
    }
}

/// Returns the number of adjacent parts that a part continues into tangentially.
fn tangent_parts(free: &FreeFacets<'_>, part: &FacetPart) -> usize {
    let mesh = free.mesh;
    let mut is_tangent: BTreeMap<u32, bool> = BTreeMap::new();
    for t in &part.triangles {
        for u in mesh.near(*t).iter().filter(|u| !free.is_free(**u)) {
            let other = free.taken[*u as usize];
            let surfaces = [&part.surface, &free.parts[other as usize].surface];
            let has_one_plane = |v: u32| {
                let [m, n] = surfaces.map(|s| s.normal(mesh.points[v as usize]));
                // Rounding turns tangent planes by this angle (radians) on faces of a thousandth of
                // the size.
                norm(cross(m, n)) <= 2e-3
            };
            *is_tangent.entry(other).or_insert(true) &= mesh.shared(*t, *u).all(has_one_plane);
        }
    }
    is_tangent.into_values().filter(|is| *is).count()
}

/// Returns the angle of a point about the axis.
fn around(surface: &Primitive, p: Point3) -> f64 {
    let [e, f] = surface.frame();
    let d = sub(p, surface.place);
    dot(d, f).atan2(dot(d, e))
}

/// Returns the angle of a point about the circle of a torus, in a meridian plane.
fn section(torus: &Primitive, p: Point3) -> f64 {
    let d = sub(p, torus.place);
    let radius = norm(cross(d, torus.axis));
    dot(d, torus.axis).atan2(radius - torus.size)
}

/// Returns true if at least `rows` different angles occur.
fn has_rows(angles: impl Iterator<Item = f64>, rows: usize) -> bool {
    let mut angles: Vec<f64> = angles.collect();
    angles.sort_by(f64::total_cmp);
    let turns = angles
        .windows(2)
        .filter(|w| w[1] - w[0] > MAX_ROW_ANGLE)
        .count();
    let whole = angles.first().zip(angles.last());
    let closes = whole.is_some_and(|(a, b)| a + std::f64::consts::TAU - b <= MAX_ROW_ANGLE);
    turns + 1 - usize::from(closes && turns > 0) >= rows
}
