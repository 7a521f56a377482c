//! Rigid motions of solids.

use super::{Axes, BSpline, Brep, Curve, Edge, Ellipsoid, Face, Graph, Revolved, Surface};
use crate::Frame;

impl Frame {
    /// Returns axes that are given in coordinates of the frame as axes in space.
    fn axes_out(&self, axes: Axes) -> Axes {
        Axes {
            origin: self.out(axes.origin),
            z: self.turned(axes.z),
            x: self.turned(axes.x),
        }
    }
}

impl Brep {
    /// Returns the solids in space, where these are given in coordinates of the frame. Faces share
    /// edges and vertices as before.
    ///
    /// ```
    /// use isoform_geom::{Frame, brep::Brep};
    /// let solids = Brep { vertices: vec![[1.0, 2.0, 3.0]], ..Brep::default() };
    /// let frame = Frame { translation: [10.0, 0.0, 0.0], ..Frame::SPACE };
    /// assert_eq!(solids.placed(&frame).vertices, [[11.0, 2.0, 3.0]]);
    /// ```
    #[must_use]
    pub fn placed(&self, frame: &Frame) -> Self {
        let edge = |e: &Edge| Edge {
            curve: e.curve.placed(frame),
            ..e.clone()
        };
        let face = |f: &Face| Face {
            surface: f.surface.placed(frame),
            ..f.clone()
        };
        Self {
            vertices: self.vertices.iter().map(|p| frame.out(*p)).collect(),
            edges: self.edges.iter().map(edge).collect(),
            faces: self.faces.iter().map(face).collect(),
            ..self.clone()
        }
    }
}

impl Curve {
    fn placed(&self, frame: &Frame) -> Self {
        let out = |axes: &Axes| frame.axes_out(*axes);
        match self {
            Self::Line => Self::Line,
            Self::Circle(axes, radius) => Self::Circle(out(axes), *radius),
            Self::Ellipse(axes, a, b) => Self::Ellipse(out(axes), *a, *b),
            Self::BSpline(spline) => Self::BSpline(BSpline {
                control: spline.control.iter().map(|p| frame.out(*p)).collect(),
                ..spline.clone()
            }),
        }
    }
}

impl Surface {
    fn placed(&self, frame: &Frame) -> Self {
        let axes = frame.axes_out(*self.axes());
        match self {
            Self::Plane(_) => Self::Plane(axes),
            Self::Cylinder(_, radius) => Self::Cylinder(axes, *radius),
            Self::Cone(_, radius, angle) => Self::Cone(axes, *radius, *angle),
            Self::Sphere(_, radius) => Self::Sphere(axes, *radius),
            Self::Torus(_, major, minor) => Self::Torus(axes, *major, *minor),
            Self::Ellipsoid(ball) => Self::Ellipsoid(Ellipsoid { axes, ..*ball }),
            Self::Revolved(turned) => Self::Revolved(std::sync::Arc::new(Revolved {
                axes,
                ..turned.as_ref().clone()
            })),
            Self::Graph(graph) => Self::Graph(std::sync::Arc::new(Graph {
                axes,
                ..graph.as_ref().clone()
            })),
        }
    }
}
