//! `isoform implicitize`: an implicit spline, or one polynomial, of a scan.

use crate::arguments;
use crate::context::Context;
use crate::disk;
use crate::failure::{Failure, INPUT, NO_RESULT};
use crate::outcome::{self, Outcome};
use crate::product::Product;
use crate::{scan, spline};
use isoform::geom::PointCloud;
use isoform::report::{ImplicitizeReport, brief};
use isoform::spline::{Error, Fineness, Options};
use isoform::{
    Control, Implicit, ImplicitizeError, ImplicitizeOptions, NormalsFrom, implicitize_scan,
    implicitize_scan_globally,
};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Fits a smooth function to a scan, without a template: f = 0 is its surface
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform implicitize scan.ply -o surface.json
  isoform implicitize scan.ply --tol 0.05 -o surface.json --json
  isoform implicitize scan.ply --global 4 -o surface.json
  isoform mesh surface.json --surface-only -o surface.obj

The result is a piecewise polynomial, a hierarchical B-spline, that eval, mesh, parameterize and
compare take as a model; inside is f >= 0. How fine it becomes follows from the points: cells are
halved until points that were left out are met no better. With --global it is one polynomial, for
shapes that are algebraic as a whole: quadrics, tori. Normals are taken from the file, from its
triangles, or estimated; given ones that contradict one another are turned to one side, which is
said.

Exit code: 0; 2 for unreadable input or too few points, 4 if the points have no surface, 130 after
Ctrl-C.")]
pub(crate) struct Args {
    /// The points: any format that `isoform inspect` reads (- for stdin)
    scan: PathBuf,
    /// The degree of the polynomials in each variable
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(2..=5))]
    degree: u8,
    /// Maximum number of cells with points, all of one size; at most half the number of points
    #[arg(long, value_name = "N", conflicts_with = "tol", value_parser = clap::value_parser!(u32).range(1..))]
    cells: Option<u32>,
    /// Smaller cells where points are farther than this from the surface
    #[arg(
        long, value_name = "LENGTH",
        allow_negative_numbers = true,
        value_parser = arguments::positive
    )]
    tol: Option<f64>,
    /// One polynomial of at most this total degree in place of a spline
    #[arg(
        long,
        value_name = "DEGREE",
        conflicts_with_all = ["cells", "tol", "degree", "smoothing"],
        value_parser = clap::value_parser!(u8).range(1..=12)
    )]
    global: Option<u8>,
    /// Source of the normals
    #[arg(long, value_enum, default_value_t = NormalsName::Auto)]
    normals: NormalsName,
    /// The weight of smoothness; more of it rounds edges and averages noise
    #[arg(long, value_name = "WEIGHT", default_value_t = Options::default().smoothing, allow_negative_numbers = true, value_parser = arguments::positive)]
    smoothing: f64,
    /// Format of the scan, where its name does not tell it
    #[arg(long, value_name = "FORMAT")]
    from: Option<String>,
    /// Write the function (- for stdout)
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum NormalsName {
    /// The file's own ones, else of its triangles, else estimated
    Auto,
    /// The file's own ones, or of its triangles
    Given,
    /// Estimated from the points
    Estimate,
}

pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    if let Some(path) = &args.output {
        disk::check_folder(path)?;
    }
    let started = Instant::now();
    let cloud = scan::read_vertices(&args.scan, args.from.as_deref(), context)?;
    let progress = context.progress();
    let show = |phase: &str, done: f64| progress.show(phase, done);
    let control = Control {
        progress: Some(&show),
        ..context.control()
    };
    let (report, function) =
        fitted(&cloud, args, started, &control).map_err(|e| failure(e, &args.scan))?;
    drop(progress);
    let mut stdout = Vec::new();
    match args.output.as_deref() {
        Some(path) if path == Path::new("-") => stdout = spline::file(&function),
        Some(path) => disk::write_file(path, &spline::file(&function))?,
        None => {}
    }
    context.hand_over(|| Product::Function(function));
    if args
        .cells
        .is_some_and(|cells| cells as usize > report.points / 2)
    {
        context.warn("--cells: cells are at most half as many as points");
    }
    if let Some(tolerance) = args.tol.filter(|t| report.rms > *t) {
        context.warn(format_args!(
            "the points lie {} off the surface (rms), more than --tol {tolerance}: their noise is \
             as large, or sheets are closer than their spacing; --cells asks for smaller cells",
            brief(report.rms)
        ));
    }
    say(&report, context);
    Ok(Outcome::new(
        outcome::exit(true),
        outcome::json_of(&report),
        stdout,
        || text(&report, args.output.as_deref()),
    ))
}

/// Fits a function to points; returns its report, too.
fn fitted(
    cloud: &PointCloud,
    args: &Args,
    started: Instant,
    control: &Control<'_>,
) -> Result<(ImplicitizeReport, Implicit), ImplicitizeError> {
    let options = options(args);
    let points = cloud.points.len();
    let seconds = || started.elapsed().as_secs_f64();
    let Some(degree) = args.global else {
        let made = implicitize_scan(cloud, &options, control)?;
        let report = ImplicitizeReport::new(&made, points, seconds());
        return Ok((report, Implicit::Spline(made.spline)));
    };
    let made = implicitize_scan_globally(cloud, options.normals, usize::from(degree), control)?;
    let report = ImplicitizeReport::of_polynomial(&made, points, seconds());
    Ok((report, Implicit::Polynomial(made.polynomial)))
}

fn options(args: &Args) -> ImplicitizeOptions {
    let fineness = match (args.cells, args.tol) {
        (Some(cells), _) => Fineness::Cells(cells as usize),
        (None, Some(tolerance)) => Fineness::Tolerance(tolerance),
        (None, None) => Fineness::Data,
    };
    ImplicitizeOptions {
        normals: match args.normals {
            NormalsName::Auto => NormalsFrom::Auto,
            NormalsName::Given => NormalsFrom::Given,
            NormalsName::Estimate => NormalsFrom::Estimate,
        },
        spline: Options {
            degree: usize::from(args.degree),
            fineness,
            smoothing: args.smoothing,
        },
    }
}

fn failure(error: ImplicitizeError, scan: &Path) -> Failure {
    let message = format!("{}: {error}", scan.display());
    match error {
        ImplicitizeError::NoNormals => {
            Failure::input("no-normals", message).hint("--normals estimate, or auto")
        }
        ImplicitizeError::Spline(Error::Few { .. } | Error::NotFinite) => {
            Failure::new(INPUT, "points", message).hint("isoform inspect says what the file holds")
        }
        ImplicitizeError::Spline(Error::Stopped(_)) => Failure::stopped(message, ", or --cells"),
        _ => Failure::new(NO_RESULT, "no-surface", message),
    }
}

/// Prints warnings about the fitted function.
fn say(report: &ImplicitizeReport, context: &Context) {
    let normals = &report.normals;
    match normals.source {
        "turned" => {
            context.warn("the normals given contradict one another: their sides were decided anew")
        }
        "estimated" if normals.pieces > 1 => context.warn(format_args!(
            "the outside of {} pieces was decided for each by itself",
            normals.pieces
        )),
        _ => {}
    }
    if normals.oriented_share < 0.95 {
        context.warn(format_args!(
            "{:.0} % of neighbours have normals to different sides: noise, thin walls or wrong normals",
            100.0 * (1.0 - normals.oriented_share)
        ));
    }
    if report.outliers > 0 {
        context.warn(format_args!(
            "{} of {} points belong to no surface: they were left out",
            report.outliers, report.points
        ));
    }
    if report.inside_out {
        let why = match normals.source {
            "estimated" => "",
            _ => "the normals point inwards: ",
        };
        context.warn(format_args!(
            "{why}the function is positive all around the surface, and the solid is what lies \
             outside of it; --normals estimate turns the normals of a closed surface"
        ));
    }
    if report.components_without_data > 0 {
        context.warn(format_args!(
            "f = 0 has {} pieces more, where there are no points",
            report.components_without_data
        ));
    }
}

/// The report for people.
fn text(report: &ImplicitizeReport, output: Option<&Path>) -> String {
    let [rms, p95, max] = [report.rms, report.p95, report.max].map(brief);
    let mut text = format!(
        "{} cells with points, {} unknowns, degree {}, spacing {}\n\
         points from the surface: rms {rms}, 95 % within {p95}, max {max}\n\
         normals {}; {} of the surface\n",
        report.cells,
        report.unknowns,
        report.degree,
        brief(report.spacing),
        report.normals.source,
        match report.components {
            1 => "one piece".to_owned(),
            n => format!("{n} pieces"),
        },
    );
    if let Some(path) = output {
        text += &format!("wrote {}\n", path.display());
    }
    text
}
