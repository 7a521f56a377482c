//! Surfaces of revolution whose profile is a B-spline.

use super::surface::{Meridian, combined};
use super::{Axes, Basis};
use crate::{Point3, cross, dot};
use std::array::from_fn;

/// Surface of revolution: a B-spline curve in a half-plane bounded by the z axis, revolved about z;
/// only the ends of the curve may lie on the axis. The parameters are the angle, in radians, and
/// that of the curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Revolved {
    /// Frame; z is the axis of revolution.
    pub axes: Axes,
    /// Degree of the curve, at most 7.
    pub degree: usize,
    /// Knot vector of the curve, ascending, with degree + 1 equal knots at both ends.
    pub knots: Vec<f64>,
    /// Control points of the curve: distance from the axis and height along it, in model units.
    pub control: Vec<[f64; 2]>,
}

/// Maximum number of Newton steps to the foot of a point; near the curve a handful suffices.
const MAX_MERIDIAN_STEPS: usize = 24;
/// Length of a Newton step, in lengths of the domain, at or below which the iteration ends.
const CONVERGED_STEP_LENGTH: f64 = 1e-15;
/// Margin beyond the ends of the domain, in lengths of the domain, in which feet are sought: the
/// outermost polynomials are continued there, and diverge from the surface farther out.
const DOMAIN_MARGIN: f64 = 0.05;

impl Revolved {
    /// Returns the interval of the curve's parameter.
    pub fn domain(&self) -> [f64; 2] {
        [self.knots[0], self.knots[self.knots.len() - 1]]
    }
    /// Returns true for each end of the curve that lies on the axis.
    pub fn tips(&self) -> [bool; 2] {
        let is_on_axis = |c: Option<&[f64; 2]>| c.is_some_and(|c| c[0] == 0.0);
        [self.control.first(), self.control.last()].map(is_on_axis)
    }
    /// Returns the point of the curve (distance from the axis, height) with its first and second
    /// derivatives.
    pub fn profile(&self, t: f64) -> [[f64; 2]; 3] {
        let basis = Basis::at(&self.knots, self.degree, t);
        let own = &self.control[basis.first..=basis.first + self.degree];
        basis.values.each_ref().map(|weights| {
            let terms = own.iter().zip(weights);
            terms.fold([0.0; 2], |sum, (c, w)| from_fn(|k| sum[k] + w * c[k]))
        })
    }
    /// Returns the parameter of the curve's point nearest to a point of the half-plane that is
    /// close to the curve.
    fn foot(&self, place: [f64; 2]) -> f64 {
        let [first, last] = self.domain();
        let far = |c: &[f64; 2]| (c[0] - place[0]).powi(2) + (c[1] - place[1]).powi(2);
        let all = self.control.iter().enumerate();
        let nearest = all.min_by(|a, b| far(a.1).total_cmp(&far(b.1)));
        let i = nearest.map_or(0, |n| n.0);
        let greville = self.knots[i + 1..=i + self.degree].iter().sum::<f64>();
        let mut t = greville / self.degree as f64;
        let reach = DOMAIN_MARGIN * (last - first);
        for _ in 0..MAX_MERIDIAN_STEPS {
            let [c, d, dd] = self.profile(t);
            let off: [f64; 2] = from_fn(|k| place[k] - c[k]);
            let speed = d[0] * d[0] + d[1] * d[1];
            let bend = off[0] * dd[0] + off[1] * dd[1];
            // Beyond the centre of curvature Newton's step would increase the distance.
            let slope = if bend < 0.5 * speed {
                speed - bend
            } else {
                speed
            };
            let step = (off[0] * d[0] + off[1] * d[1]) / slope;
            let next = (t + step).clamp(first - reach, last + reach);
            let way = (next - t).abs();
            t = next;
            if way.is_nan() || way <= CONVERGED_STEP_LENGTH * (last - first) {
                break;
            }
        }
        t
    }
    /// Returns the curve's point nearest to a point of space, and the unit normal there: the
    /// tangent rotated by −90°, away from the axis where the curve rises.
    fn below(&self, at: &Meridian) -> ([f64; 2], [f64; 2]) {
        let [c, [out, up], _] = self.profile(self.foot([at.out, at.height]));
        let length = out.hypot(up);
        (c, [up / length, -out / length])
    }
    /// Returns the signed distance of a point close to the surface, and the unit normal.
    pub fn distance(&self, p: Point3) -> (f64, Point3) {
        let at = Meridian::from_point(&self.axes, p);
        let (c, n) = self.below(&at);
        let value = (at.out - c[0]) * n[0] + (at.height - c[1]) * n[1];
        (value, combined(n[0], at.radial, n[1], self.axes.z))
    }
    /// Returns the second derivative of the distance along a tangent, at a point of the surface.
    pub fn bending(&self, p: Point3, along: Point3) -> f64 {
        let at = Meridian::from_point(&self.axes, p);
        let [_, d, dd] = self.profile(self.foot([at.out, at.height]));
        let speed = d[0] * d[0] + d[1] * d[1];
        let n = [d[1], -d[0]].map(|v| v / speed.sqrt());
        let up = dot(along, combined(d[0], at.radial, d[1], self.axes.z)).powi(2) / speed;
        let round = dot(along, cross(self.axes.z, at.radial)).powi(2);
        n[0] / at.out * round - (dd[0] * n[0] + dd[1] * n[1]) / speed * up
    }
    /// Returns the parameters of the nearest point of the surface: the angle, from 0 to 2π, and the
    /// parameter of the curve.
    pub fn parameters(&self, p: Point3) -> [f64; 2] {
        let at = Meridian::from_point(&self.axes, p);
        let [x, y, _] = self.axes.local(p);
        let angle = y.atan2(x).rem_euclid(std::f64::consts::TAU);
        [angle, self.foot([at.out, at.height])]
    }
    /// Returns the point with the given parameters.
    pub fn point(&self, [u, v]: [f64; 2]) -> Point3 {
        let [[out, height], ..] = self.profile(v);
        self.axes.point([out * u.cos(), out * u.sin(), height])
    }
    /// Returns ∂p/∂u × ∂p/∂v, u the angle and v the parameter of the curve.
    pub fn area_vector(&self, [u, v]: [f64; 2]) -> Point3 {
        let [[out, _], d, _] = self.profile(v);
        let area = [out * d[1] * u.cos(), out * d[1] * u.sin(), -out * d[0]];
        self.axes.vector(area)
    }
    /// Returns the control points in space, in the half-plane of z and x.
    pub fn control_points(&self) -> Vec<Point3> {
        let control = self.control.iter();
        control
            .map(|[r, z]| self.axes.point([*r, 0.0, *z]))
            .collect()
    }
}
