//! Solids in files, as a user runs them: `brep` writes them, `inspect`, `compare` and `mesh` read
//! them, `fit` and `recover` make them of scans.

use crate::common::*;
use isoform::geom::brep::{Axes, Brep, Surface};
use isoform::io::{SolidFile, read_solids, read_step_solids};
use serde_json::Value;
use std::f64::consts::PI;
use std::fs;
use std::path::Path;

/// A cube of side 2 with a round hole of radius 1/2.
const HOLED: &str = "-- @unit cm\nm(x[3], a[1]) { array c[3], k[3]; c = [0, 0, 0]; \
    k = [-1, -1, -1]; cube = hfBlock(x, k, 2, 2, 2); hole = hfCylinderZ(x, c, 0.5); m = cube \\ hole; }\n";
const ELLIPSOID: &str = "m(x[3], a[1]) { m = 1 - (x[1] - 5)^2/4 - x[2]^2 - 4*x[3]^2; }\n";
/// A ball about the origin.
const BALL: &str = "-- @param a[1] radius length\n\
    m(x[3], a[1]) { array c[3]; c = [0, 0, 0]; m = hfSphere(x, c, a[1]); }\n";

/// Writes a model as STEP and in our own form.
fn both(f: &Folder, name: &str, text: &str, more: &[&str]) -> [String; 2] {
    let model = f.file(&format!("{name}.hf"), text);
    let [step, own] = ["step", "brep.json"].map(|e| f.path(&format!("{name}.{e}")));
    let o = isoform(&[&["brep", &model, "-q", "-o", &step, "-o", &own], more].concat());
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    [step, own]
}

/// A fitted program keeps its parameters: one value is set by name, what is tied follows, and the
/// solid is that of the changed model.
#[test]
fn a_fitted_program_is_changed_by_name() {
    let f = Folder::new("set");
    let text = "-- @pose rigid at 1 0 0 turned 0 0 0\n-- @param a[1] radius length typical=0.5\n\
        -- @param a[2] side length min=0\n-- @param a[3] height length tie=0.5*side\n\
        my_model(x[3], a[3]) { array c[3], k[3]; c = [0, 0, 0];\n\
        k[1] = -a[2]/2; k[2] = k[1]; k[3] = k[1]; hole = hfCylinderZ(x, c, a[1]);\n\
        my_model = hfBlock(x, k, a[2], a[2], a[3]) \\ hole; }\n";
    let template = f.file("template.hf", text);
    let [scan, fitted, step] = ["scan.stl", "fitted.hf", "part.step"].map(|e| f.path(e));
    let made = isoform(&["mesh", &template, "--set", "side=2", "-q", "-o", &scan]);
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    let o = isoform(&["fit", &scan, "--template", &template, "-q", "-o", &fitted]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    // The same for CAD.
    let scad = f.path("part.scad");
    let o = isoform(&["fit", &scan, "--template", &template, "-q", "-o", &scad]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let program = fs::read_to_string(&scad).expect("a program");
    assert!(program.contains("\nheight = 0.5*side;") && program.contains("\nside = "));
    let o = isoform(&["fit", &scan, "--template", "bottle", "-q", "-o", &scad]);
    assert!(stderr(&o).contains("no CAD program"), "{}", stderr(&o));
    let volume = |settings: &[&str]| {
        let verb = ["brep", &fitted, "-q", "--json", "--force", "-o", &step];
        let o = isoform(&[&verb[..], settings].concat());
        assert_eq!(code(&o), 0, "{}", stderr(&o));
        number(&document(&o)["volume"])
    };
    let expected = |radius: f64, side: f64| 0.5 * side * (side * side - PI * radius * radius);
    for (settings, radius, side) in [
        (&[][..], 0.5, 2.0),
        (&["--set", "radius=0.75"], 0.75, 2.0),
        (&["--set", "side=3", "--set", "a[1]=1"], 1.0, 3.0),
        (&["--params", "radius=0.75", "--set", "side=3"], 0.75, 3.0),
    ] {
        let found = volume(settings);
        assert!(
            (found / expected(radius, side) - 1.0).abs() < 1e-6,
            "{settings:?}: {found}"
        );
    }
    let o = isoform(&["brep", &fitted, "--params", "0.75", "--set", "radius=1"]);
    assert!(code(&o) == 1 && stderr(&o).contains("radius is given twice"));
    let o = isoform(&["brep", &fitted, "--set", "bore=1"]);
    assert!(code(&o) == 1 && stderr(&o).contains("radius, side, height"));
}

fn own_file(path: &str) -> SolidFile {
    let bytes = fs::read(path).expect("a file");
    read_solids(&serde_json::from_slice(&bytes).expect("JSON")).expect("solids")
}

fn step_file(path: &str) -> SolidFile {
    read_step_solids(&fs::read_to_string(path).expect("a file")).expect("solids")
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn near(value: &Value, expected: f64, by: f64) -> bool {
    (number(value) / expected - 1.0).abs() < by
}

/// Without the frames that STEP has no place for, and with names of parts in the order of their
/// first faces.
fn as_step_has_it(brep: &Brep) -> Brep {
    let mut brep = brep.clone();
    let parts = std::mem::take(&mut brep.parts);
    for face in &mut brep.faces {
        if matches!(face.surface, Surface::Ellipsoid(_)) || face.surface.is_near_only() {
            face.surface = Surface::Plane(Axes::along([0.0; 3], [0.0, 0.0, 1.0]));
        }
        let name = &parts[face.part as usize];
        let known = brep.parts.iter().position(|p| p == name);
        face.part = known.unwrap_or(brep.parts.len()) as u32;
        if known.is_none() {
            brep.parts.push(name.clone());
        }
    }
    brep
}

#[test]
fn both_files_hold_the_same_solid() {
    let f = Folder::new("solids-both");
    let models = [
        ("holed", HOLED),
        ("nested", NESTED),
        ("ellipsoid", ELLIPSOID),
        ("fillet", FILLET),
    ];
    for (name, text) in models {
        let [step, own] = both(&f, name, text, &[]);
        let (from_step, from_own) = (step_file(&step), own_file(&own));
        assert_eq!(
            as_step_has_it(&from_step.brep),
            as_step_has_it(&from_own.brep),
            "{name}"
        );
        assert_eq!(from_step.name, name);
        let unit = (name == "holed").then(|| "cm".to_owned());
        assert_eq!(from_own.unit, unit);
        // STEP states a unit in any case.
        assert_eq!(from_step.unit, unit.or(Some("mm".to_owned())));
        assert_eq!(from_step.properties.volume, from_own.properties.volume);
        // Ten times it are stated, and read as what it is at most.
        assert!(from_step.properties.gap >= (1.0 - 1e-12) * from_own.properties.gap);
        let o = isoform(&["compare", &step, &own, "--json", "-q", "--samples", "2000"]);
        let j = document(&o);
        for way in ["first_to_second", "second_to_first"] {
            assert!(number(&j[way]["max"]) < 1e-13, "{name} {}", j[way]);
        }
        assert_eq!(
            [&j["first"]["kind"], &j["second"]["kind"]],
            ["solid", "solid"]
        );
    }
    let bytes = fs::read(f.path("fillet.brep.json")).expect("a file");
    let [_, again] = both(&f, "fillet", FILLET, &["--threads", "1"]);
    assert!(fs::read(again).expect("a file") == bytes);
}

#[test]
fn inspect_measures_what_a_file_states() {
    let f = Folder::new("solids-inspect");
    for path in both(&f, "holed", HOLED, &[]) {
        let o = isoform(&["inspect", &path, "--json"]);
        let j = document(&o);
        assert_eq!(
            (code(&o), &j["unit"], &j["euler"]),
            (0, &"cm".into(), &0.into())
        );
        for volume in [&j["volume"], &j["stated"]["volume"]] {
            assert!(near(volume, 8.0 - PI / 2.0, 1e-12), "{j}");
        }
        assert!(near(&j["area"], 24.0 - PI / 2.0 + 2.0 * PI, 1e-12), "{j}");
        let faces = j["faces"].as_array().expect("faces");
        let is_hole = |f: &&Value| f["part"] == "hole#chart1";
        let hole = faces.iter().find(is_hole).expect("the hole");
        assert!(hole["type"] == "cylinder" && faces.len() == 8, "{hole}");
        let text = stdout(&isoform(&["inspect", &path]));
        assert!(text.contains("8 (6 plane, 2 cylinder)"), "{text}");
    }
    // What is stated is not believed.
    let mut file: Value =
        serde_json::from_slice(&fs::read(f.path("holed.brep.json")).expect("a file"))
            .expect("JSON");
    file["properties"]["volume"] = 7.0.into();
    let other = f.file("other.json", file.to_string());
    let j = document(&isoform(&["inspect", &other, "--json"]));
    assert_eq!(j["stated"]["volume"], 7.0);
    assert!(near(&j["volume"], 8.0 - PI / 2.0, 1e-12), "{j}");
}

#[test]
fn what_is_no_such_file_is_refused() {
    let f = Folder::new("solids-refused");
    let [step, own] = both(&f, "holed", HOLED, &[]);
    let text = fs::read_to_string(&step).expect("a file");
    let foreign = f.file(
        "foreign.step",
        text.replace("'isoform 0", "'Other 1")
            .replace("=PLANE(", "=OFFSET_SURFACE("),
    );
    let half = f.file("half.step", &text[..text.len() / 2]);
    let mut open: Value = serde_json::from_slice(&fs::read(&own).expect("a file")).expect("JSON");
    open["faces"][0]["loops"][0][0][1] = true.into();
    let open = f.file("open.brep.json", open.to_string());
    let empty = f.file("empty.brep.json", "{}");
    for (path, said) in [
        (&foreign, "surfaces of the kind OFFSET_SURFACE are not read"),
        (&half, "is expected"),
        (&open, "face 0, loop 0: its edges are no closed chain"),
        (&empty, "brep is expected"),
        (&f.path("none.step"), "cannot read"),
    ] {
        for verb in [&["inspect"][..], &["mesh"], &["compare", &own]] {
            let o = isoform(&[verb, &[path.as_str(), "-q"]].concat());
            assert!(
                code(&o) == 2 && stderr(&o).contains(said),
                "{path} {}",
                stderr(&o)
            );
        }
    }
    let o = isoform(&[
        "brep",
        &f.file("m.hf", HOLED),
        "-q",
        "-o",
        &f.path("m.json"),
    ]);
    assert!(
        code(&o) == 1 && stderr(&o).contains(".brep.json"),
        "{}",
        stderr(&o)
    );
}

#[test]
fn distances_from_solids_are_those_from_their_exact_faces() {
    let f = Folder::new("solids-compare");
    let [step, _] = both(&f, "ball", BALL, &["--params", "2"]);
    let [_, larger] = both(&f, "larger", BALL, &["--params", "2.125"]);
    let o = isoform(&[
        "compare",
        &step,
        &larger,
        "--json",
        "-q",
        "--tolerance",
        "0.1",
    ]);
    let j = document(&o);
    assert_eq!((code(&o), &j["within_tolerance"]), (3, &false.into()));
    for way in ["first_to_second", "second_to_first"] {
        // A ball as polygons would be nearer to the other by a thousandth.
        for figure in ["rms", "mean", "max"] {
            assert!(near(&j[way][figure], 0.125, 1e-12), "{}", j[way]);
        }
    }
    let model = f.path("ball.hf");
    let j = document(&isoform(&[
        "compare", &step, &model, "--params", "2", "--json", "-q",
    ]));
    assert!(number(&j["first_to_second"]["max"]) < 1e-14, "{j}");
    assert!(number(&j["second_to_first"]["max"]) < 1e-12, "{j}");

    // Outside, inside, within the hole, on its edge: from the cube with a hole.
    let [step, _] = both(&f, "holed", HOLED, &[]);
    let points = [
        ([2.0, 2.0, 0.0], 2.0f64.sqrt()),
        ([0.9, 0.8, 0.1], 0.1),
        ([0.0, 0.2, 0.3], 0.3),
        ([0.0, 0.0, 2.0], 1.25f64.sqrt()),
        ([0.3, 0.4, 1.0], 0.0),
    ];
    for (i, ([x, y, z], expected)) in points.into_iter().enumerate() {
        let point = f.file(&format!("{i}.xyz"), format!("{x} {y} {z}\n"));
        let j = document(&isoform(&["compare", &point, &step, "--json", "-q"]));
        let found = number(&j["first_to_second"]["max"]);
        assert!((found - expected).abs() < 1e-12, "{x} {y} {z}: {found}");
    }
}

#[test]
fn a_solid_has_closed_triangles() {
    let f = Folder::new("solids-mesh");
    let [step, own] = both(&f, "nested", NESTED, &[]);
    let exact = 4.0 / 3.0 * PI * (27.0 - 8.0 + 1.0);
    let volume = |path: &str, more: &[&str]| {
        let o = isoform(&[&["mesh", path, "--json", "-q"], more].concat());
        let j = document(&o);
        assert_eq!((code(&o), &j["ok"]), (0, &true.into()), "{j}");
        let deviation = number(&j["deviation"]);
        assert!(
            deviation > 0.0 && deviation <= 2.0 * number(&j["chord"]),
            "{j}"
        );
        exact - number(&j["certificate"]["volume"])
    };
    let stl = f.path("n.stl");
    let (coarse, fine) = (
        volume(&step, &["--grade", "0.04"]),
        volume(&own, &["--grade", "0.01", "-o", &stl]),
    );
    // Of the order of the distance, which is a fourth.
    assert!(coarse > 2.0 * fine && fine > 0.0, "{coarse} {fine}");
    assert!(fs::metadata(&stl).expect("written").len() > 1000);
    // As polygons they leave the faces by as much as was allowed.
    let j = document(&isoform(&["compare", &stl, &step, "--json", "-q"]));
    let far = number(&j["first_to_second"]["max"]);
    assert!(far > 0.005 && far <= 0.022, "{far}");
    for more in [
        &["--order", "2"][..],
        &["--box=-1,-1,-1,1,1,1"],
        &["--close"],
        &["--params", "1"],
    ] {
        let o = isoform(&[&["mesh", &own, "-q"], more].concat());
        assert!(
            code(&o) == 1 && stderr(&o).contains("needs a HyperFun program"),
            "{more:?}"
        );
    }
}

/// Points of a ball of radius 2 about the origin, with a ripple of 1e-3.
fn ball_scan(f: &Folder) -> String {
    let point = |i: u32| {
        let (t, z) = (f64::from(i) * 2.4, (f64::from(i) + 0.5) / 200.0 - 1.0);
        let r = 2.0 + 1e-3 * (17.0 * f64::from(i)).sin();
        let s = (1.0 - z * z).sqrt();
        format!("{:?} {:?} {:?}\n", r * s * t.cos(), r * s * t.sin(), r * z)
    };
    f.file("ball.xyz", (0..400).map(point).collect::<String>())
}

/// A cylinder along z of a given radius and of height 2: a ball is none.
const BAR: &str = "-- @param a[1] radius length\n\
    m(x[3], a[1]) { m = min(a[1] - sqrt(x[1]^2 + x[2]^2), 1 - abs(x[3])); }\n";

#[test]
fn a_scan_becomes_a_solid_in_the_unit_of_the_fit() {
    let f = Folder::new("solids-fit");
    let (scan, ball) = (ball_scan(&f), f.file("ball.hf", BALL));
    let [step, own, fitted] = ["part.step", "part.brep.json", "fitted.hf"].map(|n| f.path(n));
    let files = ["-o", &step, "-o", &fitted, "-o", &own];
    let args = [&["fit", &scan, "-t", &ball, "--units", "in"][..], &files].concat();
    let o = isoform(&[&args[..], &["--json"]].concat());
    let j = document(&o);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let radius = number(&j["parameters"][0]["value"]);
    assert_eq!(
        (&j["verdict"], &j["solid"]["ok"]),
        (&"accepted".into(), &true.into())
    );
    assert_eq!(j["outputs"].as_array().map(Vec::len), Some(3));
    let again = f.path("again.step");
    let o = isoform(&["brep", &fitted, "-q", "--units", "in", "-o", &again]);
    assert_eq!(code(&o), 0);
    for file in [own_file(&own), step_file(&step), step_file(&again)] {
        assert_eq!(file.unit.as_deref(), Some("in"));
        let spheres = file.brep.faces.iter().filter(|f| match f.surface {
            Surface::Sphere(_, r) => (r / radius - 1.0).abs() < 1e-12,
            _ => false,
        });
        assert_eq!(spheres.count(), file.brep.faces.len());
        let volume = 4.0 / 3.0 * PI * radius.powi(3);
        assert!((file.properties.volume / volume - 1.0).abs() < 1e-12);
    }
    let text = stdout(&isoform(&[&args[..], &["-q"]].concat()));
    assert!(
        text.contains("solid of the fit (accepted)") && text.contains("certificate  holds"),
        "{text}"
    );
}

#[test]
fn a_refused_fit_and_a_missing_solid_are_both_said() {
    let f = Folder::new("solids-doubt");
    let (scan, bar) = (ball_scan(&f), f.file("bar.hf", BAR));
    let step = f.path("bar.step");
    let o = isoform(&["fit", &scan, "-t", &bar, "--json", "-o", &step]);
    let j = document(&o);
    // The solid is that of the model, and says so; the model is not that of the scan.
    assert_eq!((code(&o), &j["verdict"]), (3, &"refused".into()), "{j}");
    assert_eq!(j["solid"]["certificate"]["holds"], true);
    assert!(
        step_file(&step)
            .brep
            .faces
            .iter()
            .any(|f| f.surface.name() == "cylinder")
    );

    // An unbounded model has no solid: the fit's files stand all the same.
    let plane = (0..400)
        .map(|i| format!("{} {} 0.5\n", i % 20, i / 20))
        .collect::<String>();
    let scan = f.file("plane.xyz", plane);
    let plane = f.file(
        "plane.hf",
        "-- @param a[1] height z\nm(x[3], a[1]) { m = a[1] - x[3]; }\n",
    );
    let [fitted, none] = ["plane.fitted.hf", "plane.step"].map(|n| f.path(n));
    let o = isoform(&[
        "fit", &scan, "-t", &plane, "--json", "-o", &fitted, "-o", &none,
    ]);
    let j = document(&o);
    assert_eq!((code(&o), &j["solid"]["ok"]), (4, &false.into()), "{j}");
    assert!(
        j["error"]["message"]
            .as_str()
            .is_some_and(|m| m.contains("no solid")),
        "{j}"
    );
    assert!(Path::new(&fitted).exists() && !Path::new(&none).exists());
}

#[test]
fn recover_writes_a_solid_where_the_fit_is_accepted() {
    let f = Folder::new("solids-recover");
    let (scan, ball) = (ball_scan(&f), f.file("ball.hf", BALL));
    let bar = f.file("bar.hf", BAR);
    let step = f.path("isoform-recover/ball/part.step");
    let o = recover(&f, &[&scan, &bar, "--json"]);
    let j = document(&o);
    assert_eq!((code(&o), &j["verdict"]), (3, &"refused".into()));
    assert_eq!(j["solid"]["skipped"], "the fit is not accepted");
    assert!(
        !Path::new(&step).exists() && Path::new(&f.path("isoform-recover/ball/fitted.hf")).exists()
    );
    let o = recover(&f, &[&scan, &ball, "--json"]);
    let j = document(&o);
    assert_eq!(
        (code(&o), &j["solid"]["ok"]),
        (0, &true.into()),
        "{}",
        stderr(&o)
    );
    assert_eq!(j["outputs"].as_array().map(Vec::len), Some(4));
    assert_eq!(step_file(&step).name, "ball");
    // A file of an earlier run does not stay.
    let o = recover(&f, &[&scan, &bar]);
    assert!(!Path::new(&step).exists());
    assert!(
        stdout(&o).contains("no solid  the fit is not accepted"),
        "{}",
        stdout(&o)
    );
}

#[test]
fn a_scan_without_a_template_becomes_a_solid() {
    let f = Folder::new("solids-proposed");
    let scan = f.file("disc.xyz", disc());
    let own = f.path("disc.brep.json");
    let o = recover(&f, &[&scan, "-o", &own, "--json"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let file = own_file(&own);
    assert!(
        (file.properties.volume / (50.0 * PI) - 1.0).abs() < 1e-7,
        "{file:?}"
    );
    let mut kinds: Vec<&str> = file.brep.faces.iter().map(|f| f.surface.name()).collect();
    kinds.sort_unstable();
    assert_eq!(kinds, ["cylinder", "cylinder", "plane", "plane"]);
}
