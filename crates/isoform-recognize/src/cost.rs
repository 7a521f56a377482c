//! Cost of points in a description, in nats.

use crate::noise::{EXPLAINED_DEVIATIONS, MAX_EXACT_NOISE};

/// Cost of points with a given noise: r²/2σ² at a distance r from their surface, and at most that
/// of points without one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cost {
    /// 1/2σ².
    scale: f64,
    /// Cost of a point without a surface. Of exact points it is ln(1/σ), since they may lie
    /// anywhere along the diagonal, which is 1; with noise it is that of a distance of
    /// [`EXPLAINED_DEVIATIONS`].
    pub(crate) most: f64,
}

impl Cost {
    /// Returns the cost of points with this noise, in diagonals.
    pub(crate) fn with_noise(noise: f64) -> Self {
        Self {
            scale: 1.0 / (2.0 * noise * noise),
            most: match noise < MAX_EXACT_NOISE {
                true => -noise.ln(),
                false => EXPLAINED_DEVIATIONS * EXPLAINED_DEVIATIONS / 2.0,
            },
        }
    }

    /// Returns r²/2σ².
    pub(crate) fn of_distance(&self, r: f64) -> f64 {
        self.of_squares(r * r)
    }

    /// Returns Σ r²/2σ², of points that have a surface.
    pub(crate) fn of_squares(&self, squares: f64) -> f64 {
        squares * self.scale
    }

    /// Returns the cost of a point at a distance r from its surface: without it, if that is less.
    pub(crate) fn of_point(&self, r: f64) -> f64 {
        self.of_distance(r).min(self.most)
    }

    /// Returns [`of_distance`](Self::of_distance), or infinity if a point costs less without the
    /// surface.
    pub(crate) fn if_near(&self, r: f64) -> f64 {
        let cost = self.of_distance(r);
        if cost <= self.most {
            cost
        } else {
            f64::INFINITY
        }
    }

    /// Returns the distance beyond which a point costs less without the surface.
    pub(crate) fn reach(&self) -> f64 {
        (self.most / self.scale).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_belong_where_they_cost_less() {
        for (noise, deviations) in [(0.01, 3.0), (1e-8, (2.0 * 1e8_f64.ln()).sqrt())] {
            let cost = Cost::with_noise(noise);
            assert!((cost.reach() / noise - deviations).abs() < 1e-9);
            assert!(cost.if_near(0.999 * cost.reach()) <= cost.most);
            assert_eq!(cost.if_near(1.001 * cost.reach()), f64::INFINITY);
            assert!((cost.of_distance(2.0 * noise) - 2.0).abs() < 1e-12);
            assert!((cost.of_point(2.0 * noise) - 2.0).abs() < 1e-12);
            assert_eq!(cost.of_point(1.001 * cost.reach()), cost.most);
        }
    }
}
