//! `isoform parameterize`: rational patches on the surface of a model.

mod document;
mod figure;
mod files;
mod subject;
mod table;

use self::subject::PatchInput;
use crate::arguments;
use crate::context::Context;
use crate::disk;
use crate::failure::{Failure, NO_RESULT};
use crate::language::Language;
use crate::outcome::{self, Outcome};
use crate::parameters::Given;
use crate::product::Product;
use isoform::geom::{Aabb, Point3};
use isoform::io::STEP_UNITS;
use isoform::patch::{self, Covering, Error, Method, Options, Parameterized};
use isoform::{Coverage, PatchFinding, cover_surface, parameterize_surface, patch_findings};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Half the width of the box unless another is given: the paper's cube of edge 1.
const HALF_WIDTH: f64 = 0.5;
/// Squares along each side of a patch unless another number is given.
const SQUARES: u16 = 32;
/// Patches of a cover unless another number is given.
const MOST_PATCHES: usize = 1000;
/// The distance from the surface, per size of coordinates, that rounding of a point leaves: a few
/// units in the last place. A larger share would blame rounding for tiny tolerances that the
/// curvature of the surface forbids.
const ROUNDING: f64 = 1e-15;

/// Finds a rational patch as large as possible on the surface of a model
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform parameterize sphere.json --degree 2,2 --paper -o patch.json
  isoform parameterize part.hf --degree 3,3 --seed-point 0.1,0.2,0.3 --tol 1e-5 -o patch.json
  isoform parameterize gyroid.hf --degree 3,3 --paper --seed 7 -o patch.json --trace trace.csv --json
  isoform parameterize torus.hf --degree 2,2 --cover --tol 1e-4 -o patches.json -o patches.step
  isoform parameterize torus.hf --degree 2,2 --cover --tol 1e-4 -o patches.glb

where sphere.json is a polynomial in x, y and z: {\"F\": \"x^2 + y^2 + z^2 - 1/4\"}

The method is that of Wurm, Jüttler and Kim (2003): S = I + ω_J J + ω_L L + ω_R R + ω_E E is minimised while the patch grows. Every
patch comes with a proved bound on its distance from the surface, see docs/parameterize.md.

Exit code: 0 when the bound is proved and everything asked for is kept, 3 when not (files are written all the same), 2 for unreadable
input, 4 without a patch, 130 after Ctrl-C during --cover.")]
pub(crate) struct Args {
    /// The model: a HyperFun file, a formula, or a JSON file with a polynomial F (- for stdin)
    model: PathBuf,
    /// The degrees of the patch in u and in v
    #[arg(long, value_name = "M,N", default_value = "3,3", value_parser = degree)]
    degree: (usize, usize),
    /// Region to cover: half the width of a box around the origin, or x,y,z of its lower and of its
    /// upper corner [default: 0.5]
    #[arg(long = "box", value_name = "NUMBERS", allow_hyphen_values = true, value_parser = region)]
    region: Option<Aabb>,
    /// Start at the point of the surface near this one, instead of one chosen by --seed
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = point)]
    seed_point: Option<Point3>,
    /// The paper's settings: factors and thresholds of its Table 2, S <= 1e-6 (the default; takes
    /// no other bound)
    #[arg(long, conflicts_with = "tol")]
    paper: bool,
    /// Afterwards bring the patch onto the surface to rounding, where its degree admits that
    #[arg(long)]
    exact: bool,
    /// Make the patch as large as possible within this proved distance of the surface, instead of a
    /// bound on S
    #[arg(
        long, value_name = "LENGTH",
        allow_negative_numbers = true,
        value_parser = arguments::positive
    )]
    tol: Option<f64>,
    /// Add patches until all of the surface in the box lies on one, within --tol
    #[arg(long, requires = "tol", conflicts_with_all = ["seed_point", "trace", "figure", "paper"])]
    cover: bool,
    /// With --cover: every point of the surface in the box so deep inside of some patch, that is so
    /// far from its border, proved; as --tol a length. Patches reach beyond the box as far
    #[arg(long, value_name = "LENGTH", requires = "cover", allow_negative_numbers = true, value_parser = arguments::positive)]
    margin: Option<f64>,
    /// With --cover: what is nearer than this to a singular point, as at self-intersections, may be
    /// left out where no patch is found, which is said [default: a hundredth of the box]
    #[arg(long, value_name = "LENGTH", requires = "cover", allow_negative_numbers = true, value_parser = arguments::positive)]
    singular: Option<f64>,
    /// Maximum number of patches, with --cover
    #[arg(long, value_name = "N", default_value_t = MOST_PATCHES, requires = "cover", value_parser = at_least_one)]
    patches: usize,
    /// Method of computing steps
    #[arg(long, value_enum, default_value_t = Solver::GaussNewton)]
    method: Solver,
    /// Quantity that the term L measures
    #[arg(long, value_enum, default_value_t = Inner::Lengths)]
    inner: Inner,
    /// Stop after this number of extrapolations, to see how the patch grows: 0 is the start patch
    /// after its first Newton steps
    #[arg(long, value_name = "N", conflicts_with = "cover")]
    extrapolations: Option<usize>,
    /// Gauss nodes in each direction [default: as many as make J exact, 4 max(m,n) + 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(2..=64))]
    nodes: Option<u8>,
    #[command(flatten)]
    given: Given,
    /// Write the patches: .json (- for stdout), .step or .stp for CAD, or triangles as .obj, .ply,
    /// .glb, ...; may be repeated
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Unit of length that files state [default: mm in STEP, none in others]
    #[arg(long, value_name = "UNIT", value_parser = clap::builder::PossibleValuesParser::new(STEP_UNITS))]
    units: Option<String>,
    /// Number of squares along each side of a patch for its triangles
    #[arg(long, value_name = "N", default_value_t = SQUARES, value_parser = clap::value_parser!(u16).range(1..=1024))]
    grid: u16,
    /// Write every step as a table (CSV)
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Draw S, I and E over the steps, and the squared Sampson distance over the domain (SVG)
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
    #[command(flatten)]
    language: Language,
}

/// The names of the methods on the command line.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Solver {
    /// Gauss-Newton with Levenberg-Marquardt damping
    GaussNewton,
    /// Gauss-Newton with |grad F| taken as constant in each step: first derivatives of F only
    Frozen,
    /// The paper's: Newton's method with the exact Hessian, damped where that is indefinite
    Newton,
}

/// The names of the forms of L on the command line.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Inner {
    /// The lengths of the parameter lines' tangents, section 2.4 of the paper
    Lengths,
    /// Tangents in all directions, the paper's Remark 1
    Tangents,
}

/// Reads a positive whole number.
fn at_least_one(text: &str) -> Result<usize, String> {
    text.parse()
        .ok()
        .filter(|n| *n > 0)
        .ok_or_else(|| "a positive integer is expected".to_owned())
}

/// Reads two degrees.
fn degree(text: &str) -> Result<(usize, usize), String> {
    let mut numbers = text.split(',').map(|word| word.trim().parse::<usize>());
    match (numbers.next(), numbers.next(), numbers.next()) {
        (Some(Ok(m)), Some(Ok(n)), None) => Ok((m, n)),
        _ => Err("two degrees are expected, such as 3,3".to_owned()),
    }
}

/// Reads a box: half its width around the origin, or two corners.
fn region(text: &str) -> Result<Aabb, String> {
    match arguments::numbers(text)?.as_slice() {
        &[b] if b > 0.0 => Ok(Aabb {
            lo: [-b; 3],
            hi: [b; 3],
        }),
        [_] => Err("a positive number is expected".to_owned()),
        _ => arguments::region(text),
    }
}

/// Reads a point: three numbers.
fn point(text: &str) -> Result<Point3, String> {
    match arguments::numbers(text)?.as_slice() {
        &[x, y, z] => Ok([x, y, z]),
        _ => Err("three numbers are expected".to_owned()),
    }
}

/// Patches with their input and options.
struct MadePatches {
    /// Name of the model's file.
    name: String,
    /// Options of the library.
    options: Options,
    /// The patches; one without --cover.
    patches: Vec<Parameterized>,
    /// Coverage; `None` for a single patch.
    coverage: Option<Coverage>,
    /// Warnings for stderr and the document.
    warnings: Vec<String>,
    /// Files that they went to.
    written: Vec<String>,
    /// Seconds by phase.
    seconds: Vec<(&'static str, f64)>,
}

impl MadePatches {
    /// Returns the requests that the result does not fulfil.
    fn findings(&self) -> Vec<PatchFinding> {
        patch_findings(&self.patches, self.coverage.as_ref(), &self.options)
    }
    /// Writes a file that accompanies the patches.
    fn write_beside(&mut self, path: &Path, bytes: &[u8]) -> Result<(), Failure> {
        disk::write_file(path, bytes)?;
        self.written.push(path.display().to_string());
        Ok(())
    }
}

/// Runs the verb.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    let targets = files::targets(&args.output)?;
    for path in [&args.trace, &args.figure].into_iter().flatten() {
        disk::check_folder(path)?;
    }
    let clock = Instant::now();
    let subject = subject::read(&args.model, &args.language, &args.given, context)?;
    let read = clock.elapsed().as_secs_f64();
    let mut made = make(args, &subject, context)?;
    made.seconds.insert(0, ("read", read));
    let stdout = write(args, &mut made, &subject, &targets)?;
    let outcome = tell(&mut made, stdout, context);
    context.hand_over(|| Product::Patches(subject.surface, made.patches));
    Ok(outcome)
}

/// Finds the patch, or all patches of a cover.
fn make(args: &Args, subject: &PatchInput, context: &Context) -> Result<MadePatches, Failure> {
    let options = options(args, subject, context);
    let found = if args.cover {
        cover(args, subject, &options, context)
    } else {
        single(subject, &options, context)
    };
    let PatchResult {
        patches,
        coverage,
        seconds,
    } = found.map_err(|e| failure(&e, &subject.name, &options))?;
    Ok(MadePatches {
        name: subject.name.clone(),
        options,
        patches,
        coverage,
        warnings: subject.warnings.clone(),
        written: Vec::new(),
        seconds,
    })
}

/// Patches as the library made them.
struct PatchResult {
    patches: Vec<Parameterized>,
    /// Coverage; `None` for a single patch.
    coverage: Option<Coverage>,
    /// Seconds by phase.
    seconds: Vec<(&'static str, f64)>,
}

/// Covers the surface in the box with patches.
fn cover(
    args: &Args,
    subject: &PatchInput,
    options: &Options,
    context: &Context,
) -> Result<PatchResult, Error> {
    let clock = Instant::now();
    let covering = Covering {
        most: args.patches,
        margin: args.margin,
        apart: args.singular,
    };
    let made = cover_surface(&subject.surface, options, &covering, &context.control())?;
    let (patches, coverage) = Coverage::from_cover(made);
    Ok(PatchResult {
        patches,
        coverage: Some(coverage),
        seconds: vec![("cover", clock.elapsed().as_secs_f64())],
    })
}

/// Makes one patch.
fn single(
    subject: &PatchInput,
    options: &Options,
    context: &Context,
) -> Result<PatchResult, Error> {
    let patch = parameterize_surface(&subject.surface, options, &context.control())?;
    let seconds = patch.seconds.to_vec();
    Ok(PatchResult {
        patches: vec![patch],
        coverage: None,
        seconds,
    })
}

/// Writes all files; the bytes for stdout.
fn write(
    args: &Args,
    made: &mut MadePatches,
    subject: &PatchInput,
    targets: &[files::PatchTarget<'_>],
) -> Result<Vec<u8>, Failure> {
    let clock = Instant::now();
    let field = subject.surface.field.as_ref();
    let stdout = files::write(made, field, targets, args)?;
    if let Some(path) = &args.trace {
        let table = document::trace(&made.patches[0].grown);
        made.write_beside(path, table.as_bytes())?;
    }
    if let Some(path) = &args.figure {
        let svg = figure::svg(field, &made.patches[0].grown, &made.name);
        made.write_beside(path, svg.as_bytes())?;
    }
    if !made.written.is_empty() {
        made.seconds.push(("write", clock.elapsed().as_secs_f64()));
    }
    Ok(stdout)
}

/// Warns, and puts together what is printed: a file if one goes to stdout, else the table.
fn tell(made: &mut MadePatches, stdout: Vec<u8>, context: &Context) -> Outcome {
    let findings = made.findings();
    made.warnings
        .extend(findings.iter().map(ToString::to_string));
    made.warnings.iter().for_each(|w| context.warn(w));
    let exit = outcome::exit(findings.is_empty());
    Outcome::new(exit, document::document(made), stdout, || table::text(made))
}

/// Converts the arguments to options of the library: the settings of Wurm et al. (2003), with the
/// changes of the command line.
fn options(args: &Args, subject: &PatchInput, context: &Context) -> Options {
    let b = HALF_WIDTH;
    let region = args.region.or(subject.bounds).unwrap_or(Aabb {
        lo: [-b; 3],
        hi: [b; 3],
    });
    let paper = Options::paper(args.degree, region);
    let most_extrapolations = args.extrapolations.unwrap_or(paper.most_extrapolations);
    Options {
        most_extrapolations,
        seed_point: args.seed_point,
        seed: context.global.seed,
        method: match args.method {
            Solver::GaussNewton => Method::GaussNewton,
            Solver::Frozen => Method::Frozen,
            Solver::Newton => Method::Newton,
        },
        inner: match args.inner {
            Inner::Lengths => patch::Inner::Lengths,
            Inner::Tangents => patch::Inner::Tangents,
        },
        nodes: args.nodes.map(usize::from),
        tolerance: args.tol,
        exact: args.exact,
        ..paper
    }
}

/// Converts an error of the stage to a failure.
fn failure(error: &Error, name: &str, options: &Options) -> Failure {
    let message = format!("{name}: {error}");
    let none = |code| Failure::new(NO_RESULT, code, message.clone());
    match *error {
        Error::Degree(..) => Failure::usage(error.to_string()).hint("--degree 3,3"),
        Error::Option { .. } | Error::Region => {
            Failure::usage(error.to_string()).hint("a positive number")
        }
        Error::Nodes(_) => Failure::usage(error.to_string()).hint("--nodes 16"),
        Error::Stopped => {
            Failure::stopped(format!("{name}: stopped before there was a patch"), "")
        }
        Error::NoSurface => none("empty")
            .why("none of some thousand random places in it led to one")
            .hint("another --box, or --seed-point"),
        Error::FarSeed { at } => none("far-seed")
            .somewhere(at)
            .why("Newton's method along the gradient does not come to the surface in the box from there")
            .hint(other_seed(options)),
        Error::Singular { at } => none("singular")
            .somewhere(at)
            .why("the gradient of the function vanishes there")
            .hint("another --seed-point, or a smaller --box"),
        Error::NotFinite { at } => none("not-a-number")
            .somewhere(at)
            .hint("a --seed-point and a --box around the part where it is one"),
        Error::NoThirdDerivatives => none("derivatives").hint("--method gauss-newton"),
        Error::Folded { at } => none("folded")
            .somewhere(at)
            .why("the surface turns more sharply there than a patch of this degree follows")
            .hint("another --seed-point, or a smaller --tol"),
        Error::NoPatch { at } => no_patch(none("no-patch").somewhere(at), at, options),
    }
}

/// Returns the hint for a seed point from which no surface is reached.
fn other_seed(options: &Options) -> &'static str {
    if options.seed_point.is_some() {
        "a point nearer to the surface, or a larger --box"
    } else {
        "another --seed"
    }
}

/// Completes the failure to find a patch at a point by its reason.
fn no_patch(failure: Failure, at: Point3, options: &Options) -> Failure {
    let farthest = |m: f64, x: &f64| m.max(x.abs());
    let size = at.iter().fold(options.region.diagonal(), farthest);
    let is_below_rounding = options.tolerance.is_some_and(|t| t < ROUNDING * size);
    if is_below_rounding {
        failure
            .why("the tolerance is below the rounding of coordinates there")
            .hint(format!("--tol {:.0e} or more", 10.0 * ROUNDING * size))
    } else {
        failure
            .why("the surface is too curved, or not smooth, there")
            .hint("another --seed-point")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_and_boxes_are_read() {
        assert_eq!(degree("2, 3"), Ok((2, 3)));
        for bad in ["", "2", "2,3,4", "-1,2", "a,b", "2.5,1"] {
            assert!(degree(bad).is_err(), "{bad}");
        }
        assert_eq!(
            region("0.5"),
            Ok(Aabb {
                lo: [-0.5; 3],
                hi: [0.5; 3]
            })
        );
        assert_eq!(
            region("0,0,0,1,2,3"),
            Ok(Aabb {
                lo: [0.0; 3],
                hi: [1.0, 2.0, 3.0]
            })
        );
        for bad in ["0", "-1", "nan", "1,2", "1,1,1,0,0,0", ""] {
            assert!(region(bad).is_err(), "{bad}");
        }
    }
}
