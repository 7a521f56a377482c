//! Writer of version 2.2.

use super::{PhysicalNames, element_type, volume_in_gmsh_order};
use crate::mesh::group::{edge, face, face_count, face_part, volume_count, volume_region};
use crate::mesh::options::MeshWriteOptions;
use crate::mesh::out::Out;
use isoform_geom::Mesh;
use std::io::{self, Write};

/// Writes nodes and elements as text.
pub(in crate::mesh) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    _: &MeshWriteOptions,
) -> io::Result<()> {
    let mut out = Out::new(out);
    out.str("$MeshFormat\n2.2 0 8\n$EndMeshFormat").line()?;
    let physical = PhysicalNames::from_mesh(mesh);
    physical.write(&mut out)?;
    out.str("$Nodes\n").int(mesh.points.len()).line()?;
    for (i, p) in mesh.points.iter().enumerate() {
        out.int(i + 1).str(" ").point(p).line()?;
    }
    out.str("$EndNodes\n$Elements\n");
    let mut elements = ElementWriter { number: 0, out };
    elements.write(mesh)?;
    elements.out.str("$EndElements").line()?;
    elements.out.flush()
}

/// Writer of elements, numbered from 1.
struct ElementWriter<'o> {
    /// Number of the last element written.
    number: usize,
    out: Out<'o>,
}

impl ElementWriter<'_> {
    /// Writes all elements: corners, edges, faces, volumes.
    fn write(&mut self, mesh: &Mesh) -> io::Result<()> {
        let lines = mesh.corners.len() + mesh.edges.len();
        let count = lines + face_count(mesh) + volume_count(mesh);
        self.out.int(count).line()?;
        for (i, &c) in mesh.corners.iter().enumerate() {
            self.element(0, Some(0), i + 1, &[c])?;
        }
        for i in 0..mesh.edges.len() {
            let (nodes, n) = edge(mesh, i);
            self.labelled(1, mesh.edge_curves.get(i).copied(), &nodes[..n])?;
        }
        for i in 0..face_count(mesh) {
            let (nodes, n) = face(mesh, i);
            self.labelled(2, face_part(mesh, i), &nodes[..n])?;
        }
        for i in 0..volume_count(mesh) {
            let (nodes, n) = volume_in_gmsh_order(mesh, i);
            self.labelled(3, volume_region(mesh, i), &nodes[..n])?;
        }
        Ok(())
    }
    /// Writes an element whose entity has the tag of its group.
    fn labelled(&mut self, dim: usize, label: Option<u32>, nodes: &[u32]) -> io::Result<()> {
        let entity = label.map_or(1, |l| l as usize + 1);
        self.element(dim, label, entity, nodes)
    }
    /// Writes an element: number, type, two tags (physical group and entity), nodes.
    fn element(
        &mut self,
        dim: usize,
        label: Option<u32>,
        entity: usize,
        nodes: &[u32],
    ) -> io::Result<()> {
        self.number += 1;
        self.out.int(self.number).str(" ");
        self.out.int(element_type(dim, nodes.len())).str(" 2 ");
        self.out
            .int(label.map_or(0, |l| l + 1))
            .str(" ")
            .int(entity);
        for &n in nodes {
            self.out.str(" ").int(n + 1);
        }
        self.out.line()
    }
}
