//! Refinement: edges and triangles are split until all are near the surface, W keeps its sign on
//! them, and no two edges fall together in space.

use super::shape::FACING;
use super::{Ended, Measure, Plane, SPLIT, Shared};
use crate::mesh::geometry::{distance, longest};
use crate::mesh::names::Node;
use isoform_control::Control;
use std::collections::BTreeMap;

/// Rounds of improvement.
const IMPROVEMENTS: usize = 4;
/// Rounds in which edges are split that fall together in space.
const CLASHES: usize = 12;
/// The excess of an edge whose ends, or the corners opposite to it, have one image: the surface
/// would be closed up there.
const PINCHED: f64 = 1.5;
/// The shortest edges, per longest allowed, of triangles that are split because they face a wrong
/// way: where the surface has a cusp no size is small enough.
const LEAST: f64 = 0.01;
/// The least area in the parameters, per square of the longest edge, of triangles that are split
/// because they face a wrong way.
const TURNED: f64 = 1e-6;
/// Triangles that one split may add: two, and those that flips leave to be split.
const MOST_MADE: usize = 4;
/// The most steps per triangle: flips queue triangles anew, and might do so for ever.
const STEPS: usize = 20;
/// The number of steps between two looks at the control.
const BREATH: usize = 256;

/// A wish of a triangle to be split.
struct Wish {
    /// The edge opposite to this corner; none for the middle of the triangle.
    edge: Option<usize>,
    /// Whether it is for nothing but that it faces a wrong way.
    only_turned: bool,
}

impl Plane {
    /// Splits edges until all triangles are near the surface and W keeps its sign on them, or there
    /// are too many: then some are left waiting.
    pub(in crate::mesh) fn begin(
        &mut self,
        most: usize,
        measure: &dyn Measure,
        control: &Control<'_>,
    ) {
        self.thin_contracted(measure);
        self.legalise_all(measure);
        self.work_off(most, true, measure, control);
        debug_assert_eq!(self.fault(), None);
    }
    /// Whether triangles are left to be split.
    pub(in crate::mesh) fn is_waiting(&self) -> bool {
        !self.queue.is_empty()
    }
    /// Goes on with what was begun, with more triangles, makes them rounder, and tells edges apart
    /// that fall together.
    pub(in crate::mesh) fn refine(
        &mut self,
        most: usize,
        measure: &dyn Measure,
        control: &Control<'_>,
    ) -> Ended {
        self.work_off(most, false, measure, control);
        for _ in 0..IMPROVEMENTS {
            if self.ended != Ended::default() || self.coarsen(measure) + self.smooth(measure) == 0 {
                break;
            }
            self.legalise_all(measure);
            self.work_off(most, false, measure, control);
        }
        self.tell_apart(most, measure, control)
    }
    /// Splits edges that fall together in space.
    pub(super) fn tell_apart(
        &mut self,
        most: usize,
        measure: &dyn Measure,
        control: &Control<'_>,
    ) -> Ended {
        for _ in 0..CLASHES {
            let clashes = self.clashes();
            if clashes.is_empty() || self.ended != Ended::default() {
                break;
            }
            self.split_all(clashes, measure);
            self.work_off(most, false, measure, control);
        }
        debug_assert_eq!(self.fault(), None);
        Ended {
            clashes: self.clashes().len(),
            ..self.ended
        }
    }
    /// Splits edges by their ends, in the order of a triangle that has them.
    fn split_all(&mut self, edges: Vec<[u32; 2]>, measure: &dyn Measure) {
        for edge in edges {
            let found = (0..self.triangles.len() as u32).find_map(|t| {
                let i = (0..3).find(|&i| self.ends(t, i) == edge)?;
                Some((t, i))
            });
            if let Some((t, i)) = found.filter(|&(t, i)| !self.fixed[t as usize][i]) {
                self.split_edge(t, i, measure);
            }
        }
    }

    /// Splits what is queued. Where there are too many triangles already, it waits, or is given up.
    pub(super) fn work_off(
        &mut self,
        most: usize,
        waits: bool,
        measure: &dyn Measure,
        control: &Control<'_>,
    ) {
        let mut steps = 0usize;
        let mut late = false;
        while let Some(t) = self.queue.pop_front() {
            self.queued[t as usize] = false;
            steps += 1;
            late |= steps.is_multiple_of(BREATH) && control.is_stopped();
            if self.triangles.len() + MOST_MADE <= most && self.split_bulge(t, measure) {
                continue;
            }
            let Some(wish) = self.wish(t, measure) else {
                continue;
            };
            let is_full = self.triangles.len() + MOST_MADE > most || steps > STEPS * most || late;
            if is_full && waits {
                self.queue.push_front(t);
                self.queued[t as usize] = true;
                return;
            }
            let sound = self.sound[t as usize];
            if is_full || !self.fulfil(t, &wish, measure) {
                // One that only faces a wrong way is as near to the surface as asked for.
                self.ended.unsound += usize::from(!sound);
                self.ended.coarse += usize::from(sound && (is_full || !wish.only_turned));
            }
        }
    }
    /// Splits an edge of a triangle that is a chord of a contracted curve with too large a bulge.
    /// False if none is, or it has no room.
    fn split_bulge(&mut self, t: u32, measure: &dyn Measure) -> bool {
        let bulge = (0..3).find_map(|i| Some((i, self.bulge(t, i, measure)?)));
        bulge.is_some_and(|(i, (at, image))| {
            let node = Node {
                image: Some(image),
                ..Node::inner(at, 0)
            };
            self.split_at(t, i, node, measure)
        })
    }
    /// Splits a triangle. False if there is no room for it.
    fn fulfil(&mut self, t: u32, wish: &Wish, measure: &dyn Measure) -> bool {
        match wish.edge {
            Some(i) if self.fixed[t as usize][i] => self.split_rim(t, i, measure),
            Some(i) => self.split_edge(t, i, measure),
            None => self.split_triangle(t, measure),
        }
    }

    /// The wish of a triangle to be split, if it has one.
    fn wish(&self, t: u32, measure: &dyn Measure) -> Option<Wish> {
        if let Some((_, i)) = self.worst_edge(t, measure).filter(|w| w.0 > SPLIT) {
            return Some(Wish {
                edge: Some(i),
                only_turned: false,
            });
        }
        let (v, p, sound) = (
            self.triangles[t as usize],
            self.images_of(t),
            self.sound[t as usize],
        );
        let shape = self.shape(t, measure);
        let off = self.off(&shape, measure);
        let is_far = off > 1.0 || off.is_nan();
        let is_turned = || {
            longest(p) > LEAST * measure.longest()
                && self.is_thick(v, TURNED)
                && shape.facing < FACING
        };
        if sound && !is_far && !is_turned() {
            return None;
        }
        // The longest edge: of the parameters for the sign, in space for the distance.
        let length = |i: usize| match sound {
            true => distance(p[(i + 1) % 3], p[(i + 2) % 3]),
            false => self.length(t, i),
        };
        let free = (0..3).filter(|&i| !self.fixed[t as usize][i] || self.is_rim(t, i));
        Some(Wish {
            edge: free.max_by(|&i, &j| length(i).total_cmp(&length(j))),
            only_turned: sound && !is_far,
        })
    }
    /// The edge of a triangle that wants to be split most, and how much.
    fn worst_edge(&self, t: u32, measure: &dyn Measure) -> Option<(f64, usize)> {
        let (v, fixed) = (self.triangles[t as usize], self.fixed[t as usize]);
        let mut worst: Option<(f64, usize)> = None;
        for i in (0..3).filter(|&i| !fixed[i]) {
            let n = self.adjacent[t as usize][i];
            let far = self.triangles[n as usize][self.place(n, t)];
            let ends = self.ends(t, i);
            let shapes = [t, n].map(|t| self.shape(t, measure));
            let mut excess = self.excess(ends, shapes, measure).0;
            if self.have_one_image(ends) || self.is_ambiguous(ends) {
                excess = excess.max(PINCHED);
            }
            if worst.is_none_or(|w| excess > w.0) {
                worst = Some((excess, i));
            }
            // Splitting that edge would leave two that are as bad: one that leads to the corner.
            let beside = [(i + 1) % 3, (i + 2) % 3]
                .into_iter()
                .filter(|&k| !fixed[k]);
            if self.have_one_image([v[i], far])
                && worst.is_none_or(|w| w.0 < PINCHED)
                && let Some(k) =
                    beside.max_by(|&j, &k| self.length(t, j).total_cmp(&self.length(t, k)))
            {
                worst = Some((PINCHED, k));
            }
        }
        worst
    }

    /// Edges from a vertex to two others that have one image, which would be one edge with four
    /// triangles in space.
    fn clashes(&self) -> Vec<[u32; 2]> {
        let mut found = Vec::new();
        for (c, near) in self.neighbours_with_images() {
            for (k, &v) in near.shared.iter().enumerate() {
                let is_same = |u: u32| self.have_one_image([u, v]);
                let before = near.shared[..k].iter().copied().filter(|&u| is_same(u));
                if !before.clone().any(|u| !near.are_joined(u, v)) || is_same(c) {
                    continue;
                }
                // Through a chain of joined ones the surface is closed up as it should be.
                let others: Vec<u32> = before.chain([v]).collect();
                if !near.reaches(&others) {
                    found.extend(others.iter().flat_map(|&u| [[c, u], [u, c]]));
                }
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }
    /// The neighbours with shared images of each vertex. Vertices of the double curve have none:
    /// edges between them may fall together, and others are split anyway.
    fn neighbours_with_images(&self) -> BTreeMap<u32, Neighbours> {
        let mut around: BTreeMap<u32, Neighbours> = BTreeMap::new();
        for t in &self.triangles {
            for i in 0..3 {
                let (c, a, b) = (t[i], t[(i + 1) % 3], t[(i + 2) % 3]);
                if matches!(self.shared[c as usize], Some(Shared::Double(_))) {
                    continue;
                }
                for v in [a, b] {
                    if self.shared[v as usize].is_some() {
                        around.entry(c).or_default().add(v);
                    }
                }
                if self.have_one_image([a, b]) {
                    around.entry(c).or_default().joined.push([a, b]);
                }
            }
        }
        around
    }
}

/// The neighbours of a vertex that have shared images.
#[derive(Default)]
struct Neighbours {
    shared: Vec<u32>,
    /// Neighbours with one image that follow each other around the vertex.
    joined: Vec<[u32; 2]>,
}

impl Neighbours {
    fn add(&mut self, v: u32) {
        if !self.shared.contains(&v) {
            self.shared.push(v);
        }
    }
    fn are_joined(&self, u: u32, v: u32) -> bool {
        self.joined.contains(&[u, v]) || self.joined.contains(&[v, u])
    }
    /// Whether a chain of joined ones leads from the first of some neighbours to the last.
    fn reaches(&self, others: &[u32]) -> bool {
        let mut reached = vec![others[0]];
        let next = |reached: &[u32]| {
            let near =
                |u: u32| !reached.contains(&u) && reached.iter().any(|&r| self.are_joined(u, r));
            others.iter().copied().find(|&u| near(u))
        };
        while let Some(next) = next(&reached) {
            reached.push(next);
        }
        reached.contains(&others[others.len() - 1])
    }
}
