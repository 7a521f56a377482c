//! The one way through a fit, for `fit` and `recover`: scan, template, settings, result.

use super::job::Job;
use super::settings::{self, FrameName, Settings, Start};
use crate::context::Context;
use crate::failure::{Failure, NO_RESULT};
use crate::memory;
use crate::scan;
use isoform::field::hyperfun::Model;
use isoform::fit::{FitError, Options};
use isoform::geom::PointCloud;
use isoform::io::{MeshPoints, ReadReport, UnitGuess};
use isoform::{Control, FitOptions, FitScanError, ParameterError, ScanFit, fit_scan};
use std::path::Path;
use std::time::Instant;

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
        name: memory::name(path),
        cloud,
        report,
        seconds: started.elapsed().as_secs_f64(),
    })
}

/// Fits a model that has been read, with its path, and true if its start values were recognised in
/// the scan.
pub(crate) fn run(
    scan: Scan,
    (template, model, is_measured): (&Path, &Model, bool),
    settings: &Settings,
    context: &Context,
) -> Result<Job, Failure> {
    let mut options = fit_options(settings, context)?;
    options.fit.is_start_measured = is_measured && options.start.is_none();
    let progress = context.progress();
    let show = |phase: &str, done: f64| progress.show(phase, done);
    let control = Control {
        progress: Some(&show),
        ..context.control()
    };
    let found = fit_scan(&scan.cloud, model, &options, &control)
        .map_err(|e| failure(&e, &scan.name, template, settings.bounds.as_deref()))?;
    drop(progress);
    let template = memory::name(template);
    let unit = unit_of_scan(&found, &scan.report, &template, settings);
    let warnings = found.all_warnings(&scan.report, &unit);
    let mut seconds = vec![("read", scan.seconds)];
    seconds.extend(&found.seconds);
    Ok(Job {
        scan: scan.name,
        read: scan.report,
        found,
        template_name: template,
        unit,
        is_own_frame: matches!(settings.frame, FrameName::Part),
        dialect: settings.dialect,
        seed: options.fit.seed,
        method: settings.method,
        seconds,
        warnings,
    })
}

/// Returns the settings as the library takes them.
pub(super) fn fit_options(settings: &Settings, context: &Context) -> Result<FitOptions, Failure> {
    Ok(FitOptions {
        start: match &settings.start {
            Some(Start::Values(values)) => Some(values.clone()),
            Some(Start::Auto) | None => None,
        },
        bounds: match &settings.bounds {
            Some(path) => settings::bounds(path)?,
            None => Vec::new(),
        },
        fixed: settings.fix.clone(),
        pose: settings.pose,
        keep: settings.keep(),
        fit: Options {
            method: settings.method,
            loss: settings.loss,
            seed: context.global.seed,
            filter_outliers: !settings.no_outlier_filter,
            ..Options::default()
        },
    })
}

/// The unit of the scan: as asked for, else the template's or the file's.
fn unit_of_scan(
    found: &ScanFit,
    read: &ReadReport,
    template: &str,
    settings: &Settings,
) -> UnitGuess {
    match &settings.units {
        Some(unit) => UnitGuess {
            unit: unit.clone(),
            is_stated: true,
            reason: "the command line says so".to_owned(),
        },
        None => found.unit(read, template),
    }
}

/// Converts an error of the fit to a failure, with the option that may help.
pub(crate) fn failure(
    error: &FitScanError,
    scan: &str,
    template: &Path,
    bounds: Option<&Path>,
) -> Failure {
    let message = error.to_string();
    match error {
        FitScanError::NoPoints => Failure::input("no-points", format!("{scan}: {message}"))
            .hint("isoform inspect shows what is in the file"),
        FitScanError::Template(_) => {
            Failure::input("template", format!("{}: {message}", template.display()))
        }
        FitScanError::Fixed { .. } => Failure::usage(format!("--fix {message}")),
        FitScanError::Bounds { error, .. } => {
            let path = bounds.unwrap_or(Path::new("--bounds"));
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
        FitError::Stopped => Failure::stopped(message, ""),
        _ => Failure::new(NO_RESULT, "fit", message),
    }
}
