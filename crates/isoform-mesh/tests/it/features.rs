//! Feature curves and corners of solids whose features are known in closed form.

use crate::common::*;
use isoform_geom::{Aabb, Point3, Solid, cross, dot, norm, sub};
use isoform_mesh::Control;
use isoform_mesh::features::{CornerKind, FeatureCurve, FeatureOptions, Features, find};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

fn features(solid: &Made, half: f64, size: f64) -> Features {
    let region = Aabb {
        lo: [-half; 3],
        hi: [half; 3],
    };
    let found = find(
        solid,
        region,
        &FeatureOptions {
            size,
            ..Default::default()
        },
        &Control::default(),
    );
    assert!(found.complete);
    sound(solid, &found, size);
    found
}

/// Checks properties of all features: points on both pieces, curves from corner to corner, dense,
/// without duplicates.
fn sound(solid: &Made, found: &Features, size: f64) {
    for curve in &found.curves {
        for p in &curve.points {
            for k in curve.pieces {
                let (v, g) = solid.gradient(k, *p);
                // Where the pieces touch, the curve is less well determined than the pieces are.
                assert!(v.abs() <= 1e-12 * norm(g), "{p:?} is off piece {k} by {v}");
            }
        }
        assert!(
            curve
                .points
                .windows(2)
                .all(|w| w[0] != w[1] && norm(sub(w[1], w[0])) <= 0.51 * size)
        );
        let n = curve.points.len();
        assert_eq!(curve.closed, curve.points[0] == curve.points[n - 1]);
        for (corner, p) in curve
            .corners
            .iter()
            .zip([curve.points[0], curve.points[n - 1]])
        {
            assert!(corner.is_none_or(|c| found.corners[c as usize].point == p));
        }
    }
    let middles: Vec<Point3> = found
        .curves
        .iter()
        .map(|c| c.points[c.points.len() / 2])
        .collect();
    for (i, p) in middles.iter().enumerate() {
        assert!(
            middles[..i].iter().all(|q| norm(sub(*p, *q)) > 1e-3 * size),
            "two curves through {p:?}"
        );
    }
}

fn length(curve: &FeatureCurve) -> f64 {
    curve.points.windows(2).map(|w| norm(sub(w[1], w[0]))).sum()
}

fn total(f: &Features) -> f64 {
    f.curves.iter().map(length).sum()
}

fn assert_corners(found: &Features, want: &[Point3]) {
    assert_eq!(found.corners.len(), want.len(), "{:?}", found.corners);
    for w in want {
        let nearest = found
            .corners
            .iter()
            .map(|c| norm(sub(c.point, *w)))
            .fold(f64::INFINITY, f64::min);
        assert!(
            nearest < 1e-12,
            "no corner at {w:?}, the nearest one is {nearest} away"
        );
    }
}

fn near(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance, "{a} is not {b}");
}

fn corners_of(lo: Point3, hi: Point3) -> Vec<Point3> {
    (0..8usize)
        .map(|k| std::array::from_fn(|i| if k >> i & 1 == 0 { lo[i] } else { hi[i] }))
        .collect()
}

#[test]
fn part_has_20_curves_and_12_corners() {
    let found = features(&part(), 5.5, 0.25);
    assert!(found.certified);
    let half = 2.0_f64.sqrt();
    let mut corners = corners_of([-5.0, -4.0, -2.0], [5.0, 1.0, 2.0]);
    corners.extend(
        [3.0 - half, 3.0 + half]
            .into_iter()
            .flat_map(|x| [[x, 1.0, -2.0], [x, 1.0, 2.0]]),
    );
    assert_corners(&found, &corners);
    assert_eq!(found.curves.len(), 20);
    assert_eq!(found.curves.iter().filter(|c| c.closed).count(), 2);
    // Twelve edges of the box, the notch's chords left out, its two arcs and two edges, and the
    // rims of the hole.
    let notch = 1.5 * (PI + 2.0 * (0.5_f64 / 1.5).asin());
    let want = 4.0 * (10.0 + 5.0 + 4.0) - 4.0 * half + 2.0 * notch + 8.0 + 2.0 * TAU * 1.25;
    near(total(&found), want, 1e-4 * want);
    for c in found.curves.iter().filter(|c| c.closed) {
        near(c.angles[0], FRAC_PI_2, 1e-12);
        near(c.angles[1], FRAC_PI_2, 1e-12);
    }
}

#[test]
fn gyroid_has_144_curves() {
    let found = features(&gyroid(), 1.0, 0.05);
    assert!(found.certified);
    // 90 points where a sheet's face crosses an edge of the cube, and six corners of the cube
    // inside the sheet.
    assert_eq!((found.curves.len(), found.corners.len()), (144, 96));
    assert!(found.corners.iter().all(|c| c.kind == CornerKind::Meeting));
    for corner in 0..96 {
        assert_eq!(
            found
                .curves
                .iter()
                .flat_map(|c| c.corners)
                .filter(|c| *c == Some(corner))
                .count(),
            3
        );
    }
}

#[test]
fn blended_seams_are_no_features() {
    let found = features(&blend(), 3.5, 0.14);
    assert_eq!(found.curves.len(), 15);
    assert_corners(&found, &corners_of([-3.0, -2.0, -0.5], [3.0, 2.0, 0.5]));
    near(total(&found), 44.0 + TAU * 2.0, 1e-3);
}

#[test]
fn sphere_has_none() {
    let found = features(
        &made(piece(Sphere {
            center: [0.1, 0.2, 0.3],
            r: 1.0,
            side: 1.0,
        })),
        2.0,
        0.1,
    );
    assert!(found.certified && found.curves.is_empty() && found.corners.is_empty());
}

#[test]
fn capped_cylinder_has_two_circles() {
    let caps = [
        piece(plane([0.0, 0.0, -1.0], 0.7)),
        piece(plane([0.0, 0.0, 1.0], 0.9)),
    ];
    let solid = made(Node::Min(
        [cylinder(2, [0.1, 0.0, 0.0], 1.3, 1.0)]
            .into_iter()
            .chain(caps)
            .collect(),
    ));
    let found = features(&solid, 2.0, 0.2);
    assert!(found.certified && found.corners.is_empty());
    assert_eq!(
        found.curves.iter().map(|c| c.closed).collect::<Vec<_>>(),
        [true, true]
    );
    near(total(&found), 2.0 * TAU * 1.3, 1e-2);
    // Chords miss the circle by less than 4e-4 of the size.
    for c in &found.curves {
        for w in c.points.windows(2) {
            let m: Point3 = std::array::from_fn(|i| 0.5 * (w[0][i] + w[1][i]));
            assert!(1.3 - (m[0] - 0.1).hypot(m[1]) < 4.1e-4 * 0.2);
        }
    }
}

#[test]
fn coplanar_faces_are_one() {
    // Two blocks with their tops in one plane, the smaller one sticking out in front; its top is
    // written with another factor.
    let mut small = planes_of_block([-0.4, 0.3, -0.2], [0.5, 1.7, 1.0]);
    small[5] = plane([0.0, 0.0, -3.0], 3.0);
    let solid = made(Node::Max(vec![
        block([-1.0; 3], [1.0; 3]),
        Node::Min(small.into_iter().map(piece).collect()),
    ]));
    let found = features(&solid, 2.0, 0.2);
    let mut corners = corners_of([-1.0; 3], [1.0; 3]);
    for x in [-0.4, 0.5] {
        corners.extend([[x, 1.0, -0.2], [x, 1.0, 1.0], [x, 1.7, -0.2], [x, 1.7, 1.0]]);
    }
    assert_corners(&found, &corners);
    // 12 and the top front edge in two; of the small one four across, and at its front four, at its
    // foot three.
    assert_eq!(found.curves.len(), 13 + 4 + 4 + 3);
    near(
        total(&found),
        24.0 - 0.9 + 4.0 * 0.7 + 2.0 * (0.9 + 1.2) + (0.9 + 2.4),
        1e-9,
    );
}

#[test]
fn cone_has_a_tip() {
    let solid = made(Node::Min(vec![
        piece(Cone { k: 0.7 }),
        piece(plane([0.0, 0.0, -1.0], 1.1)),
    ]));
    let found = features(&solid, 1.5, 0.2);
    assert_eq!(found.curves.len(), 1);
    assert_corners(&found, &[[0.0; 3]]);
    assert_eq!(found.corners[0].kind, CornerKind::Apex);
    // The tip of a cone cut off is none.
    let solid = made(Node::Min(vec![
        piece(Cone { k: 0.7 }),
        piece(plane([0.0, 0.0, -1.0], 1.1)),
        piece(plane([0.0, 0.0, 1.0], -0.3)),
    ]));
    assert!(features(&solid, 1.5, 0.2).corners.is_empty());
    // A plane through the tip parts the cone from its other half, and has either sign there.
    for z in [0.0, 1e-16, -1e-16] {
        let solid = made(Node::Min(vec![
            piece(Cone { k: 0.7 }),
            piece(plane([0.0, 0.0, -1.0], 1.1)),
            piece(plane([0.0, 0.0, 1.0], z)),
        ]));
        assert_corners(&features(&solid, 1.5, 0.2), &[[0.0; 3]]);
    }
}

#[test]
fn the_middle_of_a_small_ball_is_no_tip() {
    let far = [3.1, 2.2, 1.3];
    let ball = |center, r| {
        piece(Sphere {
            center,
            r,
            side: 1.0,
        })
    };
    for radius in [0.3, 0.05, 0.002] {
        let solid = made(Node::Max(vec![ball([0.0; 3], 1.0), ball(far, radius)]));
        assert_corners(&features(&solid, 4.0, 0.5), &[]);
    }
}

#[test]
fn equal_cylinders_cross_where_they_are_parallel() {
    for turn in [0, 1] {
        let both = vec![
            cylinder(2, [0.0; 3], 1.0, 1.0),
            cylinder(turn, [0.0; 3], 1.0, 1.0),
        ];
        let found = features(&made(Node::Min(both)), 1.6, 0.15);
        let mut tips = [[0.0; 3], [0.0; 3]];
        (tips[0][1 - turn], tips[1][1 - turn]) = (1.0, -1.0);
        assert_corners(&found, &tips);
        assert!(found.corners.iter().all(|c| c.kind == CornerKind::Branch));
        assert_eq!(found.curves.len(), 4);
        // Half ellipses with semi-axes 1 and √2.
        near(total(&found), 2.0 * 7.640395578055424, 1e-2);
    }
}

#[test]
fn boss_touching_an_edge() {
    // A cylinder on a block, tangent to one of its sides: its foot touches the edge.
    let boss = vec![
        cylinder(2, [0.0; 3], 1.0, 1.0),
        piece(plane([0.0, 0.0, -1.0], 2.0)),
        piece(plane([0.0, 0.0, 1.0], 0.0)),
    ];
    let solid = made(Node::Max(vec![
        block([-2.0, -2.0, -1.0], [1.0, 2.0, 1.0]),
        Node::Min(boss),
    ]));
    let found = features(&solid, 2.5, 0.2);
    let mut corners = corners_of([-2.0, -2.0, -1.0], [1.0, 2.0, 1.0]);
    corners.push([1.0, 0.0, 1.0]);
    assert_eq!(found.corners.len(), corners.len(), "{:?}", found.corners);
    // The twelve edges, one of them in two, the foot and the rim.
    assert_eq!(found.curves.len(), 15);
    near(
        total(&found),
        2.0 * 2.0 * TAU / 2.0 + 4.0 * (3.0 + 4.0 + 2.0),
        1e-2,
    );
}

#[test]
fn wedge_of_nearly_parallel_planes() {
    // Planes 5 degrees apart make a roof with an edge and corners.
    let (s, c) = 2.5_f64.to_radians().sin_cos();
    let roof = [plane([s, 0.0, -c], 0.4), plane([-s, 0.0, -c], 0.4)];
    let solid = made(Node::Min(vec![
        block([-1.0, -1.1, -0.5], [1.2, 1.0, 3.0]),
        piece(roof[0].clone()),
        piece(roof[1].clone()),
    ]));
    let found = features(&solid, 2.0, 0.2);
    let z = |x: f64| (0.4 - s * x.abs()) / c;
    let mut corners = Vec::new();
    for y in [-1.1, 1.0] {
        corners.extend([
            [-1.0, y, -0.5],
            [1.2, y, -0.5],
            [-1.0, y, z(1.0)],
            [1.2, y, z(1.2)],
            [0.0, y, 0.4 / c],
        ]);
    }
    assert_corners(&found, &corners);
    assert_eq!(found.curves.len(), 15);
    let ridge = found
        .curves
        .iter()
        .find(|c| c.pieces == [6, 7])
        .expect("the ridge");
    near(ridge.angles[0], 5.0_f64.to_radians(), 1e-12);
}

#[test]
fn small_hole_is_found() {
    // A hole of a fiftieth of the size.
    let solid = made(Node::Min(vec![
        block([-1.0; 3], [1.0; 3]),
        cylinder(2, [0.123, 0.321, 0.0], 0.01, -1.0),
    ]));
    let found = features(&solid, 1.5, 0.5);
    assert_eq!((found.curves.len(), found.corners.len()), (14, 8));
}

#[test]
fn curves_leave_the_region() {
    let solid = made(block([-1.0; 3], [1.0; 3]));
    let region = Aabb {
        lo: [0.0; 3],
        hi: [3.0; 3],
    };
    let found = find(
        &solid,
        region,
        &FeatureOptions {
            size: 0.1,
            ..Default::default()
        },
        &Control::default(),
    );
    assert_eq!((found.curves.len(), found.corners.len()), (3, 1));
    for c in &found.curves {
        assert_eq!(c.corners.iter().flatten().count(), 1);
        near(length(c), 1.0, 0.01);
    }
}

#[test]
fn the_same_for_any_number_of_threads() {
    let solid = gyroid();
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| features(&solid, 1.0, 0.1))
    };
    assert_eq!(of(1), of(4));
}

#[test]
fn a_spent_budget_is_told() {
    let found = find(
        &part(),
        Aabb {
            lo: [-5.5; 3],
            hi: [5.5; 3],
        },
        &FeatureOptions {
            size: 0.1,
            cells: 500,
            ..Default::default()
        },
        &Control::default(),
    );
    assert!(!found.complete && !found.certified && !found.uncertified.is_empty());
}

/// Planes in general position through a corner, at all angles between them.
#[test]
fn corners_of_random_pyramids() {
    let mut seed = 7u64;
    let mut random = || {
        seed = seed
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    };
    let mut tried = 0;
    while tried < 40 {
        let n: [Point3; 3] = std::array::from_fn(|_| std::array::from_fn(|_| random()));
        let tip: Point3 = std::array::from_fn(|_| 0.3 * random());
        let unit = n.map(|v| v.map(|c| c / norm(v)));
        if dot(unit[0], cross(unit[1], unit[2])).abs() < 0.05 {
            continue;
        }
        tried += 1;
        let planes = unit.map(|v| piece(plane(v, -dot(v, tip))));
        let ball = piece(Sphere {
            center: [0.0; 3],
            r: 2.0,
            side: 1.0,
        });
        let solid = made(Node::Min(vec![
            Node::Min(planes.into_iter().collect()),
            ball,
        ]));
        let found = features(&solid, 2.5, 0.2);
        let at = found
            .corners
            .iter()
            .map(|c| norm(sub(c.point, tip)))
            .fold(f64::INFINITY, f64::min);
        assert!(at < 1e-12, "{at} from {tip:?}");
        // Three edges from the tip to the sphere and three arcs there.
        assert_eq!((found.corners.len(), found.curves.len()), (4, 6));
    }
}
