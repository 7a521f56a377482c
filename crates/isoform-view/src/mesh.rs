//! Meshes as arrays of a page: the surface with its parts, tetrahedra, feature curves.

use crate::blob::Blobs;
use crate::points::{numbers, positions};
use isoform::geom::{Mesh, TRIANGLE_EDGES};
use serde_json::{Value, json};

/// A layer of triangles, with the tetrahedra behind them where there are any. Elements of second
/// order are shown with straight edges between all of their nodes.
pub(crate) fn layer(name: &str, mesh: &Mesh, blobs: &mut Blobs) -> Value {
    let (triangles, parts) = surface(mesh);
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

/// The triangles between all nodes of the surface, and the part of each.
fn surface(mesh: &Mesh) -> (Vec<[u32; 3]>, Vec<u32>) {
    if mesh.triangle_mids.is_empty() {
        return (mesh.triangles.clone(), mesh.triangle_parts.clone());
    }
    let mut triangles = Vec::with_capacity(4 * mesh.triangles.len());
    for (corners, mids) in mesh.triangles.iter().zip(&mesh.triangle_mids) {
        // The three at the corners, each between the mid nodes of its two edges, and the middle
        // one.
        for (k, corner) in corners.iter().enumerate() {
            let before = TRIANGLE_EDGES.iter().position(|e| e[1] == k).unwrap_or(0);
            triangles.push([*corner, mids[k], mids[before]]);
        }
        triangles.push(*mids);
    }
    let parts = mesh.triangle_parts.iter().flat_map(|p| [*p; 4]).collect();
    (triangles, parts)
}
