//! The way out for points: formats by name.

use crate::WriteError;
use crate::atomic::write_atomic;
use crate::format::{Format, WriteFn, extension};
use crate::options::{WriteOptions, WriteReport};
use crate::registry::{format_named, formats};
use isoform_geom::PointCloud;
use std::io::Write;
use std::path::Path;

/// Writes to any sink in the format of that name or ending. Coordinates are absolute (origin
/// added).
pub fn write(
    cloud: &PointCloud,
    out: &mut dyn Write,
    format: &str,
    options: &WriteOptions,
) -> Result<WriteReport, WriteError> {
    let (format, write) = writer(format)?;
    write(cloud, out, options)
        .and_then(|()| out.flush())
        .map_err(|e| WriteError::io("cannot write the points", "output".into(), &e))?;
    Ok(report(cloud, format))
}

/// Writes a file, whole or not at all; the format by `format` or the ending of the name.
pub fn write_path(
    cloud: &PointCloud,
    path: &Path,
    format: Option<&str>,
    options: &WriteOptions,
) -> Result<WriteReport, WriteError> {
    let named = extension(&path.to_string_lossy());
    let (format, write) = writer(format.or(named.as_deref()).unwrap_or(""))?;
    write_atomic(path, |out| write(cloud, out, options))?;
    Ok(report(cloud, format))
}

/// The format of that name, if it can be written, with its writer.
fn writer(name: &str) -> Result<(&'static Format, WriteFn), WriteError> {
    let format = format_named(name);
    format.and_then(|f| f.write.map(|w| (f, w))).ok_or_else(|| {
        let can: Vec<&str> = formats()
            .iter()
            .filter(|f| f.is_writable())
            .map(|f| f.name)
            .collect();
        WriteError {
            code: "format-unknown",
            what: "cannot write points in this format",
            file: "output".into(),
            why: match format {
                Some(f) => format!("{} is read but not written", f.title),
                None => format!("no format is called \"{}\"", crate::input::shorten(name)),
            } + &format!("; points are written as {}", can.join(", ")),
            hint: "choose one of these",
        }
    })
}

/// What was written, and what the format could not hold.
fn report(cloud: &PointCloud, format: &Format) -> WriteReport {
    let mut warnings = Vec::new();
    if !cloud.triangles.is_empty() && !format.keeps_triangles {
        warnings.push(format!(
            "{} has no triangles: {} were left out",
            format.title,
            cloud.triangles.len()
        ));
    }
    WriteReport {
        format: format.name,
        warnings,
    }
}
