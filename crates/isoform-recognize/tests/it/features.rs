//! Features of a plate with all kinds of them, scanned in a pose of its own.

use isoform_control::Control;
use isoform_geom::{Point3, PointCloud, dot, sub};
use isoform_num::Random;
use isoform_recognize::{Feature, FeatureKind, Options, features, recognize};
use std::f64::consts::{FRAC_PI_4, TAU};

/// Returns the function of a plate of 80 by 50 by 12, positive inside: with a hole, one with a
/// counterbore, one with a countersink, a blind one, a slot, a pocket and a boss.
fn plate([x, y, z]: Point3) -> f64 {
    let off = |cx: f64, cy: f64| (x - cx).hypot(y - cy);
    let block = z.min(12.0 - z).min(x.min(80.0 - x)).min(y.min(50.0 - y));
    let through = 3.0 - off(10.0, 10.0);
    let counterbore = (2.5 - off(30.0, 10.0)).max((5.0 - off(30.0, 10.0)).min(z - 8.0));
    let cone = (z - 9.5).min(2.5 + (z - 9.5) - off(50.0, 10.0));
    let countersink = (2.5 - off(50.0, 10.0)).max(cone);
    let blind = (4.0 - off(70.0, 10.0)).min(z - 5.0);
    let beyond = ((x - 20.0).abs() - 8.0).max(0.0);
    let slot = (4.0 - beyond.hypot(y - 38.0)).min(z - 6.0);
    let pocket = (8.0 - (x - 50.0).abs())
        .min(5.0 - (y - 38.0).abs())
        .min(z - 7.0);
    let boss = (5.0 - off(70.0, 38.0)).min(20.0 - z).min(z - 6.0);
    let taken = [counterbore, countersink, blind, slot, pocket];
    let taken = taken.into_iter().fold(through, f64::max);
    block.min(-taken).max(boss)
}

/// Returns points on the surface of the plate: those of its planes, cylinders and cone at which the
/// function vanishes.
fn surface(random: &mut Random) -> Vec<Point3> {
    let mut points = Vec::new();
    let planes = [
        (0, vec![0.0, 80.0, 42.0, 58.0]),
        (1, vec![0.0, 50.0, 33.0, 34.0, 42.0, 43.0]),
        (2, vec![0.0, 12.0, 20.0, 5.0, 6.0, 7.0, 8.0]),
    ];
    // In the centre, the radius, and the slope of the radius with the height above 9.5.
    let bands = [
        ([10.0, 10.0], 3.0, 0.0),
        ([30.0, 10.0], 2.5, 0.0),
        ([30.0, 10.0], 5.0, 0.0),
        ([50.0, 10.0], 2.5, 0.0),
        ([50.0, 10.0], 2.5, 1.0),
        ([70.0, 10.0], 4.0, 0.0),
        ([12.0, 38.0], 4.0, 0.0),
        ([28.0, 38.0], 4.0, 0.0),
        ([70.0, 38.0], 5.0, 0.0),
    ];
    let box_ = [80.0, 50.0, 20.0];
    for (axis, offsets) in &planes {
        for offset in offsets {
            for _ in 0..5000 {
                let mut p = box_.map(|size| size * random.unit());
                p[*axis] = *offset;
                points.push(p);
            }
        }
    }
    for (center, radius, slope) in bands {
        for _ in 0..800 {
            let (sin, cos) = (TAU * random.unit()).sin_cos();
            let z = 20.0 * random.unit();
            let r = radius + slope * (z - 9.5);
            points.push([center[0] + r * cos, center[1] + r * sin, z]);
        }
    }
    points.retain(|p| plate(*p).abs() < 1e-9);
    points
}

/// Rows of a rotation.
const POSE: [Point3; 3] = [[0.6, 0.0, 0.8], [-0.64, 0.6, 0.48], [-0.48, -0.8, 0.36]];

fn found(noise: f64) -> Vec<Feature> {
    let mut random = Random::new(8);
    let points = surface(&mut random).into_iter().map(|p| {
        let moved = POSE.map(|row| dot(row, p));
        moved
            .map(|v| v + 30.0 + noise * (random.unit() + random.unit() + random.unit() - 1.5) * 2.0)
    });
    let points: Vec<Point3> = points.collect();
    let scan = PointCloud::from_points(points.clone());
    let found = recognize(&scan, &Options::default(), &Control::default()).expect("entities");
    features(&points, &found)
}

#[test]
fn features_of_a_plate_have_their_sizes_and_places() {
    for noise in [0.0, 0.02] {
        let all = found(noise);
        let within = |a: f64, b: f64| (a - b).abs() < 1e-4 + 3.0 * noise;
        let up: Point3 = std::array::from_fn(|k| POSE[k][2]);
        let place = |p: Point3| POSE.map(|row| dot(row, p) + 30.0);
        let at = |middle: Point3| {
            let is_there = |f: &&Feature| {
                let off = sub(f.point, place(middle));
                dot(off, off).sqrt() < 0.05 + 3.0 * noise
            };
            let one: Vec<&Feature> = all.iter().filter(is_there).collect();
            assert_eq!(one.len(), 1, "noise {noise}, at {middle:?}: {all:#?}");
            let sign = if matches!(one[0].kind, FeatureKind::Boss { .. }) {
                1.0
            } else {
                -1.0
            };
            assert!(sign * dot(one[0].direction, up) > 0.99, "{:?}", one[0]);
            one[0]
        };
        assert_eq!(all.len(), 7, "noise {noise}: {all:#?}");
        let holes = [
            (10.0, 3.0, true, 12.0, None),
            (30.0, 2.5, true, 12.0, Some((5.0, 4.0, None))),
            (50.0, 2.5, true, 12.0, Some((5.0, 2.5, Some(FRAC_PI_4)))),
            (70.0, 4.0, false, 7.0, None),
        ];
        for (x, radius, through, depth, wide) in holes {
            // A hole that goes through has its mouth at either end, unless one is wider.
            let is_open = through && wide.is_none();
            let top = all.iter().any(|f| {
                let off = sub(f.point, place([x, 10.0, 12.0]));
                dot(off, off).sqrt() < 0.1
            });
            if is_open && !top {
                continue;
            }
            let f = at([x, 10.0, 12.0]);
            let FeatureKind::Hole {
                radius: r,
                is_through,
                widenings,
            } = &f.kind
            else {
                panic!("{f:?}");
            };
            assert!(within(*r, radius) && within(f.depth, depth), "{f:?}");
            assert_eq!(
                (*is_through, widenings.len()),
                (through, usize::from(wide.is_some()))
            );
            if let Some((radius, depth, angle)) = wide {
                let w = widenings[0];
                assert!(w.is_at_mouth, "{w:?}");
                assert!(within(w.radius, radius) && within(w.depth, depth), "{w:?}");
                assert_eq!(w.half_angle.is_some(), angle.is_some());
                let off = w.half_angle.zip(angle).map_or(0.0, |(a, b)| (a - b).abs());
                assert!(off < 1e-4 + noise, "{w:?}");
            }
        }
        let slot = at([20.0, 38.0, 12.0]);
        assert!(
            matches!(slot.kind, FeatureKind::Slot { width, length, is_through: false }
                if within(width, 8.0) && within(length, 24.0))
                && within(slot.depth, 6.0),
            "{slot:?}"
        );
        let pocket = at([50.0, 38.0, 12.0]);
        assert!(
            matches!(pocket.kind, FeatureKind::Pocket { width, length }
                if within(width, 10.0) && within(length, 16.0))
                && within(pocket.depth, 5.0),
            "{pocket:?}"
        );
        let boss = at([70.0, 38.0, 12.0]);
        assert!(
            matches!(boss.kind, FeatureKind::Boss { radius } if within(radius, 5.0))
                && within(boss.depth, 8.0),
            "{boss:?}"
        );
    }
}
