//! The JSON document of a mesh.

use super::work::Made;
use crate::outcome;
use isoform::report::{MeshReport, ModelName, Seconds, WrittenFile};
use serde_json::Value;

/// Everything that is known of the mesh. All but `seconds` is the same each time.
pub(crate) fn document(made: &Made) -> Value {
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
