//! Flips: two triangles are replaced by those at the other diagonal, if these are better.

use super::shape::{EMPTY_QUALITY, TriangleShape, least_sine};
use super::{Measure, Plane, Quad, SPLIT_EXCESS};
use crate::surface::Point3;

/// Ratio by which the quality of triangles has to grow for a flip or a move of a vertex, so that no
/// two changes undo each other.
const MIN_QUALITY_RATIO: f64 = 1.1;

/// Returns the quality above which triangles count as improved, by their quality before.
pub(super) fn least_improved(before: f64) -> f64 {
    match before > 0.0 {
        true => MIN_QUALITY_RATIO * before,
        // The quality of triangles that face a wrong way has to grow by more than rounding.
        false => before + 1e-3,
    }
}

impl Plane {
    /// Flips edges where that makes the triangles rounder in space, starting with those opposite to
    /// given corners.
    pub(super) fn legalise(&mut self, mut stack: Vec<(u32, u32)>, measure: &dyn Measure) {
        let mut left = 100 + 2 * stack.len();
        while let Some((t, corner)) = stack.pop() {
            left -= 1;
            if left == 0 {
                return;
            }
            let Some(i) = self.triangles[t as usize].iter().position(|&v| v == corner) else {
                continue;
            };
            if self.fixed[t as usize][i] {
                continue;
            }
            let n = self.adjacent[t as usize][i];
            if self.flip(t, i, measure) {
                for k in [t, n] {
                    stack.extend(self.triangles[k as usize].map(|v| (k, v)));
                }
            }
        }
    }
    pub(super) fn legalise_all(&mut self, measure: &dyn Measure) {
        let all = (0..self.triangles.len() as u32)
            .flat_map(|t| self.triangles[t as usize].map(|v| (t, v)))
            .collect();
        self.legalise(all, measure);
    }

    /// Returns true if a flip increases the smallest angle of two triangles, by the derivatives at
    /// their centre.
    fn is_rounder(&self, old: [u32; 2], made: [[u32; 3]; 2], measure: &dyn Measure) -> bool {
        let corners = [made[0][0], made[0][1], made[0][2], made[1][2]];
        let center = [0, 1].map(|i| {
            corners
                .map(|v| self.nodes[v as usize].at[i])
                .iter()
                .sum::<f64>()
                / 4.0
        });
        let tangents = measure.tangents(center);
        let linear = |v: u32| -> Point3 {
            let [u, v] = [0, 1].map(|i| self.nodes[v as usize].at[i] - center[i]);
            std::array::from_fn(|k| u * tangents[0][k] + v * tangents[1][k])
        };
        let worst = |triangles: [[u32; 3]; 2]| {
            triangles
                .iter()
                .map(|t| least_sine(t.map(linear)))
                .fold(f64::INFINITY, f64::min)
        };
        worst(made) > MIN_QUALITY_RATIO * worst(old.map(|t| self.triangles[t as usize]))
    }

    /// Returns the triangles at the other diagonal; `None` if they have no area, if the ends of a
    /// diagonal have one image, or if the other diagonal is ambiguous.
    pub(super) fn other_diagonal(&self, quad: &Quad) -> Option<[[u32; 3]; 2]> {
        let [c, a, d, b] = quad.corners;
        let made = [[c, a, d], [c, d, b]];
        let fits = made.iter().all(|&t| self.has_room(t))
            && !self.have_one_image([c, d])
            && !self.have_one_image([a, b])
            && !self.is_ambiguous([c, d]);
        fits.then_some(made)
    }
    /// Returns true if the other diagonal needs to be split, and more than the existing edge.
    pub(super) fn is_coarser(
        &self,
        quad: &Quad,
        were: [TriangleShape; 2],
        will_be: [TriangleShape; 2],
        measure: &dyn Measure,
    ) -> bool {
        let [c, a, d, b] = quad.corners;
        let excess = self.excess([c, d], will_be, measure).0;
        excess > SPLIT_EXCESS && excess > self.excess([a, b], were, measure).0
    }
    /// Replaces two triangles by those at the other diagonal; `sound` is true for each that the
    /// pole curve provably misses.
    pub(super) fn turn(&mut self, t: u32, quad: &Quad, made: [[u32; 3]; 2], sound: [bool; 2]) {
        let n = quad.n;
        let [ca, ad, db, bc] = quad.outer;
        // (c, a, d): opposite c the edge a d, opposite a the new edge, opposite d the edge c a.
        self.set(t, made[0], [ad.0, n, ca.0], [ad.1, false, ca.1]);
        self.set(n, made[1], [db.0, bc.0, t], [db.1, bc.1, false]);
        (self.sound[t as usize], self.sound[n as usize]) = (sound[0], sound[1]);
        self.push(t);
        self.push(n);
    }

    /// Flips the edge opposite to corner i if the smallest angle grows and no bound is violated.
    fn flip(&mut self, t: u32, i: usize, measure: &dyn Measure) -> bool {
        let quad = self.quad(t, i);
        let Some(made) = self.other_diagonal(&quad) else {
            return false;
        };
        let old = [t, quad.n];
        if !self.is_better(old, &quad, made, measure) {
            return false;
        }
        let known = old.map(|t| self.sound[t as usize]);
        let sound = made.map(|t| known == [true; 2] || measure.is_sound(self.places(t)));
        if known != sound && sound != [true; 2] {
            return false;
        }
        self.turn(t, &quad, made, sound);
        true
    }
    /// Returns true if the triangles at the other diagonal are rounder, and the diagonal does not
    /// need to be split more.
    fn is_better(
        &self,
        old: [u32; 2],
        quad: &Quad,
        made: [[u32; 3]; 2],
        measure: &dyn Measure,
    ) -> bool {
        let [c, a, d, b] = quad.corners;
        let were = old.map(|t| self.shape(t, measure));
        let before = were[0].quality.min(were[1].quality);
        // A triangle that covers no surface only has the area between chord and curve, so these are
        // compared by their linearized shape.
        let is_flat = before <= EMPTY_QUALITY
            && ![[c, a], [a, d], [d, b], [b, c]]
                .iter()
                .any(|&e| self.have_one_image(e));
        if is_flat {
            return self.is_rounder(old, made, measure) && {
                let will_be = made.map(|t| self.shape_of(t, measure));
                !self.is_coarser(quad, were, will_be, measure)
            };
        }
        let least = least_improved(before);
        let is_better = |after: f64| after > EMPTY_QUALITY && after > least;
        // Orientation has priority over angles.
        if !made.iter().all(|&t| is_better(self.least_sine(t))) {
            return false;
        }
        let will_be = made.map(|t| self.shape_of(t, measure));
        will_be.iter().all(|shape| is_better(shape.quality))
            && !self.is_coarser(quad, were, will_be, measure)
    }
}
