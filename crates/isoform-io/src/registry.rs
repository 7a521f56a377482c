//! Registry of the point formats, one line each, and of foreign formats that are only recognised.

use crate::format::{Foreign, Format, Sniff};
use crate::{e57, las, obj, off, pcd, ply, stl, text, three_mf};

/// All point formats, in the order in which content is tested; plain text last.
#[rustfmt::skip]
static FORMATS: [Format; 10] = [
    Format { name: "ply", extensions: &["ply"], title: "PLY", sniff: ply::sniff, read: ply::read, write: Some(ply::write), keeps_triangles: true },
    Format { name: "e57", extensions: &["e57"], title: "E57", sniff: e57::sniff, read: e57::read, write: None, keeps_triangles: false },
    Format { name: "las", extensions: &["las", "laz"], title: "LAS/LAZ", sniff: las::sniff, read: las::read, write: None, keeps_triangles: false },
    Format { name: "pcd", extensions: &["pcd"], title: "PCD", sniff: pcd::sniff, read: pcd::read, write: None, keeps_triangles: false },
    Format { name: "off", extensions: &["off", "coff", "noff", "cnoff"], title: "OFF", sniff: off::sniff, read: off::read, write: None, keeps_triangles: false },
    Format { name: "stl", extensions: &["stl"], title: "STL", sniff: stl::sniff, read: stl::read, write: None, keeps_triangles: false },
    Format { name: "obj", extensions: &["obj"], title: "OBJ", sniff: obj::sniff, read: obj::read, write: None, keeps_triangles: false },
    Format { name: "xyz", extensions: &["xyz", "txt", "asc", "pts", "xyzn", "xyzrgb", "dat"], title: "XYZ text", sniff: text::sniff, read: text::read, write: Some(text::write_xyz), keeps_triangles: false },
    Format { name: "csv", extensions: &["csv", "tsv"], title: "CSV", sniff: |_| Sniff::No, read: text::read, write: Some(text::write_csv), keeps_triangles: false },
    Format { name: three_mf::FORMAT_NAME, extensions: &["3mf"], title: "3MF", sniff: three_mf::sniff, read: three_mf::read, write: None, keeps_triangles: false },
];

/// Formats recognised by ending or signature, but not read.
#[rustfmt::skip]
static FOREIGN: [Foreign; 21] = [
    Foreign { extensions: &["zip", "npz", "kmz", "usdz"], magic: b"PK\x03\x04", what: "a ZIP archive; unpack it first" },
    Foreign { extensions: &["gz", "tgz"], magic: b"\x1f\x8b", what: "compressed with gzip; unpack it first" },
    Foreign { extensions: &["zst"], magic: b"\x28\xb5\x2f\xfd", what: "compressed with zstd; unpack it first" },
    Foreign { extensions: &["xz"], magic: b"\xfd7zXZ", what: "compressed with xz; unpack it first" },
    Foreign { extensions: &["step", "stp"], magic: b"ISO-10303-21", what: "a STEP file: exact surfaces, not points; isoform mesh part.step -o part.stl makes triangles of it" },
    Foreign { extensions: &["iges", "igs"], magic: b"", what: "an IGES file: exact surfaces, not points; export a mesh or a point cloud from the CAD system" },
    Foreign { extensions: &["msh"], magic: b"$MeshFormat", what: "a Gmsh mesh; export its surface as STL, PLY or OFF" },
    Foreign { extensions: &["vtk"], magic: b"# vtk DataFile", what: "a VTK file; save it as PLY or CSV" },
    Foreign { extensions: &["vtu", "vtp", "vti"], magic: b"<VTKFile", what: "a VTK XML file; save it as PLY or CSV" },
    Foreign { extensions: &["glb"], magic: b"glTF", what: "a glTF model; export it as PLY or OBJ" },
    Foreign { extensions: &["gltf", "fbx", "dae", "3ds", "blend", "wrl", "x3d", "amf", "usd", "usda", "usdc"], magic: b"", what: "a scene format; export it as PLY, OBJ or STL" },
    Foreign { extensions: &["dxf", "dwg", "sat", "x_t", "prt", "sldprt", "ipt", "catpart", "3dm", "brep"], magic: b"", what: "a CAD format; export a mesh or a point cloud" },
    Foreign { extensions: &["inp", "bdf", "nas", "mesh"], magic: b"", what: "a finite element mesh; export its surface as STL or PLY" },
    Foreign { extensions: &["rcp", "rcs", "fls", "fws", "zfs", "ptx", "pod", "cl3", "imp"], magic: b"", what: "a scanner maker's format; export E57, LAS or PLY" },
    Foreign { extensions: &["bin"], magic: b"CCB2", what: "a CloudCompare project; save it as PLY or LAS" },
    Foreign { extensions: &["npy"], magic: b"\x93NUMPY", what: "a NumPy array; save it with numpy.savetxt as .xyz" },
    Foreign { extensions: &["h5", "hdf5", "nc"], magic: b"\x89HDF", what: "an HDF5 file; export it as PLY or CSV" },
    Foreign { extensions: &["hf"], magic: b"", what: "a HyperFun model, not points" },
    Foreign { extensions: &["json"], magic: b"", what: "a JSON file, not points" },
    Foreign { extensions: &["pdf"], magic: b"%PDF", what: "a PDF document" },
    Foreign { extensions: &["png", "jpg", "jpeg", "tif", "tiff", "exr"], magic: b"\x89PNG", what: "an image" },
];

/// Returns all point formats.
///
/// ```
/// let writable: Vec<&str> =
///     isoform_io::formats().iter().filter(|f| f.is_writable()).map(|f| f.name).collect();
/// assert_eq!(writable, ["ply", "xyz", "csv"]);
/// ```
pub fn formats() -> &'static [Format] {
    &FORMATS
}

/// Returns the formats that are recognised but not read.
pub(crate) fn foreign() -> &'static [Foreign] {
    &FOREIGN
}

/// Returns a format by name or ending, in any case, with or without the dot.
pub fn format_named(name: &str) -> Option<&'static Format> {
    let name = name.strip_prefix('.').unwrap_or(name).to_ascii_lowercase();
    FORMATS
        .iter()
        .find(|f| f.name == name || f.extensions.contains(&name.as_str()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_ending_is_taken_twice() {
        let mut all: Vec<&str> = FORMATS
            .iter()
            .flat_map(|f| f.extensions)
            .chain(FOREIGN.iter().flat_map(|f| f.extensions))
            .copied()
            .collect();
        all.sort_unstable();
        assert!(all.windows(2).all(|w| w[0] != w[1]), "{all:?}");
    }
}
