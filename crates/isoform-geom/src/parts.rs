//! Surfaces as smooth parts: functions that are smooth in their ranges of use, and the tree that
//! joins them.

use crate::{Csg, Field};
use std::fmt;
use std::sync::Arc;

/// Smooth part of a surface.
#[derive(Clone)]
pub struct SmoothPart {
    /// Piece of the tree that the part belongs to.
    pub piece: u32,
    /// Function of the part, which is smooth also beyond the part.
    pub field: Arc<dyn Field>,
    /// Limits of the part: the piece has the function of this part at all points at which none of
    /// the limits is negative. At the zeros of the limits the parts of a piece join smoothly.
    pub limits: Vec<Arc<dyn Field>>,
    /// Index of the first part that seems to have an equal function, so that the surface continues
    /// smoothly from one to the other. Proofs must not rely on it: functions were compared at
    /// sample points only.
    pub function: usize,
}

impl fmt::Debug for SmoothPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SmoothPart")
            .field("piece", &self.piece)
            .field("limits", &self.limits.len())
            .finish_non_exhaustive()
    }
}

/// Surface whose function is composed of smooth ones: by minima and maxima at sharp edges, and of
/// parts that join smoothly.
///
/// The surface is the zero set of the tree's value. Only the sign of the value has a meaning:
/// pieces may be scaled by positive factors.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Tree of minima and maxima that joins the pieces.
    pub tree: Csg,
    /// Parts of all pieces. Parts of one piece have equal values at points within the limits of
    /// both.
    pub parts: Vec<SmoothPart>,
}
