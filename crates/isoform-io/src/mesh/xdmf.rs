//! XDMF 3 (xdmf.org, "XDMF Model and Format"): one grid of cells of one kind in a single file, with
//! the numbers as text. meshio and ParaView read it, and so does DOLFINx with its encoding ASCII;
//! all three take the grid `mesh`, and none of them takes several kinds of cells.
//!
//! A file has either the tetrahedra with the tag of their region, or the faces with the tag of
//! their part. Both number all nodes of the mesh equally, so that tags of faces go with the
//! tetrahedra of another file. The names of the tags form a comment.

use super::group::{face, face_part, volume, volume_region};
use super::options::MeshWriteOptions;
use super::out::{Out, on_one_line};
use crate::xml;
use isoform_geom::Mesh;
use std::io::{self, Write};

/// Cells of a file.
struct Cells<'m> {
    /// Number of cells.
    count: usize,
    /// Number of nodes of each.
    nodes: usize,
    /// Type of the cells in XDMF.
    kind: &'static str,
    /// Name of the attribute with the tags.
    tag: &'static str,
    /// Names of the tags, from 1.
    names: &'m [String],
}

/// Writes the tetrahedra with their regions; of a mesh without tetrahedra the faces.
pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    if mesh.tets.is_empty() {
        return write_faces(mesh, out, options);
    }
    let (nodes, kind) = match mesh.tet_mids.is_empty() {
        true => (4, "Tetrahedron"),
        false => (10, "Tetrahedron_10"),
    };
    let cells = Cells {
        count: mesh.tets.len(),
        nodes,
        kind,
        tag: "region",
        names: &mesh.regions,
    };
    let region = |i: usize| volume_region(mesh, i);
    write_grid(
        mesh,
        &cells,
        |i| volume(mesh, i).0,
        region,
        &mut Out::new(out),
        options,
    )
}

/// Writes the triangles with their parts.
pub(super) fn write_faces(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let (nodes, kind) = match mesh.triangle_mids.is_empty() {
        true => (3, "Triangle"),
        false => (6, "Triangle_6"),
    };
    let cells = Cells {
        count: mesh.triangles.len(),
        nodes,
        kind,
        tag: "part",
        names: &mesh.parts,
    };
    let part = |i: usize| face_part(mesh, i);
    write_grid(
        mesh,
        &cells,
        |i| face(mesh, i).0,
        part,
        &mut Out::new(out),
        options,
    )
}

/// Writes the grid of some cells, whose first nodes and labels are given.
fn write_grid<const N: usize>(
    mesh: &Mesh,
    cells: &Cells<'_>,
    nodes: impl Fn(usize) -> [u32; N],
    label: impl Fn(usize) -> Option<u32>,
    out: &mut Out<'_>,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    out.str("<?xml version=\"1.0\"?>\n<!-- mesh written by isoform")
        .line()?;
    out.units("", options)?;
    for (i, name) in cells.names.iter().enumerate() {
        // A double hyphen would end the comment.
        let name = xml::escape(&on_one_line(name)).replace('-', "&#45;");
        out.str(cells.tag)
            .str(" ")
            .int(i + 1)
            .str(" ")
            .str(&name)
            .line()?;
    }
    out.str("-->\n<Xdmf Version=\"3.0\">\n<Domain>\n<Grid Name=\"mesh\" GridType=\"Uniform\">\n");
    out.str("<Topology TopologyType=\"").str(cells.kind);
    out.str("\" NumberOfElements=\"").int(cells.count);
    out.str("\" NodesPerElement=\"")
        .int(cells.nodes)
        .str("\">\n");
    item(out, "Int", 4, &[cells.count, cells.nodes]);
    for i in 0..cells.count {
        for node in &nodes(i)[..cells.nodes] {
            out.int(*node).str(" ");
        }
        out.line()?;
    }
    out.str("</DataItem>\n</Topology>\n<Geometry GeometryType=\"XYZ\">\n");
    item(out, "Float", 8, &[mesh.points.len(), 3]);
    for point in &mesh.points {
        out.point(point).line()?;
    }
    out.str("</DataItem>\n</Geometry>\n<Attribute Name=\"")
        .str(cells.tag);
    out.str("\" AttributeType=\"Scalar\" Center=\"Cell\">\n");
    item(out, "Int", 4, &[cells.count, 1]);
    for i in 0..cells.count {
        out.int(label(i).map_or(0, |l| l + 1)).line()?;
    }
    out.str("</DataItem>\n</Attribute>\n</Grid>\n</Domain>\n</Xdmf>")
        .line()?;
    out.flush()
}

/// Writes the start of an element with numbers, of some type and size in bytes.
fn item(out: &mut Out<'_>, kind: &str, bytes: usize, dimensions: &[usize]) {
    let dimensions: Vec<String> = dimensions.iter().map(usize::to_string).collect();
    out.str("<DataItem Dimensions=\"")
        .str(&dimensions.join(" "));
    out.str("\" NumberType=\"").str(kind);
    out.str("\" Precision=\"")
        .int(bytes)
        .str("\" Format=\"XML\">\n");
}
