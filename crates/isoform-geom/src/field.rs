//! What a stage asks of an implicit function.

use crate::{Aabb, Point3};
use isoform_num::{Interval, Jet2, Jet3};

/// A function of space; inside is `value ≥ 0`, the outward normal is −∇f/|∇f|.
pub trait Field: Send + Sync {
    /// f(p).
    fn value(&self, p: Point3) -> f64;
    /// f with gradient and Hessian.
    fn jet(&self, p: Point3) -> Jet2;
    /// An interval that holds f over the whole region; proves nothing by default.
    fn bounds(&self, _region: Aabb) -> Interval {
        Interval::ALL
    }
    /// f at many points; override to go fast.
    fn values(&self, points: &[Point3], out: &mut [f64]) {
        for (p, v) in points.iter().zip(out) {
            *v = self.value(*p);
        }
    }
    /// 2-jets at many points; override to go fast.
    fn jets(&self, points: &[Point3], out: &mut [Jet2]) {
        for (p, j) in points.iter().zip(out) {
            *j = self.jet(*p);
        }
    }
    /// f with all derivatives to order 3; nothing by default.
    fn jet3(&self, _p: Point3) -> Option<Jet3> {
        None
    }
    /// What can be proved of f near a point: intervals for its derivatives there, and for the third ones in the whole region,
    /// which holds the point. Nothing by default.
    fn expansion(&self, _at: Point3, _region: Aabb) -> Option<Expansion> {
        None
    }
    /// The terms c xⁱyʲzᵏ, as ([i, j, k], c), of an f that is their sum; nothing by default.
    fn terms(&self) -> Option<&[([u16; 3], f64)]> {
        None
    }
}

/// Intervals for a function's derivatives: those to order 2 at a point, those of order 3 in a region about it. By Taylor's theorem
/// they enclose f in the region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expansion {
    /// f at the point.
    pub value: Interval,
    /// ∇f at the point.
    pub gradient: [Interval; 3],
    /// Second derivatives xx, xy, xz, yy, yz, zz at the point.
    pub hessian: [Interval; 6],
    /// Third derivatives xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz in the region.
    pub third: [Interval; 10],
}

/// A function of space with parameters a: the residual of a fit.
pub trait ParamField: Send + Sync {
    /// Number of parameters.
    fn dim(&self) -> usize;
    /// f(pᵢ, a) for all points.
    fn values(&self, points: &[Point3], a: &[f64], out: &mut [f64]);
    /// f(pᵢ, a) and its derivatives by the parameters, point by point: `jac[i * dim + j]` = ∂f(pᵢ)/∂aⱼ.
    fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], jac: &mut [f64]);
    /// Weighted normal equations: Σ wᵢ fᵢ², Jᵀ W f into `gradient` (dim) and Jᵀ W J into `hessian` (dim × dim, full symmetric).
    /// `weights` empty means all 1. The sums run in a fixed order: the same bits each time.
    fn normal_equations(
        &self,
        points: &[Point3],
        weights: &[f64],
        a: &[f64],
        gradient: &mut [f64],
        hessian: &mut [f64],
    ) -> f64;
    /// f(pᵢ, a) and its gradient in space, point by point.
    fn gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], gradients: &mut [Point3]);
    /// Σ wᵢ fᵢ², in the same order of summation as [`ParamField::normal_equations`].
    fn sum_of_squares(&self, points: &[Point3], weights: &[f64], a: &[f64]) -> f64;
}
