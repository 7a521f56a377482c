//! Triangles of solids of exact faces, for display.

use super::files::{self, MeshTarget};
use super::{Args, table};
use crate::context::Context;
use crate::failure::Failure;
use crate::memory;
use crate::outcome::{self, Outcome};
use crate::product::Product;
use crate::solids::{self, FoundSolids};
use crate::table::line;
use isoform::brep::FacetOptions;
use isoform::check::{Options, certify};
use isoform::geom::{Aabb, Mesh};
use isoform::report::{CertificateReport, ContentsReport, brief};
use serde_json::{Value, json};

/// Default distance of triangles from faces, in diagonals of the box of the vertices: too small to
/// see.
const CHORD: f64 = 5e-4;

/// Triangles of solids, with how they were made.
struct Divided {
    mesh: Mesh,
    unit: Option<String>,
    /// Maximum distance of edges from their chords that was asked for.
    chord: f64,
    /// Largest distance of the triangles from the faces.
    deviation: f64,
}

/// Divides the faces as finely as the arguments say.
fn divided(args: &Args, file: FoundSolids, context: &Context) -> Result<Divided, Failure> {
    let vertices = match &file {
        FoundSolids::Own(file) => &file.brep.vertices,
        FoundSolids::Shape(file) => &file.shape.vertices,
    };
    let size = Aabb::from_points(vertices).diagonal();
    let options = FacetOptions {
        chord: args.settings.grade.unwrap_or(CHORD * size),
        longest: args.settings.size.unwrap_or(f64::INFINITY),
    };
    let chord = options.chord;
    Ok(match file {
        FoundSolids::Own(file) => {
            let unit = file.unit.clone();
            let solid = solids::divided(&args.model, *file, Some(options), context)?;
            Divided {
                mesh: solid.mesh(),
                unit,
                chord,
                deviation: solid.facets().deviation,
            }
        }
        FoundSolids::Shape(mut file) => {
            // Without two vertices that differ the default of the library is finer than none.
            let options = (chord > 0.0).then_some(options);
            let shape = solids::prepared(&args.model, &mut file, options, context)?;
            Divided {
                mesh: shape.mesh(),
                unit: Some(file.unit),
                chord,
                deviation: shape.deviation(),
            }
        }
    })
}

/// Divides the faces, looks for what is wrong with the triangles, and writes them.
pub(super) fn run(
    args: &Args,
    file: FoundSolids,
    targets: &[MeshTarget],
    context: &Context,
) -> Result<Outcome, Failure> {
    refuse_others(args)?;
    let Divided {
        mesh,
        unit,
        chord,
        deviation,
    } = divided(args, file, context)?;
    let certificate = certify(&mesh, None, &Options::default(), &context.control());
    let (written, stdout) = files::write_mesh_files(&mesh, unit.as_deref(), targets)?;
    let paths: Vec<Value> = written.iter().map(|w| json!(w.path)).collect();
    let mut json = json!({
        "ok": certificate.is_ok(),
        "verb": "mesh",
        "model": {"file": memory::name(&args.model), "unit": unit},
        "chord": chord,
        "deviation": deviation,
    });
    outcome::add(&mut json, outcome::json_of(&ContentsReport::new(&mesh)));
    json["certificate"] = outcome::json_of(&CertificateReport::new(&certificate));
    json["files"] = json!(paths);
    let exit = outcome::exit(certificate.is_ok());
    let outcome = Outcome::new(exit, json, stdout, || {
        let near = format!("{} from the faces at most", brief(deviation));
        table::of_mesh(&mesh, &certificate, unit.as_deref())
            + &line("distance", near)
            + &table::wrote(&written)
    });
    context.hand_over(|| Product::Mesh(mesh, unit));
    Ok(outcome)
}

/// Rejects options that need a function: a solid is meshed unchanged, by its surface.
fn refuse_others(args: &Args) -> Result<(), Failure> {
    let settings = &args.settings;
    let others = [
        ("--sizes", settings.sizes.is_some()),
        ("--order 2", settings.order == Some(2)),
        ("--box", settings.region.is_some()),
        ("--adapt", args.adapt.is_some()),
        ("--layers", !args.layers.layers.is_empty()),
        ("--params or --set", !args.given.is_empty()),
        ("--close", args.close),
    ];
    match others.iter().find(|o| o.1) {
        Some((option, _)) => Err(Failure::usage(format!("{option} needs a HyperFun program"))
            .why("of a solid only the faces are divided into triangles")
            .hint("--grade or --size; isoform mesh with the program of the solid")),
        None => Ok(()),
    }
}
