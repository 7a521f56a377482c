//! Covariance of the variables, and quantiles for intervals.

use super::local_fit::{ExaminedFit, MIN_CURVATURE_SHARE};
use crate::matrix::{inverse, is_positive, largest, product};
use crate::polish::{slope, weight};
use crate::vector::scale;

/// Covariance for independent residuals, and the inverse of the normal matrix.
type WithInverse = (Vec<f64>, Vec<f64>);

impl ExaminedFit<'_> {
    /// Returns the covariance of the variables that are not held, for independent residuals, and
    /// the inverse of their normal matrix. `normal` is that of `Knowledge` at this fit, if known.
    pub(crate) fn covariance_without(&self, held: &[bool], normal: Option<&[f64]>) -> WithInverse {
        let h = normal.map_or_else(|| self.weighted_normal(), <[f64]>::to_vec);
        let floor = MIN_CURVATURE_SHARE * largest(&h, self.space.len());
        let (mut covariance, inverse) = if self.loss.is_robust() {
            self.sandwich(&h, held, floor)
        } else {
            self.of_squares(&h, held, floor)
        };
        let shared = self.shared_rounding();
        let sums = covariance.iter_mut().zip(&inverse);
        sums.for_each(|(c, i)| *c += shared * i);
        (covariance, inverse)
    }

    /// Returns the variance due to rounding that all points of a face share, per entry of the
    /// inverse of the normal matrix: averaging does not reduce it.
    ///
    /// Errors of at most ρ that n points share move a variable by ρ Σᵢ |(A⁻¹ J)ᵢ| at most, which is
    /// ρ √n √(A⁻¹) by Cauchy and Schwarz; uniformly distributed errors have the deviation ρ/√3.
    /// Noise of deviation σ makes errors of steps 2ρ independent except for the share
    /// exp(−π²σ²/2ρ²) (B. Widrow, Statistical analysis of amplitude-quantized sampled-data systems,
    /// AIEE Trans. 79, 1961).
    fn shared_rounding(&self) -> f64 {
        if self.rounding <= 0.0 {
            return 0.0;
        }
        let ratio = std::f64::consts::PI * self.scale / self.rounding;
        let shared = self.rounding * (-0.5 * ratio * ratio).exp();
        self.used() as f64 * shared * shared / 3.0
    }

    /// Counts the points that are not left out.
    fn used(&self) -> usize {
        if self.mask.is_empty() {
            self.residuals.len()
        } else {
            self.mask.iter().filter(|m| **m > 0.0).count()
        }
    }

    /// Returns the degrees of freedom.
    fn degrees(&self, held: &[bool]) -> f64 {
        let free = held.iter().filter(|v| !**v).count();
        (self.used() as f64 - free as f64).max(1.0)
    }

    /// Returns s² (JᵀJ)⁻¹.
    fn of_squares(&self, h: &[f64], held: &[bool], floor: f64) -> WithInverse {
        let used = self.residuals.iter().enumerate();
        let used = used.filter(|(i, r)| r.is_finite() && self.mask.get(*i) != Some(&0.0));
        let sum: f64 = used.map(|(_, r)| r * r).sum();
        let inverse = inverse(h, self.space.len(), held, floor);
        let variance = (sum / self.degrees(held)).max(self.least_scale.powi(2));
        let mut covariance = inverse.clone();
        scale(&mut covariance, variance);
        (covariance, inverse)
    }

    /// Returns the sandwich estimate A⁻¹ B A⁻¹ with A = Σ ψ′ J Jᵀ and B = Σ ψ² J Jᵀ.
    fn sandwich(&self, h: &[f64], held: &[bool], floor: f64) -> WithInverse {
        let (m, s) = (self.space.len(), self.deviation());
        let a = self.slopes();
        // Points that the model meets exactly are still subject to rounding.
        let least = (s * s - self.scale * self.scale).max(0.0);
        let squares = self.masked(|r| weight(self.loss, r / s).powi(2) * (r * r + least));
        let b = self.normal(&squares);
        // Where the slopes do not make a positive matrix (few points, gross misfit), the weights
        // are used.
        let is_sound = is_positive(&a, m, floor);
        let c = inverse(if is_sound { &a } else { h }, m, held, floor);
        let mut covariance = product(&product(&c, &b, m), &c, m);
        scale(&mut covariance, self.used() as f64 / self.degrees(held));
        (covariance, c)
    }

    /// Returns Σ ψ′ J Jᵀ. Normal equations take the roots of their weights, so positive and
    /// negative weights are summed separately.
    fn slopes(&self) -> Vec<f64> {
        let s = self.deviation();
        let slopes = self.masked(|r| slope(self.loss, r / s));
        let plus: Vec<f64> = slopes.iter().map(|v| v.max(0.0)).collect();
        let minus: Vec<f64> = slopes.iter().map(|v| (-v).max(0.0)).collect();
        crate::vector::minus(&self.normal(&plus), &self.normal(&minus))
    }
}

/// Returns the half width of a 95 % interval in standard deviations: the quantile of Student's t
/// distribution with the given degrees of freedom.
pub(crate) fn student95(degrees: f64) -> f64 {
    let z = 1.959_963_984_540_054; // of the normal distribution
    let v = degrees.max(1.0);
    if v < 3.0 {
        return if v < 2.0 { 12.706 } else { 4.303 };
    }
    // Cornish-Fisher expansion, with errors of 1e-3 from 7 degrees on, of 0.025 at 3.
    let z2 = z * z;
    z + z * (z2 + 1.0) / (4.0 * v)
        + z * ((5.0 * z2 + 16.0) * z2 + 3.0) / (96.0 * v * v)
        + z * (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / (384.0 * v * v * v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn students_intervals_are_those_of_tables() {
        for (degrees, t) in [(7.0, 2.3646), (10.0, 2.2281), (30.0, 2.0423), (1e9, 1.9600)] {
            assert!((student95(degrees) - t).abs() < 1e-3, "{degrees}");
        }
    }
}
