//! Incidence: faces of the surface on sides of tetrahedra and wedges, curves between parts, and the
//! boundary of a mesh that has only volumes.

use super::group::{face_count, face_part};
use isoform_geom::{Mesh, TET_EDGES, TET_FACES, WEDGE_QUADS, WEDGE_TRIANGLES};
use std::collections::HashMap;

/// Side of a volume: index of the volume (tetrahedra, then wedges), and index of the side. For a
/// tetrahedron the latter is the opposite corner; for a wedge, 0 and 1 are [`WEDGE_TRIANGLES`] and
/// 2 to 4 are [`WEDGE_QUADS`].
pub(super) type ElementSide = (u32, u8);

/// Sorts indices, for the comparison of faces and edges.
fn sorted<T: Ord, const N: usize>(mut nodes: [T; N]) -> [T; N] {
    nodes.sort_unstable();
    nodes
}

/// Number of sides of a wedge.
pub(super) const WEDGE_SIDES: usize = WEDGE_TRIANGLES.len() + WEDGE_QUADS.len();

/// Returns the corners of a face, oriented outward.
pub(super) fn face_nodes(tet: &[u32; 4], face: usize) -> [u32; 3] {
    TET_FACES[face].map(|c| tet[c])
}

/// Returns the mid nodes of a face, in the order of its corners.
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

/// Returns the corners and mid nodes of the face opposite to a corner, oriented outward, and their
/// number.
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

/// Returns true if two faces with equal corner sets have equal orientation.
fn same_turn<const N: usize>(a: [u32; N], b: [u32; N]) -> bool {
    (0..N).any(|k| (0..N).all(|j| a[j] == b[(k + j) % N]))
}

/// Returns the volume side on each face (triangles, then quadrilaterals). Between two volumes it is
/// the one for which the face is oriented outward.
pub(super) fn sides_of_faces(mesh: &Mesh) -> Vec<Option<ElementSide>> {
    let mut found = vec![None; face_count(mesh)];
    for_faces_on_volumes(mesh, |face, side, looks_out| {
        if found[face].is_none() || looks_out {
            found[face] = Some(side);
        }
    });
    found
}

/// Returns true for each face with a volume on either side.
pub(super) fn wall_faces(mesh: &Mesh) -> Vec<bool> {
    let mut sides = vec![0_u8; face_count(mesh)];
    for_faces_on_volumes(mesh, |face, _, _| {
        sides[face] = sides[face].saturating_add(1)
    });
    sides.into_iter().map(|n| n > 1).collect()
}

/// Returns the parts that bound each region, ascending.
pub(super) fn parts_of_regions(mesh: &Mesh) -> Vec<Vec<u32>> {
    let mut parts = vec![Vec::new(); mesh.regions.len().max(1)];
    let part = |face: usize| face_part(mesh, face).unwrap_or(0);
    if mesh.regions.len() <= 1 {
        parts[0] = (0..face_count(mesh)).map(part).collect();
    } else {
        for_faces_on_volumes(mesh, |face, (tet, _), _| {
            let region = mesh
                .tet_regions
                .get(tet as usize)
                .map_or(0, |r| *r as usize);
            parts[region].push(part(face));
        });
    }
    for list in &mut parts {
        list.sort_unstable();
        list.dedup();
    }
    parts
}

/// Calls `visit` with every pair of a surface face and a volume side with equal corner sets, and
/// with true if their orientations are equal.
fn for_faces_on_volumes(mesh: &Mesh, mut visit: impl FnMut(usize, ElementSide, bool)) {
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
    for_faces_on_wedges(mesh, &known, visit);
}

/// Does likewise for the sides of wedges; the triangles are indexed by their corners.
fn for_faces_on_wedges(
    mesh: &Mesh,
    triangles: &HashMap<[u32; 3], u32>,
    mut visit: impl FnMut(usize, ElementSide, bool),
) {
    let known = mesh.quads.iter().enumerate();
    let quads: HashMap<[u32; 4], usize> = known.map(|(i, &q)| (sorted(q), i)).collect();
    for (i, wedge) in mesh.wedges.iter().enumerate() {
        let volume = (mesh.tets.len() + i) as u32;
        for (side, corners) in (0..).zip(WEDGE_TRIANGLES) {
            let nodes = corners.map(|c| wedge[c]);
            if let Some(&triangle) = triangles.get(&sorted(nodes)) {
                let turn = same_turn(nodes, mesh.triangles[triangle as usize]);
                visit(triangle as usize, (volume, side), turn);
            }
        }
        for (side, corners) in (2..).zip(WEDGE_QUADS) {
            let nodes = corners.map(|c| wedge[c]);
            if let Some(&quad) = quads.get(&sorted(nodes)) {
                let turn = same_turn(nodes, mesh.quads[quad]);
                visit(mesh.triangles.len() + quad, (volume, side), turn);
            }
        }
    }
}

/// Adds the sides that belong to only one volume as triangles and quadrilaterals, in the order of
/// the tetrahedra and then of the wedges.
pub(super) fn add_boundary(mesh: &mut Mesh) {
    let mut sides: Vec<([u32; 3], u64)> =
        Vec::with_capacity(4 * mesh.tets.len() + 2 * mesh.wedges.len());
    for (i, tet) in mesh.tets.iter().enumerate() {
        sides.extend((0..4).map(|f| (sorted(face_nodes(tet, f)), 4 * i as u64 + f as u64)));
    }
    let first_wedge = sides.len() as u64;
    let of_wedges = mesh.wedges.iter();
    let of_wedges = of_wedges.flat_map(|w| WEDGE_TRIANGLES.map(|t| sorted(t.map(|c| w[c]))));
    sides.extend(of_wedges.zip(first_wedge..));
    for code in alone(sides) {
        if let Some(code) = code.checked_sub(first_wedge) {
            let wedge = mesh.wedges[(code / 2) as usize];
            let side = WEDGE_TRIANGLES[(code % 2) as usize];
            mesh.triangles.push(side.map(|c| wedge[c]));
            continue;
        }
        let (i, face) = ((code / 4) as usize, (code % 4) as usize);
        mesh.triangles.push(face_nodes(&mesh.tets[i], face));
        mesh.triangle_mids
            .extend(mesh.tet_mids.get(i).map(|mids| face_mids(mids, face)));
    }
    let side = |w: &[u32; 6], k: u64| WEDGE_QUADS[k as usize].map(|c| w[c]);
    let sides = mesh.wedges.iter();
    let sides = sides.flat_map(|w| [0, 1, 2].map(|k| sorted(side(w, k))));
    for code in alone(sides.zip(0..).collect()) {
        let quad = side(&mesh.wedges[(code / 3) as usize], code % 3);
        mesh.quads.push(quad);
    }
}

/// Returns the indices of the sides whose corner set is unique, ascending.
fn alone<const N: usize>(mut sides: Vec<([u32; N], u64)>) -> Vec<u64> {
    sides.sort_unstable();
    let is_alone = |i: usize| {
        (i == 0 || sides[i - 1].0 != sides[i].0)
            && (i + 1 == sides.len() || sides[i + 1].0 != sides[i].0)
    };
    let mut rim: Vec<u64> = (0..sides.len())
        .filter(|&i| is_alone(i))
        .map(|i| sides[i].1)
        .collect();
    rim.sort_unstable();
    rim
}

/// Fills in the parts on both sides of every curve, from the faces at its edges.
pub(super) fn find_curve_parts(mesh: &mut Mesh) {
    let has_parts = !mesh.triangle_parts.is_empty() || !mesh.quad_parts.is_empty();
    if !has_parts || mesh.edge_curves.is_empty() {
        return;
    }
    let curve: HashMap<[u32; 2], u32> = mesh
        .edges
        .iter()
        .zip(&mesh.edge_curves)
        .map(|(&e, &c)| (sorted(e), c))
        .collect();
    let mut found: Vec<Vec<u32>> = vec![Vec::new(); mesh.curves.len()];
    let triangles = mesh.triangles.iter().map(|t| &t[..]);
    let triangles = triangles.zip(&mesh.triangle_parts);
    let quads = mesh.quads.iter().map(|q| &q[..]).zip(&mesh.quad_parts);
    for (face, &part) in triangles.chain(quads) {
        for k in 0..face.len() {
            if let Some(&c) = curve.get(&sorted([face[k], face[(k + 1) % face.len()]]))
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

/// Sorts parts.
fn sorted_vec(mut parts: Vec<u32>) -> Vec<u32> {
    parts.sort_unstable();
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns two tetrahedra that share the triangle 0 1 2.
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
        assert_eq!(
            sides_of_faces(&mesh),
            [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)].map(Some)
        );
    }

    /// Wedge under a tetrahedron: all faces except their common triangle are boundary, and each has
    /// the volume it belongs to.
    #[test]
    fn wedges_have_a_boundary_too() {
        let at = |z: f64| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
        let mut mesh = Mesh {
            points: [&at(0.0)[..], &at(1.0), &[[0.0, 0.0, 2.0]]].concat(),
            wedges: vec![[0, 1, 2, 3, 4, 5]],
            tets: vec![[3, 4, 5, 6]],
            ..Mesh::default()
        };
        add_boundary(&mut mesh);
        assert_eq!(mesh.triangles, [[4, 5, 6], [3, 6, 5], [3, 4, 6], [0, 2, 1]]);
        assert_eq!(mesh.quads, [[0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]]);
        let sides = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 2), (1, 3), (1, 4)];
        assert_eq!(sides_of_faces(&mesh), sides.map(Some));
        // Between the two volumes the orientation decides: this triangle is outward for the wedge.
        for (triangle, side) in [([3, 4, 5], (1, 1)), ([5, 4, 3], (0, 3))] {
            mesh.triangles = vec![triangle];
            assert_eq!(sides_of_faces(&mesh)[0], Some(side));
        }
    }

    #[test]
    fn between_two_the_triangle_decides() {
        let mut mesh = Mesh {
            triangles: vec![[0, 1, 2]],
            regions: vec!["a".into(), "b".into()],
            tet_regions: vec![0, 1],
            ..pair()
        };
        assert_eq!(sides_of_faces(&mesh), [Some((1, 3))]);
        assert_eq!(parts_of_regions(&mesh), [[0], [0]]);
        mesh.triangles[0] = [2, 1, 0];
        assert_eq!(sides_of_faces(&mesh), [Some((0, 3))]);
        mesh.triangles[0] = [1, 3, 4];
        assert_eq!(sides_of_faces(&mesh), [None]);
    }
}
