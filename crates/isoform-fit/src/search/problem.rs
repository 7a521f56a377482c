//! The data of a search, and its starts.

use super::minima::{SearchMinimum, SearchOutcome};
use crate::bounds::Bounds;
use crate::shuffle::shuffle;
use crate::space::Space;
use crate::{Control, Options, Template};
use isoform_geom::Point3;

/// Number of starts per Latin hypercube.
const CUBE_STARTS: usize = 16;

/// Data of a search.
pub(crate) struct MinimumSearch<'a> {
    pub(crate) template: &'a dyn Template,
    pub(crate) space: &'a Space,
    pub(crate) points: &'a [Point3],
    pub(crate) options: &'a Options,
    pub(crate) control: &'a Control<'a>,
}

impl MinimumSearch<'_> {
    /// Returns start i of the seeded Latin hypercubes: three of four are drawn from the ranges that
    /// the data suggest, one from the whole bounds.
    pub(crate) fn drawn(&self, i: usize) -> Vec<f64> {
        let is_wide = i % 4 == 3;
        let Bounds { lo, hi } = if is_wide {
            self.space.limits()
        } else {
            self.space.start_limits()
        };
        let mut row = CubeRow::new(self.options.seed, i);
        let ranges = lo.iter().zip(hi);
        let mut x: Vec<f64> = ranges.map(|(lo, hi)| lo + (hi - lo) * row.next()).collect();
        self.space.into_interior(&mut x, 1e-3);
        x
    }

    /// Returns the minima to be compared on more points: at most four with sums up to twice the
    /// best.
    pub(crate) fn candidates<'o>(&self, out: &'o SearchOutcome) -> &'o [SearchMinimum] {
        let limit = 2.0 * out.best();
        let first = out.minima.iter().take(4);
        let k = first.take_while(|m| m.value <= limit).count();
        &out.minima[..k.max(1).min(out.minima.len())]
    }
}

/// A row of a seeded Latin hypercube: coordinates in [0, 1) such that the rows of a cube lie in
/// different sixteenths along each axis.
struct CubeRow {
    row: usize,
    order: Vec<usize>,
    random: fastrand::Rng,
}

impl CubeRow {
    /// Makes the row of start i; each cube serves [`CUBE_STARTS`] starts.
    fn new(seed: u64, i: usize) -> Self {
        let cube = (i / CUBE_STARTS) as u64;
        Self {
            row: i % CUBE_STARTS,
            order: (0..CUBE_STARTS).collect(),
            random: fastrand::Rng::with_seed(seed.wrapping_add(cube)),
        }
    }

    /// Returns the coordinate along the next axis.
    fn next(&mut self) -> f64 {
        shuffle(&mut self.random, &mut self.order);
        let offsets: [f64; CUBE_STARTS] = std::array::from_fn(|_| self.random.f64());
        (self.order[self.row] as f64 + offsets[self.row]) / CUBE_STARTS as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_a_cube_share_no_sixteenth() {
        let mut rows: Vec<CubeRow> = (0..CUBE_STARTS).map(|i| CubeRow::new(7, i)).collect();
        for _ in 0..3 {
            let along = rows
                .iter_mut()
                .map(|row| (CUBE_STARTS as f64 * row.next()) as usize);
            let mut slots: Vec<usize> = along.collect();
            slots.sort_unstable();
            assert_eq!(slots, (0..CUBE_STARTS).collect::<Vec<_>>());
        }
    }
}
