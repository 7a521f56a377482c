//! The bound of one cell: by a direction along which F grows, at a self-intersection, or by a
//! change of sign.

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

/// How far a cell's points may be off by the rounding of subdivision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rounding {
    /// Levels of de Casteljau's algorithm that led to the cell.
    levels: f64,
    /// The largest of |X|, |Y| and |Z| of the control points of the whole patch (x, y and z
    /// multiplied by the weight), and the largest of their weights.
    size: (f64, f64),
}

impl Rounding {
    /// That of a part of a patch.
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

    /// A bound on it for points whose coordinates are at most `largest` and whose weights are at
    /// least `least`: x = X/w is off by (ΔX + |x| Δw)/w.
    fn of_points(&self, largest: f64, least: f64) -> f64 {
        SUBDIVISION * self.levels * (self.size.0 + largest * self.size.1) / least * (1.0 + 1e-9)
    }
}

/// A cell of a patch.
pub(super) struct Cell {
    /// A point about its middle.
    pub(super) c: Point3,
    /// Its control points less c times their weights: δ and the weight, homogeneous.
    pub(super) d: Vec<[f64; 4]>,
    /// No coordinate differs from that of c by more.
    pub(super) r: Point3,
    /// How far its points may be off.
    pub(super) rounding: f64,
}

impl Cell {
    /// None where a control weight is not positive.
    fn new(patch: &RationalPatch, rounding: Rounding) -> Option<Self> {
        let (least, _) = patch.control_weights();
        if least <= 0.0 {
            return None;
        }
        let c = patch.point(0.5, 0.5);
        // δ over the cell lies within these; c need not be exact.
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

    /// The box that reaches `by` beyond the cell.
    pub(super) fn around(&self, by: f64) -> Aabb {
        let (c, r) = (self.c, self.r);
        Aabb {
            lo: std::array::from_fn(|k| c[k] - r[k] - by),
            hi: std::array::from_fn(|k| c[k] + r[k] + by),
        }
    }

    /// No point of it is farther from c.
    fn reach(&self) -> f64 {
        norm(self.r)
    }
}

/// Proves bounds of cells.
pub(super) struct Prover<'w> {
    pub(super) whole: &'w Whole<'w>,
    pub(super) products: Products,
    /// A bound on |F| over the whole patch, of a single function F; infinite if none is known.
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

    /// A bound on the distance of a cell from the surface, if one of at most `target` is found.
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

    /// How far beyond a cell the surface is sought: as far as it seems to be, not as far as it may
    /// be.
    fn sought_beyond(&self, cell: &Cell, target: f64) -> f64 {
        let seems = 2.0 * self.whole.first_order(cell.c).0.abs();
        let beyond = (seems + 0.125 * cell.reach()).min(target);
        if beyond.is_nan() { target } else { beyond }
    }

    /// √(2M/λ), if there is such a bound; none at all where F cannot be expanded.
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

    /// Whether F changes its sign near a cell that is small against the target, if the functions
    /// are such of which something can be proved.
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
