//! The content of a page is read back from its text and compared with the input.

use isoform::field::hyperfun::{Mode, Model};
use isoform::geom::{Column, Mesh, PointCloud, RationalPatch};
use isoform::tess::{Map, MapOptions, TriangulateOptions};
use isoform::{Control, LiveModel, templates, triangulate_map};
use isoform_view::{Page, ShownPatch, ShownPoints};
use serde_json::Value;

/// Returns the document of a page.
fn scene(html: &str) -> Value {
    let (_, rest) = html.split_once("data-isoform-scene>").expect("a scene");
    let (text, _) = rest.split_once("</script>").expect("its end");
    assert!(!text.contains('<'), "no text ends the element");
    serde_json::from_str(text).expect("JSON")
}

/// Returns the bytes of an array that the document references.
fn bytes(html: &str, array: &Value) -> Vec<u8> {
    let begin = format!("data-isoform-blob=\"{}\">", array["blob"]);
    let (_, rest) = html.split_once(&begin).expect("an array");
    let (text, _) = rest.split_once("</script>").expect("its end");
    let digit = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let mut out = Vec::new();
    for four in text.as_bytes().chunks(4) {
        let padding = four.iter().filter(|c| **c == b'=').count();
        let word = four.iter().fold(0u32, |w, c| {
            w << 6 | if *c == b'=' { 0 } else { u32::from(digit(*c)) }
        });
        out.extend(&word.to_be_bytes()[1..4 - padding]);
    }
    if array["deflated"] == true {
        out = miniz_oxide::inflate::decompress_to_vec(&out).expect("deflated");
    }
    out
}

/// Returns the numbers of an array.
fn numbers(html: &str, array: &Value) -> Vec<f64> {
    let bytes = bytes(html, array);
    let all: Vec<f64> = match array["type"].as_str() {
        Some("f64") => bytes
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().expect("8")))
            .collect(),
        Some("f32") => bytes
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes(b.try_into().expect("4")).into())
            .collect(),
        Some("u32") => bytes
            .chunks_exact(4)
            .map(|b| u32::from_le_bytes(b.try_into().expect("4")).into())
            .collect(),
        Some("u16") => bytes
            .chunks_exact(2)
            .map(|b| u16::from_le_bytes(b.try_into().expect("2")).into())
            .collect(),
        _ => bytes.iter().map(|b| f64::from(*b)).collect(),
    };
    assert_eq!(array["n"], all.len());
    all
}

/// Returns the coordinates of points.
fn positions(html: &str, positions: &Value) -> Vec<[f64; 3]> {
    let array = numbers(html, &positions["array"]);
    let number = |key: &str, k: usize| positions[key][k].as_f64().expect("a number");
    let place = |p: &[f64]| std::array::from_fn(|k| number("from", k) + number("step", k) * p[k]);
    array.chunks_exact(3).map(place).collect()
}

/// Returns points of a helix far from the origin.
fn helix(count: usize) -> PointCloud {
    let point = |i: usize| {
        let t = i as f64 / count as f64;
        [(40.0 * t).cos(), (40.0 * t).sin(), 3.0 * t]
    };
    PointCloud {
        origin: [4_500_000.0, -20.0, 0.0],
        columns: vec![Column {
            name: "deviation".to_owned(),
            values: (0..count).map(|i| 1e-3 * i as f64 / count as f64).collect(),
        }],
        ..PointCloud::from_points((0..count).map(point).collect())
    }
}

#[test]
fn points_come_back_within_a_hundred_thousandth() {
    for (count, most) in [(1000, 1e-7), (250_000, 1e-5)] {
        let cloud = helix(count);
        let mut page = Page::new("helix");
        page.points("helix.xyz", &ShownPoints::new(&cloud));
        let html = page.html();
        let layer = &scene(&html)["layers"][0];
        assert_eq!(
            (layer["kind"].as_str(), layer["count"].as_u64()),
            (Some("points"), Some(count as u64))
        );
        let back = positions(&html, &layer["positions"]);
        for (i, p) in back.iter().enumerate() {
            let q = cloud.absolute(i);
            // The origin uses seven of sixteen digits.
            assert!(
                (0..3).all(|k| (p[k] - q[k]).abs() <= 3.7 * most + 2e-9),
                "{p:?} of {q:?}"
            );
        }
        let deviation = &layer["deviation"];
        let array = numbers(&html, &deviation["array"]);
        for (i, v) in array.iter().enumerate() {
            let v = deviation["from"].as_f64().expect("a number")
                + deviation["step"].as_f64().expect("a number") * v;
            assert!((v - cloud.columns[0].values[i]).abs() < 1e-7);
        }
    }
}

#[test]
fn many_points_take_nine_bytes_each_at_most() {
    let mut page = Page::new("helix");
    let empty = page.html().len();
    page.points(
        "helix.xyz",
        &ShownPoints {
            deviation: None,
            ..ShownPoints::new(&PointCloud {
                columns: Vec::new(),
                ..helix(250_000)
            })
        },
    );
    assert!(page.html().len() - empty < 9 * 250_000);
    assert!(empty < 1_200_000, "{empty} bytes without data");
}

#[test]
fn texts_of_files_are_data() {
    let evil = "</script><script>alert(1)</script><!--";
    let mut page = Page::new(evil);
    page.points(
        evil,
        &ShownPoints::new(&PointCloud::from_points(vec![[0.0; 3]])),
    );
    let mut mesh = Mesh::from_triangles(
        vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        vec![[0, 1, 2]],
    );
    mesh.parts = vec![evil.to_owned()];
    mesh.triangle_parts = vec![0];
    page.mesh(evil, &mesh);
    let html = page.html();
    assert!(!html.contains("alert(1)</script>"));
    let document = scene(&html);
    assert_eq!(document["title"], evil);
    assert_eq!(document["layers"][1]["parts"][0], evil);
    assert_eq!(
        numbers(&html, &document["layers"][1]["triangles"]),
        [0.0, 1.0, 2.0]
    );
    let policy = html.find("Content-Security-Policy").expect("a policy");
    assert!(policy < html.find("<title>").expect("a title"));
}

/// Evaluates a tape of the document as the page does.
fn run(tape: &Value, x: [f64; 3], a: &[f64]) -> Vec<f64> {
    let list = |key: &str| tape[key].as_array().expect("a list").clone();
    let number = |v: &Value| {
        v.as_f64()
            .or_else(|| v.as_str()?.parse().ok())
            .expect("a number")
    };
    let mut slots: Vec<f64> = list("constants").iter().map(number).collect();
    slots.extend(x);
    slots.extend(a);
    for step in list("steps") {
        let arg = |k: usize| slots[step[k].as_u64().expect("a slot") as usize];
        let value = match step[0].as_str().expect("a name") {
            "neg" => -arg(1),
            "abs" => arg(1).abs(),
            "square" => arg(1) * arg(1),
            "sqrt" => arg(1).sqrt(),
            "add" => arg(1) + arg(2),
            "sub" => arg(1) - arg(2),
            "mul" => arg(1) * arg(2),
            "div" => arg(1) / arg(2),
            "less" => f64::from(u8::from(arg(1) < arg(2))),
            "min" => arg(1).min(arg(2)),
            "max" => arg(1).max(arg(2)),
            "runion" => arg(1) + arg(2) + arg(1).hypot(arg(2)),
            "rintersection" => arg(1) + arg(2) - arg(1).hypot(arg(2)),
            "select" if arg(1) != 0.0 => arg(2),
            "select" => arg(3),
            "powi" => arg(1).powi(step[2].as_i64().expect("an exponent") as i32),
            other => panic!("{other}"),
        };
        slots.push(value);
    }
    let results = list("results");
    results
        .iter()
        .map(|r| slots[r.as_u64().expect("a slot") as usize])
        .collect()
}

#[test]
fn a_tape_in_the_page_computes_the_model() {
    let text = "-- @param a[1] radius length min=0.5 max=2 start=1
        my_model(x[3], a[1]) {
          array c[3]; c = [0, 0, 0];
          ball = hfSphere(x, c, a[1]);
          my_model = ball & (x[3] + 0.25);
        }";
    let model = Model::parse(text, Mode::Default).expect("a program");
    let live = LiveModel::new(&model, &[], None, &Control::default())
        .expect("a solid")
        .expect("an expression");
    let mut page = Page::new("ball");
    page.model("ball.hf", None, &live);
    let document = scene(&page.html());
    let layer = &document["layers"][0];
    assert_eq!(
        layer["parts"].as_array().map(Vec::len),
        Some(live.readings.part_names.len())
    );
    assert_eq!(layer["parameters"][0]["upper"], 2.0);
    for (x, a) in [
        ([0.1, 0.2, 0.3], 1.0),
        ([1.0, -0.5, -0.3], 1.7),
        ([0.0, 0.0, -0.2], 0.5),
    ] {
        let want = live.readings.tape.eval_all(&x, &[a], &mut Vec::new());
        let got = run(&layer["tape"], x, &[a]);
        assert!(
            want.iter()
                .zip(&got)
                .all(|(w, g)| (w - g).abs() <= 1e-14 * (1.0 + w.abs())),
            "{want:?}, {got:?}"
        );
    }
}

#[test]
fn every_template_is_shown_with_typical_values() {
    for found in templates() {
        let live = LiveModel::new(&found.model(), &[], None, &Control::default());
        let live = live.unwrap_or_else(|e| panic!("{}: {e}", found.name));
        let live = live.unwrap_or_else(|| panic!("{}: no expression", found.name));
        assert!(
            live.parameters
                .iter()
                .all(|p| p.lower <= p.value && p.value <= p.upper)
        );
    }
}

#[test]
fn maps_and_patches_come_as_their_numbers() {
    let map = Map::parse(
        ["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"],
        MapOptions::default(),
    )
    .expect("a map");
    let (surface, analysis) = triangulate_map(
        &map,
        &TriangulateOptions::around(2.into()),
        &Control::default(),
    )
    .expect("a surface");
    let plane = RationalPatch::planar((1, 1), [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let patch = ShownPatch {
        patch: plane.clone(),
        name: "plane".to_owned(),
        distance: Some(1e-6),
    };
    let mut page = Page::new("sphere and plane");
    page.map("sphere.json", &map, &surface, &analysis, 2.0);
    page.patches("plane.json", &[patch]);
    let html = page.html();
    let document = scene(&html);
    let [sphere, plane_layer] = [0, 1].map(|k| &document["layers"][k]);
    assert_eq!(sphere["count"], surface.triangles.len());
    assert_eq!(
        numbers(&html, &sphere["corners"]).len(),
        6 * surface.triangles.len()
    );
    assert_eq!(sphere["forms"][0], serde_json::json!([[1, 0, 2.0]]));
    assert_eq!(
        numbers(&html, &plane_layer["control"]),
        plane.control().as_flattened()
    );
    assert_eq!(plane_layer["patches"][0]["distance"], 1e-6);
}

#[test]
fn the_same_layers_give_the_same_bytes() {
    let make = || {
        let mut page = Page::new("helix");
        page.points("helix.xyz", &ShownPoints::new(&helix(5000)));
        page.html()
    };
    assert_eq!(make(), make());
}
