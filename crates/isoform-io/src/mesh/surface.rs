//! Surface meshes: reading by the readers of points, and the nodes that surface formats write.

use crate::collect::TriangleParts;
use crate::input::{Input, Result};
use crate::{ReadOptions, ReadReport, obj, off, ply, stl, three_mf};
use isoform_geom::{Mesh, Point3, PointCloud};

/// Options that keep all points and the coordinates of the file.
const LOSSLESS_OPTIONS: ReadOptions = ReadOptions {
    max_points: None,
    seed: 1,
    mesh: crate::MeshPoints::Vertices,
    recenter: false,
};

/// Returns the mesh of points and triangles with their groups; groups without triangles are
/// dropped.
fn mesh((cloud, parts): (PointCloud, TriangleParts)) -> Mesh {
    let TriangleParts { of_triangle, names } = parts;
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

/// Reads OBJ; its groups become parts.
pub(super) fn read_obj(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    obj::read_parts(input, &LOSSLESS_OPTIONS, report).map(mesh)
}

/// Reads OFF, which has no parts.
pub(super) fn read_off(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    off::read(input, &LOSSLESS_OPTIONS, report).map(|cloud| mesh((cloud, TriangleParts::default())))
}

/// Reads PLY; parts are recognised in files written by this crate.
pub(super) fn read_ply(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    ply::read_parts(input, &LOSSLESS_OPTIONS, report).map(mesh)
}

/// Reads STL; its solids become parts, unless there is only one.
pub(super) fn read_stl(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    let (cloud, parts) = stl::read_parts(input, &LOSSLESS_OPTIONS, report)?;
    Ok(mesh((
        cloud,
        if parts.names.len() > 1 {
            parts
        } else {
            TriangleParts::default()
        },
    )))
}

/// Reads 3MF; parts are the base materials of its only mesh, or its meshes.
pub(super) fn read_3mf(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    three_mf::read_parts(input, &LOSSLESS_OPTIONS, report).map(mesh)
}

/// Nodes that a surface format writes, renumbered.
pub(super) struct SurfaceNodes {
    /// Indices of the nodes in the mesh, ascending.
    nodes: Vec<u32>,
    /// New index of each node of the mesh.
    number: Vec<u32>,
}

impl SurfaceNodes {
    /// Selects the corners of the triangles. Without tetrahedra and mid-edge nodes it selects all
    /// nodes, so that node numbers survive writing and reading.
    pub(super) fn from_mesh(mesh: &Mesh) -> Self {
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
    /// Returns the number of nodes.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }
    /// Returns the coordinates of the nodes.
    pub(super) fn points<'m>(&self, mesh: &'m Mesh) -> impl Iterator<Item = &'m Point3> {
        self.nodes.iter().map(|&n| &mesh.points[n as usize])
    }
    /// Returns the values of a column at the nodes.
    pub(super) fn values<'m>(&self, column: &'m [f64]) -> impl Iterator<Item = f64> + use<'_, 'm> {
        self.nodes.iter().map(|&n| column[n as usize])
    }
    /// Returns the corners of a triangle as new indices.
    pub(super) fn triangle(&self, mesh: &Mesh, i: usize) -> [u32; 3] {
        mesh.triangles[i].map(|n| self.number[n as usize])
    }
}
