//! Points that belong to no surface.
//!
//! Two kinds are told apart from what was measured. *Stray* points lie where there are few others:
//! a cell and those around it hold far fewer than is usual, and what they hold lies in no plane, as
//! thin samples of a surface do. Points *beside* the surface are far from the function that was
//! fitted, many times as far as their neighbours, and few: where many are off together they show
//! something that the cells are too large for.

use crate::keys::{Keys, Place, place};
use crate::level::block;
use crate::points::{Samples, Sorted};
use isoform_geom::{Point3, sub};
use isoform_num::linalg::symmetric_eigen;
use rayon::prelude::*;

/// The part of the usual number of points around below which points may be stray. Scans thin out by
/// ten; a cloud of strays with a twentieth of the points fills space thirty times as thinly as a
/// surface fills its cells.
const FEW: f64 = 1.0 / 15.0;

/// The share of the least variance in all below which few points lie in a plane, and the fewest that
/// can show it: of six by chance one in a thousand times.
const FLAT: f64 = 0.01;
const SHOWN: usize = 6;

/// Cells around in which points where there are few show a plane: two, so that at borders of thin
/// samples there are enough.
const WIDE: i32 = 2;

/// How many times as far as the median around a point beside the surface is. Gaussian noise reaches
/// 7 medians twice in a million points.
const TIMES: f64 = 8.0;

/// The part of the spacing that it is off at least. At sharp edges points are off by up to a fifth;
/// outliers that are nearer do little harm.
const APART: f64 = 0.3;

/// The largest share of points around that may be off together: more are a feature.
const TOGETHER: f64 = 0.15;

/// Points by cells, with questions about those around.
struct Around<'a> {
    sorted: &'a Sorted<'a>,
    cells: Keys,
}

impl<'a> Around<'a> {
    fn new(sorted: &'a Sorted<'a>) -> Self {
        let keys = (0..sorted.count()).map(|i| sorted.cell(i).0).collect();
        Self {
            sorted,
            cells: Keys::new(keys),
        }
    }

    /// The numbers of the cells with points up to `reach` cells away from a cell, itself included.
    fn cells(&self, cell: Place, reach: i32) -> impl Iterator<Item = usize> + '_ {
        let around = block(cell.map(|v| v - reach), cell.map(|v| v + reach));
        around.filter_map(|c| self.cells.find(c))
    }

    /// The numbers among sorted points of those in a cell and the cells around it.
    fn of(&self, cell: Place) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        self.cells(cell, 1).map(|i| self.sorted.cell(i).1)
    }

    /// What `judge` says of the points of each cell, by the points' own numbers.
    fn judged(&self, judge: impl Fn(usize) -> Vec<u32> + Sync) -> Vec<u32> {
        let mut all: Vec<u32> = (0..self.sorted.count())
            .into_par_iter()
            .flat_map_iter(&judge)
            .collect();
        all.sort_unstable();
        all
    }
}

/// Points where there are few others, by their numbers in order.
pub(crate) fn strays(samples: &Samples, sorted: &Sorted<'_>) -> Vec<u32> {
    let around = Around::new(sorted);
    let counts: Vec<usize> = (0..sorted.count())
        .into_par_iter()
        .map(|i| around.of(place(sorted.cell(i).0)).map(|r| r.len()).sum())
        .collect();
    let Some(usual) = weighted_median(&counts, sorted) else {
        return Vec::new();
    };
    let is_few = |i: usize| (counts[i] as f64) < FEW * usual as f64;
    around.judged(|i| {
        let (key, range) = sorted.cell(i);
        if !is_few(i) {
            return Vec::new();
        }
        let thin = around.cells(place(key), WIDE).filter(|j| is_few(*j));
        let near: Vec<Point3> = thin
            .flat_map(|j| sorted.cell(j).1)
            .map(|k| samples.points[sorted.index(k)])
            .collect();
        if near.len() >= SHOWN && flatness(&near) < FLAT {
            return Vec::new();
        }
        range.map(|k| sorted.index(k) as u32).collect()
    })
}

/// The number of points around that half of the points have at most.
fn weighted_median(counts: &[usize], sorted: &Sorted<'_>) -> Option<usize> {
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

/// The share of the least variance in all: 0 for points in a plane.
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

/// Points that are far off for where they are, by their numbers in order. `off` holds the distances
/// of all points; where the surface is not met within a cell, the distance counts as it is.
pub(crate) fn beside(off: &[f64], sorted: &Sorted<'_>, spacing: f64) -> Vec<u32> {
    let around = Around::new(sorted);
    around.judged(|i| {
        let (key, range) = sorted.cell(i);
        let far = |k: &usize| off[sorted.index(*k)] > APART * spacing;
        if !range.clone().any(|k| far(&k)) {
            return Vec::new();
        }
        let mut near: Vec<f64> = (around.of(place(key)).flatten())
            .map(|k| off[sorted.index(k)])
            .collect();
        let half = near.len() / 2;
        let median = *near.select_nth_unstable_by(half, f64::total_cmp).1;
        let limit = (TIMES * median).max(APART * spacing);
        let many = near.iter().filter(|d| **d > limit).count();
        if many as f64 > TOGETHER * near.len() as f64 {
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

    /// A plane of 2000 points with unit normals in the unit cube, and then other points.
    fn samples(others: &[Point3]) -> Samples {
        let mut random = Random::new(3);
        let plane = (0..2000).map(|_| [random.unit(), random.unit(), 0.505]);
        let points: Vec<Point3> = plane.chain(others.iter().copied()).collect();
        Samples {
            normals: vec![[0.0, 0.0, 1.0]; points.len()],
            points,
        }
    }

    #[test]
    fn points_by_themselves_are_stray_and_thin_planes_are_not() {
        let mut others = vec![[0.3, 0.3, 0.95], [0.8, 0.2, 0.1]];
        // A thin plane beside the plane.
        let thin = |i: u32| {
            [
                1.6 + 0.09 * f64::from(i % 12),
                0.09 * f64::from(i / 12),
                0.505,
            ]
        };
        others.extend((0..132).map(thin));
        let samples = samples(&others);
        let sorted = Sorted::new(&samples, [0.0; 3], 0.1, [30; 3], |_| true);
        assert_eq!(strays(&samples, &sorted), [2000, 2001]);
    }

    #[test]
    fn few_points_beside_a_surface_are_off_and_many_are_a_feature() {
        let one = samples(&[[0.5, 0.5, 0.56]]);
        let distances = |s: &Samples| s.points.iter().map(|p| (p[2] - 0.505).abs()).collect();
        let of = |s: &Samples| {
            let off: Vec<f64> = distances(s);
            beside(&off, &Sorted::new(s, [0.0; 3], 0.1, [10; 3], |_| true), 0.1)
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
