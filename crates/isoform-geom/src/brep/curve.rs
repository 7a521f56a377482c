//! Points and derivatives of edge curves.

use super::{Axes, BSpline, Brep, Curve};
use crate::{Point3, sub};
use std::f64::consts::TAU;

impl BSpline {
    /// Returns the point and the derivative at a parameter, by de Boor's algorithm.
    pub fn evaluate(&self, t: f64) -> (Point3, Point3) {
        let (p, knots) = (self.degree, self.flat_knots());
        let last = self.control.len() - 1;
        let span = (p..last).find(|&k| t < knots[k + 1]).unwrap_or(last);
        let mut d: Vec<Point3> = (0..=p).map(|j| self.control[span - p + j]).collect();
        let mut velocity = [0.0; 3];
        for r in 1..=p {
            if r == p {
                let width = knots[span + 1] - knots[span];
                velocity = sub(d[p], d[p - 1]).map(|v| v * p as f64 / width);
            }
            for j in (r..=p).rev() {
                let i = span - p + j;
                let share = (t - knots[i]) / (knots[i + 1 + p - r] - knots[i]);
                d[j] = std::array::from_fn(|k| (1.0 - share) * d[j - 1][k] + share * d[j][k]);
            }
        }
        (d[p], velocity)
    }
    /// Divides each knot span into `parts` equal ones by knot insertion, which leaves the curve
    /// unchanged.
    pub fn divide(&mut self, parts: usize) {
        let spans: Vec<[f64; 2]> = self.knots.windows(2).map(|w| [w[0], w[1]]).collect();
        for [from, to] in spans {
            for k in 1..parts {
                let t = from + (to - from) * k as f64 / parts as f64;
                self.insert(t);
            }
        }
    }
    /// Inserts a simple knot at a parameter that is not a knot yet (Boehm 1980).
    fn insert(&mut self, t: f64) {
        let (p, flat) = (self.degree, self.flat_knots());
        let span = (p..self.control.len())
            .rfind(|k| flat[*k] <= t)
            .unwrap_or(p);
        let before = self.control.clone();
        self.control = (0..=before.len())
            .map(|i| {
                if i + p <= span {
                    return before[i];
                }
                if i > span {
                    return before[i - 1];
                }
                let share = (t - flat[i]) / (flat[i + p] - flat[i]);
                std::array::from_fn(|k| (1.0 - share) * before[i - 1][k] + share * before[i][k])
            })
            .collect();
        let at = self.knots.partition_point(|k| *k < t);
        self.knots.insert(at, t);
        self.multiplicities.insert(at, 1);
    }
    /// Returns the knot vector: each knot repeated by its multiplicity.
    pub fn flat_knots(&self) -> Vec<f64> {
        let each = self.knots.iter().zip(&self.multiplicities);
        each.flat_map(|(t, n)| std::iter::repeat_n(*t, *n))
            .collect()
    }
}

/// Returns the eccentric angle of the first end on an ellipse with the half axes a and b, and the
/// increase of the angle to the second end, in (0, 2π].
fn turn(axes: &Axes, [a, b]: [f64; 2], ends: [Point3; 2]) -> [f64; 2] {
    let angle = |p: Point3| {
        let [x, y, _] = axes.local(p);
        (y / b).atan2(x / a)
    };
    let first = angle(ends[0]);
    let mut by = (angle(ends[1]) - first).rem_euclid(TAU);
    if by < 1e-12 {
        by = TAU;
    }
    [first, by]
}

impl Brep {
    /// Returns parameters, ascending from 0 to 1, that divide the curve of an edge into smooth
    /// arcs: conics into arcs of at most a sixth of a turn, splines at their knots.
    pub fn breaks(&self, edge: u32) -> Vec<f64> {
        let even = |n: usize| (0..=n).map(|i| i as f64 / n as f64).collect();
        let arc = |axes: &Axes, radii: [f64; 2]| {
            let [_, by] = turn(axes, radii, self.ends(edge));
            even((by / TAU * 6.0).ceil().max(1.0) as usize)
        };
        match &self.edges[edge as usize].curve {
            Curve::Line => even(1),
            Curve::Circle(axes, r) => arc(axes, [*r, *r]),
            Curve::Ellipse(axes, a, b) => arc(axes, [*a, *b]),
            Curve::BSpline(spline) => {
                let knots = &spline.knots;
                let (first, last) = (knots[0], knots[knots.len() - 1]);
                let share = knots.iter().map(|t| (t - first) / (last - first));
                share.collect()
            }
        }
    }

    /// Returns the point of an edge at the parameter s, from 0 at its first end to 1 at its last,
    /// and the derivative by s.
    pub fn along(&self, edge: u32, s: f64) -> (Point3, Point3) {
        let ends = self.ends(edge);
        match &self.edges[edge as usize].curve {
            Curve::Line => {
                let d = sub(ends[1], ends[0]);
                (std::array::from_fn(|k| ends[0][k] + s * d[k]), d)
            }
            Curve::Circle(axes, r) => conic(axes, [*r, *r], ends, s),
            Curve::Ellipse(axes, a, b) => conic(axes, [*a, *b], ends, s),
            Curve::BSpline(spline) => {
                let knots = &spline.knots;
                let (first, length) = (knots[0], knots[knots.len() - 1] - knots[0]);
                let (point, velocity) = spline.evaluate(first + s * length);
                (point, velocity.map(|v| v * length))
            }
        }
    }
}

/// Returns the point of an elliptic arc at the parameter s, from 0 to 1, and the derivative by s.
fn conic(axes: &Axes, radii: [f64; 2], ends: [Point3; 2], s: f64) -> (Point3, Point3) {
    let [first, by] = turn(axes, radii, ends);
    let (sin, cos) = (first + s * by).sin_cos();
    let [a, b] = radii;
    (
        axes.point([a * cos, b * sin, 0.0]),
        axes.vector([-a * sin * by, b * cos * by, 0.0]),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::norm;

    #[test]
    fn a_cubic_as_a_spline_of_two_spans() {
        // t³ along x: blossoms of the polynomial at knots 0 0 0 0 1 2 2 2 2.
        let control = [0.0, 0.0, 0.0, 4.0, 8.0].map(|x| [x, 0.0, 0.0]).to_vec();
        let spline = BSpline {
            degree: 3,
            knots: vec![0.0, 1.0, 2.0],
            multiplicities: vec![4, 1, 4],
            control,
        };
        let mut divided = spline.clone();
        divided.divide(3);
        assert_eq!((divided.knots.len(), divided.control.len()), (7, 9));
        for spline in [spline, divided] {
            for t in [0.0, 0.3, 1.0, 1.7, 2.0] {
                let (p, v) = spline.evaluate(t);
                assert!((p[0] - t * t * t).abs() < 1e-14, "{t} {p:?}");
                assert!(norm(sub(v, [3.0 * t * t, 0.0, 0.0])) < 1e-13, "{t} {v:?}");
            }
        }
    }
}
