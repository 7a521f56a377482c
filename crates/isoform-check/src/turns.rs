//! Angles between neighbouring triangles of a curved part, and its radius there: how coarsely the
//! facets follow the surface.

use super::Place;
use isoform_geom::{Mesh, Point3, cross, distance_squared, dot, norm, sub};
use std::collections::HashSet;

/// Largest turn of a part: where its triangles follow it most coarsely.
#[derive(Clone, Debug, PartialEq)]
pub struct PartTurn {
    /// Name of the part.
    pub part: String,
    /// Largest angle between the normals of two triangles of the part at a common edge, in degrees;
    /// edges on feature curves have none.
    pub angle: f64,
    /// Radius of the circle through the edge and the two corners opposite to it, seen along the
    /// edge, in model units. A cylinder along the edge has this radius; infinite for a plane.
    pub radius: f64,
    /// Edge with that angle, which is the value.
    pub place: Place,
}

/// Measures the turns of all parts with two or more triangles, in the order of the mesh's parts.
pub(super) fn examine(mesh: &Mesh) -> Vec<PartTurn> {
    let mut found: Vec<Option<PartTurn>> = vec![None; mesh.parts.len()];
    let creases: HashSet<[u32; 2]> = mesh.edges.iter().copied().map(sorted).collect();
    // Edges with the triangle and its opposite corner.
    let mut edges: Vec<([u32; 2], u32, u32)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (k, t) in mesh.triangles.iter().enumerate() {
        edges.extend((0..3).map(|i| (sorted([t[i], t[(i + 1) % 3]]), k as u32, t[(i + 2) % 3])));
    }
    edges.sort_unstable();
    for group in edges.chunk_by(|a, b| a.0 == b.0) {
        let &[(edge, first, p), (_, second, q)] = group else {
            continue;
        };
        let part = |k: u32| mesh.triangle_parts.get(k as usize).copied();
        let Some(part) = part(first).filter(|_| part(first) == part(second)) else {
            continue;
        };
        if creases.contains(&edge) {
            continue;
        }
        let normal = |k: u32| {
            let [a, b, c] = mesh.triangles[k as usize].map(|v| mesh.points[v as usize]);
            cross(sub(b, a), sub(c, a))
        };
        let (m, n) = (normal(first), normal(second));
        let angle = norm(cross(m, n)).atan2(dot(m, n));
        let best = &mut found[part as usize];
        if best
            .as_ref()
            .is_none_or(|best| angle.to_degrees() > best.angle)
        {
            let [a, b, p, q] = [edge[0], edge[1], p, q].map(|v| mesh.points[v as usize]);
            *best = Some(PartTurn {
                part: mesh.parts[part as usize].clone(),
                angle: angle.to_degrees(),
                radius: radius(a, b, [p, q], angle),
                place: Place {
                    at: std::array::from_fn(|i| 0.5 * (a[i] + b[i])),
                    nodes: edge.to_vec(),
                    elements: vec![first, second],
                    value: angle.to_degrees(),
                },
            });
        }
    }
    found.into_iter().flatten().collect()
}

fn sorted(mut edge: [u32; 2]) -> [u32; 2] {
    edge.sort_unstable();
    edge
}

/// Returns the radius of the circle through an edge and two corners, seen along the edge: in the
/// triangle that they make the angle at the edge is π − `angle`, and the side opposite to it is
/// 2 R sin `angle`.
fn radius(a: Point3, b: Point3, corners: [Point3; 2], angle: f64) -> f64 {
    let edge = sub(b, a);
    let along = dot(edge, edge).max(f64::MIN_POSITIVE);
    let [p, q] = corners.map(|p| {
        let way = sub(p, a);
        let share = dot(way, edge) / along;
        let seen: Point3 = std::array::from_fn(|i| way[i] - share * edge[i]);
        seen
    });
    match angle.sin() {
        0.0 => f64::INFINITY,
        sine => distance_squared(p, q).sqrt() / (2.0 * sine),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A prism with n sides around a cylinder, each divided by a diagonal: neighbours at an edge
    /// along the axis turn by 360°/n, about the radius of the cylinder. Its ends are parts of their
    /// own, and flat.
    #[test]
    fn sides_of_a_prism_turn_as_the_circle_does() {
        for n in [5_u32, 9, 40] {
            let at = |k: u32, z: f64| {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(n)).sin_cos();
                [5.0 * cos, 5.0 * sin, z]
            };
            let mut mesh = Mesh {
                points: (0..2 * n).map(|k| at(k / 2, f64::from(k % 2))).collect(),
                parts: vec!["wall".into(), "end".into(), "empty".into()],
                ..Mesh::default()
            };
            for k in 0..n {
                let next = (k + 1) % n;
                let [a, b, c, d] = [2 * k, 2 * next, 2 * next + 1, 2 * k + 1];
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
                mesh.triangle_parts.extend([0, 0]);
            }
            for k in 1..n - 1 {
                mesh.triangles.push([0, 2 * k + 2, 2 * k]);
                mesh.triangle_parts.push(1);
            }
            let turns = examine(&mesh);
            let names: Vec<&str> = turns.iter().map(|turn| turn.part.as_str()).collect();
            assert_eq!(names, ["wall", "end"]);
            assert!((turns[0].angle - 360.0 / f64::from(n)).abs() < 1e-9);
            assert!((turns[0].radius - 5.0).abs() < 1e-9);
            assert!(turns[1].angle < 1e-9);
            // As creases the edges are no turns.
            mesh.edges = (0..n).map(|k| [2 * k + 1, 2 * k]).collect();
            assert!(examine(&mesh)[0].angle < 1e-6);
        }
    }
}
