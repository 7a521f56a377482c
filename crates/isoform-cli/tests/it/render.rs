//! `isoform render`: pictures of every kind of file, the same for any number of threads, and what
//! is refused.

use crate::common::*;
use std::fs;

const BALL: &str = "-- @title <b>Ball</b>
-- @param a[1] radius length min=0.5 max=2 typical=1
my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, a[1]); }
";
const RUN: &str = "my_model(x[3], a[1]) { i = 0; while x[1] > i loop i = i + 1; endloop;
my_model = 1 + 0*i - x[1]^2 - x[2]^2 - x[3]^2; }
";
const POINTS: &str = "1.1 0 0\n0 0.9 0\n0 0 1\n-1 0 0\n";
const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

/// Width and height of a PNG.
fn size(bytes: &[u8]) -> [u32; 2] {
    assert!(bytes.starts_with(b"\x89PNG\r\n\x1a\n"));
    [16, 20].map(|k| u32::from_be_bytes(bytes[k..k + 4].try_into().expect("four bytes")))
}

#[test]
fn every_kind_of_file_has_a_picture_and_a_drawing() {
    let f = Folder::new("render-kinds");
    let files = [
        ("ball.hf", BALL, "model"),
        ("four.xyz", POINTS, "points"),
        ("sphere.json", SPHERE, "map"),
        ("patches.json", PATCH, "patches"),
        ("corner.obj", OBJ, "mesh"),
    ];
    for (name, text, kind) in files {
        let file = f.file(name, text);
        for ending in ["png", "svg"] {
            let out = f.path(&format!("{name}.{ending}"));
            let o = isoform(&[
                "render", &file, "--box", "2", "--size", "120x90", "--json", "-o", &out,
            ]);
            assert_eq!(code(&o), 0, "{name}: {}", stderr(&o));
            let told = document(&o);
            assert_eq!(told["layers"][0]["kind"], kind);
            assert_eq!(told["size"][0], 120);
            let bytes = fs::read(&out).expect("a picture");
            assert_eq!(told["bytes"], bytes.len());
            if ending == "png" {
                assert_eq!(size(&bytes), [120, 90]);
            } else {
                let text = String::from_utf8(bytes).expect("a text");
                assert!(text.contains("viewBox=\"0 0 120 90\"") && text.ends_with("</svg>\n"));
            }
        }
    }
}

#[test]
fn the_camera_is_as_asked_and_as_told() {
    let f = Folder::new("render-camera");
    let (ball, out) = (f.file("ball.hf", BALL), f.path("ball.png"));
    let from = "3,-2.5,1.5,0.5,0,0";
    let o = isoform(&[
        "render",
        &ball,
        "--camera",
        from,
        "--orthographic",
        "--size",
        "64x48",
        "--json",
        "-o",
        &out,
    ]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let camera = &document(&o)["camera"];
    assert_eq!(camera["position"].as_array().map(Vec::len), Some(3));
    assert_eq!(camera["position"][1], -2.5);
    assert_eq!(camera["target"][0], 0.5);
    assert_eq!(camera["orthographic"], true);
    // Straight down, where z is not up.
    let o = isoform(&[
        "render",
        &ball,
        "--camera",
        "0,0,5,0,0,0",
        "--json",
        "-o",
        &out,
    ]);
    let up: Vec<f64> = serde_json::from_value(document(&o)["camera"]["up"].clone()).expect("three");
    assert_eq!(up, [0.0, 1.0, 0.0]);
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let f = Folder::new("render-threads");
    let (ball, points) = (f.file("ball.hf", BALL), f.file("four.xyz", POINTS));
    for ending in ["png", "svg"] {
        let made = |threads: &str| {
            let out = f.path(&format!("{threads}.{ending}"));
            let o = isoform(&[
                "render",
                &ball,
                &points,
                "--size",
                "200x150",
                "--section",
                "1,1,0,0.3",
                "--threads",
                threads,
                "-o",
                &out,
            ]);
            assert_eq!(code(&o), 0, "{}", stderr(&o));
            fs::read(out).expect("a picture")
        };
        assert!(made("1") == made("2"), "{ending}");
    }
}

#[test]
fn points_beside_a_model_are_measured() {
    let f = Folder::new("render-deviation");
    let (ball, points) = (f.file("ball.hf", BALL), f.file("four.xyz", POINTS));
    let out = f.path("both.png");
    let o = isoform(&[
        "render", &points, &ball, "--size", "90x90", "--json", "-o", &out,
    ]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let layer = &document(&o)["layers"][0];
    assert_eq!(layer["color_by"], "deviation");
    assert_eq!(layer["scale"]["n"], 4);
    let rms = layer["scale"]["rms"].as_f64().expect("a number");
    assert!((rms - 0.005_f64.sqrt()).abs() < 1e-12, "{rms}");
}

#[test]
fn a_sheet_has_its_views_at_one_scale() {
    let f = Folder::new("render-sheet");
    let (ball, out) = (f.file("ball.hf", BALL), f.path("sheet.svg"));
    let o = isoform(&[
        "render",
        &ball,
        "--views",
        "iso,front,top",
        "--color-by",
        "part",
        "--json",
        "-o",
        &out,
    ]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let views = document(&o)["views"].as_array().expect("views").clone();
    assert_eq!(views.len(), 3);
    let scale = |k: usize| {
        let height = views[k]["camera"]["height"].as_f64().expect("a number");
        height / views[k]["size"][1].as_f64().expect("a number")
    };
    assert!((scale(0) / scale(2) - 1.0).abs() < 1e-12);
    assert_eq!(views[1]["name"], "front");
}

#[test]
fn a_map_is_proved_where_its_certificate_holds() {
    let f = Folder::new("render-proved");
    // The poles of the second one are a curve with a cusp, next to which triangles cross.
    let cusp = r#"{"X": "1", "Y": "s", "Z": "t^2", "W": "s^2 - t^3"}"#;
    // Those of the third one an acnode and a curve: its mesh has points upon each other.
    let node = r#"{"X": "1", "Y": "s", "Z": "t", "W": "s^2 + t^2 - s^3"}"#;
    let maps = [
        ("sphere.json", SPHERE, true),
        ("cusp.json", cusp, false),
        ("node.json", node, false),
    ];
    let tried = maps.into_iter().take(isoform_testdata::cases(3, 2));
    for (name, text, want) in tried {
        let (map, out) = (f.file(name, text), f.path("map.png"));
        let o = isoform(&[
            "render", &map, "--box", "2", "--size", "40x30", "--json", "-o", &out,
        ]);
        assert_eq!(code(&o), 0, "it is drawn all the same: {}", stderr(&o));
        assert_eq!(document(&o)["layers"][0]["proved"], want, "{name}");
    }
}

#[test]
fn names_are_texts() {
    let f = Folder::new("render-names");
    let evil = f.file("a<script>alert(1)<&\".hf", BALL);
    let out = f.path("evil.svg");
    let o = isoform(&["render", &evil, "--size", "60x60", "-o", &out]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let text = fs::read_to_string(out).expect("a drawing");
    assert!(
        !text.contains("<script") && text.contains("&lt;script&gt;"),
        "{text}"
    );
}

#[test]
fn a_program_without_intervals_is_drawn_by_its_mesh() {
    let f = Folder::new("render-run");
    let (run, out) = (f.file("run.hf", RUN), f.path("run.png"));
    let o = isoform(&[
        "render", &run, "--box", "3", "--size", "80x60", "--json", "-o", &out,
    ]);
    assert_eq!(code(&o), 3, "{}", stderr(&o));
    assert_eq!(document(&o)["layers"][0]["proved"], false);
    assert!(stderr(&o).contains("its mesh is drawn"));
    assert_eq!(size(&fs::read(out).expect("a picture")), [80, 60]);
}

#[test]
fn what_cannot_be_drawn_is_refused_with_a_reason() {
    let f = Folder::new("render-refused");
    let ball = f.file("ball.hf", BALL);
    for (args, exit, part) in [
        (vec![&ball[..], "-o", "a.gif"], 1, ".svg"),
        (vec![&ball, "--size", "0x0", "-o", "a.png"], 1, "one pixel"),
        (
            vec![&ball, "--size", "99999x99999", "-o", "a.png"],
            1,
            "pixels",
        ),
        (
            vec![&ball, "--camera", "1,1,1,1,1,1", "-o", "a.png"],
            1,
            "looks at",
        ),
        (
            vec![&ball, "--camera", "nan,0,0,1,1,1", "-o", "a.png"],
            1,
            "nan",
        ),
        (
            vec![&ball, "--camera", "1,2,3", "-o", "a.png"],
            1,
            "six numbers",
        ),
        (vec![&ball, "--fov", "180", "-o", "a.png"], 1, "--fov"),
        (vec![&ball, "--view", "above", "-o", "a.png"], 1, "front"),
        (
            vec![&ball, "--section", "0,0,0,1", "-o", "a.png"],
            1,
            "normal",
        ),
        (
            vec![&ball, "--section", "0,0,1,-5", "-o", "a.png"],
            4,
            "leaves nothing",
        ),
        (
            vec![&ball, "--color-by", "heat", "-o", "a.png"],
            1,
            "deviation",
        ),
        (
            vec![&ball, "--color-by", "u", "-o", "a.png"],
            1,
            "none, part",
        ),
        (vec![&ball, "--hidden", "-o", "a.png"], 1, ".svg"),
        (
            vec![&ball, "--background", "#12345", "-o", "a.png"],
            1,
            "#rrggbb",
        ),
        (vec!["none.hf", "-o", "a.png"], 2, "none.hf"),
    ] {
        let out = f.path(args[args.len() - 1]);
        let mut all = vec!["render"];
        all.extend(&args[..args.len() - 1]);
        all.push(&out);
        let o = isoform(&all);
        assert_eq!(code(&o), exit, "{args:?}: {}", stderr(&o));
        assert!(stderr(&o).contains(part), "{args:?}: {}", stderr(&o));
        assert!(fs::metadata(&out).is_err(), "{args:?}: a file was written");
    }
}

#[test]
fn a_view_of_nothing_is_said() {
    let f = Folder::new("render-nothing");
    let (ball, out) = (f.file("ball.hf", BALL), f.path("away.png"));
    let away = "5,0,0,9,0,0";
    let o = isoform(&[
        "render", &ball, "--camera", away, "--size", "40x30", "-o", &out,
    ]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    assert!(stderr(&o).contains("nothing is seen"), "{}", stderr(&o));
}

/// A function that is no number in parts of the box: what evaluators make of that differs, and no
/// picture or page shows it as if it were solid.
#[test]
fn functions_without_a_value_are_refused_or_meshed() {
    let f = Folder::new("render-undefined");
    let dome = "min(sqrt(1 - x[1]^2 - x[2]^2) - x[3], x[3])";
    for (name, formula) in [
        ("root", "sqrt(1 - x[1]^2 - x[2]^2 - x[3]^2)"),
        ("dome", dome),
    ] {
        let text = format!("my_model(x[3], a[1]) {{ my_model = {formula}; }}\n");
        let file = f.file(&format!("{name}.hf"), &text);
        for (verb, out) in [("render", "x.png"), ("view", "x.html")] {
            let out = f.path(out);
            let o = isoform(&[verb, &file, "--box", "2", "-q", "-o", &out]);
            assert_eq!(code(&o), 4, "{verb} {name}: {}", stderr(&o));
            assert!(stderr(&o).contains("not a number near"), "{}", stderr(&o));
        }
    }
    let inner = f.file(
        "inner.hf",
        format!("my_model(x[3], a[1]) {{ my_model = {dome}; }}\n"),
    );
    let out = f.path("inner.png");
    let o = isoform(&[
        "render",
        &inner,
        "--box=-0.7,-0.7,-1,0.7,0.7,1.5",
        "-q",
        "-o",
        &out,
    ]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
}

/// Deviations of a file are those of the model that they were measured from; beside another one, or
/// the same one with other parameters, points are measured anew.
#[test]
fn deviations_of_another_model_are_not_taken() {
    let f = Folder::new("render-deviations");
    let ball = f.file("ball.hf", BALL);
    let axes = [[1.1, 0.0, 0.0], [0.0, 1.05, 0.0], [0.0, 0.0, -0.9]];
    let rows = axes.map(|[x, y, z]| format!("{x},{y},{z},{}\n", x + y + f64::abs(z) - 1.0));
    let points = f.file("points.csv", format!("x,y,z,deviation\n{}", rows.concat()));
    let rms = |radius: &str| {
        let out = f.path("x.png");
        let o = isoform(&[
            "render", &points, &ball, "--params", radius, "--size", "60x60", "--json", "-o", &out,
        ]);
        document(&o)["layers"][0]["scale"]["rms"]
            .as_f64()
            .expect("a number")
    };
    for radius in [1.0, 1.2] {
        let squares: f64 = [1.1, 1.05, 0.9]
            .map(|r: f64| (r - radius).powi(2))
            .iter()
            .sum();
        let want = (squares / 3.0).sqrt();
        assert!((rms(&radius.to_string()) - want).abs() < 1e-12, "{radius}");
    }
}
