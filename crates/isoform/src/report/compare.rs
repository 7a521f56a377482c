//! Report of a comparison of two shapes.

use crate::{Comparison, Distances, FaceDistances};
use serde::Serialize;

/// Report of `compare`: distances between two shapes, in both directions.
#[derive(Clone, Debug, Serialize)]
pub struct CompareReport {
    /// Name of the verb: `compare`.
    pub verb: &'static str,
    /// First shape.
    pub first: SideReport,
    /// Second shape.
    pub second: SideReport,
    /// Distances of the first shape from the second.
    pub first_to_second: Distances,
    /// Distances of the second shape from the first.
    pub second_to_first: Distances,
    /// Distances of the first shape from each face of the second, by the points that are nearest to
    /// it; empty if the second has no faces.
    pub faces: Vec<ComparedFaceReport>,
    /// Largest allowed distance; `None` without a requirement.
    pub tolerance: Option<f64>,
    /// True if all judged distances are known and within the tolerance, or if there is none.
    /// Distances of a surface from points are not judged: they are as large as the gaps between the
    /// points.
    pub within_tolerance: bool,
    /// Rows of the matrix that moved points (x, y, z, 1) of the first shape; `None` if none was
    /// asked for.
    pub motion: Option<[[f64; 4]; 3]>,
    /// Files written.
    pub files: Vec<String>,
}

/// Distances from a face.
#[derive(Clone, Debug, Serialize)]
pub struct ComparedFaceReport {
    /// Name and distances.
    #[serde(flatten)]
    pub found: FaceDistances,
    /// True if all distances are known and within the tolerance; `None` without a tolerance, or
    /// without points.
    pub within_tolerance: Option<bool>,
}

/// Shape of a comparison.
#[derive(Clone, Debug, Serialize)]
pub struct SideReport {
    /// Name of the file.
    pub file: String,
    /// Kind of shape: `points`, `mesh`, `model` or `solid`.
    pub kind: &'static str,
}

/// Kind of a side that is points alone.
const POINTS: &str = "points";

impl CompareReport {
    /// Creates the report of a comparison.
    pub fn new(sides: [SideReport; 2], found: Comparison, tolerance: Option<f64>) -> Self {
        let [first, second] = sides;
        let Comparison { there, back, faces } = found;
        let judged = |found: FaceDistances| ComparedFaceReport {
            within_tolerance: tolerance
                .filter(|_| found.distances.samples > 0)
                .map(|t| is_within(&found.distances, t)),
            found,
        };
        let is_judged =
            |from: &SideReport, to: &SideReport| to.kind != POINTS || from.kind == POINTS;
        let judged_ways = [
            (is_judged(&first, &second), &there),
            (is_judged(&second, &first), &back),
        ];
        let is_kept = |t: f64| judged_ways.iter().all(|(is, d)| !is || is_within(d, t));
        Self {
            verb: "compare",
            within_tolerance: tolerance.is_none_or(is_kept),
            first,
            second,
            first_to_second: there,
            second_to_first: back,
            faces: faces.into_iter().map(judged).collect(),
            tolerance,
            motion: None,
            files: Vec::new(),
        }
    }
}

/// Returns true if all distances are known and at most `tolerance`.
fn is_within(distances: &Distances, tolerance: f64) -> bool {
    distances.undefined == 0 && distances.max <= tolerance
}
