//! Feature curves and corners.

mod common;

use common::*;
use isoform_geom::{Aabb, Point3, Solid, norm, sub};
use isoform_mesh::Control;
use isoform_mesh::features::{FeatureCurve, FeatureOptions, Features, find};

fn features(solid: &dyn Solid, half: f64, size: f64) -> Features {
    let start = std::time::Instant::now();
    let f = find(solid, Aabb { lo: [-half; 3], hi: [half; 3] }, &FeatureOptions { size, ..Default::default() }, &Control::default());
    println!(
        "{} curves {} corners {} cells complete {} certified {} uncertified {} {:?}",
        f.curves.len(),
        f.corners.len(),
        f.cells,
        f.complete,
        f.certified,
        f.uncertified.len(),
        start.elapsed()
    );
    f
}

fn length(curve: &FeatureCurve) -> f64 {
    curve.points.windows(2).map(|w| norm(sub(w[1], w[0]))).sum()
}

fn total(f: &Features) -> f64 {
    f.curves.iter().map(length).sum()
}

#[test]
fn test_part() {
    let solid = part();
    let f = features(&solid, 5.5, 0.25);
    for c in &f.corners {
        println!("{:?}", c);
    }
    for c in &f.curves {
        println!("{:?} {} {:?} {} {:?}", c.pieces, c.points.len(), c.corners, length(c), c.angles);
    }
    assert_eq!((f.curves.len(), f.corners.len()), (20, 12));
}

#[test]
fn test_gyroid() {
    let solid = gyroid();
    let f = features(&solid, 1.0, 0.05);
    println!("{}", total(&f));
    assert_eq!((f.curves.len(), f.corners.len()), (144, 96));
}

#[test]
fn test_blend() {
    let solid = blend();
    let f = features(&solid, 3.5, 0.14);
    for c in &f.corners {
        println!("{:?}", c);
    }
    for c in &f.curves {
        println!("{:?} {} {:?} {} {:?}", c.pieces, c.points.len(), c.corners, length(c), c.angles);
    }
    assert_eq!((f.curves.len(), f.corners.len()), (15, 8));
}
#[allow(dead_code)]
fn at(_: Point3) {}
