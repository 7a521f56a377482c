//! Runs the commands of the pages, each page in a folder of its own.
//!
//! tests/doc_commands.txt lists what pages take for granted (`before`), commands that are not run
//! (`skip`) and pictures that no command draws (`given`), the last two with a reason. A line that
//! matches nothing is a failure.

use crate::commands::{PageStep, steps};
use crate::pictures::Pictures;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

#[cfg(unix)]
use std::os::unix::fs::symlink;

/// Fails: the commands are written for a Unix shell.
#[cfg(not(unix))]
fn symlink(_: PathBuf, _: PathBuf) -> std::io::Result<()> {
    Err(std::io::ErrorKind::Unsupported.into())
}

/// Time limit of a command: longer than any of the documentation takes on a busy machine.
const COMMAND_TIME_LIMIT: Duration = Duration::from_secs(120);

/// Entry of tests/doc_commands.txt.
#[derive(Debug, PartialEq, Eq)]
struct ListEntry {
    kind: ListEntryKind,
    /// Page; for given pictures the picture.
    page: String,
    command: String,
}

/// Kind of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ListEntryKind {
    Before,
    Skip,
    Given,
}

/// Parses the entries: `before | PAGE | COMMAND`, `skip | PAGE | COMMAND | REASON` or `given |
/// PICTURE | REASON`.
fn read(list: &str) -> Result<Vec<ListEntry>, String> {
    let entries = list
        .lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    entries
        .map(|line| {
            let cells: Vec<&str> = line.split(" | ").collect();
            let (kind, page, command) = match cells.as_slice() {
                ["before", page, command] => (ListEntryKind::Before, page, *command),
                ["skip", page, command, _reason] => (ListEntryKind::Skip, page, *command),
                ["given", picture, _reason] => (ListEntryKind::Given, picture, ""),
                _ => return Err(format!("no kind of line, or without a reason: {line}")),
            };
            Ok(ListEntry {
                kind,
                page: (*page).to_owned(),
                command: command.to_owned(),
            })
        })
        .collect()
}

/// Normalises a command for comparison with entries: without a comment and with single spaces.
fn plain(command: &str) -> String {
    let command = command.split(" #").next().unwrap_or(command);
    command.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Runs the commands of some pages, or of all if none is named. Returns true if all commands end as
/// they should and, if all pages were run, draw the pictures that pages show.
pub(crate) fn all(root: &Path, program: &Path, some: &[&str]) -> Result<bool, Box<dyn Error>> {
    let entries = read(&fs::read_to_string(root.join("tests/doc_commands.txt"))?)?;
    let runner = Runner::new(root, program)?;
    let pages = pages(root)?;
    if let Some(page) = some.iter().find(|page| !pages.iter().any(|p| p == **page)) {
        return Err(format!("there is no page {page}").into());
    }
    let mut is_good = true;
    let mut seen = Vec::new();
    let is_run = |page: &&String| some.is_empty() || some.contains(&page.as_str());
    for page in pages.iter().filter(is_run) {
        is_good &= runner.page(page, &entries, &mut seen)?;
    }
    if some.is_empty() {
        is_good &= is_complete(&runner, &pages, &entries, seen)?;
    }
    fs::remove_dir_all(&runner.scratch)?;
    Ok(is_good)
}

/// Checks, after the commands of all pages were run, that they drew the pictures that pages show
/// and that every entry was used; `seen` contains the entries used by commands.
fn is_complete<'a>(
    runner: &Runner,
    pages: &[String],
    entries: &'a [ListEntry],
    mut seen: Vec<&'a ListEntry>,
) -> Result<bool, Box<dyn Error>> {
    let mut is_good = true;
    let given: Vec<&ListEntry> = entries
        .iter()
        .filter(|l| l.kind == ListEntryKind::Given)
        .collect();
    let names: Vec<&str> = given.iter().map(|l| l.page.as_str()).collect();
    let pictures = Pictures::read(&runner.root, pages)?;
    for wrong in pictures.wrong(&names, |page| runner.place(page))? {
        println!("{wrong}");
        is_good = false;
    }
    seen.extend(given);
    for line in entries.iter().filter(|line| !seen.contains(line)) {
        println!(
            "{}: listed, but no such command: {}",
            line.page, line.command
        );
        is_good = false;
    }
    Ok(is_good)
}

/// Runs the commands of the pages that show pictures, and copies what they draw into docs/images;
/// returns true if all end as they should.
pub(crate) fn draw(root: &Path, program: &Path) -> Result<bool, Box<dyn Error>> {
    let entries = read(&fs::read_to_string(root.join("tests/doc_commands.txt"))?)?;
    let runner = Runner::new(root, program)?;
    let pictures = Pictures::read(root, &pages(root)?)?;
    let mut is_good = true;
    for page in pictures.pages() {
        is_good &= runner.page(page, &entries, &mut Vec::new())?;
    }
    pictures.take(|page| runner.place(page))?;
    fs::remove_dir_all(&runner.scratch)?;
    Ok(is_good)
}

/// Returns the pages whose commands are run.
fn pages(root: &Path) -> Result<Vec<String>, std::io::Error> {
    let mut pages = vec!["README.md".to_owned()];
    for entry in fs::read_dir(root.join("docs"))? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        if name.ends_with(".md") {
            pages.push(format!("docs/{name}"));
        }
    }
    pages.sort();
    Ok(pages)
}

/// Input and work space of all pages.
struct Runner {
    root: PathBuf,
    program: PathBuf,
    scratch: PathBuf,
}

impl Runner {
    fn new(root: &Path, program: &Path) -> Result<Self, std::io::Error> {
        Ok(Self {
            root: root.canonicalize()?,
            program: program.canonicalize()?,
            scratch: std::env::temp_dir().join(format!("isoform-docs-{}", std::process::id())),
        })
    }

    /// Returns the folder in which the commands of a page are run.
    fn place(&self, page: &str) -> PathBuf {
        self.scratch.join(page.replace('/', "-"))
    }

    /// Runs the commands of a page; returns true if all end as they should.
    fn page<'a>(
        &self,
        page: &str,
        entries: &'a [ListEntry],
        seen: &mut Vec<&'a ListEntry>,
    ) -> Result<bool, Box<dyn Error>> {
        let steps = steps(&fs::read_to_string(self.root.join(page))?);
        let folder = self.folder(page)?;
        let start = Instant::now();
        let mut is_good = true;
        let before = |l: &&ListEntry| l.page == page && l.kind == ListEntryKind::Before;
        for line in entries.iter().filter(before) {
            seen.push(line);
            is_good &= self.run(page, &line.command, None, &folder)?;
        }
        let mut count = [0, 0];
        for step in &steps {
            let (command, error) = match step {
                PageStep::File(name, text) => {
                    fs::write(folder.join(name), text)?;
                    continue;
                }
                PageStep::Run(command) => (plain(command), None),
                PageStep::Refused(command, error) => (plain(command), Some(error.as_str())),
            };
            let skipped = entries
                .iter()
                .find(|l| l.kind == ListEntryKind::Skip && l.page == page && l.command == command);
            count[usize::from(skipped.is_some())] += 1;
            match skipped {
                Some(line) => seen.push(line),
                None => is_good &= self.run(page, &command, error, &folder)?,
            }
        }
        if !steps.is_empty() {
            let [run, skipped] = count;
            let seconds = start.elapsed().as_secs_f64();
            println!("{page}: {run} commands run, {skipped} skipped, {seconds:.1} s");
        }
        Ok(is_good)
    }

    /// Creates the folder of a page, with a link to the examples of the repository.
    fn folder(&self, page: &str) -> Result<PathBuf, std::io::Error> {
        let folder = self.place(page);
        fs::create_dir_all(&folder)?;
        symlink(self.root.join("examples"), folder.join("examples"))?;
        Ok(folder)
    }

    /// Runs a command; returns true if it ends in time and as it should: with success, or with the
    /// line `error`.
    fn run(
        &self,
        page: &str,
        command: &str,
        error: Option<&str>,
        folder: &Path,
    ) -> Result<bool, Box<dyn Error>> {
        let beside = self.program.parent().unwrap_or(Path::new("/"));
        let path = std::env::var("PATH").unwrap_or_default();
        let said = folder.join(".said");
        let output = fs::File::create(&said)?;
        let child = Command::new("sh")
            .args(["-c", command])
            .current_dir(folder)
            .env("PATH", format!("{}:{path}", beside.display()))
            .stdin(Stdio::null())
            .stdout(output.try_clone()?)
            .stderr(output)
            .spawn()?;
        let status = ended(child)?;
        let said = String::from_utf8_lossy(&fs::read(&said)?).into_owned();
        let is_good = match (status, error) {
            (None, _) => false,
            (Some(status), None) => status.success(),
            (Some(status), Some(line)) => !status.success() && said.lines().any(|l| l == line),
        };
        if !is_good {
            let end = status.map_or("takes too long".to_owned(), |status| status.to_string());
            println!("{page}: {command}\n  {end}\n{said}");
        }
        Ok(is_good)
    }
}

/// Waits for a process; `None` if it took too long and was killed.
fn ended(mut child: Child) -> Result<Option<ExitStatus>, std::io::Error> {
    let start = Instant::now();
    while start.elapsed() < COMMAND_TIME_LIMIT {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill()?;
    child.wait()?;
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list() {
        let list = "# why\n\nbefore | a.md | cp x y\nskip | a.md | isoform z | no z\n\
                    given | x.png | by hand\n";
        let entries = read(list).expect("three lines");
        let kinds: Vec<ListEntryKind> = entries.iter().map(|l| l.kind).collect();
        assert_eq!(
            kinds,
            [
                ListEntryKind::Before,
                ListEntryKind::Skip,
                ListEntryKind::Given
            ]
        );
        assert!(
            read("skip | a.md | isoform z\n").is_err(),
            "without a reason"
        );
        assert_eq!(plain("isoform  a b   # why"), "isoform a b");
    }
}
