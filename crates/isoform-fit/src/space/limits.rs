//! Bounds of parameters, and ranges of starts, from the caller, the template and the data's box.

use crate::{FitError, Kind, Parameter};
use isoform_geom::Aabb;
use std::f64::consts::PI;

/// Factor by which the box of coordinates is larger than the data's, about its centre.
const BOX_SCALE_FACTOR: f64 = 3.0;
/// Bound of the absolute value of ratios, and least bound of numbers.
const MIN_NUMBER_BOUND: f64 = 10.0;

/// Returns a size, or 1 if it is not positive.
pub(super) fn positive(v: f64) -> f64 {
    if v > 0.0 && v.is_finite() { v } else { 1.0 }
}

/// Returns the bounds of a parameter: the caller's, else the template's, else those that the data's
/// box suggests (free parameters only).
pub(super) fn limits(
    p: &Parameter,
    said: Option<(f64, f64)>,
    data: Aabb,
    is_free: bool,
) -> Result<(f64, f64), FitError> {
    let given = said.map_or(OptionalBounds(p.min, p.max), OptionalBounds::from_pair);
    let OptionalBounds(lo, hi) = given;
    if !given.is_interval() {
        return Err(FitError::Bounds {
            name: p.name.clone(),
            lo: lo.unwrap_or(f64::NAN),
            hi: hi.unwrap_or(f64::NAN),
        });
    }
    if !is_free {
        return Ok((lo.unwrap_or(f64::NEG_INFINITY), hi.unwrap_or(f64::INFINITY)));
    }
    let start = p.start.filter(|v| v.is_finite());
    Ok(stretched(suggested(p.kind, data), start, lo, hi))
}

/// Lower and upper bound; `None` if not given.
#[derive(Clone, Copy)]
struct OptionalBounds(Option<f64>, Option<f64>);

impl OptionalBounds {
    /// Makes bounds of two numbers; infinite ones are not given.
    fn from_pair((lo, hi): (f64, f64)) -> Self {
        Self(
            Some(lo).filter(|v| *v != f64::NEG_INFINITY),
            Some(hi).filter(|v| *v != f64::INFINITY),
        )
    }

    /// Returns true if there is room between the bounds.
    fn is_interval(self) -> bool {
        let Self(lo, hi) = self;
        let has_nan = lo.into_iter().chain(hi).any(f64::is_nan);
        !has_nan && lo.zip(hi).is_none_or(|(a, b)| a < b)
    }
}

/// Returns bounds by what a parameter measures.
fn suggested(kind: Kind, data: Aabb) -> (f64, f64) {
    let diagonal = positive(data.diagonal());
    match kind {
        Kind::X | Kind::Y | Kind::Z => {
            let k = kind as usize;
            // Flat data still have a box, and lengths start off zero, where primitives degenerate.
            let side = (data.hi[k] - data.lo[k]).max(0.3 * diagonal);
            let half = 0.5 * BOX_SCALE_FACTOR * side;
            (data.center()[k] - half, data.center()[k] + half)
        }
        Kind::Length => (1e-6 * diagonal, 2.0 * diagonal),
        Kind::Angle => (-2.0 * PI, 2.0 * PI),
        Kind::Ratio => (-MIN_NUMBER_BOUND, MIN_NUMBER_BOUND),
        Kind::Number => {
            let corners = data.lo.iter().chain(&data.hi);
            let reach = corners.fold(diagonal, |m, v| m.max(v.abs()));
            let most = (BOX_SCALE_FACTOR * reach).max(MIN_NUMBER_BOUND);
            (-most, most)
        }
    }
}

/// Completes given bounds with suggested ones. A start or a given bound outside of the suggested
/// range extends it.
fn stretched(
    (a, b): (f64, f64),
    start: Option<f64>,
    lo: Option<f64>,
    hi: Option<f64>,
) -> (f64, f64) {
    let width = b - a;
    let lo = lo.unwrap_or_else(|| {
        let of_hi = hi.map_or(a, |h| if h <= a { h - width } else { a });
        a.min(start.map_or(a, |s| below(s, a, width))).min(of_hi)
    });
    let hi = hi.unwrap_or_else(|| {
        let of_start = start.map_or(b, |s| s + 0.5 * width);
        let of_lo = if lo >= b { lo + width } else { b };
        b.max(of_start).max(of_lo)
    });
    (lo, hi)
}

/// Returns a lower bound below a start, positive if the suggested one is.
fn below(start: f64, suggested: f64, width: f64) -> f64 {
    if start > 0.0 && suggested > 0.0 {
        0.1 * start
    } else {
        start - width
    }
}

/// Returns the range from which informed starts are drawn: positions in the data's box, lengths up
/// to its size. About a start of the template's author it is a quarter of the bounds on either
/// side. If bounds and data have no common range, the bounds decide.
pub(super) fn informed(p: &Parameter, lo: f64, hi: f64, data: Aabb) -> (f64, f64) {
    if let Some(start) = start_of_author(p, lo, hi) {
        let reach = 0.25 * (hi - lo);
        return ((start - reach).max(lo), (start + reach).min(hi));
    }
    let (a, b) = likely(p.kind, lo, hi, data);
    let (c, d) = (a.max(lo), b.min(hi));
    if d - c > 1e-3 * (hi - lo) {
        (c, d)
    } else {
        (lo, hi)
    }
}

/// Returns the template's start if its author also gave bounds, and is better informed than the
/// data.
fn start_of_author(p: &Parameter, lo: f64, hi: f64) -> Option<f64> {
    let start = p.start.filter(|s| lo <= *s && *s <= hi);
    start.filter(|_| p.min.is_some() && p.max.is_some())
}

/// Returns the range of values that the data's box makes likely.
fn likely(kind: Kind, lo: f64, hi: f64, data: Aabb) -> (f64, f64) {
    let size = data.size();
    let largest = positive(size[0].max(size[1]).max(size[2]));
    let (least, most) = (0.02, 0.75);
    match kind {
        Kind::X | Kind::Y | Kind::Z => (data.lo[kind as usize], data.hi[kind as usize]),
        Kind::Length => (least * largest, most * largest),
        Kind::Angle => (lo.max(-PI), hi.min(PI)),
        Kind::Ratio => (lo.max(-2.0), hi.min(2.0)),
        Kind::Number if lo >= 0.0 => (least * largest, largest),
        Kind::Number => (
            data.lo.iter().copied().fold(f64::INFINITY, f64::min),
            data.hi.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_given_stretches_what_is_suggested() {
        assert_eq!(stretched((0.0, 4.0), None, None, None), (0.0, 4.0));
        assert_eq!(
            stretched((0.0, 4.0), None, Some(6.0), None),
            (6.0, 10.0),
            "a lower bound above the range"
        );
        assert_eq!(
            stretched((1.0, 5.0), Some(0.5), None, None),
            (0.05, 5.0),
            "a small length"
        );
    }
}
