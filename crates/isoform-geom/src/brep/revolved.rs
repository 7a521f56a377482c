//! Surfaces of revolution whose profile is a B-spline.

use super::surface::{Meridian, combined};
use super::{Axes, Basis};
use crate::{Point3, cross, dot};
use std::array::from_fn;

/// A curve in the half-plane about z, turned about z; only its ends may lie on z. Its parameters are the angle, in radians, and
/// that of the curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Revolved {
    /// The frame.
    pub axes: Axes,
    /// The degree of the curve, at most 7.
    pub degree: usize,
    /// Its knots, ascending, each as often as it counts: degree + 1 times at the ends.
    pub knots: Vec<f64>,
    /// Its control points: distances from the axis, and heights along it.
    pub control: Vec<[f64; 2]>,
}

/// Steps towards the foot of a point at most; near the curve a handful is enough.
const STEPS: usize = 24;
/// A step this short, in lengths of the domain, is the last.
const LAST: f64 = 1e-15;
/// Feet are sought this far beyond the ends of the domain, in its lengths: there the outer
/// polynomials go on, and soon lead away.
const BEYOND: f64 = 0.05;

impl Revolved {
    /// The ends of the parameter of the curve.
    pub fn domain(&self) -> [f64; 2] {
        [self.knots[0], self.knots[self.knots.len() - 1]]
    }
    /// True for each end of the curve that lies on the axis.
    pub fn tips(&self) -> [bool; 2] {
        let is_on_axis = |c: Option<&[f64; 2]>| c.is_some_and(|c| c[0] == 0.0);
        [self.control.first(), self.control.last()].map(is_on_axis)
    }
    /// The curve (distance from the axis, height) with its first and second derivative.
    pub fn profile(&self, t: f64) -> [[f64; 2]; 3] {
        let basis = Basis::at(&self.knots, self.degree, t);
        let own = &self.control[basis.first..=basis.first + self.degree];
        basis.values.each_ref().map(|weights| {
            let terms = own.iter().zip(weights);
            terms.fold([0.0; 2], |sum, (c, w)| from_fn(|k| sum[k] + w * c[k]))
        })
    }
    /// The parameter of the curve's point next to a place of the half-plane, if that is near.
    fn foot(&self, place: [f64; 2]) -> f64 {
        let [first, last] = self.domain();
        let far = |c: &[f64; 2]| (c[0] - place[0]).powi(2) + (c[1] - place[1]).powi(2);
        let all = self.control.iter().enumerate();
        let nearest = all.min_by(|a, b| far(a.1).total_cmp(&far(b.1)));
        let i = nearest.map_or(0, |n| n.0);
        let greville = self.knots[i + 1..=i + self.degree].iter().sum::<f64>();
        let mut t = greville / self.degree as f64;
        let reach = BEYOND * (last - first);
        for _ in 0..STEPS {
            let [c, d, dd] = self.profile(t);
            let off: [f64; 2] = from_fn(|k| place[k] - c[k]);
            let speed = d[0] * d[0] + d[1] * d[1];
            let bend = off[0] * dd[0] + off[1] * dd[1];
            // Beyond the centre of curvature Newton's step would lead away.
            let slope = if bend < 0.5 * speed {
                speed - bend
            } else {
                speed
            };
            let step = (off[0] * d[0] + off[1] * d[1]) / slope;
            let next = (t + step).clamp(first - reach, last + reach);
            let way = (next - t).abs();
            t = next;
            if way.is_nan() || way <= LAST * (last - first) {
                break;
            }
        }
        t
    }
    /// The curve's point next to a point of space, and the unit normal there: the tangent turned
    /// away from the axis where the curve rises.
    fn below(&self, at: &Meridian) -> ([f64; 2], [f64; 2]) {
        let [c, [out, up], _] = self.profile(self.foot([at.out, at.height]));
        let length = out.hypot(up);
        (c, [up / length, -out / length])
    }
    /// The signed distance of a point that is near, and the unit normal.
    pub fn distance(&self, p: Point3) -> (f64, Point3) {
        let at = Meridian::of(&self.axes, p);
        let (c, n) = self.below(&at);
        let value = (at.out - c[0]) * n[0] + (at.height - c[1]) * n[1];
        (value, combined(n[0], at.radial, n[1], self.axes.z))
    }
    /// The second derivative of the distance along a tangent, at a point of the surface.
    pub fn bending(&self, p: Point3, along: Point3) -> f64 {
        let at = Meridian::of(&self.axes, p);
        let [_, d, dd] = self.profile(self.foot([at.out, at.height]));
        let speed = d[0] * d[0] + d[1] * d[1];
        let n = [d[1], -d[0]].map(|v| v / speed.sqrt());
        let up = dot(along, combined(d[0], at.radial, d[1], self.axes.z)).powi(2) / speed;
        let round = dot(along, cross(self.axes.z, at.radial)).powi(2);
        n[0] / at.out * round - (dd[0] * n[0] + dd[1] * n[1]) / speed * up
    }
    /// The angle, from 0 to 2π, and the parameter of the curve next to a point.
    pub fn parameters(&self, p: Point3) -> [f64; 2] {
        let at = Meridian::of(&self.axes, p);
        let [x, y, _] = self.axes.local(p);
        let angle = y.atan2(x).rem_euclid(std::f64::consts::TAU);
        [angle, self.foot([at.out, at.height])]
    }
    /// The point with the given parameters.
    pub fn point(&self, [u, v]: [f64; 2]) -> Point3 {
        let [[out, height], ..] = self.profile(v);
        self.axes.point([out * u.cos(), out * u.sin(), height])
    }
    /// ∂p/∂u × ∂p/∂v.
    pub fn area_vector(&self, [u, v]: [f64; 2]) -> Point3 {
        let [[out, _], d, _] = self.profile(v);
        let area = [out * d[1] * u.cos(), out * d[1] * u.sin(), -out * d[0]];
        self.axes.vector(area)
    }
    /// The control points in space, in the half-plane of x.
    pub fn control_points(&self) -> Vec<Point3> {
        let control = self.control.iter();
        control
            .map(|[r, z]| self.axes.point([*r, 0.0, *z]))
            .collect()
    }
}
