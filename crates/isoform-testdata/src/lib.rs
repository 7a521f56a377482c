//! Where tests find their data, the list of failures that they expect, and what is told of progress.
//!
//! Small data lies in the repository, in tests/data: [`data`] and [`files`] panic where it is not
//! there, since nothing excuses that. Data too large for the repository lies in a folder `shared`
//! beside it, or in the one that `ISOFORM_SHARED` names: [`shared_data`] is the one way to it, so
//! that every test that does without is counted.
#![forbid(unsafe_code)]

mod expected;
mod progress;

pub use expected::ExpectedFailures;
pub use progress::shares_told;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The root of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A file or folder of tests/data.
///
/// # Panics
/// Where it does not exist.
pub fn data(path: &str) -> PathBuf {
    let found = root().join("tests/data").join(path);
    assert!(found.exists(), "{} is missing", found.display());
    found
}

/// The files of a folder with an extension, in order.
///
/// # Panics
/// Where there are none.
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

/// The files of a folder of tests/data with an extension, in order.
///
/// # Panics
/// Where there are none.
pub fn files(folder: &str, extension: &str) -> Vec<PathBuf> {
    files_in(&data(folder), extension)
}

/// The name of a file without its extension.
///
/// ```
/// use std::path::Path;
///
/// assert_eq!(isoform_testdata::stem(Path::new("zoo/torus.json")), "torus");
/// ```
///
/// # Panics
/// Where it has none that is text.
pub fn stem(path: &Path) -> String {
    let stem = path.file_stem().and_then(|s| s.to_str());
    stem.unwrap_or_else(|| panic!("{} has no name", path.display()))
        .to_owned()
}

/// True if tests take all of their cases: `ISOFORM_FULL` is set, as `./test.sh --full` does. Else
/// those whose cases take many seconds take the ones that cover their claim.
pub fn is_full() -> bool {
    std::env::var_os("ISOFORM_FULL").is_some()
}

/// Number of cases that a test takes: all of them, or a few unless [`is_full`].
pub fn cases(all: usize, few: usize) -> usize {
    if is_full() { all } else { few }
}

/// A file or folder of the data beside the repository. Where it is absent the test is told to
/// return, and a line says which one did: `test.sh` counts these lines.
///
/// # Panics
/// Where it is absent and `CI` is `true`: what is missing there is a failure.
pub fn shared_data(path: &str) -> Option<PathBuf> {
    let shared =
        std::env::var_os("ISOFORM_SHARED").map_or_else(|| root().join("../shared"), PathBuf::from);
    let found = shared.join(path);
    let is_ci = std::env::var_os("CI").is_some_and(|ci| ci == "true");
    found_or_skipped(found, is_ci, &mut std::io::stderr())
}

/// [`shared_data`] apart from its surroundings.
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
    // Written past the capture of cargo's test runner, which would swallow the line of a test that
    // passes, and in one piece, on a line of its own.
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

    /// The repository stays small.
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
