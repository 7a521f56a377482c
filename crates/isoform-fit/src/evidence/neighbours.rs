//! Covariance of the residuals of neighbouring points.

use crate::task::Task;
use crate::thresholds::REPRESENTATIVE_POINTS;
use isoform_geom::{KdTree, Point3};

/// Number of points whose residuals are compared with those of their neighbours.
const NEIGHBOUR_PROBES: usize = 3000;
/// Number of neighbours that are compared; few, so that misfit of small extent shows.
pub(super) const COMPARED_NEIGHBOURS: usize = 4;

/// Covariance of the residuals of neighbours.
pub(super) struct NeighbourCovariance {
    /// Mean product of the residuals of neighbours.
    pub(super) product: f64,
    /// The mean product in standard deviations of what independent residuals show.
    pub(super) z: f64,
}

impl Task<'_> {
    /// Returns the covariance of the residuals of neighbouring foot points.
    pub(super) fn shared(&self, r: &[f64], at: &[Point3]) -> NeighbourCovariance {
        self.shared_by(r, at, |_| true)
    }

    /// Returns the covariance of the residuals of neighbours among some of the points.
    pub(super) fn shared_by(
        &self,
        r: &[f64],
        at: &[Point3],
        is_taken: impl Fn(usize) -> bool,
    ) -> NeighbourCovariance {
        let first = self.order.iter().take(REPRESENTATIVE_POINTS);
        let all = first.map(|&i| i as usize);
        let chosen: Vec<usize> = all.filter(|i| is_taken(*i)).collect();
        let places: Vec<Point3> = chosen.iter().map(|&i| at[i]).collect();
        let r: Vec<f64> = chosen.iter().map(|&i| r[i]).collect();
        let NeighbourProducts { sum, count } = products(&r, &places);
        let squares: f64 = r
            .iter()
            .take(NEIGHBOUR_PROBES)
            .fold(0.0, |sum, r| sum + r * r);
        let product = sum / count.max(1.0);
        let variance = squares / chosen.len().clamp(1, NEIGHBOUR_PROBES) as f64;
        // Most neighbours are mutual: each pair counts twice.
        let deviation = variance / (0.5 * count).max(1.0).sqrt();
        NeighbourCovariance {
            product,
            z: product / deviation.max(f64::MIN_POSITIVE),
        }
    }
}

/// Sum of products of residuals of neighbours, and the number of products.
struct NeighbourProducts {
    sum: f64,
    count: f64,
}

/// Sums the products of the first residuals with those of their neighbours among all points.
fn products(r: &[f64], places: &[Point3]) -> NeighbourProducts {
    let tree = KdTree::new(places);
    let mut found = Vec::new();
    let mut out = NeighbourProducts {
        sum: 0.0,
        count: 0.0,
    };
    for (k, place) in places.iter().enumerate().take(NEIGHBOUR_PROBES) {
        tree.nearest_k(*place, COMPARED_NEIGHBOURS + 1, &mut found);
        for j in found.iter().map(|f| f.1 as usize).filter(|j| *j != k) {
            out.sum += r[k] * r[j];
            out.count += 1.0;
        }
    }
    out
}

/// Replaces residuals that are not finite by `far`.
pub(super) fn with_far(residuals: &[f64], far: f64) -> Vec<f64> {
    let off = |r: &f64| if r.is_finite() { *r } else { far };
    residuals.iter().map(off).collect()
}

/// Replaces the residuals of points left out by zero.
pub(super) fn without(residuals: &[f64], left_out: &[bool]) -> Vec<f64> {
    let all = residuals.iter().zip(left_out);
    all.map(|(r, out)| if *out { 0.0 } else { *r }).collect()
}
