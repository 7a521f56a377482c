//! Normals of points: estimation and consistent orientation.

use isoform_control::{Control, Stopped};
use isoform_geom::{KdTree, Point3, agreement, estimate_normals, norm, orient_normals};

/// Normals known in advance.
#[derive(Clone, Copy, Debug)]
pub enum Normals<'a> {
    /// No normals: they are estimated.
    Unknown,
    /// One normal per point, outward; 0 if unknown. If neighbours contradict one another, only the
    /// directions are used, not the signs.
    Given(&'a [Point3]),
}

/// Source of normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NormalSource {
    /// Given and consistent.
    Given,
    /// Given directions; the signs contradicted one another and were decided anew.
    Turned,
    /// Estimated from the points.
    Estimated,
}

impl NormalSource {
    /// Returns true if directions were given.
    pub fn is_given(self) -> bool {
        !matches!(self, Self::Estimated)
    }
}

/// Source and consistency of normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalReport {
    /// Source of the normals.
    pub source: NormalSource,
    /// Final share of neighbours whose normals agree.
    pub oriented_share: f64,
    /// Number of pieces of the cloud whose outside had to be decided; 0 if it was given.
    pub pieces: usize,
}

/// Minimum share of agreeing neighbours for given signs to be trusted. Clean normals reach 0.999,
/// 5 % of outliers leave 0.9, random signs 0.5.
const MIN_AGREEING_SHARE: f64 = 0.8;

/// Numbers of neighbours tried for a plane, from clean to noisy points.
const PLANE_NEIGHBOURS: [usize; 4] = [16, 32, 64, 128];

/// Returns consistently oriented unit normals, and how they were obtained.
pub(crate) fn oriented_normals(
    points: &[Point3],
    normals: Normals<'_>,
    control: &Control<'_>,
) -> Result<(Vec<Point3>, NormalReport), Stopped> {
    if let Normals::Given(given) = normals
        && given.len() == points.len()
        && let Some(unit) = unit_normals(given)
    {
        // A sample decides.
        let stride = points.len().div_ceil(50_000);
        let some: Vec<Point3> = points.iter().step_by(stride).copied().collect();
        let of_some: Vec<Point3> = unit.iter().step_by(stride).copied().collect();
        let share = agreement(&some, &of_some, &KdTree::new(&some));
        if share >= MIN_AGREEING_SHARE {
            let sides = NormalReport {
                source: NormalSource::Given,
                oriented_share: share,
                pieces: 0,
            };
            return Ok((unit, sides));
        }
        control.check()?;
        let mut unit = unit;
        let found = orient_normals(points, &mut unit, &KdTree::new(points));
        let sides = NormalReport {
            source: NormalSource::Turned,
            oriented_share: found.share,
            pieces: found.pieces,
        };
        return Ok((unit, sides));
    }
    let tree = KdTree::new(points);
    let mut best: Option<(Vec<Point3>, f64)> = None;
    for neighbours in PLANE_NEIGHBOURS {
        control.check()?;
        let (directions, variation) = estimate_normals(points, &tree, neighbours);
        let is_better = best.as_ref().is_none_or(|b| variation < b.1);
        if !is_better {
            break;
        }
        best = Some((directions, variation));
        // Noise of up to about a fifth of the neighbours' distance.
        if variation < 0.02 {
            break;
        }
    }
    control.check()?;
    let (mut directions, _) = best.expect("one number of neighbours is tried");
    let found = orient_normals(points, &mut directions, &tree);
    let sides = NormalReport {
        source: NormalSource::Estimated,
        oriented_share: found.share,
        pieces: found.pieces,
    };
    Ok((directions, sides))
}

/// Normalises the given vectors, with 0 for invalid ones; `None` if fewer than half are valid.
fn unit_normals(given: &[Point3]) -> Option<Vec<Point3>> {
    let unit: Vec<Point3> = given
        .iter()
        .map(|n| {
            let length = norm(*n);
            if length > 0.0 && length.is_finite() {
                n.map(|v| v / length)
            } else {
                [0.0; 3]
            }
        })
        .collect();
    let known = unit.iter().filter(|n| **n != [0.0; 3]).count();
    (2 * known > unit.len()).then_some(unit)
}
