//! Curves of edges and profiles.

use super::{NurbsCurve, Placement};
use crate::brep::Axes;
use crate::{Point3, sub};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Curve in parameter form, with the parameters of ISO 10303-42; angles are in radians.
#[derive(Clone, Debug, PartialEq)]
pub enum CadCurve {
    /// Line: a point, and the derivative by the parameter.
    Line(Point3, Point3),
    /// Circle in the plane z = 0 of the frame, with its radius.
    Circle(Axes, f64),
    /// Ellipse with its half axes along x and y.
    Ellipse(Axes, f64, f64),
    /// Parabola with its apex at the origin: (f t², 2 f t, 0).
    Parabola(Axes, f64),
    /// Branch of a hyperbola: (a cosh t, b sinh t, 0).
    Hyperbola(Axes, f64, f64),
    /// Rational B-spline.
    Nurbs(Arc<NurbsCurve>),
}

impl CadCurve {
    /// Returns the name of the kind, such as `circle`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Line(..) => "line",
            Self::Circle(..) => "circle",
            Self::Ellipse(..) => "ellipse",
            Self::Parabola(..) => "parabola",
            Self::Hyperbola(..) => "hyperbola",
            Self::Nurbs(_) => "spline",
        }
    }
    /// Returns the point at a parameter, with the first and second derivatives.
    pub fn at(&self, t: f64) -> [Point3; 3] {
        let plane = |axes: &Axes, p: [f64; 2], d: [f64; 2], dd: [f64; 2]| {
            let [d, dd] = [d, dd].map(|[x, y]| axes.vector([x, y, 0.0]));
            [axes.point([p[0], p[1], 0.0]), d, dd]
        };
        match self {
            Self::Line(p, d) => [std::array::from_fn(|k| p[k] + t * d[k]), *d, [0.0; 3]],
            Self::Circle(axes, r) => {
                let (s, c) = t.sin_cos();
                plane(axes, [r * c, r * s], [-r * s, r * c], [-r * c, -r * s])
            }
            Self::Ellipse(axes, a, b) => {
                let (s, c) = t.sin_cos();
                plane(axes, [a * c, b * s], [-a * s, b * c], [-a * c, -b * s])
            }
            Self::Parabola(axes, f) => {
                let (d, dd) = ([2.0 * f * t, 2.0 * f], [2.0 * f, 0.0]);
                plane(axes, [f * t * t, 2.0 * f * t], d, dd)
            }
            Self::Hyperbola(axes, a, b) => {
                let (s, c) = (t.sinh(), t.cosh());
                plane(axes, [a * c, b * s], [a * s, b * c], [a * c, b * s])
            }
            Self::Nurbs(spline) => spline.at(t),
        }
    }
    /// Returns the period of the parameter; `None` for a curve that does not close.
    pub fn period(&self) -> Option<f64> {
        match self {
            Self::Circle(..) | Self::Ellipse(..) => Some(TAU),
            Self::Nurbs(spline) => spline.period(),
            _ => None,
        }
    }
    /// Returns the first and last parameter; infinite for lines, parabolas and hyperbolas.
    pub fn domain(&self) -> [f64; 2] {
        match self {
            Self::Circle(..) | Self::Ellipse(..) => [0.0, TAU],
            Self::Nurbs(spline) => spline.domain(),
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }
    /// Returns parameters between two others at which the curve is divided into pieces on which it
    /// is smooth and turns by less than a half turn, both ends included; ascending if they are.
    pub fn breaks(&self, [from, to]: [f64; 2]) -> Vec<f64> {
        let (lo, hi) = (from.min(to), from.max(to));
        let inner: Vec<f64> = match self {
            Self::Nurbs(spline) => {
                // Knots of the two periods that an edge can meet on either side of the domain.
                let shifts = spline.period().map_or(vec![0.0], |t| vec![-t, 0.0, t]);
                let breaks = spline.breaks();
                let shifted = shifts.iter().map(|s| breaks.iter().map(move |b| b + s));
                let mut all: Vec<f64> = shifted.flatten().collect();
                all.dedup();
                all
            }
            Self::Line(..) => Vec::new(),
            // Quarters.
            Self::Circle(..) | Self::Ellipse(..) => {
                let pieces = ((hi - lo) / (0.25 * TAU)).ceil().clamp(1.0, 8.0);
                let at = |k: f64| lo + (hi - lo) * k / pieces;
                (1..pieces as usize).map(|k| at(k as f64)).collect()
            }
            _ => (1..8)
                .map(|k| lo + (hi - lo) * f64::from(k) / 8.0)
                .collect(),
        };
        let mut all = vec![lo];
        all.extend(inner.into_iter().filter(|t| *t > lo && *t < hi));
        all.push(hi);
        if from > to {
            all.reverse();
        }
        all
    }
    /// Returns the parameter at which the curve is nearest to a point; of several, any. For
    /// parabolas and hyperbolas the point must lie on the curve.
    pub fn parameter(&self, p: Point3) -> f64 {
        match self {
            Self::Line(origin, d) => {
                let e = sub(p, *origin);
                crate::dot(e, *d) / crate::dot(*d, *d)
            }
            Self::Circle(axes, _) => {
                let [x, y, _] = axes.local(p);
                y.atan2(x)
            }
            Self::Ellipse(axes, a, b) => {
                let [x, y, _] = axes.local(p);
                self.polished(p, (y / b).atan2(x / a))
            }
            Self::Parabola(axes, f) => axes.local(p)[1] / (2.0 * f),
            Self::Hyperbola(axes, _, b) => (axes.local(p)[1] / b).asinh(),
            Self::Nurbs(spline) => self.searched(p, &spline.breaks(), spline.degree()),
        }
    }
    /// Returns the nearest parameter of a spline: Newton's method from the best of its samples.
    fn searched(&self, p: Point3, breaks: &[f64], degree: usize) -> f64 {
        let pieces = 2 * degree + 2;
        let mut best = (f64::INFINITY, breaks[0]);
        for w in breaks.windows(2) {
            for k in 0..=pieces {
                let t = w[0] + (w[1] - w[0]) * k as f64 / pieces as f64;
                let far = crate::distance_squared(self.at(t)[0], p);
                if far < best.0 {
                    best = (far, t);
                }
            }
        }
        self.polished(p, best.1)
    }
    /// Returns the local minimum of the distance from a point, by Newton's method with steps that
    /// never lead farther away.
    pub fn polished(&self, p: Point3, from: f64) -> f64 {
        let [lo, hi] = match self {
            Self::Nurbs(spline) if spline.period().is_none() => spline.domain(),
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        };
        polished(&|t| self.at(t), p, from, [lo, hi])
    }
    /// Returns the local minimum of the distance from a point between two parameters.
    pub fn polished_within(&self, p: Point3, from: f64, [a, b]: [f64; 2]) -> f64 {
        polished(&|t| self.at(t), p, from, [a.min(b), a.max(b)])
    }
    /// Returns the curve in another place.
    #[must_use]
    pub fn placed(&self, by: &Placement) -> Self {
        match self {
            Self::Line(p, d) => Self::Line(by.point(*p), by.vector(*d)),
            Self::Circle(axes, r) => Self::Circle(by.axes(axes), by.scale * r),
            Self::Ellipse(axes, a, b) => Self::Ellipse(by.axes(axes), by.scale * a, by.scale * b),
            Self::Parabola(axes, f) => Self::Parabola(by.axes(axes), by.scale * f),
            Self::Hyperbola(axes, a, b) => {
                Self::Hyperbola(by.axes(axes), by.scale * a, by.scale * b)
            }
            Self::Nurbs(spline) => Self::Nurbs(Arc::new(spline.placed(by))),
        }
    }
}

/// Maximum number of Newton steps; from a start within the basin ten suffice.
const MAX_NEWTON_STEPS: usize = 40;

/// Returns the parameter within bounds at which a curve is locally nearest to a point.
pub(super) fn polished(
    at: &dyn Fn(f64) -> [Point3; 3],
    p: Point3,
    from: f64,
    [lo, hi]: [f64; 2],
) -> f64 {
    let mut t = from.clamp(lo, hi);
    let mut here = at(t);
    for _ in 0..MAX_NEWTON_STEPS {
        let [x, d, dd] = here;
        let r = sub(x, p);
        let (slope, dd2) = (crate::dot(r, d), crate::dot(d, d));
        let curvature = dd2 + crate::dot(r, dd);
        // Where the distance is not convex, the step of Gauss and Newton still descends.
        let step = -slope
            / if curvature > 0.1 * dd2 {
                curvature
            } else {
                dd2
            };
        if !step.is_finite() {
            return t;
        }
        let far = crate::dot(r, r);
        let mut share = 1.0;
        let next = loop {
            let next = (t + share * step).clamp(lo, hi);
            let there = at(next);
            if crate::distance_squared(there[0], p) <= far || share < 1e-3 {
                break (next, there);
            }
            share *= 0.5;
        };
        let moved = (next.0 - t).abs();
        if crate::distance_squared(next.1[0], p) > far {
            return t;
        }
        (t, here) = next;
        if moved <= 4.0 * f64::EPSILON * t.abs().max(1e-300) || moved * dd2.sqrt() == 0.0 {
            break;
        }
    }
    t
}
