//! Reading points.

use crate::output::{self, Context, Failure};
use isoform::geom::PointCloud;
use isoform::io::{At, MeshPoints, ReadError, ReadOptions, ReadReport, Source, WriteError, read};
use std::path::Path;

/// Reads a file of points, or stdin for `-`.
pub(crate) fn read_points(
    path: &Path,
    format: Option<&str>,
    max_points: Option<usize>,
    mesh: MeshPoints,
    context: &Context,
) -> Result<(PointCloud, ReadReport), Failure> {
    let options = ReadOptions { max_points, seed: context.global.seed, mesh, ..ReadOptions::default() };
    if path == Path::new("-") {
        let bytes = output::read_file(path)?;
        return read(Source::Bytes { name: "-", bytes: &bytes }, format, &options).map_err(|e| unreadable(path, &e));
    }
    read(Source::Path(path), format, &options).map_err(|e| unreadable(path, &e))
}

/// Why a file could not be read, in our four parts.
pub(crate) fn unreadable(path: &Path, error: &ReadError) -> Failure {
    let at = match error.place.at {
        At::Byte(offset) => format!(", byte {offset}"),
        _ => String::new(),
    };
    let mut failure = Failure::input(error.code(), format!("{}{at}: {}", path.display(), error.what));
    if let At::Line { line, column } = error.place.at {
        failure = Failure::input(error.code(), error.what).at(path, line as usize, (column as usize).max(1));
    }
    failure.place.file = Some(path.to_owned());
    failure.why(&error.why).hint(error.hint)
}

/// Why a file could not be written.
pub(crate) fn unwritable(error: &WriteError) -> Failure {
    let mut failure = Failure::input(error.code, format!("{}: {}", error.file, error.what));
    failure.place.file = Some(error.file.clone().into());
    failure.why(&error.why).hint(error.hint)
}
