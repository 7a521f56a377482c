//! PLY: corners of 64 bits, triangles with the tag of their part as the face property `part`, names
//! in comments `part 1 name`, all numbers per node.

use super::number::Out;
use super::options::MeshWriteOptions;
use super::surface::SurfaceNodes;
use isoform_geom::Mesh;
use std::io::{self, Write};

pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let ascii = options.ascii == Some(true);
    let mut out = Out::new(out);
    let nodes = SurfaceNodes::of(mesh);
    out.str("ply\nformat ")
        .str(if ascii {
            "ascii"
        } else {
            "binary_little_endian"
        })
        .str(" 1.0\ncomment written by isoform")
        .line()?;
    if let Some(units) = &options.units {
        out.str("comment units: ")
            .str(&units.replace(['\n', '\r'], " "))
            .line()?;
    }
    for (i, name) in mesh.parts.iter().enumerate() {
        let plain: String = name
            .chars()
            .map(|c| if c.is_control() { ' ' } else { c })
            .collect();
        out.str("comment part ")
            .int(i + 1)
            .str(" ")
            .str(&plain)
            .line()?;
    }
    out.str("element vertex ")
        .int(nodes.len())
        .str("\nproperty double x\nproperty double y\nproperty double z")
        .line()?;
    for column in &mesh.columns {
        let word: String = column
            .name
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
            .collect();
        out.str("property double ").str(&word).line()?;
    }
    out.str("element face ")
        .int(mesh.triangles.len())
        .str("\nproperty list uchar int vertex_indices")
        .line()?;
    let has_parts = !mesh.triangle_parts.is_empty();
    out.str(if has_parts {
        "property int part\nend_header"
    } else {
        "end_header"
    })
    .line()?;
    let mut columns: Vec<_> = mesh
        .columns
        .iter()
        .map(|c| nodes.values(&c.values))
        .collect();
    for p in nodes.points(mesh) {
        let rest = columns.iter_mut().filter_map(Iterator::next);
        for (i, v) in p.iter().copied().chain(rest).enumerate() {
            if ascii {
                out.str(if i == 0 { "" } else { " " }).float(v);
            } else {
                out.bytes(&v.to_le_bytes());
            }
        }
        if ascii { out.line()? } else { out.end()? }
    }
    for i in 0..mesh.triangles.len() {
        let corners = nodes.triangle(mesh, i);
        let tag = mesh.triangle_parts.get(i).map(|p| p + 1);
        if ascii {
            out.str("3");
        } else {
            out.bytes(&[3]);
        }
        for v in corners.into_iter().chain(tag) {
            if ascii {
                out.str(" ").int(v);
            } else {
                out.bytes(&v.to_le_bytes());
            }
        }
        if ascii { out.line()? } else { out.end()? }
    }
    out.flush()
}
