//! The formats: one line each.

use crate::input::{Input, Result};
use crate::{At, ErrorKind, ReadOptions, ReadReport, WriteOptions};
use crate::{e57, las, obj, off, pcd, ply, stl, text};
use isoform_geom::PointCloud;
use std::io::{self, Write};

/// How sure a look at the first bytes is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Sniff {
    No,
    /// It could be.
    Maybe,
    /// It says so.
    Yes,
}

pub(crate) type ReadFn = fn(&mut Input<'_>, &ReadOptions, &mut ReadReport) -> Result<PointCloud>;
pub(crate) type WriteFn = fn(&PointCloud, &mut dyn Write, &WriteOptions) -> io::Result<()>;

/// A file format.
pub struct Format {
    /// Short name.
    pub name: &'static str,
    /// Endings of file names, lower case, without the dot; the first is the usual one.
    pub extensions: &'static [&'static str],
    /// Name in sentences.
    pub title: &'static str,
    pub(crate) sniff: fn(&[u8]) -> Sniff,
    pub(crate) read: ReadFn,
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

#[rustfmt::skip]
static FORMATS: [Format; 9] = [
    Format { name: "ply", extensions: &["ply"], title: "PLY", sniff: ply::sniff, read: ply::read, write: Some(ply::write), keeps_triangles: true },
    Format { name: "e57", extensions: &["e57"], title: "E57", sniff: e57::sniff, read: e57::read, write: None, keeps_triangles: false },
    Format { name: "las", extensions: &["las", "laz"], title: "LAS/LAZ", sniff: las::sniff, read: las::read, write: None, keeps_triangles: false },
    Format { name: "pcd", extensions: &["pcd"], title: "PCD", sniff: pcd::sniff, read: pcd::read, write: None, keeps_triangles: false },
    Format { name: "off", extensions: &["off", "coff", "noff", "cnoff"], title: "OFF", sniff: off::sniff, read: off::read, write: None, keeps_triangles: false },
    Format { name: "stl", extensions: &["stl"], title: "STL", sniff: stl::sniff, read: stl::read, write: None, keeps_triangles: false },
    Format { name: "obj", extensions: &["obj"], title: "OBJ", sniff: obj::sniff, read: obj::read, write: None, keeps_triangles: false },
    Format { name: "xyz", extensions: &["xyz", "txt", "asc", "pts", "xyzn", "xyzrgb", "dat"], title: "XYZ text", sniff: text::sniff, read: text::read, write: Some(text::write_xyz), keeps_triangles: false },
    Format { name: "csv", extensions: &["csv", "tsv"], title: "CSV", sniff: |_| Sniff::No, read: text::read, write: Some(text::write_csv), keeps_triangles: false },
];

/// Known by name or first bytes, and not read here: endings, first bytes, and what they are.
#[rustfmt::skip]
static OTHERS: [(&[&str], &[u8], &str); 22] = [
    (&["3mf"], b"", "a 3MF package; export it as STL or PLY"),
    (&["zip", "npz", "kmz", "usdz"], b"PK\x03\x04", "a ZIP archive; unpack it first"),
    (&["gz", "tgz"], b"\x1f\x8b", "compressed with gzip; unpack it first"),
    (&["zst"], b"\x28\xb5\x2f\xfd", "compressed with zstd; unpack it first"),
    (&["xz"], b"\xfd7zXZ", "compressed with xz; unpack it first"),
    (&["step", "stp"], b"ISO-10303-21", "a STEP file: exact surfaces, not points; export a mesh or a point cloud from the CAD system"),
    (&["iges", "igs"], b"", "an IGES file: exact surfaces, not points; export a mesh or a point cloud from the CAD system"),
    (&["msh"], b"$MeshFormat", "a Gmsh mesh; export its surface as STL, PLY or OFF"),
    (&["vtk"], b"# vtk DataFile", "a VTK file; save it as PLY or CSV"),
    (&["vtu", "vtp", "vti"], b"<VTKFile", "a VTK XML file; save it as PLY or CSV"),
    (&["glb"], b"glTF", "a glTF model; export it as PLY or OBJ"),
    (&["gltf", "fbx", "dae", "3ds", "blend", "wrl", "x3d", "amf", "usd", "usda", "usdc"], b"", "a scene format; export it as PLY, OBJ or STL"),
    (&["dxf", "dwg", "sat", "x_t", "prt", "sldprt", "ipt", "catpart", "3dm", "brep"], b"", "a CAD format; export a mesh or a point cloud"),
    (&["inp", "bdf", "nas", "mesh"], b"", "a finite element mesh; export its surface as STL or PLY"),
    (&["rcp", "rcs", "fls", "fws", "zfs", "ptx", "pod", "cl3", "imp"], b"", "a scanner maker's format; export E57, LAS or PLY"),
    (&["bin"], b"CCB2", "a CloudCompare project; save it as PLY or LAS"),
    (&["npy"], b"\x93NUMPY", "a NumPy array; save it with numpy.savetxt as .xyz"),
    (&["h5", "hdf5", "nc"], b"\x89HDF", "an HDF5 file; export it as PLY or CSV"),
    (&["hf"], b"", "a HyperFun model, not points"),
    (&["json"], b"", "a JSON file, not points"),
    (&["pdf"], b"%PDF", "a PDF document"),
    (&["png", "jpg", "jpeg", "tif", "tiff", "exr"], b"\x89PNG", "an image"),
];

/// All formats.
pub fn formats() -> &'static [Format] {
    &FORMATS
}

/// A format by name or ending, in any case, with or without the dot.
pub fn format_named(name: &str) -> Option<&'static Format> {
    let name = name.strip_prefix('.').unwrap_or(name).to_ascii_lowercase();
    FORMATS
        .iter()
        .find(|f| f.name == name || f.extensions.contains(&name.as_str()))
}

/// Ending of a file name, lower case.
pub(crate) fn extension(name: &str) -> Option<String> {
    let name = name.rsplit(['/', '\\']).next().unwrap_or(name);
    name.rsplit_once('.').map(|(_, e)| e.to_ascii_lowercase())
}

fn readable() -> String {
    FORMATS
        .iter()
        .map(|f| format!("{} (.{})", f.title, f.extensions.join(", .")))
        .collect::<Vec<_>>()
        .join("; ")
}

/// The format asked for, else the one the content states, else the one the name states, else the
/// likeliest.
pub(crate) fn choose(
    input: &mut Input<'_>,
    asked: Option<&str>,
    warnings: &mut Vec<String>,
) -> Result<&'static Format> {
    const WHAT: &str = "cannot tell how to read the file";
    const HINT: &str =
        "convert it to one of these, or name the format if the file has another ending";
    let unsupported = |input: &Input<'_>, what: &str| {
        let why = format!("it is {what}. Formats that can be read: {}", readable());
        input.error(
            ErrorKind::UnsupportedFormat,
            At::File,
            "this kind of file is not read here",
            why,
            HINT,
        )
    };
    if let Some(asked) = asked {
        return format_named(asked).ok_or_else(|| {
            let low = asked.trim_start_matches('.').to_ascii_lowercase();
            match OTHERS.iter().find(|o| o.0.contains(&low.as_str())) {
                Some(other) => unsupported(input, other.2),
                None => {
                    let why = format!(
                        "no format is called \"{}\". There are: {}",
                        crate::input::shorten(asked),
                        readable()
                    );
                    input.error(
                        ErrorKind::UnknownFormat,
                        At::File,
                        WHAT,
                        why,
                        "use one of these names",
                    )
                }
            }
        });
    }
    let head = input.head(4096)?;
    if head.is_empty() {
        return Err(input.error(
            ErrorKind::Empty,
            At::File,
            "cannot read points",
            "the file is empty",
            "check how it was made",
        ));
    }
    let named = extension(&input.name);
    let by_name = named
        .as_deref()
        .and_then(|e| FORMATS.iter().find(|f| f.extensions.contains(&e)));
    let sure = FORMATS.iter().find(|f| (f.sniff)(&head) == Sniff::Yes);
    if let (Some(n), Some(s)) = (by_name, sure)
        && n.name != s.name
        && (n.sniff)(&head) != Sniff::Yes
    {
        warnings.push(format!(
            "the name says {}, but the content is {}: read as {}",
            n.title, s.title, s.title
        ));
        return Ok(s);
    }
    if let Some(format) = by_name.or(sure) {
        // A package or an archive under a wrong name is better called what it is.
        let magic = OTHERS
            .iter()
            .find(|o| o.1.len() >= 4 && head.starts_with(o.1));
        return match magic {
            Some(other) if (format.sniff)(&head) != Sniff::Yes => Err(unsupported(input, other.2)),
            _ => Ok(format),
        };
    }
    if let Some(e) = &named
        && let Some(other) = OTHERS.iter().find(|o| o.0.contains(&e.as_str()))
    {
        return Err(unsupported(input, other.2));
    }
    if let Some(other) = OTHERS
        .iter()
        .find(|o| !o.1.is_empty() && head.starts_with(o.1))
    {
        return Err(unsupported(input, other.2));
    }
    if let Some(format) = FORMATS.iter().find(|f| (f.sniff)(&head) == Sniff::Maybe) {
        warnings.push(format!(
            "the name does not tell the format; by its content the file was read as {}",
            format.title
        ));
        return Ok(format);
    }
    let why = format!(
        "neither its name nor its content is of a known kind. Formats that can be read: {}",
        readable()
    );
    Err(input.error(ErrorKind::UnknownFormat, At::File, WHAT, why, HINT))
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
        assert_eq!(
            chosen("part.3mf", b"PK\x03\x04"),
            (Err(ErrorKind::UnsupportedFormat), 0)
        );
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

    #[test]
    fn no_ending_is_taken_twice() {
        let mut all: Vec<&str> = FORMATS
            .iter()
            .flat_map(|f| f.extensions)
            .chain(OTHERS.iter().flat_map(|o| o.0))
            .copied()
            .collect();
        all.sort_unstable();
        assert!(all.windows(2).all(|w| w[0] != w[1]), "{all:?}");
    }
}
