//! Reading and writing of meshes with groups.
//!
//! [`write_mesh`] and [`read_mesh`] do for a [`Mesh`] what `write` and
//! `read` do for points. Parts are groups of triangles and quadrilaterals,
//! curves are groups of edges, and regions are groups of tetrahedra. Each format stores as much of
//! them as it can, and the [`WriteReport`] lists the rest. Tags of groups count from 1 in the order
//! of the mesh's lists; 0 means no group.
//!
//! A new format is one file in `mesh/` with `write` or `read`, its `mod` here, and one line in
//! `mesh/registry.rs`.

mod bdf;
mod boundary;
mod build;
mod check;
mod chequer;
mod choose;
mod color;
mod format;
mod glb;
mod group;
mod inp;
mod msh;
mod obj;
mod off;
mod openfoam;
mod options;
mod out;
mod ply;
mod pvtu;
mod registry;
mod stl;
mod surface;
mod three_mf;
mod vtu;
mod xdmf;
mod zip;

pub(crate) use choose::by_content as mesh_by_content;
pub use format::MeshFormat;
pub use options::{MeshReadOptions, MeshWriteOptions};
pub use pvtu::write_pvtu;
pub use registry::{mesh_format_for, mesh_format_named, mesh_formats};
pub(crate) use three_mf::{unit as three_mf_unit, write_package};

use crate::format::extension;
use crate::input::Input;
use crate::{ReadError, ReadReport, Source, WriteError, WriteReport, write_atomic};
use format::{MeshWriteFn, StoredColumns};
use isoform_geom::{Mesh, Point3, cross, dot, sub};
use std::borrow::Cow;
use std::io::Write;
use std::path::Path;

/// Writes a mesh to a sink.
///
/// `format` is a name or an ending from [`mesh_formats`]; a suffix `-ascii` or `-binary`
/// (`msh-binary`, `stl-ascii`) overrides the options. The mesh is checked first: invalid labels and
/// indices are refused.
///
/// ```
/// use isoform_geom::Mesh;
/// use isoform_io::{MeshReadOptions, MeshWriteOptions, Source, read_mesh, write_mesh};
/// let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let mut mesh = Mesh::from_triangles(points, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
/// mesh.triangle_parts = vec![0, 0, 0, 1];
/// mesh.parts = vec!["walls".into(), "roof".into()];
/// let mut bytes = Vec::new();
/// write_mesh(&mesh, &mut bytes, "msh", &MeshWriteOptions::default())?;
/// let source = Source::Bytes { name: "-", bytes: &bytes };
/// let (again, _) = read_mesh(source, Some("msh"), &MeshReadOptions::default())?;
/// assert_eq!(again, mesh);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_mesh(
    mesh: &Mesh,
    out: &mut dyn Write,
    format: &str,
    options: &MeshWriteOptions,
) -> Result<WriteReport, WriteError> {
    let (format, write, options) = writer(format, options)?;
    check::check(mesh, "output")?;
    let stored = &writable(mesh, format);
    write(stored, out, &options)
        .and_then(|()| out.flush())
        .map_err(|e| WriteError::io("cannot write the mesh", "output".into(), &e))?;
    Ok(report(mesh, stored, format, &options))
}

/// Writes a file atomically (see [`write_atomic`]), or the files of a folder; the format is given by
/// `format` or by the name (see [`mesh_format_for`]).
pub fn write_mesh_path(
    mesh: &Mesh,
    path: &Path,
    format: Option<&str>,
    options: &MeshWriteOptions,
) -> Result<WriteReport, WriteError> {
    let ending = extension(&path.to_string_lossy());
    let named = mesh_format_for(path).map(|f| f.name).or(ending.as_deref());
    let (format, write, options) = writer(format.or(named).unwrap_or(""), options)?;
    check::check(mesh, &path.display().to_string())?;
    let stored = &writable(mesh, format);
    if let Some(write) = format.folder {
        write(stored, path, &options)?;
        return Ok(report(mesh, stored, format, &options));
    }
    write_atomic(path, |out| write(stored, out, &options))?;
    Ok(report(mesh, stored, format, &options))
}

fn writer(
    name: &str,
    options: &MeshWriteOptions,
) -> Result<(&'static MeshFormat, MeshWriteFn, MeshWriteOptions), WriteError> {
    let (bare, ascii) = format::encoding(name);
    let format = mesh_format_named(bare);
    let options = MeshWriteOptions {
        ascii: ascii.or(options.ascii),
        ..options.clone()
    };
    let format = format.ok_or_else(|| {
        let can: Vec<&str> = mesh_formats().iter().map(|f| f.name).collect();
        WriteError {
            code: "format-unknown",
            what: "cannot write a mesh in this format",
            file: "output".into(),
            why: format!(
                "no format of meshes is called \"{}\"; meshes are written as {}",
                crate::input::shorten(name),
                can.join(", ")
            ),
            hint: "choose one of these",
        }
    })?;
    Ok((format, format.write, options))
}

/// Returns the part of a mesh that a format can store. A surface format stores quadrilaterals as
/// triangles, and omits walls between regions, which would end inside the surface.
fn writable<'m>(mesh: &'m Mesh, format: &MeshFormat) -> Cow<'m, Mesh> {
    if format.volume {
        return match format.wedges {
            true => Cow::Borrowed(mesh),
            false => mesh.simplices(),
        };
    }
    match mesh.simplices() {
        Cow::Borrowed(mesh) => mesh.without_walls(),
        Cow::Owned(mesh) => Cow::Owned(mesh.without_walls().into_owned()),
    }
}

/// Counts the triangles that lose their area or their orientation when coordinates are rounded to
/// 32 bits.
fn lost_triangles(mesh: &Mesh) -> usize {
    let rounded = |p: Point3| p.map(|v| f64::from(v as f32));
    let normal = |[a, b, c]: [Point3; 3]| cross(sub(b, a), sub(c, a));
    let is_lost = |t: &&[u32; 3]| {
        let corners = t.map(|v| mesh.points[v as usize]);
        let (before, after) = (normal(corners), normal(corners.map(rounded)));
        dot(before, before) > 0.0 && (dot(before, after) <= 0.0)
    };
    mesh.triangles.iter().filter(is_lost).count()
}

/// Lists what the format cannot store of a mesh, of which `stored` was written.
fn report(
    mesh: &Mesh,
    stored: &Mesh,
    format: &MeshFormat,
    options: &MeshWriteOptions,
) -> WriteReport {
    let mut warnings = Vec::new();
    if !mesh.tets.is_empty() && !format.volume {
        warnings.push(format!(
            "{} has no volume elements: only the {} triangles were written",
            format.title,
            stored.triangles.len()
        ));
    }
    if !mesh.wedges.is_empty() && format.volume && !format.wedges {
        warnings.push(format!(
            "{} has no wedges here: each was written as three tetrahedra",
            format.title
        ));
    }
    if mesh.order() == 2 && !format.second_order {
        warnings.push(format!(
            "{} has no curved elements: the mid-edge nodes were left out",
            format.title
        ));
    }
    let bits = if format.single && options.ascii != Some(true) {
        32
    } else {
        64
    };
    if bits == 32 {
        warnings.push(format!(
            "{} holds coordinates of 32 bits: about seven digits",
            format.title
        ));
        let lost = lost_triangles(stored);
        if lost > 0 {
            warnings.push(format!(
                "{lost} of {} triangles collapse or turn over, since the mesh is far from the \
                 origin for their size: formats of 64 bits keep them",
                stored.triangles.len()
            ));
        }
    }
    let left_out =
        mesh.columns
            .iter()
            .map(|c| c.name.as_str())
            .filter(|name| match format.columns {
                StoredColumns::None => true,
                StoredColumns::Texture => mesh.parameters().is_none() || !["u", "v"].contains(name),
                StoredColumns::All => false,
            });
    let left_out: Vec<&str> = left_out.collect();
    if !left_out.is_empty() {
        warnings.push(format!(
            "{} has no place for the nodes' {}: left out",
            format.title,
            left_out.join(", ")
        ));
    }
    WriteReport {
        format: format.name,
        warnings,
    }
}

/// Reads a mesh.
///
/// `format` is a name or an ending from [`mesh_formats`] and overrides recognition by content and
/// name. Polygons become fans of triangles, except quadrilaterals of a mesh with wedges. Wedges of
/// several regions become tetrahedra. Groups keep their names if the format stores them.
/// Coordinates are those of the file, without recentring.
pub fn read_mesh(
    source: Source<'_>,
    format: Option<&str>,
    options: &MeshReadOptions,
) -> Result<(Mesh, ReadReport), ReadError> {
    let mut input = Input::open(source)?;
    let mut warnings = Vec::new();
    let (format, read) = choose::choose(&mut input, format, &mut warnings)?;
    let mut report = ReadReport::new(format.name, input.name.clone());
    report.warnings = warnings;
    let mut mesh = read(&mut input, &mut report)?;
    let has_surface = !mesh.triangles.is_empty() || !mesh.quads.is_empty();
    let has_volume = !mesh.tets.is_empty() || !mesh.wedges.is_empty();
    if options.boundary && has_volume && !has_surface {
        boundary::add_boundary(&mut mesh);
    }
    report.rows = mesh.points.len() as u64 + report.dropped_points;
    if mesh.points.is_empty() {
        report.warn("there are no points in the file");
    }
    Ok((mesh, report))
}
