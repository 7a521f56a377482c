//! Regions of the complex, and the walls between them: labelled faces with a tetrahedron on either
//! side.

use super::{BOUNDARY, Complex, NONE, Ring};

impl Complex {
    /// Assigns a region to each tetrahedron.
    pub(crate) fn divide(&mut self, regions: Vec<u16>) {
        self.walls = vec![[NONE; 4]; regions.len()];
        self.regions = regions;
    }

    /// Returns true if the complex is divided into regions.
    #[inline]
    pub(crate) fn is_divided(&self) -> bool {
        !self.regions.is_empty()
    }

    /// Returns the region of a tetrahedron.
    #[inline]
    pub(crate) fn region(&self, t: u32) -> u16 {
        self.regions.get(t as usize).copied().unwrap_or(0)
    }

    /// Returns the regions of tetrahedra, as [`Complex::replace_in`] expects them: empty if the
    /// complex is not divided.
    pub(crate) fn regions_of(&self, tets: &[u32]) -> Vec<u16> {
        match self.is_divided() {
            true => tets.iter().map(|&t| self.region(t)).collect(),
            false => Vec::new(),
        }
    }

    /// Returns what a face must be given again when its tetrahedra are replaced: its boundary
    /// value, or the label of a wall that the region of `t` owns; `None` for other faces.
    pub(crate) fn mark(&self, t: u32, i: usize) -> Option<u32> {
        let n = self.adjacent[t as usize][i];
        (n >= BOUNDARY).then_some(n).or_else(|| self.label(t, i))
    }

    /// Returns true if the face opposite to vertex `i` of `t` lies between two regions, or on a
    /// side of a unit cell.
    #[inline]
    pub(crate) fn is_wall(&self, t: u32, i: usize) -> bool {
        let n = self.adjacent[t as usize][i];
        self.is_divided()
            && n < BOUNDARY
            && (self.region(t) != self.region(n) || self.side(t, i).is_some())
    }

    /// Returns true if the face opposite to vertex `i` of `t` is a wall owned by `t`: by the lower
    /// of two regions, or on a side of a unit cell by the tetrahedron below it.
    #[inline]
    pub(crate) fn owns(&self, t: u32, i: usize) -> bool {
        if !self.is_wall(t, i) {
            return false;
        }
        let apex = self.tets[t as usize][i];
        match (self.side(t, i), &self.torus) {
            (Some(axis), Some(torus)) => torus.is_below(self.point(apex), axis),
            _ => self.region(t) < self.region(self.adjacent[t as usize][i]),
        }
    }

    /// Returns the axis of the side of a unit cell on which the face opposite to vertex `i` of `t`
    /// lies; `None` for other faces and on the boundary.
    #[inline]
    pub(crate) fn side(&self, t: u32, i: usize) -> Option<usize> {
        let torus = self.torus.as_ref()?;
        if self.adjacent[t as usize][i] >= BOUNDARY {
            return None;
        }
        let face = self.face(t, i).map(|v| torus.is_on_side(self.point(v)));
        (0..3).find(|&axis| face.iter().all(|is_on| is_on[axis]))
    }

    /// Splits a ring at its walls into open rings, in order; returns the ring itself if it has no
    /// walls.
    pub(crate) fn arcs(&self, ring: &Ring) -> Vec<Ring> {
        let n = ring.tets.len();
        // The face between a tetrahedron and its predecessor contains their common link vertex.
        let is_new = |k: usize| {
            let (t, opposite) = (ring.tets[k], ring.link[(k + 1) % ring.link.len()]);
            self.is_wall(t, self.place(t, opposite))
        };
        // A closed ring is traversed from the start of a region.
        let Some(start) = (0..n).find(|&k| is_new(k)).filter(|_| n > 1) else {
            return vec![ring.clone()];
        };
        let start = if ring.closed { start } else { 0 };
        let mut arcs: Vec<Ring> = Vec::new();
        for k in (start..start + n).map(|k| k % n) {
            if arcs.is_empty() || is_new(k) {
                arcs.push(Ring::default());
            }
            let arc = arcs.last_mut().expect("one was begun");
            if arc.tets.is_empty() {
                arc.link.push(ring.link[k]);
            }
            arc.tets.push(ring.tets[k]);
            arc.link.push(ring.link[(k + 1) % ring.link.len()]);
        }
        arcs
    }

    /// Labels the face opposite to vertex `i` of `t`, on the boundary or a wall.
    pub(crate) fn set_label(&mut self, t: u32, i: usize, label: u32) {
        if self.is_wall(t, i) {
            let n = self.adjacent[t as usize][i];
            let back = self.place_opposite(n, self.face(t, i));
            self.walls[t as usize][i] = label;
            self.walls[n as usize][back] = label;
        } else {
            self.adjacent[t as usize][i] = BOUNDARY | label;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six tetrahedra around the upright edge from 0 to 1, the first three of region 0, with the
    /// label 7 on the two walls.
    fn halves() -> (Complex, Ring) {
        let mut points = vec![[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]];
        for k in 0..6 {
            let a = std::f64::consts::TAU * f64::from(k) / 6.0;
            points.push([a.cos(), a.sin(), 0.0]);
        }
        let tets = (0..6).map(|k| [0, 1, 2 + k, 2 + (k + 1) % 6]).collect();
        let mut complex = Complex::new(points, tets);
        complex.divide(vec![0, 0, 0, 1, 1, 1]);
        for t in 0..3 {
            for i in 0..4 {
                if complex.owns(t, i) {
                    complex.set_label(t, i, 7);
                }
            }
        }
        let mut ring = Ring::default();
        complex.ring(1, 0, 1, &mut ring);
        (complex, ring)
    }

    #[test]
    fn walls_are_seen_from_the_first_region() {
        let (complex, ring) = halves();
        assert_eq!(complex.fault(), None);
        assert_eq!(complex.labels_at(&ring), [7, 7]);
        assert!(ring.closed && complex.is_on_surface(&ring));
        let faces = complex.faces();
        assert_eq!(faces.len(), 2);
        // Both look out of region 0, which lies at y > 0.
        for (f, label) in faces {
            let p = f.map(|v| complex.point(v));
            let [u, v] = [1, 2].map(|k| isoform_geom::sub(p[k], p[0]));
            assert!(isoform_geom::cross(u, v)[1] < 0.0 && label == 7);
        }
        let mut arcs = complex.arcs(&ring);
        arcs.sort_by_key(|arc| complex.region(arc.tets[0]));
        let ends = |arc: &Ring| [arc.link[0], arc.link[3]];
        assert_eq!(
            arcs.iter().map(|arc| arc.tets.len()).collect::<Vec<_>>(),
            [3, 3]
        );
        let [first, second] = [ends(&arcs[0]), ends(&arcs[1])];
        assert_eq!(first, [second[1], second[0]]);
    }

    #[test]
    fn splits_and_replacements_keep_walls() {
        let (mut complex, ring) = halves();
        let m = complex.add_point([0.0; 3]);
        let mut made = Vec::new();
        complex.split(&ring, 0, 1, m, &mut made);
        assert_eq!(complex.fault(), None);
        assert_eq!(complex.faces().len(), 4);
        let regions: Vec<u16> = made.iter().map(|&t| complex.region(t)).collect();
        assert_eq!(regions.iter().filter(|r| **r == 0).count(), 6);
        // Region 1 takes one of the tetrahedra at the wall: the wall goes around it.
        let t = made
            .iter()
            .copied()
            .find(|&t| complex.region(t) == 0 && complex.label(t, 2).is_some());
        let t = t.expect("one of them is at the wall");
        let tet = complex.tets[t as usize];
        complex.replace_in(&[t], (&[tet], &[1]), |_| 9, &mut made);
        assert_eq!(complex.fault(), None);
        assert_eq!(complex.region(made[0]), 1);
        let labels: Vec<u32> = complex.faces().into_iter().map(|f| f.1).collect();
        assert_eq!(labels.iter().filter(|l| **l == 9).count(), 2);
        assert!(labels.iter().all(|l| *l < BOUNDARY));
    }
}
