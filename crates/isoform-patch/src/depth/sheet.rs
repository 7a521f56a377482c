//! Patch with start points for the search of feet.

use super::border::Border;
use crate::feet::step_to_foot;
use crate::places::middles;
use isoform_geom::{Aabb, Point3, RationalPatch, distance_squared, dot, norm, sub};

/// Patch in which points may lie.
pub(crate) struct DepthPatch<'p> {
    pub(super) patch: &'p RationalPatch,
    /// Proved upper bound on its distance from the surface.
    pub(super) bound: f64,
    pub(super) border: Border,
    /// Box that contains the patch.
    region: Aabb,
    /// Start points for the search of feet, with their parameters.
    starts: Vec<((f64, f64), Point3)>,
    /// Largest distance between neighbouring start points.
    apart: f64,
}

impl<'p> DepthPatch<'p> {
    /// Prepares a patch; `None` if a control weight is not positive.
    pub(crate) fn new(patch: &'p RationalPatch, bound: f64, depth: f64) -> Option<Self> {
        let region = patch.control_box()?;
        let side = 16;
        let starts: Vec<((f64, f64), Point3)> = middles(side)
            .map(|(u, v)| ((u, v), patch.point(u, v)))
            .collect();
        let apart = |k: usize| norm(sub(starts[k].1, starts[k + 1].1));
        let apart = (0..side * side - 1).map(apart).fold(0.0, f64::max);
        Some(Self {
            patch,
            bound,
            border: Border::new(patch, depth),
            region,
            starts,
            apart,
        })
    }

    /// Returns the parameters of a point of the patch near p; `None` if no point within `reach` of
    /// p, plus the patch's distance from the surface, is found.
    pub(super) fn foot(&self, p: Point3, reach: f64) -> Option<(f64, f64)> {
        let far = reach + self.bound;
        let (mut u, mut v) = self.start(p, far)?;
        for _ in 0..8 {
            let t = self.patch.tangents(u, v);
            let (du, dv) = step_to_foot(&t, sub(p, t.point));
            (u, v) = ((u + du).clamp(0.0, 1.0), (v + dv).clamp(0.0, 1.0));
            // The step is shorter than a thousandth of the reach.
            if du * du * dot(t.u, t.u) + dv * dv * dot(t.v, t.v) <= 1e-6 * reach * reach {
                break;
            }
        }
        (norm(sub(self.patch.point(u, v), p)) <= far).then_some((u, v))
    }

    /// Returns the parameters of the start point nearest to p; `None` if p is farther from the
    /// patch than `far`.
    fn start(&self, p: Point3, far: f64) -> Option<(f64, f64)> {
        let region = self.region;
        let is_near = |k: usize| region.lo[k] - far <= p[k] && p[k] <= region.hi[k] + far;
        if !(0..3).all(is_near) {
            return None;
        }
        let distance = |q: &Point3| distance_squared(*q, p);
        let nearest =
            (self.starts.iter()).min_by(|a, b| distance(&a.1).total_cmp(&distance(&b.1)))?;
        // A foot is at most four spacings from the nearest start point.
        (distance(&nearest.1).sqrt() <= far + 4.0 * self.apart).then_some(nearest.0)
    }
}
