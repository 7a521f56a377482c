//! Trimming of sides that Newton steps have moved beyond edges or far beyond the region.

use super::super::{Growth, SIDE_STOP_EXCESS};
use super::{SIDE_SAMPLES, SideCriterion, SideState, bisected, evenly, neighbours};
use crate::places::contains;
use crate::stretch::{balanced, beside, extended};
use isoform_geom::{Aabb, RationalPatch};

/// Maximum fraction of a patch that is trimmed at one side.
const MAX_TRIMMED_SHARE: f64 = 0.4;
/// Fraction of the region's size by which a side may leave the region before it is trimmed back.
const SIDE_TRIM_EXCESS: f64 = 0.3;

impl<'f> Growth<'f> {
    /// Returns true if no side lies far beyond the region.
    pub(crate) fn is_near_region(&self) -> bool {
        let wide = self.wider(SIDE_TRIM_EXCESS);
        (0..4).all(|side| is_side_within(&self.patch, side, &wide))
    }

    /// Trims sides that Newton steps have moved beyond edges or far beyond the region.
    pub(crate) fn trim(&mut self) {
        if self.options.tolerance.is_some() {
            self.trim_to_region();
        }
        let samples = evenly(SIDE_SAMPLES);
        let samples = std::array::from_fn(|_| samples.clone());
        self.trim_to(self.overlap(), &samples, false);
    }

    /// Trims what lies beyond edges by more than allowed, also between the usual samples, with the
    /// densest samples near a place of suspected violation.
    pub(crate) fn trim_finely(&mut self, allowed: f64, near: Option<(f64, f64)>) {
        let samples = std::array::from_fn(|side| fine_samples(side, near));
        self.trim_to(allowed, &samples, true);
    }

    /// Trims sides that Newton steps have moved far beyond the region: on a surface that can be
    /// shifted along itself, such as a cylinder, nothing else bounds them. Applies only with a
    /// tolerance, for which steps go far.
    fn trim_to_region(&mut self) {
        let (far, near) = (self.wider(SIDE_TRIM_EXCESS), self.wider(SIDE_STOP_EXCESS));
        let mut patch = self.patch.clone();
        for side in 0..4 {
            let is_within = |share: f64, region: &Aabb| {
                is_side_within(&extended(&patch, side, -share), side, region)
            };
            if is_within(0.0, &far) || !is_within(MAX_TRIMMED_SHARE, &near) {
                continue;
            }
            let (_, share) = bisected(MAX_TRIMMED_SHARE, |share| !is_within(share, &near));
            patch = extended(&patch, side, -share);
        }
        self.put(patch);
    }

    /// Trims what lies beyond edges, by samples for each side; with `held`, if that fails,
    /// violations of edges on which the neighbours are held are ignored.
    fn trim_to(&mut self, allowed: f64, samples: &[Vec<f64>; 4], held: bool) {
        if self.on.whole.is_single() {
            return;
        }
        let mut patch = self.patch.clone();
        for side in 0..4 {
            if self.sides[side].is_at_edge() {
                continue;
            }
            let strict = SideCriterion {
                on: self.on,
                side,
                allowed,
                samples: &samples[side],
                neighbours: [SideState::Free; 2],
            };
            let lenient = SideCriterion {
                neighbours: neighbours(&self.sides, side),
                ..strict
            };
            let looks = [Some(strict), held.then_some(lenient)];
            if let Some(trimmed) = looks
                .into_iter()
                .flatten()
                .find_map(|look| trimmed(&patch, &look))
            {
                patch = trimmed;
            }
        }
        self.put(patch);
    }

    /// Takes a patch if it differs from the current one.
    fn put(&mut self, patch: RationalPatch) {
        if patch != self.patch {
            self.retake(balanced(patch));
        }
    }
}

/// Returns a patch that does not lie beyond edges at one side; `None` if too much would have to be
/// trimmed.
fn trimmed(patch: &RationalPatch, look: &SideCriterion<'_, '_>) -> Option<RationalPatch> {
    let shorter = |share: f64| extended(patch, look.side, -share);
    if !look.is_beyond(&shorter(0.0)) {
        return Some(patch.clone());
    }
    if look.is_beyond(&shorter(MAX_TRIMMED_SHARE)) {
        return None;
    }
    let (_, share) = bisected(MAX_TRIMMED_SHARE, |share| look.is_beyond(&shorter(share)));
    Some(shorter(share))
}

/// Returns true if samples of a side lie in a box.
fn is_side_within(patch: &RationalPatch, side: usize, region: &Aabb) -> bool {
    evenly(SIDE_SAMPLES).into_iter().all(|t| {
        let (u, v) = beside(side, t, 0.0);
        contains(region, patch.point(u, v))
    })
}

/// Returns samples along a side, with more of them near a point.
fn fine_samples(side: usize, near: Option<(f64, f64)>) -> Vec<f64> {
    let mut samples = evenly(241);
    if let Some((u, v)) = near {
        let t = if side < 2 { v } else { u };
        // Two of the spacings above on both sides.
        let reach = 1.0 / 120.0;
        let close = evenly(161).into_iter();
        let close = close.map(|s| t + (2.0 * s - 1.0) * reach);
        samples.extend(close.filter(|t| (0.0..=1.0).contains(t)));
    }
    samples
}
