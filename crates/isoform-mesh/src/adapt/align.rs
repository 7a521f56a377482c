//! Edges of a given mesh brought onto those of a solid.
//!
//! Every vertex of the surface is given the pieces that it lies on: the pieces of a corner or curve of
//! the solid if one is near enough to move it there, else those at its nearest point (`placing`).
//! An edge between vertices without a common piece crosses a curve of the solid and is split there
//! (`splitting`), until there is none; then the vertices of every face have a piece in common,
//! which is its label (`labels`; the idea of Kobbelt, Botsch, Schwanecke and Seidel, Feature
//! sensitive surface extraction from volume data, 2001, on a mesh that is already there).

mod labels;
mod placing;
mod splitting;

use crate::complex::{Face, edge};
use crate::features::Features;
use crate::points::along;
use crate::surface::{SKIN, Surface};
use isoform_geom::{Point3, TRIANGLE_EDGES};
use std::collections::HashSet;

/// A surface that can be cut: bare triangles, or the boundary of tetrahedra.
pub(super) trait Cuttable {
    fn points(&self) -> &[Point3];
    /// The triangles, outward.
    fn faces(&self) -> Vec<[u32; 3]>;
    /// Moves a vertex, unless what is around it would turn over or become much worse.
    fn move_to(&mut self, v: u32, p: Point3) -> bool;
    /// Brings a vertex onto the surface, as near as what is around it allows.
    fn settle(&mut self, v: u32, p: Point3);
    /// Splits an edge at a point of it; the new vertex is moved on to `p` if it may be.
    fn split(&mut self, edge: [u32; 2], at: Point3, p: Point3) -> Option<u32>;
}

/// What was found out about a mesh.
#[derive(Default)]
pub(super) struct Aligned {
    /// The piece of each face.
    pub(super) labels: Vec<Face>,
    /// Where each vertex belongs; inner ones where they are.
    pub(super) places: Vec<Point3>,
    /// Vertices nowhere near the solid's surface.
    pub(super) far: Vec<Point3>,
    /// Places where edges could not be made to follow the solid's.
    pub(super) lost: Vec<Point3>,
    /// Corners of the solid without a vertex.
    pub(super) missed_corners: Vec<Point3>,
    /// The number of corners of the solid.
    pub(super) corners: usize,
}

/// Rounds of splitting: an edge is split once in each, and crosses few curves.
const ROUNDS: usize = 16;
/// Vertices per vertex that may be near nothing: with more than a quarter of them far away the mesh is
/// of something else, and the work ends.
const FEW_FAR: usize = 4;
/// Distance of a point from the surface, in roundings, within which it is on it: it lies on two
/// pieces within one rounding each.
const ON: f64 = 2.0;

/// The edges of triangles, lower vertex first, sorted, each once.
pub(super) fn edges_of(faces: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = faces
        .iter()
        .flat_map(|f| TRIANGLE_EDGES.map(|[i, j]| edge(f[i], f[j])))
        .collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// A piece that is in both lists.
fn shared(a: &[u32], b: &[u32]) -> Option<u32> {
    a.iter().copied().find(|i| b.contains(i))
}

/// The pieces that are in all three lists.
fn common([a, b, c]: [&[u32]; 3]) -> Vec<u32> {
    let is_in_both = |i: &u32| b.contains(i) && c.contains(i);
    a.iter().copied().filter(is_in_both).collect()
}

/// A corner of the solid.
struct Corner {
    at: Point3,
    pieces: Vec<u32>,
    /// Whether a vertex is there.
    is_taken: bool,
}

struct Aligner<'a, M> {
    mesh: &'a mut M,
    surface: &'a Surface<'a>,
    /// The pieces that each vertex lies on; none of inner ones.
    on: Vec<Vec<u32>>,
    /// Where each vertex belongs: tetrahedra may not let it go the whole way yet.
    places: Vec<Point3>,
    corners: Vec<Corner>,
    /// Edges that cross a seam between pieces that touch tangentially.
    smooth: HashSet<[u32; 2]>,
    /// Edges whose crossing was not found.
    given_up: HashSet<[u32; 2]>,
    lost: Vec<Point3>,
}

/// Cuts the mesh along the edges of the solid, and finds the piece that each face lies on.
pub(super) fn align<M: Cuttable>(
    mesh: &mut M,
    surface: &Surface<'_>,
    features: &Features,
) -> Aligned {
    let places = mesh.points().to_vec();
    let mut aligner = Aligner {
        mesh,
        surface,
        on: vec![Vec::new(); places.len()],
        places,
        corners: corners_of(features),
        smooth: HashSet::new(),
        given_up: HashSet::new(),
        lost: Vec::new(),
    };
    let far = aligner.place_vertices();
    if far.len() * FEW_FAR > aligner.on.len() {
        return Aligned {
            far,
            ..Aligned::default()
        };
    }
    for _ in 0..ROUNDS {
        if aligner.split_edges() + aligner.split_faces() == 0 {
            break;
        }
    }
    let labels = aligner.labels();
    let missed = aligner.corners.iter().filter(|c| !c.is_taken);
    Aligned {
        labels,
        missed_corners: missed.map(|c| c.at).collect(),
        corners: aligner.corners.len(),
        places: aligner.places,
        far,
        lost: aligner.lost,
    }
}

/// The corners that a mesh must have.
fn corners_of(features: &Features) -> Vec<Corner> {
    let corners = features.corners.iter();
    corners
        .filter(|c| c.needs_node())
        .map(|c| Corner {
            at: c.point,
            pieces: c.pieces.clone(),
            is_taken: false,
        })
        .collect()
}

impl<M: Cuttable> Aligner<'_, M> {
    fn at(&self, v: u32) -> Point3 {
        self.places[v as usize]
    }

    /// Moves a vertex to a point on the pieces given, if it may go there.
    fn hold(&mut self, v: u32, p: Point3, on: Vec<u32>) -> bool {
        let is_moved = self.mesh.move_to(v, p);
        if is_moved {
            self.places[v as usize] = p;
            self.on[v as usize] = on;
        }
        is_moved
    }

    /// Splits an edge at a share of its length, for a vertex that belongs at `p`.
    fn split(&mut self, [u, v]: [u32; 2], share: f64, p: Point3, on: Vec<u32>) -> bool {
        let [a, b] = [u, v].map(|k| self.mesh.points()[k as usize]);
        let is_split = self.mesh.split([u, v], along(a, b, share), p).is_some();
        if is_split {
            self.places.push(p);
            self.on.push(on);
        }
        is_split
    }

    /// The pieces that bound the solid at a point of its surface.
    fn vanishing(&self, p: Point3) -> Vec<u32> {
        let Some(reduced) = self.surface.lattice.reduced_at(p) else {
            return Vec::new();
        };
        let mut zero = reduced.pieces.clone();
        zero.retain(|&i| self.surface.distance(i, p) == 0.0);
        if zero.len() > 1 {
            zero.retain(|&i| self.surface.is_face(i, p));
        }
        zero
    }

    /// The next point of the surface with its pieces.
    fn nearest(&self, p: Point3) -> Option<(Point3, Vec<u32>)> {
        let q = self.surface.project(&[SKIN], p)?;
        let on = self.vanishing(q);
        (!on.is_empty()).then_some((q, on))
    }

    /// Whether two pieces meet at a point in an edge of the solid.
    fn is_on_curve(&self, pair: [u32; 2], q: Point3) -> bool {
        self.surface.value(q).0.abs() <= ON * self.surface.zero && self.surface.is_edge(pair, q)
    }

    /// Whether an edge of a face crosses a seam between pieces that touch tangentially.
    fn has_smooth_edge(&self, f: [u32; 3]) -> bool {
        let mut edges = TRIANGLE_EDGES.iter();
        edges.any(|&[i, j]| self.smooth.contains(&edge(f[i], f[j])))
    }
}
