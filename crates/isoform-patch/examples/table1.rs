//! Table 1 of Wurm, Jüttler and Kim (2003), recomputed: `cargo run --release -p isoform-patch
//! --example table1 [-- newton|frozen]`.
//!
//! The paper does not print the equations of its surfaces of degree 8 and 12. They are replaced by
//! a figure eight revolved about an axis next to it, and by a Schwarz P surface whose cosines are
//! Taylor polynomials. One thread; the table is in Markdown.

use isoform_field::Polynomial;
use isoform_geom::Aabb;
use isoform_patch::{Control, Method, Options, Phase, parameterize};
use std::time::Instant;

type Terms = Vec<([u16; 3], f64)>;

/// Returns the product of two polynomials.
fn times(a: &Terms, b: &Terms) -> Terms {
    let mut product: Terms = Vec::new();
    for (e, c) in a {
        for (f, d) in b {
            let g = std::array::from_fn(|k| e[k] + f[k]);
            match product.iter_mut().find(|t| t.0 == g) {
                Some(t) => t.1 += c * d,
                None => product.push((g, c * d)),
            }
        }
    }
    product
}

fn plus(a: &Terms, b: &Terms, s: f64) -> Terms {
    let mut sum = a.clone();
    for (e, c) in b {
        match sum.iter_mut().find(|t| t.0 == *e) {
            Some(t) => t.1 += s * c,
            None => sum.push((*e, s * c)),
        }
    }
    sum
}

/// Figure eight (ρ − R)⁴ − a²(ρ − R)² + z²/25 = 0 with ρ² = x² + y², R = 3/10 and a² = 1/25,
/// without its root: A(ρ²) + ρ B(ρ²) = 0 becomes A² − ρ² B² = 0.
fn figure8() -> Terms {
    let (r, a2) = (0.3, 0.04);
    let rho2: Terms = vec![([2, 0, 0], 1.0), ([0, 2, 0], 1.0)];
    let one: Terms = vec![([0, 0, 0], 1.0)];
    let z2: Terms = vec![([0, 0, 2], 1.0)];
    // (ρ−R)² = ρ² − 2Rρ + R²; (ρ−R)⁴ = ρ⁴ + 6R²ρ² + R⁴ − 4Rρ(ρ² + R²).
    let even = plus(
        &plus(
            &plus(&times(&rho2, &rho2), &rho2, 6.0 * r * r - a2),
            &one,
            r.powi(4) - a2 * r * r,
        ),
        &z2,
        0.04,
    );
    let odd = plus(
        &plus(&Vec::new(), &rho2, -4.0 * r),
        &one,
        -4.0 * r.powi(3) + 2.0 * a2 * r,
    );
    plus(
        &times(&even, &even),
        &times(&rho2, &times(&odd, &odd)),
        -1.0,
    )
}

/// Schwarz P surface Σ cos(2πx) by Taylor polynomials of degree 12.
fn schwarz12() -> Terms {
    let mut terms: Terms = vec![([0, 0, 0], 3.0)];
    let (mut c, w) = (1.0, std::f64::consts::TAU);
    for k in 1..=6u16 {
        c *= -w * w / f64::from((2 * k - 1) * (2 * k));
        for axis in 0..3 {
            let mut e = [0; 3];
            e[axis] = 2 * k;
            terms.push((e, c));
        }
    }
    terms
}

fn main() {
    let mut method = Method::GaussNewton;
    for word in std::env::args().skip(1) {
        method = match word.as_str() {
            "newton" => Method::Newton,
            "frozen" => Method::Frozen,
            _ => Method::GaussNewton,
        };
    }
    let sphere: Terms = vec![
        ([2, 0, 0], 1.0),
        ([0, 2, 0], 1.0),
        ([0, 0, 2], 1.0),
        ([0, 0, 0], -0.25),
    ];
    let whitney: Terms = vec![([2, 0, 0], 1.0), ([0, 2, 1], -1.0), ([0, 2, 0], -0.5)];
    let rows = [
        ("sphere", sphere, (2, 2), [0.0, 0.0, 0.5], "1.1 s, 14, 46"),
        (
            "Schwarz P, degree 12",
            schwarz12(),
            (3, 3),
            [0.25, 0.25, 0.25],
            "32 s, 10, 50",
        ),
        (
            "figure eight revolved",
            figure8(),
            (3, 3),
            [0.38, 0.0, 0.07],
            "10 s, 18, 57",
        ),
        (
            "Whitney umbrella",
            whitney,
            (3, 3),
            [0.22, 0.35, 0.0],
            "14.91 s, 18, 113",
        ),
    ];
    println!(
        "| surface | d | m,n | paper: time, extrapolations, Newton steps | time | extrapolations | Newton steps | area in the cube | distance at most |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, terms, degree, seed, paper) in rows {
        let field = Polynomial::new(terms);
        let options = Options {
            seed_point: Some(seed),
            method,
            ..Options::paper(
                degree,
                Aabb {
                    lo: [-0.5; 3],
                    hi: [0.5; 3],
                },
            )
        };
        let clock = Instant::now();
        match parameterize(&field, &options, &Control::default()) {
            Ok(made) => {
                let (g, (m, n)) = (&made.grown, degree);
                let bound = made
                    .distances
                    .bound
                    .map_or("not proved".to_owned(), |b| format!("{b:.1e}"));
                println!(
                    "| {name} | {} | {m},{n} | {paper} | {:.0} ms | {} | {} | {:.3} | {bound} |",
                    field.degree(),
                    1e3 * clock.elapsed().as_secs_f64(),
                    g.count(Phase::Grow),
                    g.count(Phase::Newton),
                    g.area(&options.region),
                );
            }
            Err(error) => println!("| {name} | {error} |"),
        }
    }
}
