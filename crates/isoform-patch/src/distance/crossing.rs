//! Self-intersections: a bound from second derivatives of both signs, and changes of sign.

use super::taylor::{magnitude, middle, radius};
use crate::whole::Whole;
use isoform_geom::{Expansion, Point3, norm, sub};
use isoform_num::Interval;
use isoform_num::linalg::symmetric_eigen;

/// Returns √(2M/λ) with M = `most`, if second derivatives have both signs with absolute values of
/// at least λ within `wide` of the point of expansion.
pub(super) fn crossing_bound(e: &Expansion, wide: Point3, most: f64) -> Option<f64> {
    let h: [f64; 6] = std::array::from_fn(|k| middle(&e.hessian[k]));
    let (values, vectors) =
        symmetric_eigen(&[h[0], h[1], h[2], h[1], h[3], h[4], h[2], h[4], h[5]], 3);
    let size: f64 = h.iter().map(|v| v.abs()).sum();
    // Lower bound of |eᵀHe| for the k-th eigenvector e.
    let least = |k: usize| {
        let n = std::array::from_fn(|i| vectors[3 * k + i].abs());
        // Rounding of the eigenvectors changes an eigenvalue by less than fifty units in the last
        // place of |H|.
        values[k].abs() * (1.0 - 1e-12) - lost_along(e, n, wide, 1e-14 * size)
    };
    let lambda = least(0).min(least(2));
    if values[0] >= 0.0 || values[2] <= 0.0 || lambda.is_nan() || lambda <= 0.0 {
        return None;
    }
    Some((2.0 * most / lambda).sqrt() * (1.0 + 1e-12))
}

/// Returns the amount by which third derivatives, radii of intervals and rounding may reduce
/// |nᵀHn|.
fn lost_along(e: &Expansion, n: Point3, wide: Point3, rounding: f64) -> f64 {
    let t: [f64; 10] = std::array::from_fn(|k| magnitude(&e.third[k]));
    let mut lost = rounding;
    for i in 0..3 {
        for j in 0..3 {
            let along = |l: usize| t[Expansion::THIRD[i][j][l]] * wide[l];
            lost += n[i]
                * n[j]
                * (radius(&e.hessian[Expansion::SECOND[i][j]]) + (0..3).map(along).sum::<f64>());
        }
    }
    lost
}

/// Directions in which a change of sign is sought, of length at most 1.
const DIRECTIONS: [[f64; 3]; 13] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.7, 0.7],
    [0.0, 0.7, -0.7],
    [0.7, 0.0, 0.7],
    [0.7, 0.0, -0.7],
    [0.7, 0.7, 0.0],
    [0.7, -0.7, 0.0],
    [0.57, 0.57, 0.57],
    [0.57, 0.57, -0.57],
    [0.57, -0.57, 0.57],
    [-0.57, 0.57, 0.57],
];

/// Proved signs of F found so far.
struct Signs<'w> {
    whole: &'w Whole<'w>,
    positive: bool,
    negative: bool,
}

impl Signs<'_> {
    /// Determines the sign at a point; returns true if both signs have been found.
    fn see(&mut self, p: Point3) -> bool {
        let range: Interval = self.whole.range_at(p);
        let sign = i32::from(range.lo() > 0.0) - i32::from(range.hi() < 0.0);
        self.positive |= sign > 0;
        self.negative |= sign < 0;
        self.positive && self.negative
    }

    /// Determines signs around a point, at the distance t or slightly less; returns true if both
    /// signs have been found.
    fn see_around(&mut self, q: Point3, t: f64) -> bool {
        let places = DIRECTIONS.iter().flat_map(|d| {
            let at = move |s: f64| std::array::from_fn(|k| q[k] + s * d[k]);
            [at(-t), at(t)]
        });
        places.into_iter().any(|p| self.see(p))
    }
}

/// Returns true if F provably vanishes within t of c: it has both signs in that ball, which is
/// connected. Points around c are tried, and points around the end of a Newton iteration from c, as
/// the sectors between two crossing sheets may be narrow.
pub(super) fn changes_sign(whole: &Whole<'_>, c: Point3, t: f64) -> bool {
    let mut signs = Signs {
        whole,
        positive: false,
        negative: false,
    };
    signs.see(c);
    if t <= 0.0 {
        return false;
    }
    if signs.see_around(c, t) {
        return true;
    }
    let q = foot(whole, c);
    let left = t - norm(sub(q, c));
    left > 0.1 * t && signs.see_around(q, 0.99 * left)
}

/// Returns the end of a Newton iteration with the function that decides the sign.
fn foot(whole: &Whole<'_>, from: Point3) -> Point3 {
    let mut q = from;
    for _ in 0..8 {
        let j = whole.field(whole.first_order(q).1).jet(q);
        let step = j.v / j.g.iter().map(|g| g * g).sum::<f64>();
        if !step.is_finite() {
            break;
        }
        for k in 0..3 {
            q[k] -= step * j.g[k];
        }
    }
    q
}
