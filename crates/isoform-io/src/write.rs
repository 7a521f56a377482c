//! The way out: formats by name, files that are whole or untouched.

use crate::registry::{extension, format_named, formats};
use crate::roles::role_named;
use crate::{WriteError, registry};
use isoform_geom::PointCloud;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// How to write.
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// PLY as text instead of binary.
    pub ascii: bool,
    /// Unit of length to state in the file, where the format can.
    pub units: Option<String>,
}

/// What did not go into the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WriteReport {
    /// Name of the format.
    pub format: &'static str,
    /// One sentence each.
    pub warnings: Vec<String>,
}

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

fn writer(name: &str) -> Result<(&'static registry::Format, registry::WriteFn), WriteError> {
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

fn report(cloud: &PointCloud, format: &registry::Format) -> WriteReport {
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

/// Writes a file through a temporary one beside it and a rename: whoever looks sees the old file or
/// the whole new one, and an error leaves the old one. What is no regular file (a pipe,
/// `/dev/stdout`) is written directly.
pub fn write_atomic(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), WriteError> {
    let fail = |what, e: &io::Error| WriteError::io(what, path.display().to_string(), e);
    // Through a link, the file it points to is replaced, not the link.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let old = fs::metadata(&target).ok();
    if old.as_ref().is_some_and(|m| m.is_dir()) {
        return Err(fail(
            "cannot write the file",
            &io::Error::from(io::ErrorKind::IsADirectory),
        ));
    }
    if old.as_ref().is_some_and(|m| !m.is_file()) {
        let file = fs::OpenOptions::new()
            .write(true)
            .open(&target)
            .map_err(|e| fail("cannot open the file for writing", &e))?;
        let mut out = BufWriter::new(file);
        return write(&mut out)
            .and_then(|()| out.flush())
            .map_err(|e| fail("cannot write the file", &e));
    }
    // A rename would replace a file that its owner has protected.
    if old.as_ref().is_some_and(|m| m.permissions().readonly()) {
        return Err(fail(
            "cannot write the file",
            &io::Error::new(
                io::ErrorKind::PermissionDenied,
                "the file is write-protected",
            ),
        ));
    }
    let (file, temporary) =
        temporary_beside(&target).map_err(|e| fail("cannot make a file in the folder", &e))?;
    let mut out = BufWriter::with_capacity(1 << 18, file);
    let done = write(&mut out)
        .and_then(|()| out.flush())
        .and_then(|()| match &old {
            Some(m) => out.get_ref().set_permissions(m.permissions()),
            None => Ok(()),
        })
        .and_then(|()| out.get_ref().sync_all())
        .and_then(|()| fs::rename(&temporary, &target));
    done.map_err(|e| {
        // The first error is the one to tell; a temporary file that cannot be removed is litter at
        // worst.
        let _ = fs::remove_file(&temporary);
        fail("cannot write the file", &e)
    })
}

fn temporary_beside(target: &Path) -> io::Result<(File, PathBuf)> {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let name = target
        .file_name()
        .ok_or_else(|| io::Error::from(io::ErrorKind::IsADirectory))?;
    loop {
        let mut hidden = std::ffi::OsString::from(".");
        hidden.push(name);
        hidden.push(format!(
            ".{}-{}.tmp",
            std::process::id(),
            NUMBER.fetch_add(1, Ordering::Relaxed)
        ));
        let path = target.with_file_name(hidden);
        match File::create_new(&path) {
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
            made => return made.map(|file| (file, path)),
        }
    }
}

/// Names of all values of a row, such that reading gives the same roles again.
pub(crate) struct Names {
    pub(crate) positions: [&'static str; 3],
    pub(crate) normals: Vec<&'static str>,
    pub(crate) colors: Vec<&'static str>,
    pub(crate) columns: Vec<String>,
}

impl Names {
    pub(crate) fn all(&self) -> Vec<&str> {
        let columns = self.columns.iter().map(String::as_str);
        self.positions
            .iter()
            .chain(&self.normals)
            .chain(&self.colors)
            .copied()
            .chain(columns)
            .collect()
    }
}

/// Names for a header: blanks and separators become `_`; a name that is taken, or would be read as
/// something else, gets a `_` behind it.
pub(crate) fn column_names(cloud: &PointCloud) -> Names {
    let mut columns: Vec<String> = Vec::new();
    for column in &cloud.columns {
        let plain = |c: char| {
            if c.is_alphanumeric() || "-+.:()[]%^*".contains(c) {
                c
            } else {
                '_'
            }
        };
        let mut name: String = column.name.chars().map(plain).collect();
        if name.is_empty() || crate::input::parse_number(&name).is_some() {
            name.insert(0, '_');
        }
        while role_named(&name).is_some() || columns.contains(&name) {
            name.push('_');
        }
        columns.push(name);
    }
    Names {
        positions: ["x", "y", "z"],
        normals: if cloud.normals.is_empty() {
            vec![]
        } else {
            vec!["nx", "ny", "nz"]
        },
        colors: if cloud.colors.is_empty() {
            vec![]
        } else {
            vec!["red", "green", "blue"]
        },
        columns,
    }
}

/// One line of text: shortest numbers that read back as the same f64.
pub(crate) fn row(
    out: &mut dyn Write,
    separator: u8,
    numbers: impl Iterator<Item = f64>,
    color: impl Iterator<Item = u8>,
    extra: impl Iterator<Item = f64>,
    line: &mut Vec<u8>,
) -> io::Result<()> {
    line.clear();
    let number = |line: &mut Vec<u8>, v: f64| {
        if !line.is_empty() {
            line.push(separator);
        }
        // Plain digits where they are short, an exponent otherwise; both are the shortest that read
        // back the same.
        let plain = v == 0.0 || !v.is_finite() || (1e-5..1e16).contains(&v.abs());
        if plain {
            write!(line, "{v}")
        } else {
            write!(line, "{v:e}")
        }
    };
    for v in numbers {
        number(line, v)?;
    }
    for v in color {
        number(line, f64::from(v))?;
    }
    for v in extra {
        number(line, v)?;
    }
    line.push(b'\n');
    out.write_all(line)
}
