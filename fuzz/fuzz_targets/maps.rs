//! Any four lines as a map: a map or an error; those of low degree are triangulated for a short
//! time.
//!
//! `cargo +nightly fuzz run maps -- -rss_limit_mb=2048 -timeout=10`
#![no_main]

use isoform_algebra::RBig;
use isoform_tess::{Budget, Control, Map, MeshOptions, Mode, TriangulateOptions, triangulate};
use libfuzzer_sys::fuzz_target;

const SECONDS: f64 = 1.0;

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    let lines: Vec<&str> = text.lines().collect();
    let Ok(texts) = <[&str; 4]>::try_from(lines) else {
        return;
    };
    let Ok(map) = Map::parse(texts, Default::default()) else {
        return;
    };
    if map.degree() > 4 || text.len() > 400 {
        return;
    }
    for mode in [Mode::Normalised, Mode::Glued] {
        let control = Control::default().for_seconds(SECONDS);
        let options = TriangulateOptions {
            half_width: RBig::from(3),
            domain: None,
            mode,
            mesh: MeshOptions {
                tolerance: 0.05,
                longest: 1.0,
                triangles: 20_000,
            },
            budget: Budget {
                seconds: 0.18 * SECONDS,
                ..Budget::default()
            },
        };
        if let Ok((surface, _)) = triangulate(&map, &options, &control) {
            let n = surface.points.len();
            assert!(
                surface
                    .triangles
                    .iter()
                    .flatten()
                    .all(|&v| (v as usize) < n)
            );
            assert!(
                surface
                    .points
                    .iter()
                    .flatten()
                    .all(|x| x.abs() <= 3.0 * (1.0 + 1e-9))
            );
        }
    }
});
