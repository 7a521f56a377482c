//! Faces that go round without a seam, as many programs write them, against closed forms.

use crate::common::{open_sides, prepared, read};
use isoform_testdata::data;
use std::f64::consts::PI;

/// Heights of the caps.
const CAP_HEIGHTS: [f64; 2] = [2.0, 4.0];

#[test]
fn volumes_and_areas_are_the_closed_forms() {
    let cap = |h: f64| (PI * h * h * (9.0 - h) / 3.0, PI * (6.0 * h + 8.0));
    let slant = 20f64.sqrt();
    let known = [
        ("cyl", (20.0 * PI, 28.0 * PI)),
        ("ball", (36.0 * PI, 36.0 * PI)),
        // Balls of radius 3 cut at a distance of 1 from the centre; one goes round its poles.
        ("cap", cap(CAP_HEIGHTS[0])),
        ("bigcap", cap(CAP_HEIGHTS[1])),
        ("cone", (16.0 * PI / 3.0, PI * (2.0 * slant + 4.0))),
        ("elbow", (2.5 * PI * PI, 5.0 * PI * PI + 2.0 * PI)),
        ("ring", (10.0 * PI * PI, 20.0 * PI * PI)),
        ("halfring", (5.0 * PI * PI, 10.0 * PI * PI + 20.0 * PI)),
        ("tetra", (1.0 / 6.0, 1.5 + 0.5 * 3f64.sqrt())),
    ];
    for (name, (volume, area)) in known {
        let shape = prepared(read(&data(&format!("step/seamless/{name}.step")))).expect(name);
        assert_eq!(open_sides(&shape), 0, "{name}");
        let found = shape.measures();
        assert_eq!(found.by_triangles, 0, "{name}");
        for (found, expected) in [(found.volume.expect("a solid"), volume), (found.area, area)] {
            assert!(
                (found / expected - 1.0).abs() < 1e-12,
                "{name}: {found} {expected}"
            );
        }
    }
}

#[test]
fn distances_are_the_closed_forms() {
    let signed = |name: &str| {
        let shape = prepared(read(&data(&format!("step/seamless/{name}.step")))).expect(name);
        move |p: [f64; 3]| shape.signed_distance(p).expect("a distance")
    };
    let (ball, ring, cone) = (signed("ball"), signed("ring"), signed("cone"));
    for i in 0..200 {
        let at = |k: f64| 14.0 * (k * f64::from(i)).fract() - 7.0;
        let p = [at(0.754_877), at(0.569_840), at(0.430_159)];
        let [x, y, z] = p;
        let out = x.hypot(y);
        assert!((ball(p) - (out.hypot(z) - 3.0)).abs() < 1e-13, "{p:?}");
        assert!(
            (ring(p) - ((out - 5.0).hypot(z) - 1.0)).abs() < 1e-13,
            "{p:?}"
        );
    }
    // Above the apex, below the base, beside the slope and within.
    assert!((cone([0.0, 0.0, 7.0]) - 3.0).abs() < 1e-13);
    assert!((cone([0.5, 0.0, -2.0]) - 2.0).abs() < 1e-13);
    assert!((cone([0.0, 0.0, 1.0]) + 1.0).abs() < 1e-13);
    let slope = [2.0 / 5f64.sqrt(), 1.0 / 5f64.sqrt()];
    let beside = [1.0 + 3.0 * slope[0], 0.0, 2.0 + 3.0 * slope[1]];
    assert!((cone(beside) - 3.0).abs() < 1e-13);
}

/// A ball of radius 5 without a cylinder of radius 5/2 that touches it from within: the borders of
/// its faces touch themselves (Viviani's curve).
#[test]
fn faces_that_touch_themselves_are_measured_by_triangles() {
    let shape = prepared(read(&data("step/forms/viviani.step"))).expect("triangles");
    let found = shape.measures();
    assert_eq!(found.by_triangles, 2);
    let (cube, square) = (125.0, 25.0);
    let area = 4.0 * PI * square - 2.0 * (PI - 2.0) * square + 4.0 * square;
    let volume = found.volume.expect("a solid");
    let expected = 2.0 / 3.0 * PI * cube + 8.0 / 9.0 * cube;
    assert!(
        (volume - expected).abs() < shape.deviation() * area,
        "{volume}"
    );
    assert!((found.area / area - 1.0).abs() < 0.01, "{}", found.area);
}

/// A cone of radius 3 and height 7 as splines, whose tip is a pole.
#[test]
fn distances_near_the_tip_of_a_spline_cone() {
    let shape = prepared(read(&data("step/forms/nurbs-tip.step"))).expect("triangles");
    let slope = 58f64.sqrt();
    for i in 0..1000 {
        let at = |k: f64, size: f64| size * ((k * f64::from(i)).fract() - 0.5);
        let p = [
            at(0.754_877, 4.0),
            at(0.569_840, 4.0),
            7.0 + at(0.430_159, 6.0),
        ];
        let r = p[0].hypot(p[1]);
        // Along the side from the tip, and away from it.
        let along = (3.0 * r - 7.0 * (p[2] - 7.0)) / slope;
        let off = (7.0 * r + 3.0 * (p[2] - 7.0)) / slope;
        let side = if along >= 0.0 {
            off.abs()
        } else {
            r.hypot(p[2] - 7.0)
        };
        let expected = side.min(p[2].abs().hypot((r - 3.0).max(0.0)));
        let found = shape.nearest(p).expect("a point").distance;
        assert!(
            (found - expected).abs() < 1e-11,
            "{p:?}: {found}, not {expected}"
        );
    }
}
