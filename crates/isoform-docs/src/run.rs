//! Runs the commands of the pages, each page in a folder of its own.
//!
//! tests/doc_commands.txt says what pages take for granted (`before`), and which commands are not
//! run, each with its reason (`skip`). A line there that fits nothing is a failure.

use crate::commands::{Act, acts};
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
    is_skip: bool,
    page: String,
    command: String,
}

/// The lines of the list: `before | PAGE | COMMAND` or `skip | PAGE | COMMAND | REASON`.
fn read(list: &str) -> Result<Vec<Line>, String> {
    let lines = list
        .lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split(" | ").collect();
            let (is_skip, page, command) = match cells.as_slice() {
                ["before", page, command] => (false, page, command),
                ["skip", page, command, _reason] => (true, page, command),
                _ => return Err(format!("neither before nor skip with a reason: {line}")),
            };
            Ok(Line {
                is_skip,
                page: (*page).to_owned(),
                command: (*command).to_owned(),
            })
        })
        .collect()
}

/// The commands of a page as the list has them: without what is said behind them.
fn plain(command: &str) -> String {
    let command = command.split(" #").next().unwrap_or(command);
    command.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Runs the commands of all pages; whether all end well.
pub(crate) fn all(root: &Path, program: &Path) -> Result<bool, Box<dyn Error>> {
    let runner = Runner {
        root: root.canonicalize()?,
        program: program.canonicalize()?,
        scratch: std::env::temp_dir().join(format!("isoform-docs-{}", std::process::id())),
    };
    let lines = read(&fs::read_to_string(root.join("tests/doc_commands.txt"))?)?;
    let mut pages = vec!["README.md".to_owned()];
    for entry in fs::read_dir(root.join("docs"))? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        if name.ends_with(".md") {
            pages.push(format!("docs/{name}"));
        }
    }
    pages.sort();
    let mut is_good = true;
    let mut seen = Vec::new();
    for page in &pages {
        is_good &= runner.page(page, &lines, &mut seen)?;
    }
    for line in lines.iter().filter(|line| !seen.contains(line)) {
        println!(
            "{}: listed, but no such command: {}",
            line.page, line.command
        );
        is_good = false;
    }
    fs::remove_dir_all(&runner.scratch)?;
    Ok(is_good)
}

/// What all pages share.
struct Runner {
    root: PathBuf,
    program: PathBuf,
    scratch: PathBuf,
}

impl Runner {
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
        for line in lines.iter().filter(|l| l.page == page && !l.is_skip) {
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
                .find(|l| l.is_skip && l.page == page && l.command == command);
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
        let folder = self.scratch.join(page.replace('/', "-"));
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
        let lines = read("# why\n\nbefore | a.md | cp x y\nskip | a.md | isoform z | no z\n");
        let lines = lines.expect("two lines");
        assert_eq!(
            (lines.len(), lines[0].is_skip, lines[1].is_skip),
            (2, false, true)
        );
        assert!(
            read("skip | a.md | isoform z\n").is_err(),
            "without a reason"
        );
        assert_eq!(plain("isoform  a b   # why"), "isoform a b");
    }
}
