//! The points of a mesh that recognition reports on: its vertices, and further ones inside flat
//! faces and on straight lines of bent ones, which lie on the surface as vertices do.

use super::claim::Claims;
use super::mesh::{Facets, NONE};
use super::part::Part;
use crate::chart::Kind;
use isoform_geom::{Point3, middle, norm, sub};

/// The most points on one straight line: a thin rod of a fine model has no more.
const ON_LINE: f64 = 1000.0;

/// Points inside faces, each with its part.
pub(crate) fn inside(mesh: &Facets, claims: &Claims, wanted: usize) -> Vec<(Point3, u32)> {
    let total: f64 = claims.parts.iter().map(|p| mesh.area(&p.triangles)).sum();
    let spacing = (total / wanted.max(1) as f64).sqrt();
    let mut points = Vec::new();
    if wanted == 0 || spacing <= 0.0 {
        return points;
    }
    for (k, part) in claims.parts.iter().enumerate() {
        let of = match part.surface.kind {
            Kind::Plane => flat(mesh, part, spacing),
            Kind::Cylinder | Kind::Cone => straight(mesh, part, spacing),
            Kind::Sphere | Kind::Torus => Vec::new(),
        };
        points.extend(of.into_iter().map(|p| (p, k as u32)));
    }
    points
}

/// A point for each square of the spacing, by a low-discrepancy pair (Roberts, the plastic number)
/// and the square root map.
fn flat(mesh: &Facets, part: &Part, spacing: f64) -> Vec<Point3> {
    let (mut points, mut owed, mut k) = (Vec::new(), 0.0, 0.0_f64);
    for t in &part.triangles {
        owed += mesh.areas[*t as usize] / (spacing * spacing);
        let [a, b, c] = mesh.corners(*t);
        while owed >= 1.0 {
            owed -= 1.0;
            k += 1.0;
            let r: f64 = (0.5 + 0.754_877_666_246_693 * k).fract();
            let (r, s) = (r.sqrt(), (0.5_f64 + 0.569_840_290_998_053 * k).fract());
            let w = [1.0 - r, r * (1.0 - s), r * s];
            points.push(std::array::from_fn(|i| {
                w[0] * a[i] + w[1] * b[i] + w[2] * c[i]
            }));
        }
    }
    points
}

/// Points on edges that are straight lines of the surface, no farther apart than the spacing.
fn straight(mesh: &Facets, part: &Part, spacing: f64) -> Vec<Point3> {
    let sides = |t: &u32| {
        let [a, b, c] = mesh.triangles[*t as usize];
        [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)])
    };
    let mut edges: Vec<[u32; 2]> = part.triangles.iter().flat_map(sides).collect();
    edges.sort_unstable();
    edges.dedup();
    let mut points = Vec::new();
    for edge in edges {
        let [p, q] = edge.map(|v| mesh.points[v as usize]);
        let off = part.surface.distance(middle([p, q])).abs();
        if off <= mesh.tolerance {
            let pieces = (norm(sub(q, p)) / spacing).ceil().min(ON_LINE) as usize;
            let at = |j: usize| j as f64 / pieces as f64;
            points.extend(
                (1..pieces)
                    .map(|j| -> Point3 { std::array::from_fn(|i| p[i] + (q[i] - p[i]) * at(j)) }),
            );
        }
    }
    points
}

/// The part of each vertex: of those that meet there the one with the fewest triangles, so that
/// narrow faces keep their points.
pub(crate) fn at_vertices(mesh: &Facets, claims: &Claims) -> Vec<u32> {
    let mut of = vec![NONE; mesh.points.len()];
    let size = |k: u32| (claims.parts[k as usize].triangles.len(), k);
    for (t, part) in claims.taken.iter().enumerate().filter(|t| *t.1 != NONE) {
        for v in mesh.triangles[t] {
            let now = &mut of[v as usize];
            if *now == NONE || size(*part) < size(*now) {
                *now = *part;
            }
        }
    }
    of
}
