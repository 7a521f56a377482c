//! Refinement: edges and triangles are split until all are near the surface, W keeps its sign on
//! them, and no two edges coincide in space.

use super::shape::MIN_NORMAL_COSINE;
use super::step_counter::StepCounter;
use super::{Measure, Plane, RefinementDefects, SPLIT_EXCESS, Shared};
use crate::mesh::geometry::{distance, longest};
use crate::mesh::names::Node;
use isoform_control::{Control, Stopped};
use std::collections::BTreeMap;

/// Excess of an edge whose ends, or the corners opposite to it, have one image: the surface would
/// be closed up there.
const PINCHED_EXCESS: f64 = 1.5;
/// Maximum number of triangles that one split adds: two, and those left to be split by flips.
const MAX_ADDED_TRIANGLES: usize = 4;

/// Request of a triangle to be split.
struct SplitRequest {
    /// Corner opposite to the edge to be split; `None` for a vertex in the middle of the triangle.
    edge: Option<usize>,
    /// True if the only reason is that the triangle has a wrong orientation in space.
    only_turned: bool,
}

impl Plane {
    /// Splits edges until all triangles are near the surface and W keeps its sign on them, or there
    /// are too many: then some remain in the queue.
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
    /// Returns true if triangles remain to be split.
    pub(in crate::mesh) fn is_waiting(&self) -> bool {
        !self.queue.is_empty()
    }
    /// Continues the refinement with a higher limit on triangles, improves their shapes, and
    /// separates edges that coincide in space.
    pub(in crate::mesh) fn refine(
        &mut self,
        most: usize,
        measure: &dyn Measure,
        control: &Control<'_>,
    ) -> RefinementDefects {
        self.work_off(most, false, measure, control);
        // Four rounds of improvement.
        for _ in 0..4 {
            if self.ended != RefinementDefects::default()
                || control.is_stopped()
                || self.coarsen(measure) + self.smooth(measure) == 0
            {
                break;
            }
            self.legalise_all(measure);
            self.work_off(most, false, measure, control);
        }
        self.tell_apart(most, measure, control)
    }
    /// Splits edges that coincide in space.
    pub(super) fn tell_apart(
        &mut self,
        most: usize,
        measure: &dyn Measure,
        control: &Control<'_>,
    ) -> RefinementDefects {
        let left = self.split_clashes(most, measure, control);
        debug_assert_eq!(self.fault(), None);
        RefinementDefects {
            clashes: left.unwrap_or(0),
            is_stopped: left.is_err(),
            ..self.ended
        }
    }
    /// Splits edges that coincide in space, in at most twelve rounds. Returns the number of
    /// coincident edges that remain.
    fn split_clashes(
        &mut self,
        most: usize,
        measure: &dyn Measure,
        control: &Control<'_>,
    ) -> Result<usize, Stopped> {
        let mut clashes = self.clashes(control)?;
        for _ in 0..12 {
            if clashes.is_empty() || self.ended != RefinementDefects::default() {
                break;
            }
            self.split_all(clashes, measure, control)?;
            self.work_off(most, false, measure, control);
            clashes = self.clashes(control)?;
        }
        Ok(clashes.len())
    }
    /// Splits edges given by their ends, in the order of a triangle that has them.
    fn split_all(
        &mut self,
        edges: Vec<[u32; 2]>,
        measure: &dyn Measure,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        for edge in edges {
            // Each search goes through all triangles.
            control.check()?;
            let found = (0..self.triangles.len() as u32).find_map(|t| {
                let i = (0..3).find(|&i| self.ends(t, i) == edge)?;
                Some((t, i))
            });
            if let Some((t, i)) = found.filter(|&(t, i)| !self.fixed[t as usize][i]) {
                self.split_edge(t, i, measure);
            }
        }
        Ok(())
    }

    /// Splits the triangles in the queue. Above the limit on triangles, they stay in the queue if
    /// `waits`, or are given up.
    pub(super) fn work_off(
        &mut self,
        most: usize,
        waits: bool,
        measure: &dyn Measure,
        control: &Control<'_>,
    ) {
        let mut steps = 0usize;
        let counter = StepCounter::new(control);
        // Flips queue triangles again, which might not end.
        let most_steps = most.saturating_mul(20);
        while let Some(t) = self.queue.pop_front() {
            self.queued[t as usize] = false;
            steps += 1;
            let late = counter.is_over();
            if self.triangles.len() + MAX_ADDED_TRIANGLES <= most && self.split_bulge(t, measure) {
                continue;
            }
            let Some(request) = self.request(t, measure) else {
                continue;
            };
            let is_full =
                self.triangles.len() + MAX_ADDED_TRIANGLES > most || steps > most_steps || late;
            if is_full && waits {
                self.queue.push_front(t);
                self.queued[t as usize] = true;
                return;
            }
            let sound = self.sound[t as usize];
            if is_full || !self.split_as_requested(t, &request, measure) {
                // A triangle that only has a wrong orientation is as near to the surface as
                // required.
                self.ended.unsound += usize::from(!sound);
                self.ended.coarse += usize::from(sound && (is_full || !request.only_turned));
            }
        }
    }
    /// Splits an edge of a triangle that is a chord of a contracted curve with too large a bulge.
    /// Returns false if there is none, or if room is lacking.
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
    /// Splits a triangle as requested. Returns false if room is lacking.
    fn split_as_requested(
        &mut self,
        t: u32,
        request: &SplitRequest,
        measure: &dyn Measure,
    ) -> bool {
        match request.edge {
            Some(i) if self.fixed[t as usize][i] => self.split_rim(t, i, measure),
            Some(i) => self.split_edge(t, i, measure),
            None => self.split_triangle(t, measure),
        }
    }

    /// Returns the request of a triangle to be split, if it has one.
    fn request(&self, t: u32, measure: &dyn Measure) -> Option<SplitRequest> {
        if let Some((_, i)) = self.worst_edge(t, measure).filter(|w| w.0 > SPLIT_EXCESS) {
            return Some(SplitRequest {
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
            // At a cusp of the surface no size is small enough.
            longest(p) > 0.01 * measure.longest()
                && self.is_thick(v, 1e-6)
                && shape.facing < MIN_NORMAL_COSINE
        };
        if sound && !is_far && !is_turned() {
            return None;
        }
        // The longest edge: in the parameters for the sign, in space for the distance.
        let length = |i: usize| match sound {
            true => distance(p[(i + 1) % 3], p[(i + 2) % 3]),
            false => self.length(t, i),
        };
        let free = (0..3).filter(|&i| !self.fixed[t as usize][i] || self.is_rim(t, i));
        Some(SplitRequest {
            edge: free.max_by(|&i, &j| length(i).total_cmp(&length(j))),
            only_turned: sound && !is_far,
        })
    }
    /// Returns the excess and the index of the edge of a triangle with the largest excess.
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
                excess = excess.max(PINCHED_EXCESS);
            }
            if worst.is_none_or(|w| excess > w.0) {
                worst = Some((excess, i));
            }
            // Splitting that edge would leave two with an equal defect: an edge that leads to the
            // corner is split.
            let beside = [(i + 1) % 3, (i + 2) % 3]
                .into_iter()
                .filter(|&k| !fixed[k]);
            if self.have_one_image([v[i], far])
                && worst.is_none_or(|w| w.0 < PINCHED_EXCESS)
                && let Some(k) =
                    beside.max_by(|&j, &k| self.length(t, j).total_cmp(&self.length(t, k)))
            {
                worst = Some((PINCHED_EXCESS, k));
            }
        }
        worst
    }

    /// Returns edges from a vertex to two others that have one image; they would be one edge with
    /// four triangles in space.
    fn clashes(&self, control: &Control<'_>) -> Result<Vec<[u32; 2]>, Stopped> {
        let counter = StepCounter::new(control);
        let mut found = Vec::new();
        for (c, near) in self.neighbours_with_images(&counter)? {
            for (k, &v) in near.shared.iter().enumerate() {
                counter.check()?;
                let is_same = |u: u32| self.have_one_image([u, v]);
                let before = near.shared[..k].iter().copied().filter(|&u| is_same(u));
                let is_apart = |u: u32| counter.is_over() || !near.are_joined(u, v);
                if !before.clone().any(is_apart) || is_same(c) {
                    continue;
                }
                // Through a chain of adjacent ones the surface is closed up, as required.
                let others: Vec<u32> = before.chain([v]).collect();
                if !near.reaches(&others, &counter)? {
                    found.extend(others.iter().flat_map(|&u| [[c, u], [u, c]]));
                }
            }
        }
        found.sort_unstable();
        found.dedup();
        Ok(found)
    }
    /// Returns the neighbours with shared images of each vertex. Vertices of the double curve have
    /// none: edges between them may coincide, and others are split anyway.
    fn neighbours_with_images(
        &self,
        counter: &StepCounter<'_>,
    ) -> Result<BTreeMap<u32, Neighbours>, Stopped> {
        let mut around: BTreeMap<u32, Neighbours> = BTreeMap::new();
        for t in &self.triangles {
            counter.check()?;
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
        Ok(around)
    }
}

/// Neighbours of a vertex that have shared images.
#[derive(Default)]
struct Neighbours {
    shared: Vec<u32>,
    /// Pairs of neighbours with one image that are adjacent around the vertex.
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
    /// Returns true if a chain of adjacent pairs leads from the first of some neighbours to the
    /// last.
    fn reaches(&self, others: &[u32], counter: &StepCounter<'_>) -> Result<bool, Stopped> {
        let mut reached = vec![others[0]];
        // A stop is noticed in the loop, which then ends at once.
        let next = |reached: &[u32]| {
            let joins = |u: u32| move |&r: &u32| counter.is_over() || self.are_joined(u, r);
            let near = |u: u32| !reached.contains(&u) && reached.iter().any(joins(u));
            others
                .iter()
                .copied()
                .find(|&u| counter.is_over() || near(u))
        };
        while let Some(next) = next(&reached) {
            counter.check()?;
            reached.push(next);
        }
        Ok(reached.contains(&others[others.len() - 1]))
    }
}
