//! The facts of the collection of rational surfaces in tests/data/zoo.

use crate::common::zoo;
use isoform_algebra::Poly;
use isoform_control::Control;
use isoform_tess::{
    Budget, CurveKind, RealPart, VARIABLES, analyse, base_multiplicity, base_points,
};
use serde_json::Value;
use std::time::Instant;

fn as_number(v: &Value) -> Option<f64> {
    v.as_f64().or_else(|| v.as_str()?.parse().ok())
}

#[test]
fn base_points_of_the_zoo() {
    for (name, facts, map) in zoo() {
        let start = Instant::now();
        let found = base_points(&map, &Control::default()).expect("nobody stops");
        let seconds = start.elapsed().as_secs_f64();
        let total = base_multiplicity(&map, &Control::default()).expect("nobody stops");
        println!(
            "{name}: {} real base points, {seconds:.4} s; e = {total}, {:.4} s",
            found.len(),
            start.elapsed().as_secs_f64() - seconds
        );
        if let Some(e) = as_number(&facts["base_multiplicity_total"]) {
            assert_eq!(total as f64, e, "{name}: total multiplicity");
        }
        let mut left: Vec<_> = found.iter().collect();
        for class in facts["base_points"].as_array().into_iter().flatten() {
            for real in class["real_points"].as_array().into_iter().flatten() {
                let at: Vec<f64> = real
                    .as_array()
                    .expect("two numbers")
                    .iter()
                    .filter_map(as_number)
                    .collect();
                let same = |b: &&isoform_tess::BasePoint| {
                    let p = b.to_f64();
                    let ([u, v], _) = b.chart.variables();
                    b.chart.name() == class["chart"]
                        && (p[u] - at[0]).abs() <= 1e-15 * at[0].abs()
                        && (p[v] - at[1]).abs() <= 1e-15 * at[1].abs()
                };
                let i = left
                    .iter()
                    .position(same)
                    .unwrap_or_else(|| panic!("{name}: no base point at {at:?}"));
                let b = left.swap_remove(i);
                assert_eq!(
                    b.multiplicity() as u64,
                    class["q"].as_u64().expect("q"),
                    "{name}: multiplicity at {at:?}"
                );
                assert_eq!(
                    b.seam.common.degree() > 0,
                    class["needs_blowup"] == true,
                    "{name}: common direction at {at:?}"
                );
            }
        }
        assert!(
            left.is_empty(),
            "{name}: base points that are none: {left:?}"
        );
    }
}

/// A complex number as Python writes it.
fn complex(v: &Value) -> [f64; 2] {
    let text = v.as_str().expect("a number").trim_matches(['(', ')']);
    let Some(text) = text.strip_suffix('j') else {
        return [text.parse().expect("a number"), 0.0];
    };
    // The sign before the imaginary part: neither the first character nor that of an exponent.
    let inner =
        |&(i, c): &(usize, char)| i > 0 && (c == '+' || c == '-') && !text[..i].ends_with('e');
    let cut = text.char_indices().rfind(inner).map_or(0, |(i, _)| i);
    [
        text[..cut].parse().unwrap_or(0.0),
        text[cut..].parse().expect("a number"),
    ]
}

fn curve(v: &Value) -> Poly {
    Poly::parse(v.as_str().expect("a text"), &VARIABLES)
        .expect("a form")
        .primitive()
}

#[test]
fn singular_curves_of_the_zoo() {
    for (name, facts, map) in zoo() {
        let found = analyse(&map, &Budget::default(), &Control::default());
        let seconds: Vec<String> = found
            .seconds
            .iter()
            .map(|(phase, s)| format!("{phase} {s:.4}"))
            .collect();
        println!("{name}: {}; {:?}", seconds.join(", "), found.findings);
        let degrees = found.degrees.expect("counted");
        assert_eq!(
            Some(degrees.map_degree as u64),
            facts["map_degree"].as_u64(),
            "{name}"
        );
        if let Some(d) = facts["implicit_degree"].as_u64() {
            assert_eq!(degrees.implicit_degree as u64, d, "{name}");
            assert!(
                found.findings.is_empty() || d > 16,
                "{name}: {:?}",
                found.findings
            );
        }
        let mut pole: Vec<(Poly, u64)> = found
            .pole
            .expect("factored")
            .into_iter()
            .map(|(f, n)| (f, n as u64))
            .collect();
        for factor in facts["W_factors"].as_array().into_iter().flatten() {
            let i = pole
                .iter()
                .position(|(f, n)| *f == curve(&factor[0]) && *n == factor[1])
                .unwrap_or_else(|| panic!("{name}: {factor}"));
            pole.swap_remove(i);
        }
        assert!(pole.is_empty(), "{name}: {pole:?}");

        let curves = found.singular.expect("nobody stops").curves;
        if let Some(factors) = facts["singular_pullback"].as_array() {
            let listed = curves
                .iter()
                .filter(|c| c.in_double.expect("D is known") > 0);
            assert_eq!(listed.count(), factors.len(), "{name}: {curves:?}");
            for factor in factors {
                let same = |c: &&isoform_tess::SingularCurve| {
                    c.curve == curve(&factor[0])
                        && c.in_double.map(|n| n as u64) == factor[1].as_u64()
                };
                assert!(curves.iter().any(|c| same(&c)), "{name}: {factor} in D");
            }
        }
        let critical: Vec<_> = curves.iter().filter(|c| c.in_minors > 0).collect();
        let listed = |key: &str| facts[key].as_array().expect("a list").clone();
        assert_eq!(
            critical.len(),
            listed("contracted_curves").len() + listed("ramified_curves").len(),
            "{name}"
        );
        for key in ["contracted_curves", "ramified_curves"] {
            for fact in &listed(key) {
                let form = curve(&fact["curve"]);
                let c = critical
                    .iter()
                    .find(|c| c.curve == form)
                    .unwrap_or_else(|| panic!("{name}: {fact}"));
                assert_eq!(
                    Some(c.in_minors as u64),
                    fact["mult"].as_u64(),
                    "{name}: {fact}"
                );
                assert_eq!(
                    matches!(c.real, RealPart::Curve),
                    fact["real_1dim"] == true,
                    "{name}: {fact}"
                );
                let CurveKind::Contracted(image) = &c.kind else {
                    assert_eq!(key, "ramified_curves", "{name}: {fact}");
                    continue;
                };
                if key == "ramified_curves" {
                    // Curves without real points were listed as ramified unseen; some are
                    // contracted to complex points.
                    assert!(
                        fact["real_1dim"] == false && image.points().is_empty(),
                        "{name}: {fact}"
                    );
                    println!("{name}: {} is contracted to complex points", fact["curve"]);
                } else {
                    let z: Vec<[f64; 2]> = fact["image"]
                        .as_array()
                        .expect("four numbers")
                        .iter()
                        .map(complex)
                        .collect();
                    let is_real = z
                        .iter()
                        .all(|a| z.iter().all(|b| (a[0] * b[1] - a[1] * b[0]).abs() < 1e-9));
                    let close = |p: &[isoform_tess::Algebraic; 4]| {
                        let p = p.each_ref().map(|x| x.to_f64());
                        (0..4).all(|i| {
                            (0..4).all(|j| {
                                (0..2).all(|k| (p[i] * z[j][k] - p[j] * z[i][k]).abs() < 1e-9)
                            })
                        })
                    };
                    assert_eq!(
                        image.points().iter().any(close),
                        is_real,
                        "{name}: {fact}, found {:?}",
                        image.points()
                    );
                }
            }
        }
    }
}
