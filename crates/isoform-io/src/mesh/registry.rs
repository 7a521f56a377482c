//! The formats of meshes: one line each.

use super::{WriteFn, bdf, glb, inp, msh, obj, off, ply, stl, surface, three_mf, vtu};
use crate::input::{Input, Result, shorten};
use crate::registry::{Sniff, extension};
use crate::{At, ErrorKind, ReadReport};
use isoform_geom::Mesh;

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
    /// Whether it holds tetrahedra; else only triangles are written.
    pub volume: bool,
    /// Whether it holds mid-edge nodes.
    pub second_order: bool,
    /// Whether coordinates have 32 bits, except in text.
    pub single: bool,
    /// What becomes of the numbers per node.
    pub(super) columns: Columns,
    /// What is kept, for lists of formats.
    pub about: &'static str,
    pub(super) sniff: fn(&[u8]) -> Sniff,
    pub(super) read: Option<ReadFn>,
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

const NO: fn(&[u8]) -> Sniff = |_| Sniff::No;

#[rustfmt::skip]
static FORMATS: [MeshFormat; 11] = [
    MeshFormat { name: "msh", extensions: &["msh"], title: "Gmsh 4.1", volume: true, second_order: true, single: false, columns: Columns::None, about: "parts, curves, regions and corners as physical groups; text, or binary as msh-binary", sniff: msh::sniff, read: Some(msh::read), write: msh::write },
    MeshFormat { name: "msh2", extensions: &["msh2"], title: "Gmsh 2.2", volume: true, second_order: true, single: false, columns: Columns::None, about: "as msh, for older programs", sniff: msh::sniff, read: Some(msh::read), write: msh::write2 },
    MeshFormat { name: "vtu", extensions: &["vtu"], title: "VTK", volume: true, second_order: true, single: false, columns: Columns::None, about: "for ParaView; tags of parts, regions and curves as cell data", sniff: vtu::sniff, read: Some(vtu::read), write: vtu::write },
    MeshFormat { name: "inp", extensions: &["inp"], title: "Abaqus/CalculiX", volume: true, second_order: true, single: false, columns: Columns::None, about: "elements by region, node sets and surfaces by part, no step", sniff: inp::sniff, read: Some(inp::read), write: inp::write },
    MeshFormat { name: "bdf", extensions: &["bdf", "nas"], title: "Nastran", volume: true, second_order: true, single: false, columns: Columns::None, about: "bulk data, a property per part and region", sniff: NO, read: None, write: bdf::write },
    MeshFormat { name: "stl", extensions: &["stl"], title: "STL", volume: false, second_order: false, single: true, columns: Columns::None, about: "triangles in 32 bits; text with a solid per part as stl-ascii", sniff: crate::stl::sniff, read: Some(surface::read_stl), write: stl::write },
    MeshFormat { name: "obj", extensions: &["obj"], title: "OBJ", volume: false, second_order: false, single: false, columns: Columns::Texture, about: "triangles in a group per part; parameters as texture coordinates", sniff: crate::obj::sniff, read: Some(surface::read_obj), write: obj::write },
    MeshFormat { name: "ply", extensions: &["ply"], title: "PLY", volume: false, second_order: false, single: false, columns: Columns::All, about: "triangles with the tag of their part; all numbers per node", sniff: crate::ply::sniff, read: Some(surface::read_ply), write: ply::write },
    MeshFormat { name: "off", extensions: &["off"], title: "OFF", volume: false, second_order: false, single: false, columns: Columns::None, about: "triangles without groups", sniff: crate::off::sniff, read: Some(surface::read_off), write: off::write },
    MeshFormat { name: "3mf", extensions: &["3mf"], title: "3MF", volume: false, second_order: false, single: false, columns: Columns::None, about: "for printing; a material per part, with the unit", sniff: NO, read: None, write: three_mf::write },
    MeshFormat { name: "glb", extensions: &["glb"], title: "glTF", volume: false, second_order: false, single: true, columns: Columns::All, about: "for viewers; a coloured material per part, in 32 bits about the centre; a chequered texture along parameters, other numbers as attributes", sniff: NO, read: None, write: glb::write },
];

/// All formats of meshes.
pub fn mesh_formats() -> &'static [MeshFormat] {
    &FORMATS
}

/// A format by name or ending, in any case, with or without the dot.
pub fn mesh_format_named(name: &str) -> Option<&'static MeshFormat> {
    let name = name.strip_prefix('.').unwrap_or(name).to_ascii_lowercase();
    FORMATS
        .iter()
        .find(|f| f.name == name || f.extensions.contains(&name.as_str()))
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

/// The format asked for, else the one the content states, else the one the name states, else the
/// likeliest.
pub(super) fn choose(
    input: &mut Input<'_>,
    asked: Option<&str>,
    warnings: &mut Vec<String>,
) -> Result<(&'static MeshFormat, ReadFn)> {
    const WHAT: &str = "cannot tell how to read the mesh";
    let can = || {
        FORMATS
            .iter()
            .filter(|f| f.is_readable())
            .map(|f| f.name)
            .collect::<Vec<_>>()
            .join(", ")
    };
    let usable = |format: &'static MeshFormat, input: &Input<'_>| match format.read {
        Some(read) => Ok((format, read)),
        None => {
            let why = format!(
                "{} is written but not read. Meshes are read from {}",
                format.title,
                can()
            );
            Err(input.error(
                ErrorKind::UnsupportedFormat,
                At::File,
                WHAT,
                why,
                "convert it to one of these",
            ))
        }
    };
    if let Some(asked) = asked {
        return match mesh_format_named(encoding(asked).0) {
            Some(format) => usable(format, input),
            None => {
                let why = format!(
                    "no format of meshes is called \"{}\". Meshes are read from {}",
                    shorten(asked),
                    can()
                );
                Err(input.error(
                    ErrorKind::UnknownFormat,
                    At::File,
                    WHAT,
                    why,
                    "use one of these names",
                ))
            }
        };
    }
    let head = input.head(4096)?;
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
    let sure = FORMATS.iter().find(|f| (f.sniff)(&head) == Sniff::Yes);
    match (named, sure) {
        (Some(n), Some(s)) if (n.sniff)(&head) != Sniff::Yes => {
            warnings.push(format!(
                "the name says {}, but the content is {}: read as {}",
                n.title, s.title, s.title
            ));
            usable(s, input)
        }
        (Some(format), _) | (None, Some(format)) => usable(format, input),
        (None, None) => match FORMATS.iter().find(|f| (f.sniff)(&head) == Sniff::Maybe) {
            Some(format) => {
                warnings.push(format!(
                    "the name does not tell the format; by its content the file was read as {}",
                    format.title
                ));
                usable(format, input)
            }
            None => {
                let why = format!(
                    "neither its name nor its content is of a known kind. Meshes are read from {}",
                    can()
                );
                Err(input.error(
                    ErrorKind::UnknownFormat,
                    At::File,
                    WHAT,
                    why,
                    "convert it to one of these, or name the format",
                ))
            }
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_ending_is_taken_twice() {
        let mut all: Vec<&str> = FORMATS.iter().flat_map(|f| f.extensions).copied().collect();
        all.sort_unstable();
        assert!(all.windows(2).all(|w| w[0] != w[1]), "{all:?}");
        assert_eq!(encoding("stl-ascii"), ("stl", Some(true)));
        assert_eq!(encoding("msh"), ("msh", None));
    }
}
