//! Contraction of triangles without area, which arise where vertices of curves and their neighbours
//! are collinear or coincide.
//!
//! An edge that is short against the tolerance is contracted: an ordinary vertex moves onto its
//! neighbour. All triangles keep their parameters, so that what is proved of W on them remains
//! valid; their corners move by at most the length of the edge. The surface is preserved up to
//! homeomorphism if the common neighbours of the two vertices are just the corners opposite of the
//! edge (T. K. Dey and others, *Topology preserving edge contraction*, 1999).

use super::geometry::distance;
use super::triangles::{COINCIDENCE_DISTANCE, corners, is_flat, keep, leave_out, normal};
use crate::surface::{Point3, Surface, VertexKind};
use isoform_geom::dot;
use std::collections::BTreeSet;

/// Contracts short edges of triangles that have no area.
pub(super) fn contract_flat(s: &mut Surface, half_width: f64, tolerance: &dyn Fn(Point3) -> f64) {
    let mut gone = vec![false; s.points.len()];
    // Contracting one edge may leave another triangle flat.
    for _ in 0..4 {
        let flat: Vec<usize> = (0..s.triangles.len())
            .filter(|&k| is_narrow(corners(s, &s.triangles[k]), half_width))
            .collect();
        if flat.is_empty() {
            break;
        }
        let mut star = Stars::new(s);
        let mut dead = BTreeSet::new();
        for k in flat {
            if dead.contains(&k) {
                continue;
            }
            if let Some(v) = contract_one(s, k, &mut star, &mut dead, (half_width, tolerance)) {
                gone[v as usize] = true;
            }
        }
        if dead.is_empty() {
            break;
        }
        remove(s, &dead);
    }
    if gone.contains(&true) {
        leave_out(s, &gone);
    }
}

/// Removes triangles, after marking them by a repeated corner.
fn remove(s: &mut Surface, dead: &BTreeSet<usize>) {
    for &k in dead {
        s.triangles[k][1] = s.triangles[k][0];
    }
    keep(s, |_, t| t[0] != t[1]);
}

/// Returns true if a triangle has no area, or if two of its corners coincide.
fn is_narrow(at: [Point3; 3], half_width: f64) -> bool {
    let [p, q, r] = at;
    let near = |a: Point3, b: Point3| distance(a, b) < COINCIDENCE_DISTANCE * half_width;
    is_flat(at, half_width) || near(p, q) || near(q, r) || near(r, p)
}

/// Indices of the triangles at each vertex.
struct Stars {
    of: Vec<Vec<usize>>,
}

impl Stars {
    /// Computes the stars of a surface.
    fn new(s: &Surface) -> Self {
        let mut of = vec![Vec::new(); s.points.len()];
        for (k, t) in s.triangles.iter().enumerate() {
            t.iter().for_each(|&v| of[v as usize].push(k));
        }
        Self { of }
    }
    /// Returns true if the contraction of an edge preserves the surface up to homeomorphism: the
    /// triangles at its first vertex form a disc, two triangles have the edge, and the common
    /// neighbours of its vertices are the opposite corners of these.
    fn keeps_topology(&self, s: &Surface, [from, to]: [u32; 2]) -> bool {
        let around = &self.of[from as usize];
        let opposite: BTreeSet<u32> = around
            .iter()
            .map(|&k| s.triangles[k])
            .filter(|t| t.contains(&to))
            .flatten()
            .filter(|&v| v != from && v != to)
            .collect();
        let neighbours = self.neighbours(s, from);
        let shared: BTreeSet<u32> = neighbours
            .intersection(&self.neighbours(s, to))
            .copied()
            .collect();
        opposite.len() == 2 && shared == opposite && neighbours.len() == around.len()
    }
    /// Returns the vertices that share an edge with a vertex.
    fn neighbours(&self, s: &Surface, v: u32) -> BTreeSet<u32> {
        let all = self.of[v as usize].iter().flat_map(|&k| s.triangles[k]);
        all.filter(|&w| w != v).collect()
    }
}

/// Contracts the shortest edge of a triangle that may be contracted, and returns the removed
/// vertex.
fn contract_one(
    s: &mut Surface,
    k: usize,
    stars: &mut Stars,
    dead: &mut BTreeSet<usize>,
    limits: (f64, &dyn Fn(Point3) -> f64),
) -> Option<u32> {
    let ways = edges_by_length(s, s.triangles[k])
        .into_iter()
        .flat_map(|[a, b]| [[a, b], [b, a]]);
    let mut ways = ways.filter(|&[from, to]| may_move(s, stars, from, to, limits));
    let way = ways.next()?;
    let borders = move_onto(s, way, stars, dead);
    put_on_sides(s, way[1], stars, &borders);
    Some(way[0])
}

/// Returns the edges of a triangle, the shortest first.
fn edges_by_length(s: &Surface, t: [u32; 3]) -> [[u32; 2]; 3] {
    let at = |v: u32| s.points[v as usize];
    let length = |[a, b]: [u32; 2]| distance(at(a), at(b));
    let mut edges = [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    edges.sort_by(|&a, &b| length(a).total_cmp(&length(b)));
    edges
}

/// Replaces a vertex by another one in all triangles. Triangles with both are dead, and two edges
/// of each, to its third corner, become one. Returns the third corners, with the sides of the
/// domain on which one of the two edges lies.
fn move_onto(
    s: &mut Surface,
    [from, to]: [u32; 2],
    stars: &mut Stars,
    dead: &mut BTreeSet<usize>,
) -> Vec<(u32, u64)> {
    s.winding.contract(from, to);
    let moved = std::mem::take(&mut stars.of[from as usize]);
    let mut borders: Vec<(u32, u64)> = Vec::new();
    for k in moved {
        let t = s.triangles[k];
        if t.contains(&to) {
            dead.insert(k);
            let third = (0..3).find(|&i| t[i] != from && t[i] != to);
            borders.extend(third.map(|i| (t[i], edge_bits(s.borders[k], i))));
            for v in t {
                stars.of[v as usize].retain(|&other| other != k);
            }
        } else {
            s.triangles[k] = t.map(|v| if v == from { to } else { v });
            stars.of[to as usize].push(k);
        }
    }
    borders
}

/// Marks edges from a vertex to others as lying on sides of the domain, in all triangles that have
/// them.
fn put_on_sides(s: &mut Surface, vertex: u32, stars: &Stars, borders: &[(u32, u64)]) {
    for &(other, bits) in borders.iter().filter(|b| b.1 != 0) {
        for &k in &stars.of[vertex as usize] {
            let t = s.triangles[k];
            if t.contains(&other) {
                let on_edge = (0..3).filter(|&i| t[i] == other || t[i] == vertex);
                on_edge.for_each(|i| s.borders[k][i] |= bits);
            }
        }
    }
}

/// Returns the sides of the domain on which an edge at a corner of a triangle lies.
fn edge_bits(bits: [u64; 3], corner: usize) -> u64 {
    bits[corner] & (bits[(corner + 1) % 3] | bits[(corner + 2) % 3])
}

/// Returns true if a vertex may be moved onto a neighbour.
fn may_move(
    s: &Surface,
    stars: &Stars,
    from: u32,
    to: u32,
    (half_width, tolerance): (f64, &dyn Fn(Point3) -> f64),
) -> bool {
    let target = s.points[to as usize];
    if s.kinds[from as usize] != VertexKind::Ordinary
        || s.double[from as usize]
        // Contracting a longer edge would invalidate the proofs about its triangles.
        || distance(s.points[from as usize], target) > 0.02 * tolerance(target)
    {
        return false;
    }
    if !stars.keeps_topology(s, [from, to]) {
        return false;
    }
    let around = &stars.of[from as usize];
    around.iter().map(|&k| s.triangles[k]).all(|t| {
        let before = corners(s, &t);
        let after = [0, 1, 2].map(|i| if t[i] == from { target } else { before[i] });
        // A flat triangle may stay flat, as several vertices may coincide.
        t.contains(&to)
            || is_flat(before, half_width)
            || !is_flat(after, half_width) && dot(normal(before), normal(after)) > 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the square [0, 1]² as a fan about an interior point, with another point on the
    /// segment from there to a corner, at a distance: two triangles have no area.
    fn fan(distance: f64, kind: VertexKind) -> Surface {
        let d = 0.5 - distance * std::f64::consts::FRAC_1_SQRT_2;
        let points = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.5, 0.5, 0.0],
            [d, d, 0.0],
            // Just off the segment, and next to the point on it.
            [d, d, 1e-15],
        ];
        let triangles = vec![
            [4, 0, 1],
            [4, 1, 2],
            [4, 2, 3],
            [4, 3, 5],
            [5, 3, 0],
            [4, 5, 6],
            [5, 0, 6],
            [4, 6, 0],
        ];
        let (n, count) = (points.len(), triangles.len());
        Surface {
            kinds: (0..n)
                .map(|v| if v < 5 { VertexKind::Box } else { kind })
                .collect(),
            faces: vec![0; n],
            double: vec![false; n],
            charts: vec![0; count],
            corners: vec![[[0.0; 2]; 3]; count],
            borders: vec![[0; 3]; count],
            pieces: vec![0; count],
            points,
            triangles,
            ..Surface::default()
        }
    }
    fn euler(s: &Surface) -> i64 {
        let used: BTreeSet<u32> = s.triangles.iter().flatten().copied().collect();
        let edges = s.edges(&s.borders).len();
        used.len() as i64 - edges as i64 + s.triangles.len() as i64
    }
    fn flat(s: &Surface) -> usize {
        let is = |t: &&[u32; 3]| is_flat(corners(s, t), 1.0);
        s.triangles.iter().filter(is).count()
    }

    #[test]
    fn short_edges_of_flat_triangles_are_contracted() {
        let mut s = fan(1e-6, VertexKind::Ordinary);
        assert_eq!((flat(&s), euler(&s)), (3, 1));
        contract_flat(&mut s, 1.0, &|_| 1e-3);
        assert_eq!((flat(&s), euler(&s)), (0, 1));
        assert_eq!((s.points.len(), s.triangles.len()), (5, 4));
    }

    /// Four vertices coincide: each contraction but the last one leaves flat triangles.
    #[test]
    fn coincident_vertices_become_one() {
        let mut s = fan(1e-6, VertexKind::Ordinary);
        let near = s.points[4];
        for v in [5, 6] {
            s.points[v] = [near[0] + 1e-15 * v as f64, near[1], near[2]];
        }
        assert_eq!((flat(&s), euler(&s)), (4, 1));
        contract_flat(&mut s, 1.0, &|_| 1e-3);
        assert_eq!((flat(&s), euler(&s)), (0, 1));
        assert_eq!(s.triangles.len(), 4);
    }

    /// An edge that is long against the tolerance is kept, and so is a vertex of a curve.
    #[test]
    fn nothing_is_moved_far_and_no_vertex_of_a_curve() {
        for (distance, kind) in [(0.1, VertexKind::Ordinary), (1e-6, VertexKind::Double)] {
            let mut s = fan(distance, kind);
            contract_flat(&mut s, 1.0, &|_| 1e-3);
            assert!(flat(&s) > 0, "{kind:?}");
            assert_eq!(euler(&s), 1);
        }
    }
}
