//! The one way through a fit, for `fit` and `recover`: scan, template, settings, result.

use super::settings::{self, Start};
use crate::model::Language;
use crate::output::{self, Context, Failure, NO_RESULT};
use crate::progress::Progress;
use crate::{gallery, interrupt, scan};
use isoform::field::hyperfun::{Model, Pose};
use isoform::fit::{Beside, FitError, Loss, Method, Options};
use isoform::geom::PointCloud;
use isoform::io::{MeshPoints, ReadReport, UnitGuess};
use isoform::{CadDialect, Control, FitOptions, FitScanError, ParameterError, ScanFit, fit_scan};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What is asked for.
#[derive(Debug)]
pub(crate) struct Request {
    /// File or name of the template.
    pub(crate) template: PathBuf,
    /// How the program is read.
    pub(crate) language: Language,
    /// Where to start.
    pub(crate) start: Option<Start>,
    /// File of bounds.
    pub(crate) bounds: Option<PathBuf>,
    /// How the minimum is sought.
    pub(crate) method: Method,
    /// Loss of the last stage.
    pub(crate) loss: Loss,
    /// Parameters that are held, by name.
    pub(crate) fixed: Vec<(String, f64)>,
    /// Motion of the template as further parameters.
    pub(crate) pose: Option<Pose>,
    /// True if the model is written in the template's own coordinates.
    pub(crate) is_own_frame: bool,
    /// Language of .py files.
    pub(crate) dialect: CadDialect,
    /// Whether isolated points are left out.
    pub(crate) filter_outliers: bool,
    /// Clutter of these kinds is fitted like the rest.
    pub(crate) keep: Vec<Beside>,
    /// Unit of the scan, where the command line says so.
    pub(crate) units: Option<String>,
}

/// A fit with all that went into it.
pub(crate) struct Job {
    /// Name of the scan.
    pub(crate) scan: String,
    /// Report of its reader.
    pub(crate) read: ReadReport,
    /// The fit, in the library's words.
    pub(crate) found: ScanFit,
    /// Name of the template.
    pub(crate) template_name: String,
    /// Unit of the scan, and how it is known.
    pub(crate) unit: UnitGuess,
    /// True if the model is written in the template's own coordinates.
    pub(crate) is_own_frame: bool,
    /// Language of .py files.
    pub(crate) dialect: CadDialect,
    /// Seed of the search.
    pub(crate) seed: u64,
    /// Method of the search.
    pub(crate) method: Method,
    /// Seconds by phase, reading first.
    pub(crate) seconds: Vec<(&'static str, f64)>,
    /// All warnings: of reading, of the template, of the fit.
    pub(crate) warnings: Vec<String>,
}

impl Job {
    /// The unit of a parameter.
    pub(crate) fn unit_of(&self, i: usize) -> Option<String> {
        let length = Some(self.unit.unit.as_str()).filter(|unit| !unit.is_empty());
        self.found.unit_of(i, length)
    }
    /// The fitted program, in the coordinates that are asked for.
    pub(crate) fn program(&self) -> String {
        match self.is_own_frame {
            true => self.found.own_program(),
            false => self.found.program(),
        }
    }
    /// The name of the scan's file, without its ending.
    pub(crate) fn part_name(&self) -> String {
        let name = Path::new(&self.scan).file_stem().unwrap_or_default();
        name.to_string_lossy().into_owned()
    }
    /// 0, or 3 where the fit is refused or not complete, or 130.
    pub(crate) fn exit(&self) -> u8 {
        output::exit(self.found.fit.acceptable && self.found.fit.complete)
    }
}

/// Points as read, with the seconds it took.
pub(crate) struct Scan {
    pub(crate) name: String,
    pub(crate) cloud: PointCloud,
    pub(crate) report: ReadReport,
    pub(crate) seconds: f64,
}

/// Reads the scan of a fit: points, or the vertices of a mesh.
pub(crate) fn read_scan(
    path: &Path,
    format: Option<&str>,
    max_points: Option<usize>,
    context: &Context,
) -> Result<Scan, Failure> {
    let started = Instant::now();
    let (cloud, report) =
        scan::read_points(path, format, max_points, MeshPoints::Vertices, context)?;
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

/// Fits a model that has been read.
pub(crate) fn run_model(
    scan: Scan,
    model: &Model,
    request: &Request,
    context: &Context,
) -> Result<Job, Failure> {
    let options = fit_options(request, context)?;
    let progress = Progress::new(context);
    let show = |phase: &str, done: f64| progress.show(phase, done);
    let control = Control {
        progress: Some(&show),
        ..context.control()
    };
    let found = fit_scan(&scan.cloud, model, &options, &control)
        .map_err(|e| failure(&e, &scan.name, request))?;
    drop(progress);
    let unit = unit_of_scan(&found, &scan.report, request);
    let warnings = found.all_warnings(&scan.report, &unit);
    let mut seconds = vec![("read", scan.seconds)];
    seconds.extend(&found.seconds);
    Ok(Job {
        scan: scan.name,
        read: scan.report,
        found,
        template_name: request.template.display().to_string(),
        unit,
        is_own_frame: request.is_own_frame,
        dialect: request.dialect,
        seed: options.fit.seed,
        method: request.method,
        seconds,
        warnings,
    })
}

/// The request as the library takes it.
fn fit_options(request: &Request, context: &Context) -> Result<FitOptions, Failure> {
    Ok(FitOptions {
        start: match &request.start {
            Some(Start::Values(values)) => Some(values.clone()),
            Some(Start::Auto) | None => None,
        },
        bounds: match &request.bounds {
            Some(path) => settings::bounds(path)?,
            None => Vec::new(),
        },
        fixed: request.fixed.clone(),
        pose: request.pose,
        keep: request.keep.clone(),
        fit: Options {
            method: request.method,
            loss: request.loss,
            seed: context.global.seed,
            filter_outliers: request.filter_outliers,
            ..Options::default()
        },
    })
}

/// The unit of the scan: as asked for, else the template's or the file's.
fn unit_of_scan(found: &ScanFit, read: &ReadReport, request: &Request) -> UnitGuess {
    match &request.units {
        Some(unit) => UnitGuess {
            unit: unit.clone(),
            is_stated: true,
            reason: "the command line says so".to_owned(),
        },
        None => found.unit(read, &request.template.display().to_string()),
    }
}

/// Why there is no fit, with the option that may help.
fn failure(error: &FitScanError, scan: &str, request: &Request) -> Failure {
    let message = error.to_string();
    match error {
        FitScanError::NoPoints => Failure::input("no-points", format!("{scan}: {message}"))
            .hint("isoform inspect shows what is in the file"),
        FitScanError::Template(_) => Failure::input(
            "template",
            format!("{}: {message}", request.template.display()),
        ),
        FitScanError::Fixed { .. } => Failure::usage(format!("--fix {message}")),
        FitScanError::Bounds { error, .. } => {
            let path = request.bounds.as_deref().unwrap_or(Path::new("--bounds"));
            settings::bad_bounds(path, &error.to_string())
        }
        FitScanError::Start(why) => {
            let failure = Failure::usage(format!("--start has {message}"));
            match why {
                ParameterError::StartLength { names, .. } => failure.hint(format!(
                    "values for {}, in this order; or --start auto",
                    names.join(", ")
                )),
                _ => failure,
            }
        }
        FitScanError::Fit(error) => fit_failure(error, scan),
        _ => Failure::new(NO_RESULT, "fit", message),
    }
}

/// Why the search gave nothing.
fn fit_failure(error: &FitError, scan: &str) -> Failure {
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
