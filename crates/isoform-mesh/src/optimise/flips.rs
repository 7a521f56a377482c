//! Removal of edges and faces by flips; vertices do not move.

use super::{MIN_FACING_COSINE, MIN_GAIN, Optimiser};
use crate::complex::{BOUNDARY, OPEN, Ring, STRAY};
use crate::measure::{biased_sine, smallest_sine};
use crate::optimise::holds::Hold;
use crate::surface::On;
use isoform_check::quality::six_volume;
use isoform_geom::Point3;

/// Maximum length of a ring whose edge is removed; longer ones never improved a mesh in trials.
const MAX_RING_LENGTH: usize = 9;

/// Klincsek's table for the best triangulation of the link of an edge (Minimal triangulations of
/// polygonal domains, 1980), where each triangle makes two tetrahedra with the ends of the edge.
struct Triangulation {
    /// Best worst measure of the polygon from vertex i to vertex j.
    best: [[f64; MAX_RING_LENGTH + 1]; MAX_RING_LENGTH + 1],
    /// Third vertex of its triangle at the edge from i to j.
    apex: [[u8; MAX_RING_LENGTH + 1]; MAX_RING_LENGTH + 1],
    n: usize,
}

impl Triangulation {
    /// Triangulates a link, as far as the result is better than `before`. On the `surface` the edge
    /// from the first to the last vertex lies on it, and the faces there count, too.
    fn new(link: &[Point3], [a, b]: [Point3; 2], before: f64, surface: bool) -> Self {
        let n = link.len();
        let mut this = Self {
            best: [[f64::INFINITY; MAX_RING_LENGTH + 1]; MAX_RING_LENGTH + 1],
            apex: [[0u8; MAX_RING_LENGTH + 1]; MAX_RING_LENGTH + 1],
            n,
        };
        for span in 2..n {
            for i in 0..n - span {
                let j = i + span;
                this.best[i][j] = f64::NEG_INFINITY;
                for k in i + 1..j {
                    let mut w = this.best[i][k].min(this.best[k][j]);
                    if w <= before {
                        continue;
                    }
                    let (u, v, x) = (link[i], link[k], link[j]);
                    w = w
                        .min(biased_sine([u, v, x, b]))
                        .min(biased_sine([v, u, x, a]));
                    if surface && span == n - 1 {
                        w = w
                            .min(smallest_sine([u, x, a]))
                            .min(smallest_sine([u, x, b]));
                    }
                    if w > this.best[i][j] {
                        (this.best[i][j], this.apex[i][j]) = (w, k as u8);
                    }
                }
            }
        }
        this
    }

    /// Returns the worst measure of the best triangulation.
    fn worst(&self) -> f64 {
        self.best[0][self.n - 1]
    }

    /// Returns the tetrahedra of the best triangulation.
    fn tetrahedra(&self, link: &[u32], [a, b]: [u32; 2]) -> Vec<[u32; 4]> {
        let mut new = Vec::with_capacity(2 * self.n);
        let mut todo = vec![(0, self.n - 1)];
        while let Some((i, j)) = todo.pop() {
            if j < i + 2 {
                continue;
            }
            let k = usize::from(self.apex[i][j]);
            let (u, v, x) = (link[i], link[k], link[j]);
            new.push([u, v, x, b]);
            new.push([v, u, x, a]);
            todo.extend([(i, k), (k, j)]);
        }
        new
    }
}

impl Optimiser<'_> {
    /// Removes the edge from `a` to `b` of tetrahedron `t` if `apply` is set and the worst measure
    /// improves. Returns the worst measure afterwards; `None` if it does not improve.
    pub(super) fn remove_edge(&mut self, t: u32, ends: [u32; 2], apply: bool) -> Option<f64> {
        let mut ring = std::mem::take(&mut self.scratch.ring);
        self.complex.ring(t, ends[0], ends[1], &mut ring);
        let result = self.remove_ring(&mut ring, ends, apply);
        self.scratch.ring = ring;
        result
    }

    fn remove_ring(&mut self, ring: &mut Ring, ends: [u32; 2], apply: bool) -> Option<f64> {
        if ring.tets.len() > MAX_RING_LENGTH || (ring.closed && ring.link.len() < 3) {
            return None;
        }
        let before = self.worst(&ring.tets);
        if self.complex.is_divided() && self.complex.arcs(ring).len() > 1 {
            return self.flip_on_wall(ring, ends, before, apply);
        }
        let label = if ring.closed {
            None
        } else {
            Some(self.surface_edge(ring, ends)?)
        };
        let [a, b, c, d] = self.points_of([ends[0], ends[1], ring.link[0], ring.link[1]]);
        if six_volume([a, b, c, d]) < 0.0 {
            ring.link.reverse();
        }
        if let Some(label) = label {
            if !self.may_flip(&ring.link, ends, label) {
                return None;
            }
            if ring.link.len() == 2 {
                return self.remove_flat(ring, ends, label, apply);
            }
        }
        let mut link = [[0.0; 3]; MAX_RING_LENGTH + 1];
        let link = &mut link[..ring.link.len()];
        for (p, &v) in link.iter_mut().zip(&ring.link) {
            *p = self.point(v);
        }
        let triangulation = Triangulation::new(link, [a, b], before, label.is_some());
        let after = self.with_faces(triangulation.worst(), ring, before);
        if after <= before + MIN_GAIN {
            return None;
        }
        if apply {
            let new = triangulation.tetrahedra(&ring.link, ends);
            self.replace(&ring.tets, &new, |_| label.unwrap_or(OPEN));
        }
        Some(after)
    }

    /// Returns true if an edge of the surface may be flipped on it: the new faces must face
    /// outward, and the new edge must not exist already.
    fn may_flip(&self, link: &[u32], [a, b]: [u32; 2], label: u32) -> bool {
        // Counterclockwise link seen from b: the solid lies between c and d.
        let (c, d) = (link[0], link[link.len() - 1]);
        let looks_outward =
            |f: [u32; 3]| self.facing(self.points_of(f), label) >= MIN_FACING_COSINE;
        looks_outward([a, c, d])
            && looks_outward([b, d, c])
            && (link.len() == 2 || !self.complex.are_neighbours(c, d))
    }

    /// Returns the worst measure after a flip, including the unchanged faces of the surface around
    /// the cavity.
    fn with_faces(&self, after: f64, ring: &Ring, before: f64) -> f64 {
        let mut worst = after;
        for &t in &ring.tets {
            for i in 0..4 {
                if self.complex.label(t, i).is_none() {
                    continue;
                }
                let f = self.complex.face(t, i);
                let s = smallest_sine(self.points_of(f));
                // Faces at the edge itself are removed; of the others only those matter that limit
                // the gain.
                if s <= before + MIN_GAIN && !goes_away(ring, f) {
                    worst = worst.min(s);
                }
            }
        }
        worst
    }

    /// Returns the label of the faces that replace those at an edge of the surface, if the edge may
    /// be flipped: the common label of both sides.
    pub(super) fn surface_edge(&self, ring: &Ring, ends: [u32; 2]) -> Option<u32> {
        let labels = if self.complex.is_divided() {
            *self.complex.labels_at(ring).as_array()?
        } else {
            self.complex.labels_beside(ring)?
        };
        if labels.iter().any(|&l| l >= STRAY) {
            return None;
        }
        if labels[0] == labels[1] {
            return Some(labels[0]);
        }
        if ring.closed {
            return None;
        }
        self.beyond_flat(ring, ends, labels)
    }

    /// Returns the label behind a face whose vertices all lie on one seam, so that it covers
    /// nothing of its piece.
    fn beyond_flat(&self, ring: &Ring, ends: [u32; 2], labels: [u32; 2]) -> Option<u32> {
        let curve = self.hold[ends[0] as usize];
        let is_seam = |on: On| on.len() == 2 && !labels.iter().all(|&l| on.contains(l));
        if self.hold[ends[1] as usize] != curve || !matches!(curve, Hold::On(on) if is_seam(on)) {
            return None;
        }
        let is_flat = ring.ends().map(|end| self.hold[end.1 as usize] == curve);
        match is_flat {
            [true, false] => Some(labels[1]),
            [false, true] => Some(labels[0]),
            _ => None,
        }
    }

    /// Flips an edge on a wall between two regions: each region has its part of the ring, and the
    /// new edge is in both.
    fn flip_on_wall(
        &mut self,
        ring: &Ring,
        ends: [u32; 2],
        before: f64,
        apply: bool,
    ) -> Option<f64> {
        let arcs = self.complex.arcs(ring);
        let [first, second] = arcs.as_slice() else {
            return None;
        };
        let is_thick = |arc: &&Ring| arc.tets.len() > 1;
        if !ring.closed || ![first, second].iter().all(is_thick) {
            return None;
        }
        let label = self.surface_edge(ring, ends)?;
        let mut new = Vec::new();
        let mut regions = Vec::new();
        let mut after = f64::INFINITY;
        for arc in [first, second] {
            let mut arc = arc.clone();
            // The wall's face at its first vertex lies opposite to its second one.
            let place = self.complex.place(arc.tets[0], arc.link[1]);
            let owns = self.complex.owns(arc.tets[0], place);
            let [a, b, c, d] = self.points_of([ends[0], ends[1], arc.link[0], arc.link[1]]);
            if six_volume([a, b, c, d]) < 0.0 {
                arc.link.reverse();
            }
            let region = self.complex.region(arc.tets[0]);
            if owns && !self.may_flip(&arc.link, ends, label) {
                return None;
            }
            let link: Vec<Point3> = arc.link.iter().map(|&v| self.point(v)).collect();
            let triangulation = Triangulation::new(&link, [a, b], before, true);
            after = after.min(self.with_faces(triangulation.worst(), &arc, before));
            if after <= before + MIN_GAIN {
                return None;
            }
            let tetrahedra = triangulation.tetrahedra(&arc.link, ends);
            regions.extend(vec![region; tetrahedra.len()]);
            new.extend(tetrahedra);
        }
        if apply {
            let mut made = std::mem::take(&mut self.scratch.made);
            let new = (new.as_slice(), regions.as_slice());
            self.complex
                .replace_in(&ring.tets, new, |_| label, &mut made);
            self.scratch.made = made;
        }
        Some(after)
    }

    /// Removes a single tetrahedron that has two faces on one piece from the surface.
    fn remove_flat(&mut self, ring: &Ring, ends: [u32; 2], label: u32, apply: bool) -> Option<f64> {
        let t = ring.tets[0];
        if !self.may_take_off(t, ends, [ring.link[0], ring.link[1]]) {
            return None;
        }
        // The measure that neighbours get from new faces on the surface.
        let (c, d) = (ring.link[0], ring.link[1]);
        let after = ends
            .iter()
            .map(|&v| smallest_sine(self.points_of([v, c, d])))
            .fold(f64::INFINITY, f64::min);
        let before = self.measure(t);
        // Dropping a good tetrahedron would change the solid; a flat one lies within the chordal
        // error.
        if after <= before + MIN_GAIN || biased_sine(self.complex.corners(t)) > 0.3 {
            return None;
        }
        if apply {
            self.replace(&[t], &[], |_| label);
        }
        Some(after)
    }

    /// Returns true if a tetrahedron with two faces on the surface may be removed: its other two
    /// faces and the edge between them lie within, and it has no vertex of the lattice beyond the
    /// band.
    fn may_take_off(&self, t: u32, ends: [u32; 2], inner: [u32; 2]) -> bool {
        let is_outer = |v: u32| {
            let place = self.complex.place(t, v);
            self.complex.adjacent[t as usize][place] >= BOUNDARY || self.complex.is_wall(t, place)
        };
        if ends.into_iter().any(is_outer) {
            return false;
        }
        let mut ring = Ring::default();
        self.complex.ring(t, inner[0], inner[1], &mut ring);
        let is_frozen = |v: usize| self.hold[v] == Hold::Fixed && self.labels[v].is_empty();
        ring.closed
            && !self.complex.tets[t as usize]
                .iter()
                .any(|&v| is_frozen(v as usize))
    }

    /// Replaces the face opposite to vertex `i` by an edge if `apply` is set and the worst measure
    /// improves. Returns the worst measure afterwards; `None` if it does not improve.
    pub(super) fn remove_face(&mut self, t: u32, i: usize, apply: bool) -> Option<f64> {
        let n = self.complex.adjacent[t as usize][i];
        if n >= BOUNDARY || self.complex.is_wall(t, i) {
            return None;
        }
        let before = self.measure(t).min(self.measure(n));
        let a = self.complex.tets[t as usize][i];
        let f = self.complex.face(t, i);
        let b = self.complex.tets[n as usize]
            .iter()
            .copied()
            .find(|k| !f.contains(k))?;
        // f is outward of t: a lies below, b above.
        let new = [[f[0], f[1], b, a], [f[1], f[2], b, a], [f[2], f[0], b, a]];
        let mut after = f64::INFINITY;
        for v in &new {
            after = after.min(biased_sine(self.points_of(*v)));
            if after <= before + MIN_GAIN {
                return None;
            }
        }
        after = after.min(self.worst_face(t)).min(self.worst_face(n));
        if after <= before + MIN_GAIN {
            return None;
        }
        if apply {
            self.replace(&[t, n], &new, |_| OPEN);
        }
        Some(after)
    }

    /// Returns the worst measure of the faces of a tetrahedron on the surface.
    fn worst_face(&self, t: u32) -> f64 {
        (0..4)
            .filter(|&k| self.complex.label(t, k).is_some())
            .map(|k| smallest_sine(self.points_of(self.complex.face(t, k))))
            .fold(f64::INFINITY, f64::min)
    }
}

/// Returns true if a face has the edge of an open ring.
fn goes_away(ring: &Ring, f: [u32; 3]) -> bool {
    !ring.closed && f.iter().filter(|k| !ring.link.contains(k)).count() == 2
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The link of a long edge is a square with corners 0 to 3, drawn out between 0 and 2: the cut
    /// from 1 to 3 is better, whose triangles are nearly regular.
    #[test]
    fn the_shorter_diagonal_is_found() {
        let link = [
            [1.7, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [-1.7, 0.0, 0.0],
            [0.0, -1.0, 0.0],
        ];
        let ends = [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]];
        let table = Triangulation::new(&link, ends, 0.0, false);
        let tets = table.tetrahedra(&[0, 1, 2, 3], [4, 5]);
        assert_eq!(tets.len(), 4);
        assert!(tets.iter().all(|t| t.contains(&1) && t.contains(&3)));
        let all = [link[0], link[1], link[2], link[3], ends[0], ends[1]];
        let worst = tets
            .iter()
            .map(|t| biased_sine(t.map(|v| all[v as usize])))
            .fold(f64::INFINITY, f64::min);
        assert_eq!(table.worst(), worst);
    }
}
