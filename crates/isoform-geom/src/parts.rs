//! Surfaces as smooth parts: functions that are smooth wherever they are used, and the tree that
//! joins them.

use crate::{Csg, Field};
use std::fmt;
use std::sync::Arc;

/// A smooth part of a surface.
#[derive(Clone)]
pub struct SmoothPart {
    /// The piece of the tree that the part belongs to.
    pub piece: u32,
    /// The function of the part, which is smooth beyond the part, too.
    pub field: Arc<dyn Field>,
    /// Where none of these is negative, the piece has the function of this part. At the zeros of the
    /// limits the parts of a piece join smoothly.
    pub limits: Vec<Arc<dyn Field>>,
    /// The first part that seems to have the same function, so that the surface goes on smoothly
    /// from one to the other. No proof may rely on it: functions have been compared at some places
    /// only.
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

/// A surface whose function is joined from smooth ones: by minima and maxima at sharp edges, and
/// from parts that join smoothly.
///
/// The surface is where the tree's value vanishes; its sign, not its value, is what counts, so that
/// pieces may be scaled.
#[derive(Clone, Debug)]
pub struct Parts {
    /// How the pieces are joined.
    pub tree: Csg,
    /// The parts of all pieces. Where several parts of a piece are within their limits, they have
    /// one value.
    pub parts: Vec<SmoothPart>,
}
