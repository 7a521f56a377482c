//! `isoform mesh`: labelled surfaces and tetrahedra of a model, with a certificate.

mod blocks;
pub(crate) mod document;
pub(crate) mod files;
mod layers;
mod regions;
mod sizes;
mod solid;
pub(crate) mod table;
pub(crate) mod work;

use crate::memory;
use crate::model::Language;
use crate::output::{self, Context, Failure, Outcome};
use crate::parameters::{self, Given};
use crate::product::Product;
use crate::{gallery, scan, solids, spline};
use isoform::geom::Aabb;
use isoform::mesh::Layers;
use isoform::{MeshModelOptions, Unseen};
use std::path::PathBuf;
use work::{Shape, Subject};

/// Meshes a model: tetrahedra with their labelled surface
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform mesh part.hf --size 0.25 -o part.msh -o part.inp
  isoform mesh part.hf --surface-only --grade 0.01 -o part.obj
  isoform mesh part.hf --sizes sizes.csv --order 2 -o part.inp
  isoform mesh part.hf --adapt old.msh -o better.msh
  isoform mesh part.step -o part.stl
  isoform mesh lattice.hf --size 0.05 --blocks 4,4,4 -o big.pvtu
  isoform mesh bimetal.hf --regions core,shell -o bimetal.inp
  isoform mesh gyroid.hf --box=-1,-1,-1,1,1,1 -o gyroid.vtu --json
  isoform mesh cell.hf --box=0,0,0,1,1,1 --periodic xyz -o cell.msh
  isoform mesh pipe.hf --layers wall --first 0.01 --layer-count 4 -o pipe.vtu

Edges and corners are found and kept; every face carries the name of the part that it lies on. Every mesh comes with a
certificate: closed, manifold, free of self-intersections and inverted elements, with angles and distances. Formats:
msh (Gmsh), vtu (ParaView), inp (CalculiX, Abaqus) and others, see docs/meshing.md. Without -o it is only measured.
Of a solid of isoform brep (.step, .brep.json) the faces are divided into triangles for display, closed and near to
them (--grade, --size), without regard to their shape.

Exit code: 0, or 3 if the certificate fails or something is left unproved (files are written all the same), 4 without a
mesh, 2 for unreadable input, 130 after Ctrl-C.")]
pub(crate) struct Args {
    /// The model: a HyperFun file (- for stdin), the name of a built-in template, a function
    /// fitted to points (.json, from isoform implicitize), or a solid of isoform brep
    model: PathBuf,
    #[command(flatten)]
    given: Given,
    #[command(flatten)]
    settings: Settings,
    /// Improve this mesh on the model instead of making a new one: tetrahedra (msh, vtu, inp), or a
    /// surface (stl, obj, ply, off, 3mf, msh), whose triangles are made as long as --size says, or
    /// as they were
    #[arg(long, value_name = "FILE", conflicts_with = "region")]
    adapt: Option<PathBuf>,
    /// Mesh in so many blocks along x, y and z, one after the other: the memory is that for one of
    /// them. -o names a .pvtu, beside which each block is a .vtu; they meet node for node
    #[arg(
        long,
        value_name = "NX,NY,NZ",
        value_parser = counts,
        conflicts_with_all = ["adapt", "to"]
    )]
    blocks: Option<Counts>,
    /// Mesh the model in regions with common nodes: objects of the program, or files of others.
    /// Each takes what of the model lies in it and in none before it; the rest is one more
    #[arg(
        long,
        value_name = "NAME|FILE,...",
        value_delimiter = ',',
        conflicts_with_all = ["adapt", "blocks", "surface_only"]
    )]
    regions: Vec<String>,
    /// Mesh the box as a unit cell that repeats along these axes, as xyz or z: opposite sides have
    /// the same triangles, node for node. The function in the box must fit to itself there
    #[arg(
        long,
        value_name = "AXES",
        value_parser = axes,
        requires = "region",
        conflicts_with_all = ["adapt", "blocks"]
    )]
    periodic: Option<Axes>,
    #[command(flatten)]
    layers: layers::Args,
    /// Of a function fitted to points, keep the surface where there are no points, as a part named unseen
    #[arg(long)]
    close: bool,
    /// Write a file; its ending names the format (- for stdout, with --to); may be repeated
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Format of the output, where its name does not tell it
    #[arg(long, value_name = "FORMAT")]
    to: Option<String>,
    #[command(flatten)]
    language: Language,
}

/// How to mesh; shared with `recover`.
#[derive(clap::Args, Clone, Debug, Default)]
#[group(id = "MeshSettings")]
pub(crate) struct Settings {
    /// Length of edges, the largest one where sizes vary [default: a fortieth of the diagonal]
    #[arg(
        long, value_name = "LENGTH",
        allow_negative_numbers = true,
        value_parser = output::positive
    )]
    pub(crate) size: Option<f64>,
    /// Smaller edges where a face would leave the surface by more than this
    #[arg(
        long, value_name = "LENGTH",
        allow_negative_numbers = true,
        value_parser = output::positive
    )]
    pub(crate) grade: Option<f64>,
    /// Smaller edges by place: a table x,y,z,length (of a refinement, or from an error estimate),
    /// or a HyperFun program of the length
    #[arg(long, value_name = "FILE")]
    pub(crate) sizes: Option<PathBuf>,
    /// 2 for elements with nodes in the middles of their edges, on the true surface
    #[arg(long, value_name = "1|2", value_parser = clap::value_parser!(u32).range(1..=2))]
    pub(crate) order: Option<u32>,
    /// Only the surface, as triangles
    #[arg(long)]
    pub(crate) surface_only: bool,
    /// Mesh what lies in this box: x,y,z of the lower and of the upper corner; the cuts are parts
    /// named cap.x_min ...
    #[arg(long = "box", value_name = "NUMBERS", allow_hyphen_values = true, value_parser = output::region)]
    pub(crate) region: Option<Aabb>,
    /// Bounds of the dihedral angles, degrees: worked towards, and required in the certificate
    /// [default: 21,149, not required]
    #[arg(long, value_name = "MIN,MAX", value_parser = angles)]
    pub(crate) angles: Option<Angles>,
    /// Refuse a mesh that takes more memory than this many GiB, by estimate [default: 16, or what
    /// the machine has]
    #[arg(long, value_name = "GIB", allow_negative_numbers = true, value_parser = output::positive)]
    pub(crate) memory: Option<f64>,
    /// The box in which the solid is sought first.
    #[arg(skip)]
    pub(crate) start: Option<Aabb>,
    /// The axes along which the box is a unit cell.
    #[arg(skip)]
    pub(crate) periodic: [bool; 3],
    /// Layers of wedges along parts of the surface.
    #[arg(skip)]
    pub(crate) layers: Option<Layers>,
}

/// Axes along which a box repeats.
#[derive(Clone, Copy, Debug)]
struct Axes([bool; 3]);

/// Reads the axes of --periodic.
fn axes(text: &str) -> Result<Axes, String> {
    let mut axes = [false; 3];
    for letter in text.chars() {
        match "xyz".find(letter.to_ascii_lowercase()) {
            Some(axis) if !axes[axis] => axes[axis] = true,
            _ => return Err("letters of x, y and z are expected, each once, as xyz".to_owned()),
        }
    }
    match axes.contains(&true) {
        true => Ok(Axes(axes)),
        false => Err("at least one of x, y and z is expected".to_owned()),
    }
}

/// Smallest and largest angle, degrees.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Angles(pub(crate) [f64; 2]);

/// Reads the two angles of --angles.
fn angles(text: &str) -> Result<Angles, String> {
    match output::numbers(text)?.as_slice() {
        // A regular tetrahedron has 70.5 degrees.
        &[min, max] if (0.0..=70.0).contains(&min) && (71.0..=180.0).contains(&max) => {
            Ok(Angles([min, max]))
        }
        _ => Err(
            "two angles are expected, one of at most 70 and one of at least 71 degrees".to_owned(),
        ),
    }
}

/// Numbers of blocks by axis.
#[derive(Clone, Copy, Debug)]
struct Counts([usize; 3]);

/// Reads the numbers of --blocks.
fn counts(text: &str) -> Result<Counts, String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) if x > 0 && y > 0 && z > 0 => Ok(Counts([x, y, z])),
        _ => Err("three whole numbers above 0 are expected, as 4,4,4".to_owned()),
    }
}

impl Args {
    /// Returns the options as the library takes them.
    pub(crate) fn mesh_options(&self, context: &Context) -> Result<MeshModelOptions, Failure> {
        work::options(&self.settings, context)
    }
}

/// Runs the verb.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    let layers = layers::read(&args.layers, args.settings.order)?;
    if let Some(counts) = args.blocks {
        return blocks::run(args, counts.0, context);
    }
    let targets = files::targets(&args.output, args.to.as_deref(), context)?;
    if let Some(file) = solids::find(&args.model)? {
        return solid::run(args, file, &targets, context);
    }
    let subject = subject(args, context)?;
    let given = args
        .adapt
        .as_deref()
        .map(|path| scan::read_mesh_file(path, None))
        .transpose()?;
    let settings = Settings {
        periodic: args.periodic.map_or([false; 3], |axes| axes.0),
        layers,
        ..args.settings.clone()
    };
    let mut made = work::make(&subject, &settings, given.map(|g| g.0).as_ref(), context)?;
    let stdout = files::write(&mut made, &targets)?;
    made.say(context);
    let json = document::document(&made);
    let outcome = Outcome::of(made.exit(), json, stdout, || table::text(&made));
    context.hand_over(|| Product::Mesh(made.mesh.meshed.mesh, made.unit));
    Ok(outcome)
}

/// What is to be meshed: a file of JSON is a function fitted to points, any other a
/// program.
fn subject(args: &Args, context: &Context) -> Result<Subject, Failure> {
    let name = memory::name(&args.model);
    if spline::is_json(&args.model) {
        if args.adapt.is_some() {
            return Err(Failure::usage("--adapt needs a HyperFun program"));
        }
        if !args.regions.is_empty() {
            return Err(Failure::usage("--regions needs a HyperFun program"));
        }
        let unseen = if args.close {
            Unseen::Close
        } else {
            Unseen::Cut
        };
        return Ok(Subject {
            name,
            shape: Shape::Spline(Box::new(spline::read(&args.model)?), unseen),
            unit: None,
            regions: Vec::new(),
        });
    }
    let model = gallery::template(&args.model, &args.language, context)?;
    let values = parameters::values(&model, &args.given, context)?;
    let regions = regions::read(&args.regions, (&model, &values), &args.language, context)?;
    Ok(Subject {
        name,
        unit: model.info().unit.clone(),
        regions,
        shape: Shape::Model(Box::new(model), values),
    })
}
