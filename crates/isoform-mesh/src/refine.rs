//! Local refinement: the lattice is bisected before it is cut.
//!
//! Longest edges are bisected first, and where a tetrahedron around the edge has a longer one, that
//! one before it (Rivara, 1984). The tetrahedra of the body-centred cubic lattice then fall into
//! only three similarity classes, none with an angle below 45°, and neighbours differ in size by at
//! most a step or two.

mod curvature;
mod hidden;

pub(crate) use curvature::{curvature, turn_size};

use crate::complex::{Complex, Ring};
use crate::points::midpoint;
use isoform_control::Control;
use isoform_geom::{KdTree, Point3};
use rayon::prelude::*;
use std::collections::VecDeque;

/// Ratio of lengths up to which they count as equal: halves of lattice edges are exact up to
/// rounding.
const LENGTH_TOLERANCE_FACTOR: f64 = 1.0 + 1e-9;
/// Minimum number of tetrahedra that a thread processes at once.
const MIN_TETS_PER_TASK: usize = 1024;

/// Lattice around the surface while it is bisected.
pub(crate) struct Refiner<'c> {
    pub(crate) complex: Complex,
    /// True for vertices whose edges to each other are not bisected.
    pub(crate) frozen: Vec<bool>,
    /// Number of slots of the complex above which bisection ends.
    pub(crate) limit: usize,
    pub(crate) control: &'c Control<'c>,
}

/// Returns the longest edge of a tetrahedron and its length; among equally long ones that with the
/// lowest vertices, so that neighbours choose alike.
fn longest(complex: &Complex, t: u32) -> (f64, [u32; 2]) {
    let mut best = (0.0, [0, 0]);
    for ends in complex.edges(t) {
        let l = complex.edge_length(ends[0], ends[1]);
        if l > best.0 * LENGTH_TOLERANCE_FACTOR
            || (l * LENGTH_TOLERANCE_FACTOR > best.0 && best.1 > ends)
        {
            best = (l, ends);
        }
    }
    best
}

impl Refiner<'_> {
    /// Bisects tetrahedra until the longest edge of each is at most the length that `wanted`
    /// returns for it (evaluated anew for the halves). Returns true if it ended at the limit; a
    /// stop also ends it.
    pub(crate) fn bisect(&mut self, mut wanted: impl FnMut(&Complex, u32) -> f64) -> bool {
        let mut queue: VecDeque<u32> = self.complex.live().collect();
        let (mut ring, mut made) = (Ring::default(), Vec::new());
        let mut looked = 0usize;
        while let Some(t) = queue.pop_front() {
            looked += 1;
            // Checks some milliseconds apart if all tetrahedra are bisected: fewer make a stop
            // wait, more cost time.
            if looked.is_multiple_of(256) && self.control.is_stopped() {
                return false;
            }
            let complex = &self.complex;
            if !complex.is_there(t)
                || longest(complex, t).0 <= wanted(complex, t) * LENGTH_TOLERANCE_FACTOR
            {
                continue;
            }
            if complex.tets.len() > self.limit {
                return true;
            }
            // Chains of ever longer edges never exceed a few in a lattice.
            let mut steps = 64;
            while let Some(m) = self.halve_longest_near(t, &mut steps, &mut ring, &mut made) {
                queue.extend(&made);
                if !self.complex.is_there(t) || self.complex.tets[t as usize].contains(&m) {
                    break;
                }
            }
        }
        false
    }

    /// Bisects the longest edge of a tetrahedron, or of one reached from it over ever longer edges,
    /// and returns the new vertex; `None` if both ends are frozen, or `steps` are used up.
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
            let longer = |n: &&u32| longest(complex, **n).0 > length * LENGTH_TOLERANCE_FACTOR;
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

    /// Bisects the edges of tetrahedra near the given points, once. A stop ends it.
    pub(crate) fn bisect_near(&mut self, places: &[Point3]) {
        let places = KdTree::new(places);
        let (complex, control) = (&self.complex, self.control);
        let live: Vec<u32> = complex.live().collect();
        let near: Vec<(u32, f64)> = live
            .into_par_iter()
            .with_min_len(MIN_TETS_PER_TASK)
            .filter(|_| !control.is_stopped())
            .filter_map(|t| {
                let (length, _) = longest(complex, t);
                let (_, d) = places.nearest(complex.middle(t))?;
                (d < length * length).then_some((t, 0.5 * length))
            })
            .collect();
        // Slots are reused by halves, so that target lengths are looked up by position.
        let middles: Vec<Point3> = near.iter().map(|n| complex.middle(n.0)).collect();
        let wanted = KdTree::new(&middles);
        self.bisect(|complex, t| match wanted.nearest(complex.middle(t)) {
            Some((i, d)) if d < near[i].1 * near[i].1 => near[i].1,
            _ => f64::INFINITY,
        });
    }
}
