//! The surface of a mesh for formats that hold nothing else; the readers of points read them.

use crate::collect::Parts;
use crate::input::{Input, Result};
use crate::{ReadOptions, ReadReport, obj, off, ply, stl, three_mf};
use isoform_geom::{Mesh, Point3, PointCloud};

/// Coordinates as they are in the file.
const AS_THEY_ARE: ReadOptions = ReadOptions {
    max_points: None,
    seed: 1,
    mesh: crate::MeshPoints::Vertices,
    recenter: false,
};

/// The mesh of points and triangles with their groups; names without triangles are dropped.
fn mesh((cloud, parts): (PointCloud, Parts)) -> Mesh {
    let Parts { of_triangle, names } = parts;
    let names = if of_triangle.is_empty() {
        Vec::new()
    } else {
        names
    };
    Mesh {
        points: cloud.points,
        triangles: cloud.triangles,
        triangle_parts: of_triangle,
        parts: names,
        ..Mesh::default()
    }
}

/// Reads OBJ; its groups are the parts.
pub(super) fn read_obj(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    obj::read_parts(input, &AS_THEY_ARE, report).map(mesh)
}

/// Reads OFF, which has no parts.
pub(super) fn read_off(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    off::read(input, &AS_THEY_ARE, report).map(|cloud| mesh((cloud, Parts::default())))
}

/// Reads PLY; its parts are those that our writer makes.
pub(super) fn read_ply(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    ply::read_parts(input, &AS_THEY_ARE, report).map(mesh)
}

/// Reads STL; its solids are the parts, and a file of one solid has none.
pub(super) fn read_stl(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    let (cloud, parts) = stl::read_parts(input, &AS_THEY_ARE, report)?;
    Ok(mesh((
        cloud,
        if parts.names.len() > 1 {
            parts
        } else {
            Parts::default()
        },
    )))
}

/// Reads 3MF; its parts are the base materials of its only mesh, or its meshes.
pub(super) fn read_3mf(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    three_mf::read_parts(input, &AS_THEY_ARE, report).map(mesh)
}

/// The nodes that a surface format writes, and their new numbers.
pub(super) struct SurfaceNodes {
    /// Nodes of the mesh, ascending.
    nodes: Vec<u32>,
    /// New number of each node of the mesh.
    number: Vec<u32>,
}

impl SurfaceNodes {
    /// The corners of the triangles. If the mesh has neither tetrahedra nor mid-edge nodes, all
    /// nodes: then node numbers survive writing and reading.
    pub(super) fn of(mesh: &Mesh) -> Self {
        let mut used =
            vec![mesh.tets.is_empty() && mesh.triangle_mids.is_empty(); mesh.points.len()];
        mesh.triangles
            .iter()
            .flatten()
            .for_each(|&n| used[n as usize] = true);
        let nodes: Vec<u32> = (0..mesh.points.len() as u32)
            .filter(|&n| used[n as usize])
            .collect();
        let mut number = vec![0; mesh.points.len()];
        nodes
            .iter()
            .enumerate()
            .for_each(|(i, &n)| number[n as usize] = i as u32);
        Self { nodes, number }
    }
    /// The number of nodes.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }
    /// Coordinates of the nodes.
    pub(super) fn points<'m>(&self, mesh: &'m Mesh) -> impl Iterator<Item = &'m Point3> {
        self.nodes.iter().map(|&n| &mesh.points[n as usize])
    }
    /// Those values of a column that belong to the nodes.
    pub(super) fn values<'m>(&self, column: &'m [f64]) -> impl Iterator<Item = f64> + use<'_, 'm> {
        self.nodes.iter().map(|&n| column[n as usize])
    }
    /// Corners of a triangle in the new numbers.
    pub(super) fn triangle(&self, mesh: &Mesh, i: usize) -> [u32; 3] {
        mesh.triangles[i].map(|n| self.number[n as usize])
    }
}
