//! Ellipsoids as affine images of the unit sphere.

use super::Axes;
use crate::{Point3, cross, dot, sub};
use isoform_num::Svd;
use std::array::from_fn;

/// Ellipsoid x²/a² + y²/b² + z²/c² = 1 in coordinates of a frame. Longitude and latitude are those
/// on the unit sphere that is stretched to it; that sphere has a frame of its own, in any
/// orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Frame of the half axes.
    pub axes: Axes,
    /// Half axes a, b and c, in model units.
    pub half: [f64; 3],
    /// Frame of the unit sphere, with the origin 0, in coordinates of `axes` divided by the half
    /// axes.
    pub sphere: Axes,
}

impl Ellipsoid {
    /// Half the width of the stereographic chart in files: it covers all directions within 63.6° of
    /// its centre. From 1/√2 on its weights are not all positive.
    pub const CHART_HALF_WIDTH: f64 = 0.62;

    /// Returns the parameters s and t of a point in the stereographic chart ([`Self::chart`]); they
    /// are large for points on the opposite side.
    pub fn in_chart(&self, p: Point3) -> [f64; 2] {
        let [x, y, z] = self.sphere.local(self.shrunk(p));
        [z, y].map(|v| v / (1.0 - x).max(1e-9))
    }
    /// Returns the point with the parameters s and t in that chart.
    pub fn from_chart(&self, [s, t]: [f64; 2]) -> Point3 {
        let (square, sphere) = (s * s + t * t, &self.sphere);
        let (e, f, g) = (sphere.x.map(|v| -v), sphere.z, sphere.y());
        let unit =
            from_fn(|k| ((1.0 - square) * e[k] + 2.0 * (s * f[k] + t * g[k])) / (1.0 + square));
        let q = self.stretched(unit);
        from_fn(|k| self.axes.origin[k] + q[k])
    }
    /// Returns the ellipsoid with the frame of its unit sphere along the half axes.
    pub fn new(axes: Axes, half: [f64; 3]) -> Self {
        let sphere = Axes {
            origin: [0.0; 3],
            z: [0.0, 0.0, 1.0],
            x: [1.0, 0.0, 0.0],
        };
        Self { axes, half, sphere }
    }
    /// Maps a point of space to the space of the unit sphere, in coordinates along the half axes.
    pub fn shrunk(&self, p: Point3) -> Point3 {
        let local = self.axes.local(p);
        from_fn(|k| local[k] / self.half[k])
    }
    /// Maps a vector of the space of the unit sphere to a vector of space.
    pub fn stretched(&self, v: Point3) -> Point3 {
        self.axes.vector(from_fn(|k| self.half[k] * v[k]))
    }
    /// Returns the unit normal, in space, of the plane through the centre that has the normal `n`
    /// in the space of the unit sphere.
    pub fn plane_normal(&self, n: Point3) -> Point3 {
        let normal = self.axes.vector(from_fn(|k| n[k] / self.half[k]));
        let length = dot(normal, normal).sqrt();
        normal.map(|v| v / length)
    }
    /// Returns the signed distance to first order, (|q| − 1)/|∇|q||, where q is the point in the
    /// space of the unit sphere, and the unit gradient.
    pub fn distance(&self, p: Point3) -> (f64, Point3) {
        let (q, r, g) = self.slope(p);
        let length = dot(g, g).sqrt();
        if length == 0.0 {
            return (-self.half[2], self.axes.vector(q));
        }
        ((r - 1.0) / length, self.axes.vector(g.map(|v| v / length)))
    }
    /// Returns the point q in the space of the unit sphere, |q|, and ∇|q| in coordinates of `axes`.
    fn slope(&self, p: Point3) -> (Point3, f64, Point3) {
        let q = self.shrunk(p);
        let r = dot(q, q).sqrt();
        let g = if r > 0.0 {
            from_fn(|k| q[k] / (r * self.half[k]))
        } else {
            [0.0; 3]
        };
        (q, r, g)
    }
    /// Returns the second derivative of the distance along a tangent.
    pub fn bending(&self, p: Point3, along: Point3) -> f64 {
        let (q, r, g) = self.slope(p);
        let t = [self.axes.x, self.axes.y(), self.axes.z].map(|e| dot(along, e));
        let dq: Point3 = from_fn(|k| t[k] / self.half[k]);
        let second = (dot(dq, dq) - (dot(q, dq) / r).powi(2)) / r;
        second / dot(g, g).sqrt()
    }
    /// Returns the longitude, from 0 to 2π, and the latitude on the unit sphere.
    pub fn parameters(&self, p: Point3) -> [f64; 2] {
        let [x, y, z] = self.sphere.local(self.shrunk(p));
        let u = y.atan2(x).rem_euclid(std::f64::consts::TAU);
        [u, z.atan2(x.hypot(y))]
    }
    /// Returns the point with the given longitude and latitude.
    pub fn point(&self, at: [f64; 2]) -> Point3 {
        let q = self.stretched(self.sphere.vector(normal(at)));
        from_fn(|k| self.axes.origin[k] + q[k])
    }
    /// Returns ∂p/∂u × ∂p/∂v, u the longitude and v the latitude.
    pub fn area_vector(&self, at: [f64; 2]) -> Point3 {
        let cos = at[1].cos();
        let n = self.sphere.vector(normal(at).map(|v| cos * v));
        let [a, b, c] = self.half;
        self.axes.vector([b * c * n[0], c * a * n[1], a * b * n[2]])
    }
    /// Returns the rate at which the longitude changes at `p` along a velocity.
    pub fn rate_of_u(&self, p: Point3, velocity: Point3) -> f64 {
        let [x, y, _] = self.sphere.local(self.shrunk(p));
        let v = [self.axes.x, self.axes.y(), self.axes.z].map(|e| dot(velocity, e));
        let v: Point3 = from_fn(|k| v[k] / self.half[k]);
        let [vx, vy] = [self.sphere.x, self.sphere.y()].map(|e| dot(v, e));
        (x * vy - y * vx) / (x * x + y * y)
    }
    /// Intersects the ellipsoid with the plane through `p` with the normal `n`. Returns the centre
    /// of the ellipse and its half axes as vectors, the larger one first; `None` if the plane
    /// touches or misses the ellipsoid.
    pub fn section(&self, p: Point3, n: Point3) -> Option<(Point3, [Point3; 2])> {
        let n = [self.axes.x, self.axes.y(), self.axes.z].map(|e| dot(n, e));
        let n: Point3 = from_fn(|k| n[k] * self.half[k]);
        let length = dot(n, n).sqrt();
        let n = n.map(|v| v / length);
        let off = dot(n, self.shrunk(p));
        if off.is_nan() || off.abs() >= 1.0 {
            return None;
        }
        let radius = (1.0 - off * off).sqrt();
        let [e, f] = crate::orthonormal_complement(n);
        // Conjugate half diameters u and v; the rotation by `angle` makes them orthogonal.
        let [u, v] = [e, f].map(|e| self.stretched(e.map(|k| radius * k)));
        let angle = 0.5 * (2.0 * dot(u, v)).atan2(dot(u, u) - dot(v, v));
        let (sin, cos) = angle.sin_cos();
        let large = from_fn(|k| cos * u[k] + sin * v[k]);
        let small = from_fn(|k| cos * v[k] - sin * u[k]);
        let center = self.stretched(n.map(|k| off * k));
        Some((from_fn(|k| self.axes.origin[k] + center[k]), [large, small]))
    }
    /// Returns the control points and weights of the biquadratic Bézier patch over |s|, |t| ≤
    /// `reach` of the stereographic chart about −x of the sphere: ((1 − s² − t²) e + 2s f + 2t
    /// g)/(1 + s² + t²) with e = −x, f = z, g = y, stretched. Its normal points outward; weights
    /// are positive for a reach below 1/√2, and the chart covers all directions within 2
    /// atan(reach) of −x.
    pub fn chart(&self, reach: f64) -> ([[Point3; 3]; 3], [[f64; 3]; 3]) {
        let (e, f, g) = (self.sphere.x.map(|v| -v), self.sphere.z, self.sphere.y());
        // Blossoms of s and s² at (−r, −r), (−r, r) and (r, r), r the reach.
        let blossom = |i: usize| {
            let [a, b] = [[-reach, -reach], [-reach, reach], [reach, reach]][i];
            (0.5 * (a + b), a * b)
        };
        let mut control = [[[0.0; 3]; 3]; 3];
        let mut weights = [[0.0; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                let ((s, s2), (t, t2)) = (blossom(i), blossom(j));
                let w = 1.0 + s2 + t2;
                let q = from_fn(|k| ((1.0 - s2 - t2) * e[k] + 2.0 * s * f[k] + 2.0 * t * g[k]) / w);
                let q = self.stretched(q);
                control[i][j] = from_fn(|k| self.axes.origin[k] + q[k]);
                weights[i][j] = w;
            }
        }
        (control, weights)
    }
    /// Returns the ellipsoid whose chart ([`Self::chart`]) has these control points: their
    /// differences give the stretched frame of the sphere, whose singular values are the half axes.
    /// `None` if that frame is singular or left-handed. Control points of other surfaces are not
    /// detected.
    pub fn of_chart(control: &[[Point3; 3]; 3], reach: f64) -> Option<Self> {
        let between = |a: Point3, b: Point3, share: f64| -> Point3 {
            from_fn(|k| a[k] + share * (b[k] - a[k]))
        };
        let apart = |a: Point3, b: Point3| sub(b, a).map(|v| v / (4.0 * reach));
        let f = apart(control[0][1], control[2][1]);
        let g = apart(control[1][0], control[1][2]);
        // Midway between these two lies origin + e; the central control point is origin + (1 + 2
        // reach²)/(1 − 2 reach²) e.
        let near = between(control[0][1], control[2][1], 0.5);
        let e = sub(control[1][1], near).map(|v| v * (1.0 / (4.0 * reach * reach) - 0.5));
        let Svd {
            values: half,
            right,
            images,
        } = Svd::new([e, f, g]);
        if half.iter().any(|h| h.is_nan() || *h <= 0.0) || dot(cross(e, f), g) <= 0.0 {
            return None;
        }
        let [x, y, mut z]: [Point3; 3] = from_fn(|k| images[k].map(|v| v / half[k]));
        let mut rows = right;
        if dot(cross(x, y), z) < 0.0 {
            z = z.map(|v| -v);
            rows[2] = rows[2].map(|v| -v);
        }
        let column = |j: usize| -> Point3 { from_fn(|k| rows[k][j]) };
        let axes = Axes {
            origin: sub(near, e),
            z,
            x,
        };
        let sphere = Axes {
            origin: [0.0; 3],
            z: column(1),
            x: column(0).map(|v| -v),
        };
        Some(Self { axes, half, sphere })
    }
    /// Returns the ellipsoid with the frame of the sphere rotated so that −x is `direction`, a unit
    /// vector in the space of the unit sphere.
    #[must_use]
    pub fn facing(self, direction: Point3) -> Self {
        let [z, _] = crate::orthonormal_complement(direction);
        let x = direction.map(|v| -v);
        let sphere = Axes {
            origin: [0.0; 3],
            z: cross(x, cross(z, x)),
            x,
        };
        Self { sphere, ..self }
    }
}

/// Returns the point of the unit sphere with the given longitude and latitude.
fn normal([u, v]: [f64; 2]) -> Point3 {
    [v.cos() * u.cos(), v.cos() * u.sin(), v.sin()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::norm;

    fn tilted() -> Ellipsoid {
        let axes = Axes::along([0.3, -0.2, 0.1], [0.6, 0.0, 0.8]);
        let direction = [0.48, 0.6, 0.64];
        Ellipsoid::new(axes, [0.9, 0.6, 0.4]).facing(direction)
    }

    #[test]
    fn the_chart_lies_on_the_ellipsoid_and_faces_outward() {
        let ball = tilted();
        let (control, weights) = ball.chart(0.6);
        let bernstein = |s: f64| [(1.0 - s) * (1.0 - s), 2.0 * s * (1.0 - s), s * s];
        let at = |s: f64, t: f64| {
            let (a, b) = (bernstein(s), bernstein(t));
            let (mut sum, mut below) = ([0.0; 3], 0.0);
            for i in 0..3 {
                for j in 0..3 {
                    let w = a[i] * b[j] * weights[i][j];
                    below += w;
                    (0..3).for_each(|k| sum[k] += w * control[i][j][k]);
                }
            }
            sum.map(|v| v / below)
        };
        assert!(weights.as_flattened().iter().all(|w| *w > 0.0));
        for (s, t) in [(0.0, 0.0), (0.2, 0.9), (0.5, 0.5), (1.0, 0.3)] {
            let p = at(s, t);
            let (d, n) = ball.distance(p);
            assert!(d.abs() < 1e-15, "{d}");
            let h = 1e-5;
            let across = cross(
                sub(at(s + h, t), at(s - h, t)),
                sub(at(s, t + h), at(s, t - h)),
            );
            assert!(dot(across, n) > 0.999 * norm(across));
        }
        assert!(
            ball.in_chart(at(0.75, 0.25))
                .iter()
                .zip([0.3, -0.3])
                .all(|(a, b)| (a - b).abs() < 1e-14)
        );
        // The centre of the chart is −x of the sphere.
        let q = ball.shrunk(at(0.5, 0.5));
        assert!(norm(sub(q, [0.48, 0.6, 0.64])) < 1e-15, "{q:?}");
    }

    #[test]
    fn a_chart_tells_its_ellipsoid() {
        // Three different half axes, and a spheroid, whose frame is free to turn.
        for half in [[0.9, 0.6, 0.4], [0.5, 0.9, 0.5]] {
            let ball = Ellipsoid { half, ..tilted() };
            let (control, _) = ball.chart(Ellipsoid::CHART_HALF_WIDTH);
            let again =
                Ellipsoid::of_chart(&control, Ellipsoid::CHART_HALF_WIDTH).expect("a chart");
            let (back, _) = again.chart(Ellipsoid::CHART_HALF_WIDTH);
            for (p, q) in control.as_flattened().iter().zip(back.as_flattened()) {
                assert!(norm(sub(*p, *q)) < 1e-14, "{p:?} {q:?}");
            }
            // The surfaces coincide also outside the chart.
            for at in [[0.3, 0.2], [2.0, -1.0], [4.0, 1.2]] {
                assert!(again.distance(ball.point(at)).0.abs() < 1e-14);
            }
        }
        let mut flat = [[[0.0; 3]; 3]; 3];
        (0..9).for_each(|n| flat[n / 3][n % 3] = [n as f64, (n / 3) as f64, 0.0]);
        assert_eq!(
            Ellipsoid::of_chart(&flat, Ellipsoid::CHART_HALF_WIDTH),
            None
        );
    }

    #[test]
    fn sections_are_ellipses_on_the_plane_and_the_ellipsoid() {
        let ball = tilted();
        let (p, n) = ([0.4, -0.1, 0.2], [0.0, 0.6, 0.8]);
        let (center, [a, b]) = ball.section(p, n).expect("they meet");
        assert!(dot(a, b).abs() < 1e-15 && norm(a) >= norm(b));
        for i in 0..7 {
            let (sin, cos) = f64::from(i).sin_cos();
            let q = from_fn(|k| center[k] + cos * a[k] + sin * b[k]);
            assert!(ball.distance(q).0.abs() < 1e-14 && dot(n, sub(q, p)).abs() < 1e-14);
        }
        assert!(ball.section([9.0, 9.0, 9.0], n).is_none());
    }
}
