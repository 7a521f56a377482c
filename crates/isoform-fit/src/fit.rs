//! The doors of a fit, and the one way through: outliers, search, comparison of candidates, polish,
//! report.
//!
//! ```text
//! points → Scan → search → Candidate → settle → Fit
//!          (outliers)  (minimum of the metric   (the distance itself,
//!                       residual)                intervals, verdict)
//! ```
//!
//! A *candidate* is a minimum of the metric residual; the search that leads there is in
//! [`candidate`], its parts in [`compare`] (minima of near-equal sums) and [`refine`] (pieces
//! thrown elsewhere).

mod candidate;
mod compare;
mod refine;

pub(crate) use self::candidate::Found;

use crate::clock::{Clock, Seconds};
use crate::deviation;
use crate::report::Fit;
use crate::scan::Scan;
use crate::task::{Task, free_parameters};
use crate::{Control, FitError, Method, Options, Template};
use isoform_geom::Point3;

/// Distances beyond this share of the diagonal do not make a candidate worse.
const CUT: f64 = 0.05;
/// A share of a candidate's surface without data above this is no right place: another way to stand
/// is looked for. Half scans are above it, and cost the time of that search.
const COVERED: f64 = 0.1;

/// Fits a template to points.
///
/// # Errors
/// Points, start or bounds that make no sense; a template without finite values; or cancellation
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

/// Fits a template to a scan that was made ready before. The paper's methods see no more of a cloud
/// in chunks than its sample.
///
/// # Errors
/// As [`fit`].
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

/// A minimum of the search, and how well it does: what is needed to choose between templates, or
/// between the ways that one may stand, before the best is settled.
pub struct Candidate {
    found: Found,
    /// Root of the mean square distance of the points from the model, far ones cut, times one plus
    /// the share of the model's surface without data: lower is better.
    pub misfit: f64,
    /// Whether most of the model's surface has data.
    is_covered: bool,
    values: Vec<f64>,
    seconds: Seconds,
}

impl Candidate {
    /// The parameter vector.
    pub fn values(&self) -> &[f64] {
        &self.values
    }
    /// Whether the search found this place again and again.
    pub fn is_certain(&self) -> bool {
        self.found.outcome.certain
    }
    /// Whether the misfit is as low as the noise that neighbouring points show by themselves.
    pub fn is_at_noise(&self) -> bool {
        self.is_covered && self.found.is_at_noise
    }
    /// Tells that another search, of another seed or frame, came to a place as good as this one.
    pub fn confirm(&mut self) {
        self.found.outcome.certain = true;
    }
    /// Counts the time of candidates that were dropped as this one's.
    pub fn add_seconds(&mut self, dropped: &Self) {
        self.seconds.add_all(&dropped.seconds.0);
    }
}

/// Searches for the template's best place in the scan.
///
/// # Errors
/// As [`fit`].
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

/// Takes a candidate to the result: the least distance, intervals, verdict.
///
/// # Errors
/// As [`fit`].
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
    /// The report of what becomes of a minimum.
    fn settled(&self, found: Found, mut clock: Clock) -> Fit {
        let fitted = self.settle(found, &mut clock);
        self.report(fitted, clock)
    }

    /// How well a minimum does.
    fn assess(&self, found: Found, clock: Clock) -> Candidate {
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
            is_covered: bare < COVERED,
            found,
            values,
            seconds: clock.seconds,
        }
    }

    /// Root of the mean square distance of some points, far ones cut.
    fn cut_rms(&self, x: &[f64]) -> f64 {
        let some = self.some(self.options.confirm_points);
        let r = self.measured(&some, x).residuals;
        let cut = CUT * self.size();
        let off = |r: &f64| if r.is_nan() { cut } else { r.abs().min(cut) };
        let squares = r.iter().map(|r| off(r).powi(2));
        (squares.sum::<f64>() / r.len().max(1) as f64).sqrt()
    }
}
