//! `isoform mesh`: labelled surfaces and tetrahedra of a model, with a certificate.

mod blocks;
pub(crate) mod document;
pub(crate) mod files;
mod layers;
mod regions;
pub(crate) mod settings;
mod sizes;
mod solid;
pub(crate) mod table;
pub(crate) mod work;

use crate::context::Context;
use crate::failure::Failure;
use crate::language::Language;
use crate::memory;
use crate::model::{GivenModel, SolidModel};
use crate::outcome::Outcome;
use crate::parameters::Given;
use crate::product::Product;
use crate::{gallery, scan, solids};
use isoform::geom::Aabb;
use isoform::{Implicit, MeshModelOptions, Unseen};
use settings::Settings;
use std::path::PathBuf;
use work::{MeshInput, Shape};

/// Meshes a model: tetrahedra with their labelled surface
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform mesh part.hf --size 0.25 -o part.msh -o part.inp
  isoform mesh part.hf --surface-only --grade 0.01 -o part.obj
  isoform mesh \"x^2 + y^2 + z^4 = 1\" -o print.stl
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
Of a solid (STEP of any program, .brep.json) the faces are divided into triangles for display, closed and near to
them (--grade, --size), without regard to their shape.

Exit code: 0, or 3 if the certificate fails or something is left unproved (files are written all the same), 4 without a
mesh, 2 for unreadable input, 130 after Ctrl-C.")]
pub(crate) struct Args {
    /// The model: a HyperFun file (- for stdin), a formula as "x^2 + y^2 + z^4 = 1", the name of a
    /// built-in template, a function fitted to points (.json, from isoform implicitize), or a
    /// solid: STEP, .brep.json
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
    /// Mesh in this number of blocks along x, y and z, one after the other: memory is that of one
    /// block. -o names a .pvtu, which refers to a .vtu for each block; blocks meet node for node
    #[arg(
        long,
        value_name = "NX,NY,NZ",
        value_parser = counts,
        conflicts_with_all = ["adapt", "to"]
    )]
    blocks: Option<Counts>,
    /// Mesh the model in regions with common nodes: objects of the program, or files of others.
    /// Each takes the part of the model that lies in it and in none before it; the rest is one more
    #[arg(
        long,
        value_name = "NAME|FILE,...",
        value_delimiter = ',',
        conflicts_with_all = ["adapt", "blocks", "surface_only"]
    )]
    regions: Vec<String>,
    /// Mesh the box as a unit cell that repeats along these axes, as xyz or z: opposite sides have
    /// equal triangles, node for node. The function must be periodic in the box
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
    /// Keep the surface of a fitted function beyond its points, as a part named unseen
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
    let (subject, region) = subject(args, context)?;
    let given = args
        .adapt
        .as_deref()
        .map(|path| scan::read_mesh_file(path, None))
        .transpose()?;
    let settings = Settings {
        periodic: args.periodic.map_or([false; 3], |axes| axes.0),
        layers,
        region,
        ..args.settings.clone()
    };
    let mut made = work::make(&subject, &settings, given.map(|g| g.0).as_ref(), context)?;
    let stdout = files::write(&mut made, &targets)?;
    made.say(context);
    let json = document::document(&made);
    let outcome = Outcome::new(made.exit(), json, stdout, || table::text(&made));
    context.hand_over(|| Product::Mesh(made.mesh.meshed.mesh, made.unit));
    Ok(outcome)
}

/// Reads the input of the verb, with its region: a function fitted to points, or a model.
fn subject(args: &Args, context: &Context) -> Result<(MeshInput, Option<Aabb>), Failure> {
    let name = memory::name(&args.model);
    let model = gallery::model(&args.model, &args.language, context)?;
    let model = match model {
        GivenModel::Fitted(fitted) => return fitted_input(args, name, fitted),
        model => model,
    };
    let solid = model.solid(&args.model, &args.given, args.settings.region, context)?;
    let SolidModel {
        model,
        values,
        region,
        ..
    } = solid;
    let regions = regions::read(&args.regions, (&model, &values), &args.language, context)?;
    let input = MeshInput {
        name,
        unit: model.info().unit.clone(),
        regions,
        shape: Shape::Model(Box::new(model), values),
    };
    Ok((input, region))
}

/// Returns the input for a function fitted to points.
fn fitted_input(
    args: &Args,
    name: String,
    fitted: Box<Implicit>,
) -> Result<(MeshInput, Option<Aabb>), Failure> {
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
    let input = MeshInput {
        name,
        shape: Shape::Spline(fitted, unseen),
        unit: None,
        regions: Vec::new(),
    };
    Ok((input, args.settings.region))
}
