//! Edges are split in the middle: in bad tetrahedra that nothing else mends, where they leave the
//! surface, and where faces have all corners on one curve.

use super::holds::Hold;
use super::{LOOK, Optimiser};
use crate::complex::{Face, Ring, STRAY, edge, label_in, labelled_edges};
use crate::points::centroid;
use crate::surface::On;
use isoform_geom::{Point3, norm, sub};
use rayon::prelude::*;

/// Improvement of the worst tetrahedron that pays for a vertex more.
const WORTH: f64 = 0.01;
/// Farthest that a new vertex goes from the middle of its edge onto the surface, in lengths of the
/// edge. What is farther away is another sheet.
const REACH: f64 = 0.3;
/// Largest sagitta of an edge of the surface, as a share of its length, for elements of order 1 and
/// of order 2. An arc of 53 degrees is what sizes by curvature ask for (less doubles the triangles
/// of each small ball, for optimising to place); one of 37 is the most for good curved elements.
pub(super) const TURN: [f64; 2] = [0.12, 0.08];
/// Largest sagitta of an edge on a feature curve, as a share of the size asked for.
const CURVE: f64 = 0.08;
/// If one step of Newton's method gives less than this share of the largest sagitta allowed, the
/// edge is surely near enough to the surface.
const WELL: f64 = 0.6;
/// If the middle of an edge is farther from the surface than this share of the edge's length, it is
/// not near it at all: the edge runs across the solid, or an iteration failed.
const LOST: f64 = 0.4;
/// Worst measure that a split for the sake of the surface may leave.
const LEAST: f64 = 0.02;
/// Rounds of splits for the sake of the surface.
const ROUNDS: usize = 8;
/// Rounds of mending after each round of splits.
const MENDING: usize = 12;
/// Share of the measure of bad tetrahedra that a split of an ear must keep.
const KEEP: f64 = 0.9;

/// A vertex that is to be inserted.
struct Fresh {
    at: Point3,
    hold: On,
    labels: On,
}

impl Optimiser<'_> {
    /// Splits the edge from `a` to `b` in the middle and moves the new vertex to its best place;
    /// undone if the worst does not improve.
    pub(super) fn insert(&mut self, [a, b]: [u32; 2]) -> bool {
        let mut ring = Ring::default();
        if !self.complex.ring_of(a, b, &mut ring) {
            return false;
        }
        let before = self.worst(&ring.tets);
        self.insert_in(&ring, [a, b], before + WORTH)
    }

    /// Splits the edge of a ring like [`Self::insert`], kept if the worst is better than `least`.
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

    /// The vertex in the middle of an edge, on the surface if the edge is; none where that is not
    /// near.
    fn middle_vertex(&self, ring: &Ring, ends: [u32; 2]) -> Option<Fresh> {
        let middle = self.middle_of(ends);
        if !self.complex.is_on_surface(ring) {
            return Some(Fresh {
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
        let reach = REACH * self.complex.edge_length(ends[0], ends[1]);
        (norm(sub(at, middle)) <= reach).then(|| Fresh {
            at,
            hold,
            labels: On::of(&labels),
        })
    }

    /// The faces of tetrahedra on the boundary, vertices sorted, with what stands for the neighbour
    /// there, and those on walls with their labels.
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

    fn add_vertex(&mut self, fresh: Fresh) -> u32 {
        self.hold.push(Hold::On(fresh.hold));
        self.labels.push(fresh.labels);
        self.touched.push(self.clock);
        self.complex.add_point(fresh.at)
    }

    /// Takes back the vertex that was added last; no tetrahedron has it any more.
    fn remove_last_vertex(&mut self) {
        self.complex.points.pop();
        self.complex.tet_of.pop();
        self.hold.pop();
        self.labels.pop();
        self.touched.pop();
    }

    /// Splits edges of the surface whose middles are farther from it than `error`, or that turn too
    /// far, until there are none.
    pub(super) fn refine_surface(&mut self, error: f64, goal: f64) {
        self.error = error;
        let mut fewest = usize::MAX;
        for _ in 0..ROUNDS {
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
                Some(_) => self.mend_all(goal, MENDING),
            }
        }
    }

    /// Splits edges of the surface. Returns how many; none on a stop.
    fn split_all(&mut self, edges: &[(f64, [u32; 2])]) -> Option<usize> {
        let (mut ring, mut done) = (Ring::default(), 0);
        for (k, &(_, [a, b])) in edges.iter().enumerate() {
            if k.is_multiple_of(LOOK) && self.control.is_stopped() {
                return None;
            }
            if self.complex.ring_of(a, b, &mut ring) && self.complex.is_on_surface(&ring) {
                done += usize::from(self.insert_in(&ring, [a, b], LEAST));
            }
        }
        Some(done)
    }

    /// Edges of the surface that leave it too far, each with the factor by which it does.
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
            // Faces whose edges are all right but whose middle is not.
            let on_pieces = faces.par_iter().filter(|f| f.1 < STRAY);
            wanted.par_extend(on_pieces.filter_map(|f| self.longest_of_bulging(f, error)));
        }
        wanted
    }

    /// The longest edge of a face whose middle is farther from the surface than `error`, with the
    /// factor by which it is.
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

    /// By how much an edge of the surface leaves it more than it may; none if it does not.
    pub(super) fn excess(&self, ends: [u32; 2], labels: [u32; 2], error: f64) -> Option<f64> {
        if labels.iter().any(|&l| l >= STRAY) {
            return None;
        }
        let middle = self.middle_of(ends);
        let on = self.pieces_of_edge(ends, labels);
        let length = self.complex.edge_length(ends[0], ends[1]);
        let most = (self.turn * length).min(error).min(if on.len() == 2 {
            CURVE * self.size
        } else {
            f64::INFINITY
        });
        // The first step of Newton's method tells of most edges that they are well within what they
        // may.
        if norm(sub(self.surface.nearer(on.slice(), middle)?, middle)) < WELL * most {
            return None;
        }
        let off = norm(sub(self.surface.project(on.slice(), middle)?, middle));
        (off > most && off < LOST * length).then_some(off / most)
    }

    /// Splits faces of the surface whose corners all lie on one curve, at their edge that is no
    /// piece of it: three points do not say on which side of the curve such a face is, and there is
    /// room for a better one.
    pub(super) fn split_ears(&mut self, least: f64) {
        let mut ring = Ring::default();
        for (k, [a, b]) in self.ears().into_iter().enumerate() {
            if k.is_multiple_of(LOOK) && self.control.is_stopped() {
                return;
            }
            if self.complex.ring_of(a, b, &mut ring) {
                let before = self.worst(&ring.tets);
                self.insert_in(&ring, [a, b], least.min(KEEP * before));
            }
        }
    }

    /// The edges within a piece of faces whose corners all lie on one curve.
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
