//! Consistency check of a mesh: lists of matching lengths, valid indices, finite coordinates.
//! Writers run it first and rely on it.

use crate::{BAD_MESH, WriteError};
use isoform_geom::{Mesh, Point3};

/// Refuses lists of unequal lengths, invalid indices and non-finite coordinates.
pub(super) fn check(mesh: &Mesh, file: &str) -> Result<(), WriteError> {
    match complaint(mesh) {
        None => Ok(()),
        Some(why) => Err(WriteError {
            code: BAD_MESH,
            what: "cannot write the mesh",
            file: file.into(),
            why,
            hint: "isoform inspect, or another file of the mesh: this one does not hold together",
        }),
    }
}

/// Returns the first defect of a mesh.
fn complaint(mesh: &Mesh) -> Option<String> {
    let n = mesh.points.len();
    if n > u32::MAX as usize - 1 {
        return Some(format!("{n} nodes are more than 32-bit indices can number"));
    }
    let is_finite = |p: &Point3| p.iter().all(|v| v.is_finite());
    if let Some(i) = mesh.points.iter().position(|p| !is_finite(p)) {
        return Some(format!("node {i} is at {:?}", mesh.points[i]));
    }
    wrong_length(mesh)
        .or_else(|| wrong_node(mesh))
        .or_else(|| wrong_label(mesh))
        .or_else(|| wrong_beside_wedges(mesh))
}

/// Describes a list that is neither empty nor as long as the list of its elements.
fn wrong_length(m: &Mesh) -> Option<String> {
    let (triangles, tets, edges) = (m.triangles.len(), m.tets.len(), m.edges.len());
    let lengths = [
        ("mid nodes of triangles", m.triangle_mids.len(), triangles),
        ("parts of triangles", m.triangle_parts.len(), triangles),
        ("mid nodes of tetrahedra", m.tet_mids.len(), tets),
        ("regions of tetrahedra", m.tet_regions.len(), tets),
        ("parts of quadrilaterals", m.quad_parts.len(), m.quads.len()),
        ("mid nodes of edges", m.edge_mids.len(), edges),
        ("curves of edges", m.edge_curves.len(), edges),
    ];
    let is_wrong = |(_, got, want): &&(&str, usize, usize)| *got != 0 && got != want;
    if let Some((what, got, want)) = lengths.iter().find(is_wrong) {
        return Some(format!("there are {got} {what} where {want} are needed"));
    }
    let n = m.points.len();
    let column = m.columns.iter().find(|c| c.values.len() != n)?;
    let (got, name) = (column.values.len(), &column.name);
    Some(format!(
        "there are {got} values of {name} where {n} are needed"
    ))
}

/// Describes an index of a missing node.
fn wrong_node(m: &Mesh) -> Option<String> {
    let n = m.points.len();
    let nodes = [
        ("triangle", highest(&m.triangles)),
        ("mid node of a triangle", highest(&m.triangle_mids)),
        ("tetrahedron", highest(&m.tets)),
        ("mid node of a tetrahedron", highest(&m.tet_mids)),
        ("wedge", highest(&m.wedges)),
        ("quadrilateral", highest(&m.quads)),
        ("edge", highest(&m.edges)),
        ("mid node of an edge", m.edge_mids.iter().max().copied()),
        ("corner", m.corners.iter().max().copied()),
    ];
    nodes.iter().find_map(|(what, highest)| {
        let i = highest.filter(|i| *i as usize >= n)?;
        Some(format!("a {what} uses node {i} of {n}"))
    })
}

/// Describes a label of a missing group.
fn wrong_label(m: &Mesh) -> Option<String> {
    let labels = [
        ("part", &m.triangle_parts, m.parts.len()),
        ("part", &m.quad_parts, m.parts.len()),
        ("region", &m.tet_regions, m.regions.len()),
        ("curve", &m.edge_curves, m.curves.len()),
    ];
    labels.iter().find_map(|(what, labels, n)| {
        let high = labels.iter().max().filter(|i| **i as usize >= *n)?;
        Some(format!("an element lies on {what} {high} of {n}"))
    })
}

/// Describes what a mesh with wedges or quadrilaterals must not have: mid nodes, several regions,
/// or parts on only the triangles or only the quadrilaterals.
fn wrong_beside_wedges(m: &Mesh) -> Option<String> {
    let labelled = [&m.triangle_parts, &m.quad_parts].map(|parts| !parts.is_empty());
    if !m.triangles.is_empty() && !m.quads.is_empty() && labelled[0] != labelled[1] {
        return Some("only triangles or only quadrilaterals lie on parts".into());
    }
    if m.has_layers() && (m.order() == 2 || !m.edge_mids.is_empty()) {
        return Some("there are mid nodes beside wedges or quadrilaterals".into());
    }
    let divided = !m.wedges.is_empty() && m.regions.len() > 1;
    divided.then(|| "there are several regions, of which wedges have none".into())
}

/// Returns the largest node index of elements; `None` without elements.
fn highest<const N: usize>(cells: &[[u32; N]]) -> Option<u32> {
    cells.iter().flatten().max().copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn says_what_is_wrong() {
        let mesh = Mesh::from_triangles(vec![[0.0; 3]; 3], vec![[0, 1, 2]]);
        assert_eq!(complaint(&mesh), None);
        let wrong = |change: fn(&mut Mesh)| {
            let mut mesh = mesh.clone();
            change(&mut mesh);
            let e = check(&mesh, "t.msh").expect_err("wrong");
            assert_eq!(e.code, "bad-mesh");
            e.why
        };
        assert_eq!(
            wrong(|m| m.triangles[0][1] = 3),
            "a triangle uses node 3 of 3"
        );
        assert_eq!(
            wrong(|m| m.triangle_parts = vec![0]),
            "an element lies on part 0 of 0"
        );
        let column = |m: &mut Mesh| {
            m.columns = vec![isoform_geom::Column {
                name: "u".into(),
                values: vec![0.5],
            }]
        };
        assert_eq!(wrong(column), "there are 1 values of u where 3 are needed");
        assert_eq!(wrong(|m| m.corners = vec![9]), "a corner uses node 9 of 3");
        assert_eq!(
            wrong(|m| m.triangle_mids = vec![[0; 3]; 2]),
            "there are 2 mid nodes of triangles where 1 are needed"
        );
        assert!(wrong(|m| m.points[1][2] = f64::NAN).starts_with("node 1 is at"));
        assert_eq!(
            wrong(|m| m.wedges = vec![[0, 1, 2, 0, 1, 3]]),
            "a wedge uses node 3 of 3"
        );
        let half_labelled = |m: &mut Mesh| {
            (m.quads, m.quad_parts) = (vec![[0, 1, 2, 0]], vec![0]);
            m.parts = vec!["side".into()];
        };
        assert_eq!(
            wrong(half_labelled),
            "only triangles or only quadrilaterals lie on parts"
        );
        let curved = |m: &mut Mesh| {
            m.wedges = vec![[0; 6]];
            m.triangle_mids = vec![[0; 3]];
        };
        assert_eq!(
            wrong(curved),
            "there are mid nodes beside wedges or quadrilaterals"
        );
        let divided = |m: &mut Mesh| {
            (m.wedges, m.tets) = (vec![[0; 6]], vec![[0; 4]]);
            (m.tet_regions, m.regions) = (vec![0], vec!["inside".into(), "rest".into()]);
        };
        assert_eq!(
            wrong(divided),
            "there are several regions, of which wedges have none"
        );
    }
}
