//! Boxes and lengths out of Python.

use crate::error::Trouble;
use isoform::geom::{Aabb, Point3};

/// A box as Python gives it: its lower and its upper corner.
pub(crate) type Corners = (Point3, Point3);

/// A box, which must hold something.
pub(crate) fn region(corners: Corners) -> Result<Aabb, Trouble> {
    let (lo, hi) = corners;
    if (0..3).all(|k| lo[k] < hi[k] && lo[k].is_finite() && hi[k].is_finite()) {
        return Ok(Aabb { lo, hi });
    }
    let message = format!("box is from {lo:?} to {hi:?}: there is nothing in it");
    Err(Trouble::usage(message).hint("half its width, or its lower and its upper corner"))
}

/// A box that may be given.
pub(crate) fn some_region(corners: Option<Corners>) -> Result<Option<Aabb>, Trouble> {
    corners.map(region).transpose()
}

/// A length that may be given: positive.
pub(crate) fn length(name: &str, length: Option<f64>) -> Result<Option<f64>, Trouble> {
    match length {
        Some(v) if !(v > 0.0 && v.is_finite()) => Err(Trouble::usage(format!(
            "{name} is {v}: a positive number is expected"
        ))),
        length => Ok(length),
    }
}
