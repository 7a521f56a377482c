//! Border of a patch as pieces that are nearly straight.

use crate::cells::halve_net;
use isoform_geom::{Point3, RationalPatch, distance_to_segment};

/// Maximum deviation of border pieces from a straight line, as a fraction of the depth: depths are
/// underestimated by up to this fraction.
pub(super) const MAX_BORDER_DEVIATION: f64 = 0.01;

/// Piece of a border: no point of it is farther than `off` from the segment between its ends.
#[derive(Clone, Copy, Debug)]
struct BorderPiece {
    ends: [Point3; 2],
    off: f64,
}

impl BorderPiece {
    /// Returns a lower bound of its distance from a point.
    fn distance(&self, p: Point3) -> f64 {
        distance_to_segment(p, self.ends) - self.off
    }
}

/// Border curves of a patch with positive control weights.
#[derive(Clone, Debug)]
pub(crate) struct Border(Vec<BorderPiece>);

impl Border {
    /// Divides the border into pieces that are straight to a fraction of the depth.
    pub(crate) fn new(patch: &RationalPatch, depth: f64) -> Self {
        let (m, n) = patch.degree();
        let control = patch.control();
        let along_v = |i: usize| control[i * (n + 1)..][..n + 1].to_vec();
        let along_u = |j: usize| (0..=m).map(|i| control[i * (n + 1) + j]).collect();
        let mut pieces = Vec::new();
        for curve in [along_v(0), along_v(m), along_u(0), along_u(n)] {
            divide(curve, MAX_BORDER_DEVIATION * depth, 0, &mut pieces);
        }
        Self(pieces)
    }

    /// Returns a lower bound of the distance of a point from the border.
    pub(crate) fn distance(&self, p: Point3) -> f64 {
        (self.0.iter()).fold(f64::INFINITY, |least, piece| least.min(piece.distance(p)))
    }
}

/// Divides a curve into pieces; the curve lies in the convex hull of its control points.
fn divide(curve: Vec<[f64; 4]>, straight: f64, halvings: usize, pieces: &mut Vec<BorderPiece>) {
    let points: Vec<Point3> = (curve.iter())
        .map(|c| [c[0] / c[3], c[1] / c[3], c[2] / c[3]])
        .collect();
    let ends = [points[0], points[points.len() - 1]];
    let off = (points.iter())
        .map(|p| distance_to_segment(*p, ends))
        .fold(0.0, f64::max);
    // At most eight halvings: 256 pieces.
    if off <= straight || halvings == 8 {
        // The margin covers the rounding of coordinates in the halvings and of distances.
        let all = points.as_flattened().iter();
        let size = all.fold(0.0f64, |m, v| m.max(v.abs()));
        let off = off * (1.0 + 1e-9) + 1e-13 * size;
        pieces.push(BorderPiece { ends, off });
        return;
    }
    let mean = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|k| 0.5 * (a[k] + b[k]));
    for upper in [false, true] {
        let mut half = curve.clone();
        halve_net(&mut half, (0, curve.len() - 1), false, upper, mean);
        divide(half, straight, halvings + 1, pieces);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::{norm, sub};

    /// The bound for a rational curve never exceeds the distance of its points, and nearly attains
    /// it.
    #[test]
    fn pieces_of_a_border_are_as_far_as_its_points() {
        let control = (0..16).map(|i| {
            let (a, w) = (f64::from(i), 1.0 + 0.4 * f64::from(i * 7).sin());
            [(a * 1.3).sin() * w, (a * 0.7).cos() * w, 0.1 * a * w, w]
        });
        let patch = RationalPatch::new((3, 3), control.collect()).expect("a patch");
        let border = Border::new(&patch, 0.1);
        for k in 0..40 {
            let p: Point3 = std::array::from_fn(|i| f64::from(k * 3 + i as i32).sin());
            let nearest = (0..=2000)
                .map(|i| f64::from(i) / 2000.0)
                .flat_map(|t| [(t, 0.0), (t, 1.0), (0.0, t), (1.0, t)])
                .map(|(u, v)| norm(sub(patch.point(u, v), p)))
                .fold(f64::INFINITY, f64::min);
            let bound = border.distance(p);
            assert!(
                bound <= nearest && nearest - bound < 4e-3,
                "{bound} {nearest}"
            );
        }
    }
}
