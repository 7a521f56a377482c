//! Boundary representations: solids as faces on exact surfaces, trimmed by shared edges.
//!
//! There are no parameter curves and no half-edges: a face has loops of directed edges, and an edge
//! of a closed shell is in two loops, once in each direction.

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
use crate::{Point3, Quadric, across, cross, dot, sub};
use std::sync::Arc;

/// A right-handed frame: an origin and the unit vectors z and x, at right angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// The origin.
    pub origin: Point3,
    /// The direction of z.
    pub z: Point3,
    /// The direction of x.
    pub x: Point3,
}

impl Axes {
    /// A frame with the given z and some x.
    pub fn along(origin: Point3, z: Point3) -> Self {
        let [x, _] = across(z);
        Self { origin, z, x }
    }
    /// The same frame turned about z so that x points as nearly along `x` as it can; unchanged
    /// where `x` is along z.
    #[must_use]
    pub fn turned(self, x: Point3) -> Self {
        let mut flat = x;
        // Exactly at right angles matters to readers: twice, as the first difference leaves some.
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
    /// The direction of y.
    pub fn y(&self) -> Point3 {
        cross(self.z, self.x)
    }
    /// A point of space in coordinates of the frame.
    pub fn local(&self, p: Point3) -> Point3 {
        let d = sub(p, self.origin);
        [dot(d, self.x), dot(d, self.y()), dot(d, self.z)]
    }
    /// The vector with the given coordinates in the frame.
    pub fn vector(&self, [a, b, c]: Point3) -> Point3 {
        let y = self.y();
        std::array::from_fn(|k| a * self.x[k] + b * y[k] + c * self.z[k])
    }
    /// The point with the given coordinates in the frame.
    pub fn point(&self, local: Point3) -> Point3 {
        let d = self.vector(local);
        std::array::from_fn(|k| self.origin[k] + d[k])
    }
}

/// The surface of a face: exact, but for the last two kinds. Its own normal points along z for a
/// plane and a graph, away from the axis where the profile of a revolved one rises, and else away
/// from the centre, the axis or the middle of the tube.
#[derive(Clone, Debug, PartialEq)]
pub enum Surface {
    /// z = 0.
    Plane(Axes),
    /// All points at a distance (`radius`) from z.
    Cylinder(Axes, f64),
    /// All points at the distance radius + z tan(half angle) from z: the radius at the origin, in
    /// model units, and the half angle, in radians.
    Cone(Axes, f64, f64),
    /// All points at a distance (`radius`) from the origin.
    Sphere(Axes, f64),
    /// All points at the distance `minor` (the second number) from the circle of the radius `major`
    /// (the first) about z.
    Torus(Axes, f64, f64),
    /// An ellipsoid.
    Ellipsoid(Ellipsoid),
    /// A B-spline turned about an axis, near a smooth surface of revolution that has no name.
    Revolved(Arc<Revolved>),
    /// A B-spline near a smooth surface that has no name.
    Graph(Arc<Graph>),
}

impl Surface {
    /// A named quadric, ellipsoid or torus, its frame turned somehow; none of the others.
    pub fn of(quadric: &Quadric) -> Option<Self> {
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
    /// Its frame.
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
    /// Its name.
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
    /// Whether it is a spline near the surface that is meant, which it is not itself.
    pub fn is_near_only(&self) -> bool {
        matches!(self, Self::Revolved(_) | Self::Graph(_))
    }
}

/// The curve of an edge; it runs from the edge's first vertex to its last.
#[derive(Clone, Debug, PartialEq)]
pub enum Curve {
    /// A segment.
    Line,
    /// A circle, counterclockwise about z.
    Circle(Axes, f64),
    /// An ellipse with the larger half axis (first) along x, counterclockwise about z.
    Ellipse(Axes, f64, f64),
    /// A B-spline without weights.
    BSpline(BSpline),
}

impl Curve {
    /// Its name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Line => "line",
            Self::Circle(..) => "circle",
            Self::Ellipse(..) => "ellipse",
            Self::BSpline(_) => "spline",
        }
    }
}

/// A B-spline curve with clamped ends.
#[derive(Clone, Debug, PartialEq)]
pub struct BSpline {
    /// The degree.
    pub degree: usize,
    /// Knots, ascending, each once.
    pub knots: Vec<f64>,
    /// How often each knot counts: degree + 1 at the ends.
    pub multiplicities: Vec<usize>,
    /// Control points.
    pub control: Vec<Point3>,
}

/// A curve between two vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// The curve.
    pub curve: Curve,
    /// First and last vertex; the same one for a closed curve.
    pub ends: [u32; 2],
}

/// An edge as a loop passes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coedge {
    /// The edge.
    pub edge: u32,
    /// Whether it is passed from its first vertex to its last.
    pub forward: bool,
}

/// A part of a surface within loops.
#[derive(Clone, Debug, PartialEq)]
pub struct Face {
    /// The surface.
    pub surface: Surface,
    /// Whether the surface's own normal points out of the solid.
    pub agrees: bool,
    /// The part of the model, index into the names of [`Brep::parts`].
    pub part: u32,
    /// The number of this piece of the part, from 0: a part may come in several, and those that go
    /// round are cut.
    pub chart: u32,
    /// Loops, seen from outside counterclockwise around the face; the outer one is first.
    pub loops: Vec<Vec<Coedge>>,
}

/// A body.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Body {
    /// The faces of its outer shell.
    pub outer: Vec<u32>,
    /// The faces of each void inside of it.
    pub voids: Vec<Vec<u32>>,
}

/// Solids as faces, edges and vertices that they share.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Brep {
    /// Vertices.
    pub vertices: Vec<Point3>,
    /// Edges.
    pub edges: Vec<Edge>,
    /// Faces.
    pub faces: Vec<Face>,
    /// Names of the parts.
    pub parts: Vec<String>,
    /// The solids.
    pub solids: Vec<Body>,
}

impl Brep {
    /// The name of a face: that of its part, with the number of the chart (from 1) if the part has
    /// several.
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
    /// The vertices between which a loop passes an edge.
    pub fn ends_of(&self, coedge: &Coedge) -> [u32; 2] {
        let [a, b] = self.edges[coedge.edge as usize].ends;
        if coedge.forward { [a, b] } else { [b, a] }
    }
    /// First and last point of an edge.
    pub fn ends(&self, edge: u32) -> [Point3; 2] {
        self.edges[edge as usize]
            .ends
            .map(|v| self.vertices[v as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cylinder of radius 1 and height 2: bottom, top, and a wall with one seam, edge 2.
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
