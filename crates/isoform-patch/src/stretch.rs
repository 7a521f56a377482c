//! Extension and shortening of patches at their four sides u = 0, u = 1, v = 0 and v = 1, numbered
//! 0 to 3.

use crate::places::grid;
use isoform_geom::RationalPatch;

/// Returns the parameters of the point at `t` along a side and `e` beyond it.
#[inline]
pub(crate) fn beside(side: usize, t: f64, e: f64) -> (f64, f64) {
    match side {
        0 => (-e, t),
        1 => (1.0 + e, t),
        2 => (t, -e),
        _ => (t, 1.0 + e),
    }
}

/// Extends a patch by a fraction at one side.
pub(crate) fn extended(patch: &RationalPatch, side: usize, share: f64) -> RationalPatch {
    let whole = (0.0, 1.0);
    match side {
        0 => patch.part((-share, 1.0), whole),
        1 => patch.part((0.0, 1.0 + share), whole),
        2 => patch.part(whole, (-share, 1.0)),
        _ => patch.part(whole, (0.0, 1.0 + share)),
    }
}

/// Extends a patch by fractions of its edges at its four sides and balances it.
pub(crate) fn longer(patch: &RationalPatch, by: [f64; 4]) -> RationalPatch {
    balanced(patch.part((-by[0], 1.0 + by[1]), (-by[2], 1.0 + by[3])))
}

/// Scales the control points so that the least and the largest weight have equal distances from 1,
/// where J is nearly least. The points of the patch do not change.
pub(crate) fn balanced(mut patch: RationalPatch) -> RationalPatch {
    let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
    for (u, v) in grid(7) {
        let w = patch.homogeneous(u, v)[0][3];
        (lo, hi) = (lo.min(w), hi.max(w));
    }
    let middle = 0.5 * (lo + hi);
    if lo > 0.0 && middle.is_finite() {
        for v in patch.control_mut().as_flattened_mut() {
            *v /= middle;
        }
    }
    patch
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A planar patch is extended to a planar patch, and its weights stay 1.
    #[test]
    fn a_plane_goes_on() {
        let patch = RationalPatch::planar((2, 3), [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let by = [0.1, 0.2, 0.3, 0.4];
        let made = longer(&patch, by);
        for (side, share) in by.into_iter().enumerate() {
            let (u, v) = beside(side, 0.5, share);
            let one = extended(&patch, side, share);
            let (s, t) = beside(side, 0.5, 0.0);
            let p = one.point(s, t);
            assert!((p[0] - u).abs() < 1e-14 && (p[1] - v).abs() < 1e-14);
        }
        let (lower, upper) = (made.point(0.0, 0.0), made.point(1.0, 1.0));
        assert!((lower[0] + 0.1).abs() < 1e-14 && (upper[1] - 1.4).abs() < 1e-14);
        assert!((made.control_weights().0 - 1.0).abs() < 1e-14);
    }
}
