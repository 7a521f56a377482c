//! Recognition of a file's kind, for programs that were given a file of an unexpected kind.

use crate::choose::{
    MIN_SIGNATURE_BYTES, by_content, by_ending, foreign_by_ending, foreign_by_magic,
};
use crate::format::{Format, Sniff, extension};
use crate::mesh::{MeshFormat, mesh_by_content, mesh_format_named};
use crate::text;

/// Kind of a file, as far as its first bytes and its name reveal it.
#[derive(Clone, Copy, Debug)]
pub enum FileKind {
    /// Points, or a mesh in a format whose corners are read as points: XYZ, LAS, PLY, STL ...
    Points(&'static Format),
    /// Mesh in a format for meshes only: Gmsh, VTK, Abaqus ...
    Mesh(&'static MeshFormat),
    /// Recognised kind that is not read, with its description for a sentence that begins with "it
    /// is".
    Foreign(&'static str),
}

/// Endings of kinds that have their own readers elsewhere.
const ENDINGS_READ_ELSEWHERE: [&str; 5] = ["hf", "json", "step", "stp", "brep"];

/// Determines the kind of a file from its name and first bytes: by the signature, else by the
/// ending, else by the appearance of the content. Text counts as points only if a row of numbers
/// occurs near its beginning, whatever its name.
///
/// ```
/// use isoform_io::{FileKind, file_kind};
/// let kind = file_kind("part.hf", b"ply\nformat ascii 1.0\n");
/// assert!(matches!(kind, Some(FileKind::Points(f)) if f.title == "PLY"));
/// assert!(file_kind("part.txt", b"my_model(x[3], a[1]) { my_model = 1; }").is_none());
/// ```
pub fn file_kind(name: &str, head: &[u8]) -> Option<FileKind> {
    let stated = by_content(head, Sniff::Yes).map(FileKind::Points);
    let stated = stated.or_else(|| mesh_by_content(head, Sniff::Yes).map(FileKind::Mesh));
    let ending = extension(name).filter(|e| !ENDINGS_READ_ELSEWHERE.contains(&e.as_str()));
    let stated = stated.or_else(|| ending.as_deref().and_then(|e| by_name(e, head)));
    let magic = || foreign_by_magic(head, MIN_SIGNATURE_BYTES).map(|f| FileKind::Foreign(f.what));
    stated
        .or_else(magic)
        .or_else(|| by_content(head, Sniff::Maybe).map(FileKind::Points))
}

/// Returns the kind for an ending, unless the content contradicts it.
fn by_name(ending: &str, head: &[u8]) -> Option<FileKind> {
    let points = by_ending(ending).filter(|f| {
        let is_text = ["xyz", "csv"].contains(&f.name);
        !is_text || text::sniff(head) != Sniff::No
    });
    points.map(FileKind::Points).or_else(|| {
        let mesh = mesh_format_named(ending).map(FileKind::Mesh);
        let foreign = || foreign_by_ending(ending).map(|f| FileKind::Foreign(f.what));
        mesh.filter(|_| by_ending(ending).is_none())
            .or_else(foreign)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn title(name: &str, head: &[u8]) -> &'static str {
        match file_kind(name, head) {
            Some(FileKind::Points(f)) => f.title,
            Some(FileKind::Mesh(f)) => f.title,
            Some(FileKind::Foreign(what)) => what,
            None => "",
        }
    }

    #[test]
    fn content_then_name_then_looks() {
        assert_eq!(
            title("a.hf", b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"),
            "Gmsh 4.1"
        );
        assert_eq!(title("a.stl", b"\0\0"), "STL");
        assert_eq!(title("a.vtu", b""), "VTK");
        assert_eq!(title("a.xyz", b"1 2 3\n"), "XYZ text");
        assert_eq!(title("-", b"1 2 3\n"), "XYZ text");
        assert_eq!(title("a.csv", b"x,y,z\n1,2,3\n"), "CSV");
        assert_eq!(title("a.png", b"\x89PNG"), "an image");
        for (name, head) in [
            ("a.txt", "m(x[3], a[1]) { m = 1; }"),
            ("a.json", "{}"),
            ("a.hf", "-- 1 2 3\nm(x[3], a[1]) { m = 1; }"),
            ("a", ""),
        ] {
            assert_eq!(title(name, head.as_bytes()), "", "{name}");
        }
    }
}
