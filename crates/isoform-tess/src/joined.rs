//! Triangles of several patches as one mesh, joined along common sides.
//!
//! Sides with equal control points, in either order, are one curve. Its vertices are those of all
//! patches at it: if a patch lacks a vertex of another one, its triangle there is divided. The
//! sides of a domain are straight in the parameters, so that a statement proved for a triangle
//! holds for its parts.
//!
//! - *member*: a side of a patch, as part of a given curve.
//! - *place*: a number from 0 to 1 along a side, or along the curve, whose direction may be
//!   opposite.
//! - *weld*: to give coincident vertices one index.

mod weld;

use crate::patch::{ControlPoint, Patch};
use crate::surface::{Point3, Surface, VertexKind};
use isoform_algebra::RBig;
use std::collections::BTreeMap;
use weld::{PatchVertex, weld};

/// Distance up to which two places along a side, or two points in half widths of the box, are
/// identified: both sides are divided at equal doubles, up to rounding. If it is larger, vertices
/// are joined over short edges; if it is smaller, edges stay open, which is counted.
const SAME_PLACE_DISTANCE: f64 = 1e-9;

/// Scales control points to a canonical representative: divides them by their first non-zero
/// coordinate.
fn projective(points: &[&ControlPoint]) -> Vec<ControlPoint> {
    let mut coordinates = points.iter().flat_map(|p| p.iter());
    let first = coordinates.find(|x| !x.is_zero());
    let scale = first.cloned().unwrap_or(RBig::ONE);
    let scaled = points.iter().map(|p| p.each_ref().map(|x| x / &scale));
    scaled.collect()
}

/// A side of a patch, with true if its direction is opposite to that of the shared curve.
#[derive(Clone, Copy, Debug)]
struct Member {
    patch: usize,
    side: usize,
    is_reversed: bool,
}

impl Member {
    /// Converts a place along the curve to one along the side, or vice versa.
    fn turned(self, x: f64) -> f64 {
        if self.is_reversed { 1.0 - x } else { x }
    }
    /// Returns true if the corner of a triangle with given borders is on the side.
    fn holds(self, borders: u64) -> bool {
        borders >> self.side & 1 == 1
    }
}

/// Groups the sides by their curves; sides that are a single point are left out.
fn curves(patches: &[Patch]) -> Vec<Vec<Member>> {
    let mut found: BTreeMap<Vec<ControlPoint>, Vec<Member>> = BTreeMap::new();
    for (patch, p) in patches.iter().enumerate() {
        for side in 0..4 {
            let points = p.side(side);
            let forward = projective(&points);
            let backward = projective(&points.into_iter().rev().collect::<Vec<_>>());
            let first = projective(&[&forward[0]]);
            if forward.iter().all(|c| projective(&[c]) == first) {
                continue;
            }
            let is_reversed = backward < forward;
            let curve = if is_reversed { backward } else { forward };
            found.entry(curve).or_default().push(Member {
                patch,
                side,
                is_reversed,
            });
        }
    }
    found.into_values().collect()
}

/// Returns the place of parameters along a side, 0 and 1 at its ends in the order of the sides. All
/// patches lie in the first unit triangle.
fn place(side: usize, [u, v]: [f64; 2]) -> f64 {
    let w = 1.0 - u - v;
    match side {
        0 => u / w,
        1 => v / w,
        2 => 1.0 - u / w,
        _ => 1.0 - v / w,
    }
}
/// Returns the parameters in the unit triangle at a place along a side.
fn parameters(side: usize, x: f64) -> [f64; 2] {
    let [s, t] = match side {
        0 => [x, 0.0],
        1 => [1.0, x],
        2 => [1.0 - x, 1.0],
        _ => [0.0, 1.0 - x],
    };
    [s / (s + t + 1.0), t / (s + t + 1.0)]
}

/// An edge of a triangle on a side of a patch.
struct SideEdge {
    triangle: usize,
    /// Index of the corner at which the edge begins, counterclockwise.
    corner: usize,
    /// True if that corner is the first of the two given vertices.
    is_forward: bool,
}

/// Corner of a triangle: its vertex, parameters, and borders.
type Corner = (u32, [f64; 2], u64);

impl Surface {
    /// Returns the vertices on a side of a patch, ascending along the curve.
    fn along(&self, m: Member) -> Vec<(f64, u32)> {
        let mut found: BTreeMap<u32, f64> = BTreeMap::new();
        for ((t, corners), borders) in self.triangles.iter().zip(&self.corners).zip(&self.borders) {
            for k in (0..3).filter(|&k| m.holds(borders[k])) {
                found.insert(t[k], m.turned(place(m.side, corners[k])));
            }
        }
        let mut list: Vec<(f64, u32)> = found.into_iter().map(|(v, x)| (x, v)).collect();
        list.sort_by(|a, b| a.0.total_cmp(&b.0));
        list
    }
    /// Returns the edge between two vertices on a side.
    fn edge_on(&self, m: Member, ends: [u32; 2]) -> Option<SideEdge> {
        let [a, b] = ends;
        let mut all = self.triangles.iter().zip(&self.borders).enumerate();
        all.find_map(|(triangle, (t, borders))| {
            let on_side = |&k: &usize| m.holds(borders[k]) && m.holds(borders[(k + 1) % 3]);
            (0..3).filter(on_side).find_map(|corner| {
                let edge = [t[corner], t[(corner + 1) % 3]];
                let is_forward = edge == ends;
                (is_forward || edge == [b, a]).then_some(SideEdge {
                    triangle,
                    corner,
                    is_forward,
                })
            })
        })
    }
    fn corner(&self, triangle: usize, k: usize) -> Corner {
        let (t, i) = (triangle, k % 3);
        (self.triangles[t][i], self.corners[t][i], self.borders[t][i])
    }

    /// Adds a vertex on a border, with its faces of the box, and returns its index.
    fn add_border_vertex(&mut self, p: Point3, faces: u8) -> u32 {
        let number = self.points.len() as u32;
        self.points.push(p);
        self.kinds.push(VertexKind::Border);
        self.faces.push(faces);
        self.double.push(false);
        number
    }
    /// Divides the triangle at a side, between two adjacent vertices, at further vertices, given by
    /// place along the curve and position. Returns the new indices; `None` if such a triangle does
    /// not exist.
    fn divide(&mut self, m: Member, ends: [u32; 2], new: &[(f64, Point3)]) -> Option<Vec<u32>> {
        let edge = self.edge_on(m, ends)?;
        let faces = self.faces[ends[0] as usize] & self.faces[ends[1] as usize];
        let mut way: Vec<Corner> = Vec::new();
        for &(x, p) in new {
            let at = parameters(m.side, m.turned(x));
            way.push((self.add_border_vertex(p, faces), at, 1 << m.side));
        }
        let made = way.iter().map(|c| c.0).collect();
        if !edge.is_forward {
            way.reverse();
        }
        way.insert(0, self.corner(edge.triangle, edge.corner));
        way.push(self.corner(edge.triangle, edge.corner + 1));
        let apex = self.corner(edge.triangle, edge.corner + 2);
        for (i, w) in way.windows(2).enumerate() {
            let parts = [w[0], w[1], apex];
            self.put(parts, edge.triangle, i == 0);
        }
        Some(made)
    }
    /// Writes a triangle over another one, or appends it.
    fn put(&mut self, parts: [Corner; 3], old: usize, in_place: bool) {
        let (triangle, corners) = (parts.map(|c| c.0), parts.map(|c| c.1));
        let borders = parts.map(|c| c.2);
        if in_place {
            self.triangles[old] = triangle;
            self.corners[old] = corners;
            self.borders[old] = borders;
        } else {
            self.triangles.push(triangle);
            self.corners.push(corners);
            self.borders.push(borders);
            self.charts.push(self.charts[old]);
            self.pieces.push(self.pieces[old]);
        }
    }
}

/// A place on a shared curve.
struct Shared {
    /// Place along the curve, from 0 to 1.
    place: f64,
    /// Vertex of each member there; `None` where a member lacks one.
    vertices: Vec<Option<u32>>,
}

impl Shared {
    /// Creates a place at which only one member has a vertex.
    fn new(place: f64, members: usize, (member, vertex): (usize, u32)) -> Self {
        let mut vertices = vec![None; members];
        vertices[member] = Some(vertex);
        Self { place, vertices }
    }
}

/// A curve shared by several sides, with the places at which any of them has a vertex.
struct Curve {
    members: Vec<Member>,
    places: Vec<Shared>,
}

impl Curve {
    fn new(members: Vec<Member>, surfaces: &[Surface]) -> Self {
        let mut all: Vec<(f64, usize, u32)> = Vec::new();
        for (k, m) in members.iter().enumerate() {
            let vertices = surfaces[m.patch].along(*m).into_iter();
            all.extend(vertices.map(|(x, v)| (x, k, v)));
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut places: Vec<Shared> = Vec::new();
        for (place, k, v) in all {
            match places.last_mut() {
                Some(last)
                    if place - last.place < SAME_PLACE_DISTANCE && last.vertices[k].is_none() =>
                {
                    last.vertices[k] = Some(v);
                }
                _ => places.push(Shared::new(place, members.len(), (k, v))),
            }
        }
        Self { members, places }
    }
    /// Returns the vertices of a place.
    fn vertices(&self, place: usize) -> impl Iterator<Item = PatchVertex> {
        let vertices = self.places[place].vertices.iter().zip(&self.members);
        vertices.filter_map(|(v, m)| {
            Some(PatchVertex {
                patch: m.patch,
                vertex: (*v)?,
            })
        })
    }
    /// Returns the position of a place.
    fn position(&self, surfaces: &[Surface], place: usize) -> Point3 {
        let first = self.vertices(place).next();
        let PatchVertex { patch, vertex } = first.expect("a vertex at every place");
        surfaces[patch].points[vertex as usize]
    }
    /// Adds a vertex to each member at every place between two of its own.
    fn complete(&mut self, surfaces: &mut [Surface]) {
        for k in 0..self.members.len() {
            let has_vertex = |&i: &usize| self.places[i].vertices[k].is_some();
            let known: Vec<usize> = (0..self.places.len()).filter(has_vertex).collect();
            for w in known.windows(2).filter(|w| w[1] > w[0] + 1) {
                let between = w[0] + 1..w[1];
                let new: Vec<(f64, Point3)> = between
                    .clone()
                    .map(|i| (self.places[i].place, self.position(surfaces, i)))
                    .collect();
                let vertex = |i: usize| self.places[i].vertices[k].expect("known");
                let (m, ends) = (self.members[k], [vertex(w[0]), vertex(w[1])]);
                let made = surfaces[m.patch].divide(m, ends, &new);
                for (i, v) in between.zip(made.into_iter().flatten()) {
                    self.places[i].vertices[k] = Some(v);
                }
            }
        }
    }
}

/// Joins the surfaces of patches over [0, 1]² into one; `patches` of the result tells the patch of
/// each triangle. Mismatches become findings.
pub(crate) fn join(patches: &[Patch], mut surfaces: Vec<Surface>, half_width: f64) -> Surface {
    let mut seams = Seams {
        pairs: Vec::new(),
        shared: vec![0; patches.len()],
        most: 1,
    };
    for members in curves(patches).into_iter().filter(|m| m.len() > 1) {
        seams.most = seams.most.max(members.len());
        for m in &members {
            seams.shared[m.patch] |= 1 << m.side;
        }
        let mut curve = Curve::new(members, &surfaces);
        curve.complete(&mut surfaces);
        for place in 0..curve.places.len() {
            let mut here = curve.vertices(place);
            if let Some(first) = here.next() {
                seams.pairs.extend(here.map(|other| [first, other]));
            }
        }
    }
    weld(patches, surfaces, &seams, half_width)
}

/// Curves and vertices shared by patches.
struct Seams {
    /// Pairs of coincident vertices.
    pairs: Vec<[PatchVertex; 2]>,
    /// Shared sides of each patch, as bits.
    shared: Vec<u64>,
    /// Maximum number of sides that are one curve.
    most: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_and_parameters_are_inverse() {
        for side in 0..4 {
            for k in 0..=8 {
                let x = f64::from(k) / 8.0;
                assert!((place(side, parameters(side, x)) - x).abs() < 1e-15);
            }
        }
    }
}
