//! The metric reading of functions fitted to points.

use crate::Implicit;
use isoform_geom::{Field, ParamField, Point3, norm};

/// f/|∇f| of a function fitted to points: the signed distance from its surface to first order, positive
/// inside.
#[derive(Clone, Debug)]
pub struct SplineDistance(pub Implicit);

impl SplineDistance {
    /// f/|∇f| and |∇f|'s vector over its length, the Hessian of f left out.
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
    /// The gradients are of unit length, to first order in the distance.
    fn gradients(&self, points: &[Point3], _: &[f64], out: &mut [f64], gradients: &mut [Point3]) {
        for ((p, out), gradient) in points.iter().zip(out).zip(gradients) {
            (*out, *gradient) = self.at(*p);
        }
    }
}
