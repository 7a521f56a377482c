//! Alignment of a given mesh's edges with those of a solid.
//!
//! Every surface vertex is assigned the pieces on which it lies: those of a corner or curve of the
//! solid that is near enough to move the vertex there, else those at its nearest point (`placing`).
//! An edge between vertices without a common piece crosses a curve of the solid and is split there
//! (`splitting`), until none remains; then the vertices of every face have a piece in common, which
//! becomes its label (`labels`; the idea of Kobbelt, Botsch, Schwanecke and Seidel, Feature
//! sensitive surface extraction from volume data, 2001, applied to an existing mesh).

mod labels;
mod placing;
mod splitting;

use crate::complex::{Face, edge};
use crate::features::Features;
use crate::points::lerp;
use crate::surface::{SKIN, Surface};
use isoform_geom::{Point3, TRIANGLE_EDGES};
use std::collections::HashSet;

/// A surface that can be cut: bare triangles, or the boundary of tetrahedra.
pub(super) trait Cuttable {
    fn points(&self) -> &[Point3];
    /// Returns the triangles, outward.
    fn faces(&self) -> Vec<[u32; 3]>;
    /// Moves a vertex, unless adjacent elements would be inverted or become much worse. Returns
    /// true if it was moved.
    fn move_to(&mut self, v: u32, p: Point3) -> bool;
    /// Moves a vertex towards a point of the surface, as far as adjacent elements allow.
    fn settle(&mut self, v: u32, p: Point3);
    /// Splits an edge at its point `at` and moves the new vertex towards `p`. Returns the new
    /// vertex; `None` if the edge cannot be split.
    fn split(&mut self, edge: [u32; 2], at: Point3, p: Point3) -> Option<u32>;
}

/// Result of the alignment of a mesh.
#[derive(Default)]
pub(super) struct Aligned {
    /// Piece of each face.
    pub(super) labels: Vec<Face>,
    /// Target position of each vertex; inner vertices stay in place.
    pub(super) places: Vec<Point3>,
    /// Vertices that are far from the solid's surface.
    pub(super) far: Vec<Point3>,
    /// Points where edges could not be aligned with the solid's.
    pub(super) lost: Vec<Point3>,
    /// Corners of the solid without a vertex.
    pub(super) missed_corners: Vec<Point3>,
    /// Number of corners of the solid.
    pub(super) corners: usize,
}

/// Distance from the surface, in [`Surface::zero`], within which a vertex counts as lying on it:
/// each of its two pieces may be off by one rounding.
const ON_SURFACE_ROUNDINGS: f64 = 2.0;

/// Returns the edges of triangles, lower vertex first, sorted, without duplicates.
pub(super) fn edges_of(faces: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = faces
        .iter()
        .flat_map(|f| TRIANGLE_EDGES.map(|[i, j]| edge(f[i], f[j])))
        .collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Returns a piece that is in both lists.
fn shared(a: &[u32], b: &[u32]) -> Option<u32> {
    a.iter().copied().find(|i| b.contains(i))
}

/// Returns the pieces that are in all three lists.
fn common([a, b, c]: [&[u32]; 3]) -> Vec<u32> {
    let is_in_both = |i: &u32| b.contains(i) && c.contains(i);
    a.iter().copied().filter(is_in_both).collect()
}

/// A corner of the solid.
struct CornerTarget {
    at: Point3,
    pieces: Vec<u32>,
    /// True if a vertex was moved there.
    is_taken: bool,
}

struct Aligner<'a, M> {
    mesh: &'a mut M,
    surface: &'a Surface<'a>,
    /// Pieces on which each vertex lies; empty for inner vertices.
    on: Vec<Vec<u32>>,
    /// Target position of each vertex; tetrahedra may prevent it from moving there at once.
    places: Vec<Point3>,
    corners: Vec<CornerTarget>,
    /// Edges that cross a seam between pieces that touch tangentially.
    smooth: HashSet<[u32; 2]>,
    /// Edges whose crossing was not found.
    given_up: HashSet<[u32; 2]>,
    lost: Vec<Point3>,
}

/// Cuts the mesh along the edges of the solid, and determines the piece of each face.
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
    // With more than a quarter of the vertices far away the mesh does not belong to this solid.
    if far.len() * 4 > aligner.on.len() {
        return Aligned {
            far,
            ..Aligned::default()
        };
    }
    // Each round splits an edge once, and an edge crosses few curves.
    for _ in 0..16 {
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

/// Returns the corners at which a mesh must have a vertex.
fn corners_of(features: &Features) -> Vec<CornerTarget> {
    let corners = features.corners.iter();
    corners
        .filter(|c| c.needs_node())
        .map(|c| CornerTarget {
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

    /// Moves a vertex to a point on the given pieces. Returns false if adjacent elements do not
    /// allow it.
    fn hold(&mut self, v: u32, p: Point3, on: Vec<u32>) -> bool {
        let is_moved = self.mesh.move_to(v, p);
        if is_moved {
            self.places[v as usize] = p;
            self.on[v as usize] = on;
        }
        is_moved
    }

    /// Splits an edge at a fraction of its length, for a vertex whose target is `p`.
    fn split(&mut self, [u, v]: [u32; 2], share: f64, p: Point3, on: Vec<u32>) -> bool {
        let [a, b] = [u, v].map(|k| self.mesh.points()[k as usize]);
        let is_split = self.mesh.split([u, v], lerp(a, b, share), p).is_some();
        if is_split {
            self.places.push(p);
            self.on.push(on);
        }
        is_split
    }

    /// Returns the pieces that bound the solid at a point of its surface.
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

    /// Returns the nearest point of the surface with its pieces.
    fn nearest(&self, p: Point3) -> Option<(Point3, Vec<u32>)> {
        let q = self.surface.project(&[SKIN], p)?;
        let on = self.vanishing(q);
        (!on.is_empty()).then_some((q, on))
    }

    /// Returns true if two pieces meet at a point in an edge of the solid.
    fn is_on_curve(&self, pair: [u32; 2], q: Point3) -> bool {
        self.surface.value(q).0.abs() <= ON_SURFACE_ROUNDINGS * self.surface.zero
            && self.surface.is_edge(pair, q)
    }

    /// Returns true if an edge of a face crosses a seam between pieces that touch tangentially.
    fn has_smooth_edge(&self, f: [u32; 3]) -> bool {
        let mut edges = TRIANGLE_EDGES.iter();
        edges.any(|&[i, j]| self.smooth.contains(&edge(f[i], f[j])))
    }
}
