//! Random points of the surface at which noise is simulated, with the number of data points that
//! each represents.

use super::{BiasProblem, LocalGeometry};
use crate::cells::Cells;
use isoform_geom::{Aabb, Foot, Point3};

impl BiasProblem<'_> {
    /// Samples points of the surface whose local geometry has no closed form, with the number of
    /// data points that each represents; `None` if the surface has fewer than 250 samples near the
    /// data.
    pub(super) fn places(&self, a: &[f64], data: Aabb) -> Option<(Vec<Foot>, Vec<f64>)> {
        let wanted = (4 * self.points.count()).clamp(1000, 8000);
        // Noise carries points beyond the surface by up to three deviations.
        let region = data.widened(3.0 * self.noise);
        let frame = &self.frame;
        let places = self
            .distance
            .area_samples(a, frame, region, wanted, self.seed);
        if places.len() < 250 {
            return None;
        }
        let at: Vec<Point3> = places.iter().map(|f| frame.within(f.at)).collect();
        let cells = Cells::new(data, at.len());
        let met = self.points.counted(&cells, frame);
        let density = densities(&cells, &at, (&met, self.points.count()));
        let around = self.around(a, &places);
        let all = places.into_iter().zip(density).zip(around);
        let unknown = all.filter(|((_, density), around)| {
            matches!(around, LocalGeometry::Other) && *density > 0.0
        });
        Some(unknown.map(|(place, _)| place).unzip())
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
