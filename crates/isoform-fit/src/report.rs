//! What a fit tells: parameters with intervals, residuals by point and by piece, what the data
//! leave open, and the verdict. The report is put together in [`compose`].

mod compose;
mod estimates;
mod open;
mod parts;
mod told;

pub(crate) use self::compose::ByPoint;
pub use self::open::{Open, Why};
pub use self::parts::PartStatistics;
pub(crate) use self::told::{SAMPLED, Tally, Told};

use crate::clock::Seconds;
use crate::deviation::{DataToModel, ModelToData};
use crate::evidence::Evidence;
use crate::judge::{Finding, Verdict, Warning};
use crate::search::Step;
use crate::{Loss, lm};

/// What is known about a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The data fix it.
    Determined,
    /// The data fix it roughly: its deviation exceeds 2 % of the data's size (a tenth of a radian
    /// for an angle).
    Weak,
    /// The data leave it open, alone or together with others.
    Undetermined,
    /// The caller or the template fixed it.
    Fixed,
    /// It ran into a bound.
    AtBound,
}

impl Status {
    /// The word of the JSON contract.
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

/// A parameter's result.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Name, as the template gives it.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Standard deviation; none where the data leave the parameter open.
    pub sd: Option<f64>,
    /// 95 % interval.
    pub ci95: Option<(f64, f64)>,
    /// What is known.
    pub status: Status,
    /// Bounds that the fit kept.
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
    /// Starts that led there.
    pub hits: usize,
}

/// The result of [`crate::fit`].
#[derive(Clone, Debug)]
pub struct Fit {
    /// One per parameter.
    pub parameters: Vec<Estimate>,
    /// Algebraic Σ f² over the points used.
    pub sum_f2: f64,
    /// Root of the mean square of the metric residual of the points used.
    pub rms: f64,
    /// Robust standard deviation of the metric residual of all points: the noise.
    pub noise: f64,
    /// Points given.
    pub n_points: usize,
    /// Points that are not outliers.
    pub n_used: usize,
    /// Points that settled the parameters: all, or some where more would not change the intervals.
    pub n_fitted: usize,
    /// Outliers.
    pub n_outliers: usize,
    /// Points that were left out as clutter, beside the outliers.
    pub n_left_out: usize,
    /// Share of points found isolated before the search, and left out of it.
    pub isolated: f64,
    /// Typical distance of neighbouring points.
    pub spacing: f64,
    /// Deviation of the used data from the model.
    pub data_to_model: DataToModel,
    /// Deviation of the model's surface from the data.
    pub model_to_data: ModelToData,
    /// Starts run (throws of single pieces not counted).
    pub starts: usize,
    /// Starts that led to the best minimum.
    pub hits: usize,
    /// Evaluations of residuals with derivatives, on whatever number of points.
    pub evaluations: usize,
    /// Others found, best first.
    pub other_minima: Vec<OtherMinimum>,
    /// What the data leave open.
    pub undetermined: Vec<Open>,
    /// What a reader should know besides.
    pub warnings: Vec<Warning>,
    /// Whether to trust the fit.
    pub verdict: Verdict,
    /// What speaks against it.
    pub findings: Vec<Finding>,
    /// Whether the verdict is [`Verdict::Accepted`].
    pub acceptable: bool,
    /// The findings, one sentence each.
    pub reasons: Vec<String>,
    /// Loss that the polish ended with.
    pub loss: Loss,
    /// Metric residual per point; of a cloud in chunks, per point of its sample.
    pub residuals: Vec<f64>,
    /// Weight per point in the polish.
    pub weights: Vec<f64>,
    /// Whether a point is an outlier.
    pub outliers: Vec<bool>,
    /// Piece of the model per point.
    pub parts: Vec<u32>,
    /// By piece.
    pub part_statistics: Vec<PartStatistics>,
    /// Covariance of the parameters, row-major.
    pub covariance: Vec<f64>,
    /// Correlation of neighbouring residuals: near 0 for noise, near 1 where the model is
    /// systematically off.
    pub neighbour_correlation: f64,
    /// Correlation of neighbouring residuals that widened the intervals; 0 for none.
    pub correlation: f64,
    /// What the verdict rests on.
    pub evidence: Evidence,
    /// Whether the search found its best minimum again and again.
    pub certain: bool,
    /// Root of the mean square over all points of outliers that lie on a surface of their own: a
    /// shape that the template lacks. It widened the intervals.
    pub misfit: f64,
    /// What was added to the parameters against the bias of noise; empty for nothing.
    pub correction: Vec<f64>,
    /// How sums fell.
    pub history: Vec<Step>,
    /// Why the method ended, for the local ones.
    pub stop: Option<lm::Stop>,
    /// Seconds by phase.
    pub seconds: Vec<(&'static str, f64)>,
    /// Whether all phases ran to their end; else this is the best so far.
    pub complete: bool,
}

impl Fit {
    /// Marks the fit as the best so far: something that would have followed was left out.
    pub fn stop_early(&mut self) {
        if self.complete {
            self.complete = false;
            self.warnings.insert(0, Warning::Stopped);
        }
    }

    /// The parameter vector.
    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.value).collect()
    }
    /// Counts the time of a fit that was dropped as this one's.
    pub fn add_seconds(&mut self, dropped: &Self) {
        let mut seconds = Seconds(std::mem::take(&mut self.seconds));
        seconds.add_all(&dropped.seconds);
        self.seconds = seconds.0;
    }
}
