//! Angles between neighbouring triangles of a curved part, and its radius there: how coarsely the
//! facets follow the surface.

use super::Place;
use isoform_geom::{Mesh, Point3, Solid, cross, dot, norm, principal_curvatures, sub};
use std::collections::HashSet;

/// Largest turn of a part: where its triangles follow it most coarsely.
#[derive(Clone, Debug, PartialEq)]
pub struct PartTurn {
    /// Name of the part.
    pub part: String,
    /// Largest angle between the normals of two triangles of the part at a common edge, in degrees;
    /// edges on feature curves have none.
    pub angle: f64,
    /// Smaller radius of curvature of the part there, in model units; infinite for a plane, NaN for a
    /// part that the solid lacks.
    pub radius: f64,
    /// Edge with that angle, which is the value.
    pub place: Place,
}

/// Measures the turns of all parts with two or more triangles, in the order of the mesh's parts.
pub(super) fn examine(mesh: &Mesh, solid: &dyn Solid) -> Vec<PartTurn> {
    let mut found: Vec<Option<PartTurn>> = vec![None; mesh.parts.len()];
    let creases: HashSet<[u32; 2]> = mesh.edges.iter().copied().map(sorted).collect();
    let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (k, t) in mesh.triangles.iter().enumerate() {
        edges.extend((0..3).map(|i| (sorted([t[i], t[(i + 1) % 3]]), k as u32)));
    }
    edges.sort_unstable();
    for group in edges.chunk_by(|a, b| a.0 == b.0) {
        let &[(edge, first), (_, second)] = group else {
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
            let [a, b] = edge.map(|v| mesh.points[v as usize]);
            *best = Some(PartTurn {
                part: mesh.parts[part as usize].clone(),
                angle: angle.to_degrees(),
                radius: f64::NAN,
                place: Place {
                    at: std::array::from_fn(|i| 0.5 * (a[i] + b[i])),
                    nodes: edge.to_vec(),
                    elements: vec![first, second],
                    value: angle.to_degrees(),
                },
            });
        }
    }
    let mut found: Vec<PartTurn> = found.into_iter().flatten().collect();
    for turn in &mut found {
        if let Some(piece) = solid.names().iter().position(|name| *name == turn.part) {
            turn.radius = radius(solid, piece as u32, turn.place.at);
        }
    }
    found
}

fn sorted(mut edge: [u32; 2]) -> [u32; 2] {
    edge.sort_unstable();
    edge
}

/// Returns the smaller radius of curvature of a piece near a point; infinite for a plane.
fn radius(solid: &dyn Solid, piece: u32, mut p: Point3) -> f64 {
    // Two steps from the middle of an edge to the surface, where the curvature is that of the part.
    for _ in 0..2 {
        let (value, g) = solid.gradient(piece, p);
        let share = value / dot(g, g).max(f64::MIN_POSITIVE);
        p = std::array::from_fn(|i| p[i] - share * g[i]);
    }
    let [low, high] = principal_curvatures(&solid.jet(piece, p));
    1.0 / low.abs().max(high.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    use isoform_geom::{Field, OnePiece};
    use isoform_num::{Jet2, Real};

    /// A torus around the z axis, of radii 5 and 2, as a polynomial, which is not a distance.
    struct Torus;

    impl Torus {
        fn formula<T: Real + Copy>(p: [T; 3]) -> T {
            let [x, y, z] = p;
            let s = x * x + y * y;
            let w = s + z * z + T::constant(21.0);
            w * w - s * T::constant(100.0)
        }
    }

    impl Field for Torus {
        fn value(&self, p: Point3) -> f64 {
            Self::formula(p)
        }
        fn jet(&self, p: Point3) -> Jet2 {
            Self::formula(std::array::from_fn(|i| Jet2::variable(p[i], i)))
        }
    }

    /// A cylinder around the z axis, of radius 5.
    struct Cylinder;

    impl Field for Cylinder {
        fn value(&self, [x, y, _]: Point3) -> f64 {
            25.0 - x * x - y * y
        }
        fn jet(&self, p: Point3) -> Jet2 {
            let [x, y] = [0, 1].map(|i| Jet2::variable(p[i], i));
            Jet2::constant(25.0) - x * x - y * y
        }
    }

    #[test]
    fn radii_of_curvature() {
        let torus = OnePiece::new(Torus, "torus");
        for angle in [0.0_f64, 0.7, 2.0, std::f64::consts::PI] {
            let far = 5.0 + 2.001 * angle.cos();
            let p = [0.6 * far, 0.8 * far, 2.001 * angle.sin()];
            // Across the tube it is 2; around the axis at least 3 everywhere.
            assert!((radius(&torus, 0, p) - 2.0).abs() < 1e-6, "{angle}");
        }
    }

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
            let turns = examine(&mesh, &OnePiece::new(Cylinder, "wall"));
            let names: Vec<&str> = turns.iter().map(|turn| turn.part.as_str()).collect();
            assert_eq!(names, ["wall", "end"]);
            assert!((turns[0].angle - 360.0 / f64::from(n)).abs() < 1e-9);
            assert!((turns[0].radius - 5.0).abs() < 1e-9);
            assert!(turns[1].angle < 1e-9 && turns[1].radius.is_nan());
            // As creases the edges are no turns.
            mesh.edges = (0..n).map(|k| [2 * k + 1, 2 * k]).collect();
            let turns = examine(&mesh, &OnePiece::new(Cylinder, "wall"));
            assert!(turns[0].angle < 1e-6);
        }
    }
}
