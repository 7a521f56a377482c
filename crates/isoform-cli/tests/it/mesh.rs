//! `mesh`, and meshes in `recover`, `compare`, `inspect` and `convert`, as a user runs them.

use crate::common::*;
use serde_json::Value;
use std::fs;

/// A program with `c` at the origin.
fn program(body: &str) -> String {
    format!(
        "my_model(x[3], a[1]) {{ array c[3], k[3]; c = [0, 0, 0]; k = [-1, -1, -1]; {body} }}\n"
    )
}
const BALL: &str = "my_model = hfSphere(x, c, 1);";
const CUBE: &str = "cube = hfBlock(x, k, 2, 2, 2); my_model = cube;";
/// A cube with a round hole: eight edges of the cube uncut, four cut in two, two circles.
const HOLED: &str =
    "cube = hfBlock(x, k, 2, 2, 2); hole = hfCylinderZ(x, c, 0.5); my_model = cube \\ hole;";

impl Folder {
    fn program(&self, body: &str) -> String {
        self.file("model.hf", program(body))
    }
}

/// Runs `mesh MODEL ... --json`; the code and the document.
fn mesh(model: &str, more: &[&str]) -> (i32, Value) {
    let o = isoform(&[&["mesh", model, "--json", "-q"], more].concat());
    (code(&o), document(&o))
}

#[test]
fn help_has_an_example() {
    let help = isoform(&["mesh", "--help"]);
    assert!(
        code(&help) == 0 && stdout(&help).contains("isoform mesh part.hf --size 0.25 -o part.msh")
    );
}

#[test]
fn a_document_says_all_that_is_known() {
    let f = Folder::new("mesh-document");
    let (exit, j) = mesh(
        &f.program(HOLED),
        &[
            "--size",
            "0.4",
            "-o",
            &f.path("m.msh"),
            "-o",
            &f.path("m.inp"),
        ],
    );
    assert_eq!(
        (exit, &j["ok"], &j["schema"], &j["verb"]),
        (0, &Value::Bool(true), &1.into(), &"mesh".into()),
        "{j}"
    );
    let parts: Vec<(u64, &str)> = j["parts"]
        .as_array()
        .expect("parts")
        .iter()
        .map(|p| {
            (
                p["tag"].as_u64().expect("a tag"),
                p["name"].as_str().expect("a name"),
            )
        })
        .collect();
    assert_eq!(parts.len(), 7, "{parts:?}");
    assert!(
        parts.contains(&(7, "hole")) && parts[0].1.starts_with("cube."),
        "{parts:?}"
    );
    let c = &j["certificate"];
    assert_eq!(
        (&c["closed"], &c["manifold"], &c["oriented"]),
        (&true.into(), &true.into(), &true.into())
    );
    assert_eq!(
        (
            &c["euler"],
            &c["shells"],
            &c["components"],
            &c["self_intersections"]
        ),
        (&0.into(), &1.into(), &1.into(), &0.into())
    );
    let volume = 8.0 - 0.5 * std::f64::consts::PI;
    assert!(
        (c["volume"].as_f64().expect("volume") / volume - 1.0).abs() < 0.02,
        "{c}"
    );
    assert!(c["dihedral_angles"][0].as_f64().expect("an angle") > 12.0);
    assert!(c["distance"]["nodes"]["max"].as_f64().expect("a distance") < 1e-12);
    assert_eq!(
        (&c["features"]["corners"], &j["counts"]["corners"]),
        (&8.into(), &8.into())
    );
    assert!(c["features"]["covered"].as_f64().expect("a share") > 0.999);
    assert!(
        j["counts"]["tets"].as_u64() > Some(100)
            && j["region_certified"] == true
            && j["seconds"]["optimisation"].is_number()
    );
    assert_eq!(j["files"].as_array().map(Vec::len), Some(2));

    let msh = String::from_utf8(f.bytes("m.msh")).expect("text");
    for (tag, name) in &parts {
        assert!(msh.contains(&format!("2 {tag} \"{name}\"")), "{name}");
    }
    let inp = String::from_utf8(f.bytes("m.inp")).expect("text");
    assert_eq!(inp.matches("*SURFACE").count(), 7);
    // The step at the end is an example, in comments.
    assert!(inp.contains("C3D4") && inp.contains("\n***STEP\n") && !inp.contains("\n*STEP"));
    assert!(
        inp.contains("\n**CUBE_X_MIN, 1, 3\n"),
        "the first part is held"
    );

    let q = &c["quality"];
    let figure = |v: &Value| v.as_f64().expect("a figure");
    assert!(figure(&q["aspect_ratio"]["max"]) > figure(&q["aspect_ratio"]["mean"]));
    assert!((0.0..1.0).contains(&figure(&q["scaled_jacobian"]["min"])));
    let worst = q["worst"].as_array().expect("a list");
    assert_eq!(worst.len(), 20, "ten by each of two measures");
    assert_eq!(worst[0]["measure"], "scaled Jacobian");
    assert_eq!(worst[0]["value"], q["scaled_jacobian"]["min"]);
    assert_eq!(worst[10]["value"], q["aspect_ratio"]["max"]);
    assert!(worst[0]["element"].as_u64() >= Some(1));
    // Between the hole and the nearest sides lies half a unit, more than the size.
    let walls = &c["walls"];
    assert!(walls["layers_min"].as_u64() >= Some(1));
    assert!(walls["layers_p5"].as_u64() >= walls["layers_min"].as_u64());
    let facets = c["facets"].as_array().expect("parts");
    let hole = facets
        .iter()
        .find(|f| f["part"] == "hole")
        .expect("the hole");
    assert!((figure(&hole["radius"]) - 0.5).abs() < 1e-9, "{hole}");
    assert!((20.0..120.0).contains(&figure(&hole["angle"])), "{hole}");
    let flat = facets.iter().filter(|f| f["part"] != "hole");
    assert!(flat.clone().count() == 6 && flat.clone().all(|f| f["radius"].is_null()));
}

#[test]
fn a_table_says_it_shortly() {
    let f = Folder::new("mesh-table");
    let o = isoform(&[
        "mesh",
        &f.program(BALL),
        "--size",
        "0.4",
        "-o",
        &f.path("m.obj"),
    ]);
    let text = stdout(&o);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    for word in [
        "tetrahedra",
        "Euler number 2",
        "nowhere",
        "certificate  holds",
        "m.obj (obj); OBJ has no volume elements",
        "quality      aspect ratio at most ",
        "worst        element ",
        "coarsest on ",
    ] {
        assert!(text.contains(word), "{word}: {text}");
    }
    assert!(stderr(&o).contains("optimisation ..."), "phases are told");
}

#[test]
fn sizes_have_a_default() {
    let f = Folder::new("mesh-size");
    let (exit, j) = mesh(
        &f.program("my_model = hfSphere(x, c, 0.01);"),
        &["--surface-only"],
    );
    let size = j["size"].as_f64().expect("a size");
    assert!(exit == 0 && (8e-4..1e-3).contains(&size), "{size}");
    assert!(j["counts"]["tets"] == 0 && j["counts"]["triangles"].as_u64() > Some(1000));
    assert!(j["certificate"]["dihedral_angles"].is_null() && j["certificate"]["euler"] == 2);
}

#[test]
fn second_order_comes_nearer() {
    let f = Folder::new("mesh-order");
    let model = f.program(BALL);
    let off = |more: &[&str]| {
        let (exit, j) = mesh(
            &model,
            &[&["--size", "0.4", "-o", &f.path("m.inp")], more].concat(),
        );
        assert_eq!(exit, 0, "{j}");
        j["certificate"]["distance"]["faces"]["max"]
            .as_f64()
            .expect("a distance")
    };
    assert!(off(&["--order", "2"]) < 0.05 * off(&[]));
    off(&["--order", "2"]);
    assert!(
        String::from_utf8(f.bytes("m.inp"))
            .expect("text")
            .contains("C3D10")
    );
}

#[test]
fn grading_refines() {
    let f = Folder::new("mesh-grade");
    let (exit, j) = mesh(&f.program(BALL), &["--size", "0.5", "--grade", "0.01"]);
    let off = j["certificate"]["distance"]["faces"]["max"]
        .as_f64()
        .expect("a distance");
    assert!(exit == 0 && off < 0.0105, "{off}");
}

#[test]
fn a_box_cuts_and_says_so() {
    let f = Folder::new("mesh-box");
    let model = f.program("my_model = 1 - x[1]^2 - x[2]^2;");
    let o = isoform(&[
        "mesh",
        &model,
        "--size",
        "0.4",
        "--box=-2,-2,-1,2,2,1",
        "--json",
    ]);
    let j = document(&o);
    assert_eq!(
        (code(&o), j["caps"].to_string()),
        (0, "[\"cap.z_min\",\"cap.z_max\"]".to_owned()),
        "{j}"
    );
    assert_eq!(j["counts"]["parts"], 3);
    assert!(
        stderr(&o).contains("the box cuts the solid"),
        "{}",
        stderr(&o)
    );
}

#[test]
fn bad_models_are_refused_with_a_reason() {
    let f = Folder::new("mesh-bad");
    let refused = |body: &str, more: &[&str]| {
        let (exit, j) = mesh(&f.program(body), more);
        (
            exit,
            j["error"]["code"].as_str().unwrap_or_default().to_owned(),
            j["error"]["hint"].as_str().unwrap_or_default().to_owned(),
        )
    };
    let is = |found: (i32, String, String), code: &str, hint: &str| {
        assert!(
            found.0 == 4 && found.1 == code && found.2.contains(hint),
            "{found:?}, not {code}"
        );
    };
    is(
        refused(
            "my_model = hfSphere(x, c, 1) & (x[1] - 3);",
            &["--size", "0.1"],
        ),
        "empty",
        "--params",
    );
    is(
        refused("my_model = 0 - 1 - x[1]^2;", &[]),
        "empty",
        "--params",
    );
    is(
        refused(BALL, &["--box=5,5,5,6,6,6", "--size", "0.1"]),
        "empty",
        "--box",
    );
    is(refused("my_model = 1;", &[]), "unbounded", "sign");
    is(
        refused("my_model = 1 + x[1]^2;", &["--size", "0.5"]),
        "unbounded",
        "--box",
    );
    is(
        refused("my_model = 1 - x[1]^2 - x[2]^2;", &["--size", "0.5"]),
        "unbounded",
        "--box",
    );
    is(refused(BALL, &["--size", "1e-5"]), "memory", "--memory");
    is(
        refused(BALL, &["--size", "0.1", "--memory", "1e-6"]),
        "memory",
        "--size",
    );
    is(
        refused("my_model = hfSphere(x, c, 0.01);", &["--size", "3"]),
        "too-coarse",
        "--size 1.5",
    );
    is(
        refused(BALL, &["--size", "0.05", "--time-limit", "1ms"]),
        "time-limit",
        "--time-limit",
    );
}

#[test]
fn a_function_without_values_inside_is_not_passed_off_as_a_mesh() {
    let f = Folder::new("mesh-nan");
    let (exit, j) = mesh(
        &f.program("my_model = hfSphere(x, c, 2) + 0*sqrt(x[1] + 1);"),
        &["--size", "0.4"],
    );
    assert!((exit == 3 || exit == 4) && j["ok"] == false, "{exit}: {j}");
}

#[test]
fn bad_files_and_usage_are_refused() {
    let f = Folder::new("mesh-usage");
    let model = f.program(BALL);
    for more in [
        &["--size", "0"][..],
        &["--size", "-1"],
        &["--size", "nan"],
        &["--grade", "0"],
        &["--order", "3"],
        &["--box", "1,2,3"],
        &["--angles", "80,100"],
        &["--memory", "0"],
        &["--params", "1,2"],
        &["-o", "x.foo"],
        &["-o", "-"],
        &["-o", &f.path("m.msh"), "--to", "docx"],
    ] {
        let (exit, j) = mesh(&model, more);
        assert!(exit == 1 && j["error"]["code"] == "usage", "{more:?}: {j}");
    }
    let (_, j) = mesh(&model, &["-o", "x.foo"]);
    assert!(
        j["error"]["hint"]
            .as_str()
            .expect("a hint")
            .contains("msh, "),
        "{j}"
    );
    let (exit, j) = mesh(&model, &["--size", "0.5", "-o", &f.path("no/folder.msh")]);
    assert_eq!((exit, &j["error"]["code"]), (2, &"not-writable".into()));
    let (exit, _) = mesh(&f.path("absent.hf"), &[]);
    assert_eq!(exit, 2);
    let (exit, j) = mesh(
        &f.file("flat.hf", "m(x[2], a[1]) { m = 1 - x[1]^2 - x[2]^2; }"),
        &[],
    );
    assert_eq!((exit, &j["error"]["code"]), (2, &"dimension".into()));
}

#[test]
fn angles_that_are_asked_for_are_required() {
    let f = Folder::new("mesh-angles");
    let out = f.path("m.msh");
    let (exit, j) = mesh(
        &f.program(BALL),
        &["--size", "0.5", "--angles", "60,90", "-o", &out],
    );
    assert_eq!((exit, &j["ok"]), (3, &false.into()));
    let codes: Vec<&Value> = j["certificate"]["failures"]
        .as_array()
        .expect("failures")
        .iter()
        .map(|f| &f["code"])
        .collect();
    assert!(codes.contains(&&"small-dihedral-angle".into()), "{codes:?}");
    assert!(
        !f.bytes("m.msh").is_empty(),
        "files are written all the same"
    );
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let f = Folder::new("mesh-threads");
    let model = f.program(HOLED);
    let run = |threads: &str| {
        let name = format!("{threads}.vtu");
        let (exit, mut j) = mesh(
            &model,
            &["--size", "0.25", "--threads", threads, "-o", &f.path(&name)],
        );
        assert_eq!(exit, 0);
        (j["seconds"], j["files"]) = (Value::Null, Value::Null);
        (f.bytes(&name), j.to_string())
    };
    assert!(run("1") == run("2"));
}

#[test]
fn stdout_takes_a_mesh() {
    let f = Folder::new("mesh-stdout");
    let o = isoform(&[
        "mesh",
        &f.program(CUBE),
        "--size",
        "1",
        "-o",
        "-",
        "--to",
        "off",
        "-q",
    ]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let text = stdout(&o);
    let mut words = text.split_whitespace();
    assert_eq!(words.next(), Some("OFF"));
    let mut number = || -> f64 { words.next().expect("a word").parse().expect("a number") };
    let [vertices, triangles, _] = [(); 3].map(|()| number() as usize);
    let points: Vec<[f64; 3]> = (0..vertices).map(|_| [(); 3].map(|()| number())).collect();
    let mut volume = 0.0;
    for _ in 0..triangles {
        assert_eq!(number(), 3.0);
        let [a, b, c] = [(); 3].map(|()| points[number() as usize]);
        volume += a[0] * (b[1] * c[2] - b[2] * c[1]) / 6.0
            + a[1] * (b[2] * c[0] - b[0] * c[2]) / 6.0
            + a[2] * (b[0] * c[1] - b[1] * c[0]) / 6.0;
    }
    assert_eq!(words.next(), None);
    // Of a closed surface with two triangles at each edge; the cube has no handle.
    assert_eq!(2 * vertices - triangles, 4);
    assert!((volume - 8.0).abs() < 1e-12, "{volume}");
    let is_on_cube = |p: &[f64; 3]| p.iter().fold(0.0, |m: f64, x| m.max(x.abs())) == 1.0;
    assert!(points.iter().all(is_on_cube));
}

#[test]
fn meshes_are_inspected_converted_and_compared() {
    let f = Folder::new("mesh-others");
    let (model, msh, inp) = (f.program(HOLED), f.path("m.msh"), f.path("m.inp"));
    let (exit, made) = mesh(
        &model,
        &[
            "--size",
            "0.4",
            "-o",
            &msh,
            "-o",
            &inp,
            "-o",
            &f.path("m.stl"),
        ],
    );
    assert_eq!(exit, 0);
    let o = isoform(&["inspect", &msh, "--json"]);
    let j = document(&o);
    assert_eq!(
        (code(&o), &j["counts"]["tets"], &j["parts"]),
        (0, &made["counts"]["tets"], &made["parts"]),
        "{j}"
    );
    assert_eq!(
        (&j["certificate"]["euler"], &j["certificate"]["ok"]),
        (&0.into(), &true.into())
    );
    assert!(
        stdout(&isoform(&["inspect", &inp]))
            .to_lowercase()
            .contains("hole (")
    );

    let again = f.path("again.inp");
    assert_eq!(code(&isoform(&["convert", &msh, "-o", &again])), 0);
    assert_eq!(f.bytes("again.inp"), f.bytes("m.inp"));

    let j = document(&isoform(&["compare", &msh, &model, "--json"]));
    let max = |side: &str| j[side]["max"].as_f64().expect("a distance");
    assert_eq!(
        (j["first"]["kind"].as_str(), j["second"]["kind"].as_str()),
        (Some("mesh"), Some("model"))
    );
    let chord = made["certificate"]["distance"]["faces"]["max"]
        .as_f64()
        .expect("a distance");
    assert!(
        max("first_to_second") <= 1.001 * chord && max("first_to_second") > 0.5 * chord,
        "{j}, {chord}"
    );
    assert!(max("second_to_first") < 2.0 * chord, "{j}, {chord}");
    let j = document(&isoform(&["compare", &msh, &f.path("m.stl"), "--json"]));
    assert!(
        j["first_to_second"]["max"].as_f64().expect("a distance") < 1e-6,
        "{j}"
    );
}

#[test]
fn recover_goes_from_points_to_a_mesh_for_a_solver() {
    let f = Folder::new("mesh-recover");
    let template = f.file(
        "t.hf",
        "-- @param a[1] radius length\nmy_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; ball = hfSphere(x, c, a[1]); my_model = ball; }",
    );
    let point = |i: u32| {
        let (t, z) = (f64::from(i) * 2.4, (f64::from(i) + 0.5) / 200.0 - 1.0);
        let s = (1.0 - z * z).sqrt();
        format!(
            "{:?} {:?} {:?}\n",
            2.0 * s * t.cos(),
            2.0 * s * t.sin(),
            2.0 * z
        )
    };
    let scan = f.file("ball.xyz", (0..400).map(point).collect::<String>());
    let o = isoform(&[
        "recover",
        &scan,
        &template,
        "--size",
        "0.5",
        "-o",
        &f.path("part.inp"),
        "-o",
        &f.path("fitted.hf"),
        "--json",
    ]);
    let j = document(&o);
    assert_eq!(
        (code(&o), &j["mesh"]["ok"], &j["mesh"]["counts"]["parts"]),
        (0, &true.into(), &1.into()),
        "{}",
        stderr(&o)
    );
    let outputs = [f.path("fitted.hf"), f.path("part.inp")];
    assert_eq!(j["outputs"], Value::from(outputs.as_slice()));
    let volume = j["mesh"]["certificate"]["volume"]
        .as_f64()
        .expect("a volume");
    assert!((volume / 33.5 - 1.0).abs() < 0.05, "{volume}");
    assert!(
        String::from_utf8(f.bytes("part.inp"))
            .expect("text")
            .contains("*ELEMENT")
    );
    // Without a mesh the fit is still written; the code is that of the mesh.
    let o = isoform(&[
        "recover",
        &scan,
        &template,
        "--size",
        "1e-5",
        "-o",
        &f.path("fine.inp"),
        "-o",
        &f.path("other.hf"),
        "--json",
    ]);
    let j = document(&o);
    assert_eq!(
        (code(&o), &j["mesh"]["error"]["code"], &j["outputs"]),
        (
            4,
            &"memory".into(),
            &Value::from([f.path("other.hf")].as_slice())
        ),
        "{j}"
    );
    let o = isoform(&["fit", &scan, "-t", &template, "-o", &f.path("part.msh")]);
    assert!(
        code(&o) == 1 && stderr(&o).contains("isoform recover"),
        "{}",
        stderr(&o)
    );
}

#[test]
fn sizes_from_files_and_a_mesh_made_better() {
    let f = Folder::new("mesh-sizes");
    let model = f.program(HOLED);
    let tets = |more: &[&str]| {
        let (exit, j) = mesh(&model, more);
        assert_eq!(exit, 0, "{j}");
        j["counts"]["tets"].as_u64().expect("a number")
    };
    let old = f.path("old.msh");
    let plain = tets(&["--size", "0.4", "-o", &old]);
    let table = f.file("sizes.csv", "x,y,z,length\n-1,-1,-1,0.1\n");
    assert!(tets(&["--size", "0.4", "--sizes", &table]) > plain + plain / 10);
    let field = f.file("sizes.hf", "h(x[3], a[1]) { h = 0.15 + 0.1*abs(x[3]); }");
    assert!(tets(&["--size", "0.4", "--sizes", &field]) > 2 * plain);
    let again = tets(&["--adapt", &old]);
    assert!(
        again * 10 > plain * 9 && again * 10 < plain * 11,
        "{again} {plain}"
    );
    let bad = f.file("bad.csv", "1,2,3,0.1\n1,2,3\n");
    let (exit, j) = mesh(&model, &["--sizes", &bad]);
    assert_eq!(
        (exit, &j["error"]["code"], &j["error"]["where"]["line"]),
        (2, &"sizes".into(), &2.into()),
        "{j}"
    );
}

#[test]
fn surfaces_are_adapted() {
    let f = Folder::new("mesh-adapt");
    let model = f.program(HOLED);
    let first = |more: &[&str]| {
        let (exit, j) = mesh(&model, more);
        assert_eq!(exit, 0, "{j}");
        j
    };
    for name in ["old.stl", "old.obj", "old.ply", "old.off", "old.msh"] {
        let old = f.path(name);
        let plain = first(&["--size", "0.4", "--surface-only", "-o", &old]);
        let j = first(&["--adapt", &old, "--size", "0.15", "-o", &f.path("new.obj")]);
        assert_eq!(
            (
                &j["counts"]["parts"],
                &j["counts"]["corners"],
                &j["certificate"]["euler"]
            ),
            (&7.into(), &8.into(), &0.into()),
            "{name}"
        );
        assert!(
            j["counts"]["triangles"].as_u64() > plain["counts"]["triangles"].as_u64()
                && j["counts"]["tets"] == 0,
            "{name}"
        );
        assert!(
            j["certificate"]["features"]["covered"].as_f64() > Some(0.999),
            "{name}"
        );
        assert!(
            j["certificate"]["triangle_angles"][0].as_f64() > Some(25.0),
            "{name}: {}",
            j["certificate"]
        );
    }
    // Without a size it keeps its own.
    let own = first(&["--adapt", &f.path("old.stl"), "--order", "2"]);
    let (n, plain) = (
        own["counts"]["triangles"].as_f64(),
        first(&["--size", "0.4", "--surface-only"])["counts"]["triangles"].as_f64(),
    );
    let share = n.expect("a number") / plain.expect("a number");
    assert!((0.7..1.8).contains(&share) && own["order"] == 2, "{share}");
}

#[test]
fn surfaces_that_cannot_be_adapted() {
    let f = Folder::new("mesh-adapt-bad");
    let model = f.program(HOLED);
    let refused = |name: &str, text: &str| {
        let (exit, j) = mesh(&model, &["--adapt", &f.file(name, text)]);
        assert_eq!((exit, &j["error"]["code"]), (2, &"mesh".into()), "{j}");
        j["error"]["message"]
            .as_str()
            .unwrap_or_default()
            .to_owned()
    };
    let tetrahedron =
        "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n";
    let open = tetrahedron
        .replace("4 4 0", "4 3 0")
        .replace("3 2 0 3\n", "");
    assert!(refused("open.off", &open).contains("not closed"));
    let far = tetrahedron
        .replace("0 0 0", "90 90 90")
        .replace("1 0 0", "91 90 90")
        .replace("0 1 0", "90 91 90")
        .replace("0 0 1", "90 90 91");
    assert!(refused("far.off", &far).contains("near"));
    assert!(
        refused("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n")
            .contains("neither tetrahedra nor triangles")
    );
    // The whole cube: its hole is nowhere in the mesh.
    let cube = f.file("cube.hf", program(CUBE));
    let (exit, _) = mesh(
        &cube,
        &["--size", "0.4", "--surface-only", "-o", &f.path("cube.stl")],
    );
    let (bad, j) = mesh(&model, &["--adapt", &f.path("cube.stl")]);
    assert!(exit == 0 && (bad == 2 || bad == 3), "{bad} {j}");
    assert!(
        bad == 2
            || j["certificate"]["failures"]
                .as_array()
                .is_some_and(|f| !f.is_empty()),
        "{j}"
    );
}

const TWO: &str = "core(x[3], a[1]) { core = a[1]^2 - x[1]^2 - x[2]^2 - x[3]^2; }
    half(x[3], a[1]) { half = x[3]; }
    more(x[3], a[2]) { more = x[1] - a[2]; }
    my_model(x[3], a[1]) { my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2; }";

#[test]
fn regions_have_names_volumes_and_certificates() {
    let folder = Folder::new("mesh-regions");
    let model = folder.file("two.hf", TWO);
    let low = folder.file("low.hf", "low(x[3], a[1]) { low = -x[3] - 0.6; }");
    let regions = format!("core,half,{low}");
    let out = folder.path("ball.inp");
    let more = ["--params", "0.5", "--regions", &regions, "--size", "0.15"];
    let (code, document) = mesh(&model, &[&more[..], &["-o", &out]].concat());
    assert_eq!(code, 0, "{document}");
    let names: Vec<&str> = document["regions"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|r| r["name"].as_str().expect("a name"))
        .collect();
    assert_eq!(names, ["core", "half", "low", "rest"]);
    let ball = 4.0 / 3.0 * std::f64::consts::PI;
    // A cap of a unit ball, 0.4 high.
    let cap = std::f64::consts::PI * 0.16 * 2.6 / 3.0;
    let wanted = [ball / 8.0, ball / 2.0 - ball / 16.0, cap];
    let certificates = document["region_certificates"].as_array().expect("a list");
    for (region, wanted) in certificates.iter().zip(wanted) {
        let volume = region["certificate"]["volume"].as_f64().expect("a number");
        assert!(
            (volume / wanted - 1.0).abs() < 0.04,
            "{}: {volume}",
            region["name"]
        );
        assert_eq!(region["certificate"]["ok"], true);
    }
    let parts = document["parts"].to_string();
    for wall in ["core|half", "core|rest", "half|rest", "low|rest"] {
        assert!(parts.contains(wall), "{wall} in {parts}");
    }
    let deck = fs::read_to_string(&out).expect("a deck");
    for name in ["CORE", "HALF", "LOW", "REST"] {
        assert!(deck.contains(&format!("ELSET={name}\n")), "{name}");
    }
}

#[test]
fn regions_that_cannot_be() {
    let folder = Folder::new("mesh-no-regions");
    let model = folder.file("two.hf", TWO);
    for (more, why) in [
        (vec!["--regions", "cor"], "cor"),
        (
            vec!["--regions", "core,core"],
            "two regions are called core",
        ),
        (
            vec!["--regions", "more"],
            "region more has 2 parameters, my_model has 1",
        ),
        (vec!["--regions", "none.hf"], "none.hf"),
        (
            vec!["--regions", "core", "--surface-only"],
            "cannot be used with",
        ),
        (
            vec!["--regions", "core", "--blocks", "2,1,1"],
            "cannot be used with",
        ),
    ] {
        let run = isoform(&[&["mesh", &model, "--size", "0.3"][..], &more].concat());
        assert!(matches!(code(&run), 1 | 2), "{more:?}");
        assert!(stderr(&run).contains(why), "{more:?}: {}", stderr(&run));
    }
    // Nothing of the ball lies there.
    let far = folder.file("far.hf", "far(x[3], a[1]) { far = x[3] - 5; }");
    let (code, document) = mesh(&model, &["--regions", &far, "--size", "0.3"]);
    assert_eq!(code, 3);
    assert!(
        document["warnings"]
            .to_string()
            .contains("region far has no tetrahedra")
    );
}

/// A bar of two materials along x that goes over the sides of its cell, in a matrix that is said to
/// be everywhere.
const CELL: &str = "bar(x[3], a[1]) { bar = 0.09 - (x[2] - 0.5)^2 - (x[3] - 0.5)^2; }
    ball(x[3], a[1]) { p = 0.16 - (x[2] - 0.5)^2 - (x[3] - 0.5)^2;
        ball = (p - x[1]^2) | (p - (x[1] - 1)^2); }
    cell(x[3], a[1]) { cell = 1; }";

#[test]
fn unit_cells_have_opposite_sides() {
    let folder = Folder::new("mesh-cell");
    let model = folder.file("cell.hf", CELL);
    let (msh, inp) = (folder.path("cell.msh"), folder.path("cell.inp"));
    let more = [
        "--object",
        "cell",
        "--regions",
        "ball,bar",
        "--size",
        "0.12",
    ];
    let within = [
        "--box=0,0,0,1,1,1",
        "--periodic",
        "xyz",
        "-o",
        &msh,
        "-o",
        &inp,
    ];
    let (code, document) = mesh(&model, &[&more[..], &within].concat());
    assert_eq!(code, 0, "{document}");
    let sides = document["certificate"]["opposite"]
        .as_array()
        .expect("a list");
    let axes: Vec<&str> = sides
        .iter()
        .map(|s| s["axis"].as_str().expect("a name"))
        .collect();
    assert_eq!(axes, ["x", "y", "z"]);
    assert!(
        sides
            .iter()
            .all(|s| s["apart"] == 0 && s["nodes"].as_u64() > Some(80))
    );
    // Each link of the file: a line of its entities, one of the map, the count, the nodes.
    let text = fs::read_to_string(&msh).expect("a mesh");
    let (_, links) = text.split_once("$Periodic\n").expect("a section");
    let mut lines = links.lines().skip(1);
    for (axis, side) in sides.iter().enumerate() {
        let map = lines.nth(1).expect("a map");
        let shift: Vec<&str> = map.split(' ').skip(1).collect();
        assert_eq!(
            ["3", "7", "11"].map(|k| shift[k.parse::<usize>().expect("a place")]),
            {
                let mut wanted = ["0.0"; 3];
                wanted[axis] = "1.0";
                wanted
            }
        );
        let count = lines.next().expect("a count").trim();
        assert_eq!(count, side["nodes"].to_string());
        lines.nth(count.parse::<usize>().expect("a number") - 1);
    }
    assert_eq!(lines.next(), Some("$EndPeriodic"));
    let deck = fs::read_to_string(&inp).expect("a deck");
    assert!(deck.contains("ELSET=BALL\n") && deck.contains("ELSET=REST\n"));
}

#[test]
fn unit_cells_that_cannot_be() {
    let folder = Folder::new("mesh-no-cell");
    let model = folder.file("cell.hf", CELL);
    let unit = "--box=0,0,0,1,1,1";
    let exact = "--box=0,0.2,0,1,0.8,1";
    for (more, wanted, why) in [
        (vec!["--periodic", "xyz"], 1, "--box"),
        (vec![unit, "--periodic", "xx"], 1, "each once"),
        (vec![unit, "--periodic", ""], 1, "at least one"),
        (
            vec![unit, "--periodic", "x", "--blocks", "2,1,1"],
            1,
            "cannot be used with",
        ),
        (
            vec!["--box=0.2,0,0,1,1,1", "--periodic", "x"],
            4,
            "does not repeat along x",
        ),
        (
            vec![exact, "--periodic", "y", "--object", "plate"],
            4,
            "lies in a side",
        ),
    ] {
        let object = if more.contains(&"--object") {
            vec![]
        } else {
            vec!["--object", "ball"]
        };
        let plate = folder.file(
            "plate.hf",
            "plate(x[3], a[1]) { plate = (x[2] - 0.2) & (0.5 - x[2]); }",
        );
        let file = if object.is_empty() { &plate } else { &model };
        let run = isoform(&[&["mesh", file, "--size", "0.2"][..], &object, &more].concat());
        assert_eq!(code(&run), wanted, "{more:?}: {}", stderr(&run));
        assert!(stderr(&run).contains(why), "{more:?}: {}", stderr(&run));
    }
}

#[test]
fn layers_that_cannot_be() {
    let folder = Folder::new("mesh-layers-bad");
    let model = folder.file("cell.hf", CELL);
    let ball = ["mesh", &model, "--object", "ball", "--size", "0.2"];
    let layers = ["--layers", "ball*"];
    let first = ["--first", "0.01"];
    let both = [layers, first].concat();
    let cases: [(&[&str], &[&str], &str); 16] = [
        (&layers, &[], "the thickness of the first"),
        (&layers, &["--first=0"], "a positive number"),
        (&first, &[], "--layers"),
        (&["--growth", "1.5"], &[], "--layers"),
        (&["--layer-count", "3"], &[], "--layers"),
        (&first, &["--layers", "ball,"], "empty name"),
        (&both, &["--growth=-1"], "a positive number"),
        (&both, &["--growth=1e99"], "--first, --growth or"),
        (&both, &["--layer-count", "0"], "between 1 and 100"),
        (&both, &["--layer-count", "101"], "try: --layer-count"),
        (&both, &["--order", "2"], "does not go with --order 2"),
        (&both, &["--surface-only"], "cannot be used with"),
        (&both, &["--regions", "bar"], "cannot be used with"),
        (&both, &["--box=0,0,0,1,1,1", "--periodic", "x"], "cannot"),
        (&both, &["--blocks", "2,1,1"], "cannot be used with"),
        (&both, &["--adapt", "old.msh"], "cannot be used with"),
    ];
    for (given, more, why) in cases {
        let run = isoform(&[&ball[..], given, more].concat());
        let said = stderr(&run);
        assert_eq!(code(&run), 1, "{given:?} {more:?}: {said}");
        assert!(said.contains(why), "{given:?} {more:?}: {said}");
    }
}

/// A gap whose layers have no room: where it is, and each name once.
#[test]
fn the_place_without_room_for_layers_is_told() {
    let folder = Folder::new("mesh-layers-gap");
    let model = folder.file(
        "gap.hf",
        "gap(x[3], a[1]) { outer = 1 - x[1]^2 - x[2]^2; inner = (x[1] - 0.2)^2 + x[2]^2 - 0.49;
         gap = outer & inner & x[3] & (1 - x[3]); }",
    );
    let layers = [
        "--size",
        "0.1",
        "--layers",
        "outer,inner,outer",
        "--growth",
        "1",
    ];
    let (exit, thick) = mesh(&model, &[&layers[..], &["--first", "0.04"]].concat());
    assert_eq!(
        (exit, &thick["error"]["code"]),
        (4, &"no-room".into()),
        "{thick}"
    );
    let at = thick["error"]["where"]["at"].as_array().expect("a place");
    let [x, y] = [0, 1].map(|k| at[k].as_f64().expect("a number"));
    // Between the circles of radius 1 and, about (0.2, 0), 0.7.
    assert!(x.hypot(y) < 1.0 && (x - 0.2).hypot(y) > 0.7, "{at:?}");
    let (exit, thin) = mesh(&model, &[&layers[..], &["--first", "0.002"]].concat());
    assert_eq!(exit, 0, "{thin}");
    assert_eq!(
        thin["layers"]["parts"].as_array().expect("parts").len(),
        2,
        "{thin}"
    );
}

/// What is said of a mesh without layers is what was said before there were any.
#[test]
fn a_mesh_without_layers_tells_of_none() {
    let folder = Folder::new("mesh-no-layers");
    let (exit, plain) = mesh(&folder.program(BALL), &["--size", "0.4"]);
    assert!(exit == 0 && plain.get("layers").is_none(), "{plain}");
    assert!(plain["counts"].get("wedges").is_none(), "{plain}");
    assert!(plain["parts"][0].get("quads").is_none(), "{plain}");
}

#[test]
fn blocks_meet_and_are_certified() {
    let f = Folder::new("mesh-blocks");
    let (model, out) = (f.program(HOLED), f.path("m.pvtu"));
    let (exit, j) = mesh(&model, &["--size", "0.2", "--blocks", "2,1,2", "-o", &out]);
    let c = &j["certificate"];
    assert_eq!(
        (exit, &j["ok"], &c["ok"]),
        (0, &true.into(), &true.into()),
        "{j}"
    );
    let volume = 8.0 - 0.5 * std::f64::consts::PI;
    let of_whole = c["volume"].as_f64().expect("a volume");
    assert!((of_whole / volume - 1.0).abs() < 0.02, "{c}");
    assert!(c["shared_faces"].as_u64().is_some_and(|n| n > 0));
    let files: Vec<&str> = j["blocks"]
        .as_array()
        .expect("blocks")
        .iter()
        .map(|b| b["figures"]["file"].as_str().expect("a name"))
        .collect();
    assert_eq!(files, ["m_0.vtu", "m_1.vtu", "m_2.vtu", "m_3.vtu"]);
    let joined = String::from_utf8(f.bytes("m.pvtu")).expect("a text");
    assert!(
        files
            .iter()
            .all(|file| joined.contains(&format!("Source=\"{file}\"")))
    );
    assert_eq!(fs::read_dir(&f.0).expect("the folder").count(), 6);

    for (more, word) in [
        (["--blocks", "0,1,1", "-o", &out], "above 0"),
        (["--blocks", "1,1,99", "-o", &out], "this size has room for"),
        (["--blocks", "2,1,1", "-o", &f.path("m.vtu")], ".pvtu"),
    ] {
        let o = isoform(&[&["mesh", &model, "--size", "0.2"], &more[..]].concat());
        assert_eq!(code(&o), 1);
        assert!(stderr(&o).contains(word), "{}", stderr(&o));
    }
}
