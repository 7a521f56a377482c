//! Description of a mesh format: its names, what it stores, and its reader and writer.

use super::options::MeshWriteOptions;
use crate::format::Sniff;
use crate::input::{self, Input};
use crate::{ReadReport, WriteError};
use isoform_geom::Mesh;
use std::io::{self, Write};
use std::path::Path;

/// Writer of meshes.
pub(super) type MeshWriteFn = fn(&Mesh, &mut dyn Write, &MeshWriteOptions) -> io::Result<()>;
/// Writer of the files of a folder.
pub(super) type MeshFolderFn = fn(&Mesh, &Path, &MeshWriteOptions) -> Result<(), WriteError>;
/// Reader of meshes, which adds warnings to the report.
pub(super) type MeshReadFn = fn(&mut Input<'_>, &mut ReadReport) -> input::Result<Mesh>;

/// Columns of a mesh that a format stores.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum StoredColumns {
    /// No columns.
    None,
    /// Parameters u and v, as texture coordinates.
    Texture,
    /// All columns.
    All,
}

/// File format of meshes.
pub struct MeshFormat {
    /// Short name.
    pub name: &'static str,
    /// Endings of file names, in lower case, without the dot; the usual one first.
    pub extensions: &'static [&'static str],
    /// Name in sentences.
    pub title: &'static str,
    /// True if the format stores tetrahedra; otherwise only the surface is written, as triangles.
    pub volume: bool,
    /// True if the format stores wedges and quadrilaterals; otherwise a wedge is written as three
    /// tetrahedra, and a quadrilateral as two triangles.
    pub wedges: bool,
    /// True if the format stores mid-edge nodes.
    pub second_order: bool,
    /// True if binary coordinates have 32 bits.
    pub single: bool,
    /// Columns that the format stores.
    pub(super) columns: StoredColumns,
    /// Summary of what is stored, for lists of formats.
    pub about: &'static str,
    /// Content test on the first bytes of a file.
    pub(super) sniff: fn(&[u8]) -> Sniff,
    /// Reader; `None` if the format is write-only.
    pub(super) read: Option<MeshReadFn>,
    /// Writer of a folder; `None` if the format is a single file.
    pub(super) folder: Option<MeshFolderFn>,
    /// Writer of a file; fails if the format is a folder.
    pub(super) write: MeshWriteFn,
}

impl MeshFormat {
    /// Returns true if the format can be read.
    pub fn is_readable(&self) -> bool {
        self.read.is_some()
    }
    /// Returns true if the format is a folder of files, and cannot be written to a stream.
    pub fn is_folder(&self) -> bool {
        self.folder.is_some()
    }
    /// Returns true: all mesh formats can be written.
    pub fn is_writable(&self) -> bool {
        true
    }
}

impl std::fmt::Debug for MeshFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "MeshFormat({})", self.name)
    }
}

/// Splits a suffix `-ascii` or `-binary` off a name; the second value is true if it asks for text.
pub(super) fn encoding(name: &str) -> (&str, Option<bool>) {
    for (tail, ascii) in [("-ascii", true), ("-binary", false)] {
        if let Some(bare) = name.strip_suffix(tail) {
            return (bare, Some(ascii));
        }
    }
    (name, None)
}
