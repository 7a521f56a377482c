//! `isoform recover`: from points to a fitted model and a report, in one go.

use crate::fit::{Settings, document, files, job, table};
use crate::gallery;
use crate::output::{Context, Failure, Outcome};
use isoform::io::{ReadOptions, Source, read};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A scanned cup; see examples/scans/README.md.
static SCAN: &[u8] = include_bytes!("../../../examples/scans/ycb_065-d_cup.ply");
const SCAN_NAME: &str = "ycb_065-d_cup.ply";
const TEMPLATE: &str = "cup";
const FOLDER: &str = "isoform-recover";

/// Recovers a model from a scan: fit, deviations and report in one go
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform recover
  isoform recover scan.ply bottle -o bottle.hf -o report.html

Without arguments the scan of a cup that the program carries is fitted. Without -o, fitted.hf, deviation.ply and
report.html go to the folder isoform-recover. Exit codes are those of fit.")]
pub(crate) struct Args {
    /// The points [default: the scan of a cup that is built in]
    #[arg(requires = "template")]
    scan: Option<PathBuf>,
    /// The template: a HyperFun file or a name out of `fit --list`
    template: Option<PathBuf>,
    #[command(flatten)]
    options: Settings,
    /// Write a file; by its ending: .hf, .ply, .xyz, .csv, .html, .json
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
}

pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    let template = args.template.clone().unwrap_or_else(|| TEMPLATE.into());
    // What the template says wrong is said before a folder is made.
    let request = args.options.request(&template);
    let model = gallery::template(&template, &request.language, context)?;
    let outputs = if args.output.is_empty() { default_outputs()? } else { args.output.clone() };
    files::check(&outputs)?;
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
    json["outputs"] = written.iter().map(|p| p.display().to_string()).collect();
    let mut text = table::text(&job);
    for path in &written {
        text += &format!("wrote     {}\n", path.display());
    }
    Ok(Outcome { exit: job.exit(), json, stdout: text.into_bytes() })
}

fn default_outputs() -> Result<Vec<PathBuf>, Failure> {
    let folder = Path::new(FOLDER);
    std::fs::create_dir_all(folder).map_err(|e| Failure::file(folder, "make", &e).hint("-o with files elsewhere"))?;
    Ok(["fitted.hf", "deviation.ply", "report.html"].iter().map(|f| folder.join(f)).collect())
}

fn embedded() -> Result<job::Scan, Failure> {
    let started = Instant::now();
    let source = Source::Bytes { name: SCAN_NAME, bytes: SCAN };
    let (cloud, report) = read(source, None, &ReadOptions::default()).map_err(|e| crate::scan::unreadable(Path::new(SCAN_NAME), &e))?;
    Ok(job::Scan { name: SCAN_NAME.to_owned(), cloud, report, seconds: started.elapsed().as_secs_f64() })
}
