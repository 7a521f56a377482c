//! The torus that an exact patch lies on.
//!
//! Normals of a surface of revolution all meet its axis: n·(b + a × p) = 0 for the velocity b + a ×
//! p of the rotation about it (Pottmann and Wallner 2001, section 3.1), which is linear in a and b.
//! In the half-plane about the axis the meridian must then be a circle. Normals cost some digits,
//! which Gauss-Newton steps on the points' distances from the torus bring back.

use crate::least_squares::damped_least_squares;
use crate::null::null;
use isoform_geom::{Point3, Quadric, cross, dot, norm, sub};

/// Normals are exact to so much.
const NORMALS: f64 = 1e-10;
/// The patch is this near to the torus, in units of its own size: what is left of rounding where
/// control weights differ much.
const ON_TORUS: f64 = 5e-13;
/// Gauss-Newton steps; they start a few digits away from rounding.
const STEPS: usize = 4;

/// The torus through points with normals, in whose coordinates it is of size 1; none if there is
/// none or more than one.
pub(crate) fn torus(points: &[Point3], normals: &[Point3]) -> Option<Quadric> {
    let rows = points.iter().zip(normals).map(|(p, n)| {
        let m = cross(*p, *n);
        [n[0], n[1], n[2], m[0], m[1], m[2]]
    });
    let v = null(rows.collect(), NORMALS)?;
    let (b, a) = ([v[0], v[1], v[2]], [v[3], v[4], v[5]]);
    let a2 = dot(a, a);
    // A screw, or a translation.
    if a2 <= NORMALS || dot(a, b).abs() > NORMALS.sqrt() * a2 {
        return None;
    }
    let axis = a.map(|v| v / a2.sqrt());
    let foot = cross(a, b).map(|v| v / a2);
    let meridian = points.iter().map(|p| {
        let d = sub(*p, foot);
        let height = dot(d, axis);
        let out = norm(std::array::from_fn(|k| d[k] - height * axis[k]));
        [out * out + height * height, out, height, 1.0]
    });
    let c = null(meridian.collect(), NORMALS)?;
    let (out, height) = (-0.5 * c[1] / c[0], -0.5 * c[2] / c[0]);
    let r2 = out * out + height * height - c[3] / c[0];
    if !(out > 0.0 && r2 > 0.0) {
        return None;
    }
    let center = std::array::from_fn(|k| foot[k] + height * axis[k]);
    refined(points, center, axis, out, r2.sqrt())
}

/// The torus nearby with the least squared distances, if all points are on it to rounding.
fn refined(
    points: &[Point3],
    mut center: Point3,
    mut axis: Point3,
    mut major: f64,
    mut minor: f64,
) -> Option<Quadric> {
    for step in 0..=STEPS {
        let least = (0..3)
            .min_by(|&a, &b| axis[a].abs().total_cmp(&axis[b].abs()))
            .unwrap_or(0);
        let x = cross(
            axis,
            std::array::from_fn(|k| f64::from(u8::from(k == least))),
        );
        let x = x.map(|v| v / norm(x));
        let y = cross(axis, x);
        let (mut rows, mut residuals) = (
            Vec::with_capacity(7 * points.len()),
            Vec::with_capacity(points.len()),
        );
        for p in points {
            let d = sub(*p, center);
            let height = dot(d, axis);
            let flat: Point3 = std::array::from_fn(|k| d[k] - height * axis[k]);
            let out = norm(flat);
            let tube = (out - major).hypot(height);
            if out == 0.0 || tube == 0.0 {
                return None;
            }
            let (c, s) = ((out - major) / tube, height / tube);
            // Derivatives by the centre, by a tilt of the axis towards x and y, and by both radii.
            rows.extend((0..3).map(|k| -(c * flat[k] / out + s * axis[k])));
            rows.extend([x, y].map(|t| (s - c * height / out) * dot(t, d)));
            rows.extend([-c, -1.0]);
            residuals.push(tube - minor);
        }
        if step == STEPS {
            let most = residuals.iter().fold(0.0f64, |m, r| m.max(r.abs()));
            return (most <= ON_TORUS && major > 0.0 && minor > 0.0).then_some(Quadric::Torus {
                center,
                axis,
                major,
                minor,
            });
        }
        let by = damped_least_squares(rows, &residuals, 7, 0.0)?;
        let tilted: Point3 = std::array::from_fn(|k| axis[k] - by[3] * x[k] - by[4] * y[k]);
        axis = tilted.map(|v| v / norm(tilted));
        center = std::array::from_fn(|k| center[k] - by[k]);
        (major, minor) = (major - by[5], minor - by[6]);
    }
    None
}
