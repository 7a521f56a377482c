//! Abaqus and CalculiX .inp: nodes, elements, sets and surfaces; reading and writing. A step is
//! written as an example in comment lines.
//!
//! Tetrahedra are C3D4 or C3D10 with an element set per region; wedges are C3D6 in the set of the
//! tetrahedra. Each part is a node set and a surface of element faces with one name, and each curve
//! is a node set. A mesh without volumes becomes shells, S3, S6 or S4, with an element set per
//! part. Names consist of at most 80 capitals, digits and `_`; numbers have at most 20 characters,
//! the maximum that CalculiX reads.

mod read;
mod step;

pub(super) use read::read;

use super::boundary::{ElementSide, sides_of_faces};
use super::group::{Groups, UniqueNames, edge, face, volume, volume_count};
use super::options::MeshWriteOptions;
use super::out::Out;
use crate::format::Sniff;
use isoform_geom::Mesh;
use std::io::{self, Write};

/// Maximum length of a name in CalculiX.
const MAX_NAME_LENGTH: usize = 80;
/// Maximum length of a number in CalculiX, in characters.
const MAX_NUMBER_LENGTH: usize = 20;
/// Number of entries on a line of a set.
const ENTRIES_PER_LINE: usize = 16;
/// Number in Abaqus and CalculiX of the side of a tetrahedron opposite to each corner. Sides of a
/// wedge are numbered as in [`ElementSide`]: S1 has the nodes 1 2 3, S2 has 4 5 6, S3 has 1 2 5 4,
/// S4 has 2 3 6 5 and S5 has 3 1 4 6.
const TET_SIDE_NUMBERS: [u8; 4] = [3, 4, 2, 1];

/// Returns `Yes` for a keyword line of nodes, or for the lines with which Abaqus begins a model.
pub(super) fn sniff(head: &[u8]) -> Sniff {
    let text = String::from_utf8_lossy(head).to_ascii_uppercase();
    let keyword = |k: &str| {
        text.lines().any(|l| {
            l.strip_prefix(k)
                .is_some_and(|r| r.is_empty() || r.starts_with([',', ' ', '\r']))
        })
    };
    if keyword("*NODE") || keyword("*HEADING") && keyword("*PART") {
        Sniff::Yes
    } else {
        Sniff::No
    }
}

/// Converts a name to capitals, digits and single `_`, starting with a letter.
fn plain(name: &str) -> String {
    let mut name: String = name
        .chars()
        .map(|c| {
            if c.is_ascii_alphanumeric() {
                c.to_ascii_uppercase()
            } else {
                '_'
            }
        })
        .collect();
    while name.contains("__") {
        name = name.replace("__", "_");
    }
    if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        name.insert(0, 'N');
    }
    name
}

/// Distinct names of the groups in the file.
struct GroupNames {
    /// Names of the parts, for node sets, surfaces and sets of shells.
    parts: Vec<String>,
    /// Names of the curves, for node sets.
    curves: Vec<String>,
    /// Name of the set of all corners.
    corners: String,
    /// Names of the non-empty regions, for element sets.
    regions: Vec<String>,
}

impl GroupNames {
    /// Generates names in the order of the fields, and regions only if they have elements.
    fn from_mesh(mesh: &Mesh, groups: &AllGroups) -> Self {
        let mut names = UniqueNames::new(MAX_NAME_LENGTH, plain);
        let mut give =
            |given: Option<&String>, empty: &str| names.give(given.map_or(empty, |n| n), empty);
        Self {
            parts: (0..groups.parts.len())
                .map(|i| give(mesh.parts.get(i), "SURFACE"))
                .collect(),
            curves: (0..groups.curves.len())
                .map(|i| give(mesh.curves.get(i).map(|c| &c.name), "CURVES"))
                .collect(),
            corners: give(None, "CORNERS"),
            regions: groups
                .regions
                .filled()
                .map(|(i, _)| give(mesh.regions.get(i), "SOLID"))
                .collect(),
        }
    }
}

/// Elements by part, curve and region.
struct AllGroups {
    parts: Groups,
    curves: Groups,
    regions: Groups,
}

/// Writes the mesh with its groups as sets and surfaces.
pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let mut out = Out::new(out);
    out.str("** mesh written by isoform").line()?;
    out.units("**", options)?;
    write_nodes(mesh, &mut out)?;
    let groups = AllGroups {
        parts: Groups::parts(mesh),
        curves: Groups::curves(mesh),
        regions: Groups::regions(mesh),
    };
    let names = GroupNames::from_mesh(mesh, &groups);
    let has_volumes = volume_count(mesh) > 0;
    if has_volumes {
        write_volumes(mesh, &groups.regions, &names.regions, &mut out)?;
    } else {
        write_shells(mesh, &groups.parts, &names.parts, &mut out)?;
    }
    for (i, elements) in groups.parts.filled() {
        node_set(&mut out, &names.parts[i], elements, |e| face(mesh, e))?;
    }
    for (i, elements) in groups.curves.filled() {
        node_set(&mut out, &names.curves[i], elements, |e| edge(mesh, e))?;
    }
    if !mesh.corners.is_empty() {
        node_set(&mut out, &names.corners, &mesh.corners, |c| ([c as u32], 1))?;
    }
    if has_volumes {
        let sides = sides_of_faces(mesh);
        surfaces(mesh, &groups.parts, &names.parts, &sides, &mut out)?;
        step::write(mesh, &groups, &names, &sides, options, &mut out)?;
    }
    out.flush()
}

/// Writes the nodes, numbered from 1.
fn write_nodes(mesh: &Mesh, out: &mut Out<'_>) -> io::Result<()> {
    out.str("*NODE").line()?;
    for (i, p) in mesh.points.iter().enumerate() {
        out.int(i + 1);
        for &v in p {
            out.str(", ").narrow(v, MAX_NUMBER_LENGTH);
        }
        out.line()?;
    }
    Ok(())
}

/// Writes the faces as shells, with a set per part.
fn write_shells(
    mesh: &Mesh,
    parts: &Groups,
    names: &[String],
    out: &mut Out<'_>,
) -> io::Result<()> {
    let is_linear = mesh.triangle_mids.is_empty();
    let kinds = [if is_linear { "S3" } else { "S6" }, "S4"];
    for (i, elements) in parts.filled() {
        let nodes = |e: u32| face(mesh, e as usize);
        write_elements(out, kinds, &names[i], elements, mesh.triangles.len(), nodes)?;
    }
    Ok(())
}

/// Writes the tetrahedra and wedges, with a set per non-empty region.
fn write_volumes(
    mesh: &Mesh,
    regions: &Groups,
    names: &[String],
    out: &mut Out<'_>,
) -> io::Result<()> {
    let is_linear = mesh.tet_mids.is_empty();
    let kinds = [if is_linear { "C3D4" } else { "C3D10" }, "C3D6"];
    for ((_, elements), name) in regions.filled().zip(names) {
        let nodes = |e: u32| volume(mesh, e as usize);
        write_elements(out, kinds, name, elements, mesh.tets.len(), nodes)?;
    }
    Ok(())
}

/// Writes the elements of a set: those with index below `simplices` with the first type, then the
/// others with the second.
fn write_elements<const N: usize>(
    out: &mut Out<'_>,
    kinds: [&str; 2],
    set: &str,
    elements: &[u32],
    simplices: usize,
    nodes: impl Fn(u32) -> ([u32; N], usize),
) -> io::Result<()> {
    let first_other = elements.partition_point(|e| (*e as usize) < simplices);
    let (simplices, others) = elements.split_at(first_other);
    for (kind, elements) in kinds.into_iter().zip([simplices, others]) {
        if elements.is_empty() {
            continue;
        }
        elements_head(out, kind, set)?;
        for &e in elements {
            let (nodes, n) = nodes(e);
            element(out, e, &nodes[..n])?;
        }
    }
    Ok(())
}

/// Writes the keyword line of elements of one type in a set.
fn elements_head(out: &mut Out<'_>, kind: &str, set: &str) -> io::Result<()> {
    out.str("*ELEMENT, TYPE=")
        .str(kind)
        .str(", ELSET=")
        .str(set)
        .line()
}

/// Writes an element with its number and nodes, counted from 1 in the file.
fn element(out: &mut Out<'_>, number: u32, nodes: &[u32]) -> io::Result<()> {
    out.int(number + 1);
    nodes.iter().for_each(|&n| {
        out.str(", ").int(n + 1);
    });
    out.line()
}

/// Writes the set of nodes of some elements, each once, ascending.
fn node_set<const N: usize>(
    out: &mut Out<'_>,
    name: &str,
    elements: &[u32],
    nodes: impl Fn(usize) -> ([u32; N], usize),
) -> io::Result<()> {
    let mut all: Vec<u32> = Vec::with_capacity(N * elements.len());
    for &e in elements {
        let (nodes, n) = nodes(e as usize);
        all.extend_from_slice(&nodes[..n]);
    }
    all.sort_unstable();
    all.dedup();
    out.str("*NSET, NSET=").str(name).line()?;
    for line in all.chunks(ENTRIES_PER_LINE) {
        for (i, &n) in line.iter().enumerate() {
            out.str(if i == 0 { "" } else { ", " }).int(n + 1);
        }
        out.line()?;
    }
    Ok(())
}

/// Writes a surface of element faces for each part; faces that belong to no volume are omitted.
fn surfaces(
    mesh: &Mesh,
    parts: &Groups,
    names: &[String],
    sides: &[Option<ElementSide>],
    out: &mut Out<'_>,
) -> io::Result<()> {
    for (i, faces) in parts.filled() {
        let mut on_volumes = faces.iter().filter_map(|&f| sides[f as usize]).peekable();
        if on_volumes.peek().is_none() {
            continue;
        }
        out.str("*SURFACE, NAME=")
            .str(&names[i])
            .str(", TYPE=ELEMENT")
            .line()?;
        for side in on_volumes {
            out.int(side.0 + 1)
                .str(", S")
                .int(side_number(mesh, side))
                .line()?;
        }
    }
    Ok(())
}

/// Returns the number of a side of a volume, from 1.
fn side_number(mesh: &Mesh, (volume, side): ElementSide) -> u8 {
    if (volume as usize) < mesh.tets.len() {
        TET_SIDE_NUMBERS[usize::from(side)]
    } else {
        side + 1
    }
}
