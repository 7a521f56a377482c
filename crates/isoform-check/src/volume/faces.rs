//! Faces and edges of the tetrahedra around one node, of which it is the lowest node.
//!
//! Every face and every edge thus belongs to exactly one node, so that nodes are independent tasks
//! and nothing is counted twice.

use super::Volume;
use crate::Place;
use crate::stars::Stars;
use isoform_geom::{Mesh, TET_EDGES, TET_FACES, TRIANGLE_EDGES};

/// Results for one run of nodes.
#[derive(Default)]
pub(super) struct NodeRun {
    /// Counts and defects.
    pub(super) volume: Volume,
    /// Faces of one tetrahedron, counterclockwise seen from outside.
    pub(super) boundary: Vec<[u32; 3]>,
    /// Ratios of the mean edge lengths of neighbouring tetrahedra.
    pub(super) ratios: Vec<f64>,
    /// Mid nodes with the ends of their edges.
    pub(super) mids: Vec<(u32, [u32; 2])>,
}

/// Buffers reused for each node.
#[derive(Default)]
pub(super) struct NodeBuffers {
    faces: Vec<Face>,
    /// Edges at the node: (other end, mid node).
    edges: Vec<(u32, u32)>,
}

/// A face at its lowest corner, as one tetrahedron or one triangle of the surface has it.
struct Face {
    /// Other two corners in ascending order.
    others: [u32; 2],
    /// Index of the tetrahedron or triangle.
    element: u32,
    /// True if the element is a triangle of the surface.
    is_triangle: bool,
    /// True if the face runs from the lowest corner to the lower of the others, seen from outside
    /// of its tetrahedron.
    ascending: bool,
}

impl Face {
    /// Returns the sorting key: faces are grouped by corners, tetrahedra before triangles.
    fn key(&self) -> ([u32; 2], bool, u32) {
        (self.others, self.is_triangle, self.element)
    }
    /// Returns the corners, counterclockwise seen from outside.
    fn corners(&self, lowest: u32) -> [u32; 3] {
        let [a, b] = self.others;
        if self.ascending {
            [lowest, a, b]
        } else {
            [lowest, b, a]
        }
    }
}

/// Returns the face as seen from its lowest corner; `None` if that is not `node`.
fn face_at(node: u32, f: [u32; 3], element: u32, is_triangle: bool) -> Option<Face> {
    let [a, b] = match f {
        [x, a, b] | [b, x, a] | [a, b, x] if x == node => [a, b],
        _ => return None,
    };
    (node < a && node < b && a != b).then(|| Face {
        others: [a.min(b), a.max(b)],
        element,
        is_triangle,
        ascending: a < b,
    })
}

/// Elements around each node.
pub(super) struct Elements<'m> {
    pub(super) mesh: &'m Mesh,
    pub(super) tets: Stars,
    pub(super) triangles: Stars,
    /// Mean edge length of each tetrahedron.
    pub(super) lengths: Vec<f64>,
    /// Maximum number of places kept per kind of defect.
    pub(super) room: usize,
}

impl Elements<'_> {
    /// Examines the faces and edges of which a node is the lowest.
    pub(super) fn look_at(&self, node: usize, work: &mut NodeBuffers, run: &mut NodeRun) {
        work.faces.clear();
        work.edges.clear();
        self.collect_tetrahedra(node, work);
        run.volume.nodes += usize::from(!self.tets.elements_at(node).is_empty());
        work.edges.sort_unstable();
        work.edges.dedup();
        run.volume.edges += work.edges.chunk_by(|a, b| a.0 == b.0).count();
        self.collect_triangles(node, work);
        if !self.mesh.tet_mids.is_empty() {
            self.mids(node, &mut work.edges, run);
        }
        // Equal keys occur only if an element has a face twice; then a corner is repeated, and
        // `face_at` gives no face.
        work.faces.sort_unstable_by_key(Face::key);
        for group in work.faces.chunk_by(|a, b| a.others == b.others) {
            self.face(node as u32, group, run);
        }
    }

    /// Collects the faces and edges of the tetrahedra that have `node` as their lowest node.
    fn collect_tetrahedra(&self, node: usize, work: &mut NodeBuffers) {
        let u = node as u32;
        for &k in self.tets.elements_at(node) {
            let t = self.mesh.tets[k as usize];
            for f in TET_FACES {
                work.faces.extend(face_at(u, f.map(|i| t[i]), k, false));
            }
            let mids = self.mesh.tet_mids.get(k as usize);
            for (e, ends) in TET_EDGES.into_iter().enumerate() {
                let [a, b] = ends.map(|i| t[i]);
                if a.min(b) == u && a != b {
                    work.edges.push((a.max(b), mids.map_or(0, |mids| mids[e])));
                }
            }
        }
    }

    /// Collects the triangles of the surface that have `node` as their lowest node, and their edges
    /// if the mesh is of second order.
    fn collect_triangles(&self, node: usize, work: &mut NodeBuffers) {
        let u = node as u32;
        for &k in self.triangles.elements_at(node) {
            let t = self.mesh.triangles[k as usize];
            work.faces.extend(face_at(u, t, k, true));
            let mids = self.mesh.triangle_mids.get(k as usize);
            let Some(mids) = mids.filter(|_| !self.mesh.tet_mids.is_empty()) else {
                continue;
            };
            for (e, ends) in TRIANGLE_EDGES.into_iter().enumerate() {
                let [a, b] = ends.map(|i| t[i]);
                if a.min(b) == u && a != b {
                    work.edges.push((a.max(b), mids[e]));
                }
            }
        }
    }

    /// Collects the mid nodes of edges on which all elements agree; the other edges are defects.
    fn mids(&self, node: usize, edges: &mut Vec<(u32, u32)>, run: &mut NodeRun) {
        let u = node as u32;
        edges.sort_unstable();
        edges.dedup();
        for group in edges.chunk_by(|a, b| a.0 == b.0) {
            if let [(other, mid)] = group {
                run.mids.push((*mid, [u, *other]));
                continue;
            }
            let mids = group.iter().map(|e| e.1);
            let nodes = [u, group[0].0].into_iter().chain(mids).collect();
            run.volume.mid_nodes.add(self.room, || Place {
                at: self.mesh.points[node],
                nodes,
                ..Place::default()
            });
        }
    }

    /// Examines one face, given the tetrahedra and the triangles of the surface that have it.
    fn face(&self, lowest: u32, group: &[Face], run: &mut NodeRun) {
        let (tets, triangles) = group.split_at(group.partition_point(|f| !f.is_triangle));
        let place = || self.place(lowest, tets);
        let volume = &mut run.volume;
        volume.faces += usize::from(!tets.is_empty());
        match tets {
            [] => {}
            [face] => {
                run.boundary.push(face.corners(lowest));
                if triangles.is_empty() && !self.mesh.triangles.is_empty() {
                    volume.uncovered_faces.add(self.room, place);
                }
            }
            [a, b] => {
                let [x, y] = [a, b].map(|f| self.lengths[f.element as usize]);
                run.ratios.push((x / y).max(y / x));
                if a.ascending == b.ascending {
                    volume.folded_faces.add(self.room, place);
                }
            }
            _ => volume.crowded_faces.add(self.room, place),
        }
        for t in triangles {
            self.triangle(lowest, tets, t, volume);
        }
    }

    /// Examines a triangle of the surface at the face of these tetrahedra: it should cover the face
    /// of exactly one and be oriented outward.
    fn triangle(&self, lowest: u32, tets: &[Face], triangle: &Face, volume: &mut Volume) {
        let defects = match tets {
            [] => &mut volume.loose_triangles,
            [face] if face.ascending == triangle.ascending => return,
            [_] => &mut volume.inward_triangles,
            _ => &mut volume.inner_triangles,
        };
        let place = || self.place(lowest, std::slice::from_ref(triangle));
        defects.add(self.room, place);
    }

    /// Returns the middle of a face, with the elements that have it.
    fn place(&self, lowest: u32, elements: &[Face]) -> Place {
        let nodes = elements[0].corners(lowest);
        let [a, b, c] = nodes.map(|i| self.mesh.points[i as usize]);
        Place {
            at: std::array::from_fn(|i| (a[i] + b[i] + c[i]) / 3.0),
            nodes: nodes.to_vec(),
            elements: elements.iter().map(|f| f.element).collect(),
            value: elements.len() as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_at_their_lowest_corner() {
        let f = face_at(2, [7, 2, 5], 0, false).expect("the lowest corner");
        assert_eq!(
            (f.others, f.ascending, f.corners(2)),
            ([5, 7], true, [2, 5, 7])
        );
        let f = face_at(2, [5, 2, 7], 0, false).expect("the lowest corner");
        assert_eq!(
            (f.others, f.ascending, f.corners(2)),
            ([5, 7], false, [2, 7, 5])
        );
        assert!(
            face_at(5, [5, 2, 7], 0, false).is_none() && face_at(3, [3, 4, 4], 0, true).is_none()
        );
    }
}
