//! `isoform compare`: how far two shapes are apart, both ways.

use crate::arguments;
use crate::context::Context;
use crate::disk;
use crate::failure::{self, DONE, Failure};
use crate::fit::table::millimetres;
use crate::kind;
use crate::language::Language;
use crate::memory;
use crate::model::GivenModel;
use crate::outcome::{self, Outcome};
use crate::parameters::{self, Given, Parameters};
use crate::solids::FoundSolids;
use crate::{gallery, scan, solids};
use isoform::cad::PreparedShape;
use isoform::field::hyperfun::Pose;
use isoform::geom::cad::Placement;
use isoform::geom::{Aabb, Column, Point3, PointCloud};
use isoform::io::MeshPoints;
use isoform::report::{CompareReport, ComparedFaceReport, SideReport, brief};
use isoform::{
    CompareError, Distances, ExactSolid, FrepTemplate, Side, SplineDistance, compare, deviations,
    surface_of,
};
use isoform_render::Scale;
use std::path::{Path, PathBuf};

/// Measures the deviation between two of points, meshes, models and solids, both ways
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform compare scan.ply fitted.hf
  isoform compare part.msh fitted.hf
  isoform compare scan.ply part.step -o deviation.ply
  isoform compare scan.ply part.stl --align -o deviation.csv

Files with triangles count as surfaces (--vertices: as points), tetrahedra by their surface. Files
with the ending .hf are models, those with .json functions of implicitize; their distances are those of the
metric reading, and from meshes those of Newton's method on it. STEP files of any program and .brep.json are
solids; distances are those from their exact faces and edges, not from triangles. Lengths of STEP files are in
the file's own unit. Coordinates must agree, unless --align moves the first as a rigid body to where the sum of
its squared distances is least; a scan of a part of the surface must lie near its place before.
-o writes the points of the first with their deviation: positive outside of a model or a closed
surface, else without sign; view and render colour them by it. The document of --json has the
distances by the faces of a solid, or the parts of a model, to which the points of the first are
nearest; with --tolerance the faces that fail are named.

Where both files state their units, points given first are converted to those of the second.

Exit code: 0; 3 if --tolerance is given and a judged distance exceeds it, or a point has none: where
a model is not a number.")]
pub(crate) struct Args {
    /// Points, a mesh, a model or formula, or a solid: STEP, .brep.json
    first: PathBuf,
    /// The other
    second: PathBuf,
    #[command(flatten)]
    given: Given,
    /// Parameters of the second model, if both are models
    #[arg(
        long,
        value_name = "NUMBERS",
        allow_hyphen_values = true,
        value_parser = parameters::parameters
    )]
    params_second: Option<Parameters>,
    /// Region in which models are compared: x,y,z of the lower and of the upper corner [default:
    /// the other side's box]
    #[arg(long = "box", value_name = "NUMBERS", allow_hyphen_values = true, value_parser = arguments::region)]
    region: Option<Aabb>,
    /// Approximate number of points taken of a mesh, of a model and of a solid
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(10..=2_000_000))]
    samples: u32,
    /// Take the vertices of meshes as points
    #[arg(long)]
    vertices: bool,
    /// Move the points or mesh given first onto the second before they are compared: the best fit
    #[arg(long)]
    align: bool,
    /// Write the points of the first with their deviations from the second: .ply with colours, .csv
    /// or .xyz
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Fail (exit 3) where a distance is larger; those of a surface from points, which are as large
    /// as the gaps between the points, are not judged
    #[arg(
        long,
        value_name = "LENGTH",
        allow_hyphen_values = true,
        value_parser = arguments::positive
    )]
    tolerance: Option<f64>,
    #[command(flatten)]
    language: Language,
}

/// A side, and the unit that its file states.
struct Opened {
    side: Loaded,
    unit: Option<String>,
}

/// A side as read.
enum Loaded {
    /// Points, with triangles where there are any.
    Cloud(PointCloud),
    /// A model with the values of its parameters.
    Model(Box<FrepTemplate>, Vec<f64>),
    Spline(Box<SplineDistance>),
    Solid(Box<ExactSolid>),
    /// The shape of a STEP file of another program.
    Shape(Box<PreparedShape>),
}

/// Returns true for files of models, and for formulas and templates, which are not files.
fn names_model(path: &Path) -> bool {
    let is_file = memory::exists(path) || kind::is_named_file(path);
    let is_program = || kind::is_model(path) && !scan::is_mesh(path, None);
    let is_document = || kind::is_json(path) && !kind::is_solid(path);
    !is_file || is_document() || is_program()
}

/// Runs the verb.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    let of_second = match names_model(&args.first) {
        true => Given::from_params(args.params_second.as_ref()),
        false => args.given.clone(),
    };
    if let Some(output) = &args.output {
        if !scan::is_points(output) {
            let message = format!(
                "{}: no points are written with this ending",
                output.display()
            );
            return Err(Failure::usage(message).hint("-o with .ply, .csv or .xyz"));
        }
        disk::check_folder(output)?;
    }
    let first = load(&args.first, &args.given, args, context)?;
    let second = load(&args.second, &of_second, args, context)?;
    let (mut first, second) = in_one_unit(first, second, context);
    let motion = match args.align {
        true => Some(align(&mut first, &second, args)?),
        false => None,
    };
    let result = compare(
        as_side(&first, args.vertices),
        as_side(&second, args.vertices),
        args.region,
        args.samples as usize,
    );
    let found = result.map_err(failed)?;
    warn_undefined("first", &found.there, context);
    warn_undefined("second", &found.back, context);
    let mut text = line("first to second", &found.there) + &line("second to first", &found.back);
    if let Some(motion) = &motion {
        for row in rows(motion) {
            text += &format!("moved by          {}\n", row.map(brief).join("  "));
        }
    }
    if let Some(output) = &args.output {
        text += &format!("wrote {}\n", output.display());
    }
    let sides = [(&args.first, &first), (&args.second, &second)];
    let sides = sides.map(|(path, loaded)| SideReport {
        file: path.display().to_string(),
        kind: kind(loaded, args.vertices),
    });
    let mut report = CompareReport::new(sides, found, args.tolerance);
    if let (false, Some(tolerance)) = (report.within_tolerance, report.tolerance) {
        text += &format!("fails             the tolerance of {}\n", brief(tolerance));
    }
    text += &beyond(&report.faces);
    report.motion = motion.map(|m| rows(&m));
    if let Some(output) = &args.output {
        write_deviations(output, &first, &second, args)?;
        report.files.push(output.display().to_string());
    }
    let exit = if report.within_tolerance {
        DONE
    } else {
        failure::PARTIAL
    };
    Ok(Outcome {
        exit,
        json: outcome::json_of(&report),
        stdout: text.into_bytes(),
    })
}

/// Number of numbers of a rigid motion.
const MOTION_NUMBERS: usize = 6;

/// Moves the first side onto the second, and returns the motion.
fn align(first: &mut Loaded, second: &Loaded, args: &Args) -> Result<Placement, Failure> {
    let samples = args.samples as usize;
    let [a, b] = [&*first, second].map(|side| as_side(side, args.vertices));
    let found = deviations(a, b, samples, true).map_err(failed)?;
    if found.points.len() < MOTION_NUMBERS {
        return Err(
            Failure::input("few-points", "six points or more determine a motion")
                .why(format!("the first has {}", found.points.len()))
                .hint("without --align, or with more points"),
        );
    }
    let (Loaded::Cloud(cloud), Some(motion)) = (first, found.motion) else {
        return Err(Failure::usage("--align moves points or a mesh")
            .hint("give those first, and what they are compared with second"));
    };
    // The origin moves with the points, so that these keep all digits.
    cloud.origin = motion.point(cloud.origin);
    let turned = cloud.points.iter().map(|p| motion.direction(*p));
    cloud.points = turned.collect();
    Ok(motion)
}

/// Returns the rows of the matrix of a motion.
fn rows(motion: &Placement) -> [[f64; 4]; 3] {
    std::array::from_fn(|i| {
        let [x, y, z] = motion.rotation[i];
        [x, y, z, motion.shift[i]]
    })
}

/// Writes the points of the first side with their deviations and the colours of these.
fn write_deviations(
    path: &Path,
    first: &Loaded,
    second: &Loaded,
    args: &Args,
) -> Result<(), Failure> {
    let [a, b] = [first, second].map(|side| as_side(side, args.vertices));
    let found = deviations(a, b, args.samples as usize, false).map_err(failed)?;
    let scale = Scale::of_deviations(&found.values, None);
    let mut cloud = PointCloud::from_points(found.points);
    cloud.colors = found.values.iter().map(|v| scale.color(*v)).collect();
    cloud.columns = vec![Column {
        name: "deviation".to_owned(),
        values: found.values,
    }];
    disk::write_file(path, &scan::points_file(path, &cloud)?)
}

/// Converts an error of the comparison to a failure.
fn failed(error: CompareError) -> Failure {
    match error {
        CompareError::NoRegion => Failure::usage(error.to_string()).hint("--box=-1,-1,-1,1,1,1"),
        CompareError::Empty(_) => Failure::input("empty", error.to_string())
            .hint("isoform inspect; for models, another --box"),
        _ => Failure::input("compare", error.to_string()),
    }
}

/// Warns of points of a side for which the other side's function is not a number.
fn warn_undefined(side: &str, d: &Distances, context: &Context) {
    let Distances {
        samples, undefined, ..
    } = d;
    if *undefined > 0 {
        context.warn(format_args!(
            "{undefined} of {samples} points of the {side} have no distance: the other one's \
             function is not a number there"
        ));
    }
}

/// The distances of one direction, for people.
fn line(name: &str, d: &Distances) -> String {
    let samples = d.samples;
    let [rms, mean, p95, max] = [d.rms, d.mean, d.p95, d.max].map(brief);
    format!(
        "{name:<16}  rms {rms}  mean {mean}  95 % within {p95}  max {max}  ({samples} points)\n"
    )
}

/// The faces of which points are beyond the tolerance, worst first, for people.
fn beyond(faces: &[ComparedFaceReport]) -> String {
    let is_beyond = |face: &&ComparedFaceReport| face.within_tolerance == Some(false);
    let mut worst: Vec<&ComparedFaceReport> = faces.iter().filter(is_beyond).collect();
    worst.sort_by(|a, b| b.found.distances.max.total_cmp(&a.found.distances.max));
    let told = &worst[..worst.len().min(20)];
    let width = told.iter().map(|face| face.found.face.len()).max();
    let width = width.unwrap_or(0);
    let mut text = String::new();
    for ComparedFaceReport { found, .. } in told {
        let name = format!("fails at {:<width$}", found.face);
        text += &line(&name, &found.distances);
    }
    if worst.len() > told.len() {
        text += &format!("and at {} other faces\n", worst.len() - told.len());
    }
    text
}

/// The name of what a side is compared as.
fn kind(loaded: &Loaded, vertices: bool) -> &'static str {
    match as_side(loaded, vertices) {
        Side::Points(_) => "points",
        Side::Mesh(_) => "mesh",
        Side::Model(..) | Side::Spline(_) => "model",
        Side::Solid(_) | Side::Shape(_) => "solid",
    }
}

/// Reads a side: a mesh by its surface, points, or a model with the values that are given.
fn load(path: &Path, given: &Given, args: &Args, context: &Context) -> Result<Opened, Failure> {
    if names_model(path) {
        let side = load_model(path, given, &args.language, context)?;
        return Ok(Opened { side, unit: None });
    }
    match solids::find(path)? {
        Some(FoundSolids::Own(file)) => {
            let unit = file.unit.clone();
            let solid = solids::divided(path, *file, None, context)?;
            return Ok(Opened {
                side: Loaded::Solid(Box::new(solid)),
                unit,
            });
        }
        Some(FoundSolids::Shape(mut file)) => {
            let shape = solids::prepared(path, &mut file, None, context)?;
            return Ok(Opened {
                side: Loaded::Shape(Box::new(shape)),
                unit: Some(file.unit),
            });
        }
        None => {}
    }
    let (cloud, report) = if scan::is_mesh(path, None) {
        let (mesh, report) = scan::read_mesh_file(path, None)?;
        (surface_of(&mesh), report)
    } else {
        scan::read_points(path, None, None, MeshPoints::Vertices, context)?
    };
    for warning in report.warnings {
        context.warn(format_args!("{}: {warning}", path.display()));
    }
    Ok(Opened {
        side: Loaded::Cloud(cloud),
        unit: report.units,
    })
}

/// Converts points or a mesh given first to the unit of the second, where both are known and
/// differ, and warns where the sizes let units be suspected.
fn in_one_unit(first: Opened, second: Opened, context: &Context) -> (Loaded, Loaded) {
    let mut side = first.side;
    let known = [&first.unit, &second.unit].map(|unit| unit.as_deref().and_then(millimetres));
    if let [Some(from), Some(to)] = known
        && from != to
        && let [Some(given), Some(wanted)] = [first.unit, second.unit]
    {
        match &mut side {
            Loaded::Cloud(cloud) => {
                let scaled = |p: Point3| p.map(|v| v * from / to);
                cloud.origin = scaled(cloud.origin);
                cloud.points.iter_mut().for_each(|p| *p = scaled(*p));
                context.warn(format_args!(
                    "the first is in {given}, the second in {wanted}: lengths are in {wanted}"
                ));
            }
            _ => context.warn(format_args!(
                "the first is in {given}, the second in {wanted}: their numbers are compared"
            )),
        }
        return (side, second.side);
    }
    // Other units differ by 10 or more, except for centimetres and inches, but a scan may show a
    // part of a shape.
    if let [Some(one), Some(other)] = [&side, &second.side].map(extent)
        && (one > 8.0 * other || other > 8.0 * one)
    {
        context.warn(format_args!(
            "the first is {} times as large as the second: are the units the same?",
            brief(one / other)
        ));
    }
    (side, second.side)
}

/// The diagonal of a side's bounding box; `None` for models, which extend without end.
fn extent(side: &Loaded) -> Option<f64> {
    let bounds = match side {
        Loaded::Cloud(cloud) => Aabb::from_points(&cloud.points),
        Loaded::Solid(solid) => Aabb::from_points(&solid.facets().points),
        Loaded::Shape(shape) => shape.bounds(),
        Loaded::Model(..) | Loaded::Spline(_) => return None,
    };
    Some(bounds.diagonal()).filter(|d| *d > 0.0)
}

/// Reads a model; its metric reading gives the distances.
fn load_model(
    path: &Path,
    given: &Given,
    language: &Language,
    context: &Context,
) -> Result<Loaded, Failure> {
    let model = match gallery::model(path, language, context)? {
        GivenModel::Fitted(fitted) => return Ok(Loaded::Spline(Box::new(SplineDistance(*fitted)))),
        model => model.into_stated(path)?,
    };
    let values = parameters::values(&model, given, context)?;
    let template = FrepTemplate::with_pose(&model, Pose::None, &[]);
    let template =
        template.map_err(|e| Failure::input("template", format!("{}: {e}", path.display())))?;
    Ok(Loaded::Model(Box::new(template), values))
}

/// A side as the library takes it; a mesh counts as points where vertices are asked for.
fn as_side(loaded: &Loaded, vertices: bool) -> Side<'_> {
    match loaded {
        Loaded::Cloud(c) if c.triangles.is_empty() || vertices => Side::Points(c),
        Loaded::Cloud(c) => Side::Mesh(c),
        Loaded::Model(t, values) => Side::Model(t, values),
        Loaded::Spline(s) => Side::Spline(s),
        Loaded::Solid(s) => Side::Solid(s),
        Loaded::Shape(s) => Side::Shape(s),
    }
}
