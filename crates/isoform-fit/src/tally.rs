//! Statistics of all points of a fit, and the sums from which they follow.

use crate::deviation::DataToModel;
use crate::report::parts::PartStatistics;
use isoform_geom::Point3;

/// Sums over points of chunks.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tally {
    pub(crate) n: usize,
    pub(crate) n_outliers: usize,
    /// Number of outliers among all points, repeated ones included.
    pub(crate) n_outliers_of_all: usize,
    /// Sum of squared distances of the used points.
    pub(crate) squares: f64,
    /// Largest of these distances.
    pub(crate) max: f64,
    /// Sum of squared distances of all points.
    pub(crate) squares_of_all: f64,
    /// Number of used points below the window.
    pub(crate) below: usize,
    /// Distances of used points in the window.
    pub(crate) window: Vec<f64>,
    /// 95th percentile of the distances of the used points.
    pub(crate) p95: f64,
    /// Σ f² over the used points at each of some parameter vectors.
    pub(crate) algebraic: Vec<f64>,
    /// Statistics by part, with sums in place of means.
    pub(crate) parts: Vec<PartStatistics>,
    /// Points far off the model, with their distances.
    pub(crate) far: Vec<(Point3, f64)>,
}

impl Tally {
    pub(crate) fn new(parts: usize) -> Self {
        Self {
            parts: vec![PartStatistics::new(""); parts],
            ..Self::default()
        }
    }

    /// Adds a point; `far` replaces a distance that is not finite.
    pub(crate) fn add(&mut self, r: f64, is_out: bool, part: u32, far: f64) {
        let off = if r.is_finite() { r } else { far };
        self.n += 1;
        self.squares_of_all += off * off;
        if is_out {
            self.n_outliers += 1;
            return;
        }
        self.squares += r * r;
        self.max = self.max.max(r.abs());
        if let Some(part) = self.parts.get_mut(part as usize) {
            part.add(r);
        }
    }
}

/// Statistics of all points.
pub(crate) struct PointStatistics {
    pub(crate) n_points: usize,
    pub(crate) n_outliers: usize,
    /// Number of points and outliers, repeated ones included; `None` for points in memory.
    pub(crate) with_repeats: Option<(usize, usize)>,
    pub(crate) data_to_model: DataToModel,
    /// Root mean square distance of all points; `None` for points in memory.
    pub(crate) rms_of_all: Option<f64>,
    /// Statistics by part, with sums in place of means.
    pub(crate) parts: Vec<PartStatistics>,
    /// Robust standard deviation of the distances.
    pub(crate) scale: f64,
    /// Points farther off than four of these deviations, with their distances.
    pub(crate) far: Vec<(Point3, f64)>,
    /// Σ f² over the used points at each of some parameter vectors.
    pub(crate) algebraic: Vec<f64>,
}
