//! Normals: whose, and whether they point to one side.

use isoform_control::{Control, Stopped};
use isoform_geom::{KdTree, Point3, agreement, estimate_normals, norm, orient_normals};

/// What is known of the points' normals.
#[derive(Clone, Copy, Debug)]
pub enum Normals<'a> {
    /// Nothing: they are estimated.
    Unknown,
    /// One per point, outward; 0 where unknown. If neighbours contradict one another, only their
    /// directions are believed.
    Given(&'a [Point3]),
}

/// Where normals came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Source {
    /// They were given.
    Given,
    /// Their directions were given; their sides contradicted one another and were decided anew.
    Turned,
    /// They were estimated.
    Estimated,
}

impl Source {
    /// Whether directions were given.
    pub fn is_given(self) -> bool {
        !matches!(self, Self::Estimated)
    }
}

/// What was found of normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sides {
    /// Where they came from.
    pub source: Source,
    /// The share of neighbours whose normals point to one side, in the end.
    pub oriented_share: f64,
    /// Pieces of the cloud whose outside had to be decided; 0 if it was given.
    pub pieces: usize,
}

/// The least share of neighbours that agree for sides to be believed. Clean normals reach 0.999,
/// 5 % of outliers leave 0.9, sides by chance 0.5.
const BELIEVED: f64 = 0.8;

/// Neighbours of a plane: the fewest, and the most where noise asks for more.
const NEIGHBOURS: [usize; 4] = [16, 32, 64, 128];

/// The share of the variance across the plane at which more neighbours are taken: noise of some
/// fifth of the neighbours' distance.
const NOISY: f64 = 0.02;

/// How many points tell whether given sides agree.
const TRIAL: usize = 50_000;

/// Unit normals with one side, and how that was reached.
pub(crate) fn sided(
    points: &[Point3],
    normals: Normals<'_>,
    control: &Control<'_>,
) -> Result<(Vec<Point3>, Sides), Stopped> {
    if let Normals::Given(given) = normals
        && given.len() == points.len()
        && let Some(unit) = unit_normals(given)
    {
        let stride = points.len().div_ceil(TRIAL);
        let some: Vec<Point3> = points.iter().step_by(stride).copied().collect();
        let of_some: Vec<Point3> = unit.iter().step_by(stride).copied().collect();
        let share = agreement(&some, &of_some, &KdTree::new(&some));
        if share >= BELIEVED {
            let sides = Sides {
                source: Source::Given,
                oriented_share: share,
                pieces: 0,
            };
            return Ok((unit, sides));
        }
        control.check()?;
        let mut unit = unit;
        let found = orient_normals(points, &mut unit, &KdTree::new(points));
        let sides = Sides {
            source: Source::Turned,
            oriented_share: found.share,
            pieces: found.pieces,
        };
        return Ok((unit, sides));
    }
    let tree = KdTree::new(points);
    let mut best: Option<(Vec<Point3>, f64)> = None;
    for neighbours in NEIGHBOURS {
        control.check()?;
        let (directions, variation) = estimate_normals(points, &tree, neighbours);
        let is_better = best.as_ref().is_none_or(|b| variation < b.1);
        if !is_better {
            break;
        }
        best = Some((directions, variation));
        if variation < NOISY {
            break;
        }
    }
    control.check()?;
    let (mut directions, _) = best.expect("one number of neighbours is tried");
    let found = orient_normals(points, &mut directions, &tree);
    let sides = Sides {
        source: Source::Estimated,
        oriented_share: found.share,
        pieces: found.pieces,
    };
    Ok((directions, sides))
}

/// Unit lengths, 0 for what is no direction; none if fewer than half are one.
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
