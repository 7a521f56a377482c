//! The files that a fit writes, by their endings.

use super::document;
use super::job::Job;
use super::solid;
use crate::context::Context;
use crate::context::Global;
use crate::disk;
use crate::failure::{Failure, NO_RESULT};
use crate::kind::is_solid;
use crate::language::Language;
use crate::mesh::files::is_mesh;
use crate::outcome;
use crate::progress::Listener;
use crate::solids;
use crate::watchdog;
use crate::watchdog::Writing;
use crate::{report, scan};
use isoform::field::hyperfun::{Mode, Model};
use isoform::geom::{Column, PointCloud};
use isoform::io::{WriteOptions, deviation_colors, write_path};
use isoform::{CadDialect, CadOptions, CadProgramError, MeshModelOptions, cad_program};
use std::path::{Path, PathBuf};
use std::time::Instant;

impl Job {
    /// Returns the points with their deviations, part and colours.
    pub fn cloud(&self) -> PointCloud {
        deviations(self)
    }
    /// Writes a file of the fit in the format of its ending.
    ///
    /// # Errors
    /// [`Failure`] if the ending is unknown, or the fit has no solid.
    pub fn save(&self, path: &Path, listener: Listener) -> Result<(), Failure> {
        let context = Context::new(Global::default(), Some(listener));
        let paths = vec![path.to_owned()];
        if !is_solid(path) {
            check(&paths)?;
            return write_one(self, path, &context);
        }
        solids::check(&paths)?;
        let wanted = solid::SolidRequest {
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
}

/// Content of an output file.
#[derive(Clone, Copy)]
enum FileContent {
    /// The fitted model.
    Program,
    /// The fitted model as a program of CAD, in Python.
    Python,
    /// Program of the fitted part in OpenSCAD.
    OpenScad,
    /// The points with their deviations.
    Points,
    /// The page.
    Report,
    /// JSON document, as printed by --json.
    Document,
}

/// Returns the content that an ending stands for. Solids are made from the fit, not written by it.
fn named(path: &Path) -> Option<FileContent> {
    if is_solid(path) {
        return None;
    }
    let ending = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_ascii_lowercase();
    match ending.as_str() {
        "hf" => Some(FileContent::Program),
        "py" => Some(FileContent::Python),
        "scad" => Some(FileContent::OpenScad),
        "ply" | "xyz" | "txt" | "csv" => Some(FileContent::Points),
        "html" | "htm" => Some(FileContent::Report),
        "json" => Some(FileContent::Document),
        _ => None,
    }
}

/// Returns true if it is a fit that is written with that ending.
pub(crate) fn is_result(path: &Path) -> bool {
    named(path).is_some()
}

/// Returns the content for a file, or a failure that lists the valid endings.
fn kind(path: &Path) -> Result<FileContent, Failure> {
    named(path).ok_or_else(|| {
        if path == Path::new("-") {
            return Failure::usage("results are written to files, not to stdout")
                .hint("--json for the document of the fit on stdout, or -o with names of files");
        }
        let failure = Failure::usage(format!(
            "{}: no result is written with this ending",
            path.display()
        ));
        if is_mesh(path) {
            return failure.hint("isoform recover, which meshes the fitted model");
        }
        failure.hint("-o with .hf, .py, .scad, .ply, .xyz, .csv, .html, .json, .step or .brep.json")
    })
}

/// Finds out before the work whether every file can be of its kind and its folder exists.
pub(crate) fn check(paths: &[PathBuf]) -> Result<(), Failure> {
    for path in paths {
        kind(path)?;
        disk::check_folder(path)?;
    }
    Ok(())
}

/// Writes all files, records the time and returns the written paths. If one file fails, the others
/// are written nevertheless.
pub(crate) fn write(
    job: &mut Job,
    paths: &[PathBuf],
    context: &Context,
) -> Result<Vec<PathBuf>, Failure> {
    let _writing = Writing::new();
    let started = Instant::now();
    let failures: Vec<Failure> = paths
        .iter()
        .filter_map(|path| {
            let name = format!("file {}", path.display());
            watchdog::stage(&name, || write_one(job, path, context)).err()
        })
        .collect();
    if !paths.is_empty() {
        job.seconds.push(("write", started.elapsed().as_secs_f64()));
    }
    match failures.into_iter().next() {
        Some(failure) => Err(failure),
        None => Ok(paths.to_vec()),
    }
}

/// Writes the fitted model as a program of CAD, in the part's own frame.
fn write_cad(job: &Job, path: &Path, dialect: CadDialect) -> Result<(), Failure> {
    let text = job.found.own_program();
    let model = Model::parse(&text, Mode::Default).map_err(|e| {
        Failure::internal("fitted program").why(format!("it cannot be read: {}", e.message))
    })?;
    let intervals = job.found.fit.parameters.iter().map(|p| p.ci95);
    let options = CadOptions {
        title: format!("{}, fitted to {}", job.template_name, job.scan),
        unit: solid::unit(job),
        diagonal: job.found.own_extent().diagonal(),
        intervals: intervals.collect(),
    };
    let program =
        cad_program(&model, &[], &options, dialect).map_err(|e| no_cad_program(path, &e))?;
    disk::write_file(path, program.as_bytes())
}

fn no_cad_program(path: &Path, error: &CadProgramError) -> Failure {
    let message = format!("{}: there is no CAD program of the model", path.display());
    Failure::new(NO_RESULT, "no-cad-program", message)
        .why(error.to_string())
        .hint("-o part.step, which holds every solid")
}

/// Finds out before the fit whether CAD programs that are asked for have what the template is made
/// of.
pub(crate) fn check_cad(paths: &[PathBuf], template: &Model) -> Result<(), Failure> {
    for path in paths {
        if !matches!(kind(path)?, FileContent::Python | FileContent::OpenScad) {
            continue;
        }
        // Dialects do not differ in that; other errors depend on the values.
        let program = cad_program(template, &[], &CadOptions::default(), CadDialect::OpenScad);
        if let Err(e @ CadProgramError::Kind { .. }) = program {
            return Err(no_cad_program(path, &e));
        }
    }
    Ok(())
}

/// Writes a file of its kind.
pub(super) fn write_one(job: &Job, path: &Path, context: &Context) -> Result<(), Failure> {
    match kind(path)? {
        FileContent::Program => disk::write_file(path, job.program().as_bytes()),
        FileContent::Python => write_cad(job, path, job.dialect),
        FileContent::OpenScad => write_cad(job, path, CadDialect::OpenScad),
        FileContent::Points => {
            let options = WriteOptions {
                units: Some(job.unit.unit.clone()).filter(|u| !u.is_empty()),
                ..WriteOptions::default()
            };
            let report = write_path(&deviations(job), path, None, &options)
                .map_err(|e| scan::unwritable(&e))?;
            report
                .warnings
                .iter()
                .for_each(|w| context.note(format_args!("{}: {w}", path.display())));
            Ok(())
        }
        FileContent::Report => {
            disk::write_file(path, report::page(job, context.is_late()).as_bytes())
        }
        FileContent::Document => {
            let fields = document::document(job, "fit");
            disk::write_file(path, &outcome::document(true, fields))
        }
    }
}

/// The points with deviation, part and whether they are outliers, coloured by deviation; grey are
/// the outliers.
pub(super) fn deviations(job: &Job) -> PointCloud {
    let fit = &job.found.fit;
    let deviation = job.found.deviation();
    let shown: Vec<f64> = deviation
        .iter()
        .zip(&fit.outliers)
        .map(|(d, out)| if *out { f64::NAN } else { *d })
        .collect();
    let colors = deviation_colors(&shown, report::color_limit(fit));
    let columns = vec![
        Column {
            name: "deviation".into(),
            values: deviation,
        },
        Column {
            name: "part".into(),
            values: fit.parts.iter().map(|p| f64::from(*p)).collect(),
        },
        Column {
            name: "outlier".into(),
            values: fit
                .outliers
                .iter()
                .map(|o| f64::from(u8::from(*o)))
                .collect(),
        },
    ];
    PointCloud {
        normals: Vec::new(),
        colors,
        columns,
        triangles: job.found.cloud.triangles.clone(),
        ..job.found.cloud.clone()
    }
}
