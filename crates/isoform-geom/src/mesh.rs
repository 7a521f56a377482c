//! Meshes with groups: labelled triangles, tetrahedra, feature curves and corners.

mod opposite;
mod regions;
mod wedges;

use crate::{Aabb, Column, Point3};
pub use wedges::{WEDGE_QUADS, WEDGE_TRIANGLES};

/// Pairs of corners that the mid-edge nodes 4 to 9 of a ten-node tetrahedron belong to (the order
/// of VTK and CalculiX).
pub const TET_EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];
/// Corners of the face opposite to each corner, outward for a positive tetrahedron.
pub const TET_FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
/// Pairs of corners that the mid-edge nodes of a six-node triangle belong to.
pub const TRIANGLE_EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// A surface mesh, or a volume mesh with its boundary, linear or of second order.
///
/// ```
/// use isoform_geom::Mesh;
///
/// let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let mesh = Mesh::from_triangles(points, vec![[0, 1, 2]]);
/// assert_eq!((mesh.order(), mesh.bounds().size()), (1, [1.0, 1.0, 0.0]));
/// ```
///
/// Element arrays hold indices into `points`. Label arrays are as long as their elements or empty
/// (no labels); labels are indices into the list of names beside them. Arrays of mid nodes are as
/// long as their elements in a mesh of second order, else empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Nodes.
    pub points: Vec<Point3>,
    /// Triangles of the surface, counterclockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Mid-edge nodes of the triangles, in the order of [`TRIANGLE_EDGES`].
    pub triangle_mids: Vec<[u32; 3]>,
    /// The part that each triangle lies on, index into `parts`.
    pub triangle_parts: Vec<u32>,
    /// Names of the parts.
    pub parts: Vec<String>,
    /// Tetrahedra, positive: (b − a) · ((c − a) × (d − a)) > 0. Empty for a surface.
    pub tets: Vec<[u32; 4]>,
    /// Mid-edge nodes of the tetrahedra, in the order of [`TET_EDGES`].
    pub tet_mids: Vec<[u32; 6]>,
    /// The region that each tetrahedron belongs to, index into `regions`.
    pub tet_regions: Vec<u32>,
    /// Names of the regions.
    pub regions: Vec<String>,
    /// Wedges (prisms) of boundary layers, positive: the base 0 1 2 looks towards 3 4 5, and node
    /// 3 lies over 0, 4 over 1, 5 over 2. Meshes with wedges are of first order.
    pub wedges: Vec<[u32; 6]>,
    /// Quadrilaterals of the surface: sides of wedges, counterclockwise seen from outside.
    pub quads: Vec<[u32; 4]>,
    /// The part that each quadrilateral lies on, index into `parts`.
    pub quad_parts: Vec<u32>,
    /// Edges on feature curves.
    pub edges: Vec<[u32; 2]>,
    /// Mid nodes of the edges.
    pub edge_mids: Vec<u32>,
    /// The curve that each edge lies on, index into `curves`.
    pub edge_curves: Vec<u32>,
    /// The feature curves.
    pub curves: Vec<Curve>,
    /// Nodes at corners of the solid.
    pub corners: Vec<u32>,
    /// Nodes of a unit cell that stand for one, by axes along which it repeats.
    pub opposite: Vec<Opposite>,
    /// Further numbers per node, each list as long as `points`. Those called `u` and `v` are
    /// parameters on the surface: formats with textures take them as texture coordinates.
    pub columns: Vec<Column>,
}

/// Nodes on two opposite sides of a box.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Opposite {
    /// The axis across which the sides lie: 0, 1 or 2.
    pub axis: usize,
    /// A node on the lower side and the one that lies opposite on the upper side, in the order of
    /// the lower nodes.
    pub nodes: Vec<[u32; 2]>,
}

/// A feature curve: where two parts meet at an angle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Curve {
    /// Name, made of the names of its parts.
    pub name: String,
    /// The parts, indices into the mesh's `parts`.
    pub parts: [u32; 2],
}

impl Mesh {
    /// A mesh of bare triangles.
    pub fn from_triangles(points: Vec<Point3>, triangles: Vec<[u32; 3]>) -> Self {
        Self {
            points,
            triangles,
            ..Self::default()
        }
    }
    /// 2 with mid-edge nodes, else 1.
    pub fn order(&self) -> u32 {
        if self.tet_mids.is_empty() && self.triangle_mids.is_empty() {
            1
        } else {
            2
        }
    }
    /// The columns `u` and `v`, if both are there.
    pub fn parameters(&self) -> Option<(&[f64], &[f64])> {
        let named = |name: &str| {
            self.columns
                .iter()
                .find(|c| c.name == name)
                .map(|c| c.values.as_slice())
        };
        named("u").zip(named("v"))
    }
    /// Smallest box around the nodes.
    pub fn bounds(&self) -> Aabb {
        Aabb::of(&self.points)
    }
}
