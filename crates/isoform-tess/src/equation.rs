//! The implicit equation in floating point: the first-order distance of a point from the surface.

use crate::surface::Point3;
use isoform_algebra::Implicit;
use isoform_geom::norm;

/// The form F(x, y, z, 1), scaled so that its largest coefficient is ±1.
pub(crate) struct Equation {
    terms: Vec<([i32; 3], f64)>,
}

impl Equation {
    pub(crate) fn new(implicit: &Implicit) -> Self {
        let terms = implicit.equation.to_f64();
        let greatest = terms.iter().map(|t| t.1.abs()).fold(0.0, f64::max);
        Self {
            terms: terms
                .iter()
                .map(|(e, c)| ([0, 1, 2].map(|k| i32::from(e[k])), c / greatest))
                .collect(),
        }
    }
    /// Returns |F| / |∇F|; `None` where the gradient nearly vanishes.
    pub(crate) fn distance(&self, p: Point3) -> Option<f64> {
        let (mut value, mut gradient, mut size) = (0.0, [0.0; 3], 0.0);
        for (e, c) in &self.terms {
            let power = |k: usize, less: i32| p[k].powi(e[k] - less);
            let term = c * power(0, 0) * power(1, 0) * power(2, 0);
            value += term;
            size += term.abs();
            for k in (0..3).filter(|&k| e[k] > 0) {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                gradient[k] += c * f64::from(e[k]) * power(k, 1) * power(i, 0) * power(j, 0);
            }
        }
        let slope = norm(gradient);
        // A shorter gradient, relative to the terms, means that two sheets or a singular point are
        // near.
        (slope > 1e-3 * size).then(|| value.abs() / slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_algebra::{Poly, implicit};
    use isoform_control::Control;

    /// For the unit sphere by stereographic projection F = x² + y² + z² − w² up to a factor, and
    /// |F| / |∇F| = |r² − 1| / 2 r.
    #[test]
    fn sphere() {
        let map = ["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"]
            .map(|f| Poly::parse(f, &["s", "t"]).unwrap());
        let equation = Equation::new(&implicit(&map, 4, &Control::default()).unwrap().unwrap());
        for p in [[0.3, -0.4, 1.2], [0.0, 0.0, 0.5], [2.0, 1.0, -2.0]] {
            let r = norm(p);
            let distance = equation.distance(p).unwrap();
            assert!(
                (distance - (r * r - 1.0).abs() / (2.0 * r)).abs() < 1e-14,
                "{p:?} {distance}"
            );
        }
        assert!(
            equation.distance([0.0; 3]).is_none(),
            "the gradient vanishes in the middle"
        );
    }
}
