//! Flat pieces of a mesh: adjacent triangles in one plane. Each is a plane of the object, or a
//! facet of a curved surface.

use super::mesh::Facets;
use super::part::{FacetPart, MIN_FACET_COSINE, ends_clearly};
use crate::chart::Primitive;
use crate::labels::UNLABELLED;
use crate::start::plane;
use isoform_geom::{Point3, dot, sub};

/// A triangle belongs to a plane if the angle between the normals is below the sum of this angle
/// (radians) and this many tolerances over the triangle's height.
const PLANE_ANGLE_TOLERANCE: (f64, f64) = (1e-4, 2.0);
/// Minimum number of corners of a piece that is a plane of the object. A facet of a curved surface
/// has four, and up to five if the border cuts a corner off.
const MIN_PLANE_CORNERS: usize = 6;
/// Maximum ratio of the areas of adjacent facets of one surface: a mesh is graded slowly.
pub(crate) const MAX_AREA_RATIO: f64 = 8.0;

/// The flat pieces of a mesh.
pub(crate) struct Flats {
    pub(crate) pieces: Vec<FacetPart>,
    /// Index of the piece of each triangle.
    pub(crate) of: Vec<u32>,
    pub(crate) areas: Vec<f64>,
}

impl Flats {
    /// Finds the pieces, grown from the largest triangles first.
    pub(crate) fn new(mesh: &Facets) -> Self {
        let count = mesh.triangles.len();
        let mut order: Vec<u32> = (0..count as u32).collect();
        let area = |t: u32| mesh.areas[t as usize];
        order.sort_by(|&a, &b| area(b).total_cmp(&area(a)).then(a.cmp(&b)));
        let mut flats = Self {
            pieces: Vec::new(),
            of: vec![UNLABELLED; count],
            areas: Vec::new(),
        };
        for seed in order {
            if flats.of[seed as usize] == UNLABELLED {
                let piece = flats.grown(mesh, seed);
                flats.areas.push(mesh.area(&piece.triangles));
                flats.pieces.push(piece);
            }
        }
        flats
    }

    /// Grows the piece about a triangle, and marks its triangles with the index of the next piece.
    fn grown(&mut self, mesh: &Facets, seed: u32) -> FacetPart {
        let id = self.pieces.len() as u32;
        let mut surface = Primitive::plane(mesh.corners(seed)[0], mesh.normals[seed as usize]);
        self.of[seed as usize] = id;
        let (mut triangles, mut at, mut fitted) = (vec![seed], 0, 1);
        while at < triangles.len() {
            for u in mesh.near(triangles[at]) {
                if self.of[*u as usize] == UNLABELLED && lies_in(mesh, &surface, *u) {
                    self.of[*u as usize] = id;
                    triangles.push(*u);
                }
            }
            at += 1;
            // Triangles that were rejected with a worse plane are tried again with a better one.
            if triangles.len() >= 2 * fitted && triangles.len() > 2 {
                fitted = triangles.len();
                let axis = surface.axis;
                surface = plane(&mesh.at(&mesh.vertices(&triangles)));
                if dot(surface.axis, axis) < 0.0 {
                    surface.axis = surface.axis.map(|x| -x);
                }
                at = 0;
            }
        }
        triangles.sort_unstable();
        FacetPart { surface, triangles }
    }

    /// Returns true if two adjacent triangles may be facets of one curved surface: the angle
    /// between them is small, and their pieces are of about equal area.
    pub(crate) fn are_alike(&self, mesh: &Facets, pair: [u32; 2]) -> bool {
        self.are_within(mesh, pair, MAX_AREA_RATIO)
    }

    /// Returns [`are_alike`](Self::are_alike) with a given maximum ratio of the areas.
    pub(crate) fn are_within(&self, mesh: &Facets, [t, u]: [u32; 2], factor: f64) -> bool {
        let [a, b] = [t, u].map(|t| self.areas[self.of[t as usize] as usize]);
        a.max(b) <= factor * a.min(b) && mesh.cosine(t, u) >= MIN_FACET_COSINE
    }

    /// Returns true if a piece cannot be a facet of a curved surface.
    pub(crate) fn is_plain(&self, mesh: &Facets, piece: u32) -> bool {
        let part = &self.pieces[piece as usize];
        has_many_corners(mesh, &part.surface, &part.triangles) && ends_clearly(mesh, part, |_| true)
    }
}

/// Returns true if triangles in a plane have more corners than a facet of a curved surface.
pub(crate) fn has_many_corners(mesh: &Facets, plane: &Primitive, of: &[u32]) -> bool {
    if of.len() + 2 < MIN_PLANE_CORNERS {
        return false;
    }
    let [e, f] = plane.frame();
    let flat = |p: &Point3| [dot(*p, e), dot(*p, f)];
    let points = mesh.at(&mesh.vertices(of));
    hull(points.iter().map(flat).collect(), mesh.tolerance).len() >= MIN_PLANE_CORNERS
}

/// Returns true if a triangle lies in a plane.
fn lies_in(mesh: &Facets, plane: &Primitive, t: u32) -> bool {
    let corners = mesh.corners(t);
    let tolerance = mesh.tolerance;
    let n = mesh.normals[t as usize];
    let sine = 1.0 - dot(n, plane.axis).min(1.0);
    let off = (2.0 * sine).sqrt();
    off <= PLANE_ANGLE_TOLERANCE.0 + PLANE_ANGLE_TOLERANCE.1 * tolerance / mesh.heights[t as usize]
        && corners
            .iter()
            .all(|p| plane.distance(*p).abs() <= tolerance)
}

/// Returns the corners of the convex hull (Andrew 1979), without those that protrude by less than a
/// tolerance.
fn hull(mut points: Vec<[f64; 2]>, tolerance: f64) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut chains: [Vec<[f64; 2]>; 2] = [Vec::new(), Vec::new()];
    for (k, chain) in chains.iter_mut().enumerate() {
        for i in 0..points.len() {
            let p = points[if k == 0 { i } else { points.len() - 1 - i }];
            while chain.len() >= 2
                && !turns(
                    [chain[chain.len() - 2], chain[chain.len() - 1], p],
                    tolerance,
                )
            {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
    }
    chains.concat()
}

/// Returns true if the second of three points protrudes to the right of the line through the
/// others.
fn turns([a, b, c]: [[f64; 2]; 3], tolerance: f64) -> bool {
    let at = |p: [f64; 2]| [p[0], p[1], 0.0];
    let [u, v] = [sub(at(b), at(a)), sub(at(c), at(a))];
    (u[0] * v[1] - u[1] * v[0]) > tolerance * v[0].hypot(v[1])
}
