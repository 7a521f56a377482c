//! The one way through a fit, for `fit` and `recover`: scan, template, settings, result.

use super::settings::{self, Start};
use super::{FrameName, Settings};
use super::{document, files, solid};
use crate::memory;
use crate::model::Language;
use crate::output::{self, Context, Failure, Global, Listener, NO_RESULT};
use crate::progress::Progress;
use crate::{gallery, interrupt, scan, solids};
use isoform::field::hyperfun::Model;
use isoform::fit::{FitError, Method, Options};
use isoform::geom::PointCloud;
use isoform::io::{MeshPoints, ReadReport, UnitGuess};
use isoform::{
    CadDialect, Control, FitOptions, FitScanError, MeshModelOptions, ParameterError, ScanFit,
    fit_scan,
};
use serde_json::Value;
use std::path::Path;
use std::time::Instant;

/// A fit with all that went into it.
pub struct Job {
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
    /// Returns a fit of points that were not read from a file, with their report; the names of the
    /// points and of the template are for documents.
    pub fn new(
        found: ScanFit,
        (scan, template): (String, String),
        read: ReadReport,
        (method, seed): (Method, u64),
    ) -> Self {
        let unit = found.unit(&read, &template);
        Self {
            scan,
            warnings: found.all_warnings(&read, &unit),
            read,
            template_name: template,
            unit,
            is_own_frame: false,
            dialect: CadDialect::Build123d,
            seed,
            method,
            seconds: found.seconds.clone(),
            found,
        }
    }
    /// Returns the fit.
    pub fn found(&self) -> &ScanFit {
        &self.found
    }
    /// Returns the document of `fit --json`.
    pub fn document(&self) -> Value {
        document::document(self, "fit")
    }
    /// Returns the points with their deviations, part and colours.
    pub fn cloud(&self) -> PointCloud {
        files::deviations(self)
    }
    /// Writes a file of the fit; its ending says which.
    ///
    /// # Errors
    /// [`Failure`] if nothing is written with this ending, or there is no such solid.
    pub fn save(&self, path: &Path, listener: Listener) -> Result<(), Failure> {
        let context = Context::new(Global::default(), Some(listener));
        let paths = vec![path.to_owned()];
        if !solids::is_solid(path) {
            files::check(&paths)?;
            return files::write_one(self, path, &context);
        }
        solids::check(&paths)?;
        let wanted = solid::Wanted {
            paths,
            is_asked: true,
            is_forced: true,
            options: MeshModelOptions::default(),
        };
        match solid::tell(self, &Language::default(), &wanted, &context).failure {
            Some(failure) => Err(failure),
            None => Ok(()),
        }
    }
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
        name: memory::name(path),
        cloud,
        report,
        seconds: started.elapsed().as_secs_f64(),
    })
}

/// Fits a template to a scan.
pub(crate) fn run(
    scan: Scan,
    template: &Path,
    settings: &Settings,
    context: &Context,
) -> Result<Job, Failure> {
    let model = gallery::template(template, &settings.language, context)?;
    run_model(scan, (template, &model), settings, context)
}

/// Fits a model that has been read, with its path.
pub(crate) fn run_model(
    scan: Scan,
    (template, model): (&Path, &Model),
    settings: &Settings,
    context: &Context,
) -> Result<Job, Failure> {
    let options = fit_options(settings, context)?;
    let progress = Progress::new(context);
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

/// Why there is no fit, with the option that may help.
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
        FitError::Stopped if interrupt::happened() => {
            Failure::new(interrupt::INTERRUPTED, "interrupted", message)
        }
        FitError::Stopped => {
            Failure::new(NO_RESULT, "time-limit", message).hint("a longer --time-limit")
        }
        _ => Failure::new(NO_RESULT, "fit", message),
    }
}
