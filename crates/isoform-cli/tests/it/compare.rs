//! `isoform compare` with files of deviations and alignment.

use crate::common::*;
use isoform_testdata::data;

/// Columns of a table with a header.
fn table(text: &str) -> Vec<Vec<f64>> {
    let row = |line: &str| {
        line.split(',')
            .map(|v| v.parse().expect("a number"))
            .collect()
    };
    text.lines().skip(1).map(row).collect()
}

/// Deviations from a ball of radius 2, as a program, a formula, a mesh and a solid.
#[test]
fn deviations_have_the_sign_of_the_side() {
    let f = Folder::new("deviations");
    let radii = [1.5, 1.9, 2.0, 2.3, 3.0];
    let points: String = radii.iter().map(|r| format!("0,{r},0\n")).collect();
    let scan = f.file("scan.csv", points);
    let step = f.path("ball.step");
    assert_eq!(
        code(&isoform(&["brep", "x^2 + y^2 + z^2 = 4", "-o", &step])),
        0
    );
    let stl = f.path("ball.stl");
    let fine = ["--surface-only", "--size", "0.1", "-o", &stl];
    assert_eq!(
        code(&isoform(
            &[&["mesh", "x^2 + y^2 + z^2 = 4"], &fine[..]].concat()
        )),
        0
    );
    let hf = f.file(
        "ball.hf",
        "m(x[3], a[1]) { array c[3]; c = [0,0,0]; m = hfSphere(x, c, 2); }",
    );
    for (other, tolerance) in [
        (step.as_str(), 1e-9),
        (&stl, 2e-3),
        // The metric reading is the distance to first order.
        (&hf, 0.2),
        ("x^2 + y^2 + z^2 = 4", 0.2),
    ] {
        let out = f.path("deviation.csv");
        let o = isoform(&["compare", &scan, other, "-o", &out, "--json"]);
        assert_eq!(code(&o), 0, "{other}: {}", stderr(&o));
        assert_eq!(document(&o)["files"][0], out.as_str());
        for (row, r) in table(&f.text("deviation.csv")).iter().zip(radii) {
            let deviation = *row.last().expect("a column");
            assert!(
                (deviation - (r - 2.0)).abs() <= tolerance,
                "{other}: {r}: {deviation}"
            );
        }
    }
}

/// Points of a scan are judged, not the gaps between them; their unit is converted.
#[test]
fn a_scan_is_judged_by_its_points() {
    let f = Folder::new("judged");
    let step = f.path("ball.step");
    let solid = [
        "brep",
        "x^2 + y^2 + z^2 = 400",
        "--units",
        "mm",
        "-o",
        &step,
    ];
    assert_eq!(code(&isoform(&solid)), 0);
    let at = |k: i32| {
        let (z, turn) = (1.0 - f64::from(k) / 100.0, 2.4 * f64::from(k));
        let r = (20.0 + 0.05 * f64::from(k % 3 - 1)) / 25.4;
        let flat = r * (1.0 - z * z).sqrt();
        format!("{},{},{}\n", flat * turn.cos(), flat * turn.sin(), r * z)
    };
    let rows: String = (0..=200).map(at).collect();
    let scan = f.file("scan.csv", format!("X [in],Y [in],Z [in]\n{rows}"));
    for (tolerance, expected) in [("0.06", 0), ("0.04", 3)] {
        let o = isoform(&["compare", &scan, &step, "--tolerance", tolerance, "--json"]);
        let found = document(&o);
        assert_eq!(code(&o), expected, "{found} {}", stderr(&o));
        assert!(stderr(&o).contains("lengths are in mm"), "{}", stderr(&o));
        assert!(
            found["first_to_second"]["max"]
                .as_f64()
                .is_some_and(|d| (d - 0.05).abs() < 1e-6)
        );
        assert!(
            found["second_to_first"]["max"]
                .as_f64()
                .is_some_and(|d| d > 0.5)
        );
    }
    let unitless = f.file("plain.csv", &rows);
    let o = isoform(&["compare", &unitless, &step]);
    assert!(
        stderr(&o).contains("are the units the same?"),
        "{}",
        stderr(&o)
    );
    let o = isoform(&["compare", &scan, &step, "--tolerance", "-1"]);
    assert!(stderr(&o).contains("a positive number"), "{}", stderr(&o));
}

/// A part of another program and its own corners, turned by a right angle and moved.
#[test]
fn a_moved_scan_is_brought_back() {
    let f = Folder::new("align");
    let step = data("step/mixed-ap242-inch.step").display().to_string();
    let stl = f.path("part.stl");
    assert_eq!(code(&isoform(&["mesh", &step, "-o", &stl])), 0);
    let xyz = f.path("scan.csv");
    let o = isoform(&["convert", &stl, "--samples", "3000", "-o", &xyz]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let turned: String = table(&f.text("scan.csv"))
        .iter()
        .map(|p| format!("{:?},{:?},{:?}\n", 100.0 - p[1], p[0], p[2] - 30.0))
        .collect();
    let scan = f.file("moved.csv", turned);
    let o = isoform(&["compare", &scan, &step, "--align", "--json"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let found = document(&o);
    assert!(
        found["first_to_second"]["max"]
            .as_f64()
            .is_some_and(|d| d < 5e-3),
        "{found}"
    );
    // Each point is nearest to one face; of a scan that is moved by 1 some faces fail.
    let samples = |found: &serde_json::Value| -> Option<u64> {
        let faces = found["faces"].as_array()?.iter();
        faces.map(|face| face["samples"].as_u64()).sum()
    };
    assert_eq!(
        samples(&found),
        found["first_to_second"]["samples"].as_u64()
    );
    assert!(found["faces"][0]["within_tolerance"].is_null());
    let lifted: String = table(&f.text("scan.csv"))
        .iter()
        .map(|p| format!("{:?},{:?},{:?}\n", p[0], p[1], p[2] + 1.0))
        .collect();
    let lifted = f.file("lifted.csv", lifted);
    let o = isoform(&["compare", &lifted, &step, "--tolerance", "0.8", "--json"]);
    assert_eq!(code(&o), 3, "{}", stderr(&o));
    let judged = document(&o)["faces"].clone();
    let count = |is: bool| {
        let faces = judged.as_array().expect("faces").iter();
        faces.filter(|face| face["within_tolerance"] == is).count()
    };
    assert!(count(true) > 0 && count(false) > 0, "{judged}");
    let o = isoform(&["compare", &lifted, &step, "--tolerance", "0.8"]);
    assert!(String::from_utf8_lossy(&o.stdout).contains("fails at "));
    // The part is symmetric: several motions bring it back. All are rigid.
    let row = |k: usize| -> Vec<f64> {
        let row = found["motion"][k].as_array().expect("a row");
        row.iter().map(|v| v.as_f64().expect("a number")).collect()
    };
    for (j, k) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
        let product: f64 = (0..3).map(|i| row(j)[i] * row(k)[i]).sum();
        assert!(
            (product - f64::from(u8::from(j == k))).abs() < 1e-12,
            "{found}"
        );
    }
}

#[test]
fn what_cannot_be_done_is_said_first() {
    let f = Folder::new("compare-errors");
    let scan = f.file("scan.xyz", POINTS);
    let o = isoform(&["compare", &scan, "x^2 + y^2 = 1", "-o", &f.path("out.stl")]);
    assert_eq!(code(&o), 1);
    assert!(
        stderr(&o).contains("-o with .ply, .csv or .xyz"),
        "{}",
        stderr(&o)
    );
    let o = isoform(&["compare", "x^2 + y^2 + z^2 = 1", &scan, "--align"]);
    assert_eq!(code(&o), 1);
    assert!(stderr(&o).contains("give those first"), "{}", stderr(&o));
}
