//! STEP as text: complete, numbered, exact. The acceptance checks test with OpenCASCADE that CAD
//! systems accept it.

use isoform_geom::RationalPatch;
use isoform_io::{StepFace, StepOptions, step, write_step_path};
use std::collections::{BTreeMap, BTreeSet};

fn face(patch: RationalPatch) -> StepFace {
    StepFace {
        name: "it's one".to_owned(),
        patch,
        surface: None,
    }
}

/// Returns a part of the sphere of radius 1/2 about a point by stereographic projection from its
/// pole: biquadratic and exact.
fn cap(center: [f64; 3]) -> RationalPatch {
    let a = 0.5;
    // 1, s, s² on [-a, a] in Bernstein form.
    let (one, s, s2) = ([1.0; 3], [-a, 0.0, a], [a * a, -a * a, a * a]);
    let at = |i: usize, j: usize| {
        let w = 1.0 + s2[i] * one[j] + one[i] * s2[j];
        let q = [
            s[i] * one[j],
            one[i] * s[j],
            0.5 * (one[i] * one[j] - s2[i] * one[j] - one[i] * s2[j]),
        ];
        [
            q[0] + center[0] * w,
            q[1] + center[1] * w,
            q[2] + center[2] * w,
            w,
        ]
    };
    RationalPatch::new((2, 2), (0..9).map(|k| at(k / 3, k % 3)).collect()).expect("a patch")
}

/// Returns the instances of the data section by number.
fn instances(text: &str) -> BTreeMap<usize, String> {
    let (_, data) = text.split_once("DATA;\n").expect("data");
    let (data, end) = data.split_once("ENDSEC;\n").expect("an end");
    assert_eq!(end, "END-ISO-10303-21;\n");
    let mut all = BTreeMap::new();
    for line in data.replace(",\n", ",").lines() {
        let (id, entity) = line
            .strip_suffix(';')
            .and_then(|l| l.split_once('='))
            .expect("an instance");
        let id = id
            .strip_prefix('#')
            .and_then(|n| n.parse().ok())
            .expect("a number");
        assert!(all.insert(id, entity.to_owned()).is_none(), "{id} twice");
    }
    all
}

fn references(entity: &str) -> Vec<usize> {
    let digits = |tail: &str| {
        tail.chars()
            .take_while(char::is_ascii_digit)
            .collect::<String>()
    };
    entity
        .split('#')
        .skip(1)
        .filter_map(|tail| digits(tail).parse().ok())
        .collect()
}

fn count(all: &BTreeMap<usize, String>, name: &str) -> usize {
    all.values()
        .filter(|e| e.starts_with(&format!("{name}(")))
        .count()
}

fn numbers(list: &str) -> Vec<f64> {
    list.split(|c: char| "(),".contains(c))
        .filter(|w| !w.is_empty())
        .map(|w| w.parse().expect("a number"))
        .collect()
}

#[test]
fn every_reference_is_defined_and_used() {
    let faces = [face(cap([0.1, 0.2, 0.3])), face(cap([5.0, 0.0, -1.0]))];
    let text = step(&faces, &StepOptions::default()).expect("a file");
    assert_eq!(text, step(&faces, &StepOptions::default()).expect("a file"));
    assert!(text.is_ascii() && text.lines().all(|l| l.len() < 400));
    let all = instances(&text);
    assert_eq!(
        all.keys().copied().collect::<Vec<_>>(),
        (1..=all.len()).collect::<Vec<_>>()
    );
    let mut used = BTreeSet::new();
    for (id, entity) in &all {
        for r in references(entity) {
            assert!(r < *id, "#{id} uses #{r} before it is there");
            used.insert(r);
        }
    }
    // Only these instances are not referenced by others.
    let tops: Vec<&str> = all
        .iter()
        .filter(|(id, _)| !used.contains(id))
        .map(|(_, e)| e.split('(').next().expect("a name"))
        .collect();
    assert_eq!(
        tops,
        [
            "APPLICATION_PROTOCOL_DEFINITION",
            "PRODUCT_RELATED_PRODUCT_CATEGORY",
            "SHAPE_DEFINITION_REPRESENTATION"
        ]
    );
    for (name, n) in [
        ("ADVANCED_FACE", 2),
        ("OPEN_SHELL", 2),
        ("EDGE_CURVE", 8),
        ("VERTEX_POINT", 8),
        ("SHELL_BASED_SURFACE_MODEL", 1),
    ] {
        assert_eq!(count(&all, name), n, "{name}");
    }
    assert!(
        text.contains("'it''s one'")
            && text.contains("AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF")
    );
}

#[test]
fn control_points_and_weights_read_back_to_the_same_doubles() {
    let patch = cap([0.1, 0.2, 1e-9 / 3.0]);
    let all = instances(&step(&[face(patch.clone())], &StepOptions::default()).expect("a file"));
    let surface = all
        .values()
        .find(|e| e.contains("B_SPLINE_SURFACE_WITH_KNOTS"))
        .expect("a surface");
    assert!(
        surface.contains("B_SPLINE_SURFACE_WITH_KNOTS((3,3),(3,3),(0.,1.),(0.,1.),.UNSPECIFIED.)"),
        "{surface}"
    );
    let (_, weights) = surface
        .split_once("RATIONAL_B_SPLINE_SURFACE(")
        .expect("weights");
    let weights = numbers(weights.split_once("REPRESENTATION_ITEM").expect("an end").0);
    assert_eq!(
        weights,
        patch.control().iter().map(|c| c[3]).collect::<Vec<_>>()
    );
    let points: Vec<Vec<f64>> = references(surface)
        .iter()
        .map(|id| {
            numbers(
                all[id]
                    .strip_prefix("CARTESIAN_POINT('',")
                    .expect("a point"),
            )
        })
        .collect();
    let expected: Vec<Vec<f64>> = patch
        .control()
        .iter()
        .map(|c| (0..3).map(|k| c[k] / c[3]).collect())
        .collect();
    assert_eq!(points, expected);
}

#[test]
fn negative_weights_become_knots() {
    let mut patch = RationalPatch::planar((2, 2), [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    patch.control_mut()[4] = [-0.05, -0.05, 0.0, -0.1];
    let text = step(&[face(patch.clone())], &StepOptions::default()).expect("a file");
    let surface = instances(&text)
        .into_values()
        .find(|e| e.contains("B_SPLINE_SURFACE_WITH_KNOTS"))
        .expect("a surface");
    let (_, weights) = surface
        .split_once("RATIONAL_B_SPLINE_SURFACE(")
        .expect("weights");
    let weights = numbers(weights.split_once("REPRESENTATION_ITEM").expect("an end").0);
    assert!(
        weights.len() > 9 && weights.iter().all(|w| *w > 0.0),
        "{weights:?}"
    );
    // The weight function is negative inside, so inserting knots does not help.
    patch.control_mut()[4][3] = -4.0;
    assert_eq!(
        step(&[face(patch)], &StepOptions::default())
            .expect_err("poles")
            .code,
        "weights"
    );
}

#[test]
fn named_surfaces_units_and_what_is_refused() {
    let center = [0.1, 0.2, 0.3];
    let sphere = Some(isoform_geom::Quadric::Sphere {
        center,
        radius: 0.5,
    });
    let faces = [StepFace {
        name: String::new(),
        patch: cap(center),
        surface: sphere,
    }];
    let with = |units: &str| {
        step(
            &faces,
            &StepOptions {
                units: Some(units.to_owned()),
                ..StepOptions::default()
            },
        )
    };
    let all = instances(&with("m").expect("a file"));
    assert_eq!(
        (count(&all, "SPHERICAL_SURFACE"), count(&all, "EDGE_CURVE")),
        (1, 4)
    );
    assert!(all.values().all(|e| !e.contains("B_SPLINE_SURFACE")));
    assert!(
        all.values()
            .any(|e| e == "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.))")
    );
    let inch = with("in").expect("a file");
    assert!(inch.contains("LENGTH_MEASURE(25.4)") && inch.contains("CONVERSION_BASED_UNIT('INCH'"));
    assert_eq!(with("parsec").expect_err("no unit").code, "unit-unknown");
    assert_eq!(
        step(&[], &StepOptions::default())
            .expect_err("nothing")
            .code,
        "empty"
    );
    let huge = RationalPatch::planar((1, 1), [0.0; 3], [1e308, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let mut beyond = huge.clone();
    beyond.control_mut().iter_mut().for_each(|c| c[3] = 0.01);
    assert_eq!(
        step(&[face(beyond)], &StepOptions::default())
            .expect_err("beyond")
            .code,
        "overflow"
    );
    assert!(step(&[face(huge)], &StepOptions::default()).is_ok());
    let nowhere = write_step_path(
        &faces,
        std::path::Path::new("/nowhere/at/all.step"),
        &StepOptions::default(),
    );
    assert_eq!(nowhere.expect_err("no folder").code, "not-writable");
}

#[test]
fn a_side_that_is_a_point_is_no_edge() {
    let corner = RationalPatch::new(
        (1, 1),
        vec![
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0, 1.0],
            [1.0, 1.0, 0.0, 1.0],
        ],
    );
    let all = instances(
        &step(&[face(corner.expect("a patch"))], &StepOptions::default()).expect("a file"),
    );
    assert_eq!(
        (count(&all, "EDGE_CURVE"), count(&all, "VERTEX_POINT")),
        (3, 3)
    );
}
