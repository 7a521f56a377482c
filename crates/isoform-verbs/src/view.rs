//! `isoform view`: one page that shows files as layers, written or served.

use crate::context::Context;
use crate::disk;
use crate::failure::{DONE, Failure};
use crate::layers::{self, Layer, LayerOptions, Shower};
use crate::outcome::Outcome;
use crate::serve;
use isoform_view::{Page, ShownPatch, ShownPoints};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Capabilities of pages.
const SHOWER: Shower = Shower {
    can_draw: Page::can_draw,
    why_mesh: "a page cannot compute this program: its mesh is shown, for these values",
};

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
  solid    STEP of any program, and .brep.json: faces by their names
  mesh     MSH, VTU, INP, OBJ, STL, OFF, 3MF; functions of isoform implicitize are meshed

The page fetches nothing and can be sent. With --serve it is given to browsers of this machine alone, at an address
that nobody guesses, and loads itself again when a file changes; Ctrl-C ends that. What it shows and how it is moved: docs/view.md.

Exit code: 0; 2 for unreadable input, 4 where there is nothing to show.")]
pub(crate) struct Args {
    /// The files (- for stdin, points alone), or formulas as "x^2 + y^2 = 1"
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
    /// Write the scene alone, packed for a page that is open: for Isoform Studio in a browser
    #[arg(long, hide = true, requires = "output")]
    packed: bool,
    /// The title of the page [default: the names of the files]
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
    #[command(flatten)]
    reading: LayerOptions,
}

/// Runs the verb.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    if args.serve {
        return serve::run(&args.file, args.port, context, || made(args, context));
    }
    let output = args.output.as_deref().unwrap_or(Path::new("-"));
    let is_stdout = output == Path::new("-");
    if !is_stdout {
        disk::check_folder(output)?;
    }
    let (page, layers) = made(args, context)?;
    let html = match args.packed {
        true => page.packed(),
        false => page.html().into_bytes(),
    };
    let size = html.len();
    let stdout = if is_stdout {
        html
    } else {
        disk::write_file(output, &html)?;
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
pub(crate) fn made(args: &Args, context: &Context) -> Result<(Page, Vec<Value>), Failure> {
    let names: Vec<String> = args.file.iter().map(|p| layers::base_name(p)).collect();
    let title = args.title.clone().unwrap_or_else(|| names.join(", "));
    let mut page = Page::new(title);
    let mut shown = Vec::new();
    let read = args.file.iter();
    let read = read.map(|path| layers::read(path, &args.reading, &SHOWER, context));
    let mut read: Vec<Layer> = read.collect::<Result<_, Failure>>()?;
    layers::drop_foreign_deviations(&mut read);
    for ((path, name), layer) in args.file.iter().zip(&names).zip(read) {
        shown.push(json!({"file": path.display().to_string(), "kind": layer.kind()}));
        add(&mut page, name, layer);
    }
    Ok((page, shown))
}

/// Adds a layer.
fn add(page: &mut Page, name: &str, layer: Layer) {
    match layer {
        Layer::Points(cloud) => page.points(name, &ShownPoints::new(&cloud)),
        Layer::Model(model) => page.model(name, model.title.as_deref(), &model.live),
        Layer::Meshed(mesh) => page.meshed_model(name, &mesh),
        Layer::Mesh(mesh) | Layer::Spline(mesh) => page.mesh(name, &mesh),
        Layer::Solid(solid) => page.solid(name, &solid),
        Layer::Shape(shape) => page.shape(name, &shape),
        Layer::Patches(list) => {
            let shown = |p: layers::Patch| ShownPatch {
                patch: p.patch,
                name: p.name,
                distance: p.distance,
            };
            let list: Vec<ShownPatch> = list.into_iter().map(shown).collect();
            page.patches(name, &list);
        }
        Layer::Map(map) => {
            page.map(name, &map.map, &map.surface, &map.analysis, map.half_width);
        }
    }
}
