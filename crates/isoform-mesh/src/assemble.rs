//! Conversion of the optimised complex to the resulting mesh: contiguous indices, parts, curves and
//! corners.

use crate::band::Core;
use crate::complex::{Complex, Face, NONE, labelled_edges};
use crate::distance::first_order_at;
use crate::error::MeshError;
use crate::features::Corner;
use crate::points::{midpoint, pairs, unique};
use crate::surface::{Surface, meet_at_an_angle};
use isoform_geom::{Curve, Mesh, Point3, Solid};
use std::collections::HashSet;

/// A mesh with the pieces of the solid on which its parts lie.
pub(crate) struct LabelledMesh {
    pub(crate) mesh: Mesh,
    /// Piece of each part.
    pub(crate) pieces: Vec<u32>,
}

/// The core, and its connection to the complex around it.
#[derive(Default)]
pub(crate) struct CoreConnection {
    pub(crate) core: Core,
    /// Number of vertices of the band; lower vertex indices of the core refer to the band.
    pub(crate) band_points: usize,
    /// Vertex of the complex for each vertex of the band.
    pub(crate) number: Vec<u32>,
}

/// Vertices of a complex that a mesh uses, renumbered contiguously.
struct Numbering {
    /// Node of the mesh for each vertex of the complex.
    node: Vec<u32>,
    points: Vec<Point3>,
}

impl Numbering {
    fn new(vertices: usize) -> Self {
        Self {
            node: vec![NONE; vertices],
            points: Vec::new(),
        }
    }

    fn add(&mut self, v: u32, p: Point3) {
        if self.node[v as usize] == NONE {
            self.node[v as usize] = self.points.len() as u32;
            self.points.push(p);
        }
    }

    fn node(&self, v: u32) -> u32 {
        self.node[v as usize]
    }
}

/// Assembles the mesh of triangles with vertices at `points`.
pub(crate) fn assemble_surface(
    surface: &Surface<'_>,
    faces: &[Face],
    points: &[Point3],
) -> LabelledMesh {
    let mut numbering = Numbering::new(points.len());
    for &v in faces.iter().flat_map(|(f, _)| f) {
        numbering.add(v, points[v as usize]);
    }
    let mesh = Mesh {
        points: std::mem::take(&mut numbering.points),
        ..Mesh::default()
    };
    label(surface, faces, |v| numbering.node(v), mesh)
}

/// Assembles the mesh of the tetrahedra of a complex and of its core.
pub(crate) fn assemble_volume(
    surface: &Surface<'_>,
    complex: &Complex,
    joined: CoreConnection,
) -> Result<LabelledMesh, MeshError> {
    let faces = complex.faces();
    let mut numbering = Numbering::new(complex.points.len());
    // `tet_of` does not tell if a vertex is used: where bodies touch in a single point, as for
    // discontinuous functions, the recorded tetrahedron may have been removed while others remain.
    let mut is_used = vec![false; complex.points.len()];
    for t in complex.live() {
        for v in complex.tets[t as usize] {
            is_used[v as usize] = true;
        }
    }
    for (v, &p) in complex.points.iter().enumerate() {
        if is_used[v] {
            numbering.add(v as u32, p);
        }
    }
    let mut points = std::mem::take(&mut numbering.points);
    let offset = points.len() as u32;
    check_core(&joined, |v| {
        is_used.get(v as usize).is_some_and(|used| *used)
    })?;
    points.extend(joined.core.points);
    let of_core = |v: u32| match (v as usize) < joined.band_points {
        true => numbering.node(joined.number[v as usize]),
        false => v - joined.band_points as u32 + offset,
    };
    let mut tets: Vec<[u32; 4]> = complex
        .live()
        .map(|t| complex.tets[t as usize].map(|v| numbering.node(v)))
        .collect();
    tets.extend(joined.core.tets.iter().map(|t| t.map(of_core)));
    let mut tet_regions: Vec<u32> = complex.live().map(|t| complex.region(t).into()).collect();
    tet_regions.resize(tets.len(), 0);
    let mesh = Mesh {
        points,
        tet_regions,
        tets,
        regions: vec!["solid".to_owned()],
        ..Mesh::default()
    };
    Ok(label(surface, &faces, |v| numbering.node(v), mesh))
}

/// Checks that the complex still uses the vertices that the core shares with the band around it.
fn check_core(joined: &CoreConnection, is_there: impl Fn(u32) -> bool) -> Result<(), MeshError> {
    let shared = joined.core.tets.iter().flatten();
    let mut shared = shared.filter(|&&v| (v as usize) < joined.band_points);
    match shared.find(|&&v| !is_there(joined.number[v as usize])) {
        Some(v) => {
            let what = format!("vertex {v} of the lattice's core lost the tetrahedra around it");
            Err(MeshError::Internal { what })
        }
        None => Ok(()),
    }
}

/// Adds labelled triangles, parts, curves and corners to a mesh.
fn label(
    surface: &Surface<'_>,
    faces: &[Face],
    node: impl Fn(u32) -> u32,
    mut mesh: Mesh,
) -> LabelledMesh {
    let names = surface.solid.names();
    let mut part_of = vec![NONE; names.len()];
    let used = faces
        .iter()
        .map(|f| f.1)
        .filter(|&l| (l as usize) < names.len());
    let pieces = unique(used.collect());
    for (k, &piece) in pieces.iter().enumerate() {
        part_of[piece as usize] = k as u32;
        mesh.parts.push(names[piece as usize].clone());
    }
    mesh.triangles = faces.iter().map(|(f, _)| f.map(&node)).collect();
    mesh.triangle_parts = faces
        .iter()
        .map(|(_, l)| part_of.get(*l as usize).copied().unwrap_or(0))
        .collect();
    let found = feature_edges(surface.solid, surface.zero, &pieces, &mesh);
    add_curves(&mut mesh, &found);
    mesh.corners = corners(&mesh, &surface.apexes);
    LabelledMesh { mesh, pieces }
}

/// An edge between two parts: the parts, followed by its ends.
pub(crate) type FeatureEdge = ([u32; 2], [u32; 2]);

/// Returns the edges between faces of two parts that meet at an angle, with ends on both; seams of
/// parts that touch tangentially are excluded. Sorted by parts.
pub(crate) fn feature_edges(
    solid: &dyn Solid,
    zero: f64,
    pieces: &[u32],
    mesh: &Mesh,
) -> Vec<FeatureEdge> {
    let triangles = mesh.triangles.iter().copied();
    let edges = labelled_edges(triangles.zip(mesh.triangle_parts.iter().copied()));
    let is_on = |v: u32, part: u32| {
        let (piece, p) = (pieces[part as usize], mesh.points[v as usize]);
        first_order_at(solid, piece, p).abs() <= zero
    };
    let mut found: Vec<FeatureEdge> = Vec::new();
    for same in edges.chunk_by(|a, b| a.0 == b.0) {
        let ends = same[0].0;
        let is_edge = |parts: &[u32; 2]| {
            let [p, q] = ends.map(|v| mesh.points[v as usize]);
            let pair = parts.map(|k| pieces[k as usize]);
            ends.iter().all(|&v| parts.iter().all(|&k| is_on(v, k)))
                && meet_at_an_angle(solid, pair, midpoint(p, q))
        };
        let parts = unique(same.iter().map(|s| s.1).collect());
        // More than two parts meet at an edge of several regions; some of them may coincide.
        if let Some(parts) = pairs(&parts).find(is_edge) {
            found.push((parts, ends));
        }
    }
    found.sort_unstable();
    found
}

/// Adds one curve per pair of parts to a mesh, named after both, with its edges.
fn add_curves(mesh: &mut Mesh, edges: &[FeatureEdge]) {
    for same in edges.chunk_by(|a, b| a.0 == b.0) {
        let curve = mesh.curves.len() as u32;
        let parts = same[0].0;
        let [a, b] = parts.map(|k| &mesh.parts[k as usize]);
        let name = format!("{a}/{b}");
        mesh.curves.push(Curve { name, parts });
        for (_, ends) in same {
            mesh.edges.push(*ends);
            mesh.edge_curves.push(curve);
        }
    }
}

/// Returns the nodes where anything but two edges of one curve meet, and those at tips of cones.
pub(crate) fn corners(mesh: &Mesh, apexes: &[Corner]) -> Vec<u32> {
    let mut ends: Vec<(u32, u32)> = mesh
        .edges
        .iter()
        .zip(&mesh.edge_curves)
        .flat_map(|(e, &c)| e.map(|v| (v, c)))
        .collect();
    ends.sort_unstable();
    let met = ends
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|at| at.len() != 2 || at[0].1 != at[1].1)
        .map(|at| at[0].0);
    let bits = |p: Point3| p.map(f64::to_bits);
    let tips: HashSet<[u64; 3]> = apexes.iter().map(|a| bits(a.point)).collect();
    let nodes = mesh.triangles.as_flattened().iter().copied();
    let at_tips = nodes.filter(|&v| tips.contains(&bits(mesh.points[v as usize])));
    unique(met.chain(at_tips).collect())
}
