//! STL: binary in single precision with the unit in its header, or ASCII in double precision with a
//! solid per part.

use super::group::Groups;
use super::options::MeshWriteOptions;
use super::out::Out;
use isoform_geom::{Mesh, Point3, cross, norm, sub};
use std::io::{self, Write};

/// Returns the outward unit normal of a triangle; 0 for a degenerate one.
fn normal(mesh: &Mesh, t: [u32; 3]) -> Point3 {
    let [a, b, c] = t.map(|n| mesh.points[n as usize]);
    let n = cross(sub(b, a), sub(c, a));
    let length = norm(n);
    if length > 0.0 && length.is_finite() {
        n.map(|v| v / length)
    } else {
        [0.0; 3]
    }
}

/// Writes the triangles. The binary form rounds coordinates to 32 bits.
pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let mut out = Out::new(out);
    if options.ascii == Some(true) {
        return write_ascii(mesh, &mut out);
    }
    let count = u32::try_from(mesh.triangles.len())
        .map_err(|_| io::Error::other("STL holds at most 4294967295 triangles"))?;
    let units = options
        .units
        .as_deref()
        .map(|u| format!(" units: {u}"))
        .unwrap_or_default();
    // Not "solid", which would indicate the ASCII form.
    let mut head: Vec<u8> = format!("isoform binary STL{units}")
        .bytes()
        .map(|b| if b.is_ascii_graphic() { b } else { b' ' })
        .collect();
    head.resize(80, b' ');
    out.bytes(&head).bytes(&count.to_le_bytes());
    for &t in &mesh.triangles {
        let corners = t.map(|n| mesh.points[n as usize]);
        for v in normal(mesh, t).iter().chain(corners.iter().flatten()) {
            out.bytes(&(*v as f32).to_le_bytes());
        }
        out.bytes(&[0; 2]).end()?;
    }
    out.flush()
}

/// Writes a solid for each part that has triangles.
fn write_ascii(mesh: &Mesh, out: &mut Out<'_>) -> io::Result<()> {
    for (i, triangles) in Groups::parts(mesh).filled() {
        let part = mesh.parts.get(i);
        let given = part.filter(|_| !mesh.triangle_parts.is_empty());
        let name = given.map_or("surface", |n| n);
        out.str("solid ").name(name).line()?;
        for &t in triangles {
            write_facet(mesh, mesh.triangles[t as usize], out)?;
        }
        out.str("endsolid ").name(name).line()?;
    }
    if mesh.triangles.is_empty() {
        out.str("solid empty\nendsolid empty").line()?;
    }
    out.flush()
}

/// Writes a facet with its normal.
fn write_facet(mesh: &Mesh, t: [u32; 3], out: &mut Out<'_>) -> io::Result<()> {
    out.str("facet normal ").point(&normal(mesh, t));
    out.str("\nouter loop");
    for n in t {
        out.str("\nvertex ").point(&mesh.points[n as usize]);
    }
    out.str("\nendloop\nendfacet").line()
}
