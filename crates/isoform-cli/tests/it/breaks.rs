//! What must not break, whatever comes in: inputs stay, runs end, and what was made is kept.

use crate::common::{Folder, code, document, isoform, stderr};
use std::fs;
use std::time::{Duration, Instant};

const BALL: &str = "-- @param a[1] radius length\n\
    my_model(x[3], a[1]) { my_model = a[1]^2 - x[1]^2 - x[2]^2 - x[3]^2; }";

/// A block with rounded edges: r - outside - inside, where the piece of the inside for 0 is a
/// function of itself.
const ROUNDED: &str = "my_model(x[3], a[4])\n{\n  r = a[4];\n\
    qx = abs(x[1]) - a[1]/2 + r;\n  qy = abs(x[2]) - a[2]/2 + r;\n  qz = abs(x[3]) - a[3]/2 + r;\n\
    ox = max(qx, 0); oy = max(qy, 0); oz = max(qz, 0);\n\
    out = sqrt(ox^2 + oy^2 + oz^2);\n  in = min(max(qx, max(qy, qz)), 0);\n\
    my_model = r - out - in;\n}";

/// A cylinder that touches a plate along a line.
const TOUCHING: &str = "my_model(x[3], a[1])\n{\n\
    c = 1 - x[1]^2 - (x[3]-1)^2; c2 = min(c, 1-abs(x[2]));\n\
    pl = min(min(min(2-abs(x[1]),2-abs(x[2])), 0-x[3]), x[3]+0.5);\n\
    my_model = max(c2, pl);\n}";

/// A ball whose function has no value outside of a cylinder.
const NO_NUMBER: &str =
    "my_model(x[3], a[1]) { my_model = sqrt(1 - x[1]^2 - x[2]^2) - abs(x[3]); }";

/// Programs that jump, after which the mesher was left with tetrahedra of vertices that were gone,
/// and with a label of no piece among those that hold a vertex; and the sizes that showed it.
const JUMPING: [(&str, &str); 2] = [
    (
        "0.4",
        "my_model(x[3], a[1]) { array c[3], p[3]; c = [0,0,0]; p = [0,0,0];\n\
         f = hfSphere(x, c, 1); p[1] = x[1] - 0.25*floor(x[1]/0.25);\n\
         f = f & (p[1] - 0.08333333333333333);\n f = f + floor(x[1]/0.25); my_model = f; }",
    ),
    (
        "0.5",
        "my_model(x[3], a[1]) { array c[3]; c = [0,0,0];\n\
         f = hfCylinderZ(x, c, 0.7) & (0.8 - abs(x[3]));\n\
         if x[2] < -0.1 then f = f; else f = 0.25; endif;\n\
         f = f + 0.25*sign(x[1] - 0.1); f = f * floor(2*x[3]); my_model = f; }",
    ),
];

/// Points of a ball about 0.
fn ball(radius: f64) -> String {
    let point = |i: u32| {
        let (t, z) = (f64::from(i) * 2.4, (f64::from(i) + 0.5) / 150.0 - 1.0);
        let s = (1.0 - z * z).sqrt();
        let p = [s * t.cos(), s * t.sin(), z].map(|v| radius * v);
        format!("{:?} {:?} {:?}\n", p[0], p[1], p[2])
    };
    (0..300).map(point).collect()
}

/// Whether a run is refused with exit 1 and leaves all files of the folder as they are.
fn is_refused(f: &Folder, args: &[&str]) {
    let all = || {
        let mut files: Vec<(String, Vec<u8>)> = fs::read_dir(&f.0)
            .expect("a folder")
            .map(|e| e.expect("an entry").path())
            .map(|p| (p.display().to_string(), fs::read(&p).expect("a file")))
            .collect();
        files.sort();
        files
    };
    let before = all();
    let o = isoform(args);
    let said = stderr(&o);
    assert_eq!(code(&o), 1, "{args:?}: {said}");
    for part in ["would be overwritten", "because", "try:", "--force"] {
        assert!(said.contains(part), "{args:?}: {said}");
    }
    assert!(before == all(), "{args:?} changed a file");
}

#[test]
fn no_verb_writes_over_what_it_reads() {
    let f = Folder::new("overwrite");
    let (hf, scan) = (f.file("t.hf", BALL), f.file("scan.xyz", ball(2.0)));
    let bounds = f.file("b.json", "{}");
    let map = f.file(
        "map.json",
        r#"{"X": "2*s", "Y": "2*t", "Z": "s^2 + t^2 - 1", "W": "s^2 + t^2 + 1"}"#,
    );
    let sizes = f.file("sizes.csv", "x,y,z,length\n0,0,0,1\n");
    let obj = f.file("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let other = f.path(&format!(
        "../{}/./scan.xyz",
        f.0.file_name().expect("a name").display()
    ));
    let fit = ["fit", &scan, "-t", &hf, "--bounds", &bounds, "-o"];
    for output in [&scan, &other, &hf, &bounds] {
        is_refused(&f, &[&fit[..], &[output]].concat());
    }
    // One output of several suffices, as does the second file that is read.
    is_refused(&f, &[&fit[..], &[&f.path("new.hf"), "-o", &scan]].concat());
    is_refused(&f, &["recover", &scan, &hf, "-o", &scan]);
    is_refused(&f, &["mesh", &hf, "--adapt", &obj, "-o", &obj]);
    is_refused(&f, &["mesh", &hf, "--sizes", &sizes, "-o", &sizes]);
    is_refused(&f, &["eval", &hf, "--points", &scan, "-o", &scan]);
    is_refused(&f, &["eval", &hf, "--points", &scan, "-o", &hf]);
    is_refused(&f, &["convert", &scan, "-o", &scan]);
    is_refused(&f, &["convert", &hf, "--params", "2", "-o", &hf]);
    is_refused(&f, &["parameterize", &hf, "--trace", &hf]);
    is_refused(&f, &["triangulate", &map, "--box", "2", "--report", &map]);
    // The code is for programs.
    let o = isoform(&["convert", &scan, "-o", &scan, "--json"]);
    assert_eq!(document(&o)["error"]["code"], "overwrites-input");

    let before = fs::read(&hf).expect("a file");
    let o = isoform(&["convert", &hf, "--params", "2", "-o", &hf, "--force"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    assert_ne!(before, fs::read(&hf).expect("a file"));
    // What is not read may be written again.
    let old = f.file("old.xyz", "");
    assert_eq!(code(&isoform(&["convert", &scan, "-o", &old])), 0);
    assert!(fs::metadata(&old).is_ok_and(|m| m.len() > 1000));
}

#[cfg(unix)]
#[test]
fn links_to_an_input_are_that_input() {
    let f = Folder::new("overwrite-links");
    let scan = f.file("scan.xyz", ball(2.0));
    std::os::unix::fs::symlink("scan.xyz", f.0.join("soft.xyz")).expect("a link");
    fs::hard_link(&scan, f.0.join("hard.xyz")).expect("a link");
    for link in ["soft.xyz", "hard.xyz"] {
        is_refused(&f, &["convert", &scan, "-o", &f.path(link)]);
        is_refused(&f, &["convert", &f.path(link), "-o", &scan]);
    }
    // Devices are no files that could be lost.
    let o = isoform(&["convert", &scan, "--to", "xyz", "-o", "/dev/null"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
}

#[test]
fn a_block_with_rounded_edges_is_meshed() {
    let f = Folder::new("rounded");
    let hf = f.file("r.hf", ROUNDED);
    let o = isoform(&[
        "mesh",
        &hf,
        "--params",
        "20,30,40,3",
        "--size",
        "3",
        "--json",
    ]);
    let j = document(&o);
    assert_eq!(
        (code(&o), &j["certificate"]["ok"]),
        (0, &true.into()),
        "{}",
        stderr(&o)
    );
    let volume = j["certificate"]["volume"].as_f64().expect("a volume");
    // 23340.85 exactly; flat faces of edge 3 cut off the rounded edges.
    assert!((volume / 23_340.849 - 1.0).abs() < 0.01, "{volume}");
}

#[test]
fn touching_bodies_are_meshed_or_the_fault_is_placed() {
    let f = Folder::new("touching");
    let hf = f.file("t.hf", TOUCHING);
    let msh = f.path("t.msh");
    let size = if isoform_testdata::is_full() {
        "0.15"
    } else {
        "0.25"
    };
    let o = isoform(&["mesh", &hf, "--size", size, "-o", &msh, "--json"]);
    let j = document(&o);
    assert!([0, 3].contains(&code(&o)), "{}: {}", code(&o), stderr(&o));
    assert!(f.0.join("t.msh").exists());
    let failures = j["certificate"]["failures"].as_array().map_or(0, Vec::len);
    assert_eq!(
        code(&o) == 3,
        failures > 0 || j["warnings"] != serde_json::json!([]),
        "{j}"
    );
}

#[test]
fn a_function_that_is_no_number_is_refused() {
    let f = Folder::new("no-number");
    let hf = f.file("n.hf", NO_NUMBER);
    for region in [&["--box=-2,-2,-2,2,2,2"][..], &[]] {
        let o = isoform(&[&["mesh", &hf, "--size", "0.15", "--json"], region].concat());
        let j = document(&o);
        assert_eq!(
            (code(&o), &j["error"]["code"]),
            (4, &"not-a-number".into()),
            "{j}"
        );
        assert!(j["error"]["where"]["at"].is_array(), "{j}");
    }
}

/// The square root does not exist beyond x = 1, where the ball goes on; on average over a cell the
/// cut is far outside, so that it decides nothing wherever it is a number.
#[test]
fn a_piece_that_is_no_number_within_the_solid_is_found() {
    let f = Folder::new("hidden-no-number");
    let ball = "my_model(x[3], a[1]) { ball = 4 - x[1]^2 - x[2]^2 - x[3]^2;";
    let within = f.file(
        "in.hf",
        format!("{ball} my_model = ball & (30 - sqrt(1 - x[1])); }}"),
    );
    let beyond = f.file(
        "out.hf",
        format!("{ball} my_model = ball & (30 - sqrt(9 - x[1])); }}"),
    );
    let fails = f.file(
        "no.hf",
        format!("{ball} k = 1/a[1]; my_model = ball & (1 - k*x[1]); }}"),
    );
    for (verb, file) in [("mesh", "a.stl"), ("brep", "a.step")] {
        let out = f.file(file, "");
        let o = isoform(&[verb, &within, "-o", &out, "--force", "--json"]);
        let j = document(&o);
        assert_eq!(
            (code(&o), &j["error"]["code"]),
            (4, &"not-a-number".into()),
            "{j}"
        );
        let o = isoform(&[verb, &beyond, "-o", &out, "--force"]);
        assert_eq!(code(&o), 0, "{}", stderr(&o));
        // Division by zero, whatever the point.
        let o = isoform(&[
            verb, &fails, "--params", "0", "-o", &out, "--force", "--json",
        ]);
        let j = document(&o);
        assert_eq!((code(&o), &j["error"]["code"]), (2, &"run".into()), "{j}");
    }
}

#[test]
fn a_time_limit_ends_what_takes_longer() {
    let f = Folder::new("limits");
    let cases = [
        // A mesh of a great many tetrahedra; and a function that takes long for one value.
        f.file("fine.hf", BALL),
        f.file(
            "slow.hf",
            "my_model(x[3], a[1]) { f = 1 - x[1]^2 - x[2]^2 - x[3]^2; i = 0;\n\
             while i < 300000 + x[1] loop f = f - 0*i; i = i + 1; endloop; my_model = f; }",
        ),
    ];
    for hf in &cases {
        for verb in [
            &[
                "mesh",
                "--params",
                "1",
                "--size",
                "0.01",
                "--box=-2,-2,-2,2,2,2",
            ][..],
            &[
                "parameterize",
                "--params",
                "1",
                "--degree",
                "5,5",
                "--box",
                "2",
            ],
        ] {
            let started = Instant::now();
            let o = isoform(
                &[
                    &verb[..1],
                    &[hf, "--time-limit", "300ms", "--json"],
                    &verb[1..],
                ]
                .concat(),
            );
            let took = started.elapsed();
            // Half a second above the limit is promised; the rest is for a busy machine.
            assert!(took < Duration::from_secs(6), "{hf} {verb:?}: {took:?}");
            let j = document(&o);
            match code(&o) {
                0 | 3 => {}
                4 => assert_eq!(j["error"]["code"], "time-limit", "{j}"),
                other => panic!("{hf} {verb:?}: exit {other}, {}", stderr(&o)),
            }
        }
    }
}

#[test]
fn programs_nested_deeply_end() {
    let f = Folder::new("deep");
    let all = |n: usize, one: &str| one.repeat(n);
    let body = |text: String| {
        format!("my_model(x[3], a[1]) {{ f = 1 - x[1]^2 - x[2]^2 - x[3]^2; {text} }}")
    };
    let n = 100_000;
    let programs = [
        (
            "parentheses",
            body(format!("my_model = {}f{};", all(n, "("), all(n, ")"))),
        ),
        (
            "union",
            body(format!("my_model = f{};", all(n, "|(f-x[1])"))),
        ),
        (
            "blends",
            body(format!(
                "my_model = {}f{};",
                all(n, "hfBlendUni("),
                all(n, ",f,1,1,1)")
            )),
        ),
        // One after the other: the expression is as deep, though the text is not.
        (
            "statements",
            body(all(20_000, "f = hfBlendUni(f, x[1], 0.1, 0.2, 0.2); ") + "my_model = f;"),
        ),
        (
            "sides",
            body(all(20_000, "f = 0.9 - abs(f); ") + "my_model = f;"),
        ),
        (
            "products",
            body(all(20_000, "f = 2*(f | x[1]); ") + "my_model = f;"),
        ),
    ];
    let (points, scan) = (f.file("p.csv", "0.1,0.2,0.3\n"), f.file("s.xyz", ball(1.0)));
    // Each program meets two of the verbs at least.
    let step = isoform_testdata::cases(1, 2);
    for (n, (name, text)) in programs.into_iter().enumerate() {
        let hf = f.file(&format!("{name}.hf"), text);
        let verbs = [
            &["eval", &hf, "--points", &points][..],
            &["fit", &scan, "-t", &hf],
            &["mesh", &hf, "--size", "0.5", "--box=-2,-2,-2,2,2,2"],
            &["parameterize", &hf, "--degree", "2,2", "--box", "1.5"],
        ];
        for verb in verbs.into_iter().skip(n % step).step_by(step) {
            let o = isoform(&[verb, &["--time-limit", "0.3s"]].concat());
            // A stack that overflows ends the process by a signal: there is no code then.
            assert!(
                matches!(o.status.code(), Some(0..=4)),
                "{name} {verb:?}: {:?}, {}",
                o.status,
                stderr(&o).chars().take(300).collect::<String>()
            );
        }
    }
}

#[test]
fn the_fit_stays_where_the_mesh_fails() {
    let f = Folder::new("stages");
    let (hf, scan) = (f.file("t.hf", BALL), f.file("scan.xyz", ball(2.0)));
    let (fitted, cloud, page) = (f.path("fitted.hf"), f.path("d.ply"), f.path("r.html"));
    let outputs = [
        "-o",
        &fitted,
        "-o",
        &cloud,
        "-o",
        &page,
        "-o",
        &f.path("m.msh"),
    ];
    // Finer than there is memory for.
    let o = isoform(
        &[
            &["recover", &scan, &hf, "--size", "1e-5", "--json"],
            &outputs[..],
        ]
        .concat(),
    );
    let j = document(&o);
    assert_eq!(
        (code(&o), &j["error"]["code"], &j["ok"]),
        (4, &"memory".into(), &false.into()),
        "{j}"
    );
    assert!(stderr(&o).contains("not meshed"), "{}", stderr(&o));
    for file in [&fitted, &cloud, &page] {
        assert!(fs::metadata(file).is_ok_and(|m| m.len() > 100), "{file}");
    }
    let radius = j["parameters"][0]["value"].as_f64().expect("a value");
    assert!((radius - 2.0).abs() < 1e-6, "{radius}");
}

/// There is a mesh, with walls where the function jumps, or none, but never an internal
/// error; it can be written.
#[test]
fn functions_that_jump_are_meshed_honestly() {
    let f = Folder::new("breaks-jump");
    for (size, text) in JUMPING.into_iter().take(isoform_testdata::cases(2, 1)) {
        let o = isoform(&[
            "mesh",
            &f.file("jump.hf", text),
            "--box=-1.5,-1.5,-1.5,1.5,1.5,1.5",
            "--size",
            size,
            "--time-limit=60s",
            "-o",
            &f.path("jump.stl"),
        ]);
        assert!(
            [0, 3, 4].contains(&code(&o)),
            "{size}: {}: {}",
            code(&o),
            stderr(&o)
        );
    }
}

/// More memory than there is: an error, and no abort.
#[test]
fn memory_that_is_not_there_is_an_error() {
    let f = Folder::new("breaks-memory");
    let ball = f.file("ball.hf", BALL);
    for (memory, size) in [("1e12", "1e-6"), ("1e15", "1e-7")] {
        let o = isoform(&[
            "mesh",
            &ball,
            "--params=1",
            "--memory",
            memory,
            "--size",
            size,
            "--json",
        ]);
        assert_eq!(code(&o), 4, "{}", stderr(&o));
        assert_eq!(document(&o)["error"]["code"], "memory", "{}", stderr(&o));
    }
}
