//! Statistics of all points together, in memory or in chunks.

use super::{ByPoint, PartStatistics};
use crate::chunks::{Reading, Telling, Which};
use crate::deviation::{self, DataToModel};
use crate::evidence::FAR;
use crate::objective::sum_of_squares;
use crate::polish::Polish;
use crate::scan::MANY_STRAYS;
use crate::task::Task;
use isoform_geom::Point3;

/// Points of the sample that tell where an order statistic of all points lies.
pub(crate) const SAMPLED: usize = 20_000;

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
pub(crate) struct Told {
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
    /// Points farther off than [`FAR_DEVIATIONS`] of these, with their distances.
    pub(crate) far: Vec<(Point3, f64)>,
    /// Σ f² over the used points at each of some parameter vectors.
    pub(crate) algebraic: Vec<f64>,
}

impl Task<'_> {
    /// Computes the statistics of all points. `points` are the results in memory, `limit` is the
    /// distance of outliers, and the algebraic sum is computed at `minima`.
    pub(super) fn told(
        &self,
        a: &[f64],
        points: &ByPoint,
        limit: f64,
        minima: Vec<Vec<f64>>,
    ) -> Told {
        if self.scan.cloud().is_some() {
            return self.told_by_chunks(a, points, limit, minima);
        }
        let (residuals, outliers) = (&points.residuals, &points.outliers);
        let scale = Polish::scale(residuals);
        let is_far = |r: &f64| r.abs() > FAR * scale || !r.is_finite();
        let all = self.points.iter().zip(residuals);
        Told {
            n_points: self.points.len(),
            n_outliers: outliers.iter().filter(|v| **v).count(),
            with_repeats: None,
            data_to_model: deviation::data_to_model(residuals, outliers),
            rms_of_all: None,
            parts: self.part_sums(points),
            scale,
            far: all
                .filter(|(_, r)| is_far(r))
                .map(|(p, r)| (*p, *r))
                .collect(),
            algebraic: minima
                .iter()
                .map(|a| self.algebraic_sum(outliers, a))
                .collect(),
        }
    }

    fn told_by_chunks(
        &self,
        a: &[f64],
        points: &ByPoint,
        limit: f64,
        minima: Vec<Vec<f64>>,
    ) -> Told {
        let cloud = self.scan.cloud().expect("who asks has looked");
        let asked = (Reading::Distance, a);
        let sizes = cloud.sizes(self.template, asked, Which::Distinct, &points.residuals);
        // The list of far points is not used if there is clutter, or no noise.
        let is_asked = sizes.scale > self.rounding() && self.scan.isolated <= MANY_STRAYS;
        let telling = Telling {
            a: a.to_vec(),
            only: Default::default(),
            limit,
            far: if is_asked {
                FAR * sizes.scale
            } else {
                f64::INFINITY
            },
            size: self.size(),
            window: (0.0, f64::INFINITY),
            minima,
        };
        let used = points.residuals.iter().zip(&points.outliers);
        let used = used.filter(|(_, out)| !**out).map(|(r, _)| *r);
        let used: Vec<f64> = used.take(SAMPLED).collect();
        let tally = cloud.told(self.template, &telling, &used);
        let n_used = (tally.n - tally.n_outliers).max(1) as f64;
        Told {
            n_points: tally.n,
            n_outliers: tally.n_outliers,
            with_repeats: Some((cloud.n_points(), tally.n_outliers_of_all)),
            data_to_model: DataToModel {
                rms: (tally.squares / n_used).sqrt(),
                p95: tally.p95,
                max: tally.max,
            },
            rms_of_all: Some((tally.squares_of_all / tally.n.max(1) as f64).sqrt()),
            parts: tally.parts,
            scale: sizes.scale,
            far: tally.far,
            algebraic: tally.algebraic,
        }
    }

    /// Returns Σ f² over the points that are not outliers, without NaN.
    fn algebraic_sum(&self, outliers: &[bool], a: &[f64]) -> f64 {
        let field = self.template.algebraic();
        if !outliers.contains(&true) {
            return sum_of_squares(field, self.points, &[], a);
        }
        let used = self.points.iter().zip(outliers).filter(|(_, o)| !**o);
        let kept: Vec<Point3> = used.map(|(p, _)| *p).collect();
        sum_of_squares(field, &kept, &[], a)
    }
}
