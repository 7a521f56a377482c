//! The inside of closed triangles: signs of distances from them.

use super::nearest::TriangleTree;
use isoform_geom::{Point3, cross, dot, norm, sub};
use std::collections::HashMap;

/// Share of an edge from its end, below which a nearest point counts as that end: some thousand
/// rounding errors.
const VERTEX_SHARE: f64 = 1e-12;

/// Closed triangles with the normals of their faces, edges and vertices.
///
/// At the nearest point of an edge or vertex, the sum of the normals of the faces around it,
/// weighted by their angles, tells the side (J. A. Bærentzen and H. Aanæs, IEEE Trans. Vis. Comput.
/// Graph. 11, 2005).
pub(crate) struct Sides<'a> {
    tree: &'a TriangleTree,
    /// Corners of each triangle, equal for equal positions.
    corners: Vec<[u32; 3]>,
    /// Normals of faces, of length 1, or 0 for triangles without area.
    faces: Vec<Point3>,
    /// Sums of the normals of the two faces of each edge, by its ends.
    edges: HashMap<[u32; 2], Point3>,
    /// Sums of the normals around each corner, weighted by angles.
    vertices: Vec<Point3>,
    /// True if the normals point inward: the volume of the triangles is negative.
    pub(super) is_inverted: bool,
}

impl<'a> Sides<'a> {
    /// Returns the sides of triangles; `None` unless they are closed and agree on their
    /// orientation.
    pub(crate) fn new(tree: &'a TriangleTree, triangles: &[[Point3; 3]]) -> Option<Self> {
        let corners = welded(triangles);
        let mut balance: HashMap<[u32; 2], i32> = HashMap::new();
        for t in &corners {
            for (a, b) in sides_of(*t).filter(|(a, b)| a != b) {
                *balance.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
            }
        }
        if corners.is_empty() || balance.values().any(|sum| *sum != 0) {
            return None;
        }
        let n = corners
            .iter()
            .flatten()
            .max()
            .map_or(0, |v| *v as usize + 1);
        let mut sides = Self {
            tree,
            faces: triangles.iter().map(face_normal).collect(),
            edges: HashMap::new(),
            vertices: vec![[0.0; 3]; n],
            is_inverted: volume(triangles) < 0.0,
            corners,
        };
        for (i, t) in triangles.iter().enumerate() {
            let normal = sides.faces[i];
            for k in 0..3 {
                let (a, b) = (sub(t[(k + 1) % 3], t[k]), sub(t[(k + 2) % 3], t[k]));
                let angle = norm(cross(a, b)).atan2(dot(a, b));
                let corner = sides.corners[i][k] as usize;
                add(&mut sides.vertices[corner], normal, angle);
            }
            for (a, b) in sides_of(sides.corners[i]) {
                let sum = sides.edges.entry([a.min(b), a.max(b)]).or_default();
                add(sum, normal, 1.0);
            }
        }
        Some(sides)
    }

    /// Returns true if a point is inside.
    pub(super) fn is_inside(&self, p: Point3) -> bool {
        let near = self.nearest(p);
        let is_behind = |(_, foot, normal)| dot(sub(p, foot), normal) < 0.0;
        near.is_some_and(is_behind) != self.is_inverted
    }

    /// Returns the nearest triangle, the nearest point of it, and an outward normal there; `None` if
    /// no distance is finite.
    pub(super) fn nearest(&self, p: Point3) -> Option<(usize, Point3, Point3)> {
        Some(self.on_triangle(p, self.tree.nearest_triangle(p)?))
    }

    /// Returns a triangle's index, its nearest point, and an outward normal there.
    fn on_triangle(&self, p: Point3, (i, t): (u32, [Point3; 3])) -> (usize, Point3, Point3) {
        let (foot, weights) = isoform_cad::nearest_on_triangle(p, t);
        (i as usize, foot, self.normal(i as usize, weights))
    }

    /// Computes the signed distances of points from the triangles, positive inside. Successive points
    /// are best close together.
    pub(crate) fn signed_distances(&self, points: &[Point3], out: &mut [f64]) {
        let mut guess = 0;
        for (p, out) in points.iter().zip(out) {
            let (distance, place) = self.tree.nearest(*p, guess);
            guess = place;
            let (_, foot, normal) = self.on_triangle(*p, self.tree.triangle(place));
            let is_inside = (dot(sub(*p, foot), normal) < 0.0) != self.is_inverted;
            *out = if is_inside { distance } else { -distance };
        }
    }

    /// Returns the normal at a place of a triangle.
    fn normal(&self, i: usize, weights: [f64; 3]) -> Point3 {
        let on: Vec<usize> = (0..3).filter(|k| weights[*k] > VERTEX_SHARE).collect();
        let corners = self.corners[i];
        match on[..] {
            [k] => self.vertices[corners[k] as usize],
            [j, k] => {
                let [a, b] = [corners[j], corners[k]];
                self.edges[&[a.min(b), a.max(b)]]
            }
            _ => self.faces[i],
        }
    }
}

/// Returns six times the volume within closed triangles.
pub(crate) fn volume(triangles: &[[Point3; 3]]) -> f64 {
    let first = triangles.first().map_or([0.0; 3], |t| t[0]);
    let part = |t: &[Point3; 3]| {
        let [a, b, c] = t.map(|p| sub(p, first));
        dot(a, cross(b, c))
    };
    triangles.iter().map(part).sum()
}

/// Returns the directed edges of a triangle.
fn sides_of([a, b, c]: [u32; 3]) -> impl Iterator<Item = (u32, u32)> {
    [(a, b), (b, c), (c, a)].into_iter()
}

/// Adds a multiple of a vector.
fn add(sum: &mut Point3, v: Point3, factor: f64) {
    (0..3).for_each(|k| sum[k] += factor * v[k]);
}

/// Returns the unit normal of a triangle; 0 without area.
fn face_normal(t: &[Point3; 3]) -> Point3 {
    let n = cross(sub(t[1], t[0]), sub(t[2], t[0]));
    let length = norm(n);
    n.map(|v| if length > 0.0 { v / length } else { 0.0 })
}

/// Returns numbers of the corners of triangles, one for each position.
fn welded(triangles: &[[Point3; 3]]) -> Vec<[u32; 3]> {
    let mut numbers: HashMap<[u64; 3], u32> = HashMap::new();
    let mut number = |p: &Point3| {
        // Adding 0 makes -0 equal to 0.
        let key = p.map(|v| (v + 0.0).to_bits());
        let next = numbers.len() as u32;
        *numbers.entry(key).or_insert(next)
    };
    triangles
        .iter()
        .map(|t| t.each_ref().map(&mut number))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron with a sharp corner: signs near its edges and corners are those of its planes.
    #[test]
    fn signs_near_edges_and_corners() {
        let p = [[0.0; 3], [4.0, 0.0, 0.0], [0.2, 3.0, 0.0], [-2.0, 1.0, 0.7]];
        let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let triangles: Vec<[Point3; 3]> = faces.iter().map(|t| t.map(|v: usize| p[v])).collect();
        let tree = TriangleTree::new(&triangles);
        let sides = Sides::new(&tree, &triangles).expect("closed");
        // Triangles that are turned inside out bound the same solid.
        let inward: Vec<[Point3; 3]> = triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        let inward_tree = TriangleTree::new(&inward);
        let turned = Sides::new(&inward_tree, &inward).expect("closed");
        let mut random = isoform_num::Random::new(3);
        for i in 0..20_000 {
            let about = p[i % 4];
            let q = about.map(|v| v + [0.05, 3.0][i / 4 % 2] * (2.0 * random.unit() - 1.0));
            let inside = triangles
                .iter()
                .all(|t| dot(sub(q, t[0]), face_normal(t)) < 0.0);
            assert_eq!(sides.is_inside(q), inside, "{q:?}");
            assert_eq!(turned.is_inside(q), inside, "{q:?}");
        }
    }

    #[test]
    fn open_and_turned_triangles_have_no_sides() {
        let p = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let of = |faces: &[[usize; 3]]| -> bool {
            let triangles: Vec<[Point3; 3]> = faces.iter().map(|t| t.map(|v| p[v])).collect();
            Sides::new(&TriangleTree::new(&triangles), &triangles).is_some()
        };
        assert!(of(&[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]));
        assert!(!of(&[[0, 2, 1], [0, 1, 3], [1, 2, 3]]));
        assert!(!of(&[[0, 1, 2], [0, 1, 3], [1, 2, 3], [2, 0, 3]]));
        assert!(!of(&[]));
    }
}
