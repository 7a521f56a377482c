//! Edge splits at the midpoint: in bad tetrahedra that nothing else mends, where edges leave the
//! surface, and where faces have all corners on one curve.

use super::holds::Hold;
use super::{OPERATIONS_PER_STOP_CHECK, Optimiser};
use crate::complex::{Face, Ring, STRAY, edge, label_in, labelled_edges};
use crate::points::centroid;
use crate::surface::On;
use isoform_geom::{Point3, norm, sub};
use rayon::prelude::*;

/// Maximum sagitta of an edge of the surface, as a fraction of its length, for elements of order 1
/// and of order 2. The first is an arc of 53 degrees, as sizes by curvature produce (less doubles
/// the triangles of each small ball, which optimisation would have to place); the second one of 37,
/// the largest for good curved elements.
pub(super) const MAX_SAGITTA_RATIOS: [f64; 2] = [0.12, 0.08];

/// A vertex to be inserted.
struct NewVertex {
    at: Point3,
    hold: On,
    labels: On,
}

impl Optimiser<'_> {
    /// Splits the edge from `a` to `b` at its midpoint and moves the new vertex to its best
    /// position; undone if the worst measure does not improve.
    pub(super) fn insert(&mut self, [a, b]: [u32; 2]) -> bool {
        let mut ring = Ring::default();
        if !self.complex.ring_of(a, b, &mut ring) {
            return false;
        }
        let before = self.worst(&ring.tets);
        // A new vertex must pay for itself.
        self.insert_in(&ring, [a, b], before + 0.01)
    }

    /// Splits the edge of a ring like [`Self::insert`], kept if the worst measure is better than
    /// `least`.
    fn insert_in(&mut self, ring: &Ring, ends: [u32; 2], least: f64) -> bool {
        let Some(fresh) = self.middle_vertex(ring, ends) else {
            return false;
        };
        let tet = |&t: &u32| self.complex.tets[t as usize];
        let old: Vec<[u32; 4]> = ring.tets.iter().map(tet).collect();
        let faces = self.boundary_of(&ring.tets);
        let regions = self.complex.regions_of(&ring.tets);
        let m = self.add_vertex(fresh);
        let mut made = Vec::new();
        self.complex.split(ring, ends[0], ends[1], m, &mut made);
        let mut moving = std::mem::take(&mut self.scratch.moving);
        if let Some(place) = self.better_place(m, &mut moving) {
            self.complex.points[m as usize] = place;
        }
        self.scratch.moving = moving;
        if self.worst(&made) > least {
            return true;
        }
        let mut back = Vec::new();
        let label = |face| label_in(&faces, face);
        self.complex
            .replace_in(&made, (&old, &regions), label, &mut back);
        self.remove_last_vertex();
        false
    }

    /// Returns the vertex in the middle of an edge, on the surface if the edge is; `None` if the
    /// surface is not near.
    fn middle_vertex(&self, ring: &Ring, ends: [u32; 2]) -> Option<NewVertex> {
        let middle = self.middle_of(ends);
        if !self.complex.is_on_surface(ring) {
            return Some(NewVertex {
                at: middle,
                hold: On::default(),
                labels: On::default(),
            });
        }
        let labels = self.labels_beside(ring, ends)?;
        if labels.iter().any(|&l| l >= STRAY) {
            return None;
        }
        let hold = self.pieces_of_edge(ends, labels);
        let at = self.surface.project(hold.slice(), middle)?;
        // A point farther away is on another sheet.
        let reach = 0.3 * self.complex.edge_length(ends[0], ends[1]);
        (norm(sub(at, middle)) <= reach).then(|| NewVertex {
            at,
            hold,
            labels: On::from_pieces(&labels),
        })
    }

    /// Returns the boundary faces of tetrahedra, vertices sorted, with the marker of the neighbour
    /// there, and faces on walls with their labels.
    fn boundary_of(&self, tets: &[u32]) -> Vec<Face> {
        let mut faces = Vec::new();
        for &t in tets {
            for i in 0..4 {
                if let Some(label) = self.complex.mark(t, i) {
                    let mut f = self.complex.face(t, i);
                    f.sort_unstable();
                    faces.push((f, label));
                }
            }
        }
        faces
    }

    fn add_vertex(&mut self, fresh: NewVertex) -> u32 {
        self.hold.push(Hold::On(fresh.hold));
        self.labels.push(fresh.labels);
        self.touched.push(self.clock);
        self.complex.add_point(fresh.at)
    }

    /// Removes the vertex that was added last, after all its tetrahedra.
    fn remove_last_vertex(&mut self) {
        self.complex.points.pop();
        self.complex.tet_of.pop();
        self.hold.pop();
        self.labels.pop();
        self.touched.pop();
    }

    /// Splits edges of the surface whose midpoints are farther from it than `error`, or that turn
    /// too far, until there are none.
    pub(super) fn refine_surface(&mut self, error: f64, goal: f64) {
        self.error = error;
        let mut fewest = usize::MAX;
        for _ in 0..8 {
            if self.control.is_stopped() {
                return;
            }
            let mut wanted = self.edges_to_split(error);
            if wanted.len() > fewest - fewest / 10 {
                return;
            }
            fewest = wanted.len();
            wanted.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            match self.split_all(&wanted) {
                None | Some(0) => return,
                Some(_) => self.mend_all(goal, 12),
            }
        }
    }

    /// Splits edges of the surface. Returns their number; `None` on a stop.
    fn split_all(&mut self, edges: &[(f64, [u32; 2])]) -> Option<usize> {
        let (mut ring, mut done) = (Ring::default(), 0);
        for (k, &(_, [a, b])) in edges.iter().enumerate() {
            if k.is_multiple_of(OPERATIONS_PER_STOP_CHECK) && self.control.is_stopped() {
                return None;
            }
            if self.complex.ring_of(a, b, &mut ring) && self.complex.is_on_surface(&ring) {
                done += usize::from(self.insert_in(&ring, [a, b], 0.02));
            }
        }
        Some(done)
    }

    /// Returns the edges of the surface that leave it too far, each with the ratio of the deviation
    /// to its limit.
    fn edges_to_split(&self, error: f64) -> Vec<(f64, [u32; 2])> {
        let faces = self.complex.faces();
        let edges = labelled_edges(faces.iter().copied());
        let mut wanted: Vec<(f64, [u32; 2])> = edges
            .par_chunk_by(|a, b| a.0 == b.0)
            .filter_map(|same| {
                let (ends, labels) = (same[0].0, [same[0].1, same[same.len() - 1].1]);
                Some((self.excess(ends, labels, error)?, ends))
            })
            .collect();
        if error.is_finite() {
            // Faces whose edges are all right but whose centroid is not.
            let on_pieces = faces.par_iter().filter(|f| f.1 < STRAY);
            wanted.par_extend(on_pieces.filter_map(|f| self.longest_of_bulging(f, error)));
        }
        wanted
    }

    /// Returns the longest edge of a face whose centroid is farther from the surface than `error`,
    /// with the ratio of the two.
    fn longest_of_bulging(&self, (f, label): &Face, error: f64) -> Option<(f64, [u32; 2])> {
        let middle = centroid(self.points_of(*f));
        let on = self.piece_at(f, *label);
        let off = norm(sub(self.surface.project(&[on], middle)?, middle));
        let ends = |k: usize| [f[k], f[(k + 1) % 3]];
        let length = |k: usize| {
            let [a, b] = ends(k);
            self.complex.edge_length(a, b)
        };
        let longest = (0..3).max_by(|&i, &j| length(i).total_cmp(&length(j)))?;
        let [a, b] = ends(longest);
        (off > error).then_some((off / error, edge(a, b)))
    }

    /// Returns the ratio of an edge's deviation from the surface to its limit; `None` if it is
    /// within.
    pub(super) fn excess(&self, ends: [u32; 2], labels: [u32; 2], error: f64) -> Option<f64> {
        if labels.iter().any(|&l| l >= STRAY) {
            return None;
        }
        let middle = self.middle_of(ends);
        let on = self.pieces_of_edge(ends, labels);
        let length = self.complex.edge_length(ends[0], ends[1]);
        let most = (self.turn * length).min(error).min(if on.len() == 2 {
            // Edges on feature curves follow them closely.
            0.08 * self.size
        } else {
            f64::INFINITY
        });
        // For most edges the first step of Newton's method already shows that they are within.
        // The edge is surely near enough to the surface.
        if norm(sub(self.surface.nearer(on.slice(), middle)?, middle)) < 0.6 * most {
            return None;
        }
        let off = norm(sub(self.surface.project(on.slice(), middle)?, middle));
        // Farther away, the edge runs across the solid, or an iteration failed.
        (off > most && off < 0.4 * length).then_some(off / most)
    }

    /// Splits faces of the surface whose corners all lie on one curve, at their edge that is not an
    /// edge of the curve: three points do not tell on which side of the curve such a face is, and
    /// there is room for a better one.
    pub(super) fn split_ears(&mut self, least: f64) {
        let mut ring = Ring::default();
        for (k, [a, b]) in self.ears().into_iter().enumerate() {
            if k.is_multiple_of(OPERATIONS_PER_STOP_CHECK) && self.control.is_stopped() {
                return;
            }
            if self.complex.ring_of(a, b, &mut ring) {
                let before = self.worst(&ring.tets);
                self.insert_in(&ring, [a, b], least.min(0.9 * before));
            }
        }
    }

    /// Returns the edges within a piece of faces whose corners all lie on one curve.
    fn ears(&self) -> Vec<[u32; 2]> {
        let mut ears = Vec::new();
        let mut ring = Ring::default();
        for (f, _) in self.complex.faces() {
            let [a, b, c] = f.map(|v| self.labels[v as usize]);
            if a.common(&b).common(&c).len() < 2 {
                continue;
            }
            for [a, b] in [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]] {
                let is_there = self.complex.ring_of(a, b, &mut ring);
                if is_there && self.surface_edge(&ring, [a, b]).is_some() {
                    ears.push(edge(a, b));
                }
            }
        }
        ears.sort_unstable();
        ears.dedup();
        ears
    }
}
