#![allow(warnings)]
#[path = "../tests/support/mod.rs"]
mod support;
use isoform_fit::*;
use isoform_geom::*;
use support::*;
fn main() {
    let t = TestPart::new(false);
    let b: Vec<_> = LO.iter().zip(HI).map(|(l, h)| Some((*l, h))).collect();
    let starts = rows_of(&shared().unwrap().join("fitting/starts100.txt"));
    let n: usize = std::env::args().nth(1).map_or(10, |s| s.parse().unwrap());
    for name in std::env::args().skip(2) {
        let name = name.as_str();
        let pts = variant(name).unwrap();
        let (mut ev, mut st, mut ok, mut bad) = (vec![], 0, 0, vec![]);
        for seed in 0..n as u64 {
            for s in &starts[..10] {
                let o = Options { seed, start: Some(s.clone()), bounds: b.clone(), ..Options::default() };
                let f = fit(&pts, &t, &o, &Control::default()).unwrap();
                ev.push(f.evaluations);
                st += f.starts;
                let mut a = canonical(&f.values());
                if name == "hidden" {
                    let ok2 = f.undetermined.len() == 1 && f.undetermined[0].parameters == ["vz", "dz"];
                    a[5] += a[2] - TRUTH[2];
                    a[2] = TRUTH[2];
                    if !ok2 {
                        bad.push((seed, f.undetermined.clone()));
                        a[5] = 99.0;
                    }
                }
                if worst_error(&a) < if name == "noise0.05" { 0.06 } else { 0.02 } {
                    ok += 1;
                } else if k_bad() {
                    println!("{a:?}");
                }
            }
        }
        ev.sort();
        let k = ev.len();
        println!(
            "{name}: ok {ok} of {k}; evals mean {} median {} max {} starts {:.1} {bad:?}",
            ev.iter().sum::<usize>() / k,
            ev[k / 2],
            ev[k - 1],
            st as f64 / k as f64
        );
    }
}
fn k_bad() -> bool {
    std::env::var("SHOW").is_ok()
}
