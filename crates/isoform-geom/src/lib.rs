//! Geometric types and functions that all stages share.
//!
//! Points are `[f64; 3]` in model units; angles are radians; inside is f ≥ 0 and the outward normal
//! is −∇f/|∇f|.
#![forbid(unsafe_code)]

pub mod brep;
pub mod cad;
mod cloud;
mod curvature;
mod field;
mod gram;
mod kdtree;
mod mesh;
mod normals;
mod pairs;
mod parts;
mod patch;
pub mod plane;
mod point;
mod quadric;
pub mod rotation;
mod rounding;
mod solid;
mod spline;
mod union_find;

pub use cloud::{Column, PointCloud, recentering_origin};
pub use curvature::principal_curvatures;
pub use field::{
    DistanceField, Edge, Expansion, Field, Foot, Frame, Nearby, NormalEquations, ParamField, Terms,
    add_normal_equations, normal_equations_of,
};
pub use gram::Gram;
pub use kdtree::KdTree;
pub use mesh::{
    Curve, Mesh, Opposite, TET_EDGES, TET_FACES, TRIANGLE_EDGES, WEDGE_QUADS, WEDGE_TRIANGLES,
};
pub use normals::{Agreement, agreement, estimate_normals, orient_normals, vertex_normals};
pub use pairs::near_pairs;
pub use parts::{Parts, SmoothPart};
pub use patch::{PatchError, RationalPatch, Tangents, bernstein};
pub use plane::Point2;
pub use point::{
    Aabb, Point3, cross, distance_squared, distance_to_segment, dot, inverse_direction, middle,
    norm, on_triangle, orthonormal_complement, sub,
};
pub use quadric::{NormalForm, Quadric, QuadricKind};
pub use rounding::{rounding, rounding_if_decimal};
pub use solid::{Csg, OnePiece, Solid};
pub use spline::{LevelData, PolynomialData, SplineData};
pub use union_find::UnionFind;
