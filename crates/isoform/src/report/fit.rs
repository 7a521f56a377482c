//! Report of a fit.

use super::{Seconds, finite};
use crate::ScanFit;
use isoform_fit::{Estimate, Evidence, Fit, Method, Status};
use isoform_geom::Point3;
use isoform_io::{ReadReport, UnitGuess};
use serde::Serialize;

/// Report of `fit` and `recover`: a template fitted to a scan, in the coordinates and the unit of
/// the scan's file. Points are `[x, y, z]`.
#[derive(Clone, Debug, Serialize)]
pub struct FitReport {
    /// Name of the verb: `fit` or `recover`.
    pub verb: &'static str,
    /// The scan.
    pub scan: ScanReport,
    /// The template.
    pub template: TemplateReport,
    /// Unit of length; `None` if unknown.
    pub units: Option<String>,
    /// Source of the unit, in words.
    pub units_source: String,
    /// Verdict on the fit: `accepted`, `doubtful` or `refused`.
    pub verdict: &'static str,
    /// True if the verdict is `accepted`.
    pub acceptable: bool,
    /// Findings against the fit, a sentence each.
    pub reasons: Vec<String>,
    /// Numbers that the verdict is based on.
    pub evidence: EvidenceReport,
    /// True if all phases ran to their end; otherwise this is the best fit so far.
    pub complete: bool,
    /// Estimates of the parameters, in the order of the template, those of the pose last.
    pub parameters: Vec<ParameterReport>,
    /// Pose of the template in space; `None` for a template without a pose.
    pub pose: Option<PoseReport>,
    /// Sets of parameters that the data do not determine.
    pub undetermined: Vec<UndeterminedReport>,
    /// Sum of f² over the points used, f being the template's own function.
    pub sum_f2: f64,
    /// Root mean square distance of the points used.
    pub rms: f64,
    /// Robust standard deviation of the distances of all points.
    pub noise: f64,
    /// Number of points given.
    pub n_points: usize,
    /// Number of points that are not outliers.
    pub n_used: usize,
    /// Number of points from which the parameters were computed.
    pub n_fitted: usize,
    /// Number of outliers.
    pub n_outliers: usize,
    /// Number of points left out as clutter, besides the outliers.
    pub n_left_out: usize,
    /// Distances of the data from the model, and of the model from the data.
    pub two_sided: TwoSidedReport,
    /// Statistics of the residuals of each part of the model.
    pub parts: Vec<PartReport>,
    /// Name of the method of minimisation.
    pub method: &'static str,
    /// Name of the loss function of the last stage.
    pub loss: &'static str,
    /// Number of starts of the search.
    pub starts: usize,
    /// Number of starts that led to the best minimum.
    pub hits: usize,
    /// Number of evaluations of the residuals with their derivatives.
    pub evaluations: usize,
    /// Other minima, best first.
    pub other_minima: Vec<OtherMinimumReport>,
    /// Typical distance of neighbouring points.
    pub spacing: f64,
    /// Share of the points found isolated before the search, and left out of it.
    pub isolated: f64,
    /// Correlation of neighbouring residuals: near 0 for noise, near 1 for a systematic misfit.
    pub neighbour_correlation: f64,
    /// Warnings, a sentence each.
    pub warnings: Vec<String>,
    /// Seed of the pseudo-random numbers.
    pub seed: u64,
    /// Computing time by phase, in seconds.
    pub seconds: Seconds,
}

/// Scan of a fit.
#[derive(Clone, Debug, Serialize)]
pub struct ScanReport {
    /// Name of the scan's file.
    pub file: String,
    /// Name of the file's format.
    pub format: &'static str,
    /// Number of points in the file.
    pub rows: u64,
    /// Number of points dropped because a coordinate is not finite.
    pub dropped: u64,
    /// True if only a random sample of the points was read.
    pub subsampled: bool,
    /// Vector subtracted from all points before the fit; reported values include it again.
    pub origin: Point3,
}

/// Template of a fit.
#[derive(Clone, Debug, Serialize)]
pub struct TemplateReport {
    /// Name of the template in the gallery, or of its file.
    pub name: String,
    /// Title, as annotated in the program; `None` without one.
    pub title: Option<String>,
    /// Description of what the template fits, as annotated in the program; `None` without one.
    pub fits: Option<String>,
}

/// Numbers that the verdict on a fit is based on; lengths in the scan's unit.
#[derive(Clone, Debug, Serialize)]
pub struct EvidenceReport {
    /// Diagonal of the data's bounding box.
    pub size: f64,
    /// Root mean square distance of all points, outliers included.
    pub rms_of_all: f64,
    /// Root mean square of the part of the residuals that neighbouring points share: misfit of
    /// shape rather than noise.
    pub systematic: f64,
    /// The systematic part, in standard deviations of that of independent residuals.
    pub systematic_z: f64,
    /// Standard deviation of the points from planes through their neighbours.
    pub local_noise: f64,
    /// Thickness of the thinnest wall of the model; `None` if unknown.
    pub thickness: Option<f64>,
    /// Smallest thickness of a wall or a gap of the model; `None` if unknown.
    pub detail: Option<f64>,
    /// Share of the model's surface without data.
    pub bare: f64,
    /// Share of the model's surface without data where most surface that faces this direction
    /// has data.
    pub overlooked: f64,
    /// Share of the outliers that lie on a surface of their own.
    pub clustered: f64,
    /// True if the search reached its best minimum repeatedly.
    pub certain: bool,
}

/// Estimate of a parameter.
#[derive(Clone, Debug, Serialize)]
pub struct ParameterReport {
    /// Name of the parameter.
    pub name: String,
    /// Number of the parameter, from 1.
    pub index: usize,
    /// Estimated value.
    pub value: f64,
    /// Standard deviation; `None` if the data do not determine the parameter.
    pub sd: Option<f64>,
    /// Bounds of the 95 % confidence interval; `None` if the data do not determine the parameter.
    pub ci95: Option<[f64; 2]>,
    /// Status of the estimate: `determined`, `weak`, `undetermined`, `fixed` or `at-bound`.
    pub status: &'static str,
    /// Unit of the value; `None` if unknown.
    pub unit: Option<String>,
    /// Lower and upper bound; `None` for an unbounded side.
    pub bounds: [Option<f64>; 2],
    /// Bound at which the value lies, `lower` or `upper`; `None` unless the status is `at-bound`.
    pub at_bound: Option<&'static str>,
    /// Round number that the designer may have meant; `None` if it could as well be near by chance.
    pub nominal: Option<f64>,
}

/// Pose of a template: x ↦ scale · rotation · x + translation.
#[derive(Clone, Debug, Serialize)]
pub struct PoseReport {
    /// Rotation matrix, by rows.
    pub rotation: [[f64; 3]; 3],
    /// Position of the template's origin.
    pub translation: Point3,
    /// Scale factor of the template's lengths.
    pub scale: f64,
}

/// Parameters that the data do not determine, alone or together.
#[derive(Clone, Debug, Serialize)]
pub struct UndeterminedReport {
    /// Names of the parameters.
    pub parameters: Vec<String>,
    /// Reason, as a sentence.
    pub why: String,
}

/// Distances of the data from the model, and of the model from the data.
#[derive(Clone, Debug, Serialize)]
pub struct TwoSidedReport {
    /// Distances of the points used from the model.
    pub data_to_model: DataToModelReport,
    /// Distances of samples of the model's surface from the data.
    pub model_to_data: ModelCoverage,
}

/// Distances of the points used from the model.
#[derive(Clone, Debug, Serialize)]
pub struct DataToModelReport {
    /// Root mean square distance.
    pub rms: f64,
    /// 95th percentile of the distances.
    pub p95: f64,
    /// Largest distance.
    pub max: f64,
}

/// Coverage of the model's surface by the data.
#[derive(Clone, Debug, Serialize)]
pub struct ModelCoverage {
    /// 95th percentile of the distances of the samples from the nearest point; `None` if it is
    /// infinite.
    pub p95: Option<f64>,
    /// Share of the samples without data near them.
    pub share_uncovered: f64,
    /// Distance from the nearest point above which a sample may count as uncovered.
    pub uncovered_from: f64,
    /// Number of samples of the surface.
    pub samples: usize,
    /// Share of the samples outside of the data's bounding box.
    pub share_outside: f64,
}

/// Statistics of the residuals of one part of the model.
#[derive(Clone, Debug, Serialize)]
pub struct PartReport {
    /// Name of the part.
    pub name: String,
    /// Number of points for which it is the nearest part.
    pub count: usize,
    /// Root mean square distance of these points.
    pub rms: f64,
    /// Mean signed distance of these points, positive outside.
    pub mean: f64,
    /// Largest distance of these points.
    pub max: f64,
    /// Share of the part's surface without data; `None` if no sample lies on it.
    pub uncovered: Option<f64>,
}

/// Another local minimum of the search.
#[derive(Clone, Debug, Serialize)]
pub struct OtherMinimumReport {
    /// Values of all parameters.
    pub parameters: Vec<f64>,
    /// Sum of f² over the points used.
    pub sum_f2: f64,
    /// Number of starts that led to it.
    pub hits: usize,
}

impl FitReport {
    /// Creates the report of a fit; `about` states the facts that the fit itself does not contain.
    pub fn new(found: &ScanFit, about: &About<'_>) -> Self {
        let fit = &found.fit;
        let unit = Some(&about.unit.unit).filter(|unit| !unit.is_empty());
        let info = found.template.frep.model().info();
        Self {
            verb: about.verb,
            scan: ScanReport {
                file: about.scan.to_owned(),
                format: about.read.format,
                rows: about.read.rows,
                dropped: about.read.dropped_points,
                subsampled: about.read.subsampled,
                origin: found.cloud.origin,
            },
            template: TemplateReport {
                name: about.template.to_owned(),
                title: info.title.clone(),
                fits: info.fits.clone(),
            },
            units: unit.cloned(),
            units_source: about.unit.reason.clone(),
            verdict: fit.verdict.as_str(),
            acceptable: fit.acceptable,
            reasons: fit.reasons.iter().map(ToString::to_string).collect(),
            evidence: EvidenceReport::new(&fit.evidence, fit.certain),
            complete: fit.complete,
            parameters: parameters(found, unit.map(String::as_str)),
            pose: pose(found),
            undetermined: undetermined(fit),
            sum_f2: fit.sum_f2,
            rms: fit.rms,
            noise: fit.noise,
            n_points: fit.n_points,
            n_used: fit.n_used,
            n_fitted: fit.n_fitted,
            n_outliers: fit.n_outliers,
            n_left_out: fit.n_left_out,
            two_sided: TwoSidedReport::new(fit),
            parts: parts(fit),
            method: about.method.name(),
            loss: fit.loss.name(),
            starts: fit.starts,
            hits: fit.hits,
            evaluations: fit.evaluations,
            other_minima: other_minima(found),
            spacing: fit.spacing,
            isolated: fit.isolated,
            neighbour_correlation: fit.neighbour_correlation,
            warnings: about.warnings.to_vec(),
            seed: about.seed,
            seconds: Seconds::from_phases(about.seconds),
        }
    }
}

/// Facts for a report that a fit does not contain: names, the reader's report, and options.
#[derive(Clone, Copy, Debug)]
pub struct About<'a> {
    /// Name of the verb.
    pub verb: &'static str,
    /// Name of the scan.
    pub scan: &'a str,
    /// Report of the scan's reader.
    pub read: &'a ReadReport,
    /// Name of the template.
    pub template: &'a str,
    /// Unit of the scan.
    pub unit: &'a UnitGuess,
    /// Method of minimisation.
    pub method: Method,
    /// Seed of the pseudo-random numbers.
    pub seed: u64,
    /// Warnings, a sentence each.
    pub warnings: &'a [String],
    /// Computing time by phase, in seconds.
    pub seconds: &'a [(&'a str, f64)],
}

impl EvidenceReport {
    fn new(evidence: &Evidence, certain: bool) -> Self {
        Self {
            size: evidence.size,
            rms_of_all: evidence.rms_of_all,
            systematic: evidence.systematic,
            systematic_z: evidence.systematic_z,
            local_noise: evidence.local_noise,
            thickness: finite(evidence.thickness),
            detail: finite(evidence.detail),
            bare: evidence.bare,
            overlooked: evidence.overlooked,
            clustered: evidence.clustered,
            certain,
        }
    }
}

impl TwoSidedReport {
    fn new(fit: &Fit) -> Self {
        let (to_model, to_data) = (&fit.data_to_model, &fit.model_to_data);
        Self {
            data_to_model: DataToModelReport {
                rms: to_model.rms,
                p95: to_model.p95,
                max: to_model.max,
            },
            model_to_data: ModelCoverage {
                p95: finite(to_data.p95),
                share_uncovered: to_data.share_uncovered,
                uncovered_from: to_data.uncovered_from,
                samples: to_data.samples,
                share_outside: to_data.share_outside,
            },
        }
    }
}

fn parameters(found: &ScanFit, length: Option<&str>) -> Vec<ParameterReport> {
    let parameter = |(i, p): (usize, &Estimate)| {
        let shift = found.template.shift[i];
        ParameterReport {
            name: p.name.clone(),
            index: i + 1,
            value: p.value + shift,
            sd: p.sd,
            ci95: p.ci95.map(|(lo, hi)| [lo + shift, hi + shift]),
            status: p.status.as_str(),
            unit: found.unit_of(i, length),
            bounds: [p.bounds.0, p.bounds.1].map(|bound| finite(bound + shift)),
            at_bound: at_bound(p),
            nominal: found.nominal(i),
        }
    };
    let all = found.fit.parameters.iter().enumerate();
    all.map(parameter).collect()
}

/// Returns the bound at which a value lies; `None` unless its status is `at-bound`.
fn at_bound(p: &Estimate) -> Option<&'static str> {
    let (lo, hi) = p.bounds;
    let is_lower = p.value - lo < hi - p.value;
    (p.status == Status::AtBound).then_some(if is_lower { "lower" } else { "upper" })
}

fn pose(found: &ScanFit) -> Option<PoseReport> {
    let placement = found.placement()?;
    Some(PoseReport {
        rotation: placement.rotation,
        translation: placement.translation,
        scale: placement.scale,
    })
}

fn undetermined(fit: &Fit) -> Vec<UndeterminedReport> {
    let open = fit.undetermined.iter().map(|open| UndeterminedReport {
        parameters: open.parameters.clone(),
        why: open.why.to_string(),
    });
    open.collect()
}

fn parts(fit: &Fit) -> Vec<PartReport> {
    let parts = fit.part_statistics.iter().map(|p| PartReport {
        name: p.name.clone(),
        count: p.count,
        rms: p.rms,
        mean: 0.0 - p.mean,
        max: p.max,
        uncovered: p.uncovered,
    });
    parts.collect()
}

fn other_minima(found: &ScanFit) -> Vec<OtherMinimumReport> {
    let shift = &found.template.shift;
    let minima = found.fit.other_minima.iter().map(|m| OtherMinimumReport {
        parameters: m.parameters.iter().zip(shift).map(|(v, s)| v + s).collect(),
        sum_f2: m.sum_f2,
        hits: m.hits,
    });
    minima.collect()
}
