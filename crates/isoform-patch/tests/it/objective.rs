//! Objective compared with closed forms and differences.

use crate::common::{CUBE, quartic, sphere, stereographic, whitney};
use isoform_geom::{Field, RationalPatch, cross, norm};
use isoform_patch::{Inner, Method, Objective, Targets, Weights};

fn objective<'f>(field: &'f dyn Field, degree: (usize, usize), method: Method) -> Objective<'f> {
    let mut o = Objective::new(field, degree, method, None);
    o.weights = Weights {
        j: 0.3,
        l: 0.7,
        r: 1.1,
        e: 0.9,
    };
    o.targets = Targets {
        l1: 0.3,
        l2: 0.2,
        corners: [
            [0.1, 0.2, 0.3],
            [0.5, 0.1, 0.2],
            [0.0, 0.6, 0.2],
            [0.4, 0.5, 0.1],
        ],
    };
    o
}

/// Returns a patch with distinct weights.
fn bent(m: usize, n: usize) -> RationalPatch {
    let at = |i: usize, j: usize| {
        let (s, t) = (i as f64 / m as f64, j as f64 / n as f64);
        let w = 1.0 + 0.2 * (3.0 * s - 2.0 * t).sin();
        [
            w * (0.5 * s + 0.1 * t),
            w * (0.4 * t + 0.1 * s * s),
            w * (0.3 + 0.2 * s * t - 0.1 * s),
            w,
        ]
    };
    RationalPatch::new(
        (m, n),
        (0..=m)
            .flat_map(|i| (0..=n).map(move |j| at(i, j)))
            .collect(),
    )
    .expect("a patch")
}

fn moved(patch: &RationalPatch, unknown: usize, by: f64) -> RationalPatch {
    let (mut patch, count) = (patch.clone(), patch.control().len());
    patch.control_mut()[unknown % count][unknown / count] += by;
    patch
}

#[test]
fn exact_patches_have_no_distance() {
    let field = sphere(0.5);
    let o = objective(&field, (2, 2), Method::GaussNewton);
    let at = o.evaluate(&stereographic(0.5, 0.5856)).expect("a value");
    assert!(at.terms.i < 1e-31, "{:e}", at.terms.i);
    // Another radius: the Sampson distance is (r² − R²)/2r everywhere.
    let at = o.evaluate(&stereographic(0.4, 0.5)).expect("a value");
    let distance: f64 = (0.16 - 0.25) / 0.8;
    assert!((at.terms.i / distance.powi(2) - 1.0).abs() < 1e-13);
}

#[test]
fn integrals_of_flat_patches_are_closed_forms() {
    let field = sphere(0.5);
    let o = objective(&field, (3, 2), Method::GaussNewton);
    let (a, b) = ([0.3, 0.0, 0.0], [0.1, 0.4, 0.0]);
    let at = o
        .evaluate(&RationalPatch::planar((3, 2), [0.0, 0.0, 0.5], a, b))
        .expect("a value");
    let (l, r) = (
        (0.09f64 - 0.3).powi(2) + (0.17f64 - 0.2).powi(2),
        0.03f64.powi(2),
    );
    assert!(
        (at.terms.l - l).abs() < 1e-15
            && (at.terms.r - r).abs() < 1e-15
            && at.terms.j.abs() < 1e-60
    );
    // w = 1 + u: the points are multiplied by it, too. ∫ u⁸ = 1/9.
    let mut patch = RationalPatch::planar((3, 2), [0.0, 0.0, 0.5], a, b);
    for (i, c) in patch.control_mut().iter_mut().enumerate() {
        let w = 1.0 + (i / 3) as f64 / 3.0;
        *c = c.map(|v| v * w);
    }
    let at = o.evaluate(&patch).expect("a value");
    assert!((at.terms.j - 1.0 / 9.0).abs() < 1e-15, "{}", at.terms.j);
    // The corners keep their positions.
    let e: f64 = [
        [0.0, 0.0, 0.5],
        [0.3, 0.0, 0.5],
        [0.1, 0.4, 0.5],
        [0.4, 0.4, 0.5],
    ]
    .iter()
    .zip(&o.targets.corners)
    .map(|(p, q)| (0..3).map(|k| (p[k] - q[k]) * (p[k] - q[k])).sum::<f64>())
    .sum();
    assert!(
        at.terms.e > e - 1.0
            && o.evaluate(&RationalPatch::planar((3, 2), [0.0, 0.0, 0.5], a, b))
                .expect("a value")
                .terms
                .e
                - e
                < 1e-15
    );
}

/// Remark 1: L + R is l₁l₂/π times ∫ (|cos φ pᵤ/√l₁ + sin φ pᵥ/√l₂|² − 1)² dφ, here by the
/// trapezoidal rule, which is exact for it.
#[test]
fn tangents_in_all_directions_are_measured() {
    let field = sphere(0.5);
    let o = objective(&field, (3, 2), Method::GaussNewton).with_inner(Inner::Tangents);
    let (a, b) = ([0.3, 0.1, 0.0], [0.1, 0.4, 0.2]);
    let at = o
        .evaluate(&RationalPatch::planar((3, 2), [0.0, 0.0, 0.5], a, b))
        .expect("a value");
    let (l1, l2, n) = (o.targets.l1, o.targets.l2, 16);
    let integral: f64 = (0..n)
        .map(|k| {
            let (s, c) = (std::f64::consts::TAU * f64::from(k) / f64::from(n)).sin_cos();
            let d2: f64 = (0..3)
                .map(|k| (c * a[k] / l1.sqrt() + s * b[k] / l2.sqrt()).powi(2))
                .sum();
            (d2 - 1.0).powi(2) * std::f64::consts::TAU / f64::from(n)
        })
        .sum();
    assert!((at.terms.l + at.terms.r - l1 * l2 / std::f64::consts::PI * integral).abs() < 1e-15);
}

/// The gradient of Gauss-Newton and of Newton, and the Hessian of Newton, by central differences;
/// both symmetric.
#[test]
fn derivatives_agree_with_differences() {
    let fields: [&dyn Field; 3] = [&quartic(), &whitney(), &sphere(0.5)];
    for field in fields {
        for (degree, inner) in [
            ((2, 2), Inner::Lengths),
            ((3, 1), Inner::Lengths),
            ((2, 2), Inner::Tangents),
        ] {
            let o = objective(field, degree, Method::Newton).with_inner(inner);
            let patch = bent(degree.0, degree.1);
            let at = o.evaluate(&patch).expect("a value");
            let d = o.derivatives(&patch, &at).expect("derivatives");
            let gauss = objective(field, degree, Method::GaussNewton)
                .with_inner(inner)
                .derivatives(&patch, &at)
                .expect("derivatives");
            let n = o.unknowns();
            let size = d.hessian.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let h = 1e-5;
            for a in 0..n {
                let (up, down) = (moved(&patch, a, h), moved(&patch, a, -h));
                let (eu, ed) = (
                    o.evaluate(&up).expect("a value"),
                    o.evaluate(&down).expect("a value"),
                );
                let slope = (o.sum(&eu.terms) - o.sum(&ed.terms)) / (2.0 * h);
                assert!(
                    (slope - d.gradient[a]).abs() < 1e-8 * size,
                    "{degree:?}, {a}: {slope} against {}",
                    d.gradient[a]
                );
                assert_eq!(d.gradient[a], gauss.gradient[a]);
                let (du, dd) = (
                    o.derivatives(&up, &eu).expect("derivatives"),
                    o.derivatives(&down, &ed).expect("derivatives"),
                );
                for b in 0..n {
                    let second = (du.gradient[b] - dd.gradient[b]) / (2.0 * h);
                    let got = d.hessian[a * n + b];
                    assert!(
                        (second - got).abs() < 1e-7 * size,
                        "{degree:?}, {a}, {b}: {second} against {got}"
                    );
                    assert!((got - d.hessian[b * n + a]).abs() <= 1e-13 * size);
                    assert!(
                        (gauss.hessian[a * n + b] - gauss.hessian[b * n + a]).abs() <= 1e-13 * size
                    );
                }
            }
        }
    }
}

/// Residuals vanish at a solution, and Gauss-Newton's second derivatives are the true ones.
#[test]
fn gauss_newton_is_exact_where_residuals_vanish() {
    let field = sphere(0.5);
    let patch = stereographic(0.5, 0.3);
    let only_distance = |method| {
        let mut o = objective(&field, (2, 2), method);
        o.weights = Weights {
            j: 0.0,
            l: 0.0,
            r: 0.0,
            e: 0.0,
        };
        let at = o.evaluate(&patch).expect("a value");
        o.derivatives(&patch, &at).expect("derivatives").hessian
    };
    let newton = only_distance(Method::Newton);
    for method in [Method::GaussNewton, Method::Frozen] {
        for (a, b) in newton.iter().zip(only_distance(method)) {
            assert!((a - b).abs() < 1e-13);
        }
    }
}

#[test]
fn patches_with_poles_have_no_value() {
    let field = sphere(0.5);
    let o = objective(&field, (2, 2), Method::GaussNewton);
    let mut patch = stereographic(0.5, 0.3);
    patch.control_mut()[4][3] = -8.0;
    assert!(o.evaluate(&patch).is_none());
    // Nor has one where the function is not finite.
    let patch = RationalPatch::planar((2, 2), [1e200, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    assert!(o.evaluate(&patch).is_none());
    assert!(norm(cross(CUBE.lo, CUBE.hi)) == 0.0);
}
