//! Covers of smooth surfaces: margins, singular points, threads.

use isoform_field::Polynomial;
use isoform_geom::{Aabb, Point3, RationalPatch, norm, sub};
use isoform_patch::{Control, Cover, Covering, Options, Parameterized, cover, reached};

fn options(tolerance: f64) -> Options {
    let region = Aabb {
        lo: [-0.5; 3],
        hi: [0.5; 3],
    };
    Options {
        tolerance: Some(tolerance),
        ..Options::paper((3, 3), region)
    }
}

fn sphere() -> Polynomial {
    let square = [[2, 0, 0], [0, 2, 0], [0, 0, 2]];
    Polynomial::new(
        square
            .map(|e| (e, 1.0))
            .into_iter()
            .chain([([0; 3], -0.16)]),
    )
}

/// Returns points spread over the unit sphere.
fn directions(count: u32) -> Vec<Point3> {
    (0..count)
        .map(|i| {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count);
            let (angle, r) = (2.399_963_229_728_653 * f64::from(i), (1.0 - z * z).sqrt());
            [r * angle.cos(), r * angle.sin(), z]
        })
        .collect()
}

/// Returns the distance of a point from the border of a patch, by samples at most 1e-3 apart.
fn depth(patch: &RationalPatch, p: Point3) -> f64 {
    (0..=1000)
        .map(|i| f64::from(i) / 1000.0)
        .flat_map(|t| [(t, 0.0), (t, 1.0), (0.0, t), (1.0, t)])
        .map(|(u, v)| norm(sub(patch.point(u, v), p)))
        .fold(f64::INFINITY, f64::min)
}

/// Runs some work on a pool with a given number of threads.
fn on_threads<T: Send>(threads: usize, make: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("threads")
        .install(make)
}

fn margin_of_sphere(margin: f64, threads: usize, most: usize) -> Cover {
    let covering = Covering {
        margin: Some(margin),
        most,
        ..Covering::default()
    };
    let make = || cover(&sphere(), &options(1e-4), &covering, &Control::default());
    on_threads(threads, make).expect("a cover")
}

fn patches(made: &[Parameterized]) -> Vec<&RationalPatch> {
    made.iter().map(|p| &p.grown.patch).collect()
}

/// A proved margin holds at points that the proof does not use.
#[test]
fn a_margin_is_kept_everywhere() {
    let margin = 0.05;
    let made = margin_of_sphere(margin, 2, 100);
    let told = made.depth.as_ref().expect("a margin was asked for");
    let distance = told.distance.expect("a proof");
    assert!((1e-6..2e-4).contains(&distance) && told.open.is_empty());
    assert_eq!((told.margin, made.covered), (margin, made.samples));
    let points: Vec<Point3> = directions(500).iter().map(|d| d.map(|v| 0.4 * v)).collect();
    let lies: Vec<Vec<bool>> = (made.patches.iter())
        .map(|p| reached(&p.grown.patch, &points, distance))
        .collect();
    for (i, p) in points.iter().enumerate() {
        let deepest = (made.patches.iter().zip(&lies))
            .filter(|(_, lies)| lies[i])
            .map(|(made, _)| depth(&made.grown.patch, *p))
            .fold(0.0, f64::max);
        assert!(deepest >= margin, "{p:?}: {deepest}");
    }
    // The number of threads changes nothing.
    let again = margin_of_sphere(margin, 1, 100);
    assert_eq!(patches(&made.patches), patches(&again.patches));
}

/// A missing margin is reported: one patch does not cover a sphere.
#[test]
fn a_margin_that_is_not_there_is_not_proved() {
    let made = margin_of_sphere(0.05, 2, 1);
    let told = made.depth.expect("a margin was asked for");
    assert!(told.distance.is_none() && !told.open.is_empty());
    assert!(made.covered < made.samples);
    let options = options(1e-4);
    let bad = Covering {
        margin: Some(-1.0),
        ..Covering::default()
    };
    assert!(cover(&sphere(), &options, &bad, &Control::default()).is_err());
}

/// A cone is covered except for its apex, and the apex is reported.
#[test]
fn singular_points_are_left_out() {
    let cone = Polynomial::new([([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], -1.0)]);
    let apart = 0.03;
    let covering = Covering {
        apart: Some(apart),
        margin: Some(0.01),
        ..Covering::default()
    };
    let make = || cover(&cone, &options(1e-4), &covering, &Control::default());
    let made = on_threads(2, make).expect("a cover");
    assert!(made.left_out > 0 && made.left_out < made.samples / 50);
    assert!((apart..apart + 1e-9).contains(&made.apart));
    assert!(!made.singular.is_empty() && made.singular.iter().all(|s| norm(*s) < 1e-5));
    assert_eq!(made.covered, made.samples);
    let told = made.depth.expect("a margin was asked for");
    assert!(told.distance.is_some(), "{:?}", told.open.first());
}
