//! Templates proposed for scans of parts whose dimensions are known.

use isoform::field::hyperfun::{Mode, Model};
use isoform::geom::{Point3, PointCloud};
use isoform::num::Random;
use isoform::{Control, FitOptions, Proposal, RecognizeOptions, ScanFit, fit_scan, recognize_scan};

/// Points of a plate of 40 × 30 × 10 about its corner with a bore of radius 6 at (15, 12) and a
/// counterbore of radius 9 down to z = 7, turned and moved; noise along the normals.
fn plate(count: usize, noise: f64) -> PointCloud {
    let mut random = Random::new(5);
    let mut points = Vec::new();
    while points.len() < count {
        let Some((p, normal)) = on_plate(&mut random) else {
            continue;
        };
        // A sum of twelve uniform deviates is nearly normal, with variance 1.
        let far = noise * ((0..12).map(|_| random.unit()).sum::<f64>() - 6.0);
        points.push(posed(std::array::from_fn(|k| p[k] + far * normal[k])));
    }
    PointCloud::from_points(points)
}

/// A point of one of the faces, chosen by area, and its normal; `None` where a hole is.
fn on_plate(random: &mut Random) -> Option<(Point3, Point3)> {
    let [a, b, w] = [random.unit(), random.unit(), random.unit()];
    let end = f64::from(u8::from(random.unit() < 0.5));
    let (sin, cos) = (std::f64::consts::TAU * a).sin_cos();
    let on_bore = |r: f64, z: f64| ([15.0 + r * cos, 12.0 + r * sin, z], [cos, sin, 0.0]);
    let on_face = |p: Point3, axis: usize, hole: f64| {
        let r = (p[0] - 15.0).hypot(p[1] - 12.0);
        let normal = std::array::from_fn(|k| f64::from(u8::from(k == axis)));
        (r >= hole).then_some((p, normal))
    };
    // Areas: two faces of 1200, sides of 800 and 600 (both of each), bores of 264 and 170, and a
    // square of 324 about the ledge.
    match 4558.0 * w {
        w if w < 1200.0 => on_face([40.0 * a, 30.0 * b, 0.0], 2, 6.0),
        w if w < 2400.0 => on_face([40.0 * a, 30.0 * b, 10.0], 2, 9.0),
        w if w < 3200.0 => on_face([40.0 * a, 30.0 * end, 10.0 * b], 1, 0.0),
        w if w < 3800.0 => on_face([40.0 * end, 30.0 * a, 10.0 * b], 0, 0.0),
        w if w < 4064.0 => Some(on_bore(6.0, 7.0 * b)),
        w if w < 4234.0 => Some(on_bore(9.0, 7.0 + 3.0 * b)),
        _ => {
            let p = [6.0 + 18.0 * a, 3.0 + 18.0 * b, 7.0];
            let is_beyond = (p[0] - 15.0).hypot(p[1] - 12.0) > 9.0;
            on_face(p, 2, 6.0).filter(|_| !is_beyond)
        }
    }
}

fn posed(p: Point3) -> Point3 {
    let (s, c) = (0.6, 0.8);
    let q = [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]];
    [
        q[0] + 100.0,
        c * q[1] - s * q[2] - 20.0,
        s * q[1] + c * q[2] + 7.0,
    ]
}

fn proposed(scan: &PointCloud) -> Proposal {
    let control = Control::default();
    let found = recognize_scan(scan, &RecognizeOptions::default(), &control).expect("entities");
    found.template("a test", &control).expect("a template")
}

fn fitted(scan: &PointCloud, proposal: &Proposal) -> ScanFit {
    let model = Model::parse(&proposal.program, Mode::Default).expect("HyperFun");
    fit_scan(scan, &model, &FitOptions::default(), &Control::default()).expect("a fit")
}

/// The value of a parameter that has one of these values.
fn is_there(fit: &ScanFit, value: f64, tolerance: f64) -> bool {
    fit.values()
        .iter()
        .any(|v| (v.abs() - value).abs() < tolerance)
}

#[test]
fn a_plate_comes_back_with_its_dimensions() {
    let scan = plate(6000, 0.0);
    let proposal = proposed(&scan);
    assert_eq!(proposal.gaps, [], "{}", proposal.program);
    assert!(proposal.used.iter().all(|u| *u) && proposal.explained == 1.0);
    let fit = fitted(&scan, &proposal);
    assert!(
        fit.fit.acceptable && fit.fit.rms < 1e-9,
        "{:?}",
        fit.fit.reasons
    );
    for dimension in [40.0, 30.0, 10.0, 6.0, 9.0] {
        assert!(
            is_there(&fit, dimension, 1e-8),
            "{dimension}: {:?}",
            fit.values()
        );
    }
}

#[test]
fn noise_leaves_the_shape_as_it_is() {
    let scan = plate(6000, 0.05);
    let proposal = proposed(&scan);
    let fit = fitted(&scan, &proposal);
    assert!(fit.fit.acceptable, "{}", proposal.program);
    for dimension in [40.0, 30.0, 10.0, 6.0, 9.0] {
        assert!(
            is_there(&fit, dimension, 0.03),
            "{dimension}: {:?}",
            fit.values()
        );
    }
}

/// What was not seen is closed by the end of the data, and said.
#[test]
fn a_face_that_is_missing_is_said() {
    let mut scan = plate(6000, 0.0);
    let whole = proposed(&scan);
    // All but the bottom, which has z = 0 before the pose.
    let bottom = |p: &Point3| {
        let [y, z] = [p[1] + 20.0, p[2] - 7.0];
        (0.8 * z - 0.6 * y).abs() < 1e-9
    };
    scan.points.retain(|p| !bottom(p));
    let open = proposed(&scan);
    assert_eq!(open.used.len() + 1, whole.used.len());
    let is_unseen = |g: &isoform::recognize::Gap| {
        matches!(
            g,
            isoform::recognize::Gap::Unseen(..) | isoform::recognize::Gap::Open(_)
        )
    };
    assert!(open.gaps.iter().any(is_unseen), "{:?}", open.gaps);
}

#[test]
fn the_order_of_the_points_changes_nothing() {
    let scan = plate(3000, 0.02);
    let mut turned = scan.clone();
    turned.points.reverse();
    assert_eq!(proposed(&scan).program, proposed(&turned).program);
}
