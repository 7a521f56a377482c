//! `brep`, as a user runs it.

use crate::common::*;
use serde_json::Value;
use std::f64::consts::PI;
use std::fs;
use std::path::Path;

/// A cube of side 2 with a round hole of radius 1/2.
const HOLED: &str = "m(x[3], a[1]) { array c[3], k[3]; c = [0, 0, 0]; k = [-1, -1, -1]; \
    cube = hfBlock(x, k, 2, 2, 2); hole = hfCylinderZ(x, c, 0.5); m = cube \\ hole; }\n";
/// A cone of height 1 and radius 1/2.
const CONE: &str = "m(x[3], a[1]) { m = ((1 - x[3])/2 - sqrt(x[1]^2 + x[2]^2)) & x[3]; }\n";

/// Runs `brep MODEL ... --json`; the code and the document.
fn brep(model: &str, more: &[&str]) -> (i32, Value) {
    let o = isoform(&[&["brep", model, "--json", "-q"], more].concat());
    (code(&o), document(&o))
}

fn near(value: &Value, expected: f64) -> bool {
    value
        .as_f64()
        .is_some_and(|v| (v / expected - 1.0).abs() < 1e-12)
}

#[test]
fn help_has_an_example() {
    let help = isoform(&["brep", "--help"]);
    assert!(code(&help) == 0 && stdout(&help).contains("isoform brep part.hf -o part.step"));
}

#[test]
fn a_cube_with_a_hole_has_its_closed_forms() {
    let f = Folder::new("brep-holed");
    let model = f.file("holed.hf", HOLED);
    let (exit, j) = brep(&model, &["-o", &f.path("a.step")]);
    assert_eq!((exit, &j["certificate"]["holds"]), (0, &Value::Bool(true)));
    assert!(near(&j["volume"], 8.0 - PI / 2.0), "{}", j["volume"]);
    assert!(
        near(&j["area"], 24.0 - PI / 2.0 + 2.0 * PI),
        "{}",
        j["area"]
    );
    // A torus in kind; six faces of the cube, and two halves of the hole.
    assert_eq!((&j["euler"], &j["solids"]), (&0.into(), &1.into()));
    let faces = j["faces"].as_array().expect("faces");
    let cylinders = faces.iter().filter(|f| f["type"] == "cylinder").count();
    assert_eq!((faces.len(), cylinders), (8, 2));

    let text = fs::read_to_string(f.path("a.step")).expect("a file");
    let count = |entity: &str| text.matches(entity).count();
    assert_eq!(count("=ADVANCED_FACE("), 8);
    assert_eq!(
        count("=EDGE_CURVE("),
        j["edges"].as_u64().unwrap_or(0) as usize
    );
    assert_eq!(count("=ORIENTED_EDGE("), 2 * count("=EDGE_CURVE("));
    assert_eq!(count("=CIRCLE("), 4);
    assert!(count("=MANIFOLD_SOLID_BREP(") == 1 && text.contains("AP242_"));

    let more = ["--threads", "1", "-o", &f.path("b.step")];
    assert_eq!(brep(&model, &more).0, 0);
    assert!(fs::read_to_string(f.path("b.step")).is_ok_and(|again| again == text));
    let more = ["--ap214", "-o", &f.path("c.step")];
    assert_eq!(brep(&model, &more).0, 0);
    assert!(fs::read_to_string(f.path("c.step")).is_ok_and(|t| t.contains("AUTOMOTIVE_DESIGN")));
}

#[test]
fn voids_solids_in_them_and_apexes() {
    let f = Folder::new("brep-voids");
    let (exit, j) = brep(&f.file("nested.hf", NESTED), &["-o", &f.path("n.step")]);
    assert_eq!((exit, &j["solids"], &j["voids"]), (0, &2.into(), &1.into()));
    assert!(near(&j["volume"], 4.0 / 3.0 * PI * (27.0 - 8.0 + 1.0)));
    let text = fs::read_to_string(f.path("n.step")).expect("a file");
    assert_eq!(text.matches("=BREP_WITH_VOIDS(").count(), 1);
    let (exit, j) = brep(&f.file("cone.hf", CONE), &[]);
    assert_eq!((exit, &j["vertices"]), (0, &3.into()));
    assert!(near(&j["volume"], PI / 12.0), "{}", j["volume"]);
}

#[test]
fn a_box_cuts_with_planes() {
    let f = Folder::new("brep-box");
    let (exit, j) = brep(&f.file("cone.hf", CONE), &["--box=-1,-1,-1,1,1,0.5"]);
    // The frustum of radii 1/2 and 1/4.
    assert!(
        exit == 0 && near(&j["volume"], PI / 12.0 * 7.0 / 8.0),
        "{}",
        j["volume"]
    );
    let faces = j["faces"].as_array().expect("faces");
    assert!(faces.iter().any(|f| f["part"] == "cap.z_max"));
}

#[test]
fn what_is_no_such_solid_is_refused_with_a_reason() {
    let f = Folder::new("brep-refused");
    let cases = [
        ("unbounded", "m(x[3], a[1]) { m = x[3]; }", 4),
        ("empty", "m(x[3], a[1]) { m = 0 - 1 - x[1]*x[1]; }", 4),
        ("syntax", "m(x[3], a[1]) { m = x[1", 2),
    ];
    for (name, text, expected) in cases {
        let target = f.path(&format!("{name}.step"));
        let o = isoform(&[
            "brep",
            &f.file(&format!("{name}.hf"), text),
            "-q",
            "-o",
            &target,
        ]);
        assert_eq!(code(&o), expected, "{name}");
        assert!(
            !Path::new(&target).exists() && !stderr(&o).is_empty(),
            "{name}"
        );
    }
    // Bumps that the mesh is too coarse for.
    let rough = "m(x[3], a[1]) { m = 1 - x[1]^2 - x[2]^2 - x[3]^2 \
                 + 0.1*sin(30*x[1])*sin(30*x[2])*sin(30*x[3]); }";
    let o = isoform(&["brep", &f.file("rough.hf", rough), "-q", "--size", "1.2"]);
    let said = stderr(&o);
    assert_eq!(code(&o), 4, "{said}");
    for word in [
        "the part m turns over",
        "-o part.3mf",
        "a smaller --size",
        "a height over a plane",
    ] {
        assert!(said.contains(word), "{said}");
    }
    assert!(!said.contains("splines were found"), "{said}");
    let model = f.file("cone.hf", CONE);
    assert_eq!(
        code(&isoform(&["brep", &model, "-q", "-o", &f.path("cone.obj")])),
        1
    );
}

/// A block whose top is an egg box of slope 2: it needs more charts than a word has bits. The
/// volume below is that of the block, by symmetry.
#[test]
fn a_surface_of_many_charts_is_a_solid() {
    let f = Folder::new("brep-many-charts");
    let text = "m(x[3], a[1]) { top = 0.12*sin(16*x[1])*cos(16*x[2]) - x[3]; \
                m = min(top, min(x[3] + 0.4, min(0.5 - abs(x[1]), 0.5 - abs(x[2])))); }";
    let (exit, j) = brep(&f.file("egg.hf", text), &["--size", "0.2"]);
    assert_eq!(exit, 0, "{j}");
    assert!(kinds(&j, "spline") > 128, "{}", kinds(&j, "spline"));
    let volume = j["volume"].as_f64().expect("a volume");
    assert!((volume - 0.4).abs() < 1e-6, "{volume}");
}

/// A block of sides 20, 30 and 40 with edges and corners rounded by 3, as one function.
const ROUNDED: &str = "m(x[3], a[1]) { qx = max(abs(x[1]) - 7, 0); qy = max(abs(x[2]) - 12, 0); \
    qz = max(abs(x[3]) - 17, 0); in = min(max(abs(x[1]) - 7, max(abs(x[2]) - 12, abs(x[3]) - 17)), 0); \
    m = 3 - sqrt(qx^2 + qy^2 + qz^2) - in; }\n";

fn kinds(j: &Value, kind: &str) -> usize {
    let faces = j["faces"].as_array().expect("faces");
    faces.iter().filter(|f| f["type"] == kind).count()
}

#[test]
fn an_ellipsoid_is_eight_exact_charts_and_its_sections_are_ellipses() {
    let f = Folder::new("brep-ellipsoid");
    let text = "m(x[3], a[1]) { m = 1 - (x[1] - 5)^2/4 - x[2]^2 - 4*x[3]^2; }\n";
    let (exit, j) = brep(&f.file("whole.hf", text), &["-o", &f.path("w.step")]);
    assert_eq!((exit, kinds(&j, "spline")), (0, 8));
    assert!(near(&j["volume"], 4.0 / 3.0 * PI), "{}", j["volume"]);
    let step = fs::read_to_string(f.path("w.step")).expect("a file");
    assert_eq!(step.matches("RATIONAL_B_SPLINE_SURFACE").count(), 8);
    assert_eq!(step.matches("=B_SPLINE_CURVE").count(), 0);
    // Half of it, by a plane through the centre that is no plane of symmetry.
    let half = "m(x[3], a[1]) { m = min(1 - (x[1] - 5)^2/4 - x[2]^2 - 4*x[3]^2, \
        x[1] - 5 + x[2] - 2*x[3]); }\n";
    let (exit, j) = brep(&f.file("half.hf", half), &[]);
    assert!(exit == 0 && near(&j["volume"], 2.0 / 3.0 * PI), "{j}");
}

#[test]
fn a_rounded_block_is_taken_apart_into_exact_faces() {
    let f = Folder::new("brep-rounded");
    let (exit, j) = brep(&f.file("rounded.hf", ROUNDED), &[]);
    let count = ["plane", "cylinder", "sphere", "spline"].map(|k| kinds(&j, k));
    assert_eq!((exit, count), (0, [6, 12, 8, 0]));
    // Steiner's formula for the block of sides 14, 24 and 34 and a distance of 3.
    let (a, b, c, r) = (14.0, 24.0, 34.0, 3.0);
    let volume = a * b * c
        + 2.0 * r * (a * b + b * c + c * a)
        + PI * r * r * (a + b + c)
        + 4.0 / 3.0 * PI * r * r * r;
    assert!(near(&j["volume"], volume), "{} {volume}", j["volume"]);
}

#[test]
fn a_blend_about_an_axis_is_revolved_between_exact_faces() {
    let f = Folder::new("brep-fillet");
    let model = f.file("fillet.hf", FILLET);
    let (exit, j) = brep(&model, &["-o", &f.path("f.step")]);
    assert_eq!(
        (exit, kinds(&j, "revolved"), kinds(&j, "spline")),
        (0, 2, 0),
        "{}",
        j["certificate"]
    );
    assert!(kinds(&j, "cylinder") == 4 && kinds(&j, "plane") == 3, "{j}");
    // By rings: plate, boss, and what the blend adds, (0.3 − |t − s|)²/1.2 beyond the larger one.
    // On the blend, z = u and r = 1 + w with √u + √w = √0.3.
    let n = 2000;
    let added = (0..n)
        .map(|i| {
            let w = 0.3 * (i as f64 + 0.5) / n as f64;
            let u = (0.3f64.sqrt() - w.sqrt()).powi(2);
            2.0 * PI * (1.0 + w) * u * 0.3 / n as f64
        })
        .sum::<f64>();
    let volume = 2.0 * PI + PI + added;
    let found = j["volume"].as_f64().unwrap_or(0.0);
    assert!((found / volume - 1.0).abs() < 1e-5, "{found} {volume}");
    let splines = j["faces"].as_array().expect("faces").iter();
    let off = splines.map(|f| f["max_distance"].as_f64().unwrap_or(1.0));
    assert!(off.fold(0.0, f64::max) <= 4e-6, "a millionth of the size");
}

#[test]
fn a_larger_tolerance_needs_fewer_control_points() {
    let f = Folder::new("brep-tolerance");
    let text = "m(x[3], a[1]) { m = 1 - x[1]^4 - x[2]^4 - 2*x[3]^2; }\n";
    let model = f.file("pillow.hf", text);
    let brep = |file: &str, more: &[&str]| {
        brep(
            &model,
            &[&["--size", "0.2", "-o", &f.path(file)], more].concat(),
        )
    };
    let (exit, j) = brep("f.step", &[]);
    assert!(exit == 0 && kinds(&j, "spline") > 0, "{j}");
    // And one thread gives the bytes of two.
    assert_eq!(brep("g.step", &["--tol", "1e-4"]).0, 0);
    let size = |name: &str| fs::metadata(f.path(name)).map_or(0, |m| m.len());
    assert!(size("g.step") < size("f.step"));
    assert_eq!(brep("h.step", &["--threads", "1"]).0, 0);
    let read = |name: &str| fs::read(f.path(name)).expect("a file");
    assert!(read("h.step") == read("f.step"));
}

#[test]
fn what_is_smaller_than_the_mesh_is_said() {
    let f = Folder::new("brep-tiny");
    let block = "array c[3]; b = min(min(0.8 - abs(x[1]), 0.8 - abs(x[2])), 0.8 - abs(x[3]));";
    let tiny = [
        // A bore, a blind one, and a bump on a face.
        "c = [0.21, -0.13, 0]; m = min(b, 0 - hfCylinderZ(x, c, 0.001));",
        "c = [0.21, -0.13, 0]; m = min(b, 0 - min(hfCylinderZ(x, c, 0.001), x[3] - 0.799));",
        "m = min(min(b, x[3] + 0.3), 0.7 + 0.001*exp(0 - (x[1]^2 + x[2]^2)/0.001^2) - x[3]);",
    ];
    for (k, body) in tiny.into_iter().enumerate() {
        let text = format!("m(x[3], a[1]) {{ {block} {body} }}\n");
        let size = ["--size", "0.07"];
        let (exit, j) = brep(&f.file(&format!("{k}.hf"), &text), &size);
        let failures = j["certificate"]["failures"].to_string();
        assert!(exit == 3 && failures.contains("has surface at"), "{j}");
    }
}

#[test]
fn what_an_ellipsoid_leaves_of_an_elliptic_cylinder_has_its_volume() {
    let f = Folder::new("brep-lens");
    let text = "m(x[3], a[1]) { array c[3], d[3]; c = [0, 0, 0]; d = [0, 0, 0.7];
        t = hfRotate3DX(x, 1.378); t = hfRotate3DZ(x, -1.235);
        m = min(min(0 - hfEllipsoid(x, d, 0.8, 0.9, 0.6), x[3] + 0.4),
            min(hfEllCylZ(x, c, 0.7, 0.5), 0.3 - x[3])); }\n";
    let (exit, j) = brep(&f.file("lens.hf", text), &["--size", "0.1"]);
    // In x = 0.7 r cos t, y = 0.5 r sin t the ellipsoid's lower half is z = 0.7 - 0.6 √(1 - k r²);
    // it is below z = 0.3 up to k r² = 5/9. The integral over r is elementary, the one over t is
    // periodic and has kinks only where the limit of r reaches 1.
    let n = 200_000;
    let column = |i: usize| {
        let t = 0.5 * PI * (i as f64 + 0.5) / n as f64;
        let k = (0.7 * t.cos()).powi(2) / 0.64 + (0.5 * t.sin()).powi(2) / 0.81;
        let r = (5.0 / 9.0 / k).sqrt().min(1.0);
        let cut = 0.2 * (1.0 - (1.0 - k * r * r).powf(1.5)) / k;
        0.55 * r * r - cut + 0.35 * (1.0 - r * r)
    };
    let mean = (0..n).map(column).sum::<f64>() / n as f64;
    let volume = 4.0 * 0.35 * mean * 0.5 * PI;
    let found = j["volume"].as_f64().unwrap_or(0.0);
    assert!(
        exit == 0 && (found / volume - 1.0).abs() < 1e-7,
        "{found} {volume}"
    );
}

/// Parts that touch along a plane which is nowhere on the surface: their border is no crossing of
/// the two.
#[test]
fn parts_that_touch_have_an_edge_along_what_separates_them() {
    let f = Folder::new("brep-touching");
    let turned = "u = 0.8*x[1] + 0.6*x[3]; v = 0.8*x[3] - 0.6*x[1];
        p[1] = u - 0.3; p[2] = 0.6*x[2] + 0.8*v; p[3] = 0.6*v - 0.8*x[2] + 0.1;";
    let upright = "p[1] = x[1]; p[2] = x[2]; p[3] = x[3] - 0.3;";
    let capsule = "((1 - p[1]^2 - p[2]^2) & (2 - p[3]) & (p[3]+2))
        | (1 - p[1]^2 - p[2]^2 - (p[3]-2)^2) | (1 - p[1]^2 - p[2]^2 - (p[3]+2)^2)";
    let link = "((1 - p[3]) & (p[3]+1)) & (((3 - p[1]) & (p[1]+3) & (1 - p[2]) & (p[2]+1))
        | (1 - (p[1]-3)^2 - p[2]^2) | (1 - (p[1]+3)^2 - p[2]^2))";
    // A ring on half a torus that is stretched along the axis: by Pappus.
    let foot = "((28.09 - p[1]^2 - p[2]^2)/10 & (p[1]^2 + p[2]^2 - 22.09)/10 & p[3] & (2.7 - p[3]))
        | (0.09 - (sqrt(p[1]^2 + p[2]^2) - 5)^2 - (p[3]/1.5)^2)";
    let whole = [
        4.0 * PI + 4.0 / 3.0 * PI,
        24.0 + 2.0 * PI,
        PI * 6.0 * 2.7 + 10.0 * PI * PI * 0.3 * 0.45 / 2.0,
    ];
    let cases = [
        (turned, capsule, whole[0], ["cylinder", "sphere"]),
        (turned, link, whole[1], ["cylinder", "plane"]),
        (upright, foot, whole[2], ["cylinder", "revolved"]),
    ];
    let tried = cases.into_iter().take(isoform_testdata::cases(3, 2));
    for (n, (pose, body, volume, expected)) in tried.enumerate() {
        let text = format!("m(x[3], a[1]) {{ array p[3]; {pose} m = {body}; }}\n");
        let (exit, j) = brep(&f.file(&format!("{n}.hf"), &text), &[]);
        let found = j["volume"].as_f64().unwrap_or(0.0);
        assert_eq!(exit, 0, "{n}: {}", j["certificate"]);
        // Edges where splines meet exact faces are good to 1e-8 of the size.
        assert!((found / volume - 1.0).abs() < 1e-6, "{n}: {found} {volume}");
        assert!(expected.iter().all(|k| kinds(&j, k) > 0), "{n}: {j}");
        assert_eq!(kinds(&j, "spline"), 0, "{n}");
    }
}

/// A mesh passes by the flat tip of a cone, and by a ball on it: the full cone that it suggests is no
/// solid of the model. A ball that goes on beyond the end of a bar is no missed surface of it.
#[test]
fn tips_of_cones_and_ends_of_bars_are_where_the_model_has_them() {
    let f = Folder::new("brep-tips");
    let turned = "t = hfRotate3DX(x, 0.41); t = hfRotate3DY(x, -0.73); t = hfRotate3DZ(x, 1.1);";
    let cone = |top: &str| {
        format!(
            "m(x[3], a[1]) {{ array p[3], q[3]; {turned} p = [0, 0, 20];
                cone = hfConeZ(x, p, 0.5) & x[3]; {top} }}\n"
        )
    };
    let tips = [
        "m = cone & (19.98 - x[3]);",
        "m = cone & (19.99 - x[3]);",
        "q = [0, 0, 19.955278640450004];
         m = (cone & (19.964222912360004 - x[3])) | hfSphere(x, q, 0.02);",
    ];
    let tried = tips.into_iter().take(isoform_testdata::cases(3, 1));
    for (n, tip) in tried.enumerate() {
        let (exit, j) = brep(&f.file(&format!("tip{n}.hf"), cone(tip)), &[]);
        assert_eq!(exit, 3, "{n}: {}", j["certificate"]);
    }
    // A tip that the mesh sees.
    let (exit, j) = brep(&f.file("cone.hf", cone("m = cone & (18 - x[3]);")), &[]);
    assert_eq!(exit, 0, "{}", j["certificate"]);
    let volume = PI / 3.0 * (100.0 * 20.0 - 2.0);
    assert!(
        (j["volume"].as_f64().unwrap_or(0.0) / volume - 1.0).abs() < 1e-9,
        "{j}"
    );
    let bar = format!(
        "m(x[3], a[1]) {{ array p[3], q[3]; {turned} p = [0, 0, 0]; q = [0, 0, 20];
            rod = hfCylinderZ(x, p, 5) & x[3] & (20 - x[3]);
            m = (rod | hfSphere(x, p, 5) | hfSphere(x, q, 5)) & (20 - x[3]); }}\n"
    );
    let (exit, j) = brep(&f.file("bar.hf", &bar), &[]);
    assert_eq!(exit, 0, "{}", j["certificate"]);
    let volume = PI * 25.0 * 20.0 + PI * 250.0 / 3.0;
    assert!(
        (j["volume"].as_f64().unwrap_or(0.0) / volume - 1.0).abs() < 1e-9,
        "{j}"
    );
}

/// The volume of what an arc of the radius r about a point at the distance R beyond the axis leaves
/// of the half-plane, from the height a to b, turned about the axis.
fn spindle(far: f64, r: f64, [a, b]: [f64; 2]) -> f64 {
    let up_to = |z: f64| {
        let area = z * (r * r - z * z).sqrt() + r * r * (z / r).asin();
        (r * r + far * far) * z - z.powi(3) / 3.0 - far * area
    };
    PI * (up_to(b) - up_to(a))
}

/// Arcs that end on the axis: tips of surfaces of revolution.
#[test]
fn arcs_that_end_on_the_axis_have_tips_there() {
    let f = Folder::new("brep-spindles");
    let pose = "array c[3]; c = [0, 0, 0]; t = hfRotate3DX(x, 0.41); t = hfRotate3DY(x, -0.73);
        q = sqrt(x[1]^2 + x[2]^2);";
    // The arc of a circle of the radius 42.5 about a point 37.5 beyond the axis: 5 wide, 20 high.
    let ogive = "m = (42.5 - sqrt((q + 37.5)^2 + x[3]^2)) & x[3];";
    let reuleaux = "m = min(3 - q*q - (x[3] - 1)^2, 3 - (q + sqrt(3)/2)^2 - (x[3] + 0.5)^2);";
    // A torus whose tube of the radius 1.6 about a circle of the radius 1 covers its hole.
    let apple = "m = hfTorusZ(x, c, 1, 1.6);";
    let (tip, r) = (1.56f64.sqrt(), 1.6f64);
    let outer = spindle(-1.0, r, [-r, r]);
    let dimple = spindle(1.0, r, [tip, r]);
    let cases = [
        (
            "m = 25 - (q + 3)^2 - x[3]^2;",
            spindle(3.0, 5.0, [-4.0, 4.0]),
            2,
        ),
        (ogive, spindle(37.5, 42.5, [0.0, 20.0]), 2),
        (reuleaux, (2.0 / 3.0 - PI / 6.0) * PI * 27f64.sqrt(), 2),
        (apple, outer - 2.0 * dimple, 2),
    ];
    let tried = cases.into_iter().rev().take(isoform_testdata::cases(4, 1));
    for (n, (body, volume, revolved)) in tried.enumerate() {
        let text = format!("m(x[3], a[1]) {{ {pose} {body} }}\n");
        let target = f.path(&format!("{n}.brep.json"));
        let (exit, j) = brep(&f.file(&format!("{n}.hf"), &text), &["-o", &target]);
        assert_eq!((exit, kinds(&j, "revolved")), (0, revolved), "{n}: {j}");
        let found = j["volume"].as_f64().unwrap_or(0.0);
        assert!((found / volume - 1.0).abs() < 1e-7, "{n}: {found} {volume}");
        // As triangles, too.
        let stl = f.path(&format!("{n}.stl"));
        assert_eq!(
            code(&isoform(&["mesh", &target, "-q", "-o", &stl])),
            0,
            "{n}"
        );
    }
}

/// A boss that is flush with two sides of its block, and a post inside of its base: circles touch
/// the border of the face that they stand on.
#[test]
fn what_touches_in_a_point_has_a_vertex_there() {
    let f = Folder::new("brep-contacts");
    let boss = "array v[3], p[3]; v = [-10, -5, 0]; p = [7, 2, 0];
        m = hfBlock(x, v, 20, 10, 4) | (hfCylinderZ(x, p, 3) & x[3] & (8 - x[3]));";
    let post = "array o[3], p[3]; o = [0, 0, 0]; p = [2.5, 0, 0];
        m = (hfCylinderZ(x, o, 5) & x[3] & (10 - x[3]))
            | (hfCylinderZ(x, p, 2.5) & x[3] & (12 - x[3]));";
    let cases = [
        // The boss parts a corner of area 9 - 9π/4 from the top of the block.
        (boss, 800.0 + 36.0 * PI, [8, 2]),
        (post, 262.5 * PI, [3, 4]),
    ];
    for (n, (body, volume, counts)) in cases.into_iter().enumerate() {
        let text = format!("m(x[3], a[1]) {{ {body} }}\n");
        let (exit, j) = brep(&f.file(&format!("{n}.hf"), &text), &[]);
        let found = ["plane", "cylinder"].map(|k| kinds(&j, k));
        assert_eq!((exit, found), (0, counts), "{n}: {j}");
        assert_eq!(j["euler"], 2, "{n}");
        assert!(near(&j["volume"], volume), "{n}: {} {volume}", j["volume"]);
    }
}

/// The product of two planes vanishes on both: two faces. A plate with round corners and four holes,
/// whose thickness is such a product.
#[test]
fn a_product_of_planes_is_two_faces() {
    let f = Folder::new("brep-slab");
    let corner = |k: usize, x: f64, y: f64| {
        format!(
            "q = [{x}, {y}, 0]; k{k} = hfCylinderZ(x, q, 6) & slab; h{k} = hfCylinderZ(x, q, 3);\n"
        )
    };
    let corners: String = [(6.0, 6.0), (54.0, 6.0), (6.0, 34.0), (54.0, 34.0)]
        .iter()
        .enumerate()
        .map(|(k, (x, y))| corner(k, *x, *y))
        .collect();
    let text = format!(
        "m(x[3], a[1]) {{ array p[3], q[3];
            t = hfRotate3DX(x, 0.41); t = hfRotate3DY(x, -0.73);
            p = [0, 6, 0]; c = hfBlock(x, p, 60, 28, 5); p = [6, 0, 0]; d = hfBlock(x, p, 48, 40, 5);
            slab = x[3]*(5 - x[3]); {corners}
            m = (c | d | k0 | k1 | k2 | k3) \\ (h0 | h1 | h2 | h3); }}\n"
    );
    let (exit, j) = brep(&f.file("plate.hf", &text), &[]);
    assert_eq!(exit, 0, "{}", j["certificate"]);
    assert_eq!((kinds(&j, "plane"), kinds(&j, "cylinder")), (6, 12), "{j}");
    // The corners take as much away, 36 (4 − π), as the holes leave of 4 · 36: 60 · 40 − 144.
    assert!(
        (j["volume"].as_f64().unwrap_or(0.0) / 11_280.0 - 1.0).abs() < 1e-9,
        "{j}"
    );
}
