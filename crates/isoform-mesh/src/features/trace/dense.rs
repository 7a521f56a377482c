//! Densification of a curve, until chords are close enough to it.

use super::aligned_with;
use crate::features::context::FeatureContext;
use crate::features::newton::{normalised, onto_two, unit};
use isoform_geom::{Point3, cross, dot, norm, sub};

/// A point of a curve with a unit tangent.
#[derive(Clone, Copy)]
struct TangentPoint {
    p: Point3,
    t: Point3,
}

impl FeatureContext<'_> {
    /// Adds points to a curve until chords meet the chordal tolerance. Returns the points with the
    /// minimum and maximum angle between the pieces' normals.
    pub(super) fn dense(&self, points: &[Point3], pair: [u32; 2]) -> (Vec<Point3>, [f64; 2]) {
        let mut angles = [f64::INFINITY, 0.0];
        let tangents: Vec<TangentPoint> = (0..points.len())
            .map(|k| {
                let (t, angle) = self.tangent(points[k], way(points, k), pair);
                if let Some(angle) = angle {
                    angles = [angles[0].min(angle), angles[1].max(angle)];
                }
                TangentPoint { p: points[k], t }
            })
            .collect();
        let mut out = vec![points[0]];
        for w in tangents.windows(2) {
            let length = norm(sub(w[1].p, w[0].p));
            let parts = self.parts(w[0], w[1]);
            for m in 1..parts {
                let x = hermite(w[0], w[1], length, m as f64 / parts as f64);
                // The cubic is much closer to the curve.
                if let Some((x, _)) = onto_two(self.solid, pair, x, 0.1 * length) {
                    out.push(x);
                }
            }
            out.push(w[1].p);
        }
        (out, angles)
    }

    /// Returns the unit tangent of a curve along `way`, and the angle between its pieces' normals.
    fn tangent(&self, p: Point3, way: Point3, pair: [u32; 2]) -> (Point3, Option<f64>) {
        let [a, b] = pair.map(|k| normalised(self.solid, k, p));
        let (Some(a), Some(b)) = (a, b) else {
            return (unit(way), None);
        };
        let t = cross(a.n, b.n);
        let sine = norm(t);
        let angle = Some(sine.atan2(dot(a.n, b.n)));
        let t = aligned_with(unit(t), way);
        // The cross product of the normals is a good tangent, and agrees with the chord.
        if sine > 1e-3 && dot(t, unit(way)) > 0.9 {
            (t, angle)
        } else {
            (unit(way), angle)
        }
    }

    /// Returns the number of parts into which a chord is divided: an arc of length l that turns by
    /// θ has the sagitta l θ/8, one of n parts of it l θ/8n²; and no part is longer than half the
    /// size.
    fn parts(&self, a: TangentPoint, b: TangentPoint) -> usize {
        let tolerance = self.options.chord * self.size();
        let length = norm(sub(b.p, a.p));
        let turn = norm(cross(a.t, b.t)).atan2(dot(a.t, b.t));
        (length * turn / (8.0 * tolerance))
            .sqrt()
            .max(2.0 * length / self.size() * (1.0 - 1e-9))
            .ceil()
            .clamp(1.0, 256.0) as usize
    }
}

/// Returns the vector from the previous to the next point of point `k` of a curve, which is closed
/// if its last point repeats the first.
fn way(points: &[Point3], k: usize) -> Point3 {
    let n = points.len();
    let is_end = k == 0 || k == n - 1;
    if is_end && points[0] == points[n - 1] {
        return sub(points[1], points[n - 2]);
    }
    sub(points[(k + 1).min(n - 1)], points[k.saturating_sub(1)])
}

/// Evaluates the cubic with these ends, tangents and chord length.
fn hermite(from: TangentPoint, to: TangentPoint, length: f64, s: f64) -> Point3 {
    let (TangentPoint { p, t: u }, TangentPoint { p: q, t: v }) = (from, to);
    let (s2, s3) = (s * s, s * s * s);
    let (a, b, c, d) = (
        2.0 * s3 - 3.0 * s2 + 1.0,
        s3 - 2.0 * s2 + s,
        3.0 * s2 - 2.0 * s3,
        s3 - s2,
    );
    std::array::from_fn(|i| a * p[i] + b * length * u[i] + c * q[i] + d * length * v[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_of_open_and_closed_curves() {
        let open = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0]];
        assert_eq!(way(&open, 0), [1.0, 0.0, 0.0]);
        assert_eq!(way(&open, 1), [1.0, 2.0, 0.0]);
        assert_eq!(way(&open, 2), [0.0, 2.0, 0.0]);
        let closed = [open[0], open[1], open[2], open[0]];
        assert_eq!(way(&closed, 0), way(&closed, 3));
        assert_eq!(way(&closed, 0), [0.0, -2.0, 0.0]);
    }

    #[test]
    fn the_cubic_of_a_straight_line_is_straight() {
        let t = [0.6, 0.8, 0.0];
        let (from, to) = (
            TangentPoint { p: [0.0; 3], t },
            TangentPoint {
                p: [3.0, 4.0, 0.0],
                t,
            },
        );
        let x = hermite(from, to, 5.0, 0.25);
        assert!(norm(sub(x, [0.75, 1.0, 0.0])) < 1e-15);
    }
}
