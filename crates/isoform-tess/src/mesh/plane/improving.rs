//! Smoothing: vertices are moved to make triangles rounder.

use super::collapsing::Star;
use super::flipping::least_improved;
use super::{Measure, NO_TRIANGLE, Plane, SPLIT_EXCESS, TriangleShape};
use crate::surface::Point3;

/// Fractions of a step that are tried.
const SHARES: [f64; 3] = [1.0, 0.5, 0.2];

impl Plane {
    /// Moves vertices of thin triangles to places where the thinnest triangle around them is
    /// better: towards the centre of their neighbours, in space or in the parameters. Points that
    /// are nearly collinear leave no room for flips otherwise. Returns the number of moves.
    pub(super) fn smooth(&mut self, measure: &dyn Measure) -> usize {
        let (at, free) = self.inner_vertices();
        let mut done = 0;
        for v in 0..self.nodes.len() as u32 {
            if free[v as usize]
                && at[v as usize] != NO_TRIANGLE
                && let Some(star) = self.sound_star(at[v as usize], v)
                && self.smooth_one(v, &star, measure)
            {
                for t in star.triangles {
                    self.shapes[t as usize].set(None);
                    self.push(t);
                }
                done += 1;
            }
        }
        done
    }
    /// Moves a vertex if its triangles are thin. Returns false if it stays at its place.
    fn smooth_one(&mut self, v: u32, star: &Star, measure: &dyn Measure) -> bool {
        let before = self.least_quality(star, measure);
        // With a larger bound triangles get rounder, but more vertices are needed.
        if before >= 0.03 {
            return false;
        }
        let old = self.nodes[v as usize].at;
        let best = self.best_place(v, star, before, measure);
        self.put(v, old, measure);
        let Some(to) = best else { return false };
        let wanted = self.wants(v, star, measure);
        self.put(v, to, measure);
        let is_fine = self
            .wants(v, star, measure)
            .iter()
            .zip(&wanted)
            .all(|(new, old)| *new <= old.max(SPLIT_EXCESS))
            && star
                .triangles
                .iter()
                .all(|&t| measure.is_sound(self.corners(t)));
        if !is_fine {
            self.put(v, old, measure);
        }
        is_fine
    }
    /// Returns the candidate place of a vertex at which the thinnest triangle is best, if that is
    /// an improvement. The vertex is left at one of the candidates.
    fn best_place(
        &mut self,
        v: u32,
        star: &Star,
        before: f64,
        measure: &dyn Measure,
    ) -> Option<[f64; 2]> {
        let old = self.nodes[v as usize].at;
        let mut least = least_improved(before);
        let mut best = None;
        for step in self.smoothing(v, &star.ring, measure) {
            for share in SHARES {
                let to = [0, 1].map(|i| old[i] + share * step[i]);
                self.put(v, to, measure);
                let quality = self.quality_up_to(&star.triangles, least, measure);
                if quality > least {
                    (least, best) = (quality, Some(to));
                }
            }
        }
        best
    }
    /// Returns the excess of each edge and triangle at a vertex.
    fn wants(&self, v: u32, star: &Star, measure: &dyn Measure) -> Vec<f64> {
        let n = star.ring.len();
        let shapes: Vec<TriangleShape> = star
            .triangles
            .iter()
            .map(|&t| self.shape_of(self.triangles[t as usize], measure))
            .collect();
        let spoke = |k: usize| {
            let beside = [shapes[k], shapes[(k + n - 1) % n]];
            self.excess([v, star.ring[k]], beside, measure).0
        };
        let off = shapes.iter().map(|shape| self.off(shape, measure));
        (0..n).map(spoke).chain(off).collect()
    }
    fn put(&mut self, v: u32, at: [f64; 2], measure: &dyn Measure) {
        self.nodes[v as usize].at = at;
        self.images[v as usize] = measure.image(&self.nodes[v as usize]);
    }
    /// Returns the minimum quality of triangles, or any value up to `enough` if the minimum is not
    /// larger.
    fn quality_up_to(&self, star: &[u32], enough: f64, measure: &dyn Measure) -> f64 {
        let mut least = f64::INFINITY;
        for &t in star {
            let t = self.triangles[t as usize];
            if !self.has_room(t) {
                return f64::NEG_INFINITY;
            }
            least = least.min(self.least_sine(t));
            if least > enough {
                least = least.min(self.shape_of(t, measure).quality);
            }
            if least <= enough {
                return least;
            }
        }
        least
    }
    /// Returns the steps from a vertex to its candidate places.
    fn smoothing(&self, v: u32, ring: &[u32], measure: &dyn Measure) -> Vec<[f64; 2]> {
        let from = self.nodes[v as usize].at;
        let share = 1.0 / ring.len() as f64;
        let at = |w: &u32| self.nodes[*w as usize].at;
        let image = |w: &u32| self.images[*w as usize];
        let mean: Point3 = std::array::from_fn(|i| ring.iter().map(|w| share * image(w)[i]).sum());
        let center = [0, 1].map(|i| ring.iter().map(|w| share * at(w)[i]).sum::<f64>() - from[i]);
        measure
            .step(from, mean)
            .into_iter()
            .chain([center])
            .collect()
    }
}
