//! Extrapolation: a patch extended or shortened at its sides by evaluating its own polynomials.

use super::course::MAX_LOAD_AFTER_EXTRAPOLATION;
use super::{Growth, SideState};
use crate::objective::Evaluated;
use isoform_geom::RationalPatch;

/// Goal of an extrapolation.
struct ExtrapolationGoal {
    /// Roots of the present l₁ and l₂.
    present: [f64; 2],
    /// Roots of l₁ and l₂ that are aimed at.
    edges: [f64; 2],
    /// True for the sides that move.
    moves: [bool; 4],
}

impl Growth<'_> {
    /// Extrapolates (or shortens) at the sides that lie in the region until √l₁ and √l₂ are the
    /// given edges, by less if the result is not a start for Newton's method. Returns false if nothing
    /// is gained.
    pub(super) fn extrapolate(&mut self, edges: [f64; 2]) -> bool {
        let present = self.edges();
        let aim = ExtrapolationGoal {
            present,
            edges,
            moves: self.moves(edges, present),
        };
        let moving = |side: usize| u8::from(aim.moves[side]);
        let sides = [0, 2].map(|first| f64::from(moving(first) + moving(first + 1)));
        if sides == [0.0; 2] {
            return false;
        }
        let shares = [0, 1].map(|k| {
            if sides[k] > 0.0 {
                self.in_range((edges[k] / present[k] - 1.0) / sides[k])
            } else {
                0.0
            }
        });
        let shares = self.corrected(&aim, shares);
        self.try_shares(&aim, shares)
    }

    /// Returns the sides that move: those that are free and in the region, and those of a direction
    /// in which the patch becomes shorter.
    fn moves(&self, edges: [f64; 2], present: [f64; 2]) -> [bool; 4] {
        let inside = self.sides_inside(&self.patch);
        std::array::from_fn(|side| {
            let is_free = matches!(self.sides[side], SideState::Free);
            (inside[side] && is_free)
                || (edges[side / 2] < present[side / 2] && !self.sides[side].is_at_edge())
        })
    }

    /// Clamps the fraction of an edge by which a side may move.
    fn in_range(&self, share: f64) -> f64 {
        share.clamp(-0.2, self.pace.most_at_side)
    }

    /// Returns the fraction by which each side moves, limited so that the patch avoids singular
    /// points.
    fn by(&self, aim: &ExtrapolationGoal, shares: [f64; 2]) -> [f64; 4] {
        let avoided = self.on.near_singular.avoided();
        std::array::from_fn(|side| {
            let share = shares[side / 2];
            match (aim.moves[side], avoided) {
                (false, _) => 0.0,
                (true, Some(avoided)) if share > 0.0 => avoided.within(&self.patch, side, share),
                (true, _) => share,
            }
        })
    }

    /// Computes fractions with which the extrapolated patch has the target edges, by secant steps.
    fn corrected(&self, aim: &ExtrapolationGoal, mut shares: [f64; 2]) -> [f64; 2] {
        for _ in 0..4 {
            let longer = self.longer(self.by(aim, shares));
            let Some(reached) = self.objective.lengths(&longer) else {
                break;
            };
            for (k, l) in [reached.0, reached.1].into_iter().enumerate() {
                let present = aim.present[k];
                let factor = (aim.edges[k] - present) / (l.sqrt() - present);
                // Larger corrections are discarded.
                if factor > 0.1 && factor < 10.0 {
                    shares[k] = self.in_range(shares[k] * factor);
                }
            }
        }
        shares
    }

    /// Takes the patch extrapolated by fractions of its edges, halved until it is a start for
    /// Newton's method; returns true if there is one.
    fn try_shares(&mut self, aim: &ExtrapolationGoal, mut shares: [f64; 2]) -> bool {
        // A patch that is longer by this factor has come near a pole; on a plane its distance would
        // not show that.
        let max_ratio = 2.5;
        for _ in 0..6 {
            let before = self.sides;
            let patch = self.extrapolated(self.by(aim, shares));
            if let Some((targets, at)) = self.retargeted(&patch)
                && (shares.iter().all(|s| *s < 0.0) || self.is_fair(&at))
                && targets.l1.sqrt() <= max_ratio * aim.present[0]
                && targets.l2.sqrt() <= max_ratio * aim.present[1]
            {
                self.take(patch, targets, at);
                return true;
            }
            self.set_sides(before);
            shares = shares.map(|s| 0.5 * s);
        }
        false
    }

    /// Extends the patch at its sides, which may meet edges then.
    fn extrapolated(&mut self, by: [f64; 4]) -> RationalPatch {
        if self.on.whole.is_single() {
            return self.longer(by);
        }
        let (patch, sides) = self.within_edges(self.on, by, self.overlap());
        self.set_sides(sides);
        patch
    }

    /// Returns true if an extrapolated patch is a start for Newton's method.
    fn is_fair(&self, at: &Evaluated) -> bool {
        match self.options.tolerance {
            Some(t) => at.terms.i.sqrt() <= MAX_LOAD_AFTER_EXTRAPOLATION * t,
            None => self.objective.sum(&at.terms) <= MAX_LOAD_AFTER_EXTRAPOLATION * self.limit(),
        }
    }
}
