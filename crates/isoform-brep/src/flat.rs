//! Plane charts of faces: one for each kind of surface, without seams or poles within a face.
//!
//! Planes and graphs are projected along z, cylinders and cones are unrolled, tori and revolved
//! surfaces are mapped by their two parameters, spheres and ellipsoids by the stereographic
//! projection from the far side; revolved surfaces with tips by the lengths of their parallels.
//! Distances in space are at most about those in the chart ([`MAX_GRAPH_STRETCH`] times as large on
//! graphs).

use crate::arcs::Arcs;
use isoform_geom::Point3;
use isoform_geom::brep::{Axes, Ellipsoid, Revolved, Surface};
use std::f64::consts::{PI, TAU};

/// Maximum ratio of a length on a graph to that in its chart: normals are within 50° of its z.
pub(crate) const MAX_GRAPH_STRETCH: f64 = 1.6;

/// A chart in which faces lie counterclockwise, seen from outside.
pub(crate) struct Flat {
    surface: Surface,
    /// Values at which the two angles start.
    starts: [f64; 2],
    /// True if the surface ends on its axis.
    has_tips: bool,
    /// 1, or −1 if the surface's own normal points inward.
    side: f64,
    /// A sphere as an ellipsoid.
    ball: Option<Ellipsoid>,
}

impl Flat {
    /// Creates the chart of a face whose border has these points, loop after loop; `None` if it
    /// wraps around.
    pub(crate) fn new(surface: &Surface, agrees: bool, loops: &[Vec<Point3>]) -> Option<Self> {
        let ball = match surface {
            Surface::Sphere(axes, radius) => Some(Ellipsoid {
                sphere: Axes {
                    origin: [0.0; 3],
                    z: [0.0, 0.0, 1.0],
                    x: [1.0, 0.0, 0.0],
                },
                axes: *axes,
                half: [*radius; 3],
            }),
            Surface::Ellipsoid(ball) => Some(*ball),
            _ => None,
        };
        let angles = match surface {
            Surface::Cylinder(..) | Surface::Cone(..) | Surface::Revolved(_) => 1,
            Surface::Torus(..) => 2,
            _ => 0,
        };
        let mut starts = [0.0; 2];
        for (k, start) in starts.iter_mut().enumerate().take(angles) {
            *start = free_angle(surface, loops, k)?;
        }
        Some(Self {
            surface: surface.clone(),
            starts,
            has_tips: !surface.tips().is_empty(),
            side: if agrees { 1.0 } else { -1.0 },
            ball,
        })
    }

    /// Returns the angle from its start, from 0 to 2π.
    fn turned(&self, angle: f64, k: usize) -> f64 {
        (angle - self.starts[k]).rem_euclid(TAU)
    }

    /// Returns the chart coordinates of a point of the face.
    pub(crate) fn place(&self, p: Point3) -> [f64; 2] {
        let [a, b] = self.surface.parameters(p);
        let [x, y] = match self.surface {
            Surface::Plane(_) | Surface::Graph(_) => [a, b],
            Surface::Cylinder(_, radius) => [radius * self.turned(a, 0), b],
            // Parallels in their own lengths: they shrink to the tips.
            Surface::Revolved(ref turned) if self.has_tips => {
                [turned.profile(b)[0][0] * (self.turned(a, 0) - PI), b]
            }
            Surface::Revolved(ref turned) => [widest(turned) * self.turned(a, 0), b],
            Surface::Cone(_, _, half_angle) => {
                // Unrolled: the angle about the apex is that about the axis times sin(half angle),
                // and runs in the opposite sense as seen from outside.
                let out = (b - self.surface.base_of_v()) / half_angle.cos();
                let (sin, cos) = (self.turned(a, 0) * half_angle.sin()).sin_cos();
                [out * sin, out * cos]
            }
            Surface::Torus(_, major, minor) => [
                (major + minor) * self.turned(a, 0),
                minor * self.turned(b, 1),
            ],
            Surface::Sphere(..) | Surface::Ellipsoid(_) => self.ball.map_or([a, b], |ball| {
                let scale = 2.0 * ball.half.into_iter().fold(0.0, f64::max);
                ball.in_chart(p).map(|v| scale * v)
            }),
        };
        [self.side * x, y]
    }

    /// Returns the point of the surface at chart coordinates.
    pub(crate) fn point(&self, [x, y]: [f64; 2]) -> Point3 {
        let x = self.side * x;
        let at = match self.surface {
            Surface::Plane(_) | Surface::Graph(_) => [x, y],
            Surface::Cylinder(_, radius) => [x / radius + self.starts[0], y],
            Surface::Revolved(ref turned) if self.has_tips => {
                let out = turned.profile(y)[0][0];
                let turn = if out > 0.0 { x / out } else { 0.0 };
                [turn + PI + self.starts[0], y]
            }
            Surface::Revolved(ref turned) => [x / widest(turned) + self.starts[0], y],
            Surface::Cone(_, _, half_angle) => {
                let out = x.hypot(y) * half_angle.cos();
                let angle = x.atan2(y).rem_euclid(TAU) / half_angle.sin();
                [angle + self.starts[0], out + self.surface.base_of_v()]
            }
            Surface::Torus(_, major, minor) => [
                x / (major + minor) + self.starts[0],
                y / minor + self.starts[1],
            ],
            Surface::Sphere(..) | Surface::Ellipsoid(_) => {
                return self
                    .ball
                    .map_or([f64::NAN; 3], |ball| on_ball(&ball, [x, y]));
            }
        };
        self.surface.point(at)
    }
}

/// Returns an upper bound of the distance of a revolved curve from the axis.
fn widest(turned: &Revolved) -> f64 {
    turned.control.iter().map(|c| c[0]).fold(0.0, f64::max)
}

/// Returns the point of an ellipsoid at scaled coordinates of its stereographic chart
/// ([`Ellipsoid::from_chart`]).
fn on_ball(ball: &Ellipsoid, at: [f64; 2]) -> Point3 {
    let scale = 2.0 * ball.half.into_iter().fold(0.0, f64::max);
    ball.from_chart(at.map(|v| v / scale))
}

/// Returns an angle that a face leaves free, of the first or second parameter; `None` if it wraps
/// around.
fn free_angle(surface: &Surface, loops: &[Vec<Point3>], k: usize) -> Option<f64> {
    // Meridians from tip to tip do not determine the side of the face; the frame of a face is
    // placed with its x away from the face.
    if k == 0 && surface.tips().len() == 2 {
        return Some(0.0);
    }
    let mut arcs = Arcs::default();
    let out = |p: &Point3| {
        let [x, y, _] = surface.axes().local(*p);
        x.hypot(y)
    };
    let farthest = loops.iter().flatten().map(out).fold(0.0, f64::max);
    // The apex of a cone has no angle.
    let is_apex = |p: &Point3| k == 0 && out(p) <= 1e-9 * farthest;
    for around in loops {
        let next = around.iter().cycle().skip(1);
        for (p, q) in around.iter().zip(next) {
            if !is_apex(p) && !is_apex(q) {
                arcs.add(surface.parameters(*p)[k], surface.parameters(*q)[k]);
            }
        }
    }
    let (middle, width) = arcs.gap();
    // A face that leaves almost no angle free has no chart.
    (width > 1e-3).then_some(middle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::{cross, dot, norm, sub};

    /// Returns a small loop about a point with the given parameters.
    fn around(surface: &Surface, [u, v]: [f64; 2]) -> Vec<Vec<Point3>> {
        let corners = [[0.0, 0.0], [0.4, 0.0], [0.4, 0.3], [0.0, 0.3]];
        let at = |[a, b]: [f64; 2]| surface.point([u + a, v + b]);
        vec![corners.map(at).to_vec()]
    }

    #[test]
    fn places_and_points_belong_together_and_are_seen_from_outside() {
        let axes = Axes::along([0.3, -0.2, 0.1], [0.6, 0.0, 0.8]);
        let ball = Ellipsoid::new(axes, [0.9, 0.6, 0.4]);
        let all = [
            Surface::Plane(axes),
            Surface::Cylinder(axes, 0.7),
            Surface::Cone(axes, 0.5, 0.4),
            Surface::Sphere(axes, 1.2),
            Surface::Torus(axes, 1.0, 0.3),
            Surface::Ellipsoid(ball),
        ];
        // Also across the places where the angles of the surfaces begin.
        for (surface, agrees) in all.iter().flat_map(|s| [(s, true), (s, false)]) {
            for at in [[2.1, 0.35], [-0.2, -0.1]] {
                let loops = around(surface, at);
                let flat = Flat::new(surface, agrees, &loops).expect("a chart");
                let p = surface.point([at[0] + 0.1, at[1] + 0.1]);
                let place = flat.place(p);
                assert!(
                    norm(sub(flat.point(place), p)) < 1e-14,
                    "{}",
                    surface.name()
                );
                let h = 1e-6;
                let x = sub(flat.point([place[0] + h, place[1]]), p);
                let y = sub(flat.point([place[0], place[1] + h]), p);
                assert!(
                    norm(x) < 1.0001 * h && norm(y) < 1.0001 * h,
                    "{}",
                    surface.name()
                );
                let own = if agrees { 1.0 } else { -1.0 };
                let normal = surface.distance(p).1.map(|v| own * v);
                assert!(dot(cross(x, y), normal) > 0.0, "{}", surface.name());
            }
        }
    }

    #[test]
    fn what_goes_round_has_no_chart() {
        let axes = Axes::along([0.0; 3], [0.0, 0.0, 1.0]);
        let wall = Surface::Cylinder(axes, 1.0);
        let ring = |n: usize| (0..n).map(|i| wall.point([0.1 * i as f64, 0.0]));
        assert!(Flat::new(&wall, true, &[ring(64).collect()]).is_none());
        let half: Vec<Point3> = ring(30).chain([wall.point([1.5, 2.0])]).collect();
        assert!(Flat::new(&wall, true, &[half]).is_some());
    }
}
