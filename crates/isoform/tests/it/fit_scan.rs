//! Fits to scans with distant points, out-of-range options, invalid data, and a stop.

use isoform::field::hyperfun::{Mode, Model};
use isoform::geom::PointCloud;
use isoform::{
    Control, FitOptions, FitScanError, ParameterError, example_scan, fit, fit_scan, template,
};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const BALL: &str = "-- @pose translate
    -- @param a[1] radius length
    my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, a[1]); }";

fn model(text: &str) -> Model {
    Model::parse(text, Mode::Default).expect("a program")
}

/// Returns points of a ball of radius 2 about a point.
fn ball(center: [f64; 3]) -> PointCloud {
    let point = |i: u32| {
        let (t, z) = (f64::from(i) * 2.4, f64::from(i) / 250.0 - 1.0);
        let r = (1.0 - z * z).sqrt();
        let [x, y, z] = [2.0 * r * t.cos(), 2.0 * r * t.sin(), 2.0 * z];
        [x + center[0], y + center[1], z + center[2]]
    };
    PointCloud::from_points((0..500).map(point).collect())
}

#[test]
fn points_far_off_are_fitted_about_their_centre() {
    let far = [1e9, -2e9, 0.5];
    let options = FitOptions::default();
    let fitted = fit_scan(&ball(far), &model(BALL), &options, &Control::default()).expect("a fit");
    let values = fitted.values();
    // The points themselves are rounded to 2e-7.
    for (value, truth) in values.iter().zip([2.0, far[0], far[1], far[2]]) {
        assert!((value - truth).abs() < 1e-6, "{values:?}");
    }
    assert_ne!(fitted.cloud.origin, [0.0; 3]);
    assert!(fitted.warnings.is_empty(), "{:?}", fitted.warnings);
}

#[test]
fn options_without_measure_are_as_many_as_there_are() {
    let all = FitOptions {
        fit: fit::Options {
            search_points: usize::MAX,
            confirm_points: usize::MAX,
            ..fit::Options::default()
        },
        ..FitOptions::default()
    };
    let of = |options: &FitOptions| {
        fit_scan(&ball([0.0; 3]), &model(BALL), options, &Control::default())
            .expect("a fit")
            .values()
    };
    assert!((of(&all)[0] - 2.0).abs() < 1e-9);
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let of = |scan: &PointCloud, options: &FitOptions| {
        fit_scan(scan, &model(BALL), options, &Control::default()).expect_err("nothing to fit")
    };
    let mut broken = ball([0.0; 3]);
    broken.triangles = vec![[0, 1, 2], [3, 500, 4]];
    let error = of(&broken, &FitOptions::default()).to_string();
    let expected = "triangle 1 has the corner 500, but there are 500 points (from 0)";
    assert_eq!(error, expected);
    let outside = FitOptions {
        fixed: vec![("radius".to_owned(), 1.0)],
        bounds: vec![("radius".to_owned(), (2.0, 3.0))],
        ..FitOptions::default()
    };
    assert!(matches!(
        of(&ball([0.0; 3]), &outside),
        FitScanError::Bounds {
            error: ParameterError::FixedOutside { .. },
            ..
        }
    ));
    let nameless = FitOptions {
        fixed: vec![(String::new(), 1.0)],
        ..FitOptions::default()
    };
    let error = of(&ball([0.0; 3]), &nameless).to_string();
    assert!(
        error.starts_with("the name of a parameter is empty"),
        "{error}"
    );
}

#[test]
fn a_stop_leaves_out_what_is_optional() {
    let (mut scan, _) = example_scan();
    scan.points = scan.points.iter().step_by(4).copied().collect();
    let cup = template("cup").expect("a template").model();
    let cancel = AtomicBool::new(false);
    // The optimisation is complete when the phase of the report begins.
    let until_report = |phase: &str, _: f64| {
        if phase == "report" {
            cancel.store(true, Ordering::Relaxed);
        }
    };
    let control = Control {
        cancelled: Some(&cancel),
        progress: Some(&until_report),
        ..Control::default()
    };
    let stopped = fit_scan(&scan, &cup, &FitOptions::default(), &control).expect("a fit");
    assert!(!stopped.fit.complete && stopped.fit.warnings.contains(&fit::Warning::Stopped));
    assert!(stopped.fit.correction.is_empty());

    let started = Instant::now();
    let at_once = Control::default().for_seconds(0.0);
    let fitted = fit_scan(&scan, &cup, &FitOptions::default(), &at_once);
    let took = started.elapsed();
    eprintln!("{took:?} {:?}", fitted.as_ref().map(|f| f.seconds.clone()));
    assert!(fitted.is_ok_and(|f| !f.fit.complete));
    assert!(took < Duration::from_secs(20), "{took:?}");
}
