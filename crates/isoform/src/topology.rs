//! Topology of an arbitrary set of triangles: closed or open, with any number of triangles per
//! edge.

use isoform_geom::{Point3, UnionFind, cross, dot, norm, sub};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// Topological numbers of a set of triangles, which need not form a manifold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    /// Euler characteristic: vertices − edges + triangles.
    pub euler: i64,
    /// Number of connected components: sets of triangles connected by vertices.
    pub components: usize,
    /// Number of connected components of the boundary, which consists of the edges of one triangle.
    /// Curves that share a vertex are one component.
    pub boundary_loops: usize,
    /// Number of edges of more than two triangles.
    pub crowded_edges: usize,
}

/// Computes the topology of triangles given by the indices of their vertices. Only vertices in use
/// count.
///
/// ```
/// let tetrahedron = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
/// assert_eq!(isoform::topology(&tetrahedron).euler, 2);
/// assert_eq!(isoform::topology(&tetrahedron[1..]).boundary_loops, 1);
/// ```
pub fn topology(triangles: &[[u32; 3]]) -> Topology {
    let edges = edges(triangles);
    let every: Vec<[u32; 2]> = edges.keys().copied().collect();
    let open: Vec<[u32; 2]> = edges.iter().filter(|e| *e.1 == 1).map(|e| *e.0).collect();
    let (vertices, components) = groups(&every);
    Topology {
        euler: vertices as i64 - edges.len() as i64 + triangles.len() as i64,
        components,
        boundary_loops: groups(&open).1,
        crowded_edges: edges.values().filter(|n| **n > 2).count(),
    }
}

/// Edges and size of a set of triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SurfaceMeasures {
    /// Number of edges of one triangle.
    pub open_edges: usize,
    /// Number of edges of more than two triangles.
    pub crowded_edges: usize,
    /// Number of edges of two triangles that run along them in one direction.
    pub misoriented_edges: usize,
    /// Area, in square units.
    pub area: f64,
    /// Enclosed volume, in cubic units, negative if the triangles face inward; `None` unless each
    /// edge has two triangles, which run along it in opposite directions.
    pub volume: Option<f64>,
}

/// Counts the edges of triangles, and measures their surface.
///
/// ```
/// let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let tetrahedron = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
/// let measures = isoform::surface_measures(&points, &tetrahedron);
/// assert!((measures.volume.expect("closed") - 1.0 / 6.0).abs() < 1e-15);
/// assert_eq!(isoform::surface_measures(&points, &tetrahedron[1..]).open_edges, 3);
/// ```
pub fn surface_measures(points: &[Point3], triangles: &[[u32; 3]]) -> SurfaceMeasures {
    let ends = |t: &[u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    let sides = triangles.iter().flat_map(ends);
    let mut sides: Vec<([u32; 2], bool)> =
        sides.map(|(a, b)| ([a.min(b), a.max(b)], a < b)).collect();
    sides.par_sort_unstable();
    let mut found = SurfaceMeasures::default();
    for edge in sides.chunk_by(|a, b| a.0 == b.0) {
        match edge {
            [_] => found.open_edges += 1,
            [a, b] => found.misoriented_edges += usize::from(a.1 == b.1),
            _ => found.crowded_edges += 1,
        }
    }
    // As seen from a vertex, so that no digits are lost far from the origin.
    let from = triangles
        .first()
        .map_or([0.0; 3], |t| points[t[0] as usize]);
    let mut volume = 0.0;
    for t in triangles {
        let [a, b, c] = t.map(|v| sub(points[v as usize], from));
        let normal = cross(sub(b, a), sub(c, a));
        found.area += 0.5 * norm(normal);
        volume += dot(a, normal) / 6.0;
    }
    let faults = found.open_edges + found.crowded_edges + found.misoriented_edges;
    found.volume = (faults == 0).then_some(volume);
    found
}

/// Returns all edges, lower vertex first, with the number of triangles at each.
fn edges(triangles: &[[u32; 3]]) -> BTreeMap<[u32; 2], usize> {
    let mut edges = BTreeMap::new();
    for &[a, b, c] in triangles {
        for [p, q] in [[a, b], [b, c], [c, a]] {
            *edges.entry([p.min(q), p.max(q)]).or_default() += 1;
        }
    }
    edges
}

/// Counts the vertices and the connected components of a graph given by its edges.
fn groups(edges: &[[u32; 2]]) -> (usize, usize) {
    let mut vertices: Vec<u32> = edges.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let mut sets = UnionFind::new(vertices.len());
    for edge in edges {
        // All vertices of the edges are in the sorted list.
        let [a, b] = edge.map(|v| vertices.partition_point(|w| *w < v) as u32);
        sets.unite(a, b);
    }
    (vertices.len(), sets.count())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn open_and_crossing_sheets() {
        assert_eq!(topology(&[]), Topology::default());
        // Two squares that cross in an edge: four triangles at it, and one boundary, as its curves
        // meet at the ends of the edge.
        let crossing = [[0, 1, 2], [0, 3, 1], [0, 1, 4], [0, 5, 1]];
        assert_eq!(
            topology(&crossing),
            Topology {
                euler: 1,
                components: 1,
                boundary_loops: 1,
                crowded_edges: 1
            }
        );
        // Two triangles that share one vertex, and a separate one.
        let touching = [[0, 1, 2], [2, 3, 4], [7, 8, 9]];
        assert_eq!(
            topology(&touching),
            Topology {
                euler: 2,
                components: 2,
                boundary_loops: 2,
                crowded_edges: 0
            }
        );
        // An annulus of six triangles.
        let annulus = [
            [0, 1, 3],
            [1, 4, 3],
            [1, 2, 4],
            [2, 5, 4],
            [2, 0, 5],
            [0, 3, 5],
        ];
        assert_eq!(
            topology(&annulus),
            Topology {
                euler: 0,
                components: 1,
                boundary_loops: 2,
                crowded_edges: 0
            }
        );
    }
}
