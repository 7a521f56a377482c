//! Regions of the complex, and the walls between them: labelled faces with a tetrahedron on either
//! side.

use super::{BOUNDARY, Complex, NONE, Ring};

impl Complex {
    /// Gives each tetrahedron its region.
    pub(crate) fn divide(&mut self, regions: Vec<u16>) {
        self.walls = vec![[NONE; 4]; regions.len()];
        self.regions = regions;
    }

    /// Whether there are regions.
    #[inline]
    pub(crate) fn is_divided(&self) -> bool {
        !self.regions.is_empty()
    }

    /// The region of a tetrahedron.
    #[inline]
    pub(crate) fn region(&self, t: u32) -> u16 {
        self.regions.get(t as usize).copied().unwrap_or(0)
    }

    /// Whether two tetrahedra that share the face opposite to vertex `i` of `t` belong to two
    /// regions.
    #[inline]
    pub(crate) fn is_wall(&self, t: u32, i: usize) -> bool {
        let n = self.adjacent[t as usize][i];
        self.is_divided() && n < BOUNDARY && self.region(t) != self.region(n)
    }

    /// The region that the face opposite to vertex `i` of `t` bounds, if it is a wall and that is
    /// the region of `t`: of two regions the first one.
    #[inline]
    pub(crate) fn owner(&self, t: u32, i: usize) -> Option<u16> {
        if !self.is_wall(t, i) {
            return None;
        }
        let mine = self.region(t);
        (mine < self.region(self.adjacent[t as usize][i])).then_some(mine)
    }

    /// The parts of a ring that lie in one region each, in order, as open rings; the ring itself if
    /// that is one.
    pub(crate) fn arcs(&self, ring: &Ring) -> Vec<Ring> {
        let n = ring.tets.len();
        let is_new =
            |k: usize| self.region(ring.tets[k]) != self.region(ring.tets[(k + n - 1) % n]);
        // A closed ring is gone through from where a region begins.
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

    /// Labels the face opposite to vertex `i` of `t`: one on the boundary, or a wall.
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
