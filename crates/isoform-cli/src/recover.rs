//! `isoform recover`: from points to a fitted model and a report, in one go.

use crate::eval;
use crate::fit::{Settings, document, files, job, table};
use crate::gallery;
use crate::mesh::work::{self, Made, Subject};
use crate::mesh::{self, files::Target};
use crate::model::{self, Language};
use crate::output::{Context, DONE, Failure, INTERNAL, Outcome, PARTIAL};
use isoform::io::{ReadOptions, Source, read};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A scanned cup; see examples/scans/README.md.
static SCAN: &[u8] = include_bytes!("../../../examples/scans/ycb_065-d_cup.ply");
const SCAN_NAME: &str = "ycb_065-d_cup.ply";
const TEMPLATE: &str = "cup";
const FOLDER: &str = "isoform-recover";

/// Recovers a model from a scan: fit, deviations, mesh and report in one go
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform recover
  isoform recover scan.ply bottle -o bottle.hf -o report.html
  isoform recover scan.ply part.hf -o part.inp --size 0.5

Without arguments the scan of a cup that the program carries is fitted. Without -o, fitted.hf, deviation.ply and
report.html go to the folder isoform-recover. With -o part.msh, .inp, .vtu, .stl and the like the fitted model is meshed,
see mesh. Exit codes are those of fit; 3 also where the mesh fails or is not certified.")]
pub(crate) struct Args {
    /// The points [default: the scan of a cup that is built in]
    #[arg(requires = "template")]
    scan: Option<PathBuf>,
    /// The template: a HyperFun file or a name out of `fit --list`
    template: Option<PathBuf>,
    #[command(flatten)]
    options: Settings,
    #[command(flatten)]
    mesh: mesh::Settings,
    /// Write a file; by its ending: .hf, .ply, .xyz, .csv, .html, .json, or a mesh: .msh, .inp, .vtu, .stl, ...
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
}

pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    let template = args.template.clone().unwrap_or_else(|| TEMPLATE.into());
    // What the template says wrong is said before a folder is made.
    let request = args.options.request(&template);
    let model = gallery::template(&template, &request.language, context)?;
    let outputs = if args.output.is_empty() {
        default_outputs()?
    } else {
        args.output.clone()
    };
    let (outputs, meshes): (Vec<PathBuf>, Vec<PathBuf>) = outputs
        .into_iter()
        .partition(|p| files::is_result(p) || !mesh::files::is_mesh(p));
    files::check(&outputs)?;
    let targets = mesh::files::targets(&meshes, None, context)?;
    let scan = match &args.scan {
        Some(path) => job::read_scan(path, None, None, context)?,
        None => embedded()?,
    };
    let mut job = job::run_model(scan, &model, &request, context)?;
    let written = files::write(&mut job, &outputs, context)?;
    if !context.global.json {
        job.warnings.iter().for_each(|w| context.warn(w));
    }
    let mut json = document::document(&job, "recover");
    let mut files: Vec<String> = written.iter().map(|p| p.display().to_string()).collect();
    let mut text = table::text(&job);
    for path in &written {
        text += &format!("wrote     {}\n", path.display());
    }
    let mut exit = job.exit();
    if !targets.is_empty() {
        let made = fitted_mesh(&job, &request.language, &args.mesh, &targets, context);
        files.extend(made.iter().flat_map(|m| &m.written).map(|w| w.path.clone()));
        let (its_exit, document, table) = told(made, context);
        exit = if exit == DONE { its_exit } else { exit };
        json["mesh"] = document;
        text += &table;
    }
    json["outputs"] = json!(files);
    Ok(Outcome {
        exit,
        json,
        stdout: text.into_bytes(),
    })
}

/// Meshes the fitted program and writes the files.
fn fitted_mesh(
    job: &job::Job,
    language: &Language,
    settings: &mesh::Settings,
    targets: &[Target],
    context: &Context,
) -> Result<Made, Failure> {
    let fitted = model::silently(&job.program(), language);
    let model = fitted.map_err(|e| {
        Failure::new(
            INTERNAL,
            "internal",
            format!("the fitted program cannot be read: {}", e.message),
        )
    })?;
    let values = eval::values(&model, &[])?;
    let unit = Some(job.unit.unit.clone()).filter(|u| !u.is_empty());
    let subject = Subject {
        name: format!("fitted {}", job.template_name),
        model,
        values,
        unit,
    };
    let mut made = work::make(&subject, settings, None, context)?;
    mesh::files::write(&mut made, targets)?;
    Ok(made)
}

/// Exit code, document and table of the mesh. Without one the fit is still a result.
fn told(made: Result<Made, Failure>, context: &Context) -> (u8, Value, String) {
    match made {
        Ok(made) => {
            made.say(context);
            (
                made.exit(),
                mesh::document::document(&made),
                format!("\n{}", mesh::table::text(&made)),
            )
        }
        Err(failure) => {
            context.warn(format_args!(
                "no mesh: {}",
                failure.text().trim_start_matches("error: ")
            ));
            (
                PARTIAL,
                json!({"ok": false, "error": failure.json()}),
                String::new(),
            )
        }
    }
}

fn default_outputs() -> Result<Vec<PathBuf>, Failure> {
    let folder = Path::new(FOLDER);
    std::fs::create_dir_all(folder)
        .map_err(|e| Failure::file(folder, "make", &e).hint("-o with files elsewhere"))?;
    Ok(["fitted.hf", "deviation.ply", "report.html"]
        .iter()
        .map(|f| folder.join(f))
        .collect())
}

fn embedded() -> Result<job::Scan, Failure> {
    let started = Instant::now();
    let source = Source::Bytes {
        name: SCAN_NAME,
        bytes: SCAN,
    };
    let (cloud, report) = read(source, None, &ReadOptions::default())
        .map_err(|e| crate::scan::unreadable(Path::new(SCAN_NAME), &e))?;
    Ok(job::Scan {
        name: SCAN_NAME.to_owned(),
        cloud,
        report,
        seconds: started.elapsed().as_secs_f64(),
    })
}
