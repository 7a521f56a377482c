//! Reading and writing whole files, stdin, and objects in memory.

use crate::failure::Failure;
use crate::memory::{self, Object};
use isoform::io::process_id;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// Number of the next temporary file.
static TURN: AtomicU64 = AtomicU64::new(0);

/// Writes a file completely or leaves it as before: data go to a temporary file in its folder,
/// which is then renamed. Devices and pipes are written directly.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if memory::write(path, bytes) {
        return Ok(());
    }
    let failed = |e: io::Error| Failure::file(path, "write", &e);
    let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if fs::metadata(&path).is_ok_and(|m| !m.is_file()) {
        return fs::write(&path, bytes).map_err(failed);
    }
    let name = path
        .file_name()
        .ok_or_else(|| failed(io::Error::from(ErrorKind::InvalidFilename)))?;
    // Threads of one process may write one file at a time.
    let turn = TURN.fetch_add(1, Ordering::Relaxed);
    let temporary = path.with_file_name(format!(
        ".{}.{}.{turn}.tmp",
        name.to_string_lossy(),
        process_id()
    ));
    let written = fs::write(&temporary, bytes).and_then(|()| fs::rename(&temporary, &path));
    written.map_err(|e| {
        let _ = fs::remove_file(&temporary);
        failed(e)
    })
}

/// Finds out before the work whether the folder of a file exists.
pub(crate) fn check_folder(path: &Path) -> Result<(), Failure> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let folder = folder.filter(|_| memory::find(path).is_none());
    let Some(folder) = folder.filter(|f| !f.is_dir()) else {
        return Ok(());
    };
    let mut failure = Failure::input(
        "not-writable",
        format!(
            "cannot write {}: there is no folder {}",
            path.display(),
            folder.display()
        ),
    );
    failure.place.file = Some(path.to_owned());
    Err(failure.hint("make the folder first"))
}

/// Reads a file, or stdin for `-`.
pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>, Failure> {
    if path == Path::new("-") {
        let mut bytes = Vec::new();
        return match io::Read::read_to_end(&mut io::stdin().lock(), &mut bytes) {
            Ok(_) => Ok(bytes),
            Err(e) => Err(Failure::file(Path::new("stdin"), "read", &e)),
        };
    }
    match memory::find(path) {
        Some(Object::Bytes { bytes, .. }) => return Ok(Vec::clone(&bytes)),
        Some(other) => return Err(other.instead_of("a file of another kind", path)),
        None => {}
    }
    fs::read(path).map_err(|e| Failure::file(path, "read", &e))
}

/// Text as UTF-8, else as Latin-1, which old programs have in their comments.
pub(crate) fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes)
        .unwrap_or_else(|e| e.into_bytes().into_iter().map(char::from).collect())
}
