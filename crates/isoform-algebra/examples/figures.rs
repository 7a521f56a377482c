//! Figures on speed, printed: `cargo run --release -p isoform-algebra --example figures`, or of a
//! part: the same with `-- roots`.

use isoform_algebra::{
    Fibres, IBig, Poly, RBig, Subresultants, UPoly, discriminant, implicit, map_degrees,
    real_roots, resultant,
};
use isoform_control::Control;
use std::time::Instant;

fn timed<T>(what: &str, f: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = f();
    println!("{what}: {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
    result
}

fn dense(rng: &mut fastrand::Rng, vars: usize, degree: u16, bits: u32, homogeneous: bool) -> Poly {
    let mut terms = Vec::new();
    for code in 0..(u32::from(degree) + 1).pow(4) {
        let mut rest = code;
        let e: [u16; 4] = std::array::from_fn(|_| {
            let n = rest % (u32::from(degree) + 1);
            rest /= u32::from(degree) + 1;
            n as u16
        });
        let total: u16 = e.iter().sum();
        if total > degree || homogeneous && total < degree || e[vars..].iter().any(|&n| n > 0) {
            continue;
        }
        terms.push((e, (rng.i64(..) >> (64 - bits)).into()));
    }
    Poly::from_terms(terms)
}

fn composition() {
    let mut rng = fastrand::Rng::with_seed(4);
    for (degree, inner) in [(4, 2), (9, 3), (16, 4)] {
        let f = dense(&mut rng, 4, degree, 60, true);
        let parts: Vec<Poly> = (0..4)
            .map(|_| dense(&mut rng, 2, inner, 20, false))
            .collect();
        let pulled = timed(
            &format!("form of degree {degree} through degree {inner}"),
            || f.compose(&parts),
        );
        assert_eq!(pulled.total_degree(), usize::from(degree * inner));
        timed("  its product with a polynomial of degree 4", || {
            &pulled * &parts[0]
        });
        let product = &pulled * &parts[0];
        timed("  divided again", || {
            assert_eq!(product.div_exact(&parts[0]).as_ref(), Some(&pulled))
        });
    }
}

fn rational(rng: &mut fastrand::Rng, p: &Poly) -> Poly {
    Poly::from_terms(
        p.terms()
            .iter()
            .map(|(e, c)| (*e, RBig::from_parts(c.clone(), rng.u32(1..1 << 20).into()))),
    )
}

fn elimination() {
    let mut rng = fastrand::Rng::with_seed(5);
    let (f, g) = (
        dense(&mut rng, 2, 8, 20, false),
        dense(&mut rng, 2, 8, 20, false),
    );
    timed("resultant 8 x 8, 20-bit integers", || {
        resultant(&f, &g, 1, &Control::default())
    })
    .expect("two variables");
    let (f, g) = (rational(&mut rng, &f), rational(&mut rng, &g));
    timed("resultant 8 x 8, 20-bit rationals", || {
        resultant(&f, &g, 1, &Control::default())
    })
    .expect("two variables");
    for degree in [8, 12, 16, 24] {
        let f = dense(&mut rng, 2, degree, 20, false);
        timed(
            &format!("discriminant of degree {degree}, 20-bit integers"),
            || discriminant(&f, 1, &Control::default()),
        )
        .expect("two variables");
        let chain = timed("  subresultants, principal and next", || {
            Subresultants::new(&f, &f.derivative(1), 1, &Control::default())
        })
        .expect("two");
        timed("  one whole subresultant", || {
            chain.polynomial(2, &Control::default())
        })
        .expect("not stopped");
    }
    for (degree, common) in [(20, 5), (40, 10), (60, 20)] {
        let c = dense(&mut rng, 2, common, 20, false);
        let a = dense(&mut rng, 2, degree - common, 60, false) * &c;
        let b = dense(&mut rng, 2, degree - common, 60, false) * &c;
        let g = timed(
            &format!("gcd of degree {common} of degrees {degree}"),
            || a.gcd(&b),
        );
        assert!(g.is_associate(&c));
        timed("  gcd 1", || {
            assert!((&a + Poly::one()).gcd(&b).is_constant())
        });
    }
}

fn roots() {
    let mut rng = fastrand::Rng::with_seed(6);
    for (degree, bits) in [(64, 1000), (132, 2000), (300, 1000), (500, 1000)] {
        let big = |rng: &mut fastrand::Rng| {
            (0..bits / 60).fold(IBig::from(rng.i64(..)), |c, _| (c << 60) + rng.i64(..))
        };
        let p = UPoly::new((0..=degree).map(|_| big(&mut rng)).collect());
        let roots = timed(&format!("isolation, degree {degree}, {bits} bits"), || {
            real_roots(&p)
        });
        timed(&format!("  {} roots to f64", roots.len()), || {
            roots.iter().map(|r| r.to_f64()).sum::<f64>()
        });
    }
    let product = (0..64).fold(UPoly::one(), |p, i| {
        &p * &UPoly::from_i64(&[-i * i - 2, 0, 1])
    });
    timed("isolation, 128 real roots", || {
        assert_eq!(real_roots(&product).len(), 128)
    });
    for degree in [4, 8, 12, 16] {
        let f = dense(&mut rng, 2, degree, 20, false);
        let fibres = timed(&format!("curve of degree {degree}: subresultants"), || {
            Fibres::new(&f, 1, &Control::default())
        })
        .expect("two variables");
        let critical = &fibres.subresultants().expect("degree").resultant;
        let critical = timed("  critical points", || real_roots(critical));
        let n = critical.len();
        timed(&format!("  {n} fibres"), || {
            critical
                .iter()
                .map(|a| {
                    fibres
                        .at(a, &Control::default())
                        .expect("not vertical")
                        .roots
                        .len()
                })
                .sum::<usize>()
        });
    }
}

fn factors_and_maps() {
    let mut rng = fastrand::Rng::with_seed(7);
    for degrees in [[4, 8, 12], [2, 2, 20], [8, 8, 8]] {
        let whole = degrees
            .iter()
            .fold(Poly::one(), |p, &d| p * dense(&mut rng, 2, d, 20, false));
        timed(&format!("factors of degrees {degrees:?}"), || {
            assert_eq!(
                whole
                    .factor(&Control::default())
                    .expect("two variables")
                    .len(),
                3
            )
        });
        timed("  that plus one, irreducible", || {
            assert_eq!(
                (&whole + Poly::one())
                    .factor(&Control::default())
                    .expect("two variables")
                    .len(),
                1
            )
        });
    }
    for degree in [2, 3, 4, 6, 8, 12] {
        let map: [Poly; 4] = std::array::from_fn(|_| dense(&mut rng, 2, degree, 4, false));
        timed(
            &format!("degrees of a dense map of degree {degree}"),
            || map_degrees(&map, &Control::default()),
        )
        .expect("a surface");
        if degree <= 4 {
            let found = timed("  implicit equation", || {
                implicit(&map, 16, &Control::default())
            })
            .expect("a surface")
            .expect("degree 16");
            let partials: Vec<Poly> = (0..4).map(|v| found.equation.derivative(v)).collect();
            let pulled = timed("  partial derivatives pulled back", || {
                partials.iter().map(|p| p.compose(&map)).collect::<Vec<_>>()
            });
            let common = timed("  their common divisor", || {
                pulled.iter().fold(Poly::zero(), |g, p| g.gcd(p))
            });
            timed("  its factors", || common.factor(&Control::default())).expect("two variables");
        }
    }
}

/// Those whose names are among the arguments; without any, all.
fn main() {
    let all: [(&str, fn()); 4] = [
        ("composition", composition),
        ("elimination", elimination),
        ("roots", roots),
        ("factors_and_maps", factors_and_maps),
    ];
    let asked: Vec<String> = std::env::args().skip(1).collect();
    for (name, figures) in all {
        if asked.is_empty() || asked.iter().any(|a| a == name) {
            figures();
        }
    }
}
