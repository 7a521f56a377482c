//! Quantities on which a verdict is based.

/// Quantities on which a verdict is based; lengths in the units of the scan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evidence {
    /// Diagonal of the data's box.
    pub size: f64,
    /// Root mean square distance of all points, outliers included.
    pub rms_of_all: f64,
    /// Root mean square of the misfit that neighbouring points share, outliers left out: misfit of
    /// shape rather than noise.
    pub systematic: f64,
    /// Significance of the shared misfit, in standard deviations of what independent residuals
    /// show.
    pub systematic_z: f64,
    /// Standard deviation of points from planes through their neighbours: noise, and curvature at
    /// the density of the points.
    pub local_noise: f64,
    /// Thickness of the model's thinnest wall.
    pub thickness: f64,
    /// The smallest thickness of walls and width of gaps.
    pub detail: f64,
    /// Share of the model's surface without data, open parts left out.
    pub bare: f64,
    /// Share of the model's surface, open parts included, without data although most of the surface
    /// with similar normals has data.
    pub overlooked: f64,
    /// Share of the outliers that lie on a surface of their own.
    pub clustered: f64,
}
