//! Block with two layers of wedges at its floor.

use isoform_geom::{Curve, Mesh, Point3};

/// Returns a square column: two layers of two wedges each on the floor, and two tetrahedra over
/// them, which meet in a point. The parts are the floor, of triangles, and the side, of
/// quadrilaterals and triangles; the curve between them has four edges and four corners. The volume
/// is 8/15.
pub(crate) fn layers() -> Mesh {
    let square = |z: f64| [[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]];
    let points: Vec<Point3> = [0.0, 0.1, 0.3].into_iter().flat_map(square).collect();
    let halves = |z: u32| [[4 * z, 4 * z + 1, 4 * z + 2], [4 * z, 4 * z + 2, 4 * z + 3]];
    let over = |[a, b, c]: [u32; 3]| [a, b, c, a + 4, b + 4, c + 4];
    let walls = |z: u32| {
        [[0, 1], [1, 2], [2, 3], [3, 0]]
            .map(|[a, b]| [4 * z + a, 4 * z + b, 4 * z + b + 4, 4 * z + a + 4])
    };
    let edges = vec![[0, 1], [1, 2], [2, 3], [3, 0]];
    let floor = halves(0).map(|[a, b, c]| [a, c, b]);
    let roof = [[8, 9, 12], [9, 10, 12], [10, 11, 12], [11, 8, 12]];
    Mesh {
        points: [points, vec![[0.5, 0.5, 1.0]]].concat(),
        triangles: [&floor[..], &roof].concat(),
        triangle_parts: vec![0, 0, 1, 1, 1, 1],
        quads: [walls(0), walls(1)].concat(),
        quad_parts: vec![1; 8],
        parts: vec!["floor".into(), "side".into()],
        wedges: [halves(0), halves(1)]
            .concat()
            .into_iter()
            .map(over)
            .collect(),
        tets: halves(2).map(|[a, b, c]| [a, b, c, 12]).to_vec(),
        tet_regions: vec![0; 2],
        regions: vec!["solid".into()],
        edge_curves: vec![0; 4],
        curves: vec![Curve {
            name: "floor/side".into(),
            parts: [0, 1],
        }],
        edges,
        corners: vec![0, 1, 2, 3],
        ..Mesh::default()
    }
}
