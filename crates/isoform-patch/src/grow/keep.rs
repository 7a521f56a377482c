//! Shortening of a grown patch until its tolerance can be proved.

use super::Growth;
use crate::distance::{Effort, proof, sampled_on};
use crate::fold;
use crate::whole::NearSingular;

/// Limits of the attempts to prove a tolerance.
struct Trying {
    /// Maximum number of cells of a proof.
    cells: usize,
    /// Maximum number of times that the patch is shortened.
    times: usize,
    /// Fraction by which it is shortened at each side.
    share: f64,
}

/// Limits on a single function: ten times the cells that patches on smooth surfaces take. Across
/// self-intersections there may be more; then the patch ends before them.
const SMOOTH: Trying = Trying {
    cells: 60_000,
    times: 12,
    share: 0.01,
};
/// Limits on a surface with parts, where further attempts rarely succeed.
const AT_EDGES: Trying = Trying {
    cells: 8000,
    times: 3,
    share: 0.06,
};
/// Cells and times where a patch is soon given up if it may be near singular points: twice what
/// patches on smooth surfaces take.
const TRIAL_CELLS: usize = 15_000;
const TRIALS: usize = 3;
/// After the first proof that fails, the most cells of another one.
const LATER_CELLS: usize = SMOOTH.cells / 3;
/// Samples of the distance in each direction before it is proved, on a surface with parts.
const PROVED_SAMPLES: usize = 33;
/// The share of the tolerance above which a sampled distance on a surface with parts is not worth a
/// proof: near edges proofs need some room.
const HOPELESS: f64 = 0.7;

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
            trying.cells = trying.cells.min(LATER_CELLS);
        }
        None
    }

    fn trying(&self) -> Trying {
        let mut trying = if self.on.whole.is_single() {
            SMOOTH
        } else {
            AT_EDGES
        };
        if matches!(self.on.near_singular, NearSingular::Try) {
            trying.cells = trying.cells.min(TRIAL_CELLS);
            trying.times = TRIALS;
        }
        trying
    }

    /// Returns a proved bound on the distance of a patch that does not fold over; if the proof
    /// fails, the parameters of a point in a difficult cell, `None` if no proof was tried.
    fn proved(&self, tolerance: f64, cells: usize) -> Result<f64, Option<(f64, f64)>> {
        let whole = self.on.whole;
        let is_hopeless = !whole.is_single()
            && sampled_on(whole, &self.patch, PROVED_SAMPLES).0 > HOPELESS * tolerance;
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
