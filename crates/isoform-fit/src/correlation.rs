//! Spatial correlation of residuals: correlated points carry less information than their number
//! suggests.
//!
//! The covariance of residuals as a function of distance is estimated from pairs of points, in
//! bins, and set to zero from the first bin that is not positive. The covariance of the fitted
//! variables is then A⁻¹ (Jᵀ C J) A⁻¹ instead of s² A⁻¹: smooth misfit (a dent, a shrunk casting,
//! facets of a mesh, noise of a scanner that smooths) widens the intervals accordingly. Compare the
//! variogram of geostatistics, and Kermarrec et al. (2022), J. Geodesy, for range data.

use crate::residuals::jacobian;
use crate::space::Space;
use crate::vector::scale;
use isoform_geom::{ParamField, Point3, near_pairs};

/// Number of distance bins. With a width of 1.2 % of the data's size they cover misfit of up to a
/// fifth of the size; longer waves resemble other dimensions and are left to the verdict.
const DISTANCE_BINS: usize = 16;
/// Number of the nearest bins, which are tested for correlation.
const NEAREST_BINS: usize = 3;

/// Covariance of residuals as a function of distance.
pub(crate) struct Correlation {
    points: Vec<Point3>,
    step: f64,
    /// Covariance by bin, in squared units of the residuals.
    covariance: [f64; DISTANCE_BINS],
    /// Number of points that each sampled one represents.
    share: f64,
    /// Covariance of near neighbours over the variance.
    pub(crate) nearest: f64,
}

/// Sums of products over pairs of points by the bin of their distance, each pair once.
struct BinnedProducts {
    sums: [f64; DISTANCE_BINS],
    counts: [f64; DISTANCE_BINS],
}

impl BinnedProducts {
    fn mean(&self, bin: usize) -> f64 {
        self.sums[bin] / self.counts[bin].max(1.0)
    }
}

impl Correlation {
    /// Estimates the covariance; `None` if residuals of neighbours are not significantly
    /// correlated. `order` is a random order of the points; residuals of zero are left out.
    pub(crate) fn estimate(
        points: &[Point3],
        residuals: &[f64],
        order: &[u32],
        size: f64,
    ) -> Option<Self> {
        let chosen = chosen(residuals, order);
        let some: Vec<Point3> = chosen.iter().map(|&i| points[i]).collect();
        let r: Vec<f64> = chosen.iter().map(|&i| residuals[i]).collect();
        let n = (r.len() as f64).max(1.0);
        let mut this = Self {
            points: some,
            step: 0.012 * size,
            covariance: [0.0; DISTANCE_BINS],
            share: points.len() as f64 / n,
            nearest: 0.0,
        };
        let variance = r.iter().map(|v| v * v).sum::<f64>() / n;
        let near = this.near_covariance(&r, variance)?;
        this.nearest = near / variance;
        this.set_covariance(&r, near);
        Some(this)
    }

    /// Returns the covariance of near neighbours if it exceeds 2.12 standard deviations of what
    /// independent residuals show. Chance widens the intervals of one fit in sixty, by little.
    fn near_covariance(&self, r: &[f64], variance: f64) -> Option<f64> {
        let products = self.products(r, NEAREST_BINS);
        let (sum, count): (f64, f64) = (products.sums.iter().sum(), products.counts.iter().sum());
        let near = sum / count.max(1.0);
        let chance = 2.12 * variance / count.max(1.0).sqrt();
        Some(near).filter(|near| !near.is_nan() && (*near >= chance || chance.is_nan()))
    }

    /// Sets the covariance by bin, zero from the first bin that is not positive.
    fn set_covariance(&mut self, r: &[f64], near: f64) {
        let products = self.products(r, DISTANCE_BINS);
        let of_bin = |b: usize| {
            if b < NEAREST_BINS {
                near
            } else {
                products.mean(b)
            }
        };
        self.covariance = std::array::from_fn(of_bin);
        if let Some(end) = self.covariance.iter().position(|c| *c <= 0.0) {
            self.covariance[end..].fill(0.0);
        }
    }

    /// Sums the products of residuals by bin.
    fn products(&self, r: &[f64], bins: usize) -> BinnedProducts {
        let mut out = BinnedProducts {
            sums: [0.0; DISTANCE_BINS],
            counts: [0.0; DISTANCE_BINS],
        };
        self.pairs(bins, |i, j, b| {
            out.sums[b] += r[i] * r[j];
            out.counts[b] += 1.0;
        });
        out
    }

    /// Enumerates the pairs of points in the first bins, each with its bin.
    fn pairs(&self, bins: usize, mut each: impl FnMut(usize, usize, usize)) {
        near_pairs(&self.points, self.step * bins as f64, |i, j, squared| {
            let b = (squared.sqrt() / self.step) as usize;
            if b < bins {
                each(i, j, b);
            }
        });
    }

    /// Returns Σ C(|pᵢ − pⱼ|) Jᵢ Jⱼᵀ over the pairs i ≠ j of all points, in the variables.
    pub(crate) fn cross(&self, field: &dyn ParamField, space: &Space, x: &[f64]) -> Vec<f64> {
        let m = space.len();
        let rows = self.derivatives(field, space, x);
        let row = |i: usize| &rows[i * m..(i + 1) * m];
        // Σⱼ C(|pᵢ − pⱼ|) Jⱼ by point i.
        let mut near = vec![0.0; rows.len()];
        self.pairs(DISTANCE_BINS, |i, j, b| {
            let c = self.covariance[b];
            if c > 0.0 {
                for (i, j) in [(i, j), (j, i)] {
                    let sum = near[i * m..(i + 1) * m].iter_mut().zip(row(j));
                    sum.for_each(|(s, v)| *s += c * v);
                }
            }
        });
        let mut out = vec![0.0; m * m];
        for (near, row) in near.chunks_exact(m).zip(rows.chunks_exact(m)) {
            for (out, own) in out.chunks_exact_mut(m).zip(row) {
                out.iter_mut().zip(near).for_each(|(s, v)| *s += own * v);
            }
        }
        scale(&mut out, self.share * self.share);
        out
    }

    /// Returns the derivatives of the residuals by the variables, point by point.
    fn derivatives(&self, field: &dyn ParamField, space: &Space, x: &[f64]) -> Vec<f64> {
        let jac = jacobian(field, &self.points, &space.parameters(x));
        let of_point = |row| (0..space.len()).map(move |k| space.derivative(k, row));
        jac.chunks_exact(field.dim()).flat_map(of_point).collect()
    }
}

/// Returns the first 3000 points in the order with finite nonzero residuals. The cost of the sums
/// over pairs grows with the square of their number.
fn chosen(residuals: &[f64], order: &[u32]) -> Vec<usize> {
    let is_used = |i: &usize| residuals[*i] != 0.0 && residuals[*i].is_finite();
    let used = order.iter().map(|&i| i as usize).filter(is_used);
    used.take(3000).collect()
}
