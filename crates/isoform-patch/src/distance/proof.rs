//! Proof that no point of a patch is farther from the surface than a target.

use super::cell::Rounding;
use super::prover::Prover;
use super::sampling::largest_coordinate;
use crate::cells::{divided, middle_of};
use crate::compose::largest;
use crate::whole::Whole;
use isoform_control::Control;
use isoform_geom::{Field, RationalPatch};

/// Maximum number of cells of a proof on a single function: ten times what patches on smooth
/// surfaces take.
pub(crate) const MAX_PROOF_CELLS: usize = 60_000;
/// Maximum number of successive divisions of a patch into halves or quarters.
const MAX_SUBDIVISION_DEPTH: u32 = 24;

/// Returns a proved upper bound on the distance of all points of a patch from the surface; `None`
/// if no bound of at most `target` can be proved with at most `cells` cells.
pub fn prove(field: &dyn Field, patch: &RationalPatch, target: f64, cells: usize) -> Option<f64> {
    let effort = Effort {
        cells,
        control: Control::default(),
    };
    prove_on(&Whole::of_field(field), patch, target, effort)
}

/// Limits of the effort of a proof.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort<'a> {
    /// Maximum number of cells to be examined.
    pub(crate) cells: usize,
    /// Control that may stop the proof.
    pub(crate) control: Control<'a>,
}

impl Effort<'_> {
    /// Returns true if the effort is spent once `count` cells have been examined.
    pub(super) fn is_spent(&self, looked_at: usize) -> bool {
        looked_at > self.cells || self.control.is_stopped()
    }
}

/// Does what [`prove`] does, for a surface of parts.
pub(super) fn prove_on(
    whole: &Whole<'_>,
    patch: &RationalPatch,
    target: f64,
    effort: Effort<'_>,
) -> Option<f64> {
    proof(whole, patch, target, effort).ok()
}

/// Does what [`prove`] does, for a surface of parts; if the proof fails, returns the parameters of
/// a point in a cell that exceeded the limits.
pub(crate) fn proof(
    whole: &Whole<'_>,
    patch: &RationalPatch,
    target: f64,
    effort: Effort<'_>,
) -> Result<f64, (f64, f64)> {
    let prover = Prover::new(whole, patch.degree(), known(whole, patch, target));
    let mut pending = vec![(patch.clone(), [(0.0, 1.0); 2], 0u32)];
    let (mut worst, mut looked_at) = (0.0f64, 0);
    while let Some((cell, place, depth)) = pending.pop() {
        looked_at += 1;
        if effort.is_spent(looked_at) {
            return Err(middle_of(place));
        }
        match prover.bound(&cell, Rounding::of_part(patch, place), target) {
            Some(b) => worst = worst.max(b),
            None if depth == MAX_SUBDIVISION_DEPTH => return Err(middle_of(place)),
            None => {
                let halves = divided(&cell, place).into_iter();
                pending.extend(halves.map(|(c, place)| (c, place, depth + 1)));
            }
        }
    }
    Ok(worst)
}

/// Returns an upper bound on |F| over the patch from the composition F∘p; infinite if unknown.
fn known(whole: &Whole<'_>, patch: &RationalPatch, target: f64) -> f64 {
    // For larger targets, expansions suffice and cost less than the composition.
    let is_worth_it = whole.is_single() && target < 1e-5 * largest_coordinate(patch);
    let terms = is_worth_it.then(|| whole.field(0).terms()).flatten();
    let known = terms.and_then(|t| largest(&t, patch));
    known.unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    /// A proof to 10⁻⁷ takes millions of cells on a double curve: a deadline stops it.
    #[test]
    fn a_deadline_ends_a_proof() {
        let planes = isoform_field::Polynomial::new([([1, 1, 0], 1.0)]);
        let patch = RationalPatch::planar(
            (2, 2),
            [1e-10, -0.3, -0.3],
            [0.0, 0.6, 0.0],
            [0.0, 0.0, 0.6],
        );
        let start = Instant::now();
        let deadline = start + std::time::Duration::from_millis(50);
        let effort = Effort {
            cells: usize::MAX,
            control: Control::default().until(deadline),
        };
        assert_eq!(
            prove_on(&Whole::of_field(&planes), &patch, 1e-7, effort),
            None
        );
        let taken = start.elapsed().as_secs_f64();
        assert!((0.05..5.0).contains(&taken), "{taken}");
    }
}
