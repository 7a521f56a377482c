//! The folder of a project: its files, and its state as the page writes it.

use crate::context::Context;
use crate::disk;
use crate::failure::{Failure, NO_RESULT};
use crate::scan::unwritable;
use isoform::io::write_atomic;
use serde_json::{Value, json};
use std::fs;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use tokio::sync::watch;

/// The folder that holds projects without --project.
const ALL: &str = "isoform-studio";
/// Name of a project without files.
const UNNAMED: &str = "project";
/// The file of the state.
const STATE: &str = "project.json";
/// The file that is locked.
const LOCK: &str = ".lock";
/// Most letters of the name of a file; with the marks of temporary files it stays below the limit of
/// usual file systems, 255 bytes.
const MOST_LETTERS: usize = 120;
/// Bytes that are compared or copied at a time.
const CHUNK: usize = 1 << 16;

/// State of the page, and the number of its changes.
struct State {
    version: u64,
    /// Document of the page; null in a new project.
    document: Value,
    /// Files of the command line that the page is to open.
    opened: Vec<String>,
}

/// A folder with files and a state.
pub(super) struct Project {
    /// Locked as long as the project is open.
    _lock: fs::File,
    folder: PathBuf,
    state: Mutex<State>,
    /// The version of the state, for windows that follow it.
    news: watch::Sender<u64>,
}

/// True if a text may be the name of a file of the project.
pub(super) fn is_name(name: &str) -> bool {
    let is_plain = |c: char| !c.is_control() && !"/\\:*?\"<>|".contains(c);
    let is_own = name.eq_ignore_ascii_case(STATE);
    !name.is_empty()
        && name.chars().count() <= MOST_LETTERS
        && name.chars().all(is_plain)
        && !name.starts_with('.')
        && !name.ends_with(['.', ' '])
        && !is_own
}

/// True if a path stays in the working directory.
pub(super) fn is_inside(path: &Path) -> bool {
    let parts = path.components();
    path != Path::new("-")
        && path != Path::new(STATE)
        && parts
            .into_iter()
            .all(|part| matches!(part, Component::Normal(_)))
}

/// True if a path of the working directory leads to a file or a folder there, or to nothing yet:
/// links may lead out of the project, and devices have no end.
pub(super) fn is_plain(path: &Path) -> bool {
    let ways = path.ancestors().filter(|way| !way.as_os_str().is_empty());
    ways.flat_map(fs::symlink_metadata)
        .all(|about| about.is_file() || about.is_dir())
}

impl Project {
    /// Opens or makes the folder, copies files into it, and makes it the working directory.
    pub(super) fn open(
        files: &[PathBuf],
        folder: Option<&Path>,
        context: &Context,
    ) -> Result<Self, Failure> {
        let folder = folder.map_or_else(
            || {
                let stem = files.first().and_then(|file| file.file_stem());
                Path::new(ALL).join(stem.unwrap_or(UNNAMED.as_ref()))
            },
            Path::to_owned,
        );
        if let Some(file) = files.iter().find(|file| !file.is_file()) {
            let message = format!("{}: there is no such file", file.display());
            return Err(Failure::input("file", message));
        }
        let failed = |e: &io::Error| {
            Failure::file(&folder, "make", e).hint("--project with a folder that can be written to")
        };
        fs::create_dir_all(&folder).map_err(|e| failed(&e))?;
        let lock = locked(&folder)?;
        let opened: Result<Vec<String>, Failure> =
            files.iter().map(|file| copied(file, &folder)).collect();
        let document = stored(&folder, context)?;
        std::env::set_current_dir(&folder).map_err(|e| failed(&e))?;
        let folder = fs::canonicalize(".").map_err(|e| failed(&e))?;
        let state = State {
            version: 1,
            document,
            opened: opened?,
        };
        Ok(Self {
            _lock: lock,
            folder,
            state: Mutex::new(state),
            news: watch::channel(1).0,
        })
    }

    /// The folder.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Returns the state: its version, the document of the page, and files to be taken up.
    pub(super) fn state(&self) -> Value {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let name = self.folder.file_name().unwrap_or_default();
        json!({
            "version": state.version,
            "name": name.to_string_lossy(),
            "document": state.document,
            "opened": state.opened,
        })
    }

    /// Stores the state of a page that knew the version `base`; returns the new version, or `None`
    /// if another window was quicker.
    pub(super) fn store(&self, base: u64, document: Value) -> Result<Option<u64>, Failure> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if state.version != base {
            return Ok(None);
        }
        disk::write_file(Path::new(STATE), document.to_string().as_bytes())?;
        state.version += 1;
        state.document = document;
        state.opened.clear();
        self.news.send_replace(state.version);
        Ok(Some(state.version))
    }

    /// Returns the versions as they come.
    pub(super) fn news(&self) -> watch::Receiver<u64> {
        self.news.subscribe()
    }

    /// Returns the names and sizes of all files.
    pub(super) fn files(&self) -> Value {
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let mut files: Vec<(String, u64)> = entries
            .filter_map(|entry| {
                let about = entry.metadata().ok().filter(fs::Metadata::is_file)?;
                let name = entry.file_name().into_string().ok()?;
                is_name(&name).then_some((name, about.len()))
            })
            .collect();
        files.sort();
        let files = files.into_iter();
        files
            .map(|(name, size)| json!({"name": name, "size": size}))
            .collect()
    }
}

/// Locks a folder; fails if another program has it open, whose state would be overwritten.
fn locked(folder: &Path) -> Result<fs::File, Failure> {
    let path = folder.join(LOCK);
    let lock = fs::File::create(&path).map_err(|e| Failure::file(&path, "make", &e))?;
    match lock.try_lock() {
        Err(fs::TryLockError::WouldBlock) => {
            let message = format!("{}: another isoform studio has it open", folder.display());
            Err(Failure::new(NO_RESULT, "locked", message).hint("--project with another folder"))
        }
        // A file system without locks.
        Err(fs::TryLockError::Error(_)) | Ok(()) => Ok(lock),
    }
}

/// Reads the state of a folder; null where there is none. A damaged one is kept under another name.
fn stored(folder: &Path, context: &Context) -> Result<Value, Failure> {
    let path = folder.join(STATE);
    let bytes = match fs::read(&path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Value::Null),
        Err(e) => return Err(Failure::file(&path, "read", &e)),
        Ok(bytes) => bytes,
    };
    if let Ok(document @ Value::Object(_)) = serde_json::from_slice(&bytes) {
        return Ok(document);
    }
    let kept = folder.join("project.damaged.json");
    context.warn(format_args!(
        "{} is damaged, and kept as {}: the project begins anew, with its files",
        path.display(),
        kept.display()
    ));
    fs::rename(&path, &kept).map_err(|e| Failure::file(&path, "rename", &e))?;
    Ok(Value::Null)
}

/// Copies a file into a folder; returns its name there, which has a number if another file has it.
fn copied(file: &Path, folder: &Path) -> Result<String, Failure> {
    let failed = |e: &io::Error| Failure::file(file, "copy", e);
    let given = file.file_name().unwrap_or_default().to_string_lossy();
    let plain = |c: char| {
        let kept = is_name(&format!("_{c}_"));
        if kept { c } else { '_' }
    };
    let clean: String = given.chars().map(plain).collect();
    let clean = clean.trim_start_matches('.').trim_end_matches(['.', ' ']);
    // The ending, which tells the format, is kept.
    let skipped = clean.chars().count().saturating_sub(MOST_LETTERS - 4);
    let clean: String = clean.chars().skip(skipped).collect();
    for k in 1..1000 {
        let name = match (k, clean.rsplit_once('.')) {
            (1, _) => clean.clone(),
            (_, Some((stem, ending))) => format!("{stem}-{k}.{ending}"),
            (_, None) => format!("{clean}-{k}"),
        };
        if !is_name(&name) {
            continue;
        }
        let target = folder.join(&name);
        if !target.exists() {
            let mut bytes = fs::File::open(file).map_err(|e| failed(&e))?;
            write_atomic(&target, |out| io::copy(&mut bytes, out).map(drop))
                .map_err(|e| unwritable(&e))?;
            return Ok(name);
        }
        if are_equal(file, &target).map_err(|e| failed(&e))? {
            return Ok(name);
        }
    }
    let message = format!("{}: its name cannot be used in a project", file.display());
    Err(Failure::input("file", message))
}

/// True if two files have equal bytes.
fn are_equal(a: &Path, b: &Path) -> io::Result<bool> {
    if fs::metadata(a)?.len() != fs::metadata(b)?.len() {
        return Ok(false);
    }
    let [mut a, mut b] = [fs::File::open(a)?, fs::File::open(b)?].map(io::BufReader::new);
    let (mut left, mut right) = (vec![0; CHUNK], vec![0; CHUNK]);
    loop {
        let n = a.read(&mut left)?;
        if n == 0 {
            return Ok(true);
        }
        b.read_exact(&mut right[..n])?;
        if left[..n] != right[..n] {
            return Ok(false);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_in_the_folder() {
        for good in ["a.ply", "Größe 3.hf", "-x.stl", "a..b"] {
            assert!(is_name(good), "{good}");
        }
        for bad in [
            "",
            ".",
            "..",
            ".a",
            "a/b",
            "a\\b",
            "/a",
            "C:a",
            "a\nb",
            "a.",
            "a ",
            "project.json",
            "PROJECT.JSON",
            "a\0",
        ] {
            assert!(!is_name(bad), "{bad:?}");
        }
        assert!(!is_name(&"a".repeat(121)));
        for inside in ["a.ply", "x/y = 1", "x^2 + y^2 = 1"] {
            assert!(is_inside(Path::new(inside)), "{inside}");
        }
        for outside in [
            "../a",
            "/etc/passwd",
            "a/../../b",
            "-",
            "project.json",
            "..",
        ] {
            assert!(!is_inside(Path::new(outside)), "{outside}");
        }
    }
}
