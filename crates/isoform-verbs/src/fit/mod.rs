//! `isoform fit`: the parameters of a template from points.
//!
//! The way is one for `fit` and `recover`: [`work`] reads the scan, fits and gathers the warnings;
//! [`files`] writes what endings ask for, [`solid`] makes a solid for CAD; [`table`] and
//! [`document`] print the result for people and for programs.

pub(crate) mod document;
pub(crate) mod files;
pub(crate) mod job;
pub(crate) mod settings;
pub(crate) mod solid;
pub(crate) mod table;
pub(crate) mod work;

use crate::context::Context;
use crate::failure::Failure;
use crate::gallery;
use crate::kind;
use crate::outcome::Outcome;

use crate::product::Product;
use crate::solids;
use isoform::{FitOptions, MeshModelOptions};
use settings::Settings;
use std::path::PathBuf;

/// Fits a template to points
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform fit scan.ply --template cup -o fitted.hf -o deviation.ply -o report.html
  isoform fit scan.ply part.hf -o part.step

TEMPLATE is a HyperFun file, or a name out of --list. The table (--json: the document) gives every parameter with its
95 % interval and what the points say of it: determined, weak, undetermined, fixed, at-bound. See docs/fitting.md.

With -o part.step (or .brep.json) the fitted model becomes a solid of exact faces for CAD, in the unit of the fit, with
the certificate of isoform brep: the verdict says whether the model is that of the scan, the certificate whether the
solid is that of the model.

Exit code: 0, or 3 if the template does not fit, the search was cut short or the certificate of the solid does not hold
(files are written all the same), 4 without a result or without the solid that was asked for, 2 for unreadable input,
130 after Ctrl-C (the best so far is written).")]
pub(crate) struct Args {
    /// The points: PLY, XYZ, CSV, OBJ, OFF, STL, 3MF, PCD, LAS, LAZ, E57 (- for stdin)
    #[arg(required_unless_present = "list")]
    scan: Option<PathBuf>,
    /// The template: a HyperFun file or a name out of --list
    #[arg(value_name = "TEMPLATE")]
    model: Option<PathBuf>,
    /// The template, in place of TEMPLATE: a HyperFun file or a name out of --list
    #[arg(long, short, value_name = "FILE|NAME", conflicts_with = "model")]
    template: Option<PathBuf>,
    /// Lists the templates that are built in
    #[arg(long, conflicts_with_all = ["scan", "model", "template"])]
    list: bool,
    #[command(flatten)]
    options: Settings,
    /// Format of the points, where neither name nor content tell it
    #[arg(long, value_name = "FORMAT")]
    from: Option<String>,
    /// Take at most that many points, a seeded random sample
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    max_points: Option<u64>,
    /// Write a file; by its ending: .hf (fitted program), .py (program for build123d or CadQuery),
    /// .scad (for OpenSCAD), .ply .xyz .csv (points with deviations), .html (report), .json, .step
    /// .brep.json (solid)
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
}

impl Args {
    /// Returns the options as the library takes them.
    pub(crate) fn fit_options(&self, context: &Context) -> Result<FitOptions, Failure> {
        work::fit_options(&self.options, context)
    }
}

/// Runs the verb; with --list only the names of the gallery are printed.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    let Some(scan) = &args.scan else {
        let (text, json) = gallery::list(context)?;
        return Ok(Outcome {
            exit: crate::failure::DONE,
            json,
            stdout: text.into_bytes(),
        });
    };
    let Some(template) = args.model.as_ref().or(args.template.as_ref()) else {
        return Err(Failure::usage("a template is needed: isoform fit SCAN TEMPLATE").hint(format!(
            "a file or a name out of `isoform fit --list`; or isoform recover {}, which makes a \
             template of what it recognises",
            scan.display()
        )));
    };
    let output = args.output.iter().cloned();
    let (solids, results): (Vec<PathBuf>, Vec<PathBuf>) = output.partition(|p| kind::is_solid(p));
    files::check(&results)?;
    solids::check(&solids)?;
    let max_points = args
        .max_points
        .map(|n| usize::try_from(n).unwrap_or(usize::MAX));
    let scan = work::read_scan(scan, args.from.as_deref(), max_points, context)?;
    let model = gallery::template(template, &args.options.language, context)?;
    files::check_cad(&results, &model)?;
    let mut job = work::run(scan, (template, &model, false), &args.options, context)?;
    let written = files::write(&mut job, &results, context)?;
    if !context.global.json {
        for w in &job.warnings {
            context.warn(w);
        }
    }
    let mut json = document::document(&job, "fit");
    let mut written: Vec<String> = written.iter().map(|p| p.display().to_string()).collect();
    let (mut exit, mut text) = (job.exit(), table::text(&job));
    if !solids.is_empty() {
        let wanted = solid::SolidRequest {
            paths: solids,
            is_asked: true,
            is_forced: true,
            options: MeshModelOptions::default(),
        };
        let told = solid::tell(&job, &args.options.language, &wanted, context);
        exit = told.exit;
        text += &told.text;
        written.extend(told.files.iter().cloned());
        told.add_to(&mut json);
    }
    if !written.is_empty() {
        json["outputs"] = written.into();
    }
    context.hand_over(|| Product::Fit(Box::new(job)));
    Ok(Outcome {
        exit,
        json,
        stdout: text.into_bytes(),
    })
}
