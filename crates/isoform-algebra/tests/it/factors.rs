//! Factorisation: products come apart into what they were made of, irreducible polynomials stay
//! whole.

use isoform_algebra::{FactorError, IBig, Poly, RBig, UPoly};
use isoform_control::Control;
use proptest::prelude::*;
use std::time::Instant;

fn p(text: &str) -> Poly {
    Poly::parse(text, &["x", "y", "z", "w"]).expect(text)
}

fn upoly(degree: usize) -> impl Strategy<Value = UPoly> {
    prop::collection::vec(-9i64..=9, 2..degree + 2).prop_map(|c| UPoly::from_i64(&c))
}

fn poly(degree: u16) -> impl Strategy<Value = Poly> {
    prop::collection::vec((0..=degree, 0..=degree, -9i64..=9), 2..6).prop_map(|t| {
        Poly::from_terms(t.into_iter().map(|(i, j, c)| ([i, j, 0, 0], RBig::from(c))))
    })
}

/// The product of the factors is the polynomial, and none of them comes apart again.
fn check(whole: &Poly) -> Vec<(Poly, usize)> {
    let factors = whole.factor(&Control::default()).expect("few variables");
    let product = factors
        .iter()
        .fold(Poly::one(), |q, (f, n)| q * f.pow(*n as u32));
    assert!(product.is_associate(whole), "{whole}");
    for (f, _) in &factors {
        assert_eq!(f.factor(&Control::default()), Ok(vec![(f.clone(), 1)]));
    }
    factors
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn univariate_products_come_apart(parts in prop::collection::vec(upoly(4), 1..5)) {
        let whole = parts.iter().fold(UPoly::one(), |a, b| &a * b);
        prop_assume!(!whole.is_zero());
        let factors = check(&Poly::from_upoly(&whole, 2));
        let found: usize = factors.iter().map(|(_, n)| n).sum();
        prop_assert!(found >= parts.iter().filter(|q| q.degree() > 0).count());
        for part in parts.iter().filter(|q| q.degree() == 1) {
            prop_assert!(factors.iter().any(|(f, _)| f.is_associate(&Poly::from_upoly(part, 2))));
        }
    }

    #[test]
    fn bivariate_products_come_apart(parts in prop::collection::vec(poly(3), 1..4)) {
        let whole = parts.iter().fold(Poly::one(), |a, b| a * b);
        prop_assume!(!whole.is_zero());
        let factors = check(&whole);
        let found: usize = factors.iter().map(|(_, n)| n).sum();
        prop_assert!(found >= parts.iter().filter(|q| !q.is_constant()).count());
        let form = whole.homogenise(3, whole.total_degree() + 2);
        prop_assert_eq!(check(&form).len(), factors.len() + 1);
    }
}

#[test]
fn known_factorisations() {
    // Number of irreducible factors; from the definitions and sympy.
    let cases = [
        ("x^2 + 1", 1),
        ("x^4 + 4", 2),
        ("x^4 + 1", 1),
        ("x^4 - 10*x^2 + 1", 1),
        ("x^8 - 40*x^6 + 352*x^4 - 960*x^2 + 576", 1),
        ("x^12 - 1", 6),
        ("x^24 - 1", 8),
        ("6*x^2 + 5*x + 1", 2),
        ("x^2 + y^2", 1),
        ("x^4 + 4*y^4", 2),
        ("x^6 - y^6", 4),
        ("x^2*y + x*y^2 + x + y", 2),
        ("(x^2 + y^2)^2 - 4*x^2*y^2", 2),
        ("x*y - 1", 1),
        ("x^2*y^2 - 2", 1),
        ("(x^2 + y^2 - 1)*(x^2 + y^2 - 2)*(x^2 - 2*y^2)", 3),
        ("(s0)", 0),
        ("x^2 + y^2 + z^2", 1),
        ("x^2 - y^2 + 2*y*z - z^2", 2),
        ("(x^2*z - y^3 + 3*z^3)*(x*y - z^2)*z^2*x", 4),
        ("(x^2 + y^2)*(x^2 + y^2 - 3*z^2)^2", 2),
    ];
    for (text, count) in cases {
        if text == "(s0)" {
            assert_eq!(Poly::constant(12).factor(&Control::default()), Ok(vec![]));
            continue;
        }
        assert_eq!(check(&p(text)).len(), count, "{text}");
    }
    assert_eq!(
        p("x*y*z + 1").factor(&Control::default()),
        Err(FactorError::TooManyVariables)
    );
    assert_eq!(
        p("x^9 - 2*y^9 + 3").factor(&Control::default().until(Instant::now())),
        Err(FactorError::Stopped)
    );
    let big = UPoly::new(vec![
        IBig::from(1) << 200,
        IBig::from(3),
        IBig::from(1) << 100,
    ]);
    let product = &big * &UPoly::from_i64(&[7, -5, 0, 1]);
    assert_eq!(product.factor(&Control::default()).map(|f| f.len()), Ok(2));
}

/// Factors of high degree with coefficients of different sizes.
#[test]
fn dense_factors_of_degree_twelve() {
    let mut rng = fastrand::Rng::with_seed(11);
    let mut dense = |degree: u16, size: i64| {
        let exponents = (0..=degree).flat_map(|i| (0..=degree - i).map(move |j| [i, j, 0, 0]));
        Poly::from_terms(
            exponents
                .map(|e| (e, RBig::from(rng.i64(-size..=size))))
                .collect::<Vec<_>>(),
        )
    };
    let parts = [dense(4, 1_000_000), dense(8, 9), dense(12, 100)];
    let whole = parts.iter().fold(Poly::one(), |a, b| a * b);
    let factors = whole.factor(&Control::default()).expect("two variables");
    assert!(
        factors == parts.map(|q| (q.primitive(), 1)),
        "{} factors",
        factors.len()
    );
}
