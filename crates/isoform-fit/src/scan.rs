//! Points of a fit, with what is known about them before any template.

use crate::chunks::{Cloud, by_hash, hash};
use crate::clutter::Clutter;
use crate::outliers::{MAX_DROPPED_SHARE, MAX_TREE_POINTS, MIN_OUTLIER_SHARE, Neighbourhood};
use crate::report::Fit;
use crate::report::warning::Warning;
use crate::shuffle::shuffle;
use crate::thresholds::CLUTTER_STRAY_SHARE;
use crate::{Control, FitError, Options};
use isoform_geom::{Aabb, Point3};
use std::borrow::Cow;
use std::time::Instant;

/// A prepared scan: distinct points, neighbour statistics, isolated points, box. One scan serves
/// any number of templates.
///
/// ```
/// use isoform_fit::{ClutterKind, Control, Options, Scan};
///
/// // A square of 40 × 40 points, the first of them twice.
/// let mut points: Vec<[f64; 3]> =
///     (0..1600).map(|k| [f64::from(k % 40), f64::from(k / 40), 0.0]).collect();
/// points.push(points[0]);
/// let scan = Scan::new(&points, &Options::default(), &Control::default())?;
/// assert_eq!(scan.points().len(), 1600);
/// // The scan has no other component.
/// assert_eq!(scan.clutter().share(ClutterKind::Apart), 0.0);
/// # Ok::<(), isoform_fit::FitError>(())
/// ```
pub struct Scan<'a> {
    /// Distinct points; empty for a cloud in chunks, whose sample is in [`Neighbourhood`].
    distinct: Cow<'a, [Point3]>,
    /// Cloud of which the points are a sample; `None` for points in memory.
    cloud: Option<&'a Cloud<'a>>,
    /// Index of each given point among the distinct ones; `None` if all are distinct.
    index: Option<Vec<u32>>,
    /// A seeded random order of the distinct points.
    pub(crate) order: Vec<u32>,
    pub(crate) near: Neighbourhood,
    /// The first points in that order, without isolated ones.
    pub(crate) kept: Vec<Point3>,
    /// Number of these points that were requested.
    pub(crate) wanted: usize,
    /// Share of isolated points among those examined.
    pub(crate) isolated: f64,
    /// Box of the points, or of the kept ones if outliers would enlarge it.
    pub(crate) data: Aabb,
    /// Median deviation of points from the planes through their neighbours.
    pub(crate) local_noise: f64,
    /// First decile of these deviations: on flat faces, noise alone.
    pub(crate) least_noise: f64,
    /// Time of the preparation in seconds.
    pub(crate) seconds: f64,
}

impl<'a> Scan<'a> {
    /// Prepares points.
    ///
    /// # Errors
    /// [`FitError::NotFinite`], or [`FitError::TooFewPoints`] for an empty list.
    pub fn new(
        points: &'a [Point3],
        options: &Options,
        control: &Control,
    ) -> Result<Self, FitError> {
        let started = Instant::now();
        check(points)?;
        control.report("outliers", 0.0);
        let (points, index) = distinct(points);
        let order = random_order(&points, options.seed);
        let near = Neighbourhood::new(&points, &order);
        let bounds = Aabb::from_points(points.iter());
        let scan = Self::prepare(points, None, (order, near), bounds, options);
        Ok(Self {
            index,
            seconds: started.elapsed().as_secs_f64(),
            ..scan
        })
    }

    /// Prepares a cloud in chunks, drawn with the seed of the options, from its sample, which is
    /// moved out of it.
    pub fn of_cloud(cloud: &'a mut Cloud<'_>, options: &Options, control: &Control) -> Self {
        let started = Instant::now();
        control.report("outliers", 0.0);
        let near = Neighbourhood::of_sample(std::mem::take(&mut cloud.sample));
        let order = (0..near.sampled().len() as u32).collect();
        let (none, bounds) = (Cow::Borrowed(&[][..]), cloud.bounds);
        let scan = Self::prepare(none, Some(cloud), (order, near), bounds, options);
        Self {
            seconds: started.elapsed().as_secs_f64(),
            ..scan
        }
    }

    /// Prepares distinct points, or the sample of a cloud, in a random order and in a box.
    fn prepare(
        distinct: Cow<'a, [Point3]>,
        cloud: Option<&'a Cloud<'a>>,
        (order, near): (Vec<u32>, Neighbourhood),
        bounds: Aabb,
        options: &Options,
    ) -> Self {
        let points = if cloud.is_some() {
            near.sampled()
        } else {
            &distinct
        };
        let wanted = (options.confirm_points / 2).max(options.search_points);
        let (kept, isolated) = kept(points, &order, &near, wanted, options.filter_outliers);
        let noise = near.local_noise(points, &order);
        Self {
            data: trusted_box(bounds, &kept, isolated, near.spacing),
            local_noise: noise.typical,
            least_noise: noise.least,
            distinct,
            cloud,
            index: None,
            order,
            near,
            kept,
            wanted,
            isolated,
            seconds: 0.0,
        }
    }

    /// Returns the sample of a cloud in chunks, else the distinct points.
    pub fn into_points(self) -> Vec<Point3> {
        match self.cloud {
            Some(_) => self.near.into_sample(),
            None => self.distinct.into_owned(),
        }
    }

    /// Returns the cloud in chunks of which the points are a sample; `None` for points in memory.
    pub(crate) fn cloud(&self) -> Option<&'a Cloud<'a>> {
        self.cloud
    }

    /// Returns the number of distinct points, in memory or in chunks.
    pub(crate) fn count(&self) -> usize {
        self.cloud.map_or(self.distinct.len(), Cloud::count)
    }

    /// Returns the distinct points in the order of their first occurrence; of a cloud in chunks a
    /// sample.
    pub fn points(&self) -> &[Point3] {
        match self.cloud {
            Some(_) => self.near.sampled(),
            None => &self.distinct,
        }
    }

    /// Classifies the clutter around the part, as far as the points alone show it.
    pub fn clutter(&self) -> Clutter<'_> {
        // For a million points the test for stray ones takes some 20 s on one core.
        let has_strays = self.isolated > CLUTTER_STRAY_SHARE && self.count() <= 1 << 18;
        let sampled = (self.points(), &self.order[..]);
        Clutter::find(sampled, self.count(), &self.near, has_strays)
    }

    /// Extends the result of a fit to the distinct points to all points.
    pub(crate) fn expand(&self, mut fit: Fit) -> Fit {
        if let Some(cloud) = self.cloud {
            fit.warnings
                .extend(repeated(cloud.n_points(), cloud.count()));
            return fit;
        }
        let Some(index) = &self.index else {
            return fit;
        };
        repeat(index, &mut fit.residuals);
        repeat(index, &mut fit.weights);
        repeat(index, &mut fit.outliers);
        repeat(index, &mut fit.parts);
        fit.n_points = index.len();
        fit.n_outliers = fit.outliers.iter().filter(|o| **o).count();
        fit.n_used = fit.n_points - fit.n_outliers;
        fit.warnings
            .extend(repeated(index.len(), self.distinct.len()));
        fit
    }
}

/// Warns of points that repeat others, if there are any.
fn repeated(points: usize, distinct: usize) -> Option<Warning> {
    let count = points - distinct;
    (count > 0).then_some(Warning::Repeated { count, points })
}

/// Returns a random order of distinct points. For many points it is that of a hash of each, so that
/// the sample does not depend on their order.
fn random_order(points: &[Point3], seed: u64) -> Vec<u32> {
    if points.len() > MAX_TREE_POINTS {
        let hashes: Vec<u64> = points.iter().map(|p| hash(p, seed)).collect();
        return by_hash(&hashes);
    }
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    shuffle(&mut fastrand::Rng::with_seed(seed), &mut order);
    order
}

/// Expands values of distinct points to all points.
fn repeat<T: Copy>(index: &[u32], v: &mut Vec<T>) {
    *v = index.iter().map(|&i| v[i as usize]).collect();
}

/// Checks that there are points, and that their coordinates are finite.
fn check(points: &[Point3]) -> Result<(), FitError> {
    let is_wrong = |p: &Point3| p.iter().any(|v| !v.is_finite());
    if let Some(index) = points.iter().position(is_wrong) {
        return Err(FitError::NotFinite {
            what: "a point",
            index,
        });
    }
    if points.is_empty() {
        return Err(FitError::TooFewPoints { found: 0, free: 1 });
    }
    Ok(())
}

/// Returns the first points in the order, without isolated ones if these are filtered and not too
/// many; and the share of isolated ones.
fn kept(
    points: &[Point3],
    order: &[u32],
    near: &Neighbourhood,
    wanted: usize,
    is_filtered: bool,
) -> (Vec<Point3>, f64) {
    let (kept, isolated) = if is_filtered {
        near.keep(points, order, wanted)
    } else {
        (Vec::new(), 0.0)
    };
    if is_filtered && isolated <= MAX_DROPPED_SHARE {
        return (kept, isolated);
    }
    let some = order.iter().take(wanted);
    (some.map(|&i| points[i as usize]).collect(), isolated)
}

/// Returns the distinct points in the order of their first occurrence, and the index of each point
/// among them; `None` if all are distinct.
fn distinct(points: &[Point3]) -> (Cow<'_, [Point3]>, Option<Vec<u32>>) {
    let Some(first) = first_occurrences(points) else {
        return (Cow::Borrowed(points), None);
    };
    let mut place = vec![0; points.len()];
    let mut kept = Vec::new();
    let mut index = Vec::with_capacity(points.len());
    for (i, &f) in first.iter().enumerate() {
        if f as usize == i {
            place[i] = kept.len() as u32;
            kept.push(points[i]);
        }
        index.push(place[f as usize]);
    }
    (Cow::Owned(kept), Some(index))
}

/// Returns for each point the index of the first equal one; `None` if all are distinct. Both zeros
/// are equal.
fn first_occurrences(points: &[Point3]) -> Option<Vec<u32>> {
    let bits = |p: &Point3| p.map(|v| (v + 0.0).to_bits());
    let keyed = points.iter().zip(0_u32..);
    let mut sorted: Vec<([u64; 3], u32)> = keyed.map(|(p, i)| (bits(p), i)).collect();
    sorted.sort_unstable();
    let mut first: Vec<u32> = (0..points.len() as u32).collect();
    let mut repeats = false;
    for pair in sorted.windows(2) {
        let ((before, i), (at, j)) = (pair[0], pair[1]);
        if before == at {
            first[j as usize] = first[i as usize];
            repeats = true;
        }
    }
    repeats.then_some(first)
}

/// Returns the box of all points, or of those kept if outliers would enlarge it.
fn trusted_box(all: Aabb, kept: &[Point3], isolated: f64, spacing: f64) -> Aabb {
    let mut some = Aabb::from_points(kept);
    if isolated <= MIN_OUTLIER_SHARE && all.diagonal() < 1.5 * some.diagonal() {
        return all;
    }
    for i in 0..3 {
        some.lo[i] = (some.lo[i] - spacing).max(all.lo[i]);
        some.hi[i] = (some.hi[i] + spacing).min(all.hi[i]);
    }
    some
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeats_count_once_and_both_zeros_are_one() {
        let (a, b) = ([0.0, 1.0, 2.0], [-0.0, 1.0, 2.0]);
        let c = [3.0; 3];
        let points = [c, a, b, c];
        let (kept, index) = distinct(&points);
        assert_eq!(kept.as_ref(), [c, a]);
        assert_eq!(index, Some(vec![0, 1, 1, 0]));
        assert_eq!(distinct(&[a, c]).1, None);
    }
}
