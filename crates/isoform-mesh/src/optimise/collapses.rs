//! Edge collapses: a vertex is pulled onto its neighbour, and the tetrahedra between them vanish.

use super::holds::Hold;
use super::link::keeps_topology;
use super::{MIN_GAIN, OPERATIONS_PER_STOP_CHECK, Optimiser};
use crate::complex::{EDGES, Face, NONE, Ring, label_in};
use crate::measure::{biased_sine, smallest_sine};
use crate::surface::On;
use isoform_geom::{dot, norm, sub};

/// Length of an edge, in sizes, below which it is collapsed even if angles do not improve.
const MICRO_EDGE_SIZES: f64 = 0.004;
/// Measure that the collapse of such an edge must leave: this share of the previous one, or this
/// value.
const MICRO_COLLAPSE_MEASURES: [f64; 2] = [0.5, 0.05];

/// Maximum edge of a wall or of the surface next to it that a collapse may create, in sizes: longer
/// ones are remains of a thin gap between a wall and another surface, whose flat tetrahedra only
/// collapses mend. Edges of 1.6 sizes are usual.
const MAX_WALL_EDGE_SIZES: f64 = 2.0;

/// Collapse of vertex `u` onto its neighbour `w`.
#[derive(Clone, Copy)]
pub(super) struct Pull {
    pub(super) u: u32,
    pub(super) w: u32,
}

impl Pull {
    /// Returns the vertex that replaces `k`.
    fn image(self, k: u32) -> u32 {
        if k == self.u { self.w } else { k }
    }
}

/// Tetrahedra and faces after a collapse.
struct CollapseResult {
    tets: Vec<[u32; 4]>,
    /// Regions of the tetrahedra, if there are regions.
    regions: Vec<u16>,
    /// Faces of the surface, vertices sorted.
    labels: Vec<Face>,
    /// Worst measure of all these.
    worst: f64,
}

impl Optimiser<'_> {
    /// Returns true if vertex `u` may be pulled onto its neighbour `w`: not across the solid from
    /// one side of the surface to the other, on the surface only along it, and on a curve only
    /// along that.
    fn may_collapse(&self, Pull { u, w }: Pull, ring: &Ring) -> bool {
        let Hold::On(on) = self.hold[u as usize] else {
            return false;
        };
        let labels = self.labels[u as usize];
        if labels.is_empty() {
            // A free vertex: onto anything.
            return true;
        }
        if !self.complex.is_on_surface(ring) {
            return false;
        }
        let Some([a, b]) = self.labels_beside(ring, [u, w]) else {
            return false;
        };
        let is_within = labels.is_within(&self.labels[w as usize]);
        if self.is_skin(u) && on.len() == 1 {
            // Seams between pieces that touch tangentially may go anywhere.
            return is_within || matches!(self.hold[w as usize], Hold::On(held) if held.len() == 1);
        }
        is_within
            && if on.len() == 2 {
                a != b && self.pieces_of_edge([u, w], [a, b]).is_within(&on)
            } else {
                labels.len() == 1 || a != b
            }
    }

    /// Pulls `u` of tetrahedron `t` onto `w` if `apply` is set and the worst measure around `u`
    /// improves, or stays above `least` if that is given. Returns the worst measure afterwards;
    /// `None` if it does not improve.
    pub(super) fn collapse(
        &mut self,
        t: u32,
        pull: Pull,
        least: Option<f64>,
        apply: bool,
    ) -> Option<f64> {
        let Pull { u, w } = pull;
        let mut ring = std::mem::take(&mut self.scratch.ring);
        self.complex.ring(t, u, w, &mut ring);
        let allowed = self.may_collapse(pull, &ring);
        self.scratch.ring = ring;
        if !allowed {
            return None;
        }
        let mut star = Vec::new();
        self.complex.star(u, &mut star);
        let bound = least.unwrap_or_else(|| self.worst(&star) + MIN_GAIN);
        let mut left = self.collapsed(&star, pull, bound)?;
        let faces = self.faces_at(&star, u);
        self.collapse_faces(&faces, pull, bound, &mut left)?;
        let mut other = Vec::new();
        self.complex.star(w, &mut other);
        if !keeps_topology(&self.complex, [(u, &star), (w, &other)], &self.scratch.ring)
            || self.joins_sheets(pull, &left.tets)
            || (least.is_none() && self.leaves_surface(pull, &faces))
        {
            return None;
        }
        if apply {
            self.apply_collapse(pull, &star, &left);
        }
        Some(left.worst)
    }

    /// Pulls `u` onto `w` even if they are held, provided that all tetrahedra stay positive and the
    /// complex a manifold; `ring` is that of their edge. Returns true if the collapse was done.
    pub(super) fn contract(&mut self, pull: Pull, ring: &Ring) -> bool {
        let (mut star, mut other) = (Vec::new(), Vec::new());
        self.complex.star(pull.u, &mut star);
        self.complex.star(pull.w, &mut other);
        let Some(mut left) = self.collapsed(&star, pull, 0.0) else {
            return false;
        };
        let faces = self.faces_at(&star, pull.u);
        let is_fit = self.collapse_faces(&faces, pull, 0.0, &mut left).is_some()
            && keeps_topology(&self.complex, [(pull.u, &star), (pull.w, &other)], ring);
        if is_fit {
            self.apply_collapse(pull, &star, &left);
        }
        is_fit
    }

    /// Returns the tetrahedra that a collapse would leave of the star of `u`; `None` unless all of
    /// them are better than `bound`.
    fn collapsed(&self, star: &[u32], pull: Pull, bound: f64) -> Option<CollapseResult> {
        let mut left = CollapseResult {
            tets: Vec::with_capacity(star.len()),
            regions: Vec::new(),
            labels: Vec::new(),
            worst: f64::INFINITY,
        };
        for &t in star {
            let v = self.complex.tets[t as usize];
            if v.contains(&pull.w) {
                continue;
            }
            let v = v.map(|k| pull.image(k));
            left.worst = left.worst.min(biased_sine(self.points_of(v)));
            if left.worst <= bound {
                return None;
            }
            left.tets.push(v);
            if self.complex.is_divided() {
                left.regions.push(self.complex.region(t));
            }
        }
        Some(left)
    }

    /// Adds the faces of the surface that a collapse would leave; `None` unless all are better than
    /// `bound` and face their pieces.
    fn collapse_faces(
        &self,
        faces: &[Face],
        pull: Pull,
        bound: f64,
        left: &mut CollapseResult,
    ) -> Option<()> {
        left.labels.reserve(faces.len());
        for &(f, label) in faces.iter().filter(|(f, _)| !f.contains(&pull.w)) {
            let mut g = f.map(|k| pull.image(k));
            let [old, new] = [f, g].map(|f| self.points_of(f));
            left.worst = left.worst.min(smallest_sine(new));
            if left.worst <= bound || self.turns_away(old, new, label) {
                return None;
            }
            g.sort_unstable();
            left.labels.push((g, label));
        }
        Some(())
    }

    /// Returns true if a free vertex between two sheets, pulled onto one, would join them in an
    /// edge or face of the surface.
    fn joins_sheets(&self, Pull { u, w }: Pull, new: &[[u32; 4]]) -> bool {
        let is_free = |v: u32| self.labels[v as usize].is_empty();
        is_free(u) && !is_free(w) && new.iter().any(|v| v.iter().all(|&k| !is_free(k)))
    }

    /// Returns true if a new edge would be too far from the surface: such an edge would be split
    /// again.
    fn leaves_surface(&self, pull: Pull, faces: &[Face]) -> bool {
        let curve = match self.hold[pull.u as usize] {
            Hold::On(on) if on.len() == 2 => Some([on.slice()[0], on.slice()[1]]),
            _ => None,
        };
        let w = pull.w;
        let is_along = |x: u32, pieces: &[u32; 2]| {
            let on = |v: u32, i: u32| self.labels[v as usize].contains(i);
            pieces.iter().all(|&i| on(x, i) && on(w, i))
        };
        let is_long = |x: u32| self.complex.edge_length(w, x) > MAX_WALL_EDGE_SIZES * self.size;
        let new_faces = faces.iter().filter(|(f, _)| !f.contains(&w));
        let mut new_edges = new_faces.flat_map(|(f, label)| f.map(|x| (x, *label)));
        new_edges.any(|(x, label)| {
            x != pull.u && {
                if self.complex.is_divided() && is_long(x) {
                    return true;
                }
                let along = curve.filter(|pieces| is_along(x, pieces));
                self.excess([w, x], along.unwrap_or([label; 2]), self.error)
                    .is_some()
            }
        })
    }

    /// Collapses `u` into `w`. Open faces of the band, those towards the lattice beyond, are
    /// unaffected: their vertices are fixed, so `u` is on none of them.
    fn apply_collapse(&mut self, Pull { u, w }: Pull, star: &[u32], left: &CollapseResult) {
        let mut made = std::mem::take(&mut self.scratch.made);
        let label = |face| label_in(&left.labels, face);
        let new = (left.tets.as_slice(), left.regions.as_slice());
        self.complex.replace_in(star, new, label, &mut made);
        self.scratch.made = made;
        self.complex.tet_of[u as usize] = NONE;
        let held = self.labels[w as usize];
        let mine = self.labels[u as usize];
        let add = |all: On, &l: &u32| all.with(l).unwrap_or(all);
        let both = mine.slice().iter().fold(held, add);
        if self.is_skin(u) && both != held {
            (self.labels[w as usize], self.hold[w as usize]) = (both, self.hold[u as usize]);
        }
    }

    /// Collapses edges that are far shorter than any requested edge; cuts leave such edges where
    /// pieces nearly touch.
    pub(super) fn collapse_micro(&mut self) {
        let mut ring = Ring::default();
        for (k, ends) in self.micro_edges().into_iter().enumerate() {
            if k.is_multiple_of(OPERATIONS_PER_STOP_CHECK) && self.control.is_stopped() {
                return;
            }
            let [a, b] = ends;
            for pull in [Pull { u: a, w: b }, Pull { u: b, w: a }] {
                let is_there = |v: u32| self.complex.tet_of[v as usize] != NONE;
                if !is_there(a) || !is_there(b) || self.collapse_short(pull, &mut ring) {
                    break;
                }
            }
        }
    }

    /// Returns the micro edges, shortest first.
    fn micro_edges(&self) -> Vec<[u32; 2]> {
        let micro = MICRO_EDGE_SIZES * self.size;
        let mut short: Vec<(f64, [u32; 2])> = Vec::new();
        for t in self.complex.live() {
            let (edges, p) = (self.complex.edges(t), self.complex.corners(t));
            for (ends, (i, j)) in edges.into_iter().zip(EDGES) {
                let e = sub(p[i], p[j]);
                if dot(e, e) < micro * micro {
                    short.push((norm(e), ends));
                }
            }
        }
        short.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        short.dedup();
        short.into_iter().map(|s| s.1).collect()
    }

    /// Pulls one end of a short edge onto the other. Returns true if that was done or the edge no
    /// longer exists.
    fn collapse_short(&mut self, pull: Pull, ring: &mut Ring) -> bool {
        let Pull { u, w } = pull;
        if !self.complex.ring_of(u, w, ring) {
            return true;
        }
        if !self.labels[u as usize].is_empty() {
            self.free(u, true);
        }
        let [share, least] = MICRO_COLLAPSE_MEASURES;
        let least = (share * self.worst(&ring.tets)).min(least);
        let done = self.collapse(ring.tets[0], pull, Some(least), true);
        if done.is_some() {
            self.touched[w as usize] = self.clock + 1;
        }
        done.is_some()
    }
}
