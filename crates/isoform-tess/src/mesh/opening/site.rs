//! Base point in a unit triangle, with the rectangle around it and the arcs that end in it.

use crate::mesh::names::Ray;
use isoform_algebra::Arrangement;

/// Base point in a unit triangle.
pub(in crate::mesh) struct Site {
    pub(in crate::mesh) fan: usize,
    pub(in crate::mesh) at: [f64; 2],
    /// Half the height of the rectangle around it.
    pub(in crate::mesh) height: f64,
    /// Drawn arcs that end there.
    pub(in crate::mesh) arcs: Vec<SiteArc>,
}

impl Site {
    pub(in crate::mesh) fn new(fan: usize, at: [f64; 2]) -> Self {
        Self {
            fan,
            at,
            height: 0.0,
            arcs: Vec::new(),
        }
    }
    /// Returns the curve on its wall that ends there from above or below.
    pub(in crate::mesh) fn vertical_arc(&self, up: bool) -> Option<&SiteArc> {
        let mut arcs = self.arcs.iter();
        arcs.find(|x| x.chain.is_empty() && x.right == up)
    }
}

/// Arc that ends in a base point.
pub(in crate::mesh) struct SiteArc {
    pub(in crate::mesh) ray: Ray,
    /// True if the arc lies to the right or, for a vertical line, above.
    pub(in crate::mesh) right: bool,
    pub(in crate::mesh) curve: usize,
    /// Slabs and places in them, from the base point to the border of the rectangle; empty for a
    /// vertical line.
    pub(in crate::mesh) chain: Vec<(usize, usize)>,
    /// End on the border of the rectangle, and the point halfway.
    pub(in crate::mesh) end: [f64; 2],
    pub(in crate::mesh) middle: [f64; 2],
}

impl SiteArc {
    pub(super) fn new(ray: Ray, right: bool, curve: usize, chain: Vec<(usize, usize)>) -> Self {
        Self {
            ray,
            right,
            curve,
            chain,
            end: [0.0; 2],
            middle: [0.0; 2],
        }
    }
    /// Returns the height of its end above or below the base point.
    pub(in crate::mesh) fn rise(&self, base: [f64; 2]) -> f64 {
        (self.end[1] - base[1]).abs()
    }
    /// Returns the points of walls that the arc passes within the rectangle.
    pub(in crate::mesh) fn passed(&self, a: &Arrangement) -> Vec<(usize, usize)> {
        let ends = |&(slab, i): &(usize, usize)| {
            let arc = a.slabs[slab].arcs[i];
            if self.right {
                (slab + 1, arc.right)
            } else {
                (slab, arc.left)
            }
        };
        self.chain[..self.chain.len().saturating_sub(1)]
            .iter()
            .map(ends)
            .collect()
    }
}
