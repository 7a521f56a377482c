//! The part of a complex inside the solid: what cutting leaves and optimising begins with.

use crate::complex::Complex;
use isoform_geom::Point3;

/// The part of a complex inside the solid, with the faces on the surface labelled by piece.
pub(crate) struct Inside {
    pub(crate) complex: Complex,
    /// Vertices that must stay where they are.
    pub(crate) frozen: Vec<bool>,
    /// Old vertices to new ones.
    pub(crate) number: Vec<u32>,
    /// Vertices of faces on no single piece.
    pub(crate) stray: Vec<Point3>,
}
