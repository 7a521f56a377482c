//! A grown patch with the way to it.

use crate::places::{contains, middles};
use crate::terms::{Targets, Terms, Weights};
use isoform_geom::{Aabb, Point3, RationalPatch, dot};

/// Area elements in each direction by which areas are summed.
const ELEMENTS: usize = 24;

/// The event after which a row of the trace is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// A Newton step.
    Newton,
    /// An extrapolation, before the first step that follows it.
    Grow,
}

/// A row of the trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// The event.
    pub phase: Phase,
    /// S.
    pub sum: f64,
    /// The terms of S.
    pub terms: Terms,
    /// l₁ and l₂.
    pub lengths: (f64, f64),
    /// The factors ω.
    pub weights: Weights,
}

/// A patch as large as the bound admits, with the way to it.
#[derive(Clone, Debug)]
pub struct Grown {
    /// The patch.
    pub patch: RationalPatch,
    /// The point of the surface at which it was started.
    pub seed_point: Point3,
    /// The terms of S at the patch.
    pub terms: Terms,
    /// The last l₁, l₂ and corners.
    pub targets: Targets,
    /// The last factors ω.
    pub weights: Weights,
    /// All steps.
    pub trace: Vec<Row>,
}

impl Grown {
    /// S.
    pub fn sum(&self) -> f64 {
        self.terms.sum(&self.weights)
    }
    /// The area of its part in a region, to some per cent.
    pub fn area(&self, region: &Aabb) -> f64 {
        area_within(&self.patch, region)
    }
    /// How many rows of the trace belong to a phase.
    pub fn count(&self, phase: Phase) -> usize {
        self.trace.iter().filter(|r| r.phase == phase).count()
    }
}

/// The area of a patch, to some per cent.
pub(crate) fn area(patch: &RationalPatch) -> f64 {
    area_where(patch, |_| true)
}

/// The area of a patch's part in a region, to some per cent.
pub(crate) fn area_within(patch: &RationalPatch, region: &Aabb) -> f64 {
    area_where(patch, |p| contains(region, p))
}

/// The area of a patch by a grid of area elements, only where `inside` holds.
fn area_where(patch: &RationalPatch, inside: impl Fn(Point3) -> bool) -> f64 {
    let mut sum = 0.0;
    for (u, v) in middles(ELEMENTS) {
        let t = patch.tangents(u, v);
        if inside(t.point) {
            let n = t.normal();
            sum += dot(n, n).sqrt();
        }
    }
    sum / (ELEMENTS * ELEMENTS) as f64
}
