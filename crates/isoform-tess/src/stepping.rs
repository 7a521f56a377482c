//! Step lengths and acceptance of steps of predictor–corrector tracing, shared by arcs of the
//! double curve (`pairs`) and solitary curves (`double`).

/// Maximum number of points of a traced branch; one that needs more is lost.
pub(crate) const MAX_BRANCH_POINTS: usize = 100_000;
/// Length of the first step of a branch, in the affine chart around its first point.
pub(crate) const FIRST_STEP_LENGTH: f64 = 0.02;
/// Step length below which chords need not be fine in space: parameters next to a base point reach
/// far there.
pub(crate) const FREE_STEP_LENGTH: f64 = 1e-7;

/// Bounds on the error of a prediction, its distance from the corrected point, per length of the
/// step.
pub(crate) struct ErrorBounds {
    /// Error above which a step is rejected, as the point may lie on another branch.
    pub(crate) rejecting: f64,
    /// Error below which the next step is longer.
    pub(crate) growing: f64,
}

impl ErrorBounds {
    /// Returns true if a step is too long, by the cosine of its tangents and its prediction error.
    pub(crate) fn rejects(&self, step: f64, cosine: f64, error: f64) -> bool {
        // Tangents may turn by 18 degrees.
        cosine < 0.95 || error > self.rejecting * step
    }
    /// Returns the length of the step after one with a given error.
    pub(crate) fn next_step(&self, step: f64, error: f64) -> f64 {
        if error < self.growing * step {
            (1.5 * step).min(0.1)
        } else {
            step
        }
    }
}

/// Returns half of a step that was rejected; `None` if that is too short, as next to a base point
/// or a singular point.
pub(crate) fn halved_step(step: f64) -> Option<f64> {
    let half = step / 2.0;
    (half >= 1e-10).then_some(half)
}

/// Returns true if a point may lie on a step, by the length of the step and that of the detour over
/// the point.
///
/// Tangents turn by at most 18 degrees, and an arc of that angle is 1.004 times its chord. The
/// absolute term allows for rounding on very short steps.
pub(crate) fn is_short_detour(detour: f64, step: f64) -> bool {
    detour <= 1.03 * step + 1e-9
}
