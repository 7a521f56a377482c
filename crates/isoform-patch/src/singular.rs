//! Singular points of a surface: where F and ∇F vanish, as at nodes, along self-intersections and at
//! pinch points.

use isoform_geom::{Field, Point3, distance_squared, norm};
use isoform_num::linalg::symmetric_eigen;

/// Newton steps towards a singular point.
const STEPS: usize = 20;
/// Second derivatives along a direction below this share of the largest are none: along a curve of
/// singular points ∇F vanishes.
const FLAT: f64 = 1e-3;
/// ∇F is none below this share of second derivatives times the scale, F below its square.
const NONE: f64 = 1e-6;
/// The step along which distances are measured, in the distance asked for: points of the list are
/// so far apart.
const SPACING: f64 = 0.25;
/// Samples farther from singular points than this, in the distance asked for, by |∇F|/|H|, are not
/// looked at. Where curvatures differ that may be off by as much.
const REACH: f64 = 4.0;

/// Singular points near samples of the surface, none within a quarter of `apart` of another; all
/// samples within `apart` of singular points have one of these at little more than that, and what is
/// left out about these is told by them.
pub(crate) fn points(field: &dyn Field, samples: &[Point3], apart: f64, scale: f64) -> Vec<Point3> {
    let mut found: Vec<Point3> = Vec::new();
    let least = (SPACING * apart).powi(2);
    for p in samples {
        let Some(s) = near(field, *p, apart, scale) else {
            continue;
        };
        if found.iter().all(|f| distance_squared(*f, s) > least) {
            found.push(s);
        }
    }
    found
}

/// The singular point that Newton's method for ∇F = 0 leads to with the least steps, if that is
/// near.
fn near(field: &dyn Field, from: Point3, apart: f64, scale: f64) -> Option<Point3> {
    let mut p = from;
    for _ in 0..STEPS {
        let j = field.jet(p);
        let h: Vec<f64> = (0..9).map(|k| j.second(k / 3, k % 3)).collect();
        let size = norm([
            norm([h[0], h[1], h[2]]),
            norm([h[3], h[4], h[5]]),
            norm([h[6], h[7], h[8]]),
        ]);
        let slope = norm(j.g);
        if !(size > 0.0 && size.is_finite()) || slope > REACH * apart * size {
            return None;
        }
        if slope <= NONE * size * scale {
            let is_on = j.v.abs() <= NONE * NONE * size * scale * scale;
            return (is_on && distance_squared(p, from) <= (2.0 * apart).powi(2)).then_some(p);
        }
        let (values, vectors) = symmetric_eigen(&h, 3);
        let most = values[0].abs().max(values[2].abs());
        for k in 0..3 {
            if values[k].abs() > FLAT * most {
                let v = &vectors[3 * k..3 * k + 3];
                let along: f64 = (0..3).map(|i| v[i] * j.g[i]).sum::<f64>() / values[k];
                for i in 0..3 {
                    p[i] -= along * v[i];
                }
            }
        }
        if !p.iter().all(|v| v.is_finite()) {
            return None;
        }
    }
    None
}
