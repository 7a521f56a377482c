//! Real objects deviate from their surfaces by more than the noise of their points, and by smooth
//! amounts: they are recognised nevertheless, and the required tolerance is reported.

use isoform_control::Control;
use isoform_geom::{Point3, PointCloud, Quadric};
use isoform_num::Random;
use isoform_recognize::{Entity, Options, Recognition, Relation, RelationKind, recognize};
use std::f64::consts::TAU;

const NOISE: f64 = 2e-4;

fn recognised(points: Vec<Point3>, noise: Option<f64>) -> Recognition {
    let options = Options {
        noise,
        ..Options::default()
    };
    recognize(
        &PointCloud::from_points(points),
        &options,
        &Control::default(),
    )
    .expect("surfaces")
}

fn kinds(found: &Recognition) -> Vec<&'static str> {
    found.entities.iter().map(|e| e.surface.name()).collect()
}

/// Returns a normal deviate (Box and Muller).
fn normal(random: &mut Random) -> f64 {
    let (u, turn) = (1.0 - random.unit(), TAU * random.unit());
    (-2.0 * u.ln()).sqrt() * turn.cos()
}

/// Returns a ball of radius 1 whose surface rises and falls by `height`, four to six times around.
fn dented_ball(height: f64) -> Vec<Point3> {
    let mut random = Random::new(5);
    let mut point = || -> Point3 {
        let z = random.symmetric();
        let turn = TAU * random.unit();
        let (r, wave) = (
            (1.0 - z * z).sqrt(),
            (5.0 * turn).sin() * (4.0_f64 * z).cos(),
        );
        let radius = 1.0 + height * wave + NOISE * normal(&mut random);
        [r * turn.cos(), r * turn.sin(), z].map(|v| v * radius)
    };
    (0..6000).map(|_| point()).collect()
}

/// Returns a block of 3 × 2 × 1 whose faces rise and fall by `height`.
fn wavy_block(height: f64) -> Vec<Point3> {
    let mut random = Random::new(6);
    let size = [3.0, 2.0, 1.0];
    let mut point = |face: usize| -> Point3 {
        let k = face / 2;
        let [i, j] = [(k + 1) % 3, (k + 2) % 3];
        let (u, v) = (random.unit(), random.unit());
        let wave = (9.0 * u).sin() * (7.0 * v + 1.0).cos();
        let off = height * wave + NOISE * normal(&mut random);
        let mut p = [0.0; 3];
        (p[i], p[j]) = (size[i] * u, size[j] * v);
        p[k] = if face.is_multiple_of(2) {
            -off
        } else {
            size[k] + off
        };
        p
    };
    // By area: faces of 2, 3 and 6.
    let shares = [2, 2, 3, 3, 6, 6];
    let faces = shares.iter().enumerate();
    let counts = faces.flat_map(|(face, share)| std::iter::repeat_n(face, 300 * share));
    counts.map(&mut point).collect()
}

#[test]
fn a_dented_ball_is_a_ball() {
    let found = recognised(dented_ball(0.01), None);
    assert_eq!(kinds(&found), ["sphere"]);
    assert!(
        found.is_form && found.noise > 5.0 * NOISE,
        "{}",
        found.noise
    );
    let round = recognised(dented_ball(0.0), None);
    assert_eq!(kinds(&round), ["sphere"]);
    assert!(
        !round.is_form && round.noise < 1.5 * NOISE,
        "{}",
        round.noise
    );
}

#[test]
fn a_wavy_block_has_six_planes() {
    let found = recognised(wavy_block(0.02), None);
    let planes = kinds(&found).iter().filter(|k| **k == "plane").count();
    assert!(found.is_form && planes == 6, "{:?}", kinds(&found));
}

/// The user gives the tolerance, whatever the form.
#[test]
fn a_tolerance_allows_form() {
    let found = recognised(dented_ball(0.01), Some(0.01));
    assert_eq!(kinds(&found), ["sphere"]);
    let found = recognised(wavy_block(0.02), Some(0.02));
    assert_eq!(kinds(&found)[..6], ["plane"; 6]);
}

/// Two round balls of radii 0.5 and 0.5008, some 50 deviations apart, lie next to a block whose
/// faces deviate by far more: the tolerance of the block does not make the balls equal.
#[test]
fn a_tolerance_of_form_makes_no_relations_of_those_that_follow_their_surfaces() {
    let mut points = wavy_block(0.02);
    let mut random = Random::new(7);
    for (x, radius) in [(-2.0, 0.5), (5.0, 0.5008)] {
        for _ in 0..600 {
            let (z, turn) = (random.symmetric(), TAU * random.unit());
            let (r, off) = ((1.0 - z * z).sqrt(), radius + NOISE * normal(&mut random));
            points.push([
                x + off * r * turn.cos(),
                1.0 + off * r * turn.sin(),
                off * z,
            ]);
        }
    }
    let found = recognised(points, None);
    assert!(found.is_form, "{:?}", kinds(&found));
    let ball = |radius: f64| {
        let is_it = |e: &Entity| match e.surface {
            Quadric::Sphere { radius: r, .. } => (r - radius).abs() < 2e-4,
            _ => false,
        };
        found.entities.iter().position(is_it).expect("the ball")
    };
    let pair = [ball(0.5), ball(0.5008)];
    let equal = |r: &&Relation| {
        r.kind == RelationKind::EqualRadius && pair.iter().all(|k| r.entities.contains(k))
    };
    assert_eq!(found.relations.iter().find(equal), None);
}

/// A step of 40 deviations in an exact face stays two planes, whatever tolerance a block next to it
/// requires.
#[test]
fn a_step_beside_a_bent_block_is_two_planes() {
    let mut points = wavy_block(0.02);
    let mut random = Random::new(8);
    for (x, z) in [(4.0, 0.0), (5.0, 40.0 * NOISE)] {
        for _ in 0..900 {
            let (u, v) = (random.unit(), random.unit());
            points.push([x + u, 2.0 * v, z + NOISE * normal(&mut random)]);
        }
    }
    let found = recognised(points, None);
    assert!(found.is_form, "{:?}", kinds(&found));
    let is_exact = |e: &&Entity| {
        matches!(e.surface, Quadric::Plane { .. }) && e.points > 850 && e.rms < 1.1 * NOISE
    };
    let exact = found.entities.iter().filter(is_exact).count();
    assert_eq!(exact, 2, "{:?}", found.entities);
}

/// Rotates points by `angle` about x, then about z, and scales them to a unit.
fn placed(points: &[Point3], angle: f64, unit: f64) -> Vec<Point3> {
    let (sin, cos) = angle.sin_cos();
    let turn = |[x, y, z]: Point3| {
        let (y, z) = (cos * y - sin * z, sin * y + cos * z);
        [cos * x - sin * y, sin * x + cos * y, z].map(|v| v * unit)
    };
    points.iter().map(|p| turn(*p)).collect()
}

/// Returns random points on a body of revolution about z whose profile of (z, r) is a polyline,
/// displaced along the normal by `off` of the segment, the height and the angle.
fn turned(
    profile: &[[f64; 2]],
    count: usize,
    noise: f64,
    off: impl Fn(usize, f64, f64) -> f64,
) -> Vec<Point3> {
    let mut random = Random::new(9);
    let length = |s: &[[f64; 2]]| (s[1][0] - s[0][0]).hypot(s[1][1] - s[0][1]);
    let areas: Vec<f64> = (profile.windows(2))
        .map(|s| length(s) * (s[0][1] + s[1][1]))
        .collect();
    let all: f64 = areas.iter().sum();
    let mut points = Vec::new();
    for (k, s) in profile.windows(2).enumerate() {
        let [[z0, r0], [z1, r1]] = [s[0], s[1]];
        for _ in 0..(count as f64 * areas[k] / all) as usize {
            // Evenly by area: the square of the radius is even along a cone.
            let u = random.unit();
            let r = (r0 * r0 + u * (r1 * r1 - r0 * r0)).sqrt();
            let t = if (r1 - r0).abs() < 1e-9 {
                u
            } else {
                (r - r0) / (r1 - r0)
            };
            let (z, turn) = (z0 + t * (z1 - z0), TAU * random.unit());
            let d = off(k, z, turn) + noise * normal(&mut random);
            let (nz, nr) = ((r0 - r1) / length(s), (z1 - z0) / length(s));
            let r = r + d * nr;
            points.push([r * turn.cos(), r * turn.sin(), z + d * nz]);
        }
    }
    points
}

const CAN: [[f64; 2]; 4] = [[0.0, 0.0], [0.0, 1.0], [3.0, 1.0], [3.0, 0.0]];

#[test]
fn what_is_found_depends_neither_on_the_position_nor_on_the_unit() {
    let block = wavy_block(0.012);
    let counts =
        |found: &Recognition| -> Vec<usize> { found.entities.iter().map(|e| e.points).collect() };
    let upright = recognised(block.clone(), None);
    assert_eq!(kinds(&upright), ["plane"; 6]);
    let places = [(1.1, 25.4), (0.3, 1.0), (2.5, 1e-3)];
    for (angle, unit) in places.into_iter().take(isoform_testdata::cases(3, 1)) {
        let found = recognised(placed(&block, angle, unit), None);
        assert_eq!(kinds(&found), kinds(&upright));
        assert_eq!(counts(&found), counts(&upright));
        assert!((found.noise / unit - upright.noise).abs() < 1e-6 * upright.noise);
    }
}

/// Within the noise the side is four adjacent cylinders or more.
#[test]
fn an_oval_can_is_a_can() {
    let off = |k: usize, _: f64, turn: f64| {
        if k == 1 {
            0.015 * (2.0 * turn).cos()
        } else {
            0.0
        }
    };
    let found = recognised(turned(&CAN, 5000, 5e-4, off), None);
    assert!(found.is_form, "{:?}", kinds(&found));
    assert_eq!(kinds(&found), ["cylinder", "plane", "plane"]);
}

/// Within the noise the side is a stack of a dozen cones.
#[test]
fn a_barrel_is_a_can() {
    let off = |k: usize, z: f64, _: f64| {
        if k == 1 {
            0.02 * (1.0 - (z / 1.5 - 1.0).powi(2))
        } else {
            0.0
        }
    };
    let found = recognised(turned(&CAN, 5000, 3e-4, off), None);
    assert!(found.is_form, "{:?}", kinds(&found));
    assert_eq!(kinds(&found), ["cylinder", "plane", "plane"]);
}

/// A taper of 3° next to a cylinder is smooth, and exact.
#[test]
fn a_taper_of_an_exact_part_stays() {
    let profile = [[0.0, 0.0], [0.0, 1.0], [1.5, 1.0], [3.0, 0.92], [3.0, 0.0]];
    let found = recognised(turned(&profile, 6000, 3e-4, |_, _, _| 0.0), None);
    assert!(!found.is_form, "form within {}", found.noise);
    let mut kinds = kinds(&found);
    kinds.sort_unstable();
    assert_eq!(kinds, ["cone", "cylinder", "plane", "plane"]);
}

/// Steps of 30 deviations in a shaft and folds of 6° in a sheet are smaller than tolerances of
/// form, and exact.
#[test]
fn steps_and_folds_of_exact_parts_stay() {
    let noise = 2e-3;
    let step = 30.0 * noise;
    let band = [[3.0, 1.0], [3.0, 1.0 + step], [6.0, 1.0 + step], [6.0, 1.0]];
    let mut profile = vec![[0.0, 0.0], [0.0, 1.0]];
    profile.extend(band);
    profile.extend([[9.0, 1.0], [9.0, 0.0]]);
    let found = recognised(turned(&profile, 8000, noise, |_, _, _| 0.0), None);
    assert!(!found.is_form, "form within {}", found.noise);
    let radii = found.entities.iter().filter_map(|e| match e.surface {
        Quadric::Cylinder { radius, .. } => Some(radius),
        _ => None,
    });
    let mut radii: Vec<f64> = radii.collect();
    radii.sort_unstable_by(f64::total_cmp);
    assert_eq!(radii.len(), 2, "{:?}", found.entities);
    assert!((radii[1] - radii[0] - step).abs() < 0.1 * step, "{radii:?}");

    let mut random = Random::new(12);
    let mut point = || -> Point3 {
        let (x, y) = (12.0 * random.unit(), 8.0 * random.unit());
        let fold = ((x / 2.0).rem_euclid(2.0) - 1.0).abs();
        [x, y, 0.1 * fold + 3.0 * noise * normal(&mut random)]
    };
    let found = recognised((0..8000).map(|_| point()).collect(), None);
    assert_eq!(kinds(&found), ["plane"; 6]);
    assert!(!found.is_form && found.free == 0.0);
}

/// Spheres, cones and tori follow an ellipsoid; the result reports that their sizes mean nothing.
#[test]
fn a_free_form_is_said_to_be_free() {
    let mut random = Random::new(10);
    let mut point = || -> Point3 {
        let (z, turn) = (random.symmetric(), TAU * random.unit());
        let r = (1.0 - z * z).sqrt();
        let off = 1.0 + 1.5e-3 * normal(&mut random);
        [
            0.5 * off * r * turn.cos(),
            0.35 * off * r * turn.sin(),
            0.27 * off * z,
        ]
    };
    let found = recognised((0..5000).map(|_| point()).collect(), None);
    assert!(found.is_form || found.free > 0.5, "{:?}", kinds(&found));
    let can = recognised(turned(&CAN, 5000, 5e-4, |_, _, _| 0.0), None);
    assert!(can.free < 0.01, "{}", can.free);
}

/// A tolerance as wide as the thickness of a bent plate does not make one plane of its two faces.
#[test]
fn the_faces_of_a_bent_plate_stay_apart() {
    let mut random = Random::new(11);
    let mut point = |k: usize| -> Point3 {
        let (x, y) = (100.0 * random.unit(), 80.0 * random.unit());
        let side = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        [
            x,
            y,
            side + 0.8 * (x / 20.0).sin() + 0.04 * normal(&mut random),
        ]
    };
    let found = recognised((0..6000).map(&mut point).collect(), None);
    // One surface of both lies 1 off each.
    let most = found.entities.iter().map(|e| e.rms).fold(0.0, f64::max);
    assert!(most < 0.3, "{:?}", found.entities);
}

/// At 0.5 % of noise a plane with half a fillet is a sphere, and a cylinder with the other half a
/// torus, until both are replaced by simpler surfaces.
#[test]
fn a_fillet_in_noise_is_found_between_its_faces() {
    let fillet = 4.0;
    let arc = (0..=16).map(|k| {
        let (sin, cos) = (TAU / 4.0 * f64::from(k) / 16.0).sin_cos();
        [6.0 + fillet * (1.0 - cos), 9.0 + fillet * (1.0 - sin)]
    });
    let mut profile = vec![[0.0, 5.0], [0.0, 22.0], [6.0, 22.0]];
    profile.extend(arc);
    profile.extend([[28.0, 9.0], [28.0, 5.0], [0.0, 5.0]]);
    let found = recognised(turned(&profile, 10_000, 0.33, |_, _, _| 0.0), None);
    let torus = found.entities.iter().find_map(|e| match e.surface {
        Quadric::Torus { major, minor, .. } => Some([major, minor]),
        _ => None,
    });
    let [major, minor] = torus.unwrap_or_default();
    assert!(
        (major - 13.0).abs() < 0.5 && (minor - fillet).abs() < 0.5,
        "{:?}",
        found.entities
    );
}

/// Returns the profile (z, r) of a turned shaft: steps, chamfers, and fillets of 1.32 and 1.13
/// about circles of 10.82 and 14.86.
fn shaft() -> Vec<[f64; 2]> {
    let arc = |z: f64, r: f64, fillet: f64| {
        (0..=12).map(move |k| {
            let (sin, cos) = (TAU / 4.0 * f64::from(k) / 12.0).sin_cos();
            [z + fillet * sin, r - fillet * cos]
        })
    };
    let mut profile = vec![
        [0.0, 0.0],
        [0.0, 4.51],
        [0.8, 5.31],
        [7.18, 5.31],
        [8.74, 9.49],
    ];
    profile.extend(arc(14.57, 10.82, 1.32));
    profile.extend([[15.89, 13.73]]);
    profile.extend(arc(23.15, 14.86, 1.13));
    profile.extend([
        [24.28, 17.95],
        [36.02, 17.95],
        [37.58, 16.39],
        [37.58, 7.47],
    ]);
    profile.extend([[36.95, 6.84], [31.56, 6.84], [31.56, 0.0]]);
    profile
}

/// Chamfers are cones about the axis of the adjacent cylinders: a local fit of such a short cone
/// creeps along a valley and does not reach it.
#[test]
fn chamfers_of_exact_points_are_cones() {
    let chamfered = [
        [0.0, 0.0],
        [0.0, 8.0],
        [2.0, 10.0],
        [22.0, 10.0],
        [23.0, 9.0],
        [23.0, 0.0],
    ];
    let found = recognised(turned(&chamfered, 6000, 0.0, |_, _, _| 0.0), None);
    let mut angles: Vec<f64> = (found.entities.iter())
        .filter_map(|e| match e.surface {
            Quadric::Cone { half_angle, .. } => Some(half_angle.to_degrees()),
            _ => None,
        })
        .collect();
    angles.sort_by(f64::total_cmp);
    assert_eq!(angles.len(), 2, "{:?}", kinds(&found));
    assert!(angles.iter().all(|a| (a - 45.0).abs() < 1e-6), "{angles:?}");
    assert!(found.labels.iter().all(Option::is_some));
}

/// With a thousandth of noise the faces next to a fillet absorb its ends, bend, and hide it, until
/// their borders prove to be off: then no wide tolerance of form describes the shaft in less.
#[test]
fn noise_is_no_form() {
    let found = recognised(turned(&shaft(), 10_000, 0.063, |_, _, _| 0.0), None);
    assert!(!found.is_form, "{:?}", found.entities);
    let is_near = |e: &Entity, wanted: [f64; 2]| match e.surface {
        Quadric::Torus { major, minor, .. } => {
            (major - wanted[0]).abs() < 0.3 && (minor - wanted[1]).abs() < 0.3
        }
        _ => false,
    };
    for wanted in [[10.82, 1.32], [14.86, 1.13]] {
        let is_found = found.entities.iter().any(|e| is_near(e, wanted));
        assert!(is_found, "{wanted:?}: {:?}", found.entities);
    }
}
