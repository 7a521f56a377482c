//! Splits: new vertices on edges and in triangles.

use super::shape::{EMPTY_QUALITY, twice_area};
use super::{Measure, NO_TRIANGLE, Plane, Quad};
use crate::mesh::geometry::distance;
use crate::mesh::names::Node;

/// Fractions of the way from an edge towards the larger adjacent triangle at which the edge is
/// split: collinear points would leave no room for flips.
const ASIDE: [f64; 2] = [0.1, 0.02];

impl Plane {
    /// Splits the edge opposite to corner i, in the middle if there is room. Returns false if
    /// rounding leaves no room.
    pub(super) fn split_edge(&mut self, t: u32, i: usize, measure: &dyn Measure) -> bool {
        let quad = self.quad(t, i);
        let [c, a, d, b] = quad.corners;
        let [x, y, p, q] = [a, b, c, d].map(|v| self.nodes[v as usize].at);
        let area = |z: [f64; 2]| twice_area([x, y, z]);
        let toward = if area(p) > area(q) { p } else { q };
        let halfway = [0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1])];
        let best = self.best_split(t, &quad, halfway, measure);
        let places = [
            (best, ASIDE[0]),
            (halfway, ASIDE[0]),
            (halfway, ASIDE[1]),
            (halfway, 0.0),
        ]
        .map(|(from, aside)| [0, 1].map(|i| from[i] * (1.0 - aside) + aside * toward[i]));
        let fitting = self.fitting(&quad, places, measure);
        fitting.is_some_and(|at| self.split_at(t, i, Node::inner(at, 0), measure))
    }
    /// Returns the best place to split an edge, unless a corner next to it is there already.
    fn best_split(
        &self,
        t: u32,
        quad: &Quad,
        halfway: [f64; 2],
        measure: &dyn Measure,
    ) -> [f64; 2] {
        let [c, a, d, b] = quad.corners;
        let shapes = [t, quad.n].map(|t| self.shape(t, measure));
        let best = self.excess([a, b], shapes, measure).1;
        let there = measure.at(best);
        let [p, q, x, y] = [c, d, a, b].map(|v| self.images[v as usize]);
        // Edges are not split close to their ends.
        match distance(there, p).min(distance(there, q)) < 0.25 * distance(x, y) {
            true => halfway,
            false => best,
        }
    }
    /// Returns the first place with room at which every triangle covers a part of the surface, or
    /// else the first one with room.
    fn fitting(
        &mut self,
        quad: &Quad,
        places: [[f64; 2]; 4],
        measure: &dyn Measure,
    ) -> Option<[f64; 2]> {
        let mut fitting = None;
        for at in places {
            let m = self.add(at, measure);
            let made = quad.halves(m);
            let fits = made.iter().all(|&t| self.is_counterclockwise(t));
            let is_good = fits
                && made
                    .iter()
                    .all(|&t| self.shape_of(t, measure).quality > EMPTY_QUALITY);
            self.drop_last();
            if is_good {
                return Some(at);
            }
            if fits && fitting.is_none() {
                fitting = Some(at);
            }
        }
        fitting
    }

    /// Splits the edge opposite to corner i in a new vertex; fixed edges remain fixed. Returns
    /// false if room is lacking.
    pub(super) fn split_at(&mut self, t: u32, i: usize, node: Node, measure: &dyn Measure) -> bool {
        let along = self.fixed[t as usize][i];
        let quad = self.quad(t, i);
        let (n, [ca, ad, db, bc]) = (quad.n, quad.outer);
        let m = self.add_node(node, measure);
        let made = quad.halves(m);
        if !made.iter().all(|&t| self.is_counterclockwise(t)) {
            self.drop_last();
            return false;
        }
        let (t2, n2) = (self.new_triangle(), self.new_triangle());
        // (c, a, m): opposite c: n2 (a m); opposite a: t2 (m c); opposite m: the edge c a.
        self.set(t, made[0], [n2, t2, ca.0], [along, false, ca.1]);
        self.set(t2, made[1], [n, bc.0, t], [along, bc.1, false]);
        self.set(n, made[2], [t2, n2, db.0], [along, false, db.1]);
        self.set(n2, made[3], [t, ad.0, n], [along, ad.1, false]);
        self.prove([t, n], [t, t2, n, n2], measure);
        self.settle_around(m, [t, t2, n, n2], measure);
        true
    }

    /// Inserts a vertex into the centre of a triangle. Returns false if rounding leaves no room.
    pub(super) fn split_triangle(&mut self, t: u32, measure: &dyn Measure) -> bool {
        let at = self.corners(t);
        let middle = [0, 1].map(|i| (at[0][i] + at[1][i] + at[2][i]) / 3.0);
        self.put_into(t, middle, measure)
    }

    /// Inserts a vertex into a triangle. Returns false if rounding leaves no room.
    pub(super) fn put_into(&mut self, t: u32, at: [f64; 2], measure: &dyn Measure) -> bool {
        let [a, b, c] = self.triangles[t as usize];
        let m = self.add(at, measure);
        let made = [[m, b, c], [m, c, a], [m, a, b]];
        if !made.iter().all(|&t| self.is_counterclockwise(t)) {
            self.drop_last();
            return false;
        }
        let (n, f) = (self.adjacent[t as usize], self.fixed[t as usize]);
        let (t2, t3) = (self.new_triangle(), self.new_triangle());
        self.set(t, made[0], [n[0], t2, t3], [f[0], false, false]);
        self.set(t2, made[1], [n[1], t3, t], [f[1], false, false]);
        self.set(t3, made[2], [n[2], t, t2], [f[2], false, false]);
        self.prove([t], [t, t2, t3], measure);
        self.settle_around(m, [t, t2, t3], measure);
        true
    }

    /// Queues new triangles around a new vertex, and flips the edges opposite to it.
    fn settle_around<const N: usize>(&mut self, m: u32, new: [u32; N], measure: &dyn Measure) {
        for k in new {
            self.push(k);
        }
        self.legalise(new.map(|k| (k, m)).to_vec(), measure);
    }

    /// Returns the vertices that were inserted between the ends of an edge of the rim.
    pub(in crate::mesh) fn way(&self, [a, b]: [u32; 2]) -> Vec<u32> {
        let Some(&Some(m)) = self.rim.get(&[a.min(b), a.max(b)]) else {
            return Vec::new();
        };
        let mut way = self.way([a, m]);
        way.push(m);
        way.extend(self.way([m, b]));
        way
    }
    /// Returns true if the edge opposite to corner i belongs to the rim.
    pub(super) fn is_rim(&self, t: u32, i: usize) -> bool {
        let [a, b] = self.ends(t, i);
        self.rim.get(&[a.min(b), a.max(b)]) == Some(&None)
    }
    /// Splits an edge of the rim opposite to corner i. Returns false if rounding leaves no room.
    pub(super) fn split_rim(&mut self, t: u32, i: usize, measure: &dyn Measure) -> bool {
        let [a, b] = self.ends(t, i);
        let [x, y] = [a, b].map(|v| self.nodes[v as usize].at);
        let middle = Node::inner([0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1])], 0);
        let Some(m) = self.split_border(t, i, middle, measure) else {
            return false;
        };
        self.rim.insert([a.min(b), a.max(b)], Some(m));
        self.rim.extend([[a, m], [b, m]].map(|e| (e, None)));
        true
    }
    /// Splits an edge of a single triangle, opposite to corner i, in a new vertex, which is
    /// returned; `None` if room is lacking.
    pub(super) fn split_border(
        &mut self,
        t: u32,
        i: usize,
        node: Node,
        measure: &dyn Measure,
    ) -> Option<u32> {
        let (c, [a, b]) = (self.triangles[t as usize][i], self.ends(t, i));
        let m = self.add_node(node, measure);
        let made = [[c, a, m], [c, m, b]];
        if !made.iter().all(|&t| self.is_counterclockwise(t)) {
            self.drop_last();
            return None;
        }
        let (ca, bc) = (self.beyond(t, i + 2), self.beyond(t, i + 1));
        let t2 = self.new_triangle();
        self.set(t, made[0], [NO_TRIANGLE, t2, ca.0], [true, false, ca.1]);
        self.set(t2, made[1], [NO_TRIANGLE, bc.0, t], [true, bc.1, false]);
        self.prove([t], [t, t2], measure);
        self.settle_around(m, [t, t2], measure);
        Some(m)
    }

    /// Proves that the pole curve misses new triangles, which replace old ones: if it provably
    /// misses these, nothing remains to be proved.
    fn prove<const N: usize, const M: usize>(
        &mut self,
        old: [u32; N],
        new: [u32; M],
        measure: &dyn Measure,
    ) {
        let is_known = old.iter().all(|&t| self.sound[t as usize]);
        for t in new {
            self.sound[t as usize] = is_known || measure.is_sound(self.corners(t));
        }
    }
}
