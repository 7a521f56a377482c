//! A closed, oriented triangle surface, modified by replacing faces.

use super::align::{Cuttable, edges_of};
use crate::complex::{Face, NONE, edge};
use crate::measure::smallest_sine;
use crate::points::{centroid, unique};
use isoform_geom::{Point3, cross, dot, norm, sub};

/// Triangles with the faces around each vertex. Slots are reused; a slot whose first vertex is
/// [`NONE`] is empty.
#[derive(Clone, Debug, Default)]
pub(super) struct EditableSurface {
    pub(super) points: Vec<Point3>,
    pub(super) faces: Vec<[u32; 3]>,
    pub(super) labels: Vec<u32>,
    pub(super) around: Vec<Vec<u32>>,
    free: Vec<u32>,
}

fn normal(p: [Point3; 3]) -> Point3 {
    cross(sub(p[1], p[0]), sub(p[2], p[0]))
}

/// Returns the cosine between the normals of two faces; 1 if the first one has no area.
fn turned(old: [Point3; 3], new: [Point3; 3]) -> f64 {
    let (a, b) = (normal(old), normal(new));
    let length = norm(a) * norm(b);
    if length > 0.0 {
        dot(a, b) / length
    } else {
        f64::from(u8::from(norm(a) == 0.0))
    }
}

impl EditableSurface {
    pub(super) fn new(points: Vec<Point3>, faces: Vec<[u32; 3]>) -> Self {
        let mut around = vec![Vec::new(); points.len()];
        for (k, f) in faces.iter().enumerate() {
            f.iter().for_each(|&v| around[v as usize].push(k as u32));
        }
        Self {
            points,
            labels: vec![0; faces.len()],
            faces,
            around,
            free: Vec::new(),
        }
    }

    pub(super) fn at(&self, v: u32) -> Point3 {
        self.points[v as usize]
    }
    pub(super) fn is_there(&self, f: u32) -> bool {
        self.faces[f as usize][0] != NONE
    }
    pub(super) fn corners(&self, f: u32) -> [Point3; 3] {
        self.faces[f as usize].map(|v| self.at(v))
    }
    /// Returns the label of a face.
    pub(super) fn label_of(&self, f: u32) -> u32 {
        self.labels[f as usize]
    }
    pub(super) fn live(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.faces.len() as u32).filter(|&f| self.is_there(f))
    }
    /// Returns the faces with their labels.
    pub(super) fn labelled_faces(&self) -> Vec<Face> {
        let labelled = |f: u32| (self.faces[f as usize], self.labels[f as usize]);
        self.live().map(labelled).collect()
    }

    /// Assigns the given labels to the faces.
    pub(super) fn label(&mut self, labels: &[Face]) {
        for (face, label) in labels {
            if let Some([f, _]) = self.sides(face[0], face[1]) {
                self.labels[f as usize] = *label;
            }
        }
    }

    fn add_point(&mut self, p: Point3) -> u32 {
        self.points.push(p);
        self.around.push(Vec::new());
        self.points.len() as u32 - 1
    }

    /// Replaces faces by others, given with their labels.
    pub(super) fn replace(&mut self, old: &[u32], new: &[Face]) {
        for &f in old {
            for v in self.faces[f as usize] {
                self.around[v as usize].retain(|&k| k != f);
            }
            self.faces[f as usize] = [NONE; 3];
            self.free.push(f);
        }
        for &(face, label) in new {
            let slot = self.free.pop().unwrap_or_else(|| {
                self.faces.push([NONE; 3]);
                self.labels.push(0);
                self.faces.len() as u32 - 1
            });
            self.faces[slot as usize] = face;
            self.labels[slot as usize] = label;
            for v in face {
                self.around[v as usize].push(slot);
            }
        }
    }

    /// Returns a face with its label, one vertex replaced by another.
    pub(super) fn exchanged(&self, f: u32, old: u32, new: u32) -> Face {
        let face = self.faces[f as usize].map(|v| if v == old { new } else { v });
        (face, self.labels[f as usize])
    }

    /// Returns the corners of a face, with a vertex moved to `p`.
    pub(super) fn corners_with(&self, f: u32, v: u32, p: Point3) -> [Point3; 3] {
        self.faces[f as usize].map(|k| if k == v { p } else { self.at(k) })
    }

    /// Returns the faces at an edge: the one that runs along it from `a` to `b`, and the other.
    pub(super) fn sides(&self, a: u32, b: u32) -> Option<[u32; 2]> {
        let runs = |f: u32, a: u32, b: u32| {
            let f = self.faces[f as usize];
            (0..3).any(|i| f[i] == a && f[(i + 1) % 3] == b)
        };
        let star = &self.around[a as usize];
        let left = star.iter().copied().find(|&f| runs(f, a, b))?;
        let right = star.iter().copied().find(|&f| runs(f, b, a))?;
        Some([left, right])
    }

    /// Returns the vertex of a face that is neither of two.
    pub(super) fn opposite(&self, f: u32, a: u32, b: u32) -> u32 {
        self.faces[f as usize]
            .into_iter()
            .find(|&v| v != a && v != b)
            .unwrap_or(NONE)
    }

    /// Returns the neighbours of a vertex, ascending.
    pub(super) fn neighbours(&self, v: u32) -> Vec<u32> {
        let all = self.around[v as usize]
            .iter()
            .flat_map(|&f| self.faces[f as usize])
            .filter(|&k| k != v);
        unique(all.collect())
    }

    /// Splits an edge at a new vertex and returns that.
    pub(super) fn split_at(&mut self, a: u32, b: u32, p: Point3) -> Option<u32> {
        let [l, r] = self.sides(a, b)?;
        let (c, d) = (self.opposite(l, a, b), self.opposite(r, a, b));
        let labels = [l, r].map(|f| self.labels[f as usize]);
        let m = self.add_point(p);
        self.replace(
            &[l, r],
            &[
                ([a, m, c], labels[0]),
                ([m, b, c], labels[0]),
                ([b, m, d], labels[1]),
                ([m, a, d], labels[1]),
            ],
        );
        Some(m)
    }

    /// Iterates over the faces at a vertex, with the vertex moved to `p`.
    pub(super) fn star_with(
        &self,
        v: u32,
        p: Point3,
    ) -> impl Iterator<Item = (u32, [Point3; 3])> + '_ {
        let star = self.around[v as usize].iter();
        star.map(move |&f| (f, self.corners_with(f, v, p)))
    }

    /// Returns the smallest sine of the angles at a vertex's faces, with the vertex moved to `p`.
    pub(super) fn worst_at(&self, v: u32, p: Point3) -> f64 {
        self.star_with(v, p)
            .map(|(_, c)| smallest_sine(c))
            .fold(f64::INFINITY, f64::min)
    }

    /// Returns true if an edge joins the two vertices.
    pub(super) fn has_edge(&self, a: u32, b: u32) -> bool {
        let mut star = self.around[a as usize].iter();
        star.any(|&f| self.faces[f as usize].contains(&b))
    }

    /// Returns all edges, lower vertex first.
    pub(super) fn edges(&self) -> Vec<[u32; 2]> {
        edges_of(&self.faces())
    }

    /// Returns the centroid of a face.
    pub(super) fn middle(&self, f: u32) -> Point3 {
        centroid(self.corners(f))
    }

    /// Returns the length of an edge.
    pub(super) fn length(&self, [a, b]: [u32; 2]) -> f64 {
        norm(sub(self.at(a), self.at(b)))
    }

    /// Returns the edges of a face, lower vertex first.
    pub(super) fn edges_at(&self, f: u32) -> [[u32; 2]; 3] {
        let f = self.faces[f as usize];
        [edge(f[0], f[1]), edge(f[1], f[2]), edge(f[2], f[0])]
    }
}

impl Cuttable for EditableSurface {
    fn points(&self) -> &[Point3] {
        &self.points
    }
    fn faces(&self) -> Vec<[u32; 3]> {
        self.live().map(|f| self.faces[f as usize]).collect()
    }
    fn move_to(&mut self, v: u32, p: Point3) -> bool {
        let old = self.at(v);
        // Smallest sine of an angle that a vertex moved onto a curve may leave, unless it was
        // smaller before.
        let least = 0.08f64.min(0.5 * self.worst_at(v, old));
        let may = self
            .star_with(v, p)
            // Faces may turn by at most 72 degrees.
            .all(|(f, new)| smallest_sine(new) >= least && turned(self.corners(f), new) > 0.3);
        if may {
            self.points[v as usize] = p;
        }
        may
    }
    fn settle(&mut self, v: u32, p: Point3) {
        self.points[v as usize] = p;
    }
    fn split(&mut self, edge: [u32; 2], _: Point3, p: Point3) -> Option<u32> {
        self.split_at(edge[0], edge[1], p)
    }
}
