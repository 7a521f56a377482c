//! The facts of the collection of rational surfaces in `../shared/zoo`, where it is present.

use isoform_tess::{Map, Options, base_multiplicity, base_points};
use serde_json::Value;
use std::path::Path;
use std::time::Instant;

/// Name, facts and map of every valid surface; nothing where the collection is absent.
fn zoo() -> Vec<(String, Value, Map)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/zoo");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        println!("skipped: {} is absent", folder.display());
        return Vec::new();
    };
    let mut paths: Vec<_> = entries.flatten().map(|e| e.path()).filter(|p| p.extension().is_some_and(|e| e == "json")).collect();
    paths.sort();
    let mut found = Vec::new();
    for path in paths {
        let text = std::fs::read_to_string(&path).expect("a readable file");
        let facts: Value = serde_json::from_str(&text).expect("JSON");
        let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
        match Map::from_json(&text, Options::default()) {
            Ok(map) => {
                assert_eq!(facts["valid"], true, "{name}");
                found.push((name, facts, map));
            }
            Err(error) => assert_eq!(facts["valid"], false, "{name}: {error}"),
        }
    }
    found
}

fn as_number(v: &Value) -> Option<f64> {
    v.as_f64().or_else(|| v.as_str()?.parse().ok())
}

#[test]
fn base_points_of_the_zoo() {
    let go = || false;
    for (name, facts, map) in zoo() {
        let start = Instant::now();
        let found = base_points(&map, &go).expect("nobody stops");
        let seconds = start.elapsed().as_secs_f64();
        let total = base_multiplicity(&map, &go).expect("nobody stops");
        println!("{name}: {} real base points, {seconds:.4} s; e = {total}, {:.4} s", found.len(), start.elapsed().as_secs_f64() - seconds);
        if let Some(e) = as_number(&facts["base_multiplicity_total"]) {
            assert_eq!(total as f64, e, "{name}: total multiplicity");
        }
        let mut left: Vec<_> = found.iter().collect();
        for class in facts["base_points"].as_array().into_iter().flatten() {
            for real in class["real_points"].as_array().into_iter().flatten() {
                let at: Vec<f64> = real.as_array().expect("two numbers").iter().filter_map(as_number).collect();
                let same = |b: &&isoform_tess::BasePoint| {
                    let p = b.to_f64();
                    let ([u, v], _) = b.chart.variables();
                    b.chart.name() == class["chart"]
                        && (p[u] - at[0]).abs() <= 1e-15 * at[0].abs()
                        && (p[v] - at[1]).abs() <= 1e-15 * at[1].abs()
                };
                let i = left.iter().position(same).unwrap_or_else(|| panic!("{name}: no base point at {at:?}"));
                let b = left.swap_remove(i);
                assert_eq!(b.multiplicity() as u64, class["q"].as_u64().expect("q"), "{name}: multiplicity at {at:?}");
                assert_eq!(b.seam.common.degree() > 0, class["needs_blowup"] == true, "{name}: common direction at {at:?}");
            }
        }
        assert!(left.is_empty(), "{name}: base points that are none: {left:?}");
    }
}
