//! Refinement of a proved bound: the cells with the largest bounds are divided first.

use super::cell::Rounding;
use super::proof::Effort;
use super::prover::Prover;
use crate::cells::{ParameterBox, lengths, middle_of, parts};
use crate::whole::Whole;
use isoform_geom::RationalPatch;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Cell with its proved bound. The greatest in the order has the largest bound; of equal bounds,
/// the one that was made first.
struct BoundedCell {
    bound: f64,
    number: usize,
    cell: RationalPatch,
    place: ParameterBox,
    depth: u32,
}

impl Ord for BoundedCell {
    fn cmp(&self, other: &Self) -> Ordering {
        self.bound
            .total_cmp(&other.bound)
            .then(other.number.cmp(&self.number))
    }
}
impl PartialOrd for BoundedCell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for BoundedCell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for BoundedCell {}

/// Divides the cells with the largest bounds until all are at most `goal` or the effort is spent.
/// Returns the bound and, if it exceeds the goal, the parameters of the centre of the worst cell.
pub(super) fn refined(
    whole: &Whole<'_>,
    patch: &RationalPatch,
    proved: f64,
    goal: f64,
    effort: Effort<'_>,
) -> (f64, Option<(f64, f64)>) {
    let mut work = Refinement {
        prover: Prover::new(whole, patch.degree(), f64::INFINITY),
        patch,
        goal,
        looked_at: 0,
    };
    let root = work.bounded(patch.clone(), [(0.0, 1.0); 2], 0, proved);
    let mut all = BinaryHeap::from([root]);
    while let Some(worst) = all.pop() {
        let is_over = effort.is_spent(work.looked_at + 1);
        // At most 40 halvings, each in one direction.
        if worst.bound <= goal || worst.depth == 40 || is_over {
            let at = middle_of(worst.place);
            return (worst.bound, (worst.bound > goal).then_some(at));
        }
        all.extend(work.halves(&worst));
    }
    (proved, None)
}

struct Refinement<'a> {
    prover: Prover<'a>,
    patch: &'a RationalPatch,
    goal: f64,
    looked_at: usize,
}

impl Refinement<'_> {
    /// Returns a cell with the best bound that can be proved for it; `known` is a valid one.
    fn bounded(
        &mut self,
        cell: RationalPatch,
        place: ParameterBox,
        depth: u32,
        known: f64,
    ) -> BoundedCell {
        self.looked_at += 1;
        let rounding = Rounding::of_part(self.patch, place);
        let of = |target: f64| self.prover.bound(&cell, rounding, target);
        let proved = of(self.goal).or_else(|| of(known));
        BoundedCell {
            bound: proved.map_or(known, |b| b.min(known)),
            number: self.looked_at,
            cell,
            place,
            depth,
        }
    }

    /// Returns the halves of a cell in the direction that lowers the bounds more: along an edge
    /// cells may stay long.
    fn halves(&mut self, cell: &BoundedCell) -> Vec<BoundedCell> {
        let (in_u, in_v) = (self.halved(cell, true), self.halved(cell, false));
        let (sum_u, sum_v) = (self.sum(&in_u), self.sum(&in_v));
        let (along_u, along_v) = lengths(&cell.cell);
        // Edges oblique to the parameter lines gain a little from ever narrower cells, and much
        // from shorter ones later: so the longer direction is halved if both lower the bounds
        // nearly equally, or if the cell is very narrow.
        let alike = sum_u.max(sum_v) <= 1.2 * sum_u.min(sum_v)
            || along_u.max(along_v) > 200.0 * along_u.min(along_v);
        let is_in_u = if alike {
            along_u >= along_v
        } else {
            sum_u < sum_v
        };
        if is_in_u { in_u } else { in_v }
    }

    fn halved(&mut self, of: &BoundedCell, in_u: bool) -> Vec<BoundedCell> {
        let halves = parts(&of.cell, of.place, in_u, !in_u).into_iter();
        halves
            .map(|(cell, place)| self.bounded(cell, place, of.depth + 1, of.bound))
            .collect()
    }

    /// Returns the sum of bounds, each counted as at least the goal.
    fn sum(&self, cells: &[BoundedCell]) -> f64 {
        cells
            .iter()
            .fold(0.0, |sum, h| sum + h.bound.max(self.goal))
    }
}
