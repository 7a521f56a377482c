//! The one way through a fit, for `fit` and `recover`: scan, template, settings, result.

use super::settings::{Adjusted, Start};
use crate::model::Language;
use crate::output::{Context, DONE, Failure, NO_RESULT, PARTIAL};
use crate::progress::Progress;
use crate::{gallery, interrupt, scan};
use isoform::field::hyperfun::{Model, Pose};
use isoform::fit::{
    Beside, Control, Finding, Fit, FitError, Kind, Loss, Method, Options, Warning, fit, search,
    settle,
};
use isoform::geom::{Point3, PointCloud};
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
    /// Clutter of these kinds is fitted like the rest.
    pub(crate) keep: Vec<Beside>,
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
    if cloud.points.is_empty() {
        return Err(
            Failure::input("no-points", format!("{name}: there is no point to fit to"))
                .hint("isoform inspect shows what is in the file"),
        );
    }
    let make = |points: &[Point3]| {
        match request.pose {
            None => FrepTemplate::new(model, points),
            Some(pose) => FrepTemplate::with_pose(model, pose, points),
        }
        .map_err(|e| Failure::input("template", format!("{}: {e}", request.template.display())))
    };
    let mut template = Adjusted::new(make(&cloud.points)?, cloud.origin);
    if cloud.origin != [0.0; 3] && !template.moves() {
        // The template's own coordinates are the file's.
        cloud.points = (0..cloud.points.len()).map(|i| cloud.absolute(i)).collect();
        cloud.origin = [0.0; 3];
        warnings
            .push("the points lie far from the origin and the template cannot be moved: digits are lost; try --pose translate".to_owned());
        template = Adjusted::new(make(&cloud.points)?, cloud.origin);
    }
    template.hold(&request.fixed)?;
    let unit = match &request.units {
        Some(unit) => UnitGuess {
            unit: unit.clone(),
            is_stated: true,
            reason: "the command line says so".to_owned(),
        },
        None => believed(
            inspect_unit(&cloud, &read),
            model.info().unit.as_deref(),
            &request.template,
        ),
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
    let task = Task {
        request,
        options: &options,
        control: &control,
        origin: cloud.origin,
        scan: &name,
    };
    let fit = task.fit_beside_clutter(&cloud.points, &mut template, &make)?;
    drop(progress);
    warnings.extend(fit.warnings.iter().map(sentence));
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

/// The template's unit in place of a guess: its bounds and starts are numbers of that unit, and a
/// scan in another one would not meet them.
fn believed(seen: UnitGuess, template: Option<&str>, name: &Path) -> UnitGuess {
    match template {
        Some(unit) if !seen.is_stated => UnitGuess {
            unit: unit.to_owned(),
            is_stated: true,
            reason: format!("the template {} says so", name.display()),
        },
        _ => seen,
    }
}

/// Starts of each other way to stand: enough to tell whether it is the right one.
const STARTS_PER_TURN: usize = 8;
/// Another way must be better by this factor: alike ones (the symmetries of a part) are one.
const BETTER: f64 = 0.97;
/// A scan that stands askew by more than this (as a Rodrigues vector: 0.6 degrees) is looked at
/// along the template's axes again, since shares of its box change with the frame.
const ASKEW: f64 = 5e-3;
/// Makes the seed of the second search, which must come to the place of the first.
const OTHER_SEED: u64 = 0x5EED;
/// Two searches agree when their misfits differ by less than this share.
const AGREE: f64 = 0.03;
/// A value this near to a bound, as a share of the range, has reached it.
const AT_BOUND: f64 = 0.005;
/// The same for a fit that is not accepted: one that a bound keeps from its place may end beside
/// the bound, too.
const BESIDE_BOUND: f64 = 0.05;
/// Rounds in which bounds that are shares of the box give way.
const WIDENINGS: usize = 2;

/// Most of the points that may be left out as clutter, as a share: with more gone, what is left
/// need not be the part.
const MOST_LEFT_OUT: f64 = 0.6;

/// What all stages of a fit share.
struct Task<'a> {
    request: &'a Request,
    options: &'a Options,
    control: &'a Control<'a>,
    /// What is added to the points to get the file's coordinates.
    origin: Point3,
    /// Name of the scan.
    scan: &'a str,
}

impl Task<'_> {
    /// The fit; where it is in doubt, and planes or other objects beside the part are seen, the fit
    /// without them if that is better.
    fn fit_beside_clutter(
        &self,
        points: &[Point3],
        template: &mut Adjusted,
        make: &dyn Fn(&[Point3]) -> Result<FrepTemplate, Failure>,
    ) -> Result<Fit, Failure> {
        let mut whole = self.fit_in_pose(points, template)?;
        let is_clutter = |f: &Finding| {
            matches!(
                f,
                Finding::Apart { .. } | Finding::Table { .. } | Finding::Stray { .. }
            )
        };
        if !whole.findings.iter().any(is_clutter) || self.control.is_stopped() {
            return Ok(whole);
        }
        let started = Instant::now();
        let scan = isoform::fit::Scan::new(points, self.options, self.control)
            .map_err(|e| failure(&e, self.scan))?;
        let clutter = scan.clutter();
        let mut beside: Vec<Option<Beside>> = points
            .iter()
            .map(|p| clutter.of(*p).filter(|b| !self.request.keep.contains(b)))
            .collect();
        let mut kept = kept_of(points, &beside);
        whole
            .seconds
            .push(("clutter", started.elapsed().as_secs_f64()));
        let is_most = kept.len() as f64 >= (1.0 - MOST_LEFT_OUT) * points.len() as f64;
        if kept.len() == points.len() || !is_most {
            return Ok(whole);
        }
        let fit_kept = |kept: &[Point3]| -> Result<Option<(Fit, Adjusted)>, Failure> {
            let mut alone = self.adjusted(make(kept)?)?;
            // Too few points, say: the fit of all stands.
            let part = self.fit_in_pose(kept, &mut alone).ok();
            Ok(part.map(|part| (part, alone)))
        };
        let Some((mut part, mut alone)) = fit_kept(&kept)? else {
            return Ok(whole);
        };
        let fringe = clutter.fringe(&part, &kept);
        if fringe.contains(&true) && !self.request.keep.contains(&Beside::Plane) {
            let mut of_kept = fringe.iter();
            for b in beside.iter_mut().filter(|b| b.is_none()) {
                *b = of_kept.next().filter(|f| **f).map(|_| Beside::Plane);
            }
            kept = kept_of(points, &beside);
            let Some((mut found, again)) = fit_kept(&kept)? else {
                return Ok(whole);
            };
            found.add_seconds(&part);
            (part, alone) = (found, again);
        }
        part = part.with_left_out(&alone, points, &beside);
        if part.verdict >= whole.verdict {
            whole.add_seconds(&part);
            return Ok(whole);
        }
        part.add_seconds(&whole);
        *template = alone;
        part.warnings.extend(told_of(&beside));
        Ok(part)
    }

    /// The fit, in whatever pose the scan comes: where the template does not fit as the scan
    /// stands, the other ways are tried; then the box is measured along the template's own axes;
    /// then bounds that presume a whole part give way where the fit ran into them.
    fn fit_in_pose(&self, points: &[Point3], template: &mut Adjusted) -> Result<Fit, Failure> {
        let (request, options, control) = (self.request, self.options, self.control);
        let failed = |e: FitError| failure(&e, self.scan);
        let is_free = !matches!(request.start, Some(Start::Values(_)))
            && request.bounds.is_none()
            && request.method == Method::Default;
        if !is_free {
            return fit(points, template, options, control).map_err(failed);
        }
        let scan = isoform::fit::Scan::new(points, options, control).map_err(failed)?;
        let quick = Options {
            most_starts: STARTS_PER_TURN,
            refine: false,
            ..options.clone()
        };
        let mut best = search(&scan, template, options, control).map_err(failed)?;
        if !best.is_at_noise() {
            let turned = template.frep.turned(points);
            for frep in turned {
                if control.is_stopped() {
                    break;
                }
                let turned = self.adjusted(frep)?;
                let Ok(mut found) = search(&scan, &turned, &quick, control) else {
                    continue;
                };
                if found.misfit < BETTER * best.misfit {
                    std::mem::swap(&mut best, &mut found);
                    *template = turned;
                }
                best.add_seconds(&found);
                if best.is_at_noise() {
                    break;
                }
            }
        }
        let is_askew = template.frep.askew(best.values()) > ASKEW;
        if (is_askew || !best.is_at_noise() || !best.is_certain()) && !control.is_stopped() {
            let frep = template.frep.aligned(best.values(), points);
            let aligned = self.adjusted(frep)?;
            let other = Options {
                seed: options.seed ^ OTHER_SEED,
                ..options.clone()
            };
            if let Ok(mut found) = search(&scan, &aligned, &other, control) {
                if (found.misfit / best.misfit - 1.0).abs() < AGREE {
                    found.confirm();
                    best.confirm();
                }
                if found.misfit < best.misfit / BETTER {
                    std::mem::swap(&mut best, &mut found);
                    *template = aligned;
                }
                best.add_seconds(&found);
            }
        }
        let mut result = settle(&scan, template, options, control, best).map_err(failed)?;
        for _ in 0..WIDENINGS {
            let values = result.values();
            let near = if result.acceptable {
                AT_BOUND
            } else {
                BESIDE_BOUND
            };
            let Some(frep) = template.frep.widened(&values, points, near) else {
                break;
            };
            let wider = self.adjusted(frep)?;
            let Ok(found) = search(&scan, &wider, options, control) else {
                break;
            };
            let mut again = settle(&scan, &wider, options, control, found).map_err(failed)?;
            let cost = |f: &Fit| f.rms * (1.0 + f.n_outliers as f64 / f.n_points as f64);
            if cost(&again) > cost(&result) / BETTER {
                result.add_seconds(&again);
                break;
            }
            again.add_seconds(&result);
            (result, *template) = (again, wider);
        }
        Ok(result)
    }

    /// The template with what the command line holds.
    fn adjusted(&self, frep: FrepTemplate) -> Result<Adjusted, Failure> {
        let mut adjusted = Adjusted::new(frep, self.origin);
        adjusted.hold(&self.request.fixed)?;
        Ok(adjusted)
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
            .hint("--fix some parameters, a denser scan, or a larger --max-points"),
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

/// The points that nothing is beside the part for.
fn kept_of(points: &[Point3], beside: &[Option<Beside>]) -> Vec<Point3> {
    let kept = points.iter().zip(beside).filter(|(_, b)| b.is_none());
    kept.map(|(p, _)| *p).collect()
}

/// A warning for each kind of points that were left out.
fn told_of(beside: &[Option<Beside>]) -> impl Iterator<Item = Warning> {
    let kinds = [Beside::Plane, Beside::Apart, Beside::Stray];
    kinds.into_iter().filter_map(|why| {
        let count = beside.iter().filter(|b| **b == Some(why)).count();
        let points = beside.len();
        (count > 0).then_some(Warning::Beside { why, count, points })
    })
}

/// A warning of the fit, with the option that takes points in which were left out.
fn sentence(warning: &Warning) -> String {
    let option = match warning {
        Warning::Beside { why, .. } => match why {
            Beside::Plane => "--keep-planes",
            Beside::Apart => "--keep-apart",
            Beside::Stray => "--no-outlier-filter",
        },
        other => return other.to_string(),
    };
    format!("{warning}; {option} fits them, too")
}
