//! Cells of a patch in homogeneous coordinates, with bounds on their rounding errors.

use crate::cells::ParameterBox;
use isoform_geom::{Aabb, Point3, RationalPatch, norm};

/// Error bound of one level of de Casteljau's algorithm, in units of the largest homogeneous
/// coordinate of the whole patch: half a unit in the last place of each of three coordinates, as
/// 1.8 > √3.
const SUBDIVISION_ERROR: f64 = 0.5 * 1.8 * f64::EPSILON;

/// Bound on the rounding error of a cell's points, which comes from subdivision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rounding {
    /// Levels of de Casteljau's algorithm that led to the cell.
    levels: f64,
    /// Largest of |X|, |Y| and |Z| of the control points of the whole patch (x, y and z multiplied
    /// by the weight), and largest of their weights.
    size: (f64, f64),
}

impl Rounding {
    /// Returns the error data of a part of a patch.
    pub(super) fn of_part(patch: &RationalPatch, place: ParameterBox) -> Self {
        let (m, n) = patch.degree();
        let halvings = |(a, b): (f64, f64)| -(b - a).log2();
        let size = patch.control().iter().fold((0.0f64, 0.0f64), |(x, w), c| {
            (
                x.max(c[0].abs()).max(c[1].abs()).max(c[2].abs()),
                w.max(c[3].abs()),
            )
        });
        Self {
            // 16 levels stand for all other roundings of the cell's points.
            levels: 16.0 + m as f64 * halvings(place[0]) + n as f64 * halvings(place[1]),
            size,
        }
    }

    /// Returns a bound on the error of points whose coordinates are at most `largest` and whose
    /// weights are at least `least`: x = X/w is off by (ΔX + |x| Δw)/w.
    fn of_points(&self, largest: f64, least: f64) -> f64 {
        SUBDIVISION_ERROR * self.levels * (self.size.0 + largest * self.size.1) / least
            * (1.0 + 1e-9)
    }
}

/// Cell of a patch, in homogeneous coordinates relative to a point c.
pub(super) struct PatchCell {
    /// Point near the centre of the cell.
    pub(super) c: Point3,
    /// Control points less c times their weights: δ and the weight, homogeneous.
    pub(super) d: Vec<[f64; 4]>,
    /// Bounds on the differences of its coordinates from those of c.
    pub(super) r: Point3,
    /// Bound on the rounding error of its points.
    pub(super) rounding: f64,
}

impl PatchCell {
    /// Prepares a cell; `None` if a control weight is not positive.
    pub(super) fn new(patch: &RationalPatch, rounding: Rounding) -> Option<Self> {
        let (least, _) = patch.control_weights();
        if least <= 0.0 {
            return None;
        }
        let c = patch.point(0.5, 0.5);
        // δ over the cell lies in the hull of these; c need not be exact.
        let about = |p: &[f64; 4]| {
            let x = |k: usize| p[k] - c[k] * p[3];
            [x(0), x(1), x(2), p[3]]
        };
        let d: Vec<[f64; 4]> = patch.control().iter().map(about).collect();
        let mut r = [0.0f64; 3];
        let mut largest = 0.0f64;
        for p in &d {
            for k in 0..3 {
                r[k] = r[k].max((p[k] / p[3]).abs() * (1.0 + 1e-12));
                largest = largest.max(c[k].abs() + r[k]);
            }
        }
        let rounding = rounding.of_points(largest, least);
        Some(Self { c, d, r, rounding })
    }

    /// Returns a box that extends by `by` beyond the cell.
    pub(super) fn around(&self, by: f64) -> Aabb {
        let (c, r) = (self.c, self.r);
        Aabb {
            lo: std::array::from_fn(|k| c[k] - r[k] - by),
            hi: std::array::from_fn(|k| c[k] + r[k] + by),
        }
    }

    /// Returns an upper bound on the distance of its points from c.
    pub(super) fn reach(&self) -> f64 {
        norm(self.r)
    }
}
