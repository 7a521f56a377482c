//! `isoform view`: one page that shows files as layers, written or served.

use crate::eval::{self, Parameters};
use crate::mesh::Settings;
use crate::mesh::work::no_mesh;
use crate::model::Language;
use crate::output::{self, Context, DONE, Failure, Outcome};
use crate::triangulate::{self, HalfWidth, Subject};
use crate::{gallery, scan, serve, solids, spline};
use isoform::field::hyperfun::Model;
use isoform::geom::Aabb;
use isoform::io::{FilePatch, MeshPoints, is_patch_file, read_patches};
use isoform::mesh::Options;
use isoform::tess::{Map, TriangulateOptions};
use isoform::{
    LiveModel, MeshModelOptions, PatchesError, Unseen, mesh_model, mesh_spline, triangulate_map,
};
use isoform_view::{Page, ShownPatch, ShownPoints};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Makes one page that shows files as layers, offline, in any browser
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform view part.hf -o part.html
  isoform view scan.ply fitted.hf -o compare.html
  isoform view torus.json --box 4 -o torus.html
  isoform view patches.json mesh.msh -o page.html
  isoform view --serve part.hf                     open the address, edit part.hf: the page follows

Every file is a layer, in their order:
  points   PLY, XYZ, CSV, PCD, LAS, LAZ, E57; with the deviations that the file has, or those from a model beside them
  model    HyperFun programs and built-in templates: parameters move by sliders, and the surface with them;
           polynomials F in x, y and z as JSON (--box is needed)
  map      X, Y, Z, W in s and t as JSON; with the plane of parameters beside space (--box is needed)
  patches  of isoform parameterize
  solid    STEP and .brep.json of isoform brep: faces by their names
  mesh     MSH, VTU, INP, OBJ, STL, OFF; functions of isoform implicitize are meshed

The page fetches nothing and can be sent. With --serve it is given to browsers of this machine alone, at an address
that nobody guesses, and loads itself again when a file changes; Ctrl-C ends that. What it shows and how it is moved: docs/view.md.

Exit code: 0; 2 for unreadable input, 4 where there is nothing to show.")]
pub(crate) struct Args {
    /// The files (- for stdin, points alone)
    #[arg(required = true, value_name = "FILE")]
    file: Vec<PathBuf>,
    /// The page (- for stdout)
    #[arg(
        short,
        long,
        value_name = "PAGE.html",
        required_unless_present = "serve"
    )]
    output: Option<PathBuf>,
    /// Give the page to browsers of this machine, and a new one whenever a file changes
    #[arg(long, conflicts_with_all = ["output", "time_limit"])]
    serve: bool,
    /// The port of the address [default: one that is free]
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        hide_default_value = true,
        requires = "serve"
    )]
    port: u16,
    /// The values of the parameters a of the models, in their order; missing ones are as annotated,
    /// else 0
    #[arg(long, value_name = "NUMBERS", allow_hyphen_values = true, value_parser = eval::parameters)]
    params: Option<Parameters>,
    /// Half the width of a box around the origin, which maps need; or x,y,z of the lower and of the
    /// upper corner, for models without an end
    #[arg(long = "box", value_name = "B", allow_hyphen_values = true, value_parser = place)]
    region: Option<Place>,
    /// Show files that may be both as points or as meshes [default: PLY as points, OBJ, STL and OFF
    /// as meshes]
    #[arg(long = "as", value_name = "KIND", value_enum)]
    kind: Option<Kind>,
    /// The title of the page [default: the names of the files]
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
    #[command(flatten)]
    language: Language,
}

/// What a file with points and triangles is shown as.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Kind {
    Points,
    Mesh,
}

/// Where to look.
#[derive(Clone, Debug)]
enum Place {
    /// A cube about the origin.
    Around(HalfWidth),
    /// A box.
    Box(Aabb),
}

impl Place {
    /// The box.
    fn region(&self) -> Aabb {
        match self {
            Self::Around(half) => Aabb {
                lo: [-half.near; 3],
                hi: [half.near; 3],
            },
            Self::Box(region) => *region,
        }
    }
}

/// Reads half a width, or six numbers.
fn place(text: &str) -> Result<Place, String> {
    if text.contains(',') {
        output::region(text).map(Place::Box)
    } else {
        triangulate::half_width(text).map(Place::Around)
    }
}

/// Runs the verb.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    if args.serve {
        return serve::run(&args.file, args.port, context, || made(args, context));
    }
    let output = args.output.as_deref().unwrap_or(Path::new("-"));
    let is_stdout = output == Path::new("-");
    if !is_stdout {
        output::check_folder(output)?;
    }
    let (page, layers) = made(args, context)?;
    let html = page.html().into_bytes();
    let size = html.len();
    let stdout = if is_stdout {
        html
    } else {
        output::write_file(output, &html)?;
        format!(
            "{}: {} layers, {size} bytes\n",
            output.display(),
            layers.len()
        )
        .into_bytes()
    };
    let json = json!({
        "verb": "view",
        "output": output.display().to_string(),
        "bytes": size,
        "layers": layers,
    });
    Ok(Outcome {
        exit: DONE,
        json,
        stdout,
    })
}

/// The page of the files as they are now, and what its layers are.
fn made(args: &Args, context: &Context) -> Result<(Page, Vec<Value>), Failure> {
    let names: Vec<String> = args.file.iter().map(|path| base_name(path)).collect();
    let title = args.title.clone().unwrap_or_else(|| names.join(", "));
    let mut page = Page::new(title);
    let mut layers = Vec::new();
    for (path, name) in args.file.iter().zip(&names) {
        let kind = add(&mut page, path, name, args, context)?;
        layers.push(json!({"file": path.display().to_string(), "kind": kind}));
    }
    Ok((page, layers))
}

/// The name of a file without its folder.
fn base_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// Adds a file as a layer; its kind.
fn add(
    page: &mut Page,
    path: &Path,
    name: &str,
    args: &Args,
    context: &Context,
) -> Result<&'static str, Failure> {
    if path != Path::new("-")
        && let Some(file) = solids::find(path)?
    {
        let solid = solids::divided(path, file, None, context)?;
        page.solid(name, &solid);
        return Ok("solid");
    }
    if spline::is_json(path) {
        return document(page, path, name, args, context);
    }
    let is_program = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("hf"));
    if is_program || is_template(path) {
        let model = gallery::template(path, &args.language, context)?;
        return program(page, &model, name, args, context);
    }
    if scan::is_mesh(path, None) {
        return mesh(page, path, name, context);
    }
    let (cloud, report) = scan::read_points(path, None, None, MeshPoints::Vertices, context)?;
    let usual = if report.format == "ply" {
        Kind::Points
    } else {
        Kind::Mesh
    };
    let is_mesh = !cloud.triangles.is_empty() && args.kind.unwrap_or(usual) == Kind::Mesh;
    if is_mesh && path != Path::new("-") {
        return mesh(page, path, name, context);
    }
    for warning in &report.warnings {
        context.warn(format_args!("{}: {warning}", path.display()));
    }
    if cloud.points.is_empty() {
        let message = format!("{}: there are no points", path.display());
        return Err(
            Failure::input("no-points", message).hint("isoform inspect shows what is in the file")
        );
    }
    page.points(name, &ShownPoints::new(&cloud));
    Ok("points")
}

/// Whether it is the name of a template, and of no file.
fn is_template(path: &Path) -> bool {
    !path.exists() && isoform::template(&path.to_string_lossy()).is_some()
}

/// Adds a mesh.
fn mesh(
    page: &mut Page,
    path: &Path,
    name: &str,
    context: &Context,
) -> Result<&'static str, Failure> {
    let (mesh, report) = scan::read_mesh_file(path, None)?;
    for warning in &report.warnings {
        context.warn(format_args!("{}: {warning}", path.display()));
    }
    if mesh.triangles.is_empty() {
        let message = format!("{}: there are no triangles", path.display());
        return Err(Failure::input("no-triangles", message)
            .hint("isoform inspect shows what is in the file"));
    }
    page.mesh(name, &mesh);
    Ok("mesh")
}

/// Adds a model that moves; one whose program is no expression as its mesh.
fn program(
    page: &mut Page,
    model: &Model,
    name: &str,
    args: &Args,
    context: &Context,
) -> Result<&'static str, Failure> {
    let values = eval::values(model, args.params.as_ref().map_or(&[], |p| &p.0))?;
    let region = args.region.as_ref().map(Place::region);
    let control = context.control();
    let settings = Settings {
        region,
        ..Settings::default()
    };
    let live = LiveModel::new(model, &values, region, &control);
    let live = live.map_err(|e| no_mesh(&e, name, &settings))?;
    if let Some(live) = live.filter(Page::can_draw) {
        page.model(name, model.info().title.as_deref(), &live);
        return Ok("model");
    }
    let options = surface_options(region);
    let made = mesh_model(model, &values, &options, &control);
    let made = made.map_err(|e| no_mesh(&e, name, &settings))?;
    context.warn(format_args!(
        "{name}: a page cannot compute this program: its mesh is shown, for these values"
    ));
    page.meshed_model(name, &made.meshed.mesh);
    Ok("model")
}

/// A surface of triangles, in a region where there is one.
fn surface_options(region: Option<Aabb>) -> MeshModelOptions {
    MeshModelOptions {
        mesh: Options {
            surface_only: true,
            region,
            ..Options::default()
        },
        ..MeshModelOptions::default()
    }
}

/// Adds what a document holds: patches, a function fitted to points, or a map.
fn document(
    page: &mut Page,
    path: &Path,
    name: &str,
    args: &Args,
    context: &Context,
) -> Result<&'static str, Failure> {
    let text = output::text(output::read_file(path)?);
    let json: Value = serde_json::from_str(&text).unwrap_or_default();
    if is_patch_file(&json) {
        return patches(page, path, name, &json);
    }
    if spline::is_fitted(&json) {
        return fitted(page, path, name, &json, context);
    }
    if let Some(formula) = json.get("F").and_then(Value::as_str) {
        return polynomial(page, path, name, formula, args);
    }
    let Subject::Map(map) = triangulate::read(path, false)? else {
        return patches(page, path, name, &json);
    };
    add_map(page, path, name, &map, args, context)
}

/// Adds the surface of a polynomial.
fn polynomial(
    page: &mut Page,
    path: &Path,
    name: &str,
    formula: &str,
    args: &Args,
) -> Result<&'static str, Failure> {
    let Some(region) = args.region.as_ref().map(Place::region) else {
        return Err(
            Failure::usage(format!("{}: --box is needed", path.display()))
                .why("the surface of a polynomial may have no end")
                .hint("--box B, half the width of a box around the origin"),
        );
    };
    let wrong = |what: String| Failure::input("polynomial", format!("{}: {what}", path.display()));
    let live = LiveModel::of_polynomial(formula, region)
        .map_err(|e| wrong(format!("F, column {}: {e}", e.column)))?
        .filter(Page::can_draw)
        .ok_or_else(|| wrong("F is constant, or too long to be drawn".to_owned()))?;
    page.model(name, None, &live);
    Ok("model")
}

/// Adds patches, with the distances that their file tells.
fn patches(
    page: &mut Page,
    path: &Path,
    name: &str,
    json: &Value,
) -> Result<&'static str, Failure> {
    let wrong = |e: &dyn std::fmt::Display| {
        Failure::input("not_patches", format!("{}: {e}", path.display()))
            .hint("see Patches in docs/rational.md")
    };
    let found = read_patches(json).map_err(|e| wrong(&e))?;
    let told = |k: usize| json["patches"][k]["max_distance"].as_f64();
    let shown = |(k, p): (usize, &FilePatch)| -> Result<ShownPatch, Failure> {
        Ok(ShownPatch {
            patch: p.patch().map_err(|e| wrong(&e))?,
            name: p.name.clone(),
            distance: told(k),
        })
    };
    let list = found
        .iter()
        .enumerate()
        .map(shown)
        .collect::<Result<Vec<_>, _>>()?;
    page.patches(name, &list);
    Ok("patches")
}

/// Adds the surface of a function that was fitted to points.
fn fitted(
    page: &mut Page,
    path: &Path,
    name: &str,
    json: &Value,
    context: &Context,
) -> Result<&'static str, Failure> {
    let function = spline::of_document(path, json)?;
    let made = mesh_spline(
        &function,
        Unseen::Cut,
        &surface_options(None),
        &context.control(),
    );
    let made = made.map_err(|e| no_mesh(&e, name, &Settings::default()))?;
    page.mesh(name, &made.meshed.mesh);
    Ok("mesh")
}

/// Adds a rational surface.
fn add_map(
    page: &mut Page,
    path: &Path,
    name: &str,
    map: &Map,
    args: &Args,
    context: &Context,
) -> Result<&'static str, Failure> {
    let Some(Place::Around(half)) = &args.region else {
        return Err(
            Failure::usage(format!("{}: --box is needed", path.display()))
                .why("the parameters are the whole plane")
                .hint("--box B, half the width of a box around the origin"),
        );
    };
    let mut options = TriangulateOptions::around(half.exact.clone());
    if let Some(limit) = context.global.time_limit {
        options.budget.seconds = triangulate::EXACT_SHARE * limit.as_secs_f64();
    }
    let made = triangulate_map(map, &options, &context.control());
    let (surface, analysis) = made.map_err(|e| match PatchesError::from(e) {
        PatchesError::Stopped => triangulate::nothing(name, None, context),
        e => Failure::usage(format!("{}: {e}", path.display())),
    })?;
    if surface.triangles.is_empty() {
        return Err(triangulate::nothing(
            name,
            Some((&surface, &options)),
            context,
        ));
    }
    for finding in &surface.findings {
        context.note(format_args!("{name}: {finding}"));
    }
    page.map(name, map, &surface, &analysis, half.near);
    Ok("map")
}
