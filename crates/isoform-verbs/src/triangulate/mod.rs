//! `isoform triangulate`: triangles of a rational surface in a box, with what is proved of them.
//!
//! The input is a map of two parameters, or patches. Numbers that decide what is drawn (the box,
//! the region of parameters) are read as exact rationals, because the analysis of the surface is
//! exact.

mod document;
mod domain;
mod table;

use crate::arguments;
use crate::context::Context;
use crate::disk;
use crate::failure::{Failure, NO_RESULT};
use crate::interrupt;
use crate::kind::{self, Kind};
use crate::memory::{self, MapObject};
use crate::mesh::files::{self, MeshTarget};
use crate::mesh::work::Written;
use crate::outcome::{self, Outcome};
use crate::product::Product;
use isoform::algebra::RBig;
use isoform::io::MapFileError;
use isoform::tess::{
    Domain, Finding, Map, MapError, MeshOptions, Mode, Surface, TriangulateOptions, VARIABLES,
};
use isoform::{
    PatchesError, RationalSurface, RationalSurfaceError, SurfaceBox, TriangulatedSurface,
    exact_number,
};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Triangulates a rational parametric surface in a box
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform triangulate sphere.json --box 2 -o sphere.obj
  isoform triangulate sphere.json --box 3/2 --tol 1e-4 -o sphere.ply --report report.json --domain domain.svg
  isoform triangulate sphere.json --box 2 --mode normalised -o sphere.obj --sidecar sidecar.json --json
  isoform triangulate sphere.json --box 2 --rectangle -1/2,1,0,0.75 -o piece.obj
  isoform triangulate patches.json -o patches.obj

where sphere.json is a map (s, t) to (X/W, Y/W, Z/W):
  {\"X\": \"2*s\", \"Y\": \"2*t\", \"Z\": \"s^2 + t^2 - 1\", \"W\": \"s^2 + t^2 + 1\"}

The parameters are the whole projective plane, infinity included; what is drawn is the part of the surface in the box from -B to B in x, y
and z; --rectangle and --polygon restrict the parameters. Files of patches, as isoform parameterize writes them, and of NURBS surfaces are drawn
over their own parameters; their weights may be zero or negative. Poles, base points, contracted and double curves are found with exact arithmetic, not by sampling. What is open is
said, see docs/rational.md.

Exit code: 0 when every claim holds, 3 when something is open (files are written all the same), 2 for an invalid map, 4 without
triangles, 130 after Ctrl-C. Which claims are proved, and which are checked in floating point only, is said with the result.")]
pub(crate) struct Args {
    /// The map: a JSON file with X, Y, Z and W, polynomials in s and t with rational coefficients,
    /// or a file of patches (- for stdin)
    map: PathBuf,
    /// Half the width of the box around the origin, taken as exactly this number: 2, 0.1, 1/3
    /// [default: that of the file, or around a surface without poles, or one that shows it]
    #[arg(long = "box", value_name = "B", allow_hyphen_values = true, value_parser = half_width)]
    half_width: Option<HalfWidth>,
    /// Draw only parameters with S0 <= s <= S1 and T0 <= t <= T1, taken as exactly these numbers
    #[arg(long, value_name = "S0,S1,T0,T1", allow_hyphen_values = true, value_parser = rectangle, conflicts_with = "polygon")]
    rectangle: Option<Domain>,
    /// Draw only parameters in a polygon with these corners: "0,0 2,0 1,3/2"
    #[arg(long, value_name = "S,T S,T ...", allow_hyphen_values = true, value_parser = polygon)]
    polygon: Option<Domain>,
    /// Largest distance of the middles of triangles and edges from the surface; without --box, B is
    /// half its width here [default: 5e-4 B]
    #[arg(
        long, value_name = "LENGTH",
        allow_negative_numbers = true,
        value_parser = arguments::positive
    )]
    tol: Option<f64>,
    /// Largest length of edges; without --box, B is half the surface's width here [default: 0.25 B]
    #[arg(
        long, value_name = "LENGTH",
        allow_negative_numbers = true,
        value_parser = arguments::positive
    )]
    longest: Option<f64>,
    /// Approximate number of triangles at which refinement stops
    #[arg(long, value_name = "N", default_value_t = MeshOptions::TRIANGLES, value_parser = at_least_one)]
    triangles: usize,
    /// Treatment of sheets that cross [default: glued; for patches normalised]
    #[arg(long, value_enum)]
    mode: Option<Sheets>,
    /// Draw real points that only complex parameters of an improper map reach, too, as a part with
    /// a colour of its own
    #[arg(long, conflicts_with = "sidecar")]
    complex: bool,
    /// Divide X, Y, Z and W by their common factor instead of refusing the map
    #[arg(long)]
    reduce: bool,
    /// Write a file; its ending names the format (- for stdout, with --to); may be repeated
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Format of the output, where its name does not tell it
    #[arg(long, value_name = "FORMAT")]
    to: Option<String>,
    /// Write what is known of the surface as JSON: base points, pole, double curve, what is not
    /// proved
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Write the parameters of every triangle's corners and the kind of every vertex as JSON
    #[arg(long, value_name = "FILE")]
    sidecar: Option<PathBuf>,
    /// Draw the triangles in the plane of parameters as SVG
    #[arg(long, value_name = "FILE")]
    domain: Option<PathBuf>,
}

impl Args {
    /// Returns the region of parameters, if one is set.
    fn region(&self) -> Option<&Domain> {
        self.rectangle.as_ref().or(self.polygon.as_ref())
    }
}

/// Treatment of sheets that cross.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Sheets {
    /// Cut and joined along the double curve, whose edges have four triangles or more
    Glued,
    /// Left as they are: they pass through one another
    Normalised,
}

/// A positive rational number and its nearest double.
#[derive(Clone, Debug)]
pub(crate) struct HalfWidth {
    /// The number as it was written.
    pub(crate) exact: RBig,
    /// Nearest double.
    pub(crate) near: f64,
}

impl HalfWidth {
    /// Returns the box about the origin.
    pub(crate) fn surface_box(&self) -> SurfaceBox {
        SurfaceBox {
            half_width: self.exact.clone(),
            size: self.near,
        }
    }
}

/// Reads a rational number exactly.
fn rational(text: &str) -> Result<RBig, String> {
    exact_number(text).ok_or_else(|| {
        "a decimal number or a fraction is expected, such as 2, 0.1 or 1/3".to_owned()
    })
}

/// Reads four bounds of parameters.
fn rectangle(text: &str) -> Result<Domain, String> {
    let list = text
        .split(',')
        .map(rational)
        .collect::<Result<Vec<_>, _>>()?;
    let [s0, s1, t0, t1] = <[RBig; 4]>::try_from(list)
        .map_err(|l| format!("four numbers are expected, {} are there", l.len()))?;
    Domain::rectangle([s0, s1], [t0, t1]).map_err(|e| e.to_string())
}

/// Reads the corners of a polygon of parameters.
fn polygon(text: &str) -> Result<Domain, String> {
    let corner = |c: &str| {
        let list = c.split(',').map(rational).collect::<Result<Vec<_>, _>>()?;
        <[RBig; 2]>::try_from(list).map_err(|_| format!("{c}: s,t is expected"))
    };
    // Lists of pairs come as one list of numbers.
    let numbers: Vec<&str> = text.split(',').collect();
    let is_flat = !text.trim().contains(char::is_whitespace) && numbers.len().is_multiple_of(2);
    let corners = match is_flat && numbers.len() > 2 {
        true => numbers.chunks(2).map(|c| corner(&c.join(","))).collect(),
        false => text
            .split_whitespace()
            .map(corner)
            .collect::<Result<Vec<_>, _>>(),
    }?;
    Domain::polygon(corners).map_err(|e| e.to_string())
}

/// Reads a positive rational number whose double is neither 0 nor infinite.
pub(crate) fn half_width(text: &str) -> Result<HalfWidth, String> {
    let exact = rational(text)?;
    let near = exact.to_f64_fast();
    if near > 0.0 && near.is_normal() {
        Ok(HalfWidth { exact, near })
    } else {
        Err("a positive number is expected".to_owned())
    }
}

/// Reads a positive whole number.
fn at_least_one(text: &str) -> Result<usize, String> {
    text.parse()
        .ok()
        .filter(|n| *n > 0)
        .ok_or_else(|| "a positive integer is expected".to_owned())
}

/// A triangulated surface, and where it went.
struct MadeSurface {
    /// Name of the map's file.
    name: String,
    /// The triangles with all that is known of them.
    drawn: TriangulatedSurface,
    /// B to the nearest double.
    half_width: f64,
    written: Vec<Written>,
}

impl MadeSurface {
    /// Returns true if every claim about the surface holds.
    fn is_certified(&self) -> bool {
        self.drawn.is_certified()
    }
    /// Warns of the common factor that a map was divided by.
    fn warn_of_factors(&self, context: &Context) {
        if !self.drawn.patches.is_empty() {
            return;
        }
        for factor in self.drawn.maps.iter().filter_map(Map::removed) {
            context.warn(format_args!(
                "X, Y, Z and W were divided by their common factor {}",
                factor.display(&VARIABLES)
            ));
        }
    }
    /// Warns of the border of the real image.
    fn warn_of_border(&self, context: &Context) {
        let border = &self.drawn.surface.real_border;
        if border.is_empty() {
            return;
        }
        let folds = table::equations(border);
        let ends = match (border.lines.len(), folds.is_empty()) {
            (0, _) => "the real image is not all of the surface".to_owned(),
            (n, true) => format!("the real image ends along {}", table::count(n, "line")),
            (n, false) => format!(
                "the real image ends along {}, at {}",
                table::count(n, "line"),
                folds.join(" and ")
            ),
        };
        let beyond = match (&border.beyond[..], &self.drawn.beyond[..]) {
            ([], _) => ", and is not drawn",
            (_, []) => ", and is drawn with --complex",
            _ => ", and is a part of its own",
        };
        context.warn(format_args!(
            "{ends}: what is beyond has complex parameters, a two-dimensional family{beyond}"
        ));
    }
    /// Warns of patches that have no area.
    fn warn_of_collapsed(&self, context: &Context) {
        let name = |&k: &u32| &*self.drawn.patches[k as usize];
        let names: Vec<&str> = self.drawn.surface.collapsed.iter().map(name).collect();
        if !names.is_empty() {
            context.warn(format_args!(
                "left out, since their image is a curve or a point and has no area: {}",
                names.join(", ")
            ));
        }
    }
    /// Writes the mesh, then the sidecar, the drawing of the parameters and the report; the bytes
    /// of the mesh that is for stdout.
    fn write(&mut self, targets: &[MeshTarget], args: &Args) -> Result<Vec<u8>, Failure> {
        let (written, stdout) = files::write_mesh_files(&self.drawn.mesh(), None, targets)?;
        self.written = written;
        if let Some(path) = &args.sidecar {
            disk::write_file(path, &document::sidecar(&self.drawn.surface))?;
        }
        if let Some(path) = &args.domain {
            disk::write_file(path, domain::svg(self).as_bytes())?;
        }
        if let Some(path) = &args.report {
            disk::write_file(path, &document::file(self))?;
        }
        Ok(stdout)
    }
    /// Returns what is to be handed over.
    fn product(self) -> Product {
        let report = String::from_utf8_lossy(&document::file(&self)).into_owned();
        let (mesh, parameters) = (self.drawn.mesh(), self.drawn.parameters());
        let mut drawn = self.drawn;
        let map = match (drawn.maps.pop(), drawn.analyses.pop()) {
            (Some(map), Some(analysis)) if drawn.maps.is_empty() => Some(Arc::new(MapObject {
                map,
                surface: drawn.surface,
                analysis,
                half_width: self.half_width,
            })),
            _ => None,
        };
        Product::Map {
            mesh,
            parameters,
            report,
            map,
        }
    }
    /// 0 where every claim holds, 3 where something is open, 130 after Ctrl-C.
    fn exit(&self) -> u8 {
        outcome::exit(self.is_certified())
    }
}

/// Runs the verb.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    let targets = files::targets(&args.output, args.to.as_deref(), context)?;
    let beside = [&args.report, &args.sidecar, &args.domain];
    check_beside(beside)?;
    let (subject, stated) = read(&args.map, args.reduce)?;
    let mut made = make(args, subject, stated, context)?;
    made.warn_of_factors(context);
    made.warn_of_collapsed(context);
    made.warn_of_border(context);

    let clock = Instant::now();
    let file = made.write(&targets, args)?;
    if !targets.is_empty() || beside.iter().any(|path| path.is_some()) {
        let took = clock.elapsed().as_secs_f64();
        made.drawn.seconds.push(("write", took));
    }
    if made.drawn.surface.sheets > 1 {
        context.note("the map is improper: its parameters cover the surface more than once");
    }

    let mut json = document::document(&made);
    for (key, path) in ["report", "sidecar", "domain"].into_iter().zip(beside) {
        json[key] = path
            .as_ref()
            .map_or(Value::Null, |p| p.display().to_string().into());
    }
    let outcome = Outcome::new(made.exit(), json, file, || table::text(&made, &beside));
    context.hand_over(|| made.product());
    Ok(outcome)
}

/// Checks before the work that the additional files can be written.
fn check_beside(files: [&Option<PathBuf>; 3]) -> Result<(), Failure> {
    for path in files.into_iter().flatten() {
        if path == Path::new("-") {
            return Err(
                Failure::usage("only a mesh goes to stdout").hint("--json prints the report")
            );
        }
        disk::check_folder(path)?;
    }
    Ok(())
}

/// Reads and checks a map, or patches, with half the width of the box that the file states.
pub(crate) fn read(
    path: &Path,
    reduce: bool,
) -> Result<(RationalSurface, Option<HalfWidth>), Failure> {
    let bytes = disk::read_file(path)?;
    let head = kind::head(&bytes).to_vec();
    let text = disk::text(bytes);
    let path = if path == Path::new("-") {
        Path::new("stdin")
    } else {
        path
    };
    let other = |_: &_| match Kind::detect(path, &head, &text)? {
        Kind::Map | Kind::Patches | Kind::Json => None,
        other => Some(other.instead_of("a map or a file of patches", path)),
    };
    let made = RationalSurface::parse(&text, reduce);
    if let Some(failure) = made.as_ref().err().and_then(other) {
        return Err(failure);
    }
    let surface = made.map_err(|e| match e {
        RationalSurfaceError::Patches(e) => {
            refused(path, "not_patches", &e).hint("see Patches in docs/rational.md")
        }
        RationalSurfaceError::File(e) => unreadable(&e, path, &text),
        RationalSurfaceError::Map(e) => invalid(&e, path),
        e => refused(path, "map", &e),
    })?;
    let json: Value = serde_json::from_str(&text).unwrap_or_default();
    let stated = match json.get("box") {
        Some(Value::String(text)) if surface.is_map() => Some(text.clone()),
        Some(Value::Number(number)) if surface.is_map() => Some(number.to_string()),
        _ => None,
    };
    let wrong = |problem: String| {
        let mut failure = Failure::input("box", format!("{}: box: {problem}", path.display()));
        failure.place.key = Some("box");
        failure
    };
    let stated = stated.map(|text| half_width(&text)).transpose();
    Ok((surface, stated.map_err(wrong)?))
}

/// The box about the origin in which a surface is drawn.
struct InBox {
    around: SurfaceBox,
    /// True if it was not asked for, but holds all of the surface.
    is_chosen: bool,
}

/// Returns the box of a map that no one gave, and says it.
pub(crate) fn shown_box(map: &Map, context: &Context) -> Option<SurfaceBox> {
    let around = SurfaceBox::showing(map)?;
    context.warn(format_args!(
        "the surface is not proved to be bounded: it is drawn within --box {}",
        around.half_width.to_f64_fast()
    ));
    Some(around)
}

/// The box as asked for or stated in the file, or around the surface where that is proved to have
/// bounds, or one that shows it.
fn find_box(
    args: &Args,
    subject: &RationalSurface,
    stated: Option<HalfWidth>,
    context: &Context,
) -> Result<InBox, Failure> {
    let cut = |around| InBox {
        around,
        is_chosen: false,
    };
    let domain = args.region();
    let stated = stated.filter(|_| domain.is_none());
    if let Some(given) = args.half_width.clone().or(stated) {
        return Ok(cut(given.surface_box()));
    }
    let Some(around) = subject.bounds(domain) else {
        if let RationalSurface::Map(map) = subject
            && domain.is_none()
            && let Some(around) = shown_box(map, context)
        {
            return Ok(cut(around));
        }
        let why = match (subject, domain) {
            (RationalSurface::Map(_), None) => "the parameters are the whole plane",
            (RationalSurface::Map(_), Some(_)) => {
                "W is not proved to keep its sign over the region"
            }
            (RationalSurface::Patches(_), _) => "the weights are not proved to keep their sign",
        };
        return Err(Failure::usage("--box is needed")
            .why(why.to_owned())
            .hint("--box B, half the width of a box around the origin"));
    };
    Ok(InBox {
        around,
        is_chosen: true,
    })
}

/// Makes the failure of a text that is not a map, with its place.
fn unreadable(error: &MapFileError, path: &Path, text: &str) -> Failure {
    if let MapFileError::NotJson {
        line,
        column,
        problem,
    } = error
    {
        let (line, column) = ((*line).max(1), (*column).max(1));
        let failure =
            Failure::input(error.code(), format!("not JSON: {problem}")).at(path, line, column);
        return failure
            .drawn(text.lines().nth(line - 1).unwrap_or_default())
            .hint(error.hint());
    }
    let mut failure = refused(path, error.code(), error).hint(error.hint());
    failure.place.key = error.key();
    if let MapFileError::NotAPolynomial { error, .. } = error {
        failure.place.column = Some(error.column);
    }
    failure
}

/// Makes the failure of four polynomials that do not map onto a surface.
fn invalid(error: &MapError, path: &Path) -> Failure {
    let hint = match error {
        MapError::CommonFactor { .. } => "divide all four by it, or --reduce",
        _ => error.hint(),
    };
    let mut failure = refused(path, error.code(), error).hint(hint);
    failure.place.key = error.key();
    failure
}

/// The failure of a file that holds something wrong.
fn refused(path: &Path, code: &'static str, error: &dyn std::error::Error) -> Failure {
    let mut failure = Failure::input(code, format!("{}: {error}", path.display()));
    failure.place.file = Some(path.to_owned());
    failure
}

/// Triangulates a map or patches.
fn make(
    args: &Args,
    subject: RationalSurface,
    stated: Option<HalfWidth>,
    context: &Context,
) -> Result<MadeSurface, Failure> {
    if !subject.is_map() && args.region().is_some() {
        return Err(
            Failure::usage("patches are drawn over their own parameters")
                .hint("without --rectangle and --polygon"),
        );
    }
    let in_box = find_box(args, &subject, stated, context)?;
    let time_limit = context.global.time_limit;
    let options = options(args, subject.options(&in_box.around, time_limit));
    let name = memory::name(&args.map);
    let control = context.control();
    let progress = context.progress();
    let drawn = progress
        .during("triangulation", time_limit, || {
            let mut drawn = subject.triangulate(options, in_box.is_chosen, &control)?;
            if args.complex {
                drawn.draw_complex(&control)?;
            }
            Ok(drawn)
        })
        .map_err(|e| match e {
            PatchesError::Map { name: which, error } => {
                Failure::input(error.code(), format!("{name}: {which}: {error}")).hint(error.hint())
            }
            PatchesError::Option { .. } => Failure::usage(e.to_string()),
            PatchesError::Stopped => nothing(&name, None, context),
        })?;
    drop(progress);
    if drawn.surface.triangles.is_empty() {
        let empty = Some((&drawn.surface, &drawn.options));
        return Err(nothing(&name, empty, context));
    }
    Ok(MadeSurface {
        name,
        half_width: drawn.options.half_width.to_f64_fast(),
        drawn,
        written: Vec::new(),
    })
}

/// Converts the arguments to options of the library, based on its defaults.
fn options(args: &Args, usual: TriangulateOptions) -> TriangulateOptions {
    TriangulateOptions {
        domain: args.region().cloned(),
        mode: match args.mode {
            Some(Sheets::Glued) => Mode::Glued,
            Some(Sheets::Normalised) => Mode::Normalised,
            None => usual.mode,
        },
        mesh: MeshOptions {
            tolerance: args.tol.unwrap_or(usual.mesh.tolerance),
            longest: args.longest.unwrap_or(usual.mesh.longest),
            triangles: args.triangles,
        },
        ..usual
    }
}

/// Makes the failure of an empty result, with the surface and its meaning if the analysis finished.
pub(crate) fn nothing(
    name: &str,
    surface: Option<(&Surface, &TriangulateOptions)>,
    context: &Context,
) -> Failure {
    if interrupt::happened() || context.is_late() {
        let message = format!("{name}: stopped before there were triangles");
        return Failure::stopped(message, "");
    }
    let (what, why, hint) = match surface {
        Some((surface, options)) if surface.is_outside => (
            "no triangle of the surface lies in the box",
            outside(options),
            "a larger --box",
        ),
        Some((surface, _)) => (
            "no triangle could be made of the surface in the box",
            sentences(&surface.findings),
            "another --box, or --mode normalised",
        ),
        None => (
            "no triangle could be made of the surface",
            "the parameters that lead into the box were not found".to_owned(),
            "another --box",
        ),
    };
    Failure::new(NO_RESULT, "empty", format!("{name}: {what}"))
        .why(why)
        .hint(hint)
}

/// Returns the hint for a surface outside the box.
fn outside(options: &TriangulateOptions) -> String {
    let b = &options.half_width;
    let parameters = match options.domain {
        Some(_) => "no parameters of the region",
        None => "no parameters, infinite ones included,",
    };
    format!(
        "{parameters} lead to points with x, y and z between -{b} and {b}, single points and curves \
         apart: all of the surface is farther out"
    )
}

/// All findings in one text.
fn sentences(findings: &[Finding]) -> String {
    let all: Vec<String> = findings.iter().map(ToString::to_string).collect();
    all.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_widths_are_exact() {
        let exact = |text: &str| half_width(text).map(|b| b.exact.to_string());
        assert_eq!(exact("0.1"), Ok("1/10".to_owned()));
        assert_eq!(exact("7/21"), Ok("1/3".to_owned()));
        assert_eq!(exact("25e-1"), Ok("5/2".to_owned()));
        for bad in [
            "", "0", "-1", "nan", "inf", "1e999", "1e-999", "2,3", "two", "1/0",
        ] {
            assert!(half_width(bad).is_err(), "{bad}");
        }
    }
}
