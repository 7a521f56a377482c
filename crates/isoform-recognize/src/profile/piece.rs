//! Pieces of profiles, and what they cost in a description.

use super::curve::{CurveFamily, ProfileCurve};
use crate::chart::PrimitiveKind;
use crate::cost::Cost;

/// Prices of pieces in a description.
pub(crate) struct Price<'a> {
    pub(super) noise: f64,
    pub(super) cost: Cost,
    pub(super) shapes: &'a [(CurveFamily, PrimitiveKind)],
    pub(super) is_proper: &'a dyn Fn(PrimitiveKind, &ProfileCurve) -> bool,
}

impl<'a> Price<'a> {
    /// Builds the prices of pieces of these shapes and kinds that are proper, through points with
    /// the given noise.
    pub(crate) fn new(
        noise: f64,
        shapes: &'a [(CurveFamily, PrimitiveKind)],
        is_proper: &'a dyn Fn(PrimitiveKind, &ProfileCurve) -> bool,
    ) -> Self {
        Self {
            noise,
            cost: Cost::with_noise(noise),
            shapes,
            is_proper,
        }
    }

    /// Returns the cost of a point at a distance from its piece.
    pub(crate) fn of_distance(&self, r: f64) -> f64 {
        self.cost.of_point(r)
    }

    /// Returns the cost of each parameter of a piece through `count` points.
    pub(crate) fn of_number(&self, count: usize) -> f64 {
        // Among the many stretches that are tried, a shape with an additional parameter follows
        // some better by chance: each parameter costs three nats more than its digits.
        (count.max(1) as f64).ln() / 2.0 + 3.0
    }

    /// Returns the kind of surface that an arc may be the section of.
    pub(crate) fn kind_of_arc(&self, curve: &ProfileCurve) -> Option<PrimitiveKind> {
        let is_arc = |(shape, kind): &&(CurveFamily, PrimitiveKind)| {
            matches!(shape, CurveFamily::Circle) && (self.is_proper)(*kind, curve)
        };
        let (_, kind) = self.shapes.iter().find(is_arc)?;
        curve.is_wider_than(self.noise).then_some(*kind)
    }
}

/// A piece, with the kind of surface that it is the section of, and its points.
#[derive(Debug)]
pub(crate) struct ProfilePiece {
    pub(crate) kind: PrimitiveKind,
    pub(crate) curve: ProfileCurve,
    pub(crate) points: Vec<u32>,
}
