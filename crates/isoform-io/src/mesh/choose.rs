//! Choice of the format of a mesh file: by request, else by content, else by the ending of its
//! name, else by likelihood.

use super::format::{MeshFormat, MeshReadFn, encoding};
use super::registry::{mesh_format_named, mesh_formats};
use crate::format::{SNIFFED_BYTES, Sniff, extension};
use crate::input::{Input, Result, shorten};
use crate::{At, ErrorKind, ReadError};

const MESH_CHOICE_FAILURE: &str = "cannot tell how to read the mesh";

/// Returns the format of a file and its reader; oddities are added to the warnings.
pub(super) fn choose(
    input: &mut Input<'_>,
    asked: Option<&str>,
    warnings: &mut Vec<String>,
) -> Result<(&'static MeshFormat, MeshReadFn)> {
    let format = match asked {
        Some(asked) => {
            mesh_format_named(encoding(asked).0).ok_or_else(|| no_such_format(input, asked))?
        }
        None => guess(input, warnings)?,
    };
    let read = format.read.ok_or_else(|| not_read(input, format))?;
    Ok((format, read))
}

/// Guesses the format of a file if none was requested.
fn guess(input: &mut Input<'_>, warnings: &mut Vec<String>) -> Result<&'static MeshFormat> {
    let head = input.head(SNIFFED_BYTES)?;
    if head.is_empty() {
        return Err(input.error(
            ErrorKind::Empty,
            At::File,
            "cannot read a mesh",
            "the file is empty",
            "check how it was made",
        ));
    }
    let named = extension(&input.name).and_then(|e| mesh_format_named(&e));
    let stated = by_content(&head, Sniff::Yes);
    if let (Some(named), Some(stated)) = (named, stated)
        && (named.sniff)(&head) != Sniff::Yes
    {
        warnings.push(format!(
            "the name says {}, but the content is {}: read as {}",
            named.title, stated.title, stated.title
        ));
        return Ok(stated);
    }
    if let Some(format) = named.or(stated) {
        return Ok(format);
    }
    let likeliest = by_content(&head, Sniff::Maybe).ok_or_else(|| unknown(input))?;
    warnings.push(format!(
        "the name does not tell the format; by its content the file was read as {}",
        likeliest.title
    ));
    Ok(likeliest)
}

/// Returns the first format in the registry whose content test gives this certainty.
pub(crate) fn by_content(head: &[u8], sure: Sniff) -> Option<&'static MeshFormat> {
    mesh_formats().iter().find(|f| (f.sniff)(head) == sure)
}

/// Lists the names of the readable formats, for messages.
fn readable() -> String {
    let names = mesh_formats().iter().filter(|f| f.is_readable());
    names.map(|f| f.name).collect::<Vec<_>>().join(", ")
}

/// Returns the error for a write-only format.
fn not_read(input: &Input<'_>, format: &MeshFormat) -> ReadError {
    let why = format!(
        "{} is written but not read. Meshes are read from {}",
        format.title,
        readable()
    );
    let hint = "convert it to one of these";
    input.error(
        ErrorKind::UnsupportedFormat,
        At::File,
        MESH_CHOICE_FAILURE,
        why,
        hint,
    )
}

/// Returns the error for an unknown format name.
fn no_such_format(input: &Input<'_>, asked: &str) -> ReadError {
    let why = format!(
        "no format of meshes is called \"{}\". Meshes are read from {}",
        shorten(asked),
        readable()
    );
    let hint = "use one of these names";
    input.error(
        ErrorKind::UnknownFormat,
        At::File,
        MESH_CHOICE_FAILURE,
        why,
        hint,
    )
}

/// Returns the error for a file whose format neither name nor content reveal.
fn unknown(input: &Input<'_>) -> ReadError {
    let why = format!(
        "neither its name nor its content is of a known kind. Meshes are read from {}",
        readable()
    );
    let hint = "convert it to one of these, or name the format";
    input.error(
        ErrorKind::UnknownFormat,
        At::File,
        MESH_CHOICE_FAILURE,
        why,
        hint,
    )
}
