//! `fit`, `recover`, `inspect`, `convert` and `compare`, as a user runs them.

use crate::common::*;
use serde_json::Value;
use std::fs;
use std::process::Command;

const BALL: &str = "-- @title A ball
-- @param a[1] cx x
-- @param a[2] cy y
-- @param a[3] cz z
-- @param a[4] radius length
my_model(x[3], a[4]) { array c[3]; c[1] = a[1]; c[2] = a[2]; c[3] = a[3]; my_model = hfSphere(x, c, a[4]); }
";

impl Folder {
    /// Points of a ball of radius 2 about (1, 2, 3) + shift, with a ripple of 1e-3.
    fn ball(&self, shift: f64) -> String {
        let point = |i: u32| {
            let (t, z) = (f64::from(i) * 2.4, (f64::from(i) + 0.5) / 200.0 - 1.0);
            let r = 2.0 + 1e-3 * (17.0 * f64::from(i)).sin();
            let s = (1.0 - z * z).sqrt();
            format!(
                "{:?} {:?} {:?}\n",
                shift + 1.0 + r * s * t.cos(),
                shift + 2.0 + r * s * t.sin(),
                3.0 + r * z
            )
        };
        self.file("ball.xyz", (0..400).map(point).collect::<String>())
    }
}

fn value(j: &Value, i: usize) -> f64 {
    j["parameters"][i]["value"].as_f64().expect("a number")
}

#[test]
fn a_ball_is_found_and_told_of() {
    let f = Folder::new("ball");
    let (hf, scan) = (f.file("t.hf", BALL), f.ball(0.0));
    let o = isoform(&["fit", &scan, "--template", &hf, "--json"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let j = document(&o);
    for (i, want) in [1.0, 2.0, 3.0, 2.0].into_iter().enumerate() {
        assert!((value(&j, i) - want).abs() < 1e-3, "{j}");
        let p = &j["parameters"][i];
        assert_eq!(
            (p["index"].as_u64(), p["status"].as_str()),
            (Some(i as u64 + 1), Some("determined"))
        );
        let (lo, hi) = (
            p["ci95"][0].as_f64().expect("lo"),
            p["ci95"][1].as_f64().expect("hi"),
        );
        assert!(lo < value(&j, i) && value(&j, i) < hi);
    }
    assert_eq!(
        (
            j["n_points"].as_u64(),
            j["n_outliers"].as_u64(),
            j["seed"].as_u64()
        ),
        (Some(400), Some(0), Some(1))
    );
    assert!(
        j["two_sided"]["model_to_data"]["share_uncovered"]
            .as_f64()
            .expect("a share")
            < 0.05
    );
    let text = stdout(&isoform(&["fit", &scan, "-t", &hf, "-q"]));
    assert!(
        text.contains("radius") && text.contains("the template fits") && text.contains("seed 1"),
        "{text}"
    );
}

#[test]
fn one_stray_point_does_not_count() {
    let dir = Folder::new("stray");
    let template = dir.file("ball.hf", BALL);
    dir.ball(0.0);
    for stray in ["8 2 3\n", "1e4 2 3\n", "1e308 2 3\n"] {
        let scan = dir.file("stray.xyz", dir.text("ball.xyz") + stray);
        let o = isoform(&["fit", &scan, "--template", &template, "--json"]);
        let j = document(&o);
        assert_eq!(code(&o), 0, "{j}");
        assert!((value(&j, 3) - 2.0).abs() < 1e-3, "{j}");
        assert_eq!(j["n_outliers"].as_u64(), Some(1), "{j}");
    }
}

#[test]
fn a_table_is_left_out_unless_it_is_to_be_kept() {
    let dir = Folder::new("table");
    let template = dir.file("ball.hf", BALL);
    dir.ball(0.0);
    // A square of 16 about the ball's foot, from which a disc of 1.2 is hidden.
    let on_table = |i: u32| {
        let at = |k: f64| 16.0 * (f64::from(i) * k).fract() - 8.0;
        (at(0.754_877_666), at(0.569_840_291))
    };
    let table: Vec<String> = (0..400)
        .map(on_table)
        .filter(|(x, y)| x.hypot(*y) > 1.2)
        .map(|(x, y)| format!("{:?} {:?} 1.0\n", 1.0 + x, 2.0 + y))
        .collect();
    let scan = dir.file("scene.xyz", dir.text("ball.xyz") + &table.concat());
    let mut command = ["fit", &scan, "--template", &template, "--json"].to_vec();
    let o = isoform(&command);
    let j = document(&o);
    assert_eq!(code(&o), 0, "{j}");
    assert!((value(&j, 3) - 2.0).abs() < 2e-3, "{j}");
    // Points of the table under the ball are not told from the ball's own.
    let left_out = j["n_left_out"].as_u64().expect("a number") as usize;
    assert!(
        (table.len() - 30..=table.len()).contains(&left_out),
        "{left_out}"
    );
    assert_eq!(
        j["n_points"].as_u64(),
        Some(400 + table.len() as u64),
        "{j}"
    );
    command.push("--keep-planes");
    let o = isoform(&command);
    let j = document(&o);
    assert_eq!((code(&o), &j["n_left_out"]), (3, &Value::from(0)), "{j}");
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let f = Folder::new("threads");
    let (hf, scan) = (f.file("t.hf", BALL), f.ball(0.0));
    let run = |threads: &str| {
        let mut j = document(&isoform(&[
            "fit",
            &scan,
            "-t",
            &hf,
            "--json",
            "--threads",
            threads,
        ]));
        j["seconds"] = Value::Null;
        j.to_string()
    };
    assert_eq!(run("1"), run("3"));
}

#[test]
fn bounds_starts_and_fixed_values() {
    let f = Folder::new("settings");
    let (hf, scan) = (f.file("t.hf", BALL), f.ball(0.0));
    let bounds = f.file("b.json", r#"{"RADIUS": [0.5, 1.5], "2": [-5, 5]}"#);
    let j = document(&isoform(&[
        "fit",
        &scan,
        "-t",
        &hf,
        "--json",
        "--bounds",
        &bounds,
        "--start=0,0,0,1",
    ]));
    assert_eq!(j["parameters"][3]["status"], "at-bound", "{j}");
    assert_eq!(j["parameters"][3]["at_bound"], "upper");
    let j = document(&isoform(&[
        "fit", &scan, "-t", &hf, "--json", "--fix", "a[4]=2.5",
    ]));
    assert_eq!(
        (value(&j, 3), j["parameters"][3]["status"].as_str()),
        (2.5, Some("fixed"))
    );

    for (file, word) in [
        (r#"{"size": [0, 1]}"#, "cx, cy, cz, radius"),
        (r#"{"9": [0, 1]}"#, "there is no parameter 9"),
        (r#"{"1": [1, 0]}"#, "not below"),
        (r#"{"1": [1]}"#, "two numbers"),
        (r#"[1]"#, "an object"),
        ("{", "not a JSON document"),
        (r#"{"1": [0, 1], "cx": [0, 2]}"#, "already"),
    ] {
        let o = isoform(&[
            "fit",
            &scan,
            "-t",
            &hf,
            "--json",
            "--bounds",
            &f.file("bad.json", file),
        ]);
        assert_eq!(
            (code(&o), document(&o)["ok"].as_bool()),
            (2, Some(false)),
            "{file}"
        );
        assert!(
            document(&o)["error"]["message"]
                .as_str()
                .is_some_and(|m| m.contains(word)),
            "{file}: {}",
            stdout(&o)
        );
    }
    let o = isoform(&["fit", &scan, "-t", &hf, "--json", "--start", "1,2"]);
    assert_eq!(code(&o), 1);
    assert!(stdout(&o).contains("2 values for 4") && stdout(&o).contains("cx, cy, cz, radius"));
    let twice = [
        "fit", &scan, "-t", &hf, "--fix", "radius=1", "--fix", "a[4]=2",
    ];
    let o = isoform(&twice);
    assert_eq!(code(&o), 1);
    assert!(
        stderr(&o).contains("radius is held twice"),
        "{}",
        stderr(&o)
    );
    let o = isoform(&["fit", &scan, "-t", &hf, "--json", "--fix", "size=1"]);
    assert_eq!(
        (code(&o), document(&o)["error"]["code"].as_str()),
        (1, Some("usage"))
    );
}

#[test]
fn a_posed_template_far_from_the_origin() {
    let f = Folder::new("utm");
    let hf =
        f.file("t.hf", "-- @pose translate\n-- @param a[1] r length\nm(x[3], a[1]) { array c[3]; c = [0,0,0]; m = hfSphere(x, c, a[1]); }");
    let o = isoform(&[
        "fit",
        &f.ball(4_000_000.0),
        "-t",
        &hf,
        "--json",
        "-o",
        &f.path("o.hf"),
    ]);
    let j = document(&o);
    assert_eq!(code(&o), 0, "{j}");
    assert!(
        (value(&j, 0) - 2.0).abs() < 1e-3 && (value(&j, 1) - 4_000_001.0).abs() < 1e-3,
        "{j}"
    );
    // The fitted program stands in the file's coordinates.
    let o = isoform(&["compare", &f.path("ball.xyz"), &f.path("o.hf"), "--json"]);
    assert!(
        document(&o)["first_to_second"]["max"]
            .as_f64()
            .expect("a number")
            < 2e-3,
        "{}",
        stdout(&o)
    );
}

#[test]
fn every_kind_of_file_is_written() {
    let f = Folder::new("files");
    let (hf, scan) = (f.file("t.hf", BALL), f.ball(0.0));
    let names = ["o.hf", "o.ply", "o.csv", "o.xyz", "o.html", "o.json"].map(|n| f.path(n));
    let mut args = vec!["fit", &scan, "-t", &hf, "--units", "mm"];
    names.iter().for_each(|n| args.extend(["-o", n]));
    let o = isoform(&args);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    assert!(f.text("o.hf").contains("my_model_template"));
    assert!(
        f.text("o.csv")
            .lines()
            .next()
            .is_some_and(|l| l.contains("deviation") && l.contains("outlier"))
    );
    let page = f.text("o.html");
    assert!(
        page.contains("A ball")
            && page.contains("<svg")
            && page.contains("Accepted")
            && page.ends_with("</html>\n")
    );
    // The viewer and the arrays that it shows are text that may hold any letters, as are pictures.
    let mut elements = page.split("<script");
    let rest: String = elements
        .next()
        .into_iter()
        .chain(elements.filter_map(|e| e.split_once("</script>").map(|e| e.1)))
        .collect::<String>()
        .replace("http-equiv", "");
    let mut pieces = rest.split("data:image/png;base64,");
    let words: String = pieces
        .next()
        .into_iter()
        .chain(pieces.filter_map(|p| p.split_once('"').map(|p| p.1)))
        .collect();
    assert!(
        !words.contains("http") && !words.contains("NaN") && !words.contains("inf"),
        "the page needs nothing and shows numbers"
    );
    assert!(rest.len() < 1_000_000, "{}", rest.len());
    assert!(page.len() < 1_700_000, "{}", page.len());
    assert!(
        words.contains("<svg class=\"sheet\"")
            && words.contains("<tspan class=\"name\">radius</tspan>")
            && words.contains(">R "),
        "the model is drawn with its dimensions"
    );
    let j: Value = serde_json::from_str(&f.text("o.json")).expect("a document");
    assert_eq!(
        (j["ok"].as_bool(), j["units"].as_str()),
        (Some(true), Some("mm"))
    );
    let o = isoform(&["inspect", &f.path("o.ply"), "--json"]);
    let columns = document(&o)["columns"].to_string();
    assert!(
        columns.contains("deviation") && document(&o)["colors"] == true,
        "{columns}"
    );
}

#[test]
fn what_cannot_be_written_leaves_the_old_file() {
    let f = Folder::new("old");
    let (hf, scan) = (f.file("t.hf", BALL), f.ball(0.0));
    for (bad, exit) in [("o.stl", 1), ("o", 1), ("no/o.hf", 2)] {
        let o = isoform(&["fit", &scan, "-t", &hf, "--json", "-o", &f.path(bad)]);
        assert_eq!(
            (code(&o), document(&o)["ok"].as_bool()),
            (exit, Some(false)),
            "{bad}: {}",
            stdout(&o)
        );
    }
    let old = f.file("old.hf", "old");
    let o = isoform(&[
        "fit",
        &f.file("bad.xyz", "1 2 3\n4 five 6\n"),
        "-t",
        &hf,
        "-o",
        &old,
    ]);
    assert_eq!(
        (code(&o), f.text("old.hf").as_str()),
        (2, "old"),
        "{}",
        stderr(&o)
    );
    fs::create_dir_all(f.path("folder.hf")).expect("a folder");
    let o = isoform(&[
        "fit",
        &scan,
        "-t",
        &hf,
        "--json",
        "-o",
        &f.path("folder.hf"),
    ]);
    assert_eq!((code(&o), document(&o)["ok"].as_bool()), (2, Some(false)));
    assert!(fs::read_dir(&f.0).expect("the folder").all(|e| {
        !e.expect("an entry")
            .file_name()
            .to_string_lossy()
            .ends_with(".tmp")
    }));
}

#[test]
fn broken_inputs_are_refused() {
    let f = Folder::new("broken");
    let (hf, scan) = (f.file("t.hf", BALL), f.ball(0.0));
    let cases = [
        (f.file("empty.xyz", ""), hf.clone(), 2),
        (f.file("two.xyz", "0 0 0\n1 0 0\n"), hf.clone(), 2),
        (f.path("none.xyz"), hf.clone(), 2),
        (f.file("nan.xyz", "nan nan nan\n"), hf.clone(), 2),
        (
            scan.clone(),
            f.file("bad.hf", "my_model(x[3], a[1]) { my_model = ; }"),
            2,
        ),
        (
            scan.clone(),
            f.file("flat.hf", "m(x[2], a[1]) { m = a[1] - x[1]; }"),
            2,
        ),
        (scan.clone(), f.path("no-such-template"), 2),
        (
            scan.clone(),
            f.file(
                "nan.hf",
                "m(x[3], a[1]) { m = sqrt(0 - 1 - x[1]^2 - a[1]^2); }",
            ),
            4,
        ),
    ];
    for (scan, hf, exit) in cases {
        let o = isoform(&["fit", &scan, "-t", &hf, "--json"]);
        let j = document(&o);
        assert_eq!(
            (code(&o), j["ok"].as_bool()),
            (exit, Some(false)),
            "{scan} {hf}: {j}"
        );
        assert!(
            j["error"]["message"]
                .as_str()
                .is_some_and(|m| !m.is_empty()),
            "{j}"
        );
    }
    assert_eq!(code(&isoform(&["fit"])), 1);
    assert_eq!(code(&isoform(&["fit", &scan])), 1);
}

#[test]
fn a_bad_fit_is_refused_and_written() {
    let f = Folder::new("refused");
    let grid = (0..1000)
        .map(|i| format!("{} {} {}\n", i % 10, i / 10 % 10, i / 100))
        .collect::<String>();
    let o = isoform(&[
        "fit",
        &f.file("cube.xyz", grid),
        "-t",
        &f.file("t.hf", BALL),
        "--json",
        "-o",
        &f.path("o.hf"),
    ]);
    let j = document(&o);
    assert_eq!(
        (code(&o), j["ok"].as_bool(), j["acceptable"].as_bool()),
        (3, Some(true), Some(false)),
        "{j}"
    );
    assert!(
        !j["reasons"].as_array().expect("reasons").is_empty()
            && f.path("o.hf").len() > 1
            && !f.text("o.hf").is_empty()
    );
}

#[test]
fn the_gallery_is_listed() {
    let j = document(&isoform(&["fit", "--list", "--json"]));
    let names: Vec<&str> = j["templates"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|t| t["name"].as_str())
        .collect();
    assert!(
        names.contains(&"cup") && names.contains(&"sphere"),
        "{names:?}"
    );
    assert!(stdout(&isoform(&["fit", "--list"])).contains("radius"));
}

#[test]
fn a_template_that_is_not_there_is_guessed() {
    let f = Folder::new("guess");
    let scan = f.ball(0.0);
    let said = |name: &str| stderr(&isoform(&["fit", &scan, "-t", name]));
    assert!(said("cpu").contains("did you mean cup?"), "{}", said("cpu"));
    f.file("teapot.hf", BALL);
    let near = said(&f.path("teappt.hf"));
    assert!(
        near.contains("did you mean") && near.contains("teapot.hf"),
        "{near}"
    );
    assert!(!said("quux-quux").contains("did you mean"));
}

#[cfg(unix)]
#[test]
fn bash_completes_templates() {
    let f = Folder::new("completions");
    f.file("boss.hf", BALL);
    f.file("bowl.ply", "");
    let script = f.file("isoform.bash", isoform(&["completions", "bash"]).stdout);
    for option in ["-t", "--template"] {
        let ask = format!(
            "source {script}; COMP_WORDS=(isoform fit s.ply {option} bo); COMP_CWORD=4; \
             _isoform isoform bo {option}; printf '%s\\n' \"${{COMPREPLY[@]}}\""
        );
        let o = Command::new("bash")
            .args(["--norc", "-c", &ask])
            .current_dir(&f.0)
            .output()
            .expect("bash runs");
        let offered = stdout(&o);
        let offered: Vec<&str> = offered.lines().collect();
        assert_eq!(offered, ["bottle", "box", "boss.hf"], "{}", stderr(&o));
    }
    for shell in ["zsh", "fish"] {
        let script = stdout(&isoform(&["completions", shell]));
        assert!(script.contains("block-holes bottle box"), "{shell}");
    }
}

#[test]
fn units_of_the_template_are_believed_over_a_guess() {
    let f = Folder::new("units");
    let scan = f.ball(0.0);
    let hf = f.file("t.hf", format!("-- @unit cm\n{BALL}"));
    let j = document(&isoform(&["fit", &scan, "-t", &hf, "--json"]));
    assert_eq!(j["units"], "cm", "{j}");
    assert!(
        j["units_source"]
            .as_str()
            .is_some_and(|s| s.contains("the template")),
        "{j}"
    );
    assert_eq!(j["parameters"][3]["unit"], "cm");
    let o = isoform(&["fit", &scan, "-t", &hf, "--json", "--units", "in"]);
    assert_eq!(document(&o)["units"], "in");
    assert!(
        stderr(&o).contains("the template is written in cm")
            || document(&o)["warnings"]
                .to_string()
                .contains("written in cm")
    );
}

#[test]
fn recover_runs_without_arguments() {
    let f = Folder::new("recover");
    let o = recover(&f, &["--json"]);
    let j = document(&o);
    assert!([0, 3].contains(&code(&o)), "{}", stderr(&o));
    assert_eq!(
        (j["verb"].as_str(), j["outputs"].as_array().map(Vec::len)),
        (Some("recover"), Some(3))
    );
    for name in ["fitted.hf", "deviation.ply", "report.html"] {
        assert!(
            fs::metadata(f.0.join("isoform-recover/cup").join(name))
                .expect("written")
                .len()
                > 1000,
            "{name}"
        );
    }
    let page = f.text("isoform-recover/cup/report.html");
    let marks = [
        "Section",
        ">R 30.2",
        ">outer_radius</tspan>",
        ">inner_radius</tspan>",
        ">height</tspan>",
        ">floor_height</tspan>",
        ">taper</tspan>",
    ];
    for mark in marks {
        assert!(page.contains(mark), "{mark} is missing in the drawing");
    }
    assert_eq!(
        code(&isoform(&["recover", &f.path("scan.ply")])),
        2,
        "there is no such scan"
    );
}

#[test]
fn each_scan_has_a_folder_of_its_own() {
    let f = Folder::new("recover-folders");
    let (scan, hf) = (f.ball(0.0), f.file("ball.hf", BALL));
    fs::create_dir(f.0.join("other")).expect("a folder");
    fs::copy(&scan, f.0.join("other/ball.xyz")).expect("copied");
    let read = |name: &str| f.text(&format!("isoform-recover/{name}"));
    let o = recover(&f, &[&scan, &hf]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let first = read("ball/fitted.hf");
    assert!(read("ball/scan.txt").trim_end().ends_with("/ball.xyz"));
    // Another scan of the same name, and the first one by another spelling.
    let o = recover(&f, &["other/ball.xyz", &hf]);
    assert!(stderr(&o).contains("ball-2"), "{}", stderr(&o));
    assert!(
        read("ball-2/scan.txt")
            .trim_end()
            .ends_with("/other/ball.xyz")
    );
    assert_eq!(code(&recover(&f, &["./other/../ball.xyz", &hf, "-q"])), 0);
    assert!(!f.0.join("isoform-recover/ball-3").exists() && read("ball/fitted.hf") == first);

    // What an earlier run wrote is gone, whatever comes of this one; other files stay.
    f.file("isoform-recover/ball/part.step", "of an earlier run");
    f.file("isoform-recover/ball/notes.txt", "of the user");
    let plane = "-- @param a[1] height z\nm(x[3], a[1]) { m = a[1] - x[3]; }\n";
    let o = recover(&f, &[&scan, &f.file("plane.hf", plane)]);
    assert_eq!(code(&o), 3, "{}", stderr(&o));
    assert!(!f.0.join("isoform-recover/ball/part.step").exists());
    assert_eq!(read("ball/notes.txt"), "of the user");
    // Nothing is made or removed where the input cannot be read.
    f.file("bad.xyz", "1 2\n");
    assert_eq!(code(&recover(&f, &["bad.xyz", &hf])), 2);
    assert!(!f.0.join("isoform-recover/bad").exists());
}

#[test]
fn results_go_to_a_folder_that_is_named() {
    let f = Folder::new("recover-folder");
    let (scan, hf) = (f.ball(0.0), f.file("ball.hf", BALL));
    let mesh = f.path("ball.stl");
    let o = recover(&f, &[&scan, &hf, "-o", "out/here/", "-o", &mesh, "--json"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    for name in [
        "fitted.hf",
        "deviation.ply",
        "report.html",
        "part.step",
        "scan.txt",
    ] {
        assert!(f.0.join("out/here").join(name).exists(), "{name}");
    }
    assert!(f.0.join("ball.stl").exists() && !f.0.join("isoform-recover").exists());
    // A folder of the user's own: what is not written stays, and is told of.
    fs::create_dir(f.0.join("mine")).expect("a folder");
    f.file("mine/part.step", "by hand");
    let plane = "-- @param a[1] height z\nm(x[3], a[1]) { m = a[1] - x[3]; }\n";
    let o = recover(&f, &[&scan, &f.file("plane.hf", plane), "-o", "mine"]);
    assert_eq!(
        (code(&o), f.text("mine/part.step")),
        (3, "by hand".to_owned())
    );
    assert!(
        stderr(&o).contains("part.step is of an earlier run"),
        "{}",
        stderr(&o)
    );
    // The results of another scan are not replaced without a word.
    let moved = f.file("moved.xyz", f.text("ball.xyz"));
    let o = recover(&f, &[&moved, &hf, "-o", "out/here"]);
    assert!(stderr(&o).contains("are replaced"), "{}", stderr(&o));
}

#[test]
fn the_verb_that_does_it_is_named() {
    let f = Folder::new("pointers");
    let (scan, hf) = (f.ball(0.0), f.file("ball.hf", BALL));
    let step = f.path("part.step");
    let stp = f.path("part.STP");
    for (args, hint) in [
        (vec!["convert", &scan, "-o", &step], "isoform recover"),
        (
            vec!["convert", &scan, "-o", "-", "--to", "step"],
            "isoform recover",
        ),
        (vec!["convert", &hf, "-o", &step], "isoform brep"),
        (vec!["mesh", &hf, "-o", &step], "isoform brep"),
        (vec!["mesh", &hf, "-o", &stp], "isoform brep"),
        (vec!["mesh", &hf, "-o", "-", "--to", "step"], "isoform brep"),
        (vec!["recognize", &scan, "-o", &step], "isoform recover"),
        (
            vec!["recognize", &scan, "-o", "part.msh"],
            "isoform recover",
        ),
        (vec!["recognize", &scan, "-o", "part.what"], ".json"),
        (vec!["recover", &scan, &hf, "-o", "-"], "--json"),
        (vec!["fit", &scan, &hf, "-o", "-"], "--json"),
        (vec!["fit", &scan], "isoform recover"),
    ] {
        let o = isoform(&args);
        let said = stderr(&o);
        let told = said.split("try: ").nth(1).unwrap_or_default();
        assert!(code(&o) == 1 && told.contains(hint), "{args:?}: {said}");
    }
    for args in [
        ["mesh", &hf, "--size", "-2"],
        ["recognize", &scan, "--tol", "-2"],
    ] {
        let o = isoform(&args);
        let said = stderr(&o);
        assert!(
            code(&o) == 1 && said.contains("a positive number is expected"),
            "{said}"
        );
    }
    let o = isoform(&["compare", &scan, "--json"]);
    let message = document(&o)["error"]["message"].to_string();
    assert!(message.contains("<SECOND>"), "{message}");
}

#[test]
fn a_solid_of_a_doubtful_fit_has_to_be_forced() {
    let f = Folder::new("recover-doubt");
    let (scan, step) = (f.ball(0.0), f.path("cube.step"));
    let cube = "-- @param a[1] half length\n\
        m(x[3], a[1]) { m = min(min(a[1] - abs(x[1] - 1), a[1] - abs(x[2] - 2)), a[1] - abs(x[3] - 3)); }\n";
    let hf = f.file("cube.hf", cube);
    let o = recover(&f, &[&scan, &hf, "-o", &step]);
    assert_eq!(code(&o), 3, "{}", stderr(&o));
    assert!(!f.0.join("cube.step").exists());
    assert!(
        stdout(&o).contains("no solid") && stdout(&o).contains("--force"),
        "{}",
        stdout(&o)
    );
    let o = recover(&f, &[&scan, &hf, "-o", &step, "--force"]);
    assert_eq!(code(&o), 3, "{}", stderr(&o));
    assert!(f.0.join("cube.step").exists() && stdout(&o).contains("solid of the fit"));
    assert!(
        stderr(&o).contains("Ctrl-C keeps the fit"),
        "{}",
        stderr(&o)
    );
    // Phases are said once, however often they come again.
    let said = stderr(&o);
    let mut phases: Vec<&str> = said.lines().filter(|l| l.ends_with(" ...")).collect();
    let all = phases.len();
    phases.sort_unstable();
    phases.dedup();
    assert!(all > 2 && phases.len() == all, "{said}");
}

#[test]
fn conversions() {
    let f = Folder::new("convert");
    let scan = f.ball(0.0);
    assert_eq!(
        code(&isoform(&["convert", &scan, "-o", &f.path("b.ply")])),
        0
    );
    let o = isoform(&["convert", &f.path("b.ply"), "-o", "-", "--to", "xyz"]);
    let numbers = |t: &str| {
        t.lines()
            .filter(|l| !l.starts_with('#'))
            .flat_map(str::split_whitespace)
            .map(|w| w.parse::<f64>())
            .collect::<Result<Vec<_>, _>>()
    };
    assert_eq!(
        numbers(&stdout(&o)),
        numbers(&f.text("ball.xyz")),
        "every bit comes back"
    );
    let hf = f.file("t.hf", BALL);
    assert_eq!(
        code(&isoform(&[
            "convert",
            &hf,
            "-o",
            &f.path("v.hf"),
            "--params",
            "1,2,3,2"
        ])),
        0
    );
    let o = isoform(&[
        "compare",
        &f.path("v.hf"),
        &scan,
        "--json",
        "--tolerance",
        "0.5",
    ]);
    assert!(
        document(&o)["second_to_first"]["max"]
            .as_f64()
            .expect("a number")
            < 2e-3,
        "{}",
        stdout(&o)
    );
    assert_eq!(
        code(&isoform(&[
            "compare",
            &f.path("v.hf"),
            &scan,
            "--tolerance",
            "1e-6"
        ])),
        3
    );
    for (input, output, exit) in [(&hf, "x.ply", 1), (&scan, "x.hf", 1), (&scan, "x.las", 2)] {
        let o = isoform(&["convert", input, "-o", &f.path(output), "--json"]);
        assert_eq!(
            (code(&o), document(&o)["ok"].as_bool()),
            (exit, Some(false)),
            "{output}"
        );
    }
    let o = isoform(&["compare", &hf, &hf, "--json"]);
    assert_eq!(
        (code(&o), document(&o)["error"]["code"].as_str()),
        (1, Some("usage"))
    );
}

#[test]
fn points_without_a_distance_are_told_of() {
    let f = Folder::new("undefined");
    let half = "my_model(x[3], a[1]) { my_model = 2*sqrt(x[1]) - x[1]^2 - x[2]^2 - x[3]^2; }";
    let half = f.file("half.hf", half);
    let scan: String = (0..400)
        .map(|i| format!("{} {} 0.25\n", i % 2 * 2 - 1, i))
        .collect();
    let scan = f.file("scan.xyz", &scan);
    let of = |more: &[&str]| isoform(&[&["compare", &scan, &half, "--json"], more].concat());
    let o = of(&["--tolerance", "1e9"]);
    let d = document(&o);
    assert_eq!(
        (code(&o), d["within_tolerance"].as_bool()),
        (3, Some(false))
    );
    let there = &d["first_to_second"];
    assert_eq!(
        (there["samples"].as_u64(), there["undefined"].as_u64()),
        (Some(400), Some(200))
    );
    assert!(
        stderr(&o).contains("200 of 400 points of the first"),
        "{}",
        stderr(&o)
    );
    assert_eq!(code(&of(&[])), 0);
}

#[test]
fn every_verb_has_an_example() {
    for verb in ["fit", "recover", "eval", "inspect", "convert", "compare"] {
        let help = stdout(&isoform(&[verb, "--help"]));
        assert!(
            help.contains(&format!("isoform {verb}")) && help.contains("Example"),
            "{verb}"
        );
    }
    for shell in ["bash", "zsh", "fish"] {
        assert!(stdout(&isoform(&["completions", shell])).contains("isoform"));
    }
}
