//! Detection of points that belong to no surface.
//!
//! There are two kinds. *Isolated* points have few neighbours: their cell and those around it
//! contain far fewer points than usual, and these do not lie in a plane, as those of a thin sample
//! would. *Off-surface* points lie many times as far from the fitted function as their neighbours
//! do, and are few: many of them together indicate a feature smaller than the cells.

use crate::keys::{IndexSet, LatticeIndex, place};
use crate::level::block;
use crate::points::{PointsByCell, PointsWithNormals};
use isoform_geom::{Point3, sub};
use isoform_num::linalg::symmetric_eigen;
use rayon::prelude::*;

/// Share of the usual number of neighbours below which points may be isolated. Scans thin out by a
/// factor of ten; outliers that are a twentieth of the points fill space thirty times as thinly as
/// a surface fills its cells.
const ISOLATED_SHARE: f64 = 1.0 / 15.0;

/// Distance of an off-surface point, in medians of its neighbours' distances. Gaussian noise
/// exceeds 7 medians twice in a million points.
const OUTLIER_MEDIANS: f64 = 8.0;

/// Minimum distance of an off-surface point, in cells. Points at sharp edges are off by up to a
/// fifth of a cell; closer outliers do little harm.
const MIN_OUTLIER_CELLS: f64 = 0.3;

/// Points by cell, with access to the neighbouring cells.
struct Neighbourhoods<'a> {
    sorted: &'a PointsByCell<'a>,
    cells: IndexSet,
}

impl<'a> Neighbourhoods<'a> {
    fn new(sorted: &'a PointsByCell<'a>) -> Self {
        let keys = (0..sorted.count()).map(|i| sorted.cell(i).0).collect();
        Self {
            sorted,
            cells: IndexSet::new(keys),
        }
    }

    /// Returns the indices of the cells with points up to `reach` cells from a cell, itself
    /// included.
    fn cells(&self, cell: LatticeIndex, reach: i32) -> impl Iterator<Item = usize> + '_ {
        let around = block(cell.map(|v| v - reach), cell.map(|v| v + reach));
        around.filter_map(|c| self.cells.find(c))
    }

    /// Returns the ranges of sorted points in a cell and the cells around it.
    fn points(&self, cell: LatticeIndex) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        self.cells(cell, 1).map(|i| self.sorted.cell(i).1)
    }

    /// Collects the point indices that `judge` returns for each cell, ascending.
    fn judged(&self, judge: impl Fn(usize) -> Vec<u32> + Sync) -> Vec<u32> {
        let mut all: Vec<u32> = (0..self.sorted.count())
            .into_par_iter()
            .flat_map_iter(&judge)
            .collect();
        all.sort_unstable();
        all
    }
}

/// Returns the ascending indices of isolated points.
pub(crate) fn isolated_points(samples: &PointsWithNormals, sorted: &PointsByCell<'_>) -> Vec<u32> {
    let around = Neighbourhoods::new(sorted);
    let counts: Vec<usize> = (0..sorted.count())
        .into_par_iter()
        .map(|i| {
            around
                .points(place(sorted.cell(i).0))
                .map(|r| r.len())
                .sum()
        })
        .collect();
    let Some(usual) = weighted_median(&counts, sorted) else {
        return Vec::new();
    };
    let is_few = |i: usize| (counts[i] as f64) < ISOLATED_SHARE * usual as f64;
    around.judged(|i| {
        let (key, range) = sorted.cell(i);
        if !is_few(i) {
            return Vec::new();
        }
        // Two cells around, so that enough points are found at borders of thin samples.
        let thin = around.cells(place(key), 2).filter(|j| is_few(*j));
        let near: Vec<Point3> = thin
            .flat_map(|j| sorted.cell(j).1)
            .map(|k| samples.points[sorted.index(k)])
            .collect();
        // Six random points are as flat as this once in a thousand times.
        if near.len() >= 6 && flatness(&near) < 0.01 {
            return Vec::new();
        }
        range.map(|k| sorted.index(k) as u32).collect()
    })
}

/// Returns the median over points of the number of points around; `None` without points.
fn weighted_median(counts: &[usize], sorted: &PointsByCell<'_>) -> Option<usize> {
    let mut all: Vec<(usize, usize)> = (counts.iter().enumerate())
        .map(|(i, count)| (*count, sorted.cell(i).1.len()))
        .collect();
    all.sort_unstable();
    let mut sum = 0;
    let half = sorted.len().div_ceil(2);
    all.into_iter().find_map(|(count, held)| {
        sum += held;
        (sum >= half).then_some(count)
    })
}

/// Returns the smallest eigenvalue of the covariance over their sum: 0 for points in a plane.
fn flatness(points: &[Point3]) -> f64 {
    let count = points.len() as f64;
    let center: Point3 = std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f64>() / count);
    let mut moments = [0.0; 9];
    for p in points {
        let d = sub(*p, center);
        for a in 0..3 {
            for b in 0..3 {
                moments[3 * a + b] += d[a] * d[b];
            }
        }
    }
    let (values, _) = symmetric_eigen(&moments, 3);
    let sum: f64 = values.iter().sum();
    if sum > 0.0 { values[0] / sum } else { 0.0 }
}

/// Returns the ascending indices of points that are far off compared with their neighbours. `off`
/// contains the distances of all points; the criterion also holds if the surface does not pass
/// within a cell.
pub(crate) fn off_surface_points(off: &[f64], sorted: &PointsByCell<'_>, spacing: f64) -> Vec<u32> {
    let around = Neighbourhoods::new(sorted);
    around.judged(|i| {
        let (key, range) = sorted.cell(i);
        let far = |k: &usize| off[sorted.index(*k)] > MIN_OUTLIER_CELLS * spacing;
        if !range.clone().any(|k| far(&k)) {
            return Vec::new();
        }
        let mut near: Vec<f64> = (around.points(place(key)).flatten())
            .map(|k| off[sorted.index(k)])
            .collect();
        let half = near.len() / 2;
        let median = *near.select_nth_unstable_by(half, f64::total_cmp).1;
        let limit = (OUTLIER_MEDIANS * median).max(MIN_OUTLIER_CELLS * spacing);
        let many = near.iter().filter(|d| **d > limit).count();
        // A larger share of the neighbours is a feature.
        if many as f64 > 0.15 * near.len() as f64 {
            return Vec::new();
        }
        let is_off = |k: &usize| off[sorted.index(*k)] > limit;
        range
            .filter(is_off)
            .map(|k| sorted.index(k) as u32)
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_num::Random;

    /// Returns 2000 points in a plane of the unit cube with unit normals, followed by other points.
    fn samples(others: &[Point3]) -> PointsWithNormals {
        let mut random = Random::new(3);
        let plane = (0..2000).map(|_| [random.unit(), random.unit(), 0.505]);
        let points: Vec<Point3> = plane.chain(others.iter().copied()).collect();
        PointsWithNormals {
            normals: vec![[0.0, 0.0, 1.0]; points.len()],
            points,
        }
    }

    #[test]
    fn points_by_themselves_are_stray_and_thin_planes_are_not() {
        let mut others = vec![[0.3, 0.3, 0.95], [0.8, 0.2, 0.1]];
        // A thin plane next to the dense one.
        let thin = |i: u32| {
            [
                1.6 + 0.09 * f64::from(i % 12),
                0.09 * f64::from(i / 12),
                0.505,
            ]
        };
        others.extend((0..132).map(thin));
        let samples = samples(&others);
        let sorted = PointsByCell::new(&samples, [0.0; 3], 0.1, [30; 3], |_| true);
        assert_eq!(isolated_points(&samples, &sorted), [2000, 2001]);
    }

    #[test]
    fn few_points_beside_a_surface_are_off_and_many_are_a_feature() {
        let one = samples(&[[0.5, 0.5, 0.56]]);
        let distances =
            |s: &PointsWithNormals| s.points.iter().map(|p| (p[2] - 0.505).abs()).collect();
        let of = |s: &PointsWithNormals| {
            let off: Vec<f64> = distances(s);
            off_surface_points(
                &off,
                &PointsByCell::new(s, [0.0; 3], 0.1, [10; 3], |_| true),
                0.1,
            )
        };
        assert_eq!(of(&one), [2000]);
        let mut random = Random::new(6);
        let peak: Vec<Point3> = (0..60)
            .map(|_| {
                [
                    0.5 + 0.04 * random.symmetric(),
                    0.5 + 0.04 * random.symmetric(),
                    0.56,
                ]
            })
            .collect();
        assert_eq!(of(&samples(&peak)), [0u32; 0]);
    }
}
