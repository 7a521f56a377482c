//! Wedges and quadrilaterals of boundary layers, and their subdivision into simplices.

use super::Mesh;
use std::borrow::Cow;

/// Triangular faces of a wedge, oriented outward; the first is its base.
pub const WEDGE_TRIANGLES: [[usize; 3]; 2] = [[0, 2, 1], [3, 4, 5]];
/// Quadrilateral faces of a wedge, oriented outward.
pub const WEDGE_QUADS: [[usize; 4]; 3] = [[0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]];
/// Permutations of a wedge's corners that keep it positive, one for each corner that comes first.
const TURNS: [[usize; 6]; 6] = [
    [0, 1, 2, 3, 4, 5],
    [1, 2, 0, 4, 5, 3],
    [2, 0, 1, 5, 3, 4],
    [3, 5, 4, 0, 2, 1],
    [4, 3, 5, 1, 0, 2],
    [5, 4, 3, 2, 1, 0],
];

/// Divides a wedge into three tetrahedra. Each quadrilateral face is divided by the diagonal from
/// its lowest corner, so that wedges with a common face agree (Dompierre et al. 1999, table 2).
fn tetrahedra(wedge: [u32; 6]) -> [[u32; 4]; 3] {
    let lowest = (0..6).min_by_key(|&i| wedge[i]).unwrap_or(0);
    let [a, b, c, d, e, f] = TURNS[lowest].map(|i| wedge[i]);
    if b.min(f) < c.min(e) {
        [[a, b, c, f], [a, b, f, e], [a, e, f, d]]
    } else {
        [[a, b, c, e], [a, e, c, f], [a, e, f, d]]
    }
}

/// Divides a quadrilateral into two triangles by the diagonal from its lowest corner.
fn triangles([a, b, c, d]: [u32; 4]) -> [[u32; 3]; 2] {
    if a.min(c) < b.min(d) {
        [[a, b, c], [a, c, d]]
    } else {
        [[b, c, d], [b, d, a]]
    }
}

impl Mesh {
    /// Returns true if the mesh has wedges or quadrilaterals, as meshes with boundary layers do.
    pub fn has_layers(&self) -> bool {
        !(self.wedges.is_empty() && self.quads.is_empty())
    }

    /// Returns the mesh with each wedge replaced by three tetrahedra of the first region, after the
    /// existing ones, and each quadrilateral by two triangles.
    ///
    /// ```
    /// use isoform_geom::Mesh;
    ///
    /// let mut mesh = Mesh::default();
    /// mesh.points = vec![
    ///     [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0],
    ///     [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0],
    /// ];
    /// mesh.wedges = vec![[0, 1, 2, 3, 4, 5]];
    /// mesh.quads = vec![[0, 1, 4, 3]];
    /// let simplices = mesh.simplices();
    /// assert_eq!(simplices.tets, [[0, 1, 2, 5], [0, 1, 5, 4], [0, 4, 5, 3]]);
    /// assert_eq!(simplices.triangles, [[0, 1, 4], [0, 4, 3]]);
    /// ```
    pub fn simplices(&self) -> Cow<'_, Self> {
        if !self.has_layers() {
            return Cow::Borrowed(self);
        }
        let mut mesh = self.clone();
        let wedges = std::mem::take(&mut mesh.wedges);
        mesh.tets.extend(wedges.into_iter().flat_map(tetrahedra));
        if !mesh.tet_regions.is_empty() {
            mesh.tet_regions.resize(mesh.tets.len(), 0);
        }
        let quads = std::mem::take(&mut mesh.quads);
        mesh.triangles.extend(quads.into_iter().flat_map(triangles));
        let parts = std::mem::take(&mut mesh.quad_parts);
        mesh.triangle_parts
            .extend(parts.into_iter().flat_map(|part| [part, part]));
        Cow::Owned(mesh)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{cross, dot, sub};
    use std::collections::BTreeSet;

    const POINTS: [[f64; 3]; 6] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [0.0, 1.0, 1.0],
    ];

    /// Returns all permutations of six numbers.
    fn orders() -> Vec<[u32; 6]> {
        let mut found = vec![vec![]];
        for n in 0..6u32 {
            found = found
                .into_iter()
                .flat_map(|order: Vec<u32>| {
                    (0..=order.len()).map(move |at| {
                        let mut order = order.clone();
                        order.insert(at, n);
                        order
                    })
                })
                .collect();
        }
        let whole = |order: Vec<u32>| order.try_into().expect("six numbers");
        found.into_iter().map(whole).collect()
    }

    /// Checks that for every numbering of its corners a wedge becomes three positive tetrahedra of
    /// a sixth of its box each, and its faces are divided like the quadrilaterals on them.
    #[test]
    fn wedges_are_parted_as_their_faces_are() {
        for number in orders() {
            let tets = tetrahedra(number);
            let corner = |v: u32| number.iter().position(|&n| n == v).map(|i| POINTS[i]);
            let mut faces = BTreeSet::new();
            for tet in tets {
                let [a, b, c, d] = tet.map(|v| corner(v).expect("a corner"));
                assert_eq!(
                    dot(sub(b, a), cross(sub(c, a), sub(d, a))),
                    1.0,
                    "{number:?}"
                );
                for face in super::super::TET_FACES {
                    let mut face = face.map(|i| tet[i]);
                    face.sort_unstable();
                    // A face shared by two of the tetrahedra is interior.
                    if !faces.remove(&face) {
                        faces.insert(face);
                    }
                }
            }
            let quads = WEDGE_QUADS.map(|q| triangles(q.map(|i| number[i])));
            let outer = quads
                .into_iter()
                .flatten()
                .chain(WEDGE_TRIANGLES.map(|t| t.map(|i| number[i])));
            let outer: BTreeSet<[u32; 3]> = outer
                .map(|mut face| {
                    face.sort_unstable();
                    face
                })
                .collect();
            assert_eq!(faces, outer, "{number:?}");
        }
    }
}
