//! Random points of the surface at which noise is simulated, with the number of data points that
//! each represents.

use super::{Around, Biased};
use crate::chunks::Grid;
use isoform_geom::{Aabb, Foot, Frame, Point3};

/// Most places that noise is simulated at.
const MOST_PLACES: usize = 8000;
/// Fewest places wanted; a quarter of them must be met for the surface to tell anything.
const LEAST_PLACES: usize = 1000;
/// Deviations of the noise by which the box of the places is larger than the data's.
const MARGIN: f64 = 3.0;
/// Places expected per cell of the grid that densities are counted in; a place sees some nine.
const PER_CELL: f64 = 3.0;
/// Most cells along each side of that grid.
const MOST_CELLS: f64 = 64.0;

impl Biased<'_> {
    /// Samples points of the surface whose local geometry has no closed form, with the number of
    /// data points that each represents; `None` if the surface has fewer than 250 samples near the
    /// data.
    pub(super) fn places(&self, a: &[f64], data: Aabb) -> Option<(Vec<Foot>, Vec<f64>)> {
        let wanted = (4 * self.points.count()).clamp(LEAST_PLACES, MOST_PLACES);
        let region = grown(data, MARGIN * self.noise);
        let frame = &self.frame;
        let places = self
            .distance
            .area_samples(a, frame, region, wanted, self.seed);
        if places.len() < LEAST_PLACES / 4 {
            return None;
        }
        let at: Vec<Point3> = places.iter().map(|f| frame.within(f.at)).collect();
        let cells = Cells::new(data, at.len());
        let met = self.points.counted(&cells, frame);
        let density = densities(&cells, &at, (&met, self.points.count()));
        let around = self.around(a, &places);
        let all = places.into_iter().zip(density).zip(around);
        let unknown =
            all.filter(|((_, density), around)| matches!(around, Around::Much) && *density > 0.0);
        Some(unknown.map(|(place, _)| place).unzip())
    }
}

fn grown(mut region: Aabb, by: f64) -> Aabb {
    for i in 0..3 {
        region.lo[i] -= by;
        region.hi[i] += by;
    }
    region
}

/// A grid over a box with a rim of empty cells, so that every cell of the box has 26 neighbours.
pub(crate) struct Cells {
    lo: Point3,
    cell: f64,
    count: [usize; 3],
}

impl Cells {
    /// Makes a grid whose cells hold three points of a surface on average: with its neighbours, a
    /// cell sees some nine times as many. The longest side has at most 64 cells.
    fn new(data: Aabb, places: usize) -> Self {
        let size = data.size();
        let area = 2.0 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0]);
        let cell = (area * PER_CELL / places as f64).sqrt();
        let cell = cell.max(data.diagonal() / MOST_CELLS);
        Self {
            lo: data.lo,
            cell,
            count: size.map(|s| (s / cell) as usize + 3),
        }
    }

    /// Those of a grid.
    pub(crate) fn of(grid: &Grid) -> Self {
        Self {
            lo: grid.lo,
            cell: grid.cell,
            count: grid.count,
        }
    }

    /// As a grid along the axes of a frame.
    pub(crate) fn grid(&self, frame: Frame) -> Grid {
        Grid {
            frame,
            lo: self.lo,
            cell: self.cell,
            count: self.count,
        }
    }

    /// Returns the index of the cell that a point is in, or of the nearest one.
    fn key(&self, p: Point3) -> usize {
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
    fn around(&self, counts: &[f64], at: usize) -> f64 {
        let rows = [self.count[1] * self.count[2], self.count[2], 1];
        let mut sum = 0.0;
        for cell in 0..27 {
            let to = |i: usize| (cell / 3_usize.pow(i as u32) % 3) * rows[i];
            sum += counts[at + to(0) + to(1) + to(2) - rows[0] - rows[1] - rows[2]];
        }
        sum
    }
}

/// Returns the number of data points per sample of the surface, near each sample. Both are counted
/// in the sample's cell of a grid and in its neighbours; `met` are the data points by cell, and
/// their number.
fn densities(cells: &Cells, places: &[Point3], (met, count): (&[f64], usize)) -> Vec<f64> {
    let there = cells.counted(places);
    let mean = count as f64 / places.len() as f64;
    let density = |place: &Point3| {
        let at = cells.key(*place);
        let (there, met) = (cells.around(&there, at), cells.around(met, at));
        // Small counts are shrunk towards the mean, unless no data are near.
        if met == 0.0 && there > 3.0 {
            0.0
        } else {
            (met + mean) / (there + 1.0)
        }
    };
    places.iter().map(density).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_data_have_one_density_and_none_where_they_end() {
        // Ten data points at each place of the left half of a plate.
        let grid = (0..40_u32).flat_map(|i| (0..40_u32).map(move |j| (i, j)));
        let at = |(i, j)| [0.05 * f64::from(i) + 0.01, 0.05 * f64::from(j) + 0.01, 0.0];
        let places: Vec<Point3> = grid.map(at).collect();
        let left = places.iter().filter(|p| p[0] < 1.0);
        let points: Vec<Point3> = left.flat_map(|p| [*p; 10]).collect();
        let data = Aabb {
            lo: [0.0, 0.0, -0.01],
            hi: [2.0, 2.0, 0.01],
        };
        let cells = Cells::new(data, places.len());
        let met = cells.counted(&points);
        let found = densities(&cells, &places, (&met, points.len()));
        for (p, d) in places.iter().zip(found) {
            if p[0] < 0.7 {
                assert!((d - 10.0).abs() < 1.0, "{p:?} {d}");
            } else if p[0] > 1.3 {
                assert_eq!(d, 0.0, "{p:?}");
            }
        }
    }
}
