//! Success counts, times and accuracy of the fit on the shared variants of the test part, with a
//! hand-written template.
//!
//! `cargo run --release -p isoform-fit --example testpart_rates [variant ...]`; RAYON_NUM_THREADS=1
//! for times on one core.

#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../tests/it/support.rs"]
mod support;

use isoform_fit::{Control, Fit, Options, fit};
use isoform_geom::Point3;
use isoform_testdata::shared_data;
use std::path::PathBuf;
use std::time::Instant;
use support::{HI, LO, SET1, SET2, TRUTH, TestPart, cramer_rao, rows_of, variant, worst_error};

/// The folder of the variants, in full: those of tests/data are thinned.
fn folder() -> PathBuf {
    shared_data("fitting").expect("the folder of shared data")
}

fn main() {
    let folder = folder();
    let wide = rows_of(&folder.join("starts100.txt"));
    let said: Vec<String> = std::env::args().skip(1).collect();
    let all = [
        "clean",
        "noise0.01",
        "noise0.05",
        "poly",
        "partial",
        "outlier10",
        "hidden",
    ];
    let names: Vec<&str> = if said.is_empty() {
        all.to_vec()
    } else {
        said.iter().map(String::as_str).collect()
    };
    for name in names {
        if let Some(sigma) = name.strip_prefix("draws") {
            draws(sigma.parse().expect("a deviation"));
            continue;
        }
        let points = variant(&folder, name);
        let starts: Vec<Vec<f64>> = [SET1.to_vec(), SET2.to_vec()]
            .into_iter()
            .chain(wide.iter().cloned())
            .collect();
        let starts = if name == "outlier10" {
            &starts[..22]
        } else {
            &starts[..]
        };
        run(name, &points, starts);
    }
}

fn run(name: &str, points: &[Point3], starts: &[Vec<f64>]) {
    let template = TestPart::new(false);
    let bounds: Vec<_> = LO.iter().zip(HI).map(|(l, h)| Some((*l, h))).collect();
    let sigma = match name {
        "noise0.05" => 0.05,
        "clean" => 0.0,
        _ => 0.01,
    };
    let sd = cramer_rao(&variant(&folder(), "clean"));
    let tolerance = |i: usize| {
        if name == "clean" {
            1e-6 * TRUTH[i].abs()
        } else {
            (if name == "poly" { 2e-2 } else { 1e-2 } * TRUTH[i].abs()).max(5.0 * sigma * sd[i])
        }
    };
    let (mut good, mut times, mut z_worst, mut phases) =
        (0, Vec::new(), 0.0_f64, Vec::<(&str, f64)>::new());
    let mut worst: f64 = 0.0;
    let mut outliers = Vec::new();
    let mut starts_run = 0;
    let mut last: Option<Fit> = None;
    for start in starts {
        let options = Options {
            start: Some(start.clone()),
            bounds: bounds.clone(),
            ..Options::default()
        };
        let begun = Instant::now();
        let fitted = match fit(points, &template, &options, &Control::default()) {
            Ok(fitted) => fitted,
            Err(error) => {
                println!("{name}: {error}");
                continue;
            }
        };
        times.push(begun.elapsed().as_secs_f64() * 1e3);
        let a = support::canonical(&fitted.values());
        let ok = if name == "hidden" {
            let open: Vec<&str> = fitted
                .parameters
                .iter()
                .filter(|p| p.status.as_str() == "undetermined")
                .map(|p| p.name.as_str())
                .collect();
            let d: f64 = (0..12)
                .filter(|i| *i != 2 && *i != 5)
                .map(|i| (a[i] - TRUTH[i]).abs() / (0.01 * sd[i]))
                .fold(0.0, f64::max);
            worst = worst
                .max(d.max((a[2] + a[5] - TRUTH[2] - TRUTH[5]).abs() / (0.01 / 2280f64.sqrt())));
            open == ["vz", "dz"] && d < 3.0
        } else {
            worst = worst.max(worst_error(&a));
            (0..12).all(|i| (a[i] - TRUTH[i]).abs() <= tolerance(i))
        };
        if !ok {
            println!(
                "  miss {a:.4?} starts {} hits {} {:?}",
                fitted.starts, fitted.hits, fitted.warnings
            );
        }
        good += usize::from(ok);
        starts_run += fitted.starts;
        if sigma > 0.0 {
            let z: f64 = (0..12)
                .map(|i| ((a[i] - TRUTH[i]) / (sigma * sd[i])).powi(2))
                .sum::<f64>()
                / 12.0;
            z_worst = z_worst.max(z.sqrt());
        }
        outliers.push(fitted.n_outliers);
        for (k, (phase, s)) in fitted.seconds.iter().enumerate() {
            if phases.len() <= k {
                phases.push((phase, 0.0));
            }
            phases[k].1 += 1e3 * s / starts.len() as f64;
        }
        last = Some(fitted);
    }
    times.sort_by(f64::total_cmp);
    let phases: Vec<String> = phases.iter().map(|(p, s)| format!("{p} {s:.1}")).collect();
    println!(
        "{name}: {good} of {}; ms median {:.1} max {:.1} ({}); starts {:.1}; worst {worst:.2e}; \
         rms z {z_worst:.2}; outliers {:?}..{:?}",
        starts.len(),
        times[times.len() / 2],
        times[times.len() - 1],
        phases.join(", "),
        starts_run as f64 / starts.len() as f64,
        outliers.iter().min(),
        outliers.iter().max(),
    );
    if let Some(f) = last {
        println!(
            "  rms {:.3e} noise {:.3e} loss {:?} {:?} {:?} open {:?} warnings {:?} reasons {:?} \
             correlation {:.2}",
            f.rms,
            f.noise,
            f.loss,
            f.data_to_model,
            f.model_to_data,
            f.undetermined.iter().map(|u| &u.why).collect::<Vec<_>>(),
            f.warnings,
            f.reasons,
            f.neighbour_correlation,
        );
    }
}

/// Intervals and accuracy over many draws of the noise.
fn draws(sigma: f64) {
    let template = TestPart::new(false);
    let clean = variant(&folder(), "clean");
    let sd = cramer_rao(&clean);
    let bounds: Vec<_> = LO.iter().zip(HI).map(|(l, h)| Some((*l, h))).collect();
    let (mut inside, mut z, mut mean, mut ratio) = (0, 0.0, [0.0; 12], 0.0);
    const DRAWS: usize = 200;
    for seed in 0..DRAWS {
        let mut points = clean.clone();
        support::noise(&mut points, sigma, seed as u64 + 100);
        let options = Options {
            start: Some(SET1.to_vec()),
            bounds: bounds.clone(),
            ..Options::default()
        };
        let f = fit(&points, &template, &options, &Control::default()).expect("a fit");
        let a = f.values();
        let swapped = support::canonical(&a) != a[..];
        for i in 0..12 {
            let k = if swapped && i >= 6 {
                (i - 6 + 3) % 6 + 6
            } else {
                i
            };
            let p = &f.parameters[k];
            let (lo, hi) = p.ci95.unwrap_or((f64::NAN, f64::NAN));
            inside += usize::from(lo <= TRUTH[i] && TRUTH[i] <= hi);
            let d = (p.value - TRUTH[i]) / (sigma * sd[i]);
            z += d * d;
            mean[i] += d / DRAWS as f64;
            ratio += p.sd.unwrap_or(f64::NAN) / (sigma * sd[i]) / (12 * DRAWS) as f64;
        }
    }
    let total = 12 * DRAWS;
    println!(
        "sigma {sigma}: {:.1} % of {total} intervals cover, rms z {:.3}, sd ratio {ratio:.3}, \
         mean z {mean:.2?}",
        100.0 * inside as f64 / total as f64,
        (z / total as f64).sqrt()
    );
}
