//! Evaluators and a hand-written loop of the same formula, in one run: `cargo run --release -p
//! isoform-field --example evaluators`.
//!
//! The model is the paper's test part (twelve parameters); the numbers are millions of points per
//! second, the last column the share of the hand-written loop.

use isoform_field::hyperfun::{Mode, Model};
use isoform_field::{Bound, Graph, Residual, Shape, Tape};
use isoform_geom::{Field, ParamField, Point3};
use std::hint::black_box;
use std::time::Instant;

const PART: &str = include_str!("../../../examples/templates/testpart.hf");
const A: [f64; 12] = [
    -5.1, -4.05, -1.95, 10.2, 6.2, 3.9, 4.6, 2.5, 1.7, 2.9, -1.85, 1.15,
];

/// The part by hand, on separate arrays of coordinates, compiled for AVX2 where the machine has it.
mod by_hand {
    #[inline(always)]
    fn body(x: &[f64], y: &[f64], z: &[f64], a: &[f64; 12], out: &mut [f64]) {
        let and = |u: f64, v: f64| u + v - (u * u + v * v).sqrt();
        let (r1, r2) = (a[8] * a[8], a[11] * a[11]);
        let hi = [a[0] + a[3], a[1] + a[4], a[2] + a[5]];
        for i in 0..out.len() {
            let (x, y, z) = (x[i], y[i], z[i]);
            let b = and(
                and((x - a[0]) * (hi[0] - x), (y - a[1]) * (hi[1] - y)),
                (z - a[2]) * (hi[2] - z),
            );
            let (u, v, s, t) = (x - a[6], y - a[7], x - a[9], y - a[10]);
            out[i] = and(and(b, u * u + v * v - r1), s * s + t * t - r2);
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn avx2(x: &[f64], y: &[f64], z: &[f64], a: &[f64; 12], out: &mut [f64]) {
        body(x, y, z, a, out);
    }

    pub(super) fn values(x: &[f64], y: &[f64], z: &[f64], a: &[f64; 12], out: &mut [f64]) {
        let n = out.len();
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            #[allow(unsafe_code, reason = "the processor was asked in the line above")]
            return unsafe { avx2(&x[..n], &y[..n], &z[..n], a, out) };
        }
        body(&x[..n], &y[..n], &z[..n], a, out);
    }
}

/// Best of many runs, in seconds.
fn best(mut f: impl FnMut()) -> f64 {
    let mut least = f64::INFINITY;
    let begin = Instant::now();
    while begin.elapsed().as_secs_f64() < 0.6 {
        let t = Instant::now();
        f();
        least = least.min(t.elapsed().as_secs_f64());
    }
    least
}

fn main() {
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a pool");
    let two = rayon::ThreadPoolBuilder::new()
        .num_threads(2)
        .build()
        .expect("a pool");
    let model = Model::parse(PART, Mode::Default).expect("the test part");
    let mut graph = Graph::new();
    let root = model.compile(&mut graph).expect("an expression");
    let shape = Shape::new(&mut graph, root);
    let tape = Tape::new(&graph, &[root], 3, 12);
    let residual = Residual::new(tape.clone());
    let metric = Residual::new(Tape::new(&graph, &[shape.distance], 3, 12));

    let n = 10_714;
    let points: Vec<Point3> = (0..n)
        .map(|i| {
            let t = f64::from(i);
            [
                5.0 * (t * 0.754_877).sin(),
                3.0 * (t * 0.569_84).cos() - 1.0,
                2.0 * (t * 0.327).sin(),
            ]
        })
        .collect();
    let axis = |k: usize| -> Vec<f64> { points.iter().map(|p| p[k]).collect() };
    let (x, y, z) = (axis(0), axis(1), axis(2));
    let mut out = vec![0.0; n as usize];
    let rate = |seconds: f64| f64::from(n) / seconds / 1e6;

    let hand = best(|| by_hand::values(black_box(&x), &y, &z, &A, &mut out));
    let want = out.clone();
    println!("{} operations; {n} points", tape.len());
    let line = |name: &str, s: f64| {
        println!(
            "{name:44} {:8.1} M/s  {:7.1} us  {:.3}",
            rate(s),
            s * 1e6,
            hand / s
        )
    };
    line("values, by hand", hand);
    one.install(|| {
        line(
            "values",
            best(|| residual.values(black_box(&points), &A, &mut out)),
        );
        assert!(
            out.iter()
                .zip(&want)
                .all(|(u, v)| (u - v).abs() < 1e-12 * (1.0 + v.abs())),
            "the two must agree"
        );
        let mut grad = vec![0.0; 15 * n as usize];
        line(
            "value and 15 derivatives",
            best(|| residual.all_gradients(black_box(&points), &A, &mut out, &mut grad)),
        );
        let mut g = vec![[0.0; 3]; n as usize];
        line(
            "value and gradient in space",
            best(|| residual.gradients(black_box(&points), &A, &mut out, &mut g)),
        );
        let (mut gradient, mut hessian) = ([0.0; 12], [0.0; 144]);
        line(
            "normal equations, 12 parameters",
            best(|| {
                black_box(residual.normal_equations(
                    black_box(&points),
                    &[],
                    &A,
                    &mut gradient,
                    &mut hessian,
                ));
            }),
        );
        line(
            "the same, 256 points",
            41.85
                * best(|| {
                    black_box(residual.normal_equations(
                        black_box(&points[..256]),
                        &[],
                        &A,
                        &mut gradient,
                        &mut hessian,
                    ));
                }),
        );
        line(
            "metric normal equations",
            best(|| {
                black_box(metric.normal_equations(
                    black_box(&points),
                    &[],
                    &A,
                    &mut gradient,
                    &mut hessian,
                ));
            }),
        );
        let bound = Bound::new(residual.clone(), &A);
        let mut jets = vec![
            isoform_num::Jet2 {
                v: 0.0,
                g: [0.0; 3],
                h: [0.0; 6]
            };
            n as usize
        ];
        line("2-jets", best(|| bound.jets(black_box(&points), &mut jets)));
        line(
            "2-jets, point by point",
            best(|| {
                points.iter().take(1000).for_each(|p| {
                    black_box(bound.jet(*p));
                })
            }) * 10.714,
        );
    });
    two.install(|| {
        line(
            "values, 2 threads",
            best(|| residual.values(black_box(&points), &A, &mut out)),
        );
        let (mut gradient, mut hessian) = ([0.0; 12], [0.0; 144]);
        line(
            "normal equations, 2 threads",
            best(|| {
                black_box(residual.normal_equations(
                    black_box(&points),
                    &[],
                    &A,
                    &mut gradient,
                    &mut hessian,
                ));
            }),
        );
    });
}
