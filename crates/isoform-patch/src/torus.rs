//! Torus on which an exact patch lies.
//!
//! Normals of a surface of revolution all meet its axis: n·(b + a × p) = 0 for the velocity b + a ×
//! p of the rotation about the axis (Pottmann and Wallner 2001, section 3.1), which is linear in a
//! and b. In the half-plane bounded by the axis the meridian must then be a circle. Normals cost
//! some digits, which Gauss-Newton steps on the points' distances from the torus restore.

use crate::least_squares::damped_least_squares;
use crate::null::null;
use crate::places::{moved, normalized};
use isoform_geom::{Point3, Quadric, cross, dot, norm, orthonormal_complement, sub};

/// Relative error of normals, some digits larger than that of points.
const NORMAL_TOLERANCE: f64 = 1e-10;
/// Number of parameters of a torus: three of its centre, two of its axis, two radii.
const TORUS_PARAMETERS: usize = 7;

/// Returns the torus through points with normals, in coordinates in which their extent is about 1;
/// `None` unless there is exactly one torus.
pub(crate) fn torus(points: &[Point3], normals: &[Point3]) -> Option<Quadric> {
    let axis = Axis::through(points, normals)?;
    let circle = Circle::of_meridian(points, &axis)?;
    let height = circle.height;
    let start = Torus {
        center: moved(axis.foot, height, axis.direction),
        axis: axis.direction,
        major: circle.out,
        minor: circle.radius,
    };
    start.refined(points)
}

/// Axis of a surface of revolution.
struct Axis {
    /// Point of the axis nearest to the origin.
    foot: Point3,
    direction: Point3,
}

impl Axis {
    /// Computes the axis; `None` if no rotation, or more than one motion, maps the surface to
    /// itself.
    fn through(points: &[Point3], normals: &[Point3]) -> Option<Self> {
        let rows = points.iter().zip(normals).map(|(p, n)| {
            let m = cross(*p, *n);
            [n[0], n[1], n[2], m[0], m[1], m[2]]
        });
        let v = null(rows.collect(), NORMAL_TOLERANCE)?;
        let (b, a) = ([v[0], v[1], v[2]], [v[3], v[4], v[5]]);
        let a2 = dot(a, a);
        // Screws and translations are excluded.
        if a2 <= NORMAL_TOLERANCE || dot(a, b).abs() > NORMAL_TOLERANCE.sqrt() * a2 {
            return None;
        }
        Some(Self {
            direction: a.map(|v| v / a2.sqrt()),
            foot: cross(a, b).map(|v| v / a2),
        })
    }
}

/// Circle in the half-plane bounded by an axis.
struct Circle {
    /// Distance of its centre from the axis.
    out: f64,
    /// Coordinate of its centre along the axis.
    height: f64,
    radius: f64,
}

impl Circle {
    /// Returns the meridian if it is a circle away from the axis.
    fn of_meridian(points: &[Point3], axis: &Axis) -> Option<Self> {
        let rows = points.iter().map(|p| {
            let d = sub(*p, axis.foot);
            let height = dot(d, axis.direction);
            let out = norm(std::array::from_fn(|k| d[k] - height * axis.direction[k]));
            [out * out + height * height, out, height, 1.0]
        });
        let c = null(rows.collect(), NORMAL_TOLERANCE)?;
        let (out, height) = (-0.5 * c[1] / c[0], -0.5 * c[2] / c[0]);
        let r2 = out * out + height * height - c[3] / c[0];
        (out > 0.0 && r2 > 0.0).then(|| Self {
            out,
            height,
            radius: r2.sqrt(),
        })
    }
}

/// Torus near the points.
struct Torus {
    center: Point3,
    axis: Point3,
    major: f64,
    minor: f64,
}

impl Torus {
    /// Minimises the squared distances of the points; `None` if not all of them lie on the
    /// resulting torus to rounding.
    fn refined(mut self, points: &[Point3]) -> Option<Quadric> {
        // The start is accurate except for the last few digits.
        for _ in 0..4 {
            let tilts = orthonormal_complement(self.axis);
            let (rows, residuals) = self.residuals(points, tilts)?;
            let by = damped_least_squares(rows, &residuals, TORUS_PARAMETERS, 0.0)?;
            self.move_by(&by, tilts);
        }
        let (_, residuals) = self.residuals(points, orthonormal_complement(self.axis))?;
        let most = residuals.iter().fold(0.0f64, |m, r| m.max(r.abs()));
        // Rounding leaves up to this distance, in units of the patch's size, where control weights
        // differ much.
        let is_torus = most <= 5e-13 && self.major > 0.0 && self.minor > 0.0;
        is_torus.then_some(Quadric::Torus {
            center: self.center,
            axis: self.axis,
            major: self.major,
            minor: self.minor,
        })
    }

    /// Returns the derivatives of the distances of points by the centre, by tilts of the axis
    /// towards two vectors across it and by both radii, and the distances; `None` if a point lies
    /// on the axis or on the central circle.
    fn residuals(&self, points: &[Point3], tilts: [Point3; 2]) -> Option<(Vec<f64>, Vec<f64>)> {
        let mut rows = Vec::with_capacity(TORUS_PARAMETERS * points.len());
        let mut residuals = Vec::with_capacity(points.len());
        for p in points {
            let d = sub(*p, self.center);
            let height = dot(d, self.axis);
            let flat: Point3 = std::array::from_fn(|k| d[k] - height * self.axis[k]);
            let out = norm(flat);
            let tube = (out - self.major).hypot(height);
            if out == 0.0 || tube == 0.0 {
                return None;
            }
            let (c, s) = ((out - self.major) / tube, height / tube);
            rows.extend((0..3).map(|k| -(c * flat[k] / out + s * self.axis[k])));
            rows.extend(tilts.map(|t| (s - c * height / out) * dot(t, d)));
            rows.extend([-c, -1.0]);
            residuals.push(tube - self.minor);
        }
        Some((rows, residuals))
    }

    /// Subtracts a step.
    fn move_by(&mut self, by: &[f64], [x, y]: [Point3; 2]) {
        let axis = self.axis;
        let tilted: Point3 = std::array::from_fn(|k| axis[k] - by[3] * x[k] - by[4] * y[k]);
        self.axis = normalized(tilted);
        self.center = std::array::from_fn(|k| self.center[k] - by[k]);
        (self.major, self.minor) = (self.major - by[5], self.minor - by[6]);
    }
}
