//! Distances from a solid and its pieces, by their functions.

use crate::locus::{Distance, outward};
use isoform_geom::{Point3, Solid};

/// A piece of a solid with all of its functions.
pub(crate) struct SolidPiece<'a> {
    pub(crate) solid: &'a dyn Solid,
    pub(crate) piece: u32,
}

impl Distance for SolidPiece<'_> {
    fn distance(&self, p: Point3) -> (f64, Point3) {
        let (value, gradient) = self.solid.gradient(self.piece, p);
        outward(value, gradient)
    }
}

/// Returns the piece of a solid with a name; the first one if no piece has it.
pub(crate) fn piece_named(solid: &dyn Solid, name: &str) -> u32 {
    solid.names().iter().position(|n| n == name).unwrap_or(0) as u32
}

/// The boundary of a solid: at each point the piece that determines the value there.
pub(crate) struct Boundary<'a>(pub(crate) &'a dyn Solid);

impl Distance for Boundary<'_> {
    /// Returns the distance and normal; a piece without a gradient, such as a cone at its apex,
    /// counts as vanishing.
    fn distance(&self, p: Point3) -> (f64, Point3) {
        let solid = self.0;
        let of = |piece| SolidPiece { solid, piece }.distance(p);
        let inward = |piece| {
            let off = of(piece).0;
            if off.is_finite() { -off } else { 0.0 }
        };
        let (off, piece) = solid.tree().value_and_piece(&inward);
        (-off, of(piece).1)
    }
}
