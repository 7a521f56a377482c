//! Pinch points and solitary curves: against facts about a collection of surfaces, and against what
//! is known by hand.
use crate::common::zoo;
use isoform_algebra::{Poly, RBig};
use isoform_control::Control;
use isoform_tess::{
    Analysis, Budget, Finding, Map, Phase, Stopped, analyse, pinch_points, solitary_arcs,
};
use serde_json::Value;
use std::time::Instant;

type Arcs = Vec<Vec<[f64; 3]>>;

fn analysed(map: &Map) -> Analysis {
    analyse(map, &Budget::default(), &Control::default())
}

fn arcs(map: &Map, half_width: f64, tolerance: f64) -> (Arcs, Vec<Finding>) {
    solitary_arcs(
        map,
        &analysed(map).singular.expect("not stopped"),
        half_width,
        tolerance,
        &Control::default(),
    )
}

fn parse(texts: [&str; 4]) -> Map {
    Map::parse(texts, Default::default()).expect("a map")
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn to_segment(p: &[f64; 3], a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let (d, e) = (
        [0, 1, 2].map(|i| b[i] - a[i]),
        [0, 1, 2].map(|i| p[i] - a[i]),
    );
    let d2 = length(d).powi(2);
    let t = if d2 > 0.0 {
        ((0..3).map(|i| d[i] * e[i]).sum::<f64>() / d2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    length([0, 1, 2].map(|i| e[i] - t * d[i]))
}

fn to_arcs(p: &[f64; 3], arcs: &Arcs) -> f64 {
    arcs.iter()
        .flat_map(|arc| arc.windows(2))
        .map(|w| to_segment(p, &w[0], &w[1]))
        .fold(f64::INFINITY, f64::min)
}

/// The real points of random plane sections of the double curve, of one type.
fn samples(facts: &Value, of: &[&str]) -> Vec<[f64; 3]> {
    let examples = facts["double_curve_samples"]["examples"]
        .as_array()
        .into_iter()
        .flatten();
    let examples = examples.filter(|e| of.iter().any(|t| e["type"] == *t));
    // Coordinates of points at infinity are null.
    let points = examples.filter_map(|e| {
        e["image"]
            .as_array()
            .expect("a list")
            .iter()
            .map(Value::as_f64)
            .collect::<Option<Vec<_>>>()
    });
    points.map(|x| [x[0], x[1], x[2]]).collect()
}

/// The value of a polynomial and the sum of the absolute values of its terms.
fn value(f: &Poly, x: [f64; 3]) -> (f64, f64) {
    let x = [x[0], x[1], x[2], 1.0];
    let terms = f.to_f64();
    let terms = terms
        .iter()
        .map(|(e, c)| (0..4).fold(*c, |term, i| term * x[i].powi(i32::from(e[i]))));
    terms.fold((0.0, 0.0), |(sum, size), term| {
        (sum + term, size + term.abs())
    })
}

/// Vertices are singular points of the surface and lie in the box.
fn check_vertices(name: &str, equation: &Poly, arcs: &Arcs, half_width: f64) {
    let derivatives = [0, 1, 2, 3].map(|i| equation.derivative(i));
    for x in arcs.iter().flatten() {
        assert!(
            x.iter().all(|v| v.abs() <= half_width * (1.0 + 1e-12)),
            "{name}: {x:?} outside of the box"
        );
        // Close to the origin all terms are small: compare with those at the distance of a
        // hundredth of the box, too.
        let reach = x.map(|v| v.abs().max(1e-2 * half_width));
        for f in [equation].into_iter().chain(&derivatives) {
            let ((v, _), (_, size)) = (value(f, *x), value(f, reach));
            assert!(v.abs() <= 1e-9 * size, "{name}: {v:e} of {size:e} at {x:?}");
        }
    }
}

#[test]
fn solitary_curves_of_the_zoo() {
    let mut compared = 0;
    for (name, facts, map) in zoo() {
        let found = analysed(&map);
        let (Some(implicit), Some(singular)) = (&found.implicit, &found.singular) else {
            continue;
        };
        let b = facts["box"].as_f64().expect("a number");
        let solitary = samples(&facts, &["conjugate_pair_only"]);
        let far = solitary
            .iter()
            .flatten()
            .fold(0.0, |m: f64, x| m.max(x.abs()));
        // Some samples lie outside of the box of the collection.
        for half_width in [b, 1.05 * far] {
            if half_width < b {
                continue;
            }
            let clock = Instant::now();
            let (arcs, problems) = solitary_arcs(
                &map,
                singular,
                half_width,
                1e-3 * half_width,
                &Control::default(),
            );
            let points: usize = arcs.iter().map(Vec::len).sum();
            println!(
                "{name} in {half_width}: {} arcs, {points} points, {:?}",
                arcs.len(),
                clock.elapsed()
            );
            assert!(problems.is_empty(), "{name}: {problems:?}");
            check_vertices(&name, &implicit.equation, &arcs, half_width);
            for x in solitary
                .iter()
                .filter(|x| x.iter().all(|v| v.abs() < 0.98 * half_width))
            {
                let distance = to_arcs(x, &arcs);
                assert!(
                    distance < 1e-3 * half_width,
                    "{name}: {x:?} is {distance} from the arcs in {half_width}"
                );
                compared += 1;
            }
            let ends: Vec<_> = arcs.iter().flat_map(|a| [a[0], a[a.len() - 1]]).collect();
            for x in samples(&facts, &["real_preimages_2plus", "mixed"]) {
                let at_end = ends
                    .iter()
                    .any(|e| length([0, 1, 2].map(|i| e[i] - x[i])) < 1e-2 * half_width);
                assert!(
                    at_end || to_arcs(&x, &arcs) > 1e-3 * half_width,
                    "{name}: {x:?} has real parameters"
                );
            }
        }
        assert_eq!(
            solitary_arcs(&map, singular, b, 1e-2 * b, &Control::default()),
            solitary_arcs(&map, singular, b, 1e-2 * b, &Control::default()),
            "{name}"
        );
    }
    assert_eq!(compared, 35, "points compared");
}

/// Ends of straight arcs, ordered.
fn ends(arcs: &Arcs) -> Vec<[f64; 6]> {
    let mut found: Vec<_> = arcs
        .iter()
        .map(|arc| {
            let (a, b) = (arc[0], arc[arc.len() - 1]);
            for x in arc {
                assert!(
                    to_segment(x, &a, &b) < 1e-12,
                    "{x:?} off the line from {a:?} to {b:?}"
                );
            }
            let (a, b) = if length(a) < length(b) {
                (a, b)
            } else {
                (b, a)
            };
            [a[0], a[1], a[2], b[0], b[1], b[2]]
        })
        .collect();
    found.sort_by(|a, b| {
        a.map(|x| (x * 1e6).round())
            .partial_cmp(&b.map(|x| (x * 1e6).round()))
            .expect("finite numbers")
    });
    found
}

fn assert_ends(arcs: &(Arcs, Vec<Finding>), expected: &[[f64; 6]]) {
    assert!(arcs.1.is_empty(), "{:?}", arcs.1);
    let found = ends(&arcs.0);
    let same = found.len() == expected.len()
        && found
            .iter()
            .zip(expected)
            .all(|(a, b)| (0..6).all(|i| (a[i] - b[i]).abs() < 1e-11));
    assert!(same, "{found:?} instead of {expected:?}");
}

#[test]
fn half_axes() {
    let steiner = parse(["t", "s", "s*t", "s^2 + t^2 + 1"]);
    let expected = [
        [-0.5, 0.0, 0.0, -1.0, 0.0, 0.0],
        [0.0, -0.5, 0.0, 0.0, -1.0, 0.0],
        [0.0, 0.0, -0.5, 0.0, 0.0, -1.0],
        [0.0, 0.0, 0.5, 0.0, 0.0, 1.0],
        [0.0, 0.5, 0.0, 0.0, 1.0, 0.0],
        [0.5, 0.0, 0.0, 1.0, 0.0, 0.0],
    ];
    assert_ends(&arcs(&steiner, 1.0, 1e-2), &expected);
    // The umbrella's handle: t = ±√z on the line s = 0.
    let umbrella = parse(["s*t", "s", "t^2", "1"]);
    assert_ends(
        &arcs(&umbrella, 2.0, 1e-2),
        &[[0.0, 0.0, 0.0, 0.0, 0.0, -2.0]],
    );
    // Beyond the real directions of a base point: z = 2ab/(a² + b²).
    let conoid = parse(["s^3 + s*t^2", "s^2*t + t^3", "2*s*t", "s^2 + t^2"]);
    assert_ends(
        &arcs(&conoid, 2.0, 1e-2),
        &[
            [0.0, 0.0, -1.0, 0.0, 0.0, -2.0],
            [0.0, 0.0, 1.0, 0.0, 0.0, 2.0],
        ],
    );
    // A short one in a corner of the box, between the planes.
    let low = parse(["s*t + 9/10", "s + 9/10", "t^2 - 39/40", "1"]);
    assert_ends(
        &arcs(&low, 1.0, 1e-2),
        &[[0.9, 0.9, -0.975, 0.9, 0.9, -1.0]],
    );
}

/// Several pairs with one image, and real parameters on a part of it only: the line s = 0, with z =
/// q(t).
#[test]
fn real_parameters_on_a_part() {
    // For z < −1/4 two pairs, then real ones; for z > 0 a pair and real ones.
    let even = parse(["s", "s*t", "t^4 - t^2", "1"]);
    assert_ends(
        &arcs(&even, 1.0, 1e-2),
        &[[0.0, 0.0, -0.25, 0.0, 0.0, -1.0]],
    );
    // Below the lower one of the minima, at the roots of 5t² + t − 1, parameters are not real.
    let skew = parse(["s", "s*t", "t^4 + 4/15*t^3 - 2/5*t^2", "1"]);
    let q = |t: f64| t.powi(4) + 4.0 / 15.0 * t.powi(3) - 0.4 * t * t;
    let t = (-1.0 - 21f64.sqrt()) / 10.0;
    let lowest = q(t).min(q((-1.0 + 21f64.sqrt()) / 10.0));
    let (found, problems) = arcs(&skew, 1.0, 1e-2);
    assert!(
        problems.is_empty() && found.len() == 1,
        "{found:?} {problems:?}"
    );
    let e = ends(&found)[0];
    assert!(
        (e[2] - lowest).abs() < 1e-6 && (e[5] + 1.0).abs() < 1e-12,
        "{e:?} instead of {lowest}"
    );
}

#[test]
fn pinch_points_exact() {
    let rational = |map: &Map| {
        let points = pinch_points(map, &Control::default()).expect("not stopped");
        points
            .iter()
            .map(|p| {
                p.each_ref()
                    .map(|x| x.as_rational().expect("a rational number"))
            })
            .collect::<Vec<_>>()
    };
    let expect = |map: &Map, expected: &[[i32; 3]]| {
        let mut expected: Vec<_> = expected.iter().map(|p| p.map(RBig::from)).collect();
        let mut found = rational(map);
        found.sort();
        expected.sort();
        assert_eq!(found, expected);
    };
    expect(
        &parse(["t", "2*s*t", "s^2 - t^2", "s^2 + t^2 + 1"]),
        &[[0, 0, 1], [1, 0, 0]],
    );
    let six = [
        [0, 1, 1],
        [0, -1, 1],
        [1, 0, 1],
        [-1, 0, 1],
        [1, 1, 0],
        [-1, 1, 0],
    ];
    expect(&parse(["t", "s", "s*t", "s^2 + t^2 + 1"]), &six);
    expect(&parse(["s*t", "s", "t^2", "1"]), &[[0, 0, 1], [0, 1, 0]]);
    // Smooth, with a contracted line; and four nodes, base points at all corners.
    expect(
        &parse(["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"]),
        &[],
    );
    expect(
        &parse([
            "-s*t - t^2 - t",
            "-s^2 - s*t - s",
            "-s^2*t - s*t^2 - s*t",
            "s*t",
        ]),
        &[],
    );
    // Irrational ones: (s² − 2)t instead of st has a pinch point for each root.
    let two = parse(["s", "t^2", "t*(s^2 - 2)", "1"]);
    let found = pinch_points(&two, &Control::default()).expect("not stopped");
    let finite: Vec<_> = found
        .iter()
        .filter(|p| !p[2].is_zero())
        .map(|p| (p[0].to_f64(), p[1].to_f64()))
        .collect();
    assert_eq!(finite, [(-(2f64.sqrt()), 0.0), (2f64.sqrt(), 0.0)]);
}

/// The map in other coordinates of its parameter plane.
fn moved(map: &Map, rows: [[i64; 3]; 3]) -> Map {
    let linear = rows.map(|r| {
        (0..3).fold(Poly::zero(), |sum, v| {
            sum + Poly::var(v).scale(&RBig::from(r[v]))
        })
    });
    Map::new(
        map.forms()
            .each_ref()
            .map(|f| f.compose(&linear).dehomogenise(2)),
        Default::default(),
    )
    .expect("a map")
}

#[test]
fn projectivities_of_the_parameters() {
    let names = [
        "bohemian_dome",
        "cross_cap",
        "pole_nonreduced",
        "pole_on_axes",
        "pluecker_conoid",
        "base_mult2",
        "pole_4ovals",
    ];
    let named: Vec<_> = zoo()
        .into_iter()
        .filter(|z| names.contains(&&*z.0))
        .collect();
    assert_eq!(named.len(), names.len());
    for (name, facts, map) in named {
        let b = facts["box"].as_f64().expect("a number");
        let (first, _) = arcs(&map, b, 1e-3 * b);
        assert!(!first.is_empty(), "{name}");
        for rows in [
            [[2, -1, 3], [1, 4, -2], [-3, 1, 5]],
            [[-1, 3, 1], [5, 2, -1], [2, 1, 4]],
        ] {
            let (second, problems) = arcs(&moved(&map, rows), b, 1e-3 * b);
            assert!(problems.is_empty(), "{name}: {problems:?}");
            for (these, those) in [(&first, &second), (&second, &first)] {
                for x in these.iter().flatten() {
                    let distance = to_arcs(x, those);
                    assert!(
                        distance < 1e-3 * b,
                        "{name}: {x:?} is {distance} from the other arcs"
                    );
                }
            }
        }
    }
}

/// Two arcs cross in a point of a surface without its plane at infinity; the curve is closed.
#[test]
fn closed_curve() {
    let map = parse([
        "s",
        "t",
        "s*t + 1",
        "4*s^4 + 17*s^2*t^2 - 20*s^2 + 4*t^4 - 20*t^2 + 33/2",
    ]);
    let (found, problems) = arcs(&map, 3.0, 1e-2);
    assert!(problems.is_empty(), "{problems:?}");
    assert!(
        found.iter().any(|arc| arc[0] == arc[arc.len() - 1]),
        "{found:?}"
    );
}

#[test]
fn what_cannot_be_done() {
    let map = parse(["s*t", "s", "t^2", "1"]);
    let singular = analysed(&map).singular.expect("not stopped");
    let (found, problems) = solitary_arcs(
        &map,
        &singular,
        2.0,
        1e-2,
        &Control::default().until(Instant::now()),
    );
    assert!(
        found.is_empty() && problems == [Finding::Stopped(Phase::SolitaryArcs)],
        "{problems:?}"
    );
    assert_eq!(
        pinch_points(&map, &Control::default().until(Instant::now())).err(),
        Some(Stopped)
    );
    let without = isoform_tess::Singular {
        double: None,
        ..singular
    };
    assert_eq!(
        solitary_arcs(&map, &without, 2.0, 1e-2, &Control::default()).1,
        [Finding::DoubleLocusUnknown]
    );
}

/// Random maps of degree 2 and 3: all points found are singular, and equal to those found in other
/// coordinates of the parameter plane.
#[test]
fn random_maps() {
    let mut rng = fastrand::Rng::with_seed(5);
    let (mut compared, mut found_arcs) = (0, 0);
    for trial in 0..60 {
        let degree = if trial < 20 { 2 } else { 3 };
        let polynomials = [(); 4].map(|()| {
            let exponents = (0..=degree).flat_map(|i| (0..=degree - i).map(move |j| [i, j, 0, 0]));
            // Dense cubic surfaces are slow to analyse.
            let kept: Vec<_> = exponents
                .filter(|_| degree == 2 || rng.u8(0..3) == 0)
                .collect();
            Poly::from_terms(kept.into_iter().map(|e| (e, RBig::from(rng.i64(-4..5)))))
        });
        let Ok(map) = Map::new(polynomials, Default::default()) else {
            continue;
        };
        let found = analyse(
            &map,
            &Budget {
                implicit_degree: 7,
                ..Budget::default()
            },
            &Control::default(),
        );
        let (Some(implicit), Some(singular)) = (found.implicit, found.singular) else {
            continue;
        };
        if implicit.degrees.map_degree > 1 {
            continue;
        }
        let (first, problems) = solitary_arcs(&map, &singular, 3.0, 3e-3, &Control::default());
        assert!(problems.is_empty(), "{trial}: {problems:?}");
        check_vertices(&format!("map {trial}"), &implicit.equation, &first, 3.0);
        let (second, problems) = arcs(
            &moved(&map, [[2, -1, 3], [1, 4, -2], [-3, 1, 5]]),
            3.0,
            3e-3,
        );
        assert!(problems.is_empty(), "{trial}: {problems:?}");
        assert_eq!(first.len(), second.len(), "{trial}");
        for (these, those) in [(&first, &second), (&second, &first)] {
            for x in these.iter().flatten() {
                assert!(
                    to_arcs(x, those) < 3e-3,
                    "{trial}: {x:?} is {} from the other arcs",
                    to_arcs(x, those)
                );
            }
        }
        compared += 1;
        found_arcs += first.len();
    }
    println!("{compared} maps, {found_arcs} arcs");
    assert!(
        compared >= 20 && found_arcs >= 30,
        "{compared} maps, {found_arcs} arcs"
    );
}
