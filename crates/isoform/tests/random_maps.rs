//! Random maps with small coefficients through the whole façade: slow, so asked for by
//! `ISOFORM_RANDOM_MAPS=10000 ISOFORM_RANDOM_SECONDS=0.5 cargo test --release -p isoform --test random_maps -- --ignored --nocapture`
//! (how many, and the seconds each may take; `ISOFORM_RANDOM_FIRST` says where to begin).

use isoform::rational_surface;
use isoform_algebra::RBig;
use isoform_mesh::Control;
use isoform_mesh::check::{Options, certify};
use isoform_tess::{Budget, Map, MeshOptions, Mode, TriangulateOptions};
use std::collections::BTreeMap;
use std::ops::Range;
use std::time::{Duration, Instant};

/// A polynomial of a degree with small coefficients, most of them zero.
fn polynomial(rng: &mut fastrand::Rng, degree: usize) -> String {
    let mut text = String::new();
    for i in 0..=degree {
        for j in 0..=degree - i {
            let c = if rng.u8(0..10) < 4 {
                rng.i32(-3..=3)
            } else {
                0
            };
            if c != 0 {
                text += &format!("{c:+}*s^{i}*t^{j}");
            }
        }
    }
    if text.is_empty() {
        "1".to_owned()
    } else {
        text
    }
}

/// A coarse mesh in a box of half width 3.
fn options(mode: Mode, budget: Budget) -> TriangulateOptions {
    let mesh = MeshOptions {
        tolerance: 0.03,
        longest: 1.0,
        triangles: 100_000,
    };
    TriangulateOptions {
        half_width: RBig::from(3),
        domain: None,
        mode,
        mesh,
        budget,
    }
}

/// As many as asked for, 60 of four seconds each where nothing is said.
#[test]
#[ignore = "takes minutes"]
fn random_maps() {
    let asked = |name, default| {
        std::env::var(name)
            .ok()
            .and_then(|n| n.parse().ok())
            .unwrap_or(default)
    };
    let first = asked("ISOFORM_RANDOM_FIRST", 0.0) as u64;
    let seconds = Duration::from_secs_f64(asked("ISOFORM_RANDOM_SECONDS", 4.0));
    try_maps(
        first..first + asked("ISOFORM_RANDOM_MAPS", 60.0) as u64,
        seconds,
    );
}

/// Its region has walls that are closer to each other than rounding: arcs over a place next to one were asked for in the wrong slab.
#[test]
fn walls_closer_than_rounding() {
    let texts = ["-s^0+t^2-3*s", "t-2*s*t", "3*t", "-t+3*s*t"];
    let map = Map::parse(texts, Default::default()).expect("a map");
    let (surface, _) = rational_surface(&map, &options(Mode::Glued, Budget::default()), &|| false)
        .expect("a surface");
    assert!(!surface.triangles.is_empty());
}

/// Next to a base point that others are infinitely near to, a rectangle's edge was split beyond the arc on a face of the box, and certified.
#[test]
fn nothing_certified_is_outside_of_the_box() {
    try_maps(2868..2869, Duration::from_secs(60));
}

#[test]
fn a_few_random_maps() {
    try_maps(0..9, Duration::from_secs(1));
}

/// No panic, no more time than allowed and some, and no crossings or open edges in what is certified.
fn try_maps(seeds: Range<u64>, allowed: Duration) {
    let mut why: BTreeMap<String, usize> = BTreeMap::new();
    let (mut certified, mut reported, mut nothing, mut invalid) = (0, 0, 0, 0);
    // All of them are tried before the test ends: thousands take hours.
    let (mut slow, mut wrong) = (Vec::new(), Vec::new());
    for seed in seeds {
        let mut rng = fastrand::Rng::with_seed(seed);
        let degree = 2 + (seed % 3) as usize;
        let texts: [String; 4] = std::array::from_fn(|_| polynomial(&mut rng, degree));
        let Ok(map) = Map::parse(texts.each_ref().map(String::as_str), Default::default()) else {
            invalid += 1;
            continue;
        };
        println!("{seed} {texts:?}");
        for mode in [Mode::Normalised, Mode::Glued] {
            let clock = Instant::now();
            let stop = || clock.elapsed() > allowed;
            let options = options(
                mode,
                Budget {
                    seconds: 0.18 * allowed.as_secs_f64(),
                    ..Budget::default()
                },
            );
            let made = std::panic::catch_unwind(|| rational_surface(&map, &options, &stop));
            let seconds = clock.elapsed().as_secs_f64();
            if seconds > (2.0 * allowed.as_secs_f64()).max(8.0) {
                println!("{seed} {mode:?} {seconds:.1} s, too slow: {texts:?}");
                slow.push((seed, mode, seconds));
            }
            let (surface, _) = match made {
                Ok(Ok(made)) => made,
                Ok(Err(_)) => {
                    nothing += 1;
                    continue;
                }
                Err(_) => {
                    println!("{seed} {mode:?} panicked");
                    wrong.push((seed, mode));
                    continue;
                }
            };
            if !surface.unproven.is_empty() {
                reported += 1;
                for sentence in &surface.unproven {
                    let kind: String = sentence
                        .chars()
                        .filter(|c| !c.is_ascii_digit())
                        .take(60)
                        .collect();
                    *why.entry(kind).or_default() += 1;
                }
                println!(
                    "{seed} {mode:?} {seconds:.1} s, {} triangles: {:?}",
                    surface.triangles.len(),
                    surface.unproven
                );
                continue;
            }
            certified += 1;
            let mesh = isoform_geom::Mesh {
                points: surface.points,
                triangles: surface.triangles,
                ..Default::default()
            };
            let certificate = certify(&mesh, None, &Options::default(), &Control::default());
            let crossing = if mode == Mode::Glued && !mesh.triangles.is_empty() {
                certificate.intersections.map(|i| i.pairs.count)
            } else {
                Some(0)
            };
            let outside = mesh
                .points
                .iter()
                .flatten()
                .filter(|x| x.abs() > 3.0 * (1.0 + 1e-9))
                .count();
            if !certificate.malformed.is_empty() || crossing != Some(0) || outside > 0 {
                println!(
                    "{seed} {mode:?} certified and wrong: {:?}, {crossing:?} pairs, {outside} outside",
                    certificate.malformed
                );
                wrong.push((seed, mode));
            }
        }
    }
    println!(
        "{certified} certified, {reported} with something open, {nothing} stopped, {invalid} maps invalid"
    );
    let mut why: Vec<_> = why.into_iter().collect();
    why.sort_by_key(|w| std::cmp::Reverse(w.1));
    for (sentence, n) in why {
        println!("{n:4} {sentence}");
    }
    assert!(
        wrong.is_empty(),
        "panics, or certified and wrong: {wrong:?}"
    );
    assert!(slow.is_empty(), "too slow: {slow:?}");
}
