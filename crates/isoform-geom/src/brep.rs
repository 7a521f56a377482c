//! Boundary representations: solids as faces on exact surfaces, trimmed by shared edges.
//!
//! A face has loops of directed edges ([`Coedge`]); edges have curves in space only, none in the
//! parameter plane. An edge of a closed shell is in two loops, once in each direction.

mod curve;
mod defect;
mod ellipsoid;
mod graph;
mod placed;
mod revolved;
mod surface;

pub use defect::Defect;
pub use ellipsoid::Ellipsoid;
pub use graph::{Basis, Graph, Height};
pub use revolved::Revolved;

use crate::quadric::{NormalForm, QuadricKind};
use crate::{Point3, Quadric, cross, dot, orthonormal_complement, sub};
use std::sync::Arc;

/// Right-handed orthonormal frame: an origin and the unit vectors z and x; y = z × x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// Origin.
    pub origin: Point3,
    /// Direction of z, of length 1.
    pub z: Point3,
    /// Direction of x, of length 1.
    pub x: Point3,
}

impl Axes {
    /// Returns a frame with the given z direction and an arbitrary x direction.
    pub fn along(origin: Point3, z: Point3) -> Self {
        let [x, _] = orthonormal_complement(z);
        Self { origin, z, x }
    }
    /// Returns the frame rotated about z so that x points as nearly along `x` as possible;
    /// unchanged if `x` is parallel to z.
    #[must_use]
    pub fn turned(self, x: Point3) -> Self {
        let mut flat = x;
        // Programs that read the files require right angles up to rounding: the second pass removes
        // the component along z that rounding leaves in the first.
        for _ in 0..2 {
            let along = dot(flat, self.z);
            flat = std::array::from_fn(|k| flat[k] - along * self.z[k]);
            let length = dot(flat, flat).sqrt();
            if length <= 1e-12 {
                return self;
            }
            flat = flat.map(|v| v / length);
        }
        Self { x: flat, ..self }
    }
    /// Returns the direction of y.
    pub fn y(&self) -> Point3 {
        cross(self.z, self.x)
    }
    /// Returns the coordinates of a point in the frame.
    pub fn local(&self, p: Point3) -> Point3 {
        let d = sub(p, self.origin);
        [dot(d, self.x), dot(d, self.y()), dot(d, self.z)]
    }
    /// Returns the coordinates of a vector in the frame.
    pub fn vector_local(&self, d: Point3) -> Point3 {
        [dot(d, self.x), dot(d, self.y()), dot(d, self.z)]
    }
    /// Returns the vector of space with the given coordinates in the frame.
    pub fn vector(&self, [a, b, c]: Point3) -> Point3 {
        let y = self.y();
        std::array::from_fn(|k| a * self.x[k] + b * y[k] + c * self.z[k])
    }
    /// Returns the point of space with the given coordinates in the frame.
    pub fn point(&self, local: Point3) -> Point3 {
        let d = self.vector(local);
        std::array::from_fn(|k| self.origin[k] + d[k])
    }
}

/// Surface of a face: exact, except for the last two kinds, which are B-splines near the surface
/// that is meant. Its normal points along z for a plane and a graph, away from the axis where the
/// profile of a surface of revolution rises, and otherwise away from the centre, the axis or the
/// centre circle of the tube.
#[derive(Clone, Debug, PartialEq)]
pub enum Surface {
    /// Plane z = 0 of the frame.
    Plane(Axes),
    /// Points at the distance `radius` from the z axis.
    Cylinder(Axes, f64),
    /// Points at the distance radius + z tan(half angle) from the z axis: the radius at the origin,
    /// in model units, and the half angle, in radians.
    Cone(Axes, f64, f64),
    /// Points at the distance `radius` from the origin.
    Sphere(Axes, f64),
    /// Points at the distance `minor` (the second number) from the circle about z of radius `major`
    /// (the first).
    Torus(Axes, f64, f64),
    /// Ellipsoid with three half axes.
    Ellipsoid(Ellipsoid),
    /// B-spline profile revolved about an axis: an approximation of a smooth surface of revolution
    /// for which CAD systems have no name.
    Revolved(Arc<Revolved>),
    /// B-spline approximation of a smooth surface for which CAD systems have no name.
    Graph(Arc<Graph>),
}

impl Surface {
    /// Returns the surface of a plane, sphere, cylinder, cone, torus or ellipsoid, whose frame has
    /// an arbitrary rotation about z; `None` for other quadrics.
    pub fn from_quadric(quadric: &Quadric) -> Option<Self> {
        Some(match *quadric {
            Quadric::Plane { normal, offset } => {
                Self::Plane(Axes::along(normal.map(|v| v * offset), normal))
            }
            Quadric::Sphere { center, radius } => {
                Self::Sphere(Axes::along(center, [0.0, 0.0, 1.0]), radius)
            }
            Quadric::Cylinder {
                point,
                axis,
                radius,
            } => Self::Cylinder(Axes::along(point, axis), radius),
            Quadric::Cone {
                apex,
                axis,
                half_angle,
            } => Self::Cone(Axes::along(apex, axis), 0.0, half_angle),
            Quadric::Torus {
                center,
                axis,
                major,
                minor,
            } => Self::Torus(Axes::along(center, axis), major, minor),
            Quadric::Other {
                form:
                    Some(NormalForm {
                        kind: QuadricKind::Ellipsoid,
                        center,
                        axes: [x, y, z],
                        measures,
                    }),
                ..
            } => {
                let is_right = dot(cross(x, y), z) > 0.0;
                let z = if is_right { z } else { z.map(|v| -v) };
                let axes = Axes {
                    origin: center,
                    z,
                    x,
                };
                Self::Ellipsoid(Ellipsoid::new(axes, measures))
            }
            Quadric::Other { .. } => return None,
        })
    }
    /// Returns the frame of the surface.
    pub fn axes(&self) -> &Axes {
        match self {
            Self::Plane(axes)
            | Self::Cylinder(axes, _)
            | Self::Cone(axes, ..)
            | Self::Sphere(axes, _)
            | Self::Torus(axes, ..) => axes,
            Self::Ellipsoid(ball) => &ball.axes,
            Self::Revolved(turned) => &turned.axes,
            Self::Graph(graph) => &graph.axes,
        }
    }
    /// Returns the name of the kind, such as `plane`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Plane(_) => "plane",
            Self::Cylinder(..) => "cylinder",
            Self::Cone(..) => "cone",
            Self::Sphere(..) => "sphere",
            Self::Torus(..) => "torus",
            Self::Ellipsoid(_) => "ellipsoid",
            Self::Revolved(_) => "revolved",
            Self::Graph(_) => "spline",
        }
    }
    /// Returns true if the surface is a B-spline approximation of the surface that is meant.
    pub fn is_near_only(&self) -> bool {
        matches!(self, Self::Revolved(_) | Self::Graph(_))
    }
}

/// Curve of an edge, which runs from the first vertex of the edge to the last.
#[derive(Clone, Debug, PartialEq)]
pub enum Curve {
    /// Segment between the vertices.
    Line,
    /// Circle, counterclockwise about z, with its radius in model units.
    Circle(Axes, f64),
    /// Ellipse, counterclockwise about z, with its half axes in model units; the first one, along
    /// x, is the larger.
    Ellipse(Axes, f64, f64),
    /// Polynomial (not rational) B-spline.
    BSpline(BSpline),
}

impl Curve {
    /// Returns the name of the kind, such as `circle`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Line => "line",
            Self::Circle(..) => "circle",
            Self::Ellipse(..) => "ellipse",
            Self::BSpline(_) => "spline",
        }
    }
}

/// B-spline curve with clamped ends.
#[derive(Clone, Debug, PartialEq)]
pub struct BSpline {
    /// Degree.
    pub degree: usize,
    /// Distinct knots, ascending.
    pub knots: Vec<f64>,
    /// Multiplicity of each knot: degree + 1 at the ends.
    pub multiplicities: Vec<usize>,
    /// Control points.
    pub control: Vec<Point3>,
}

/// Edge: a curve between two vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// Curve of the edge.
    pub curve: Curve,
    /// First and last vertex, which coincide for a closed curve.
    pub ends: [u32; 2],
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
    pub surface: Surface,
    /// True if the normal of the surface points out of the solid.
    pub agrees: bool,
    /// Part of the model that the face belongs to, an index into [`Brep::parts`].
    pub part: u32,
    /// Number of this piece of the part, from 0: a part may consist of several pieces, and one that
    /// closes about an axis is cut.
    pub chart: u32,
    /// Boundary loops, the outer one first; seen from outside, each has the face on its left.
    pub loops: Vec<Vec<Coedge>>,
}

/// Solid body: an outer shell, and shells around voids.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Body {
    /// Indices of the faces of the outer shell.
    pub outer: Vec<u32>,
    /// Indices of the faces around each void.
    pub voids: Vec<Vec<u32>>,
}

/// Boundary representation: solids, with the faces, edges and vertices that they share.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Brep {
    /// Positions of the vertices.
    pub vertices: Vec<Point3>,
    /// Edges.
    pub edges: Vec<Edge>,
    /// Faces.
    pub faces: Vec<Face>,
    /// Names of the parts.
    pub parts: Vec<String>,
    /// Solids, by the indices of their faces.
    pub solids: Vec<Body>,
}

impl Brep {
    /// Returns the name of a face: that of its part, with the number of the chart (from 1) if the
    /// part has several.
    pub fn face_name(&self, face: usize) -> String {
        let Face { part, chart, .. } = self.faces[face];
        let name = &self.parts[part as usize];
        let charts = self.faces.iter().filter(|f| f.part == part).count();
        if charts == 1 {
            name.clone()
        } else {
            format!("{name}#chart{}", u64::from(chart) + 1)
        }
    }
    /// Returns the start and end vertex of a directed edge.
    pub fn ends_of(&self, coedge: &Coedge) -> [u32; 2] {
        let [a, b] = self.edges[coedge.edge as usize].ends;
        if coedge.forward { [a, b] } else { [b, a] }
    }
    /// Returns the first and last point of an edge.
    pub fn ends(&self, edge: u32) -> [Point3; 2] {
        self.edges[edge as usize]
            .ends
            .map(|v| self.vertices[v as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a cylinder of radius 1 and height 2: bottom, top, and a wall with one seam, edge 2.
    pub(super) fn can() -> Brep {
        let up = [0.0, 0.0, 1.0];
        let x = [1.0, 0.0, 0.0];
        let axes = |height: f64, z: Point3| Axes {
            origin: [0.0, 0.0, height],
            z,
            x,
        };
        let edge = |curve, ends| Edge { curve, ends };
        let coedges = |list: &[(u32, bool)]| {
            let list = list.iter();
            list.map(|&(edge, forward)| Coedge { edge, forward })
                .collect()
        };
        let face = |surface, agrees, part, around: &[(u32, bool)]| Face {
            surface,
            agrees,
            part,
            chart: 0,
            loops: vec![coedges(around)],
        };
        Brep {
            vertices: vec![x, [1.0, 0.0, 2.0]],
            edges: vec![
                edge(Curve::Circle(axes(0.0, up), 1.0), [0, 0]),
                edge(Curve::Circle(axes(2.0, up), 1.0), [1, 1]),
                edge(Curve::Line, [0, 1]),
            ],
            faces: vec![
                face(Surface::Plane(axes(0.0, up)), false, 0, &[(0, false)]),
                face(Surface::Plane(axes(2.0, up)), true, 1, &[(1, true)]),
                face(
                    Surface::Cylinder(axes(0.0, up), 1.0),
                    true,
                    2,
                    &[(0, true), (2, true), (1, false), (2, false)],
                ),
            ],
            parts: ["bottom", "top", "wall"].map(str::to_owned).to_vec(),
            solids: vec![Body {
                outer: vec![0, 1, 2],
                voids: Vec::new(),
            }],
        }
    }

    #[test]
    fn charts_are_numbered_from_one() {
        let mut can = can();
        can.faces[0].part = 2;
        can.faces[2].chart = u32::MAX; // the largest that a file can give
        let names: Vec<String> = (0..3).map(|f| can.face_name(f)).collect();
        assert_eq!(names, ["wall#chart1", "top", "wall#chart4294967296"]);
    }

    #[test]
    fn frames_go_there_and_back() {
        let axes = Axes::along([1.0, 2.0, 3.0], [0.6, 0.0, 0.8]).turned([1.0, 1.0, 0.0]);
        let p = [0.3, -0.2, 5.0];
        let back = axes.point(axes.local(p));
        assert!((0..3).all(|k| (back[k] - p[k]).abs() < 1e-14));
        assert!(dot(axes.x, axes.z).abs() < 1e-16 && dot(axes.x, [1.0, 1.0, 0.0]) > 0.0);
    }
}
