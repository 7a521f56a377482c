//! Residual statistics by piece, from the residuals by point.

use crate::by_point::ByPoint;
use crate::deviation::SampledSurface;
use crate::report::parts::PartStatistics;
use crate::task::Task;

impl Task<'_> {
    /// Returns the sums over the used points by piece.
    pub(super) fn part_sums(&self, points: &ByPoint) -> Vec<PartStatistics> {
        let mut sums = vec![PartStatistics::new(""); self.template.part_names().len()];
        let used = points.residuals.iter().zip(&points.outliers);
        for ((r, out), part) in used.zip(&points.parts) {
            if let Some(sums) = sums.get_mut(*part as usize).filter(|_| !out) {
                sums.add(*r);
            }
        }
        sums
    }

    /// Completes the statistics by piece with names and coverage.
    pub(super) fn part_statistics(
        &self,
        mut stats: Vec<PartStatistics>,
        surface: &SampledSurface,
    ) -> Vec<PartStatistics> {
        let cover = surface.cover(stats.len());
        let names = self.template.part_names();
        for ((stats, name), cover) in stats.iter_mut().zip(names).zip(cover) {
            stats.name.clone_from(name);
            stats.close(cover);
        }
        stats
    }
}
