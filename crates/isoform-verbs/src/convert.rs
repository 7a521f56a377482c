//! `isoform convert`: points and meshes from format to format, programs with values, level sets.

use crate::arguments;
use crate::context::Context;
use crate::disk;
use crate::failure::{DONE, Failure};
use crate::gallery;
use crate::kind;
use crate::language::Language;
use crate::memory;
use crate::mesh::settings::Settings;
use crate::mesh::work::no_mesh;
use crate::model::SolidModel;
use crate::outcome::Outcome;
use crate::parameters::{self, Given};
use crate::{scan, solids};
use isoform::geom::Aabb;
use isoform::io::{
    MeshPoints, MeshWriteOptions, WriteOptions, format_named, mesh_format_for, mesh_format_named,
    write, write_mesh, write_mesh_path, write_path,
};
use isoform::{LevelSetFileError, level_set_file};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

/// Converts points and meshes from format to format, and programs to 3MF and back
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform convert scan.e57 -o scan.ply
  isoform convert part.stl --samples 20000 -o part.xyz
  isoform convert part.msh -o part.inp
  isoform convert part.3mf -o part.stl
  isoform convert template.hf --params 1,2,0.5 -o part.hf
  isoform convert part.hf -o part.3mf
  isoform convert part.3mf -o part.hf

A program becomes a level set of an implicit function in 3MF, and level sets become a program;
isoform mesh makes triangles of either.
Points are written as PLY, XYZ and CSV; every number reads back exactly. Meshes (msh, vtu, inp, obj, ...) keep their groups
where the format has them.")]
pub(crate) struct Args {
    /// The file (- for stdin)
    file: PathBuf,
    /// The result; its ending names the format (- for stdout, with --to)
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Format of the input, where neither name nor content tell it
    #[arg(long, value_name = "FORMAT")]
    from: Option<String>,
    /// Format of the output, where its name does not tell it
    #[arg(long, value_name = "FORMAT")]
    to: Option<String>,
    /// Take at most that many points, a seeded random sample
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    max_points: Option<u64>,
    /// Number of points to sample on the triangles of a mesh, uniformly by area, in place of its
    /// vertices
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    samples: Option<u64>,
    /// PLY as text
    #[arg(long)]
    ascii: bool,
    /// Box that bounds a level set, as x,y,z of the lower and of the upper corner [default: sought]
    #[arg(long = "box", value_name = "NUMBERS", allow_hyphen_values = true, value_parser = arguments::region)]
    region: Option<Aabb>,
    #[command(flatten)]
    given: Given,
    #[command(flatten)]
    language: Language,
}

/// Returns true if the ending of a file, or the format that was said, is this one.
fn is_called(path: &Path, said: Option<&String>, ending: &str) -> bool {
    let own = path.extension().map(|e| e.to_string_lossy());
    let name = said.map(|f| f.trim_start_matches('.').into());
    name.or(own).is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

/// Runs the verb: the kinds of input and output, as names or formats tell them, choose the way.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    let is_model = match &args.from {
        Some(_) => is_called(&args.file, args.from.as_ref(), "hf"),
        None => kind::is_model(&args.file) || gallery::is_named(&args.file)?,
    };
    let is_stored = is_model || args.file == Path::new("-") || memory::find(&args.file).is_some();
    if !is_stored {
        fs::metadata(&args.file).map_err(|e| Failure::file(&args.file, "open", &e))?;
    }
    let output = std::slice::from_ref(&args.output);
    solids::refuse(output, args.to.as_deref(), |path| {
        let file = args.file.display();
        match is_model {
            true => format!("isoform brep {file} -o {path}"),
            false => format!("isoform recover {file} -o {path}"),
        }
    })?;
    let json = json!({"verb": "convert", "input": args.file.display().to_string(), "output": args.output.display().to_string()});
    let is_output = |ending| is_called(&args.output, args.to.as_ref(), ending);
    match (is_model, is_output("hf")) {
        (true, true) => program(args, json, context),
        (true, false) if is_output("3mf") => level_set(args, json, context),
        (false, false) if is_mesh(args) => mesh(args, json, context),
        (false, false) => points(args, json, context),
        (true, false) => {
            let failure = Failure::usage("a model is not turned into points or triangles here");
            Err(failure
                .hint("-o with the ending .hf or .3mf; isoform mesh makes triangles of a model"))
        }
        (false, true) => Err(Failure::usage("points are not turned into a model here")
            .hint("isoform fit SCAN --template T -o model.hf")),
    }
}

/// Returns true if both formats are formats of meshes, and at least one of nothing else. An output
/// format in which points are only read counts too, unless a sample of points is requested.
fn is_mesh(args: &Args) -> bool {
    let (from, to) = (args.from.as_deref(), args.to.as_deref());
    let name = |path: &Path, said: Option<&str>| {
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        said.map_or_else(|| ending.into_owned(), str::to_owned)
    };
    let can = |path: &Path, said: Option<&str>| match said {
        Some(name) => mesh_format_named(name).is_some(),
        None => mesh_format_for(path).is_some(),
    };
    let is_only_read = format_named(&name(&args.output, to)).is_some_and(|f| !f.is_writable());
    let is_sampled = args.samples.is_some() || args.max_points.is_some();
    let is_surface = is_only_read && !is_sampled;
    (scan::is_mesh(&args.file, from) || scan::is_mesh(&args.output, to) || is_surface)
        && can(&args.file, from)
        && can(&args.output, to)
}

/// Converts a mesh with its groups.
fn mesh(args: &Args, mut json: Value, context: &Context) -> Result<Outcome, Failure> {
    let (mesh, report) = scan::read_mesh_file(&args.file, args.from.as_deref())?;
    let options = MeshWriteOptions {
        ascii: args.ascii.then_some(true),
        units: report.units.clone(),
    };
    let mut stdout = Vec::new();
    let written = if args.output == Path::new("-") {
        write_mesh(
            &mesh,
            &mut stdout,
            args.to.as_deref().unwrap_or_default(),
            &options,
        )
    } else {
        write_mesh_path(&mesh, &args.output, args.to.as_deref(), &options)
    }
    .map_err(|e| scan::unwritable(&e))?;
    json["counts"] = json!({"points": mesh.points.len(), "triangles": mesh.triangles.len(), "tets": mesh.tets.len()});
    if mesh.has_layers() {
        json["counts"]["wedges"] = mesh.wedges.len().into();
        json["counts"]["quads"] = mesh.quads.len().into();
    }
    json["formats"] = json!([report.format, written.format]);
    json["warnings"] = warned([&report.warnings, &written.warnings], context);
    if context.global.json && !stdout.is_empty() {
        json["text"] = json!(String::from_utf8_lossy(&stdout));
    }
    Ok(Outcome {
        exit: DONE,
        json,
        stdout,
    })
}

/// Warns of what was read and of what was written; all warnings for the document.
fn warned(warnings: [&[String]; 2], context: &Context) -> Value {
    let warnings = warnings.concat();
    for warning in &warnings {
        context.warn(warning);
    }
    json!(warnings)
}

/// A count of the command line as a count of things in memory.
fn size(n: Option<u64>) -> Option<usize> {
    n.map(|n| usize::try_from(n).unwrap_or(usize::MAX))
}

/// Converts points, or samples on the triangles of a mesh.
fn points(args: &Args, mut json: Value, context: &Context) -> Result<Outcome, Failure> {
    let mesh = size(args.samples).map_or(MeshPoints::Vertices, MeshPoints::Samples);
    let (cloud, report) = scan::read_points(
        &args.file,
        args.from.as_deref(),
        size(args.max_points),
        mesh,
        context,
    )?;
    let options = WriteOptions {
        ascii: args.ascii,
        units: report.units.clone(),
    };
    let mut stdout = Vec::new();
    let written = if args.output == Path::new("-") {
        write(
            &cloud,
            &mut stdout,
            args.to.as_deref().unwrap_or("xyz"),
            &options,
        )
    } else {
        write_path(&cloud, &args.output, args.to.as_deref(), &options)
    }
    .map_err(|e| scan::unwritable(&e))?;
    json["points"] = json!(cloud.points.len());
    json["dropped"] = json!(report.dropped_points);
    json["formats"] = json!([report.format, written.format]);
    json["warnings"] = warned([&report.warnings, &written.warnings], context);
    if stdout.is_empty() {
        context.note(format_args!(
            "{} points written to {}",
            cloud.points.len(),
            args.output.display()
        ));
    } else if context.global.json {
        json["text"] = json!(String::from_utf8_lossy(&stdout));
    }
    Ok(Outcome {
        exit: DONE,
        json,
        stdout,
    })
}

/// Prints a model again; where values are given, as the program that has them in it.
fn program(args: &Args, mut json: Value, context: &Context) -> Result<Outcome, Failure> {
    let model = gallery::model(&args.file, &args.language, context)?.into_stated(&args.file)?;
    let text = match args.given.is_empty() {
        false => model.print_fitted(&parameters::values(&model, &args.given, context)?, None),
        true => model.source().to_owned(),
    };
    json["object"] = json!(model.name());
    if args.output == Path::new("-") {
        json["text"] = json!(text);
        return Ok(Outcome {
            exit: DONE,
            json,
            stdout: text.into_bytes(),
        });
    }
    disk::write_file(&args.output, text.as_bytes())?;
    Ok(Outcome {
        exit: DONE,
        json,
        stdout: Vec::new(),
    })
}

/// Writes a model as a level set in 3MF.
fn level_set(args: &Args, mut json: Value, context: &Context) -> Result<Outcome, Failure> {
    let model = gallery::model(&args.file, &args.language, context)?;
    let solid = model.solid(&args.file, &args.given, args.region, context)?;
    let SolidModel {
        model,
        values,
        region,
        ..
    } = solid;
    json["object"] = json!(model.name());
    let title = model.info().title.as_deref();
    let stem = args.output.file_stem().map(|s| s.to_string_lossy());
    let name = title.map(Into::into).or(stem).unwrap_or_default();
    let control = context.control();
    let made = level_set_file(&model, &values, region, &name, &control);
    let bytes = made.map_err(|e| unexpressed(&e, &args.file))?;
    json["formats"] = json!(["hf", "3mf"]);
    if args.output == Path::new("-") {
        return Ok(Outcome {
            exit: DONE,
            json,
            stdout: bytes,
        });
    }
    disk::write_file(&args.output, &bytes)?;
    Ok(Outcome {
        exit: DONE,
        json,
        stdout: Vec::new(),
    })
}

/// The failure of a model that cannot be a level set.
fn unexpressed(error: &LevelSetFileError, path: &Path) -> Failure {
    let name = memory::name(path);
    if let LevelSetFileError::Bounds(error) = error {
        return no_mesh(error, &name, &Settings::default());
    }
    let failure = Failure::input("level-set", format!("{name}: {error}"));
    failure.hint("isoform mesh writes the model as triangles in 3MF")
}
