//! The mesh prepared for recognition: scaled, without duplicate vertices and triangles,
//! consistently oriented, with adjacency.

use crate::chart::unit;
use crate::cloud::{Scaling, sorted};
use crate::labels::UNLABELLED;
use isoform_geom::{KdTree, Point3, PointCloud, UnionFind, cross, dot, norm, rounding, sub};
use rayon::prelude::*;
use std::collections::VecDeque;

/// Maximum distance of a vertex from its surface, in rounding errors: three coordinates were
/// rounded, and the programs that made them computed no better. Fewer lose facets, more join facets
/// of different surfaces.
const TOLERANCE_IN_ROUNDINGS: f64 = 10.0;

/// A mesh of triangles about the middle of its box, scaled to a diagonal of 1.
pub(crate) struct Facets {
    pub(crate) points: Vec<Point3>,
    /// Index in `points` of each given vertex.
    pub(crate) index: Vec<u32>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Unit normals, outwards if the mesh is closed or oriented.
    pub(crate) normals: Vec<Point3>,
    pub(crate) areas: Vec<f64>,
    /// Smallest height of each triangle.
    pub(crate) heights: Vec<f64>,
    /// Maximum distance of vertices from their surface.
    pub(crate) tolerance: f64,
    /// Largest rounding error of a coordinate.
    pub(crate) rounding: f64,
    /// Number of triangles at each point.
    pub(crate) valence: Vec<u32>,
    near: Vec<u32>,
    first: Vec<u32>,
}

/// Ends of an edge in ascending order, its triangle, and a flag: true if the triangle runs from the
/// first to the second.
type EdgeSide = ([u32; 2], u32, bool);

impl Facets {
    /// Prepares a mesh whose corners are points; degenerate triangles are left out.
    pub(crate) fn new(scan: &PointCloud, scaling: &Scaling) -> Self {
        let rounding = rounding(scan) / scaling.unit;
        // In diagonals: the accuracy with which modellers compute where two surfaces meet, and five
        // roundings of single precision, which a mesh has that was scaled after it had been
        // rounded.
        let tolerance = (TOLERANCE_IN_ROUNDINGS * rounding).max(3e-7);
        let (places, mut index) = sorted(&scan.points);
        let points: Vec<Point3> = places.iter().map(|p| scaling.apply(*p)).collect();
        let mut triangles = distinct(&scan.triangles, &index, &points, tolerance);
        let open = open_vertices(&sides(&triangles));
        if let Some(same) = welded(&points, &open, tolerance) {
            index.iter_mut().for_each(|i| *i = same[*i as usize]);
            triangles = distinct(&scan.triangles, &index, &points, tolerance);
        }
        let sides = sides(&triangles);
        turn_alike(&mut triangles, &sides);
        if volume(&points, &triangles) < 0.0 && open_vertices(&sides).is_empty() {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let (near, first) = neighbours(&sides, triangles.len());
        let mut valence = vec![0; points.len()];
        let corners = triangles.as_flattened().iter();
        corners.for_each(|v| valence[*v as usize] += 1);
        let shape = |t: &[u32; 3]| shape(t.map(|v| points[v as usize]));
        let shapes: Vec<(Point3, f64, f64)> = triangles.par_iter().map(shape).collect();
        Self {
            normals: shapes.iter().map(|s| s.0).collect(),
            areas: shapes.iter().map(|s| s.1).collect(),
            heights: shapes.iter().map(|s| s.2).collect(),
            points,
            index,
            triangles,
            tolerance,
            rounding,
            valence,
            near,
            first,
        }
    }

    /// Returns the distance of vertices from their surface that rounding and modellers allow.
    pub(crate) fn exactness(&self) -> f64 {
        self.tolerance / TOLERANCE_IN_ROUNDINGS
    }

    /// Returns the triangles across the edges of one.
    pub(crate) fn near(&self, t: u32) -> &[u32] {
        let [from, to] = [t as usize, t as usize + 1].map(|k| self.first[k] as usize);
        &self.near[from..to]
    }

    /// Returns each triangle with each of those across its edges.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = (u32, u32)> {
        let all = 0..self.triangles.len() as u32;
        all.flat_map(|t| self.near(t).iter().map(move |u| (t, *u)))
    }

    /// Returns the edge-connected pieces of parts, each with its part, given the part of each
    /// triangle.
    pub(crate) fn pieces(&self, parts: &[u32]) -> Vec<(u32, Vec<u32>)> {
        let mut is_open: Vec<bool> = parts.iter().map(|part| *part != UNLABELLED).collect();
        let mut pieces = Vec::new();
        for seed in 0..parts.len() {
            if !std::mem::take(&mut is_open[seed]) {
                continue;
            }
            let (mut piece, mut at) = (vec![seed as u32], 0);
            while let Some(t) = piece.get(at).copied() {
                at += 1;
                for u in self.near(t) {
                    let is_own = parts[*u as usize] == parts[seed];
                    if is_own && std::mem::take(&mut is_open[*u as usize]) {
                        piece.push(*u);
                    }
                }
            }
            pieces.push((parts[seed], piece));
        }
        pieces
    }

    /// Returns the vertices that two triangles share.
    pub(crate) fn shared(&self, t: u32, u: u32) -> impl Iterator<Item = u32> {
        let [own, other] = [t, u].map(|t| self.triangles[t as usize]);
        own.into_iter().filter(move |v| other.contains(v))
    }

    /// Returns the corners of a triangle.
    pub(crate) fn corners(&self, t: u32) -> [Point3; 3] {
        self.triangles[t as usize].map(|v| self.points[v as usize])
    }

    /// Returns the distinct vertices of triangles, in ascending order.
    pub(crate) fn vertices(&self, of: &[u32]) -> Vec<u32> {
        let corners = of.iter().flat_map(|t| self.triangles[*t as usize]);
        let mut vertices: Vec<u32> = corners.collect();
        vertices.sort_unstable();
        vertices.dedup();
        vertices
    }

    /// Returns true if all triangles at some vertex are among these.
    pub(crate) fn surround_a_vertex(&self, of: &[u32]) -> bool {
        let corners = of.iter().flat_map(|t| self.triangles[*t as usize]);
        let mut corners: Vec<u32> = corners.collect();
        corners.sort_unstable();
        let mut groups = corners.chunk_by(|a, b| a == b);
        groups.any(|g| g.len() == self.valence[g[0] as usize] as usize)
    }

    /// Returns the positions of vertices.
    pub(crate) fn at(&self, which: &[u32]) -> Vec<Point3> {
        which.iter().map(|i| self.points[*i as usize]).collect()
    }

    /// Returns the cosine of the angle between the normals of two triangles.
    pub(crate) fn cosine(&self, a: u32, b: u32) -> f64 {
        dot(self.normals[a as usize], self.normals[b as usize])
    }

    /// Returns the total area of triangles.
    pub(crate) fn area(&self, of: &[u32]) -> f64 {
        of.iter().map(|t| self.areas[*t as usize]).sum()
    }
}

/// Returns the triangles by the indices of their points, without duplicates and without those too
/// narrow for the tolerance.
fn distinct(given: &[[u32; 3]], index: &[u32], points: &[Point3], tolerance: f64) -> Vec<[u32; 3]> {
    let placed = |t: &[u32; 3]| t.map(|v| index[v as usize]);
    let mut keyed: Vec<([u32; 3], u32)> = (0..given.len() as u32)
        .map(|k| {
            let mut key = placed(&given[k as usize]);
            key.sort_unstable();
            (key, k)
        })
        .filter(|([a, b, c], _)| a != b && b != c)
        .collect();
    keyed.par_sort_unstable();
    keyed.dedup_by_key(|k| k.0);
    keyed.sort_unstable_by_key(|k| k.1);
    let triangles = keyed.iter().map(|k| placed(&given[k.1 as usize]));
    let is_wide = |t: &[u32; 3]| shape(t.map(|v| points[v as usize])).2 > 0.01 * tolerance;
    triangles.filter(is_wide).collect()
}

/// Returns the normal, the area and the smallest height of a triangle.
fn shape([a, b, c]: [Point3; 3]) -> (Point3, f64, f64) {
    let n = cross(sub(b, a), sub(c, a));
    let double = norm(n);
    let sides = [sub(b, a), sub(c, b), sub(a, c)].map(norm);
    let longest = sides.into_iter().fold(0.0, f64::max);
    let height = if longest > 0.0 { double / longest } else { 0.0 };
    (unit(n), double / 2.0, height)
}

/// Returns the sides of triangles, sorted by edge.
fn sides(triangles: &[[u32; 3]]) -> Vec<EdgeSide> {
    let of = |(t, v): (usize, &[u32; 3])| {
        let [a, b, c] = *v;
        [[a, b], [b, c], [c, a]].map(|[a, b]| ([a.min(b), a.max(b)], t as u32, a < b))
    };
    let mut sides: Vec<EdgeSide> = triangles.iter().enumerate().flat_map(of).collect();
    sides.par_sort_unstable();
    sides
}

/// Groups sides by edge.
fn edges(sides: &[EdgeSide]) -> impl Iterator<Item = &[EdgeSide]> {
    sides.chunk_by(|a, b| a.0 == b.0)
}

/// Returns the vertices at edges of only one triangle.
fn open_vertices(sides: &[EdgeSide]) -> Vec<u32> {
    let open = edges(sides).filter(|e| e.len() == 1);
    let mut vertices: Vec<u32> = open.flat_map(|e| e[0].0).collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices
}

/// Returns for each point the smallest index of those that coincide with it up to rounding, along
/// open edges; `None` if no edges are open.
fn welded(points: &[Point3], open: &[u32], tolerance: f64) -> Option<Vec<u32>> {
    if open.is_empty() {
        return None;
    }
    let at: Vec<Point3> = open.iter().map(|v| points[*v as usize]).collect();
    let tree = KdTree::new(&at);
    let mut same = UnionFind::new(points.len());
    let squared = tolerance * tolerance;
    for (k, p) in at.iter().enumerate() {
        tree.near(*p, squared, &mut |_, j| {
            same.unite(open[k], open[j as usize]);
            squared
        });
    }
    Some((0..points.len() as u32).map(|v| same.root(v)).collect())
}

/// Reverses triangles such that neighbours run along their edge in opposite directions; in each
/// piece the minority is reversed.
fn turn_alike(triangles: &mut [[u32; 3]], sides: &[EdgeSide]) {
    let mut near: Vec<(u32, u32, bool)> = Vec::new();
    for edge in edges(sides).filter(|e| e.len() == 2) {
        let (a, b) = (&edge[0], &edge[1]);
        near.push((a.1, b.1, a.2 == b.2));
        near.push((b.1, a.1, a.2 == b.2));
    }
    near.sort_unstable();
    let mut turned: Vec<Option<bool>> = vec![None; triangles.len()];
    for start in 0..triangles.len() {
        if turned[start].is_some() {
            continue;
        }
        turned[start] = Some(false);
        let (mut queue, mut piece) = (VecDeque::from([start as u32]), Vec::new());
        while let Some(t) = queue.pop_front() {
            piece.push(t);
            let own = turned[t as usize] == Some(true);
            let from = near.partition_point(|n| n.0 < t);
            for (_, u, clash) in near[from..].iter().take_while(|n| n.0 == t) {
                if turned[*u as usize].is_none() {
                    turned[*u as usize] = Some(own != *clash);
                    queue.push_back(*u);
                }
            }
        }
        let changed = piece.iter().filter(|t| turned[**t as usize] == Some(true));
        let most = changed.count() * 2 > piece.len();
        for t in piece {
            if (turned[t as usize] == Some(true)) != most {
                triangles[t as usize].swap(1, 2);
            }
        }
    }
}

/// Returns six times the enclosed volume.
fn volume(points: &[Point3], triangles: &[[u32; 3]]) -> f64 {
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| points[v as usize]);
        dot(a, cross(b, c))
    };
    triangles.iter().map(of).sum()
}

/// Returns the triangles across the edges of each triangle, concatenated, and the index of the
/// first of each.
fn neighbours(sides: &[EdgeSide], count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    // More triangles at an edge are a bundle of sheets.
    for edge in edges(sides).filter(|e| e.len() <= 4) {
        for a in edge {
            pairs.extend(edge.iter().filter(|b| b.1 != a.1).map(|b| (a.1, b.1)));
        }
    }
    pairs.par_sort_unstable();
    pairs.dedup();
    let mut first = vec![0; count + 1];
    pairs.iter().for_each(|p| first[p.0 as usize + 1] += 1);
    for k in 0..count {
        first[k + 1] += first[k];
    }
    (pairs.iter().map(|p| p.1).collect(), first)
}
