//! Topology of the tetrahedra, determined exactly from indices and the signs of volumes.
//!
//! Suppose that all tetrahedra are positive, inner faces belong to two tetrahedra on different
//! sides, and the other faces form a surface that is closed, embedded and oriented outward, with no
//! component inside another one. Then the tetrahedra fill the interior of the surface exactly once:
//! the number of tetrahedra over a point changes only across faces of one tetrahedron, there by the
//! orientation of the face. It equals the winding number of the surface around the point, 1 inside
//! and 0 outside, so that no geometric test of overlap is needed.
//!
//! Everything is derived from the elements around each node (`faces`): a face or an edge belongs to
//! its lowest node.

mod faces;
mod mids;

use super::exact::volume_sign;
use super::stars::{Stars, blocks};
use super::{Defects, Options, Place};
use crate::quality::{Shape, six_volume};
use faces::{Elements, NodeBuffers, NodeRun};
use isoform_geom::Mesh;
use rayon::prelude::*;

/// Number of nodes or tetrahedra in a task.
const ITEMS_PER_TASK: usize = 4096;
/// Quantile that [`Volume::size_ratio`] reports; the largest ratio would tell of a single pair
/// only.
const SIZE_RATIO_QUANTILE: f64 = 0.999;

/// Topology and volume of the tetrahedra.
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
    /// Tetrahedra whose corners are exactly coplanar, or that have a repeated corner.
    pub flat: Defects,
    /// Faces of more than two tetrahedra.
    pub crowded_faces: Defects,
    /// Faces whose two tetrahedra lie on one side.
    pub folded_faces: Defects,
    /// True if the mesh has triangles of its own; if not, the surface is taken from the tetrahedra.
    pub has_surface: bool,
    /// Faces of one tetrahedron that are not a triangle of the surface; tested only with
    /// [`Self::has_surface`].
    pub uncovered_faces: Defects,
    /// Triangles of the surface that are the face of one tetrahedron, but oriented inward.
    pub inward_triangles: Defects,
    /// Triangles of the surface between two tetrahedra.
    pub inner_triangles: Defects,
    /// Triangles of the surface that are not a face of a tetrahedron.
    pub loose_triangles: Defects,
    /// Edges whose elements disagree on their mid node, and edges that share one; empty unless the
    /// mesh is of second order.
    pub mid_nodes: Defects,
    /// Total volume of the tetrahedra.
    pub volume: f64,
    /// Grading: 0.999 quantile, over the inner faces, of the ratio (≥ 1) of the mean edge lengths
    /// of the two tetrahedra at the face; 1 without inner faces. Interpolated linearly, as by
    /// numpy's `quantile`.
    pub size_ratio: f64,
}

impl Volume {
    /// Returns true if all tetrahedra are positive, all faces conform, and the triangles of the
    /// mesh are exactly the boundary.
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

/// Examines the topology of the tetrahedra; also returns their boundary, ordered by its lowest
/// corners.
pub(super) fn examine(mesh: &Mesh, options: &Options<'_>) -> (Volume, Vec<[u32; 3]>) {
    let (points, room) = (&mesh.points, options.places);
    let (mut volume, lengths) = measure(mesh, options);
    (volume.tets, volume.has_surface) = (mesh.tets.len(), !mesh.triangles.is_empty());
    let elements = Elements {
        mesh,
        tets: Stars::new(points.len(), &mesh.tets),
        triangles: Stars::new(points.len(), &mesh.triangles),
        lengths,
        room,
    };
    let runs: Vec<NodeRun> = blocks(points.len(), ITEMS_PER_TASK)
        .into_par_iter()
        .map(|range| {
            let (mut run, mut work) = (NodeRun::default(), NodeBuffers::default());
            for node in range {
                elements.look_at(node, &mut work, &mut run);
            }
            run
        })
        .collect();
    mids::examine(mesh, &runs, room, &mut volume.mid_nodes);
    let (mut boundary, mut ratios) = (Vec::new(), Vec::new());
    for run in runs {
        volume.append(room, run.volume);
        boundary.extend(run.boundary);
        ratios.extend(run.ratios);
    }
    volume.size_ratio = quantile(&mut ratios, SIZE_RATIO_QUANTILE).unwrap_or(1.0);
    (volume, boundary)
}

impl Volume {
    /// Adds the counts and defects of a later run of nodes.
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

/// Computes the signs and the sum of the volumes, and the mean edge length of each tetrahedron.
fn measure(mesh: &Mesh, options: &Options<'_>) -> (Volume, Vec<f64>) {
    let room = options.places;
    let mut lengths = vec![0.0; mesh.tets.len()];
    let parts: Vec<Volume> = lengths
        .par_chunks_mut(ITEMS_PER_TASK)
        .enumerate()
        .map(|(chunk, lengths)| {
            let mut part = Volume::default();
            for (k, length) in lengths.iter_mut().enumerate() {
                *length = part.add_tetrahedron(mesh, chunk * ITEMS_PER_TASK + k, room);
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
    // Divided last, so that integers stay exact.
    all.volume = six_volumes / 6.0;
    (all, lengths)
}

impl Volume {
    /// Adds six times the volume of a tetrahedron, and its sign. Returns the mean length of its
    /// edges.
    fn add_tetrahedron(&mut self, mesh: &Mesh, k: usize, room: usize) -> f64 {
        let t = mesh.tets[k];
        let p = t.map(|i| mesh.points[i as usize]);
        self.volume += six_volume(p);
        let sign = volume_sign(p[0], p[1], p[2], p[3]);
        let place = || Place {
            at: std::array::from_fn(|i| 0.25 * (p[0][i] + p[1][i] + p[2][i] + p[3][i])),
            nodes: t.to_vec(),
            elements: vec![k as u32],
            value: six_volume(p) / 6.0,
        };
        match sign {
            1.. => {}
            0 => self.flat.add(room, place),
            _ => self.inverted.add(room, place),
        }
        Shape::new(p).mean_edge()
    }
}

/// Returns the quantile `q` of the values, by linear interpolation; `None` without values.
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
}
