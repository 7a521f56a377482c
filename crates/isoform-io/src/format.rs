//! What a file format is: its names, how it is recognised, and the functions that read and write
//! it.
//!
//! The formats themselves stand in the list of `registry.rs`.

use crate::input::{Input, Result};
use crate::options::{ReadOptions, ReadReport, WriteOptions};
use isoform_geom::PointCloud;
use std::io::{self, Write};

/// How sure a look at the first bytes is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Sniff {
    /// The content is none of this format, or tells nothing.
    No,
    /// The content could be of this format.
    Maybe,
    /// The content states this format.
    Yes,
}

/// A reader of points: the cloud, with counts and warnings in the report.
pub(crate) type ReadFn = fn(&mut Input<'_>, &ReadOptions, &mut ReadReport) -> Result<PointCloud>;
/// A writer of points.
pub(crate) type WriteFn = fn(&PointCloud, &mut dyn Write, &WriteOptions) -> io::Result<()>;

/// A file format.
pub struct Format {
    /// Short name.
    pub name: &'static str,
    /// Endings of file names, lower case, without the dot; the first is the usual one.
    pub extensions: &'static [&'static str],
    /// Name in sentences.
    pub title: &'static str,
    /// How sure the first bytes of a file make this format.
    pub(crate) sniff: fn(&[u8]) -> Sniff,
    /// Its reader.
    pub(crate) read: ReadFn,
    /// Its writer, if it is written.
    pub(crate) write: Option<WriteFn>,
    /// Whether triangles, normals and colours survive writing; for the warnings of
    /// [`write_path`](crate::write_path).
    pub(crate) keeps_triangles: bool,
}

impl Format {
    /// Whether it can be written.
    pub fn is_writable(&self) -> bool {
        self.write.is_some()
    }
}

impl std::fmt::Debug for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Format({})", self.name)
    }
}

/// A kind of file that is known and not read here.
pub(crate) struct Foreign {
    /// Endings of file names, lower case, without the dot.
    pub(crate) extensions: &'static [&'static str],
    /// The first bytes of such files; empty where they have none of their own.
    pub(crate) magic: &'static [u8],
    /// What the file is and what to do about it, for a sentence that begins with "it is".
    pub(crate) what: &'static str,
}

/// Ending of a file name, lower case.
pub(crate) fn extension(name: &str) -> Option<String> {
    let name = name.rsplit(['/', '\\']).next().unwrap_or(name);
    name.rsplit_once('.').map(|(_, e)| e.to_ascii_lowercase())
}
