//! What a format of meshes is: its names, what it keeps, and the functions that read and write it.

use super::options::MeshWriteOptions;
use crate::ReadReport;
use crate::format::Sniff;
use crate::input::{Input, Result};
use isoform_geom::Mesh;
use std::io::{self, Write};

/// A writer of meshes.
pub(super) type WriteFn = fn(&Mesh, &mut dyn Write, &MeshWriteOptions) -> io::Result<()>;
/// A reader of meshes, with warnings in the report.
pub(super) type ReadFn = fn(&mut Input<'_>, &mut ReadReport) -> Result<Mesh>;

/// What a format keeps of a mesh's columns.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Columns {
    /// Nothing.
    None,
    /// The parameters u and v, as texture coordinates.
    Texture,
    /// All.
    All,
}

/// A file format of meshes.
pub struct MeshFormat {
    /// Short name.
    pub name: &'static str,
    /// Endings of file names, lower case, without the dot; the first is the usual one.
    pub extensions: &'static [&'static str],
    /// Name in sentences.
    pub title: &'static str,
    /// Whether it holds tetrahedra and wedges; else only a surface of triangles is written.
    pub volume: bool,
    /// Whether it holds mid-edge nodes.
    pub second_order: bool,
    /// Whether coordinates have 32 bits, except in text.
    pub single: bool,
    /// What becomes of the numbers per node.
    pub(super) columns: Columns,
    /// What is kept, for lists of formats.
    pub about: &'static str,
    /// How sure the first bytes of a file make this format.
    pub(super) sniff: fn(&[u8]) -> Sniff,
    /// Its reader, if it is read.
    pub(super) read: Option<ReadFn>,
    /// Its writer.
    pub(super) write: WriteFn,
}

impl MeshFormat {
    /// Whether it can be read; all can be written.
    pub fn is_readable(&self) -> bool {
        self.read.is_some()
    }
    /// Whether it can be written.
    pub fn is_writable(&self) -> bool {
        true
    }
}

impl std::fmt::Debug for MeshFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "MeshFormat({})", self.name)
    }
}

/// A name without `-ascii` or `-binary` behind it, and whether it asks for text.
pub(super) fn encoding(name: &str) -> (&str, Option<bool>) {
    for (tail, ascii) in [("-ascii", true), ("-binary", false)] {
        if let Some(bare) = name.strip_suffix(tail) {
            return (bare, Some(ascii));
        }
    }
    (name, None)
}
