//! Runs the commands of the pages, each page in a folder of its own.
//!
//! tests/doc_commands.txt says what pages take for granted (`before`), and which commands are not
//! run (`skip`) and which pictures are not drawn by one (`given`), each with its reason. A line
//! there that fits nothing is a failure.

use crate::commands::{Act, acts};
use crate::pictures::Pictures;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

#[cfg(unix)]
use std::os::unix::fs::symlink;

/// The commands are written for a shell, which other systems lack.
#[cfg(not(unix))]
fn symlink(_: PathBuf, _: PathBuf) -> std::io::Result<()> {
    Err(std::io::ErrorKind::Unsupported.into())
}

/// Longer than any command of the documentation takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// A line of the list.
#[derive(Debug, PartialEq, Eq)]
struct Line {
    kind: Kind,
    /// The page; the picture of those that are given.
    page: String,
    command: String,
}

/// What a line of the list says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Before,
    Skip,
    Given,
}

/// The lines of the list: `before | PAGE | COMMAND`, `skip | PAGE | COMMAND | REASON` or
/// `given | PICTURE | REASON`.
fn read(list: &str) -> Result<Vec<Line>, String> {
    let lines = list
        .lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split(" | ").collect();
            let (kind, page, command) = match cells.as_slice() {
                ["before", page, command] => (Kind::Before, page, *command),
                ["skip", page, command, _reason] => (Kind::Skip, page, *command),
                ["given", picture, _reason] => (Kind::Given, picture, ""),
                _ => return Err(format!("no kind of line, or without a reason: {line}")),
            };
            Ok(Line {
                kind,
                page: (*page).to_owned(),
                command: command.to_owned(),
            })
        })
        .collect()
}

/// The commands of a page as the list has them: without what is said behind them.
fn plain(command: &str) -> String {
    let command = command.split(" #").next().unwrap_or(command);
    command.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Runs the commands of some pages, or of all where none is named; true if all end well and, of all
/// pages, draw the pictures that pages show.
pub(crate) fn all(root: &Path, program: &Path, some: &[&str]) -> Result<bool, Box<dyn Error>> {
    let lines = read(&fs::read_to_string(root.join("tests/doc_commands.txt"))?)?;
    let runner = Runner::new(root, program)?;
    let pages = pages(root)?;
    if let Some(page) = some.iter().find(|page| !pages.iter().any(|p| p == **page)) {
        return Err(format!("there is no page {page}").into());
    }
    let mut is_good = true;
    let mut seen = Vec::new();
    let is_run = |page: &&String| some.is_empty() || some.contains(&page.as_str());
    for page in pages.iter().filter(is_run) {
        is_good &= runner.page(page, &lines, &mut seen)?;
    }
    if some.is_empty() {
        is_good &= is_complete(&runner, &pages, &lines, seen)?;
    }
    fs::remove_dir_all(&runner.scratch)?;
    Ok(is_good)
}

/// Checks, once the commands of all pages were run, that these draw the pictures that pages show,
/// and that each line of the list fits one; `seen` are the lines that do.
fn is_complete<'a>(
    runner: &Runner,
    pages: &[String],
    lines: &'a [Line],
    mut seen: Vec<&'a Line>,
) -> Result<bool, Box<dyn Error>> {
    let mut is_good = true;
    let given: Vec<&Line> = lines.iter().filter(|l| l.kind == Kind::Given).collect();
    let names: Vec<&str> = given.iter().map(|l| l.page.as_str()).collect();
    let pictures = Pictures::read(&runner.root, pages)?;
    for wrong in pictures.wrong(&names, |page| runner.place(page))? {
        println!("{wrong}");
        is_good = false;
    }
    seen.extend(given);
    for line in lines.iter().filter(|line| !seen.contains(line)) {
        println!(
            "{}: listed, but no such command: {}",
            line.page, line.command
        );
        is_good = false;
    }
    Ok(is_good)
}

/// Runs the commands of the pages that show pictures, and takes what they draw into docs/images;
/// whether all end well.
pub(crate) fn draw(root: &Path, program: &Path) -> Result<bool, Box<dyn Error>> {
    let lines = read(&fs::read_to_string(root.join("tests/doc_commands.txt"))?)?;
    let runner = Runner::new(root, program)?;
    let pictures = Pictures::read(root, &pages(root)?)?;
    let mut is_good = true;
    for page in pictures.pages() {
        is_good &= runner.page(page, &lines, &mut Vec::new())?;
    }
    pictures.take(|page| runner.place(page))?;
    fs::remove_dir_all(&runner.scratch)?;
    Ok(is_good)
}

/// The pages whose commands are run.
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

/// What all pages share.
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

    /// The folder in which the commands of a page are run.
    fn place(&self, page: &str) -> PathBuf {
        self.scratch.join(page.replace('/', "-"))
    }

    /// Runs the commands of a page; whether all end well.
    fn page<'a>(
        &self,
        page: &str,
        lines: &'a [Line],
        seen: &mut Vec<&'a Line>,
    ) -> Result<bool, Box<dyn Error>> {
        let acts = acts(&fs::read_to_string(self.root.join(page))?);
        let folder = self.folder(page)?;
        let start = Instant::now();
        let mut is_good = true;
        let before = |l: &&Line| l.page == page && l.kind == Kind::Before;
        for line in lines.iter().filter(before) {
            seen.push(line);
            is_good &= self.run(page, &line.command, None, &folder)?;
        }
        let mut count = [0, 0];
        for act in &acts {
            let (command, error) = match act {
                Act::File(name, text) => {
                    fs::write(folder.join(name), text)?;
                    continue;
                }
                Act::Run(command) => (plain(command), None),
                Act::Refused(command, error) => (plain(command), Some(error.as_str())),
            };
            let skipped = lines
                .iter()
                .find(|l| l.kind == Kind::Skip && l.page == page && l.command == command);
            count[usize::from(skipped.is_some())] += 1;
            match skipped {
                Some(line) => seen.push(line),
                None => is_good &= self.run(page, &command, error, &folder)?,
            }
        }
        if !acts.is_empty() {
            let [run, skipped] = count;
            let seconds = start.elapsed().as_secs_f64();
            println!("{page}: {run} commands run, {skipped} skipped, {seconds:.1} s");
        }
        Ok(is_good)
    }

    /// An empty folder with the examples of the repository.
    fn folder(&self, page: &str) -> Result<PathBuf, std::io::Error> {
        let folder = self.place(page);
        fs::create_dir_all(&folder)?;
        symlink(self.root.join("examples"), folder.join("examples"))?;
        Ok(folder)
    }

    /// Runs a command; whether it ends in time and as it should: well, or with this line.
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

/// How a process ends; none where it takes too long.
fn ended(mut child: Child) -> Result<Option<ExitStatus>, std::io::Error> {
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
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
        let lines = read(list).expect("three lines");
        let kinds: Vec<Kind> = lines.iter().map(|l| l.kind).collect();
        assert_eq!(kinds, [Kind::Before, Kind::Skip, Kind::Given]);
        assert!(
            read("skip | a.md | isoform z\n").is_err(),
            "without a reason"
        );
        assert_eq!(plain("isoform  a b   # why"), "isoform a b");
    }
}
