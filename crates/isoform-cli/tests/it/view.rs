//! `isoform view`: pages, kinds of layers, and what is refused.

use crate::common::*;
use serde_json::Value;
use std::fs;

const BALL: &str = "-- @title <b>Ball</b>
-- @param a[1] radius length min=0.5 max=2 typical=1.5
my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, a[1]); }
";
const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\ng face\nf 1 2 3\n";

/// The document of the scene in a page.
fn scene(page: &str) -> Value {
    let (_, rest) = page.split_once("data-isoform-scene>").expect("a scene");
    let (text, _) = rest.split_once("</script>").expect("its end");
    serde_json::from_str(text).expect("JSON")
}

#[test]
fn each_file_is_a_layer_of_its_kind() {
    let f = Folder::new("view-kinds");
    let files = [
        ("ball.hf", BALL),
        ("four.xyz", POINTS),
        ("sphere.json", SPHERE),
        ("patches.json", PATCH),
        ("face.obj", OBJ),
    ]
    .map(|(name, text)| f.file(name, text));
    let page = f.path("page.html");
    let mut args = vec!["view", "--box", "2", "--json", "-o", &page];
    args.extend(files.iter().map(String::as_str));
    let o = isoform(&args);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let told = document(&o);
    let html = fs::read_to_string(&page).expect("a page");
    assert_eq!(told["bytes"], html.len());
    let document = scene(&html);
    let layers = document["layers"].as_array().expect("layers");
    let kinds: Vec<_> = layers.iter().map(|l| l["kind"].as_str()).collect();
    let want = ["model", "points", "map", "patches", "mesh"].map(Some);
    assert_eq!(kinds, want);
    let names: Vec<_> = layers.iter().map(|l| l["name"].as_str()).collect();
    assert_eq!(names[0], Some("ball.hf"));
    assert_eq!(layers[0]["parameters"][0]["value"], 1.5);
    assert!(!html.contains("<b>Ball"), "titles are data");
    assert!(
        html.find("Content-Security-Policy")
            .is_some_and(|at| at < 400)
    );
}

#[test]
fn values_are_those_that_are_given() {
    let f = Folder::new("view-values");
    let (ball, page) = (f.file("ball.hf", BALL), f.path("page.html"));
    let o = isoform(&["view", &ball, "--params", "0.75", "-o", &page]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let document = scene(&fs::read_to_string(&page).expect("a page"));
    assert_eq!(document["layers"][0]["values"][0], 0.75);
    // The page for stdout is the same one.
    let o = isoform(&["view", &ball, "--params", "0.75", "-o", "-"]);
    assert_eq!(stdout(&o), fs::read_to_string(&page).expect("a page"));
}

#[test]
fn scans_with_triangles_are_points_unless_asked() {
    let f = Folder::new("view-as");
    let (obj, page) = (f.file("face.obj", OBJ), f.path("page.html"));
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let ply = f.file("scan.ply", ply);
    let kind = |file: &str, more: &[&str]| {
        let o = isoform(&[&["view", file, "-o", &page], more].concat());
        assert_eq!(code(&o), 0, "{}", stderr(&o));
        let document = scene(&fs::read_to_string(&page).expect("a page"));
        document["layers"][0]["kind"].as_str().map(str::to_owned)
    };
    assert_eq!(kind(&ply, &[]).as_deref(), Some("points"));
    assert_eq!(kind(&ply, &["--as", "mesh"]).as_deref(), Some("mesh"));
    assert_eq!(kind(&obj, &[]).as_deref(), Some("mesh"));
    assert_eq!(kind(&obj, &["--as", "points"]).as_deref(), Some("points"));
}

#[test]
fn solids_are_shown_by_their_faces() {
    let f = Folder::new("view-solid");
    let (ball, page) = (f.file("ball.hf", BALL), f.path("page.html"));
    for name in ["ball.step", "ball.brep.json"] {
        let solid = f.path(name);
        let o = isoform(&["brep", &ball, "-o", &solid]);
        assert_eq!(code(&o), 0, "{}", stderr(&o));
        let o = isoform(&["view", &solid, "-o", &page]);
        assert_eq!(code(&o), 0, "{name}: {}", stderr(&o));
        let document = scene(&fs::read_to_string(&page).expect("a page"));
        let layer = &document["layers"][0];
        assert_eq!(
            (layer["kind"].as_str(), layer["name"].as_str()),
            (Some("solid"), Some(name))
        );
        assert!(layer["count"].as_u64() > Some(100));
        assert_eq!(layer["triangleFaces"]["n"], layer["count"]);
        let surfaces = layer["surfaces"].as_array().expect("surfaces");
        for surface in surfaces {
            assert_eq!(surface["kind"], "sphere");
            assert_eq!(surface["measures"][0], 1.5);
        }
    }
}

#[test]
fn polynomials_are_models_in_a_box() {
    let f = Folder::new("view-polynomial");
    let sphere = f.file("f.json", r#"{"F": "x^2 + y^2 + z^2 - 1/4"}"#);
    let wrong = f.file("g.json", r#"{"F": "x^2 +"}"#);
    let page = f.path("page.html");
    let o = isoform(&["view", &sphere, "--box", "1", "-o", &page]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let document = scene(&fs::read_to_string(&page).expect("a page"));
    assert_eq!(document["layers"][0]["kind"], "model");
    assert_eq!(code(&isoform(&["view", &sphere, "-o", &page])), 0);
    assert_eq!(
        code(&isoform(&["view", &wrong, "--box", "1", "-o", &page])),
        2
    );
}

#[test]
fn a_template_is_shown_by_its_name() {
    let f = Folder::new("view-template");
    let page = f.path("page.html");
    let o = isoform(&["view", "cup", "-o", &page]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let document = scene(&fs::read_to_string(&page).expect("a page"));
    assert_eq!(document["layers"][0]["name"], "cup");
}

#[test]
fn what_cannot_be_shown_leaves_no_page() {
    let f = Folder::new("view-refused");
    let page = f.path("page.html");
    let sphere = f.file("sphere.json", SPHERE);
    let halfspace = f.file("half.hf", "my_model(x[3], a[1]) { my_model = x[1]; }");
    let empty = f.file("empty.xyz", "");
    let broken = f.file("broken.hf", "my_model(x[3], a[1]) { my_model = ; }");
    let missing = f.path("none.ply");
    let cases: [(&str, i32, &str); 4] = [
        (&missing, 2, "none.ply"),
        (&halfspace, 4, "no end"),
        (&empty, 2, "empty.xyz"),
        (&broken, 2, "broken.hf"),
    ];
    for (file, exit, word) in cases {
        let o = isoform(&["view", file, "-o", &page]);
        assert_eq!(code(&o), exit, "{file}: {}", stderr(&o));
        assert!(stderr(&o).contains(word), "{}", stderr(&o));
        assert!(fs::metadata(&page).is_err(), "{file}");
    }
    let o = isoform(&["view", &halfspace, "--box=-1,-1,-1,1,1,1", "-o", &page]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let o = isoform(&["view", &sphere, "--box", "2", "-o", &sphere]);
    assert_eq!(code(&o), 1, "an input is not overwritten");
}
