//! Choice of the format of a file: by request, else by content, else by the ending of its name,
//! else by likelihood.

use crate::format::{Foreign, Format, SNIFFED_BYTES, Sniff, extension};
use crate::input::{Input, Result, shorten};
use crate::registry::{foreign, format_named, formats};
use crate::{At, ErrorKind, ReadError, three_mf};

/// Minimum length of a signature that overrides the name of a file. Shorter ones occur by chance.
pub(crate) const MIN_SIGNATURE_BYTES: usize = 4;
const FORMAT_CHOICE_FAILURE: &str = "cannot tell how to read the file";

/// Returns the format of a file; oddities are added to the warnings.
pub(crate) fn choose(
    input: &mut Input<'_>,
    asked: Option<&str>,
    warnings: &mut Vec<String>,
) -> Result<&'static Format> {
    if let Some(asked) = asked {
        return format_named(asked).ok_or_else(|| no_such_format(input, asked));
    }
    let head = input.head(SNIFFED_BYTES)?;
    if head.is_empty() {
        return Err(input.error(
            ErrorKind::Empty,
            At::File,
            "cannot read points",
            "the file is empty",
            "check how it was made",
        ));
    }
    let ending = extension(&input.name);
    let by_name = ending.as_deref().and_then(by_ending);
    let stated = by_content(&head, Sniff::Yes);
    if let (Some(named), Some(stated)) = (by_name, stated)
        && named.name != stated.name
        && (named.sniff)(&head) != Sniff::Yes
    {
        warnings.push(format!(
            "the name says {}, but the content is {}: read as {}",
            named.title, stated.title, stated.title
        ));
        return Ok(stated);
    }
    if let Some(format) = by_name.or(stated) {
        return unless_foreign(input, format, &head);
    }
    let foreign = ending.as_deref().and_then(foreign_by_ending);
    if let Some(foreign) = foreign.or_else(|| foreign_by_magic(&head, 1)) {
        return Err(unsupported(input, foreign));
    }
    let likeliest = by_content(&head, Sniff::Maybe).ok_or_else(|| unknown(input))?;
    warnings.push(format!(
        "the name does not tell the format; by its content the file was read as {}",
        likeliest.title
    ));
    Ok(likeliest)
}

/// Returns the format with an ending (in lower case, without the dot).
pub(crate) fn by_ending(ending: &str) -> Option<&'static Format> {
    formats().iter().find(|f| f.extensions.contains(&ending))
}

/// Returns the first format in the registry whose content test gives this certainty.
pub(crate) fn by_content(head: &[u8], sure: Sniff) -> Option<&'static Format> {
    formats().iter().find(|f| (f.sniff)(head) == sure)
}

/// Returns the foreign format with an ending.
pub(crate) fn foreign_by_ending(ending: &str) -> Option<&'static Foreign> {
    foreign().iter().find(|f| f.extensions.contains(&ending))
}

/// Returns the foreign format whose signature of at least `least` bytes starts the file.
pub(crate) fn foreign_by_magic(head: &[u8], least: usize) -> Option<&'static Foreign> {
    foreign()
        .iter()
        .find(|f| f.magic.len() >= least && head.starts_with(f.magic))
}

/// Returns the format, or an error if the file is a package or an archive with a wrong ending.
fn unless_foreign(
    input: &Input<'_>,
    format: &'static Format,
    head: &[u8],
) -> Result<&'static Format> {
    // A 3MF package is an archive; its reader explains what an invalid one lacks.
    let is_package = format.name == three_mf::FORMAT_NAME;
    match foreign_by_magic(head, MIN_SIGNATURE_BYTES) {
        Some(foreign) if !is_package && (format.sniff)(head) != Sniff::Yes => {
            Err(unsupported(input, foreign))
        }
        _ => Ok(format),
    }
}

/// Lists titles and endings of all formats, for messages.
fn readable() -> String {
    formats()
        .iter()
        .map(|f| format!("{} (.{})", f.title, f.extensions.join(", .")))
        .collect::<Vec<_>>()
        .join("; ")
}

const CONVERSION_HINT: &str =
    "convert it to one of these, or name the format if the file has another ending";

/// Returns the error for a foreign format, which names it.
fn unsupported(input: &Input<'_>, foreign: &Foreign) -> ReadError {
    let what = foreign.what;
    let why = format!("it is {what}. Formats that can be read: {}", readable());
    let failed = "this kind of file is not read here";
    input.error(
        ErrorKind::UnsupportedFormat,
        At::File,
        failed,
        why,
        CONVERSION_HINT,
    )
}

/// Returns the error for a file whose format neither name nor content reveal.
fn unknown(input: &Input<'_>) -> ReadError {
    let why = format!(
        "neither its name nor its content is of a known kind. Formats that can be read: {}",
        readable()
    );
    input.error(
        ErrorKind::UnknownFormat,
        At::File,
        FORMAT_CHOICE_FAILURE,
        why,
        CONVERSION_HINT,
    )
}

/// Returns the error for a requested format that is foreign or unknown.
fn no_such_format(input: &Input<'_>, asked: &str) -> ReadError {
    let ending = asked.trim_start_matches('.').to_ascii_lowercase();
    if let Some(foreign) = foreign_by_ending(&ending) {
        return unsupported(input, foreign);
    }
    let (name, readable) = (shorten(asked), readable());
    let why = format!("no format is called \"{name}\". There are: {readable}");
    let hint = "use one of these names";
    input.error(
        ErrorKind::UnknownFormat,
        At::File,
        FORMAT_CHOICE_FAILURE,
        why,
        hint,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;

    fn chosen(name: &str, bytes: &[u8]) -> (std::result::Result<&'static str, ErrorKind>, usize) {
        let mut warnings = Vec::new();
        let mut input = Input::open(Source::Bytes { name, bytes }).expect("bytes");
        let found = choose(&mut input, None, &mut warnings);
        (found.map(|f| f.name).map_err(|e| e.kind), warnings.len())
    }

    #[test]
    fn by_name_then_by_content() {
        assert_eq!(chosen("A.PLY", b"ply\nformat ascii 1.0\n"), (Ok("ply"), 0));
        assert_eq!(chosen("a.xyz", b"ply\nformat ascii 1.0\n"), (Ok("ply"), 1));
        assert_eq!(chosen("-", b"1 2 3\n4 5 6\n"), (Ok("xyz"), 1));
        assert_eq!(
            chosen("-", b"# made by hand\nv 1 2 3\nv 4 5 6\n"),
            (Ok("obj"), 1)
        );
        assert_eq!(chosen("a.CSV", b"x,y,z\n1,2,3\n"), (Ok("csv"), 0));
        assert_eq!(chosen("scan", b"LASF"), (Ok("las"), 0));
        assert_eq!(chosen("part.3mf", b"PK\x03\x04"), (Ok("3mf"), 0));
        assert_eq!(chosen("-", b"PK\x03\x04 3D/3dmodel.model"), (Ok("3mf"), 0));
        assert_eq!(
            chosen("part.xyz", b"PK\x03\x04"),
            (Err(ErrorKind::UnsupportedFormat), 0)
        );
        assert_eq!(
            chosen("part", b"ISO-10303-21;\n"),
            (Err(ErrorKind::UnsupportedFormat), 0)
        );
        assert_eq!(
            chosen("part", b"\x00\x01\x02"),
            (Err(ErrorKind::UnknownFormat), 0)
        );
        assert_eq!(chosen("a.ply", b""), (Err(ErrorKind::Empty), 0));
    }
}
