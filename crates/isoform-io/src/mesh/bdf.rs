//! Nastran bulk data: GRID* with 16 characters a number; CTRIA3, CTRIA6, CQUAD4, CTETRA and CPENTA
//! in fields of eight characters. CPENTA has the node order of [`Mesh`].
//!
//! The property of an element is the tag of its part; tags of regions follow those of the parts.
//! Names are comments. Faces are numbered before the volumes.

use super::group::{face, face_count, face_part, volume, volume_count, volume_region};
use super::options::MeshWriteOptions;
use super::out::Out;
use isoform_geom::{Mesh, Point3};
use std::io::{self, Write};

/// Largest number of a node or an element: eight digits.
const MAX_NUMBER: usize = 99_999_999;

/// Writes nodes, faces and volumes as bulk data.
pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let elements = face_count(mesh) + volume_count(mesh);
    if mesh.points.len().max(elements) > MAX_NUMBER {
        return Err(io::Error::other(format!(
            "Nastran numbers nodes and elements up to {MAX_NUMBER} only"
        )));
    }
    let mut out = Out::new(out);
    out.str("$ mesh written by isoform").line()?;
    out.units("$", options)?;
    write_names(mesh, &mut out)?;
    out.str("CEND\nBEGIN BULK").line()?;
    for (i, p) in mesh.points.iter().enumerate() {
        write_node(i + 1, p, &mut out)?;
    }
    write_faces(mesh, &mut out)?;
    write_volumes(mesh, &mut out)?;
    out.str("ENDDATA").line()?;
    out.flush()
}

/// Writes the names of the properties: parts, then regions.
fn write_names(mesh: &Mesh, out: &mut Out<'_>) -> io::Result<()> {
    let parts = mesh.parts.iter().map(|n| (" is part ", n));
    let regions = mesh.regions.iter().map(|n| (" is region ", n));
    for (i, (is, name)) in parts.chain(regions).enumerate() {
        out.str("$ property ")
            .int(i + 1)
            .str(is)
            .name(name)
            .line()?;
    }
    Ok(())
}

/// Writes a node as two lines of wide fields.
fn write_node(number: usize, p: &Point3, out: &mut Out<'_>) -> io::Result<()> {
    let start = out.mark();
    out.str("GRID*").pad(start, 8).int(number).pad(start, 40);
    out.narrow(p[0], 16)
        .pad(start, 56)
        .narrow(p[1], 16)
        .str("\n");
    let start = out.mark();
    out.str("*").pad(start, 8).narrow(p[2], 16).line()
}

/// Element and its property, both numbered from 1.
struct ElementCard<'n> {
    /// Type of the element.
    name: &'static str,
    number: usize,
    /// Number of the property, which identifies part or region.
    property: usize,
    /// Corners, then mid nodes, as indices from 0.
    nodes: &'n [u32],
}

impl ElementCard<'_> {
    /// Writes ten fields of eight characters per line: the first is the name or a continuation
    /// mark, the last stays empty.
    fn write(&self, out: &mut Out<'_>) -> io::Result<()> {
        let mut start = out.mark();
        out.str(self.name).pad(start, 8).int(self.number);
        out.pad(start, 16).int(self.property).pad(start, 24);
        let mut column = 24;
        for &n in self.nodes {
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
    }
}

/// Writes the faces, numbered from 1, with the tags of their parts as properties.
fn write_faces(mesh: &Mesh, out: &mut Out<'_>) -> io::Result<()> {
    for i in 0..face_count(mesh) {
        let (nodes, n) = face(mesh, i);
        ElementCard {
            name: match n {
                3 => "CTRIA3",
                4 => "CQUAD4",
                _ => "CTRIA6",
            },
            number: i + 1,
            property: face_part(mesh, i).map_or(1, |p| p as usize + 1),
            nodes: &nodes[..n],
        }
        .write(out)?;
    }
    Ok(())
}

/// Writes the volumes, whose numbers and properties follow those of the faces.
fn write_volumes(mesh: &Mesh, out: &mut Out<'_>) -> io::Result<()> {
    let parts = match face_count(mesh) {
        0 => 0,
        _ => mesh.parts.len().max(1),
    };
    for i in 0..volume_count(mesh) {
        let (nodes, n) = volume(mesh, i);
        let region = volume_region(mesh, i).map_or(1, |r| r as usize + 1);
        ElementCard {
            name: if n == 6 { "CPENTA" } else { "CTETRA" },
            number: face_count(mesh) + i + 1,
            property: parts + region,
            nodes: &nodes[..n],
        }
        .write(out)?;
    }
    Ok(())
}
