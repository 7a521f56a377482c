//! Figures on speed, printed: `cargo test --release -p isoform-algebra --test figures -- --ignored --nocapture`.

use isoform_algebra::Poly;
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

#[test]
#[ignore = "measures"]
fn composition() {
    let mut rng = fastrand::Rng::with_seed(4);
    for (degree, inner) in [(4, 2), (9, 3), (16, 4)] {
        let f = dense(&mut rng, 4, degree, 60, true);
        let parts: Vec<Poly> = (0..4).map(|_| dense(&mut rng, 2, inner, 20, false)).collect();
        let pulled = timed(&format!("form of degree {degree} through degree {inner}"), || f.compose(&parts));
        assert_eq!(pulled.total_degree(), usize::from(degree * inner));
        timed("  its product with a polynomial of degree 4", || &pulled * &parts[0]);
        let product = &pulled * &parts[0];
        timed("  divided again", || assert_eq!(product.div_exact(&parts[0]).as_ref(), Some(&pulled)));
    }
}
