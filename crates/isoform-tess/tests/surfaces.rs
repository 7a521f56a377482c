//! Surfaces without base points in the box, triangulated: topology and accuracy.
mod common;

use common::zoo;
use isoform_algebra::RBig;
use isoform_tess::{Budget, Kind, Map, MeshOptions, Mode, Surface, TriangulateOptions, triangulate};
use std::collections::BTreeMap;

fn options(half_width: f64) -> MeshOptions {
    MeshOptions { tolerance: 1e-2 * half_width, longest: 0.5 * half_width, triangles: 400_000 }
}

fn surface(map: &Map, half_width: i64) -> Surface {
    let options = TriangulateOptions {
        half_width: RBig::from(half_width),
        mode: Mode::Normalised,
        mesh: options(half_width as f64),
        budget: Budget::default(),
    };
    triangulate(map, &options, &|| false).expect("not stopped").0
}

/// Euler characteristic, components, boundary loops; every edge has one or two triangles.
fn topology(s: &Surface) -> [i64; 3] {
    let mut edges: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for t in &s.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    let crowded: Vec<_> = edges.iter().filter(|e| *e.1 > 2).collect();
    if !crowded.is_empty() {
        let at = |v: u32| s.points[v as usize];
        println!("{} edges with more than two triangles, the first {:?} {:?}", crowded.len(), crowded[0], crowded[0].0.map(at));
        return [i64::MAX; 3];
    }
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
    let used: std::collections::BTreeSet<u32> = s.triangles.iter().flatten().copied().collect();
    let euler = used.len() as i64 - edges.len() as i64 + s.triangles.len() as i64;
    [euler, groups(&mut edges.keys().copied()), groups(&mut edges.iter().filter(|e| *e.1 == 1).map(|e| *e.0))]
}

#[test]
fn sphere() {
    let map = Map::parse(["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"], Default::default()).expect("a map");
    let s = surface(&map, 2);
    assert!(s.unproven.is_empty(), "{:?}", s.unproven);
    assert_eq!(topology(&s), [2, 1, 0]);
    assert_eq!(s.kinds.iter().filter(|k| **k == Kind::Contracted).count(), 1, "the pole opposite to the origin");
    for p in &s.points {
        assert!((p.iter().map(|x| x * x).sum::<f64>().sqrt() - 1.0).abs() < 1e-14);
    }
    // Area and volume converge to those of the sphere.
    let area: f64 = s
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| s.points[i as usize]);
            let (u, v): (Vec<f64>, Vec<f64>) = (0..3).map(|i| (b[i] - a[i], c[i] - a[i])).unzip();
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            0.5 * n.iter().map(|x| x * x).sum::<f64>().sqrt()
        })
        .sum();
    assert!((area / (4.0 * std::f64::consts::PI) - 1.0).abs() < 3e-2, "{area}");
}

/// Members of the zoo whose topology in the box is known, without real base points in it.
#[test]
fn surfaces_of_the_zoo() {
    let surfaces = zoo();
    if surfaces.is_empty() {
        return;
    }
    let mut wrong = Vec::new();
    let mut compared = 0;
    for (name, known, map) in surfaces {
        let counted = &known["box_topology_normalised"];
        let Some(true) = counted["stable"].as_bool() else { continue };
        let half_width = known["box"].as_i64().expect("a number");
        let clock = std::time::Instant::now();
        let s = surface(&map, half_width);
        let expected = ["chi_corrected", "components", "boundary_loops"].map(|k| counted[k].as_i64().expect("a number"));
        let t = topology(&s);
        println!("{} {t:?} {} triangles {:?} {:?}", name, s.triangles.len(), s.unproven, clock.elapsed());
        compared += 1;
        if t != expected || !s.unproven.is_empty() {
            wrong.push(format!("{}: {t:?} instead of {expected:?}", name));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(compared >= 11, "{compared} surfaces");
}
