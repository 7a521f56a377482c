//! Meshes with groups: labelled triangles, tetrahedra, feature curves and corners.

mod opposite;
mod regions;
mod wedges;

use crate::{Aabb, Column, Point3};
pub use wedges::{WEDGE_QUADS, WEDGE_TRIANGLES};

/// Corners of the edges of a ten-node tetrahedron, in the order of its mid-edge nodes 4 to 9 (that
/// of VTK and CalculiX).
pub const TET_EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];
/// Corners of the face opposite to each corner, oriented outward for a positive tetrahedron.
pub const TET_FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
/// Corners of the edges of a six-node triangle, in the order of its mid-edge nodes.
pub const TRIANGLE_EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// Surface mesh, or volume mesh with its boundary, of first or second order.
///
/// ```
/// use isoform_geom::Mesh;
///
/// let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let mesh = Mesh::from_triangles(points, vec![[0, 1, 2]]);
/// assert_eq!((mesh.order(), mesh.bounds().size()), (1, [1.0, 1.0, 0.0]));
/// ```
///
/// Element arrays hold indices into `points`. Label arrays are as long as their element arrays or
/// empty (no labels); labels are indices into the list of names. Arrays of mid-edge nodes are as
/// long as their element arrays in a mesh of second order, else empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions of the nodes.
    pub points: Vec<Point3>,
    /// Triangles of the surface, counterclockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Mid-edge nodes of the triangles, in the order of [`TRIANGLE_EDGES`].
    pub triangle_mids: Vec<[u32; 3]>,
    /// Part that each triangle lies on, an index into `parts`.
    pub triangle_parts: Vec<u32>,
    /// Names of the parts.
    pub parts: Vec<String>,
    /// Tetrahedra, positive: (b − a) · ((c − a) × (d − a)) > 0. Empty for a surface.
    pub tets: Vec<[u32; 4]>,
    /// Mid-edge nodes of the tetrahedra, in the order of [`TET_EDGES`].
    pub tet_mids: Vec<[u32; 6]>,
    /// Region that each tetrahedron belongs to, an index into `regions`.
    pub tet_regions: Vec<u32>,
    /// Names of the regions.
    pub regions: Vec<String>,
    /// Wedges (triangular prisms) of boundary layers, positive: the base 0 1 2 faces 3 4 5, and
    /// node 3 lies over 0, 4 over 1, 5 over 2. Meshes with wedges are of first order.
    pub wedges: Vec<[u32; 6]>,
    /// Quadrilaterals of the surface: sides of wedges, counterclockwise seen from outside.
    pub quads: Vec<[u32; 4]>,
    /// Part that each quadrilateral lies on, an index into `parts`.
    pub quad_parts: Vec<u32>,
    /// Edges on feature curves.
    pub edges: Vec<[u32; 2]>,
    /// Mid-edge nodes of the edges.
    pub edge_mids: Vec<u32>,
    /// Feature curve that each edge lies on, an index into `curves`.
    pub edge_curves: Vec<u32>,
    /// Feature curves.
    pub curves: Vec<Curve>,
    /// Nodes at corners of the solid.
    pub corners: Vec<u32>,
    /// Pairs of nodes that are identified in a periodic unit cell, by the axis of the period.
    pub opposite: Vec<Opposite>,
    /// Further values per node, each list as long as `points`. Columns named `u` and `v` are
    /// parameters on the surface: formats with textures store them as texture coordinates.
    pub columns: Vec<Column>,
}

/// Pairs of nodes on two opposite sides of a box.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Opposite {
    /// Axis normal to the sides: 0, 1 or 2.
    pub axis: usize,
    /// Pairs of a node on the lower side and the opposite one on the upper side, in the order of
    /// the lower nodes.
    pub nodes: Vec<[u32; 2]>,
}

/// Feature curve: the set of points at which two parts meet at an angle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Curve {
    /// Name, composed of the names of its parts.
    pub name: String,
    /// The two parts, as indices into the mesh's `parts`.
    pub parts: [u32; 2],
}

impl Mesh {
    /// Returns a surface mesh of triangles without labels.
    pub fn from_triangles(points: Vec<Point3>, triangles: Vec<[u32; 3]>) -> Self {
        Self {
            points,
            triangles,
            ..Self::default()
        }
    }
    /// Returns the order of the elements: 2 if there are mid-edge nodes, else 1.
    pub fn order(&self) -> u32 {
        if self.tet_mids.is_empty() && self.triangle_mids.is_empty() {
            1
        } else {
            2
        }
    }
    /// Returns the columns `u` and `v`; `None` unless both exist.
    pub fn parameters(&self) -> Option<(&[f64], &[f64])> {
        let named = |name: &str| {
            self.columns
                .iter()
                .find(|c| c.name == name)
                .map(|c| c.values.as_slice())
        };
        named("u").zip(named("v"))
    }
    /// Returns the smallest box around the nodes.
    pub fn bounds(&self) -> Aabb {
        Aabb::from_points(&self.points)
    }
}
