//! The JSON document of a mesh.

use super::work::Made;
use isoform::check::{Certificate, Coverage, Defects, Deviation, Distances, Failure, Lengths};
use isoform::geom::Mesh;
use serde_json::{Map, Value, json};

/// Everything that is known of the mesh. All but `seconds` is the same each time.
pub(crate) fn document(made: &Made) -> Value {
    let (mesh, options) = (&made.meshed.mesh, &made.options);
    let files: Vec<Value> = made
        .written
        .iter()
        .map(|w| json!({"path": w.path, "format": w.format, "warnings": w.warnings}))
        .collect();
    let warnings: Vec<Value> = made
        .warnings
        .iter()
        .map(|w| json!({"message": w.message, "at": w.at}))
        .collect();
    let mut json = json!({
        "ok": made.certificate.is_ok(),
        "verb": "mesh",
        "model": {"file": made.name, "object": made.object, "parameters": made.values, "unit": made.unit},
        "size": options.size,
        "grade": options.grade,
        "order": mesh.order(),
        "region": [made.meshed.region.lo, made.meshed.region.hi],
        "region_certified": made.meshed.region_certified,
        "features_certified": made.meshed.features.certified,
        "caps": made.meshed.caps,
    });
    add(&mut json, contents(mesh));
    json["certificate"] = certificate(&made.certificate);
    json["files"] = json!(files);
    json["warnings"] = json!(warnings);
    json["notes"] = json!(made.notes);
    json["seconds"] = made
        .seconds
        .iter()
        .map(|(k, v)| (k.clone(), json!(v)))
        .collect::<Map<_, _>>()
        .into();
    json
}

/// Groups and counts of a mesh.
pub(crate) fn contents(mesh: &Mesh) -> Value {
    json!({
        "parts": groups(&mesh.parts, &mesh.triangle_parts, "triangles"),
        "regions": groups(&mesh.regions, &mesh.tet_regions, "tets"),
        "curves": curves(mesh),
        "corners": mesh.corners.iter().map(|&v| mesh.points[v as usize]).collect::<Vec<_>>(),
        "counts": {
            "points": mesh.points.len(), "triangles": mesh.triangles.len(), "tets": mesh.tets.len(), "edges": mesh.edges.len(),
            "parts": mesh.parts.len(), "curves": mesh.curves.len(), "corners": mesh.corners.len(),
        },
    })
}

/// Puts the fields of one document behind those of another.
pub(crate) fn add(json: &mut Value, more: Value) {
    if let (Value::Object(json), Value::Object(more)) = (json, more) {
        json.extend(more);
    }
}

/// Groups with the tags that they have in files: from 1 in the order of the mesh.
fn groups(names: &[String], labels: &[u32], elements: &str) -> Vec<Value> {
    let mut counts = vec![0_usize; names.len()];
    labels.iter().for_each(|&l| counts[l as usize] += 1);
    names
        .iter()
        .zip(counts)
        .enumerate()
        .map(|(i, (name, n))| json!({"tag": i + 1, "name": name, elements: n}))
        .collect()
}

fn curves(mesh: &Mesh) -> Vec<Value> {
    let names: Vec<String> = mesh.curves.iter().map(|c| c.name.clone()).collect();
    let mut curves = groups(&names, &mesh.edge_curves, "edges");
    for (json, curve) in curves.iter_mut().zip(&mesh.curves) {
        json["parts"] = json!(curve.parts.map(|p| p + 1));
    }
    curves
}

/// The figures, null where something does not apply or was not reached.
pub(crate) fn certificate(c: &Certificate) -> Value {
    let none = |defects: &[&Defects]| defects.iter().all(|d| d.is_empty());
    let (s, q) = (c.surface.as_ref(), c.tets.as_ref());
    json!({
        "ok": c.is_ok(),
        "complete": c.complete,
        "failures": c.failures().iter().map(failure).collect::<Vec<_>>(),
        "closed": s.map(|s| none(&[&s.open_edges])),
        "manifold": s.map(|s| none(&[&s.crowded_edges, &s.pinched_nodes, &s.repeated_triangles, &s.degenerate_triangles])),
        "oriented": s.map(|s| none(&[&s.misoriented_edges, &s.misplaced_shells])),
        "euler": s.map(|s| s.euler),
        "shells": s.map(|s| s.shells),
        "components": s.map(|s| s.components),
        "volume": s.map(|s| s.volume),
        "area": s.map(|s| s.area),
        "self_intersections": c.intersections.as_ref().map(|i| i.pairs.count),
        "inverted": c.volume.as_ref().map(|v| v.inverted.count + v.flat.count),
        "triangle_angles": c.triangles.as_ref().map(|t| [t.angle_min, t.angle_max]),
        "edge_lengths": q.map(|q| lengths(&q.edges)).or_else(|| c.triangles.as_ref().map(|t| lengths(&t.edges))),
        "dihedral_angles": q.map(|q| [q.dihedral_min, q.dihedral_max]),
        "dihedral_histogram": q.map(|q| q.histogram),
        "radius_ratio": q.map(|q| json!({"min": q.radius_ratio_min, "mean": q.radius_ratio_mean})),
        "size_ratio": c.volume.as_ref().map(|v| v.size_ratio),
        "distance": c.deviation.as_ref().map(deviation),
        "features": c.coverage.as_ref().map(coverage),
        "scaled_jacobian": c.curved.as_ref().map(|q| q.scaled_jacobian_min),
    })
}

/// Distances of the mesh from the function: of nodes, of mid nodes, of nodes on curves, and of
/// points within faces.
fn deviation(d: &Deviation) -> Value {
    let distances = |d: &Distances| json!({"count": d.count, "max": d.max, "rms": d.rms, "at": d.worst.as_ref().map(|p| p.at)});
    json!({
        "nodes": distances(&d.nodes), "mid_nodes": distances(&d.mids), "curves": distances(&d.curves), "faces": distances(&d.faces),
        "misclassified": d.misclassified.count,
    })
}

/// How much of the solid's curves and corners the mesh has.
fn coverage(c: &Coverage) -> Value {
    json!({
        "length": c.length, "covered": c.covered, "uncovered": c.uncovered.count,
        "corners": c.corners, "corners_missed": c.missed_corners.count, "corner_distance": c.corner_max,
    })
}

fn lengths(l: &Lengths) -> Value {
    json!({"min": l.min, "mean": l.mean, "max": l.max})
}

fn failure(f: &Failure) -> Value {
    let place = f.place.as_ref();
    json!({"code": f.code, "message": f.message, "count": f.count, "at": place.map(|p| p.at), "elements": place.map(|p| &p.elements)})
}
