//! Files as terms of programs: `mesh("cube.stl")`.

use crate::common::*;
use std::f64::consts::PI;

/// The cube from -1 to 1, moved by `shift` along x.
pub(crate) fn cube(shift: f64) -> String {
    let corner = |i: usize| {
        let at = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        format!("vertex {} {} {}\n", at(0) + shift, at(1), at(2))
    };
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let mut text = "solid cube\n".to_owned();
    for [a, b, c, d] in sides {
        for t in [[a, b, c], [a, c, d]] {
            let corners = t.map(corner).concat();
            text += &format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n");
        }
    }
    text + "endsolid cube\n"
}

/// Returns the volume of a mesh, whose certificate holds.
fn volume(args: &[&str]) -> f64 {
    let o = isoform(&[&["mesh", "--json", "--surface-only", "--size", "0.3"], args].concat());
    assert_eq!(code(&o), 0, "{args:?}: {}", stderr(&o));
    let certificate = &document(&o)["certificate"];
    assert_eq!(certificate["complete"], true, "{certificate}");
    certificate["volume"].as_f64().expect("a volume")
}

/// An offset of a cube by r has Steiner's volume, an offset inward is a cube.
#[test]
fn offsets_and_shells_of_a_cube() {
    let f = Folder::new("terms");
    f.file("cube.stl", cube(0.0));
    let body = |text: &str| {
        format!("my_model(x[3], a[1]) {{ d = mesh(\"cube.stl\", 0.02); my_model = {text}; }}")
    };
    let r = 0.5_f64;
    let outer = 8.0 + 24.0 * r + 6.0 * PI * r * r + 4.0 / 3.0 * PI * r.powi(3);
    let inner = (2.0 - 2.0 * 0.3_f64).powi(3);
    for (name, text, expected) in [
        ("offset", "d + 0.5", outer),
        ("inward", "d - 0.3", inner),
        ("shell", "d & (0.3 - d)", 8.0 - inner),
    ] {
        let program = f.file(&format!("{name}.hf"), body(text));
        let found = volume(&[&program]);
        assert!(
            (found / expected - 1.0).abs() < 0.02,
            "{name}: {found}, not {expected}"
        );
    }
}

/// A value that is typed is a model, and a file of implicitize a term of one.
#[test]
fn terms_are_typed_in_place_of_a_model() {
    let f = Folder::new("typed-terms");
    let stl = f.file("cube.stl", cube(4.0));
    let found = volume(&[&format!("mesh(\"{stl}\", 0.02) - 0.2")]);
    assert!((found / 1.6_f64.powi(3) - 1.0).abs() < 0.03, "{found}");
    let points: String = (0..2000)
        .map(|i| {
            let z = (f64::from(i) + 0.5) / 1000.0 - 1.0;
            let (turn, r) = (f64::from(i) * 2.399_963, (1.0 - z * z).sqrt());
            format!("{} {} {z}\n", r * turn.cos(), r * turn.sin())
        })
        .collect();
    let (scan, function) = (f.file("ball.xyz", points), f.path("ball.json"));
    let o = isoform(&["implicitize", &scan, "-o", &function, "-q"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let program = "my_model(x[3], a[1]) { my_model = surface(\"ball.json\") & x[3]; }";
    let found = volume(&[&f.file("half.hf", program)]);
    assert!((found / (2.0 / 3.0 * PI) - 1.0).abs() < 0.04, "{found}");
}

#[test]
fn files_that_cannot_be_terms_are_refused() {
    let f = Folder::new("no-terms");
    let stl = cube(0.0);
    let last = stl.rfind("facet normal").expect("a facet");
    f.file("open.stl", format!("{}endsolid\n", &stl[..last]));
    let whole = f.file("cube.stl", &stl);
    f.file("text.json", "{}");
    // Two cubes that overlap.
    f.file("two.stl", cube(0.0) + &cube(1.0));
    let cases = [
        ("mesh(\"none.stl\")", "file-unreadable", "none.stl"),
        ("mesh(\"open.stl\")", "open-mesh", "closed"),
        ("mesh(\"two.stl\")", "crossing-mesh", "overlap"),
        ("surface(\"text.json\")", "spline", "text.json"),
        ("surface(\"cube.stl\")", "json", "cube.stl"),
        // Refused once there are too many cells, after ten seconds.
        ("mesh(\"cube.stl\", 1e-12)", "accuracy", "coefficients"),
    ];
    let tried = cases.into_iter().take(isoform_testdata::cases(6, 5));
    for (text, code_of_error, word) in tried {
        let program = format!("my_model(x[3], a[1]) {{ my_model = {text}; }}");
        let o = isoform(&["mesh", &f.file("wrong.hf", program), "--json"]);
        assert_eq!(code(&o), 2, "{text}: {}", stderr(&o));
        let error = &document(&o)["error"];
        assert_eq!(error["code"], code_of_error, "{error}");
        assert!(error.to_string().contains(word), "{error}");
    }
    let program = f.file(
        "own.hf",
        "my_model(x[3], a[1]) { my_model = mesh(\"cube.stl\"); }",
    );
    let o = isoform(&["mesh", &program, "-o", &whole, "--json"]);
    assert_eq!(code(&o), 1, "{}", stderr(&o));
    assert!(f.text("cube.stl") == stl, "overwritten");
    assert_eq!(document(&o)["error"]["code"], "overwrites-input");
    let bare = f.file("bare.hf", "my_model(x[3], a[1]) { my_model = mesh(x); }");
    assert!(stderr(&isoform(&["mesh", &bare])).contains("double quotes"));
    // `mesh` is a verb, too.
    assert!(stdout(&isoform(&["help", "mesh"])).contains("Usage: isoform mesh"));
    assert!(stdout(&isoform(&["functions", "mesh"])).contains("mesh(x, file, accuracy)"));
}
