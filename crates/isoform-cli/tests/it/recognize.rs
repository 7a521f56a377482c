//! `isoform recognize`, and `recover` without a template.

use crate::common::*;

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
