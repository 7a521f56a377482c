//! Smaller tetrahedra where they are wanted: the lattice is bisected before it is cut.
//!
//! Longest edges first, and where a tetrahedron around the edge has a longer one, that one before
//! it (Rivara, 1984): the tetrahedra of the body-centred lattice then fall into three classes of
//! shapes only, none worse than 45°, and neighbours differ in size by no more than a step or two.

mod curvature;
mod hidden;

pub(crate) use curvature::{curvature, turn_size};

use crate::complex::{Complex, Ring};
use crate::points::midpoint;
use isoform_control::Control;
use isoform_geom::{KdTree, Point3};
use rayon::prelude::*;
use std::collections::VecDeque;

/// Lengths that differ by less are equal: halves of lattice edges are exact but for rounding.
const SAME: f64 = 1.0 + 1e-9;
/// Tetrahedra looked at between two looks at the clock, some milliseconds where all are bisected.
/// Fewer cost time where none is; more let a stop wait.
const LOOK: usize = 256;
/// Edges that are looked at for one tetrahedron: chains of ever longer ones, until it is halved. In
/// a lattice they never exceed a few.
const CHAIN: usize = 64;
/// Tetrahedra that a thread takes at once.
const CHUNK: usize = 1024;

/// The tetrahedra around the surface while they are bisected.
pub(crate) struct Refiner<'c> {
    pub(crate) complex: Complex,
    /// Vertices that keep their edges to each other.
    pub(crate) frozen: Vec<bool>,
    /// Tetrahedra from which on none is bisected any more.
    pub(crate) limit: usize,
    pub(crate) control: &'c Control<'c>,
}

/// The longest edge of a tetrahedron and its length; of equally long ones that with the lowest
/// vertices, so that neighbours choose the same one.
fn longest(complex: &Complex, t: u32) -> (f64, [u32; 2]) {
    let mut best = (0.0, [0, 0]);
    for ends in complex.edges(t) {
        let l = complex.edge_length(ends[0], ends[1]);
        if l > best.0 * SAME || (l * SAME > best.0 && best.1 > ends) {
            best = (l, ends);
        }
    }
    best
}

impl Refiner<'_> {
    /// Bisects tetrahedra until the longest edge of each is at most what `wanted` says for it
    /// (looked at anew for the halves). Says whether it ended at the limit; a stop ends it, too.
    pub(crate) fn bisect(&mut self, mut wanted: impl FnMut(&Complex, u32) -> f64) -> bool {
        let mut queue: VecDeque<u32> = self.complex.live().collect();
        let (mut ring, mut made) = (Ring::default(), Vec::new());
        let mut looked = 0usize;
        while let Some(t) = queue.pop_front() {
            looked += 1;
            if looked.is_multiple_of(LOOK) && self.control.is_stopped() {
                return false;
            }
            let complex = &self.complex;
            if !complex.is_there(t) || longest(complex, t).0 <= wanted(complex, t) * SAME {
                continue;
            }
            if complex.tets.len() > self.limit {
                return true;
            }
            let mut steps = CHAIN;
            while let Some(m) = self.halve_longest_near(t, &mut steps, &mut ring, &mut made) {
                queue.extend(&made);
                if !self.complex.is_there(t) || self.complex.tets[t as usize].contains(&m) {
                    break;
                }
            }
        }
        false
    }

    /// Halves the longest edge of a tetrahedron, or of one that is reached from it over ever longer
    /// edges, and returns the new vertex; none if both ends are frozen, or `steps` are used up.
    fn halve_longest_near(
        &mut self,
        t: u32,
        steps: &mut usize,
        ring: &mut Ring,
        made: &mut Vec<u32>,
    ) -> Option<u32> {
        let complex = &mut self.complex;
        let mut at = t;
        while *steps > 0 {
            *steps -= 1;
            let (length, [a, b]) = longest(complex, at);
            complex.ring(at, a, b, ring);
            let longer = |n: &&u32| longest(complex, **n).0 > length * SAME;
            if let Some(&longer) = ring.tets.iter().find(longer) {
                at = longer;
                continue;
            }
            if self.frozen[a as usize] && self.frozen[b as usize] {
                return None;
            }
            let [p, q] = complex.points_of([a, b]);
            let m = complex.add_point(midpoint(p, q));
            self.frozen.push(false);
            complex.split(ring, a, b, m, made);
            return Some(m);
        }
        None
    }

    /// Halves the edges of tetrahedra next to the places given. A stop ends it.
    pub(crate) fn bisect_near(&mut self, places: &[Point3]) {
        let places = KdTree::new(places);
        let (complex, control) = (&self.complex, self.control);
        let live: Vec<u32> = complex.live().collect();
        let near: Vec<(u32, f64)> = live
            .into_par_iter()
            .with_min_len(CHUNK)
            .filter(|_| !control.is_stopped())
            .filter_map(|t| {
                let (length, _) = longest(complex, t);
                let (_, d) = places.nearest(complex.middle(t))?;
                (d < length * length).then_some((t, 0.5 * length))
            })
            .collect();
        // Halves take the slots of others: what is wanted goes by place.
        let middles: Vec<Point3> = near.iter().map(|n| complex.middle(n.0)).collect();
        let wanted = KdTree::new(&middles);
        self.bisect(|complex, t| match wanted.nearest(complex.middle(t)) {
            Some((i, d)) if d < near[i].1 * near[i].1 => near[i].1,
            _ => f64::INFINITY,
        });
    }
}
