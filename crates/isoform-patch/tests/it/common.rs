//! Surfaces shared by the tests.

use isoform_field::Polynomial;
use isoform_geom::{Aabb, RationalPatch};

pub(crate) const CUBE: Aabb = Aabb {
    lo: [-0.5; 3],
    hi: [0.5; 3],
};

/// Sphere x² + y² + z² − r².
pub(crate) fn sphere(r: f64) -> Polynomial {
    Polynomial::new([
        ([2, 0, 0], 1.0),
        ([0, 2, 0], 1.0),
        ([0, 0, 2], 1.0),
        ([0, 0, 0], -r * r),
    ])
}
/// Whitney's umbrella x² = y² (z + 1/2).
pub(crate) fn whitney() -> Polynomial {
    Polynomial::new([([2, 0, 0], 1.0), ([0, 2, 1], -1.0), ([0, 2, 0], -0.5)])
}
/// Torus (x² + y² + z² + R² − r²)² = 4 R² (x² + y²).
pub(crate) fn torus(major: f64, minor: f64) -> Polynomial {
    let (r2, c) = (major * major, major * major - minor * minor);
    let mut terms = vec![
        ([2, 0, 0], 2.0 * c - 4.0 * r2),
        ([0, 2, 0], 2.0 * c - 4.0 * r2),
        ([0, 0, 2], 2.0 * c),
        ([0, 0, 0], c * c),
    ];
    terms.extend([[4, 0, 0], [0, 4, 0], [0, 0, 4]].map(|e| (e, 1.0)));
    terms.extend([[2, 2, 0], [2, 0, 2], [0, 2, 2]].map(|e| (e, 2.0)));
    Polynomial::new(terms)
}
/// Quartic without symmetry.
pub(crate) fn quartic() -> Polynomial {
    Polynomial::new([
        ([4, 0, 0], 1.0),
        ([1, 2, 1], -0.7),
        ([0, 3, 0], 0.4),
        ([0, 0, 2], 1.3),
        ([1, 0, 0], 0.2),
        ([0, 0, 1], -0.9),
        ([0, 0, 0], -0.1),
    ])
}

/// Stereographic patch on the sphere of radius r: (2s, 2t, s² + t² − 1, s² + t² + 1) for s, t in
/// [−a, a], around the lowest point.
pub(crate) fn stereographic(r: f64, a: f64) -> RationalPatch {
    // Bernstein coefficients of 1, s and s² on [−a, a].
    let (one, s, s2) = ([1.0; 3], [-a, 0.0, a], [a * a, -a * a, a * a]);
    let mut control = Vec::new();
    for i in 0..3 {
        for j in 0..3 {
            let q = s2[i] * one[j] + one[i] * s2[j];
            control.push([2.0 * r * s[i], 2.0 * r * s[j], r * (q - 1.0), q + 1.0]);
        }
    }
    RationalPatch::new((2, 2), control).expect("a patch")
}
