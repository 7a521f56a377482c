//! Results of a fit by point, before they are composed.

use isoform_geom::Point3;

/// Results of a fit by point.
pub(crate) struct ByPoint {
    /// Metric residuals.
    pub(crate) residuals: Vec<f64>,
    pub(crate) outliers: Vec<bool>,
    /// Weights in the polish.
    pub(crate) weights: Vec<f64>,
    /// Pieces of the model.
    pub(crate) parts: Vec<u32>,
    /// Nearest points of the model.
    pub(crate) at: Vec<Point3>,
}
