//! Moves of vertices that cutting had to leave off the surface onto it.

use super::holds::Hold;
use super::{OPERATIONS_PER_STOP_CHECK, Optimiser};
use crate::complex::{NONE, STRAY};
use crate::points::{centroid, lerp};
use crate::surface::{On, is_skin};
use isoform_geom::{Point3, norm, sub};
use rayon::prelude::*;

/// Shares of the way to the surface that are tried: the whole of it if possible.
const SETTLING_STEP_SHARES: [f64; 3] = [1.0, 0.5, 0.25];

impl Optimiser<'_> {
    /// Returns the vertices off the surface, in order; only vertices that `may` admits are
    /// examined.
    pub(super) fn off(&self, may: impl Fn(u32) -> bool + Sync) -> Vec<u32> {
        let is_off = |&v: &u32| {
            self.complex.tet_of[v as usize] != NONE
                && may(v)
                && (self.is_off(v, self.point(v)) || self.is_hidden(v))
        };
        (0..self.complex.points.len() as u32)
            .into_par_iter()
            .filter(is_off)
            .collect()
    }

    /// Moves vertices that the cutting could not place on their pieces onto these, making room by
    /// mending. Returns the positions of those that are still off.
    pub(super) fn settle(&mut self, goal: f64) -> Vec<Point3> {
        let mut left = std::mem::take(&mut self.first_off);
        let mut fewest = usize::MAX;
        let mut since = 0;
        for round in 0..6 {
            if self.control.is_stopped() {
                break;
            }
            let off =
                self.off(|v| self.touched[v as usize] > since || left.binary_search(&v).is_ok());
            since = self.clock;
            // Worse tetrahedra are allowed in every further round.
            left = self.bring_all(off, 0.05 * 0.5f64.powi(round));
            // Many vertices whose number does not fall mean a solid too fine for the size.
            let are_many = left.len() > 16usize.max(fewest - fewest / 10);
            if (left.is_empty() && round > 0) || are_many {
                break;
            }
            fewest = left.len();
            // After three rounds vertices that do not reach their seam are held on the solid alone,
            // which is also right next to the seam.
            let seams_hold = round < 3;
            left.iter().for_each(|&v| self.free(v, seams_hold));
            self.collapse_micro();
            self.make_room(&left);
            self.mend_all(goal, 8);
        }
        left.into_iter()
            .filter(|&v| self.complex.tet_of[v as usize] != NONE)
            .map(|v| self.point(v))
            .collect()
    }

    /// Moves vertices onto the surface, as far as the tetrahedra allow. Returns those that are not
    /// on it.
    fn bring_all(&mut self, off: Vec<u32>, least: f64) -> Vec<u32> {
        let mut left = Vec::new();
        for (k, v) in off.into_iter().enumerate() {
            if k.is_multiple_of(OPERATIONS_PER_STOP_CHECK) && self.control.is_stopped() {
                break;
            }
            if !self.bring(v, least) {
                left.push(v);
            }
        }
        left
    }

    /// Moves a vertex towards the pieces that hold it. Returns true if it is on them.
    pub(super) fn bring(&mut self, v: u32, least: f64) -> bool {
        if self.is_hidden(v) {
            self.hold[v as usize] = Hold::On(self.skin_at(v));
        }
        let p = self.point(v);
        let Some(q) = self.place_of(v) else {
            return false;
        };
        let mut star = Vec::new();
        self.complex.star(v, &mut star);
        let faces = self.faces_at(&star, v);
        let least = if norm(sub(p, q)) < 0.01 * self.size {
            least
                // A slight step may leave most of the previous measure, however bad that was.
                .min(0.9 * self.worst_at(v, p, &star, &faces))
                .max(0.0)
        } else {
            least
        };
        let share = SETTLING_STEP_SHARES
            .into_iter()
            .find(|&t| self.worst_at(v, lerp(p, q, t), &star, &faces) > least);
        if let Some(t) = share {
            self.suspects.extend_from_slice(&star);
            self.touched[v as usize] = self.clock + 1;
            self.complex.points[v as usize] = if t == 1.0 { q } else { lerp(p, q, t) };
        }
        share == Some(1.0)
    }

    /// Returns the nearest point on all pieces that hold a vertex; `None` if there is none within
    /// the size.
    fn place_of(&self, v: u32) -> Option<Point3> {
        let p = self.point(v);
        self.surface
            .project(self.surface.parted(self.holding(v), p).slice(), p)
            .filter(|q| norm(sub(*q, p)) < self.size)
    }

    /// Moves the vertices around some vertices as far as it helps, even if they are good enough.
    pub(super) fn make_room(&mut self, vertices: &[u32]) {
        let near = self.complex.vertices_around(vertices);
        self.clock += 1;
        let enough = std::mem::replace(&mut self.enough, f64::INFINITY);
        self.smooth(&near);
        self.enough = enough;
    }

    /// Frees a vertex whose labels have no common edge or corner of the solid near it, as where
    /// pieces touch tangentially: it is held on the solid alone, and the faces around it get new
    /// labels, from the solid at their centroids. Seams between pieces count as edges if
    /// `seams_hold` is set.
    pub(super) fn free(&mut self, v: u32, seams_hold: bool) {
        let on = self.holding(v);
        if on.is_empty()
            || self
                .place_of(v)
                .is_some_and(|q| self.is_real(on, q, seams_hold))
        {
            return;
        }
        self.hold[v as usize] = Hold::On(self.skin_at(v));
        self.touched[v as usize] = self.clock + 1;
        let mut star = Vec::new();
        self.complex.star(v, &mut star);
        let mut labels = On::default();
        for &t in &star {
            for i in 0..4 {
                if let Some(old) = self.complex.label(t, i)
                    && self.complex.tets[t as usize][i] != v
                {
                    let within = self.complex.middle(t);
                    let label = self.label_anew(v, self.complex.face(t, i), within, old);
                    self.complex.set_label(t, i, label);
                    // A face on no piece, as where a function jumps, does not hold its vertices.
                    if label < STRAY {
                        labels = labels.with(label).unwrap_or(labels);
                    }
                }
            }
        }
        self.labels[v as usize] = labels;
    }

    /// Returns true if pieces meet at a point in an edge or corner of the solid, if there are
    /// several.
    fn is_real(&self, on: On, q: Point3, seams_hold: bool) -> bool {
        match on.slice() {
            held if held.iter().any(|&i| is_skin(i)) => true,
            &[a, b] if seams_hold => self.surface.is_curve([a, b], q),
            &[a, b] => self.surface.is_edge([a, b], q),
            [_, _, _] => self.surface.is_corner(on.slice(), q),
            _ => true,
        }
    }

    /// Returns the piece on which a face at a vertex lies, from the solid at its centroid: of the
    /// vertex's pieces and the one that decides there the one that the face faces best. `within` is
    /// a point in the tetrahedron that has the face.
    fn label_anew(&self, v: u32, face: [u32; 3], within: Point3, old: u32) -> u32 {
        let c = self.points_of(face);
        if old >= STRAY && self.complex.is_divided() {
            return old;
        }
        let layer = self.surface.layer_of(old);
        let Some(q) = self.surface.project(&[self.surface.skin(old)], centroid(c)) else {
            return old;
        };
        let mine = self.labels[v as usize];
        let deciding = self.surface.value_in(layer, q).1;
        let candidates = mine.with(deciding).unwrap_or(mine);
        let is_face = |l: &u32| {
            self.surface.layer_of(*l) == layer
                && self.surface.distance(*l, q) == 0.0
                && self.surface.is_face(*l, q)
        };
        let mut candidates = candidates.slice().to_vec();
        self.surface.keep_beside(&mut candidates, c, within);
        candidates
            .into_iter()
            .filter(is_face)
            .max_by(|&a, &b| self.facing(c, a).total_cmp(&self.facing(c, b)))
            .unwrap_or(old)
    }
}
