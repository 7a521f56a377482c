//! Edge lengths of a given mesh.

use super::align::edges_of;
use crate::options::Sizes;
use isoform_geom::{Mesh, Point3, TET_EDGES, norm, sub};

/// Returns the edge lengths of a surface as sizes: at each vertex the geometric mean of its edges'
/// lengths, growing slowly with the distance from the vertex.
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
///
/// # Panics
/// If a triangle has a node index out of range ([`check_nodes`](crate::check_nodes)).
pub fn own_sizes(mesh: &Mesh) -> Sizes {
    // (Sum of logarithms, number of edges) of each vertex.
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
    // Growth of the sizes per unit of length.
    Sizes::nearest(&samples, 0.4)
}

/// Returns the mean edge length of a mesh's tetrahedra, or of its triangles if it has no
/// tetrahedra; 0 for an empty mesh.
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
///
/// # Panics
/// If an element has a node index out of range ([`check_nodes`](crate::check_nodes)).
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
