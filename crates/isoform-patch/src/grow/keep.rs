//! Shortening of a grown patch until its tolerance can be proved.

use super::Growth;
use crate::distance::{Effort, MAX_PROOF_CELLS, proof, sampled_on};
use crate::fold;
use crate::whole::NearSingular;

/// Limits of the attempts to prove a tolerance.
struct ProofLimits {
    /// Maximum number of cells of a proof.
    cells: usize,
    /// Maximum number of times that the patch is shortened.
    times: usize,
    /// Fraction by which it is shortened at each side.
    share: f64,
}

/// Limits on a single function. Proofs across self-intersections may need more cells; then the
/// patch ends before them.
const SMOOTH_LIMITS: ProofLimits = ProofLimits {
    cells: MAX_PROOF_CELLS,
    times: 12,
    share: 0.01,
};
/// Limits on a surface with parts, where further attempts rarely succeed.
const EDGE_LIMITS: ProofLimits = ProofLimits {
    cells: 8000,
    times: 3,
    share: 0.06,
};

impl Growth<'_> {
    /// Proves that the patch does not fold over; if that fails, returns the parameters of a place
    /// where it may.
    pub(crate) fn prove_unfolded(&self) -> Result<(), (f64, f64)> {
        fold::prove_none(self.on.field(), &self.patch, &self.control)
    }

    /// Shortens the patch until it is proved not to fold over and to keep the tolerance; returns
    /// the proved bound on its distance, `None` if that fails.
    pub(crate) fn keep_tolerance(&mut self) -> Option<f64> {
        let tolerance = self.options.tolerance?;
        let is_single = self.on.whole.is_single();
        let mut trying = self.trying();
        for _ in 0..trying.times {
            if self.is_over() {
                return None;
            }
            let left = match self.proved(tolerance, trying.cells) {
                Ok(bound) => return Some(bound),
                Err(Some(place)) if is_single => self.leave(place, trying.share),
                Err(_) => self.retreat(trying.share),
            };
            if !left {
                return None;
            }
            self.shortenings += 1;
            trying.cells = trying.cells.min(MAX_PROOF_CELLS / 3);
        }
        None
    }

    fn trying(&self) -> ProofLimits {
        let mut trying = if self.on.whole.is_single() {
            SMOOTH_LIMITS
        } else {
            EDGE_LIMITS
        };
        if matches!(self.on.near_singular, NearSingular::Try) {
            // A patch that may be near singular points is given up early: after twice the cells
            // that patches on smooth surfaces take.
            trying.cells = trying.cells.min(15_000);
            trying.times = 3;
        }
        trying
    }

    /// Returns a proved bound on the distance of a patch that does not fold over; if the proof
    /// fails, the parameters of a point in a difficult cell, `None` if no proof was tried.
    fn proved(&self, tolerance: f64, cells: usize) -> Result<f64, Option<(f64, f64)>> {
        let whole = self.on.whole;
        // Near edges a proof needs some room above the sampled distance.
        let is_hopeless =
            !whole.is_single() && sampled_on(whole, &self.patch, 33).0 > 0.7 * tolerance;
        if is_hopeless {
            return Err(None);
        }
        let effort = Effort {
            cells,
            control: self.control,
        };
        proof(whole, &self.patch, tolerance, effort)
            .and_then(|bound| self.prove_unfolded().map(|()| bound))
            .map_err(Some)
    }

    /// Shortens the patch by a fraction at each side, without Newton steps; returns false if the
    /// result has no targets.
    pub(crate) fn retreat(&mut self, share: f64) -> bool {
        // Sides on an edge stay near it.
        let little = 0.5 * self.overlap();
        let edges = self.edges();
        let shorter = self.longer(std::array::from_fn(|side| {
            if self.sides[side].is_at_edge() {
                -little / edges[side / 2]
            } else {
                -share
            }
        }));
        self.retake(shorter)
    }

    /// Shortens the patch by a fraction at each side, and one side further so that a point is
    /// removed: near a singular point nothing may be provable. Returns false if the result has no
    /// targets.
    pub(crate) fn leave(&mut self, (u, v): (f64, f64), share: f64) -> bool {
        let lost = [u, 1.0 - u, v, 1.0 - v];
        let side = (0..4)
            .min_by(|&a, &b| lost[a].total_cmp(&lost[b]))
            .unwrap_or(0);
        let shorter = self.longer(std::array::from_fn(|k| {
            if k == side { -lost[k] - share } else { -share }
        }));
        self.retake(shorter)
    }
}
