//! Reading points and meshes.

use crate::context::Context;
use crate::disk;
use crate::failure::Failure;
use crate::kind::{self, Kind};
use crate::memory::{self, Object};
use isoform::geom::{Mesh, PointCloud};
use isoform::io::{
    At, BAD_MESH, FileKind, MeshPoints, MeshReadOptions, ReadError, ReadOptions, ReadReport,
    Source, WriteError, WriteOptions, format_named, mesh_format_for, mesh_format_named, read,
    read_mesh, write,
};
use isoform::surface_of;
use std::path::Path;

/// Reads a file of points, or stdin for `-`.
pub(crate) fn read_points(
    path: &Path,
    format: Option<&str>,
    max_points: Option<usize>,
    mesh: MeshPoints,
    context: &Context,
) -> Result<(PointCloud, ReadReport), Failure> {
    let held = match memory::find(path) {
        Some(Object::Points(cloud, report)) => Some((PointCloud::clone(&cloud), (*report).clone())),
        Some(Object::Mesh(mesh, units)) => {
            let cloud = surface_of(&mesh);
            let mut report = ReadReport::of_memory("mesh", cloud.points.len());
            report.units = units;
            Some((cloud, report))
        }
        Some(Object::Bytes { .. }) | None => None,
        Some(other) => return Err(other.instead_of(POINTS, path)),
    };
    if let Some((cloud, report)) = held {
        return from_memory(path, (cloud, report), format, max_points, mesh, context);
    }
    let options = ReadOptions {
        max_points,
        seed: context.global.seed,
        mesh,
        ..ReadOptions::default()
    };
    if path == Path::new("-") {
        let bytes = disk::read_file(path)?;
        return read(
            Source::Bytes {
                name: "-",
                bytes: &bytes,
            },
            format,
            &options,
        )
        .map_err(|e| other(path, &bytes, POINTS).unwrap_or_else(|| unreadable(path, &e)));
    }
    read(Source::Path(path), format, &options).map_err(|e| {
        let other = other_file(path, format, POINTS);
        other.unwrap_or_else(|| unreadable(path, &e))
    })
}

/// Points in memory, of which a sample may be wanted: drawn as from a file.
fn from_memory(
    path: &Path,
    held: (PointCloud, ReadReport),
    format: Option<&str>,
    max_points: Option<usize>,
    mesh: MeshPoints,
    context: &Context,
) -> Result<(PointCloud, ReadReport), Failure> {
    if format.is_some() {
        return Err(Failure::usage("points in memory have no format"));
    }
    let is_small = max_points.is_none_or(|most| held.0.points.len() <= most);
    if is_small && mesh == MeshPoints::Vertices {
        return Ok(held);
    }
    let mut bytes = Vec::new();
    write(&held.0, &mut bytes, "ply", &WriteOptions::default()).map_err(|e| unwritable(&e))?;
    let options = ReadOptions {
        max_points,
        seed: context.global.seed,
        mesh,
        ..ReadOptions::default()
    };
    let source = Source::Bytes {
        name: "memory",
        bytes: &bytes,
    };
    let (cloud, report) = read(source, Some("ply"), &options).map_err(|e| unreadable(path, &e))?;
    let format = held.1.format;
    Ok((cloud, ReadReport { format, ..report }))
}

/// Name of the input of verbs that read points, and meshes.
const POINTS: &str = "points";
const MESH: &str = "a mesh";
/// Larger files are not read whole to find out what they are: programs and documents are small.
const SMALL: u64 = 64 << 20;

/// The failure of a file in whose place points or a mesh are wanted, if it is known to be something
/// else, and none that a reader of theirs could take.
fn other(path: &Path, bytes: &[u8], wanted: &'static str) -> Option<Failure> {
    let head = kind::head(bytes).to_vec();
    let kind = Kind::detect(path, &head, &disk::text(bytes.to_vec()))?;
    let is_wanted = match kind {
        Kind::File(FileKind::Points(f)) => wanted == POINTS || mesh_format_named(f.name).is_some(),
        Kind::File(FileKind::Mesh(_)) => wanted == MESH,
        // Its own reader says more.
        Kind::File(FileKind::Foreign(_)) => true,
        _ => false,
    };
    (!is_wanted).then(|| kind.instead_of(wanted, path))
}

/// Makes the failure of a file of another kind whose format was not given.
fn other_file(path: &Path, format: Option<&str>, wanted: &'static str) -> Option<Failure> {
    let about = std::fs::metadata(path).ok()?;
    if format.is_some() || !about.is_file() || about.len() > SMALL {
        return None;
    }
    other(path, &std::fs::read(path).ok()?, wanted)
}

/// Reads all points of a file, of meshes the vertices; what is odd about it is said.
pub(crate) fn read_vertices(
    path: &Path,
    format: Option<&str>,
    context: &Context,
) -> Result<PointCloud, Failure> {
    let (cloud, report) = read_points(path, format, None, MeshPoints::Vertices, context)?;
    for warning in &report.warnings {
        context.warn(format_args!("{}: {warning}", path.display()));
    }
    Ok(cloud)
}

/// Returns true if it is a format of meshes alone, by what was said or by the ending: msh, vtu, inp
/// and so on.
pub(crate) fn is_mesh(path: &Path, said: Option<&str>) -> bool {
    let format = match said {
        Some(name) => mesh_format_named(name),
        None => mesh_format_for(path),
    };
    format.is_some_and(|format| format_named(said.unwrap_or(format.name)).is_none())
}

/// Reads a mesh with its groups, or stdin for `-`.
pub(crate) fn read_mesh_file(
    path: &Path,
    format: Option<&str>,
) -> Result<(Mesh, ReadReport), Failure> {
    if let Some(Object::Mesh(mesh, units)) = memory::find(path) {
        let mut report = ReadReport::of_memory("mesh", mesh.points.len());
        report.units = units;
        return Ok((Mesh::clone(&mesh), report));
    }
    if let Some(other) = memory::find(path) {
        return Err(other.instead_of(MESH, path));
    }
    let options = MeshReadOptions::default();
    if path == Path::new("-") {
        let bytes = disk::read_file(path)?;
        return read_mesh(
            Source::Bytes {
                name: "-",
                bytes: &bytes,
            },
            format,
            &options,
        )
        .map_err(|e| other(path, &bytes, MESH).unwrap_or_else(|| unreadable(path, &e)));
    }
    read_mesh(Source::Path(path), format, &options).map_err(|e| {
        let other = other_file(path, format, MESH);
        other.unwrap_or_else(|| unreadable(path, &e))
    })
}

/// Why a file could not be read, in our four parts.
pub(crate) fn unreadable(path: &Path, error: &ReadError) -> Failure {
    let at = match error.place.at {
        At::Byte(offset) => format!(", byte {offset}"),
        _ => String::new(),
    };
    let mut failure = Failure::input(
        error.code(),
        format!("{}{at}: {}", path.display(), error.what),
    );
    if let At::Line { line, column } = error.place.at {
        failure = Failure::input(error.code(), error.what).at(
            path,
            line as usize,
            (column as usize).max(1),
        );
    }
    failure.place.file = Some(path.to_owned());
    failure.why(&error.why).hint(error.hint)
}

/// Returns true if points are written to files of this name.
pub(crate) fn is_points(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    format_named(&ending).is_some_and(|f| f.is_writable())
}

/// Returns the bytes of points, in the format of the file's ending.
pub(crate) fn points_file(path: &Path, cloud: &PointCloud) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    write(cloud, &mut bytes, &ending, &WriteOptions::default()).map_err(|e| unwritable(&e))?;
    Ok(bytes)
}

/// Why a file could not be written.
pub(crate) fn unwritable(error: &WriteError) -> Failure {
    let mut failure = Failure::input(error.code, format!("{}: {}", error.file, error.what));
    failure.place.file = Some(error.file.clone().into());
    failure.why(&error.why).hint(error.hint)
}

/// Why a mesh of our own making could not be written: what is wrong with it is our fault.
pub(crate) fn unwritable_mesh(error: &WriteError) -> Failure {
    if error.code == BAD_MESH {
        return Failure::internal("mesh").why(&error.why);
    }
    unwritable(error)
}
