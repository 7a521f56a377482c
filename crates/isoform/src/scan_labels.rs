//! Labels that the points of a scan were given by hand: corrections of what was recognised.

use crate::facets::{check_corners, with_points};
use crate::recognize_scan::{RecognizeError, Recognized};
use isoform_control::Control;
use isoform_geom::{Point3, PointCloud, norm, rounding, rounding_if_decimal, sub};
use isoform_num::Random;
use isoform_recognize::{GivenLabels, LabelFacts, Options, recognize_labelled};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// Name of the column of a file that holds the labels.
const LABEL_COLUMN: &str = "entity";
/// Number of points of a label that a sample keeps, if it has more: a surface through 1000 points
/// is known to a thirtieth of their noise.
const SAMPLED_OF_LABEL: usize = 1000;

/// Labels of the points of a scan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScanLabels {
    /// Label of each point, those inside faces included; `None` for points of no entity.
    pub labels: Vec<Option<u32>>,
    /// Points inside the faces of a CAD mesh, numbered after its own, relative to its origin.
    pub inside: Vec<Point3>,
}

/// Reasons why a file holds no labels of a scan.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScanLabelsError {
    /// The file has no column with labels.
    #[error("it has no column `{LABEL_COLUMN}` with the numbers of the entities")]
    NoColumn,
    /// The file has another number of points.
    #[error("it has {labels} points, but the scan has {points}")]
    Count {
        /// Number of points of the file.
        labels: usize,
        /// Number of points of the scan.
        points: usize,
    },
    /// A number that cannot be a label.
    #[error("point {point} (from 0) has the label {value}: 0, 1, 2, ... are labels, -1 is none")]
    Label {
        /// Index of the point.
        point: usize,
        /// Value in the file.
        value: f64,
    },
    /// A point of the file is not that of the scan.
    #[error(
        "point {point} (from 0) is {distance} off that of the scan: it has other points, or in \
         another order"
    )]
    Elsewhere {
        /// Index of the point.
        point: usize,
        /// Distance of the two points.
        distance: f64,
    },
}

impl ScanLabels {
    /// Takes the labels from a file: the points of the scan in their order, and of a CAD mesh those
    /// inside its faces behind them, with the column `entity`. Coordinates have to agree within
    /// their rounding.
    ///
    /// # Errors
    /// [`ScanLabelsError`].
    pub fn from_file(scan: &PointCloud, file: &PointCloud) -> Result<Self, ScanLabelsError> {
        let named = file.columns.iter().find(|c| c.name == LABEL_COLUMN);
        let values = &named.ok_or(ScanLabelsError::NoColumn)?.values;
        let (labels, points) = (file.points.len(), scan.points.len());
        let may_have_more = !scan.triangles.is_empty() && labels > points;
        if labels != points && !may_have_more || values.len() != labels {
            return Err(ScanLabelsError::Count { labels, points });
        }
        // Both were rounded.
        let most = 2.0 * (rounding(scan) + rounding_if_decimal(file));
        for point in 0..points {
            let (p, q) = (scan.absolute(point), file.absolute(point));
            // The percentile that `rounding` takes for the largest coordinate is not that of all.
            let is_one = |k: usize| (p[k] - q[k]).abs() <= most || p[k] as f32 == q[k] as f32;
            if !(0..3).all(is_one) {
                let distance = norm(sub(p, q));
                return Err(ScanLabelsError::Elsewhere { point, distance });
            }
        }
        let label = |(point, value): (usize, &f64)| match *value {
            -1.0 => Ok(None),
            // The largest number stands for no label.
            v if v >= 0.0 && v < f64::from(u32::MAX) && v.fract() == 0.0 => Ok(Some(v as u32)),
            value => Err(ScanLabelsError::Label { point, value }),
        };
        let inside = |i: usize| {
            let p = file.absolute(i);
            std::array::from_fn(|k| p[k] - scan.origin[k])
        };
        Ok(Self {
            labels: values
                .iter()
                .enumerate()
                .map(label)
                .collect::<Result<_, _>>()?,
            inside: (points..labels).map(inside).collect(),
        })
    }

    /// Returns the labels of some points of a scan, and those that vanish: labels of which most
    /// points are left out lose the others, too.
    #[must_use]
    pub fn select(&self, kept: &[u32]) -> (Self, BTreeSet<u32>) {
        let own = self.labels.len() - self.inside.len();
        let (first, inside) = self.labels.split_at(own.min(self.labels.len()));
        let chosen = kept.iter().filter_map(|i| first.get(*i as usize).copied());
        let mut labels: Vec<Option<u32>> = chosen.chain(inside.iter().copied()).collect();
        let count = |labels: &[Option<u32>]| {
            let mut counts = BTreeMap::<u32, usize>::new();
            let all = labels.iter().flatten();
            all.for_each(|label| *counts.entry(*label).or_default() += 1);
            counts
        };
        let (before, after) = (count(&self.labels), count(&labels));
        let left = |label: &u32| after.get(label).copied().unwrap_or(0);
        let lost = before.iter().filter(|(label, n)| 2 * left(label) < **n);
        let lost: BTreeSet<u32> = lost.map(|(label, _)| *label).collect();
        for label in &mut labels {
            *label = label.filter(|l| !lost.contains(l));
        }
        let inside = self.inside.clone();
        (Self { labels, inside }, lost)
    }

    /// Returns about `wanted` points of a scan with their labels, drawn at random with a fixed seed,
    /// but more of small entities; `None` if it has no more points than that, or is a CAD mesh with
    /// points inside its faces.
    pub fn sample(&self, scan: &PointCloud, wanted: usize) -> Option<(PointCloud, Self)> {
        let count = scan.points.len();
        if count <= wanted || !self.inside.is_empty() {
            return None;
        }
        let mut sizes = BTreeMap::<Option<u32>, usize>::new();
        let all = self.labels.iter();
        all.for_each(|label| *sizes.entry(*label).or_default() += 1);
        let share = wanted as f64 / count as f64;
        let mut random = Random::new(1);
        let mut is_drawn = |label: &Option<u32>| {
            let size = label.and_then(|_| sizes.get(label)).copied();
            let least = size.map_or(0.0, |n| SAMPLED_OF_LABEL as f64 / n as f64);
            random.unit() < share.max(least)
        };
        let drawn = (0..).zip(&self.labels).filter(|(_, label)| is_drawn(label));
        let drawn: Vec<u32> = drawn.map(|(i, _)| i).collect();
        let labels = drawn.iter().map(|i| self.labels[*i as usize]);
        let labels = Self {
            labels: labels.collect(),
            inside: Vec::new(),
        };
        Some((scan.select(&drawn), labels))
    }
}

/// Makes an entity of each label of a scan's points, and searches nothing: of the kind asked for,
/// or of the one that describes its points best. The entities are in ascending order of their
/// labels.
///
/// Points of a CAD mesh count as a cloud, with those inside its faces, if they have labels.
///
/// ```
/// use isoform::geom::{Point3, PointCloud, Quadric};
/// use isoform::{Control, RecognizeOptions, ScanLabels, recognize_scan_labels};
/// // The plane z = 0 has the label 7, the plane x = 0 the label 2.
/// let side = |i: u32| [f64::from(i % 20), f64::from(i / 20)];
/// let floor = (0..400).map(side).map(|[x, y]| [x, y, 0.0]);
/// let wall = (0..400).map(side).map(|[y, z]| [0.0, y, z + 1.0]);
/// let scan = PointCloud::from_points(floor.chain(wall).collect());
/// let labels = ScanLabels {
///     labels: (0..800).map(|i| Some(if i < 400 { 7 } else { 2 })).collect(),
///     ..ScanLabels::default()
/// };
/// let options = RecognizeOptions::default();
/// let facts = Default::default();
/// let found = recognize_scan_labels(&scan, &labels, &facts, &options, &Control::default())?;
/// let [wall, floor] = &found.recognition.entities[..] else { panic!() };
/// assert_eq!([wall.label, floor.label], [Some(2), Some(7)]);
/// let Quadric::Plane { normal: [x, ..], .. } = wall.surface else { panic!() };
/// assert!((x.abs() - 1.0).abs() < 1e-12);
/// # Ok::<(), isoform::RecognizeError>(())
/// ```
///
/// # Errors
/// [`RecognizeError`] if a triangle is not valid, the labels are not those of the scan, the points
/// of one determine no surface, or on a stop.
pub fn recognize_scan_labels<'a>(
    scan: &'a PointCloud,
    labels: &ScanLabels,
    facts: &LabelFacts,
    options: &Options,
    control: &Control<'_>,
) -> Result<Recognized<'a>, RecognizeError> {
    check_corners(scan)?;
    // Points inside faces are as exact as the vertices that their surfaces pass through.
    let (scan, rounding) = match labels.inside.is_empty() {
        true => (Cow::Borrowed(scan), 0.0),
        false => {
            let all = with_points(scan, &labels.inside);
            (Cow::Owned(all), rounding(scan))
        }
    };
    let given = GivenLabels {
        labels: labels.labels.clone(),
        facts: facts.clone(),
        rounding,
    };
    Ok(Recognized {
        recognition: recognize_labelled(&scan, &given, options, control)?,
        scan,
        supports: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::Column;

    fn cloud(count: u32) -> PointCloud {
        let at = |i: u32| [f64::from(i % 13), f64::from(i % 7), 0.1 * f64::from(i)];
        PointCloud::from_points((0..count).map(at).collect())
    }

    fn with_labels(cloud: &PointCloud, values: Vec<f64>) -> PointCloud {
        let name = LABEL_COLUMN.to_owned();
        PointCloud {
            columns: vec![Column { name, values }],
            ..cloud.clone()
        }
    }

    #[test]
    fn labels_are_those_of_the_same_points() {
        let scan = cloud(5);
        let values = vec![0.0, -1.0, 7.0, 4_294_967_294.0, 0.0];
        let read = |file: &PointCloud| ScanLabels::from_file(&scan, file);
        let labels = read(&with_labels(&scan, values.clone())).expect("labels");
        assert_eq!(
            labels.labels,
            [Some(0), None, Some(7), Some(u32::MAX - 1), Some(0)]
        );
        // Coordinates as a file with three decimals has them, or one with another origin.
        let mut rounded = with_labels(&scan, values.clone());
        rounded.points.iter_mut().for_each(|p| p[2] += 4e-4);
        assert!(read(&rounded).is_err());
        rounded
            .points
            .iter_mut()
            .for_each(|p| p[2] = (p[2] * 1e3).round() / 1e3);
        assert_eq!(read(&rounded), Ok(labels.clone()));
        let moved = with_labels(&scan, values.clone()).about([1.0, 2.0, 3.0]);
        assert_eq!(read(&moved), Ok(labels));
        // Another order, another number, and numbers that cannot be labels.
        let mut turned = with_labels(&scan, values.clone());
        turned.points.swap(3, 4);
        let elsewhere = read(&turned).expect_err("other points");
        assert!(matches!(
            elsewhere,
            ScanLabelsError::Elsewhere { point: 3, .. }
        ));
        assert_eq!(read(&scan), Err(ScanLabelsError::NoColumn));
        let more = with_labels(&cloud(6), vec![0.0; 6]);
        assert_eq!(
            read(&more),
            Err(ScanLabelsError::Count {
                labels: 6,
                points: 5
            })
        );
        for value in [-2.0, 0.5, 4_294_967_295.0, 1e300, f64::INFINITY, -0.5] {
            let mut wrong = values.clone();
            wrong[2] = value;
            let error = ScanLabelsError::Label { point: 2, value };
            assert_eq!(read(&with_labels(&scan, wrong)), Err(error));
        }
        let nan = with_labels(&scan, vec![f64::NAN; 5]);
        assert!(matches!(
            read(&nan),
            Err(ScanLabelsError::Label { point: 0, .. })
        ));
        assert!(read(&with_labels(&scan, vec![0.0; 3])).is_err());
    }

    #[test]
    fn labels_that_lose_most_points_lose_all() {
        let of = |n: usize, label: u32| std::iter::repeat_n(Some(label), n);
        let labels = ScanLabels {
            labels: of(10, 3).chain(of(10, 4)).chain([None; 5]).collect(),
            inside: Vec::new(),
        };
        let kept: Vec<u32> = (6..25).collect();
        let (left, lost) = labels.select(&kept);
        assert_eq!(lost.into_iter().collect::<Vec<_>>(), [3]);
        assert_eq!(left.labels[..4], [None; 4]);
        assert_eq!(left.labels[4..14], [Some(4); 10]);
    }

    /// All points of a label with 200 are kept where 3000 of 30 000 are wanted.
    #[test]
    fn samples_keep_small_labels() {
        let scan = cloud(30_000);
        let label = |i: u32| Some(u32::from(i.is_multiple_of(150)));
        let labels = ScanLabels {
            labels: (0..30_000).map(label).collect(),
            inside: Vec::new(),
        };
        let (sample, left) = labels.sample(&scan, 3000).expect("a sample");
        assert_eq!(sample.points.len(), left.labels.len());
        let small = left.labels.iter().filter(|l| **l == Some(1)).count();
        assert_eq!(small, 200);
        assert!((2900..3400).contains(&sample.points.len()));
        for (p, label) in sample.points.iter().zip(&left.labels) {
            let i = (10.0 * p[2]).round() as u32;
            assert_eq!(*label, Some(u32::from(i.is_multiple_of(150))));
        }
        assert!(labels.sample(&scan, 30_000).is_none());
    }
}
