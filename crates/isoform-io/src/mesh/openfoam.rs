//! OpenFOAM's polyMesh, a folder of files ("OpenFOAM User Guide", 4.1): points, faces, the cells on
//! both sides of each face, and patches. Coordinates are in metres.
//!
//! Cells are the tetrahedra, then the wedges. Faces between two cells come first, ordered by the
//! lower cell, then by the other one; each looks out of the lower one. Faces of the boundary follow
//! patch by patch, and each part of the surface is a patch. Regions are zones of cells.

use super::boundary::{WEDGE_SIDES, face_nodes};
use super::group::{UniqueNames, face, face_count, face_part, volume_count, volume_region};
use super::options::MeshWriteOptions;
use super::out::Out;
use crate::{WriteError, write_atomic};
use isoform_geom::{Mesh, WEDGE_QUADS, WEDGE_TRIANGLES};
use std::collections::HashMap;
use std::fs;
use std::io::{self, Write};
use std::path::Path;

/// Name of the folder with the files.
pub(super) const FOLDER: &str = "polyMesh";
/// Filler of the fourth node of a triangle, above all nodes.
const NO_NODE: u32 = u32::MAX;
/// Maximum length of the name of a patch. OpenFOAM has none; names of parts are shorter.
const MAX_PATCH_NAME_LENGTH: usize = 200;

/// Face of the mesh in OpenFOAM.
struct PatchFace {
    /// Nodes, looking out of the owner; [`NO_NODE`] behind the three of a triangle.
    nodes: [u32; 4],
    /// Lower cell at the face.
    owner: u32,
    /// Other cell, or the number of the patch.
    other: u32,
}

/// Mesh as OpenFOAM has it.
struct PolyMesh {
    /// Nodes of the mesh in the order of the file: those that are corners of cells.
    points: Vec<u32>,
    /// Faces between two cells.
    inner: Vec<PatchFace>,
    /// Faces of the boundary, patch by patch.
    outer: Vec<PatchFace>,
    /// Names of the patches.
    patches: Vec<String>,
}

/// Refuses to write to a stream.
pub(super) fn write(_: &Mesh, _: &mut dyn Write, _: &MeshWriteOptions) -> io::Result<()> {
    Err(io::Error::other(
        "an OpenFOAM mesh is a folder of files: name one, as constant/polyMesh",
    ))
}

/// Writes the files of a folder, which is made if it is missing. A path that does not end with
/// `polyMesh` is that of a case, with the mesh in `constant/polyMesh`.
pub(super) fn write_folder(
    mesh: &Mesh,
    path: &Path,
    options: &MeshWriteOptions,
) -> Result<(), WriteError> {
    let is_own = path
        .file_name()
        .is_some_and(|name| name.eq_ignore_ascii_case(FOLDER));
    let folder = match is_own {
        true => path.to_owned(),
        false => path.join("constant").join(FOLDER),
    };
    let name = folder.display().to_string();
    let fail = |what, e: io::Error| WriteError::io(what, name.clone(), &e);
    let poly = PolyMesh::from_mesh(mesh).map_err(|e| fail("cannot write the mesh", e))?;
    fs::create_dir_all(&folder).map_err(|e| fail("cannot make the folder", e))?;
    type Part<'a> = (&'a str, &'a str, &'a dyn Fn(&mut Out<'_>) -> io::Result<()>);
    let faces = || poly.inner.iter().chain(&poly.outer);
    let files: [Part<'_>; 8] = [
        ("points", "vectorField", &|out| {
            poly.write_points(mesh, options, out)
        }),
        ("faces", "faceList", &|out| {
            write_list(out, faces(), put_nodes)
        }),
        ("owner", "labelList", &|out| {
            write_list(out, faces(), |out, f| put(out, f.owner))
        }),
        ("neighbour", "labelList", &|out| {
            write_list(out, poly.inner.iter(), |out, f| put(out, f.other))
        }),
        ("boundary", "polyBoundaryMesh", &|out| {
            poly.write_patches(out)
        }),
        ("cellZones", "regIOobject", &|out| write_zones(mesh, out)),
        // Zones of an earlier mesh in this folder would name faces and points of that one.
        ("faceZones", "regIOobject", &|out| out.str("0\n(\n)").line()),
        ("pointZones", "regIOobject", &|out| {
            out.str("0\n(\n)").line()
        }),
    ];
    for (name, class, write) in files {
        write_atomic(&folder.join(name), |sink| {
            let mut out = Out::new(sink);
            out.str("FoamFile\n{\n    version 2.0;\n    format ascii;\n    class ")
                .str(class);
            out.str(";\n    location \"constant/polyMesh\";\n    object ")
                .str(name);
            out.str(";\n}").line()?;
            write(&mut out)?;
            out.flush()
        })?;
    }
    Ok(())
}

/// Writes the length of a list and its items, one a line.
fn write_list<'f>(
    out: &mut Out<'_>,
    faces: impl Iterator<Item = &'f PatchFace> + Clone,
    item: impl Fn(&mut Out<'_>, &PatchFace),
) -> io::Result<()> {
    out.int(faces.clone().count()).str("\n(").line()?;
    for face in faces {
        item(out, face);
        out.line()?;
    }
    out.str(")").line()
}

/// Appends a number.
fn put(out: &mut Out<'_>, number: u32) {
    out.int(number);
}

/// Appends the number of nodes of a face, and the nodes.
fn put_nodes(out: &mut Out<'_>, face: &PatchFace) {
    let nodes = face.nodes.iter().filter(|&&v| v != NO_NODE);
    out.int(nodes.clone().count()).str("(");
    for (i, &node) in nodes.enumerate() {
        out.str(if i == 0 { "" } else { " " }).int(node);
    }
    out.str(")");
}

/// Writes the cells of each region, if there are several.
fn write_zones(mesh: &Mesh, out: &mut Out<'_>) -> io::Result<()> {
    let regions = match mesh.regions.len() {
        0 | 1 => &[],
        _ => &mesh.regions[..],
    };
    let mut names = UniqueNames::new(MAX_PATCH_NAME_LENGTH, plain);
    out.int(regions.len()).str("\n(").line()?;
    for (k, region) in regions.iter().enumerate() {
        let is_own = |&i: &usize| volume_region(mesh, i) == Some(k as u32);
        let cells: Vec<usize> = (0..volume_count(mesh)).filter(is_own).collect();
        out.str(&names.give(region, "region"));
        out.str("\n{\n    type cellZone;\n    cellLabels List<label>\n");
        out.int(cells.len()).str("\n(").line()?;
        for cell in cells {
            out.int(cell).line()?;
        }
        out.str(")\n    ;\n}").line()?;
    }
    out.str(")").line()
}

/// Converts a name to letters, digits and `_`, starting with a letter.
fn plain(name: &str) -> String {
    let letters = name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' });
    let name: String = letters.collect();
    match name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        true => name,
        false => format!("N{name}"),
    }
}

/// Sorts the nodes of a face, for the comparison of faces.
fn key(mut nodes: [u32; 4]) -> [u32; 4] {
    nodes.sort_unstable();
    nodes
}

/// Returns the faces of all cells, looking outward, with their cells.
fn sides(mesh: &Mesh) -> impl Iterator<Item = ([u32; 4], u32)> {
    let triangle = |[a, b, c]: [u32; 3]| [a, b, c, NO_NODE];
    let tets = (0..).zip(&mesh.tets).flat_map(move |(cell, tet)| {
        (0..4).map(move |side| (triangle(face_nodes(tet, side)), cell))
    });
    let first = mesh.tets.len() as u32;
    let wedges = (first..).zip(&mesh.wedges).flat_map(move |(cell, wedge)| {
        (0..WEDGE_SIDES).map(move |side| {
            let nodes = match side.checked_sub(WEDGE_TRIANGLES.len()) {
                None => triangle(WEDGE_TRIANGLES[side].map(|c| wedge[c])),
                Some(quad) => WEDGE_QUADS[quad].map(|c| wedge[c]),
            };
            (nodes, cell)
        })
    });
    tets.chain(wedges)
}

impl PolyMesh {
    /// Finds the faces and their cells.
    fn from_mesh(mesh: &Mesh) -> io::Result<Self> {
        if volume_count(mesh) == 0 {
            return Err(io::Error::other(
                "OpenFOAM meshes consist of volumes, and this one is a surface alone",
            ));
        }
        let numbers = numbers(mesh);
        let mut found: Vec<([u32; 4], u32, [u32; 4])> = sides(mesh)
            .map(|(nodes, cell)| (key(nodes), cell, nodes))
            .collect();
        found.sort_unstable();
        let parts = parts_of_faces(mesh);
        let nodes =
            |nodes: [u32; 4]| nodes.map(|v| if v == NO_NODE { v } else { numbers[v as usize] });
        let (mut inner, mut outer) = (Vec::new(), Vec::new());
        for group in found.chunk_by(|a, b| a.0 == b.0) {
            let (key, owner, corners) = group[0];
            let face = |other| PatchFace {
                nodes: nodes(corners),
                owner,
                other,
            };
            match group {
                [_] => outer.push(face(
                    parts.get(&key).map_or(mesh.parts.len() as u32, |p| *p),
                )),
                [_, (_, neighbour, _)] if *neighbour != owner => inner.push(face(*neighbour)),
                _ => {
                    return Err(io::Error::other(format!(
                        "{} cells have a face in common (the first is number {owner}): isoform inspect \
                     says where the mesh is wrong",
                        group.len()
                    )));
                }
            }
        }
        inner.sort_unstable_by_key(|face: &PatchFace| (face.owner, face.other));
        // By patch, and by cell within a patch.
        outer.sort_by_key(|face: &PatchFace| (face.other, face.owner));
        let used = |v: &u32| numbers[*v as usize] != NO_NODE;
        Ok(Self {
            points: (0..mesh.points.len() as u32).filter(used).collect(),
            patches: patches(mesh, &mut outer),
            inner,
            outer,
        })
    }

    /// Writes the coordinates of the points, in metres if the unit is known.
    fn write_points(
        &self,
        mesh: &Mesh,
        options: &MeshWriteOptions,
        out: &mut Out<'_>,
    ) -> io::Result<()> {
        let metres = options.metres().unwrap_or(1.0);
        out.int(self.points.len()).str("\n(").line()?;
        for &v in &self.points {
            let point = mesh.points[v as usize].map(|x| metres * x);
            out.str("(").point(&point).str(")").line()?;
        }
        out.str(")").line()
    }

    /// Writes the patches.
    fn write_patches(&self, out: &mut Out<'_>) -> io::Result<()> {
        out.int(self.patches.len()).str("\n(").line()?;
        for (k, name) in self.patches.iter().enumerate() {
            let start = self.outer.partition_point(|face| (face.other as usize) < k);
            let end = self
                .outer
                .partition_point(|face| (face.other as usize) <= k);
            out.str("    ")
                .str(name)
                .str("\n    {\n        type patch;\n        nFaces ");
            out.int(end - start).str(";\n        startFace ");
            out.int(self.inner.len() + start).str(";\n    }").line()?;
        }
        out.str(")").line()
    }
}

/// Returns the number of each node among the corners of cells; [`NO_NODE`] for the other nodes,
/// such as those in the middles of edges.
fn numbers(mesh: &Mesh) -> Vec<u32> {
    let mut numbers = vec![NO_NODE; mesh.points.len()];
    let corners = mesh
        .tets
        .as_flattened()
        .iter()
        .chain(mesh.wedges.as_flattened());
    corners.for_each(|&v| numbers[v as usize] = 0);
    let used = numbers.iter_mut().filter(|number| **number == 0);
    (0..).zip(used).for_each(|(k, number)| *number = k);
    numbers
}

/// Returns the part of each face of the surface that lies on one.
fn parts_of_faces(mesh: &Mesh) -> HashMap<[u32; 4], u32> {
    let faces = (0..face_count(mesh)).filter_map(|i| {
        let (nodes, n) = face(mesh, i);
        let last = if n == 4 { nodes[3] } else { NO_NODE };
        Some((
            key([nodes[0], nodes[1], nodes[2], last]),
            face_part(mesh, i)?,
        ))
    });
    faces.collect()
}

/// Returns the names of the patches, and numbers them at their faces, which have the numbers of
/// parts, or of one beyond the last part where they lie on none. A part without faces of the
/// boundary, such as a wall between regions, gets none.
fn patches(mesh: &Mesh, outer: &mut [PatchFace]) -> Vec<String> {
    let mut numbers: Vec<Option<u32>> = vec![None; mesh.parts.len() + 1];
    outer
        .iter()
        .for_each(|face| numbers[face.other as usize] = Some(0));
    (0..)
        .zip(numbers.iter_mut().flatten())
        .for_each(|(k, number)| *number = k);
    for face in outer {
        face.other = numbers[face.other as usize].expect("numbered above");
    }
    let mut names = UniqueNames::new(MAX_PATCH_NAME_LENGTH, plain);
    let filled = numbers
        .iter()
        .enumerate()
        .filter(|(_, number)| number.is_some());
    let name = |(part, _)| mesh.parts.get(part).map_or("defaultFaces", String::as_str);
    filled
        .map(name)
        .map(|name| names.give(name, "patch"))
        .collect()
}
