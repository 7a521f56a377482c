//! Real roots and fibres: known roots are found, comparisons and signs are those of the numbers.

use isoform_algebra::{
    Fibres, IBig, Poly, RBig, RealRoot, UBig, UPoly, count_roots_between, real_roots,
    simplest_between,
};
use isoform_control::Control;
use proptest::prelude::*;
use std::cmp::Ordering;

fn p(text: &str) -> Poly {
    Poly::parse(text, &["x", "y"]).expect(text)
}

fn u(text: &str) -> UPoly {
    p(text).to_upoly(0).expect("one variable")
}

fn q(n: i64, d: u64) -> RBig {
    RBig::from_parts(IBig::from(n), UBig::from(d))
}

/// (d x − n) over the fractions, which are its roots.
fn with_roots(roots: &[(i64, u64)]) -> UPoly {
    roots.iter().fold(UPoly::one(), |product, &(n, d)| {
        &product * &UPoly::new(vec![IBig::from(-n), IBig::from(d)])
    })
}

/// What `RealRoot` promises about its interval.
fn check(root: &RealRoot) {
    let (lo, hi) = root.interval();
    if lo == hi {
        assert!(root.poly().sign_at(&lo).is_eq());
    } else {
        assert!(lo < hi);
        let (a, b) = (root.poly().sign_at(&lo), root.poly().sign_at(&hi));
        assert!(
            a.is_ne() && b == a.reverse(),
            "no change of sign between {lo} and {hi}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn rational_roots_are_found(roots in prop::collection::vec((-40i64..40, 1u64..9), 0..8), squares in prop::collection::vec(1u32..5, 0..3)) {
        // Factors x² + x + c have no real roots.
        let f = squares.iter().fold(with_roots(&roots), |f, c| &f * &UPoly::from_i64(&[i64::from(*c), 1, 1]));
        let mut wanted: Vec<RBig> = roots.iter().map(|&(n, d)| q(n, d)).collect();
        wanted.sort();
        wanted.dedup();
        let found = real_roots(&f);
        prop_assert_eq!(found.len(), wanted.len());
        for (r, w) in found.iter().zip(&wanted) {
            check(r);
            prop_assert_eq!(r.to_rational(), Some(w.clone()));
            prop_assert_eq!(r.cmp_rational(w), Ordering::Equal);
            prop_assert_eq!(r.cmp_rational(&(w + q(1, 1000))), Ordering::Less);
            prop_assert_eq!(r, &RealRoot::from_rational(w));
            prop_assert_eq!(r.to_f64(), w.to_f64().value());
            prop_assert!(r.to_interval().contains(w.to_f64().value()));
        }
        for pair in found.windows(2) {
            prop_assert!(pair[0] < pair[1]);
            let between = pair[0].rational_below(&pair[1]);
            prop_assert!(pair[0].cmp_rational(&between).is_lt() && pair[1].cmp_rational(&between).is_gt());
        }
        let (lo, hi) = (q(-7, 3), q(5, 1));
        prop_assert_eq!(count_roots_between(&f, &lo, &hi), wanted.iter().filter(|w| lo < **w && **w < hi).count());
    }

    #[test]
    fn signs_and_order_agree_with_values(a in prop::collection::vec(-30i64..30, 2..7), b in prop::collection::vec(-30i64..30, 2..7)) {
        let (a, b) = (UPoly::from_i64(&a), UPoly::from_i64(&b));
        prop_assume!(a.degree() > 0 && b.degree() > 0);
        let both = &a * &b;
        let (of_a, of_b) = (real_roots(&a), real_roots(&b));
        for r in &of_a {
            check(r);
            prop_assert_eq!(r.sign_of(&a), Ordering::Equal);
            prop_assert_eq!(r.sign_of(&both), Ordering::Equal);
            let mut close = r.clone();
            close.refine(200);
            check(&close);
            let (lo, hi) = close.interval();
            prop_assert!(hi - &lo <= RBig::from_parts(IBig::ONE, UBig::ONE << 200));
            // Unless it vanishes, b does not change its sign so near to r.
            let sign = if a.gcd(&b).degree() > 0 && of_b.contains(r) { Ordering::Equal } else { b.sign_at(&lo) };
            prop_assert_eq!(r.sign_of(&b), sign);
        }
        let mut all: Vec<RealRoot> = of_a.into_iter().chain(of_b).collect();
        all.sort();
        all.dedup();
        prop_assert_eq!(all, real_roots(&both));
    }

    #[test]
    fn the_simplest_number_between(n in -300i64..300, d in 1u64..60, m in 1i64..50, e in 1u64..200) {
        let lo = q(n, d);
        let hi = &lo + q(m, e);
        let s = simplest_between(&lo, &hi);
        prop_assert!(lo < s && s < hi);
        for k in 1u64.. {
            let k_big = UBig::from(k);
            if k_big >= *s.denominator() {
                break;
            }
            let first = RBig::from_parts((&lo * RBig::from(k)).floor() + IBig::ONE, k_big);
            prop_assert!(first >= hi, "{first} is simpler than {s}");
        }
    }

    #[test]
    fn fibres_of_products_of_lines(lines in prop::collection::vec((-3i64..4, -4i64..5, 1usize..3), 1..4), at in -6i64..7) {
        // Over x = at the line y = a x + b has the root a·at + b; multiplicities add up.
        let f = lines.iter().fold(Poly::one(), |f, &(a, b, n)| f * (Poly::var(1) - Poly::var(0).scale(&RBig::from(a)) - Poly::constant(b)).pow(n as u32));
        let mut wanted = std::collections::BTreeMap::new();
        for &(a, b, n) in &lines {
            *wanted.entry(a * at + b).or_insert(0) += n;
        }
        let fibre = Fibres::new(&f, 1, &Control::default()).expect("two variables").at(&RealRoot::from_rational(&RBig::from(at)), &Control::default()).expect("not vertical");
        prop_assert_eq!(fibre.roots.len(), wanted.len());
        prop_assert_eq!(fibre.distinct_complex, wanted.len());
        for (root, (y, n)) in fibre.roots.iter().zip(wanted) {
            prop_assert_eq!(root.multiplicity, n);
            prop_assert!(root.lo < RBig::from(y) && RBig::from(y) < root.hi);
        }
    }
}

#[test]
fn famous_polynomials() {
    // Wilkinson: 1 … 20. Chebyshev of degree 40: cos((2k + 1)π/80). Mignotte: two roots closer than
    // 2^−60.
    let wilkinson = with_roots(&(1..=20).map(|n| (n, 1)).collect::<Vec<_>>());
    assert!(
        real_roots(&wilkinson)
            .iter()
            .enumerate()
            .all(|(i, r)| r.to_rational() == Some(RBig::from(i + 1)))
    );
    let (mut a, mut b) = (UPoly::one(), UPoly::from_i64(&[0, 1]));
    for _ in 1..40 {
        let next = &(&UPoly::from_i64(&[0, 2]) * &b) - &a;
        (a, b) = (b, next);
    }
    let roots = real_roots(&b);
    assert_eq!(roots.len(), 40);
    for (k, r) in roots.iter().rev().enumerate() {
        assert!(
            (r.to_f64() - ((2 * k + 1) as f64 * std::f64::consts::PI / 80.0).cos()).abs() < 1e-15
        );
    }
    let mignotte = real_roots(&u("x^30 - 2*(1000*x - 1)^2"));
    assert_eq!(mignotte.len(), 4);
    assert_eq!(mignotte[1].to_f64(), mignotte[2].to_f64());
    assert!(mignotte[1] < mignotte[2]);
    let simple = mignotte[1].rational_below(&mignotte[2]);
    assert_eq!(simple, q(1, 1000));
    assert_eq!(real_roots(&u("x^2 + 1")).len(), 0);
    assert_eq!(real_roots(&UPoly::one()).len(), 0);
    assert_eq!(real_roots(&u("4*x^3 - x"))[2].to_rational(), Some(q(1, 2)));
    assert_eq!(real_roots(&u("x^2 - 2"))[1].to_rational(), None);
    let tiny = real_roots(&UPoly::new(vec![IBig::from(-3), IBig::ONE << 1080]));
    assert_eq!((tiny[0].to_f64(), tiny[0].to_interval().lo()), (0.0, 0.0));
    let huge = real_roots(&UPoly::new(vec![-(IBig::ONE << 1100), IBig::ONE]));
    assert_eq!(
        (huge[0].to_f64(), huge[0].to_interval().lo()),
        (f64::INFINITY, f64::MAX)
    );
}

#[test]
fn fibres_at_critical_points() {
    // Curve, x as a root of a polynomial (which one), multiplicities of the real roots upwards,
    // distinct complex roots.
    let cases: [(&str, &str, usize, &[usize], usize); 14] = [
        ("x^2 + y^2 - 1", "x - 1", 0, &[2], 1),
        ("x^2 + y^2 - 1", "x^2 - 2", 0, &[], 2),
        ("x^2 + y^2 - 2", "x^2 - 2", 1, &[2], 1),
        ("y^2 - x^2*(x + 1)", "x", 0, &[2], 1),
        ("y^2 - x^3", "x", 0, &[2], 1),
        ("y^2 + x^2*(1 - x)", "x", 0, &[2], 1),
        ("(y - x^2)*(y + x^2)*(y - 3)", "x^2 - 3", 1, &[1, 2], 2),
        ("(y^2 + x^2)*(y - 5*x + 1)", "x", 0, &[1, 2], 2),
        ("((y - 1)^2 + x^2)*((y + 1)^2 + x^2)", "x", 0, &[2, 2], 2),
        ("(y^2 - 2)^2*(y - x) + (x^2 - 2)", "x^2 - 2", 1, &[2, 3], 2),
        ("(y^2 + 1)^2 + x", "x", 0, &[], 2),
        ("x*y^3 + y^2 - 1", "x", 0, &[1, 1], 2),
        ("x*y^2 + x*y + 1", "x", 0, &[], 0),
        (
            "(y - 1000000*x)*(y - 1000000*x - 1/1000000)*y",
            "x^2 - 2",
            1,
            &[1, 1, 1],
            3,
        ),
    ];
    for (curve, over, which, multiplicities, complex) in cases {
        let fibres = Fibres::new(&p(curve), 1, &Control::default()).expect(curve);
        let alpha = &real_roots(&u(over))[which];
        let mut fibre = fibres.at(alpha, &Control::default()).expect(curve);
        let found: Vec<usize> = fibre.roots.iter().map(|r| r.multiplicity).collect();
        assert_eq!(
            (&found[..], fibre.distinct_complex),
            (multiplicities, complex),
            "{curve} over {over}"
        );
        if let Some(count) = fibres
            .count_at(alpha, &Control::default())
            .expect("not stopped")
        {
            assert_eq!(count, multiplicities.len(), "{curve} over {over}");
        }
        for i in 0..fibre.roots.len() {
            let before = fibre.roots[i].clone();
            fibre
                .refine(i, 300, &Control::default())
                .expect("not stopped");
            let r = &fibre.roots[i];
            assert!(before.lo <= r.lo && r.lo < r.hi && r.hi <= before.hi);
            assert!(&r.hi - &r.lo <= RBig::from_parts(IBig::ONE, UBig::ONE << 300));
        }
    }
    let vertical = Fibres::new(&p("x*y^2 - 2*x"), 1, &Control::default())
        .expect("two variables")
        .at(&RealRoot::from_rational(&RBig::ZERO), &Control::default());
    assert!(vertical.is_err_and(|e| e == isoform_algebra::FibreError::Vertical));
}

/// Signs of subresultants count the roots that isolation finds, over rational points and critical
/// ones.
#[test]
fn counting_agrees_with_isolating() {
    let mut rng = fastrand::Rng::with_seed(9);
    for _ in 0..12 {
        let terms = (0..=4u16).flat_map(|i| (0..=4 - i).map(move |j| [i, j, 0, 0]));
        let f = Poly::from_terms(terms.map(|e| (e, RBig::from(rng.i64(-5..=5)))));
        if f.degree(1) < 2 {
            continue;
        }
        let fibres = Fibres::new(&f, 1, &Control::default()).expect("two variables");
        let discriminant = fibres
            .subresultants()
            .expect("degree 2 or more")
            .resultant
            .clone();
        if discriminant.is_zero() {
            continue;
        }
        let critical = real_roots(&discriminant);
        let count = |alpha: &RealRoot| {
            fibres
                .count_at(alpha, &Control::default())
                .expect("not stopped")
        };
        for (i, alpha) in critical.iter().enumerate() {
            let fibre = fibres.at(alpha, &Control::default()).expect("not vertical");
            assert_eq!(count(alpha).unwrap_or(fibre.roots.len()), fibre.roots.len());
            if let Some(next) = critical.get(i + 1) {
                let x = alpha.rational_below(next);
                let over = f.set(0, &x).to_upoly(1).expect("one variable");
                let at = RealRoot::from_rational(&x);
                assert_eq!(count(&at), Some(real_roots(&over).len()));
                assert_eq!(
                    fibres
                        .at(&at, &Control::default())
                        .expect("not vertical")
                        .roots
                        .len(),
                    real_roots(&over).len()
                );
            }
        }
    }
}

/// Roots halfway between two neighbouring doubles, on a grid that halving the first interval does
/// not meet: ties go to the even one.
#[test]
fn ties() {
    let coefficients = [
        "83734783535626296711395216750389",
        "-329747378849440028749325827833856",
        "324518553658426726783156020576256",
    ];
    let f = UPoly::new(
        coefficients
            .iter()
            .map(|c| c.parse::<IBig>().expect("an integer"))
            .collect(),
    );
    // The roots are these over 2^54; 8978173444146977 has 53 bits and is a double.
    let halves = [8978173444146977u64, 9326483171275156];
    let roots: Vec<f64> = real_roots(&f).iter().map(|r| r.to_f64()).collect();
    assert_eq!(roots, halves.map(|n| n as f64 / 2f64.powi(54)));
}
