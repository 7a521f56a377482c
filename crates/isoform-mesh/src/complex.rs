//! The tetrahedra under work: a complex with neighbours, changed by replacing cavities.
//!
//! Every operation of the mesher (splitting an edge, removing one, a flip, a collapse) takes some
//! tetrahedra out and puts others into the same cavity: [`Complex::replace`] is the only place
//! where neighbours are written, so they cannot get out of step.

use isoform_control::Control;
use isoform_geom::{Point3, TET_FACES, TRIANGLE_EDGES};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};

/// No tetrahedron, no vertex.
pub(crate) const NONE: u32 = u32::MAX;
/// Neighbours from here on are no tetrahedra: the face lies on the boundary, with a label.
pub(crate) const BOUNDARY: u32 = 1 << 31;
/// The label of a boundary face that is no part of the solid's surface.
pub(crate) const OPEN: u32 = BOUNDARY | (BOUNDARY - 2);

/// The label of a face of the solid's surface that lies on no single piece.
pub(crate) const STRAY: u32 = BOUNDARY - 3;

/// Tetrahedra with neighbours. Slots are reused; a tetrahedron whose first vertex is [`NONE`] is
/// not there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Complex {
    pub(crate) points: Vec<Point3>,
    pub(crate) tets: Vec<[u32; 4]>,
    /// Neighbour opposite to each vertex, or [`BOUNDARY`] with a label.
    pub(crate) adjacent: Vec<[u32; 4]>,
    /// One tetrahedron of each vertex, [`NONE`] where there is none.
    pub(crate) tet_of: Vec<u32>,
    free: Vec<u32>,
    marks: Vec<u32>,
    epoch: u32,
    /// Outer faces of the cavity: sorted vertices, neighbour.
    outer: Vec<([u32; 3], u32)>,
    inner: Vec<([u32; 3], u32)>,
    /// Slots of tetrahedra that were put in or got other faces on the boundary, where that is kept:
    /// some may be empty again.
    pub(crate) log: Option<Vec<u32>>,
}

/// Vertices between two looks at the clock, where neighbours are sought: some milliseconds.
const LOOK: usize = 1 << 12;

/// The edges of a tetrahedron, by the places of their ends.
pub(crate) const EDGES: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];

/// The edges of labelled triangles, lower vertex first, each with its triangle's label; sorted, so
/// that those of one edge stand together.
pub(crate) fn labelled_edges(faces: impl Iterator<Item = ([u32; 3], u32)>) -> Vec<([u32; 2], u32)> {
    let edge = |a: u32, b: u32| [a.min(b), a.max(b)];
    let mut edges: Vec<_> = faces
        .flat_map(|(f, label)| TRIANGLE_EDGES.map(|[i, j]| (edge(f[i], f[j]), label)))
        .collect();
    edges.par_sort_unstable();
    edges
}

fn sorted(mut f: [u32; 3]) -> [u32; 3] {
    f.sort_unstable();
    f
}

/// What [`Complex::ring`] finds.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ring {
    /// Tetrahedra around the edge, in order.
    pub(crate) tets: Vec<u32>,
    /// Vertices of the link, in order; one more than tetrahedra where the ring is open.
    pub(crate) link: Vec<u32>,
    /// Whether the ring goes all the way round (the edge is not on the boundary).
    pub(crate) closed: bool,
}

impl Complex {
    /// From vertices and positive tetrahedra; boundary faces are [`OPEN`].
    pub(crate) fn new(points: Vec<Point3>, tets: Vec<[u32; 4]>) -> Self {
        Self::within(points, tets, &Control::default())
    }

    /// The same. On a stop by `control` neighbours are missing.
    pub(crate) fn within(points: Vec<Point3>, tets: Vec<[u32; 4]>, control: &Control<'_>) -> Self {
        // Faces by their lowest vertex: few have the same one, so that partners are found by
        // comparing them all.
        let mut from = vec![0u32; points.len() + 1];
        let key = |t: usize, i: usize| sorted(TET_FACES[i].map(|k| tets[t][k]));
        for v in &tets {
            for f in TET_FACES {
                from[f.iter().map(|&k| v[k]).min().expect("three") as usize] += 1;
            }
        }
        let mut sum = 0;
        for n in &mut from {
            sum += *n;
            *n = sum;
        }
        let mut faces = vec![([0u32; 2], 0u32); tets.len() * 4];
        for t in 0..tets.len() {
            for i in 0..4 {
                let [a, b, c] = key(t, i);
                from[a as usize] -= 1;
                faces[from[a as usize] as usize] = ([b, c], (t * 4 + i) as u32);
            }
        }
        let mut adjacent = vec![[OPEN; 4]; tets.len()];
        for (lowest, w) in from.windows(2).enumerate() {
            if lowest.is_multiple_of(LOOK) && control.is_stopped() {
                break;
            }
            let same = &mut faces[w[0] as usize..w[1] as usize];
            if same.len() > 200 {
                same.sort_unstable();
            }
            for (k, a) in same.iter().enumerate() {
                if adjacent[a.1 as usize / 4][a.1 as usize % 4] != OPEN {
                    continue;
                }
                let after = &same[k + 1..];
                let near = if same.len() > 200 {
                    &after[..after.len().min(1)]
                } else {
                    after
                };
                if let Some(b) = near.iter().find(|b| b.0 == a.0) {
                    adjacent[a.1 as usize / 4][a.1 as usize % 4] = b.1 / 4;
                    adjacent[b.1 as usize / 4][b.1 as usize % 4] = a.1 / 4;
                }
            }
        }
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

    /// Gives every further fan of tetrahedra at a vertex of the boundary (they share the vertex,
    /// and no chain of faces joins them) a vertex of its own, except where faces are open: there
    /// the rest of the lattice joins them. Returns the vertices that were copied, in the order of
    /// the copies.
    pub(crate) fn separate(&mut self) -> Vec<u32> {
        let (mut on_boundary, mut on_open) = (
            vec![false; self.points.len()],
            vec![false; self.points.len()],
        );
        for t in self.live() {
            for i in 0..4 {
                let n = self.adjacent[t as usize][i];
                if n >= BOUNDARY {
                    self.face(t, i)
                        .into_iter()
                        .for_each(|v| on_boundary[v as usize] = true);
                }
                if n == OPEN {
                    self.face(t, i)
                        .into_iter()
                        .for_each(|v| on_open[v as usize] = true);
                }
            }
        }
        on_boundary
            .iter_mut()
            .zip(on_open)
            .for_each(|(b, open)| *b &= !open);
        let mut seen = vec![[false; 4]; self.tets.len()];
        let mut has_fan = vec![false; self.points.len()];
        let (mut copied, mut fan) = (Vec::new(), Vec::new());
        let live: Vec<u32> = self.live().collect();
        for t in live {
            for i in 0..4 {
                let v = self.tets[t as usize][i];
                if !on_boundary[v as usize] || seen[t as usize][i] {
                    continue;
                }
                fan.clear();
                fan.push((t, i));
                seen[t as usize][i] = true;
                let mut next = 0;
                while let Some(&(t, i)) = fan.get(next) {
                    next += 1;
                    for j in (0..4).filter(|&j| j != i) {
                        let n = self.adjacent[t as usize][j];
                        if n < BOUNDARY {
                            let k = self.place(n, v);
                            if !std::mem::replace(&mut seen[n as usize][k], true) {
                                fan.push((n, k));
                            }
                        }
                    }
                }
                if std::mem::replace(&mut has_fan[v as usize], true) {
                    let copy = self.add_point(self.points[v as usize]);
                    on_boundary.push(true);
                    has_fan.push(true);
                    copied.push(v);
                    fan.iter()
                        .for_each(|&(t, i)| self.tets[t as usize][i] = copy);
                    self.tet_of[copy as usize] = fan[0].0;
                } else {
                    self.tet_of[v as usize] = t;
                }
            }
        }
        copied
    }

    pub(crate) fn is_there(&self, t: u32) -> bool {
        self.tets[t as usize][0] != NONE
    }
    pub(crate) fn corners(&self, t: u32) -> [Point3; 4] {
        self.tets[t as usize].map(|v| self.points[v as usize])
    }
    /// The mean of the vertices.
    pub(crate) fn middle(&self, t: u32) -> Point3 {
        let c = self.corners(t);
        std::array::from_fn(|i| 0.25 * (c[0][i] + c[1][i] + c[2][i] + c[3][i]))
    }
    pub(crate) fn add_point(&mut self, p: Point3) -> u32 {
        self.points.push(p);
        self.tet_of.push(NONE);
        self.points.len() as u32 - 1
    }
    /// Where the vertex stands in the tetrahedron.
    pub(crate) fn place(&self, t: u32, v: u32) -> usize {
        self.tets[t as usize]
            .iter()
            .position(|&k| k == v)
            .expect("a vertex of the tetrahedron")
    }
    /// The face opposite to vertex `i` of tetrahedron `t`, outward.
    pub(crate) fn face(&self, t: u32, i: usize) -> [u32; 3] {
        TET_FACES[i].map(|k| self.tets[t as usize][k])
    }

    fn next_epoch(&mut self) -> u32 {
        if self.epoch == u32::MAX {
            self.marks.fill(0);
            self.epoch = 0;
        }
        self.epoch += 1;
        self.epoch
    }

    /// All tetrahedra at the vertex.
    pub(crate) fn star(&mut self, v: u32, out: &mut Vec<u32>) {
        let epoch = self.next_epoch();
        let mut marks = std::mem::take(&mut self.marks);
        self.spread(v, out, |n, _| {
            std::mem::replace(&mut marks[n as usize], epoch) != epoch
        });
        self.marks = marks;
    }

    /// The same without marks, for several threads at once; stars are small.
    pub(crate) fn star_shared(&self, v: u32, out: &mut Vec<u32>) {
        let mut many = HashSet::new();
        self.spread(v, out, |n, out| {
            if out.len() < 200 {
                return !out.contains(&n);
            }
            if many.is_empty() {
                many.extend(out.iter().copied());
            }
            many.insert(n)
        });
    }

    /// Goes from tetrahedron to tetrahedron around the vertex, to those that `is_new` says have not
    /// been met.
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

    /// The tetrahedra around the edge from vertex `a` to `b` of tetrahedron `t`.
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
        // Open: the other way, in front.
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

    /// The tetrahedra around the edge from `a` to `b`; false if there is no such edge.
    pub(crate) fn ring_of(&self, a: u32, b: u32, ring: &mut Ring) -> bool {
        let mut star = Vec::with_capacity(64);
        self.star_shared(a, &mut star);
        let found = star
            .into_iter()
            .find(|&t| self.tets[t as usize].contains(&b));
        if let Some(t) = found {
            self.ring(t, a, b, ring);
        }
        found.is_some()
    }

    /// Walks from `t` across the face opposite to `from`, over `over`; true when it comes back to
    /// `t`.
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

    /// Puts the tetrahedra `new` in the place of `old`, which fill the same cavity (or one that
    /// differs by boundary faces). The new boundary faces get the label that `label` gives for
    /// their vertices (sorted). Slots of the new ones go to `made`.
    pub(crate) fn replace(
        &mut self,
        old: &[u32],
        new: &[[u32; 4]],
        mut label: impl FnMut([u32; 3]) -> u32,
        made: &mut Vec<u32>,
    ) {
        let epoch = self.next_epoch();
        for &t in old {
            self.marks[t as usize] = epoch;
        }
        let (mut outer, mut inner) = (
            std::mem::take(&mut self.outer),
            std::mem::take(&mut self.inner),
        );
        outer.clear();
        inner.clear();
        for &t in old {
            for i in 0..4 {
                let n = self.adjacent[t as usize][i];
                if n >= BOUNDARY || self.marks[n as usize] != epoch {
                    outer.push((sorted(self.face(t, i)), n));
                }
            }
        }
        // Neighbours of boundary labels are found by their faces; those of tetrahedra are turned to
        // the new ones below.
        for &t in old {
            for k in self.tets[t as usize] {
                self.tet_of[k as usize] = NONE;
            }
            self.tets[t as usize] = [NONE; 4];
            self.free.push(t);
        }
        made.clear();
        for v in new {
            let t = self.free.pop().unwrap_or_else(|| {
                self.tets.push([NONE; 4]);
                self.adjacent.push([OPEN; 4]);
                self.marks.push(0);
                self.tets.len() as u32 - 1
            });
            self.tets[t as usize] = *v;
            made.push(t);
        }
        // Cavities are small as a rule, and a list is searched faster than a table.
        let many = outer.len() > 200;
        let (mut outer_at, mut inner_at) = (HashMap::new(), HashMap::new());
        if many {
            outer_at.extend(outer.iter().enumerate().map(|(k, o)| (o.0, k)));
        }
        let take =
            |list: &mut Vec<([u32; 3], u32)>, at: &mut HashMap<[u32; 3], usize>, key: [u32; 3]| {
                let k = if many {
                    at.remove(&key)?
                } else {
                    list.iter().position(|o| o.0 == key)?
                };
                let (_, n) = list.swap_remove(k);
                if many && k < list.len() {
                    at.insert(list[k].0, k);
                }
                Some(n)
            };
        for &t in made.iter() {
            for i in 0..4 {
                let key = sorted(self.face(t, i));
                if let Some(n) = take(&mut outer, &mut outer_at, key) {
                    self.adjacent[t as usize][i] = n;
                    if n < BOUNDARY {
                        let back = (0..4)
                            .find(|&j| !key.contains(&self.tets[n as usize][j]))
                            .expect("one vertex is not on the face");
                        self.adjacent[n as usize][back] = t;
                    }
                } else if let Some(other) = take(&mut inner, &mut inner_at, key) {
                    self.adjacent[t as usize][i] = other / 4;
                    self.adjacent[other as usize / 4][other as usize % 4] = t;
                } else {
                    if many {
                        inner_at.insert(key, inner.len());
                    }
                    inner.push((key, 4 * t + i as u32));
                }
            }
            for k in self.tets[t as usize] {
                self.tet_of[k as usize] = t;
            }
        }
        self.log
            .iter_mut()
            .for_each(|log| log.extend_from_slice(made));
        for &(key, place) in &inner {
            self.adjacent[place as usize / 4][place as usize % 4] = label(key) | BOUNDARY;
        }
        // Boundary faces that vanish leave nothing behind; a neighbour left behind is an opened
        // boundary.
        for &(key, n) in &outer {
            if n < BOUNDARY {
                let back = (0..4)
                    .find(|&j| !key.contains(&self.tets[n as usize][j]))
                    .expect("one vertex is not on the face");
                self.adjacent[n as usize][back] = label(key) | BOUNDARY;
                self.log.iter_mut().for_each(|log| log.push(n));
                for k in self.tets[n as usize] {
                    self.tet_of[k as usize] = n;
                }
            }
        }
        // Vertices of the cavity that no new tetrahedron holds may still live in neighbours.
        for &(key, n) in &outer {
            if n < BOUNDARY {
                for k in key {
                    if self.tet_of[k as usize] == NONE {
                        self.tet_of[k as usize] = n;
                    }
                }
            }
        }
        self.outer = outer;
        self.inner = inner;
    }

    /// Splits the edge from `a` to `b` of the ring at vertex `m`: every tetrahedron of the ring
    /// becomes two.
    pub(crate) fn split(&mut self, ring: &Ring, a: u32, b: u32, m: u32, made: &mut Vec<u32>) {
        let mut new = Vec::with_capacity(2 * ring.tets.len());
        let mut labels: Vec<([u32; 3], u32)> = Vec::new();
        for &t in &ring.tets {
            let v = self.tets[t as usize];
            new.push(v.map(|k| if k == b { m } else { k }));
            new.push(v.map(|k| if k == a { m } else { k }));
            for i in 0..4 {
                let n = self.adjacent[t as usize][i];
                let f = self.face(t, i);
                if n >= BOUNDARY && f.contains(&a) && f.contains(&b) {
                    labels.push((sorted(f.map(|k| if k == b { m } else { k })), n));
                    labels.push((sorted(f.map(|k| if k == a { m } else { k })), n));
                }
            }
        }
        self.replace(
            &ring.tets,
            &new,
            |key| labels.iter().find(|l| l.0 == key).map_or(OPEN, |l| l.1),
            made,
        );
    }

    /// The tetrahedra that are there.
    pub(crate) fn live(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.tets.len() as u32).filter(|&t| self.is_there(t))
    }

    /// What is wrong with the neighbours, for tests.
    #[cfg(test)]
    pub(crate) fn fault(&self) -> Option<String> {
        for t in self.live() {
            for i in 0..4 {
                let n = self.adjacent[t as usize][i];
                if n < BOUNDARY {
                    let f = sorted(self.face(t, i));
                    let back = (0..4).find(|&j| {
                        self.adjacent[n as usize][j] == t && sorted(self.face(n, j)) == f
                    });
                    if !self.is_there(n) || back.is_none() {
                        return Some(format!("tet {t} face {i}: neighbour {n} does not agree"));
                    }
                }
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
                .all(|t| crate::quality::six_volume(t.map(|v| c.points[v as usize])) > 0.0)
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
