//! B-splines as Bézier curves between their knots.

use super::ControlPoint;
use isoform_algebra::RBig;

/// The Bézier points of a B-spline between knot k and the next: the i-th is the polar form at p − i
/// times the one and i times the other.
pub(super) fn segment(
    p: usize,
    knots: &[RBig],
    points: &[ControlPoint],
    k: usize,
) -> Vec<ControlPoint> {
    let at = |i: usize| {
        let mut d: Vec<ControlPoint> = points[k - p..=k].to_vec();
        for r in 1..=p {
            let x = if r <= p - i { &knots[k] } else { &knots[k + 1] };
            // d[j] belongs to point k − p + j.
            for j in (r..=p).rev() {
                let (lo, hi) = (&knots[k - p + j], &knots[k + j - r + 1]);
                let share = (x - lo) / (hi - lo);
                d[j] = std::array::from_fn(|c| {
                    &d[j - 1][c] * (RBig::ONE - &share) + &d[j][c] * &share
                });
            }
        }
        d.swap_remove(p)
    };
    (0..=p).map(at).collect()
}
