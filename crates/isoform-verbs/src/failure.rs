//! Failures of verbs and their exit codes: the problem, its place, the reason and the remedy.
//!
//! Exit codes: 0 done, 1 usage, 2 input, 3 partial, 4 no result, 5 an internal error, 130 after
//! Ctrl-C.

use crate::interrupt;
use isoform::geom::Point3;
use serde_json::{Value, json};
use std::io;
use std::path::{Path, PathBuf};

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
/// Internal error.
pub(crate) const INTERNAL: u8 = 5;

/// Position of an error: a place in a file, or a point in space.
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

/// Reason for a missing result: code, message, position, cause and hint.
pub struct Failure {
    /// Exit code.
    pub exit: u8,
    /// Short and fixed, for programs.
    pub code: &'static str,
    /// Description of the problem, in one sentence.
    pub message: String,
    /// Position of the problem.
    pub place: Box<Place>,
    /// Why; may be empty.
    pub why: String,
    /// Suggested remedy; may be empty.
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
    /// Work that Ctrl-C interrupted, or that the time limit ended; `more` adds to the hint.
    pub(crate) fn stopped(message: impl Into<String>, more: &str) -> Self {
        if interrupt::happened() {
            return Self::new(interrupt::INTERRUPTED, "interrupted", message);
        }
        Self::new(NO_RESULT, "time-limit", message).hint(format!("a longer --time-limit{more}"))
    }
    /// A failure of the arguments.
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self::new(USAGE, "usage", message)
    }
    /// A failure of what was read.
    pub(crate) fn input(code: &'static str, message: impl Into<String>) -> Self {
        Self::new(INPUT, code, message)
    }
    /// Makes an internal error of a stage of the work; an empty name stands for any stage.
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
    /// Adds a position in a text, line and column counted from 1.
    pub(crate) fn at(mut self, file: &Path, line: usize, column: usize) -> Self {
        *self.place = Place {
            file: Some(file.to_owned()),
            line: Some(line),
            column: Some(column),
            ..Place::default()
        };
        self
    }
    /// Adds a point in space.
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

    /// Returns the fields of the failure in a JSON document.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_caret_stands_under_the_column() {
        let drawn = caret(12, 5, "\tab c");
        assert_eq!(drawn, "\n    |\n 12 |  ab c\n    |     ^");
        let long = caret(1, 1000, &"x".repeat(2000));
        assert!(long.lines().all(|l| l.chars().count() < 140));
    }
}
