//! Data of tests, the list of failures that they expect, and a recorder of progress.
//!
//! Small data are part of the repository, in tests/data: [`data`] and [`files`] panic if they are
//! missing. Data too large for the repository lie in a folder `shared` next to it, or in the one
//! that `ISOFORM_SHARED` names: [`shared_data`] is the only access to it, so that every test
//! skipped for lack of data is counted.
#![forbid(unsafe_code)]

mod expected;
mod progress;

pub use expected::ExpectedFailures;
pub use progress::shares_told;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Returns the root of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Returns the path of a file or folder of tests/data.
///
/// # Panics
/// If it does not exist.
pub fn data(path: &str) -> PathBuf {
    let found = root().join("tests/data").join(path);
    assert!(found.exists(), "{} is missing", found.display());
    found
}

/// Returns the files of a folder with an extension, sorted.
///
/// # Panics
/// If the folder has no such file.
pub fn files_in(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut found: Vec<PathBuf> = entries
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|path| path.extension().is_some_and(|e| e == extension))
        .collect();
    assert!(
        !found.is_empty(),
        "{} holds no file .{extension}",
        folder.display()
    );
    found.sort();
    found
}

/// Returns the files of a folder of tests/data with an extension, sorted.
///
/// # Panics
/// If the folder has no such file.
pub fn files(folder: &str, extension: &str) -> Vec<PathBuf> {
    files_in(&data(folder), extension)
}

/// Returns the name of a file without its extension.
///
/// ```
/// use std::path::Path;
///
/// assert_eq!(isoform_testdata::stem(Path::new("zoo/torus.json")), "torus");
/// ```
///
/// # Panics
/// If the path lacks a name, or the name is not UTF-8.
pub fn stem(path: &Path) -> String {
    let stem = path.file_stem().and_then(|s| s.to_str());
    stem.unwrap_or_else(|| panic!("{} has no name", path.display()))
        .to_owned()
}

/// Returns true if tests run all of their cases: `ISOFORM_FULL` is set, as `./test.sh --full` does.
/// Otherwise slow tests run only the cases that cover their claim.
pub fn is_full() -> bool {
    std::env::var_os("ISOFORM_FULL").is_some()
}

/// Returns the number of cases that a test runs: `all` if [`is_full`], else `few`.
pub fn cases(all: usize, few: usize) -> usize {
    if is_full() { all } else { few }
}

/// Returns the path of a file or folder of the data outside the repository; `None` if it is
/// missing, and then the test is to return. The test is reported on a line of stderr: `test.sh`
/// counts these lines.
///
/// # Panics
/// If the path is missing and `CI` is `true`: data must be complete there.
pub fn shared_data(path: &str) -> Option<PathBuf> {
    let shared =
        std::env::var_os("ISOFORM_SHARED").map_or_else(|| root().join("../shared"), PathBuf::from);
    let found = shared.join(path);
    let is_ci = std::env::var_os("CI").is_some_and(|ci| ci == "true");
    found_or_skipped(found, is_ci, &mut std::io::stderr())
}

/// Implements [`shared_data`] independently of the environment.
fn found_or_skipped(path: PathBuf, is_ci: bool, to: &mut dyn Write) -> Option<PathBuf> {
    if path.exists() {
        return Some(path);
    }
    assert!(
        !is_ci,
        "{} is missing; ISOFORM_SHARED names the folder that holds it",
        path.display()
    );
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("a test");
    // Bypasses the output capture of cargo's test runner, which would swallow the line of a passing
    // test. Written at once and on a line of its own.
    let line = format!("\nskipped  {test}: {} is not there\n", path.display());
    to.write_all(line.as_bytes()).expect("stderr takes a line");
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_said() {
        let (mut said, nowhere) = (Vec::new(), root().join("no such folder"));
        assert_eq!(found_or_skipped(nowhere, false, &mut said), None);
        let said = String::from_utf8(said).expect("text");
        assert!(
            said.starts_with("\nskipped  tests::what_is_missing_is_said: ") && said.ends_with('\n'),
            "{said}"
        );
        let mut said = Vec::new();
        assert!(found_or_skipped(root(), false, &mut said).is_some() && said.is_empty());
        assert!(found_or_skipped(root(), true, &mut said).is_some() && said.is_empty());
    }

    #[test]
    #[should_panic(expected = "is missing; ISOFORM_SHARED")]
    fn what_is_missing_in_ci_is_a_failure() {
        found_or_skipped(root().join("no such folder"), true, &mut Vec::new());
    }

    #[test]
    #[should_panic(expected = "is missing")]
    fn what_is_missing_in_the_repository_is_a_failure() {
        data("no such file");
    }

    /// Bounds the size of the repository's data.
    #[test]
    fn data_is_small() {
        let (mut folders, mut total) = (vec![data("")], 0);
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).expect("a folder") {
                let path = entry.expect("readable").path();
                if path.is_dir() {
                    folders.push(path);
                    continue;
                }
                let bytes = path.metadata().expect("a size").len();
                assert!(bytes <= 1 << 20, "{}: {bytes} bytes", path.display());
                total += bytes;
            }
        }
        assert!(total <= 1_500_000, "{total} bytes");
    }
}
