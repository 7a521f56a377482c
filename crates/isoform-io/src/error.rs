//! What can go wrong at the door, in four parts: what, where, why, and what to try.

use std::fmt;

/// Where in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum At {
    /// The file as a whole.
    File,
    /// Line and column, both from 1; column 0 is the whole line.
    Line {
        /// Line, from 1.
        line: u64,
        /// Byte column, from 1; 0 for the whole line.
        column: u64,
    },
    /// Byte offset, from 0.
    Byte(u64),
}

/// A file and a position in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Name of the file, as the caller gave it.
    pub file: String,
    /// Position.
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

/// Kinds of [`ReadError`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// The file cannot be opened or read.
    Unreadable,
    /// There is not a byte in it.
    Empty,
    /// Neither name nor content tell the format.
    UnknownFormat,
    /// A known format that is not read here (or not in this build).
    UnsupportedFormat,
    /// The header is wrong.
    Header,
    /// Something stands where a number should.
    Number,
    /// A face names a point that is not there.
    Index,
    /// The file ends early.
    Truncated,
    /// The content contradicts itself.
    Corrupt,
    /// More than this program or 32-bit indices can hold.
    TooLarge,
}

impl ErrorKind {
    /// A short text that will not change.
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

/// Why a file could not be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {what}: {why}")]
pub struct ReadError {
    /// Kind, for programs.
    pub kind: ErrorKind,
    /// What failed.
    pub what: &'static str,
    /// Where.
    pub place: Place,
    /// Why, with the offending value.
    pub why: String,
    /// What to try.
    pub hint: &'static str,
}

impl ReadError {
    /// A short text per kind that will not change.
    pub fn code(&self) -> &'static str {
        self.kind.code()
    }
}

/// The code of a mesh that does not hold together: a fault of whoever made it.
pub const BAD_MESH: &str = "bad-mesh";

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {what}: {why}")]
pub struct WriteError {
    /// A short text that will not change: `disk-full`, `not-writable`, `format-unknown`,
    /// `bad-mesh`, `write-failed`.
    pub code: &'static str,
    /// What failed.
    pub what: &'static str,
    /// The file.
    pub file: String,
    /// Why.
    pub why: String,
    /// What to try.
    pub hint: &'static str,
}

impl WriteError {
    /// A failure of the system to open or write a file.
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
