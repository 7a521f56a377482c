//! Topology of the tetrahedra: exact, by indices and the signs of volumes.
//!
//! If all tetrahedra are positive, inner faces belong to two tetrahedra on different sides, and the
//! other faces form a surface that is closed, embedded and oriented outward with no component
//! inside another one, then the tetrahedra fill the inside of the surface exactly once. For the
//! number of tetrahedra over a point changes only across faces of one tetrahedron, there by the
//! sense of the face; so it is the number of times that the surface winds around the point, 1
//! inside and 0 outside. No geometric test of overlap is needed.

use super::exact::volume_sign;
use super::stars::{Stars, blocks};
use super::{Defects, Options, Place};
use crate::quality::{Shape, six_volume};
use isoform_geom::{Mesh, Point3, TET_EDGES, TET_FACES, TRIANGLE_EDGES};
use rayon::prelude::*;

/// Nodes or tetrahedra per task.
const TASK: usize = 4096;

/// Topology and measure of the tetrahedra.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Volume {
    /// Number of tetrahedra.
    pub tets: usize,
    /// Number of nodes at their corners.
    pub nodes: usize,
    /// Number of faces, inner ones counted once.
    pub faces: usize,
    /// Number of edges.
    pub edges: usize,
    /// Tetrahedra of negative volume, by exact sign.
    pub inverted: Defects,
    /// Tetrahedra whose corners lie exactly in a plane, or that have a corner twice.
    pub flat: Defects,
    /// Faces of more than two tetrahedra.
    pub crowded_faces: Defects,
    /// Faces whose two tetrahedra lie on the same side.
    pub folded_faces: Defects,
    /// Whether the mesh has triangles of its own; if not, the surface is taken from the tetrahedra.
    pub has_surface: bool,
    /// Faces of one tetrahedron that are no triangle of the surface. None are looked for without
    /// [`Self::has_surface`].
    pub uncovered_faces: Defects,
    /// Triangles of the surface that are the face of one tetrahedron, but turned inward.
    pub inward_triangles: Defects,
    /// Triangles of the surface between two tetrahedra.
    pub inner_triangles: Defects,
    /// Triangles of the surface that are no face of a tetrahedron.
    pub loose_triangles: Defects,
    /// Edges whose elements do not agree on their mid node, and edges that share one; of a mesh of
    /// second order.
    pub mid_nodes: Defects,
    /// Volume: the sum over the tetrahedra.
    pub volume: f64,
    /// The ratio (above 1) of the mean edge lengths of two tetrahedra that share a face which 999
    /// of 1000 do not exceed; 1 without inner faces. Linear interpolation between the two nearest,
    /// as numpy's `quantile`.
    pub size_ratio: f64,
}

impl Volume {
    /// Whether all tetrahedra are positive, all faces conform, and the triangles of the mesh are
    /// exactly the boundary.
    pub fn is_conforming(&self) -> bool {
        [
            &self.inverted,
            &self.flat,
            &self.crowded_faces,
            &self.folded_faces,
            &self.uncovered_faces,
            &self.inward_triangles,
            &self.inner_triangles,
            &self.loose_triangles,
            &self.mid_nodes,
        ]
        .iter()
        .all(|d| d.is_empty())
    }
}

/// What one run of nodes has.
#[derive(Default)]
struct Run {
    volume: Volume,
    boundary: Vec<[u32; 3]>,
    ratios: Vec<f64>,
    mids: Vec<(u32, [u32; 2])>,
}

/// A face at its lowest corner: the other two corners in ascending order, then what has it.
struct Face {
    others: [u32; 2],
    /// Tetrahedron or triangle.
    element: u32,
    is_triangle: bool,
    /// Whether it runs from the lowest corner to the lower of the others, seen from outside of its
    /// tetrahedron.
    ascending: bool,
}

impl Face {
    fn key(&self) -> ([u32; 2], bool, u32) {
        (self.others, self.is_triangle, self.element)
    }
    /// As seen from outside.
    fn corners(&self, lowest: u32) -> [u32; 3] {
        let [a, b] = self.others;
        if self.ascending {
            [lowest, a, b]
        } else {
            [lowest, b, a]
        }
    }
}

/// The face as its lowest corner has it, if that is `node`.
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

/// Topology and measure of the tetrahedra, and their boundary in the order of its lowest corners.
pub(super) fn examine(mesh: &Mesh, options: &Options<'_>) -> (Volume, Vec<[u32; 3]>) {
    let (points, room) = (&mesh.points, options.places);
    let has_surface = !mesh.triangles.is_empty();
    let sizes = measure(mesh, options);
    let (mut volume, lengths) = sizes;
    (volume.tets, volume.has_surface) = (mesh.tets.len(), has_surface);
    let around = Stars::new(points.len(), &mesh.tets);
    let triangles_around = Stars::new(points.len(), &mesh.triangles);
    let runs: Vec<Run> = blocks(points.len(), TASK)
        .into_par_iter()
        .map(|range| {
            let mut run = Run::default();
            let mut work = (Vec::new(), Vec::new());
            for node in range {
                at_node(
                    mesh,
                    &around,
                    &triangles_around,
                    &lengths,
                    node,
                    room,
                    &mut work,
                    &mut run,
                );
            }
            run
        })
        .collect();
    let (mut boundary, mut ratios, mut users) = (Vec::new(), Vec::new(), vec![0u8; points.len()]);
    let mut doubled = false;
    for run in &runs {
        for &(mid, _) in &run.mids {
            let n = &mut users[mid as usize];
            doubled |= *n > 0;
            *n = 1;
        }
    }
    // Mid nodes must not be corners either.
    for &i in mesh
        .tets
        .iter()
        .flatten()
        .filter(|_| !mesh.tet_mids.is_empty())
    {
        doubled |= users[i as usize] == 1;
    }
    if doubled {
        shared_mids(points, &runs, mesh, room, &mut volume.mid_nodes);
    }
    for run in runs {
        volume.append(room, run.volume);
        boundary.extend(run.boundary);
        ratios.extend(run.ratios);
    }
    volume.size_ratio = quantile(&mut ratios, 0.999).unwrap_or(1.0);
    (volume, boundary)
}

impl Volume {
    /// Joins what a later run of nodes has.
    fn append(&mut self, room: usize, run: Self) {
        self.nodes += run.nodes;
        self.faces += run.faces;
        self.edges += run.edges;
        self.crowded_faces.append(room, run.crowded_faces);
        self.folded_faces.append(room, run.folded_faces);
        self.uncovered_faces.append(room, run.uncovered_faces);
        self.inward_triangles.append(room, run.inward_triangles);
        self.inner_triangles.append(room, run.inner_triangles);
        self.loose_triangles.append(room, run.loose_triangles);
        self.mid_nodes.append(room, run.mid_nodes);
    }
}

/// Signs and sum of the volumes, and the mean edge length of each tetrahedron.
fn measure(mesh: &Mesh, options: &Options<'_>) -> (Volume, Vec<f64>) {
    let room = options.places;
    let mut lengths = vec![0.0; mesh.tets.len()];
    let parts: Vec<Volume> = lengths
        .par_chunks_mut(TASK)
        .zip(mesh.tets.par_chunks(TASK))
        .enumerate()
        .map(|(chunk, (lengths, tets))| {
            let mut part = Volume::default();
            for (k, (length, t)) in lengths.iter_mut().zip(tets).enumerate() {
                let p = t.map(|i| mesh.points[i as usize]);
                *length = Shape::of(p).mean_edge();
                part.volume += six_volume(p);
                let sign = volume_sign(p[0], p[1], p[2], p[3]);
                if sign <= 0 {
                    let defects = if sign < 0 {
                        &mut part.inverted
                    } else {
                        &mut part.flat
                    };
                    let at =
                        std::array::from_fn(|i| 0.25 * (p[0][i] + p[1][i] + p[2][i] + p[3][i]));
                    let element = (chunk * TASK + k) as u32;
                    defects.add(room, || Place {
                        at,
                        nodes: t.to_vec(),
                        elements: vec![element],
                        value: six_volume(p) / 6.0,
                    });
                }
            }
            part
        })
        .collect();
    let (mut all, mut six_volumes) = (Volume::default(), 0.0);
    for part in parts {
        six_volumes += part.volume;
        all.inverted.append(room, part.inverted);
        all.flat.append(room, part.flat);
    }
    // Divided at last, so that whole numbers stay whole.
    all.volume = six_volumes / 6.0;
    (all, lengths)
}

/// Faces and edges that belong to a node, being its lowest.
#[expect(
    clippy::too_many_arguments,
    reason = "one loop body, called from one place"
)]
fn at_node(
    mesh: &Mesh,
    tets: &Stars,
    triangles: &Stars,
    lengths: &[f64],
    node: usize,
    room: usize,
    (faces, edges): &mut (Vec<Face>, Vec<(u32, u32)>),
    run: &mut Run,
) {
    let u = node as u32;
    faces.clear();
    edges.clear();
    let second = !mesh.tet_mids.is_empty();
    for &k in tets.of(node) {
        let t = mesh.tets[k as usize];
        for f in TET_FACES {
            faces.extend(face_at(u, f.map(|i| t[i]), k, false));
        }
        for (e, [a, b]) in TET_EDGES.into_iter().enumerate() {
            let (a, b) = (t[a], t[b]);
            if a.min(b) == u && a != b {
                edges.push((
                    a.max(b),
                    if second {
                        mesh.tet_mids[k as usize][e]
                    } else {
                        0
                    },
                ));
            }
        }
    }
    run.volume.nodes += usize::from(!tets.of(node).is_empty());
    edges.sort_unstable();
    edges.dedup();
    run.volume.edges += edges.chunk_by(|a, b| a.0 == b.0).count();
    for &k in triangles.of(node) {
        let t = mesh.triangles[k as usize];
        faces.extend(face_at(u, t, k, true));
        for (e, [a, b]) in TRIANGLE_EDGES.into_iter().enumerate() {
            let (a, b) = (t[a], t[b]);
            if second && !mesh.triangle_mids.is_empty() && a.min(b) == u && a != b {
                edges.push((a.max(b), mesh.triangle_mids[k as usize][e]));
            }
        }
    }
    if second {
        edges.sort_unstable();
        edges.dedup();
        for group in edges.chunk_by(|a, b| a.0 == b.0) {
            if let [(other, mid)] = group {
                run.mids.push((*mid, [u, *other]));
            } else {
                let nodes = [u, group[0].0]
                    .into_iter()
                    .chain(group.iter().map(|e| e.1))
                    .collect();
                run.volume.mid_nodes.add(room, || Place {
                    at: mesh.points[node],
                    nodes,
                    ..Place::default()
                });
            }
        }
    }
    // Equal keys only occur if an element has a face twice; then it has a corner twice, and its
    // face is none.
    faces.sort_unstable_by_key(Face::key);
    for group in faces.chunk_by(|a, b| a.others == b.others) {
        at_face(mesh, lengths, u, group, room, run);
    }
}

/// One face: the tetrahedra that have it, then the triangles.
fn at_face(mesh: &Mesh, lengths: &[f64], lowest: u32, group: &[Face], room: usize, run: &mut Run) {
    let (tets, triangles) = group.split_at(group.partition_point(|f| !f.is_triangle));
    let place = |elements: &[Face]| {
        let nodes = elements[0].corners(lowest);
        let [a, b, c] = nodes.map(|i| mesh.points[i as usize]);
        Place {
            at: std::array::from_fn(|i| (a[i] + b[i] + c[i]) / 3.0),
            nodes: nodes.to_vec(),
            elements: elements.iter().map(|f| f.element).collect(),
            value: elements.len() as f64,
        }
    };
    let volume = &mut run.volume;
    volume.faces += usize::from(!tets.is_empty());
    match tets {
        [] => triangles.iter().for_each(|t| {
            volume
                .loose_triangles
                .add(room, || place(std::slice::from_ref(t)))
        }),
        [face] => {
            run.boundary.push(face.corners(lowest));
            if triangles.is_empty() && !mesh.triangles.is_empty() {
                volume.uncovered_faces.add(room, || place(tets));
            }
            for t in triangles.iter().filter(|t| t.ascending != face.ascending) {
                volume
                    .inward_triangles
                    .add(room, || place(std::slice::from_ref(t)));
            }
        }
        [a, b] => {
            let (x, y) = (lengths[a.element as usize], lengths[b.element as usize]);
            run.ratios.push((x / y).max(y / x));
            if a.ascending == b.ascending {
                volume.folded_faces.add(room, || place(tets));
            }
        }
        _ => volume.crowded_faces.add(room, || place(tets)),
    }
    if tets.len() > 1 {
        triangles.iter().for_each(|t| {
            volume
                .inner_triangles
                .add(room, || place(std::slice::from_ref(t)))
        });
    }
}

/// Edges that share a mid node, and those whose mid node is a corner; only called if there are
/// some.
fn shared_mids(points: &[Point3], runs: &[Run], mesh: &Mesh, room: usize, defects: &mut Defects) {
    let mut mids: Vec<(u32, [u32; 2])> = runs
        .iter()
        .flat_map(|run| run.mids.iter().copied())
        .collect();
    mids.sort_unstable();
    let mut corner = vec![false; points.len()];
    mesh.tets
        .iter()
        .flatten()
        .for_each(|&i| corner[i as usize] = true);
    for group in mids.chunk_by(|a, b| a.0 == b.0) {
        let mid = group[0].0;
        if group.len() > 1 || corner[mid as usize] {
            let nodes = std::iter::once(mid)
                .chain(group.iter().flat_map(|m| m.1))
                .take(16)
                .collect();
            defects.add(room, || Place {
                at: points[mid as usize],
                nodes,
                elements: Vec::new(),
                value: group.len() as f64,
            });
        }
    }
}

/// The value below which a share `q` of the values lies, with linear interpolation.
fn quantile(values: &mut [f64], q: f64) -> Option<f64> {
    let at = (values.len().checked_sub(1)?) as f64 * q;
    let (_, low, above) = values.select_nth_unstable_by(at as usize, f64::total_cmp);
    let next = above.iter().copied().min_by(f64::total_cmp).unwrap_or(*low);
    Some(*low + (next - *low) * at.fract())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles() {
        assert_eq!(quantile(&mut [], 0.5), None);
        assert_eq!(quantile(&mut [3.0], 0.999), Some(3.0));
        assert_eq!(quantile(&mut [4.0, 1.0, 2.0, 3.0], 0.5), Some(2.5));
        assert_eq!(quantile(&mut [4.0, 1.0, 2.0, 3.0], 1.0), Some(4.0));
    }

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
