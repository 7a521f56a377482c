//! Report of a comparison of two shapes.

use crate::Distances;
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
    /// Largest allowed distance; `None` without a requirement.
    pub tolerance: Option<f64>,
    /// True if all distances are known and within the tolerance, or if there is none.
    pub within_tolerance: bool,
    /// Rows of the matrix that moved points (x, y, z, 1) of the first shape; `None` if none was
    /// asked for.
    pub motion: Option<[[f64; 4]; 3]>,
    /// Files written.
    pub files: Vec<String>,
}

/// Shape of a comparison.
#[derive(Clone, Debug, Serialize)]
pub struct SideReport {
    /// Name of the file.
    pub file: String,
    /// Kind of shape: `points`, `mesh`, `model` or `solid`.
    pub kind: &'static str,
}

impl CompareReport {
    /// Creates the report of the distances in both directions.
    pub fn new(
        sides: [SideReport; 2],
        distances: (Distances, Distances),
        tolerance: Option<f64>,
    ) -> Self {
        let [first, second] = sides;
        let (there, back) = distances;
        Self {
            verb: "compare",
            first,
            second,
            first_to_second: there,
            second_to_first: back,
            tolerance,
            motion: None,
            files: Vec::new(),
            within_tolerance: tolerance.is_none_or(|t| is_within(&there, t) && is_within(&back, t)),
        }
    }
}

/// Returns true if all distances are known and at most `tolerance`.
fn is_within(distances: &Distances, tolerance: f64) -> bool {
    distances.undefined == 0 && distances.max <= tolerance
}
