//! `isoform implicitize`, and the verbs that take its result.

use crate::common::*;

/// Points of the unit sphere about (3, 0, 0), without normals.
fn sphere() -> String {
    let point = |i: u32| {
        let (t, z) = (f64::from(i) * 2.4, (f64::from(i) + 0.5) / 750.0 - 1.0);
        let r = (1.0 - z * z).sqrt();
        format!("{} {} {}\n", 3.0 + r * t.cos(), r * t.sin(), z)
    };
    (0..1500).map(point).collect()
}

#[test]
fn a_scan_becomes_a_model_for_the_other_verbs() {
    let f = Folder::new("implicitize");
    let scan = f.file("scan.xyz", sphere());
    let model = f.file("surface.json", "");
    let o = isoform(&["implicitize", &scan, "-o", &model, "--json", "--force"]);
    let report = document(&o);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    assert_eq!(report["normals"]["source"], "estimated");
    assert_eq!(
        (&report["components"], &report["ok"]),
        (&1.into(), &true.into())
    );

    let points = f.file("p.csv", "3,0,0.9\n3,0,1.1\n");
    let o = isoform(&["eval", &model, "--points", &points, "--reading", "metric"]);
    let table = stdout(&o);
    let values: Vec<f64> = table
        .lines()
        .skip(1)
        .map(|l| l.rsplit(',').next().expect("f").parse().expect("a number"))
        .collect();
    // To first order in the distance, which is 0.1.
    assert!(
        (values[0] - 0.1).abs() < 0.02 && (values[1] + 0.1).abs() < 0.02,
        "{values:?}"
    );

    let o = isoform(&["mesh", &model, "--surface-only", "--size", "0.2", "--json"]);
    let mesh = document(&o);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let volume = mesh["certificate"]["volume"].as_f64().expect("a volume");
    assert!((volume / 4.18879 - 1.0).abs() < 0.02, "{volume}");

    let o = isoform(&["compare", &scan, &model, "--json"]);
    let far = document(&o)["first_to_second"]["max"]
        .as_f64()
        .expect("a distance");
    assert!(far < 2e-3, "{far}");

    let options = [
        "--degree",
        "2,2",
        "--tol",
        "1e-2",
        "--seed-point",
        "3,0,1",
        "--json",
    ];
    let o = isoform(&[&["parameterize", &model, "--box", "5"][..], &options].concat());
    assert!(document(&o)["patches"][0].is_object(), "{}", stdout(&o));
    assert_eq!(code(&o), 0, "the distance is proved: {}", stderr(&o));
}

#[test]
fn one_polynomial_is_a_model_for_the_other_verbs() {
    let f = Folder::new("implicitize-global");
    let scan = f.file("scan.xyz", sphere());
    let model = f.file("ball.json", "");
    let options = ["--global", "2", "-o", &model, "--json", "--force"];
    let o = isoform(&[&["implicitize", &scan][..], &options].concat());
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let report = document(&o);
    assert_eq!(
        (&report["unknowns"], &report["cells"]),
        (&10.into(), &1.into())
    );
    assert!(report["max"].as_f64().expect("a distance") < 1e-9);

    let points = f.file("p.csv", "3,0,0.9\n3,0,1\n1e3,0,0\n");
    let o = isoform(&["eval", &model, "--points", &points]);
    let values: Vec<f64> = stdout(&o)
        .lines()
        .skip(1)
        .map(|l| l.rsplit(',').next().expect("f").parse().expect("a number"))
        .collect();
    // (1 − r²)/2 everywhere; its steepness is that along estimated normals.
    let want = [0.095, 0.0, (1.0 - 997.0 * 997.0) / 2.0];
    for (value, want) in values.iter().zip(want) {
        let off = (value - want).abs();
        assert!(off < 1e-9 + 1e-3 * f64::abs(want), "{values:?}");
    }

    let o = isoform(&["mesh", &model, "--surface-only", "--size", "0.2", "--json"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let volume = document(&o)["certificate"]["volume"].as_f64();
    assert!((volume.expect("a volume") / 4.18879 - 1.0).abs() < 0.02);

    let o = isoform(&["compare", &scan, &model, "--json"]);
    let far = document(&o)["first_to_second"]["max"].as_f64();
    assert!(far.expect("a distance") < 1e-9);

    let tolerance = [
        "--tol",
        "1e-2",
        "--seed-point",
        "3,0,1",
        "--box",
        "5",
        "--json",
    ];
    let o = isoform(&[&["parameterize", &model][..], &tolerance].concat());
    assert_eq!(code(&o), 0, "{}", stderr(&o));

    let o = isoform(&["implicitize", &scan, "--global", "13"]);
    assert!(code(&o) == 1 && stderr(&o).contains("13 is not in 1..=12"));
    let wrong = r#"{"kind": "implicit_polynomial", "degree": 2, "origin": [0, 0, 0], "unit": 1,
        "coefficients": [1], "corner": [0, 0, 0], "spacing": 1, "count": [1, 1, 1], "cells": []}"#;
    let o = isoform(&["mesh", &f.file("bad.json", wrong)]);
    assert!(code(&o) == 2 && stderr(&o).contains("1 coefficients for 10 monomials"));
}

#[test]
fn an_open_scan_gives_an_open_surface() {
    let f = Folder::new("implicitize-open");
    let upper: String = sphere()
        .lines()
        .filter(|l| !l.rsplit(' ').next().expect("z").starts_with('-'))
        .map(|l| format!("{l}\n"))
        .collect();
    let scan = f.file("scan.xyz", &upper);
    let model = f.file("surface.json", "");
    let o = isoform(&[
        "implicitize",
        &scan,
        "--cells",
        "150",
        "-o",
        &model,
        "--force",
    ]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let out = f.file("open.obj", "");
    let o = isoform(&[
        "mesh",
        &model,
        "--surface-only",
        "--size",
        "0.1",
        "-o",
        &out,
    ]);
    assert!(
        stderr(&o).contains("the surface has a border there"),
        "{}",
        stderr(&o)
    );
    // Half a sphere, and what lies within a cell of its rim.
    let o = isoform(&["mesh", &model, "--surface-only", "--size", "0.1", "--json"]);
    let certificate = document(&o)["certificate"].clone();
    let area = certificate["area"].as_f64().expect("an area");
    assert!(
        (1.0..1.4).contains(&(area / std::f64::consts::TAU)),
        "{area}"
    );
    let is = |key: &str| certificate[key].as_bool();
    assert_eq!(
        (is("closed"), is("ok")),
        (Some(false), Some(true)),
        "{certificate}"
    );
    assert!(certificate["volume"].is_null(), "{certificate}");
    let lowest = std::fs::read_to_string(&out)
        .expect("written")
        .lines()
        .filter_map(|l| {
            l.strip_prefix("v ")?
                .rsplit(' ')
                .next()?
                .parse::<f64>()
                .ok()
        })
        .fold(f64::INFINITY, f64::min);
    // Two cells of some 0.3 below the last points.
    assert!((-0.65..0.1).contains(&lowest), "{lowest}");
}

#[test]
fn what_is_wrong_is_said() {
    let f = Folder::new("implicitize-wrong");
    let few = f.file("few.xyz", "0 0 0\n1 0 0\n0 1 0\n");
    let o = isoform(&["implicitize", &few]);
    assert_eq!(code(&o), 2);
    assert!(
        stderr(&o).contains("3 points: at least 10 are needed"),
        "{}",
        stderr(&o)
    );
    let scan = f.file("scan.xyz", sphere());
    let o = isoform(&["implicitize", &scan, "--normals", "given"]);
    assert_eq!(code(&o), 2);
    assert!(
        stderr(&o).contains("the scan has no normals"),
        "{}",
        stderr(&o)
    );
    for (text, said) in [
        ("{}", "a JSON file, not a model"),
        ("{", "not JSON"),
        (
            r#"{"kind": "implicit_spline", "levels": 1}"#,
            "levels: a list is expected",
        ),
        (
            r#"{"kind": "implicit_spline", "degree": 3, "corner": [0, 0, 0], "spacing": 1,
                "count": [1, 1, 1], "levels": [{"cells": [], "coefficients": []}]}"#,
            "level 0: 0 coefficients for 64 B-splines",
        ),
    ] {
        let model = f.file("bad.json", text);
        let o = isoform(&["mesh", &model]);
        assert_eq!(code(&o), 2, "{text}");
        assert!(stderr(&o).contains(said), "{}", stderr(&o));
    }
}
