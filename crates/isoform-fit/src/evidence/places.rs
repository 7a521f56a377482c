//! Local misfit: a misplaced piece, a group of points off the model on one side, and outliers on
//! surfaces of their own.

use super::{NEIGHBOURS, but, finite};
use crate::judge::Finding;
use crate::report::{ByPoint, PartStatistics, Told};
use crate::scan::MANY_STRAYS;
use crate::task::Task;
use isoform_geom::{KdTree, Point3};

/// Outliers whose eighth neighbour is no farther than this many typical mean distances to eight
/// neighbours lie on a surface.
const DENSE: f64 = 2.2;
/// Outliers that are asked whether they lie together, at most.
const PROBES: usize = 750;
/// A piece is off its points where their root mean square exceeds that of the noise by this factor.
/// Right models of clean parts show up to 1.2, holes of another size or place 1.7 to 3; real
/// objects as much as those, but not on clean parts.
const OFF_RMS: f64 = 1.5;
/// Deviations beyond chance from which a piece is off, and residuals of neighbours are alike.
const OFF_SURE: f64 = 5.0;
/// A point is far off the model from this many robust deviations on: one of 16,000 by noise alone.
pub(crate) const FAR: f64 = 4.0;
/// A point belongs to a group if this many neighbours lie as far off, on the same side of the
/// model.
const ALIKE: usize = 2;
/// This many such points make a feature: chance makes none, and dust has fewer.
const LEAST_TOGETHER: usize = 9;
/// Deviations by which one side must outnumber the other, were they equally likely.
const ONE_SIDED: f64 = 3.0;

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
        let offs: Vec<Option<f64>> = statistics.iter().map(|s| off_by(s, noise)).collect();
        let pieces = offs.iter().zip(statistics);
        let (ratio, worst) = pieces
            .filter_map(|(off, s)| Some(((*off)?, s)))
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        let is_off = |part: u32| offs.get(part as usize).is_some_and(Option::is_some);
        let rest = but(&finite(&points.residuals, 0.0), &points.outliers);
        let on_off: Vec<bool> = points.parts.iter().map(|part| is_off(*part)).collect();
        let is_noise = self.shared(&but(&rest, &on_off), &points.at).z < OFF_SURE;
        is_noise.then(|| Finding::Misplaced {
            piece: worst.name.clone(),
            ratio,
        })
    }

    /// Finds a group of points far off the model on one side if all other points show only noise: a
    /// feature that the template lacks, or one that the object lacks.
    pub(crate) fn together(&self, points: &ByPoint, told: &Told) -> Option<Finding> {
        let (noise, far) = (told.scale, &told.far);
        let is_exact = noise <= self.rounding();
        if is_exact || far.len() < LEAST_TOGETHER || self.scan.isolated > MANY_STRAYS {
            return None;
        }
        let (inside, outside) = self.groups_by_side(far);
        let count = inside + outside;
        // Noise that is larger in places goes to both sides.
        let is_one_sided = inside.abs_diff(outside) as f64 > ONE_SIDED * (count as f64).sqrt();
        let is_found = count >= LEAST_TOGETHER && is_one_sided;
        let is_far = |r: &f64| r.abs() > FAR * noise || !r.is_finite();
        let near = |r: &f64| if is_far(r) { 0.0 } else { *r };
        let rest = || -> Vec<f64> { points.residuals.iter().map(near).collect() };
        let is_noise = || self.shared(&rest(), &points.at).z < OFF_SURE;
        (is_found && is_noise()).then_some(Finding::Together { count })
    }

    /// Counts the points far off the model that have two neighbours equally far on the same side:
    /// inside, outside.
    fn groups_by_side(&self, far: &[(Point3, f64)]) -> (usize, usize) {
        let places: Vec<Point3> = far.iter().map(|(p, _)| *p).collect();
        let tree = KdTree::new(&places);
        let reach = (DENSE * self.near.spacing).powi(2);
        let mut found = Vec::new();
        let (mut inside, mut outside) = (0_usize, 0_usize);
        for (i, (place, r)) in far.iter().enumerate() {
            // At least two of its four nearest neighbours among all points must be far.
            let near = &self.near.tree;
            near.nearest_k(*place, NEIGHBOURS + 1, &mut found);
            let most = found.last().map_or(0.0, |f| f.0).min(reach);
            let mut alike = 0;
            tree.near(*place, most, &mut |_, j| {
                let j = j as usize;
                alike += usize::from(j != i && r * far[j].1 > 0.0);
                most
            });
            let side = if *r > 0.0 { &mut inside } else { &mut outside };
            *side += usize::from(alike >= ALIKE);
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
        for &i in outlying.iter().take(PROBES) {
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
        tree.nearest_k(self.points[i as usize], 2 * NEIGHBOURS + 1, found);
        let around = found.iter().map(|f| place(f.1)).filter(|j| *j != i);
        let others = around.filter(|j| is_outlier(*j)).count();
        let spacing = found.last().map_or(f64::INFINITY, |f| f.0.sqrt());
        others > NEIGHBOURS && spacing < DENSE * self.near.spacing
    }
}

/// Returns the root mean square of a piece's residuals over the noise if it is significantly above
/// 1.5. Correct models of clean parts show up to 1.2; holes of another size or position show 1.7 to
/// 3, as do real objects that are not clean. The mean would be less reliable: noise moves points of
/// other pieces to narrow ones.
fn off_by(s: &PartStatistics, noise: f64) -> Option<f64> {
    let (n, rms) = (s.count as f64, s.rms / noise);
    let is_sure = (rms - 1.0) * (2.0 * n).sqrt() > OFF_SURE;
    (rms > OFF_RMS && is_sure).then_some(rms)
}
