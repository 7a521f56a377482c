//! Measures this repository's crates: tokens and cyclomatic complexity of functions, and how comments
//! and names read.
//!
//! Prints a table by crate. Functions with more than [`MAX_TOKENS`] tokens or a cyclomatic
//! complexity above [`MAX_COMPLEXITY`] are listed in tests/long_functions.txt, each with its
//! reason. A long function that is not listed is a failure, and so is a listed one that was
//! removed or shortened, so that the list can only shrink. The counts of comments and names are
//! bounded by tests/prose.txt likewise; `--write` writes that list anew.
#![forbid(unsafe_code)]

mod functions;
mod prose;

use functions::{Function, functions};
use prose::Prose;
use std::collections::{BTreeMap, BTreeSet};
use std::env;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Maximum number of tokens of a function that need not be listed. One function in a hundred of
/// kurbo, fidget and spade is longer; a lower limit would force tables to be split.
const MAX_TOKENS: usize = 800;
/// Maximum cyclomatic complexity of a function that need not be listed. Beyond it a reader no
/// longer keeps track of the paths; kurbo has two such functions, spade one.
const MAX_COMPLEXITY: usize = 25;

struct MeasuredFunction {
    /// Name of the crate.
    room: String,
    /// Path of the file, relative to the folder of crates.
    file: String,
    function: Function,
}

impl MeasuredFunction {
    fn is_long(&self) -> bool {
        self.function.tokens > MAX_TOKENS || self.function.cyclomatic > MAX_COMPLEXITY
    }
    fn key(&self) -> String {
        format!("{} {}", self.file, self.function.name)
    }
}

fn main() -> ExitCode {
    match run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(2)
        }
    }
}

fn run() -> Result<bool, Box<dyn Error>> {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut measured = Vec::new();
    let mut prose = Prose::default();
    for folder in sorted(&crates)? {
        let room = name(&folder);
        for path in sources(&folder.join("src"))? {
            let text = fs::read_to_string(&path)?;
            prose.add(&room, &text);
            let file = path.strip_prefix(&crates)?.display().to_string();
            let found = functions(&text).map_err(|e| format!("{file}: {e}"))?;
            measured.extend(found.into_iter().map(|function| MeasuredFunction {
                room: room.clone(),
                file: file.clone(),
                function,
            }));
        }
    }
    print_table(&measured);
    let lists = crates.join("../tests");
    let is_short = print_long(
        &measured,
        &fs::read_to_string(lists.join("long_functions.txt"))?,
    );
    let path = lists.join("prose.txt");
    let list = fs::read_to_string(&path)?;
    if env::args().any(|argument| argument == "--write") {
        let head = list.lines().filter(|line| line.starts_with('#'));
        let head: String = head.map(|line| format!("{line}\n")).collect();
        fs::write(&path, head + &prose.list())?;
        return Ok(is_short);
    }
    let differences = prose.against(&list);
    for difference in &differences {
        println!("{difference} (tests/prose.txt)");
    }
    Ok(is_short && differences.is_empty())
}

/// Returns the entries of a folder, sorted by name.
fn sorted(folder: &Path) -> Result<Vec<PathBuf>, std::io::Error> {
    let entries = fs::read_dir(folder)?;
    let mut paths = entries
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<Vec<_>, std::io::Error>>()?;
    paths.sort();
    Ok(paths)
}

fn name(path: &Path) -> String {
    path.file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// Returns the source files of a folder and its subfolders.
fn sources(folder: &Path) -> Result<Vec<PathBuf>, std::io::Error> {
    let mut found = Vec::new();
    for path in sorted(folder)? {
        if path.is_dir() {
            found.extend(sources(&path)?);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    Ok(found)
}

fn print_table(measured: &[MeasuredFunction]) {
    let mut rooms: BTreeMap<&str, Vec<&Function>> = BTreeMap::new();
    for m in measured {
        rooms.entry(&m.room).or_default().push(&m.function);
    }
    println!("crate                functions  tokens: median   p90  >{MAX_TOKENS}  branches >25");
    for (room, functions) in &rooms {
        print_row(room, functions);
    }
    let all: Vec<&Function> = measured.iter().map(|m| &m.function).collect();
    print_row("all", &all);
}

fn print_row(room: &str, functions: &[&Function]) {
    let mut tokens: Vec<usize> = functions.iter().map(|f| f.tokens).collect();
    tokens.sort_unstable();
    let n = tokens.len();
    let at = |tenths: usize| tokens.get(n * tenths / 10).copied().unwrap_or_default();
    let long = tokens.iter().filter(|&&t| t > MAX_TOKENS).count();
    let is_branched = |f: &&&Function| f.cyclomatic > MAX_COMPLEXITY;
    let branched = functions.iter().filter(is_branched).count();
    let (median, ninth) = (at(5), at(9));
    println!("{room:20} {n:9} {median:15} {ninth:5} {long:5} {branched:13}");
}

/// Prints long functions that are not listed, and listed ones that are not long; returns true if
/// neither exist.
fn print_long(measured: &[MeasuredFunction], list: &str) -> bool {
    // Format of a line: file, function, then the reason after a colon and a space.
    let listed: BTreeSet<&str> = list
        .lines()
        .filter(|line| !line.starts_with('#') && !line.trim().is_empty())
        .filter_map(|line| line.split(": ").next())
        .collect();
    let mut seen = BTreeSet::new();
    let mut is_right = true;
    for m in measured.iter().filter(|m| m.is_long()) {
        let key = m.key();
        let (tokens, cyclomatic) = (m.function.tokens, m.function.cyclomatic);
        let size = format!("{tokens} tokens, {cyclomatic} branches");
        let place = format!("{}:{}", m.file, m.function.line);
        if let Some(key) = listed.get(key.as_str()) {
            seen.insert(*key);
        } else {
            println!("too long: {place} {}, {size}", m.function.name);
            is_right = false;
        }
    }
    for key in listed.difference(&seen) {
        println!("listed but not long: {key}");
        is_right = false;
    }
    is_right
}
