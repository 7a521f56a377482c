//! Atomic replacement of files.
//!
//! A writer works on a temporary file next to the target, which is then renamed to the target.
//! POSIX renames are atomic: a reader opens the old file or the new one, never a part of one, and a
//! crash leaves at most a hidden file behind.

use crate::WriteError;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Writes a file through a temporary one next to it and a rename: readers see the old file or the
/// complete new one, and an error leaves the old one unchanged. A target that is not a regular file
/// (a pipe, `/dev/stdout`) is written directly.
pub fn write_atomic(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), WriteError> {
    let fail = |what, e: &io::Error| WriteError::io(what, path.display().to_string(), e);
    let cannot_write = |e: io::Error| fail("cannot write the file", &e);
    // A symbolic link is kept; the file it points to is replaced.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let old = fs::metadata(&target).ok();
    if let Some(old) = &old {
        if old.is_dir() {
            return Err(cannot_write(io::ErrorKind::IsADirectory.into()));
        }
        if !old.is_file() {
            let file = fs::OpenOptions::new()
                .write(true)
                .open(&target)
                .map_err(|e| fail("cannot open the file for writing", &e))?;
            let mut out = BufWriter::new(file);
            return write(&mut out)
                .and_then(|()| out.flush())
                .map_err(cannot_write);
        }
    }
    // Files of WebAssembly have no permissions, and would all look protected.
    let permissions = old.filter(|_| !cfg!(target_family = "wasm"));
    let permissions = permissions.map(|old| old.permissions());
    if let Some(permissions) = &permissions {
        // A rename would replace a file that its owner has protected.
        if permissions.readonly() {
            let kind = io::ErrorKind::PermissionDenied;
            return Err(cannot_write(io::Error::new(
                kind,
                "the file is write-protected",
            )));
        }
    }
    let (file, temporary) =
        create_temporary(&target).map_err(|e| fail("cannot make a file in the folder", &e))?;
    write_whole(file, permissions, write)
        .and_then(|()| fs::rename(&temporary, &target))
        .map_err(|e| {
            // The first error is reported; a temporary file that cannot be removed does no further
            // harm.
            let _ = fs::remove_file(&temporary);
            cannot_write(e)
        })
}

/// Writes a new file, gives it the permissions of the file it will replace, and syncs it to disk.
fn write_whole(
    file: File,
    permissions: Option<fs::Permissions>,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 18, file);
    write(&mut out)?;
    out.flush()?;
    if let Some(permissions) = permissions {
        out.get_ref().set_permissions(permissions)?;
    }
    out.get_ref().sync_all()
}

/// Returns the number of this process, 0 for WebAssembly, which has none.
pub fn process_id() -> u32 {
    match cfg!(target_family = "wasm") {
        true => 0,
        false => std::process::id(),
    }
}

/// Creates a hidden file in the folder of the target. Its name contains the process and a counter,
/// so that it is unique among processes and threads.
fn create_temporary(target: &Path) -> io::Result<(File, PathBuf)> {
    /// Number of temporary files that this process has named so far.
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let name = target
        .file_name()
        .ok_or_else(|| io::Error::from(io::ErrorKind::IsADirectory))?;
    loop {
        let mut hidden = std::ffi::OsString::from(".");
        hidden.push(name);
        hidden.push(format!(
            ".{}-{}.tmp",
            process_id(),
            NUMBER.fetch_add(1, Ordering::Relaxed)
        ));
        let path = target.with_file_name(hidden);
        match File::create_new(&path) {
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
            made => return made.map(|file| (file, path)),
        }
    }
}
