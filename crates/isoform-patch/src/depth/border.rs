//! The border of a patch as pieces that are nearly straight.

use crate::cells::halve_net;
use isoform_geom::{Point3, RationalPatch, distance_to_segment};

/// Pieces of a border are halved until they are this straight, in the depth asked for: less is
/// lost.
pub(super) const STRAIGHT: f64 = 0.01;
/// Halvings of a border, at most.
const MOST_HALVINGS: usize = 8;

/// A piece of a border: no point of it is farther than `off` from the line between two points.
#[derive(Clone, Copy, Debug)]
struct Piece {
    ends: [Point3; 2],
    off: f64,
}

impl Piece {
    /// A lower bound of its distance from a point.
    fn distance(&self, p: Point3) -> f64 {
        distance_to_segment(p, self.ends) - self.off
    }
}

/// The four borders of a patch with positive control weights.
#[derive(Clone, Debug)]
pub(crate) struct Border(Vec<Piece>);

impl Border {
    /// As pieces that are straight to a share of the depth.
    pub(crate) fn new(patch: &RationalPatch, depth: f64) -> Self {
        let (m, n) = patch.degree();
        let control = patch.control();
        let along_v = |i: usize| control[i * (n + 1)..][..n + 1].to_vec();
        let along_u = |j: usize| (0..=m).map(|i| control[i * (n + 1) + j]).collect();
        let mut pieces = Vec::new();
        for curve in [along_v(0), along_v(m), along_u(0), along_u(n)] {
            divide(curve, STRAIGHT * depth, 0, &mut pieces);
        }
        Self(pieces)
    }

    /// A lower bound of the distance of a point from the border.
    pub(crate) fn distance(&self, p: Point3) -> f64 {
        (self.0.iter()).fold(f64::INFINITY, |least, piece| least.min(piece.distance(p)))
    }
}

/// Adds a curve as pieces; its points lie in the hull of its control points.
fn divide(curve: Vec<[f64; 4]>, straight: f64, halvings: usize, pieces: &mut Vec<Piece>) {
    let points: Vec<Point3> = (curve.iter())
        .map(|c| [c[0] / c[3], c[1] / c[3], c[2] / c[3]])
        .collect();
    let ends = [points[0], points[points.len() - 1]];
    let off = (points.iter())
        .map(|p| distance_to_segment(*p, ends))
        .fold(0.0, f64::max);
    if off <= straight || halvings == MOST_HALVINGS {
        // Coordinates are rounded in each halving, and distances.
        let all = points.as_flattened().iter();
        let size = all.fold(0.0f64, |m, v| m.max(v.abs()));
        let off = off * (1.0 + 1e-9) + 1e-13 * size;
        pieces.push(Piece { ends, off });
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

    /// A rational curve's pieces are never farther than its points, and nearly as far.
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
