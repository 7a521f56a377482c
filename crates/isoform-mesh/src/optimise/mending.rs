//! Mending of bad tetrahedra in rounds, worst first, by the operation that helps most.

use super::collapses::Pull;
use super::{OPERATIONS_PER_STOP_CHECK, Optimiser};
use crate::complex::EDGES;
use crate::points::unique;
use isoform_geom::{dot, sub};
use rayon::prelude::*;

/// Factor of the goal above which a measure is good enough: vertices move only next to worse
/// tetrahedra, and moves end there. The worst tetrahedra count, and most of the others are good from
/// the start.
const ENOUGH_GOAL_FACTOR: f64 = 1.25;
/// First round in which vertices are inserted: flips and collapses come first.
const FIRST_INSERTION_ROUND: usize = 3;

/// An operation that may mend a tetrahedron.
#[derive(Clone, Copy)]
enum Remedy {
    Edge([u32; 2]),
    Face(usize),
    Collapse(Pull),
}

/// A tetrahedron with its measure.
type MeasuredTet = (f64, u32);

/// Progress of mending from round to round.
struct MendingProgress {
    /// Best worst measure so far.
    best: f64,
    /// Minimum number of bad tetrahedra so far.
    fewest: usize,
    /// Number of rounds without progress.
    idle: usize,
}

impl MendingProgress {
    fn new() -> Self {
        Self {
            best: f64::NEG_INFINITY,
            fewest: usize::MAX,
            idle: 0,
        }
    }

    /// Records a round. Progress is a better worst tetrahedron or fewer bad ones.
    fn note(&mut self, worst: f64, bad: usize) {
        // A better worst tetrahedron, or 2 % fewer bad ones.
        if worst > self.best + 1e-4 || bad < self.fewest - self.fewest / 50 {
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
        self.enough = ENOUGH_GOAL_FACTOR * goal;
        self.collapse_micro();
        let off = self.off(|_| true);
        let live: Vec<u32> = self.complex.live().collect();
        let poor: Vec<u32> = live
            .into_par_iter()
            .with_min_len(1024)
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
        // From here on, touched vertices may have left the surface or come onto it.
        self.clock = 1;
        self.smooth(&near);
        self.make_room(&off);
        self.first_off = off;
        self.mend_all(goal, 30);
    }

    /// Mends tetrahedra below `goal` in rounds, with moves of the vertices around them.
    pub(super) fn mend_all(&mut self, goal: f64, rounds: usize) {
        let mut course = MendingProgress::new();
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
            if course.idle >= 4 || (mended == 0 && moved == 0) {
                return;
            }
        }
    }

    /// Returns the tetrahedra below `goal`, worst first.
    fn bad(&mut self, goal: f64) -> Vec<MeasuredTet> {
        let mut suspects = std::mem::take(&mut self.suspects);
        if let Some(log) = &mut self.complex.log {
            suspects.append(log);
        }
        suspects.par_sort_unstable();
        suspects.dedup();
        suspects.retain(|&t| self.complex.is_there(t));
        let mut bad: Vec<MeasuredTet> = suspects
            .par_iter()
            .with_min_len(1024)
            .map(|&t| (self.measure(t), t))
            .filter(|b| b.0 < goal)
            .collect();
        self.suspects.extend(bad.iter().map(|b| b.1));
        bad.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        bad
    }

    /// Tries to mend each tetrahedron once. Returns the number of successes; `None` on a stop.
    fn mend_round(&mut self, bad: &[MeasuredTet], goal: f64, round: usize) -> Option<usize> {
        // Insertions are for the remaining few; where many tetrahedra are bad they only add more.
        let insertions = round >= FIRST_INSERTION_ROUND
            && bad.len() < 200usize.max(self.complex.tets.len() / 200);
        self.clock += 1;
        self.tried.resize(self.complex.tets.len(), 0);
        if round == FIRST_INSERTION_ROUND {
            self.tried.fill(0);
        }
        let mut done = 0;
        for (k, &(_, t)) in bad.iter().enumerate() {
            if k.is_multiple_of(OPERATIONS_PER_STOP_CHECK) && self.control.is_stopped() {
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

    /// Returns true if a tetrahedron was tried, and nothing was touched since.
    fn was_in_vain(&self, t: u32) -> bool {
        let tried = self.tried[t as usize];
        let mut vertices = self.complex.tets[t as usize].iter();
        tried > 0 && vertices.all(|&k| self.touched[k as usize] < tried)
    }

    /// Returns the vertices of all tetrahedra around the bad ones.
    fn wide_surroundings(&mut self, bad: &[MeasuredTet]) -> Vec<u32> {
        let there = bad.iter().filter(|b| self.complex.is_there(b.1));
        let near = there.flat_map(|b| self.complex.tets[b.1 as usize]);
        let near = unique(near.collect());
        self.complex.vertices_around(&near)
    }

    /// Tries all operations on a bad tetrahedron. Returns true if one was applied.
    fn mend(&mut self, t: u32, insertions: bool) -> bool {
        match self.best_remedy(t) {
            Some(remedy) => self.try_remedy(t, remedy, true).is_some(),
            None => insertions && self.insert_at_longest(t),
        }
    }

    /// Returns the operation that leaves the best worst measure, of all that improve it; of equals
    /// the first.
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

    /// Returns the worst measure after an operation; `None` if it does not improve. Applies it if
    /// `apply` is set.
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
        edges.iter().take(4).any(|&(_, ends)| self.insert(ends))
    }
}
