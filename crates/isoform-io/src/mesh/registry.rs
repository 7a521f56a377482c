//! List of mesh formats, one line each.

use super::format::{MeshFormat, StoredColumns};
use super::{bdf, glb, inp, msh, obj, off, openfoam, ply, stl, surface, three_mf, vtu, xdmf};
use crate::format::{Sniff, extension};
use std::path::Path;

/// Content test of formats that are write-only or unrecognisable by content.
const NO_SNIFF: fn(&[u8]) -> Sniff = |_| Sniff::No;

/// All mesh formats.
#[rustfmt::skip]
static FORMATS: [MeshFormat; 14] = [
    MeshFormat { name: "msh", extensions: &["msh"], title: "Gmsh 4.1", volume: true, wedges: true, second_order: true, single: false, columns: StoredColumns::None, about: "parts, curves, regions and corners as physical groups; text, or binary as msh-binary", sniff: msh::sniff, read: Some(msh::read), folder: None, write: msh::write },
    MeshFormat { name: "msh2", extensions: &["msh2"], title: "Gmsh 2.2", volume: true, wedges: true, second_order: true, single: false, columns: StoredColumns::None, about: "as msh, for older programs", sniff: msh::sniff, read: Some(msh::read), folder: None, write: msh::write2 },
    MeshFormat { name: "vtu", extensions: &["vtu"], title: "VTK", volume: true, wedges: true, second_order: true, single: false, columns: StoredColumns::None, about: "for ParaView; tags of parts, regions and curves as cell data", sniff: vtu::sniff, read: Some(vtu::read), folder: None, write: vtu::write },
    MeshFormat { name: "inp", extensions: &["inp"], title: "Abaqus/CalculiX", volume: true, wedges: true, second_order: true, single: false, columns: StoredColumns::None, about: "elements by region, node sets and surfaces by part, an example of a step as comments", sniff: inp::sniff, read: Some(inp::read), folder: None, write: inp::write },
    MeshFormat { name: "bdf", extensions: &["bdf", "nas"], title: "Nastran", volume: true, wedges: true, second_order: true, single: false, columns: StoredColumns::None, about: "bulk data, a property per part and region", sniff: NO_SNIFF, read: None, folder: None, write: bdf::write },
    MeshFormat { name: "stl", extensions: &["stl"], title: "STL", volume: false, wedges: false, second_order: false, single: true, columns: StoredColumns::None, about: "triangles in 32 bits; text with a solid per part as stl-ascii", sniff: crate::stl::sniff, read: Some(surface::read_stl), folder: None, write: stl::write },
    MeshFormat { name: "obj", extensions: &["obj"], title: "OBJ", volume: false, wedges: false, second_order: false, single: false, columns: StoredColumns::Texture, about: "triangles in a group per part; parameters as texture coordinates", sniff: crate::obj::sniff, read: Some(surface::read_obj), folder: None, write: obj::write },
    MeshFormat { name: "ply", extensions: &["ply"], title: "PLY", volume: false, wedges: false, second_order: false, single: false, columns: StoredColumns::All, about: "triangles with the tag of their part; all numbers per node", sniff: crate::ply::sniff, read: Some(surface::read_ply), folder: None, write: ply::write },
    MeshFormat { name: "off", extensions: &["off"], title: "OFF", volume: false, wedges: false, second_order: false, single: false, columns: StoredColumns::None, about: "triangles without groups", sniff: crate::off::sniff, read: Some(surface::read_off), folder: None, write: off::write },
    MeshFormat { name: "3mf", extensions: &["3mf"], title: "3MF", volume: false, wedges: false, second_order: false, single: false, columns: StoredColumns::None, about: "for printing; a material per part, with the unit", sniff: crate::three_mf::sniff, read: Some(surface::read_3mf), folder: None, write: three_mf::write },
    MeshFormat { name: "glb", extensions: &["glb"], title: "glTF", volume: false, wedges: false, second_order: false, single: true, columns: StoredColumns::All, about: "for viewers; a coloured material per part, in 32 bits about the centre; a chequered texture along parameters, other numbers as attributes", sniff: NO_SNIFF, read: None, folder: None, write: glb::write },
    MeshFormat { name: "xdmf", extensions: &["xdmf", "xmf"], title: "XDMF", volume: true, wedges: false, second_order: true, single: false, columns: StoredColumns::None, about: "for FEniCS, meshio, ParaView: tetrahedra with the tag of their region, as text", sniff: NO_SNIFF, read: None, folder: None, write: xdmf::write },
    MeshFormat { name: "xdmf-faces", extensions: &[], title: "XDMF of faces", volume: true, wedges: false, second_order: true, single: false, columns: StoredColumns::None, about: "the triangles to xdmf with the tag of their part, on the same nodes", sniff: NO_SNIFF, read: None, folder: None, write: xdmf::write_faces },
    MeshFormat { name: "openfoam", extensions: &[], title: "OpenFOAM", volume: true, wedges: true, second_order: false, single: false, columns: StoredColumns::None, about: "the folder constant/polyMesh in metres: a patch per part, a zone of cells per region", sniff: NO_SNIFF, read: None, folder: Some(openfoam::write_folder), write: openfoam::write },
];

/// Returns all mesh formats.
///
/// ```
/// let second: Vec<&str> =
///     isoform_io::mesh_formats().iter().filter(|f| f.second_order).map(|f| f.name).collect();
/// assert_eq!(second, ["msh", "msh2", "vtu", "inp", "bdf", "xdmf", "xdmf-faces"]);
/// ```
pub fn mesh_formats() -> &'static [MeshFormat] {
    &FORMATS
}

/// Returns the format with a name or ending, in any case, with or without the dot.
pub fn mesh_format_named(name: &str) -> Option<&'static MeshFormat> {
    let name = name.strip_prefix('.').unwrap_or(name).to_ascii_lowercase();
    FORMATS
        .iter()
        .find(|f| f.name == name || f.extensions.contains(&name.as_str()))
}

/// Returns the format that the name of a file or folder tells: by its ending, or `polyMesh`.
///
/// ```
/// use isoform_io::mesh_format_for;
/// let named = |path: &str| mesh_format_for(path.as_ref()).map(|f| f.name);
/// assert_eq!(named("a/part.vtu"), Some("vtu"));
/// assert_eq!(named("a/constant/polyMesh"), Some("openfoam"));
/// assert_eq!(named("vtu"), None);
/// ```
pub fn mesh_format_for(path: &Path) -> Option<&'static MeshFormat> {
    let name = path.file_name()?.to_string_lossy();
    match name.eq_ignore_ascii_case(openfoam::FOLDER) {
        true => mesh_format_named("openfoam"),
        false => mesh_format_named(&extension(&name)?),
    }
}

#[cfg(test)]
mod tests {
    use super::super::format::encoding;
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
