//! VTK's .pvtu: an unstructured grid distributed over several .vtu files (VTK file formats,
//! "Parallel file formats").

use super::out::{Out, on_one_line};
use super::vtu::GROUP_NAMES;
use crate::xml::escape;
use crate::{WriteError, write_atomic};
use std::io::{self, Write};
use std::path::Path;

/// Writes the file that joins .vtu files of [`write_mesh`](crate::write_mesh) to one grid. `pieces`
/// are their paths, relative to its folder.
///
/// ```
/// # let folder = std::env::temp_dir().join(format!("isoform-pvtu-{}", std::process::id()));
/// # std::fs::create_dir_all(&folder)?;
/// let path = folder.join("big.pvtu");
/// isoform_io::write_pvtu(&path, &["big_0.vtu".to_owned(), "big_1.vtu".to_owned()])?;
/// let text = std::fs::read_to_string(&path)?;
/// assert!(text.contains("<Piece Source=\"big_1.vtu\"/>"));
/// # std::fs::remove_dir_all(&folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// If the file cannot be written.
pub fn write_pvtu(path: &Path, pieces: &[String]) -> Result<(), WriteError> {
    write_atomic(path, |out| write(out, pieces))
}

fn write(out: &mut dyn Write, pieces: &[String]) -> io::Result<()> {
    let mut out = Out::new(out);
    out.str("<?xml version=\"1.0\"?>\n<VTKFile type=\"PUnstructuredGrid\" version=\"1.0\"");
    out.str(" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n");
    out.str("<PUnstructuredGrid GhostLevel=\"0\">\n<PPoints>\n");
    out.str("<PDataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\"/>\n");
    out.str("</PPoints>\n<PCellData Scalars=\"part\">\n");
    for name in GROUP_NAMES {
        out.str("<PDataArray type=\"Int32\" Name=\"").str(name);
        out.str("\" NumberOfComponents=\"1\"/>\n");
    }
    out.str("</PCellData>\n");
    for piece in pieces {
        let source = escape(&on_one_line(piece));
        out.str("<Piece Source=\"")
            .str(&source)
            .str("\"/>")
            .line()?;
    }
    out.str("</PUnstructuredGrid>\n</VTKFile>").line()?;
    out.flush()
}
