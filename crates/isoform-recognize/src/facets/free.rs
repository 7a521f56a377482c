//! Facets that no surface has claimed yet.

use super::flat::Flats;
use super::mesh::Facets;
use super::part::FacetPart;
use crate::labels::UNLABELLED;

/// The mesh with its flat pieces and the parts found so far.
pub(crate) struct FreeFacets<'a> {
    pub(crate) mesh: &'a Facets,
    pub(crate) flats: &'a Flats,
    /// Part of each triangle.
    pub(crate) taken: &'a [u32],
    pub(crate) parts: &'a [FacetPart],
}

impl FreeFacets<'_> {
    /// Returns true if a triangle belongs to no part.
    pub(crate) fn is_free(&self, t: u32) -> bool {
        self.taken[t as usize] == UNLABELLED
    }
}
