//! Residuals of neighbours that are alike: points that say less than their number.
//!
//! The covariance of residuals by distance is estimated from pairs of points, in bins, and is taken
//! for nought from where it is no longer positive. Then the covariance of the fitted variables is
//! A⁻¹ (Jᵀ C J) A⁻¹ instead of s² A⁻¹: smooth misfit (a dent, a shrunk casting, facets of a mesh,
//! noise of a scanner that smooths) widens the intervals by what it truly costs. Compare the
//! variogram of geostatistics, and Kermarrec et al. (2022), J. Geodesy, for range data.

use crate::space::Space;
use isoform_geom::{KdTree, ParamField, Point3};

/// Bins of distance...
const BINS: usize = 16;
/// ... of this share of the data's size each: misfit of up to a fifth of the size is seen; longer
/// waves look like other dimensions and are the verdict's business.
const STEP: f64 = 0.012;
/// Bins that tell whether there is any correlation.
const NEAREST: usize = 3;
/// The correlation must exceed this many deviations of what independent residuals show.
const SURE: f64 = 3.0;
/// Points whose pairs are looked at. The sums over pairs grow with the square.
const SAMPLE: usize = 3000;

/// The covariance of residuals at a distance.
pub(crate) struct Correlation {
    points: Vec<Point3>,
    tree: KdTree,
    step: f64,
    /// By bin, in squared units of the residuals.
    covariance: [f64; BINS],
    /// Points that each sampled one stands for.
    share: f64,
    /// Covariance of near neighbours over the variance.
    pub(crate) nearest: f64,
}

impl Correlation {
    /// None where residuals of neighbours are as good as independent. `order` is a random order of
    /// the points; residuals that are nought count for nothing.
    pub(crate) fn of(
        points: &[Point3],
        residuals: &[f64],
        order: &[u32],
        size: f64,
    ) -> Option<Self> {
        let used = order
            .iter()
            .map(|&i| i as usize)
            .filter(|&i| residuals[i] != 0.0 && residuals[i].is_finite());
        let chosen: Vec<usize> = used.take(SAMPLE).collect();
        let some: Vec<Point3> = chosen.iter().map(|&i| points[i]).collect();
        let r: Vec<f64> = chosen.iter().map(|&i| residuals[i]).collect();
        let n = r.len() as f64;
        let step = STEP * size;
        let mut this = Self {
            tree: KdTree::new(&some),
            points: some,
            step,
            covariance: [0.0; BINS],
            share: points.len() as f64 / n.max(1.0),
            nearest: 0.0,
        };
        let variance = r.iter().map(|v| v * v).sum::<f64>() / n.max(1.0);
        let (sums, counts) = this.products(&r, NEAREST);
        let (sum, count): (f64, f64) = (sums.iter().sum(), counts.iter().sum());
        let near = sum / count.max(1.0);
        if near.is_nan() || near < SURE * variance / count.max(1.0).sqrt() {
            return None;
        }
        let (sums, counts) = this.products(&r, BINS);
        for (b, c) in this.covariance.iter_mut().enumerate() {
            *c = if b < NEAREST {
                near
            } else {
                sums[b] / counts[b].max(1.0)
            };
        }
        if let Some(end) = this.covariance.iter().position(|c| *c <= 0.0) {
            this.covariance[end..].fill(0.0);
        }
        this.nearest = near / variance;
        Some(this)
    }

    /// Sums and counts of products of residuals, by bin, each pair twice.
    fn products(&self, r: &[f64], bins: usize) -> ([f64; BINS], [f64; BINS]) {
        let (mut sums, mut counts) = ([0.0; BINS], [0.0; BINS]);
        for (i, p) in self.points.iter().enumerate() {
            self.pairs(i, *p, bins, |j, b| {
                sums[b] += r[i] * r[j];
                counts[b] += 1.0;
            });
        }
        (sums, counts)
    }

    /// The other points within so many bins of point i.
    fn pairs(&self, i: usize, p: Point3, bins: usize, mut each: impl FnMut(usize, usize)) {
        let reach = (self.step * bins as f64).powi(2);
        self.tree.near(p, reach, &mut |squared, j| {
            let b = (squared.sqrt() / self.step) as usize;
            if j as usize != i && b < bins {
                each(j as usize, b);
            }
            reach
        });
    }

    /// Σ C(|pᵢ − pⱼ|) Jᵢ Jⱼᵀ over the pairs i ≠ j of all points, in the variables.
    pub(crate) fn cross(&self, field: &dyn ParamField, space: &Space, x: &[f64]) -> Vec<f64> {
        let (n, m) = (field.dim(), space.len());
        let mut a = vec![0.0; n];
        space.parameters_at(x, &mut a);
        let (mut f, mut jac) = (
            vec![0.0; self.points.len()],
            vec![0.0; self.points.len() * n],
        );
        field.jacobian(&self.points, &a, &mut f, &mut jac);
        let rows: Vec<f64> = jac
            .chunks_exact(n)
            .flat_map(|row| {
                (0..m).map(|k| {
                    space
                        .column(k)
                        .iter()
                        .map(|&(i, c)| c * row[i])
                        .sum::<f64>()
                })
            })
            .collect();
        let mut out = vec![0.0; m * m];
        let mut near = vec![0.0; m];
        for (i, p) in self.points.iter().enumerate() {
            near.fill(0.0);
            self.pairs(i, *p, BINS, |j, b| {
                let c = self.covariance[b];
                if c > 0.0 {
                    near.iter_mut()
                        .zip(&rows[j * m..(j + 1) * m])
                        .for_each(|(s, v)| *s += c * v);
                }
            });
            for j in 0..m {
                for k in 0..m {
                    out[j * m + k] += rows[i * m + j] * near[k];
                }
            }
        }
        let share = self.share * self.share;
        out.iter_mut().for_each(|v| *v *= share);
        out
    }
}
