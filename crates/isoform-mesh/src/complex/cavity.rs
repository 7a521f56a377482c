//! Cavities: replacing tetrahedra by others that fill an equal space.

use super::{BOUNDARY, Complex, MAX_SCANNED_ITEMS, NONE, OPEN, Ring, sorted};
use std::collections::HashMap;

/// Faces waiting for the tetrahedron on their other side, each with a number.
#[derive(Clone, Debug, Default)]
struct PendingFaces {
    list: Vec<([u32; 3], u32)>,
    /// Position of each face in the list, if the list is long.
    table: HashMap<[u32; 3], usize>,
    is_indexed: bool,
}

impl PendingFaces {
    fn clear(&mut self) {
        self.list.clear();
        self.table.clear();
        self.is_indexed = false;
    }

    fn index(&mut self) {
        self.is_indexed = true;
        self.table
            .extend(self.list.iter().enumerate().map(|(k, f)| (f.0, k)));
    }

    #[inline]
    fn push(&mut self, face: [u32; 3], number: u32) {
        if self.is_indexed {
            self.table.insert(face, self.list.len());
        }
        self.list.push((face, number));
    }

    /// Removes a face and returns its number.
    #[inline]
    fn take(&mut self, face: [u32; 3]) -> Option<u32> {
        let k = if self.is_indexed {
            self.table.remove(&face)?
        } else {
            self.list.iter().position(|f| f.0 == face)?
        };
        let (_, number) = self.list.swap_remove(k);
        if self.is_indexed && k < self.list.len() {
            self.table.insert(self.list[k].0, k);
        }
        Some(number)
    }
}

/// Faces of a cavity while it is filled.
#[derive(Clone, Debug, Default)]
pub(super) struct Cavity {
    /// Faces around the cavity, with the neighbour beyond or the label.
    outer: PendingFaces,
    /// Faces of new tetrahedra without a neighbour so far, encoded as four times the tetrahedron
    /// plus the opposite vertex.
    inner: PendingFaces,
    /// Possible walls without a label so far: (new tetrahedron, opposite vertex); used only with
    /// regions.
    joined: Vec<(u32, usize)>,
}

impl Complex {
    /// Replaces the tetrahedra `old` by `new`, which fill an equal cavity (or one that differs by
    /// boundary faces), within one region. New boundary faces get the label that `label` returns
    /// for their vertices (sorted). The slots of the new tetrahedra are written to `made`.
    pub(crate) fn replace(
        &mut self,
        old: &[u32],
        new: &[[u32; 4]],
        label: impl FnMut([u32; 3]) -> u32,
        made: &mut Vec<u32>,
    ) {
        let regions = match self.is_divided() {
            true => vec![self.region(old[0]); new.len()],
            false => Vec::new(),
        };
        debug_assert!(old.iter().all(|&t| self.region(t) == self.region(old[0])));
        self.replace_in(old, (new, &regions), label, made);
    }

    /// Replaces tetrahedra like [`Self::replace`], with a region for each new one if the complex is
    /// divided; new walls are labelled like new boundary faces.
    pub(crate) fn replace_in(
        &mut self,
        old: &[u32],
        (new, regions): (&[[u32; 4]], &[u16]),
        mut label: impl FnMut([u32; 3]) -> u32,
        made: &mut Vec<u32>,
    ) {
        let mut cavity = std::mem::take(&mut self.cavity);
        cavity.inner.clear();
        cavity.joined.clear();
        self.list_outer_faces(old, &mut cavity.outer);
        if cavity.outer.list.len() > MAX_SCANNED_ITEMS {
            cavity.outer.index();
            cavity.inner.index();
        }
        self.take_out(old);
        self.put_in(new, regions, made);
        for &t in made.iter() {
            for i in 0..4 {
                self.join(t, i, &mut cavity);
            }
            self.find_vertices_from(t);
        }
        if self.is_divided() {
            self.label_walls(&cavity.joined, &mut label);
        }
        if let Some(log) = &mut self.log {
            log.extend_from_slice(made);
        }
        for &(face, place) in &cavity.inner.list {
            self.adjacent[place as usize / 4][place as usize % 4] = label(face) | BOUNDARY;
        }
        for &(face, n) in &cavity.outer.list {
            if n < BOUNDARY {
                self.open(n, face, label(face));
            }
        }
        self.keep_vertices(&cavity.outer);
        self.cavity = cavity;
    }

    /// Lists the outer faces of the tetrahedra `old`, each with the neighbour behind it or, on the
    /// boundary, its label.
    fn list_outer_faces(&mut self, old: &[u32], outer: &mut PendingFaces) {
        outer.clear();
        let epoch = self.next_epoch();
        for &t in old {
            self.marks[t as usize] = epoch;
        }
        for &t in old {
            for i in 0..4 {
                let n = self.adjacent[t as usize][i];
                if n >= BOUNDARY || self.marks[n as usize] != epoch {
                    outer.push(sorted(self.face(t, i)), n);
                }
            }
        }
    }

    /// Empties the slots of tetrahedra.
    fn take_out(&mut self, old: &[u32]) {
        for &t in old {
            for k in self.tets[t as usize] {
                self.tet_of[k as usize] = NONE;
            }
            self.tets[t as usize] = [NONE; 4];
            self.free.push(t);
        }
    }

    /// Stores tetrahedra without neighbours in free slots, or new ones.
    fn put_in(&mut self, new: &[[u32; 4]], regions: &[u16], made: &mut Vec<u32>) {
        made.clear();
        for (k, v) in new.iter().enumerate() {
            let t = self.free.pop().unwrap_or_else(|| {
                self.tets.push([NONE; 4]);
                self.adjacent.push([OPEN; 4]);
                self.marks.push(0);
                if !regions.is_empty() {
                    self.regions.push(0);
                    self.walls.push([NONE; 4]);
                }
                self.tets.len() as u32 - 1
            });
            self.tets[t as usize] = *v;
            if let Some(&region) = regions.get(k) {
                self.regions[t as usize] = region;
                self.walls[t as usize] = [NONE; 4];
            }
            made.push(t);
        }
    }

    /// Joins face `i` of a new tetrahedron to its neighbour: one around the cavity, another new
    /// tetrahedron, or one that is added later.
    #[inline]
    fn join(&mut self, t: u32, i: usize, cavity: &mut Cavity) {
        let face = sorted(self.face(t, i));
        if let Some(n) = cavity.outer.take(face) {
            self.adjacent[t as usize][i] = n;
            if n < BOUNDARY {
                let back = self.place_opposite(n, face);
                self.adjacent[n as usize][back] = t;
                if self.is_divided() {
                    self.keep_wall((t, i), (n, back), cavity);
                }
            }
        } else if let Some(other) = cavity.inner.take(face) {
            self.adjacent[t as usize][i] = other / 4;
            self.adjacent[other as usize / 4][other as usize % 4] = t;
            if self.is_divided() {
                cavity.joined.push((t, i));
            }
        } else {
            cavity.inner.push(face, 4 * t + i as u32);
        }
    }

    /// Keeps the label of a wall between a new tetrahedron and a neighbour of the cavity; a face
    /// that becomes a wall is queued for a label.
    fn keep_wall(&mut self, (t, i): (u32, usize), (n, back): (u32, usize), cavity: &mut Cavity) {
        let label = self.walls[n as usize][back];
        if !self.is_wall(t, i) {
            self.walls[n as usize][back] = NONE;
        } else if label == NONE {
            cavity.joined.push((t, i));
        } else {
            self.walls[t as usize][i] = label;
        }
    }

    /// Labels the walls among faces of new tetrahedra that have no label so far.
    fn label_walls(&mut self, joined: &[(u32, usize)], label: &mut impl FnMut([u32; 3]) -> u32) {
        for &(t, i) in joined {
            if self.is_wall(t, i) {
                let label = label(sorted(self.face(t, i)));
                self.set_label(t, i, label);
            }
        }
    }

    /// Returns the local index of the vertex of tetrahedron `t` that is not on its face.
    pub(super) fn place_opposite(&self, t: u32, face: [u32; 3]) -> usize {
        (0..4)
            .find(|&j| !face.contains(&self.tets[t as usize][j]))
            .expect("one vertex is not on the face")
    }

    fn find_vertices_from(&mut self, t: u32) {
        for k in self.tets[t as usize] {
            self.tet_of[k as usize] = t;
        }
    }

    /// Marks `face` of the neighbour `n` as boundary, since the tetrahedron behind it was removed.
    fn open(&mut self, n: u32, face: [u32; 3], label: u32) {
        let back = self.place_opposite(n, face);
        self.adjacent[n as usize][back] = label | BOUNDARY;
        if let Some(log) = &mut self.log {
            log.push(n);
        }
        self.find_vertices_from(n);
    }

    /// Updates `tet_of` of cavity vertices that only neighbours of the cavity use now.
    fn keep_vertices(&mut self, outer: &PendingFaces) {
        for &(face, n) in &outer.list {
            if n < BOUNDARY {
                for k in face {
                    if self.tet_of[k as usize] == NONE {
                        self.tet_of[k as usize] = n;
                    }
                }
            }
        }
    }

    /// Splits the edge from `a` to `b` of the ring at vertex `m`: every tetrahedron of the ring
    /// becomes two.
    pub(crate) fn split(&mut self, ring: &Ring, a: u32, b: u32, m: u32, made: &mut Vec<u32>) {
        let with = |from: u32| move |k: u32| if k == from { m } else { k };
        let mut new = Vec::with_capacity(2 * ring.tets.len());
        let regions = self.regions_of(&ring.tets);
        let regions: Vec<u16> = regions.into_iter().flat_map(|r| [r; 2]).collect();
        let mut labels: Vec<([u32; 3], u32)> = Vec::new();
        for &t in &ring.tets {
            let v = self.tets[t as usize];
            new.push(v.map(with(b)));
            new.push(v.map(with(a)));
            for i in 0..4 {
                let f = self.face(t, i);
                if let Some(label) = self.mark(t, i)
                    && f.contains(&a)
                    && f.contains(&b)
                {
                    labels.push((sorted(f.map(with(b))), label));
                    labels.push((sorted(f.map(with(a))), label));
                }
            }
        }
        let label = |face| label_in(&labels, face);
        self.replace_in(&ring.tets, (&new, &regions), label, made);
    }
}

/// Returns the label of a face in a list of faces with sorted vertices; [`OPEN`] if it is not
/// listed.
pub(crate) fn label_in(labels: &[([u32; 3], u32)], face: [u32; 3]) -> u32 {
    labels.iter().find(|l| l.0 == face).map_or(OPEN, |l| l.1)
}
