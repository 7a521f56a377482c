//! The one way through a fit, for `fit` and `recover`: scan, template, settings, result.

use super::settings::{Adjusted, Start};
use crate::model::Language;
use crate::output::{Context, DONE, Failure, NO_RESULT, PARTIAL};
use crate::progress::Progress;
use crate::{gallery, interrupt, scan};
use isoform::field::hyperfun::{Model, Pose};
use isoform::fit::{Control, Fit, FitError, Kind, Loss, Method, Options, fit};
use isoform::geom::PointCloud;
use isoform::io::{MeshPoints, ReadReport, UnitGuess, inspect_unit};
use isoform::{FrepTemplate, points_on_faces};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What is asked for.
#[derive(Debug)]
pub(crate) struct Request {
    pub(crate) template: PathBuf,
    pub(crate) language: Language,
    pub(crate) start: Option<Start>,
    pub(crate) bounds: Option<PathBuf>,
    pub(crate) method: Method,
    pub(crate) loss: Loss,
    pub(crate) fixed: Vec<(String, f64)>,
    pub(crate) pose: Option<Pose>,
    pub(crate) filter_outliers: bool,
    pub(crate) units: Option<String>,
}

/// A fit with all that went into it.
pub(crate) struct Job {
    pub(crate) scan: String,
    pub(crate) cloud: PointCloud,
    pub(crate) read: ReadReport,
    pub(crate) template: Adjusted,
    pub(crate) template_name: String,
    pub(crate) unit: UnitGuess,
    pub(crate) fit: Fit,
    pub(crate) seed: u64,
    pub(crate) method: Method,
    /// Seconds by phase, reading first.
    pub(crate) seconds: Vec<(&'static str, f64)>,
    /// All warnings: of reading, of the template, of the fit.
    pub(crate) warnings: Vec<String>,
}

impl Job {
    /// The values in the file's coordinates.
    pub(crate) fn values(&self) -> Vec<f64> {
        self.fit
            .parameters
            .iter()
            .zip(&self.template.shift)
            .map(|(p, s)| p.value + s)
            .collect()
    }
    /// The values as the template takes them, relative to the cloud's origin.
    pub(crate) fn relative(&self) -> Vec<f64> {
        self.fit.values()
    }
    /// The fitted program, in the file's coordinates.
    pub(crate) fn program(&self) -> String {
        self.template
            .frep
            .fitted_program(&self.relative(), self.cloud.origin)
    }
    /// Deviation per point: outside positive, as inspectors have it.
    pub(crate) fn deviation(&self) -> Vec<f64> {
        self.fit.residuals.iter().map(|r| 0.0 - r).collect()
    }
    /// The unit of a parameter.
    pub(crate) fn unit_of(&self, i: usize) -> Option<String> {
        let p = &isoform::fit::Template::parameters(&self.template)[i];
        let length = || Some(self.unit.unit.clone()).filter(|u| !u.is_empty());
        match p.kind {
            Kind::X | Kind::Y | Kind::Z | Kind::Length => length().or_else(|| p.unit.clone()),
            Kind::Angle => Some("rad".to_owned()),
            Kind::Ratio => None,
            Kind::Number => p.unit.clone(),
        }
    }
    /// 0, or 3 where the fit is refused or not complete, or 130.
    pub(crate) fn exit(&self) -> u8 {
        match () {
            () if interrupt::happened() => interrupt::INTERRUPTED,
            () if self.fit.acceptable && self.fit.complete => DONE,
            () => PARTIAL,
        }
    }
}

/// Points as read, with the seconds it took.
pub(crate) struct Scan {
    pub(crate) name: String,
    pub(crate) cloud: PointCloud,
    pub(crate) report: ReadReport,
    pub(crate) seconds: f64,
}

/// About how many points are added on the flat faces of a CAD model.
const ON_FACES: usize = 6000;

/// Reads the scan of a fit: points or vertices, and of a CAD mesh also points of its flat faces.
pub(crate) fn read_scan(
    path: &Path,
    format: Option<&str>,
    max_points: Option<usize>,
    context: &Context,
) -> Result<Scan, Failure> {
    let started = Instant::now();
    let (mut cloud, mut report) =
        scan::read_points(path, format, max_points, MeshPoints::Vertices, context)?;
    if !cloud.triangles.is_empty() {
        let (with_faces, added) = points_on_faces(&cloud, ON_FACES);
        if added > 0 {
            report.warnings.push(format!(
                "a CAD model: {added} points of its flat faces and straight lines were added to {} vertices",
                cloud.points.len()
            ));
            cloud = with_faces;
        }
    }
    Ok(Scan {
        name: path.display().to_string(),
        cloud,
        report,
        seconds: started.elapsed().as_secs_f64(),
    })
}

/// Fits a template to a scan.
pub(crate) fn run(scan: Scan, request: &Request, context: &Context) -> Result<Job, Failure> {
    let model = gallery::template(&request.template, &request.language, context)?;
    run_model(scan, &model, request, context)
}

pub(crate) fn run_model(
    scan: Scan,
    model: &Model,
    request: &Request,
    context: &Context,
) -> Result<Job, Failure> {
    let started = Instant::now();
    let Scan {
        name,
        mut cloud,
        report: read,
        seconds,
    } = scan;
    let mut warnings = read.warnings.clone();
    if read.dropped_points > 0 {
        warnings.push(format!(
            "{} points are not finite and were left out",
            read.dropped_points
        ));
    }
    if cloud.points.is_empty() {
        return Err(
            Failure::input("no-points", format!("{name}: there is no point to fit to"))
                .hint("isoform inspect shows what is in the file"),
        );
    }
    let make = |cloud: &PointCloud| {
        match request.pose {
            None => FrepTemplate::new(model, &cloud.points),
            Some(pose) => FrepTemplate::with_pose(model, pose, &cloud.points),
        }
        .map_err(|e| Failure::input("template", format!("{}: {e}", request.template.display())))
    };
    let mut template = Adjusted::new(make(&cloud)?, cloud.origin);
    if cloud.origin != [0.0; 3] && !template.moves() {
        // The template's own coordinates are the file's.
        cloud.points = (0..cloud.points.len()).map(|i| cloud.absolute(i)).collect();
        cloud.origin = [0.0; 3];
        warnings
            .push("the points lie far from the origin and the template cannot be moved: digits are lost; try --pose translate".to_owned());
        template = Adjusted::new(make(&cloud)?, cloud.origin);
    }
    template.hold(&request.fixed)?;
    let unit = match &request.units {
        Some(unit) => UnitGuess {
            unit: unit.clone(),
            is_stated: true,
            reason: "the command line says so".to_owned(),
        },
        None => inspect_unit(&cloud, &read),
    };
    if let Some(said) = &model.info().unit
        && !unit.unit.is_empty()
        && *said != unit.unit
    {
        warnings.push(format!(
            "the template is written in {said}, the scan in {} ({}); values are in the scan's unit",
            unit.unit, unit.reason
        ));
    }
    let options = Options {
        method: request.method,
        loss: request.loss,
        start: template.start(request.start.as_ref())?,
        bounds: request
            .bounds
            .as_deref()
            .map_or(Ok(Vec::new()), |path| template.bounds(path))?,
        seed: context.global.seed,
        filter_outliers: request.filter_outliers,
        ..Options::default()
    };
    let prepared = started.elapsed().as_secs_f64();
    let progress = Progress::new(context);
    let show = |phase: &str, done: f64| progress.show(phase, done);
    let control = Control {
        cancelled: Some(interrupt::watch()),
        deadline: context.deadline,
        progress: Some(&show),
    };
    let mut fit =
        fit(&cloud.points, &template, &options, &control).map_err(|e| failure(&e, &name))?;
    if !matches!(request.start, Some(Start::Values(_)))
        && request.bounds.is_none()
        && request.method == Method::Default
    {
        turn_until_it_fits(&cloud, &mut template, &mut fit, request, &options, &control)?;
    }
    drop(progress);
    warnings.extend(fit.warnings.iter().cloned());
    let mut all = vec![("read", seconds), ("template", prepared)];
    all.extend(fit.seconds.iter().copied());
    let template_name = request.template.display().to_string();
    let method = request.method;
    Ok(Job {
        scan: name,
        cloud,
        read,
        template,
        template_name,
        unit,
        fit,
        seed: options.seed,
        method,
        seconds: all,
        warnings,
    })
}

/// A misfit below this share of the size settles how the scan stands; above, other ways are tried.
const SETTLED: f64 = 4e-3;
/// Starts of each other way: enough to tell whether it is the right one.
const STARTS_PER_TURN: usize = 8;

/// Scans come in any pose: where the template does not fit well as the scan stands, the other ways to stand it are tried, and the best
/// is kept. In the order of the ways, so that the result does not depend on threads.
fn turn_until_it_fits(
    cloud: &PointCloud,
    template: &mut Adjusted,
    best: &mut Fit,
    request: &Request,
    options: &Options,
    control: &Control<'_>,
) -> Result<(), Failure> {
    let size = cloud.bounds().diagonal();
    let misfit = |f: &Fit| {
        f.rms * (1.0 + f.model_to_data.share_uncovered) + if f.acceptable { 0.0 } else { size }
    };
    let settled = |f: &Fit| misfit(f) < SETTLED * size;
    if settled(best) {
        return Ok(());
    }
    let quick = Options {
        most_starts: STARTS_PER_TURN,
        ..options.clone()
    };
    let mut chosen = None;
    for frep in template.frep.turned(&cloud.points) {
        if control.stops() {
            break;
        }
        let mut turned = Adjusted::new(frep, cloud.origin);
        turned.hold(&request.fixed)?;
        let Ok(mut found) = fit(&cloud.points, &turned, &quick, control) else {
            continue;
        };
        if misfit(&found) < 0.7 * misfit(best) {
            std::mem::swap(best, &mut found);
            add_seconds(best, &found);
            chosen = Some(turned);
        } else {
            add_seconds(best, &found);
        }
        if settled(best) {
            break;
        }
    }
    if let Some(turned) = chosen {
        *template = turned;
    }
    Ok(())
}

/// Adds the seconds of an attempt that was dropped.
fn add_seconds(kept: &mut Fit, dropped: &Fit) {
    for (phase, seconds) in &dropped.seconds {
        match kept.seconds.iter_mut().find(|(p, _)| p == phase) {
            Some((_, s)) => *s += seconds,
            None => kept.seconds.push((phase, *seconds)),
        }
    }
}

fn failure(error: &FitError, scan: &str) -> Failure {
    let message = error.to_string();
    match error {
        FitError::Bounds { .. } => {
            Failure::input("bounds", message).hint("--bounds, or min= and max= in the template")
        }
        FitError::Tie { .. } => {
            Failure::input("tie", message).hint("the tie= annotations of the template")
        }
        FitError::NothingFree => Failure::usage(message).hint("fewer --fix"),
        FitError::NotFinite { .. } | FitError::Length { .. } => Failure::usage(message),
        FitError::TooFewPoints { .. } => Failure::input("few-points", format!("{scan}: {message}"))
            .hint("--fix some parameters, or a denser scan"),
        FitError::NoFiniteStart { .. } => Failure::new(NO_RESULT, "no-finite-value", message)
            .hint("--start or --bounds within the template's domain"),
        FitError::Stopped if interrupt::happened() => {
            Failure::new(interrupt::INTERRUPTED, "interrupted", message)
        }
        FitError::Stopped => {
            Failure::new(NO_RESULT, "time-limit", message).hint("a longer --time-limit")
        }
        _ => Failure::new(NO_RESULT, "fit", message),
    }
}
