//! Round trips of solids in their native form and in STEP, and refusal of damaged files.

use crate::common::damage::{apply, damage};
use isoform_geom::brep::{
    Axes, BSpline, Body, Brep, Coedge, Curve, Edge, Ellipsoid, Face, Graph, Revolved, Surface,
};
use isoform_geom::{Point3, norm, sub};
use isoform_io::{
    SolidFile, SolidOptions, SolidProperties, StepOptions, read_solids, read_step_solids,
    step_solids, write_solids,
};
use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![-1e3..1e3, -1e-9..1e-9, -1e30..1e30, Just(-0.0), Just(0.1)]
}

fn point() -> impl Strategy<Value = Point3> {
    prop::array::uniform3(number())
}

fn length() -> impl Strategy<Value = f64> {
    prop_oneof![1e-3..1e3, 1e-60..1e-50, 1e50..1e60]
}

fn axes() -> impl Strategy<Value = Axes> {
    (point(), prop::array::uniform3(-1.0..1.0)).prop_map(|(origin, d): (_, Point3)| {
        let length = norm(d);
        let z = if length > 0.1 {
            d.map(|v| v / length)
        } else {
            [0.0, 0.0, 1.0]
        };
        Axes::along(origin, z)
    })
}

fn curve() -> impl Strategy<Value = Curve> {
    let control = prop::collection::vec(point(), 5);
    prop_oneof![
        (axes(), length()).prop_map(|(axes, r)| Curve::Circle(axes, r)),
        (axes(), length(), length()).prop_map(|(axes, a, b)| Curve::Ellipse(axes, a, b)),
        (control, -5.0..5.0).prop_map(|(control, t)| Curve::BSpline(BSpline {
            degree: 3,
            knots: vec![t, t + 0.7, t + 2.0],
            multiplicities: vec![4, 1, 4],
            control,
        })),
    ]
}

/// Generates a frame near the origin, for surfaces whose frames STEP stores through points.
fn near_axes() -> impl Strategy<Value = Axes> {
    axes().prop_map(|axes| Axes {
        origin: axes.origin.map(|v| v.clamp(-2.0, 2.0)),
        ..axes
    })
}

fn surface() -> impl Strategy<Value = Surface> {
    let heights = prop::collection::vec(-1.0..1.0, 4 * 5);
    prop_oneof![
        axes().prop_map(Surface::Plane),
        (axes(), length()).prop_map(|(axes, r)| Surface::Cylinder(axes, r)),
        (axes(), length(), 0.01..1.5).prop_map(|(axes, r, a)| Surface::Cone(axes, r, a)),
        (axes(), length()).prop_map(|(axes, r)| Surface::Sphere(axes, r)),
        (axes(), length()).prop_map(|(axes, r)| Surface::Torus(axes, 1.5 * r, r)),
        (near_axes(), prop::array::uniform3(0.1..10.0), axes()).prop_map(|(axes, half, d)| {
            Surface::Ellipsoid(Ellipsoid::new(axes, half).facing(d.z))
        }),
        (
            near_axes(),
            prop::array::uniform4((0.1..10.0, -5.0..5.0)),
            -1.0..1.0
        )
            .prop_map(|(axes, control, t): (_, [(f64, f64); 4], f64)| {
                Surface::Revolved(Arc::new(Revolved {
                    axes,
                    degree: 2,
                    knots: vec![t, t, t, t + 0.5, t + 2.0, t + 2.0, t + 2.0],
                    control: control.map(|(r, z)| [r, z]).to_vec(),
                }))
            }),
        (near_axes(), heights, -1.0..1.0).prop_map(|(axes, heights, t)| {
            let knots = |inner: &[f64]| -> Vec<f64> {
                let end = |t: f64| std::iter::repeat_n(t, 3);
                let inner = inner.iter().copied();
                end(t).chain(inner).chain(end(t + 3.0)).collect()
            };
            Surface::Graph(Arc::new(Graph {
                axes,
                degree: 2,
                knots: [knots(&[t + 0.5]), knots(&[t + 1.0, t + 1.1])],
                heights,
            }))
        }),
    ]
}

/// Generates pairs of faces with a common edge, which are consistent data but not solids in space.
/// All pairs after the first two are voids.
fn file() -> impl Strategy<Value = SolidFile> {
    let pair = (point(), curve(), surface(), surface(), any::<[bool; 2]>());
    let pairs = prop::collection::vec(pair, 1..6);
    let text = prop_oneof!["\\PC{0,12}", Just("a+b".to_owned())];
    (pairs, text, number(), point()).prop_map(|(pairs, name, volume, centroid)| {
        let mut brep = Brep::default();
        for (i, (vertex, curve, a, b, sense)) in pairs.into_iter().enumerate() {
            let edge = i as u32;
            brep.vertices.push(vertex);
            let ends = [edge, edge];
            brep.edges.push(Edge { curve, ends });
            brep.parts.push(format!("{name}.{i}"));
            for (surface, forward) in [(a, sense[0]), (b, !sense[0])] {
                brep.faces.push(Face {
                    surface,
                    agrees: sense[1],
                    part: edge,
                    chart: u32::from(forward != sense[0]),
                    loops: vec![vec![Coedge { edge, forward }]],
                });
            }
            let faces = vec![2 * edge, 2 * edge + 1];
            if i < 2 {
                let voids = Vec::new();
                brep.solids.push(Body {
                    outer: faces,
                    voids,
                });
            } else {
                brep.solids[1].voids.push(faces);
            }
        }
        let properties = SolidProperties {
            volume,
            area: volume.abs(),
            centroid,
            gap: 1e-8,
        };
        let unit = Some("in".to_owned());
        SolidFile {
            brep,
            name,
            unit,
            properties,
        }
    })
}

fn json_of(bytes: &[u8]) -> Value {
    serde_json::from_slice(bytes).expect("JSON")
}

fn step_of(file: &SolidFile) -> String {
    let step = StepOptions {
        units: file.unit.clone(),
        name: file.name.clone(),
        time: None,
    };
    let options = SolidOptions { step, ap214: false };
    step_solids(&file.brep, &file.properties, &options).expect("a file")
}

/// Uses all parts of a file, to find out if one panics.
fn work_on(file: &SolidFile) {
    let brep = &file.brep;
    for e in 0..brep.edges.len() as u32 {
        for s in brep.breaks(e) {
            brep.along(e, s);
        }
    }
    for (f, face) in brep.faces.iter().enumerate() {
        let at = face.surface.parameters(brep.vertices[0]);
        face.surface.distance(face.surface.point(at));
        assert!(!brep.face_name(f).is_empty() || brep.parts.iter().any(String::is_empty));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, ..ProptestConfig::default() })]

    #[test]
    fn our_form_reads_back_bit_for_bit(file in file()) {
        prop_assert_eq!(file.brep.validate(), Ok(()));
        let bytes = write_solids(&file);
        let again = read_solids(&json_of(&bytes)).expect("our own file");
        prop_assert_eq!(&again, &file);
        // The bytes also show the sign of zero, which the comparison ignores.
        prop_assert_eq!(write_solids(&again), bytes);
    }

    #[test]
    fn step_reads_back(file in file()) {
        let again = read_step_solids(&step_of(&file)).expect("our own file");
        let (a, b) = (&again.brep, &file.brep);
        prop_assert_eq!(&a.vertices, &b.vertices);
        prop_assert_eq!(&a.edges, &b.edges);
        prop_assert_eq!(&a.solids, &b.solids);
        prop_assert_eq!(&a.parts, &b.parts);
        prop_assert_eq!(&again.unit, &file.unit);
        prop_assert_eq!(again.properties, file.properties);
        for (found, face) in a.faces.iter().zip(&b.faces) {
            let like = Face { surface: face.surface.clone(), ..found.clone() };
            prop_assert_eq!(&like, face);
            match (&found.surface, &face.surface) {
                // STEP cannot store their frame: the surface agrees up to rounding.
                (Surface::Ellipsoid(x), Surface::Ellipsoid(y)) => {
                    let p = y.point([2.0, 0.3]);
                    prop_assert!(x.distance(p).0.abs() < 1e-12, "{:?} {:?}", x, y);
                }
                (Surface::Revolved(x), Surface::Revolved(y)) => {
                    prop_assert_eq!(&x.knots, &y.knots);
                    let p = y.point([2.0, y.knots[0] + 0.7]);
                    prop_assert!(norm(sub(p, x.point([2.0, y.knots[0] + 0.7]))) < 1e-12);
                }
                (Surface::Graph(x), Surface::Graph(y)) => {
                    let [[a, _], _] = y.domain();
                    let p = y.point([a + 0.7, a + 1.3]);
                    prop_assert!(x.distance(p).0.abs() < 1e-12, "{:?} {:?}", x, y);
                    for (p, q) in x.control().iter().zip(y.control()) {
                        prop_assert!(norm(sub(*p, q)) < 1e-12);
                    }
                }
                (x, y) => prop_assert_eq!(x, y),
            }
        }
    }

    #[test]
    fn damaged_files_are_read_or_refused(file in file(), all in prop::collection::vec(damage(), 1..3)) {
        let mut bytes = write_solids(&file);
        all.iter().for_each(|d| apply(&mut bytes, d));
        if let Ok(json) = serde_json::from_slice(&bytes) {
            match read_solids(&json) {
                Ok(file) => work_on(&file),
                Err(e) => prop_assert!(!e.problem.is_empty()),
            }
        }
        let mut bytes = step_of(&file).into_bytes();
        all.iter().for_each(|d| apply(&mut bytes, d));
        match read_step_solids(&String::from_utf8_lossy(&bytes)) {
            Ok(file) => work_on(&file),
            Err(e) => prop_assert!(!e.problem.is_empty()),
        }
    }

    /// Damaged bytes are seldom JSON; replaced values are.
    #[test]
    fn wrong_values_are_read_or_refused(file in file(), at in any::<u32>(), to in value()) {
        let mut json = json_of(&write_solids(&file));
        let count = replace(&mut json, &mut u32::MAX.clone(), &to);
        let count = u32::MAX - count;
        replace(&mut json, &mut (at % count), &to);
        match read_solids(&json) {
            Ok(file) => work_on(&file),
            Err(e) => prop_assert!(!e.problem.is_empty() && !e.at.is_empty()),
        }
    }
}

/// Returns half of a ball's surface and a plane, with one common edge.
fn half_ball() -> SolidFile {
    let axes = Axes::along([0.0; 3], [0.0, 0.0, 1.0]);
    let face = |surface, agrees, forward| Face {
        surface,
        agrees,
        part: u32::from(agrees),
        chart: 0,
        loops: vec![vec![Coedge { edge: 0, forward }]],
    };
    let brep = Brep {
        vertices: vec![axes.x],
        edges: vec![Edge {
            curve: Curve::Circle(axes, 1.0),
            ends: [0, 0],
        }],
        faces: vec![
            face(Surface::Plane(axes), false, false),
            face(Surface::Sphere(axes, 1.0), true, true),
        ],
        parts: vec!["cut".to_owned(), "ball".to_owned()],
        solids: vec![Body {
            outer: vec![0, 1],
            voids: Vec::new(),
        }],
    };
    let properties = SolidProperties {
        volume: 2.0,
        area: 9.0,
        centroid: [0.0, 0.0, 0.375],
        gap: 1e-8,
    };
    SolidFile {
        brep,
        name: "half".to_owned(),
        unit: Some("um".to_owned()),
        properties,
    }
}

/// Runs the fuzzing target on its seeds: files of models with planes, cylinders, spheres,
/// ellipsoids and splines.
#[test]
fn the_corpus_is_read() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/read_solids");
    let mut read = [0, 0];
    for entry in std::fs::read_dir(folder).expect("a corpus") {
        let bytes = std::fs::read(entry.expect("an entry").path()).expect("readable");
        let own = serde_json::from_slice(&bytes)
            .ok()
            .map(|json| read_solids(&json));
        let step = read_step_solids(&String::from_utf8_lossy(&bytes));
        for (k, file) in [own.and_then(Result::ok), step.ok()].iter().enumerate() {
            let Some(file) = file else { continue };
            work_on(file);
            assert_eq!(
                read_solids(&json_of(&write_solids(file))).as_ref(),
                Ok(file)
            );
            read[k] += 1;
        }
    }
    assert!(read.iter().all(|n| *n >= 2), "{read:?}");
}

#[test]
fn units_are_read_back() {
    for unit in isoform_io::STEP_UNITS {
        let unit = Some(unit.to_owned());
        let file = SolidFile {
            unit,
            ..half_ball()
        };
        assert_eq!(read_step_solids(&step_of(&file)), Ok(file));
    }
}

#[test]
fn what_is_no_file_of_solids_is_refused_with_the_reason() {
    let said = |text: &str| read_step_solids(text).expect_err(text).to_string();
    let step = step_of(&half_ball());
    let other = step.replace("'isoform 0", "'Other CAD 7");
    assert_eq!(
        said(&other).split_once(".1.0").expect("a version").0,
        "FILE_NAME: written by `Other CAD 7"
    );
    assert!(said(&other).ends_with("`; only STEP files of isoform brep can be read"));
    let swept = step.replace("SPHERICAL_SURFACE", "SURFACE_OF_LINEAR_EXTRUSION");
    assert!(
        said(&swept).ends_with("SURFACE_OF_LINEAR_EXTRUSION: a surface of this kind is not read")
    );
    let patches = step.replace("MANIFOLD_SOLID_BREP", "SHELL_BASED_SURFACE_MODEL");
    assert_eq!(
        said(&patches),
        "solids: there is none: patches and faces alone are not read"
    );

    let mut json = json_of(&write_solids(&half_ball()));
    let of = |json: &Value| read_solids(json).expect_err("it is wrong").to_string();
    json["schema"] = json!(2);
    assert_eq!(of(&json), "schema: version 2 is not known here, only 1");
    json["schema"] = json!(1);
    json["faces"][1]["axes"]["z"] = json!([0, 1]);
    assert_eq!(of(&json), "faces 1, axes, z: 3 numbers are expected");
    json["faces"][1]["axes"]["z"] = json!([0, 0, 2]);
    assert_eq!(
        of(&json),
        "face 1: the directions of a frame are not of length 1 and at right angles"
    );
    assert_eq!(of(&json!({})), "kind: brep is expected");
}

/// Without a limit, a short file could request the product of two long lists.
#[test]
fn long_lists_are_not_multiplied() {
    let step = step_of(&half_ball());
    let face = step.split_once("=ADVANCED_FACE(").expect("a face").1;
    let (bound, _) = face
        .split_once("(#")
        .and_then(|(_, list)| list.split_once(')'))
        .expect("a bound");
    let many = step.replace(&format!("(#{bound})"), &format!("(#{bound},#{bound})"));
    assert_ne!(many, step);
    let said = read_step_solids(&many).expect_err("twice").to_string();
    assert_eq!(said, format!("#{bound}: it is referred to more than once"));
}

fn value() -> impl Strategy<Value = Value> {
    prop::sample::select(vec![
        json!(null),
        json!(-1),
        json!(0),
        json!(1),
        json!(4_294_967_295_u64),
        json!(u64::MAX),
        json!(1e308),
        json!(1e-308),
        json!(0.5),
        json!("plane"),
        json!([]),
        json!({}),
        json!(true),
        json!([0, 1]),
        json!([[0.0, 0.0, 0.0]]),
        json!("spline"),
    ])
}

/// Replaces the value with index `left` inside a document; returns the remaining count if there are
/// fewer.
fn replace(json: &mut Value, left: &mut u32, to: &Value) -> u32 {
    let inner: Vec<&mut Value> = match json {
        Value::Array(list) => list.iter_mut().collect(),
        Value::Object(map) => map.values_mut().collect(),
        _ => Vec::new(),
    };
    for value in inner {
        if *left == 0 {
            *value = to.clone();
            *left = u32::MAX;
            return *left;
        }
        *left -= 1;
        if replace(value, left, to) == u32::MAX {
            return u32::MAX;
        }
    }
    *left
}
