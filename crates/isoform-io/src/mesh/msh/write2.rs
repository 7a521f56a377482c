//! The writer of version 2.2.

use super::{Physical, TET10, element_type};
use crate::mesh::group::{edge, tet, triangle};
use crate::mesh::number::Out;
use crate::mesh::options::MeshWriteOptions;
use isoform_geom::Mesh;
use std::io::{self, Write};

pub(in crate::mesh) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    _: &MeshWriteOptions,
) -> io::Result<()> {
    let mut out = Out::new(out);
    out.str("$MeshFormat\n2.2 0 8\n$EndMeshFormat").line()?;
    let physical = Physical::of(mesh);
    physical.write(&mut out)?;
    out.str("$Nodes\n").int(mesh.points.len()).line()?;
    for (i, p) in mesh.points.iter().enumerate() {
        out.int(i + 1)
            .str(" ")
            .float(p[0])
            .str(" ")
            .float(p[1])
            .str(" ")
            .float(p[2])
            .line()?;
    }
    out.str("$EndNodes\n$Elements\n");
    out.int(mesh.corners.len() + mesh.edges.len() + mesh.triangles.len() + mesh.tets.len())
        .line()?;
    let mut number = 0;
    // Number, type, two tags (physical group and entity), nodes.
    let mut element = |dim: usize, label: Option<u32>, entity: usize, nodes: &[u32]| {
        number += 1;
        out.int(number)
            .str(" ")
            .int(element_type(dim, nodes.len()))
            .str(" 2 ");
        out.int(label.map_or(0, |l| l + 1)).str(" ").int(entity);
        nodes.iter().for_each(|&n| {
            out.str(" ").int(n + 1);
        });
        out.line()
    };
    for (i, &c) in mesh.corners.iter().enumerate() {
        element(0, Some(0), i + 1, &[c])?;
    }
    let entity = |label: Option<u32>| label.map_or(1, |l| l as usize + 1);
    for i in 0..mesh.edges.len() {
        let (nodes, n) = edge(mesh, i);
        let label = mesh.edge_curves.get(i).copied();
        element(1, label, entity(label), &nodes[..n])?;
    }
    for i in 0..mesh.triangles.len() {
        let (nodes, n) = triangle(mesh, i);
        let label = mesh.triangle_parts.get(i).copied();
        element(2, label, entity(label), &nodes[..n])?;
    }
    for i in 0..mesh.tets.len() {
        let (nodes, n) = tet(mesh, i);
        let label = mesh.tet_regions.get(i).copied();
        element(
            3,
            label,
            entity(label),
            &if n == 10 {
                TET10.map(|k| nodes[k])
            } else {
                nodes
            }[..n],
        )?;
    }
    out.str("$EndElements").line()?;
    out.flush()
}
