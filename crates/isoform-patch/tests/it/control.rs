//! Rejected options, stopped work and reports of progress.

use crate::common;
use isoform_field::Polynomial;
use isoform_field::hyperfun::{Mode, Model};
use isoform_geom::{Aabb, Parts};
use isoform_patch::{
    Control, Covering, Error, Options, Weights, cover, parameterize, parameterize_part,
};
use isoform_testdata::shares_told;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

fn sphere() -> Polynomial {
    common::sphere(0.5)
}

/// Two half spaces that meet in an edge.
fn wedge() -> Parts {
    let text = "my_model(x[3], a[1]) { my_model = (0.2 - x[1]) & (0.2 - x[2]); }";
    let model = Model::parse(text, Mode::Default).expect("a model");
    isoform_field::parts_of(&model, &[0.0]).expect("parts")
}

fn options() -> Options {
    let region = Aabb {
        lo: [-0.6; 3],
        hi: [0.6; 3],
    };
    Options::new((2, 2), 1e-2, region)
}

/// Returns the error of invalid options, which both ways to patches report equally.
fn refused(options: &Options) -> Error {
    let control = Control::default();
    let single = parameterize(&sphere(), options, &control).expect_err("refused");
    let many = cover(&sphere(), options, &Covering::default(), &control).expect_err("refused");
    assert_eq!(single.to_string(), many.to_string());
    single
}

#[test]
fn numbers_of_nodes_out_of_range_are_refused() {
    for nodes in [0, 1, 65, 5000, usize::MAX] {
        let error = refused(&Options {
            nodes: Some(nodes),
            ..options()
        });
        assert_eq!(error, Error::Nodes(nodes));
    }
    assert_eq!(
        Error::Nodes(1).to_string(),
        "1 nodes: there must be from 2 to 64 in each direction"
    );
}

#[test]
fn factors_that_are_no_weights_are_refused() {
    for bad in [f64::NAN, -1.0, f64::INFINITY] {
        let of = |w: Weights| {
            let (j, l, r, e) = (
                Weights { j: bad, ..w },
                Weights { l: bad, ..w },
                Weights { r: bad, ..w },
                Weights { e: bad, ..w },
            );
            [j, l, r, e]
        };
        for start in of(Weights::START) {
            let error = refused(&Options { start, ..options() });
            assert!(error.to_string().contains("at the start"), "{error}");
        }
        for floor in of(Weights::FLOOR) {
            let error = refused(&Options { floor, ..options() });
            assert!(error.to_string().contains("threshold"), "{error}");
        }
    }
}

#[test]
fn a_cover_of_no_patches_is_refused() {
    let covering = Covering {
        most: 0,
        ..Covering::default()
    };
    let error = cover(&sphere(), &options(), &covering, &Control::default());
    assert_eq!(
        error.expect_err("refused"),
        Error::Option {
            name: "the number of patches",
            value: 0.0
        }
    );
}

/// A cover takes a second or more; work that has not begun is reported as stopped, not as empty.
#[test]
fn without_time_there_is_no_patch_but_not_for_lack_of_surface() {
    let fine = Options {
        tolerance: Some(1e-9),
        ..options()
    };
    for milliseconds in [0, 1, 5] {
        let deadline = Instant::now() + Duration::from_millis(milliseconds);
        let control = Control::default().until(deadline);
        let made = cover(&sphere(), &fine, &Covering::default(), &control);
        assert_eq!(made.expect_err("no time"), Error::Stopped);
    }
    let flag = AtomicBool::new(true);
    let cancelled = Control {
        cancelled: Some(&flag),
        ..Control::default()
    };
    let made = parameterize(&sphere(), &fine, &cancelled);
    assert_eq!(made.expect_err("cancelled"), Error::Stopped);
    let parts = wedge();
    let made = parameterize_part(&parts, &fine, &cancelled);
    assert_eq!(made.expect_err("cancelled"), Error::Stopped);
}

/// Returns the phases that are reported during some work.
fn told(make: impl FnOnce(&Control<'_>)) -> Vec<String> {
    let told = shares_told(|hear| {
        make(&Control {
            progress: Some(hear),
            ..Control::default()
        });
    });
    for (_, shares) in &told {
        assert!(shares.iter().all(|s| (0.0..=1.0).contains(s)), "{shares:?}");
    }
    told.into_iter().map(|(phase, _)| phase).collect()
}

#[test]
fn progress_is_told_by_phases() {
    let single = told(|control| {
        parameterize(&sphere(), &options(), control).expect("a patch");
    });
    assert_eq!(single, ["seed", "grow", "certify"]);
    let paper = Options::paper((2, 2), options().region);
    let single = told(|control| {
        parameterize(&sphere(), &paper, control).expect("a patch");
    });
    assert_eq!(single, ["seed", "grow", "certify"]);
    let covering = Covering {
        margin: Some(0.01),
        ..Covering::default()
    };
    let many = told(|control| {
        cover(&sphere(), &options(), &covering, control).expect("patches");
    });
    assert_eq!(many, ["samples", "cover", "margin"]);
}
