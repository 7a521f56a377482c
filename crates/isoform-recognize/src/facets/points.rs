//! The points of a mesh that recognition reports on: its vertices, and further ones inside faces,
//! which lie on the surface as vertices do.
//!
//! Facets are chords: along a curved edge they reach beyond the face, or end before it. Points
//! between the chord and the edge are on the surface but not on the face, and are left out: a face
//! ends where the adjacent surface begins.

use super::claim::Claims;
use super::mesh::Facets;
use crate::chart::{Primitive, PrimitiveKind};
use crate::labels::UNLABELLED;
use isoform_geom::{Point3, dot, middle, on_triangle};
use std::collections::BTreeMap;

/// A point inside a facet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FacetPoint {
    pub(crate) at: Point3,
    /// Outward normal of the surface.
    pub(crate) normal: Point3,
    /// Part on whose surface the point is; [`UNLABELLED`] for points of facets without a part,
    /// which lie on the facet.
    pub(crate) part: u32,
    /// Facet over which the point lies.
    pub(crate) triangle: u32,
}

/// Returns about `wanted` points inside facets, and at least `fewest` inside each part, unless its
/// facets are all next to a curved edge.
pub(crate) fn inside(
    mesh: &Facets,
    claims: &Claims,
    wanted: usize,
    fewest: usize,
) -> Vec<FacetPoint> {
    let spacing = (mesh.areas.iter().sum::<f64>() / wanted.max(1) as f64).sqrt();
    let mut points = Vec::new();
    if wanted == 0 || spacing <= 0.0 {
        return points;
    }
    let borders = borders(mesh, claims);
    for (k, part) in claims.parts.iter().enumerate() {
        let area = mesh.area(&part.triangles);
        // Twice as many, because some fall beyond the border.
        let spacing = spacing.min((area / (2 * fewest).max(1) as f64).sqrt());
        let near = borders.range((k as u32, 0)..=(k as u32, UNLABELLED));
        let near: Vec<(&Primitive, &PartBorder)> = near
            .map(|((_, other), b)| (&claims.parts[*other as usize].surface, b))
            .collect();
        let is_on_face = |p: &Point3| near.iter().all(|(s, b)| b.is_kept(s.distance(*p), mesh));
        let on_surface = |(triangle, p): (u32, Point3)| {
            let at = match part.surface.kind {
                PrimitiveKind::Plane => p,
                _ => part.surface.foot(p),
            };
            let normal = part.surface.normal(at);
            let sign = dot(normal, mesh.normals[triangle as usize]).signum();
            FacetPoint {
                at,
                normal: normal.map(|x| sign * x),
                part: k as u32,
                triangle,
            }
        };
        let of = all_over(mesh, &part.triangles, spacing).into_iter();
        points.extend(of.map(on_surface).filter(|p| is_on_face(&p.at)));
    }
    let left = (0..mesh.triangles.len() as u32).filter(|t| claims.taken[*t as usize] == UNLABELLED);
    let left = all_over(mesh, &left.collect::<Vec<_>>(), spacing).into_iter();
    points.extend(left.map(|(triangle, at)| FacetPoint {
        at,
        normal: mesh.normals[triangle as usize],
        part: UNLABELLED,
        triangle,
    }));
    points
}

/// The edges that a part shares with another one.
#[derive(Default)]
struct PartBorder {
    /// Maximum distance of the edges from the two surfaces: the height of the chords.
    height: f64,
    /// Areas of the part's facets at the border on the two sides of the other surface.
    areas: [f64; 2],
}

impl PartBorder {
    /// Returns true if a point of the part at this distance from the other surface is on the part's
    /// face.
    fn is_kept(&self, distance: f64, mesh: &Facets) -> bool {
        let [below, above] = self.areas;
        // The face continues on both sides, like a plane that a pipe meets.
        // Chords reach beyond the end of a face by one facet in a hundred.
        let is_two_sided = below.min(above) > 0.01 * below.max(above);
        let is_far = distance.abs() > self.height + mesh.tolerance;
        let inwards = if above > below { distance } else { -distance };
        is_far || !is_two_sided && inwards > mesh.tolerance
    }
}

/// Returns the borders of the parts, by the part and its neighbour.
fn borders(mesh: &Facets, claims: &Claims) -> BTreeMap<(u32, u32), PartBorder> {
    let mut borders: BTreeMap<(u32, u32), PartBorder> = BTreeMap::new();
    for t in 0..mesh.triangles.len() as u32 {
        let own = claims.taken[t as usize];
        for u in mesh.near(t) {
            let other = claims.taken[*u as usize];
            if own == UNLABELLED || other == UNLABELLED || own == other {
                continue;
            }
            let [a, b] = [own, other].map(|k| &claims.parts[k as usize].surface);
            let border = borders.entry((own, other)).or_default();
            let shared = mesh.shared(t, *u);
            let ends: Vec<Point3> = shared.map(|v| mesh.points[v as usize]).collect();
            if let [p, q] = ends[..] {
                let chord = middle([p, q]);
                let height = a.distance(chord).abs().max(b.distance(chord).abs());
                border.height = border.height.max(height);
            }
            let side = b.distance(middle(mesh.corners(t)));
            border.areas[usize::from(side > 0.0)] += mesh.areas[t as usize];
        }
    }
    borders
}

/// Returns points on triangles, one per square of the spacing, each with its triangle.
fn all_over(mesh: &Facets, of: &[u32], spacing: f64) -> Vec<(u32, Point3)> {
    let (mut points, mut owed, mut k) = (Vec::new(), 0.0, 0);
    for t in of {
        owed += mesh.areas[*t as usize] / (spacing * spacing);
        while owed >= 1.0 {
            owed -= 1.0;
            k += 1;
            points.push((*t, on_triangle(k, mesh.corners(*t))));
        }
    }
    points
}

/// Returns the part of each vertex: of those that meet there the one with the fewest triangles, so
/// that narrow faces keep their points.
pub(crate) fn at_vertices(mesh: &Facets, claims: &Claims) -> Vec<u32> {
    let mut of = vec![UNLABELLED; mesh.points.len()];
    let size = |k: u32| (claims.parts[k as usize].triangles.len(), k);
    for (t, part) in claims
        .taken
        .iter()
        .enumerate()
        .filter(|t| *t.1 != UNLABELLED)
    {
        for v in mesh.triangles[t] {
            let now = &mut of[v as usize];
            if *now == UNLABELLED || size(*part) < size(*now) {
                *now = *part;
            }
        }
    }
    of
}
