//! Quantities at a minimum of the last stages.

use crate::deviation::SampledSurface;
use isoform_geom::Point3;

/// Quantities at a minimum.
pub(super) struct MinimumState {
    pub(super) residuals: Vec<f64>,
    /// Nearest points of the model, by point.
    pub(super) at: Vec<Point3>,
    pub(super) noise: f64,
    pub(super) surface: SampledSurface,
    pub(super) open_parts: Vec<bool>,
    /// 0 for points on open parts, else 1; empty for none on open parts.
    pub(super) mask: Vec<f64>,
}
