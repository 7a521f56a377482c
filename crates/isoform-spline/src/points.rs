//! Points sorted into the cells of a level.

use crate::keys::{LatticeIndex, MAX_AXIS_NODES, key};
use isoform_geom::{Point3, sub};
use rayon::prelude::*;
use std::ops::Range;

/// Points with normals.
#[derive(Clone, Debug)]
pub(crate) struct PointsWithNormals {
    pub(crate) points: Vec<Point3>,
    /// Outward unit normals; 0 if unknown.
    pub(crate) normals: Vec<Point3>,
}

impl PointsWithNormals {
    /// Removes points, given by ascending indices.
    pub(crate) fn leave_out(&mut self, numbers: &[u32]) {
        let is_kept = |i: u32| numbers.binary_search(&i).is_err();
        let mut at = 0..;
        self.points.retain(|_| at.next().is_some_and(is_kept));
        let mut at = 0..;
        self.normals.retain(|_| at.next().is_some_and(is_kept));
    }
}

/// Selection of points in the order of their cells.
#[derive(Debug)]
pub(crate) struct PointsByCell<'a> {
    samples: &'a PointsWithNormals,
    /// Corner of the lattice.
    corner: Point3,
    order: Vec<u32>,
    /// Cells with points, as keys, with the position of their first point in `order`.
    cells: Vec<(u64, u32)>,
}

/// Returns a number in \[0, 1) from an aperiodic sequence that is evenly spread over any range of
/// indices: the multiples of 2³² divided by the golden ratio, in 32 bits.
pub(crate) fn scattered(i: usize) -> f64 {
    f64::from((i as u32).wrapping_mul(0x9E37_79B9)) / 2.0_f64.powi(32)
}

/// Returns the cell of a point.
pub(crate) fn cell_of(p: Point3, spacing: f64, count: LatticeIndex) -> LatticeIndex {
    std::array::from_fn(|k| ((p[k] / spacing) as i32).clamp(0, count[k] - 1))
}

impl<'a> PointsByCell<'a> {
    /// Sorts a selection of points, by index, into cells.
    pub(crate) fn new(
        samples: &'a PointsWithNormals,
        corner: Point3,
        spacing: f64,
        count: LatticeIndex,
        is_chosen: impl Fn(usize) -> bool + Sync,
    ) -> Self {
        debug_assert!(count.iter().all(|c| *c < MAX_AXIS_NODES));
        let mut keyed: Vec<(u64, u32)> = (0..samples.points.len())
            .into_par_iter()
            .filter(|i| is_chosen(*i))
            .map(|i| {
                (
                    key(cell_of(sub(samples.points[i], corner), spacing, count)),
                    i as u32,
                )
            })
            .collect();
        keyed.par_sort_unstable();
        let mut cells: Vec<(u64, u32)> = Vec::new();
        for (at, (k, _)) in keyed.iter().enumerate() {
            if cells.last().is_none_or(|(last, _)| last != k) {
                cells.push((*k, at as u32));
            }
        }
        Self {
            samples,
            corner,
            order: keyed.iter().map(|(_, i)| *i).collect(),
            cells,
        }
    }
    /// Keeps at most `most` points of each cell, evenly but aperiodically spread over their order,
    /// as points of two kinds may alternate.
    pub(crate) fn thinned(self, most: usize) -> Self {
        let (mut order, mut cells) = (Vec::new(), Vec::with_capacity(self.cells.len()));
        for i in 0..self.count() {
            let (key, range) = self.cell(i);
            cells.push((key, order.len() as u32));
            let kept = range.len().min(most);
            let step = range.len() as f64 / kept as f64;
            let at = |k: usize| range.start + ((k as f64 + scattered(k)) * step) as usize;
            order.extend((0..kept).map(|k| self.order[at(k).min(range.end - 1)]));
        }
        Self {
            order,
            cells,
            ..self
        }
    }
    pub(crate) fn len(&self) -> usize {
        self.order.len()
    }
    /// Returns the number of cells with points.
    pub(crate) fn count(&self) -> usize {
        self.cells.len()
    }
    /// Returns the key of the i-th cell with points, and the positions of its points.
    pub(crate) fn cell(&self, i: usize) -> (u64, Range<usize>) {
        let end = self
            .cells
            .get(i + 1)
            .map_or(self.order.len(), |c| c.1 as usize);
        (self.cells[i].0, self.cells[i].1 as usize..end)
    }
    /// Returns the index of the k-th point.
    pub(crate) fn index(&self, k: usize) -> usize {
        self.order[k] as usize
    }
    /// Returns the coordinates of the k-th point in its cell, in \[0, 1\]³, and its normal.
    pub(crate) fn local(&self, k: usize, cell: LatticeIndex, spacing: f64) -> (Point3, Point3) {
        let i = self.index(k);
        let p = self.samples.points[i];
        (
            std::array::from_fn(|c| (p[c] - self.corner[c]) / spacing - f64::from(cell[c])),
            self.samples.normals[i],
        )
    }
}
