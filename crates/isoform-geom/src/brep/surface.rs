//! Distances, parameters and normals of exact surfaces.

use super::{Axes, Surface};
use crate::{Point3, dot};

/// Cylindrical coordinates of a point about an axis.
pub(super) struct Meridian {
    /// Distance from the axis.
    pub(super) out: f64,
    /// Height along the axis.
    pub(super) height: f64,
    /// Unit direction away from the axis; x for a point on the axis.
    pub(super) radial: Point3,
}

impl Meridian {
    /// Returns the cylindrical coordinates of a point.
    pub(super) fn from_point(axes: &Axes, p: Point3) -> Self {
        let [x, y, height] = axes.local(p);
        let out = x.hypot(y);
        let radial = if out > 0.0 {
            axes.vector([x / out, y / out, 0.0])
        } else {
            axes.x
        };
        Self {
            out,
            height,
            radial,
        }
    }
}

/// Returns a u + b v.
pub(super) fn combined(a: f64, u: Point3, b: f64, v: Point3) -> Point3 {
    std::array::from_fn(|k| a * u[k] + b * v[k])
}

impl Surface {
    /// Returns the signed distance of a point, positive on the side of the surface's normal, and
    /// its gradient, of length 1. For a cone it is the distance from the generating line in the
    /// half-plane of the point: beyond the apex that is not the distance from the cone, but it is
    /// smooth. For ellipsoids and graphs it is the distance to first order; for surfaces of
    /// revolution the point must be close to the surface.
    pub fn distance(&self, p: Point3) -> (f64, Point3) {
        match *self {
            Self::Plane(axes) => (axes.local(p)[2], axes.z),
            Self::Cylinder(axes, radius) => {
                let at = Meridian::from_point(&axes, p);
                (at.out - radius, at.radial)
            }
            Self::Cone(axes, radius, half_angle) => {
                let (at, (sin, cos)) = (Meridian::from_point(&axes, p), half_angle.sin_cos());
                let value = cos * (at.out - radius) - sin * at.height;
                (value, combined(cos, at.radial, -sin, axes.z))
            }
            Self::Sphere(axes, radius) => {
                let d = crate::sub(p, axes.origin);
                let r = dot(d, d).sqrt();
                let normal = if r > 0.0 { d.map(|v| v / r) } else { axes.z };
                (r - radius, normal)
            }
            Self::Torus(axes, major, minor) => {
                let at = Meridian::from_point(&axes, p);
                let q = at.out - major;
                let r = q.hypot(at.height);
                let (c, s) = if r > 0.0 {
                    (q / r, at.height / r)
                } else {
                    (1.0, 0.0)
                };
                (r - minor, combined(c, at.radial, s, axes.z))
            }
            Self::Ellipsoid(ball) => ball.distance(p),
            Self::Revolved(ref turned) => turned.distance(p),
            Self::Graph(ref graph) => graph.distance(p),
        }
    }

    /// Returns the second derivative of the distance along a vector; for ellipsoids, surfaces of
    /// revolution and graphs, the point must be on the surface and the vector tangent to it.
    pub fn bending(&self, p: Point3, along: Point3) -> f64 {
        let axes = self.axes();
        let at = Meridian::from_point(axes, p);
        let round = dot(along, crate::cross(axes.z, at.radial)).powi(2);
        match *self {
            Self::Plane(_) => 0.0,
            Self::Cylinder(..) => round / at.out,
            Self::Cone(_, _, half_angle) => half_angle.cos() * round / at.out,
            Self::Sphere(..) => {
                let (value, normal) = self.distance(p);
                let Self::Sphere(_, radius) = *self else {
                    return 0.0;
                };
                (dot(along, along) - dot(along, normal).powi(2)) / (value + radius)
            }
            Self::Torus(_, major, _) => {
                let q = at.out - major;
                let r = q.hypot(at.height);
                let (c, s) = (q / r, at.height / r);
                let across = dot(along, combined(-s, at.radial, c, axes.z));
                across * across / r + c / at.out * round
            }
            Self::Ellipsoid(ball) => ball.bending(p, along),
            Self::Revolved(ref turned) => turned.bending(p, along),
            Self::Graph(ref graph) => graph.bending(p, along),
        }
    }

    /// Returns parameters of the point nearest to `p`: x and y on a plane or graph; otherwise the
    /// angle about z, from 0 to 2π, and the height along z, the latitude on a sphere or ellipsoid,
    /// the angle about the tube, from 0 to 2π, on a torus, or the parameter of a revolved curve.
    pub fn parameters(&self, p: Point3) -> [f64; 2] {
        match self {
            Self::Ellipsoid(ball) => return ball.parameters(p),
            Self::Revolved(turned) => return turned.parameters(p),
            _ => {}
        }
        let full = |angle: f64| angle.rem_euclid(std::f64::consts::TAU);
        let [x, y, z] = self.axes().local(p);
        let u = full(y.atan2(x));
        match *self {
            Self::Plane(_) | Self::Graph(_) => [x, y],
            Self::Cylinder(..) | Self::Cone(..) | Self::Revolved(_) => [u, z],
            Self::Sphere(..) | Self::Ellipsoid(_) => [u, z.atan2(x.hypot(y))],
            Self::Torus(_, major, _) => [u, full(z.atan2(x.hypot(y) - major))],
        }
    }

    /// Returns the point with the given parameters.
    pub fn point(&self, [u, v]: [f64; 2]) -> Point3 {
        let round = |out: f64, height: f64| [out * u.cos(), out * u.sin(), height];
        let local = match *self {
            Self::Plane(_) => [u, v, 0.0],
            Self::Cylinder(_, radius) => round(radius, v),
            Self::Cone(_, radius, half_angle) => round(radius + v * half_angle.tan(), v),
            Self::Sphere(_, radius) => round(radius * v.cos(), radius * v.sin()),
            Self::Torus(_, major, minor) => round(major + minor * v.cos(), minor * v.sin()),
            Self::Ellipsoid(ball) => return ball.point([u, v]),
            Self::Revolved(ref turned) => return turned.point([u, v]),
            Self::Graph(ref graph) => return graph.point([u, v]),
        };
        self.axes().point(local)
    }

    /// Returns ∂p/∂u × ∂p/∂v, which points along the surface's normal.
    pub fn area_vector(&self, [u, v]: [f64; 2]) -> Point3 {
        let (sin, cos) = u.sin_cos();
        let local = match *self {
            Self::Plane(_) => [0.0, 0.0, 1.0],
            Self::Cylinder(_, radius) => [radius * cos, radius * sin, 0.0],
            Self::Cone(_, radius, half_angle) => {
                let tan = half_angle.tan();
                let out = radius + v * tan;
                [out * cos, out * sin, -out * tan]
            }
            Self::Sphere(_, radius) => {
                let (s, c) = v.sin_cos();
                let area = radius * radius * c;
                [area * c * cos, area * c * sin, area * s]
            }
            Self::Torus(_, major, minor) => {
                let (s, c) = v.sin_cos();
                let area = minor * (major + minor * c);
                [area * c * cos, area * c * sin, area * s]
            }
            Self::Ellipsoid(ball) => return ball.area_vector([u, v]),
            Self::Revolved(ref turned) => return turned.area_vector([u, v]),
            Self::Graph(ref graph) => return graph.area_vector([u, v]),
        };
        self.axes().vector(local)
    }

    /// Returns the rate at which the parameter u changes at `p` along a velocity.
    pub fn rate_of_u(&self, p: Point3, velocity: Point3) -> f64 {
        let axes = self.axes();
        match self {
            Self::Plane(_) | Self::Graph(_) => return dot(velocity, axes.x),
            Self::Ellipsoid(ball) => return ball.rate_of_u(p, velocity),
            _ => {}
        }
        let at = Meridian::from_point(axes, p);
        dot(velocity, crate::cross(axes.z, at.radial)) / at.out
    }

    /// Returns the lower limit of integrals along v: the apex of a cone, where its circles have
    /// length 0; else 0.
    pub fn base_of_v(&self) -> f64 {
        match *self {
            Self::Cone(_, radius, half_angle) => -radius / half_angle.tan(),
            _ => 0.0,
        }
    }

    /// Returns the points in which a surface ends on its axis: the apex of a cone, and the ends of
    /// a revolved curve that lie on the axis.
    pub fn tips(&self) -> Vec<Point3> {
        match self {
            Self::Revolved(turned) => {
                let ends = [turned.control.first(), turned.control.last()];
                let tips = ends.into_iter().flatten().zip(turned.tips());
                let at = |c: &[f64; 2]| turned.axes.point([0.0, 0.0, c[1]]);
                tips.filter(|t| t.1).map(|t| at(t.0)).collect()
            }
            _ => self.apex().into_iter().collect(),
        }
    }

    /// Returns the apex of a cone; `None` for other surfaces.
    pub fn apex(&self) -> Option<Point3> {
        match *self {
            Self::Cone(axes, ..) => Some(axes.point([0.0, 0.0, self.base_of_v()])),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brep::{Ellipsoid, Graph, Revolved};
    use crate::{cross, norm, sub};
    use std::sync::Arc;

    /// Returns z = (x² + xy − y²)/5 for x and y from −1 to 3.
    fn saddle(axes: Axes) -> Graph {
        let (a, b) = (-1.0, 3.0);
        let knots = vec![a, a, a, b, b, b];
        let blossom = |i: usize| [[a, a], [a, b], [b, b]][i];
        let heights = (0..9).map(|n| {
            let ([p, q], [r, s]) = (blossom(n / 3), blossom(n % 3));
            (p * q + 0.25 * (p + q) * (r + s) - r * s) / 5.0
        });
        Graph {
            axes,
            degree: 2,
            knots: [knots.clone(), knots],
            heights: heights.collect(),
        }
    }

    /// Returns the parabola with the control points (0.9, 0), (0.5, 0.5), (1.1, 0.8), revolved.
    fn vase(axes: Axes) -> Revolved {
        Revolved {
            axes,
            degree: 2,
            knots: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
            control: vec![[0.9, 0.0], [0.5, 0.5], [1.1, 0.8]],
        }
    }

    fn all() -> [Surface; 8] {
        let axes = Axes::along([0.3, -0.2, 0.1], [0.6, 0.0, 0.8]);
        [
            Surface::Plane(axes),
            Surface::Cylinder(axes, 0.7),
            Surface::Cone(axes, 0.5, 0.4),
            Surface::Sphere(axes, 1.2),
            Surface::Torus(axes, 1.0, 0.3),
            Surface::Ellipsoid(Ellipsoid::new(axes, [0.9, 0.6, 0.4]).facing([0.48, 0.6, 0.64])),
            Surface::Revolved(Arc::new(vase(axes))),
            Surface::Graph(Arc::new(saddle(axes))),
        ]
    }

    #[test]
    fn parameters_distances_and_area_vectors_agree() {
        for surface in all() {
            let at = [2.1, 0.35];
            let p = surface.point(at);
            let (value, normal) = surface.distance(p);
            assert!(value.abs() < 1e-15, "{} {value}", surface.name());
            let back = surface.parameters(p);
            assert!((back[0] - at[0]).abs() + (back[1] - at[1]).abs() < 1e-14);
            let h = 1e-5;
            let along = |k: usize| {
                let shifted = |s: f64| {
                    let mut at = at;
                    at[k] += s;
                    surface.point(at)
                };
                sub(shifted(h), shifted(-h)).map(|v| v / (2.0 * h))
            };
            let n = surface.area_vector(at);
            assert!(norm(sub(n, cross(along(0), along(1)))) < 1e-9);
            assert!((dot(n, normal) / norm(n) - 1.0).abs() < 1e-12);
            assert!((surface.rate_of_u(p, along(0)) - 1.0).abs() < 1e-9);
            assert!(surface.rate_of_u(p, along(1)).abs() < 1e-9);
        }
    }

    #[test]
    fn tips_lie_on_the_axis() {
        let axes = Axes::along([0.3, -0.2, 0.1], [0.6, 0.0, 0.8]);
        let mut drop = vase(axes);
        assert!(Surface::Revolved(Arc::new(drop.clone())).tips().is_empty());
        drop.control[0][0] = 0.0;
        let drop = Surface::Revolved(Arc::new(drop));
        assert_eq!(drop.tips(), [axes.origin]);
        assert!(drop.distance(axes.origin).0.abs() < 1e-15);
        let cone = Surface::Cone(axes, 0.0, 0.4);
        assert_eq!(cone.tips(), [axes.origin]);
    }

    #[test]
    fn bending_is_the_second_derivative() {
        for surface in all() {
            let (mut p, mut t) = ([0.9, 0.4, -0.3], [0.2, -0.7, 0.4]);
            if matches!(surface, Surface::Ellipsoid(_)) || surface.is_near_only() {
                p = surface.point([2.1, 0.35]);
                let n = surface.distance(p).1;
                t = combined(1.0, t, -dot(t, n), n);
            }
            let h = 1e-4;
            let at = |s: f64| surface.distance(combined(1.0, p, s, t)).0;
            let second = (at(h) - 2.0 * at(0.0) + at(-h)) / (h * h);
            assert!(
                (second - surface.bending(p, t)).abs() < 1e-6,
                "{}",
                surface.name()
            );
        }
    }
}
