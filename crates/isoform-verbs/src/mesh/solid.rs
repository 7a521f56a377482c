//! Triangles of solids of exact faces, for display.

use super::files::{self, MeshTarget};
use super::{Args, table};
use crate::context::Context;
use crate::failure::Failure;
use crate::memory;
use crate::outcome::{self, Outcome};
use crate::product::Product;
use crate::solids;
use crate::table::line;
use isoform::brep::FacetOptions;
use isoform::check::{Options, certify};
use isoform::geom::Aabb;
use isoform::io::SolidFile;
use isoform::report::{CertificateReport, ContentsReport, brief};
use serde_json::{Value, json};

/// Default distance of triangles from faces, in diagonals of the box of the vertices: too small to
/// see.
const CHORD: f64 = 5e-4;

/// Divides the faces, looks for what is wrong with the triangles, and writes them.
pub(super) fn run(
    args: &Args,
    file: SolidFile,
    targets: &[MeshTarget],
    context: &Context,
) -> Result<Outcome, Failure> {
    refuse_others(args)?;
    let size = Aabb::from_points(&file.brep.vertices).diagonal();
    let options = FacetOptions {
        chord: args.settings.grade.unwrap_or(CHORD * size),
        longest: args.settings.size.unwrap_or(f64::INFINITY),
    };
    let unit = file.unit.clone();
    let solid = solids::divided(&args.model, file, Some(options), context)?;
    let mesh = solid.mesh();
    let certificate = certify(&mesh, None, &Options::default(), &context.control());
    let (written, stdout) = files::write_mesh_files(&mesh, unit.as_deref(), targets)?;
    let deviation = solid.facets().deviation;
    let paths: Vec<Value> = written.iter().map(|w| json!(w.path)).collect();
    let mut json = json!({
        "ok": certificate.is_ok(),
        "verb": "mesh",
        "model": {"file": memory::name(&args.model), "unit": unit},
        "chord": options.chord,
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
