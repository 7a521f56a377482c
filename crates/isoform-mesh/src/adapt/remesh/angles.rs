//! Flips, moves and insertions that increase small angles.

use super::{Hold, MIN_COLLAPSE_SINE, MIN_FACING_COSINE, MIN_SINE_GAIN, Remesher};
use crate::complex::Face;
use crate::measure::smallest_sine;
use crate::points::{lerp, unit};
use crate::surface::{On, SKIN};
use isoform_geom::{Point3, cross, norm, sub};

/// First step of the search for a better position: the first fraction of the shortest edge, which
/// counts as at least the second fraction of the target length.
const FIRST_STEP_FRACTIONS: [f64; 2] = [0.4, 0.2];

/// Returns the lesser of a function's values for two triangles.
fn least(triangles: [[Point3; 3]; 2], of: impl Fn([Point3; 3]) -> f64) -> f64 {
    let numbers = triangles.into_iter().map(of);
    numbers.fold(f64::INFINITY, f64::min)
}

impl Remesher<'_> {
    /// Flips edges wherever that increases the smallest angle of the two faces. Returns the number
    /// of flips.
    pub(super) fn flip_all(&mut self) -> usize {
        let mut total = 0;
        for _ in 0..6 {
            let edges = self.skin.edges().into_iter();
            let done = edges.filter(|&[a, b]| self.flip(a, b)).count();
            total += done;
            if done == 0 {
                break;
            }
        }
        total
    }

    fn flip(&mut self, a: u32, b: u32) -> bool {
        let Some([l, r]) = self.skin.sides(a, b) else {
            return false;
        };
        let (c, d) = (self.skin.opposite(l, a, b), self.skin.opposite(r, a, b));
        let label = self.skin.label_of(l);
        let degree = |v: u32| self.skin.around[v as usize].len();
        // Only within one part: a face across the seam of two parts would fit neither.
        if label != self.skin.label_of(r)
            || c == d
            || self.skin.has_edge(c, d)
            || degree(a) <= 3
            || degree(b) <= 3
        {
            return false;
        }
        let new = [[c, a, d], [d, b, c]];
        let old_corners = [l, r].map(|f| self.skin.corners(f));
        let new_corners = new.map(|f| f.map(|v| self.skin.at(v)));
        if !self.is_better(old_corners, new_corners, label) {
            return false;
        }
        let on = self.piece_at([c, d], label);
        if self.leaves(c, d, &[on]) && !self.leaves(a, b, &[on]) {
            return false;
        }
        self.skin.replace(&[l, r], &new.map(|f| (f, label)));
        true
    }

    /// Returns true if two faces are better than two others: the smallest angle is larger, and
    /// neither is turned away from the piece. Folded faces are unfolded whatever their angles.
    fn is_better(&self, old: [[Point3; 3]; 2], new: [[Point3; 3]; 2], label: u32) -> bool {
        let facing = |faces| least(faces, |p| self.facing(p, label));
        let before = facing(old);
        let is_better = least(new, smallest_sine) > least(old, smallest_sine) + MIN_SINE_GAIN
            || (before < 0.0 && facing(new) > 0.0);
        is_better && facing(new) >= MIN_FACING_COSINE.min(before)
    }

    /// Moves every vertex towards the mean of its neighbours, on its pieces. With `freely` also
    /// where angles get worse.
    pub(super) fn relax(&mut self, freely: bool) {
        // Rounds of moves, while they are free and when angles must not get worse.
        for _ in 0..[3, 2][usize::from(!freely)] {
            for v in 0..self.skin.points.len() as u32 {
                self.relax_one(v, freely);
            }
        }
    }

    fn relax_one(&mut self, v: u32, freely: bool) {
        let Hold::On(on) = self.hold[v as usize] else {
            return;
        };
        if self.skin.around[v as usize].is_empty() {
            return;
        }
        let p = self.skin.at(v);
        let before = self.skin.worst_at(v, p);
        // Vertices whose angles are above 38 degrees stay in place.
        if !freely && before > 0.62 {
            return;
        }
        let mut others = self.skin.neighbours(v);
        if on.len() == 2 {
            others.retain(|&w| self.sharp(v, w).is_some());
        }
        if others.is_empty() {
            return;
        }
        let n = others.len() as f64;
        let sum = |i: usize| others.iter().map(|&w| self.skin.at(w)[i]).sum::<f64>();
        // Damped Laplacian smoothing: the vertex moves this fraction of the way.
        let target = lerp(p, std::array::from_fn(|i| sum(i) / n), 0.7);
        let least = if freely {
            0.5 * before.min(MIN_COLLAPSE_SINE)
        } else {
            before.min(MIN_COLLAPSE_SINE)
        };
        self.try_place(v, on, target, least);
    }

    /// Moves a vertex to the projection of `target` onto its pieces, if adjacent faces stay valid
    /// and no sine falls below `least`.
    fn try_place(&mut self, v: u32, on: On, target: Point3, least: f64) -> bool {
        let Some(q) = self.surface.project(on.slice(), target) else {
            return false;
        };
        let reach = self.skin.around[v as usize]
            .iter()
            .flat_map(|&f| self.skin.faces[f as usize])
            .map(|w| self.skin.length([v, w]))
            .fold(0.0, f64::max);
        if self.skin.worst_at(v, q) < least || norm(sub(self.skin.at(v), q)) > reach {
            return false;
        }
        let may = self.is_there(on, q) && !self.turns_away(v, q);
        if may {
            self.skin.points[v as usize] = q;
        }
        may
    }

    /// Returns true if a point lies on pieces and on the surface.
    fn is_there(&self, on: On, q: Point3) -> bool {
        let vanishes = |i: u32| self.surface.distance(i, q) == 0.0;
        on.slice().iter().all(|&i| vanishes(i)) && vanishes(SKIN)
    }

    /// Returns true if a face at a vertex would turn away from its piece if the vertex were moved
    /// to `q`.
    fn turns_away(&self, v: u32, q: Point3) -> bool {
        let mut star = self.skin.star_with(v, q);
        star.any(|(f, new)| self.faces_away(self.skin.corners(f), new, self.skin.label_of(f)))
    }

    /// Improves the worst triangles until none is below the goal or nothing helps.
    pub(super) fn mend(&mut self) {
        // Triangles with a smaller angle are mended; in degrees.
        let goal = 35.0f64.to_radians().sin();
        for round in 0..25 {
            if self.control.is_stopped() {
                return;
            }
            let faces = self.skin.live();
            let mut bad: Vec<(f64, u32)> = faces
                .map(|f| (smallest_sine(self.skin.corners(f)), f))
                .filter(|b| b.0 < goal)
                .collect();
            bad.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            // Vertices are inserted only after other operations had three rounds.
            let insertions = round >= 3;
            bad.retain(|&(_, f)| {
                self.skin.is_there(f)
                    && smallest_sine(self.skin.corners(f)) < goal
                    && self.mend_one(f, insertions)
            });
            if bad.is_empty() && insertions {
                return;
            }
        }
    }

    /// Tries all operations on a bad triangle, longest edges first. Returns true if one succeeded.
    fn mend_one(&mut self, f: u32, insertions: bool) -> bool {
        let mut edges = self.skin.edges_at(f);
        edges.sort_by(|a, b| self.skin.length(*b).total_cmp(&self.skin.length(*a)));
        if edges.into_iter().any(|[a, b]| self.flip(a, b)) {
            return true;
        }
        let mut shortest_first = edges.into_iter().rev();
        if shortest_first.any(|[a, b]| self.collapse(a, b, true) || self.collapse(b, a, true)) {
            return true;
        }
        let vertices = self.skin.faces[f as usize];
        if vertices.map(|v| self.nudge(v)).contains(&true) {
            return true;
        }
        insertions && self.insert(edges[0])
    }

    /// Searches for a better position of a vertex: along its curve, or in eight directions, with
    /// decreasing steps.
    fn nudge(&mut self, v: u32) -> bool {
        let Hold::On(on) = self.hold[v as usize] else {
            return false;
        };
        let p = self.skin.at(v);
        let neighbours = self.skin.neighbours(v).into_iter();
        let shortest = neighbours
            .map(|w| self.skin.length([v, w]))
            .fold(f64::INFINITY, f64::min);
        let Some([a, b]) = self.directions(on, p) else {
            return false;
        };
        let mut step =
            FIRST_STEP_FRACTIONS[0] * shortest.max(FIRST_STEP_FRACTIONS[1] * self.wanted(p));
        let mut moved = false;
        // The search ends when steps are 1 % of the shortest edge.
        while step > 0.01 * shortest {
            let p = self.skin.at(v);
            let before = self.skin.worst_at(v, p);
            // Directions at equal angles.
            let better = (0..8).any(|k| {
                let (s, c) = (0.25 * std::f64::consts::PI * f64::from(k)).sin_cos();
                let target = std::array::from_fn(|i| p[i] + step * (c * a[i] + s * b[i]));
                self.try_place(v, on, target, before + MIN_SINE_GAIN)
            });
            moved |= better;
            if !better {
                step *= 0.5;
            }
        }
        moved
    }

    /// Returns two vectors that span the directions in which a vertex may move; on a curve the
    /// second is 0.
    fn directions(&self, on: On, p: Point3) -> Option<[Point3; 2]> {
        let gradient = |i: u32| self.surface.gradient(i, p).1;
        match *on.slice() {
            [i] => {
                let n = gradient(i);
                let axis = (0..3)
                    .min_by(|&i, &j| n[i].abs().total_cmp(&n[j].abs()))
                    .unwrap_or(0);
                let mut e = [0.0; 3];
                e[axis] = 1.0;
                let a = unit(cross(n, e));
                Some([a, unit(cross(n, a))])
            }
            [i, j] => Some([unit(cross(gradient(i), gradient(j))), [0.0; 3]]),
            _ => None,
        }
    }

    /// Splits an edge and optimises the new vertex; kept if the smallest angle increases.
    fn insert(&mut self, [a, b]: [u32; 2]) -> bool {
        let Some(sides) = self.skin.sides(a, b) else {
            return false;
        };
        let before = least(sides.map(|f| self.skin.corners(f)), smallest_sine);
        let m = self.skin.points.len() as u32;
        if !self.split(a, b) {
            return false;
        }
        self.nudge(m);
        if self.skin.worst_at(m, self.skin.at(m)) > before + MIN_SINE_GAIN {
            return true;
        }
        // Undo: the two faces on each side are merged.
        let star = self.skin.around[m as usize].clone();
        let has_a = |f: &&u32| self.skin.faces[**f as usize].contains(&a);
        let kept = star.iter().filter(has_a);
        let faces: Vec<Face> = kept.map(|&f| self.skin.exchanged(f, m, b)).collect();
        self.skin.replace(&star, &faces);
        false
    }
}
