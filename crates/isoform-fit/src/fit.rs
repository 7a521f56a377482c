//! Entry points of a fit, and its sequence of stages: outliers, search, comparison of candidates,
//! polish, report.
//!
//! ```text
//! points → Scan → search → Candidate → settle → Fit
//!          (outliers)  (minimum of the metric   (the distance itself,
//!                       residual)                intervals, verdict)
//! ```
//!
//! A *candidate* is a minimum of the metric residual; the search that leads to it is in
//! [`candidate`], with its parts in [`compare`] (minima with nearly equal sums) and [`refine`]
//! (perturbed pieces).

mod candidate;
mod compare;
mod refine;

use crate::clock::{Clock, Seconds};
use crate::deviation;
use crate::minimum::FitMinimum;
use crate::report::Fit;
use crate::scan::Scan;
use crate::task::{Task, free_parameters};
use crate::{Control, FitError, Method, Options, Template};
use isoform_geom::Point3;

/// Fits a template to points.
///
/// # Errors
/// Points, start or bounds that are invalid; a template without finite values; or cancellation
/// before any result.
pub fn fit(
    points: &[Point3],
    template: &dyn Template,
    options: &Options,
    control: &Control,
) -> Result<Fit, FitError> {
    if points.is_empty() {
        let free = free_parameters(template.parameters());
        return Err(FitError::TooFewPoints { found: 0, free });
    }
    fit_to(
        &Scan::new(points, options, control)?,
        template,
        options,
        control,
    )
}

/// Fits a template to a prepared scan. The methods of paper C see only the sample of a cloud in
/// chunks.
///
/// # Errors
/// See [`fit`].
pub fn fit_to(
    scan: &Scan<'_>,
    template: &dyn Template,
    options: &Options,
    control: &Control,
) -> Result<Fit, FitError> {
    let task = Task::new(scan, template, options, control)?;
    let fit = match options.method {
        Method::Default => {
            let mut clock = Clock::new();
            let found = task.candidate(&mut clock)?;
            task.settled(found, clock)
        }
        method => task.classical(method)?,
    };
    Ok(scan.expand(fit))
}

/// A minimum of the search with its quality: all that is needed to choose between templates, or
/// between poses of one, before the best is settled.
pub struct Candidate {
    found: FitMinimum,
    /// Root mean square distance of the points from the model, truncated, times one plus the share
    /// of the model's surface without data; lower is better.
    pub misfit: f64,
    /// True if at least 90 % of the model's surface has data. Half scans do not reach this, and
    /// cost the time of a search for other poses.
    is_covered: bool,
    values: Vec<f64>,
    seconds: Seconds,
}

impl Candidate {
    /// Returns the parameter vector.
    pub fn values(&self) -> &[f64] {
        &self.values
    }
    /// Returns true if the search found this minimum repeatedly, or a measured start led to noise.
    pub fn is_certain(&self) -> bool {
        self.found.outcome.certain
    }
    /// Returns true if the misfit is as low as the noise between neighbouring points.
    pub fn is_at_noise(&self) -> bool {
        self.is_covered && self.found.is_at_noise
    }
    /// Records that another search, with another seed or frame, reached an equally good minimum.
    pub fn confirm(&mut self) {
        self.found.outcome.certain = true;
    }
    /// Returns the computing time by phase.
    pub fn seconds(&self) -> &[(&'static str, f64)] {
        &self.seconds.0
    }
    /// Adds the time by phase of a search that was dropped.
    pub fn add_seconds(&mut self, dropped: &[(&'static str, f64)]) {
        self.seconds.add_all(dropped);
    }
}

/// Searches for the best minimum of the template in the scan.
///
/// # Errors
/// See [`fit`].
pub fn search(
    scan: &Scan<'_>,
    template: &dyn Template,
    options: &Options,
    control: &Control,
) -> Result<Candidate, FitError> {
    let task = Task::new(scan, template, options, control)?;
    let mut clock = Clock::new();
    let found = task.candidate(&mut clock)?;
    Ok(task.assess(found, clock))
}

/// Refines a candidate to the final result: minimum of the distance, intervals, verdict.
///
/// # Errors
/// See [`fit`].
pub fn settle(
    scan: &Scan<'_>,
    template: &dyn Template,
    options: &Options,
    control: &Control,
    candidate: Candidate,
) -> Result<Fit, FitError> {
    let task = Task::new(scan, template, options, control)?;
    let clock = Clock::after(candidate.seconds);
    Ok(scan.expand(task.settled(candidate.found, clock)))
}

impl Task<'_> {
    /// Refines a minimum and reports the result.
    fn settled(&self, found: FitMinimum, mut clock: Clock) -> Fit {
        let fitted = self.settle(found, &mut clock);
        self.report(fitted, clock)
    }

    /// Assesses a minimum.
    fn assess(&self, found: FitMinimum, clock: Clock) -> Candidate {
        let rms = self.cut_rms(&found.x);
        let values = self.space.parameters(&found.x);
        let samples = self.options.surface_samples / 4;
        let surface =
            deviation::model_to_data(self.template, &values, &self.data(rms), samples).summary;
        let bare = if surface.samples == 0 {
            1.0
        } else {
            surface.share_uncovered
        };
        Candidate {
            misfit: rms * (1.0 + bare),
            is_covered: bare < 0.1,
            found,
            values,
            seconds: clock.seconds,
        }
    }

    /// Returns the root mean square distance of some points, truncated at 5 % of the diagonal.
    fn cut_rms(&self, x: &[f64]) -> f64 {
        let some = self.some(self.options.confirm_points);
        let r = self.measured(&some, x).residuals;
        let cut = 0.05 * self.size();
        let off = |r: &f64| if r.is_nan() { cut } else { r.abs().min(cut) };
        let squares = r.iter().map(|r| off(r).powi(2));
        (squares.sum::<f64>() / r.len().max(1) as f64).sqrt()
    }
}
