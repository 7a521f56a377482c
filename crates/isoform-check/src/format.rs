//! Format of a mesh: index ranges, array lengths and finite coordinates.

use isoform_geom::Mesh;

/// Format error in one of the arrays of a mesh, which prevents all other checks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Malformed {
    /// Coordinates that are not finite.
    #[error(
        "{count} of the nodes have coordinates that are no finite numbers, the first is node {first}"
    )]
    Coordinates {
        /// Number of these nodes.
        count: usize,
        /// Index of the first of them.
        first: usize,
    },
    /// Indices out of range.
    #[error("{count} of `{array}` have an index out of range, the first is number {first}")]
    Index {
        /// Name of the array.
        array: &'static str,
        /// Number of items with such an index.
        count: usize,
        /// Index of the first of them.
        first: usize,
    },
    /// An array that is neither empty nor as long as the array of its elements.
    #[error("`{array}` has {found} items for {wanted} elements")]
    Length {
        /// Name of the array.
        array: &'static str,
        /// Length of the array.
        found: usize,
        /// Number of elements that it describes.
        wanted: usize,
    },
    /// More items than 32-bit indices can count.
    #[error("`{array}` has {found} items, too many to count in 32 bits")]
    Size {
        /// Name of the array.
        array: &'static str,
        /// Length of the array.
        found: usize,
    },
}

/// Returns all format errors of a mesh.
pub(super) fn examine(mesh: &Mesh) -> Vec<Malformed> {
    let mut found = coordinates(mesh);
    let (nodes, parts) = (mesh.points.len(), mesh.parts.len());
    for (array, flat, width, limit) in [
        ("triangles", mesh.triangles.as_flattened(), 3, nodes),
        ("triangle_mids", mesh.triangle_mids.as_flattened(), 3, nodes),
        ("triangle_parts", &mesh.triangle_parts, 1, parts),
        ("tets", mesh.tets.as_flattened(), 4, nodes),
        ("tet_mids", mesh.tet_mids.as_flattened(), 6, nodes),
        ("tet_regions", &mesh.tet_regions, 1, mesh.regions.len()),
        ("wedges", mesh.wedges.as_flattened(), 6, nodes),
        ("quads", mesh.quads.as_flattened(), 4, nodes),
        ("quad_parts", &mesh.quad_parts, 1, parts),
        ("edges", mesh.edges.as_flattened(), 2, nodes),
        ("edge_mids", &mesh.edge_mids, 1, nodes),
        ("edge_curves", &mesh.edge_curves, 1, mesh.curves.len()),
        ("corners", &mesh.corners, 1, nodes),
    ] {
        indices(&mut found, array, flat, width, limit);
    }
    curves(mesh, &mut found);
    lengths(mesh, &mut found);
    found
}

/// Reports feature curves that name a part beyond the mesh's, one error per curve.
fn curves(mesh: &Mesh, found: &mut Vec<Malformed>) {
    let parts = mesh.parts.len();
    for (k, curve) in mesh.curves.iter().enumerate() {
        if curve.parts.iter().any(|&i| i as usize >= parts) {
            found.push(Malformed::Index {
                array: "curves",
                count: 1,
                first: k,
            });
        }
    }
}

/// Reports coordinates that are not finite, and more nodes than fit 32 bits.
fn coordinates(mesh: &Mesh) -> Vec<Malformed> {
    let mut found = Vec::new();
    let bad = |p: &&[f64; 3]| p.iter().any(|v| !v.is_finite());
    let count = mesh.points.iter().filter(bad).count();
    if count > 0 {
        found.push(Malformed::Coordinates {
            count,
            first: mesh.points.iter().position(|p| bad(&p)).unwrap_or(0),
        });
    }
    if u32::try_from(mesh.points.len()).is_err() {
        found.push(Malformed::Size {
            array: "points",
            found: mesh.points.len(),
        });
    }
    found
}

/// Reports arrays that are neither empty nor as long as the array of their elements.
fn lengths(mesh: &Mesh, found: &mut Vec<Malformed>) {
    let (triangles, tets, edges) = (mesh.triangles.len(), mesh.tets.len(), mesh.edges.len());
    for (array, length, wanted) in [
        ("triangle_mids", mesh.triangle_mids.len(), triangles),
        ("triangle_parts", mesh.triangle_parts.len(), triangles),
        ("tet_mids", mesh.tet_mids.len(), tets),
        ("tet_regions", mesh.tet_regions.len(), tets),
        ("quad_parts", mesh.quad_parts.len(), mesh.quads.len()),
        ("edge_mids", mesh.edge_mids.len(), edges),
        ("edge_curves", mesh.edge_curves.len(), edges),
    ] {
        if length != 0 && length != wanted {
            found.push(Malformed::Length {
                array,
                found: length,
                wanted,
            });
        }
    }
}

/// Reports indices not below `limit`, in items of `width`, and arrays with more than 2³² indices.
fn indices(
    found: &mut Vec<Malformed>,
    array: &'static str,
    flat: &[u32],
    width: usize,
    limit: usize,
) {
    if u32::try_from(flat.len()).is_err() {
        found.push(Malformed::Size {
            array,
            found: flat.len() / width,
        });
    }
    let bad = |item: &[u32]| item.iter().any(|&i| i as usize >= limit);
    let count = flat.chunks(width).filter(|item| bad(item)).count();
    if count > 0 {
        let first = flat.chunks(width).position(bad).unwrap_or(0);
        found.push(Malformed::Index {
            array,
            count,
            first,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_named() {
        let points = vec![[0.0; 3], [f64::NAN, 0.0, 0.0], [f64::INFINITY; 3]];
        let mut mesh = Mesh::from_triangles(points, vec![[0, 1, 2], [0, 1, 3], [0, 1, u32::MAX]]);
        mesh.triangle_parts = vec![0, 0];
        mesh.corners = vec![3];
        let said: Vec<String> = examine(&mesh).iter().map(ToString::to_string).collect();
        assert_eq!(
            said,
            [
                "2 of the nodes have coordinates that are no finite numbers, the first is node 1",
                "2 of `triangles` have an index out of range, the first is number 1",
                "2 of `triangle_parts` have an index out of range, the first is number 0",
                "1 of `corners` have an index out of range, the first is number 0",
                "`triangle_parts` has 2 items for 3 elements",
            ]
        );
        assert!(examine(&Mesh::default()).is_empty());
    }
}
