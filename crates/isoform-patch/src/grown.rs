//! Grown patch with its history.

use crate::places::{contains, middles};
use crate::terms::{Targets, Terms, Weights};
use isoform_geom::{Aabb, Point3, RationalPatch, dot};

/// Event after which a row of the trace is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// A Newton step.
    Newton,
    /// An extrapolation, before the first step that follows it.
    Grow,
}

/// Row of the trace of a growing patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Event after which the row was written.
    pub phase: Phase,
    /// Objective S.
    pub sum: f64,
    /// Terms of S.
    pub terms: Terms,
    /// Target lengths l₁ and l₂.
    pub lengths: (f64, f64),
    /// Factors ω of the terms.
    pub weights: Weights,
}

/// Patch grown as large as the bound admits, with its history.
#[derive(Clone, Debug)]
pub struct Grown {
    /// Grown patch.
    pub patch: RationalPatch,
    /// Surface point at which it was started.
    pub seed_point: Point3,
    /// Terms of S for the patch.
    pub terms: Terms,
    /// Last l₁, l₂ and corners.
    pub targets: Targets,
    /// Last factors ω.
    pub weights: Weights,
    /// All Newton steps and extrapolations, in order.
    pub trace: Vec<Row>,
}

impl Grown {
    /// Returns S.
    pub fn sum(&self) -> f64 {
        self.terms.sum(&self.weights)
    }
    /// Returns the area of the patch within a region, to a few per cent.
    pub fn area(&self, region: &Aabb) -> f64 {
        area_within(&self.patch, region)
    }
    /// Returns the number of rows of the trace that belong to a phase.
    pub fn count(&self, phase: Phase) -> usize {
        self.trace.iter().filter(|r| r.phase == phase).count()
    }
}

/// Returns the area of a patch, to a few per cent.
pub(crate) fn area(patch: &RationalPatch) -> f64 {
    area_where(patch, |_| true)
}

/// Returns the area of a patch within a region, to a few per cent.
pub(crate) fn area_within(patch: &RationalPatch, region: &Aabb) -> f64 {
    area_where(patch, |p| contains(region, p))
}

/// Sums area elements on a grid, counting those for which `inside` holds.
fn area_where(patch: &RationalPatch, inside: impl Fn(Point3) -> bool) -> f64 {
    let mut sum = 0.0;
    let side = 24;
    for (u, v) in middles(side) {
        let t = patch.tangents(u, v);
        if inside(t.point) {
            let n = t.normal();
            sum += dot(n, n).sqrt();
        }
    }
    sum / (side * side) as f64
}
