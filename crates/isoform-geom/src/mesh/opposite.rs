//! Pairs of nodes on opposite sides of a unit cell.

use super::{Mesh, Opposite};
use crate::Aabb;
use std::collections::HashMap;

impl Mesh {
    /// Returns the pairs of surface nodes on the two sides of a box normal to an axis whose other
    /// coordinates are equal, bit for bit. Nodes without a partner are omitted.
    ///
    /// ```
    /// use isoform_geom::{Aabb, Mesh};
    ///
    /// let points = vec![[0.0, 0.5, 0.5], [1.0, 0.5, 0.5], [0.2, 0.0, 0.0]];
    /// let mesh = Mesh::from_triangles(points, vec![[0, 1, 2]]);
    /// let cell = Aabb { lo: [0.0; 3], hi: [1.0; 3] };
    /// assert_eq!(mesh.opposite_nodes(cell, 0).nodes, [[0, 1]]);
    /// assert!(mesh.opposite_nodes(cell, 1).nodes.is_empty());
    /// ```
    pub fn opposite_nodes(&self, region: Aabb, axis: usize) -> Opposite {
        let others = [(axis + 1) % 3, (axis + 2) % 3];
        let key = |v: u32| others.map(|i| (self.points[v as usize][i] + 0.0).to_bits());
        let mut used = vec![false; self.points.len()];
        let (corners, mids) = (&self.triangles, &self.triangle_mids);
        for &v in corners.as_flattened().iter().chain(mids.as_flattened()) {
            used[v as usize] = true;
        }
        let on = |at: f64| {
            let is_on = move |v: &u32| self.points[*v as usize][axis] == at;
            (0..self.points.len() as u32)
                .filter(|&v| used[v as usize])
                .filter(is_on)
        };
        let upper: HashMap<[u64; 2], u32> = on(region.hi[axis]).map(|v| (key(v), v)).collect();
        let pair = |v: u32| Some([v, *upper.get(&key(v))?]);
        Opposite {
            axis,
            nodes: on(region.lo[axis]).filter_map(pair).collect(),
        }
    }
}
