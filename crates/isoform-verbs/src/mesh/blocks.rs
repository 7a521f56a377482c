//! `isoform mesh --blocks`: a huge model block after block.

use super::settings::Settings;
use super::work::{self, MeshInput, Shape};
use super::{Args, subject};
use crate::context::Context;
use crate::disk;
use crate::failure::Failure;
use crate::outcome::{self, Outcome};
use crate::scan;
use crate::table::line;
use isoform::report::brief;
use isoform::{
    BlockFailure, BlockWarning, BlocksError, BlocksReport, Control, WholeReport, mesh_in_blocks,
};
use serde_json::json;
use std::path::Path;

/// Meshes the model, writes all files, and says what is known of them.
pub(super) fn run(args: &Args, counts: [usize; 3], context: &Context) -> Result<Outcome, Failure> {
    let [out] = args.output.as_slice() else {
        return Err(Failure::usage("--blocks writes one grid").hint("-o big.pvtu, once"));
    };
    disk::check_folder(out)?;
    let (subject, region) = subject(args, context)?;
    let Shape::Model(model, values) = &subject.shape else {
        return Err(Failure::usage("--blocks needs a HyperFun program"));
    };
    let settings = Settings {
        region,
        ..args.settings.clone()
    };
    let options = work::options(&settings, context)?;
    let phases = work::Phases::new(context);
    let show = |phase: &str, done: f64| phases.share(phase, done);
    let control = Control {
        progress: Some(&show),
        ..context.control()
    };
    let made = mesh_in_blocks(model, values, counts, out, &options, &control);
    let report = made.map_err(|e| failure(e, args, &subject))?;
    say(&report, context);
    let mut json = outcome::json_of(&report);
    json["ok"] = report.certificate.ok.into();
    json["model"] = json!({
        "file": subject.name,
        "object": model.name(),
        "parameters": values,
        "unit": subject.unit,
    });
    json["files"] = json!([out.display().to_string()]);
    json["seconds"] = phases.seconds().into_iter().collect();
    let exit = outcome::exit(report.is_as_asked());
    Ok(Outcome::new(exit, json, Vec::new(), || text(&report, out)))
}

/// Converts an error of meshing in blocks to a failure.
fn failure(error: BlocksError, args: &Args, subject: &MeshInput) -> Failure {
    match error {
        BlocksError::Mesh(e) => work::no_mesh(&e, &subject.name, &args.settings),
        BlocksError::Write(e) => scan::unwritable_mesh(&e),
        e @ BlocksError::Ending { .. } => Failure::usage(e.to_string()).hint("-o big.pvtu"),
        e => Failure::input("not-writable", e.to_string())
            .hint("write where there is room and permission"),
    }
}

/// Says all warnings, and what does not hold, on stderr.
fn say(report: &BlocksReport, context: &Context) {
    let at = |place: Option<[f64; 3]>| {
        place.map_or(String::new(), |p| format!(" at {}", work::place(p)))
    };
    for BlockWarning { message, at: place } in &report.warnings {
        context.warn(format!("{message}{}", at(*place)));
    }
    for block in &report.blocks {
        let figures = block.figures.iter();
        for BlockFailure {
            message, at: place, ..
        } in figures.flat_map(|f| &f.failures)
        {
            context.warn(format!("block {}: {message}{}", block.block, at(*place)));
        }
    }
}

/// The certificate as a short table.
fn text(report: &BlocksReport, out: &Path) -> String {
    let WholeReport {
        ok,
        shared_faces,
        tets,
        triangles,
        volume,
        area,
        dihedral_angles,
        node_distance,
        face_distance,
        covered,
        ..
    } = &report.certificate;
    let [nx, ny, nz] = report.counts;
    let mut lines = vec![
        line("size", brief(report.size)),
        line(
            "mesh",
            format!("{tets} tetrahedra, {triangles} triangles in {nx} x {ny} x {nz} blocks"),
        ),
        line(
            "interfaces",
            format!("{shared_faces} faces, each in two blocks, node for node"),
        ),
        line(
            "volume",
            format!("{}, area {}", brief(*volume), brief(*area)),
        ),
    ];
    if let Some([least, most]) = dihedral_angles {
        lines.push(line("angles", format!("{least:.2} to {most:.2} degrees")));
    }
    let distances = format!(
        "nodes {}, faces {}",
        brief(*node_distance),
        brief(*face_distance)
    );
    lines.push(line("distance", distances));
    let features = format!("{:.3} % of the curves covered", 100.0 * covered);
    lines.push(line("features", features));
    let verdict = match (*ok, report.warnings.is_empty()) {
        (false, _) => "does not hold",
        (true, true) => "holds in every block",
        (true, false) => "holds in every block, but something is left open (see the warnings)",
    };
    lines.push(line("certificate", verdict.to_owned()));
    lines.push(line("wrote", format!("{} (pvtu)", out.display())));
    lines.concat()
}
