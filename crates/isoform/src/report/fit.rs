//! The report of a fit.

use super::{Seconds, finite};
use crate::ScanFit;
use isoform_fit::{Estimate, Evidence, Fit, Method, Status};
use isoform_geom::Point3;
use isoform_io::{ReadReport, UnitGuess};
use serde::Serialize;

/// Everything that a fit found, in the file's coordinates and unit.
#[derive(Clone, Debug, Serialize)]
pub struct FitReport {
    /// The verb of the command line: `fit` or `recover`.
    pub verb: &'static str,
    /// The scan.
    pub scan: ScanReport,
    /// The template.
    pub template: TemplateReport,
    /// The unit of lengths, if known.
    pub units: Option<String>,
    /// How the unit is known.
    pub units_source: String,
    /// `accepted`, `doubtful` or `refused`.
    pub verdict: &'static str,
    /// Whether the verdict is `accepted`.
    pub acceptable: bool,
    /// What stands against the fit, a sentence each.
    pub reasons: Vec<String>,
    /// What the verdict rests on.
    pub evidence: EvidenceReport,
    /// Whether all phases ran to their end; else this is the best so far.
    pub complete: bool,
    /// One by parameter.
    pub parameters: Vec<ParameterReport>,
    /// Where the template lies; none without a pose.
    pub pose: Option<PoseReport>,
    /// What the data leave open.
    pub undetermined: Vec<OpenReport>,
    /// Sum of f² over the points used.
    pub sum_f2: f64,
    /// Root of the mean square distance of the points used.
    pub rms: f64,
    /// Robust standard deviation of the distances of all points.
    pub noise: f64,
    /// Points given.
    pub n_points: usize,
    /// Points that are no outliers.
    pub n_used: usize,
    /// Points that settled the parameters.
    pub n_fitted: usize,
    /// Outliers.
    pub n_outliers: usize,
    /// Points left out as clutter.
    pub n_left_out: usize,
    /// Distances both ways.
    pub two_sided: TwoSided,
    /// One by part of the model.
    pub parts: Vec<PartReport>,
    /// How the minimum was sought.
    pub method: &'static str,
    /// The loss of the last stage.
    pub loss: &'static str,
    /// Starts of the search.
    pub starts: usize,
    /// Starts that led to the best minimum.
    pub hits: usize,
    /// Evaluations of residuals with derivatives.
    pub evaluations: usize,
    /// Other minima, best first.
    pub other_minima: Vec<OtherMinimumReport>,
    /// Typical distance of neighbouring points.
    pub spacing: f64,
    /// Share of points found isolated before the search.
    pub isolated: f64,
    /// Correlation of neighbouring residuals: near 0 for noise.
    pub neighbour_correlation: f64,
    /// What a reader should know, a sentence each.
    pub warnings: Vec<String>,
    /// Of everything random.
    pub seed: u64,
    /// Seconds by phase.
    pub seconds: Seconds,
}

/// The scan of a fit.
#[derive(Clone, Debug, Serialize)]
pub struct ScanReport {
    /// Its name.
    pub file: String,
    /// Its format.
    pub format: &'static str,
    /// Points in the file.
    pub rows: u64,
    /// Points that are not finite.
    pub dropped: u64,
    /// Whether only a sample of the points was taken.
    pub subsampled: bool,
    /// What was subtracted from all points.
    pub origin: Point3,
}

/// The template of a fit.
#[derive(Clone, Debug, Serialize)]
pub struct TemplateReport {
    /// Its file or its name in the gallery.
    pub name: String,
    /// Its title, as annotated.
    pub title: Option<String>,
    /// What it fits, as annotated.
    pub fits: Option<String>,
}

/// What the verdict on a fit rests on.
#[derive(Clone, Debug, Serialize)]
pub struct EvidenceReport {
    /// Diagonal of the data's box.
    pub size: f64,
    /// Root of the mean square distance of all points, outliers included.
    pub rms_of_all: f64,
    /// What neighbouring points share of that: misfit of shape.
    pub systematic: f64,
    /// The systematic part in deviations of what independent residuals show.
    pub systematic_z: f64,
    /// Deviation of points from planes through their neighbours.
    pub local_noise: f64,
    /// Thickness of the model's thinnest wall.
    pub thickness: Option<f64>,
    /// The smallest of its walls and gaps.
    pub detail: Option<f64>,
    /// Share of the model's surface without data.
    pub bare: f64,
    /// Share of it without data although most of what faces the same way has them.
    pub overlooked: f64,
    /// Share of the outliers that lie on a surface of their own.
    pub clustered: f64,
    /// Whether the search found its best minimum again and again.
    pub certain: bool,
}

/// The result for a parameter.
#[derive(Clone, Debug, Serialize)]
pub struct ParameterReport {
    /// Its name.
    pub name: String,
    /// Its number, from 1.
    pub index: usize,
    /// Its value.
    pub value: f64,
    /// Standard deviation; none where the data leave it open.
    pub sd: Option<f64>,
    /// 95 % interval.
    pub ci95: Option<[f64; 2]>,
    /// `determined`, `weak`, `undetermined`, `fixed` or `at-bound`.
    pub status: &'static str,
    /// Its unit, if known.
    pub unit: Option<String>,
    /// Lower and upper bound; none for no bound.
    pub bounds: [Option<f64>; 2],
    /// The bound it ran into, `lower` or `upper`.
    pub at_bound: Option<&'static str>,
    /// A round number that may be meant; none where chance tells one as well.
    pub nominal: Option<f64>,
}

/// Where a template lies.
#[derive(Clone, Debug, Serialize)]
pub struct PoseReport {
    /// Rotation matrix by rows.
    pub rotation: [[f64; 3]; 3],
    /// Place of the template's origin.
    pub translation: Point3,
    /// Factor on the template's lengths.
    pub scale: f64,
}

/// Parameters that the data leave open together.
#[derive(Clone, Debug, Serialize)]
pub struct OpenReport {
    /// Their names.
    pub parameters: Vec<String>,
    /// The reason, as a sentence.
    pub why: String,
}

/// Distances of the data from the model, and of the model from the data.
#[derive(Clone, Debug, Serialize)]
pub struct TwoSided {
    /// Of the points used.
    pub data_to_model: DataToModelReport,
    /// Of samples of the model's surface.
    pub model_to_data: Coverage,
}

/// Distances of the points used from the model.
#[derive(Clone, Debug, Serialize)]
pub struct DataToModelReport {
    /// Root of the mean square.
    pub rms: f64,
    /// 95 % are nearer.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

/// How the data cover the model's surface.
#[derive(Clone, Debug, Serialize)]
pub struct Coverage {
    /// 95 % of the samples are nearer to a point.
    pub p95: Option<f64>,
    /// Share of the samples that no data support.
    pub share_uncovered: f64,
    /// Distance from which a sample counts as such.
    pub uncovered_from: f64,
    /// Samples of the surface.
    pub samples: usize,
    /// Share of the samples outside of the data's box.
    pub share_outside: f64,
}

/// Residuals of one part of the model.
#[derive(Clone, Debug, Serialize)]
pub struct PartReport {
    /// Its name.
    pub name: String,
    /// Points that it is nearest to.
    pub count: usize,
    /// Root of the mean square of their distances.
    pub rms: f64,
    /// Their mean: positive outside.
    pub mean: f64,
    /// Largest distance.
    pub max: f64,
    /// Share of the part's surface that no data support.
    pub uncovered: Option<f64>,
}

/// Another minimum of the search.
#[derive(Clone, Debug, Serialize)]
pub struct OtherMinimumReport {
    /// All parameters.
    pub parameters: Vec<f64>,
    /// Sum of f² there.
    pub sum_f2: f64,
    /// Starts that led there.
    pub hits: usize,
}

impl FitReport {
    /// What `found` says of a scan of this name, read as `read` says, with its length in `unit`.
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
            two_sided: TwoSided::new(fit),
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
            seconds: Seconds::of(about.seconds),
        }
    }
}

/// What a fit itself does not know: names, the reader's report, what was asked for.
#[derive(Clone, Copy, Debug)]
pub struct About<'a> {
    /// The verb of the command line.
    pub verb: &'static str,
    /// The name of the scan.
    pub scan: &'a str,
    /// What its reader says.
    pub read: &'a ReadReport,
    /// The name of the template.
    pub template: &'a str,
    /// The unit of the scan.
    pub unit: &'a UnitGuess,
    /// How the minimum was sought.
    pub method: Method,
    /// Of everything random.
    pub seed: u64,
    /// What a reader should know.
    pub warnings: &'a [String],
    /// Seconds by phase.
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

impl TwoSided {
    fn new(fit: &Fit) -> Self {
        let (to_model, to_data) = (&fit.data_to_model, &fit.model_to_data);
        Self {
            data_to_model: DataToModelReport {
                rms: to_model.rms,
                p95: to_model.p95,
                max: to_model.max,
            },
            model_to_data: Coverage {
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

/// Which bound a value ran into.
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

fn undetermined(fit: &Fit) -> Vec<OpenReport> {
    let open = fit.undetermined.iter().map(|open| OpenReport {
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
