//! Unit cells: a box with opposite sides identified, a torus.
//!
//! The complex of a unit cell has no vertices on the upper sides of the box: those on its lower
//! sides stand for both, so that the two sides of the mesh match by construction. Sides are walls,
//! i.e. labelled faces with a tetrahedron in front and one behind: no tetrahedron crosses them, and
//! the corners of a tetrahedron behind an upper side are unwrapped, one period away.

use crate::distance::zero_in;
use isoform_geom::{Aabb, Point3};

/// Distance from a side, in [`zero_in`] of the box, up to which a point lies on it: a point moved
/// off the side by twice as much has unchanged values.
pub(crate) const SIDE_TOLERANCE_FACTOR: f64 = 0.125;
/// A box with the axes along which it is periodic.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Torus {
    pub(crate) region: Aabb,
    /// True for each axis across which opposite sides are identified.
    pub(crate) axes: [bool; 3],
    /// Distance from a side up to which a point lies on it.
    pub(crate) near: f64,
}

impl Torus {
    /// Creates a box that is periodic along some axes.
    pub(crate) fn new(region: Aabb, axes: [bool; 3]) -> Self {
        Self {
            region,
            axes,
            near: SIDE_TOLERANCE_FACTOR * zero_in(region),
        }
    }

    /// Returns the axes along which the box is periodic.
    pub(crate) fn repeating(&self) -> impl Iterator<Item = usize> + use<> {
        let axes = self.axes;
        (0..3).filter(move |&i| axes[i])
    }

    /// Unwraps positions of nearby vertices: chooses periodic images close to each other.
    ///
    /// Never inlined: within the loops of the optimiser that costs meshes without periodicity a
    /// tenth of their time.
    #[cold]
    #[inline(never)]
    pub(crate) fn bring_together(&self, p: &mut [Point3]) {
        for i in self.repeating() {
            let (lo, hi) = (self.region.lo[i], self.region.hi[i]);
            let most = p.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p[i]));
            for p in p.iter_mut() {
                if most - p[i] > 0.5 * (hi - lo) {
                    p[i] = hi + (p[i] - lo);
                }
            }
        }
    }

    /// Returns the periodic image of a point that is nearest to another point.
    pub(crate) fn nearest(&self, mut p: Point3, to: Point3) -> Point3 {
        for i in self.repeating() {
            let (lo, hi) = (self.region.lo[i], self.region.hi[i]);
            let half = 0.5 * (hi - lo);
            if to[i] - p[i] > half {
                p[i] = hi + (p[i] - lo);
            } else if p[i] - to[i] > half {
                p[i] = lo + (p[i] - hi);
            }
        }
        p
    }

    /// Returns the distance of a point from the nearest periodic side, positive inside the box.
    pub(crate) fn depth(&self, p: Point3) -> f64 {
        let depth = |i: usize| (p[i] - self.region.lo[i]).min(self.region.hi[i] - p[i]);
        self.repeating().map(depth).fold(f64::INFINITY, f64::min)
    }

    /// Returns the periodic image of a point in the box.
    pub(crate) fn wrapped(&self, mut p: Point3) -> Point3 {
        for i in self.repeating() {
            let (lo, hi) = (self.region.lo[i], self.region.hi[i]);
            if p[i] < lo - self.near {
                p[i] = hi + (p[i] - lo);
            } else if p[i] > hi + self.near {
                p[i] = lo + (p[i] - hi);
            }
        }
        p
    }

    /// Returns all periodic images of a point in the box: several if it lies on a side.
    pub(crate) fn images(&self, p: Point3) -> Vec<Point3> {
        let p = self.wrapped(p);
        let mut all = vec![p];
        for i in self.repeating() {
            let (lo, hi) = (self.region.lo[i], self.region.hi[i]);
            let ends = if (p[i] - lo).abs() <= self.near || (p[i] - hi).abs() <= self.near {
                [lo, hi]
            } else {
                continue;
            };
            let with = |x: f64| {
                all.iter().map(move |p| {
                    let mut p = *p;
                    p[i] = x;
                    p
                })
            };
            all = with(ends[0]).chain(with(ends[1])).collect();
        }
        all
    }

    /// Returns true for each axis across which a point lies on a side.
    pub(crate) fn is_on_side(&self, p: Point3) -> [bool; 3] {
        std::array::from_fn(|i| {
            let ends = [self.region.lo[i], self.region.hi[i]];
            self.axes[i] && ends.iter().any(|end| (p[i] - end).abs() <= self.near)
        })
    }

    /// Moves a point on a side slightly, but by more than the tolerance, into the box.
    pub(crate) fn inner(&self, mut p: Point3) -> Point3 {
        let is_on_side = self.is_on_side(p);
        for i in (0..3).filter(|&i| is_on_side[i]) {
            let (lo, hi) = (self.region.lo[i], self.region.hi[i]);
            p[i] = match hi - p[i] < p[i] - lo {
                true => hi - 2.0 * self.near,
                false => lo + 2.0 * self.near,
            };
        }
        p
    }

    /// Moves a point on a side slightly, but by more than the tolerance, towards another one.
    pub(crate) fn moved_off_side(&self, p: Point3, towards: Point3) -> Point3 {
        let mut p = self.nearest(p, towards);
        let is_on_side = self.is_on_side(p);
        for i in (0..3).filter(|&i| is_on_side[i]) {
            p[i] += (2.0 * self.near).copysign(towards[i] - p[i]);
        }
        p
    }

    /// Returns true if a point in the box is nearer to the upper side across an axis: as an element
    /// next to the side, it lies below it.
    pub(crate) fn is_below(&self, p: Point3, axis: usize) -> bool {
        self.region.hi[axis] - p[axis] < p[axis] - self.region.lo[axis]
    }

    /// Splits the range of a box along an axis into ranges within one period.
    pub(crate) fn spans(&self, axis: usize, [from, to]: [f64; 2]) -> Vec<[f64; 2]> {
        let (lo, hi) = (self.region.lo[axis], self.region.hi[axis]);
        if !self.axes[axis] {
            return vec![[from, to]];
        }
        // Both images of a side are included.
        let (from, to) = (from - self.near, to + self.near);
        if to - from >= hi - lo {
            return vec![[lo, hi]];
        }
        let mut spans = Vec::new();
        for shift in [hi - lo, 0.0, lo - hi] {
            let span = [(from + shift).max(lo), (to + shift).min(hi)];
            if span[0] <= span[1] {
                spans.push(span);
            }
        }
        spans
    }
}
