//! The documents of a triangulated surface: the report, the sidecar, and what --json prints.

use super::MadeSurface;
use crate::outcome;
use isoform::report::{Sidecar, SurfaceReport, TriangulateReport, WrittenFile};
use isoform::tess::Surface;
use serde_json::{Value, json};

/// Returns the document that --json prints: the report, the options and the files.
pub(super) fn document(made: &MadeSurface) -> Value {
    let files = made.written.iter().map(|w| WrittenFile {
        path: w.path.clone(),
        format: w.format,
        warnings: w.warnings.clone(),
    });
    outcome::json_of(&TriangulateReport::new(
        &made.drawn.about(&made.name),
        files.collect(),
    ))
}

/// The file of the report.
pub(super) fn file(made: &MadeSurface) -> Vec<u8> {
    let mut json = json!({"schema": 1});
    let report = SurfaceReport::new(&made.drawn.about(&made.name));
    outcome::add(&mut json, outcome::json_of(&report));
    let mut bytes = serde_json::to_vec_pretty(&json).unwrap_or_default();
    bytes.push(b'\n');
    bytes
}

/// The file of the sidecar.
pub(super) fn sidecar(surface: &Surface) -> Vec<u8> {
    let mut bytes = serde_json::to_vec(&Sidecar::new(surface)).unwrap_or_default();
    bytes.push(b'\n');
    bytes
}
