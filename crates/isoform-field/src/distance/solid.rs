//! Compiled solids: trees of minima and maxima over compiled pieces.

use crate::block::{LANES, Plan};
use crate::shape::Join;
use crate::tape::Tape;

/// Maximum number of points in a unit of work. More points fill blocks better, fewer keep the table
/// of their distances from all pieces in the cache.
const MAX_BATCH_POINTS: usize = 2048;
/// Maximum number of entries of that table, which bounds memory for solids with many pieces.
const MAX_TABLE_ENTRIES: usize = 1 << 17;

/// Compiled smooth piece.
#[derive(Clone, Debug)]
pub(super) struct CompiledPiece {
    /// Function g of the piece.
    pub(super) tape: Tape,
    /// Plan of ∇g.
    pub(super) by_space: Plan,
    /// Plan of the derivatives by coordinates and parameters.
    pub(super) by_all: Plan,
}

/// Compiled solid.
#[derive(Clone, Debug)]
pub(super) struct CompiledSolid {
    /// Pieces.
    pub(super) pieces: Vec<CompiledPiece>,
    /// Minima and maxima of the pieces, in the order of computation.
    pub(super) tree: Vec<Join>,
    /// Number of parameters.
    pub(super) n_params: usize,
}

impl CompiledSolid {
    /// Returns the tree's value if the pieces have the values `v`.
    pub(super) fn value(&self, stack: &mut Vec<f64>, v: impl Fn(u32) -> f64) -> f64 {
        self.fold(stack, v, f64::min, f64::max)
    }

    /// Returns the lanes, as bits, that are inside if each piece is positive in its lanes `leaves`.
    pub(super) fn is_inside(&self, stack: &mut Vec<u32>, leaves: &[u32]) -> u32 {
        self.fold(stack, |k| leaves[k as usize], |u, v| u & v, |u, v| u | v)
    }

    /// Evaluates the tree over leaves of any type.
    fn fold<T: Copy>(
        &self,
        stack: &mut Vec<T>,
        leaf: impl Fn(u32) -> T,
        min: impl Fn(T, T) -> T,
        max: impl Fn(T, T) -> T,
    ) -> T {
        stack.clear();
        for join in &self.tree {
            if let Join::Part(k) = join {
                stack.push(leaf(*k));
                continue;
            }
            let second = stack.pop().expect("a join has two inputs");
            let first = stack.pop().expect("a join has two inputs");
            stack.push(match join {
                Join::Min => min(first, second),
                _ => max(first, second),
            });
        }
        stack.pop().expect("a tree has a root")
    }

    /// Returns the number of points in a unit of work.
    pub(super) fn batch_points(&self) -> usize {
        (MAX_TABLE_ENTRIES / (4 * self.pieces.len().max(1))).clamp(LANES, MAX_BATCH_POINTS)
    }
}
