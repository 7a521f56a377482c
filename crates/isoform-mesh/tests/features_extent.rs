//! The box of a solid.

mod common;

use common::*;
use isoform_geom::{Aabb, Solid};
use isoform_mesh::features::{ExtentError, START, extent};

fn holds(solid: &dyn Solid, want: Aabb, size: f64) {
    let found = extent(solid, START, size).expect("bounded");
    assert!(found.certified, "{found:?}");
    for i in 0..3 {
        let (lo, hi) = (
            want.lo[i] - found.bounds.lo[i],
            found.bounds.hi[i] - want.hi[i],
        );
        assert!(
            (0.0..=0.5 * size).contains(&lo) && (0.0..=0.5 * size).contains(&hi),
            "{:?} for {want:?}",
            found.bounds
        );
    }
}

#[test]
fn boxes_of_known_solids() {
    holds(
        &part(),
        Aabb {
            lo: [-5.0, -4.0, -2.0],
            hi: [5.0, 1.0, 2.0],
        },
        0.25,
    );
    holds(
        &gyroid(),
        Aabb {
            lo: [-0.95; 3],
            hi: [0.95; 3],
        },
        0.05,
    );
    holds(
        &blend(),
        Aabb {
            lo: [-3.0, -2.0, -0.5],
            hi: [3.0, 2.0, 2.5],
        },
        0.14,
    );
    holds(
        &made(piece(Sphere {
            center: [0.3, -0.2, 7.0],
            r: 1.0,
            side: 1.0,
        })),
        Aabb {
            lo: [-0.7, -1.2, 6.0],
            hi: [1.3, 0.8, 8.0],
        },
        0.08,
    );
    // Larger than the start box, and beyond it.
    holds(
        &made(piece(Sphere {
            center: [0.0; 3],
            r: 500.0,
            side: 1.0,
        })),
        Aabb {
            lo: [-500.0; 3],
            hi: [500.0; 3],
        },
        10.0,
    );
    let two = Node::Max(vec![
        block([-1.0; 3], [1.0; 3]),
        block([399.0, 0.0, 0.0], [404.0, 1.0, 1.0]),
    ]);
    holds(
        &made(two),
        Aabb {
            lo: [-1.0; 3],
            hi: [404.0, 1.0, 1.0],
        },
        0.1,
    );
    // Oblique planes: an octahedron.
    let faces = (0..8).map(|k: usize| {
        let n: [f64; 3] = std::array::from_fn(|i| if k >> i & 1 == 0 { 0.5 } else { -0.5 });
        piece(plane(n, 1.0))
    });
    holds(
        &made(Node::Min(faces.collect())),
        Aabb {
            lo: [-2.0; 3],
            hi: [2.0; 3],
        },
        0.1,
    );
}

#[test]
fn boxes_to_begin_with_may_lie_far_out() {
    let center = [3e6, -5e7, 0.0];
    let far = made(block(center, center.map(|v| v + 2.0)));
    let start = Aabb {
        lo: center.map(|v| v - 1.0),
        hi: center.map(|v| v + 4.0),
    };
    let found = extent(&far, start, 0.1).expect("a box");
    for k in 0..3 {
        assert!((found.bounds.lo[k] - center[k]).abs() < 0.1);
        assert!((found.bounds.hi[k] - center[k] - 2.0).abs() < 0.1);
    }
    let endless = Aabb {
        lo: [0.0; 3],
        hi: [f64::INFINITY; 3],
    };
    let error = extent(&far, endless, 0.1);
    assert!(matches!(error, Err(ExtentError::Start { .. })));
}

#[test]
fn what_has_no_box() {
    let empty = made(Node::Min(vec![
        block([0.0; 3], [1.0; 3]),
        block([2.0; 3], [3.0; 3]),
    ]));
    assert_eq!(
        extent(&empty, START, 0.1),
        Err(ExtentError::Empty { certified: true })
    );
    let half = made(piece(plane([0.6, 0.0, 0.8], 1.0)));
    assert_eq!(
        extent(&half, START, 0.1),
        Err(ExtentError::Unbounded { limit: 1e6 })
    );
    let all = made(Node::Max(vec![
        piece(plane([1.0, 0.0, 0.0], 1.0)),
        piece(plane([-1.0, 0.0, 0.0], 1.0)),
    ]));
    assert_eq!(
        extent(&all, START, 0.1),
        Err(ExtentError::Unbounded { limit: 1e6 })
    );
    let pipe = made(cylinder(0, [0.0; 3], 1.0, 1.0));
    assert_eq!(
        extent(&pipe, START, 0.1),
        Err(ExtentError::Unbounded { limit: 1e6 })
    );
    // A single point: inside by ≥ 0, yet no solid that samples would meet.
    let point = made(piece(Ellipsoid { a: [1e-9; 3] }));
    assert!(matches!(
        extent(&point, START, 0.1),
        Err(ExtentError::Empty { certified: false }) | Ok(_)
    ));
    assert!(matches!(
        extent(&part(), Aabb::EMPTY, 0.1),
        Err(ExtentError::Start { .. })
    ));
}
