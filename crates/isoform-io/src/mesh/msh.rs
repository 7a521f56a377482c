//! Gmsh .msh: 4.1 as text and binary, 2.2 as text, reading and writing (Gmsh reference manual,
//! "File formats").
//!
//! Parts, curves and regions are entities and physical groups of dimension 2, 1 and 3 with one tag
//! for both, from 1; corners are points in one physical group. Nodes and elements are numbered in
//! the order of the mesh, so that reading restores this order.

mod read;
mod write2;
mod write4;

pub(super) use read::read;
pub(super) use write2::write as write2;
pub(super) use write4::write;

use super::group::{UniqueNames, volume};
use super::out::Out;
use crate::format::Sniff;
use isoform_geom::Mesh;
use std::io;

/// Maximum length of a name in Gmsh.
const MAX_NAME_LENGTH: usize = 127;
/// Name of the physical group of the corners.
const CORNER_GROUP: &str = "corners";
/// Permutation, its own inverse, between our order of the nodes of a quadratic tetrahedron and
/// Gmsh's, which swaps the last two mid nodes.
const TET10_PERMUTATION: [usize; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8];

/// Returns `Yes` for the first section of the format.
pub(super) fn sniff(head: &[u8]) -> Sniff {
    if head.starts_with(b"$MeshFormat") {
        Sniff::Yes
    } else {
        Sniff::No
    }
}

/// Names of the groups by dimension, all distinct: many readers of Gmsh files identify groups by
/// name alone.
struct PhysicalNames {
    /// Names by dimension: corners, curves, parts, regions.
    names: [Vec<String>; 4],
}

impl PhysicalNames {
    /// Collects the names of groups that label elements, and of the corners.
    fn from_mesh(mesh: &Mesh) -> Self {
        let mut names = UniqueNames::new(MAX_NAME_LENGTH, |n| {
            n.chars()
                .map(|c| if c == '"' || c.is_control() { '\'' } else { c })
                .collect()
        });
        let labelled =
            |labels: &[u32], given: Vec<String>| if labels.is_empty() { Vec::new() } else { given };
        let parts = mesh.parts.iter().map(|n| names.give(n, "part")).collect();
        let curves = mesh
            .curves
            .iter()
            .map(|c| names.give(&c.name, "curve"))
            .collect();
        let regions = mesh
            .regions
            .iter()
            .map(|n| names.give(n, "region"))
            .collect();
        let faces = match mesh.triangle_parts.is_empty() {
            true => &mesh.quad_parts,
            false => &mesh.triangle_parts,
        };
        // Wedges have no labels but belong to the only region (see `volume_region`).
        let volumes = match mesh.wedges.is_empty() {
            true => &mesh.tet_regions[..],
            false => &[0],
        };
        let corners = mesh
            .corners
            .first()
            .map(|_| names.give(CORNER_GROUP, CORNER_GROUP));
        Self {
            names: [
                corners.into_iter().collect(),
                labelled(&mesh.edge_curves, curves),
                labelled(faces, parts),
                labelled(volumes, regions),
            ],
        }
    }
    /// Writes the section of physical names, if there are any.
    fn write(&self, out: &mut Out<'_>) -> io::Result<()> {
        let count: usize = self.names.iter().map(Vec::len).sum();
        if count == 0 {
            return Ok(());
        }
        out.str("$PhysicalNames\n").int(count).line()?;
        for (dim, names) in self.names.iter().enumerate() {
            for (i, name) in names.iter().enumerate() {
                out.int(dim)
                    .str(" ")
                    .int(i + 1)
                    .str(" \"")
                    .str(name)
                    .str("\"")
                    .line()?;
            }
        }
        out.str("$EndPhysicalNames").line()
    }
    /// Returns true if elements of a dimension belong to groups.
    fn has(&self, dim: usize) -> bool {
        !self.names[dim].is_empty()
    }
}

/// Returns the nodes of a tetrahedron or wedge in Gmsh's order, and their number. For wedges Gmsh's
/// order is ours.
fn volume_in_gmsh_order(mesh: &Mesh, i: usize) -> ([u32; 10], usize) {
    let (nodes, n) = volume(mesh, i);
    let nodes = if n == 10 {
        TET10_PERMUTATION.map(|k| nodes[k])
    } else {
        nodes
    };
    (nodes, n)
}

/// Returns Gmsh's number of the type of an element, given its dimension and number of nodes.
fn element_type(dim: usize, nodes: usize) -> i32 {
    match (dim, nodes) {
        (0, _) => 15,
        (1, 2) => 1,
        (1, _) => 8,
        (2, 3) => 2,
        (2, 4) => 3,
        (2, _) => 9,
        (_, 4) => 4,
        (_, 6) => 6,
        _ => 11,
    }
}
