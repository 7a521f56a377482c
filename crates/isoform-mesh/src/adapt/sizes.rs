//! The edge lengths that a mesh has.

use super::align::edges_of;
use crate::options::Sizes;
use isoform_geom::{Mesh, Point3, TET_EDGES, norm, sub};

/// By how much sizes may grow per unit of length where the edge lengths of a given surface are
/// kept.
const GROWTH: f64 = 0.4;

/// The edge lengths of a surface by place: at each vertex the geometric mean of its edges' lengths,
/// growing slowly with the distance from the vertex.
///
/// ```
/// use isoform_geom::Mesh;
/// use isoform_mesh::own_sizes;
///
/// // Edges of 3, 4 and 5 units.
/// let mesh = Mesh {
///     points: vec![[0.0; 3], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0]],
///     triangles: vec![[0, 1, 2]],
///     ..Mesh::default()
/// };
/// let size = own_sizes(&mesh).0([0.0; 3]);
/// assert!((size - 12f64.sqrt()).abs() < 1e-12);
/// ```
pub fn own_sizes(mesh: &Mesh) -> Sizes {
    // Sums of logarithms with the number of edges.
    let mut sums = vec![(0.0, 0usize); mesh.points.len()];
    for e in edges_of(&mesh.triangles) {
        let l = norm(sub(mesh.points[e[0] as usize], mesh.points[e[1] as usize]));
        if l > 0.0 {
            for v in e {
                let sum = &mut sums[v as usize];
                *sum = (sum.0 + l.ln(), sum.1 + 1);
            }
        }
    }
    let samples: Vec<(Point3, f64)> = mesh
        .points
        .iter()
        .zip(&sums)
        .filter(|(_, s)| s.1 > 0)
        .map(|(p, s)| (*p, (s.0 / s.1 as f64).exp()))
        .collect();
    Sizes::nearest(&samples, GROWTH)
}

/// Mean length of the edges of a mesh's tetrahedra, of its triangles where it has none; 0 if there
/// are neither.
///
/// ```
/// use isoform_geom::Mesh;
/// use isoform_mesh::mean_edge;
///
/// let mesh = Mesh {
///     points: vec![[0.0; 3], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0]],
///     triangles: vec![[0, 1, 2]],
///     ..Mesh::default()
/// };
/// assert_eq!(mean_edge(&mesh), 4.0);
/// assert_eq!(mean_edge(&Mesh::default()), 0.0);
/// ```
pub fn mean_edge(mesh: &Mesh) -> f64 {
    let length = |a: u32, b: u32| norm(sub(mesh.points[a as usize], mesh.points[b as usize]));
    if mesh.tets.is_empty() {
        let edges = edges_of(&mesh.triangles);
        return edges.iter().map(|e| length(e[0], e[1])).sum::<f64>() / edges.len().max(1) as f64;
    }
    let sum: f64 = mesh
        .tets
        .iter()
        .flat_map(|t| TET_EDGES.map(|[i, j]| length(t[i], t[j])))
        .sum();
    sum / (6 * mesh.tets.len()) as f64
}
