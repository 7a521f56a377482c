//! Curvatures of level sets.

use crate::{Point3, dot, norm, orthonormal_complement};
use isoform_num::Jet2;

/// Returns the principal curvatures of the level set through a point, positive where it bends
/// towards the inside, where the function is positive; 0 without a gradient.
///
/// With the unit normal n and orthonormal tangents u, v these are the eigenvalues of the Hessian
/// restricted to u and v, divided by −|∇g|.
///
/// ```
/// use isoform_geom::principal_curvatures;
/// use isoform_num::{Jet2, Real};
///
/// // A cylinder of radius 5 around the z axis.
/// let [x, y] = [0, 1].map(|i| Jet2::variable([3.0, 4.0, 7.0][i], i));
/// let [low, high] = principal_curvatures(&(Jet2::constant(25.0) - x * x - y * y));
/// assert!(low.abs() < 1e-15 && (high - 0.2).abs() < 1e-15);
/// ```
pub fn principal_curvatures(j: &Jet2) -> [f64; 2] {
    let l = norm(j.g);
    if !(l > 0.0 && l.is_finite()) {
        return [0.0; 2];
    }
    let [u, v] = orthonormal_complement(j.g.map(|v| v / l));
    let times = |w: Point3| -> Point3 {
        std::array::from_fn(|i| (0..3).map(|k| j.second(i, k) * w[k]).sum())
    };
    let (hu, hv) = (times(u), times(v));
    let (a, b, c) = (dot(u, hu) / l, dot(u, hv) / l, dot(v, hv) / l);
    let (mean, off) = (0.5 * (a + c), (0.25 * (a - c) * (a - c) + b * b).sqrt());
    [-mean - off, off - mean]
}
