//! Noise simulated at random points of the surface, and its effect on the fit.

use super::moves::NormalSequence;
use super::{BiasProblem, NoiseSums};
use crate::vector::add;
use isoform_geom::{Foot, Point3};
use rayon::prelude::*;

/// A simulated point with its weight.
struct NoisyPoint {
    at: Point3,
    weight: f64,
    place: u32,
}

/// Sums over a block of the simulated points.
struct BlockSums {
    /// Pulls by sample of the surface.
    rows: Vec<(u32, Vec<f64>)>,
    /// Weighted sum of squared distances.
    squares: f64,
    weights: f64,
}

impl BlockSums {
    /// Returns the pull of a sample, which is the last one or follows it.
    fn row(&mut self, place: u32, m: usize) -> &mut [f64] {
        if self.rows.last().is_none_or(|(last, _)| *last != place) {
            self.rows.push((place, vec![0.0; m]));
        }
        &mut self.rows.last_mut().expect("just pushed").1
    }
}

impl BiasProblem<'_> {
    /// Adds the effect of simulated noise at samples of the surface.
    pub(super) fn simulated(
        &self,
        a: &[f64],
        places: &[Foot],
        density: &[f64],
        sums: &mut NoiseSums,
    ) {
        if places.is_empty() {
            return;
        }
        let noisy = self.noisy(places, density);
        let m = self.space.len();
        let pieces: Vec<BlockSums> = noisy
            // The length of a block is fixed: sums do not depend on the number of threads.
            .par_chunks(2048)
            .map(|piece| self.sums(a, piece))
            .collect();
        // Blocks may split the points of a sample.
        let mut rows = vec![0.0; places.len() * m];
        for piece in &pieces {
            sums.squares += piece.squares;
            sums.weights += piece.weights;
            for (place, row) in &piece.rows {
                let at = *place as usize * m;
                add(&mut rows[at..at + m], row);
            }
        }
        rows.chunks_exact(m).for_each(|row| sums.add(row));
    }

    /// Draws noisy points at samples of the surface, one to eight sets of six each, some 16,000 in
    /// all.
    fn noisy(&self, places: &[Foot], density: &[f64]) -> Vec<NoisyPoint> {
        let sets = ((1 << 14) / (6 * places.len())).clamp(1, 8);
        let mut noisy = Vec::with_capacity(6 * sets * places.len());
        let mut moves = NormalSequence::new(self.seed);
        for (row, (place, density)) in places.iter().zip(density).enumerate() {
            for by in (0..sets).flat_map(|_| moves.next()) {
                let by = self.frame.turned(by.map(|v| self.noise * v));
                noisy.extend([1.0, -1.0].map(|sign| NoisyPoint {
                    at: std::array::from_fn(|i| place.at[i] + sign * by[i]),
                    weight: density / (6 * sets) as f64,
                    place: row as u32,
                }));
            }
        }
        noisy
    }

    /// Sums Jᵀr by sample over some simulated points.
    fn sums(&self, a: &[f64], noisy: &[NoisyPoint]) -> BlockSums {
        let (n, m) = (self.distance.dim(), self.space.len());
        let points: Vec<Point3> = noisy.iter().map(|p| p.at).collect();
        let (mut r, mut jac) = (vec![0.0; points.len()], vec![0.0; points.len() * n]);
        self.distance.jacobian(&points, a, &mut r, &mut jac);
        let mut out = BlockSums {
            rows: Vec::new(),
            squares: 0.0,
            weights: 0.0,
        };
        for ((p, r), jac) in noisy.iter().zip(&r).zip(jac.chunks_exact(n)) {
            if !r.is_finite() {
                continue;
            }
            out.squares += p.weight * r * r;
            out.weights += p.weight;
            let pull = p.weight * self.weight(*r) * r;
            for (k, v) in out.row(p.place, m).iter_mut().enumerate() {
                *v += pull * self.space.derivative(k, jac);
            }
        }
        out
    }
}
