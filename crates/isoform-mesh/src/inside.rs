//! Part of a complex inside the solid: the result of cutting, and the input of optimisation.

use crate::complex::Complex;
use isoform_geom::Point3;

/// Part of a complex inside the solid, with the faces on the surface labelled by piece.
pub(crate) struct Inside {
    pub(crate) complex: Complex,
    /// True for vertices that must not move.
    pub(crate) frozen: Vec<bool>,
    /// New index of each old vertex.
    pub(crate) number: Vec<u32>,
    /// Points on faces that do not lie on a single piece.
    pub(crate) stray: Vec<Point3>,
}
