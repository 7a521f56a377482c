//! The pictures that pages show, and the commands that draw them.
//!
//! A picture docs/images/NAME is what a command of a page writes as NAME: of a page that shows it,
//! where one does both.

use crate::page::Page;
use crate::site::resolved;
use std::collections::BTreeMap;
use std::fs;
use std::io::Error;
use std::path::{Path, PathBuf};

/// Where pictures are, in the repository.
const FOLDER: &str = "docs/images/";

/// The pictures that pages show.
pub(crate) struct Pictures {
    folder: PathBuf,
    /// All pages, in their order.
    pages: Vec<String>,
    /// By their names, the pages that show them.
    shown: BTreeMap<String, Vec<String>>,
}

impl Pictures {
    /// Reads which pictures some pages show.
    pub(crate) fn read(root: &Path, pages: &[String]) -> Result<Self, Error> {
        let mut shown: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for page in pages {
            let text = fs::read_to_string(root.join(page))?;
            for link in Page::of(&text, |_| None).links {
                let (target, _) = resolved(page, &link);
                if let Some(name) = target.strip_prefix(FOLDER) {
                    shown.entry(name.to_owned()).or_default().push(page.clone());
                }
            }
        }
        Ok(Self {
            folder: root.join(FOLDER),
            pages: pages.to_vec(),
            shown,
        })
    }

    /// The pages that show some.
    pub(crate) fn pages(&self) -> impl Iterator<Item = &String> {
        let is_shown = |page: &&String| self.shown.values().any(|pages| pages.contains(page));
        self.pages.iter().filter(is_shown)
    }

    /// What the commands of pages have written as a picture; `place` is where those of a page were
    /// run.
    fn drawn(&self, name: &str, place: &impl Fn(&str) -> PathBuf) -> Option<PathBuf> {
        let shows = |page: &&String| self.shown[name].contains(page);
        let first = self.pages.iter().filter(shows);
        let mut files = first.chain(&self.pages).map(|page| place(page).join(name));
        files.find(|file| file.is_file())
    }

    /// What is wrong once all commands were run: pictures that none has drawn though they are not
    /// given, given ones that some have, and files that no page shows.
    pub(crate) fn wrong(
        &self,
        given: &[&str],
        place: impl Fn(&str) -> PathBuf,
    ) -> Result<Vec<String>, Error> {
        let mut wrong = Vec::new();
        let mut others = 0;
        for name in self.shown.keys() {
            let is_given = given.contains(&name.as_str());
            match self.drawn(name, &place) {
                None if !is_given => wrong.push(format!("{FOLDER}{name}: no command draws it")),
                Some(_) if is_given => wrong.push(format!("{FOLDER}{name}: a command draws it")),
                Some(file) => others += usize::from(!self.is_as(name, &file)),
                None => {}
            }
        }
        for entry in fs::read_dir(&self.folder)? {
            let name = entry?.file_name().to_string_lossy().into_owned();
            if !self.shown.contains_key(&name) {
                wrong.push(format!("{FOLDER}{name}: no page shows it"));
            }
        }
        let all = self.shown.len();
        println!("{FOLDER}: {all} pictures, {others} of them are drawn otherwise now");
        Ok(wrong)
    }

    /// Whether a file has the bytes of a picture.
    fn is_as(&self, name: &str, file: &Path) -> bool {
        let read = |file: &Path| fs::read(file).ok();
        read(file).is_some_and(|bytes| read(&self.folder.join(name)) == Some(bytes))
    }

    /// Takes what commands have drawn.
    pub(crate) fn take(&self, place: impl Fn(&str) -> PathBuf) -> Result<(), Error> {
        for name in self.shown.keys() {
            if let Some(file) = self.drawn(name, &place).filter(|f| !self.is_as(name, f)) {
                fs::copy(file, self.folder.join(name))?;
                println!("{FOLDER}{name}");
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
        // Drawn by another page than the one that shows it; and by both, then the one that shows it.
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
