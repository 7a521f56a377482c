//! Detection of changed files without reading them.
//!
//! Polling costs some microseconds a file, and detects changes that notifications of the system
//! miss or report in many ways: files on network drives, files that an editor writes under another
//! name and renames, and files that are absent for a while.

use std::fs;
use std::path::PathBuf;
use std::time::SystemTime;

/// The state of files at one time.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Stamps(Vec<Option<Stamp>>);

/// Identity of a file: a renamed file may have the time and length of the old one, but not its
/// birth or number.
#[derive(Debug, PartialEq, Eq)]
struct Stamp {
    length: u64,
    modified: Option<SystemTime>,
    created: Option<SystemTime>,
    number: u64,
}

impl Stamps {
    /// The files as they are now.
    pub(super) fn read(files: &[PathBuf]) -> Self {
        let stamp = |file: &PathBuf| {
            let about = fs::metadata(file).ok()?;
            Some(Stamp {
                length: about.len(),
                modified: about.modified().ok(),
                created: about.created().ok(),
                number: number(&about),
            })
        };
        Self(files.iter().map(stamp).collect())
    }
}

/// The number of a file; other systems tell none.
#[cfg(unix)]
fn number(about: &fs::Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::ino(about)
}

#[cfg(not(unix))]
fn number(_: &fs::Metadata) -> u64 {
    0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_the_same_length_and_time_in_its_place_is_another() {
        let folder = std::env::temp_dir().join(format!("isoform-stamps-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        let [file, beside] = ["a", "b"].map(|name| folder.join(name));
        fs::write(&file, "old").expect("written");
        let files = [file.clone()];
        let before = Stamps::read(&files);
        assert_eq!(before, Stamps::read(&files));
        let time = fs::metadata(&file).and_then(|about| about.modified());
        fs::write(&beside, "new").expect("written");
        let written = fs::File::options().write(true).open(&beside).expect("open");
        written.set_modified(time.expect("a time")).expect("set");
        fs::rename(&beside, &file).expect("renamed");
        assert_ne!(before, Stamps::read(&files));
        fs::remove_file(&file).expect("removed");
        assert_eq!(Stamps::read(&files), Stamps(vec![None]));
        let _ = fs::remove_dir_all(&folder);
    }
}
