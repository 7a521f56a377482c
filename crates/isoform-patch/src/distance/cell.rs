//! Proved bound of one cell: along a direction in which F increases, at a self-intersection, or by
//! a change of sign.

use super::crossing::{changes_sign, crossing_bound};
use super::products::Products;
use super::smooth::smooth_bound;
use super::taylor::{Taylor, range};
use crate::cells::Place;
use crate::whole::Whole;
use isoform_geom::{Aabb, Point3, RationalPatch, norm};

/// The error of one level of de Casteljau's algorithm, in the largest homogeneous coordinate of the
/// whole patch: half a unit in the last place of each of three coordinates, as 1.8 > √3.
const SUBDIVISION: f64 = 0.5 * 1.8 * f64::EPSILON;
/// Levels that stand for all other roundings of a cell's points.
const OTHER_LEVELS: f64 = 16.0;
/// The largest cell, in targets, for which a bound is tried at self-intersections: it is about the
/// root of the distance times the size of the cell.
const CROSSING: f64 = 4.0;
/// The largest cell, in targets, on which a change of sign is sought. The rest is the distance at
/// which it is found.
const SMALL: f64 = 0.85;

/// Bound on the rounding error of a cell's points, which comes from subdivision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rounding {
    /// Levels of de Casteljau's algorithm that led to the cell.
    levels: f64,
    /// Largest of |X|, |Y| and |Z| of the control points of the whole patch (x, y and z multiplied
    /// by the weight), and largest of their weights.
    size: (f64, f64),
}

impl Rounding {
    /// Returns the error data of a part of a patch.
    pub(super) fn of_part(patch: &RationalPatch, place: Place) -> Self {
        let (m, n) = patch.degree();
        let halvings = |(a, b): (f64, f64)| -(b - a).log2();
        let size = patch.control().iter().fold((0.0f64, 0.0f64), |(x, w), c| {
            (
                x.max(c[0].abs()).max(c[1].abs()).max(c[2].abs()),
                w.max(c[3].abs()),
            )
        });
        Self {
            levels: OTHER_LEVELS + m as f64 * halvings(place[0]) + n as f64 * halvings(place[1]),
            size,
        }
    }

    /// Returns a bound on the error of points whose coordinates are at most `largest` and whose
    /// weights are at least `least`: x = X/w is off by (ΔX + |x| Δw)/w.
    fn of_points(&self, largest: f64, least: f64) -> f64 {
        SUBDIVISION * self.levels * (self.size.0 + largest * self.size.1) / least * (1.0 + 1e-9)
    }
}

/// Cell of a patch, in homogeneous coordinates relative to a point c.
pub(super) struct Cell {
    /// Point near the centre of the cell.
    pub(super) c: Point3,
    /// Control points less c times their weights: δ and the weight, homogeneous.
    pub(super) d: Vec<[f64; 4]>,
    /// Bounds on the differences of its coordinates from those of c.
    pub(super) r: Point3,
    /// Bound on the rounding error of its points.
    pub(super) rounding: f64,
}

impl Cell {
    /// Prepares a cell; `None` if a control weight is not positive.
    fn new(patch: &RationalPatch, rounding: Rounding) -> Option<Self> {
        let (least, _) = patch.control_weights();
        if least <= 0.0 {
            return None;
        }
        let c = patch.point(0.5, 0.5);
        // δ over the cell lies in the hull of these; c need not be exact.
        let about = |p: &[f64; 4]| {
            let x = |k: usize| p[k] - c[k] * p[3];
            [x(0), x(1), x(2), p[3]]
        };
        let d: Vec<[f64; 4]> = patch.control().iter().map(about).collect();
        let mut r = [0.0f64; 3];
        let mut largest = 0.0f64;
        for p in &d {
            for k in 0..3 {
                r[k] = r[k].max((p[k] / p[3]).abs() * (1.0 + 1e-12));
                largest = largest.max(c[k].abs() + r[k]);
            }
        }
        let rounding = rounding.of_points(largest, least);
        Some(Self { c, d, r, rounding })
    }

    /// Returns a box that extends by `by` beyond the cell.
    pub(super) fn around(&self, by: f64) -> Aabb {
        let (c, r) = (self.c, self.r);
        Aabb {
            lo: std::array::from_fn(|k| c[k] - r[k] - by),
            hi: std::array::from_fn(|k| c[k] + r[k] + by),
        }
    }

    /// Returns an upper bound on the distance of its points from c.
    fn reach(&self) -> f64 {
        norm(self.r)
    }
}

/// Prover of bounds for cells.
pub(super) struct Prover<'w> {
    pub(super) whole: &'w Whole<'w>,
    pub(super) products: Products,
    /// Upper bound on |F| over the whole patch, for a single function F; infinite if unknown.
    pub(super) known: f64,
}

impl<'w> Prover<'w> {
    pub(super) fn new(whole: &'w Whole<'w>, degree: (usize, usize), known: f64) -> Self {
        Self {
            whole,
            products: Products::new(degree),
            known,
        }
    }

    /// Returns a bound on the distance of a cell from the surface; `None` if none of at most
    /// `target` is found.
    pub(super) fn bound(
        &self,
        patch: &RationalPatch,
        rounding: Rounding,
        target: f64,
    ) -> Option<f64> {
        let cell = Cell::new(patch, rounding)?;
        let serves = |b: &f64| b + cell.rounding <= target;
        let beyond = self.sought_beyond(&cell, target);
        if let Some(b) = smooth_bound(self, &cell, beyond).filter(serves) {
            return Some(b + cell.rounding);
        }
        let is_near = self.whole.is_single() && cell.reach() <= CROSSING * target;
        if self.known.is_finite() || is_near {
            let bound = self.bound_at_crossing(&cell, target)?;
            if let Some(b) = bound.filter(serves) {
                return Some(b + cell.rounding);
            }
        }
        self.has_sign_change(&cell, target).then_some(target)
    }

    /// Returns the distance beyond a cell in which the surface is sought: an estimate from F/|∇F|,
    /// at most the target.
    fn sought_beyond(&self, cell: &Cell, target: f64) -> f64 {
        let seems = 2.0 * self.whole.first_order(cell.c).0.abs();
        let beyond = (seems + 0.125 * cell.reach()).min(target);
        if beyond.is_nan() { target } else { beyond }
    }

    /// Returns √(2M/λ) if there is such a bound; the outer `None` means that F cannot be expanded.
    fn bound_at_crossing(&self, cell: &Cell, target: f64) -> Option<Option<f64>> {
        let e = self.whole.field(0).expansion(cell.c, cell.around(target))?;
        let (lo, hi) = range(&Taylor::new(&e, cell.r), cell, &self.products);
        let most = if lo <= hi {
            self.known.min(hi.max(-lo))
        } else {
            self.known
        };
        Some(crossing_bound(&e, cell.r.map(|v| v + target), most))
    }

    /// Returns true if F provably changes its sign near a cell that is small compared with the
    /// target.
    fn has_sign_change(&self, cell: &Cell, target: f64) -> bool {
        let reach = cell.reach();
        if reach > SMALL * target {
            return false;
        }
        let near = cell.around(target);
        let can_expand = |k: &usize| self.whole.field(*k).expansion(cell.c, near).is_some();
        let is_provable = (self.whole.within(near)).is_some_and(|w| w.parts.iter().all(can_expand));
        let left = (target - reach - cell.rounding) * (1.0 - 1e-9);
        is_provable && changes_sign(self.whole, cell.c, left)
    }
}
