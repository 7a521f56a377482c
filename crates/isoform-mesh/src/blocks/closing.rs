//! Assembly of the labelled mesh of a block.

use super::faces::{OpenFace, open_faces};
use super::plan::Plan;
use super::tetrahedra::{INNER, Tetrahedra};
use super::{MergedTetrahedra, holds, within};
use crate::assemble::{FeatureEdge, corners, feature_edges};
use crate::complex::edge;
use crate::distance::zero_in;
use crate::error::{MeshError, Warning};
use crate::options::Options;
use crate::points::centroid;
use crate::unmeshed::find_unmeshed;
use isoform_control::Control;
use isoform_geom::{Aabb, Curve, Mesh, Point3, Solid, TET_FACES, TRIANGLE_EDGES};
use std::cmp::Ordering;
use std::collections::HashMap;

/// A finished block.
#[derive(Clone, Debug)]
pub struct BlockMesh {
    /// Tetrahedra of the block, with the triangles of the surface on them. All pieces of the solid
    /// are parts, in their order, so that tags agree between blocks.
    pub mesh: Mesh,
    /// The block with its surroundings; checks of elements in the room are valid for the whole
    /// mesh.
    pub around: Mesh,
    /// Faces towards other blocks.
    pub faces: Vec<OpenFace>,
    /// Warnings of surface of the solid that the mesh misses.
    pub warnings: Vec<Warning>,
}

/// Assembles the mesh of block `k` from the tetrahedra of its room and those around it
/// ([`BLOCK_MARGIN_SIZES`](super::BLOCK_MARGIN_SIZES)), both in `given`.
///
/// # Errors
/// [`MeshError::Stopped`].
pub fn close(
    solid: &dyn Solid,
    plan: &Plan,
    options: &Options,
    k: usize,
    given: &Tetrahedra,
    control: &Control<'_>,
) -> Result<BlockMesh, MeshError> {
    let room = plan.room(0, k);
    within(solid, options, |solid| {
        control.begin("assembly")?;
        let mut all = MergedTetrahedra::default();
        all.add(given, |c| holds(&room, c));
        let own = all.clone().tetrahedra();
        all.add(given, |c| !holds(&room, c));
        let block = LabelledBlock::new(solid, plan, all.tetrahedra(), &own);
        control.begin("what the mesh misses")?;
        let region = Aabb {
            lo: std::array::from_fn(|i| room.lo[i].max(plan.region.lo[i])),
            hi: std::array::from_fn(|i| room.hi[i].min(plan.region.hi[i])),
        };
        let missed = find_unmeshed(solid, &block.around, region, options.size, control);
        control.check()?;
        Ok(BlockMesh {
            mesh: block.own(own.points.len()),
            around: block.around,
            faces: open_faces(&own),
            warnings: missed.warning().into_iter().collect(),
        })
    })
}

/// A labelled block with its surroundings.
struct LabelledBlock {
    around: Mesh,
    /// Tetrahedron of each triangle.
    tet_of: Vec<u32>,
    /// Number of the block's own tetrahedra, which come first.
    own: usize,
}

impl LabelledBlock {
    fn new(solid: &dyn Solid, plan: &Plan, all: Tetrahedra, own: &Tetrahedra) -> Self {
        let names = solid.names();
        let mut around = Mesh {
            points: all.points,
            tet_regions: vec![0; all.tets.len()],
            regions: vec!["solid".to_owned()],
            parts: names.to_vec(),
            ..Mesh::default()
        };
        let mut tet_of = Vec::new();
        for (t, (tet, labels)) in all.tets.iter().zip(&all.labels).enumerate() {
            for i in (0..4).filter(|&i| labels[i] != INNER) {
                around.triangles.push(TET_FACES[i].map(|k| tet[k]));
                // A warning about faces that do not lie on a single piece was issued before.
                let part = Some(labels[i]).filter(|&l| (l as usize) < names.len());
                around.triangle_parts.push(part.unwrap_or(0));
                tet_of.push(t as u32);
            }
        }
        around.tets = all.tets;
        let pieces: Vec<u32> = (0..names.len() as u32).collect();
        let edges = feature_edges(solid, zero_in(plan.region), &pieces, &around);
        add_curves(&mut around, plan, &edges);
        around.corners = corners(&around, &plan.apexes);
        Self {
            around,
            tet_of,
            own: own.tets.len(),
        }
    }

    /// Returns true if a triangle belongs to one of the block's own tetrahedra.
    fn is_own(&self, triangle: usize) -> bool {
        (self.tet_of[triangle] as usize) < self.own
    }

    /// Returns the block alone, which has the first `nodes` nodes.
    fn own(&self, nodes: usize) -> Mesh {
        let around = &self.around;
        let triangles = self.tet_of.partition_point(|&t| (t as usize) < self.own);
        let mut mesh = Mesh {
            points: around.points[..nodes].to_vec(),
            tets: around.tets[..self.own].to_vec(),
            tet_regions: vec![0; self.own],
            regions: around.regions.clone(),
            triangles: around.triangles[..triangles].to_vec(),
            triangle_parts: around.triangle_parts[..triangles].to_vec(),
            parts: around.parts.clone(),
            curves: around.curves.clone(),
            ..Mesh::default()
        };
        let first = self.first_triangles();
        let is_own = |key: [u32; 2]| first.get(&key).is_some_and(|f| self.is_own(f.1));
        for (ends, &curve) in around.edges.iter().zip(&around.edge_curves) {
            if is_own(edge(ends[0], ends[1])) {
                mesh.edges.push(*ends);
                mesh.edge_curves.push(curve);
            }
        }
        let own_corners = around.corners.iter().filter(|&&v| is_own([v; 2]));
        mesh.corners = own_corners.copied().collect();
        mesh
    }

    /// Returns, for each feature edge and each corner (as twice the node), the adjacent triangle
    /// with the lowest centroid: the block that owns this triangle writes the feature.
    fn first_triangles(&self) -> HashMap<[u32; 2], (Point3, usize)> {
        let around = &self.around;
        let none = ([f64::INFINITY; 3], usize::MAX);
        let edges = around.edges.iter().map(|e| (edge(e[0], e[1]), none));
        let corners = around.corners.iter().map(|&v| ([v; 2], none));
        let mut first: HashMap<[u32; 2], (Point3, usize)> = edges.chain(corners).collect();
        for (k, f) in around.triangles.iter().enumerate() {
            let mut corners = f.map(|v| around.points[v as usize]);
            corners.sort_unstable_by(compare);
            let at = centroid(corners);
            let edges = TRIANGLE_EDGES.map(|[i, j]| edge(f[i], f[j]));
            for key in edges.into_iter().chain(f.map(|v| [v; 2])) {
                if let Some(best) = first.get_mut(&key)
                    && compare(&at, &best.0).is_lt()
                {
                    *best = (at, k);
                }
            }
        }
        first
    }
}

/// Adds the curves of the plan to a mesh, one per pair of pieces, so that tags agree between
/// blocks; further curves of its edges follow.
fn add_curves(mesh: &mut Mesh, plan: &Plan, edges: &[FeatureEdge]) {
    let mut pairs: Vec<[u32; 2]> = plan.curves.iter().map(|c| c.pieces).collect();
    pairs.sort_unstable();
    pairs.dedup();
    // Sorted by pairs.
    for same in edges.chunk_by(|a, b| a.0 == b.0) {
        let known = pairs.iter().position(|p| *p == same[0].0);
        let curve = known.unwrap_or_else(|| {
            pairs.push(same[0].0);
            pairs.len() - 1
        });
        mesh.edges.extend(same.iter().map(|(_, ends)| ends));
        mesh.edge_curves.extend(same.iter().map(|_| curve as u32));
    }
    let named = |parts: [u32; 2]| {
        let [a, b] = parts.map(|k| &mesh.parts[k as usize]);
        let name = format!("{a}/{b}");
        Curve { name, parts }
    };
    mesh.curves = pairs.into_iter().map(named).collect();
}

/// Compares points by x, then y, then z.
fn compare(p: &Point3, q: &Point3) -> Ordering {
    let axis = |i: usize| p[i].total_cmp(&q[i]);
    axis(0).then_with(|| axis(1)).then_with(|| axis(2))
}
