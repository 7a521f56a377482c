//! The surface of a mesh for formats that hold nothing else.

use isoform_geom::{Mesh, Point3};

/// The nodes that a surface format writes, and their new numbers.
pub(super) struct SurfaceNodes {
    /// Nodes of the mesh, ascending.
    nodes: Vec<u32>,
    /// New number of each node of the mesh.
    number: Vec<u32>,
}

impl SurfaceNodes {
    /// The corners of the triangles; of a mesh with nothing else all nodes, so that reading gives the same numbers.
    pub(super) fn of(mesh: &Mesh) -> Self {
        let mut used = vec![mesh.tets.is_empty() && mesh.triangle_mids.is_empty(); mesh.points.len()];
        mesh.triangles.iter().flatten().for_each(|&n| used[n as usize] = true);
        let nodes: Vec<u32> = (0..mesh.points.len() as u32).filter(|&n| used[n as usize]).collect();
        let mut number = vec![0; mesh.points.len()];
        nodes.iter().enumerate().for_each(|(i, &n)| number[n as usize] = i as u32);
        Self { nodes, number }
    }
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }
    pub(super) fn points<'m>(&self, mesh: &'m Mesh) -> impl Iterator<Item = &'m Point3> {
        self.nodes.iter().map(|&n| &mesh.points[n as usize])
    }
    /// Corners of a triangle in the new numbers.
    pub(super) fn triangle(&self, mesh: &Mesh, i: usize) -> [u32; 3] {
        mesh.triangles[i].map(|n| self.number[n as usize])
    }
}
