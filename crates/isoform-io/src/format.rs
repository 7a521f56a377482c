//! Description of a file format: its names, its recognition, and its reader and writer.
//!
//! The formats themselves are listed in `registry.rs`.

use crate::input::{Input, Result};
use crate::options::{ReadOptions, ReadReport, WriteOptions};
use isoform_geom::PointCloud;
use std::io::{self, Write};

/// Number of bytes at the start of a file on which content is tested.
pub(crate) const SNIFFED_BYTES: usize = 4096;

/// Certainty of a content test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Sniff {
    /// The content is of another format or inconclusive.
    No,
    /// The content may be of this format.
    Maybe,
    /// The content states this format.
    Yes,
}

/// Reader of points, which adds counts and warnings to the report.
pub(crate) type ReadFn = fn(&mut Input<'_>, &ReadOptions, &mut ReadReport) -> Result<PointCloud>;
/// Writer of points.
pub(crate) type WriteFn = fn(&PointCloud, &mut dyn Write, &WriteOptions) -> io::Result<()>;

/// File format of points.
pub struct Format {
    /// Short name.
    pub name: &'static str,
    /// Endings of file names, in lower case, without the dot; the usual one first.
    pub extensions: &'static [&'static str],
    /// Name in sentences.
    pub title: &'static str,
    /// Content test on the first bytes of a file.
    pub(crate) sniff: fn(&[u8]) -> Sniff,
    /// Reader.
    pub(crate) read: ReadFn,
    /// Writer; `None` if the format is read-only.
    pub(crate) write: Option<WriteFn>,
    /// True if triangles, normals and colours survive writing; for the warnings of
    /// [`write_path`](crate::write_path).
    pub(crate) keeps_triangles: bool,
}

impl Format {
    /// Returns true if the format can be written.
    pub fn is_writable(&self) -> bool {
        self.write.is_some()
    }
}

impl std::fmt::Debug for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Format({})", self.name)
    }
}

/// File format that is recognised but not read.
pub(crate) struct Foreign {
    /// Endings of file names, in lower case, without the dot.
    pub(crate) extensions: &'static [&'static str],
    /// Signature at the start of such files; empty if they have none.
    pub(crate) magic: &'static [u8],
    /// Description and remedy, completing a sentence that begins with "it is".
    pub(crate) what: &'static str,
}

/// Returns the ending of a file name, in lower case.
pub(crate) fn extension(name: &str) -> Option<String> {
    let name = name.rsplit(['/', '\\']).next().unwrap_or(name);
    name.rsplit_once('.').map(|(_, e)| e.to_ascii_lowercase())
}
