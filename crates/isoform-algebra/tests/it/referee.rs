//! Results of FLINT (through python-flint) for these problems; tests/golden/flint.txt is what
//! this script prints:
//!
//! ```text
//! # python-flint 0.9 (FLINT 3): resultants, discriminants, gcds, factors and real roots of seeded random polynomials.
//! import random
//! from flint import fmpz_mpoly_ctx, fmpz_poly, fmpq, Ordering
//! random.seed(20)
//! ctx = fmpz_mpoly_ctx.get(["x", "y"], Ordering.lex)
//! x, y = ctx.gens()
//! def poly(d, size):
//!     return sum((random.randint(-size, size) * x**i * y**j for i in range(d + 1) for j in range(d + 1 - i)), 0 * x)
//! def text(p): return str(p).replace(" ", "")
//! print("# kind | first | second | answer")
//! for d, e, size in [(2, 3, 99), (3, 3, 9), (4, 5, 999), (5, 2, 10**6), (6, 6, 20)]:
//!     f, g = poly(d, size), poly(e, size)
//!     print("resultant |", text(f), "|", text(g), "|", text(f.resultant(g, "y")))
//! for d, size in [(2, 99), (4, 9), (6, 30)]:
//!     f = poly(d, size)
//!     print("discriminant |", text(f), "| y |", text(f.discriminant("y")))
//! for d in [2, 3, 4]:
//!     c, a, b = poly(d, 20), poly(3, 20), poly(2, 20)
//!     print("gcd |", text(a * c), "|", text(b * c * c), "|", text((a * c).gcd(b * c * c)))
//! for parts in [(1, 1, 2), (2, 3), (3, 4, 1, 1)]:
//!     whole = 1
//!     for d in parts:
//!         whole = whole * poly(d, 9)
//!     _, factors = whole.factor()
//!     print("factor |", text(whole), "| |", " ; ".join(sorted(text(p) + "^^" + str(n) for p, n in factors)))
//! for d, size in [(5, 9), (12, 99), (30, 999)]:
//!     p = fmpz_poly([random.randint(-size, size) for _ in range(d)] + [1])
//!     roots = sorted(float(r.real.mid()) for r, _ in p.complex_roots() if r.imag == 0)
//!     print("roots |", text(str(p)), "| |", " ; ".join(repr(r) for r in roots))
//! ```

use isoform_algebra::{Poly, discriminant, real_roots, resultant};
use isoform_control::Control;

fn p(text: &str) -> Poly {
    Poly::parse(text, &["x", "y"]).expect(text)
}

#[test]
fn flint_agrees() {
    let mut checked = 0;
    for line in include_str!("../golden/flint.txt")
        .lines()
        .filter(|l| !l.starts_with('#'))
    {
        let [kind, first, second, answer] = line.split('|').map(str::trim).collect::<Vec<_>>()[..]
        else {
            panic!("four fields: {line}")
        };
        let f = p(first);
        match kind {
            "resultant" => assert!(
                resultant(&f, &p(second), 1, &Control::default()) == Ok(p(answer)),
                "{line}"
            ),
            "discriminant" => assert!(
                discriminant(&f, 1, &Control::default()) == Ok(p(answer)),
                "{line}"
            ),
            "gcd" => assert!(f.gcd(&p(second)).is_associate(&p(answer)), "{line}"),
            "factor" => {
                let factors = f.factor(&Control::default()).expect("two variables");
                let wanted: Vec<(Poly, usize)> = answer
                    .split(';')
                    .map(|part| {
                        let (factor, multiplicity) = part.split_once("^^").expect("a multiplicity");
                        (
                            p(factor.trim()).primitive(),
                            multiplicity.trim().parse().expect("a number"),
                        )
                    })
                    .collect();
                assert_eq!(factors.len(), wanted.len(), "{line}");
                assert!(wanted.iter().all(|w| factors.contains(w)), "{line}");
            }
            "roots" => {
                let roots: Vec<f64> = real_roots(&f.to_upoly(0).expect("one variable"))
                    .iter()
                    .map(|r| r.to_f64())
                    .collect();
                let wanted: Vec<f64> = answer
                    .split(';')
                    .map(|r| r.trim().parse().expect("a number"))
                    .collect();
                assert_eq!(roots.len(), wanted.len(), "{line}");
                // The middle of FLINT's enclosure is not always the nearest number.
                assert!(
                    roots
                        .iter()
                        .zip(&wanted)
                        .all(|(r, w)| (r - w).abs() <= 4.0 * f64::EPSILON * w.abs()),
                    "{line}"
                );
            }
            _ => panic!("what is {kind}?"),
        }
        checked += 1;
    }
    assert_eq!(checked, 17);
}
