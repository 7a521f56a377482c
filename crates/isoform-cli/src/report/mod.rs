//! The HTML report of a fit: one file that needs nothing else.

use crate::fit::job::Job;
use isoform::fit::Fit;

/// A round number at or above: 1, 2, 5 times a power of ten.
fn round_up(v: f64) -> f64 {
    if !(v > 0.0 && v.is_finite()) {
        return 1.0;
    }
    let power = 10_f64.powf(v.log10().floor());
    [1.0, 2.0, 5.0, 10.0].iter().map(|m| m * power).find(|c| *c >= v * (1.0 - 1e-12)).unwrap_or(v)
}

/// The deviation at which colours end.
pub(crate) fn color_limit(fit: &Fit) -> f64 {
    round_up(fit.data_to_model.p95)
}

/// The page.
pub(crate) fn page(job: &Job) -> String {
    let _ = job;
    String::new()
}
