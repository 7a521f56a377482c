//! Counts of points by cell of a grid.

use isoform_geom::{Aabb, Point3};

/// A grid over a box with a rim of empty cells, so that every cell of the box has 26 neighbours.
pub(crate) struct Cells {
    pub(crate) lo: Point3,
    pub(crate) cell: f64,
    pub(crate) count: [usize; 3],
}

impl Cells {
    /// Makes a grid whose cells hold three points of a surface on average: with its neighbours, a
    /// cell sees some nine times as many. The longest side has at most 64 cells.
    pub(crate) fn new(data: Aabb, places: usize) -> Self {
        let size = data.size();
        let area = 2.0 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0]);
        let cell = (area * 3.0 / places as f64).sqrt();
        let cell = cell.max(data.diagonal() / 64.0);
        Self {
            lo: data.lo,
            cell,
            count: size.map(|s| (s / cell) as usize + 3),
        }
    }

    /// Returns the index of the cell that a point is in, or of the nearest one.
    pub(crate) fn key(&self, p: Point3) -> usize {
        let along = |i: usize| {
            let at = ((p[i] - self.lo[i]) / self.cell).floor() as isize + 1;
            at.clamp(1, self.count[i] as isize - 2) as usize
        };
        (along(0) * self.count[1] + along(1)) * self.count[2] + along(2)
    }

    /// Counts points by cell.
    pub(crate) fn counted(&self, points: &[Point3]) -> Vec<f64> {
        let mut counts = vec![0.0; self.count.iter().product()];
        points.iter().for_each(|p| counts[self.key(*p)] += 1.0);
        counts
    }

    /// Sums the counts of a cell and its 26 neighbours.
    pub(crate) fn around(&self, counts: &[f64], at: usize) -> f64 {
        let rows = [self.count[1] * self.count[2], self.count[2], 1];
        let mut sum = 0.0;
        for cell in 0..27 {
            let to = |i: usize| (cell / 3_usize.pow(i as u32) % 3) * rows[i];
            sum += counts[at + to(0) + to(1) + to(2) - rows[0] - rows[1] - rows[2]];
        }
        sum
    }
}
