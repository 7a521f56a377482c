//! `parameterize` as a user runs it.

use crate::common::{Folder, code, document, isoform};
use crate::triangulate::obj;
use serde_json::{Value, json};
use std::fs;

const SPHERE: &str = r#"{"F": "x^2 + y^2 + z^2 - 1/4"}"#;
const BALL: &str =
    "my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, 0.5); }";

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
    let seed = [
        "--paper",
        "--degree",
        "2,2",
        "--seed-point",
        "0,0,0.5",
        "-o",
        &patches,
        "--trace",
        &trace,
    ];
    let (code, document) = parameterize(&model, &seed);
    assert_eq!((code, &document["ok"]), (0, &json!(true)));
    let report = &document["patches"][0];
    assert!(report["S"].as_f64().is_some_and(|s| s <= 1e-6));
    let file = folder.json("p.json");
    let patch = &file["patches"][0];
    assert_eq!(patch["degree"], json!([2, 2]));
    let rows = patch["control"].as_array().expect("rows");
    assert!(
        rows.len() == 3
            && rows
                .iter()
                .all(|r| r.as_array().is_some_and(|r| r.len() == 3))
    );
    // Corners lie within the bound of the sphere.
    let bound = patch["max_distance"].as_f64().expect("a bound");
    for (i, j) in [(0, 0), (0, 2), (2, 0), (2, 2)] {
        let c: Vec<f64> = rows[i][j]
            .as_array()
            .expect("a point")
            .iter()
            .filter_map(Value::as_f64)
            .collect();
        let r = ((c[0] * c[0] + c[1] * c[1] + c[2] * c[2]) / (c[3] * c[3])).sqrt();
        assert!((r - 0.5).abs() <= bound, "{r}");
    }
    let text = fs::read_to_string(&trace).expect("a table");
    assert!(text.starts_with("phase,step,S,I,J,L,R,E,l1,l2,wJ,wL,wR,wE\n"));
    let of = |phase: &str| text.lines().filter(|l| l.starts_with(phase)).count();
    assert_eq!(
        json!([of("newton,"), of("grow,")]),
        json!([report["newton_steps"], report["extrapolation_steps"]])
    );
    // The same bytes again.
    let before = fs::read(&patches).expect("a file");
    parameterize(&model, &seed);
    assert_eq!(before, fs::read(&patches).expect("a file"));
}

#[test]
fn programs_tolerances_and_exactness() {
    let folder = Folder::new("parameterize-hf");
    let model = folder.file("ball.hf", BALL);
    let (code, document) =
        parameterize(&model, &["--degree", "2,2", "--tol", "1e-4", "--seed", "3"]);
    assert_eq!(code, 0, "{document}");
    assert!(
        document["patches"][0]["max_distance"]
            .as_f64()
            .is_some_and(|d| d <= 1e-4)
    );
    let (code, document) = parameterize(&model, &["--degree", "2,2", "--exact"]);
    assert_eq!(
        (code, &document["patches"][0]["exact"]),
        (0, &json!(true)),
        "{document}"
    );
    // A quartic without rational patches of this degree nearby: made as usual, and said.
    let model = folder.file("quartic.json", r#"{"F": "x^4 + y^4 + z^4 - 1/16"}"#);
    let (code, document) = parameterize(
        &model,
        &["--degree", "2,2", "--exact", "--seed-point", "0.3,0.3,0.3"],
    );
    assert_eq!(
        (code, &document["ok"], &document["patches"][0]["exact"]),
        (3, &json!(false), &json!(false))
    );
    assert!(document["patches"][0]["max_distance"].is_f64());
}

#[test]
fn covers_do_not_depend_on_threads() {
    let folder = Folder::new("parameterize-cover");
    let model = folder.file("sphere.json", SPHERE);
    let make = |threads: &str| {
        let path = folder.path(&format!("{threads}.json"));
        let (code, document) = parameterize(
            &model,
            &[
                "--degree",
                "2,2",
                "--cover",
                "--tol",
                "1e-3",
                "--threads",
                threads,
                "-o",
                &path,
            ],
        );
        assert_eq!(code, 0, "{document}");
        (fs::read(path).expect("a file"), document)
    };
    let ((one, document), (two, _)) = (make("1"), make("3"));
    assert_eq!(one, two);
    let patches = document["patches"].as_array().expect("patches");
    assert!((4..=16).contains(&patches.len()), "{}", patches.len());
    assert!(
        patches
            .iter()
            .all(|p| p["control_weights"][0].as_f64().is_some_and(|w| w > 0.0))
    );
    assert_eq!(
        document["coverage"]["covered"],
        document["coverage"]["samples"]
    );
}

/// The triangles of all patches are turned to where the function falls: outward for a ball, and
/// inward for F, which is positive outside of the sphere.
#[test]
fn patches_are_turned_alike() {
    let folder = Folder::new("parameterize-turned");
    for (name, text, is_outward) in [("ball.hf", BALL, true), ("sphere.json", SPHERE, false)] {
        let model = folder.file(name, text);
        let cover = [
            "--degree", "2,2", "--box", "0.6", "--cover", "--tol", "1e-3", "-o",
        ];
        let to = folder.path("cover.obj");
        let (code, document) = parameterize(&model, &[&cover[..], &[&to, "--force"]].concat());
        assert_eq!(code, 0, "{name}: {document}");
        let (points, triangles) = obj(&folder.bytes("cover.obj"));
        assert!(triangles.len() > 1000, "{name}");
        for t in triangles {
            let [p, q, r] = t.map(|v| points[v]);
            // Six times the volume between the triangle and the centre.
            let turned = (0..3).map(|k| {
                let [i, j] = [(k + 1) % 3, (k + 2) % 3];
                p[k] * (q[i] * r[j] - q[j] * r[i])
            });
            assert_eq!(turned.sum::<f64>() > 0.0, is_outward, "{name}: {t:?}");
        }
    }
}

#[test]
fn step_and_triangles_beside_json() {
    let folder = Folder::new("parameterize-files");
    let model = folder.file("ball.hf", BALL);
    let names = ["p.json", "p.step", "again.STP", "p.obj", "p.ply", "p.glb"];
    let paths = names.map(|n| folder.path(n));
    let outputs: Vec<&str> = paths.iter().flat_map(|p| ["-o", p]).collect();
    let grid = [
        "--degree", "2,2", "--tol", "1e-4", "--grid", "8", "--units", "cm",
    ];
    let (code, document) = parameterize(&model, &[&outputs[..], &grid].concat());
    assert_eq!((code, &document["files"]), (0, &json!(paths)), "{document}");
    let text = |name: &str| fs::read_to_string(folder.0.join(name)).expect("a file");
    let step = text("p.step");
    assert_eq!(step, text("again.STP"));
    assert!(step.contains("PRODUCT('ball'") && step.contains("SI_UNIT(.CENTI.,.METRE.)"));
    assert_eq!(step.matches("ADVANCED_FACE").count(), 1);
    // The first control point, divided by its weight.
    let corner = &folder.json("p.json")["patches"][0]["control"][0][0];
    let n = |k: usize| corner[k].as_f64().expect("a number");
    let point: Vec<String> = (0..3).map(|k| format!("{}", n(k) / n(3))).collect();
    assert!(
        step.replace(",\n", ",")
            .contains(&format!("({})", point.join(","))),
        "{point:?}"
    );
    let obj = text("p.obj");
    let lines = |start: &str| obj.lines().filter(|l| l.starts_with(start)).count();
    assert_eq!((lines("v "), lines("vt "), lines("f ")), (81, 81, 128));
    let ply = fs::read(folder.0.join("p.ply")).expect("a file");
    let header = String::from_utf8_lossy(&ply[..400]).into_owned();
    assert!(
        header.contains("property double u\nproperty double v\nproperty double distance\n"),
        "{header}"
    );
    assert_eq!(
        fs::read(folder.0.join("p.glb")).expect("a file")[..4],
        *b"glTF"
    );
    // Triangles face outward.
    let points: Vec<Vec<f64>> = obj
        .lines()
        .filter_map(|l| l.strip_prefix("v "))
        .map(|l| l.split(' ').map(|w| w.parse().expect("a number")).collect())
        .collect();
    for face in obj.lines().filter_map(|l| l.strip_prefix("f ")) {
        let t: Vec<&Vec<f64>> = face
            .split(' ')
            .map(|w| {
                &points[w
                    .split('/')
                    .next()
                    .and_then(|i| i.parse::<usize>().ok())
                    .expect("an index")
                    - 1]
            })
            .collect();
        let [a, b, c] = [t[0], t[1], t[2]];
        let det = a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        assert!(det > 0.0, "{face}");
    }
    // What a format has no place for is said.
    let (_, document) = parameterize(
        &model,
        &[
            "--degree",
            "2,2",
            "--tol",
            "1e-4",
            "-o",
            &folder.path("p.stl"),
        ],
    );
    assert!(
        document["warnings"].as_array().is_some_and(|w| w
            .iter()
            .any(|w| w.as_str().is_some_and(|w| w.contains("distance")))),
        "{document}"
    );
}

#[test]
fn exact_patches_are_on_named_surfaces_in_step() {
    let folder = Folder::new("parameterize-named");
    let shapes = [
        ("sphere", SPHERE, "SPHERICAL_SURFACE"),
        (
            "cylinder",
            r#"{"F": "x^2 + y^2 - 1/16"}"#,
            "CYLINDRICAL_SURFACE",
        ),
        ("cone", r#"{"F": "x^2 + y^2 - z^2/4"}"#, "CONICAL_SURFACE"),
        // Radii 3/10 and 3/20.
        (
            "torus",
            r#"{"F": "(x^2 + y^2 + z^2 + 27/400)^2 - 9/25*(x^2 + y^2)"}"#,
            "TOROIDAL_SURFACE",
        ),
    ];
    for (name, formula, entity) in shapes {
        let model = folder.file(&format!("{name}.json"), formula);
        let path = folder.path(&format!("{name}.step"));
        let (code, document) = parameterize(
            &model,
            &[
                "--degree",
                "2,2",
                "--exact",
                "--seed-point",
                "0.1,0.3,0.2",
                "-o",
                &path,
            ],
        );
        assert_eq!(
            (code, &document["patches"][0]["entity"]["kind"]),
            (0, &json!(name)),
            "{document}"
        );
        let text = fs::read_to_string(&path).expect("a file");
        assert!(
            text.contains(entity) && !text.contains("B_SPLINE_SURFACE("),
            "{name}"
        );
        if name == "torus" {
            let of = |key: &str| {
                document["patches"][0]["entity"][key]
                    .as_f64()
                    .unwrap_or_default()
            };
            assert!(
                (of("major_radius") - 0.3).abs() < 1e-12
                    && (of("minor_radius") - 0.15).abs() < 1e-12,
                "{document}"
            );
        }
    }
}

/// An ellipsoid with the half axes 0.5, 0.4 and 0.3 about (0.1, 0, -0.2), by its own numbers.
#[test]
fn quadrics_have_a_centre_axes_and_measures() {
    let folder = Folder::new("parameterize-ellipsoid");
    let formula = r#"{"F": "4*(x - 1/10)^2 + 25/4*y^2 + 100/9*(z + 1/5)^2 - 1"}"#;
    let model = folder.file("ellipsoid.json", formula);
    let (code, document) = parameterize(&model, &["--degree", "2,2", "--exact"]);
    let entity = &document["patches"][0]["entity"];
    assert_eq!(
        (code, &entity["kind"]),
        (0, &json!("ellipsoid")),
        "{document}"
    );
    let numbers = |value: &Value| -> Vec<f64> {
        let all = value.as_array().expect("numbers").iter();
        all.map(|x| x.as_f64().expect("a number")).collect()
    };
    for (found, truth) in numbers(&entity["center"]).iter().zip([0.1, 0.0, -0.2]) {
        assert!((found - truth).abs() < 1e-9, "{entity}");
    }
    let axes = entity["axes"].as_array().expect("axes");
    for (axis, measure) in axes.iter().zip(numbers(&entity["measures"])) {
        let along = numbers(axis).iter().position(|x| x.abs() > 1.0 - 1e-9);
        let truth = [0.5, 0.4, 0.3][along.expect("an axis")];
        assert!((measure - truth).abs() < 1e-9, "{entity}");
    }
}

#[test]
fn a_tolerance_below_rounding_is_named() {
    let folder = Folder::new("parameterize-rounding");
    let model = folder.file("sphere.json", SPHERE);
    let why = |tolerance: &str| {
        let (code, document) = parameterize(&model, &["--degree", "2,2", "--tol", tolerance]);
        let why = document["error"]["why"].as_str().unwrap_or_default();
        (code, why.to_owned())
    };
    let (code, text) = why("1e-30");
    assert_eq!(code, 4);
    assert!(text.contains("rounding"), "{text}");
}

#[test]
fn growth_stops_after_so_many_extrapolations() {
    let folder = Folder::new("parameterize-growth");
    let model = folder.file("sphere.json", SPHERE);
    let grown = |count: &str| {
        let (code, document) =
            parameterize(&model, &["--degree", "2,2", "--extrapolations", count]);
        assert_eq!(code, 0, "{document}");
        let patch = &document["patches"][0];
        assert_eq!(patch["extrapolation_steps"].to_string(), count);
        patch["area"].as_f64().expect("an area")
    };
    let [start, third] = ["0", "3"].map(grown);
    // The start patch has a tenth of the box's edge.
    assert!(
        (start / 0.01 - 1.0).abs() < 0.02 && third > 2.0 * start,
        "{start} {third}"
    );
}

#[test]
fn figures_and_the_other_term() {
    let folder = Folder::new("parameterize-figure");
    let (model, path) = (folder.file("sphere.json", SPHERE), folder.path("steps.svg"));
    let (code, document) = parameterize(
        &model,
        &["--degree", "2,2", "--inner", "tangents", "--figure", &path],
    );
    assert_eq!((code, &document["inner"]), (0, &json!("tangents")));
    let svg = fs::read_to_string(&path).expect("a picture");
    assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n") && !svg.contains("NaN"));
    // A plus for each extrapolation and one in the legend; three lines; 40 x 40 quadrangles.
    let count = |what: &str| svg.matches(what).count();
    let extrapolations = document["patches"][0]["extrapolation_steps"]
        .as_u64()
        .expect("a number") as usize;
    assert_eq!(
        (
            count("class=\"grow\""),
            count("<polyline"),
            count("class=\"sheet\"")
        ),
        (extrapolations + 1, 3, 1600)
    );
}

#[test]
fn bad_input_is_refused() {
    let folder = Folder::new("parameterize-bad");
    let model = folder.file("sphere.json", SPHERE);
    let error = |model: &str, more: &[&str]| {
        let (code, document) = parameterize(model, more);
        assert_eq!(document["ok"], false);
        (
            code,
            document["error"]["code"]
                .as_str()
                .unwrap_or_default()
                .to_owned(),
        )
    };
    let is = |code: i32, name: &str| (code, name.to_owned());
    assert_eq!(error(&model, &["--degree", "0,2"]), is(1, "usage"));
    assert_eq!(error(&model, &["--degree", "2"]), is(1, "usage"));
    assert_eq!(error(&model, &["-o", "patches.iges"]), is(1, "usage"));
    assert_eq!(
        error(&model, &["-o", "patches.step", "--units", "parsec"]),
        is(1, "usage")
    );
    assert_eq!(
        error(&model, &["-o", "nowhere/patches.step"]),
        is(2, "not-writable")
    );
    assert_eq!(error(&model, &["--grid", "0"]), is(1, "usage"));
    assert_eq!(error(&model, &["--cover"]), is(1, "usage"));
    assert_eq!(
        error(&model, &["--tol", "1e-3", "--margin", "0.1"]),
        is(1, "usage")
    );
    assert_eq!(
        error(&model, &["--cover", "--tol", "1e-3", "--margin", "0"]),
        is(1, "usage")
    );
    assert_eq!(error(&model, &["--paper", "--tol", "1e-3"]), is(1, "usage"));
    assert_eq!(error(&model, &["--seed-point", "0,0,0"]), is(4, "far-seed"));
    assert_eq!(error(&model, &["--box", "0.1"]), is(4, "empty"));
    let file = |text: &str| folder.file("bad.json", text);
    assert_eq!(error(&file("{"), &[]), is(2, "json"));
    assert_eq!(error(&file("{}"), &[]), is(2, "other-kind"));
    assert_eq!(
        error(&file(r#"{"F": "x^2 + sine(y)"}"#), &[]),
        is(2, "formula")
    );
    assert_eq!(error(&file(r#"{"F": "3"}"#), &[]), is(2, "formula"));
    assert_eq!(
        error(
            &file(r#"{"F": "x^2 - y^2*z"}"#),
            &["--seed-point", "0,0,0.2"]
        ),
        is(4, "singular")
    );
    assert_eq!(
        error(&file(r#"{"F": "x^2 + y^2 + z^2 + 1"}"#), &[]),
        is(4, "empty")
    );
    let half = folder.file(
        "half.hf",
        "my_model(x[3], a[1]) { my_model = sqrt(x[1]) - 0.3; }",
    );
    assert_eq!(
        error(&half, &["--seed-point", "-0.2,0,0"]),
        is(4, "not-a-number")
    );
    assert_eq!(
        error(&model, &["--seed-point", "1e9,0,0"]),
        is(4, "far-seed")
    );
    assert_eq!(error(&model, &["--seed-point", "nan,0,0"]), is(1, "usage"));
    assert_eq!(error(&model, &["--degree", "9,2"]), is(1, "usage"));
    assert_eq!(error(&model, &["--inner", "angles"]), is(1, "usage"));
    assert_eq!(
        error(&model, &["--figure", "nowhere/f.svg"]),
        is(2, "not-writable")
    );
    assert_eq!(
        error(&model, &["--cover", "--tol", "1e-3", "--figure", "f.svg"]),
        is(1, "usage")
    );
    assert_eq!(error(&model, &["--params", "1"]), is(1, "usage"));
    assert_eq!(error("nowhere.json", &[]), is(2, "file"));
}

/// A margin is proved, or where not is said, with exit code 3; on models with edges never.
#[test]
fn margins_are_proved_or_not() {
    let folder = Folder::new("parameterize-margin");
    let model = folder.file("sphere.json", SPHERE);
    let cover = [
        "--box", "0.6", "--degree", "2,2", "--cover", "--tol", "1e-3", "--margin", "0.04",
    ];
    let (code, document) = parameterize(&model, &cover);
    let margin = &document["coverage"]["margin"];
    assert_eq!((code, &document["ok"]), (0, &json!(true)), "{margin}");
    assert_eq!(
        (&margin["length"], &margin["proved"], &margin["open"]),
        (&json!(0.04), &json!(true), &json!(0))
    );
    assert!(margin["max_distance"].as_f64().is_some_and(|d| d <= 1.5e-3));
    let (code, document) = parameterize(&model, &[&cover[..], &["--patches", "2"]].concat());
    let margin = &document["coverage"]["margin"];
    assert_eq!((code, &margin["proved"]), (3, &json!(false)));
    let boxes = margin["boxes"].as_array().expect("boxes");
    assert!(!boxes.is_empty() && margin["max_distance"].is_null());
    let warned = document["warnings"].to_string();
    assert!(
        warned.contains("margin: it could not be proved in"),
        "{warned}"
    );
    let cube = folder.file(
        "cube.hf",
        "my_model(x[3], a[1]) { my_model = min(min(0.3 - abs(x[1]), 0.3 - abs(x[2])), 0.3 - abs(x[3])); }",
    );
    let (code, document) = parameterize(&cube, &cover);
    let proved = &document["coverage"]["margin"]["proved"];
    assert_eq!((code, proved), (3, &json!(false)));
}

/// Multiples of a polynomial have the same zero set, squares of whose gradients may be beyond the
/// largest number.
#[test]
fn multiples_of_a_polynomial_have_the_same_patch() {
    let folder = Folder::new("parameterize-multiples");
    let distance = |factor: &str| {
        let model = folder.file(
            "m.json",
            format!(r#"{{"F": "{factor}*x^2 + {factor}*y^2 + {factor}*z^2 - {factor}/4"}}"#),
        );
        let (code, document) = parameterize(&model, &["--degree", "2,2", "--tol", "1e-4"]);
        assert_eq!(code, 0, "{document}");
        document["patches"][0]["max_distance"]
            .as_f64()
            .expect("a bound")
    };
    let one = distance("1");
    for factor in ["10^200", "1/10^200"] {
        assert!((distance(factor) / one - 1.0).abs() < 1e-6, "{factor}");
    }
}

/// On an infinite cylinder aslant, patches end near the box.
#[test]
fn patches_end_near_the_box() {
    let folder = Folder::new("parameterize-box");
    let model = folder.file("c.json", r#"{"F": "x^2 + y^2 - 9/100"}"#);
    for seed in ["1", "2", "3", "4", "5", "6"] {
        let path = folder.path("c-patch.json");
        let (code, document) =
            parameterize(&model, &["--tol", "1e-3", "--seed", seed, "-o", &path]);
        assert_eq!(code, 0, "{document}");
        let patches = folder.json("c-patch.json");
        let control = patches["patches"][0]["control"].as_array().expect("rows");
        let number = |i: usize, j: usize, k: usize| control[i][j][k].as_f64().expect("a number");
        // Bernstein polynomials of degree 3.
        let basis = |t: f64| {
            let s = 1.0 - t;
            [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]
        };
        for place in 0..31 * 31 {
            let [a, b] = [place / 31, place % 31].map(|k| basis(f64::from(k) / 30.0));
            let sum = |k: usize| -> f64 {
                (0..16)
                    .map(|i| a[i / 4] * b[i % 4] * number(i / 4, i % 4, k))
                    .sum()
            };
            let z = sum(2) / sum(3);
            assert!(z.abs() < 0.85, "seed {seed}: {z}");
        }
    }
}

/// Out of time before there is a patch is told as such, and not as a lack of surface.
#[test]
fn without_time_there_is_no_patch() {
    let folder = Folder::new("parameterize-time");
    let model = folder.file("sphere.json", SPHERE);
    let cover = ["--degree", "2,2", "--cover", "--tol", "1e-9"];
    let single = ["--degree", "2,2", "--paper"];
    for what in [&cover[..], &single] {
        let (code, document) = parameterize(&model, &[what, &["--time-limit", "0s"]].concat());
        let error = &document["error"];
        assert_eq!((code, &error["code"]), (4, &json!("time-limit")), "{error}");
        let message = error["message"].as_str().unwrap_or_default();
        assert!(message.ends_with("stopped before there was a patch"));
    }
}
