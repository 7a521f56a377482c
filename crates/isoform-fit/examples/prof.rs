#![allow(warnings)]
#[path = "../tests/support/mod.rs"]
mod support;
use isoform_fit::*;
use isoform_geom::*;
use std::time::Instant;
use support::*;
fn main() {
    let pts = variant("noise0.05").unwrap();
    let t = TestPart::new(false);
    let time = |n: &str, f: &mut dyn FnMut()| {
        let t0 = Instant::now();
        for _ in 0..10 {
            f();
        }
        println!("{n} {:.2} ms", t0.elapsed().as_secs_f64() * 100.0);
    };
    time("build", &mut || {
        std::hint::black_box(KdTree::new(&pts));
    });
    let tree = KdTree::new(&pts);
    let mut found = vec![];
    time("1000 k9", &mut || {
        for p in &pts[..1000] {
            tree.nearest_k(*p, 9, &mut found);
        }
    });
    time("1000 k1", &mut || {
        for p in &pts[..1000] {
            std::hint::black_box(tree.nearest(*p));
        }
    });
    let mut o = vec![0; pts.len()];
    time("parts", &mut || t.parts(&pts, &TRUTH, &mut o));
    let b: Vec<_> = LO.iter().zip(HI).map(|(l, h)| Some((*l, h))).collect();
    for name in ["clean", "noise0.01", "noise0.05", "poly", "outlier10", "hidden"] {
        let pts = variant(name).unwrap();
        for k in ["set2"] {
            let o = Options { start: Some(SET2.to_vec()), bounds: b.clone(), ..Options::default() };
            let f = fit(&pts, &t, &o, &Control::default()).unwrap();
            let f = fit(&pts, &t, &o, &Control::default()).unwrap();
            let pol: Vec<_> = f.history.iter().filter(|s| s.start == f.starts).map(|s| (s.iteration, s.rms)).collect();
            println!(
                "{name} starts {} hits {} evals {} {:?} polish steps {:?}",
                f.starts,
                f.hits,
                f.evaluations,
                f.seconds.iter().map(|s| (s.0, (s.1 * 1e4).round() / 10.0)).collect::<Vec<_>>(),
                pol
            );
            let mut m: Vec<(usize, usize, f64)> = vec![];
            for s in &f.history {
                if s.start < f.starts {
                    if m.len() <= s.start {
                        m.push((0, 0, 0.0));
                    }
                    m[s.start] = (s.start, s.iteration, s.rms);
                }
            }
            println!("  {:?}", m);
        }
    }
}
