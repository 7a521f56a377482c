//! Growth up to the edges of a part.
//!
//! A patch grows on the smooth function of its part, which extends beyond the part's edges. When a
//! side reaches an edge, it is moved onto the edge if all of it meets that edge nearby, and a term
//! of the objective then keeps it there. Otherwise it stops.

mod put;
mod trim;

use super::Growth;
use crate::stretch::{balanced, beside, extended};
use crate::whole::{Beyond, On};
use isoform_geom::{Field, RationalPatch, norm};
use put::put_on;

/// State of a side of a patch.
#[derive(Clone, Copy)]
pub(crate) enum Side<'f> {
    /// The side moves outward.
    Free,
    /// The side lies on an edge, where this function vanishes.
    At(&'f dyn Field),
    /// The side has met an edge that it cannot follow.
    Stopped,
}

impl<'f> Side<'f> {
    pub(crate) fn is_at_edge(&self) -> bool {
        self.edge().is_some()
    }

    /// Returns the function that vanishes on the edge on which the side is held; `None` if it is
    /// not held.
    pub(crate) fn edge(self) -> Option<&'f dyn Field> {
        match self {
            Self::At(edge) => Some(edge),
            Self::Free | Self::Stopped => None,
        }
    }

    /// Returns true if the side is held on the given edge.
    fn is_held_at(self, edge: &dyn Field) -> bool {
        self.edge().is_some_and(|own| std::ptr::addr_eq(own, edge))
    }
}

/// Fraction of the tolerance by which a patch may extend beyond edges.
pub(crate) const OVERLAP: f64 = 0.3;
/// Samples along a side.
const SAMPLES: usize = 25;
/// Places in each direction, less one, at which a start patch is looked at.
const START_SAMPLES: usize = 4;
/// Bisections towards an edge.
const BISECTIONS: usize = 12;
/// The share of a side that is near its end.
const NEAR_END: f64 = 0.25;
/// A side that gets no farther than this share of the patch has come to its edge.
const STUCK: f64 = 0.02;

/// Returns evenly spaced numbers from 0 to 1.
fn evenly(count: usize) -> Vec<f64> {
    (0..count).map(|i| i as f64 / (count - 1) as f64).collect()
}

/// Returns the states of the two neighbours of a side.
fn neighbours<'f>(sides: &[Side<'f>; 4], side: usize) -> [Side<'f>; 2] {
    if side < 2 {
        [sides[2], sides[3]]
    } else {
        [sides[0], sides[1]]
    }
}

/// Bisects from 0 to `hi`; returns an interval in which `is_below` changes from true to false.
fn bisected(hi: f64, is_below: impl Fn(f64) -> bool) -> (f64, f64) {
    let (mut lo, mut hi) = (0.0, hi);
    for _ in 0..BISECTIONS {
        let share = 0.5 * (lo + hi);
        if is_below(share) {
            lo = share
        } else {
            hi = share
        }
    }
    (lo, hi)
}

/// Criterion for the position of a side.
#[derive(Clone, Copy)]
struct Look<'a, 'f> {
    on: On<'f>,
    side: usize,
    /// Distance by which it may lie beyond edges.
    allowed: f64,
    /// Parameters of samples along it.
    samples: &'a [f64],
    /// States of its neighbours: near its ends it may lie beyond the edges on which they are held,
    /// as Newton steps will correct that.
    neighbours: [Side<'f>; 2],
}

impl<'f> Look<'_, 'f> {
    /// Returns the worst violation of an edge by the side of a patch.
    fn farthest(&self, patch: &RationalPatch) -> Option<Beyond<'f>> {
        let mut worst: Option<Beyond<'f>> = None;
        for &t in self.samples {
            let (u, v) = beside(self.side, t, 0.0);
            let Some(beyond) = self.on.beyond(patch.point(u, v)) else {
                continue;
            };
            let is_worse = beyond.by > worst.map_or(self.allowed, |w| w.by);
            if is_worse && !self.is_excused(t, &beyond) {
                worst = Some(beyond);
            }
        }
        worst
    }

    /// Returns true if a neighbour is held on the violated edge near this sample.
    fn is_excused(&self, t: f64, beyond: &Beyond<'_>) -> bool {
        let [first, last] = self.neighbours;
        t < NEAR_END && first.is_held_at(beyond.edge)
            || t > 1.0 - NEAR_END && last.is_held_at(beyond.edge)
    }

    /// Returns true if the side of a patch lies beyond an edge.
    fn is_beyond(&self, patch: &RationalPatch) -> bool {
        self.farthest(patch).is_some()
    }
}

impl<'f> Growth<'f> {
    /// Returns the largest distance of the border beyond the edges of the part, or from the edges
    /// on which it is held.
    pub(crate) fn off_edges(&self, on: On<'f>) -> f64 {
        let mut most = 0.0f64;
        for side in 0..4 {
            for t in evenly(SAMPLES) {
                let (u, v) = beside(side, t, 0.0);
                let p = self.patch.point(u, v);
                if let Side::At(edge) = self.sides[side] {
                    let j = edge.jet(p);
                    most = most.max(j.v.abs() / norm(j.g));
                }
                most = most.max(on.beyond(p).map_or(0.0, |b| b.by));
            }
        }
        most
    }

    /// Returns true if a start patch lies on its part; the side on an edge is exempt, as it need
    /// not fit yet.
    pub(crate) fn starts_within(
        on: On<'f>,
        patch: &RationalPatch,
        allowed: f64,
        at_edge: bool,
    ) -> bool {
        let at = |i: usize| i as f64 / START_SAMPLES as f64;
        let is_within = |i: usize, j: usize| {
            let beyond = on.beyond(patch.point(at(i), at(j)));
            beyond.is_none_or(|b| b.by <= allowed)
        };
        let first = usize::from(at_edge);
        (0..=START_SAMPLES).all(|i| (first..=START_SAMPLES).all(|j| is_within(i, j)))
    }

    /// Extends the patch by fractions of its edges at its four sides, but not beyond the part;
    /// returns the resulting states of its sides as well.
    pub(crate) fn within_edges(
        &self,
        on: On<'f>,
        by: [f64; 4],
        allowed: f64,
    ) -> (RationalPatch, [Side<'f>; 4]) {
        let (mut patch, mut sides) = (self.patch.clone(), self.sides);
        let samples = evenly(SAMPLES);
        for side in 0..4 {
            let look = Look {
                on,
                side,
                allowed,
                samples: &samples,
                neighbours: neighbours(&sides, side),
            };
            let (longer, end) = moved_out(&patch, &look, by[side]);
            patch = longer;
            if let Some(end) = end {
                sides[side] = end;
            }
        }
        (balanced(patch), sides)
    }
}

/// Extends a patch by a fraction at one side, but not beyond the part; returns the state of the
/// side if that changes.
fn moved_out<'f>(
    patch: &RationalPatch,
    look: &Look<'_, 'f>,
    share: f64,
) -> (RationalPatch, Option<Side<'f>>) {
    let side = look.side;
    let longer = extended(patch, side, share);
    if share <= 0.0 {
        return (longer, None);
    }
    let Some(beyond) = look.farthest(&longer) else {
        return (longer, None);
    };
    if let Some(put) = put_on(patch, side, share, beyond.edge) {
        return (put, Some(Side::At(beyond.edge)));
    }
    let is_within = |share: f64| !look.is_beyond(&extended(patch, side, share));
    let (most, _) = bisected(share, is_within);
    let end = (most < STUCK).then_some(Side::Stopped);
    (extended(patch, side, most), end)
}
