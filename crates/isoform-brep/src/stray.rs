//! Stray parts of a mesh, no triangle of which is on the surface of the solid.

use crate::BrepError;
use crate::locus::Distance;
use crate::newton::{POINT_TOLERANCE, meet};
use crate::topology::{TriangleSide, across_sides, components, ends_of};
use crate::whole::{Boundary, SolidPiece, piece_named};
use isoform_geom::{Mesh, Point3, Solid, distance_squared, middle};
use std::collections::BTreeMap;

/// Returns the part of each triangle. Connected triangles of a part are stray if none is on the
/// surface of the solid; they get the part with which they share the longest border. A node off the
/// surface, near a contact of parts, makes such triangles of a part that ends there.
///
/// # Errors
/// [`BrepError::NotClosed`].
pub(crate) fn parts_on_surface(mesh: &Mesh, solid: &dyn Solid) -> Result<Vec<u32>, BrepError> {
    let across = across_sides(&mesh.triangles)?;
    let labels = &mesh.triangle_parts;
    let is_same = |a: u32, b: u32| labels[a as usize] == labels[b as usize];
    let (set_of, count) = components(&across, is_same);
    let mut is_on = vec![false; count];
    for (t, set) in set_of.iter().enumerate() {
        let is_on = &mut is_on[*set as usize];
        *is_on = *is_on || is_triangle_on(mesh, solid, t);
    }
    let mut parts = labels.clone();
    for (set, part) in longest_borders(mesh, &across, &set_of, &is_on) {
        for (t, _) in set_of.iter().enumerate().filter(|(_, s)| **s == set) {
            parts[t] = part;
        }
    }
    Ok(parts)
}

/// Returns true if a triangle is on the surface of the solid: the point of its part nearest to its
/// middle, or all of its nodes.
fn is_triangle_on(mesh: &Mesh, solid: &dyn Solid, t: usize) -> bool {
    let [x, y, z] = mesh.bounds().size();
    let limit = POINT_TOLERANCE * x.max(y).max(z);
    let is_on = |p: Point3| Boundary(solid).distance(p).0.abs() <= limit;
    let corners = mesh.triangles[t].map(|v| mesh.points[v as usize]);
    let piece = piece_named(solid, &mesh.parts[mesh.triangle_parts[t] as usize]);
    let nearest = meet([&SolidPiece { solid, piece }], middle(corners));
    is_on(nearest) || corners.into_iter().all(is_on)
}

/// Returns, by stray component, the part with which it shares the longest border among those on the
/// surface.
fn longest_borders(
    mesh: &Mesh,
    across: &[[TriangleSide; 3]],
    set_of: &[u32],
    is_on: &[bool],
) -> BTreeMap<u32, u32> {
    let mut borders: BTreeMap<(u32, u32), f64> = BTreeMap::new();
    for (t, others) in across.iter().enumerate() {
        for (k, (other, _)) in (0..3).zip(others) {
            let [set, beyond] = [t, *other as usize].map(|t| set_of[t]);
            if !is_on[set as usize] && is_on[beyond as usize] {
                let [a, b] = ends_of(&mesh.triangles[t], k).map(|v| mesh.points[v as usize]);
                let part = mesh.triangle_parts[*other as usize];
                *borders.entry((set, part)).or_default() += distance_squared(a, b).sqrt();
            }
        }
    }
    let mut longest: BTreeMap<u32, (f64, u32)> = BTreeMap::new();
    for ((set, part), length) in borders {
        let best = longest.entry(set).or_default();
        if length > best.0 {
            *best = (length, part);
        }
    }
    longest
        .into_iter()
        .map(|(set, best)| (set, best.1))
        .collect()
}
