//! Rounder triangles: vertices that are moved.

use super::collapsing::Star;
use super::{Measure, NONE, Plane, SPLIT, Shape};
use crate::surface::Point3;

/// The sine of the smallest angle below which vertices are moved: with a larger one triangles get
/// rounder, but there are more of them.
const THIN_IN_SPACE: f64 = 0.03;
/// The factor by which the thinnest triangle has to get rounder for a vertex to be moved.
const BETTER: f64 = 1.1;
/// The growth of its quality that is asked for where that is not positive.
const BEYOND_ROUNDING: f64 = 1e-3;
/// The shares of the way that are tried.
const SHARES: [f64; 3] = [1.0, 0.5, 0.2];

impl Plane {
    /// Moves vertices of thin triangles to where the thinnest around them gets better: towards the
    /// middle of their neighbours, in space or in the parameters. Points that lie nearly on one
    /// line leave no room for flips otherwise. Returns how many.
    pub(super) fn smooth(&mut self, measure: &dyn Measure) -> usize {
        let (at, free) = self.inner_vertices();
        let mut done = 0;
        for v in 0..self.nodes.len() as u32 {
            if free[v as usize]
                && at[v as usize] != NONE
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
    /// Moves a vertex, if its triangles are thin. False if it stays where it is.
    fn smooth_one(&mut self, v: u32, star: &Star, measure: &dyn Measure) -> bool {
        let before = self.least_quality(star, measure);
        if before >= THIN_IN_SPACE {
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
            .all(|(new, old)| *new <= old.max(SPLIT))
            && star
                .triangles
                .iter()
                .all(|&t| measure.is_sound(self.corners(t)));
        if !is_fine {
            self.put(v, old, measure);
        }
        is_fine
    }
    /// Of the places that a vertex might go to the one where the thinnest triangle is best, if that
    /// is better than it was. The vertex is left at one of them.
    fn best_place(
        &mut self,
        v: u32,
        star: &Star,
        before: f64,
        measure: &dyn Measure,
    ) -> Option<[f64; 2]> {
        let old = self.nodes[v as usize].at;
        let mut least = match before > 0.0 {
            true => BETTER * before,
            false => before + BEYOND_ROUNDING,
        };
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
    /// The largest excess of the edges and triangles at a vertex.
    fn wants(&self, v: u32, star: &Star, measure: &dyn Measure) -> Vec<f64> {
        let n = star.ring.len();
        let shapes: Vec<Shape> = star
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
    /// The least quality of triangles; some number up to `enough` if it is no more than that.
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
    /// The places that a vertex might go to.
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
