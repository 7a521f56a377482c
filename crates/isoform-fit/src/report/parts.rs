//! Residual statistics by piece of the model.

use crate::deviation::Cover;

/// Residual statistics of one piece of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct PartStatistics {
    /// Name.
    pub name: String,
    /// Number of used points that are nearest to it.
    pub count: usize,
    /// Root mean square of their residuals.
    pub rms: f64,
    /// Mean of their residuals; inside is positive.
    pub mean: f64,
    /// Largest absolute residual.
    pub max: f64,
    /// Share of the piece's surface without data; `None` if it has no samples.
    pub uncovered: Option<f64>,
}

impl PartStatistics {
    pub(crate) fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            count: 0,
            rms: 0.0,
            mean: 0.0,
            max: 0.0,
            uncovered: None,
        }
    }

    /// Adds a residual; `rms` and `mean` are sums until [`PartStatistics::close`].
    pub(crate) fn add(&mut self, r: f64) {
        self.count += 1;
        self.rms += r * r;
        self.mean += r;
        self.max = self.max.max(r.abs());
    }

    /// Replaces sums by means.
    pub(crate) fn close(&mut self, cover: Cover) {
        let n = self.count.max(1) as f64;
        self.rms = (self.rms / n).sqrt();
        self.mean /= n;
        let share = cover.bare as f64 / cover.samples as f64;
        self.uncovered = (cover.samples > 0).then_some(share);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_residuals_make_a_mean() {
        let mut s = PartStatistics::new("lid");
        s.add(3.0);
        s.add(-4.0);
        s.close(Cover {
            samples: 8,
            bare: 2,
        });
        assert_eq!((s.count, s.mean, s.max), (2, -0.5, 4.0));
        assert_eq!((s.rms, s.uncovered), (12.5f64.sqrt(), Some(0.25)));
    }
}
