//! Files of another kind than a verb takes are named, with the verbs that take them.

use crate::common::{Folder, SPHERE, code, document, isoform, stderr, stdout};

const BALL: &str = "m(x[3], a[1]) { m = 1 - x[1]^2 - x[2]^2 - x[3]^2; }";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
    property float z\nend_header\n0 0 0\n";
const MSH: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 0 0 0\n$EndNodes\n";

/// What the verb says, which must fail as input of another kind does.
fn said(args: &[&str]) -> String {
    let o = isoform(&[args, &["--json"]].concat());
    let error = &document(&o)["error"];
    assert_eq!(code(&o), 2, "{args:?}: {}", stderr(&o));
    assert_eq!(error["code"], "other-kind", "{args:?}: {error}");
    let text = |key: &str| error[key].as_str().expect("text").to_owned();
    format!("{} / {}", text("message"), text("hint"))
}

#[test]
fn files_of_another_kind_are_named() {
    let f = Folder::new("kinds");
    let hf = f.file("ball.hf", BALL);
    let txt = f.file("ball.txt", BALL);
    let ply = f.file("scan.ply", PLY);
    let xyz = f.file("scan.xyz", "0 0 0\n1 2 3\n");
    let msh = f.file("part.msh", MSH);
    let map = f.file("map.json", SPHERE);
    let png = f.file("picture.png", "\u{89}PNG\r\n");
    // A name that says something else than the content.
    let wrong = f.file("wrong.hf", PLY);
    for (args, words) in [
        (
            vec!["mesh", &ply],
            ["PLY", "not a model", "isoform fit, recover"],
        ),
        (vec!["mesh", &wrong], ["PLY", "not a model", "--adapt"]),
        (
            vec!["brep", &xyz],
            ["points (XYZ text)", "not a model", "recognize"],
        ),
        (
            vec!["parameterize", &msh],
            ["a mesh (Gmsh", "not a model", "compare"],
        ),
        (
            vec!["mesh", &map],
            ["a rational map", "not a model", "isoform triangulate"],
        ),
        (vec!["brep", &png], ["an image", "not a model", ""]),
        (
            vec!["eval", &ply, "--points", &xyz],
            ["PLY", "not a model", "fit"],
        ),
        (
            vec!["inspect", &hf],
            ["a HyperFun program", "not points", "isoform mesh, brep"],
        ),
        (
            vec!["inspect", &txt],
            ["a HyperFun program", "not points", "isoform mesh, brep"],
        ),
        (
            vec!["recognize", &map],
            ["a rational map", "not points", "isoform triangulate"],
        ),
        (
            vec!["recognize", &msh],
            ["a mesh (Gmsh", "not points", "isoform convert makes"],
        ),
        (
            vec!["mesh", &hf, "--adapt", &hf],
            ["a HyperFun program", "not a mesh", "eval"],
        ),
        (
            vec!["mesh", &hf, "--adapt", &xyz],
            ["(XYZ text)", "not a mesh", "fit"],
        ),
        (
            vec!["triangulate", &hf],
            ["a HyperFun program", "not a map", "isoform mesh"],
        ),
    ] {
        let said = said(&args);
        for word in words {
            assert!(said.contains(word), "{args:?}: {word}: {said}");
        }
    }
}

#[test]
fn a_misspelled_program_is_still_one() {
    let f = Folder::new("kinds-misspelled");
    for name in ["m.hf", "m.txt", "m"] {
        let path = f.file(name, BALL.replace("1 -", "1 +* -"));
        let o = isoform(&["mesh", &path, "--json"]);
        assert_eq!(
            document(&o)["error"]["code"],
            "syntax",
            "{name}: {}",
            stderr(&o)
        );
    }
    let damaged = f.file("damaged.ply", PLY.replace("0 0 0", "0 0"));
    let o = isoform(&["inspect", &damaged, "--json"]);
    assert_ne!(
        document(&o)["error"]["code"],
        "other-kind",
        "{}",
        stderr(&o)
    );
}

/// Exit 3 with a certificate that holds: the table says why.
#[test]
fn what_is_left_open_is_listed() {
    let f = Folder::new("kinds-open");
    let text = "m(x[3], a[1]) {\n p = x[1]; n = 0;\n f = 1 - x[1]^2 - x[2]^2 - x[3]^2;\n \
        while p > 0.5 loop p = p - 0.5; n = n + 1; endloop;\n m = f + 0*n;\n}";
    let o = isoform(&[
        "mesh",
        &f.file("loop.hf", text),
        "--size=0.4",
        "--box=-1.1,-1.1,-1.1,1.1,1.1,1.1",
    ]);
    let table = stdout(&o);
    assert_eq!(code(&o), 3, "{}", stderr(&o));
    assert!(
        table.contains("LEFT OPEN    the program is no expression"),
        "{table}"
    );
    let verdict = "certificate  holds of the mesh itself, but something is left open";
    assert!(table.contains(verdict), "{table}");
}

#[test]
fn surfaces_go_from_3mf_to_stl() {
    let f = Folder::new("kinds-3mf");
    let ball = f.file("ball.hf", BALL);
    let [made, stl] = ["ball.3mf", "ball.stl"].map(|n| f.path(n));
    let o = isoform(&["mesh", &ball, "--size=0.4", "-o", &made]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let o = isoform(&["convert", &made, "-o", &stl, "--json"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
    let counts = &document(&o)["counts"];
    assert!(counts["triangles"].as_u64() > Some(100), "{counts}");
    let o = isoform(&["compare", &made, &stl, "--tolerance=1e-6"]);
    assert_eq!(code(&o), 0, "{}", stderr(&o));
}
