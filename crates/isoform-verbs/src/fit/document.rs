//! The JSON document of a fit.

use super::job::Job;
use crate::outcome;
use isoform::report::{About, FitReport};
use serde_json::Value;

impl Job {
    /// Returns the document of `fit --json`.
    pub fn document(&self) -> Value {
        document(self, "fit")
    }
}

/// Returns all results of the fit as JSON, in the file's coordinates and unit. All fields but
/// `seconds` are reproducible.
pub(crate) fn document(job: &Job, verb: &'static str) -> Value {
    let about = About {
        verb,
        scan: &job.scan,
        read: &job.read,
        template: &job.template_name,
        unit: &job.unit,
        method: job.method,
        seed: job.seed,
        warnings: &job.warnings,
        seconds: &job.seconds,
    };
    outcome::json_of(&FitReport::new(&job.found, &about))
}
