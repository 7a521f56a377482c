//! The formats of meshes: one line each.

use super::{WriteFn, inp, msh, obj, stl, vtu};

/// A file format of meshes.
pub struct MeshFormat {
    /// Short name.
    pub name: &'static str,
    /// Endings of file names, lower case, without the dot; the first is the usual one.
    pub extensions: &'static [&'static str],
    /// Name in sentences.
    pub title: &'static str,
    /// Whether tetrahedra are written.
    pub volume: bool,
    /// Whether mid-edge nodes are written.
    pub second_order: bool,
    /// Whether coordinates have 32 bits, except in text.
    pub single: bool,
    /// What is kept, for lists of formats.
    pub about: &'static str,
    pub(super) write: Option<WriteFn>,
}

impl MeshFormat {
    /// Whether it can be written.
    pub fn is_writable(&self) -> bool {
        self.write.is_some()
    }
}

impl std::fmt::Debug for MeshFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "MeshFormat({})", self.name)
    }
}

#[rustfmt::skip]
static FORMATS: [MeshFormat; 6] = [
    MeshFormat { name: "msh", extensions: &["msh"], title: "Gmsh 4.1", volume: true, second_order: true, single: false, about: "parts, curves, regions and corners as physical groups", write: Some(msh::write) },
    MeshFormat { name: "msh2", extensions: &["msh2"], title: "Gmsh 2.2", volume: true, second_order: true, single: false, about: "as msh, for older programs", write: Some(msh::write2) },
    MeshFormat { name: "vtu", extensions: &["vtu"], title: "VTK", volume: true, second_order: true, single: false, about: "for ParaView; tags of parts, regions and curves as cell data", write: Some(vtu::write) },
    MeshFormat { name: "inp", extensions: &["inp"], title: "Abaqus/CalculiX", volume: true, second_order: true, single: false, about: "elements, node sets and surfaces by part, no step", write: Some(inp::write) },
    MeshFormat { name: "stl", extensions: &["stl"], title: "STL", volume: false, second_order: false, single: true, about: "triangles in 32 bits", write: Some(stl::write) },
    MeshFormat { name: "obj", extensions: &["obj"], title: "OBJ", volume: false, second_order: false, single: false, about: "triangles in a group per part", write: Some(obj::write) },
];

/// All formats of meshes.
pub fn mesh_formats() -> &'static [MeshFormat] {
    &FORMATS
}

/// A format by name or ending, in any case, with or without the dot.
pub fn mesh_format_named(name: &str) -> Option<&'static MeshFormat> {
    let name = name.strip_prefix('.').unwrap_or(name).to_ascii_lowercase();
    FORMATS.iter().find(|f| f.name == name || f.extensions.contains(&name.as_str()))
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
