//! The collection of rational surfaces in tests/data/zoo, and measures of triangulated ones.

use isoform_geom::{cross, norm, sub};
use isoform_io::read_map;
use isoform_tess::{Map, MapOptions, Surface};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// The unit sphere.
pub(crate) const SPHERE: [&str; 4] = ["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"];

/// Name, facts and map of every valid surface.
pub(crate) fn zoo() -> Vec<(String, Value, Map)> {
    let mut found = Vec::new();
    for path in isoform_testdata::files("zoo", "json") {
        let text = std::fs::read_to_string(&path).expect("a readable file");
        let facts: Value = serde_json::from_str(&text).expect("JSON");
        let name = isoform_testdata::stem(&path);
        match read_map(&text).map(|file| Map::new(file.polynomials, MapOptions::default())) {
            Ok(Ok(map)) => {
                assert_eq!(facts["valid"], true, "{name}");
                found.push((name, facts, map));
            }
            Ok(Err(error)) => assert_eq!(facts["valid"], false, "{name}: {error}"),
            Err(error) => assert_eq!(facts["valid"], false, "{name}: {error}"),
        }
    }
    assert_eq!(found.len(), 34, "the valid surfaces of the zoo");
    found
}

/// Sum of the areas of all triangles.
pub(crate) fn area(s: &Surface) -> f64 {
    let one = |t: &[u32; 3]| {
        let [p, q, r] = t.map(|v| s.points[v as usize]);
        0.5 * norm(cross(sub(q, p), sub(r, p)))
    };
    s.triangles.iter().map(one).sum()
}

/// Number of triangles at each edge.
pub(crate) fn edges(s: &Surface) -> BTreeMap<[u32; 2], usize> {
    let mut edges = BTreeMap::new();
    for t in &s.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    edges
}

/// Euler characteristic, components, boundary loops.
pub(crate) fn topology(s: &Surface) -> [i64; 3] {
    let edges = edges(s);
    let groups = |pairs: &mut dyn Iterator<Item = [u32; 2]>| {
        let mut of: BTreeMap<u32, u32> = BTreeMap::new();
        fn root(of: &mut BTreeMap<u32, u32>, v: u32) -> u32 {
            let up = *of.entry(v).or_insert(v);
            if up == v {
                return v;
            }
            let r = root(of, up);
            of.insert(v, r);
            r
        }
        for [a, b] in pairs {
            let (a, b) = (root(&mut of, a), root(&mut of, b));
            of.insert(a, b);
        }
        of.iter().filter(|(v, up)| v == up).count() as i64
    };
    let used: BTreeSet<u32> = s.triangles.iter().flatten().copied().collect();
    let euler = used.len() as i64 - edges.len() as i64 + s.triangles.len() as i64;
    [
        euler,
        groups(&mut edges.keys().copied()),
        groups(&mut edges.iter().filter(|e| *e.1 == 1).map(|e| *e.0)),
    ]
}
