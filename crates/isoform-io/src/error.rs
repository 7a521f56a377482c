//! Errors of readers and writers in four parts: what failed, where, why, and what to try.

use std::fmt;

/// Position in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum At {
    /// The file as a whole.
    File,
    /// Line and column.
    Line {
        /// Line, from 1.
        line: u64,
        /// Byte column, from 1; 0 for the whole line.
        column: u64,
    },
    /// Byte offset, from 0.
    Byte(u64),
}

/// File and position in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Name of the file, as given by the caller.
    pub file: String,
    /// Position in the file.
    pub at: At,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.at {
            At::File => write!(f, "{}", self.file),
            At::Line { line, column: 0 } => write!(f, "{}:{line}", self.file),
            At::Line { line, column } => write!(f, "{}:{line}:{column}", self.file),
            At::Byte(offset) => write!(f, "{}, byte {offset}", self.file),
        }
    }
}

/// Kind of a [`ReadError`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// The file cannot be opened or read.
    Unreadable,
    /// The file is empty.
    Empty,
    /// Neither name nor content reveal the format.
    UnknownFormat,
    /// The format is known but not supported (or not in this build).
    UnsupportedFormat,
    /// The header is invalid.
    Header,
    /// A number is malformed.
    Number,
    /// A face refers to a missing point.
    Index,
    /// The file ends early.
    Truncated,
    /// The content is inconsistent.
    Corrupt,
    /// The content exceeds memory or 32-bit indices.
    TooLarge,
}

impl ErrorKind {
    /// Returns a short stable identifier.
    pub fn code(self) -> &'static str {
        match self {
            Self::Unreadable => "file-unreadable",
            Self::Empty => "file-empty",
            Self::UnknownFormat => "format-unknown",
            Self::UnsupportedFormat => "format-unsupported",
            Self::Header => "bad-header",
            Self::Number => "bad-number",
            Self::Index => "bad-index",
            Self::Truncated => "file-truncated",
            Self::Corrupt => "file-corrupt",
            Self::TooLarge => "too-large",
        }
    }
}

/// Reason why a file could not be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {what}: {why}")]
pub struct ReadError {
    /// Kind, for programs.
    pub kind: ErrorKind,
    /// Operation that failed.
    pub what: &'static str,
    /// File and position.
    pub place: Place,
    /// Reason, with the offending value.
    pub why: String,
    /// Suggested remedy.
    pub hint: &'static str,
}

impl ReadError {
    /// Returns a short stable identifier of the kind.
    pub fn code(&self) -> &'static str {
        self.kind.code()
    }
}

/// Code of an inconsistent mesh, which is a bug of its producer.
pub const BAD_MESH: &str = "bad-mesh";

/// Reason why a file could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {what}: {why}")]
pub struct WriteError {
    /// Short stable identifier: `disk-full`, `not-writable`, `format-unknown`, `bad-mesh`,
    /// `write-failed`.
    pub code: &'static str,
    /// Operation that failed.
    pub what: &'static str,
    /// Name of the file.
    pub file: String,
    /// Reason.
    pub why: String,
    /// Suggested remedy.
    pub hint: &'static str,
}

impl WriteError {
    /// Returns the error for a failure of the operating system to open or write a file.
    pub(crate) fn io(what: &'static str, file: String, e: &std::io::Error) -> Self {
        use std::io::ErrorKind as K;
        let (code, hint) = match e.kind() {
            K::StorageFull | K::QuotaExceeded => {
                ("disk-full", "free some space or write elsewhere")
            }
            K::PermissionDenied | K::ReadOnlyFilesystem => (
                "not-writable",
                "check the permissions of the folder or write elsewhere",
            ),
            K::NotFound | K::NotADirectory => ("not-writable", "make the folder first"),
            K::IsADirectory => ("not-writable", "give the name of a file, not of a folder"),
            _ => ("write-failed", "try again or write elsewhere"),
        };
        Self {
            code,
            what,
            file,
            why: e.to_string(),
            hint,
        }
    }
}
