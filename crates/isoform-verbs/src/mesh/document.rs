//! The JSON document of a mesh.

use super::work::MadeMesh;
use crate::outcome;
use isoform::report::{MeshReport, ModelName, Seconds, WrittenFile};
use serde_json::Value;

/// Returns all results of meshing as JSON. All fields but `seconds` are reproducible.
pub(crate) fn document(made: &MadeMesh) -> Value {
    let model = ModelName {
        file: made.name.clone(),
        object: made.object.clone(),
        parameters: made.values.clone(),
        unit: made.unit.clone(),
    };
    let files = made.written.iter().map(|w| WrittenFile {
        path: w.path.clone(),
        format: w.format,
        warnings: w.warnings.clone(),
    });
    let seconds = Seconds(made.seconds.clone());
    outcome::json_of(&MeshReport::new(
        &made.mesh,
        model,
        files.collect(),
        seconds,
    ))
}
