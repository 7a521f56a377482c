//! What lies on what: triangles on faces of tetrahedra, curves on parts, and the boundary of
//! tetrahedra alone.

use isoform_geom::{Mesh, TET_EDGES, TET_FACES};
use std::collections::HashMap;

/// A face of a tetrahedron: the number of the tetrahedron, and the corner opposite to the face.
pub(super) type Face = (u32, u8);

/// Numbers in ascending order, by which equal faces and edges are found.
fn sorted<T: Ord, const N: usize>(mut nodes: [T; N]) -> [T; N] {
    nodes.sort_unstable();
    nodes
}

/// Corners of a face, outward.
fn face_nodes(tet: &[u32; 4], face: usize) -> [u32; 3] {
    TET_FACES[face].map(|c| tet[c])
}

/// Mid nodes of a face, in the order of its corners.
fn face_mids(mids: &[u32; 6], face: usize) -> [u32; 3] {
    let corners = TET_FACES[face];
    std::array::from_fn(|k| {
        let ends = sorted([corners[k], corners[(k + 1) % 3]]);
        mids[TET_EDGES
            .iter()
            .position(|e| sorted(*e) == ends)
            .expect("all six are listed")]
    })
}

/// Corners and mid nodes of the face opposite to a corner, outward, and how many there are.
pub(super) fn face_with_mids(
    tet: &[u32; 4],
    mids: Option<&[u32; 6]>,
    face: usize,
) -> ([u32; 6], usize) {
    let [a, b, c] = face_nodes(tet, face);
    match mids.map(|m| face_mids(m, face)) {
        None => ([a, b, c, 0, 0, 0], 3),
        Some([d, e, f]) => ([a, b, c, d, e, f], 6),
    }
}

/// Whether two triangles of the same corners turn the same way.
fn same_turn(a: [u32; 3], b: [u32; 3]) -> bool {
    (0..3).any(|k| a[0] == b[k] && a[1] == b[(k + 1) % 3] && a[2] == b[(k + 2) % 3])
}

/// The tetrahedron behind each triangle; between two, the one that the triangle looks out of.
pub(super) fn faces_of_triangles(mesh: &Mesh) -> Vec<Option<Face>> {
    let mut found = vec![None; mesh.triangles.len()];
    for_triangles_on_tets(mesh, |triangle, face, looks_out| {
        if found[triangle].is_none() || looks_out {
            found[triangle] = Some(face);
        }
    });
    found
}

/// The parts that bound each region, ascending.
pub(super) fn parts_of_regions(mesh: &Mesh) -> Vec<Vec<u32>> {
    let mut parts = vec![Vec::new(); mesh.regions.len().max(1)];
    let part = |triangle: usize| mesh.triangle_parts.get(triangle).copied().unwrap_or(0);
    if mesh.regions.len() <= 1 {
        parts[0] = (0..mesh.triangles.len()).map(part).collect();
    } else {
        for_triangles_on_tets(mesh, |triangle, (tet, _), _| {
            let region = mesh
                .tet_regions
                .get(tet as usize)
                .map_or(0, |r| *r as usize);
            parts[region].push(part(triangle));
        });
    }
    for list in &mut parts {
        list.sort_unstable();
        list.dedup();
    }
    parts
}

/// Calls with every pair of a triangle and a face of the same corners, and whether both turn the
/// same way.
fn for_triangles_on_tets(mesh: &Mesh, mut visit: impl FnMut(usize, Face, bool)) {
    let mut on_surface = vec![false; mesh.points.len()];
    let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.triangles.len());
    for (i, &t) in mesh.triangles.iter().enumerate() {
        t.iter().for_each(|&c| on_surface[c as usize] = true);
        known.insert(sorted(t), i as u32);
    }
    for (i, tet) in mesh.tets.iter().enumerate() {
        let inside = tet.map(|c| !on_surface[c as usize]);
        for face in 0..4 {
            if TET_FACES[face].iter().any(|&c| inside[c]) {
                continue;
            }
            let nodes = face_nodes(tet, face);
            if let Some(&triangle) = known.get(&sorted(nodes)) {
                visit(
                    triangle as usize,
                    (i as u32, face as u8),
                    same_turn(nodes, mesh.triangles[triangle as usize]),
                );
            }
        }
    }
}

/// Adds the faces that belong to one tetrahedron as triangles, in the order of the tetrahedra.
pub(super) fn add_boundary(mesh: &mut Mesh) {
    let mut faces: Vec<([u32; 3], u64)> = Vec::with_capacity(4 * mesh.tets.len());
    for (i, tet) in mesh.tets.iter().enumerate() {
        faces.extend((0..4).map(|f| (sorted(face_nodes(tet, f)), 4 * i as u64 + f as u64)));
    }
    faces.sort_unstable();
    let alone = |i: usize| {
        (i == 0 || faces[i - 1].0 != faces[i].0)
            && (i + 1 == faces.len() || faces[i + 1].0 != faces[i].0)
    };
    let mut rim: Vec<u64> = (0..faces.len())
        .filter(|&i| alone(i))
        .map(|i| faces[i].1)
        .collect();
    rim.sort_unstable();
    for code in rim {
        let (i, face) = ((code / 4) as usize, (code % 4) as usize);
        mesh.triangles.push(face_nodes(&mesh.tets[i], face));
        mesh.triangle_mids
            .extend(mesh.tet_mids.get(i).map(|mids| face_mids(mids, face)));
    }
}

/// Fills in the parts on both sides of every curve, as the triangles beside its edges say.
pub(super) fn find_curve_parts(mesh: &mut Mesh) {
    if mesh.triangle_parts.is_empty() || mesh.edge_curves.is_empty() {
        return;
    }
    let curve: HashMap<[u32; 2], u32> = mesh
        .edges
        .iter()
        .zip(&mesh.edge_curves)
        .map(|(&e, &c)| (sorted(e), c))
        .collect();
    let mut found: Vec<Vec<u32>> = vec![Vec::new(); mesh.curves.len()];
    for (t, &part) in mesh.triangles.iter().zip(&mesh.triangle_parts) {
        for k in 0..3 {
            if let Some(&c) = curve.get(&sorted([t[k], t[(k + 1) % 3]]))
                && found[c as usize].len() < 2
                && !found[c as usize].contains(&part)
            {
                found[c as usize].push(part);
            }
        }
    }
    for (curve, parts) in mesh.curves.iter_mut().zip(found) {
        match sorted_vec(parts)[..] {
            [a, b] => curve.parts = [a, b],
            [a] => curve.parts = [a, a],
            _ => {}
        }
    }
}

/// Parts in ascending order.
fn sorted_vec(mut parts: Vec<u32>) -> Vec<u32> {
    parts.sort_unstable();
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two tetrahedra on both sides of the triangle 0 1 2.
    fn pair() -> Mesh {
        let points = vec![
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ];
        Mesh {
            points,
            tets: vec![[0, 1, 2, 3], [0, 2, 1, 4]],
            ..Mesh::default()
        }
    }

    #[test]
    fn the_boundary_looks_out() {
        let mut mesh = pair();
        mesh.tet_mids = vec![[10, 11, 12, 13, 14, 15], [12, 11, 10, 16, 17, 18]];
        add_boundary(&mut mesh);
        assert_eq!(mesh.triangles.len(), 6);
        assert_eq!(
            (mesh.triangles[0], mesh.triangle_mids[0]),
            ([1, 2, 3], [11, 15, 14])
        );
        let faces = faces_of_triangles(&mesh);
        assert_eq!(
            faces,
            [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)].map(Some)
        );
    }

    #[test]
    fn between_two_the_triangle_decides() {
        let mut mesh = Mesh {
            triangles: vec![[0, 1, 2]],
            regions: vec!["a".into(), "b".into()],
            tet_regions: vec![0, 1],
            ..pair()
        };
        assert_eq!(faces_of_triangles(&mesh), [Some((1, 3))]);
        assert_eq!(parts_of_regions(&mesh), [[0], [0]]);
        mesh.triangles[0] = [2, 1, 0];
        assert_eq!(faces_of_triangles(&mesh), [Some((0, 3))]);
        mesh.triangles[0] = [1, 3, 4];
        assert_eq!(faces_of_triangles(&mesh), [None]);
    }
}
