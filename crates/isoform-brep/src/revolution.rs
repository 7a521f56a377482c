//! Smooth pieces that are surfaces of revolution: turned parts and their blends.
//!
//! The motion about an axis that leaves a surface alone is the one along which its normals have no
//! component. It is found by the least eigenvalue of these components (Pottmann and Wallner,
//! Computational Line Geometry, 2001, section 4.1), or is that of a neighbour, and the function
//! itself says whether it is one. The profile is followed in a half-plane about the axis.

use crate::curves::{Wanted, spline};
use crate::locus::{Distance, Locus};
use crate::newton::meet;
use crate::topology::longest_side;
use isoform_geom::brep::{Axes, Revolved, Surface};
use isoform_geom::{Aabb, Point3, cross, dot, sub};
use isoform_num::linalg::symmetric_eigen;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Nodes from which the axis is found and at which it is tried.
const SAMPLES: usize = 200;
/// Turns by which the nodes are moved.
const TURNS: usize = 5;
/// Nodes that are moved about the axis stay as near to the surface as this, in sizes: rounding.
const ROUND: f64 = 1e-11;
/// Steps along the profile for the diagonal of its box.
const STEPS: f64 = 48.0;
/// Steps at most: profiles that wind more are cut into graphs.
const MOST_STEPS: usize = 1000;
/// A step onto the profile this short, in lengths of the steps along it, is the last: the next one
/// would be about its square.
const CLOSE: f64 = 1e-7;
/// Nodes within this of the profile, in steps, have been passed.
const PASSED: f64 = 0.3;
/// Steps for the longest edge of the mesh after which the walk ends where no node was passed.
const EMPTY: f64 = 2.0;
/// Points nearer to the axis than this, in steps, are poles, which are left to other splines.
const POLE: f64 = 1.0;

/// A piece of a smooth surface.
pub(crate) struct Piece<'a> {
    /// Where its function vanishes.
    pub(crate) locus: &'a Locus,
    /// Corners of its triangles.
    pub(crate) triangles: &'a [[Point3; 3]],
    /// Frames about whose z it may be turned; more are found.
    pub(crate) axes: &'a [Axes],
    /// How far the surface may be away.
    pub(crate) tolerance: f64,
    /// The size of the model.
    pub(crate) size: f64,
}

impl Piece<'_> {
    /// The surface of revolution that the piece is, or none.
    pub(crate) fn revolved(&self) -> Option<Surface> {
        let all = self.triangles.as_flattened();
        let every = all.len().div_ceil(SAMPLES).max(1);
        let nodes: Vec<Point3> = all.iter().step_by(every).copied().collect();
        let is_round = |a: &Axes| self.is_round(a, &nodes);
        let known = self.axes.iter().copied().find(is_round);
        let axes = known.or_else(|| self.axis(&nodes).filter(is_round))?;
        let made = Surface::Revolved(Arc::new(self.turned(&axes)?));
        // Nodes on a border may not lie on the surface.
        let is_near = |p: &Point3| made.distance(meet([self.locus], *p)).0.abs() <= self.tolerance;
        all.iter().all(is_near).then_some(made)
    }

    /// The axis of the motion that the surface allows: c × p + d with normals n has the components
    /// c·(p × n) + d·n.
    fn axis(&self, nodes: &[Point3]) -> Option<Axes> {
        let bounds = Aabb::of(nodes);
        let (center, scale) = (bounds.center(), bounds.diagonal());
        let mut matrix = [0.0; 36];
        for p in nodes {
            let n = self.locus.distance(*p).1;
            let arm = sub(*p, center).map(|v| v / scale);
            let m = cross(arm, n);
            let row = [m[0], m[1], m[2], n[0], n[1], n[2]];
            (0..36).for_each(|k| matrix[k] += row[k / 6] * row[k % 6]);
        }
        if matrix.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let (_, vectors) = symmetric_eigen(&matrix, 6);
        let [c, d] = [0, 3].map(|k| [vectors[k], vectors[k + 1], vectors[k + 2]]);
        let square = dot(c, c);
        if square < f64::EPSILON {
            return None;
        }
        let foot = cross(c, d).map(|v| scale * v / square);
        let origin = std::array::from_fn(|k| center[k] + foot[k]);
        Some(Axes::along(origin, c.map(|v| v / square.sqrt())))
    }

    /// Whether nodes stay as far from the surface when they are turned about z: those on a border
    /// may not lie on it.
    fn is_round(&self, axes: &Axes, nodes: &[Point3]) -> bool {
        let off = |p: Point3| self.locus.distance(p).0;
        nodes.iter().all(|p| {
            let ([x, y, z], before) = (axes.local(*p), off(*p));
            (1..=TURNS).all(|k| {
                let (sin, cos) = (k as f64 * TAU / (TURNS + 1) as f64).sin_cos();
                let turned = axes.point([cos * x - sin * y, sin * x + cos * y, z]);
                (off(turned) - before).abs() <= ROUND * self.size
            })
        })
    }

    /// The surface about an axis.
    fn turned(&self, axes: &Axes) -> Option<Revolved> {
        let all = self.triangles.as_flattened().iter();
        let places: Vec<[f64; 2]> = all
            .map(|p| {
                let [x, y, z] = axes.local(*p);
                [x.hypot(y), z]
            })
            .collect();
        let path = Walk::new(self, axes, &places).path()?;
        let in_space = |q: &[f64; 2]| axes.point([q[0], 0.0, q[1]]);
        let points: Vec<Point3> = path.iter().map(in_space).collect();
        let half_plane = Locus::Exact(Surface::Plane(Axes::along(axes.origin, axes.y())));
        let last = points.len() - 1;
        let wanted = Wanted {
            surfaces: [self.locus, &half_plane],
            ends: [points[0], points[last]],
            between: &points[1..last],
            size: self.size,
        };
        let spline = spline(&wanted, &points)?;
        let control = spline.control.iter().map(|p| axes.local(*p));
        Some(Revolved {
            axes: *axes,
            degree: spline.degree,
            knots: spline.flat_knots(),
            control: control.map(|[r, _, z]| [r, z]).collect(),
        })
    }
}

/// The way along the profile of a surface of revolution.
struct Walk<'a> {
    piece: &'a Piece<'a>,
    axes: &'a Axes,
    /// Distances from the axis, and heights, of the nodes of the piece.
    places: &'a [[f64; 2]],
    step: f64,
}

impl<'a> Walk<'a> {
    fn new(piece: &'a Piece<'a>, axes: &'a Axes, places: &'a [[f64; 2]]) -> Self {
        let flat: Vec<Point3> = places.iter().map(|q| [q[0], q[1], 0.0]).collect();
        Self {
            piece,
            axes,
            places,
            step: Aabb::of(&flat).diagonal() / STEPS,
        }
    }

    /// Points of the profile in order, past all nodes and a step beyond; none if it is closed,
    /// reaches the axis, or does not pass all nodes.
    fn path(&self) -> Option<Vec<[f64; 2]>> {
        let (start, tangent) = self.onto(*self.places.first()?)?;
        let mut passed = vec![false; self.places.len()];
        let mut path = self.half(start, tangent.map(|v| -v), &mut passed)?;
        path.reverse();
        path.extend(self.half(start, tangent, &mut passed)?.into_iter().skip(1));
        (path.len() > 2 && passed.into_iter().all(|p| p)).then_some(path)
    }

    /// The way in one direction, with its start.
    fn half(
        &self,
        start: [f64; 2],
        mut tangent: [f64; 2],
        passed: &mut [bool],
    ) -> Option<Vec<[f64; 2]>> {
        let empty =
            1 + (EMPTY * longest_side(self.piece.triangles.iter().copied()) / self.step) as usize;
        let (mut path, mut last_passed) = (vec![start], 0);
        while path.len() - last_passed <= empty + 1 {
            let from = path[path.len() - 1];
            let ahead = std::array::from_fn(|k| from[k] + self.step * tangent[k]);
            let Some((to, new)) = self.onto(ahead) else {
                break;
            };
            let side = if new[0] * tangent[0] + new[1] * tangent[1] < 0.0 {
                -1.0
            } else {
                1.0
            };
            tangent = new.map(|v| side * v);
            let is_closed = path.len() > 2 && apart(to, start) < self.step;
            if is_closed || path.len() > MOST_STEPS {
                return None;
            }
            path.push(to);
            for (place, passed) in self.places.iter().zip(passed.iter_mut()) {
                if !*passed && to_segment(*place, [from, to]) <= PASSED * self.step {
                    *passed = true;
                    last_passed = path.len() - 1;
                }
            }
        }
        // One step beyond the last node: what is trimmed lies inside of the surface.
        path.truncate(last_passed + 2);
        Some(path)
    }

    /// A point of the profile near a place, and its tangent.
    fn onto(&self, near: [f64; 2]) -> Option<([f64; 2], [f64; 2])> {
        let mut q = near;
        for _ in 0..32 {
            if q[0] < POLE * self.step {
                return None;
            }
            let (d, n) = self
                .piece
                .locus
                .distance(self.axes.point([q[0], 0.0, q[1]]));
            let n = [dot(n, self.axes.x), dot(n, self.axes.z)];
            let length = n[0].hypot(n[1]);
            let way = d / length;
            q = std::array::from_fn(|k| q[k] - way * n[k] / length);
            if !way.is_finite() || apart(q, near) > self.step {
                return None;
            }
            if way.abs() <= CLOSE * self.step {
                return Some((q, [-n[1] / length, n[0] / length]));
            }
        }
        None
    }
}

fn apart(p: [f64; 2], q: [f64; 2]) -> f64 {
    (p[0] - q[0]).hypot(p[1] - q[1])
}

/// The distance of a place from a segment.
fn to_segment(p: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let d = [b[0] - a[0], b[1] - a[1]];
    let along = (p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1];
    let s = (along / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
    apart(p, [a[0] + s * d[0], a[1] + s * d[1]])
}
