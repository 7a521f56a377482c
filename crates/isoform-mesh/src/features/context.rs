//! Context of the search for features: the solid, its octree and tolerances.

use super::FeatureOptions;
use super::newton::normalised;
use super::octree::{self, Octree};
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid, cross, dot, norm};

/// Distances by which the region is enlarged below and above, in sizes. They are uneven so that
/// faces of the solid at round coordinates do not lie on faces of cells.
const REGION_SHIFT_SIZES: [f64; 2] = [0.0137, 0.0211];
/// Tolerance within which a piece vanishes: a fraction of the size, and a number of roundings of
/// the largest coordinate that is added to it.
const VANISHING_TOLERANCE: [f64; 2] = [1e-9, 64.0];

/// Context of the search: the solid, its octree and tolerances.
pub(crate) struct FeatureContext<'a> {
    pub(super) solid: &'a dyn Solid,
    pub(super) octree: Octree,
    pub(super) options: FeatureOptions,
    region: Aabb,
    pub(super) control: &'a Control<'a>,
    /// Distance within which a piece vanishes, in model units.
    pub(super) tolerance: f64,
    /// Sine of the smallest angle.
    pub(super) sine: f64,
}

impl<'a> FeatureContext<'a> {
    pub(super) fn new(
        solid: &'a dyn Solid,
        region: Aabb,
        options: &FeatureOptions,
        control: &'a Control<'a>,
    ) -> Self {
        let size = options.size;
        let region = Aabb {
            lo: region.lo.map(|v| v - REGION_SHIFT_SIZES[0] * size),
            hi: region.hi.map(|v| v + REGION_SHIFT_SIZES[1] * size),
        };
        let bounds = region.lo.iter().chain(&region.hi);
        let far = bounds.fold(0.0, |m: f64, v| m.max(v.abs()));
        Self {
            solid,
            octree: Octree::new(solid, region, size, options.cells, control),
            options: options.clone(),
            region,
            control,
            tolerance: VANISHING_TOLERANCE[0] * size + VANISHING_TOLERANCE[1] * f64::EPSILON * far,
            sine: options.smallest_angle.sin(),
        }
    }
}

impl FeatureContext<'_> {
    pub(super) fn size(&self) -> f64 {
        self.options.size
    }

    pub(super) fn holds(&self, p: Point3) -> bool {
        octree::holds(&self.region, p)
    }

    /// Returns the angle between the normals of two pieces.
    pub(super) fn angle_at(&self, p: Point3, [i, j]: [u32; 2]) -> Option<f64> {
        let (a, b) = (
            normalised(self.solid, i, p)?.n,
            normalised(self.solid, j, p)?.n,
        );
        Some(norm(cross(a, b)).atan2(dot(a, b)))
    }
}
