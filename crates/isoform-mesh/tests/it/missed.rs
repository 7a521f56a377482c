//! Features far smaller than the triangles of a mesh, which it misses.

use isoform_field::Pieces;
use isoform_field::hyperfun::{Mode, Model};
use isoform_geom::{Point3, distance_squared};
use isoform_mesh::{Control, Meshed, Options, WarningKind, Witness, mesh};

/// A block with sides of 1.6.
const BLOCK: &str = "array c[3]; b = min(min(0.8 - abs(x[1]), 0.8 - abs(x[2])), 0.8 - abs(x[3]));";

fn meshed(body: &str) -> (Pieces, Meshed) {
    let text = format!("m(x[3], a[1]) {{ {body} }}");
    let model = Model::parse(&text, Mode::Default).expect("a program");
    let solid = Pieces::of_model(&model, &[0.0]).expect("an expression");
    let options = Options {
        size: 0.07,
        surface_only: true,
        ..Options::default()
    };
    let made = mesh(&solid, &options, &Control::default()).expect("a mesh");
    (solid, made)
}

fn is_warned(made: &Meshed) -> bool {
    made.warnings.iter().any(|w| w.kind == WarningKind::Missed)
}

/// Witnesses on surfaces other than those of the block.
fn foreign<'a>(solid: &'a Pieces, made: &'a Meshed) -> Vec<&'a Witness> {
    use isoform_geom::Solid;
    let is_foreign = |w: &&Witness| !solid.names()[w.piece as usize].starts_with("b.");
    made.missed.witnesses.iter().filter(is_foreign).collect()
}

#[test]
fn a_bore_a_seventieth_of_the_size_is_missed_and_said() {
    let (solid, made) = meshed(&format!(
        "{BLOCK} c = [0.21, -0.13, 0]; m = min(b, 0 - hfCylinderZ(x, c, 0.001));"
    ));
    assert!(is_warned(&made));
    let found = foreign(&solid, &made);
    assert!(!found.is_empty());
    for w in found {
        let r = (w.at[0] - 0.21).hypot(w.at[1] + 0.13);
        assert!((r - 0.001).abs() < 1e-9, "{r}");
    }
}

#[test]
fn an_oblique_bore_whose_function_cancels_is_found() {
    // 1e-4 in radius: r² - u² - e² has lost half of its digits there.
    let (_, made) = meshed(&format!(
        "{BLOCK} u = 0.6*(x[1] - 0.11) + 0.8*(x[2] - 0.05); c = [0, 0, 0];
         r = (x[1] - 0.11)^2 + (x[2] - 0.05)^2 + (x[3] - 0.02)^2;
         m = min(b, r - u*u - 0.0001^2);"
    ));
    assert!(is_warned(&made));
}

#[test]
fn tiny_balls_beside_and_inside_are_missed_and_said() {
    let small: [(&str, Point3); 2] = [
        ("m = max(b, hfSphere(x, c, 0.001));", [0.96, -0.17, 0.3]),
        (
            "m = min(b, 0 - hfSphere(x, c, 0.001));",
            [0.2169, -0.1717, 0.3],
        ),
    ];
    for (formula, [x, y, z]) in small {
        let (solid, made) = meshed(&format!("{BLOCK} c = [{x}, {y}, {z}]; {formula}"));
        assert!(is_warned(&made), "{formula}");
        let found = foreign(&solid, &made);
        assert!(!found.is_empty());
        for w in found {
            let r = distance_squared(w.at, [x, y, z]).sqrt();
            assert!((r - 0.001).abs() < 1e-9, "{r}");
        }
    }
}

#[test]
fn a_pimple_lower_than_chords_is_no_fault_of_the_mesh_but_has_witnesses() {
    let (solid, made) = meshed(&format!(
        "{BLOCK} c = [0.2169, -0.1717, 0.8]; m = max(b, hfSphere(x, c, 0.003));"
    ));
    assert!(!is_warned(&made));
    let found = foreign(&solid, &made);
    assert!(!found.is_empty() && found.iter().all(|w| w.near));
}

#[test]
fn a_bump_of_a_smooth_function_has_witnesses_on_it() {
    let body = "r = (x[1] - 0.2)^2 + (x[2] + 0.1)^2;
        b = min(min(0.9 - abs(x[1]), 0.9 - abs(x[2])), x[3] + 0.9);
        m = min(b, 0.8 + 0.001*exp(0 - r/0.001^2) - x[3]);";
    let (_, made) = meshed(body);
    let height = |w: &Witness| w.at[2] - 0.8;
    let highest = made.missed.witnesses.iter().map(height).fold(0.0, f64::max);
    assert!((1e-5..=0.001).contains(&highest), "{highest}");
}

#[test]
fn nothing_is_missed_of_what_the_mesh_has() {
    let whole = [
        "m = 1 - sqrt(x[1]^2 + x[2]^2 + x[3]^2);",
        "array c[3]; c = [0, 0, 0]; m = hfTorusZ(x, c, 1, 0.4);",
        "m = min(min(1 - abs(x[1]), 1 - abs(x[2])), x[1]^2 + x[2]^2 - 0.04) & (0.5 - abs(x[3]));",
        // A block that two others lie in, with faces in common.
        "b = min(min(1 - abs(x[1]), 1 - abs(x[2])), 0.5 - abs(x[3]));
         c = min(min(1 - abs(x[1]), 0.5 - abs(x[2])), 0.5 - abs(x[3])); m = max(b, c);",
        // Two balls joined smoothly.
        "array c[3], d[3]; c = [-0.5, 0, 0]; d = [0.5, 0, 0];
         m = hfBlendUni(hfSphere(x, c, 0.6), hfSphere(x, d, 0.6), 0.1, 0.3, 0.3);",
    ];
    for body in whole {
        let (_, made) = meshed(body);
        let far = made.missed.witnesses.iter().filter(|w| !w.near).count();
        assert_eq!((far, &made.warnings[..]), (0, &[][..]), "{body}");
    }
}
