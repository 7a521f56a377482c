//! Bad tetrahedra are mended in rounds, worst first, by whatever helps most.

use super::collapses::Pull;
use super::{LOOK, Optimiser};
use crate::complex::EDGES;
use crate::points::unique;
use isoform_geom::{dot, sub};
use rayon::prelude::*;

/// Vertices around which no tetrahedron is worse than this factor times the goal are left where
/// they are, and moves that get there end: the worst tetrahedra count, and most of the others are
/// good from the start.
const ENOUGH: f64 = 1.25;
/// Rounds of mending in the beginning.
const ROUNDS: usize = 30;
/// Round from which vertices are inserted: flips and collapses come first.
const INSERT_FROM: usize = 3;
/// Bad tetrahedra up to which vertices are inserted in meshes of any size.
const MANY: usize = 200;
/// Tetrahedra per bad one from which on vertices are inserted in large meshes.
const MANY_OF: usize = 200;
/// Edges of a bad tetrahedron that are tried for an insertion, longest first.
const TRIED: usize = 4;
/// Least improvement of the worst tetrahedron that is progress.
const PROGRESS: f64 = 1e-4;
/// Bad tetrahedra per one less that count as progress, too: two of a hundred.
const FEWER: usize = 50;
/// Rounds without progress after which mending ends.
const IDLE: usize = 4;
/// Tetrahedra that a thread takes at once.
const CHUNK: usize = 1024;

/// One way to mend a tetrahedron.
#[derive(Clone, Copy)]
enum Remedy {
    Edge([u32; 2]),
    Face(usize),
    Collapse(Pull),
}

/// A tetrahedron and its measure.
type Bad = (f64, u32);

/// How mending gets on from round to round.
struct Course {
    /// The best worst measure so far.
    best: f64,
    /// Fewest bad tetrahedra so far.
    fewest: usize,
    /// Rounds without progress.
    idle: usize,
}

impl Course {
    fn new() -> Self {
        Self {
            best: f64::NEG_INFINITY,
            fewest: usize::MAX,
            idle: 0,
        }
    }

    /// Takes note of a round. Progress is a better worst tetrahedron or fewer bad ones.
    fn note(&mut self, worst: f64, bad: usize) {
        if worst > self.best + PROGRESS || bad < self.fewest - self.fewest / FEWER {
            self.idle = 0;
        } else {
            self.idle += 1;
        }
        self.fewest = self.fewest.min(bad);
        self.best = self.best.max(worst);
    }
}

impl Optimiser<'_> {
    /// Optimises until no tetrahedron is below `goal` or nothing helps any more.
    pub(super) fn run(&mut self, goal: f64) {
        self.enough = ENOUGH * goal;
        self.collapse_micro();
        let off = self.off(|_| true);
        let live: Vec<u32> = self.complex.live().collect();
        let poor: Vec<u32> = live
            .into_par_iter()
            .with_min_len(CHUNK)
            .filter(|&t| self.measure(t) < self.enough)
            .collect();
        let mut is_near = vec![false; self.complex.points.len()];
        for &t in &poor {
            for v in self.complex.tets[t as usize] {
                is_near[v as usize] = true;
            }
        }
        self.suspects = poor;
        self.complex.log = Some(Vec::new());
        let near: Vec<u32> = (0..is_near.len() as u32)
            .filter(|&v| is_near[v as usize])
            .collect();
        // From here on, what is touched may have become off the surface or come onto it.
        self.clock = 1;
        self.smooth(&near);
        self.make_room(&off);
        self.first_off = off;
        self.mend_all(goal, ROUNDS);
    }

    /// Mends tetrahedra below `goal` in rounds, with moves of the vertices around them.
    pub(super) fn mend_all(&mut self, goal: f64, rounds: usize) {
        let mut course = Course::new();
        for round in 0..rounds {
            let bad = self.bad(goal);
            let Some(&(worst, _)) = bad.first() else {
                return;
            };
            if self.control.is_stopped() {
                return;
            }
            let Some(mended) = self.mend_round(&bad, goal, round) else {
                return;
            };
            let around = self.wide_surroundings(&bad);
            let moved = self.smooth(&around);
            course.note(worst, bad.len());
            if course.idle >= IDLE || (mended == 0 && moved == 0) {
                return;
            }
        }
    }

    /// The tetrahedra below `goal`, worst first.
    fn bad(&mut self, goal: f64) -> Vec<Bad> {
        let mut suspects = std::mem::take(&mut self.suspects);
        if let Some(log) = &mut self.complex.log {
            suspects.append(log);
        }
        suspects.par_sort_unstable();
        suspects.dedup();
        suspects.retain(|&t| self.complex.is_there(t));
        let mut bad: Vec<Bad> = suspects
            .par_iter()
            .with_min_len(CHUNK)
            .map(|&t| (self.measure(t), t))
            .filter(|b| b.0 < goal)
            .collect();
        self.suspects.extend(bad.iter().map(|b| b.1));
        bad.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        bad
    }

    /// Tries to mend each tetrahedron once. Returns how many were; none on a stop.
    fn mend_round(&mut self, bad: &[Bad], goal: f64, round: usize) -> Option<usize> {
        // Insertions are for what is left over; where much is bad they only make more of it.
        let insertions =
            round >= INSERT_FROM && bad.len() < MANY.max(self.complex.tets.len() / MANY_OF);
        self.clock += 1;
        self.tried.resize(self.complex.tets.len(), 0);
        if round == INSERT_FROM {
            self.tried.fill(0);
        }
        let mut done = 0;
        for (k, &(_, t)) in bad.iter().enumerate() {
            if k.is_multiple_of(LOOK) && self.control.is_stopped() {
                return None;
            }
            if !self.complex.is_there(t) || self.measure(t) >= goal || self.was_in_vain(t) {
                continue;
            }
            let v = self.complex.tets[t as usize];
            if self.mend(t, insertions) {
                done += 1;
                for k in v {
                    self.touched[k as usize] = self.clock;
                }
            } else if self.complex.tets[t as usize] == v {
                self.tried[t as usize] = self.clock;
            }
            if self.tried.len() < self.complex.tets.len() {
                self.tried.resize(self.complex.tets.len(), 0);
            }
        }
        Some(done)
    }

    /// Whether a tetrahedron was tried, and nothing was touched since.
    fn was_in_vain(&self, t: u32) -> bool {
        let tried = self.tried[t as usize];
        let mut vertices = self.complex.tets[t as usize].iter();
        tried > 0 && vertices.all(|&k| self.touched[k as usize] < tried)
    }

    /// The vertices of all tetrahedra around the bad ones.
    fn wide_surroundings(&mut self, bad: &[Bad]) -> Vec<u32> {
        let there = bad.iter().filter(|b| self.complex.is_there(b.1));
        let near = there.flat_map(|b| self.complex.tets[b.1 as usize]);
        let near = unique(near.collect());
        self.complex.vertices_around(&near)
    }

    /// Tries everything on a bad tetrahedron; returns whether something was done.
    fn mend(&mut self, t: u32, insertions: bool) -> bool {
        match self.best_remedy(t) {
            Some(remedy) => self.try_remedy(t, remedy, true).is_some(),
            None => insertions && self.insert_at_longest(t),
        }
    }

    /// What leaves the best worst measure, of all that improves it; of equals the first.
    fn best_remedy(&mut self, t: u32) -> Option<Remedy> {
        let v = self.complex.tets[t as usize];
        let pull = |i: usize, j: usize| Remedy::Collapse(Pull { u: v[i], w: v[j] });
        let edges = EDGES.map(|(i, j)| Remedy::Edge([v[i], v[j]]));
        let faces = [0, 1, 2, 3].map(Remedy::Face);
        let collapses = EDGES.map(|(i, j)| [pull(i, j), pull(j, i)]);
        let mut best: Option<(f64, Remedy)> = None;
        for remedy in edges
            .into_iter()
            .chain(faces)
            .chain(collapses.into_iter().flatten())
        {
            if let Some(q) = self.try_remedy(t, remedy, false)
                && best.is_none_or(|b| q > b.0)
            {
                best = Some((q, remedy));
            }
        }
        best.map(|b| b.1)
    }

    /// The worst measure after the remedy, if it improves that; done if `apply` is set.
    fn try_remedy(&mut self, t: u32, remedy: Remedy, apply: bool) -> Option<f64> {
        match remedy {
            Remedy::Edge(ends) => self.remove_edge(t, ends, apply),
            Remedy::Face(i) => self.remove_face(t, i, apply),
            Remedy::Collapse(pull) => self.collapse(t, pull, None, apply),
        }
    }

    /// Inserts a vertex at one of the longest edges of a tetrahedron.
    fn insert_at_longest(&mut self, t: u32) -> bool {
        let v = self.complex.tets[t as usize];
        let mut edges = EDGES.map(|(i, j)| {
            let [p, q] = self.points_of([v[i], v[j]]);
            let d = sub(p, q);
            (dot(d, d), [v[i], v[j]])
        });
        edges.sort_by(|a, b| b.0.total_cmp(&a.0));
        edges.iter().take(TRIED).any(|&(_, ends)| self.insert(ends))
    }
}
