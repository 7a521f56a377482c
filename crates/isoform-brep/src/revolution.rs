//! Smooth pieces that are surfaces of revolution: turned parts and their blends.
//!
//! The rotation that leaves a surface invariant is the motion along which its normals have no
//! component. It is found from the least eigenvalue of the matrix of these components (Pottmann and
//! Wallner, Computational Line Geometry, 2001, section 4.1), or taken from a neighbour, and tested
//! on the function itself. The profile is followed in a half-plane about the axis.

use crate::curves::{Bezier, CurveRequest, joined, pieces};
use crate::locus::{Distance, Locus};
use crate::newton::{POINT_TOLERANCE, gap, meet};
use crate::topology::longest_side;
use isoform_geom::brep::{Axes, Revolved, Surface};
use isoform_geom::{Aabb, Point3, cross, dot, sub};
use isoform_num::linalg::symmetric_eigen;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Number of rotations by which the nodes are tested.
const TEST_ROTATIONS: usize = 5;
/// Maximum distance of a node from the profile that counts as passing it, in steps.
const MAX_PASSING_DISTANCE: f64 = 0.3;
/// Maximum distance to the axis, in steps, from the last point that is followed: profiles that meet
/// it at more than six degrees reach it.
const MAX_STEPS_TO_AXIS: f64 = 10.0;
/// Minimum sine between the normal and the axis direction, or its normal, at a tip. Below it the
/// profile reaches the axis at a right angle, a smooth pole without a tip, or along it, a cusp.
const MIN_TIP_SINE: f64 = 0.02;

/// A piece of a smooth surface.
pub(crate) struct ProfileInput<'a> {
    /// Zero set of its function.
    pub(crate) locus: &'a Locus,
    /// Corners of its triangles.
    pub(crate) triangles: &'a [[Point3; 3]],
    /// Frames about whose z it may be a surface of revolution; another axis is computed.
    pub(crate) axes: &'a [Axes],
    /// Maximum distance of the result, in model units.
    pub(crate) tolerance: f64,
    /// Size of the model.
    pub(crate) size: f64,
}

impl ProfileInput<'_> {
    /// Returns the surface of revolution that the piece is; `None` if it is not one.
    pub(crate) fn revolved(&self) -> Option<Surface> {
        let all = self.triangles.as_flattened();
        // About 200 nodes determine and test the axis.
        let every = all.len().div_ceil(200).max(1);
        let nodes = all.iter().step_by(every).copied();
        // The normal does not exist at a tip.
        let has_normal = |p: &Point3| self.locus.distance(*p).1.iter().all(|v| v.is_finite());
        let nodes: Vec<Point3> = nodes.filter(has_normal).collect();
        let is_round = |a: &Axes| self.is_round(a, &nodes);
        let known = self.axes.iter().copied().find(is_round);
        let axes = known.or_else(|| self.axis(&nodes).filter(is_round))?;
        let made = Surface::Revolved(Arc::new(self.turned(&axes)?));
        // Nodes on a border may be off the surface.
        let is_near = |p: &Point3| made.distance(meet([self.locus], *p)).0.abs() <= self.tolerance;
        all.iter().all(is_near).then_some(made)
    }

    /// Returns the axis of the motion that leaves the surface invariant: c × p + d with normals n
    /// has the components c·(p × n) + d·n.
    fn axis(&self, nodes: &[Point3]) -> Option<Axes> {
        let bounds = Aabb::from_points(nodes);
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

    /// Returns true if the distance of nodes from the surface does not change when they are rotated
    /// about z. It need not be zero: nodes on a border may be off the surface.
    fn is_round(&self, axes: &Axes, nodes: &[Point3]) -> bool {
        let off = |p: Point3| self.locus.distance(p).0;
        nodes.iter().all(|p| {
            let ([x, y, z], before) = (axes.local(*p), off(*p));
            (1..=TEST_ROTATIONS).all(|k| {
                let (sin, cos) = (k as f64 * TAU / (TEST_ROTATIONS + 1) as f64).sin_cos();
                let turned = axes.point([cos * x - sin * y, sin * x + cos * y, z]);
                // Rounding only.
                (off(turned) - before).abs() <= 1e-11 * self.size
            })
        })
    }

    /// Returns the surface about an axis.
    fn turned(&self, axes: &Axes) -> Option<Revolved> {
        let all = self.triangles.as_flattened().iter();
        let places: Vec<[f64; 2]> = all
            .map(|p| {
                let [x, y, z] = axes.local(*p);
                [x.hypot(y), z]
            })
            .collect();
        let ProfilePath { points, ends } = ProfileWalk::new(self, axes, &places).path()?;
        let in_space = |q: &[f64; 2]| axes.point([q[0], 0.0, q[1]]);
        let points: Vec<Point3> = points.iter().map(in_space).collect();
        let half_plane = Locus::Exact(Surface::Plane(Axes::along(axes.origin, axes.y())));
        let last = points.len() - 1;
        let wanted = CurveRequest {
            surfaces: [self.locus, &half_plane],
            ends: [points[0], points[last]],
            between: &points[1..last],
            size: self.size,
        };
        let mut pieces = pieces(&wanted, &points)?;
        let last = pieces.len() - 1;
        if ends[0].is_on_axis() {
            pieces[0] = to_axis(&pieces[0].reversed(), axes)?.reversed();
        }
        if ends[1].is_on_axis() {
            pieces[last] = to_axis(&pieces[last], axes)?;
        }
        let spline = joined(&pieces);
        let control = spline.control.iter().map(|p| axes.local(*p));
        let mut control: Vec<[f64; 2]> = control.map(|[r, _, z]| [r, z]).collect();
        let last = control.len() - 1;
        for (end, i) in ends.into_iter().zip([0, last]) {
            if end.is_on_axis() {
                control[i][0] = 0.0;
            }
        }
        Some(Revolved {
            axes: *axes,
            degree: spline.degree,
            knots: spline.flat_knots(),
            control,
        })
    }
}

/// Extends a piece of a profile that ends near the axis up to the axis.
fn to_axis(piece: &Bezier, axes: &Axes) -> Option<Bezier> {
    let mut s = 1.0;
    for _ in 0..8 {
        let (p, velocity) = piece.at(s);
        s -= axes.local(p)[0] / dot(velocity, axes.x);
    }
    // The extension is as short as the distance from the axis at which the piece ends.
    ((s - 1.0).abs() < 0.5).then(|| piece.up_to(s))
}

/// End of a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ProfileEnd {
    /// The profile continues beyond the piece.
    Beyond,
    /// The profile reaches the axis at an angle, and is followed up to a point near it.
    Tip,
    /// The profile reaches the axis at a right angle.
    Pole,
}

impl ProfileEnd {
    fn is_on_axis(self) -> bool {
        self != Self::Beyond
    }
}

/// Points of a profile in order, and the kinds of its first and its last end.
struct ProfilePath {
    points: Vec<[f64; 2]>,
    ends: [ProfileEnd; 2],
}

/// State of following the profile of a surface of revolution.
struct ProfileWalk<'a> {
    piece: &'a ProfileInput<'a>,
    axes: &'a Axes,
    /// Distances from the axis, and heights, of the nodes of the piece.
    places: &'a [[f64; 2]],
    step: f64,
}

impl<'a> ProfileWalk<'a> {
    fn new(piece: &'a ProfileInput<'a>, axes: &'a Axes, places: &'a [[f64; 2]]) -> Self {
        let flat: Vec<Point3> = places.iter().map(|q| [q[0], q[1], 0.0]).collect();
        Self {
            piece,
            axes,
            places,
            step: Aabb::from_points(&flat).diagonal() / 48.0,
        }
    }

    /// Returns the profile past all nodes, and a step beyond or up to the axis; `None` if it is
    /// closed, has smooth poles and no tip, or does not pass all nodes.
    fn path(&self) -> Option<ProfilePath> {
        let is_off = |q: &&[f64; 2]| q[0] > self.step;
        let (start, tangent) = self.onto(*self.places.iter().find(is_off)?)?;
        let mut passed = vec![false; self.places.len()];
        let (mut points, first) = self.half(start, tangent.map(|v| -v), &mut passed)?;
        points.reverse();
        let (behind, last) = self.half(start, tangent, &mut passed)?;
        points.extend(behind.into_iter().skip(1));
        let ends = [first, last];
        if ends.contains(&ProfileEnd::Pole) && !ends.contains(&ProfileEnd::Tip) {
            return None;
        }
        (points.len() > 2 && passed.into_iter().all(|p| p)).then_some(ProfilePath { points, ends })
    }

    /// Returns the profile in one direction, with its start.
    fn half(
        &self,
        start: [f64; 2],
        mut tangent: [f64; 2],
        passed: &mut [bool],
    ) -> Option<(Vec<[f64; 2]>, ProfileEnd)> {
        // The search ends two edges of the mesh after the last node that was passed.
        let empty =
            1 + (2.0 * longest_side(self.piece.triangles.iter().copied()) / self.step) as usize;
        let (mut path, mut last_passed) = (vec![start], 0);
        while path.len() - last_passed <= empty + 1 {
            let from = path[path.len() - 1];
            let ahead = std::array::from_fn(|k| from[k] + self.step * tangent[k]);
            let Some((to, new)) = self.onto(ahead) else {
                if let Some((last, tip, end)) = self.tip(from, tangent) {
                    let near = |q: &[f64; 2]| {
                        to_segment(*q, [from, tip]) <= MAX_PASSING_DISTANCE * self.step
                    };
                    let pass = self.places.iter().zip(passed.iter_mut());
                    pass.for_each(|(q, passed)| *passed |= near(q));
                    path.push(last);
                    return Some((path, end));
                }
                break;
            };
            let side = if new[0] * tangent[0] + new[1] * tangent[1] < 0.0 {
                -1.0
            } else {
                1.0
            };
            tangent = new.map(|v| side * v);
            let is_closed = path.len() > 2 && apart(to, start) < self.step;
            // Profiles that wind more are cut into graphs.
            if is_closed || path.len() > 1000 {
                return None;
            }
            path.push(to);
            for (place, passed) in self.places.iter().zip(passed.iter_mut()) {
                if !*passed && to_segment(*place, [from, to]) <= MAX_PASSING_DISTANCE * self.step {
                    *passed = true;
                    last_passed = path.len() - 1;
                }
            }
        }
        // One step beyond the last node: trimmed edges lie inside the surface.
        path.truncate(last_passed + 2);
        Some((path, ProfileEnd::Beyond))
    }

    /// Returns the point of the profile near the axis, the point on it, and the kind of end, in the
    /// direction of a tangent; `None` if the axis is not reached, or no node is near.
    fn tip(&self, from: [f64; 2], tangent: [f64; 2]) -> Option<([f64; 2], [f64; 2], ProfileEnd)> {
        // Nearer to the axis than a millionth of the size the profile is continued by its
        // polynomial, with an error of the third power of this distance.
        let out = 1e-6 * self.piece.size;
        let steps = (out - from[0]) / tangent[0];
        if !(0.0 < steps && steps <= MAX_STEPS_TO_AXIS * self.step) {
            return None;
        }
        let exact = [
            Surface::Plane(Axes::along(self.axes.origin, self.axes.y())),
            Surface::Cylinder(*self.axes, out),
        ];
        let [half_plane, around] = exact.map(Locus::Exact);
        let all = [self.piece.locus, &half_plane, &around];
        let start = self.axes.point([out, 0.0, from[1] + steps * tangent[1]]);
        let p = meet(all, start);
        let [r, _, z] = self.axes.local(p);
        let n = self.piece.locus.distance(p).1;
        let [nr, nz] = [dot(n, self.axes.x), dot(n, self.axes.z)];
        let tip = [0.0, z + nr / nz * r];
        let longest = longest_side(self.piece.triangles.iter().copied());
        // A function that vanishes twice at its tip is accurate to half of the digits near it.
        let is_reached = gap(all, p) <= POINT_TOLERANCE * self.piece.size
            && r > 0.0
            && apart([r, z], from) <= 2.0 * MAX_STEPS_TO_AXIS * self.step
            && nz.abs() > MIN_TIP_SINE
            && self.places.iter().any(|q| apart(*q, tip) <= 2.0 * longest);
        let end = if nr.abs() > MIN_TIP_SINE {
            ProfileEnd::Tip
        } else {
            ProfileEnd::Pole
        };
        is_reached.then_some(([r, z], tip, end))
    }

    /// Returns a point of the profile near a given one, and its tangent.
    fn onto(&self, near: [f64; 2]) -> Option<([f64; 2], [f64; 2])> {
        let mut q = near;
        for _ in 0..32 {
            // Nearer to the axis functions may have no gradient.
            if q[0] < 0.05 * self.step {
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
            // The next step would be about the square of such a short one.
            if way.abs() <= 1e-7 * self.step {
                return Some((q, [-n[1] / length, n[0] / length]));
            }
        }
        None
    }
}

fn apart(p: [f64; 2], q: [f64; 2]) -> f64 {
    (p[0] - q[0]).hypot(p[1] - q[1])
}

/// Returns the distance of a point from a segment.
fn to_segment(p: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let d = [b[0] - a[0], b[1] - a[1]];
    let along = (p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1];
    let s = (along / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
    apart(p, [a[0] + s * d[0], a[1] + s * d[1]])
}
