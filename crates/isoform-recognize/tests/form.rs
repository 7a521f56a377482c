//! Real objects deviate from their surfaces by more than the noise of their points, and by smooth
//! amounts: they are found all the same, and the tolerance that this took is told.

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

/// A normal deviate (Box and Muller).
fn normal(random: &mut Random) -> f64 {
    let (u, turn) = (1.0 - random.unit(), TAU * random.unit());
    (-2.0 * u.ln()).sqrt() * turn.cos()
}

/// A ball of radius 1 whose surface goes up and down by `height`, four to six times around.
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

/// A block of 3 × 2 × 1 whose faces go up and down by `height`.
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

/// With a tolerance that the user gives, whatever the form.
#[test]
fn a_tolerance_allows_form() {
    let found = recognised(dented_ball(0.01), Some(0.01));
    assert_eq!(kinds(&found), ["sphere"]);
    let found = recognised(wavy_block(0.02), Some(0.02));
    assert_eq!(kinds(&found)[..6], ["plane"; 6]);
}

/// Two round balls of radii 0.5 and 0.5008, some 50 deviations apart, beside a block whose
/// faces deviate by far more: the tolerance that the block asks for does not make the balls equal.
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

/// A step of 40 deviations in an exact face stays two planes, whatever a block beside it asks for.
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
