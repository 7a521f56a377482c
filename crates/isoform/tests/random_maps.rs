//! Random maps with small coefficients through the whole façade: slow, so asked for by
//! `ISOFORM_RANDOM_MAPS=10000 ISOFORM_RANDOM_SECONDS=0.5 cargo test --release -p isoform --test random_maps -- --ignored --nocapture`
//! (how many, and the seconds each may take).

use isoform::rational_surface;
use isoform_algebra::RBig;
use isoform_mesh::Control;
use isoform_mesh::check::{Options, certify};
use isoform_tess::{Budget, Map, MeshOptions, Mode, TriangulateOptions};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// A polynomial of a degree with small coefficients, most of them zero.
fn polynomial(rng: &mut fastrand::Rng, degree: usize) -> String {
    let mut text = String::new();
    for i in 0..=degree {
        for j in 0..=degree - i {
            let c = if rng.u8(0..10) < 4 { rng.i32(-3..=3) } else { 0 };
            if c != 0 {
                text += &format!("{c:+}*s^{i}*t^{j}");
            }
        }
    }
    if text.is_empty() { "1".to_owned() } else { text }
}

/// As many as asked for, 60 of four seconds each where nothing is said.
#[test]
#[ignore = "takes minutes"]
fn random_maps() {
    let asked = |name, default| std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(default);
    try_maps(asked("ISOFORM_RANDOM_MAPS", 60.0) as u64, Duration::from_secs_f64(asked("ISOFORM_RANDOM_SECONDS", 4.0)));
}

#[test]
fn a_few_random_maps() {
    try_maps(9, Duration::from_secs(1));
}

/// No panic, no more time than allowed and some, and no crossings or open edges in what is certified.
fn try_maps(count: u64, allowed: Duration) {
    let mut why: BTreeMap<String, usize> = BTreeMap::new();
    let (mut certified, mut reported, mut nothing, mut invalid) = (0, 0, 0, 0);
    // All of them are tried before the test ends: thousands take hours.
    let (mut slow, mut wrong) = (Vec::new(), Vec::new());
    for seed in 0..count {
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
            let options = TriangulateOptions {
                half_width: RBig::from(3),
                domain: None,
                mode,
                mesh: MeshOptions { tolerance: 0.03, longest: 1.0, triangles: 100_000 },
                budget: Budget { seconds: 0.18 * allowed.as_secs_f64(), ..Budget::default() },
            };
            let made = rational_surface(&map, &options, &stop);
            let seconds = clock.elapsed().as_secs_f64();
            if seconds > 2.0 * allowed.as_secs_f64() + 5.0 {
                println!("{seed} {mode:?} {seconds:.1} s, too slow: {texts:?}");
                slow.push((seed, mode, seconds));
            }
            let Ok((surface, _)) = made else {
                nothing += 1;
                continue;
            };
            if !surface.unproven.is_empty() {
                reported += 1;
                for sentence in &surface.unproven {
                    let kind: String = sentence.chars().filter(|c| !c.is_ascii_digit()).take(60).collect();
                    *why.entry(kind).or_default() += 1;
                }
                println!("{seed} {mode:?} {seconds:.1} s, {} triangles: {:?}", surface.triangles.len(), surface.unproven);
                continue;
            }
            certified += 1;
            let mesh = isoform_geom::Mesh { points: surface.points, triangles: surface.triangles, ..Default::default() };
            let certificate = certify(&mesh, None, &Options::default(), &Control::default());
            let crossing =
                if mode == Mode::Glued && !mesh.triangles.is_empty() { certificate.intersections.map(|i| i.pairs.count) } else { Some(0) };
            let outside = mesh.points.iter().flatten().filter(|x| x.abs() > 3.0 * (1.0 + 1e-9)).count();
            if !certificate.malformed.is_empty() || crossing != Some(0) || outside > 0 {
                println!("{seed} {mode:?} certified and wrong: {:?}, {crossing:?} pairs, {outside} outside", certificate.malformed);
                wrong.push((seed, mode));
            }
        }
    }
    println!("{certified} certified, {reported} with something open, {nothing} stopped, {invalid} maps invalid");
    let mut why: Vec<_> = why.into_iter().collect();
    why.sort_by_key(|w| std::cmp::Reverse(w.1));
    for (sentence, n) in why {
        println!("{n:4} {sentence}");
    }
    assert!(wrong.is_empty(), "certified and wrong: {wrong:?}");
    assert!(slow.is_empty(), "too slow: {slow:?}");
}
