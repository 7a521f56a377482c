//! Meshes with groups, to files and back.
//!
//! [`write_mesh`] does for a [`Mesh`] what [`write()`](crate::write()) does for points. Parts are
//! groups of triangles, curves groups of edges, regions groups of tetrahedra; each format carries of them what it can, and the
//! [`WriteReport`] says what it cannot. Tags of groups count from 1 in the order of the mesh's lists, 0 is no group.
//!
//! A new format is one file in `mesh/` with `write` or `read`, and one line in `mesh/registry.rs`.

#[expect(dead_code, reason = "the readers come next")]
mod boundary;
mod check;
mod group;
mod inp;
mod msh;
#[expect(dead_code, reason = "the readers come next")]
mod number;
mod obj;
mod registry;
mod stl;
#[expect(dead_code, reason = "the other surface formats come next")]
mod surface;
mod vtu;

pub use registry::{MeshFormat, mesh_format_named, mesh_formats};

use crate::registry::extension;
use crate::{WriteError, WriteReport, write_atomic};
use isoform_geom::Mesh;
use std::io::{self, Write};
use std::path::Path;

/// How to write a mesh.
#[derive(Clone, Debug, Default)]
pub struct MeshWriteOptions {
    /// Text or binary where the format has both; else, and by default, what is usual: text for .msh, binary for .vtu, .stl and .ply.
    pub ascii: Option<bool>,
    /// Unit of length of the coordinates, `mm`, `m`, `in`, …, to state where the format can.
    pub units: Option<String>,
}

/// Writes a mesh to any sink.
///
/// `format` is a name or an ending out of [`mesh_formats`]; `-ascii` or `-binary` behind it (`msh-binary`, `stl-ascii`) says more than the
/// options. The mesh is checked first: labels and indices that point nowhere are refused.
pub fn write_mesh(mesh: &Mesh, out: &mut dyn Write, format: &str, options: &MeshWriteOptions) -> Result<WriteReport, WriteError> {
    let (format, write, options) = writer(format, options)?;
    check::check(mesh, "output")?;
    write(mesh, out, &options).and_then(|()| out.flush()).map_err(|e| WriteError::io("cannot write the mesh", "output".into(), &e))?;
    Ok(report(mesh, format, &options))
}

/// Writes a file, whole or not at all (see [`write_atomic`]); the format by `format` or the ending of the name.
pub fn write_mesh_path(mesh: &Mesh, path: &Path, format: Option<&str>, options: &MeshWriteOptions) -> Result<WriteReport, WriteError> {
    let named = extension(&path.to_string_lossy());
    let (format, write, options) = writer(format.or(named.as_deref()).unwrap_or(""), options)?;
    check::check(mesh, &path.display().to_string())?;
    write_atomic(path, |out| write(mesh, out, &options))?;
    Ok(report(mesh, format, &options))
}

type WriteFn = fn(&Mesh, &mut dyn Write, &MeshWriteOptions) -> io::Result<()>;

fn writer(name: &str, options: &MeshWriteOptions) -> Result<(&'static MeshFormat, WriteFn, MeshWriteOptions), WriteError> {
    let (bare, ascii) = registry::encoding(name);
    let format = mesh_format_named(bare);
    let options = MeshWriteOptions { ascii: ascii.or(options.ascii), ..options.clone() };
    format.and_then(|f| f.write.map(|w| (f, w, options))).ok_or_else(|| {
        let can: Vec<&str> = mesh_formats().iter().filter(|f| f.is_writable()).map(|f| f.name).collect();
        WriteError {
            code: "format-unknown",
            what: "cannot write a mesh in this format",
            file: "output".into(),
            why: match format {
                Some(f) => format!("{} is read but not written", f.title),
                None => format!("no format of meshes is called \"{}\"", crate::input::shorten(name)),
            } + &format!("; meshes are written as {}", can.join(", ")),
            hint: "choose one of these",
        }
    })
}

/// What the format has no place for.
fn report(mesh: &Mesh, format: &MeshFormat, options: &MeshWriteOptions) -> WriteReport {
    let mut warnings = Vec::new();
    if !mesh.tets.is_empty() && !format.volume {
        warnings.push(format!("{} has no tetrahedra: only the {} triangles were written", format.title, mesh.triangles.len()));
    }
    if mesh.order() == 2 && !format.second_order {
        warnings.push(format!("{} has no curved elements: the mid-edge nodes were left out", format.title));
    }
    let bits = if format.single && options.ascii != Some(true) { 32 } else { 64 };
    if bits == 32 {
        warnings.push(format!("{} holds coordinates of 32 bits: about seven digits", format.title));
    }
    WriteReport { format: format.name, warnings }
}
