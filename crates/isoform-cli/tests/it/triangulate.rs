//! `triangulate` as a user runs it.

use crate::common::*;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;

/// Two sheets: poles within the box's reach, cut by it.
const HYPERBOLOID: &str = r#"{"X": "2*s", "Y": "2*t", "Z": "1 + s^2 + t^2", "W": "1 - s^2 - t^2"}"#;
/// A paraboloid whose parameters cover it twice.
const TWICE: &str = r#"{"X": "s^2", "Y": "t", "Z": "s^4 + t^2", "W": "1"}"#;

impl Folder {
    fn map(&self, text: &str) -> String {
        self.file("map.json", text)
    }
    fn is_there(&self, name: &str) -> bool {
        self.0.join(name).exists()
    }
}

/// Points and triangles of an OBJ, as they stand there.
pub(crate) fn obj(bytes: &[u8]) -> (Vec<[f64; 3]>, Vec<[usize; 3]>) {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for line in std::str::from_utf8(bytes).expect("text").lines() {
        let mut words = line.split(' ');
        let kind = words.next();
        let words: Vec<&str> = words.collect();
        match kind {
            Some("v") => points.push([0, 1, 2].map(|k| words[k].parse().expect("a number"))),
            Some("f") => {
                let first = |k: usize| words[k].split('/').next().unwrap_or_default();
                let index = |k| first(k).parse::<usize>().expect("an index") - 1;
                triangles.push([0, 1, 2].map(index))
            }
            _ => {}
        }
    }
    (points, triangles)
}

/// Vertices − edges + triangles.
fn euler(triangles: &[[usize; 3]]) -> i64 {
    let vertices: BTreeSet<usize> = triangles.iter().flatten().copied().collect();
    let sides = triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let edges: BTreeSet<[usize; 2]> = sides.map(|[a, b]| [a.min(b), a.max(b)]).collect();
    vertices.len() as i64 - edges.len() as i64 + triangles.len() as i64
}

fn keys(json: &Value) -> Vec<&str> {
    json.as_object()
        .expect("an object")
        .keys()
        .map(String::as_str)
        .collect()
}

#[test]
fn help_has_an_example() {
    let help = isoform(&["triangulate", "--help"]);
    let text = stdout(&help);
    assert!(
        code(&help) == 0 && text.contains("isoform triangulate sphere.json --box 2 -o sphere.obj"),
        "{text}"
    );
    assert!(
        text.contains(SPHERE) && text.contains("[default: 5e-4 B]"),
        "{text}"
    );
}

#[test]
fn a_sphere_is_certified() {
    let f = Folder::new("triangulate-sphere");
    let map = f.map(SPHERE);
    let args = [
        "triangulate",
        &map,
        "--box",
        "2",
        "--tol",
        "0.02",
        "-o",
        &f.path("m.obj"),
        "-o",
        &f.path("m.ply"),
    ];
    let o = isoform(
        &[
            &args[..],
            &[
                "--report",
                &f.path("r.json"),
                "--sidecar",
                &f.path("s.json"),
                "--domain",
                &f.path("d.svg"),
            ],
        ]
        .concat(),
    );
    assert_eq!(code(&o), 0, "{}{}", stdout(&o), stderr(&o));
    let text = stdout(&o);
    for word in [
        "certificate  certified",
        "2 checked in floating point, not proved (distances, shapes)",
        "Euler number 2, 1 component, no boundary loops",
        "winding      consistent, normals outward",
        "proper, onto a surface of degree 2",
        "w = 0 to (0, 0, 1)",
    ] {
        assert!(text.contains(word), "{word}: {text}");
    }
    assert!(
        stderr(&o).contains("triangulation ..."),
        "the phase is told"
    );

    let (points, triangles) = obj(&f.bytes("m.obj"));
    assert_eq!(euler(&triangles), 2);
    for p in &points {
        assert!(
            (p.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-14,
            "{p:?}"
        );
    }
    assert!(f.bytes("m.ply").starts_with(b"ply"));

    let r = f.json("r.json");
    let all = [
        "schema",
        "certified",
        "unproven",
        "claims",
        "map_degree",
        "winding",
        "base_points",
        "pole_components",
        "double_curve_complete",
        "double_curve",
        "contracted",
        "solitary_arcs",
        "seconds",
    ];
    assert_eq!(keys(&r), all);
    assert_eq!(
        (&r["schema"], &r["certified"], &r["map_degree"]),
        (&json!(1), &json!(true), &json!(1))
    );
    // What is only checked in floating point is said to be.
    let claims = r["claims"].as_array().expect("claims");
    let floating: Vec<&Value> = claims
        .iter()
        .filter(|c| c["basis"] == "floating")
        .map(|c| &c["claim"])
        .collect();
    assert_eq!(floating, ["distances", "shapes"]);
    assert_eq!(
        claims.iter().find(|c| c["claim"] == "sign of W"),
        Some(&json!({
            "claim": "sign of W",
            "basis": "bounded",
            "holds": true,
            "text": "W keeps its sign on every triangle of the parameters",
        }))
    );
    assert_eq!(
        r["pole_components"],
        json!({"ovals": 0, "pseudolines": 0, "singular": 0, "isolated": 0})
    );
    assert_eq!(
        r["contracted"],
        json!([{"curve": "w", "point": [0.0, 0.0, 1.0]}])
    );
    assert!(r["seconds"]["pole topology"].is_number() && r["seconds"]["triangles"].is_number());

    let picture = String::from_utf8(f.bytes("d.svg")).expect("text");
    assert!(
        picture.starts_with("<svg")
            && picture.ends_with("</svg>\n")
            && picture.matches('z').count() > triangles.len()
    );
}

/// The sidecar goes by the order of the OBJ: its parameters give the vertices.
#[test]
fn a_sidecar_has_the_order_of_the_mesh() {
    let f = Folder::new("triangulate-sidecar");
    let (exit, _) = triangulate(
        &f.map(HYPERBOLOID),
        &[
            "--box",
            "3",
            "--tol",
            "0.1",
            "-o",
            &f.path("m.obj"),
            "--sidecar",
            &f.path("s.json"),
            "--mode",
            "normalised",
        ],
    );
    assert_eq!(exit, 0);
    let ((points, triangles), s) = (obj(&f.bytes("m.obj")), f.json("s.json"));
    assert_eq!(keys(&s), ["schema", "chart", "corners", "kind"]);
    let kinds = s["kind"].as_array().expect("kinds");
    assert_eq!(
        (kinds.len(), s["chart"].as_array().map(Vec::len)),
        (points.len(), Some(triangles.len()))
    );
    assert!(
        kinds.contains(&json!("box"))
            && kinds.contains(&json!("contracted"))
            && kinds.contains(&json!("ordinary"))
    );
    for (i, t) in triangles.iter().enumerate() {
        let [a, b] = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            [s["chart"][i].as_u64().expect("a chart") as usize]
            .into();
        for (k, &n) in t.iter().enumerate() {
            let [u, v] = [0, 1].map(|c| s["corners"][i][k][c].as_f64().expect("a number"));
            let [x, y, w] = [a * u, b * v, 1.0 - u - v];
            let pole = w * w - x * x - y * y;
            let image = [2.0 * x * w, 2.0 * y * w, w * w + x * x + y * y].map(|v| v / pole);
            let off = (0..3)
                .map(|c| (image[c] - points[n][c]).abs())
                .fold(0.0, f64::max);
            assert!(
                off < 1e-9 || kinds[n] == "contracted",
                "{off}: {image:?} {:?}",
                points[n]
            );
        }
    }
}

#[test]
fn a_document_says_all_that_is_known() {
    let f = Folder::new("triangulate-document");
    let (exit, j) = triangulate(
        &f.map(HYPERBOLOID),
        &["--box", "3", "--tol", "0.1", "-o", &f.path("m.stl")],
    );
    assert_eq!(
        (exit, &j["ok"], &j["schema"], &j["verb"]),
        (0, &json!(true), &json!(1), &json!("triangulate")),
        "{j}"
    );
    assert_eq!(
        (&j["box"], &j["mode"], &j["tolerance"], &j["longest"]),
        (&json!("3"), &json!("glued"), &json!(0.1), &json!(0.75))
    );
    let expected =
        json!({"euler": 2, "components": 2, "boundary_loops": 2, "edges_of_more_than_two": 0});
    assert_eq!(
        (&j["topology"], &j["surface_degree"], &j["map"]["degree"]),
        (&expected, &json!(2), &json!(2))
    );
    assert_eq!(
        j["pole_components"],
        json!({"ovals": 1, "pseudolines": 0, "singular": 0, "isolated": 0})
    );
    assert_eq!(
        (&j["files"][0]["format"], &j["report"]),
        (&json!("stl"), &Value::Null)
    );
    assert!(j["counts"]["triangles"].as_u64() > Some(100) && j["seconds"]["write"].is_number());
}

#[test]
fn maps_that_cover_the_surface_twice_say_so() {
    let f = Folder::new("triangulate-improper");
    let map = f.map(TWICE);
    let (exit, j) = triangulate(&map, &["--box", "1", "--tol", "0.1"]);
    assert_eq!(exit, 0, "{j}");
    assert_eq!(
        [&j["map_degree"], &j["improper"], &j["parameters_drawn"]],
        [&json!(2), &json!(true), &json!(1)]
    );
    // Two of the three parameters of a cube are complex, which is not looked for.
    let cubes = f.file(
        "cubes.json",
        r#"{"X": "s^3", "Y": "t", "Z": "t^2", "W": "1"}"#,
    );
    let (exit, j) = triangulate(
        &cubes,
        &["--box", "1", "--tol", "0.1", "--mode", "normalised"],
    );
    assert_eq!((exit, &j["parameters_drawn"]), (3, &json!(3)), "{j}");
    let o = isoform(&["triangulate", &map, "--box", "1", "--tol", "0.1"]);
    assert!(
        stdout(&o).contains("improper: 2 parameters for each point"),
        "{}",
        stdout(&o)
    );
}

/// The border of the real image is told, and the other half of the paraboloid is drawn if it is
/// asked for: x has both signs then, and a part for each.
#[test]
fn the_real_image_ends() {
    let f = Folder::new("triangulate-real-border");
    let map = f.map(TWICE);
    let run = |more: &[&str]| {
        let args = [
            "triangulate",
            &map,
            "--box",
            "1",
            "--tol",
            "0.01",
            "--force",
            "-o",
        ];
        let o = isoform(
            &[
                &args[..],
                &[&f.path("m.obj"), "--report", &f.path("r.json")],
                more,
            ]
            .concat(),
        );
        assert_eq!(code(&o), 0, "{}", stderr(&o));
        assert!(
            stderr(&o).contains("the real image ends along 1 line, at s = 0"),
            "{}",
            stderr(&o)
        );
        let text = String::from_utf8(f.bytes("m.obj")).expect("text");
        let parts = text.lines().filter(|l| l.starts_with("g ")).count();
        let xs = obj(text.as_bytes())
            .0
            .iter()
            .map(|p| p[0])
            .collect::<Vec<f64>>();
        (parts, xs.iter().copied().fold(f64::INFINITY, f64::min))
    };
    assert_eq!(run(&[]), (0, 0.0));
    let report = f.json("r.json");
    assert_eq!(report["real_border"]["folds"], json!(["s"]));
    assert_eq!(report["real_border"]["complex_dimension"], 2);
    let (parts, least) = run(&["--complex"]);
    assert!(parts == 2 && (least + 1.0).abs() < 1e-9, "{parts} {least}");
}

/// A cap and a span that is a line: the cap is drawn, and the span is named.
#[test]
fn spans_without_area_are_left_out() {
    let f = Folder::new("triangulate-collapsed");
    let nurbs = r#"{"degree": [1, 1], "knots_u": [0, 0, 1, 2, 2], "knots_v": [0, 0, 1, 1],
        "points": [[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]], [[1, 0, 0], [1, 1, 0]]]}"#;
    let o = isoform(&["triangulate", &f.map(nurbs), "--json"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    assert!(
        stderr(&o).contains("left out, since their image is a curve"),
        "{}",
        stderr(&o)
    );
    let j: Value = serde_json::from_str(&stdout(&o)).expect("JSON");
    assert_eq!(j["collapsed_patches"], json!([1]));
    assert_eq!(j["topology"]["euler"], 1);
}

/// Files that can be read again have the triangles of a sphere outward.
#[test]
fn all_formats_are_wound() {
    let f = Folder::new("triangulate-winding");
    let map = f.map(SPHERE);
    for name in ["m.ply", "m.obj", "m.stl", "m.off", "m.3mf", "m.msh"] {
        let (exit, j) = triangulate(&map, &["--box", "2", "--tol", "0.02", "-o", &f.path(name)]);
        assert_eq!(
            (exit, &j["winding"]["oriented"]),
            (0, &json!(true)),
            "{name}"
        );
        let msh = f.path("again.msh");
        let o = isoform(&["convert", &f.path(name), "-o", &msh, "--force"]);
        assert_eq!(code(&o), 0, "{name}: {}", stderr(&o));
        let o = isoform(&["inspect", &msh, "--json"]);
        let j: Value = serde_json::from_str(&stdout(&o)).expect("JSON");
        let [oriented, volume] = ["oriented", "volume"].map(|key| found(&j, key).cloned());
        assert_eq!(oriented, Some(json!(true)), "{name}");
        let volume = volume.and_then(|v| v.as_f64()).expect("a volume");
        assert!((volume / 4.18879 - 1.0).abs() < 0.05, "{name}: {volume}");
    }
}

/// The first value of a key at any depth.
fn found<'a>(json: &'a Value, key: &str) -> Option<&'a Value> {
    let object = json.as_object()?;
    object
        .get(key)
        .or_else(|| object.values().find_map(|v| found(v, key)))
}

#[test]
fn boxes_are_exact() {
    let f = Folder::new("triangulate-box");
    let map = f.map(SPHERE);
    for (given, exact) in [("3/2", "3/2"), ("0.1", "1/10"), ("1.50", "3/2")] {
        let (exit, j) = triangulate(&map, &["--box", given, "--tol", "0.1"]);
        if given == "0.1" {
            // Within the ball: nothing of the sphere.
            assert_eq!((exit, &j["error"]["code"]), (4, &json!("empty")), "{j}");
        } else {
            assert_eq!((exit, &j["box"]), (0, &json!(exact)), "{j}");
        }
    }
}

#[test]
fn invalid_maps_are_refused_with_a_reason() {
    let f = Folder::new("triangulate-invalid");
    let cases = [
        (
            r#"{"X":"s","Y":"s^2","Z":"s^3","W":"1"}"#,
            "not_a_surface",
            "",
        ),
        (
            r#"{"X":"2*s+2*t","Y":"s+t","Z":"3*s+3*t","W":"s+t"}"#,
            "not_a_surface",
            "",
        ),
        (r#"{"X":"0","Y":"0","Z":"0","W":"0"}"#, "all_zero", ""),
        (
            r#"{"X":"s","Y":"t","Z":"s*t","W":"0"}"#,
            "zero_denominator",
            "W",
        ),
        (
            r#"{"X":"1/s","Y":"t","Z":"s*t","W":"1"}"#,
            "not_a_polynomial",
            "X",
        ),
        (
            r#"{"X":"s+q","Y":"t","Z":"s*t","W":"1"}"#,
            "unknown_variable",
            "X",
        ),
        (
            r#"{"X":"s","Y":"t","Z":"nan","W":"1"}"#,
            "unknown_variable",
            "Z",
        ),
        (r#"{"X":"s","Y":"t","Z":"s*t"}"#, "missing", "W"),
        (r#"{"X":"s","Y":"#, "not_json", ""),
        ("", "not_json", ""),
    ];
    for (text, expected, key) in cases {
        let map = f.map(text);
        let more = [
            "--box",
            "2",
            "-o",
            &f.path("m.obj"),
            "--report",
            &f.path("r.json"),
            "--sidecar",
            &f.path("s.json"),
        ];
        let (exit, j) = triangulate(&map, &more);
        assert_eq!(
            (exit, &j["ok"], &j["error"]["code"]),
            (2, &json!(false), &json!(expected)),
            "{text}: {j}"
        );
        assert_eq!(
            (
                &j["error"]["where"]["file"],
                j["error"]["where"]["key"].as_str().unwrap_or_default()
            ),
            (&json!(map), key),
            "{j}"
        );
        assert!(
            ["message", "hint"]
                .iter()
                .all(|k| j["error"][k].as_str().is_some_and(|t| !t.is_empty())),
            "{j}"
        );
        assert!(
            !f.is_there("m.obj") && !f.is_there("r.json") && !f.is_there("s.json"),
            "nothing is written"
        );
    }
    let (_, j) = triangulate(&f.map("{\"X\": \"s\",\n \"Y\" 2}"), &["--box", "2"]);
    assert_eq!(
        (&j["error"]["where"]["line"], &j["error"]["code"]),
        (&json!(2), &json!("not_json")),
        "{j}"
    );
    let (exit, j) = triangulate(&f.path("absent.json"), &["--box", "2"]);
    assert_eq!((exit, &j["error"]["code"]), (2, &json!("file")), "{j}");
}

#[test]
fn common_factors_are_refused_or_removed() {
    let f = Folder::new("triangulate-factor");
    let map =
        f.map(r#"{"X": "s*(s - t)", "Y": "t*(s - t)", "Z": "(s + t)*(s - t)", "W": "s - t"}"#);
    let (exit, j) = triangulate(&map, &["--box", "1"]);
    assert_eq!(
        (exit, &j["error"]["code"]),
        (2, &json!("common_factor")),
        "{j}"
    );
    assert!(
        j["error"]["hint"]
            .as_str()
            .is_some_and(|h| h.contains("--reduce")),
        "{j}"
    );
    let (exit, j) = triangulate(&map, &["--box", "1", "--reduce", "--tol", "0.1"]);
    assert!(
        (exit == 0 || exit == 3) && j["map"]["removed"] == "s - t" && j["map"]["degree"] == 1,
        "{j}"
    );
}

#[test]
fn bad_options_are_refused() {
    let f = Folder::new("triangulate-bad");
    let map = f.map(SPHERE);
    let bad: [&[&str]; 11] = [
        &["--box", "0"],
        &["--box", "-1"],
        &["--box", "two"],
        &["--box", "1/0"],
        &["--box", "2", "--tol", "0"],
        &["--box", "2", "--tol", "nan"],
        &["--box", "2", "--mode", "both"],
        &["--box", "2", "-o", "m.xyz"],
        &["--box", "2", "-o", "-"],
        &["--box", "2", "--report", "-"],
        &["--box", "2", "--triangles", "0"],
    ];
    for more in bad {
        let (exit, j) = triangulate(&map, more);
        assert_eq!(
            (exit, &j["ok"], &j["error"]["code"]),
            (1, &json!(false), &json!("usage")),
            "{more:?}: {j}"
        );
    }
    let (exit, j) = triangulate(&map, &["--box", "2", "--sidecar", &f.path("absent/s.json")]);
    assert_eq!(
        (exit, &j["error"]["code"]),
        (2, &json!("not-writable")),
        "{j}"
    );
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let f = Folder::new("triangulate-threads");
    let map = f.map(HYPERBOLOID);
    let mut seen: BTreeMap<String, Vec<Vec<u8>>> = BTreeMap::new();
    for threads in ["1", "2"] {
        let names = ["m.obj", "r.json", "s.json", "d.svg"].map(|n| f.path(n));
        let more = [
            "--box",
            "3",
            "--tol",
            "0.05",
            "-o",
            &names[0],
            "--report",
            &names[1],
            "--sidecar",
            &names[2],
            "--domain",
            &names[3],
        ];
        let (exit, _) = triangulate(&map, &[&more[..], &["--threads", threads]].concat());
        assert_eq!(exit, 0);
        for name in ["m.obj", "s.json", "d.svg"] {
            seen.entry(name.to_owned()).or_default().push(f.bytes(name));
        }
        let mut r = f.json("r.json");
        r.as_object_mut().expect("an object").remove("seconds");
        seen.entry("r.json".to_owned())
            .or_default()
            .push(r.to_string().into_bytes());
    }
    for (name, bytes) in seen {
        assert!(bytes[0] == bytes[1], "{name}");
    }
}

/// A curve whose real components are contracted to two points is one curve.
#[test]
fn a_contracted_curve_is_named_once() {
    let f = Folder::new("triangulate-contracted");
    let map = f.map(r#"{"X": "s", "Y": "s^2 - 2", "Z": "t*(s^2 - 2)", "W": "1"}"#);
    let o = isoform(&[
        "triangulate",
        &map,
        "--box",
        "2",
        "--tol",
        "0.1",
        "--mode",
        "normalised",
        "-o",
        &f.path("m.obj"),
    ]);
    let text = stdout(&o);
    let line = "s^2 - 2*w^2 = 0 to (-1.4142135623730951, 0, 0) and (1.4142135623730951, 0, 0)\n";
    assert_eq!(text.matches("s^2 - 2*w^2 = 0").count(), 1, "{text}");
    assert!(text.contains(line), "{text}");
}

/// Where there is no triangle it is said where the surface is.
#[test]
fn a_surface_outside_of_the_box() {
    let f = Folder::new("triangulate-outside");
    let map =
        f.map(r#"{"X": "20*s", "Y": "20*t", "Z": "10*s^2 + 10*t^2 - 10", "W": "s^2 + t^2 + 1"}"#);
    let o = isoform(&["triangulate", &map, "--box", "3/2", "-o", &f.path("m.obj")]);
    assert_eq!(code(&o), 4);
    let said = stderr(&o);
    assert!(said.contains("x, y and z between -3/2 and 3/2"), "{said}");
    assert!(said.contains("all of the surface is farther out"), "{said}");
    assert!(!f.is_there("m.obj"));
}

#[test]
fn a_time_limit_ends_it() {
    let f = Folder::new("triangulate-time");
    // Degree 8, dense: the exact part alone lasts longer.
    let dense = |k: i32| {
        let term = |i: i32, j: i32| {
            format!(
                "{}*s^{i}*t^{j}",
                (7 * i + 5 * j * k + 3 * k * k + i * j) % 19 - 9
            )
        };
        (0..=8)
            .flat_map(|i| (0..=8 - i).map(move |j| term(i, j)))
            .collect::<Vec<_>>()
            .join(" + ")
    };
    let map = json!({"X": dense(1), "Y": dense(2), "Z": dense(3), "W": dense(5)}).to_string();
    for (text, limit) in [(SPHERE, "0.001s"), (&map, "0.001s"), (&map, "1s")] {
        let started = std::time::Instant::now();
        let (exit, j) = triangulate(
            &f.map(text),
            &["--box", "2", "--time-limit", limit, "-o", &f.path("m.obj")],
        );
        assert!(started.elapsed().as_secs() < 30, "{:?}", started.elapsed());
        match exit {
            3 => assert!(
                j["certified"] == false && j["unproven"].as_array().is_some_and(|u| !u.is_empty()),
                "{j}"
            ),
            _ => assert_eq!(
                (exit, &j["ok"], &j["error"]["code"]),
                (4, &json!(false), &json!("time-limit")),
                "{j}"
            ),
        }
        assert_eq!(f.is_there("m.obj"), exit == 3);
        let _ = fs::remove_file(f.path("m.obj"));
    }
}
