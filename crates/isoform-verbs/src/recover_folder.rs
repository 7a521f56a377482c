//! The folder of the results of `recover`: one for each scan, without files of earlier runs.

use crate::context::Context;
use crate::disk;
use crate::failure::Failure;
use crate::memory;
use std::fs::{self, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf, absolute, is_separator};

/// The folder that holds those of the scans, without -o.
const ALL: &str = "isoform-recover";
/// Results of the fit.
pub(crate) const RESULTS: [&str; 3] = ["fitted.hf", "deviation.ply", "report.html"];
/// The solid.
pub(crate) const SOLID: &str = "part.step";
/// The file that says which scan the results are of, and the beginning of its line.
const SCAN: &str = "scan.txt";
const OF: &str = "Results of isoform recover for ";
/// Most folders for scans of one name.
const MAX_FOLDERS: usize = 10_000;

/// True if a name is that of a folder: it ends like one, or there is one.
pub(crate) fn is_folder(path: &Path) -> bool {
    path.to_string_lossy().ends_with(is_separator) || path.is_dir()
}

/// The content of [`SCAN`]: the absolute path of the scan.
fn source(scan: Option<&Path>) -> String {
    match scan {
        None => "the scan that is built in".to_owned(),
        Some(path) if path == Path::new("-") => "-".to_owned(),
        Some(path) => {
            let full = fs::canonicalize(path).or_else(|_| absolute(path));
            memory::name(full.as_deref().unwrap_or(path))
        }
    }
}

/// Returns the scan whose results a folder holds; `None` for folders that `recover` did not write.
fn owner(folder: &Path) -> Option<String> {
    let text = fs::read_to_string(folder.join(SCAN)).ok()?;
    Some(text.lines().next()?.strip_prefix(OF)?.to_owned())
}

/// Writes down whose results a folder holds, unless it is said already.
fn claim(folder: &Path, source: &str) -> std::io::Result<()> {
    fs::create_dir_all(folder)?;
    let mut file = OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(folder.join(SCAN))?;
    writeln!(file, "{OF}{source}")
}

/// The folder of a scan, which is made where there is none: named like the scan, with a number
/// behind the name where that is the folder of another scan, or holds other files.
pub(crate) fn of_scan(
    name: &Path,
    scan: Option<&Path>,
    context: &Context,
) -> Result<PathBuf, Failure> {
    let source = source(scan);
    let stem = name.file_stem().unwrap_or_default().to_string_lossy();
    let stem = if stem == "-" { "stdin" } else { &stem };
    for k in 1..MAX_FOLDERS {
        let name = if k == 1 {
            stem.to_owned()
        } else {
            format!("{stem}-{k}")
        };
        let folder = Path::new(ALL).join(name);
        if owner(&folder).is_some_and(|owner| owner == source) {
            return Ok(folder);
        }
        let is_free = match fs::read_dir(&folder) {
            Ok(mut files) => files.next().is_none(),
            Err(e) => e.kind() == ErrorKind::NotFound,
        };
        if !is_free {
            continue;
        }
        match claim(&folder, &source) {
            // Another run was quicker.
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
            Err(e) => {
                let failure = Failure::file(&folder, "make", &e);
                return Err(failure.hint("-o with files elsewhere"));
            }
            Ok(()) => {
                if k > 1 {
                    context.warn(format_args!(
                        "{} holds results of another scan, or other files: those of this one go to \
                         {}",
                        Path::new(ALL).join(stem).display(),
                        folder.display()
                    ));
                }
                return Ok(folder);
            }
        }
    }
    Err(Failure::usage(format!("{ALL} has no more names for {stem}")).hint("-o FOLDER/"))
}

/// Begins a run in a folder: makes it, and removes what an earlier run wrote there. Files of the
/// same names in a folder that is not ours are left, until they are written over.
pub(crate) fn begin(folder: &Path, scan: Option<&Path>, context: &Context) -> Result<(), Failure> {
    let source = source(scan);
    let files = || RESULTS.iter().chain([&SOLID]).map(|f| folder.join(f));
    files().try_for_each(|f| context.inputs.allow(&f))?;
    let failed = |e: &std::io::Error| {
        Failure::file(folder, "write to", e).hint("-o with a folder that can be written to")
    };
    match owner(folder) {
        None => match claim(folder, &source) {
            Err(e) if e.kind() != ErrorKind::AlreadyExists => Err(failed(&e)),
            _ => Ok(()),
        },
        Some(owner) => {
            if owner != source {
                context.warn(format_args!(
                    "{}: the results of {owner} are replaced",
                    folder.display()
                ));
            }
            for file in files() {
                match fs::remove_file(&file) {
                    Err(e) if e.kind() != ErrorKind::NotFound => return Err(failed(&e)),
                    _ => {}
                }
            }
            disk::write_file(&folder.join(SCAN), format!("{OF}{source}\n").as_bytes())
        }
    }
}
