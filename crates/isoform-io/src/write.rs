//! Writing of points in any format.

use crate::WriteError;
use crate::atomic::write_atomic;
use crate::format::{Format, WriteFn, extension};
use crate::options::{WriteOptions, WriteReport};
use crate::registry::{format_named, formats};
use isoform_geom::PointCloud;
use std::io::Write;
use std::path::Path;

/// Writes to a sink in the format of this name or ending. Coordinates are absolute (origin added).
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

/// Writes a file atomically; the format is given by `format` or by the ending of the name.
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

/// Returns the format of this name with its writer; an error if it is not writable.
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

/// Returns the report of writing, with warnings for data that the format cannot store.
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
