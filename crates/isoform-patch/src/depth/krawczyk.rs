//! Proof that lines meet a patch, by Krawczyk's operator.

use isoform_geom::{Aabb, Point3, RationalPatch, cross, dot, sub};
use isoform_num::{Interval, Real};

/// Returns a part of a patch, around given parameters, that every line along n through a point of a
/// cell provably meets; `None` if Krawczyk's operator does not prove it.
pub(super) fn across(
    patch: &RationalPatch,
    cell: &Aabb,
    n: Point3,
    (u, v): (f64, f64),
) -> Option<RationalPatch> {
    let c = cell.center();
    let t = patch.tangents(u, v);
    // Rows that map a vector, projected along n, to its coefficients in the basis of the tangents.
    let volume = dot(n, cross(t.u, t.v));
    if volume == 0.0 {
        return None;
    }
    let rows = [cross(t.v, n), cross(n, t.u)].map(|row| row.map(|x| x / volume));
    let half = cell.size().map(|s| 0.5 * s * (1.0 + 1e-12));
    let off = sub(t.point, c);
    // Bound on |A⁻¹(p − q)| at the known point for all q of the cell.
    let first = rows.map(|row| {
        let wide: f64 = (0..3).map(|k| row[k].abs() * half[k]).sum();
        dot(row, off).abs() + wide
    });
    // W extends 1.5 times as far from the known point as a linear patch would need.
    let [du, dv] = first.map(|f| 1.5 * f);
    let ranges = [(u - du, u + du), (v - dv, v + dv)];
    if !(ranges.iter()).all(|r| r.0 >= 0.0 && r.1 <= 1.0 && r.0 < r.1) {
        return None;
    }
    let part = patch.part(ranges[0], ranges[1]);
    let slopes = slopes_of(&part, t.point, rows)?;
    is_contraction(first, [du, dv], slopes).then_some(part)
}

/// Returns true if |A⁻¹(p − q)| + |1 − A⁻¹p′| ≤ 1 for parameters scaled to −1 to 1 around the known
/// point.
fn is_contraction(first: [f64; 2], reach: [f64; 2], slopes: [[Interval; 2]; 2]) -> bool {
    (0..2).all(|k| {
        let mut sum = first[k] / reach[k];
        for l in 0..2 {
            // The part has parameters from 0 to 1: its derivatives are twice those of parameters
            // from −1 to 1.
            let share = Interval::constant(0.5 / reach[k]) * slopes[k][l];
            let unit = if k == l { 1.0 } else { 0.0 };
            sum += (share.hi() - unit).max(unit - share.lo());
        }
        // The margin is ten thousand times the rounding error of the sum on the smallest useful
        // cells.
        sum <= 1.0 - 1e-6
    })
}

/// Returns ranges of the derivatives by u and v (inner index) of the products of a patch with two
/// vectors; `c` is a point near the patch. `None` if a control weight is not positive.
fn slopes_of(patch: &RationalPatch, c: Point3, rows: [Point3; 2]) -> Option<[[Interval; 2]; 2]> {
    let (least, most) = patch.control_weights();
    if least <= 0.0 {
        return None;
    }
    let (degree, control) = (patch.degree(), patch.control());
    let weight = Interval::new(least, most);
    let weights: Vec<f64> = control.iter().map(|p| p[3]).collect();
    let by_weight = [true, false].map(|in_u| derivative(&weights, degree, in_u));
    Some(rows.map(|row| {
        let values: Vec<f64> = (control.iter())
            .map(|p| (0..3).map(|k| row[k] * (p[k] - c[k] * p[3])).sum())
            .collect();
        let quotients = values.iter().zip(&weights).map(|(v, w)| v / w);
        // (X/w)′ = (X′ − (X/w) w′)/w.
        let quotient = hull(quotients);
        [true, false].map(|in_u| {
            let by_weight = by_weight[usize::from(!in_u)];
            (derivative(&values, degree, in_u) - quotient * by_weight) / weight
        })
    }))
}

/// Returns the range of the derivative by u or v of a polynomial of degree (m, n), from the
/// differences of its Bernstein coefficients.
fn derivative(values: &[f64], (m, n): (usize, usize), in_u: bool) -> Interval {
    let (by, factor) = if in_u {
        ((1, 0), m as f64)
    } else {
        ((0, 1), n as f64)
    };
    let at = |i: usize, j: usize| values[i * (n + 1) + j];
    let pairs = (0..=m - by.0).flat_map(|i| (0..=n - by.1).map(move |j| (i, j)));
    hull(pairs.map(|(i, j)| factor * (at(i + by.0, j + by.1) - at(i, j))))
}

/// Returns the smallest interval that contains the given numbers.
fn hull(all: impl Iterator<Item = f64>) -> Interval {
    let (lo, hi) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
        (lo.min(v), hi.max(v))
    });
    Interval::new(lo, hi)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x′ falls from 3 to 0 at u = 0.34, where the patch turns back: a small cell is proved to be
    /// met, a larger one that comes near the fold is not.
    #[test]
    fn cells_near_a_fold_are_not_known_to_be_met() {
        let row = |x: f64| [0.0, 0.5, 1.0].map(|y| [x, y, 0.0, 1.0]);
        let control = [0.0, 1.0, -0.2, 0.8].map(row).concat();
        let patch = RationalPatch::new((3, 2), control).expect("a patch");
        let c = patch.point(0.15, 0.5);
        let met = |half: f64| {
            let cell = Aabb {
                lo: [c[0] - half, c[1] - 0.01, -0.01],
                hi: [c[0] + half, c[1] + 0.01, 0.01],
            };
            across(&patch, &cell, [0.0, 0.0, 1.0], (0.15, 0.5)).is_some()
        };
        assert!(met(0.02));
        assert!(!met(0.12));
    }

    fn square(x: (f64, f64), y: (f64, f64)) -> RationalPatch {
        let (a, b) = (x.1 - x.0, y.1 - y.0);
        RationalPatch::planar((3, 2), [x.0, y.0, 1e-6], [a, 0.0, 0.0], [0.0, b, 0.0])
    }

    /// Every line through a cell inside the patch meets it; beyond its border no proof is found.
    #[test]
    fn lines_are_met_where_the_operator_says_so() {
        let patch = square((-0.5, 0.5), (-0.5, 0.5));
        let cell = |c: Point3, r: f64| Aabb {
            lo: c.map(|v| v - r),
            hi: c.map(|v| v + r),
        };
        let n = [0.0, 0.0, 1.0];
        let part = across(&patch, &cell([0.1, 0.1, 0.0], 0.01), n, (0.6, 0.6)).expect("met");
        let region = part.control_box().expect("a box");
        assert!(region.lo[0] < 0.09 && region.hi[0] > 0.11);
        // Too near the border, and around a point that is too far away.
        assert!(across(&patch, &cell([0.49, 0.1, 0.0], 0.01), n, (0.99, 0.6)).is_none());
        assert!(across(&patch, &cell([0.1, 0.1, 0.0], 0.01), n, (0.2, 0.6)).is_none());
    }
}
