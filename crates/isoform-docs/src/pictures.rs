//! Pictures shown by pages, and the commands that draw them.
//!
//! A picture docs/images/NAME is the file that a command writes as NAME: preferably a command of a
//! page that shows the picture.

use crate::page::Page;
use crate::site::resolved;
use std::collections::BTreeMap;
use std::fs;
use std::io::Error;
use std::path::{Path, PathBuf};

/// Folder of pictures, relative to the repository.
const PICTURE_FOLDER: &str = "docs/images/";

/// Pictures shown by pages.
pub(crate) struct Pictures {
    folder: PathBuf,
    /// All pages, in order.
    pages: Vec<String>,
    /// Pages that show a picture, by its name.
    shown: BTreeMap<String, Vec<String>>,
}

impl Pictures {
    /// Collects the pictures that the pages show.
    pub(crate) fn read(root: &Path, pages: &[String]) -> Result<Self, Error> {
        let mut shown: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for page in pages {
            let text = fs::read_to_string(root.join(page))?;
            for link in Page::from_markdown(&text, |_| None).links {
                let (target, _) = resolved(page, &link);
                if let Some(name) = target.strip_prefix(PICTURE_FOLDER) {
                    shown.entry(name.to_owned()).or_default().push(page.clone());
                }
            }
        }
        Ok(Self {
            folder: root.join(PICTURE_FOLDER),
            pages: pages.to_vec(),
            shown,
        })
    }

    /// Returns the pages that show pictures.
    pub(crate) fn pages(&self) -> impl Iterator<Item = &String> {
        let is_shown = |page: &&String| self.shown.values().any(|pages| pages.contains(page));
        self.pages.iter().filter(is_shown)
    }

    /// Returns the file that the commands of pages wrote as a picture; `place` returns the folder
    /// in which the commands of a page were run.
    fn drawn(&self, name: &str, place: &impl Fn(&str) -> PathBuf) -> Option<PathBuf> {
        let shows = |page: &&String| self.shown[name].contains(page);
        let first = self.pages.iter().filter(shows);
        let mut files = first.chain(&self.pages).map(|page| place(page).join(name));
        files.find(|file| file.is_file())
    }

    /// Returns the defects after all commands were run: pictures that no command draws though they
    /// are not listed as given (a `*` at the end of a listed name stands for any end), given ones
    /// that a command draws, and files that no page shows.
    pub(crate) fn wrong(
        &self,
        given: &[&str],
        place: impl Fn(&str) -> PathBuf,
    ) -> Result<Vec<String>, Error> {
        let mut wrong = Vec::new();
        let mut others = 0;
        for name in self.shown.keys() {
            let is_given = given.iter().any(|given| match given.strip_suffix('*') {
                Some(start) => name.starts_with(start),
                None => given == name,
            });
            match self.drawn(name, &place) {
                None if !is_given => {
                    wrong.push(format!("{PICTURE_FOLDER}{name}: no command draws it"))
                }
                Some(_) if is_given => {
                    wrong.push(format!("{PICTURE_FOLDER}{name}: a command draws it"))
                }
                Some(file) => others += usize::from(!self.is_as(name, &file)),
                None => {}
            }
        }
        for entry in fs::read_dir(&self.folder)? {
            let name = entry?.file_name().to_string_lossy().into_owned();
            if !self.shown.contains_key(&name) {
                wrong.push(format!("{PICTURE_FOLDER}{name}: no page shows it"));
            }
        }
        let all = self.shown.len();
        println!("{PICTURE_FOLDER}: {all} pictures, {others} of them are drawn otherwise now");
        Ok(wrong)
    }

    /// Returns true if a file is identical to a picture.
    fn is_as(&self, name: &str, file: &Path) -> bool {
        let read = |file: &Path| fs::read(file).ok();
        read(file).is_some_and(|bytes| read(&self.folder.join(name)) == Some(bytes))
    }

    /// Copies new versions of pictures from the files that commands wrote.
    pub(crate) fn take(&self, place: impl Fn(&str) -> PathBuf) -> Result<(), Error> {
        for name in self.shown.keys() {
            if let Some(file) = self.drawn(name, &place).filter(|f| !self.is_as(name, f)) {
                fs::copy(file, self.folder.join(name))?;
                println!("{PICTURE_FOLDER}{name}");
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_what_a_command_draws() {
        let root = std::env::temp_dir().join(format!("isoform-pictures-{}", std::process::id()));
        let place = |page: &str| root.join("run").join(page.replace('/', "-"));
        let write = |file: PathBuf, text: &str| {
            fs::create_dir_all(file.parent().expect("a folder")).expect("a folder");
            fs::write(file, text).expect("written");
        };
        write(root.join("README.md"), "![a](docs/images/a.png)");
        write(
            root.join("docs/b.md"),
            "![b](images/b.png) ![c](images/c.png)",
        );
        write(root.join("docs/c.md"), "It shows none.");
        write(root.join("docs/images/a.png"), "old");
        write(root.join("docs/images/d.png"), "no page shows it");
        let pages = ["README.md", "docs/b.md", "docs/c.md"].map(str::to_owned);
        let pictures = Pictures::read(&root, &pages).expect("pages");
        assert_eq!(pictures.pages().collect::<Vec<_>>(), [&pages[0], &pages[1]]);
        // Drawn by another page than the one that shows it; and by both: then the latter counts.
        write(place("docs/c.md").join("a.png"), "new");
        write(place("docs/c.md").join("b.png"), "of another");
        write(place("docs/b.md").join("b.png"), "its own");
        pictures.take(place).expect("copied");
        let read = |name: &str| fs::read_to_string(root.join("docs/images").join(name));
        assert_eq!(read("a.png").expect("a"), "new");
        assert_eq!(read("b.png").expect("b"), "its own");
        let wrong = |given: &[&str]| pictures.wrong(given, place).expect("read");
        let orphan = "docs/images/d.png: no page shows it";
        assert_eq!(
            wrong(&[]),
            ["docs/images/c.png: no command draws it", orphan]
        );
        assert_eq!(wrong(&["c.png"]), [orphan]);
        let given = wrong(&["a.png", "c.png"]);
        assert_eq!(given, ["docs/images/a.png: a command draws it", orphan]);
        fs::remove_dir_all(&root).expect("removed");
    }
}
