//! Result of a fit: parameters with intervals, residuals by point and by piece, what the data leave
//! open, and the verdict.

pub(crate) mod evidence;
pub(crate) mod finding;
pub(crate) mod open;
pub(crate) mod parts;
pub(crate) mod warning;

pub use self::evidence::Evidence;
pub use self::finding::{Finding, Verdict};
pub use self::open::{UndeterminedGroup, Why};
pub use self::parts::PartStatistics;
pub use self::warning::Warning;

use crate::clock::Seconds;
use crate::deviation::{DataToModel, ModelToData};
use crate::search::ConvergenceStep;
use crate::{Loss, lm};

/// State of knowledge about a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Determined by the data.
    Determined,
    /// Determined roughly: its deviation exceeds 2 % of the data's size (a tenth of a radian for an
    /// angle).
    Weak,
    /// Not determined by the data, alone or together with others.
    Undetermined,
    /// Fixed by the caller or the template.
    Fixed,
    /// Held by a bound.
    AtBound,
}

impl Status {
    /// Returns the word of the JSON contract.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Determined => "determined",
            Self::Weak => "weak",
            Self::Undetermined => "undetermined",
            Self::Fixed => "fixed",
            Self::AtBound => "at-bound",
        }
    }
}

/// Result for a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Name, as the template gives it.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Standard deviation; `None` if the data leave the parameter open.
    pub sd: Option<f64>,
    /// 95 % interval; `None` if the data leave the parameter open.
    pub ci95: Option<(f64, f64)>,
    /// State of knowledge.
    pub status: Status,
    /// Bounds during the fit.
    pub bounds: (f64, f64),
    /// Unit, as the template gives it.
    pub unit: Option<String>,
}

/// Another minimum of the search.
#[derive(Clone, Debug, PartialEq)]
pub struct OtherMinimum {
    /// All parameters.
    pub parameters: Vec<f64>,
    /// Algebraic sum over the points used.
    pub sum_f2: f64,
    /// Number of starts that led there.
    pub hits: usize,
}

/// Result of a fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// One per parameter.
    pub parameters: Vec<Estimate>,
    /// Algebraic Σ f² over the used points.
    pub sum_f2: f64,
    /// Root mean square of the metric residual over the used points.
    pub rms: f64,
    /// Robust standard deviation of the metric residual over all points: the noise.
    pub noise: f64,
    /// Number of points given.
    pub n_points: usize,
    /// Number of points that are not outliers.
    pub n_used: usize,
    /// Number of points that determined the parameters: all, or a part if more would not change the
    /// intervals.
    pub n_fitted: usize,
    /// Number of outliers.
    pub n_outliers: usize,
    /// Number of points that were left out as clutter, in addition to the outliers.
    pub n_left_out: usize,
    /// Share of points that were isolated, and left out of the search.
    pub isolated: f64,
    /// Typical distance of neighbouring points.
    pub spacing: f64,
    /// Deviation of the used data from the model.
    pub data_to_model: DataToModel,
    /// Deviation of the model's surface from the data.
    pub model_to_data: ModelToData,
    /// Number of starts (without perturbations of single pieces).
    pub starts: usize,
    /// Number of starts that led to the best minimum.
    pub hits: usize,
    /// Number of evaluations of residuals with derivatives, on any number of points.
    pub evaluations: usize,
    /// Other minima found, best first.
    pub other_minima: Vec<OtherMinimum>,
    /// Groups of parameters that the data leave open.
    pub undetermined: Vec<UndeterminedGroup>,
    /// Warnings, which do not speak against the fit.
    pub warnings: Vec<Warning>,
    /// Verdict on the fit.
    pub verdict: Verdict,
    /// Findings against the fit.
    pub findings: Vec<Finding>,
    /// True if the verdict is [`Verdict::Accepted`].
    pub acceptable: bool,
    /// The findings, one sentence each.
    pub reasons: Vec<String>,
    /// Final loss of the polish.
    pub loss: Loss,
    /// Metric residual per point; of a cloud in chunks, per point of its sample.
    pub residuals: Vec<f64>,
    /// Weight per point in the polish.
    pub weights: Vec<f64>,
    /// True for outliers, by point.
    pub outliers: Vec<bool>,
    /// Piece of the model, by point.
    pub parts: Vec<u32>,
    /// Residuals by piece.
    pub part_statistics: Vec<PartStatistics>,
    /// Covariance of the parameters, row-major.
    pub covariance: Vec<f64>,
    /// Correlation of neighbouring residuals: near 0 for noise, near 1 for a systematic misfit.
    pub neighbour_correlation: f64,
    /// Correlation of neighbouring residuals that widened the intervals; 0 for none.
    pub correlation: f64,
    /// Quantities on which the verdict is based.
    pub evidence: Evidence,
    /// True if the search found its best minimum repeatedly, or a measured start led to noise.
    pub certain: bool,
    /// Root mean square, over all points, of the outliers on surfaces of their own: a shape that
    /// the template lacks. It widened the intervals.
    pub misfit: f64,
    /// Correction of the parameters for the bias of noise; empty for none.
    pub correction: Vec<f64>,
    /// Convergence history.
    pub history: Vec<ConvergenceStep>,
    /// Reason for which a local method stopped; `None` for other methods.
    pub stop: Option<lm::Stop>,
    /// Time by phase in seconds.
    pub seconds: Vec<(&'static str, f64)>,
    /// True if all phases were completed; otherwise this is the best result so far.
    pub complete: bool,
}

impl Fit {
    /// Marks the fit as incomplete: a later stage was left out.
    pub fn stop_early(&mut self) {
        if self.complete {
            self.complete = false;
            self.warnings.insert(0, Warning::Stopped);
        }
    }

    /// Sets the verdict that follows from the findings.
    pub(crate) fn decide(&mut self) {
        let worst = self.findings.iter().map(Finding::verdict).max();
        self.verdict = worst.unwrap_or(Verdict::Accepted);
        self.acceptable = self.verdict == Verdict::Accepted;
        self.reasons = self.findings.iter().map(ToString::to_string).collect();
    }

    /// Adds a finding and updates the verdict.
    pub fn add_finding(&mut self, finding: Finding) {
        self.findings.push(finding);
        self.decide();
    }

    /// Removes findings and updates the verdict.
    pub(crate) fn drop_findings(&mut self, is_dropped: impl Fn(&Finding) -> bool) {
        self.findings.retain(|f| !is_dropped(f));
        self.decide();
    }

    /// Returns the parameter vector.
    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.value).collect()
    }
    /// Adds the time by phase of a fit or search that was dropped.
    pub fn add_seconds(&mut self, dropped: &[(&'static str, f64)]) {
        let mut seconds = Seconds(std::mem::take(&mut self.seconds));
        seconds.add_all(dropped);
        self.seconds = seconds.0;
    }
}
