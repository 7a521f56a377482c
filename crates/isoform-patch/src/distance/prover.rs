//! Data shared by the proofs for all cells of a patch.

use super::products::Products;
use crate::whole::Whole;

/// Prover of bounds for the cells of a patch.
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
}
