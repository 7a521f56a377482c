//! Growth up to the edges of a part.
//!
//! A patch grows on the smooth function of its part, which extends beyond the part's edges. When a
//! side reaches an edge, it is moved onto the edge if all of it meets that edge nearby, and a term
//! of the objective then keeps it there. Otherwise it stops.

mod put;
mod trim;

use super::Growth;
use crate::stretch::{balanced, beside, extended};
use crate::whole::{EdgeViolation, GrowthPart};
use isoform_geom::{Field, RationalPatch, norm};
use put::put_on;

/// State of a side of a patch.
#[derive(Clone, Copy)]
pub(crate) enum SideState<'f> {
    /// The side moves outward.
    Free,
    /// The side lies on an edge, where this function vanishes.
    At(&'f dyn Field),
    /// The side has met an edge that it cannot follow.
    Stopped,
}

impl<'f> SideState<'f> {
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

/// Number of samples along a side.
const SIDE_SAMPLES: usize = 25;

/// Returns evenly spaced numbers from 0 to 1.
fn evenly(count: usize) -> Vec<f64> {
    (0..count).map(|i| i as f64 / (count - 1) as f64).collect()
}

/// Returns the states of the two neighbours of a side.
fn neighbours<'f>(sides: &[SideState<'f>; 4], side: usize) -> [SideState<'f>; 2] {
    if side < 2 {
        [sides[2], sides[3]]
    } else {
        [sides[0], sides[1]]
    }
}

/// Bisects from 0 to `hi`; returns an interval in which `is_below` changes from true to false.
fn bisected(hi: f64, is_below: impl Fn(f64) -> bool) -> (f64, f64) {
    let (mut lo, mut hi) = (0.0, hi);
    for _ in 0..12 {
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
struct SideCriterion<'a, 'f> {
    on: GrowthPart<'f>,
    side: usize,
    /// Distance by which it may lie beyond edges.
    allowed: f64,
    /// Parameters of samples along it.
    samples: &'a [f64],
    /// States of its neighbours: near its ends it may lie beyond the edges on which they are held,
    /// as Newton steps will correct that.
    neighbours: [SideState<'f>; 2],
}

impl<'f> SideCriterion<'_, 'f> {
    /// Returns the worst violation of an edge by the side of a patch.
    fn farthest(&self, patch: &RationalPatch) -> Option<EdgeViolation<'f>> {
        let mut worst: Option<EdgeViolation<'f>> = None;
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

    /// Returns true if a neighbour is held on the violated edge and the sample lies in the quarter
    /// of the side next to it.
    fn is_excused(&self, t: f64, beyond: &EdgeViolation<'_>) -> bool {
        let [first, last] = self.neighbours;
        t < 0.25 && first.is_held_at(beyond.edge) || t > 0.75 && last.is_held_at(beyond.edge)
    }

    /// Returns true if the side of a patch lies beyond an edge.
    fn is_beyond(&self, patch: &RationalPatch) -> bool {
        self.farthest(patch).is_some()
    }
}

impl<'f> Growth<'f> {
    /// Returns the largest distance of the border beyond the edges of the part, or from the edges
    /// on which it is held.
    pub(crate) fn off_edges(&self, on: GrowthPart<'f>) -> f64 {
        let mut most = 0.0f64;
        for side in 0..4 {
            for t in evenly(SIDE_SAMPLES) {
                let (u, v) = beside(side, t, 0.0);
                let p = self.patch.point(u, v);
                if let SideState::At(edge) = self.sides[side] {
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
        on: GrowthPart<'f>,
        patch: &RationalPatch,
        allowed: f64,
        at_edge: bool,
    ) -> bool {
        let steps = 4;
        let at = |i: usize| i as f64 / steps as f64;
        let is_within = |i: usize, j: usize| {
            let beyond = on.beyond(patch.point(at(i), at(j)));
            beyond.is_none_or(|b| b.by <= allowed)
        };
        let first = usize::from(at_edge);
        (0..=steps).all(|i| (first..=steps).all(|j| is_within(i, j)))
    }

    /// Extends the patch by fractions of its edges at its four sides, but not beyond the part;
    /// returns the resulting states of its sides as well.
    pub(crate) fn within_edges(
        &self,
        on: GrowthPart<'f>,
        by: [f64; 4],
        allowed: f64,
    ) -> (RationalPatch, [SideState<'f>; 4]) {
        let (mut patch, mut sides) = (self.patch.clone(), self.sides);
        let samples = evenly(SIDE_SAMPLES);
        for side in 0..4 {
            let look = SideCriterion {
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
    look: &SideCriterion<'_, 'f>,
    share: f64,
) -> (RationalPatch, Option<SideState<'f>>) {
    let side = look.side;
    let longer = extended(patch, side, share);
    if share <= 0.0 {
        return (longer, None);
    }
    let Some(beyond) = look.farthest(&longer) else {
        return (longer, None);
    };
    if let Some(put) = put_on(patch, side, share, beyond.edge) {
        return (put, Some(SideState::At(beyond.edge)));
    }
    let is_within = |share: f64| !look.is_beyond(&extended(patch, side, share));
    let (most, _) = bisected(share, is_within);
    // A side that gains less than 2 % has come to the edge.
    let end = (most < 0.02).then_some(SideState::Stopped);
    (extended(patch, side, most), end)
}
