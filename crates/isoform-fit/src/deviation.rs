//! Deviation in both directions: of the data from the model, and of the model's surface from the
//! data.
//!
//! Small residuals of the data say nothing about surface without data: a template may extend far
//! beyond its scan and still pass through all points. The model's own surface is therefore sampled
//! in a box somewhat larger than the data's, and the distance of each sample to the nearest datum
//! is measured. Templates with a distance provide the samples themselves; for others see
//! [`samples`].

mod samples;

pub use self::samples::{MAX_SURFACE_SAMPLES, surface_samples};

use self::samples::BOX_MARGIN_SHARE;
pub(crate) use self::samples::newton_step;
use crate::Template;
use crate::outliers::{Neighbourhood, median};
use crate::template::parts_of;
use isoform_geom::{Aabb, Frame, KdTree, Point3};

/// Number of local spacings of the data beyond which a sample is uncovered. Of points spread at
/// random, one in 10⁷ has its nearest neighbour beyond 2.
const UNCOVERED_SPACINGS: f64 = 2.5;
/// Number of points from which the correlation of neighbouring residuals is estimated.
const CORRELATION_PROBES: usize = 2000;

/// Distances of the used data from the model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DataToModel {
    /// Root mean square.
    pub rms: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Maximum.
    pub max: f64,
}

/// Distances of the model's surface from the data.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ModelToData {
    /// 95th percentile of the distances of samples to the nearest datum.
    pub p95: f64,
    /// Share of the samples that are uncovered.
    pub share_uncovered: f64,
    /// Least distance from the data of an uncovered sample.
    pub uncovered_from: f64,
    /// Number of samples of the surface.
    pub samples: usize,
    /// Share of the samples outside the data's box by more than the noise; large if the model
    /// extends beyond the data.
    pub share_outside: f64,
}

/// Samples of the model's surface.
#[derive(Default)]
struct SurfaceSamples {
    points: Vec<Point3>,
    /// Part of the model, by sample.
    parts: Vec<u32>,
    /// Unit inward normals; empty if the template has no foot points.
    inward: Vec<Point3>,
}

/// Samples of the surface compared with the data.
pub(crate) struct SampledSurface {
    pub(crate) points: Vec<Point3>,
    /// Part of the model, by sample.
    pub(crate) parts: Vec<u32>,
    /// Unit inward normals; empty if the template has no foot points.
    pub(crate) inward: Vec<Point3>,
    /// True if a sample is uncovered, by sample.
    pub(crate) bare: Vec<bool>,
    pub(crate) summary: ModelToData,
}

/// Number of samples of a part, and of uncovered ones among them.
#[derive(Clone, Copy, Default)]
pub(crate) struct Cover {
    pub(crate) samples: usize,
    pub(crate) bare: usize,
}

impl SampledSurface {
    /// Counts samples by part; samples of parts without a name are left out.
    pub(crate) fn cover(&self, parts: usize) -> Vec<Cover> {
        let mut cover = vec![Cover::default(); parts];
        for (part, is_bare) in self.parts.iter().zip(&self.bare) {
            if let Some(c) = cover.get_mut(*part as usize) {
                c.samples += 1;
                c.bare += usize::from(*is_bare);
            }
        }
        cover
    }
}

/// Summarises finite residuals, except those flagged in `left_out`.
pub(crate) fn data_to_model(residuals: &[f64], left_out: &[bool]) -> DataToModel {
    let all = residuals.iter().zip(left_out);
    let used = all.filter(|(r, out)| !**out && r.is_finite());
    let mut d: Vec<f64> = used.map(|(r, _)| r.abs()).collect();
    if d.is_empty() {
        return DataToModel::default();
    }
    DataToModel {
        rms: (d.iter().map(|v| v * v).sum::<f64>() / d.len() as f64).sqrt(),
        p95: percentile95(&mut d),
        max: d.iter().copied().fold(0.0, f64::max),
    }
}

/// Returns the 95th percentile; reorders the numbers.
fn percentile95(d: &mut [f64]) -> f64 {
    let n = d.len();
    let at = ((0.95 * n as f64).ceil() as usize).clamp(1, n) - 1;
    *d.select_nth_unstable_by(at, f64::total_cmp).1
}

/// The data with which the surface is compared.
pub(crate) struct ReferenceData<'a> {
    pub(crate) bounds: Aabb,
    pub(crate) near: &'a Neighbourhood,
    pub(crate) noise: f64,
}

impl ReferenceData<'_> {
    /// Returns the least distance from the data of an uncovered sample: in dense scans the noise
    /// exceeds the spacing, and four deviations of it count.
    fn uncovered_from(&self) -> f64 {
        (UNCOVERED_SPACINGS * self.near.spacing).max(4.0 * self.noise)
    }

    /// Returns the distance of a sample to the nearest datum, and true if the sample is uncovered.
    fn distance(&self, p: Point3, found: &mut Vec<(f64, u32)>) -> (f64, bool) {
        let Some((at, squared)) = self.near.tree.nearest(p) else {
            return (f64::INFINITY, true);
        };
        let d = squared.sqrt();
        // In sparse regions a larger distance does not indicate a gap.
        let is_far = |spacing: f64| d > UNCOVERED_SPACINGS * spacing;
        let is_bare = d > self.uncovered_from() && is_far(self.near.spacing_at(at, found));
        (d, is_bare)
    }

    /// Returns true if a point lies outside the data's box by more than `by`.
    fn is_outside(&self, p: &Point3, by: f64) -> bool {
        let Aabb { lo, hi } = self.bounds;
        (0..3).any(|i| p[i] < lo[i] - by || p[i] > hi[i] + by)
    }

    /// Returns the box of the trusted points in a frame, somewhat enlarged.
    fn region(&self, frame: &Frame) -> Aabb {
        let trusted = self.near.sampled().iter();
        let trusted = trusted.filter(|p| !self.is_outside(p, 0.0));
        let within: Vec<Point3> = trusted.map(|p| frame.within(*p)).collect();
        let mut region = Aabb::from_points(&within);
        let margin = BOX_MARGIN_SHARE * region.diagonal();
        for i in 0..3 {
            region.lo[i] -= margin;
            region.hi[i] += margin;
        }
        region
    }

    /// Summarises the samples of the surface.
    fn summary(&self, points: &[Point3], mut distances: Vec<f64>, bare: &[bool]) -> ModelToData {
        let from = self.uncovered_from();
        let mut summary = ModelToData {
            samples: points.len(),
            uncovered_from: from,
            ..ModelToData::default()
        };
        if !points.is_empty() {
            let n = points.len() as f64;
            let outside = points.iter().filter(|p| self.is_outside(p, from)).count();
            summary.p95 = percentile95(&mut distances);
            summary.share_uncovered = bare.iter().filter(|b| **b).count() as f64 / n;
            summary.share_outside = outside as f64 / n;
        }
        summary
    }
}

/// Samples the surface of the template in a box larger than the data's and compares it with the
/// data.
pub(crate) fn model_to_data(
    template: &dyn Template,
    a: &[f64],
    data: &ReferenceData<'_>,
    samples: usize,
) -> SampledSurface {
    let SurfaceSamples {
        points,
        parts,
        inward,
    } = places(template, a, data, samples.min(MAX_SURFACE_SAMPLES));
    let mut found = Vec::new();
    let measured = points.iter().map(|p| data.distance(*p, &mut found));
    let (distances, bare): (Vec<f64>, Vec<bool>) = measured.unzip();
    let summary = data.summary(&points, distances, &bare);
    SampledSurface {
        points,
        parts,
        inward,
        bare,
        summary,
    }
}

/// Samples the surface in a box larger than the data's.
fn places(
    template: &dyn Template,
    a: &[f64],
    data: &ReferenceData<'_>,
    wanted: usize,
) -> SurfaceSamples {
    let Some(distance) = template.distance() else {
        let points = surface_samples(template.metric(), a, data.bounds, wanted);
        return SurfaceSamples {
            parts: parts_of(template, &points, a),
            points,
            inward: Vec::new(),
        };
    };
    // In the model's own frame, so that the samples are equal in all poses; any seed will do.
    let frame = template.frame(a);
    let feet = distance.area_samples(a, &frame, data.region(&frame), wanted, 51);
    SurfaceSamples {
        points: feet.iter().map(|f| f.at).collect(),
        parts: feet.iter().map(|f| f.pieces[0]).collect(),
        inward: feet.iter().map(|f| f.inward).collect(),
    }
}

/// Returns the correlation of residuals with those of their nearest neighbours, for the first of
/// some points in random order: near 0 for noise, near 1 for a wrong model. Neighbours are those of
/// the feet of the points on the surface: where noise is as wide as the spacing, points near each
/// other in space have similar residuals. Residuals are clipped at five medians.
pub(crate) fn neighbour_correlation(feet: &[Point3], residuals: &[f64]) -> f64 {
    let tree = KdTree::new(feet);
    let most = 5.0 * median_size(residuals.iter().copied());
    let cut = |i: usize| residuals[i].clamp(-most, most);
    let mut products = CorrelationSums::default();
    let mut found = Vec::new();
    for (i, foot) in feet.iter().enumerate().take(CORRELATION_PROBES) {
        tree.nearest_k(*foot, 2, &mut found);
        if let Some(j) = found.iter().map(|f| f.1 as usize).find(|j| *j != i) {
            products.add(cut(i), cut(j));
        }
    }
    products.correlation()
}

/// Sums over pairs of numbers.
#[derive(Default)]
struct CorrelationSums {
    mixed: f64,
    own: f64,
}

impl CorrelationSums {
    fn add(&mut self, u: f64, v: f64) {
        self.mixed += u * v;
        self.own += 0.5 * (u * u + v * v);
    }

    /// Returns 1 if the numbers of each pair are equal, about 0 if they are independent.
    fn correlation(&self) -> f64 {
        if self.own > 0.0 {
            self.mixed / self.own
        } else {
            0.0
        }
    }
}

/// Returns the median of the absolute values of finite numbers.
fn median_size(residuals: impl Iterator<Item = f64>) -> f64 {
    let sizes = residuals.map(f64::abs);
    median(&mut sizes.filter(|r| r.is_finite()).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ninety_five_of_a_hundred_are_no_larger() {
        let mut d: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!(percentile95(&mut d), 95.0);
        assert_eq!(percentile95(&mut [3.0]), 3.0);
    }

    /// Noise as wide as the spacing is not correlated, though points near each other in space have
    /// similar residuals; waves of many spacings are.
    #[test]
    fn neighbours_are_those_of_the_feet() {
        let mut random = fastrand::Rng::with_seed(5);
        let feet: Vec<Point3> = (0..3000)
            .map(|_| [60.0 * random.f64(), 60.0 * random.f64(), 0.0])
            .collect();
        let noise: Vec<f64> = feet
            .iter()
            .map(|_| (0..12).map(|_| random.f64() - 0.5).sum())
            .collect();
        let bent: Vec<f64> = feet.iter().map(|p| (0.3 * p[0]).cos()).collect();
        let of_feet = |r: &[f64]| neighbour_correlation(&feet, r);
        // Chance has a deviation of 1/√2000.
        assert!(of_feet(&noise).abs() < 0.09, "{}", of_feet(&noise));
        assert!(of_feet(&bent) > 0.9, "{}", of_feet(&bent));
        let in_space: Vec<Point3> = (feet.iter().zip(&noise))
            .map(|(p, r)| [p[0], p[1], *r])
            .collect();
        let of_points = neighbour_correlation(&in_space, &noise);
        assert!(of_points > 0.2, "{of_points}");
    }

    #[test]
    fn left_out_points_do_not_count() {
        let found = data_to_model(&[3.0, -4.0, 100.0, f64::NAN], &[false, false, true, false]);
        assert_eq!((found.rms, found.max), (12.5f64.sqrt(), 4.0));
    }
}
