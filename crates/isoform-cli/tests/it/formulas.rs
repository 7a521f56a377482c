//! Formulas in place of files, and in files `{"F": "…"}`.

use crate::common::*;
use serde_json::Value;
use std::f64::consts::PI;

/// Volume of the mesh of a model.
fn volume(args: &[&str]) -> f64 {
    let o = isoform(&[&["mesh", "--json"], args].concat());
    assert_eq!(code(&o), 0, "{args:?}: {}", stderr(&o));
    document(&o)["certificate"]["volume"]
        .as_f64()
        .expect("a volume")
}

fn assert_near(found: f64, expected: f64, args: &[&str]) {
    assert!(
        (found / expected - 1.0).abs() < 0.02,
        "{args:?}: {found}, not {expected}"
    );
}

/// Volumes of bounded solids, however their formula is written.
#[test]
fn formulas_bound_the_finite_side() {
    let ball = 4.0 / 3.0 * PI;
    for (formula, expected) in [
        ("x^2 + y^2 + z^2 = 4", 8.0 * ball),
        ("4 - x² - y² - z²", 8.0 * ball),
        ("x^2/9 + y^2/4 + z^2 <= 1", 6.0 * ball),
        ("1 >= x**2/9 + y**2/4 + z**2", 6.0 * ball),
        ("max(abs(x), abs(y), abs(z)) = 1/2", 1.0),
        ("sqrt(x^2 + y^2 + z^2) - 1", ball),
    ] {
        assert_near(volume(&[formula]), expected, &[formula]);
    }
}

/// Surfaces without an end are cut: by the given box, or by one that is said.
#[test]
fn surfaces_without_an_end_are_cut() {
    let args = ["x^2 + y^2 - z^2 = 1", "--box=-3,-3,-1,3,3,1"];
    assert_near(volume(&args), 8.0 * PI / 3.0, &args);
    // The other side of a wall is as unbounded as this one, and the inequality says which.
    for (formula, expected) in [("z <= 1/2", 6.0), ("z >= 1/2", 2.0)] {
        let args = [formula, "--box=-1,-1,-1,1,1,1"];
        assert_near(volume(&args), expected, &args);
    }
    let o = isoform(&["mesh", "x^2 + y^2 - 9z^2 = 1", "--surface-only"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    assert!(
        stderr(&o).contains("it is cut by --box=-"),
        "{}",
        stderr(&o)
    );
}

/// Parameters have the values of the command line, of the file, or 1, which is said.
#[test]
fn parameters_are_set_by_name() {
    let f = Folder::new("formula-parameters");
    let file = f.file("ball.json", r#"{"F": "x^2 + y^2 + z^2 = r^2", "r": 2}"#);
    let points = f.file("p.csv", "1,0,2\n");
    let value = |args: &[&str]| {
        let o = isoform(&[&["eval", "--points", &points], args].concat());
        assert_eq!(code(&o), 0, "{}", stderr(&o));
        stdout(&o)
    };
    assert_eq!(value(&[&file]), "x,y,z,f\n1,0,2,1.0\n");
    assert_eq!(value(&[&file, "--set", "r=3"]), "x,y,z,f\n1,0,2,-4.0\n");
    assert_eq!(
        value(&["x y + x z = a", "--params", "3"]),
        "x,y,z,f\n1,0,2,-1.0\n"
    );
    let ball = 4.0 / 3.0 * PI;
    assert_near(volume(&[&file]), 8.0 * ball, &[&file]);
    let o = isoform(&["mesh", "x^2 + y^2 + z^2 = r^2", "--surface-only"]);
    assert!(stderr(&o).contains("--set r=1"), "{}", stderr(&o));
}

/// A formula is a model for all verbs that take one.
#[test]
fn every_verb_of_models_takes_a_formula() {
    let f = Folder::new("formula-verbs");
    let ball = "x^2 + y^2 + z^2 = 1";
    let stl = f.path("ball.stl");
    assert_eq!(
        code(&isoform(&["mesh", ball, "--surface-only", "-o", &stl])),
        0
    );
    let o = isoform(&["compare", &stl, ball, "--tolerance", "0.01"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let step = f.path("ball.step");
    let o = isoform(&["brep", ball, "-o", &step, "--json"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let found = document(&o)["solid"]["volume"].as_f64();
    assert!(
        found.is_none_or(|v| (v - 4.0 / 3.0 * PI).abs() < 1e-6),
        "{found:?}"
    );
    let page = f.path("ball.html");
    assert_eq!(
        code(&isoform(&["view", "x^2 + y^2 - z^2 = a", "-o", &page])),
        0
    );
    let picture = f.path("ball.svg");
    let o = isoform(&["render", ball, "--size", "80x60", "-o", &picture]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    // The surface is larger than the default region of files.
    let patches = f.path("patches.json");
    let tol = ["--tol", "1e-3", "-o", &patches];
    let o = isoform(&[&["parameterize", "x^2 + y^2 + z^2 = 9"], &tol[..]].concat());
    assert_eq!(code(&o), 0, "{}", stderr(&o));
}

/// Errors name the column, and what could be meant; paths of files are no formulas.
#[test]
fn errors_name_the_place_and_the_remedy() {
    for (text, code, words) in [
        ("x^2 + = 1", "formula", ["column 7", "write F(x, y, z) = 0"]),
        (
            "sine(x) + y = z",
            "formula",
            ["column 1: `sine`", "did you mean sin"],
        ),
        (
            "min(x) = y",
            "formula",
            ["column 1: min takes 2 or more", ""],
        ),
        (
            "a^2 + b = 1",
            "formula",
            ["does not depend on x, y or z", ""],
        ),
        ("scan (2).hf", "template", ["no file and no template", ""]),
        ("folder=1/part.stp", "file", ["cannot read", ""]),
    ] {
        let o = isoform(&["mesh", text, "--json"]);
        let error = &document(&o)["error"];
        assert_eq!(error["code"], code, "{text}: {error}");
        let said = error.to_string();
        assert!(
            words.iter().all(|word| said.contains(word)),
            "{text}: {said}"
        );
    }
    let f = Folder::new("formula-errors");
    let file = f.file("wrong.json", r#"{"F": "x^2 + u = 1 =", "box": 2}"#);
    let o = isoform(&["mesh", &file, "--json"]);
    let error = &document(&o)["error"];
    assert_eq!(
        (&error["where"]["column"], &error["where"]["key"]),
        (&13.into(), &"F".into())
    );
    let file = f.file("box.json", r#"{"F": "x = z^2", "box": "wide"}"#);
    let o = isoform(&["view", &file, "--json", "-o", &f.path("page.html")]);
    assert_eq!(
        document(&o)["error"]["where"]["key"],
        "box",
        "{}",
        stderr(&o)
    );
}

/// The box of a map is that of its file, or one that shows it.
#[test]
fn maps_need_no_box() {
    let f = Folder::new("map-box");
    let text = |more: &str| format!(r#"{{"x": "u", "y": "v", "z": "u² - v²", "w": 1{more}}}"#);
    let half = |file: &str, args: &[&str]| {
        let o = isoform(&[&["triangulate", file, "--json"], args].concat());
        assert_eq!(code(&o), 0, "{}", stderr(&o));
        let Value::Object(document) = document(&o) else {
            panic!("a document");
        };
        let found = document.get("box").and_then(Value::as_str);
        (found.expect("a width").to_owned(), stderr(&o))
    };
    let file = f.file("stated.json", text(r#", "box": "3/2""#));
    assert_eq!(half(&file, &[]).0, "3/2");
    assert_eq!(half(&file, &["--box", "2"]).0, "2");
    let file = f.file("free.json", text(""));
    let (chosen, said) = half(&file, &[]);
    // The median over all directions of max(|u|, |v|, |u² − v²|) is near 1.
    let chosen = isoform::exact_number(&chosen)
        .expect("a fraction")
        .to_f64_fast();
    assert!((1.0..10.0).contains(&chosen), "{chosen}");
    assert!(said.contains("it is drawn within --box"), "{said}");
}
