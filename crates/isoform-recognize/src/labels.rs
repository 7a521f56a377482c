//! Labels of points and of facets.

/// Label of a point or facet without an entity; as an index, no triangle, cluster or part.
pub(crate) const UNLABELLED: u32 = u32::MAX;
/// Cost of a point all of whose neighbours have other labels: that of 3 standard deviations. A
/// larger cost smooths borders of small faces away, a smaller one lets crossing planes cut strips
/// out of walls.
pub(crate) const ISOLATION_COST: f64 = 4.5;
