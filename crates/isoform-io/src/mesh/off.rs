//! OFF (Geomview): vertices and triangles as text, in double precision. The format cannot store
//! parts, units or columns.

use super::options::MeshWriteOptions;
use super::out::Out;
use super::surface::SurfaceNodes;
use isoform_geom::Mesh;
use std::io::{self, Write};

/// Writes the surface.
pub(super) fn write(mesh: &Mesh, out: &mut dyn Write, _: &MeshWriteOptions) -> io::Result<()> {
    let mut out = Out::new(out);
    let nodes = SurfaceNodes::from_mesh(mesh);
    out.str("OFF\n")
        .int(nodes.len())
        .str(" ")
        .int(mesh.triangles.len())
        .str(" 0")
        .line()?;
    for p in nodes.points(mesh) {
        out.point(p).line()?;
    }
    for i in 0..mesh.triangles.len() {
        let [a, b, c] = nodes.triangle(mesh, i);
        out.str("3 ")
            .int(a)
            .str(" ")
            .int(b)
            .str(" ")
            .int(c)
            .line()?;
    }
    out.flush()
}
