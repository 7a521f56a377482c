//! OBJ: vertices in double precision, faces in a group per part, parameters as texture coordinates.

use super::group::{Groups, UniqueNames};
use super::options::MeshWriteOptions;
use super::out::Out;
use super::surface::SurfaceNodes;
use isoform_geom::Mesh;
use std::io::{self, Write};

/// Maximum length of a group's name, which keeps lines short.
const MAX_NAME_LENGTH: usize = 200;

/// Converts a name to a single word.
fn plain(name: &str) -> String {
    name.chars()
        .map(|c| {
            if c.is_whitespace() || c.is_control() || "#\\".contains(c) {
                '_'
            } else {
                c
            }
        })
        .collect()
}

/// Writes the surface.
pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let mut out = Out::new(out);
    out.str("# mesh written by isoform").line()?;
    out.units("#", options)?;
    let nodes = SurfaceNodes::from_mesh(mesh);
    for p in nodes.points(mesh) {
        out.str("v ").point(p).line()?;
    }
    if let Some((u, v)) = mesh.parameters() {
        for (u, v) in nodes.values(u).zip(nodes.values(v)) {
            out.str("vt ").float(u).str(" ").float(v).line()?;
        }
    }
    write_faces(mesh, &nodes, &mut out)?;
    out.flush()
}

/// Writes the faces in groups by part; the texture coordinates of a corner have the index of its
/// vertex.
fn write_faces(mesh: &Mesh, nodes: &SurfaceNodes, out: &mut Out<'_>) -> io::Result<()> {
    let is_textured = mesh.parameters().is_some();
    let parts = Groups::parts(mesh);
    let mut names = UniqueNames::new(MAX_NAME_LENGTH, plain);
    for (i, triangles) in parts.filled() {
        if !mesh.triangle_parts.is_empty() {
            let name = names.give(&mesh.parts[i], "part");
            out.str("g ").str(&name).line()?;
        }
        for &t in triangles {
            out.str("f");
            for n in nodes.triangle(mesh, t as usize).map(|n| n + 1) {
                out.str(" ").int(n);
                if is_textured {
                    out.str("/").int(n);
                }
            }
            out.line()?;
        }
    }
    Ok(())
}
