//! Separation of fans of tetrahedra that share only a vertex, where the surface would touch itself.

use super::{BOUNDARY, Complex, OPEN};

/// A tetrahedron, and the local index of a vertex in it.
type Corner = (u32, usize);

impl Complex {
    /// Gives every further fan of tetrahedra at a boundary vertex (fans share the vertex, but are
    /// not connected across faces) a vertex of its own, except at open faces, where the rest of the
    /// lattice connects them. Returns the vertices that were copied, in the order of the copies.
    pub(crate) fn separate(&mut self) -> Vec<u32> {
        let mut on_boundary = self.only_on_labelled_faces();
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
                self.fan((t, i), &mut seen, &mut fan);
                if has_fan[v as usize] {
                    self.give_copy(v, &fan);
                    on_boundary.push(true);
                    has_fan.push(true);
                    copied.push(v);
                } else {
                    has_fan[v as usize] = true;
                    self.tet_of[v as usize] = t;
                }
            }
        }
        copied
    }

    /// Marks the vertices that lie on the boundary, and not on any open face.
    fn only_on_labelled_faces(&self) -> Vec<bool> {
        let mut on_boundary = vec![false; self.points.len()];
        let mut on_open = vec![false; self.points.len()];
        for t in self.live() {
            for i in 0..4 {
                let n = self.adjacent[t as usize][i];
                for v in self.face(t, i).map(|v| v as usize) {
                    on_boundary[v] |= n >= BOUNDARY;
                    on_open[v] |= n == OPEN;
                }
            }
        }
        for (b, open) in on_boundary.iter_mut().zip(on_open) {
            *b &= !open;
        }
        on_boundary
    }

    /// Collects the fan of a corner: all corners at its vertex that are connected to it across
    /// faces.
    fn fan(&self, first: Corner, seen: &mut [[bool; 4]], fan: &mut Vec<Corner>) {
        let v = self.tets[first.0 as usize][first.1];
        fan.clear();
        fan.push(first);
        seen[first.0 as usize][first.1] = true;
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
    }

    /// Replaces vertex `v` by a copy in the tetrahedra of a fan.
    fn give_copy(&mut self, v: u32, fan: &[Corner]) {
        let copy = self.add_point(self.points[v as usize]);
        for &(t, i) in fan {
            self.tets[t as usize][i] = copy;
        }
        self.tet_of[copy as usize] = fan[0].0;
    }
}
