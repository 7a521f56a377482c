//! PLY: vertices in double precision, triangles with the tag of their part as face property `part`,
//! names in comments `part 1 name`, and all columns.

use super::options::MeshWriteOptions;
use super::out::Out;
use super::surface::SurfaceNodes;
use isoform_geom::Mesh;
use std::io::{self, Write};

/// Writes the surface, in binary unless text is requested.
pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let mut values = RowWriter {
        out: Out::new(out),
        ascii: options.ascii == Some(true),
        is_first: true,
    };
    let nodes = SurfaceNodes::from_mesh(mesh);
    write_header(mesh, nodes.len(), options, &mut values.out)?;
    write_nodes(mesh, &nodes, &mut values)?;
    write_faces(mesh, &nodes, &mut values)?;
    values.out.flush()
}

/// Writes the header: names of the parts, then the properties of vertices and faces.
fn write_header(
    mesh: &Mesh,
    nodes: usize,
    options: &MeshWriteOptions,
    out: &mut Out<'_>,
) -> io::Result<()> {
    let encoding = match options.ascii {
        Some(true) => "ascii",
        _ => "binary_little_endian",
    };
    out.str("ply\nformat ").str(encoding);
    out.str(" 1.0\ncomment written by isoform").line()?;
    out.units("comment", options)?;
    for (i, name) in mesh.parts.iter().enumerate() {
        out.str("comment part ").int(i + 1).str(" ");
        out.name(name).line()?;
    }
    out.str("element vertex ").int(nodes);
    out.str("\nproperty double x\nproperty double y\nproperty double z");
    out.line()?;
    for column in &mesh.columns {
        let word = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let name: String = column.name.chars().map(word).collect();
        out.str("property double ").str(&name).line()?;
    }
    out.str("element face ").int(mesh.triangles.len());
    out.str("\nproperty list uchar int vertex_indices").line()?;
    if !mesh.triangle_parts.is_empty() {
        out.str("property int part").line()?;
    }
    out.str("end_header").line()
}

/// Writer of rows of numbers, in text or binary.
struct RowWriter<'o> {
    out: Out<'o>,
    /// True if the rows are text.
    ascii: bool,
    /// True if the next number starts a line of text.
    is_first: bool,
}

impl RowWriter<'_> {
    /// Appends the blank before a number unless it starts a line.
    fn gap(&mut self) {
        if !std::mem::take(&mut self.is_first) {
            self.out.str(" ");
        }
    }
    /// Appends a double.
    fn float(&mut self, v: f64) {
        if self.ascii {
            self.gap();
            self.out.float(v);
        } else {
            self.out.bytes(&v.to_le_bytes());
        }
    }
    /// Appends an integer of 32 bits.
    fn index(&mut self, v: u32) {
        if self.ascii {
            self.gap();
            self.out.int(v);
        } else {
            self.out.bytes(&v.to_le_bytes());
        }
    }
    /// Appends the length of a list.
    fn length(&mut self, n: u8) {
        if self.ascii {
            self.gap();
            self.out.int(n);
        } else {
            self.out.bytes(&[n]);
        }
    }
    /// Ends a row.
    fn end(&mut self) -> io::Result<()> {
        self.is_first = true;
        if self.ascii {
            self.out.line()
        } else {
            self.out.end()
        }
    }
}

/// Writes coordinates and columns of the nodes.
fn write_nodes(mesh: &Mesh, nodes: &SurfaceNodes, values: &mut RowWriter<'_>) -> io::Result<()> {
    let columns = mesh.columns.iter().map(|c| nodes.values(&c.values));
    let mut columns: Vec<_> = columns.collect();
    for p in nodes.points(mesh) {
        let rest = columns.iter_mut().filter_map(Iterator::next);
        for v in p.iter().copied().chain(rest) {
            values.float(v);
        }
        values.end()?;
    }
    Ok(())
}

/// Writes corners and part tags of the faces.
fn write_faces(mesh: &Mesh, nodes: &SurfaceNodes, values: &mut RowWriter<'_>) -> io::Result<()> {
    for i in 0..mesh.triangles.len() {
        values.length(3);
        let tag = mesh.triangle_parts.get(i).map(|p| p + 1);
        for v in nodes.triangle(mesh, i).into_iter().chain(tag) {
            values.index(v);
        }
        values.end()?;
    }
    Ok(())
}
