//! F around a point as a Taylor polynomial with a remainder, its range on a cell, and limits of
//! parts as linear functions.

use super::cell::PatchCell;
use super::products::Products;
use isoform_geom::{Expansion, Point3};
use isoform_num::Interval;

/// Index of ∂²F/∂xᵢ∂xⱼ among the six second derivatives.
const AT: [[usize; 3]; 3] = Expansion::SECOND;

/// Returns the midpoint of an interval.
#[inline]
pub(super) fn middle(i: &Interval) -> f64 {
    0.5 * i.lo() + 0.5 * i.hi()
}
/// Returns the largest |x − midpoint| of an interval, rounded up.
#[inline]
pub(super) fn radius(i: &Interval) -> f64 {
    let m = middle(i);
    (i.hi() - m).max(m - i.lo()).next_up()
}
/// Returns the largest |x| of an interval.
#[inline]
pub(super) fn magnitude(i: &Interval) -> f64 {
    i.lo().abs().max(i.hi().abs())
}

/// Returns ∇F at the point of expansion.
#[inline]
pub(super) fn slopes(e: &Expansion) -> Point3 {
    std::array::from_fn(|k| middle(&e.gradient[k]))
}

/// Returns Σ t_ijk r_i r_j r_k over all i, j, k; with `n`, Σ t_ijk n_i r_j r_k.
pub(super) fn cubic(t: &[f64; 10], r: Point3, n: Option<Point3>) -> f64 {
    let first = n.unwrap_or(r);
    let mut sum = 0.0;
    for i in 0..3 {
        for j in 0..3 {
            for k in 0..3 {
                let f = first[i] * r[j] * r[k];
                // The product 0 · ∞ counts as 0.
                if f > 0.0 {
                    sum += t[Expansion::THIRD[i][j][k]] * f;
                }
            }
        }
    }
    sum
}

/// Taylor polynomial of order 2 or 3 of F around c, with a bound on its error on a cell.
#[derive(Clone, Copy)]
pub(super) struct Taylor {
    value: f64,
    g: Point3,
    h: [f64; 6],
    /// Third derivatives; 0 for order 2.
    third: [f64; 10],
    off: f64,
}

impl Taylor {
    /// Expands F to order 3 if its third derivatives are bounded, with their midpoints on the cell:
    /// the deviation from those decreases with the fourth power of the cell's size. Expands it to
    /// order 2 otherwise.
    pub(super) fn new(e: &Expansion, r: Point3) -> Self {
        let third: [f64; 10] = std::array::from_fn(|k| middle(&e.third[k]));
        if third.iter().all(|t| t.is_finite()) {
            let differ = std::array::from_fn(|k| radius(&e.third[k]));
            Self::up_to(e, r, third, &differ)
        } else {
            Self::square(e, r)
        }
    }

    /// Expands F to order 2.
    fn square(e: &Expansion, r: Point3) -> Self {
        let t = std::array::from_fn(|k| magnitude(&e.third[k]));
        Self::up_to(e, r, [0.0; 10], &t)
    }

    /// Expands F with the third derivatives `third`, from which the true ones deviate by at most t.
    fn up_to(e: &Expansion, r: Point3, third: [f64; 10], t: &[f64; 10]) -> Self {
        let mut off = radius(&e.value) + cubic(t, r, None) / 6.0;
        for i in 0..3 {
            off += radius(&e.gradient[i]) * r[i];
            for j in 0..3 {
                off += 0.5 * radius(&e.hessian[AT[i][j]]) * r[i] * r[j];
            }
        }
        Self {
            value: middle(&e.value),
            g: slopes(e),
            h: std::array::from_fn(|k| middle(&e.hessian[k])),
            third,
            off,
        }
    }

    /// Returns F + b (m − λ)(λ + ρ). Where the limit is not negative, the added term is at least 0
    /// for b ≥ 0 and at most 0 for b ≤ 0.
    pub(super) fn bent(&self, l: &PartLimit, b: f64, r: Point3) -> Self {
        let (above, below) = (l.most - l.value, l.value + l.off);
        let slope = b * (above - below);
        let size = (0..3).map(|k| l.g[k].abs() * r[k]).sum::<f64>();
        let mut h = self.h;
        for i in 0..3 {
            for j in i..3 {
                h[AT[i][j]] -= 2.0 * b * l.g[i] * l.g[j];
            }
        }
        let rounding = 16.0
            * f64::EPSILON
            * b.abs()
            * (l.most.abs() + l.value.abs() + size)
            * (l.value.abs() + l.off + size);
        Self {
            value: self.value + b * above * below,
            g: std::array::from_fn(|k| self.g[k] + slope * l.g[k]),
            h,
            third: self.third,
            off: self.off + rounding,
        }
    }

    /// Returns the factors of (w δ, w) in w³ times the polynomial, for a control point p = (w δ,
    /// w): in the first three columns T wδ/6, which is multiplied by wδ twice, in the last (H w
    /// δ/2, F(c) w + ∇F·w δ).
    #[inline]
    fn factors(&self, p: &[f64; 4]) -> [[f64; 4]; 4] {
        let (g, h) = (self.g, |i: usize, j: usize| self.h[AT[i][j]]);
        let third = |i: usize, j: usize, k: usize| self.third[Expansion::THIRD[i][j][k]];
        let h = |k: usize| 0.5 * (h(k, 0) * p[0] + h(k, 1) * p[1] + h(k, 2) * p[2]);
        let t = |i: usize, k: usize| {
            (third(i, k, 0) * p[0] + third(i, k, 1) * p[1] + third(i, k, 2) * p[2]) / 6.0
        };
        let constant = self.value * p[3] + g[0] * p[0] + g[1] * p[1] + g[2] * p[2];
        [
            [t(0, 0), t(1, 0), t(2, 0), h(0)],
            [t(0, 1), t(1, 1), t(2, 1), h(1)],
            [t(0, 2), t(1, 2), t(2, 2), h(2)],
            [0.0, 0.0, 0.0, constant],
        ]
    }

    /// Returns an upper bound on the sum of the absolute values of all terms for |δ| ≤ r.
    fn size(&self, r: Point3) -> f64 {
        let (g, h) = (self.g, |i: usize, j: usize| self.h[AT[i][j]]);
        let second = |k: usize| (0..3).map(|j| h(k, j).abs() * r[k] * r[j]).sum::<f64>();
        self.value.abs()
            + (0..3)
                .map(|k| g[k].abs() * r[k] + 0.5 * second(k))
                .sum::<f64>()
            + cubic(&self.third.map(f64::abs), r, None) / 6.0
    }
}

/// Returns bounds of F on a cell: the least and the largest quotient of the Bernstein coefficients
/// of w³ F by those of w³, widened by the remainder and by rounding.
pub(super) fn range(taylor: &Taylor, cell: &PatchCell, products: &Products) -> (f64, f64) {
    let rights: Vec<[[f64; 4]; 4]> = cell.d.iter().map(|p| taylor.factors(p)).collect();
    let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
    for [q, w3] in products.triple(&cell.d, &rights) {
        (lo, hi) = (lo.min(q / w3), hi.max(q / w3));
    }
    let most = products.roundings() * f64::EPSILON * taylor.size(cell.r) + taylor.off;
    (lo - most, hi + most)
}

/// Limit of a part on a cell: where the part is valid, the linear function λ = value + g·δ is at
/// least −off.
pub(super) struct PartLimit {
    value: f64,
    g: Point3,
    off: f64,
    /// Upper bound of λ on the cell; negative if the part is nowhere valid there.
    pub(super) most: f64,
}

impl PartLimit {
    /// Expands a limit; `None` if it is not finite.
    pub(super) fn new(e: &Expansion, cell: &PatchCell) -> Option<Self> {
        let taylor = Taylor::square(e, cell.r);
        let (g, r) = (taylor.g, cell.r);
        let mut off = taylor.off;
        for i in 0..3 {
            off += g[i].abs() * (cell.rounding + 4.0 * f64::EPSILON * r[i]);
            for j in 0..3 {
                off += 0.5 * taylor.h[AT[i][j]].abs() * r[i] * r[j];
            }
        }
        let off = (off + 4.0 * f64::EPSILON * taylor.value.abs()) * (1.0 + 1e-12);
        // A linear function is largest at a control point.
        let along = cell
            .d
            .iter()
            .map(|p| (g[0] * p[0] + g[1] * p[1] + g[2] * p[2]) / p[3])
            .fold(f64::NEG_INFINITY, f64::max);
        let most = taylor.value + along + off;
        (off.is_finite() && most.is_finite()).then_some(Self {
            value: taylor.value,
            g,
            off,
            most,
        })
    }

    /// Returns the difference of the second derivatives of a part and its neighbour across the
    /// limit, as a multiple of the limit's square. With F bent by it, the values of the part's
    /// function where it is not valid do not widen the range.
    pub(super) fn bend(&self, own: &Expansion, other: &Expansion) -> f64 {
        let n = slopes(own);
        let nn = n.iter().map(|v| v * v).sum::<f64>();
        let across = (0..3).map(|k| n[k] * self.g[k]).sum::<f64>() / nn;
        let t: Point3 = std::array::from_fn(|k| self.g[k] - across * n[k]);
        let slope = (0..3).map(|k| t[k] * self.g[k]).sum::<f64>();
        let mut difference = 0.0;
        for i in 0..3 {
            for j in 0..3 {
                let second = |e: &Expansion| middle(&e.hessian[AT[i][j]]);
                difference += t[i] * (second(own) - second(other)) * t[j];
            }
        }
        let bend = 0.5 * difference / (slope * slope);
        if bend.is_finite() { bend } else { 0.0 }
    }
}
