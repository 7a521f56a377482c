//! Discontinuous functions, and equivalent solids with walls.

use isoform_field::hyperfun::{Mode, Model};
use isoform_field::{Jump, Pieces};
use isoform_geom::{Aabb, Point3, Solid};

fn pieces(body: &str) -> (Model, Pieces) {
    let text = format!("my_model(x[3], a[1]) {{ {body} }}");
    let model = Model::parse(&text, Mode::Default).expect("a program");
    let pieces = Pieces::of_model(&model, &[]).expect("an expression");
    (model, pieces)
}

const BOX: Aabb = Aabb {
    lo: [-3.2, -1.1, -1.3],
    hi: [4.1, 1.2, 2.9],
};

/// Returns points of a low-discrepancy sequence, none of which has round coordinates.
fn points() -> impl Iterator<Item = Point3> {
    (1..4000).map(|i| {
        let share = |by: f64| (0.5 + f64::from(i) * by).fract();
        let shares = [
            share(0.819_172_513),
            share(0.671_043_607),
            share(0.549_700_478),
        ];
        std::array::from_fn(|k| BOX.lo[k] + shares[k] * (BOX.hi[k] - BOX.lo[k]))
    })
}

/// Checks that the solid with walls has the sign of the program everywhere, and that its pieces are
/// continuous.
#[test]
fn walls_keep_the_sign() {
    for body in [
        "k = floor(x[1]); my_model = min(0.5*k + 1 - x[3], 1 - abs(x[2]));",
        "k = ceil(x[1]/0.7 + x[2]); my_model = min(0.2*k + 0.5 - x[3], 1 - abs(x[2]));",
        "k = int(x[1]); my_model = min(1 + 0.3*k - x[3], x[3]);",
        "my_model = 1 + 0.4*sign(x[1]) - x[3];",
        "if x[1] < 2 then h = 1; else h = 2; endif; my_model = min(h - x[3], x[3]);",
        "if x[1] > 0.3 and not (x[2] > 0) then h = 2; else h = 1; endif; my_model = h - x[3];",
        "i = mod(x[1], 3); my_model = 1 + 0.5*i - x[3];",
        "c = x[1] + 2 - 2*floor((x[1] + 3)/2); my_model = min(2 - x[3], abs(c) - 0.5);",
        "u = x[1] - floor(x[1]) - 0.5; v = x[2] - floor(x[2]) - 0.5; my_model = 0.16 - u^2 - v^2;",
        "u = x[1] - floor(x[1]); v = x[3] - floor(x[3]); my_model = u + v - 1;",
        "k = floor(sqrt(x[1]^2 + x[2]^2)); my_model = 2 - 0.5*k - x[3];",
    ] {
        let (model, jumping) = pieces(body);
        let walled = jumping.without_jumps(BOX);
        let walled = walled.expect("walls").unwrap_or_else(|| panic!("{body}"));
        let mut evaluator = model.evaluator::<f64>();
        for p in points() {
            let f = evaluator.eval(&p, &[0.0], &[]).expect("a value");
            let mut out = [0.0];
            walled.sign_values(&[p], &mut out);
            assert!(
                (out[0] >= 0.0) == (f >= 0.0),
                "{body} at {p:?}: {out:?}, {f}"
            );
            let tree = walled.tree().value(&|k| walled.gradient(k, p).0);
            assert!((tree >= 0.0) == (f >= 0.0), "{body} at {p:?}: {tree}, {f}");
        }
        assert!(matches!(walled.without_jumps(BOX), Ok(None)), "{body}");
    }
}

/// Checks that the pattern of a motif that does not leave its cell is the union or intersection of
/// the motifs.
#[test]
fn patterns_within_their_cells_have_no_walls() {
    let (_, holes) = pieces(
        "u = x[1] - floor(x[1]) - 0.5; v = x[2] - floor(x[2]) - 0.5; my_model = u^2 + v^2 - 0.16;",
    );
    let walled = holes.without_jumps(BOX).expect("walls").expect("jumps");
    let is_step = |name: &&String| name.contains("step");
    assert_eq!(walled.names().iter().find(is_step), None);
}

#[test]
fn what_does_not_jump_stays_as_it_is() {
    for body in [
        "my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2;",
        "my_model = min(abs(x[1]), 1 - x[2]);",
        // Continuous selections.
        "array p[3], c[3]; c = [-1, -1, 0]; p[1] = x[1]; p[2] = x[2]; p[3] = x[3]; \
         ok = hfTaperZ(p, 0, 2, 1, 0.5); my_model = hfBlock(p, c, 2, 2, 2);",
        "if x[1] < 0 then h = 1; else h = 1 + x[1]; endif; my_model = h - x[3];",
    ] {
        let (_, solid) = pieces(body);
        assert!(matches!(solid.without_jumps(BOX), Ok(None)), "{body}");
    }
}

/// Checks that jumps without walls are reported with their positions in space and in the program.
#[test]
fn other_jumps_are_told() {
    let jump = |body: &str, region: Aabb| -> Jump {
        let (_, solid) = pieces(body);
        solid.without_jumps(region).expect_err("a jump")
    };
    let seam = jump("my_model = 1 + 0.1*atan2(x[2], x[1]) - x[3];", BOX);
    let what = seam.what.clone().expect("its place");
    assert_eq!(
        (what.text.as_str(), what.line, what.column),
        ("atan2", 1, 43)
    );
    assert!(seam.at[1].abs() < 1e-9 && seam.at[0] < 0.0, "{seam}");
    // A taper to 0 has scale 1 where its scale is below the tolerance of the language.
    let taper = "array p[3], c[3]; c = [-1, -1, 0]; p[1] = x[1]; p[2] = x[2]; p[3] = x[3]; \
                 ok = hfTaperZ(p, 0, 2, 1, 0); my_model = hfBlock(p, c, 2, 2, 2);";
    let around = Aabb {
        lo: [-1.0, -1.0, 0.0],
        hi: [1.0, 1.0, 2.0],
    };
    let tip = jump(taper, around);
    assert_eq!(tip.what.expect("its place").text, "hfTaperZ");
    assert!((tip.at[2] - 2.0).abs() < 1e-5);
}
