//! Statistics of all points together, in memory or in chunks.

use crate::by_point::ByPoint;
use crate::chunks::{PointSet, Reading, StatisticsQuery};
use crate::deviation::{self, DataToModel};
use crate::polish::Polish;
use crate::residuals::sum_of_squares;
use crate::tally::PointStatistics;
use crate::task::Task;
use crate::thresholds::{CLUTTER_STRAY_SHARE, FAR_DEVIATIONS, REPRESENTATIVE_POINTS};
use isoform_geom::Point3;

impl Task<'_> {
    /// Computes the statistics of all points. `points` are the results in memory, `limit` is the
    /// distance of outliers, and the algebraic sum is computed at `minima`.
    pub(super) fn statistics(
        &self,
        a: &[f64],
        points: &ByPoint,
        limit: f64,
        minima: Vec<Vec<f64>>,
    ) -> PointStatistics {
        if self.scan.cloud().is_some() {
            return self.statistics_of_chunks(a, points, limit, minima);
        }
        let (residuals, outliers) = (&points.residuals, &points.outliers);
        let scale = Polish::scale(residuals);
        let is_far = |r: &f64| r.abs() > FAR_DEVIATIONS * scale || !r.is_finite();
        let all = self.points.iter().zip(residuals);
        PointStatistics {
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

    fn statistics_of_chunks(
        &self,
        a: &[f64],
        points: &ByPoint,
        limit: f64,
        minima: Vec<Vec<f64>>,
    ) -> PointStatistics {
        let cloud = self
            .scan
            .cloud()
            .expect("who asks has decode_count_and_bounds");
        let asked = (Reading::Distance, a);
        let sizes = cloud.sizes(self.template, asked, PointSet::Distinct, &points.residuals);
        // The list of far points is not used if there is clutter, or no noise.
        let is_asked = sizes.scale > self.rounding() && self.scan.isolated <= CLUTTER_STRAY_SHARE;
        let telling = StatisticsQuery {
            a: a.to_vec(),
            only: Default::default(),
            limit,
            far: if is_asked {
                FAR_DEVIATIONS * sizes.scale
            } else {
                f64::INFINITY
            },
            size: self.size(),
            window: (0.0, f64::INFINITY),
            minima,
        };
        let used = points.residuals.iter().zip(&points.outliers);
        let used = used.filter(|(_, out)| !**out).map(|(r, _)| *r);
        let used: Vec<f64> = used.take(REPRESENTATIVE_POINTS).collect();
        let tally = cloud.statistics(self.template, &telling, &used);
        let n_used = (tally.n - tally.n_outliers).max(1) as f64;
        PointStatistics {
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
