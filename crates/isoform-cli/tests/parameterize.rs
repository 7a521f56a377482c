//! `parameterize` as a user runs it.

#[allow(dead_code, reason = "other tests use the rest")]
mod common;

use common::{Folder, code, document, isoform};
use serde_json::{Value, json};
use std::fs;

const SPHERE: &str = r#"{"F": "x^2 + y^2 + z^2 - 1/4"}"#;
const BALL: &str = "my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, 0.5); }";

impl Folder {
    fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&fs::read(self.0.join(name)).expect("a file")).expect("JSON")
    }
}

/// Runs `parameterize MODEL ... --json`; the code and the document.
fn parameterize(model: &str, more: &[&str]) -> (i32, Value) {
    let o = isoform(&[&["parameterize", model, "--json", "-q"], more].concat());
    (code(&o), document(&o))
}

#[test]
fn a_patch_its_file_and_its_trace() {
    let folder = Folder::new("parameterize");
    let model = folder.file("sphere.json", SPHERE);
    let (patches, trace) = (folder.path("p.json"), folder.path("t.csv"));
    let seed = ["--paper", "--degree", "2,2", "--seed-point", "0,0,0.5", "-o", &patches, "--trace", &trace];
    let (code, document) = parameterize(&model, &seed);
    assert_eq!((code, &document["ok"]), (0, &json!(true)));
    let report = &document["patches"][0];
    assert!(report["S"].as_f64().is_some_and(|s| s <= 1e-6));
    let file = folder.json("p.json");
    let patch = &file["patches"][0];
    assert_eq!(patch["degree"], json!([2, 2]));
    let rows = patch["control"].as_array().expect("rows");
    assert!(rows.len() == 3 && rows.iter().all(|r| r.as_array().is_some_and(|r| r.len() == 3)));
    // Corners lie within the bound of the sphere.
    let bound = patch["max_distance"].as_f64().expect("a bound");
    for (i, j) in [(0, 0), (0, 2), (2, 0), (2, 2)] {
        let c: Vec<f64> = rows[i][j].as_array().expect("a point").iter().filter_map(Value::as_f64).collect();
        let r = ((c[0] * c[0] + c[1] * c[1] + c[2] * c[2]) / (c[3] * c[3])).sqrt();
        assert!((r - 0.5).abs() <= bound, "{r}");
    }
    let text = fs::read_to_string(&trace).expect("a table");
    assert!(text.starts_with("phase,step,S,I,J,L,R,E,l1,l2,wJ,wL,wR,wE\n"));
    let of = |phase: &str| text.lines().filter(|l| l.starts_with(phase)).count();
    assert_eq!(json!([of("newton,"), of("grow,")]), json!([report["newton_steps"], report["extrapolation_steps"]]));
    // The same bytes again.
    let before = fs::read(&patches).expect("a file");
    parameterize(&model, &seed);
    assert_eq!(before, fs::read(&patches).expect("a file"));
}

#[test]
fn programs_tolerances_and_exactness() {
    let folder = Folder::new("parameterize-hf");
    let model = folder.file("ball.hf", BALL);
    let (code, document) = parameterize(&model, &["--degree", "2,2", "--tol", "1e-4", "--seed", "3"]);
    assert_eq!(code, 0, "{document}");
    assert!(document["patches"][0]["max_distance"].as_f64().is_some_and(|d| d <= 1e-4));
    let (code, document) = parameterize(&model, &["--degree", "2,2", "--exact"]);
    assert_eq!((code, &document["patches"][0]["exact"]), (0, &json!(true)), "{document}");
    // A quartic without rational patches of this degree nearby: made as usual, and said.
    let model = folder.file("quartic.json", r#"{"F": "x^4 + y^4 + z^4 - 1/16"}"#);
    let (code, document) = parameterize(&model, &["--degree", "2,2", "--exact", "--seed-point", "0.3,0.3,0.3"]);
    assert_eq!((code, &document["ok"], &document["patches"][0]["exact"]), (3, &json!(false), &json!(false)));
    assert!(document["patches"][0]["max_distance"].is_f64());
}

#[test]
fn covers_do_not_depend_on_threads() {
    let folder = Folder::new("parameterize-cover");
    let model = folder.file("sphere.json", SPHERE);
    let make = |threads: &str| {
        let path = folder.path(&format!("{threads}.json"));
        let (code, document) = parameterize(&model, &["--degree", "2,2", "--cover", "--tol", "1e-3", "--threads", threads, "-o", &path]);
        assert_eq!(code, 0, "{document}");
        (fs::read(path).expect("a file"), document)
    };
    let ((one, document), (two, _)) = (make("1"), make("3"));
    assert_eq!(one, two);
    let patches = document["patches"].as_array().expect("patches");
    assert!((4..=16).contains(&patches.len()), "{}", patches.len());
    assert!(patches.iter().all(|p| p["control_weights"][0].as_f64().is_some_and(|w| w > 0.0)));
    assert_eq!(document["coverage"]["covered"], document["coverage"]["samples"]);
}

#[test]
fn bad_input_is_refused() {
    let folder = Folder::new("parameterize-bad");
    let model = folder.file("sphere.json", SPHERE);
    let error = |model: &str, more: &[&str]| {
        let (code, document) = parameterize(model, more);
        assert_eq!(document["ok"], false);
        (code, document["error"]["code"].as_str().unwrap_or_default().to_owned())
    };
    let is = |code: i32, name: &str| (code, name.to_owned());
    assert_eq!(error(&model, &["--degree", "0,2"]), is(1, "usage"));
    assert_eq!(error(&model, &["--degree", "2"]), is(1, "usage"));
    assert_eq!(error(&model, &["-o", "patches.step"]), is(1, "usage"));
    assert_eq!(error(&model, &["--cover"]), is(1, "usage"));
    assert_eq!(error(&model, &["--paper", "--tol", "1e-3"]), is(1, "usage"));
    assert_eq!(error(&model, &["--seed-point", "0,0,0"]), is(4, "far-seed"));
    assert_eq!(error(&model, &["--box", "0.1"]), is(4, "empty"));
    let file = |text: &str| folder.file("bad.json", text);
    assert_eq!(error(&file("{"), &[]), is(2, "json"));
    assert_eq!(error(&file("{}"), &[]), is(2, "key"));
    assert_eq!(error(&file(r#"{"F": "x^2 + sin(y)"}"#), &[]), is(2, "polynomial"));
    assert_eq!(error(&file(r#"{"F": "3"}"#), &[]), is(2, "polynomial"));
    assert_eq!(error(&file(r#"{"F": "x^2 - y^2*z"}"#), &["--seed-point", "0,0,0.2"]), is(4, "singular"));
    assert_eq!(error(&file(r#"{"F": "x^2 + y^2 + z^2 + 1"}"#), &[]), is(4, "empty"));
    assert_eq!(error(&model, &["--params", "1"]), is(1, "usage"));
    assert_eq!(error("nowhere.json", &[]), is(2, "file"));
}
