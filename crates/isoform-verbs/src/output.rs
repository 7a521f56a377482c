//! What all verbs share: global options, failures, exit codes, stdout as data, stderr as talk.
//!
//! A verb gives back an [`Outcome`] or a [`Failure`]. [`finish`] prints either: the outcome's table
//! or file on stdout, or one JSON document with --json; the failure on stderr in four parts (what,
//! where, why, what to try), and in the document. Exit codes: 0 done, 1 usage, 2 input, 3 partial,
//! 4 no result, 5 a fault of ours, 130 after Ctrl-C.

use crate::inputs::Inputs;
use crate::interrupt;
use crate::memory::{self, Object};
use crate::product::Product;
use crate::progress::Whole;
use crate::watchdog;
use clap::ArgAction;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use isoform::Control;
use isoform::geom::{Aabb, Point3};
use isoform::report::Document;
use serde::Serialize;
use serde_json::{Value, json};
use std::fmt::Display;
use std::fs;
use std::io::{self, ErrorKind, Write};
use std::panic::AssertUnwindSafe;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Done and within tolerance.
pub(crate) const DONE: u8 = 0;
/// Wrong usage.
pub(crate) const USAGE: u8 = 1;
/// Unreadable or invalid input.
pub(crate) const INPUT: u8 = 2;
/// Done, but not in all parts or outside tolerance; output is written.
pub(crate) const PARTIAL: u8 = 3;
/// No result.
pub(crate) const NO_RESULT: u8 = 4;
/// A fault of ours.
pub(crate) const INTERNAL: u8 = 5;

/// The exit code of work whose result is there: `DONE` if it is all that was asked for.
pub(crate) fn exit(is_as_asked: bool) -> u8 {
    if interrupt::happened() {
        interrupt::INTERRUPTED
    } else if is_as_asked {
        DONE
    } else {
        PARTIAL
    }
}

/// Seed of everything random unless another is given.
const DEFAULT_SEED: u64 = 1;
/// Bytes of stack of a thread: those that Linux gives to a program's first one. Trees of deeply
/// nested models are walked by recursion.
const STACK: usize = 8 << 20;

#[derive(clap::Args)]
pub(crate) struct Global {
    /// Make stdout exactly one JSON document, on failure too
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Number of threads; results do not depend on it [default: all cores]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) threads: Option<u16>,
    /// Seed of everything random
    #[arg(long, global = true, value_name = "N", default_value_t = DEFAULT_SEED)]
    pub(crate) seed: u64,
    /// Say nothing on stderr but errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// Say more on stderr
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub(crate) verbose: u8,
    /// Let results overwrite the files that they come from, and recover make the solid of a fit that
    /// is in doubt
    #[arg(long, global = true)]
    pub(crate) force: bool,
    /// Stop after this time with the best so far: 30s, 2m, 1h
    #[arg(long, global = true, value_name = "TIME", value_parser = duration)]
    pub(crate) time_limit: Option<Duration>,
}

impl Default for Global {
    fn default() -> Self {
        Self {
            json: false,
            threads: None,
            seed: DEFAULT_SEED,
            quiet: false,
            verbose: 0,
            force: false,
            time_limit: None,
        }
    }
}

/// Reads a time: a number with ms, s, m or h behind it, seconds without.
fn duration(text: &str) -> Result<Duration, String> {
    let (number, unit) = match text.trim_end_matches(|c: char| c.is_ascii_alphabetic()) {
        number if number.len() == text.len() => (text, "s"),
        number => text.split_at(number.len()),
    };
    let scale = match unit {
        "ms" => 1e-3,
        "s" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => return Err(format!("`{unit}` is no unit of time; ms, s, m and h are")),
    };
    let seconds = number
        .parse::<f64>()
        .map_err(|_| format!("`{number}` is not a number"))?
        * scale;
    Duration::try_from_secs_f64(seconds).map_err(|e| e.to_string())
}

/// A function that is told of a phase and the share of it that is done, 0 to 1.
pub type OnProgress = dyn Fn(&str, f64) + Send + Sync;

/// A caller in place of a terminal: Python, or a page.
pub struct Listener {
    /// Set by the caller to end the work with the best so far.
    pub cancelled: Arc<AtomicBool>,
    /// Is told of progress.
    pub progress: Box<OnProgress>,
}

/// The settings of this run.
pub(crate) struct Context {
    /// Options that all verbs share.
    pub(crate) global: Global,
    /// When to stop.
    pub(crate) deadline: Option<Instant>,
    /// What is read, and must not be written over.
    pub(crate) inputs: Inputs,
    /// One bar for all stages, of verbs that have several.
    pub(crate) whole: Option<Whole>,
    /// The caller, where there is no terminal.
    pub(crate) listener: Option<Listener>,
    /// Warnings so far, for a caller.
    warnings: Mutex<Vec<String>>,
    /// The result in memory, for a caller.
    product: Mutex<Option<Product>>,
}

impl Context {
    /// Returns the context of a run; `None` as listener stands for the terminal.
    pub(crate) fn new(global: Global, listener: Option<Listener>) -> Self {
        Self {
            deadline: global
                .time_limit
                .and_then(|t| Instant::now().checked_add(t)),
            global,
            inputs: Inputs::default(),
            whole: None,
            listener,
            warnings: Mutex::default(),
            product: Mutex::default(),
        }
    }
    /// Starts the watch over the time limit and the pool of threads of a program.
    pub(crate) fn begin(&self) {
        let global = &self.global;
        if let Some(limit) = global.time_limit {
            watchdog::watch(limit, global.json);
        }
        // Fails only if a pool exists already, and nothing has made one yet. 0 threads: as many as
        // there are cores.
        let _ = rayon::ThreadPoolBuilder::new()
            .num_threads(global.threads.map_or(0, usize::from))
            .stack_size(STACK)
            .build_global();
    }
    /// Ends work at Ctrl-C and at the time limit.
    pub(crate) fn control(&self) -> Control<'_> {
        Control {
            cancelled: Some(match &self.listener {
                Some(listener) => &listener.cancelled,
                None => interrupt::watch(),
            }),
            deadline: self.deadline,
            progress: match &self.listener {
                Some(listener) => Some(&*listener.progress),
                None => None,
            },
        }
    }
    /// Whether the time limit is over.
    pub(crate) fn is_late(&self) -> bool {
        self.deadline.is_some_and(|d| Instant::now() >= d)
    }
    /// A line on stderr about something that may be wrong.
    pub(crate) fn warn(&self, message: impl Display) {
        if self.listener.is_some() {
            let mut warnings = self.warnings.lock().unwrap_or_else(PoisonError::into_inner);
            warnings.push(memory::plain(&message.to_string()));
        } else if !self.global.quiet {
            say(format_args!("warning: {message}"));
        }
    }
    /// A line on stderr about what is going on.
    pub(crate) fn say(&self, message: impl Display) {
        if self.listener.is_none() && !self.global.quiet {
            say(message);
        }
    }
    /// A line on stderr about what is going on, with -v.
    pub(crate) fn note(&self, message: impl Display) {
        if self.global.verbose > 0 {
            self.say(message);
        }
    }
    /// Says why a part of the work has no result, where the rest has one.
    pub(crate) fn complain(&self, failure: &Failure) {
        match self.listener {
            Some(_) => self.warn(&failure.message),
            None => say(failure.text()),
        }
    }
    /// Hands the result over to a caller, who may want more of it than its document.
    pub(crate) fn hand_over(&self, product: impl FnOnce() -> Product) {
        if self.listener.is_some() {
            let mut held = self.product.lock().unwrap_or_else(PoisonError::into_inner);
            *held = Some(product());
        }
    }
    /// Returns what was handed over, and the warnings.
    pub(crate) fn into_parts(self) -> (Option<Product>, Vec<String>) {
        let product = self.product.into_inner();
        let warnings = self.warnings.into_inner();
        (
            product.unwrap_or_else(PoisonError::into_inner),
            warnings.unwrap_or_else(PoisonError::into_inner),
        )
    }
}

/// A closed stderr is no reason to fail.
fn say(message: impl Display) {
    let _ = writeln!(io::stderr().lock(), "{message}");
}

/// What a verb gives back: the exit code, the fields of the JSON document, and what goes to stdout
/// without --json.
pub struct Outcome {
    /// Exit code.
    pub exit: u8,
    /// Fields of the JSON document; null where the verb has printed it.
    pub json: Value,
    /// Bytes for stdout without --json.
    pub stdout: Vec<u8>,
}

impl Outcome {
    /// The outcome of a verb that writes files: a file for stdout takes the place of the table, and
    /// stands as `text` in the document.
    pub(crate) fn of(
        exit: u8,
        mut json: Value,
        file: Vec<u8>,
        table: impl FnOnce() -> String,
    ) -> Self {
        let stdout = if file.is_empty() {
            table().into_bytes()
        } else {
            json["text"] = String::from_utf8_lossy(&file).into();
            file
        };
        Self { exit, json, stdout }
    }
    /// Returns the same with the names of objects in place of their paths.
    pub(crate) fn plain(mut self) -> Self {
        self.json = plain(self.json);
        self
    }
    /// Returns the outcome of a verb whose result is a document, with --json or without.
    pub(crate) fn json(json: Value) -> Self {
        let mut stdout = serde_json::to_vec_pretty(&json).unwrap_or_default();
        stdout.push(b'\n');
        Self {
            exit: DONE,
            json,
            stdout,
        }
    }
    /// The outcome of a verb whose result is a text.
    pub(crate) fn text(stdout: Vec<u8>) -> Self {
        let json = json!({"text": String::from_utf8_lossy(&stdout)});
        Self {
            exit: DONE,
            json,
            stdout,
        }
    }
}

/// Where something is wrong.
#[derive(Clone, Default)]
pub struct Place {
    /// File, as it was named.
    pub file: Option<PathBuf>,
    /// Line, from 1.
    pub line: Option<usize>,
    /// Column, from 1, in characters.
    pub column: Option<usize>,
    /// The key of a JSON object; then the column is one of its text.
    pub key: Option<&'static str>,
    /// The text of the line, to be drawn with a caret.
    pub text: Option<String>,
    /// Coordinates.
    pub point: Option<Point3>,
}

/// Why there is no result: what, where, why, and what to try.
pub struct Failure {
    /// Exit code.
    pub exit: u8,
    /// Short and fixed, for programs.
    pub code: &'static str,
    /// What is wrong, in one sentence.
    pub message: String,
    /// Where.
    pub place: Box<Place>,
    /// Why; may be empty.
    pub why: String,
    /// What to try; may be empty.
    pub hint: String,
}

impl Failure {
    /// A failure with its exit code and code; the rest is added by the methods below.
    pub(crate) fn new(exit: u8, code: &'static str, message: impl Into<String>) -> Self {
        Self {
            exit,
            code,
            message: message.into(),
            place: Box::default(),
            why: String::new(),
            hint: String::new(),
        }
    }
    /// A failure of the arguments.
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self::new(USAGE, "usage", message)
    }
    /// A failure of what was read.
    pub(crate) fn input(code: &'static str, message: impl Into<String>) -> Self {
        Self::new(INPUT, code, message)
    }
    /// A fault of ours in a stage of the work, or (no name) somewhere.
    pub(crate) fn internal(stage: &str) -> Self {
        let place = if stage.is_empty() {
            String::new()
        } else {
            format!(" while it worked on the {stage}")
        };
        let message = format!("internal error: isoform made an error of its own{place}");
        Self::new(INTERNAL, "internal", message)
            .why("this is a fault of isoform, not of its input")
            .hint("please report it, with the command and its input")
    }
    /// A file that cannot be read or written.
    pub(crate) fn file(path: &Path, verb: &str, error: &io::Error) -> Self {
        let mut failure = Self::input("file", format!("cannot {verb} {}: {error}", path.display()));
        failure.place.file = Some(path.to_owned());
        failure
    }
    /// At a place of a text, both numbers from 1.
    pub(crate) fn at(mut self, file: &Path, line: usize, column: usize) -> Self {
        *self.place = Place {
            file: Some(file.to_owned()),
            line: Some(line),
            column: Some(column),
            ..Place::default()
        };
        self
    }
    /// At a point of space.
    pub(crate) fn somewhere(mut self, at: Point3) -> Self {
        self.place.point = Some(at);
        self
    }
    /// With the line of text that the caret stands under.
    pub(crate) fn drawn(mut self, text: &str) -> Self {
        self.place.text = Some(text.to_owned());
        self
    }
    /// With the reason.
    pub(crate) fn why(mut self, why: impl Into<String>) -> Self {
        self.why = why.into();
        self
    }
    /// With what to try.
    pub(crate) fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = hint.into();
        self
    }

    /// Returns the same with the names of objects in place of their paths.
    pub(crate) fn plain(mut self) -> Self {
        for text in [&mut self.message, &mut self.why, &mut self.hint] {
            *text = memory::plain(text);
        }
        if let Some(file) = &mut self.place.file {
            *file = memory::name(file).into();
        }
        self
    }

    /// Its fields in a document.
    pub(crate) fn json(&self) -> Value {
        let mut at = serde_json::Map::new();
        if let Some(file) = &self.place.file {
            at.insert("file".into(), json!(file.display().to_string()));
        }
        if let Some(key) = self.place.key {
            at.insert("key".into(), json!(key));
        }
        if let Some(line) = self.place.line {
            at.insert("line".into(), json!(line));
        }
        if let Some(column) = self.place.column {
            at.insert("column".into(), json!(column));
        }
        if let Some(point) = self.place.point {
            at.insert("at".into(), json!(point));
        }
        json!({"code": self.code, "message": self.message, "where": at, "why": self.why, "hint": self.hint})
    }

    /// The message, its place first, the source line with a caret, why, and what to try.
    pub(crate) fn text(&self) -> String {
        let mut text = "error: ".to_owned();
        if let (Some(file), Some(line), Some(column)) =
            (&self.place.file, self.place.line, self.place.column)
        {
            text += &format!("{}:{line}:{column}: ", file.display());
        }
        text += &self.message;
        if let (Some(line), Some(column), Some(source)) =
            (self.place.line, self.place.column, &self.place.text)
        {
            text += &caret(line, column, source);
        }
        if !self.why.is_empty() {
            text += &format!("\n  because {}", self.why);
        }
        if !self.hint.is_empty() {
            text += &format!("\n  try: {}", self.hint);
        }
        text
    }
}

/// Characters of a source line that are drawn on either side of the caret.
const AROUND: usize = 60;

/// A line of the source with a caret under a column, cut to [`AROUND`] characters on both sides.
fn caret(line: usize, column: usize, source: &str) -> String {
    let skipped = column.saturating_sub(AROUND + 1);
    let visible = |c: char| if c.is_control() { ' ' } else { c };
    let shown: String = source
        .chars()
        .skip(skipped)
        .take(2 * AROUND)
        .map(visible)
        .collect();
    let number = line.to_string();
    let margin = " ".repeat(number.len());
    let before = " ".repeat(column - 1 - skipped);
    format!(
        "\n {margin} |\n {number} | {}\n {margin} | {before}^",
        shown.trim_end()
    )
}

/// Runs a stage of the work. A panic in it is a failure of that stage, so that what was made
/// before it is still there to be written.
pub(crate) fn stage<T>(
    name: &str,
    work: impl FnOnce() -> Result<T, Failure>,
) -> Result<T, Failure> {
    watchdog::enter(name);
    std::panic::catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|_| Err(Failure::internal(name)))
}

/// Runs a verb and reports what comes of it.
pub(crate) fn finish(
    context: &mut Context,
    verb: impl FnOnce(&mut Context) -> Result<Outcome, Failure>,
) -> ExitCode {
    let result = stage("", || verb(context));
    let _over = watchdog::Writing::new();
    match result {
        Ok(outcome) => {
            let bytes = if context.global.json && outcome.json.is_null() {
                Vec::new()
            } else if context.global.json {
                document(![NO_RESULT, INTERNAL].contains(&outcome.exit), outcome.json)
            } else {
                outcome.stdout
            };
            match to_stdout(&bytes) {
                Ok(()) => ExitCode::from(outcome.exit),
                Err(error) => fail(false, &Failure::file(Path::new("stdout"), "write", &error)),
            }
        }
        Err(failure) => fail(context.global.json, &failure),
    }
}

/// Ends the run with a failure, from another thread than the one that works.
pub(crate) fn give_up(json: bool, failure: &Failure) -> ! {
    let _ = fail(json, failure);
    std::process::exit(i32::from(failure.exit))
}

/// Reports a failure; its exit code.
fn fail(json: bool, failure: &Failure) -> ExitCode {
    say(failure.text());
    if json {
        let _ = to_stdout(&document(false, json!({"error": failure.json()})));
    }
    ExitCode::from(failure.exit)
}

/// Arguments that clap refuses: exit 1, and 0 for --help and --version.
pub(crate) fn usage(error: clap::Error) -> ExitCode {
    let _ = error.print();
    if !error.use_stderr() {
        return ExitCode::from(DONE);
    }
    if std::env::args_os().any(|a| a == "--json") {
        let failure = crate::refused(error);
        let _ = to_stdout(&document(false, json!({"error": failure.json()})));
    }
    ExitCode::from(USAGE)
}

/// Returns a document with the names of objects in place of their paths.
fn plain(json: Value) -> Value {
    match json {
        Value::String(text) => memory::plain(&text).into(),
        Value::Array(items) => items.into_iter().map(plain).collect(),
        Value::Object(fields) => fields.into_iter().map(|(k, v)| (k, plain(v))).collect(),
        other => other,
    }
}

/// One JSON document: schema and ok before the rest.
pub(crate) fn document(ok: bool, fields: Value) -> Vec<u8> {
    let all = json_of(&Document::new(ok, fields));
    let mut bytes = serde_json::to_vec_pretty(&all).unwrap_or_default();
    bytes.push(b'\n');
    bytes
}

/// Prints what a verb says before it is done: the text, or the document with --json.
pub(crate) fn announce(context: &Context, json: Value, text: String) -> Result<(), Failure> {
    if context.listener.is_some() {
        return Ok(());
    }
    let bytes = if context.global.json {
        document(true, json)
    } else {
        text.into_bytes()
    };
    to_stdout(&bytes).map_err(|e| Failure::file(Path::new("stdout"), "write", &e))
}

/// A reader that has seen enough is no error.
fn to_stdout(bytes: &[u8]) -> io::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}

/// Number of the next temporary file.
static TURN: AtomicU64 = AtomicU64::new(0);

/// Writes a file whole or not at all: to a temporary file beside it, which is then renamed. Devices
/// and pipes are written to.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if memory::write(path, bytes) {
        return Ok(());
    }
    let failed = |e: io::Error| Failure::file(path, "write", &e);
    let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if fs::metadata(&path).is_ok_and(|m| !m.is_file()) {
        return fs::write(&path, bytes).map_err(failed);
    }
    let name = path
        .file_name()
        .ok_or_else(|| failed(io::Error::from(ErrorKind::InvalidFilename)))?;
    // Threads of one process may write one file at a time.
    let turn = TURN.fetch_add(1, Ordering::Relaxed);
    let temporary = path.with_file_name(format!(
        ".{}.{}.{turn}.tmp",
        name.to_string_lossy(),
        std::process::id()
    ));
    let written = fs::write(&temporary, bytes).and_then(|()| fs::rename(&temporary, &path));
    written.map_err(|e| {
        let _ = fs::remove_file(&temporary);
        failed(e)
    })
}

/// Finds out before the work whether the folder of a file exists.
pub(crate) fn check_folder(path: &Path) -> Result<(), Failure> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let folder = folder.filter(|_| memory::find(path).is_none());
    let Some(folder) = folder.filter(|f| !f.is_dir()) else {
        return Ok(());
    };
    let mut failure = Failure::input(
        "not-writable",
        format!(
            "cannot write {}: there is no folder {}",
            path.display(),
            folder.display()
        ),
    );
    failure.place.file = Some(path.to_owned());
    Err(failure.hint("make the folder first"))
}

/// Reads a file, or stdin for `-`.
pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>, Failure> {
    if path == Path::new("-") {
        let mut bytes = Vec::new();
        return match io::Read::read_to_end(&mut io::stdin().lock(), &mut bytes) {
            Ok(_) => Ok(bytes),
            Err(e) => Err(Failure::file(Path::new("stdin"), "read", &e)),
        };
    }
    match memory::find(path) {
        Some(Object::Bytes { bytes, .. }) => return Ok(Vec::clone(&bytes)),
        Some(other) => return Err(other.instead_of("a file of another kind", path)),
        None => {}
    }
    fs::read(path).map_err(|e| Failure::file(path, "read", &e))
}

/// Text as UTF-8, else as Latin-1, which old programs have in their comments.
pub(crate) fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes)
        .unwrap_or_else(|e| e.into_bytes().into_iter().map(char::from).collect())
}

/// Reads one of the values that have names.
pub(crate) fn one_of<T: Copy + Send + Sync + 'static>(
    all: &'static [(&'static str, T)],
) -> impl TypedValueParser<Value = T> {
    let names = PossibleValuesParser::new(all.iter().map(|named| named.0));
    names.map(|name| {
        let named = all.iter().find(|named| named.0 == name);
        named.expect("the name is one of them").1
    })
}

/// A list of numbers with commas: `1,2.5,-3`.
pub(crate) fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |word: &str| match word.trim().parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err(format!("`{}` is not a number", word.trim())),
    };
    if text.trim().is_empty() {
        Ok(Vec::new())
    } else {
        text.split(',').map(number).collect()
    }
}

/// A positive number.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    match numbers(text)?.as_slice() {
        &[v] if v > 0.0 => Ok(v),
        _ => Err("a positive number is expected".to_owned()),
    }
}

/// A box: six numbers.
pub(crate) fn region(text: &str) -> Result<Aabb, String> {
    match numbers(text)?.as_slice() {
        &[a, b, c, d, e, f] if a < d && b < e && c < f => Ok(Aabb {
            lo: [a, b, c],
            hi: [d, e, f],
        }),
        _ => Err("six numbers are expected, lower corner and upper corner".to_owned()),
    }
}

/// A length (power 1), an area (2) or a volume (3) to ten digits, with its unit if it is known.
pub(crate) fn measure(v: f64, unit: Option<&str>, power: usize) -> String {
    let digits = (9 - v.abs().max(1e-9).log10().floor() as i32).clamp(0, 17) as usize;
    let number = if v == 0.0 || (1e-6..1e12).contains(&v.abs()) {
        let fixed = format!("{v:.digits$}");
        match fixed.contains('.') {
            true => fixed.trim_end_matches('0').trim_end_matches('.').to_owned(),
            false => fixed,
        }
    } else {
        format!("{v:e}")
    };
    match unit.filter(|u| !u.is_empty()) {
        Some(unit) => format!("{number} {unit}{}", ["", "", "²", "³"][power]),
        None => number,
    }
}

/// A report as JSON.
pub(crate) fn json_of(report: &impl Serialize) -> Value {
    serde_json::to_value(report).expect("reports have texts for keys")
}

/// Puts the fields of one document behind another's.
pub(crate) fn add(json: &mut Value, more: Value) {
    if let (Value::Object(json), Value::Object(more)) = (json, more) {
        json.extend(more);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measures_have_ten_digits_and_a_unit() {
        assert_eq!(measure(24591.080299382007, Some("mm"), 3), "24591.0803 mm³");
        assert_eq!(measure(24591.123456789, None, 3), "24591.12346");
        assert_eq!(measure(100.0, Some("in"), 2), "100 in²");
        assert_eq!(
            measure(0.00012345678901234, Some("m"), 1),
            "0.000123456789 m"
        );
        assert_eq!(measure(12345678901.5, None, 3), "12345678902");
        assert_eq!(measure(0.0, Some("mm"), 3), "0 mm³");
    }

    #[test]
    fn durations() {
        assert_eq!(duration("30s"), Ok(Duration::from_secs(30)));
        assert_eq!(duration("1.5m"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("250ms"), Ok(Duration::from_millis(250)));
        assert_eq!(duration("7"), Ok(Duration::from_secs(7)));
        for bad in ["", "s", "1y", "-1s", "1e999s"] {
            assert!(duration(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_panic_is_a_failure_of_its_stage() {
        let Err(failure) = stage("mesh", || -> Result<(), Failure> { panic!("on purpose") }) else {
            panic!("it has a result");
        };
        assert_eq!((failure.exit, failure.code), (INTERNAL, "internal"));
        assert!(failure.message.contains("mesh"), "{}", failure.message);
        assert_eq!(stage("", || Ok(1)).ok(), Some(1));
    }

    #[test]
    fn the_caret_stands_under_the_column() {
        let drawn = caret(12, 5, "\tab c");
        assert_eq!(drawn, "\n    |\n 12 |  ab c\n    |     ^");
        let long = caret(1, 1000, &"x".repeat(2000));
        assert!(long.lines().all(|l| l.chars().count() < 140));
    }
}
