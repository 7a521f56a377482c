//! Samples of a faceted CAD model that lie on the surface it stands for.
//!
//! Vertices of such a mesh lie on the true surface, but there are few of them on flat faces; points
//! inside the facets of a curved face lie off it, by the sagitta. So flat faces are sampled by
//! area, and straight lines of cylinders and cones (edges whose ends see the same two facets and
//! sharp edges only) by length. A scanned mesh has neither, and stays as it is.

use isoform_geom::{Point3, PointCloud, cross, dot, norm, sub};
use std::collections::BTreeMap;

/// Angle between the normals of two facets below which they are one plane: CAD exports have
/// rounding of 1e-4, scans have a degree and more.
const FLAT: f64 = 0.05_f64.to_radians();
/// Angle between the normals of two facets above which they meet in an edge of the object, not
/// within a curved face: a circle of 11 sides has 33°.
const SHARP: f64 = 35.0_f64.to_radians();
/// Share of the area that flat faces and facets along straight lines have at least on a CAD model.
const LEAST_EXACT: f64 = 0.2;
/// Largest number of parts that a straight line is divided into.
const MOST_PARTS: f64 = 1000.0;

/// Most points that are added on faces.
const MOST_ADDED: usize = 2_000_000;

/// A triangle with a corner that is no point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("triangle {triangle} has the corner {corner}, but there are {points} points (from 0)")]
pub struct CornerError {
    /// The triangle, from 0.
    pub triangle: usize,
    /// The index of its corner.
    pub corner: u32,
    /// How many points there are.
    pub points: usize,
}

/// Whether the corners of all triangles are points.
pub(crate) fn check_corners(mesh: &PointCloud) -> Result<(), CornerError> {
    let points = mesh.points.len();
    let corners = mesh.triangles.as_flattened().iter().enumerate();
    let mut missing = corners.filter(|(_, v)| **v as usize >= points);
    missing.next().map_or(Ok(()), |(i, &corner)| {
        Err(CornerError {
            triangle: i / 3,
            corner,
            points,
        })
    })
}

/// The points of the mesh, with about `wanted` further ones (two million at most) on flat faces and
/// straight lines; and how many were added.
///
/// # Errors
/// [`CornerError`].
pub fn points_on_faces(
    mesh: &PointCloud,
    wanted: usize,
) -> Result<(PointCloud, usize), CornerError> {
    check_corners(mesh)?;
    Ok(with_faces(mesh, wanted.min(MOST_ADDED)))
}

fn with_faces(mesh: &PointCloud, wanted: usize) -> (PointCloud, usize) {
    let faces = Faces::new(mesh);
    let total: f64 = faces.area.iter().sum();
    let is_flat: Vec<bool> = (0..mesh.triangles.len())
        .map(|t| faces.is_flat(t))
        .collect();
    let straight = faces.straight_edges();
    let exact = faces.exact_area(&is_flat, &straight);
    if !(total > 0.0 && exact >= LEAST_EXACT * total) || wanted == 0 {
        return (mesh.clone(), 0);
    }
    let spacing = (total / wanted as f64).sqrt();
    let mut points = mesh.points.clone();
    sample_flat_faces(mesh, &faces, &is_flat, spacing, &mut points);
    for (u, v) in straight {
        let (p, q) = (mesh.points[u as usize], mesh.points[v as usize]);
        sample_line(p, q, spacing, &mut points);
    }
    let added = points.len() - mesh.points.len();
    let cloud = PointCloud {
        points,
        origin: mesh.origin,
        triangles: mesh.triangles.clone(),
        ..PointCloud::default()
    };
    (cloud, added)
}

/// Adds a point for each square of the spacing on the flat faces, by area.
fn sample_flat_faces(
    mesh: &PointCloud,
    faces: &Faces,
    is_flat: &[bool],
    spacing: f64,
    points: &mut Vec<Point3>,
) {
    let (mut owed, mut k) = (0.0, 0_u32);
    let flat = mesh.triangles.iter().enumerate();
    for (t, triangle) in flat.filter(|(t, _)| is_flat[*t]) {
        owed += faces.area[t] / (spacing * spacing);
        while owed >= 1.0 {
            owed -= 1.0;
            k += 1;
            let corners = triangle.map(|v| mesh.points[v as usize]);
            points.push(on_triangle(k, corners));
        }
    }
}

/// Adds points inside the segment from p to q, no farther apart than the spacing.
fn sample_line(p: Point3, q: Point3, spacing: f64, points: &mut Vec<Point3>) {
    let pieces = (norm(sub(q, p)) / spacing).ceil().min(MOST_PARTS) as usize;
    let at = |j: usize| j as f64 / pieces as f64;
    points.extend((1..pieces).map(|j| std::array::from_fn(|i| p[i] + (q[i] - p[i]) * at(j))));
}

/// Point k of an even sequence on a triangle: a low-discrepancy pair (Roberts, the plastic number)
/// and the square root map.
pub(crate) fn on_triangle(k: u32, corners: [Point3; 3]) -> Point3 {
    let (r, s) = (
        (0.5 + 0.754_877_666_246_693 * f64::from(k)).fract().sqrt(),
        (0.5 + 0.569_840_290_998_053 * f64::from(k)).fract(),
    );
    let weights = [1.0 - r, r * (1.0 - s), r * s];
    std::array::from_fn(|i| {
        weights[0] * corners[0][i] + weights[1] * corners[1][i] + weights[2] * corners[2][i]
    })
}

/// Triangles by edge and by vertex.
struct Faces {
    /// Unit normals; 0 of a triangle without area.
    normals: Vec<Point3>,
    /// Areas.
    area: Vec<f64>,
    /// The triangles at each edge, by its ends in ascending order.
    edges: BTreeMap<(u32, u32), Vec<u32>>,
    /// The triangles at each vertex.
    around: Vec<Vec<u32>>,
    /// The triangles.
    of: Vec<[u32; 3]>,
}

impl Faces {
    /// The edges that are straight lines of curved faces.
    fn straight_edges(&self) -> Vec<(u32, u32)> {
        self.edges
            .iter()
            .filter(|((u, v), pair)| self.is_straight(*u, *v, pair))
            .map(|e| *e.0)
            .collect()
    }

    /// The area of flat faces and of the facets at straight edges.
    fn exact_area(&self, is_flat: &[bool], straight: &[(u32, u32)]) -> f64 {
        let mut is_exact = is_flat.to_vec();
        for t in straight.iter().flat_map(|e| &self.edges[e]) {
            is_exact[*t as usize] = true;
        }
        let exact = is_exact.iter().zip(&self.area).filter(|f| *f.0);
        exact.map(|f| f.1).sum()
    }

    /// The triangles of a mesh.
    fn new(mesh: &PointCloud) -> Self {
        let mut faces = Self {
            normals: Vec::new(),
            area: Vec::new(),
            edges: BTreeMap::new(),
            around: vec![Vec::new(); mesh.points.len()],
            of: mesh.triangles.clone(),
        };
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|v| mesh.points[v as usize]);
            let n = cross(sub(b, a), sub(c, a));
            let length = norm(n);
            faces.normals.push(if length > 0.0 {
                n.map(|v| v / length)
            } else {
                [0.0; 3]
            });
            faces.area.push(0.5 * length);
            for k in 0..3 {
                faces
                    .edges
                    .entry(edge(triangle[k], triangle[(k + 1) % 3]))
                    .or_default()
                    .push(t as u32);
                faces.around[triangle[k] as usize].push(t as u32);
            }
        }
        faces
    }

    /// Angle between two facets, whichever way round they are listed.
    fn angle(&self, a: u32, b: u32) -> f64 {
        let (m, n) = (self.normals[a as usize], self.normals[b as usize]);
        norm(cross(m, n)).atan2(dot(m, n))
    }

    /// Whether all neighbours lie in the same plane or beyond a sharp edge.
    fn is_flat(&self, t: usize) -> bool {
        let triangle = self.of[t];
        self.area[t] > 0.0
            && (0..3).all(|k| {
                let pair = &self.edges[&edge(triangle[k], triangle[(k + 1) % 3])];
                pair.iter()
                    .filter(|u| **u as usize != t && self.area[**u as usize] > 0.0)
                    .all(|u| {
                        let angle = self.angle(t as u32, *u);
                        !(FLAT..=SHARP).contains(&angle)
                    })
            })
    }

    /// Whether an edge is a straight line of the curved face that its facets stand for.
    fn is_straight(&self, u: u32, v: u32, pair: &[u32]) -> bool {
        let &[a, b] = pair else { return false };
        if self.area[a as usize] == 0.0
            || self.area[b as usize] == 0.0
            || !(FLAT..=SHARP).contains(&self.angle(a, b))
        {
            return false;
        }
        [u, v].iter().all(|w| {
            self.around[*w as usize]
                .iter()
                .filter(|t| self.area[**t as usize] > 0.0)
                .all(|t| {
                    let (p, q) = (self.angle(a, *t), self.angle(b, *t));
                    p < FLAT || q < FLAT || (p > SHARP && q > SHARP)
                })
        })
    }
}

/// The ends of an edge in ascending order.
fn edge(u: u32, v: u32) -> (u32, u32) {
    (u.min(v), u.max(v))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed prism over a regular polygon of radius 1 and height 4.
    fn prism(sides: u32) -> PointCloud {
        let ring = |z: f64| {
            (0..sides)
                .map(move |k| (std::f64::consts::TAU * f64::from(k) / f64::from(sides)).sin_cos())
                .map(move |(s, c)| [c, s, z])
        };
        let mut points: Vec<Point3> = ring(0.0).chain(ring(4.0)).collect();
        points.extend([[0.0; 3], [0.0, 0.0, 4.0]]);
        let mut triangles = Vec::new();
        for k in 0..sides {
            let (next, top) = ((k + 1) % sides, sides);
            triangles.extend([
                [k, next, top + next],
                [k, top + next, top + k],
                [2 * sides, next, k],
                [2 * sides + 1, top + k, top + next],
            ]);
        }
        PointCloud {
            points,
            triangles,
            ..PointCloud::default()
        }
    }

    #[test]
    fn added_points_lie_on_the_cylinder() {
        let mesh = prism(36);
        let (cloud, added) = with_faces(&mesh, 500);
        assert_eq!(cloud.points.len(), mesh.points.len() + added);
        let (mut caps, mut lines) = (0, 0);
        for p in &cloud.points[mesh.points.len()..] {
            let r = p[0].hypot(p[1]);
            if p[2].abs().min((p[2] - 4.0).abs()) < 1e-12 {
                caps += 1;
                assert!(r < 1.0 + 1e-12, "{p:?}");
            } else {
                lines += 1;
                assert!((r - 1.0).abs() < 1e-12, "{p:?}");
            }
        }
        assert!(caps > 50 && lines > 300, "{caps} {lines}");
    }

    #[test]
    fn all_faces_of_a_box_are_flat() {
        let (_, added) = with_faces(&prism(4), 1000);
        assert!((990..=1010).contains(&added), "{added}");
    }

    #[test]
    fn a_bumpy_mesh_stays_as_it_is() {
        let mut mesh = prism(36);
        for (k, p) in mesh.points.iter_mut().enumerate() {
            *p = p.map(|v| {
                v * (1.0 + 0.05 * (7.0 * k as f64).sin()) + 0.01 * (11.0 * k as f64).cos()
            });
        }
        assert_eq!(with_faces(&mesh, 500).1, 0);
    }

    #[test]
    fn corners_are_points() {
        let mut mesh = prism(5);
        let points = mesh.points.len();
        mesh.triangles[2][1] = 99;
        let error = points_on_faces(&mesh, 100).expect_err("no such point");
        let expected = CornerError {
            triangle: 2,
            corner: 99,
            points,
        };
        assert_eq!(error, expected);
    }
}
