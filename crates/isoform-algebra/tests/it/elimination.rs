//! Common divisors, squarefree parts, resultants and subresultants against their definitions.

use isoform_algebra::{
    IBig, Poly, RBig, ResultantError, Subresultants, UPoly, discriminant, resultant,
    resultant_univariate,
};
use isoform_control::Control;
use proptest::prelude::*;
use std::time::Instant;

fn p(text: &str) -> Poly {
    Poly::parse(text, &["x", "y", "z", "w"]).expect(text)
}

/// Up to `terms` terms in `vars` variables with small coefficients.
fn poly(vars: usize, degree: u16, terms: usize) -> impl Strategy<Value = Poly> {
    let exponents = prop::array::uniform4(0..=degree).prop_map(move |mut e| {
        e[vars..].fill(0);
        e
    });
    prop::collection::vec((exponents, -9i64..=9), 1..terms)
        .prop_map(|t| Poly::from_terms(t.into_iter().map(|(e, c)| (e, RBig::from(c)))))
}

fn upoly(degree: usize) -> impl Strategy<Value = UPoly> {
    prop::collection::vec(-20i64..=20, 1..degree + 2).prop_map(|c| UPoly::from_i64(&c))
}

/// Determinant over a ring of polynomials by expansion along the first row.
fn determinant(m: &[Vec<Poly>]) -> Poly {
    let Some((first, rest)) = m.split_first() else {
        return Poly::one();
    };
    let minor = |skip: usize| -> Vec<Vec<Poly>> {
        rest.iter()
            .map(|r| {
                r.iter()
                    .enumerate()
                    .filter(|(c, _)| *c != skip)
                    .map(|(_, v)| v.clone())
                    .collect()
            })
            .collect()
    };
    let mut sum = Poly::zero();
    for (c, v) in first.iter().enumerate().filter(|(_, v)| !v.is_zero()) {
        let t = v * determinant(&minor(c));
        sum = if c % 2 == 0 { sum + t } else { sum - t };
    }
    sum
}

/// Coefficient of yⁱ in the j-th subresultant, by its definition.
fn minor(f: &Poly, g: &Poly, j: usize, i: usize) -> Poly {
    let (n, m) = (f.degree(1), g.degree(1));
    let columns: Vec<usize> = (j + 1..n + m - j).rev().chain([i]).collect();
    let row = |q: &Poly, shift: usize| -> Vec<Poly> {
        let c = q.coefficients_in(1);
        columns
            .iter()
            .map(|&k| {
                k.checked_sub(shift)
                    .and_then(|k| c.get(k).cloned())
                    .unwrap_or_default()
            })
            .collect()
    };
    let rows: Vec<_> = (0..m - j)
        .rev()
        .map(|s| row(f, s))
        .chain((0..n - j).rev().map(|s| row(g, s)))
        .collect();
    determinant(&rows)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn common_factors_are_found(
        a in poly(4, 2, 5), b in poly(4, 2, 5), c in poly(4, 2, 5), vars in 1usize..4
    ) {
        let [a, b, c] = [a, b, c].map(|q| (vars..4).fold(q, |q, v| q.set(v, &RBig::from(3))));
        prop_assume!(!a.is_zero() && !b.is_zero() && !c.is_zero());
        let g = (&a * &c).gcd(&(&b * &c));
        prop_assert!(g.is_multiple_of(&c));
        prop_assert!((&a * &c).is_multiple_of(&g) && (&b * &c).is_multiple_of(&g));
        prop_assert_eq!(&g, &g.primitive());
        // What is left has no common factor: gcd(ac, bc) = gcd(a, b) c.
        prop_assert!(g.is_associate(&(a.gcd(&b) * &c)));
        prop_assert_eq!((&b * &c).gcd(&(&a * &c)), g);
    }

    #[test]
    fn squarefree_parts_multiply_up(a in poly(2, 2, 4), b in poly(2, 2, 4), c in poly(3, 1, 3)) {
        let whole = &a * &b.pow(2) * c.pow(3);
        prop_assume!(!whole.is_zero());
        let parts = whole.squarefree();
        let product = parts.iter().fold(Poly::one(), |q, (f, n)| q * f.pow(*n as u32));
        prop_assert!(product.is_associate(&whole));
        let part = whole.squarefree_part();
        prop_assert!(part.is_associate(&(&a * &b * &c).squarefree_part()));
        for v in 0..3 {
            let repeated = part.gcd(&part.derivative(v));
            prop_assert!(repeated.degree(v) == 0, "{part} has a square");
        }
        for (i, (f, _)) in parts.iter().enumerate() {
            for (g, _) in &parts[..i] {
                prop_assert!(f.gcd(g).is_constant());
            }
        }
    }

    #[test]
    fn univariate_agrees_with_multivariate(a in upoly(6), b in upoly(6), c in upoly(4)) {
        prop_assume!(!a.is_zero() && !b.is_zero() && !c.is_zero());
        let (ac, bc) = (&a * &c, &b * &c);
        let [pa, pb] = [&ac, &bc].map(|q| Poly::from_upoly(q, 0));
        prop_assert_eq!(Poly::from_upoly(&ac.gcd(&bc), 0), pa.gcd(&pb));
        let dense = (&ac * &b).squarefree().into_iter();
        let dense: Vec<_> = dense.map(|(q, n)| (Poly::from_upoly(&q, 0), n)).collect();
        prop_assert_eq!(dense, (&pa * Poly::from_upoly(&b, 0)).squarefree());
        let both = [&a, &b].map(|q| Poly::from_upoly(q, 0));
        let r = resultant(&both[0], &both[1], 0, &Control::default()).expect("one variable");
        prop_assert_eq!(r, Poly::constant(resultant_univariate(&a, &b)));
    }

    #[test]
    fn resultants_are_determinants(f in poly(2, 3, 6), g in poly(2, 2, 5), q in 1i64..5) {
        prop_assume!(!f.is_zero() && !g.is_zero());
        let f = f.scale(&(RBig::ONE / RBig::from(q)));
        prop_assert_eq!(resultant(&f, &g, 1, &Control::default()), Ok(minor(&f, &g, 0, 0)));
        prop_assert_eq!(resultant(&g, &f, 1, &Control::default()), Ok(minor(&g, &f, 0, 0)));
    }

    #[test]
    fn subresultants_are_determinants(f in poly(2, 4, 7), g in poly(2, 3, 6)) {
        let (f, g) = if f.degree(1) >= g.degree(1) { (f, g) } else { (g, f) };
        prop_assume!(g.degree(1) > 0);
        let chain = Subresultants::new(&f, &g, 1, &Control::default()).expect("two variables");
        prop_assert_eq!(chain.count(), g.degree(1));
        for j in 0..g.degree(1) {
            let principal = chain.principal(j, &Control::default()).expect("not stopped");
            prop_assert_eq!(Poly::from_upoly(&principal, 0), minor(&f, &g, j, j));
            let whole = chain.polynomial(j, &Control::default()).expect("not stopped").coefficients_in(1);
            for i in 0..=j {
                let coefficient = whole.get(i).cloned().unwrap_or_default();
                prop_assert_eq!(coefficient, minor(&f, &g, j, i));
            }
        }
    }
}

#[test]
fn closed_forms() {
    assert_eq!(
        discriminant(&p("x*y^2 + 3*y + 5"), 1, &Control::default()),
        Ok(p("9 - 20*x"))
    );
    assert_eq!(
        discriminant(&p("y^3 + x*y - 2"), 1, &Control::default()),
        Ok(p("-4*x^3 - 108"))
    );
    assert_eq!(
        discriminant(&p("y - x"), 1, &Control::default()),
        Ok(Poly::one())
    );
    assert_eq!(
        resultant(&p("x + y + z"), &p("x"), 0, &Control::default()),
        Err(ResultantError::TooManyVariables)
    );
    assert_eq!(
        resultant(
            &p("x + y"),
            &p("x"),
            0,
            &Control::default().until(Instant::now())
        ),
        Err(ResultantError::Stopped)
    );
    // The tacnode of (y − x²)(y + x²)(y − 3): over x = 0 the divisor S₁ of f and f′ has the root y
    // = 0, over x² = 3 the root y = 3.
    let f = p("(y^2 - x^4)*(y - 3)");
    let chain =
        Subresultants::new(&f, &f.derivative(1), 1, &Control::default()).expect("two variables");
    assert_eq!(
        chain
            .resultant
            .squarefree()
            .last()
            .map(|(q, n)| (q.clone(), *n)),
        Some((UPoly::from_i64(&[0, 1]), 4))
    );
    let divisor = chain
        .polynomial(1, &Control::default())
        .expect("not stopped");
    let rows = divisor.coefficients_in(1);
    let at = |c: &Poly, x: i64| {
        c.set(0, &RBig::from(x))
            .as_constant()
            .expect("no variables")
    };
    assert_eq!(at(&rows[0], 0), RBig::ZERO);
    assert_ne!(at(&rows[1], 0), RBig::ZERO);
    let difference = (&rows[0] + rows[1].scale(&RBig::from(3)))
        .to_upoly(0)
        .expect("a polynomial in x");
    assert!(
        difference
            .div_exact(&UPoly::from_i64(&[-3, 0, 1]))
            .is_some()
            || difference.is_zero()
    );
    assert_eq!(p("0").gcd(&p("-2*x")), p("x"));
    assert_eq!(p("x*y").gcd(&p("z")), Poly::one());
    assert_eq!(Poly::constant(6).gcd(&Poly::constant(4)), Poly::one());
    assert_eq!(UPoly::from_i64(&[6]).squarefree(), []);
    assert_eq!(p("x^3*y - x*y").squarefree(), [(p("x^3*y - x*y"), 1)]);
    assert_eq!(p("x^2*y^2*z").squarefree(), [(p("z"), 1), (p("x*y"), 2)]);
    assert_eq!(
        resultant_univariate(&UPoly::from_i64(&[-1, 0, 0, 2]), &UPoly::from_i64(&[5])),
        IBig::from(125)
    );
}

/// Values at small integers that agree by design: y(y−1)(y−2)… vanishes at the first points anyone
/// would try.
#[test]
fn no_small_point_deceives() {
    let falling = (0..12).fold(Poly::one(), |q, i| q * (Poly::var(1) - Poly::constant(i)));
    let c = &falling + p("x^2 + 1");
    assert!(
        (&c * p("x + y"))
            .gcd(&(&c * p("x - y^3 + 1")))
            .is_associate(&c)
    );
    let prime = Poly::constant(IBig::from((1u64 << 62) - 57));
    let c = p("x*y + 1") + &prime * p("x^2 - y");
    assert!(
        (&c * p("x + y"))
            .gcd(&(&c * (p("x - y") + &prime)))
            .is_associate(&c)
    );
}
