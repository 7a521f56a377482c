//! Meshes in a page, as arrays: the surface with its parts, tetrahedra, feature curves.

use crate::blob::Blobs;
use crate::points::{numbers, positions};
use isoform::flat_triangles;
use isoform::geom::Mesh;
use serde_json::{Value, json};

/// Returns a layer of triangles, with the tetrahedra that they bound, if any. Elements of second
/// order are shown with straight edges between all of their nodes, wedges as tetrahedra.
pub(crate) fn layer(name: &str, mesh: &Mesh, blobs: &mut Blobs) -> Value {
    let mesh = &*mesh.simplices();
    let (triangles, parts) = flat_triangles(mesh);
    let mut layer = json!({
        "kind": "mesh",
        "name": name,
        "count": triangles.len(),
        "positions": positions(&mesh.points, [0.0; 3], blobs),
        "triangles": blobs.u32(triangles.as_flattened()),
        "parts": mesh.parts,
    });
    if parts.len() == triangles.len() && !mesh.parts.is_empty() {
        layer["triangleParts"] = blobs.u32(&parts);
    }
    if !mesh.tets.is_empty() {
        layer["tets"] = blobs.u32(mesh.tets.as_flattened());
    }
    if !mesh.edges.is_empty() {
        layer["edges"] = blobs.u32(mesh.edges.as_flattened());
    }
    let columns = mesh
        .columns
        .iter()
        .filter(|c| c.values.len() == mesh.points.len());
    let columns: Vec<Value> = columns
        .map(|c| json!({"name": c.name, "values": numbers(&c.values, blobs)}))
        .collect();
    layer["columns"] = columns.into();
    layer
}
