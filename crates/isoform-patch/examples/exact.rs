//! Numbers of patches that become exact and are recognised: `cargo run --release -p isoform-patch
//! --example exact [-- SEEDS [SURFACE]]`.
//!
//! Each row is a surface and a degree; all with the paper's settings, from the first SEEDS seeds
//! (20 by default). The table is in Markdown.

use isoform_field::Polynomial;
use isoform_geom::Aabb;
use isoform_patch::{Control, Options, parameterize};
use std::time::Instant;

type Term = ([u16; 3], f64);

/// Torus with radii 0.33 and 0.15: (x² + y² + z² + R² − r²)² = 4 R² (x² + y²).
fn torus() -> Vec<Term> {
    let (r, s) = (0.33f64.powi(2), 0.15f64.powi(2));
    let c = r - s;
    vec![
        ([4, 0, 0], 1.0),
        ([0, 4, 0], 1.0),
        ([0, 0, 4], 1.0),
        ([2, 2, 0], 2.0),
        ([2, 0, 2], 2.0),
        ([0, 2, 2], 2.0),
        ([2, 0, 0], 2.0 * c - 4.0 * r),
        ([0, 2, 0], 2.0 * c - 4.0 * r),
        ([0, 0, 2], 2.0 * c),
        ([0, 0, 0], c * c),
    ]
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let seeds: u64 = words.first().and_then(|w| w.parse().ok()).unwrap_or(20);
    let quadric = |x: f64, y: f64, z: f64, z1: f64, c: f64| {
        vec![
            ([2, 0, 0], x),
            ([0, 2, 0], y),
            ([0, 0, 2], z),
            ([0, 0, 1], z1),
            ([0, 0, 0], c),
        ]
        .into_iter()
        .filter(|t| t.1 != 0.0)
        .collect()
    };
    let surfaces: [(&str, Vec<Term>); 9] = [
        ("sphere", quadric(1.0, 1.0, 1.0, 0.0, -0.25)),
        ("ellipsoid", quadric(1.0, 2.0, 3.0, 0.0, -0.25)),
        ("cylinder", quadric(9.0, 9.0, 0.0, 0.0, -1.0)),
        ("cone", quadric(9.0, 9.0, -1.0, 2.0, -1.0)),
        ("hyperboloid", quadric(1.0, 1.0, -1.0, 0.0, -0.0625)),
        ("paraboloid", quadric(1.0, 2.0, 0.0, -1.0, -0.25)),
        ("saddle", quadric(1.0, -1.0, 0.0, -0.5, 0.0)),
        ("torus", torus()),
        (
            "Whitney",
            vec![([2, 0, 0], 1.0), ([0, 2, 1], -1.0), ([0, 2, 0], -0.5)],
        ),
    ];
    println!(
        "| surface | m,n | I ≤ 10⁻²⁰ | exact | named | least area | largest I of those | time |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (name, terms) in surfaces
        .iter()
        .filter(|s| words.get(1).is_none_or(|w| w == s.0))
    {
        let field = Polynomial::new(terms.clone());
        for degree in [(2, 2), (3, 3)] {
            let (mut small, mut exact, mut named) = (0, 0, Vec::new());
            let (mut area, mut most) = (f64::INFINITY, 0.0f64);
            let clock = Instant::now();
            for seed in 1..=seeds {
                let options = Options {
                    exact: true,
                    seed,
                    ..Options::paper(
                        degree,
                        Aabb {
                            lo: [-0.5; 3],
                            hi: [0.5; 3],
                        },
                    )
                };
                let Ok(made) = parameterize(&field, &options, &Control::default()) else {
                    continue;
                };
                let i = made.grown.terms.i;
                small += usize::from(i <= 1e-20);
                exact += usize::from(made.is_exact);
                area = area.min(made.grown.area(&options.region));
                if i <= 1e-20 {
                    most = most.max(i);
                }
                if words.len() > 1 {
                    println!(
                        "{seed}: I {i:e}, {:?}, area {}, {:?}",
                        made.distances,
                        made.grown.area(&options.region),
                        made.quadric
                    );
                }
                named.extend(made.quadric.map(|q| q.name()));
            }
            let time = 1e3 * clock.elapsed().as_secs_f64() / seeds as f64;
            let count = named.len();
            named.dedup();
            println!(
                "| {name} | {},{} | {small} | {exact} | {count} {} | {area:.3} | {most:.0e} | {time:.0} ms |",
                degree.0,
                degree.1,
                named.join(", ")
            );
        }
    }
}
