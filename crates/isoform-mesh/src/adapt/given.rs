//! Validation of given meshes, and problems that alignment leaves.

use super::align::Aligned;
use crate::distance::distance_at;
use crate::error::{MeshError, Warning, WarningKind};
use crate::points::centroid;
use isoform_check::Certificate;
use isoform_geom::{Mesh, Point3, Solid};
use std::collections::HashMap;

/// Distance from the model, in diagonals, up to which a mesh can be adapted.
const MAX_RELATIVE_OFFSET: f64 = 0.15;
/// Share of the vertices that must be near the model.
const MIN_NEAR_SHARE: f64 = 0.75;

/// Returns the error for a mesh that is not accepted.
pub(super) fn wrong(why: impl Into<String>) -> MeshError {
    MeshError::Input { why: why.into() }
}

fn nowhere_near(at: Point3) -> MeshError {
    let at = place(at);
    wrong(format!(
        "has a surface that is nowhere near the model's, as at {at}"
    ))
}

/// Formats a point for messages.
pub(super) fn place([x, y, z]: Point3) -> String {
    format!("({x}, {y}, {z})")
}

/// Drops mid nodes, labels and unused nodes, and merges coincident nodes: files of triangles repeat
/// them.
pub(super) fn welded(mesh: &Mesh) -> Mesh {
    let mut known: HashMap<[u64; 3], u32> = HashMap::new();
    let mut points = Vec::new();
    let mut number = |v: u32| {
        let p = mesh.points[v as usize];
        // Adding 0.0 makes both zeros equal.
        *known
            .entry(p.map(|x| (x + 0.0).to_bits()))
            .or_insert_with(|| {
                points.push(p);
                points.len() as u32 - 1
            })
    };
    let tets: Vec<[u32; 4]> = mesh.tets.iter().map(|t| t.map(&mut number)).collect();
    let bare_triangles = if tets.is_empty() {
        mesh.triangles.as_slice()
    } else {
        &[]
    };
    let triangles = bare_triangles.iter().map(|t| t.map(&mut number)).collect();
    Mesh {
        points,
        triangles,
        tets,
        ..Mesh::default()
    }
}

/// Checks that tetrahedra and triangles refer to existing nodes only.
///
/// # Errors
/// [`MeshError::Input`] names the first element with a missing node.
pub fn check_nodes(mesh: &Mesh) -> Result<(), MeshError> {
    let count = mesh.points.len();
    let missing = |nodes: &[u32]| nodes.iter().copied().find(|&v| v as usize >= count);
    let tets = mesh.tets.iter().map(|t| ("tetrahedron", &t[..]));
    let triangles = mesh.triangles.iter().map(|t| ("triangle", &t[..]));
    let tets = tets.enumerate();
    for (i, (kind, nodes)) in tets.chain(triangles.enumerate()) {
        if let Some(node) = missing(nodes) {
            return Err(wrong(format!(
                "has node {node} in {kind} {i}, but {count} nodes (from 0)"
            )));
        }
    }
    Ok(())
}

/// Rejects meshes that cannot be adapted, with a place where possible.
pub(super) fn check_given(mesh: &Mesh, certificate: &Certificate) -> Result<(), MeshError> {
    if !certificate.malformed.is_empty() {
        return Err(wrong("is malformed"));
    }
    if let Some(v) = &certificate.volume {
        let is_valid = v.inverted.is_empty() && v.flat.is_empty() && v.crowded_faces.is_empty();
        return if is_valid {
            Ok(())
        } else {
            Err(wrong("has inverted or overlapping tetrahedra"))
        };
    }
    check_surface(certificate)?;
    if mesh.points.len() < 4 {
        Err(wrong("has no inside"))
    } else {
        Ok(())
    }
}

/// Checks that a bare surface is closed, oriented, manifold, and free of self-intersections.
fn check_surface(certificate: &Certificate) -> Result<(), MeshError> {
    let Some(s) = &certificate.surface else {
        return Err(wrong("has no inside"));
    };
    let findings = [
        (&s.open_edges, "is not closed: a triangle has no neighbour"),
        (
            &s.crowded_edges,
            "is no manifold: an edge has more than two triangles",
        ),
        (
            &s.pinched_nodes,
            "is no manifold: parts of the surface touch in one node",
        ),
        (&s.repeated_triangles, "has a triangle twice"),
        (
            &s.degenerate_triangles,
            "has a triangle with a corner twice",
        ),
        (
            &s.misoriented_edges,
            "is not oriented: neighbouring triangles face opposite ways",
        ),
        (&s.misplaced_shells, "has a shell that is inside out"),
    ];
    for (defects, why) in findings {
        if let Some(first) = defects.places.first() {
            return Err(wrong(format!("{why} at {}", place(first.at))));
        }
    }
    let crossings = certificate.intersections.as_ref();
    match crossings.and_then(|i| i.pairs.places.first()) {
        Some(first) => Err(wrong(format!("intersects itself at {}", place(first.at)))),
        None => Ok(()),
    }
}

/// Returns the largest distance of the surface's vertices and face centroids from the solid,
/// clamped to the maximum offset; an error if most vertices are farther away.
pub(super) fn distance(mesh: &Mesh, solid: &dyn Solid, diagonal: f64) -> Result<f64, MeshError> {
    let value = |p: Point3| distance_at(solid, p).abs();
    let (triangles, points) = (&mesh.triangles, &mesh.points);
    if triangles.is_empty() {
        return Ok(0.0);
    }
    let mut off: Vec<(f64, Point3)> = points.iter().map(|&p| (value(p), p)).collect();
    if let Some(at) = off.iter().find(|o| o.0.is_nan()) {
        return Err(MeshError::NotANumber { at: at.1 });
    }
    off.sort_by(|a, b| a.0.total_cmp(&b.0));
    let most = off[(MIN_NEAR_SHARE * (off.len() - 1) as f64) as usize];
    if most.0 > MAX_RELATIVE_OFFSET * diagonal {
        return Err(nowhere_near(most.1));
    }
    let middles = triangles
        .iter()
        .map(|t| value(centroid(t.map(|v| points[v as usize]))));
    let worst = middles.fold(off[off.len() - 1].0, f64::max);
    Ok(worst.min(MAX_RELATIVE_OFFSET * diagonal))
}

/// Converts the problems that alignment left on a surface with `n` vertices: an error if most
/// vertices are far away or most corners are missed, else warnings.
pub(super) fn settled(aligned: &Aligned, n: usize) -> Result<Vec<Warning>, MeshError> {
    if let (true, Some(&at)) = (
        (aligned.far.len() as f64) > (1.0 - MIN_NEAR_SHARE) * n as f64,
        aligned.far.first(),
    ) {
        return Err(nowhere_near(at));
    }
    let missed = &aligned.missed_corners;
    if let (true, Some(&at)) = (2 * missed.len() > aligned.corners, missed.first()) {
        let at = place(at);
        return Err(wrong(format!(
            "has nothing near most corners of the model, as at {at}"
        )));
    }
    let (far, lost) = (aligned.far.iter().copied(), aligned.lost.iter().copied());
    let mut warnings = Warning::each(WarningKind::VertexFar, far);
    warnings.extend(Warning::each(WarningKind::EdgeLost, lost));
    Ok(warnings)
}
