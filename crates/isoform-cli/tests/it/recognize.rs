//! `isoform recognize`, and `recover` without a template.

use crate::common::*;
use serde_json::json;

#[test]
fn a_disc_is_two_planes_and_a_cylinder() {
    let f = Folder::new("recognize");
    let scan = f.file("scan.xyz", disc());
    let (entities, labels, template) = (f.path("e.json"), f.path("l.ply"), f.path("t.hf"));
    let files = ["-o", &entities, "-o", &labels, "-o", &template];
    let o = isoform(&[&["recognize", &scan, "--json"][..], &files].concat());
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let report = document(&o);
    let found = report["entities"].as_array().expect("entities");
    let mut kinds: Vec<&str> = found.iter().filter_map(|e| e["type"].as_str()).collect();
    kinds.sort_unstable();
    assert_eq!(kinds, ["cylinder", "plane", "plane"]);
    let is_cylinder = |e: &&serde_json::Value| e["type"] == "cylinder";
    let radius = &found.iter().find(is_cylinder).expect("a cylinder")["parameters"]["radius"];
    assert!((radius.as_f64().expect("a number") - 5.0).abs() < 1e-9);
    assert_eq!(report["n_unassigned"], 0);
    let text = |path: &str| {
        let bytes = std::fs::read(path).expect("a file");
        String::from_utf8_lossy(&bytes).into_owned()
    };
    assert!(text(&labels).contains("entity"));
    assert!(text(&template).contains("-- @param a[1]"));

    let fitted = f.path("fitted.hf");
    let o = isoform(&["recover", &scan, "-o", &fitted, "--json"]);
    let report = document(&o);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    assert_eq!(report["proposal"]["explained"], 1.0);
    let o = isoform(&["mesh", &fitted, "--surface-only", "--size", "0.4", "--json"]);
    let volume = document(&o)["certificate"]["volume"]
        .as_f64()
        .expect("a volume");
    assert!((volume / 157.0796 - 1.0).abs() < 0.01, "{volume}");
}

/// The six faces of a box of 4 by 3 by 2, turned, with errors along their normals.
fn noisy_box() -> String {
    let turned = |[x, y, z]: [f64; 3]| [0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y, z];
    let point = |i: u32| {
        let of = |f: f64| (f64::from(i) * f).fract();
        let (k, sizes) = ((i % 3) as usize, [4.0, 3.0, 2.0]);
        let noise = 0.01 * (of(0.137_7) + of(0.573_1) + of(0.817_9) - 1.5);
        let mut p = [of(0.754_878), of(0.569_840), of(0.319_7)];
        p[k] = f64::from(i / 3 % 2);
        let mut p: [f64; 3] = std::array::from_fn(|j| p[j] * sizes[j]);
        p[k] += noise;
        let [x, y, z] = turned(p);
        format!("{x} {y} {z}\n")
    };
    (0..6000).map(point).collect()
}

#[test]
fn snapped_relations_hold_to_rounding() {
    let f = Folder::new("snapped");
    let scan = f.file("scan.xyz", noisy_box());
    let run = |more: &[&str]| {
        let o = isoform(&[&["recognize", &scan, "--json"][..], more].concat());
        assert_eq!(code(&o), 0, "{}", stderr(&o));
        document(&o)
    };
    let (before, after) = (run(&[]), run(&["--snap"]));
    let worst = |report: &serde_json::Value| {
        let relations = report["relations"].as_array().expect("relations");
        assert_eq!(relations.len(), 15, "3 pairs and 12 right angles");
        let deviations = relations.iter().filter_map(|r| r["deviation"].as_f64());
        deviations.fold(0.0, f64::max)
    };
    assert!(worst(&before) > 1e-6 && worst(&after) < 1e-12);
    let normal = |i: usize| -> Vec<f64> {
        let n = after["entities"][i]["parameters"]["normal"].as_array();
        n.expect("a plane")
            .iter()
            .filter_map(serde_json::Value::as_f64)
            .collect()
    };
    for (i, j) in (0..6).flat_map(|i| (0..i).map(move |j| (i, j))) {
        let (m, n) = (normal(i), normal(j));
        let cosine: f64 = m.iter().zip(&n).map(|(a, b)| a * b).sum();
        assert!(cosine.abs() < 1e-12 || cosine.abs() > 1.0 - 1e-12);
    }
    // Directions have 12 parameters, a frame has 3.
    assert_eq!(after["snap"]["conditions"], 9);
    let sd = |report: &serde_json::Value| {
        let sd = &report["entities"][5]["sd"]["normal"][0];
        sd.as_f64().expect("a number")
    };
    assert!(sd(&after) < sd(&before));
}

#[test]
fn what_cannot_be_recognised_is_an_error() {
    let f = Folder::new("unrecognised");
    let line: String = (0..200).map(|i| format!("{i} {} 0\n", 2 * i)).collect();
    let o = isoform(&["recognize", &f.file("line.xyz", line)]);
    assert_eq!(code(&o), 4, "{}", stderr(&o));
    let o = isoform(&["recognize", &f.file("none.xyz", "")]);
    assert_eq!(code(&o), 2, "{}", stderr(&o));
    // One sheet bounds no solid: there is no template, and the way without one is named.
    let sheet: String = (0..900)
        .map(|i| {
            format!(
                "{} {} 0\n",
                i % 30,
                f64::from(i / 30) + 0.1 * f64::from(i % 7)
            )
        })
        .collect();
    let (sheet, fitted) = (f.file("sheet.xyz", sheet), f.path("fitted.hf"));
    let o = isoform(&["recover", &sheet, "-o", &fitted, "--json"]);
    assert_eq!(code(&o), 4, "{}", stdout(&o));
    assert!(stdout(&o).contains("implicitize"), "{}", stdout(&o));
}

/// The table of a csv file of labels with other labels.
fn relabelled(text: &str, label: impl Fn(i64) -> String) -> String {
    let at = text
        .lines()
        .next()
        .and_then(|head| head.split(',').position(|c| c == "entity"));
    let at = at.expect("a column");
    let edited = |(k, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if k > 0 {
            cells[at] = label(cells[at].parse().expect("a label"));
        }
        cells.join(",") + "\n"
    };
    text.lines().enumerate().map(edited).collect()
}

#[test]
fn labels_are_corrected_by_hand() {
    let f = Folder::new("labels");
    let scan = f.file("scan.xyz", noisy_box());
    let (ply, csv) = (f.path("l.ply"), f.path("l.csv"));
    let o = isoform(&["recognize", &scan, "-o", &ply, "-o", &csv, "--json"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let before = document(&o);
    assert!(before["entities"][0].get("label").is_none());
    let run = |labels: &str, more: &[&str]| {
        isoform(
            &[
                &["recognize", &scan, "--labels", labels, "--json"][..],
                more,
            ]
            .concat(),
        )
    };
    // As they were, in both formats.
    let again = f.path("again.ply");
    for labels in [&ply, &csv] {
        let o = run(labels, &["-o", &again]);
        assert_eq!(code(&o), 0, "{}", stderr(&o));
        let report = document(&o);
        for (k, e) in report["entities"]
            .as_array()
            .expect("entities")
            .iter()
            .enumerate()
        {
            assert_eq!((&e["label"], &e["explained"]), (&json!(k), &json!(true)));
            assert_eq!(e["n_points"], before["entities"][k]["n_points"]);
        }
        assert_eq!(f.bytes("l.ply"), f.bytes("again.ply"));
        assert_eq!(report["relations"].as_array().map(Vec::len), Some(15));
    }
    // A relation that holds is no other one; one that cannot hold is refused in words.
    let o = run(&ply, &["--relate", "parallel=0,1"]);
    let related = document(&o);
    let angle = &related["error"]["message"]
        .as_str()
        .unwrap_or_default()
        .to_owned();
    match related["ok"] == json!(true) {
        true => assert_eq!(related["relations"].as_array().map(Vec::len), Some(15)),
        false => assert!(angle.contains("by 90.0 degrees"), "{angle}"),
    }
    let o = run(&ply, &["--relate", "coaxial=0,1"]);
    assert_eq!(code(&o), 2);
    assert!(
        stderr(&o).contains("cannot be coaxial: they are a plane and a plane"),
        "{}",
        stderr(&o)
    );
    // Two faces merged, one deleted, one renamed with a kind: the document says which is which.
    let text = f.text("l.csv");
    let edited = |l: i64| match l {
        1 | 5 => "0".to_owned(),
        2 => "-1".to_owned(),
        3 => "70".to_owned(),
        l => l.to_string(),
    };
    let labels = f.file("edited.csv", relabelled(&text, edited));
    let o = run(&labels, &["--kind", "0=cylinder", "--snap"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let report = document(&o);
    let entities = report["entities"].as_array().expect("entities");
    let column = |key: &str| entities.iter().map(|e| e[key].clone()).collect::<Vec<_>>();
    assert_eq!(column("label"), [json!(0), json!(4), json!(70)]);
    assert_eq!(
        column("explained"),
        [json!(false), json!(true), json!(true)]
    );
    assert_eq!(
        column("type"),
        [json!("cylinder"), json!("plane"), json!("plane")]
    );
    assert!(stderr(&o).contains("label 0:"), "{}", stderr(&o));
    let deleted = before["entities"][2]["n_points"]
        .as_u64()
        .expect("a number");
    let unassigned = |r: &serde_json::Value| r["n_unassigned"].as_u64().expect("a number");
    assert_eq!(unassigned(&report), unassigned(&before) + deleted);

    // The way to the solid.
    let fitted = f.path("fitted.hf");
    let o = isoform(&["recover", &scan, "--labels", &ply, "-o", &fitted, "--json"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let proposal = &document(&o)["proposal"];
    assert_eq!(proposal["labels"], json!([0, 1, 2, 3, 4, 5]));
    assert_eq!(proposal["unexplained_labels"], json!([]));

    // What is wrong is said, with the label and what to do.
    let refused = |labels: &str, more: &[&str], exit: i32, words: &str| {
        let o = run(labels, more);
        assert_eq!(code(&o), exit, "{}", stdout(&o));
        assert!(stdout(&o).contains(words), "{words}: {}", stdout(&o));
    };
    refused(&scan, &[], 2, "no column `entity`");
    let half = f.file("half.csv", relabelled(&text, |l| format!("{l}.5")));
    refused(&half, &[], 2, "-1 is none");
    let short: String = text
        .lines()
        .take(100)
        .map(|l| l.to_owned() + "\n")
        .collect();
    refused(
        &f.file("short.csv", short),
        &[],
        2,
        "99 points, but the scan has 6000",
    );
    let mut lines: Vec<&str> = text.lines().collect();
    lines[1..].reverse();
    refused(
        &f.file("turned.csv", lines.join("\n")),
        &[],
        2,
        "another order",
    );
    refused(&csv, &["--kind", "9=plane"], 2, "no point has the label 9");
    refused(&csv, &["--kind", "0=ball"], 1, "`ball` is no kind");
    refused(&csv, &["--min-points", "9"], 1, "--min-points");
    let left = std::cell::Cell::new(2);
    let few = relabelled(&text, |l| {
        let is_moved = l == 0 && left.get() > 0;
        left.set(left.get() - i32::from(is_moved));
        if is_moved { 80 } else { l }.to_string()
    });
    refused(
        &f.file("few.csv", few),
        &[],
        2,
        "2 points of label 80 determine no surface",
    );
    let o = isoform(&["recover", "--labels", &csv, "--json"]);
    assert_eq!(code(&o), 1, "{}", stdout(&o));
}

/// A tube whose vertices lie on its rims: the file of labels also has points inside its faces.
#[test]
fn labels_of_a_cad_mesh_have_points_inside_its_faces() {
    let n = 40;
    let ring = |r: f64, z: f64| {
        let at = move |k: i32| std::f64::consts::TAU * f64::from(k) / f64::from(n);
        (0..n).map(move |k| format!("v {} {} {z}\n", r * at(k).cos(), r * at(k).sin()))
    };
    let rings = ring(2.0, 0.0)
        .chain(ring(2.0, 3.0))
        .chain(ring(0.8, 0.0))
        .chain(ring(0.8, 3.0));
    let mut mesh: String = rings.collect();
    for k in 1..=n {
        let next = k % n + 1;
        for [a, b] in [[0, n], [3 * n, 2 * n], [2 * n, 0], [n, 3 * n]] {
            let (a, b, c, d) = (a + k, a + next, b + next, b + k);
            mesh += &format!("f {a} {b} {c}\nf {a} {c} {d}\n");
        }
    }
    let f = Folder::new("labels_cad");
    let scan = f.file("tube.obj", mesh);
    let (labels, again) = (f.path("l.ply"), f.path("again.ply"));
    let o = isoform(&["recognize", &scan, "-o", &labels, "--json"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let before = document(&o);
    assert!(before["points"].as_u64() > Some(10_000));
    let o = isoform(&[
        "recognize",
        &scan,
        "--labels",
        &labels,
        "-o",
        &again,
        "--json",
    ]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let after = document(&o);
    assert_eq!(f.bytes("l.ply"), f.bytes("again.ply"));
    for k in 0..4 {
        let [a, b] = [&before, &after].map(|r| &r["entities"][k]);
        assert_eq!((&a["type"], &b["explained"]), (&b["type"], &json!(true)));
        if a["type"] == "cylinder" {
            let [r, s] = [a, b].map(|e| e["parameters"]["radius"].as_f64().expect("a number"));
            assert!((r - s).abs() < 1e-12, "{r} {s}");
        }
    }
    let fitted = f.path("fitted.hf");
    let o = isoform(&[
        "recover", &scan, "--labels", &labels, "-o", &fitted, "--json",
    ]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
}

/// Faces of a cube, moved off the origin, as triangles and as points: squares, seen from outside.
#[test]
fn flat_faces_have_borders() {
    let f = Folder::new("borders");
    let mesh = f.file("cube.stl", crate::terms::cube(10.0));
    let mut points = String::new();
    for side in [-1.0, 1.0] {
        for axis in 0..3 {
            for k in 0..21 * 21 {
                let mut p = [f64::from(k % 21) / 10.0 - 1.0; 3];
                p[(axis + 1) % 3] = f64::from(k / 21) / 10.0 - 1.0;
                p[axis] = side;
                points += &format!("{} {} {}\n", p[0] + 10.0, p[1], p[2]);
            }
        }
    }
    for (scan, allowed) in [(mesh, 1e-9), (f.file("cube.xyz", points), 0.45)] {
        let o = isoform(&["recognize", &scan, "--json"]);
        assert_eq!(code(&o), 0, "{}", stderr(&o));
        let report = document(&o);
        let faces = report["faces"].as_array().expect("faces");
        assert_eq!(faces.len(), 6, "{faces:?}");
        for face in faces {
            let rings: Vec<Vec<[f64; 3]>> =
                serde_json::from_value(face["border"].clone()).expect("polygons");
            assert_eq!(rings.len(), 1, "{rings:?}");
            // The volume of the cone over the polygon from the middle of the cube: a sixth.
            let at = |p: [f64; 3]| [p[0] - 10.0, p[1], p[2]];
            let next = rings[0].iter().cycle().skip(1);
            let sum = rings[0].iter().zip(next).fold([0.0; 3], |sum, (p, q)| {
                let (p, q) = (at(*p), at(*q));
                let turn = |k: usize, l: usize| p[k] * q[l] - p[l] * q[k];
                [
                    sum[0] + turn(1, 2),
                    sum[1] + turn(2, 0),
                    sum[2] + turn(0, 1),
                ]
            });
            let first = at(rings[0][0]);
            let volume: f64 = (0..3).map(|k| first[k] * sum[k]).sum::<f64>() / 6.0;
            assert!((volume - 8.0 / 6.0).abs() < allowed, "{volume}: {rings:?}");
        }
    }
}
