//! Covers of models: `cargo run --release -p isoform-patch --example cover -- MODEL.hf [DEGREE] [TOLERANCE] [HALF_WIDTH]`.

use isoform_field::hyperfun::{Mode, Model};
use isoform_geom::Aabb;
use isoform_patch::{Options, cover_parts};
use std::time::Instant;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize, or: f64| arguments.get(k).map_or(or, |a| a.parse().expect("a number"));
    let text = std::fs::read_to_string(&arguments[0]).expect("a file");
    let model = Model::parse(&text, Mode::Default).expect("a model");
    let parts = isoform_field::parts_of(&model, &vec![0.0; model.n_params()]).expect("parts");
    println!("{} parts", parts.parts.len());
    let (degree, tolerance, b) = (number(1, 3.0) as usize, number(2, 1e-4), number(3, 0.5));
    let options =
        Options { tolerance: Some(tolerance), ..Options::paper((degree, degree), Aabb { lo: [-b; 3], hi: [b; 3] }) };
    let clock = Instant::now();
    let late = || clock.elapsed().as_secs_f64() > number(4, 100.0);
    let cover = cover_parts(&parts, &options, 3000, 2, &late).expect("a cover");
    println!("{} patches, {} of {} samples, {:.1} s", cover.patches.len(), cover.covered, cover.samples, clock.elapsed().as_secs_f64());
    for p in cover.patches.iter().take(30) {
        let g = &p.grown;
        println!("{:.3?} area {:.4} bound {:.1e} rows {} {:?}", g.seed_point, g.area(&options.region), p.distances.bound.unwrap_or(f64::NAN), g.trace.len(), p.seconds.iter().map(|s| (s.1 * 1e3) as u32).collect::<Vec<_>>());
    }
}
