//! Damaged and hostile files: each is read or refused, and none stops the program.

use isoform_cad::{Control, PreparedShape};
use isoform_io::{StepContent, read_step};
use isoform_testdata::{data, files};
use proptest::prelude::*;
use std::path::Path;

/// Maximum time of a file, in seconds.
const LIMIT: f64 = 20.0;

/// Reads a text and works on its shape, as the fuzzing target does; true if it has triangles.
fn work_on(text: &str) -> bool {
    let Ok(StepContent::Shape(file)) = read_step(text) else {
        return false;
    };
    let control = Control::default().for_seconds(LIMIT);
    let Ok(shape) = PreparedShape::new(file.shape, None, &control) else {
        return false;
    };
    shape.measures();
    shape.nearest([0.5, -2.0, 0.25]);
    shape.signed_distance([0.5, -2.0, 0.25]);
    true
}

#[test]
fn the_corpus_is_read_or_refused() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/read_step");
    let (mut all, mut read) = (0, 0);
    for entry in std::fs::read_dir(folder).expect("a corpus") {
        let bytes = std::fs::read(entry.expect("an entry").path()).expect("readable");
        all += 1;
        read += usize::from(work_on(&String::from_utf8_lossy(&bytes)));
    }
    assert!(read >= 9 && all > read, "{read} of {all}");
}

fn cylinder() -> String {
    std::fs::read_to_string(data("step/seamless/cyl.step")).expect("a file")
}

/// Returns the message about a cylinder with a replaced text.
fn said(from: &str, to: &str) -> String {
    let text = cylinder();
    assert!(text.contains(from), "{from}");
    match read_step(&text.replacen(from, to, 1)) {
        Err(e) => e.to_string(),
        Ok(read) => panic!("{from} {to}: {read:?}"),
    }
}

#[test]
fn what_cannot_be_read_is_named_with_its_place() {
    let circle = "CIRCLE('',#6,2.0)";
    let other = said(circle, "OFFSET_CURVE_3D('',#6,2.0,.F.,$)");
    assert!(
        other.ends_with("curves of the kind OFFSET_CURVE_3D are not read"),
        "{other}"
    );
    assert!(other.contains("line "), "{other}");
    assert!(said(circle, "CIRCLE('',#6,0.0)").ends_with("its radius must be positive"));
    assert!(said(circle, "CIRCLE('',#6,-2.0)").ends_with("its radius must be positive"));
    assert!(said(circle, "CIRCLE('',#6,1E999)").ends_with("a number is too large"));
    assert!(said(circle, "CIRCLE('',#999,2.0)").starts_with("#999: there is no such instance"));
    assert!(said("PLANE(", "OFFSET_SURFACE(").contains("OFFSET_SURFACE are not read"));
    assert!(said("ADVANCED_FACE(", "SUBFACE(").contains("faces of this kind are not read"));
    let flat = said("DIRECTION('',(0.0,0.0,1.0))", "DIRECTION('',(0.0,0.0,0.0))");
    assert!(flat.ends_with("its length is 0 or too large"), "{flat}");
    let none = said("MANIFOLD_SOLID_BREP(", "GEOMETRIC_CURVE_SET(");
    assert!(none.contains("there is no face"), "{none}");
}

#[test]
fn knots_that_exhaust_the_memory_are_refused() {
    let spline = "B_SPLINE_CURVE_WITH_KNOTS('',2,(#1,#1,#1),.UNSPECIFIED.,.F.,.F.,\
        (4294967295,3),(0.,1.),.UNSPECIFIED.)";
    let said = said("CIRCLE('',#6,2.0)", spline);
    assert!(said.ends_with("and the degree do not agree"), "{said}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn damaged_files_are_read_or_refused(
        which in 0usize..12,
        at in any::<prop::sample::Index>(),
        from in any::<prop::sample::Index>(),
        length in 0usize..12,
    ) {
        let mut all = files("step/seamless", "step");
        all.push(data("step/nurbs-cone.step"));
        all.push(data("step/revolved-spline.step"));
        let mut bytes = std::fs::read(&all[which % all.len()]).expect("a file");
        let start = bytes.windows(5).position(|w| w == b"DATA;").unwrap_or(0);
        let body = bytes.len() - start - 16;
        let (to, from) = (start + at.index(body), start + from.index(body));
        for k in 0..length {
            bytes[to + k] = bytes[from + k];
        }
        work_on(&String::from_utf8_lossy(&bytes));
    }
}
