//! Shapes of CAD files: faces on surfaces in parameter form, trimmed by loops of edges.
//!
//! In contrast to [`brep`](crate::brep), surfaces and curves may be rational splines, swept or
//! extended, faces may wrap around, and shells may be open. Curves of edges are in space; those in
//! the parameter plane are computed from them.

mod curve;
mod nurbs;
mod placement;
mod surface;

pub use curve::CadCurve;
pub use nurbs::{MAX_DEGREE, NurbsCurve, NurbsError, NurbsSurface};
pub use placement::Placement;
pub use surface::{CadSurface, SurfaceJet};

use crate::Point3;

/// Edge: a piece of a curve between two vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// Curve that holds the edge.
    pub curve: CadCurve,
    /// Parameters on the curve of the first and the last vertex; descending if the edge runs
    /// against the curve.
    pub range: [f64; 2],
    /// First and last vertex, which coincide for a closed edge.
    pub ends: [u32; 2],
}

impl Edge {
    /// Returns the parameter on the curve at a share of the edge, from 0 to 1.
    pub fn parameter(&self, share: f64) -> f64 {
        self.range[0] + share * (self.range[1] - self.range[0])
    }
    /// Returns the point at a share of the edge, with the first and second derivatives by the
    /// share.
    pub fn at(&self, share: f64) -> [Point3; 3] {
        let length = self.range[1] - self.range[0];
        let [p, d, dd] = self.curve.at(self.parameter(share));
        [p, d.map(|v| v * length), dd.map(|v| v * length * length)]
    }
}

/// Directed edge of a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coedge {
    /// Index of the edge.
    pub edge: u32,
    /// True if the loop runs from the first vertex of the edge to the last.
    pub forward: bool,
}

/// Face: the part of a surface bounded by loops.
#[derive(Clone, Debug, PartialEq)]
pub struct Face {
    /// Surface on which the face lies.
    pub surface: CadSurface,
    /// True if the normal of the face is ∂p/∂u × ∂p/∂v of the surface, false if it is opposite.
    pub agrees: bool,
    /// Boundary loops; seen from the side of the normal, each has the face on its left. Without
    /// loops the face is the whole surface.
    pub loops: Vec<Vec<Coedge>>,
    /// Name of the face for messages: its entity number and kind.
    pub name: String,
}

/// Connected faces of a solid, or a surface that is none's boundary.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shell {
    /// Indices of the faces.
    pub faces: Vec<u32>,
    /// Index of the solid that the shell bounds, `None` for a surface without an inside.
    pub solid: Option<u32>,
    /// True if the shell bounds a void of its solid.
    pub is_void: bool,
}

/// Shape of a CAD file, with all parts of an assembly in their places.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// Positions of the vertices.
    pub vertices: Vec<Point3>,
    /// Edges.
    pub edges: Vec<Edge>,
    /// Faces.
    pub faces: Vec<Face>,
    /// Shells.
    pub shells: Vec<Shell>,
    /// Names of the solids.
    pub solids: Vec<String>,
}

impl Shape {
    /// Returns the index of the solid that each face bounds, `None` for surfaces without an inside.
    pub fn solids_of_faces(&self) -> Vec<Option<u32>> {
        let mut solids = vec![None; self.faces.len()];
        for shell in &self.shells {
            for face in &shell.faces {
                solids[*face as usize] = shell.solid;
            }
        }
        solids
    }
}
