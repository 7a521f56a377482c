//! The report of a comparison of two shapes.

use crate::Distances;
use serde::Serialize;

/// How far two shapes are apart, both ways.
#[derive(Clone, Debug, Serialize)]
pub struct CompareReport {
    /// `compare`.
    pub verb: &'static str,
    /// One of the shapes.
    pub first: SideReport,
    /// The other.
    pub second: SideReport,
    /// Distances of the first from the second.
    pub first_to_second: Distances,
    /// Distances of the second from the first.
    pub second_to_first: Distances,
    /// The largest distance allowed, if there is one.
    pub tolerance: Option<f64>,
    /// Whether no distance is larger, and none undefined, where there is a tolerance.
    pub within_tolerance: bool,
}

/// One of the shapes.
#[derive(Clone, Debug, Serialize)]
pub struct SideReport {
    /// Its file.
    pub file: String,
    /// `points`, `mesh`, `model` or `solid`.
    pub kind: &'static str,
}

impl CompareReport {
    /// The report of the distances both ways.
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
            within_tolerance: tolerance.is_none_or(|t| is_within(&there, t) && is_within(&back, t)),
        }
    }
}

/// Whether all distances are known and at most this.
fn is_within(distances: &Distances, tolerance: f64) -> bool {
    distances.undefined == 0 && distances.max <= tolerance
}
