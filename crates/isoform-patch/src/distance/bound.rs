//! Proved bound of one cell: along a direction in which F increases, at a self-intersection, or by
//! a change of sign.

use super::cell::{PatchCell, Rounding};
use super::crossing::{changes_sign, crossing_bound};
use super::prover::Prover;
use super::smooth::smooth_bound;
use super::taylor::{Taylor, range};
use isoform_geom::RationalPatch;

impl Prover<'_> {
    /// Returns a bound on the distance of a cell from the surface; `None` if none of at most
    /// `target` is found.
    pub(super) fn bound(
        &self,
        patch: &RationalPatch,
        rounding: Rounding,
        target: f64,
    ) -> Option<f64> {
        let cell = PatchCell::new(patch, rounding)?;
        let serves = |b: &f64| b + cell.rounding <= target;
        let beyond = self.sought_beyond(&cell, target);
        if let Some(b) = smooth_bound(self, &cell, beyond).filter(serves) {
            return Some(b + cell.rounding);
        }
        // A bound at a self-intersection is about the root of distance times cell size; so it is
        // tried only on cells of at most four targets.
        let is_near = self.whole.is_single() && cell.reach() <= 4.0 * target;
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
    fn sought_beyond(&self, cell: &PatchCell, target: f64) -> f64 {
        let seems = 2.0 * self.whole.first_order(cell.c).0.abs();
        let beyond = (seems + 0.125 * cell.reach()).min(target);
        if beyond.is_nan() { target } else { beyond }
    }

    /// Returns √(2M/λ) if there is such a bound; the outer `None` means that F cannot be expanded.
    fn bound_at_crossing(&self, cell: &PatchCell, target: f64) -> Option<Option<f64>> {
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
    fn has_sign_change(&self, cell: &PatchCell, target: f64) -> bool {
        let reach = cell.reach();
        // At least 15 % of the target remain for the distance from c at which signs are sought.
        if reach > 0.85 * target {
            return false;
        }
        let near = cell.around(target);
        let can_expand = |k: &usize| self.whole.field(*k).expansion(cell.c, near).is_some();
        let is_provable = (self.whole.within(near)).is_some_and(|w| w.parts.iter().all(can_expand));
        let left = (target - reach - cell.rounding) * (1.0 - 1e-9);
        is_provable && changes_sign(self.whole, cell.c, left)
    }
}
