//! `triangulate` over a part of the parameters, with patches and NURBS surfaces, and the example
//! surfaces.

use crate::common::*;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fs;

const PLANE: &str = r#"{"X": "s", "Y": "t", "Z": "0", "W": "1"}"#;

/// Points and triangles of an OBJ.
fn obj(f: &Folder, name: &str) -> (Vec<[f64; 3]>, Vec<[usize; 3]>) {
    let text = fs::read_to_string(f.0.join(name)).expect("a file");
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        match words[0] {
            "v" => points.push([1, 2, 3].map(|k| words[k].parse().expect("a number"))),
            "f" => {
                triangles.push([1, 2, 3].map(|k| words[k].parse::<usize>().expect("an index") - 1))
            }
            _ => {}
        }
    }
    (points, triangles)
}

fn area((points, triangles): &(Vec<[f64; 3]>, Vec<[usize; 3]>)) -> f64 {
    let of = |t: &[usize; 3]| {
        let [a, b, c] = t.map(|v| points[v]);
        let [u, v]: [[f64; 3]; 2] = [b, c].map(|x| std::array::from_fn(|i| x[i] - a[i]));
        let n = [
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        ];
        0.5 * n.iter().map(|x| x * x).sum::<f64>().sqrt()
    };
    triangles.iter().map(of).sum()
}

#[test]
fn rectangles_and_polygons() {
    let f = Folder::new("domains-regions");
    let map = f.file("plane.json", PLANE);
    let out = f.path("m.obj");
    // Decimals and fractions, ends in either order; the box is found from bounds of the surface.
    let (exit, j) = triangulate(
        &map,
        &[
            "--rectangle",
            "-0.5,3/2,1,-1",
            "-o",
            &out,
            "--sidecar",
            &f.path("s.json"),
        ],
    );
    assert_eq!(
        (exit, &j["box"], &j["box_chosen"]),
        (0, &json!("8/5"), &json!(true)),
        "{j}"
    );
    assert_eq!(
        j["region"],
        json!([["-1/2", "-1"], ["3/2", "-1"], ["3/2", "1"], ["-1/2", "1"]])
    );
    assert_eq!(
        j["topology"],
        json!({"euler": 1, "components": 1, "boundary_loops": 1, "edges_of_more_than_two": 0})
    );
    assert!((area(&obj(&f, "m.obj")) - 4.0).abs() < 1e-12);
    let s: Value =
        serde_json::from_slice(&fs::read(f.path("s.json")).expect("a file")).expect("JSON");
    assert!(
        s["kind"]
            .as_array()
            .is_some_and(|k| k.contains(&json!("border")))
    );
    let (exit, _) = triangulate(
        &map,
        &[
            "--polygon",
            "0,0 4,0 4,1 1,1 1,4 0,4",
            "--box",
            "2",
            "-o",
            &out,
        ],
    );
    assert!(
        exit == 0 && (area(&obj(&f, "m.obj")) - 3.0).abs() < 1e-12,
        "an L, cut by the box"
    );
    let o = isoform(&["triangulate", &map, "--polygon", "0,0 2,0 1,1"]);
    assert!(
        code(&o) == 0
            && stdout(&o).contains("region       (0, 0) (2, 0) (1, 1)")
            && stdout(&o).contains("chosen"),
        "{}",
        stdout(&o)
    );
    // Nothing of the region in the box.
    let sphere = f.file("sphere.json", SPHERE);
    let (exit, j) = triangulate(&sphere, &["--rectangle", "2,3,2,3", "--box", "1/2"]);
    assert_eq!((exit, &j["error"]["code"]), (4, &json!("empty")), "{j}");
}

#[test]
fn bad_regions_are_refused() {
    let f = Folder::new("domains-bad");
    let map = f.file("map.json", SPHERE);
    let patches = f.file(
        "patches.json",
        json!({"patches": [bilinear([[0.0, 0.0], [1.0, 1.0]])]}).to_string(),
    );
    for (file, more, words) in [
        (&map, &["--rectangle", "0,1,0"][..], "four numbers"),
        (
            &map,
            &["--rectangle", "0,1,0,x"],
            "a decimal number or a fraction",
        ),
        (&map, &["--rectangle", "0,1,2,2"], "no area"),
        (&map, &["--polygon", "0,0 1,1"], "too few"),
        (&map, &["--polygon", ""], "too few"),
        (&map, &["--polygon", "0,0 1,1 2,2"], "no area"),
        (&map, &["--polygon", "0,0 2,2 2,0 0,2"], "sides 1 and 3"),
        (&map, &["--polygon", "0,0 2 2,0"], "s,t is expected"),
        (
            &map,
            &["--rectangle", "0,1,0,1", "--polygon", "0,0 1,0 0,1"],
            "cannot be used with",
        ),
        (
            &patches,
            &["--rectangle", "0,1,0,1"],
            "their own parameters",
        ),
    ] {
        let (exit, j) = triangulate(file, more);
        assert_eq!(
            (exit, &j["error"]["code"]),
            (1, &json!("usage")),
            "{more:?}: {j}"
        );
        assert!(j.to_string().contains(words), "{more:?}: {j}");
    }
    // The pole goes through the region: no box can be chosen.
    let pole = f.file(
        "pole.json",
        r#"{"X": "s^2", "Y": "s*t", "Z": "1", "W": "s"}"#,
    );
    let (exit, j) = triangulate(&pole, &["--rectangle", "-1,1,0,1"]);
    assert!(
        exit == 1 && j["error"]["message"] == "--box is needed",
        "{j}"
    );
    let (exit, j) = triangulate(
        &pole,
        &["--rectangle", "-1,1,0,1", "--box", "4", "--tol", "0.02"],
    );
    assert_eq!(
        (exit, &j["topology"]["components"], &j["topology"]["euler"]),
        (0, &json!(2), &json!(2)),
        "{j}"
    );
}

/// A bilinear patch over two corners of a square.
fn bilinear([[x0, y0], [x1, y1]]: [[f64; 2]; 2]) -> Value {
    let c = |x: f64, y: f64| json!([x, y, x * y, 1.0]);
    json!({"degree": [1, 1], "control": [[c(x0, y0), c(x0, y1)], [c(x1, y0), c(x1, y1)]], "max_distance": 0.0, "certified": true})
}

/// Four patches of one saddle: borders are shared, and the last one is written the other way
/// around.
#[test]
fn patches_are_joined_along_their_sides() {
    let f = Folder::new("domains-patches");
    let mut list = vec![];
    for (x, y) in [(-1.0, -1.0), (0.0, -1.0), (-1.0, 0.0)] {
        list.push(bilinear([[x, y], [x + 1.0, y + 1.0]]));
    }
    list.push(bilinear([[1.0, 0.0], [0.0, 1.0]]));
    let map = f.file("p.json", json!({"schema": 1, "patches": list}).to_string());
    let out = f.path("m.obj");
    let (exit, j) = triangulate(
        &map,
        &["--tol", "1e-3", "-o", &out, "--sidecar", &f.path("s.json")],
    );
    assert_eq!(
        (exit, &j["mode"], &j["patches"]),
        (0, &json!("normalised"), &json!(4)),
        "{j}"
    );
    assert_eq!(
        j["topology"],
        json!({"euler": 1, "components": 1, "boundary_loops": 1, "edges_of_more_than_two": 0})
    );
    let s: Value =
        serde_json::from_slice(&fs::read(f.path("s.json")).expect("a file")).expect("JSON");
    let parts: Vec<u64> = s["patch"]
        .as_array()
        .expect("patches")
        .iter()
        .filter_map(Value::as_u64)
        .collect();
    let mesh = obj(&f, "m.obj");
    assert!(parts.len() == mesh.1.len() && (0..4).all(|k| parts.contains(&k)) && parts.is_sorted());
    assert!(mesh.0.iter().all(|p| (p[0] * p[1] - p[2]).abs() < 1e-15));
    let groups = fs::read_to_string(&out).expect("a file");
    assert!(
        groups.contains("patch_1") || groups.contains("patch 1"),
        "parts have names"
    );
}

const CIRCLE: [[f64; 2]; 9] = [
    [1.0, 0.0],
    [1.0, 1.0],
    [0.0, 1.0],
    [-1.0, 1.0],
    [-1.0, 0.0],
    [-1.0, -1.0],
    [0.0, -1.0],
    [1.0, -1.0],
    [1.0, 0.0],
];

fn weight(k: usize) -> f64 {
    if k % 2 == 1 { 0.5f64.sqrt() } else { 1.0 }
}

/// A profile turned around the z axis, quadratic in both directions.
fn turned(profile: &[[f64; 2]], knots: &[f64]) -> Value {
    let points: Vec<Vec<[f64; 3]>> = CIRCLE
        .iter()
        .map(|d| {
            profile
                .iter()
                .map(|c| [c[0] * d[0], c[0] * d[1], c[1]])
                .collect()
        })
        .collect();
    let weights: Vec<Vec<f64>> = (0..9)
        .map(|i| (0..profile.len()).map(|j| weight(i) * weight(j)).collect())
        .collect();
    let around = [
        0.0, 0.0, 0.0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1.0, 1.0, 1.0,
    ];
    json!({"degree": [2, 2], "knots_u": around, "knots_v": knots, "points": points, "weights": weights})
}

/// A torus is closed, and so is a sphere with two sides of patches contracted to each pole; areas
/// are of second order in the size.
#[test]
fn closed_nurbs_surfaces() {
    let f = Folder::new("domains-nurbs");
    let tube = CIRCLE.map(|c| [3.0 + c[0], c[1]]);
    let torus = turned(
        &tube,
        &[
            0.0, 0.0, 0.0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1.0, 1.0, 1.0,
        ],
    );
    let half = [[0.0, -1.0], [1.0, -1.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let sphere = json!({"nurbs": [turned(&half, &[0.0, 0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.0])]});
    for (surface, patches, euler, exact) in
        [(torus, 16, 0, 12.0 * PI * PI), (sphere, 8, 2, 4.0 * PI)]
    {
        let map = f.file("n.json", surface.to_string());
        let errors = ["0.004", "0.001"].map(|tol| {
            let (exit, j) = triangulate(&map, &["--tol", tol, "-o", &f.path("m.obj")]);
            assert_eq!((exit, &j["patches"], &j["certified"]), (0, &json!(patches), &json!(true)), "{j}");
            let closed = json!({"euler": euler, "components": 1, "boundary_loops": 0, "edges_of_more_than_two": 0});
            assert_eq!(j["topology"], closed, "{}", j["unproven"]);
            (area(&obj(&f, "m.obj")) / exact - 1.0).abs()
        });
        assert!(
            errors[0] < 5e-3 && errors[1] < 0.4 * errors[0],
            "{errors:?}"
        );
    }
}

/// Weights of both signs: a pole inside, two components; and two patches that share a side which
/// the pole crosses.
#[test]
fn patches_with_poles() {
    let f = Folder::new("domains-poles");
    // (s : t : 1) over w = 1 - 2s.
    let control = json!([[[0, 0, 1, 1], [0, 1, 1, 1]], [[1, 0, 1, -1], [1, 1, 1, -1]]]);
    let one = json!({"patches": [{"degree": [1, 1], "control": control}]});
    let map = f.file("p.json", one.to_string());
    let (exit, j) = triangulate(&map, &[]);
    assert!(
        exit == 1 && j["error"]["message"] == "--box is needed",
        "{j}"
    );
    let (exit, j) = triangulate(&map, &["--box", "4", "--tol", "0.02"]);
    assert_eq!(
        (exit, &j["topology"]["components"], &j["topology"]["euler"]),
        (0, &json!(2), &json!(2)),
        "{j}"
    );
    let control = json!([[[0, 1, 1, 1], [0, 2, 1, 1]], [[1, 1, 1, -1], [1, 2, 1, -1]]]);
    let mut two = one;
    two["patches"]
        .as_array_mut()
        .expect("a list")
        .push(json!({"degree": [1, 1], "control": control}));
    let map = f.file("p.json", two.to_string());
    let (exit, j) = triangulate(&map, &["--box", "4", "--tol", "0.02"]);
    let counts =
        json!({"euler": 2, "components": 2, "boundary_loops": 2, "edges_of_more_than_two": 0});
    assert_eq!((exit, &j["topology"]), (0, &counts), "{j}");
}

#[test]
fn bad_patches_are_refused() {
    let f = Folder::new("domains-bad-patches");
    let flat = json!([[[0, 0, 0, 1], [0, 0, 0, 1]], [[1, 0, 0, 1], [1, 0, 0, 1]]]);
    for (text, expected) in [
        (json!({"patches": [{"degree": [1, 1]}]}), "not_patches"),
        (json!({"patches": []}), "not_patches"),
        (
            json!({"nurbs": [{"degree": [1, 1], "knots_u": [0, 1], "points": [[[0, 0, 0]]]}]}),
            "not_patches",
        ),
        (
            json!({"patches": [{"degree": [1, 1], "control": flat}]}),
            "not_a_surface",
        ),
    ] {
        let map = f.file("p.json", text.to_string());
        let (exit, j) = triangulate(&map, &["--box", "2", "-o", &f.path("m.obj")]);
        assert_eq!(
            (exit, &j["error"]["code"]),
            (2, &json!(expected)),
            "{text}: {j}"
        );
        assert!(!f.0.join("m.obj").exists());
    }
}

/// Every example is certified at a coarse tolerance, has a line on what to see, and is in the list
/// of them.
#[test]
fn example_surfaces() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/surfaces");
    let list = fs::read_to_string(folder.join("README.md")).expect("a list");
    let mut euler = BTreeMap::new();
    for entry in fs::read_dir(&folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path
            .file_stem()
            .expect("a name")
            .to_string_lossy()
            .into_owned();
        if path.extension().is_none_or(|e| e != "json") {
            continue;
        }
        let known: Value = serde_json::from_slice(&fs::read(&path).expect("a file")).expect("JSON");
        let (half_width, note) = (
            known["box"].as_str().expect("a box"),
            known["note"].as_str().expect("a note"),
        );
        assert!(
            list.contains(&format!("| [{name}]({name}.json) | {note} |")),
            "{name} is not in the list"
        );
        let tolerance = (0.01 * half_width.parse::<f64>().expect("a number")).to_string();
        let (exit, j) = triangulate(
            &path.display().to_string(),
            &["--box", half_width, "--tol", &tolerance],
        );
        assert_eq!(exit, 0, "{name}: {}", j["unproven"]);
        euler.insert(name, j["topology"]["euler"].as_i64().expect("a number"));
    }
    // Known from topology. The image of a closed surface has the Euler number of the surface, one
    // more for each triple point and one half for each pinch point (S. Izumiya, W. L. Marar, 1993):
    // the projective plane's is 1.
    let images = [
        ("cross-cap", 1 + 2 / 2),
        ("roman", 1 + 1 + 6 / 2),
        ("boy", 1 + 1),
    ];
    for (name, known) in [("stereographic-sphere", 2), ("torus", 0), ("cyclide", 0)]
        .into_iter()
        .chain(images)
    {
        assert_eq!(euler.get(name), Some(&known), "{name}");
    }
    assert!(euler.len() >= 20);
}
