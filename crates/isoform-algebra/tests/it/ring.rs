//! Polynomials obey the laws of the ring, evaluation and composition are homomorphisms, conversions
//! are exact.

use isoform_algebra::{Exponents, IBig, Poly, RBig, UBig};
use proptest::prelude::*;

fn rational() -> impl Strategy<Value = RBig> {
    (any::<i16>(), 1u16..300).prop_map(|(n, d)| RBig::from_parts(IBig::from(n), UBig::from(d)))
}

/// Up to `terms` terms in `vars` variables, exponents below `degree`; zero, constants and
/// coinciding terms included.
fn poly(vars: usize, degree: u16, terms: usize) -> impl Strategy<Value = Poly> {
    let exponents = prop::array::uniform4(0..degree).prop_map(move |mut e| {
        e[vars..].fill(0);
        e
    });
    prop::collection::vec((exponents, rational()), 0..terms).prop_map(Poly::from_terms)
}

/// What `Poly` promises about its representation.
fn check(p: &Poly) {
    assert!(
        p.terms().windows(2).all(|w| w[0].0 > w[1].0),
        "terms out of order"
    );
    assert!(p.terms().iter().all(|(_, c)| !c.is_zero()), "a zero term");
    let again = Poly::from_terms(
        p.terms()
            .iter()
            .map(|(e, c)| (*e, RBig::from_parts(c.clone(), p.denominator().clone()))),
    );
    assert_eq!(*p, again, "the denominator is not the least");
}

fn p(text: &str) -> Poly {
    Poly::parse(text, &["x", "y", "z", "w"]).expect(text)
}

proptest! {
    #[test]
    fn values_of_sums_and_products(a in poly(4, 5, 7), b in poly(4, 5, 7), at in prop::array::uniform4(rational()), v in 0usize..4) {
        let (x, y) = (a.eval(&at), b.eval(&at));
        for r in [&a + &b, &a - &b, &a * &b, -&a, a.scale(&at[0]), a.derivative(v), a.set(v, &at[v]), a.pow(3)] {
            check(&r);
        }
        prop_assert_eq!((&a + &b).eval(&at), &x + &y);
        prop_assert_eq!((&a - &b).eval(&at), &x - &y);
        prop_assert_eq!((&a * &b).eval(&at), &x * &y);
        prop_assert_eq!(a.pow(3).eval(&at), &x * &x * &x);
        prop_assert_eq!(a.set(v, &at[v]).eval(&at), x.clone());
        prop_assert_eq!((&a * &b).derivative(v), a.derivative(v) * &b + &a * b.derivative(v));
        prop_assert_eq!(a.primitive().scale(&a.content()).is_associate(&a), true);
        let parts = a.coefficients_in(v);
        let sum = parts.iter().enumerate().fold(Poly::zero(), |s, (i, c)| s + c * Poly::var(v).pow(i as u32));
        prop_assert_eq!(sum, a.clone());
        prop_assert_eq!(a.homogenise(3, 40).set(3, &RBig::ONE), a.set(3, &RBig::ONE));
    }

    #[test]
    fn exact_division(a in poly(3, 4, 6), b in poly(3, 4, 6), c in poly(3, 2, 3)) {
        prop_assert_eq!((&a * &b).div_exact(&b), (!b.is_zero()).then_some(a.clone()));
        if b.total_degree() > c.total_degree() && !c.is_zero() {
            // A divisor of a·b + c divides c, whose degree is lower.
            prop_assert!(!(&a * &b + c).is_multiple_of(&b));
        }
    }

    #[test]
    fn composition_is_evaluation(f in poly(4, 5, 8), parts in prop::array::uniform4(poly(3, 3, 5)), vars in 1usize..4, at in prop::array::uniform4(rational())) {
        let parts = parts.map(|q| (vars..3).fold(q, |q, v| q.set(v, &RBig::from(2))));
        let composed = f.compose(&parts);
        check(&composed);
        let values: Vec<RBig> = parts.iter().map(|q| q.eval(&at)).collect();
        prop_assert_eq!(composed.eval(&at), f.eval(&values));
    }

    #[test]
    fn floats_are_exact(terms in prop::collection::vec((prop::array::uniform4(0u16..3), any::<f64>()), 0..5)) {
        let distinct: std::collections::BTreeMap<Exponents, f64> = terms.into_iter().collect();
        let finite = distinct.values().all(|v| v.is_finite());
        let made = Poly::from_f64(distinct.clone());
        prop_assert_eq!(made.is_some(), finite);
        if let Some(made) = made {
            check(&made);
            let back: std::collections::BTreeMap<Exponents, f64> = made.to_f64().into_iter().collect();
            let wanted: std::collections::BTreeMap<_, _> = distinct.into_iter().filter(|(_, v)| *v != 0.0).collect();
            prop_assert_eq!(back, wanted);
        }
    }
}

/// Forms composed with forms go through a grid of two variables; Horner's rule is the referee,
/// reached by a part with a fourth variable.
#[test]
fn the_grid_agrees_with_multiplying_out() {
    let f = p("x^5*y - 3/7*x^2*y^2*z*w + 5*z^6 - w^6 + 1/3*x*y*z*w^3");
    let parts = [
        p("x^3 - 2*x*y*z + z^3"),
        p("1/2*x^2*y + y^3"),
        p("x*y*z - 5/3*z^3"),
        p("x^3 + y^3 + 7*z^3"),
    ];
    let by_grid = f.compose(&parts);
    assert!(by_grid.is_homogeneous());
    assert_eq!(by_grid.total_degree(), 18);
    let mut lifted = parts.clone();
    lifted[0] = &lifted[0] * Poly::var(3);
    lifted[1] = &lifted[1] * Poly::var(3);
    lifted[2] = &lifted[2] * Poly::var(3);
    lifted[3] = &lifted[3] * Poly::var(3);
    assert_eq!(f.compose(&lifted), &by_grid * Poly::var(3).pow(6));
    let affine = parts.map(|q| q.set(2, &RBig::from(3)));
    assert_eq!(f.compose(&affine), by_grid.set(2, &RBig::from(3)));
}

#[test]
fn rounding_is_to_nearest_ties_to_even() {
    let half_up = RBig::from(1) + RBig::from_parts(IBig::ONE, UBig::ONE << 53);
    let tiny = RBig::from_parts(IBig::ONE, UBig::ONE << 300);
    let cases = [
        (half_up.clone(), 1.0),
        (&half_up + &tiny, 1.0 + f64::EPSILON),
        (&half_up - &tiny, 1.0),
        (RBig::from_parts(IBig::from(1), UBig::from(3u8)), 1.0 / 3.0),
        (
            RBig::from_parts(IBig::from(-2), UBig::from(7u8)),
            -2.0 / 7.0,
        ),
        (RBig::from_parts(IBig::ONE, UBig::ONE << 1075), 0.0),
        (RBig::from_parts(IBig::from(3), UBig::ONE << 1075), 1e-323),
        (RBig::from(IBig::ONE << 1030), f64::INFINITY),
    ];
    for (exact, rounded) in cases {
        assert_eq!(
            Poly::constant(exact.clone()).to_f64()[0].1,
            rounded,
            "{exact}"
        );
    }
}

#[test]
fn shapes_of_polynomials() {
    let f = p("x^3*y - 2*y^2 + 4");
    assert_eq!(
        (f.total_degree(), f.order(), f.degrees()),
        (4, 0, [3, 2, 0, 0])
    );
    assert_eq!(f.homogeneous_part(2), p("-2*y^2"));
    assert_eq!(f.homogenise(3, 4), p("x^3*y - 2*y^2*w^2 + 4*w^4"));
    assert_eq!(f.rename([1, 0, 2, 3]), p("y^3*x - 2*x^2 + 4"));
    assert_eq!(f.substitute(1, &p("x + z")), p("x^3*(x+z) - 2*(x+z)^2 + 4"));
    assert_eq!(f.primitive(), f);
    assert_eq!(p("-2/3*x - 4/9").primitive(), p("3*x + 2"));
    assert_eq!(
        p("-2/3*x - 4/9").content(),
        RBig::from_parts(IBig::from(2), UBig::from(9u8))
    );
    assert_eq!(
        p("6*x^2 - 3")
            .to_upoly(0)
            .map(|u| u.display("t").to_string()),
        Some("2*t^2 - 1".into())
    );
    assert_eq!(f.to_upoly(0), None);
    assert_eq!(f.coefficient([3, 1, 0, 0]), RBig::ONE);
    assert_eq!(f.coefficient([1, 1, 0, 0]), RBig::ZERO);
    assert_eq!(f.div_exact(&Poly::zero()), None);
}
