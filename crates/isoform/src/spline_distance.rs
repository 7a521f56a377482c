//! Metric functions of functions fitted to points.

use crate::Implicit;
use isoform_geom::{Field, ParamField, Point3, norm};

/// Signed distance to first order f/|∇f| from the surface of a function fitted to points, positive
/// inside.
#[derive(Clone, Debug)]
pub struct SplineDistance(pub Implicit);

impl SplineDistance {
    /// Returns f/|∇f| and the unit vector ∇f/|∇f|, which is its gradient without the Hessian of f.
    fn at(&self, p: Point3) -> (f64, Point3) {
        let jet = self.0.jet(p);
        let slope = norm(jet.g);
        (jet.v / slope, jet.g.map(|g| g / slope))
    }
}

impl ParamField for SplineDistance {
    fn dim(&self) -> usize {
        0
    }
    fn values(&self, points: &[Point3], _: &[f64], out: &mut [f64]) {
        for (p, out) in points.iter().zip(out) {
            *out = self.at(*p).0;
        }
    }
    fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], _: &mut [f64]) {
        self.values(points, a, out);
    }
    /// Gradients of unit length: exact on the surface.
    fn gradients(&self, points: &[Point3], _: &[f64], out: &mut [f64], gradients: &mut [Point3]) {
        for ((p, out), gradient) in points.iter().zip(out).zip(gradients) {
            (*out, *gradient) = self.at(*p);
        }
    }
}
