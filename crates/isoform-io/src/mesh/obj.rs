//! OBJ: vertices in full, faces in a group per part, parameters as texture coordinates.

use super::group::{Groups, Names};
use super::number::Out;
use super::options::MeshWriteOptions;
use super::surface::SurfaceNodes;
use isoform_geom::Mesh;
use std::io::{self, Write};

/// Longest name of a group; others cut lines.
const LONGEST_NAME: usize = 200;

/// One word.
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

pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let mut out = Out::new(out);
    out.str("# mesh written by isoform").line()?;
    if let Some(units) = &options.units {
        out.str("# units: ")
            .str(&units.replace(['\n', '\r'], " "))
            .line()?;
    }
    let nodes = SurfaceNodes::of(mesh);
    for p in nodes.points(mesh) {
        out.str("v ")
            .float(p[0])
            .str(" ")
            .float(p[1])
            .str(" ")
            .float(p[2])
            .line()?;
    }
    let parameters = mesh.parameters();
    if let Some((u, v)) = parameters {
        for (u, v) in nodes.values(u).zip(nodes.values(v)) {
            out.str("vt ").float(u).str(" ").float(v).line()?;
        }
    }
    let parts = Groups::parts(mesh);
    let mut names = Names::new(LONGEST_NAME, plain);
    for (i, triangles) in parts.filled() {
        if !mesh.triangle_parts.is_empty() {
            out.str("g ")
                .str(&names.give(&mesh.parts[i], "part"))
                .line()?;
        }
        for &t in triangles {
            let [a, b, c] = nodes.triangle(mesh, t as usize).map(|n| n + 1);
            out.str("f");
            for n in [a, b, c] {
                out.str(" ").int(n);
                if parameters.is_some() {
                    out.str("/").int(n);
                }
            }
            out.line()?;
        }
    }
    out.flush()
}
