//! Local misfit: a misplaced piece, a group of points off the model on one side, and outliers on
//! surfaces of their own.

use super::neighbours::{COMPARED_NEIGHBOURS, with_far, without};
use crate::by_point::ByPoint;
use crate::report::finding::Finding;
use crate::report::parts::PartStatistics;
use crate::tally::PointStatistics;
use crate::task::Task;
use crate::thresholds::{CLUTTER_STRAY_SHARE, FAR_DEVIATIONS, SIGNIFICANT_DEVIATIONS};
use isoform_geom::{KdTree, Point3};

/// Spacing of outliers that lie on a surface: their eighth neighbour is at most this many typical
/// spacings away, where a typical spacing is the mean distance to eight neighbours.
const DENSE_SPACINGS: f64 = 2.2;
/// Fewest points of a group off the model that indicates a feature: noise makes no such group, and
/// dust is smaller.
const MIN_GROUP_POINTS: usize = 9;

/// Outliers on surfaces of their own.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Clusters {
    /// Share of these among the outliers.
    pub(crate) share: f64,
    /// Their mean square distance over all points.
    pub(crate) misfit: f64,
}

impl Task<'_> {
    /// Returns the piece that is farthest off its points, in deviations of the noise, if the points
    /// of all other pieces show only noise: a hole of another size, or at another position.
    /// `statistics` is by piece.
    pub(crate) fn misplaced(
        &self,
        points: &ByPoint,
        statistics: &[PartStatistics],
        noise: f64,
    ) -> Option<Finding> {
        if noise <= self.rounding() {
            return None;
        }
        let is_exact = |ratio: &f64| ratio * noise < self.exact();
        let off = |s| off_by(s, noise).filter(|ratio| !is_exact(ratio));
        let offs: Vec<Option<f64>> = statistics.iter().map(off).collect();
        let pieces = offs.iter().zip(statistics);
        let (ratio, worst) = pieces
            .filter_map(|(off, s)| Some(((*off)?, s)))
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        let is_off = |part: u32| offs.get(part as usize).is_some_and(Option::is_some);
        let rest = without(&with_far(&points.residuals, 0.0), &points.outliers);
        let on_off: Vec<bool> = points.parts.iter().map(|part| is_off(*part)).collect();
        let is_noise = self.shared(&without(&rest, &on_off), &points.at).z < SIGNIFICANT_DEVIATIONS;
        is_noise.then(|| Finding::Misplaced {
            piece: worst.name.clone(),
            ratio,
        })
    }

    /// Returns the piece with the most significant misfit that its points share, if most points lie
    /// on pieces that show only noise: another shape there, not the form of the object.
    pub(crate) fn misshapen(
        &self,
        points: &ByPoint,
        statistics: &[PartStatistics],
        noise: f64,
    ) -> Option<Finding> {
        if noise <= self.rounding() {
            return None;
        }
        let off = with_far(&points.residuals, 0.0);
        let is_used = |i: usize| !points.outliers[i];
        let of_part = |part: usize| {
            self.shared_by(&off, &points.at, |i| {
                is_used(i) && points.parts[i] as usize == part
            })
        };
        let shared = statistics.iter().enumerate();
        let shared: Vec<_> = shared.map(|(part, s)| (of_part(part), s)).collect();
        let all: usize = statistics.iter().map(|s| s.count).sum();
        let (off, rest): (Vec<_>, Vec<_>) = shared.iter().partition(|(shared, _)| {
            shared.z > SIGNIFICANT_DEVIATIONS && shared.product > self.exact().powi(2)
        });
        let clean: usize = rest.iter().map(|(_, s)| s.count).sum();
        let (worst, s) = off.iter().max_by(|a, b| a.0.z.total_cmp(&b.0.z))?;
        (2 * clean > all).then(|| Finding::Misshapen {
            piece: s.name.clone(),
            misfit: worst.product.sqrt(),
        })
    }

    /// Finds a group of points far off the model on one side if all other points show only noise: a
    /// feature that the template lacks, or one that the object lacks.
    pub(crate) fn together(&self, points: &ByPoint, told: &PointStatistics) -> Option<Finding> {
        let (noise, far) = (told.scale, &told.far);
        let is_exact = noise <= self.rounding();
        if is_exact || far.len() < MIN_GROUP_POINTS || self.scan.isolated > CLUTTER_STRAY_SHARE {
            return None;
        }
        let (inside, outside) = self.groups_by_side(far);
        let count = inside + outside;
        // Locally larger noise goes to both sides; one side must exceed the other significantly.
        let is_one_sided = inside.abs_diff(outside) as f64 > 3.0 * (count as f64).sqrt();
        let is_found = count >= MIN_GROUP_POINTS && is_one_sided;
        let is_far = |r: &f64| r.abs() > FAR_DEVIATIONS * noise || !r.is_finite();
        let near = |r: &f64| if is_far(r) { 0.0 } else { *r };
        let rest = || -> Vec<f64> { points.residuals.iter().map(near).collect() };
        let is_noise = || self.shared(&rest(), &points.at).z < SIGNIFICANT_DEVIATIONS;
        (is_found && is_noise()).then_some(Finding::Together { count })
    }

    /// Counts the points far off the model that have two neighbours equally far on their own
    /// side: inside, outside.
    fn groups_by_side(&self, far: &[(Point3, f64)]) -> (usize, usize) {
        let places: Vec<Point3> = far.iter().map(|(p, _)| *p).collect();
        let tree = KdTree::new(&places);
        let reach = (DENSE_SPACINGS * self.near.spacing).powi(2);
        let mut found = Vec::new();
        let (mut inside, mut outside) = (0_usize, 0_usize);
        for (i, (place, r)) in far.iter().enumerate() {
            // At least two of its four nearest neighbours among all points must be far.
            let near = &self.near.tree;
            near.nearest_k(*place, COMPARED_NEIGHBOURS + 1, &mut found);
            let most = found.last().map_or(0.0, |f| f.0).min(reach);
            let mut alike = 0;
            tree.near(*place, most, &mut |_, j| {
                let j = j as usize;
                alike += usize::from(j != i && r * far[j].1 > 0.0);
                most
            });
            let side = if *r > 0.0 { &mut inside } else { &mut outside };
            *side += usize::from(alike >= 2);
        }
        (inside, outside)
    }

    /// Finds outliers that lie as densely as the surface, among other outliers: a shape that the
    /// template lacks rather than stray points.
    pub(crate) fn clusters(&self, points: &ByPoint) -> Clusters {
        let is_outlier = |i: u32| points.outliers[i as usize];
        // If the tree holds only a part of the points, these are the first ones in the order.
        let seen = &self.order[..self.near.tree.len()];
        let outlying: Vec<u32> = seen.iter().copied().filter(|i| is_outlier(*i)).collect();
        let mut found = Vec::new();
        let (mut asked, mut alike, mut squares) = (0.0_f64, 0.0, 0.0);
        // A sample of the outliers estimates the share.
        for &i in outlying.iter().take(750) {
            asked += 1.0;
            if self.is_on_surface(i, &is_outlier, &mut found) {
                let r = points.residuals[i as usize];
                alike += 1.0;
                squares += if r.is_finite() { r * r } else { 0.0 };
            }
        }
        let each = outlying.len() as f64 / f64::max(asked, 1.0);
        Clusters {
            share: alike / asked.max(1.0),
            misfit: squares * each / seen.len().max(1) as f64,
        }
    }

    /// Returns true if most neighbours of an outlier are outliers, too, and as near as points of a
    /// surface: stray points are farther from each other.
    fn is_on_surface(
        &self,
        i: u32,
        is_outlier: &impl Fn(u32) -> bool,
        found: &mut Vec<(f64, u32)>,
    ) -> bool {
        let tree = &self.near.tree;
        let is_whole = tree.len() == self.points.len();
        let place = |j: u32| if is_whole { j } else { self.order[j as usize] };
        tree.nearest_k(self.points[i as usize], 2 * COMPARED_NEIGHBOURS + 1, found);
        let around = found.iter().map(|f| place(f.1)).filter(|j| *j != i);
        let others = around.filter(|j| is_outlier(*j)).count();
        let spacing = found.last().map_or(f64::INFINITY, |f| f.0.sqrt());
        others > COMPARED_NEIGHBOURS && spacing < DENSE_SPACINGS * self.near.spacing
    }
}

/// Returns the root mean square of a piece's residuals over the noise if it is significantly above
/// 1.5. Correct models of clean parts show up to 1.2; holes of another size or position show 1.7 to
/// 3, as do real objects that are not clean. The mean would be less reliable: noise moves points of
/// other pieces to narrow ones.
fn off_by(s: &PartStatistics, noise: f64) -> Option<f64> {
    let (n, rms) = (s.count as f64, s.rms / noise);
    let is_sure = (rms - 1.0) * (2.0 * n).sqrt() > SIGNIFICANT_DEVIATIONS;
    (rms > 1.5 && is_sure).then_some(rms)
}
