//! The box of a solid.

use crate::common::*;
use isoform_field::Pieces;
use isoform_field::hyperfun::{Mode, Model};
use isoform_geom::{Aabb, Point3, Solid, dot};
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

fn of_program(text: &str) -> Pieces {
    let model = Model::parse(text, Mode::Default).expect("a program");
    Pieces::of_model(&model, &[0.0]).expect("an expression")
}

/// Returns the coordinate from `at` along `r`, as an expression of a program.
fn along(r: Point3, at: Point3) -> String {
    let terms: Vec<String> = (0..3)
        .map(|i| format!("({:?})*(x[{}] - ({:?}))", r[i], i + 1, at[i]))
        .collect();
    terms.join(" + ")
}

/// A disk of radius 30 and height 16 with its foot at `at`, and its own axes as rows.
fn disk(at: Point3, rows: [Point3; 3]) -> Pieces {
    let [x, y, z] = rows.map(|r| along(r, at));
    let text = format!(
        "m(x[3], a[1]) {{
            u = {x}; v = {y}; w = {z};
            m = ((900 - u^2 - v^2)/60) & (w & (16 - w));
        }}"
    );
    of_program(&text)
}

/// Oblique disks beyond the start box. Some of the slabs around the box hold a part of the disk,
/// others only a sliver that samples miss: the disk continues behind it, and the box must not end
/// where the search did.
#[test]
fn what_goes_on_behind_a_sliver_is_in_the_box() {
    let rows = [
        [-0.708_561_205_387, -0.702_320_888_350, -0.068_457_198_361],
        [-0.358_998_792_212, 0.442_299_797_410, -0.821_882_446_826],
        [0.607_503_815_140, -0.557_777_965_680, -0.565_528_828_259],
    ];
    let feet = [
        [-13.393, 37.247, 15.244],
        [13.393, -37.247, -15.244],
        [33.0, 12.5, 28.0],
    ];
    for at in feet {
        let top: Point3 = std::array::from_fn(|i| at[i] + 16.0 * rows[2][i]);
        let axis = rows[2];
        // The rim of a disk with axis n reaches r √(1 − nᵢ²) along axis i.
        let rim = axis.map(|n| 30.0 * (1.0 - n * n / dot(axis, axis)).sqrt());
        let want = Aabb {
            lo: std::array::from_fn(|i| at[i].min(top[i]) - rim[i] + 1e-6),
            hi: std::array::from_fn(|i| at[i].max(top[i]) + rim[i] - 1e-6),
        };
        for size in [10.0, 4.0, 2.0, 1.25, 0.5] {
            holds(&disk(at, rows), want, size);
        }
    }
}

/// An oblique thin plate with a bore in a shell beyond the start box: samples miss it at the first
/// tolerances, but it is not empty.
#[test]
fn a_thin_plate_with_a_bore_beyond_the_start_box_is_found() {
    let rows = [
        [-0.399976124, 0.903668560, -0.152977883],
        [0.590081789, 0.126186567, -0.797421114],
        [-0.701300636, -0.409218870, -0.583709975],
    ];
    let at = [-15.2677, -7.8706, -19.7007];
    let half = [28.2238, 30.0072];
    let thickness = 5.2403;
    let [u, v, w] = rows.map(|r| along(r, at));
    let text = format!(
        "m(x[3], a[1]) {{
            u = {u}; v = {v}; w = {w};
            m = ({} - u) & (u + {}) & ({} - v) & (v + {}) & w & ({thickness} - w)
                & (u^2 + v^2 - 19.64^2);
        }}",
        half[0], half[0], half[1], half[1]
    );
    let middle: Point3 = std::array::from_fn(|i| at[i] + 0.5 * thickness * rows[2][i]);
    let reach: Point3 = std::array::from_fn(|i| {
        let sides = half[0] * rows[0][i].abs() + half[1] * rows[1][i].abs();
        sides + 0.5 * thickness * rows[2][i].abs() - 1e-6
    });
    let want = Aabb {
        lo: std::array::from_fn(|i| middle[i] - reach[i]),
        hi: std::array::from_fn(|i| middle[i] + reach[i]),
    };
    for size in [4.0, 2.0, 1.0] {
        holds(&of_program(&text), want, size);
    }
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
