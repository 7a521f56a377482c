//! Distances of points from a surface f = 0.

use isoform_geom::{Point3, dot, norm, sub};

/// Statistics of distances, in the unit of the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distances {
    /// Root mean square.
    pub rms: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Maximum.
    pub max: f64,
}

impl Distances {
    /// Returns the statistics of distances, of which there is at least one.
    pub(crate) fn from_values(mut all: Vec<f64>) -> Self {
        let squares: f64 = all.iter().map(|d| d * d).sum();
        let rms = (squares / all.len() as f64).sqrt();
        let at = (all.len() * 95 / 100).min(all.len() - 1);
        let p95 = *all.select_nth_unstable_by(at, f64::total_cmp).1;
        Self {
            rms,
            p95,
            max: all.iter().copied().fold(0.0, f64::max),
        }
    }
}

/// Number of iterations towards the foot of a point. The first is Newton's step of f along its
/// gradient; convergence is quadratic, and three bring a point within a cell to a thousandth of its
/// distance.
const FOOT_STEPS: usize = 3;

/// Returns the distance of a point from f = 0, where `jet` evaluates f and its gradient: the
/// distance to the iterate closest to the surface plus |f|/|∇f| there. A step is at most `reach`
/// long.
pub(crate) fn distance(jet: impl Fn(Point3) -> (f64, Point3), p: Point3, reach: f64) -> f64 {
    let mut y = p;
    let mut nearest = (f64::INFINITY, f64::INFINITY);
    for _ in 0..=FOOT_STEPS {
        let (f, g) = jet(y);
        let squared = dot(g, g).max(f64::MIN_POSITIVE);
        let (off, left) = (sub(y, p), f.abs() / squared.sqrt());
        if left < nearest.0 {
            nearest = (left, norm(off) + left);
        }
        // The point of the tangent plane that is nearest to p.
        let along = (dot(g, off) - f) / squared;
        let way: Point3 = std::array::from_fn(|k| p[k] + along * g[k] - y[k]);
        let length = norm(way);
        if !length.is_finite() {
            break;
        }
        let share = if length > reach { reach / length } else { 1.0 };
        for k in 0..3 {
            y[k] += share * way[k];
        }
    }
    nearest.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_from_a_quadratic_sphere_are_true() {
        // One step from r = 1.2 is off by 0.017.
        let sphere = |p: Point3| (1.0 - dot(p, p), p.map(|v| -2.0 * v));
        for r in [0.8, 0.95, 1.0, 1.2] {
            let p = [0.6 * r, 0.0, 0.8 * r];
            let want: f64 = f64::abs(1.0 - r);
            assert!(
                (distance(sphere, p, 1.0) - want).abs() < 1e-4 * want.max(1e-9),
                "{r}"
            );
        }
        let flat = |_: Point3| (1.0, [0.0; 3]);
        assert!(distance(flat, [0.0; 3], 1.0) > 1.0);
    }
}
