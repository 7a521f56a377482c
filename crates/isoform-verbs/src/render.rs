//! `isoform render`: pictures of files, without a browser.

mod cameras;

use crate::arguments;
use crate::context::Context;
use crate::disk;
use crate::failure::{Failure, NO_RESULT};
use crate::layers::{self, Layer, LayerOptions, LiveLayer, Shower};
use crate::outcome::{self, Outcome};
use cameras::{Cameras, report};
use isoform::geom::PointCloud;
use isoform::{Control, LiveModel, Stopped, solid_of};
use isoform_render::{
    Color, ColorBy, Drawing, FINEST, Key, Pane, Patch, Picture, Scene, Section, ShownModel, Style,
    draw_legend, draw_svg, legend_width, render, write_png,
};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Draws files as a picture, without a browser
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform render part.hf -o part.png
  isoform render part.hf --section 0,0,1,0.5 -o cut.svg
  isoform render scan.ply part.hf --color-by deviation --views iso,front,top,right -o sheet.png
  isoform render torus.json --box 4 --camera 9,-7,5,0,0,0 --size 1600x1200 -o torus.png

Files are the same layers as those of isoform view. A model's own function is drawn, and patches
and maps themselves. The same files give the same bytes, for any number of threads. More:
docs/render.md.

Exit code: 0; 1 for wrong usage; 2 for unreadable input; 3 where a program without intervals is
drawn by its mesh; 4 where there is nothing to be seen.")]
pub(crate) struct Args {
    /// The files (- for stdin, points alone), or formulas as "x^2 + y^2 = 1"
    #[arg(required = true, value_name = "FILE")]
    file: Vec<PathBuf>,
    /// The picture, its format by its ending: .png or .svg
    #[arg(short, long, value_name = "PICTURE")]
    output: PathBuf,
    #[command(flatten)]
    cameras: Cameras,
    /// Cut away what has nx x + ny y + nz z > d
    #[arg(long, value_name = "NX,NY,NZ,D", allow_hyphen_values = true, value_parser = section)]
    section: Option<Section>,
    /// Colours of the layers that have such: none, part, deviation, quality, u, v, bound, file
    #[arg(long, value_name = "WHAT", value_parser = color_by)]
    color_by: Option<ColorBy>,
    /// The colour behind everything: white, black, grey or #rrggbb
    #[arg(long, value_name = "COLOR", default_value = "white", value_parser = color)]
    background: Color,
    /// Leave models and meshes open where the section or the box cuts them, without caps
    #[arg(long, conflicts_with = "hatch")]
    no_caps: bool,
    /// Hatch caps of sections, as drawings (.svg) always do
    #[arg(long)]
    hatch: bool,
    /// Draw hidden edges, dashed; in drawings (.svg)
    #[arg(long)]
    hidden: bool,
    /// Leave out lines of edges and outlines
    #[arg(long)]
    no_lines: bool,
    /// Leave out scales and lists of parts
    #[arg(long)]
    no_legend: bool,
    #[command(flatten)]
    reading: LayerOptions,
}

/// Capabilities of pictures.
const SHOWER: Shower = Shower {
    can_draw: |_| true,
    why_mesh: "it is run statement by statement, or is no number in parts of the box: its mesh is \
               drawn, and may miss thin parts",
};

/// Reads a plane.
fn section(text: &str) -> Result<Section, String> {
    match arguments::numbers(text)?.as_slice() {
        &[x, y, z, d] => Section::new([x, y, z], d).ok_or_else(|| "the normal is zero".to_owned()),
        _ => Err("four numbers are expected, a normal and an offset: nx,ny,nz,d".to_owned()),
    }
}

/// Reads what to colour by.
fn color_by(text: &str) -> Result<ColorBy, String> {
    let found = ColorBy::ALL.iter().find(|(name, _)| *name == text);
    found.map(|(_, by)| *by).ok_or_else(|| {
        let names = ColorBy::ALL.map(|(name, _)| name).join(", ");
        format!("colours are {names}")
    })
}

/// Reads a colour.
fn color(text: &str) -> Result<Color, String> {
    let known = [
        ("white", [255; 3]),
        ("black", [0; 3]),
        ("grey", [236, 238, 240]),
    ];
    if let Some((_, color)) = known.iter().find(|(name, _)| *name == text) {
        return Ok(*color);
    }
    if let Ok(&[r, g, b]) = arguments::numbers(text).as_deref() {
        let part = |v: f64| (0.0..=255.0).contains(&v) && v.fract() == 0.0;
        if [r, g, b].into_iter().all(part) {
            return Ok([r as u8, g as u8, b as u8]);
        }
    }
    let digits = text
        .strip_prefix('#')
        .filter(|d| d.len() == 6 && d.is_ascii());
    let value = digits.and_then(|d| u32::from_str_radix(d, 16).ok());
    value
        .map(|v| [(v >> 16) as u8, (v >> 8) as u8, v as u8])
        .ok_or_else(|| "white, black, grey, #rrggbb or r,g,b (0 to 255) are colours".to_owned())
}

/// The formats of pictures.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Png,
    Svg,
}

fn format_of(path: &Path) -> Result<Format, Failure> {
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    match ending.to_ascii_lowercase().as_str() {
        "png" => Ok(Format::Png),
        "svg" => Ok(Format::Svg),
        _ => {
            let message = format!(
                "{}: pictures are not written with this ending",
                path.display()
            );
            Err(Failure::usage(message).hint("a name that ends in .png or .svg"))
        }
    }
}

/// Description of a layer for the report.
struct LayerNote {
    file: String,
    /// True if the function itself is drawn, or whatever else is in the file; else its mesh is.
    is_itself: bool,
    /// True if what is seen is proved to be all there is, up to the smallest features.
    is_proved: bool,
}

/// Runs the verb.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    let format = format_of(&args.output)?;
    disk::check_folder(&args.output)?;
    args.cameras.check()?;
    if args.hidden && format == Format::Png {
        return Err(Failure::usage("hidden edges are drawn in drawings only").hint("-o NAME.svg"));
    }
    let progress = context.progress();
    let show = |phase: &str, done: f64| progress.show(phase, done);
    let control = Control {
        progress: Some(&show),
        ..context.control()
    };
    let mut read = Vec::new();
    for path in &args.file {
        read.push(layers::read(path, &args.reading, &SHOWER, context)?);
    }
    layers::drop_foreign_deviations(&mut read);
    let said: Vec<LayerNote> = args
        .file
        .iter()
        .zip(&read)
        .map(|(p, l)| said(p, l))
        .collect();
    let scene = scene(args, read, &control).map_err(|Stopped| stopped())?;
    check(args, &scene)?;
    let panes = args.cameras.panes(&scene.bounds(), room(args, &scene))?;
    let (bytes, is_blank) = match format {
        Format::Png => png(args, &scene, &panes, &control)?,
        Format::Svg => svg(args, &scene, &panes, &control)?,
    };
    drop(progress);
    if is_blank {
        context.warn("nothing is seen from there: the picture is empty");
    }
    disk::write_file(&args.output, &bytes)?;
    let is_itself = said.iter().all(|s| s.is_itself);
    Ok(Outcome {
        exit: outcome::exit(is_itself),
        json: document(args, &scene, &panes, &said, bytes.len()),
        stdout: format!("{}: {} bytes\n", args.output.display(), bytes.len()).into_bytes(),
    })
}

/// Returns the description of a file's layer.
fn said(path: &Path, layer: &Layer) -> LayerNote {
    LayerNote {
        file: path.display().to_string(),
        is_itself: !matches!(layer, Layer::Meshed(_)),
        is_proved: match layer {
            Layer::Meshed(_) | Layer::Spline(_) => false,
            Layer::Map(map) => map.surface.is_certified(),
            _ => true,
        },
    }
}

/// The work was stopped before there was a picture.
fn stopped() -> Failure {
    Failure::stopped(
        "stopped before there was a picture",
        ", or a smaller --size",
    )
}

/// The scene of all files.
fn scene(args: &Args, read: Vec<Layer>, control: &Control<'_>) -> Result<Scene, Stopped> {
    let section = args.section;
    let mut scene = Scene {
        layers: Vec::new(),
        section,
    };
    let beside = read.iter().find_map(|layer| match layer {
        Layer::Model(model) => Some(model.live.clone()),
        _ => None,
    });
    for (path, layer) in args.file.iter().zip(read) {
        let name = layers::base_name(path);
        scene
            .layers
            .push(shown(&name, layer, beside.as_ref(), args, control)?);
    }
    Ok(scene)
}

/// Converts a file's layer to a layer of the picture.
fn shown(
    name: &str,
    layer: Layer,
    beside: Option<&LiveModel>,
    args: &Args,
    control: &Control<'_>,
) -> Result<isoform_render::Layer, Stopped> {
    use isoform_render::Layer as Drawn;
    let by = args.color_by;
    Ok(match layer {
        Layer::Points(cloud) => points(name, &cloud, beside, by),
        Layer::Model(model) => Drawn::model(name, model_of(&model), by, control)?,
        Layer::Meshed(mesh) | Layer::Spline(mesh) => {
            Drawn::meshed_model(name, &mesh, by, args.section.as_ref())
        }
        Layer::Mesh(mesh) => Drawn::mesh(name, &mesh, by, args.section.as_ref()),
        Layer::Solid(solid) => Drawn::solid(name, &solid.mesh(), by, args.section.as_ref()),
        Layer::Shape(shape) => Drawn::solid(name, &shape.mesh(), by, args.section.as_ref()),
        Layer::Patches(list) => {
            let patch = |p: layers::Patch| Patch {
                patch: p.patch,
                name: p.name,
                distance: p.distance,
            };
            let list: Vec<Patch> = list.into_iter().map(patch).collect();
            Drawn::patches(name, &list, by)
        }
        Layer::Map(map) => Drawn::map(name, &map.map, &map.surface, by),
    })
}

/// A model's function, ready to be drawn.
fn model_of(model: &LiveLayer) -> ShownModel<'_> {
    let (solid, _) = solid_of(&model.model, &model.values).expect("it has been read as a solid");
    ShownModel {
        solid,
        bounds: model.live.bounds,
        is_cut: model.live.is_cut,
        is_surface: model.live.is_surface,
        names: &model.live.readings.part_names,
    }
}

/// Makes a layer of points with deviations: those of the file, else those from a model among the
/// layers. With a model, deviations colour the points.
fn points(
    name: &str,
    cloud: &PointCloud,
    beside: Option<&LiveModel>,
    by: Option<ColorBy>,
) -> isoform_render::Layer {
    let has_own = cloud.columns.iter().any(|c| c.name == "deviation");
    let measured = beside.filter(|_| !has_own).map(|m| m.deviations(cloud));
    let by = by.or_else(|| beside.map(|_| ColorBy::Deviation));
    isoform_render::Layer::points(name, cloud, measured.as_deref(), by)
}

/// Rejects colours that no layer has, and empty scenes.
fn check(args: &Args, scene: &Scene) -> Result<(), Failure> {
    if let Some(by) = args.color_by
        && !scene.layers.iter().any(|l| l.modes.contains(&by))
    {
        let mut all: Vec<&str> = scene
            .layers
            .iter()
            .flat_map(|l| l.modes.iter().map(|by| by.name()))
            .collect();
        all.sort_unstable();
        all.dedup();
        let failure = Failure::usage(format!("nothing that is shown has colours by {by}"));
        return Err(failure.hint(format!("--color-by with one of: {}", all.join(", "))));
    }
    if scene.is_left() {
        return Ok(());
    }
    let failure = Failure::new(
        NO_RESULT,
        "nothing",
        "the section leaves nothing to be seen",
    );
    let b = scene.bounds();
    Err(failure
        .why("all that is shown lies beyond its plane")
        .hint(format!(
            "the opposite normal, or an offset for what lies between {:?} and {:?}",
            b.lo, b.hi
        )))
}

/// Returns the width kept free for the legend next to several views; a single view has its legend
/// inside.
fn room(args: &Args, scene: &Scene) -> u32 {
    let width = legend_width(&scene.layers);
    let is_wanted =
        args.cameras.is_sheet() && !args.no_legend && 3 * width < args.cameras.size.0[0];
    if is_wanted { width } else { 0 }
}

/// Returns the style of pictures and drawings.
fn style(args: &Args) -> Style {
    Style {
        background: args.background,
        lines: !args.no_lines,
        caps: !args.no_caps,
        hatch: args.hatch,
    }
}

/// The bytes of an SVG, and whether nothing is seen.
fn svg(
    args: &Args,
    scene: &Scene,
    panes: &[Pane],
    control: &Control<'_>,
) -> Result<(Vec<u8>, bool), Failure> {
    let names: Vec<String> = args.file.iter().map(|p| layers::base_name(p)).collect();
    let drawing = Drawing {
        style: style(args),
        hidden: args.hidden,
        legend: !args.no_legend,
        has_room: room(args, scene) > 0,
        title: names.join(", "),
    };
    let made = draw_svg(scene, panes, args.cameras.size.0, &drawing, control);
    let text = made.map_err(|Stopped| stopped())?;
    let is_blank = !text.contains("<path");
    Ok((text.into_bytes(), is_blank))
}

/// The bytes of a PNG, and whether nothing is seen.
fn png(
    args: &Args,
    scene: &Scene,
    panes: &[Pane],
    control: &Control<'_>,
) -> Result<(Vec<u8>, bool), Failure> {
    let style = style(args);
    let mut sheet = Picture::blank(args.cameras.size.0, args.background);
    for pane in panes {
        let picture = render(scene, &pane.camera, pane.size, &style, control);
        sheet.put(&picture.map_err(|Stopped| stopped())?, pane.at);
    }
    let is_blank = sheet.pixels.iter().all(|p| *p == args.background);
    for pane in panes {
        sheet.title(pane.at, &pane.name, args.background);
    }
    if !args.no_legend {
        draw_legend(
            &mut sheet,
            &scene.layers,
            args.background,
            room(args, scene) > 0,
        );
    }
    let bytes = write_png(&sheet).map_err(|_| Failure::internal("picture"))?;
    Ok((bytes, is_blank))
}

/// Returns the JSON document of the picture.
fn document(args: &Args, scene: &Scene, panes: &[Pane], said: &[LayerNote], bytes: usize) -> Value {
    let each = scene.layers.iter().zip(said);
    let layers: Vec<Value> = each
        .map(|(layer, said)| layer_report(layer, said))
        .collect();
    let mut document = json!({
        "verb": "render",
        "output": args.output.display().to_string(),
        "bytes": bytes,
        "size": args.cameras.size.0,
        "camera": panes.first().map(|p| report(&p.camera)),
        "layers": layers,
    });
    if panes.len() > 1 {
        let view = |p: &Pane| {
            let camera = report(&p.camera);
            json!({"name": p.name, "at": p.at, "size": p.size, "camera": camera})
        };
        document["views"] = panes.iter().map(view).collect();
    }
    document
}

fn layer_report(layer: &isoform_render::Layer, said: &LayerNote) -> Value {
    let mut json = json!({
        "file": said.file,
        "kind": layer.kind,
        "color_by": layer.color_by.name(),
        "proved": said.is_proved,
    });
    if layer.is_function() {
        // What is thinner along a line of sight may be missing.
        json["thinnest"] = json!(FINEST * layer.bounds().diagonal());
    }
    if let Some(Key::Scale(scale)) = &layer.key {
        let figures = scale.rms_and_max.unwrap_or([f64::NAN; 2]);
        json["scale"] = json!({
            "lower": scale.lower, "upper": scale.upper, "n": scale.count,
            "rms": figures[0], "max": figures[1], "outliers": scale.outliers,
        });
    }
    json
}
