//! Parts without data of their own.
//!
//! Faces along which a scan ends get points of their neighbours' rims, some noise × perimeter /
//! area; a hole between the points of a face only has points near its edge. Neither are data of the
//! part.

use crate::deviation::{Cover, SampledSurface};
use crate::minimum::FitMinimum;
use crate::point_distances::PointDistances;
use crate::residuals::{MOVING_DERIVATIVE, jacobian};
use crate::task::Task;
use crate::thresholds::OUTLIER_DEVIATIONS;
use isoform_geom::{DistanceField, Foot, Nearby, Point3};

/// Smallest probability of a count for which chance explains it.
const MIN_CHANCE_PROBABILITY: f64 = 1e-4;

/// Number of points whose nearest point is on a part: on it within the noise, or off it.
#[derive(Clone, Copy, Default)]
struct PartCount {
    on: usize,
    off: usize,
}

impl PartCount {
    /// Returns true if a part has less than 12 % of the points that are expected on it, and either
    /// more than a fifth of it is bare (sparse is not absent) or it is shunned. Parts with fewer
    /// than six samples are never absent.
    fn is_absent(self, cover: Cover, expected: f64) -> bool {
        let is_sparse = cover.samples >= 6 && (self.on as f64) < 0.12 * expected;
        let is_bare = cover.bare as f64 > 0.2 * cover.samples as f64;
        is_sparse && (is_bare || self.is_shunned(expected))
    }

    /// Returns true if most of the points are off the part, and all of them together are few for
    /// its area. A part with all its points next to it is misplaced, not unseen.
    fn is_shunned(self, expected: f64) -> bool {
        self.off > self.on && ((self.on + self.off) as f64) < 0.5 * expected
    }
}

/// A minimum whose parts are examined.
struct PartExamination<'a> {
    measured: &'a PointDistances,
    surface: &'a SampledSurface,
    a: &'a [f64],
    noise: f64,
    /// Distance beyond which points are outliers.
    limit: f64,
    /// Number of points per sample of the covered surface.
    density: f64,
}

impl PartExamination<'_> {
    /// Counts points on and off each part.
    fn counts(&self, parts: usize) -> Vec<PartCount> {
        let mut counts = vec![PartCount::default(); parts];
        for (met, r) in self.measured.pieces.iter().zip(&self.measured.residuals) {
            if let Some(count) = counts.get_mut(met[0] as usize) {
                let is_on = r.abs() <= self.limit;
                let side = if is_on { &mut count.on } else { &mut count.off };
                *side += 1;
            }
        }
        counts
    }

    /// Returns the expected number of points on some samples, less one standard deviation.
    fn expected(&self, samples: usize) -> f64 {
        self.density * (samples as f64 - (samples as f64).sqrt())
    }

    /// Returns the samples of a part.
    fn samples_of(&self, part: usize) -> Vec<Foot> {
        let surface = self.surface;
        let samples = surface.points.iter().zip(&surface.inward);
        samples
            .zip(&surface.parts)
            .filter(|(_, p)| **p as usize == part)
            .map(|((at, inward), p)| Foot::on_face(*at, *inward, *p))
            .collect()
    }

    /// Returns the feet on a part, and on no other, of the points that are on it.
    fn feet_of(&self, part: usize, distance: &dyn DistanceField) -> Vec<Foot> {
        let is_on = |parts: &[u32; 3]| parts[0] as usize == part;
        let measured = self.measured;
        let points = measured.pieces.iter().zip(&measured.residuals);
        let near: Vec<Point3> = points
            .zip(&measured.at)
            .filter(|((met, r), _)| is_on(met) && r.abs() <= self.limit)
            .map(|(_, at)| *at)
            .collect();
        let mut feet = vec![Foot::NONE; near.len()];
        distance.feet(&near, self.a, &mut feet);
        feet.retain(|foot| foot.order == 1 && is_on(&foot.pieces));
        feet
    }

    /// Counts the feet that are farther from all edges than three deviations of the noise, so that
    /// their points belong to one face.
    fn off_edges(&self, places: &[Foot], distance: &dyn DistanceField) -> usize {
        let reach = 3.0 * self.noise;
        let around = distance.nearby(places, self.a, reach, reach);
        around.iter().filter(|n| **n == Nearby::Face).count()
    }

    /// Returns true if a part only has points near its edges, where chance does not explain that: a
    /// hole between the points of a face, no larger than their spacing. Up to two points off edges
    /// may be noise of its neighbours, or stray.
    fn is_empty_off_edges(&self, part: usize, distance: &dyn DistanceField) -> bool {
        let samples = self.samples_of(part);
        if chance_of_few(0, self.expected(samples.len())) > MIN_CHANCE_PROBABILITY {
            return false;
        }
        let count = self.off_edges(&self.feet_of(part, distance), distance);
        let expected = || self.expected(self.off_edges(&samples, distance));
        count <= 2 && chance_of_few(count, expected()) <= MIN_CHANCE_PROBABILITY
    }
}

impl Task<'_> {
    /// Flags parts without data of their own: few points on them for their area, and either much of
    /// it bare or most of the points near them off them; or no points except those of their
    /// neighbours' rims.
    pub(super) fn open_parts(
        &self,
        measured: &PointDistances,
        a: &[f64],
        noise: f64,
        surface: &SampledSurface,
    ) -> Vec<bool> {
        let covered = surface.bare.iter().filter(|b| !**b).count().max(1);
        let looked = PartExamination {
            measured,
            surface,
            a,
            noise,
            limit: OUTLIER_DEVIATIONS * noise.max(self.rounding()),
            density: measured.residuals.len() as f64 / covered as f64,
        };
        let names = self.template.part_names().len();
        let distance = self.template.distance();
        let is_hollow = |k: usize| distance.is_some_and(|d| looked.is_empty_off_edges(k, d));
        let all = surface.cover(names).into_iter().zip(looked.counts(names));
        all.enumerate()
            .map(|(k, (cover, count))| {
                let expected = looked.density * cover.samples as f64;
                let has_few = 2.0 * (count.on as f64) < expected;
                count.is_absent(cover, expected) || (has_few && is_hollow(k))
            })
            .collect()
    }

    /// Returns true for each variable that moves a sample of the surface on one of the flagged
    /// parts.
    pub(super) fn moves(
        &self,
        found: &FitMinimum,
        surface: &SampledSurface,
        flagged: &[bool],
    ) -> Vec<bool> {
        let is_flagged = |part: u32| flagged.get(part as usize) == Some(&true);
        let places = surface.points.iter().zip(&surface.parts);
        let at: Vec<Point3> = places
            .filter(|(_, part)| is_flagged(**part))
            .map(|(p, _)| *p)
            .collect();
        let a = self.space.parameters(&found.x);
        let jac = jacobian(self.template.metric(), &at, &a);
        let rows = || jac.chunks_exact(a.len());
        let is_moved =
            |k: usize| rows().any(|row| self.space.derivative(k, row).abs() > MOVING_DERIVATIVE);
        (0..self.space.len()).map(is_moved).collect()
    }
}

/// Returns the probability of at most `points` points if `expected` are expected (Poisson).
fn chance_of_few(points: usize, expected: f64) -> f64 {
    let mut term = (-expected.max(0.0)).exp();
    let mut sum = term;
    for k in 1..=points {
        term *= expected / k as f64;
        sum += term;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_points_are_as_probable_as_poisson_says() {
        assert_eq!(chance_of_few(0, 0.0), 1.0);
        // e⁻² (1 + 2 + 2).
        assert!((chance_of_few(2, 2.0) - 5.0 * (-2f64).exp()).abs() < 1e-15);
    }
}
