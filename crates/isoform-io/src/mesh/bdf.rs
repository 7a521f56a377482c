//! Nastran bulk data: GRID* with 16 characters a number, CTETRA and CTRIA3 or CTRIA6 in fields of
//! eight.
//!
//! The property of an element is the tag of its part; regions follow behind the parts. Their names
//! are comments. Triangles are numbered before the tetrahedra.

use super::group::{tet, triangle};
use super::number::Out;
use super::options::MeshWriteOptions;
use isoform_geom::Mesh;
use std::io::{self, Write};

/// Highest number of a node or an element.
const HIGHEST: usize = 99_999_999;

pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    if mesh
        .points
        .len()
        .max(mesh.triangles.len() + mesh.tets.len())
        > HIGHEST
    {
        return Err(io::Error::other(format!(
            "Nastran numbers nodes and elements up to {HIGHEST} only"
        )));
    }
    let mut out = Out::new(out);
    out.str("$ mesh written by isoform").line()?;
    if let Some(units) = &options.units {
        out.str("$ units: ")
            .str(&units.replace(['\n', '\r'], " "))
            .line()?;
    }
    let names = mesh
        .parts
        .iter()
        .map(|n| ("part", n))
        .chain(mesh.regions.iter().map(|n| ("region", n)));
    for (i, (kind, name)) in names.enumerate() {
        let plain: String = name
            .chars()
            .map(|c| if c.is_control() { ' ' } else { c })
            .collect();
        out.str("$ property ")
            .int(i + 1)
            .str(" is ")
            .str(kind)
            .str(" ")
            .str(&plain)
            .line()?;
    }
    out.str("CEND\nBEGIN BULK").line()?;
    for (i, p) in mesh.points.iter().enumerate() {
        let start = out.mark();
        out.str("GRID*")
            .pad(start, 8)
            .int(i + 1)
            .pad(start, 40)
            .narrow(p[0], 16)
            .pad(start, 56)
            .narrow(p[1], 16);
        out.str("\n");
        let start = out.mark();
        out.str("*").pad(start, 8).narrow(p[2], 16).line()?;
    }
    let card = |out: &mut Out<'_>, name: &str, number: usize, property: usize, nodes: &[u32]| {
        let mut start = out.mark();
        out.str(name)
            .pad(start, 8)
            .int(number)
            .pad(start, 16)
            .int(property)
            .pad(start, 24);
        let mut column = 24;
        for &n in nodes {
            if column == 72 {
                out.str("\n");
                start = out.mark();
                column = 8;
                out.str("+").pad(start, column);
            }
            column += 8;
            out.int(n + 1).pad(start, column);
        }
        out.line()
    };
    for i in 0..mesh.triangles.len() {
        let (nodes, n) = triangle(mesh, i);
        let property = mesh.triangle_parts.get(i).map_or(1, |p| *p as usize + 1);
        card(
            &mut out,
            if n == 6 { "CTRIA6" } else { "CTRIA3" },
            i + 1,
            property,
            &nodes[..n],
        )?;
    }
    let parts = if mesh.triangles.is_empty() {
        0
    } else {
        mesh.parts.len().max(1)
    };
    for i in 0..mesh.tets.len() {
        let (nodes, n) = tet(mesh, i);
        let property = parts + mesh.tet_regions.get(i).map_or(1, |r| *r as usize + 1);
        card(
            &mut out,
            "CTETRA",
            mesh.triangles.len() + i + 1,
            property,
            &nodes[..n],
        )?;
    }
    out.str("ENDDATA").line()?;
    out.flush()
}
