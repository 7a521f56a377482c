//! A tetrahedral complex with neighbours, modified by replacing cavities.
//!
//! Every operation of the mesher (edge split, edge removal, flip, collapse) removes some tetrahedra
//! and fills their cavity with others: [`Complex::replace`] is the only place where neighbours are
//! written, so they stay consistent.
//!
//! Terms used here, and in all modules that work on the complex:
//! - the *star* of a vertex: all tetrahedra that have it as a corner;
//! - the *ring* of an edge: all tetrahedra that have it as an edge, in order around it;
//! - the *link* of an edge: the vertices of its ring except its ends, in its order;
//! - a *cavity*: the space that removed tetrahedra leave and new ones fill;
//! - the *label* of a face on the boundary: the piece of the solid that it lies on.
//!
//! ```text
//!        l1 ---- l2          The ring of an edge that stands upright on this page: its
//!       /  \    /  \         tetrahedra are (a, b, l0, l1), (a, b, l1, l2), ... for the ends a
//!      /    \  /    \        and b, its link is l0, l1, l2, ... An edge on the boundary has an
//!    l0 ---- ab ---- l3      open ring: its link has one vertex more than it has tetrahedra.
//! ```

mod cavity;
mod fans;
mod neighbours;
mod opened;
mod regions;

use crate::torus::Torus;
use cavity::Cavity;
pub(crate) use cavity::label_in;
use isoform_control::Control;
use isoform_geom::{Point3, TET_FACES, TRIANGLE_EDGES, norm, sub};
use rayon::prelude::*;
use std::collections::HashSet;

/// Marker of a missing tetrahedron or vertex.
pub(crate) const NONE: u32 = u32::MAX;
/// First value of neighbours that encodes a face on the boundary: this bit, with the face's label.
pub(crate) const BOUNDARY: u32 = 1 << 31;
/// Neighbour of a boundary face that does not belong to the solid's surface.
pub(crate) const OPEN: u32 = BOUNDARY | (BOUNDARY - 2);
/// Label of a face of the solid's surface that does not lie on a single piece.
pub(crate) const STRAY: u32 = BOUNDARY - 3;
/// Maximum number of faces or tetrahedra that are searched linearly; above it a hash table is
/// faster. Cavities and stars seldom have more than a few dozen.
const MAX_SCANNED_ITEMS: usize = 200;

/// A complex of tetrahedra with neighbours. Slots are reused; a slot whose first vertex is [`NONE`]
/// is empty.
#[derive(Clone, Debug, Default)]
pub(crate) struct Complex {
    pub(crate) points: Vec<Point3>,
    pub(crate) tets: Vec<[u32; 4]>,
    /// Neighbour opposite to each vertex, or [`BOUNDARY`] with a label.
    pub(crate) adjacent: Vec<[u32; 4]>,
    /// Region of each tetrahedron; empty if the complex is not divided into regions.
    regions: Vec<u16>,
    /// Labels of the faces between regions, opposite to each vertex; [`NONE`] for other faces.
    /// Empty if the complex is not divided into regions.
    walls: Vec<[u32; 4]>,
    /// Periodic box of a complex that is a unit cell.
    pub(crate) torus: Option<Torus>,
    /// One tetrahedron of each vertex; [`NONE`] for unused vertices.
    pub(crate) tet_of: Vec<u32>,
    /// Empty slots.
    free: Vec<u32>,
    /// Epoch of the last visit to each tetrahedron.
    marks: Vec<u32>,
    epoch: u32,
    /// Buffers of [`Complex::replace`].
    cavity: Cavity,
    /// Slots of tetrahedra that were inserted or whose boundary faces changed, if recorded; some
    /// may be empty again.
    pub(crate) log: Option<Vec<u32>>,
}

/// Pairs of local vertex indices of a tetrahedron's edges.
pub(crate) const EDGES: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];

/// A face of the solid's surface: its vertices, outward, and its label.
pub(crate) type Face = ([u32; 3], u32);

/// Returns the ends of an edge, lower vertex first.
#[inline]
pub(crate) fn edge(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Lists the edges of labelled triangles, lower vertex first, each with its triangle's label;
/// sorted, so that all entries of one edge are adjacent.
pub(crate) fn labelled_edges(faces: impl Iterator<Item = Face>) -> Vec<([u32; 2], u32)> {
    let mut edges: Vec<_> = faces
        .flat_map(|(f, label)| TRIANGLE_EDGES.map(|[i, j]| (edge(f[i], f[j]), label)))
        .collect();
    edges.par_sort_unstable();
    edges
}

/// Returns the vertices of a face in ascending order, its key in lists of faces.
#[inline]
fn sorted(mut f: [u32; 3]) -> [u32; 3] {
    f.sort_unstable();
    f
}

/// Ring and link of an edge, see [`Complex::ring`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Ring {
    /// Tetrahedra around the edge, in order.
    pub(crate) tets: Vec<u32>,
    /// Vertices of the link, in order; one more than tetrahedra if the ring is open.
    pub(crate) link: Vec<u32>,
    /// True if the ring is a full cycle (the edge is not on the boundary).
    pub(crate) closed: bool,
}

impl Ring {
    /// Returns the first and the last tetrahedron, each with the vertex of the link at its outer
    /// end. In an open ring these have the two boundary faces at the edge.
    pub(crate) fn ends(&self) -> [(u32, u32); 2] {
        let (t, l) = (self.tets.len() - 1, self.link.len() - 1);
        [(self.tets[0], self.link[0]), (self.tets[t], self.link[l])]
    }
}

impl Complex {
    /// Builds a complex from vertices and positive tetrahedra; boundary faces are [`OPEN`].
    pub(crate) fn new(points: Vec<Point3>, tets: Vec<[u32; 4]>) -> Self {
        Self::within(points, tets, &Control::default())
    }

    /// Builds a complex like [`Self::new`]. After a stop by `control` neighbours are missing.
    pub(crate) fn within(points: Vec<Point3>, tets: Vec<[u32; 4]>, control: &Control<'_>) -> Self {
        let adjacent = neighbours::adjacency(points.len(), &tets, control);
        let mut tet_of = vec![NONE; points.len()];
        for (t, v) in tets.iter().enumerate() {
            for &k in v {
                tet_of[k as usize] = t as u32;
            }
        }
        let marks = vec![0; tets.len()];
        Self {
            points,
            tets,
            adjacent,
            tet_of,
            marks,
            ..Self::default()
        }
    }

    #[inline]
    pub(crate) fn is_there(&self, t: u32) -> bool {
        self.tets[t as usize][0] != NONE
    }

    /// Returns the position of a vertex.
    #[inline]
    pub(crate) fn point(&self, v: u32) -> Point3 {
        self.points[v as usize]
    }

    /// Returns the positions of a tetrahedron's corners, unwrapped so that they are close to each
    /// other.
    #[inline]
    pub(crate) fn corners(&self, t: u32) -> [Point3; 4] {
        self.points_of(self.tets[t as usize])
    }

    /// Returns the positions, unwrapped, of vertices of one tetrahedron, or of several on one side
    /// of all walls.
    #[inline(always)]
    pub(crate) fn points_of<const N: usize>(&self, vertices: [u32; N]) -> [Point3; N] {
        self.together(vertices.map(|v| self.points[v as usize]))
    }

    /// Unwraps positions of such vertices in a unit cell: chooses periodic images close to each
    /// other.
    #[inline(always)]
    pub(crate) fn together<const N: usize>(&self, places: [Point3; N]) -> [Point3; N] {
        if let Some(torus) = &self.torus {
            let mut places = places;
            torus.bring_together(&mut places);
            return places;
        }
        places
    }

    /// Translates unwrapped positions so that the first becomes the stored position of vertex `v`;
    /// the others are those of further vertices of its tetrahedron.
    #[inline]
    pub(crate) fn seen_from<const N: usize>(&self, v: u32, mut places: [Point3; N]) -> [Point3; N] {
        if self.torus.is_some() {
            let (p, seen) = (self.point(v), places[0]);
            for q in &mut places {
                *q = std::array::from_fn(|i| q[i] + (p[i] - seen[i]));
            }
        }
        places
    }

    /// Returns the centroid of a tetrahedron.
    pub(crate) fn middle(&self, t: u32) -> Point3 {
        let c = self.corners(t);
        std::array::from_fn(|i| 0.25 * (c[0][i] + c[1][i] + c[2][i] + c[3][i]))
    }

    /// Returns the edges of a tetrahedron, lower vertex first.
    #[inline]
    pub(crate) fn edges(&self, t: u32) -> [[u32; 2]; 6] {
        let v = self.tets[t as usize];
        EDGES.map(|(i, j)| edge(v[i], v[j]))
    }

    /// Returns the distance between two vertices.
    #[inline]
    pub(crate) fn edge_length(&self, a: u32, b: u32) -> f64 {
        let [p, q] = self.points_of([a, b]);
        norm(sub(p, q))
    }

    pub(crate) fn add_point(&mut self, p: Point3) -> u32 {
        self.points.push(p);
        self.tet_of.push(NONE);
        self.points.len() as u32 - 1
    }

    /// Returns the local index of a vertex in a tetrahedron.
    #[inline]
    pub(crate) fn place(&self, t: u32, v: u32) -> usize {
        self.tets[t as usize]
            .iter()
            .position(|&k| k == v)
            .expect("a vertex of the tetrahedron")
    }

    /// Returns the face opposite to vertex `i` of tetrahedron `t`, outward.
    #[inline]
    pub(crate) fn face(&self, t: u32, i: usize) -> [u32; 3] {
        TET_FACES[i].map(|k| self.tets[t as usize][k])
    }

    /// Returns the label of the face opposite to vertex `i` of tetrahedron `t`; `None` unless it
    /// lies on the surface of the solid or of a region. A face between regions belongs to the first
    /// of them.
    #[inline]
    pub(crate) fn label(&self, t: u32, i: usize) -> Option<u32> {
        let n = self.adjacent[t as usize][i];
        if n >= BOUNDARY {
            (n != OPEN).then_some(n & !BOUNDARY)
        } else {
            self.owns(t, i).then(|| self.walls[t as usize][i])
        }
    }

    /// Returns the labels of the faces at the edge of a ring, in its order: two on a surface, zero
    /// within a region, more where surfaces meet.
    pub(crate) fn labels_at(&self, ring: &Ring) -> Vec<u32> {
        let mut labels = Vec::new();
        for (k, &t) in ring.tets.iter().enumerate() {
            let next = (k + 1) % ring.link.len();
            // A tetrahedron of the ring has two faces at the edge, each opposite to a vertex of the
            // link.
            for opposite in [ring.link[next], ring.link[k]] {
                labels.extend(self.label(t, self.place(t, opposite)));
            }
        }
        labels
    }

    /// Returns true if the edge of a ring lies on the boundary, or on a wall between regions.
    #[inline]
    pub(crate) fn is_on_surface(&self, ring: &Ring) -> bool {
        !ring.closed || (self.is_divided() && !self.labels_at(ring).is_empty())
    }

    /// Returns the labels of the two faces of the solid's surface at the edge of an open ring;
    /// `None` if one of them is open.
    pub(crate) fn labels_beside(&self, ring: &Ring) -> Option<[u32; 2]> {
        let [first, last] = ring.ends();
        let behind = [ring.link[1], ring.link[ring.link.len() - 2]];
        let label = |t: u32, v: u32| self.label(t, self.place(t, v));
        Some([label(first.0, behind[0])?, label(last.0, behind[1])?])
    }

    /// Returns the labelled faces of the solid's surface, outward.
    pub(crate) fn faces(&self) -> Vec<Face> {
        let mut faces = Vec::new();
        for t in self.live() {
            for i in 0..4 {
                if let Some(label) = self.label(t, i) {
                    faces.push((self.face(t, i), label));
                }
            }
        }
        faces
    }

    /// Iterates over the occupied slots.
    pub(crate) fn live(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.tets.len() as u32).filter(|&t| self.is_there(t))
    }

    fn next_epoch(&mut self) -> u32 {
        if self.epoch == u32::MAX {
            self.marks.fill(0);
            self.epoch = 0;
        }
        self.epoch += 1;
        self.epoch
    }

    /// Collects all tetrahedra at a vertex.
    pub(crate) fn star(&mut self, v: u32, out: &mut Vec<u32>) {
        let epoch = self.next_epoch();
        let mut marks = std::mem::take(&mut self.marks);
        self.spread(v, out, |n, _| {
            std::mem::replace(&mut marks[n as usize], epoch) != epoch
        });
        self.marks = marks;
    }

    /// Collects all tetrahedra at a vertex without marks, so that several threads may search at
    /// once.
    pub(crate) fn star_shared(&self, v: u32, out: &mut Vec<u32>) {
        let mut many = HashSet::new();
        self.spread(v, out, |n, out| {
            if out.len() < MAX_SCANNED_ITEMS {
                return !out.contains(&n);
            }
            if many.is_empty() {
                many.extend(out.iter().copied());
            }
            many.insert(n)
        });
    }

    /// Walks from tetrahedron to tetrahedron around a vertex, to those for which `is_new` returns
    /// true.
    fn spread(&self, v: u32, out: &mut Vec<u32>, mut is_new: impl FnMut(u32, &[u32]) -> bool) {
        out.clear();
        let first = self.tet_of[v as usize];
        if first == NONE {
            return;
        }
        is_new(first, out);
        out.push(first);
        let mut at = 0;
        while at < out.len() {
            let t = out[at] as usize;
            at += 1;
            for i in 0..4 {
                let n = self.adjacent[t][i];
                if self.tets[t][i] != v && n < BOUNDARY && is_new(n, out) {
                    out.push(n);
                }
            }
        }
    }

    /// Returns the vertices of the stars of the given vertices, without duplicates.
    pub(crate) fn vertices_around(&mut self, vertices: &[u32]) -> Vec<u32> {
        let (mut around, mut star) = (Vec::new(), Vec::new());
        for &v in vertices {
            self.star(v, &mut star);
            around.extend(star.iter().flat_map(|&t| self.tets[t as usize]));
        }
        crate::points::unique(around)
    }

    /// Returns true if an edge joins two vertices.
    pub(crate) fn are_neighbours(&self, a: u32, b: u32) -> bool {
        self.shared_tet(a, b).is_some()
    }

    /// Returns a tetrahedron with both vertices.
    fn shared_tet(&self, a: u32, b: u32) -> Option<u32> {
        let mut star = Vec::with_capacity(64);
        self.star_shared(a, &mut star);
        star.into_iter()
            .find(|&t| self.tets[t as usize].contains(&b))
    }

    /// Collects the ring of the edge from vertex `a` to `b` of tetrahedron `t`.
    pub(crate) fn ring(&self, t: u32, a: u32, b: u32, ring: &mut Ring) {
        ring.tets.clear();
        ring.link.clear();
        ring.closed = false;
        let v = self.tets[t as usize];
        let mut others = v.iter().copied().filter(|&k| k != a && k != b);
        let (c, d) = (
            others.next().expect("four vertices"),
            others.next().expect("four vertices"),
        );
        // Forward over d: leave each tetrahedron through the face opposite to the vertex that was
        // entered last.
        ring.tets.push(t);
        ring.link.extend([c, d]);
        if self.walk(t, a, b, c, d, ring) {
            ring.closed = true;
            ring.link.pop();
            return;
        }
        // An open ring is extended at its front in the other direction.
        let mut back = Ring::default();
        back.link.extend([d, c]);
        self.walk(t, a, b, d, c, &mut back);
        back.tets.reverse();
        back.link.drain(..2);
        back.link.reverse();
        back.tets.extend_from_slice(&ring.tets);
        back.link.extend_from_slice(&ring.link);
        *ring = back;
    }

    /// Collects the ring of the edge from `a` to `b`; returns false if the edge does not exist.
    pub(crate) fn ring_of(&self, a: u32, b: u32, ring: &mut Ring) -> bool {
        let found = self.shared_tet(a, b);
        if let Some(t) = found {
            self.ring(t, a, b, ring);
        }
        found.is_some()
    }

    /// Walks from `t` across the face opposite to `from`, over `over`; returns true if it arrives
    /// at `t` again.
    fn walk(&self, t: u32, a: u32, b: u32, from: u32, over: u32, ring: &mut Ring) -> bool {
        let (mut at, mut from, mut over) = (t, from, over);
        loop {
            let next = self.adjacent[at as usize][self.place(at, from)];
            if next >= BOUNDARY {
                return false;
            }
            if next == t {
                return true;
            }
            let fresh = self.tets[next as usize]
                .iter()
                .copied()
                .find(|&k| k != a && k != b && k != over)
                .expect("four vertices");
            ring.tets.push(next);
            ring.link.push(fresh);
            (at, from, over) = (next, over, fresh);
        }
    }

    /// Describes an inconsistency of neighbours or walls, for tests; `None` if there are none.
    #[cfg(any(test, debug_assertions))]
    pub(crate) fn fault(&self) -> Option<String> {
        for t in self.live() {
            for i in 0..4 {
                let n = self.adjacent[t as usize][i];
                if n < BOUNDARY {
                    let f = sorted(self.face(t, i));
                    let back = (0..4).find(|&j| {
                        self.adjacent[n as usize][j] == t && sorted(self.face(n, j)) == f
                    });
                    let Some(j) = back.filter(|_| self.is_there(n)) else {
                        return Some(format!("tet {t} face {i}: neighbour {n} does not agree"));
                    };
                    let label = self.walls.get(t as usize).map_or(NONE, |w| w[i]);
                    let theirs = self.walls.get(n as usize).map_or(NONE, |w| w[j]);
                    if label != theirs || (label != NONE) != self.is_wall(t, i) {
                        return Some(format!("tet {t} face {i}: labels {label} and {theirs}"));
                    }
                }
            }
            let is_none = |&label: &u32| label >= BOUNDARY && label != NONE;
            if (self.walls.get(t as usize)).is_some_and(|w| w.iter().any(is_none)) {
                return Some(format!("tet {t} has a wall without a label"));
            }
            for v in self.tets[t as usize] {
                let of = self.tet_of[v as usize];
                if of == NONE || !self.is_there(of) || !self.tets[of as usize].contains(&v) {
                    return Some(format!("vertex {v} is not found from its tet {of}"));
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two by two by two BCC-like star: a ring of n tetrahedra around an edge.
    fn ring_of(n: usize) -> Complex {
        let mut points = vec![[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]];
        for k in 0..n {
            let a = std::f64::consts::TAU * k as f64 / n as f64;
            points.push([a.cos(), a.sin(), 0.0]);
        }
        let tets = (0..n)
            .map(|k| [0, 1, 2 + k as u32, 2 + ((k + 1) % n) as u32])
            .collect();
        Complex::new(points, tets)
    }

    #[test]
    fn rings_and_splits_keep_neighbours() {
        let mut c = ring_of(5);
        assert!(
            c.tets
                .iter()
                .all(|t| isoform_check::quality::six_volume(t.map(|v| c.points[v as usize])) > 0.0)
        );
        let mut ring = Ring::default();
        c.ring(2, 0, 1, &mut ring);
        assert!(ring.closed);
        assert_eq!(ring.tets.len(), 5);
        let m = c.add_point([0.0, 0.0, 0.0]);
        let mut made = Vec::new();
        c.split(&ring, 0, 1, m, &mut made);
        assert_eq!((made.len(), c.live().count()), (10, 10));
        assert_eq!(c.fault(), None);
        // A boundary edge: the ring is open.
        let t = c.tet_of[2];
        c.ring(t, 2, m, &mut ring);
        assert!(ring.closed);
        let (mut star, mut open) = (Vec::new(), Ring::default());
        c.star(2, &mut star);
        let t = star
            .iter()
            .copied()
            .find(|&t| c.tets[t as usize].contains(&3))
            .expect("2 and 3 are neighbours");
        c.ring(t, 2, 3, &mut open);
        assert!(!open.closed);
        assert_eq!(open.link.len(), open.tets.len() + 1);
        let n = c.add_point([0.9, 0.3, 0.0]);
        c.split(&open, 2, 3, n, &mut made);
        assert_eq!(c.fault(), None);
    }
}
