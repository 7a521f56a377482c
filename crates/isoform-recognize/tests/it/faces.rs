//! Faces, also small ones, of exact points in the digits of files; scans of one surface.

use isoform_control::Control;
use isoform_geom::{Point3, PointCloud, Quadric};
use isoform_num::Random;
use isoform_recognize::{Options, Recognition, recognize};
use std::f64::consts::{FRAC_PI_2, TAU};

fn recognised(points: Vec<Point3>) -> Recognition {
    let scan = PointCloud::from_points(points);
    recognize(&scan, &Options::default(), &Control::default()).expect("a scan")
}

/// Returns a nearly normal deviate.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.unit()).sum::<f64>() - 6.0
}

/// Returns the points a + u b + v c of a grid over the unit square, including its sides.
fn grid(a: Point3, b: Point3, c: Point3, counts: [u32; 2]) -> Vec<Point3> {
    let at = |i: u32, count: u32| f64::from(i) / f64::from(count - 1);
    let cells = (0..counts[0]).flat_map(|i| (0..counts[1]).map(move |j| (i, j)));
    cells
        .map(|(i, j)| {
            let (u, v) = (at(i, counts[0]), at(j, counts[1]));
            std::array::from_fn(|k| a[k] + u * b[k] + v * c[k])
        })
        .collect()
}

/// Returns the top of a block with a slot across it, in a general pose: two pieces of one plane,
/// two walls and a floor.
fn slot() -> Vec<Point3> {
    let [along, across] = [[0.0, 2.0, 0.0], [1.0, 0.0, 0.0]];
    let faces = [
        ([0.0, 0.0, 0.0], across, along),
        ([2.0, 0.0, 0.0], across, along),
        ([1.0, 0.0, -1.0], [0.0, 0.0, 1.0], along),
        ([2.0, 0.0, -1.0], [0.0, 0.0, 1.0], along),
        ([1.0, 0.0, -1.0], across, along),
    ];
    let all = faces
        .iter()
        .flat_map(|(a, b, c)| grid(*a, *b, *c, [21, 41]));
    let turned = |p: Point3| -> Point3 {
        let [x, y, z] = p;
        let (x, y) = (0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y);
        [x, 0.28 * y - 0.96 * z, 0.96 * y + 0.28 * z]
    };
    all.map(turned).collect()
}

#[test]
fn pieces_of_a_plane_are_faces_of_their_own() {
    let found = recognised(slot());
    assert_eq!(found.entities.len(), 4);
    assert_eq!(found.faces.len(), 5, "{:?}", found.faces);
    let of_top: Vec<usize> = (0..5).filter(|f| found.faces[*f].entity == 0).collect();
    assert_eq!(of_top.len(), 2, "{:?}", found.faces);
    for face in &found.faces {
        // The floor is adjacent to two walls, a wall to a piece of the top and the floor, a piece
        // of the top one wall.
        let beside = if face.entity == 0 { 1 } else { 2 };
        assert_eq!(face.beside.len(), beside, "{:?}", found.faces);
        assert!(
            face.beside
                .iter()
                .all(|f| found.faces[*f].entity != face.entity)
        );
    }
    let mut counts = [0; 5];
    for (entity, face) in found.labels.iter().zip(&found.face_labels) {
        let face = face.expect("all points are on faces") as usize;
        assert_eq!(entity.map(|e| e as usize), Some(found.faces[face].entity));
        counts[face] += 1;
    }
    assert!(found.faces.iter().zip(counts).all(|(f, c)| f.points == c));
    // Edges belong to the smaller face, the walls and the floor.
    assert!(
        of_top
            .iter()
            .all(|f| counts[*f] < counts[(0..5).find(|g| !of_top.contains(g)).unwrap_or(0)])
    );
}

/// Rounding to the digits of files counts as no noise, and changes nothing.
#[test]
fn rounded_points_have_the_same_faces() {
    let digits = |points: Vec<Point3>, round: &dyn Fn(f64) -> f64| -> Vec<Point3> {
        points.into_iter().map(|p| p.map(round)).collect()
    };
    let decimals = |x: f64| (x * 1e6).round() / 1e6;
    let single = |x: f64| f64::from(x as f32);
    let nine = |x: f64| format!("{x:.8e}").parse().unwrap_or(x);
    for round in [&decimals as &dyn Fn(f64) -> f64, &single, &nine] {
        let found = recognised(digits(slot(), round));
        assert_eq!([found.entities.len(), found.faces.len()], [4, 5]);
        assert!(found.labels.iter().all(Option::is_some));
        let mut cylinder = Vec::new();
        for i in 0..60 {
            for j in 0..40 {
                let t = TAU * f64::from(i) / 60.0;
                cylinder.push([3.0 * t.cos(), 5.0 + 0.1 * f64::from(j), 3.0 * t.sin()]);
            }
        }
        let floor = grid(
            [-4.0, 5.0, -4.0],
            [8.0, 0.0, 0.0],
            [0.0, 0.0, 8.0],
            [60, 60],
        );
        cylinder.extend(floor);
        let found = recognised(digits(cylinder, round));
        assert_eq!(found.entities.len(), 2, "{:?}", found.entities);
        // Rows of the floor may lie on the cylinder's circle.
        assert!(found.entities.iter().all(|e| e.points > 2000));
    }
}

/// A strip of three rows lies between two rounds of five rows each, and shares each border.
#[test]
fn strips_between_rounds_are_found() {
    let mut points = grid([0.0, 0.0, 3.0], [40.0, 0.0, 0.0], [0.0, 9.0, 0.0], [81, 19]);
    points.extend(grid(
        [0.0, 0.0, 0.0],
        [40.0, 0.0, 0.0],
        [0.0, 9.0, 0.0],
        [81, 19],
    ));
    points.extend(grid(
        [0.0, 10.0, 1.0],
        [40.0, 0.0, 0.0],
        [0.0, 0.0, 1.0],
        [81, 3],
    ));
    for (height, sign) in [(2.0, 1.0), (1.0, -1.0)] {
        for i in 0..81 {
            for j in 0..5 {
                let t = FRAC_PI_2 * f64::from(j) / 4.0;
                points.push([0.5 * f64::from(i), 9.0 + t.cos(), height + sign * t.sin()]);
            }
        }
    }
    let found = recognised(points);
    let rounds = found.entities.iter().filter(
        |e| matches!(e.surface, Quadric::Cylinder { radius, .. } if (radius - 1.0).abs() < 1e-9),
    );
    assert_eq!(rounds.count(), 2, "{:?}", found.entities);
    let is_strip = |n: Point3, d: f64| n[1].abs() > 1.0 - 1e-9 && (d.abs() - 10.0).abs() < 1e-9;
    let strips = found.entities.iter().filter(
        |e| matches!(e.surface, Quadric::Plane { normal, offset } if is_strip(normal, offset)),
    );
    assert_eq!(strips.count(), 1, "{:?}", found.entities);
    assert_eq!(found.entities.len(), 5, "{:?}", found.entities);
}

/// Neighbourhoods show nothing of a narrow piece with noise above the spacing; all points together
/// do.
#[test]
fn one_surface_is_found_in_noise_above_the_spacing() {
    let mut random = Random::new(3);
    let noise = 0.04;
    let points: Vec<Point3> = (0..8000)
        .map(|i| {
            let (t, z) = (1.2 * f64::from(i % 89) / 89.0, f64::from(i) / 8000.0);
            let r = 2.0 + noise * normal(&mut random);
            [r * t.cos(), r * t.sin(), 2.0 * z]
        })
        .collect();
    let found = recognised(points);
    assert_eq!(found.entities.len(), 1, "{:?}", found.entities);
    let (Quadric::Cylinder { radius, .. }, sd) =
        (found.entities[0].surface, found.entities[0].deviations.size)
    else {
        panic!("{:?}", found.entities)
    };
    assert!(
        (radius - 2.0).abs() < 4.0 * sd && sd < 0.05,
        "{radius} {sd}"
    );
    assert!((found.noise / noise - 1.0).abs() < 0.05, "{}", found.noise);
}

/// Points on both sides of a wall are not taken for noise about the surface between them, even if
/// the wall is thinner than their spacing.
#[test]
fn a_tube_has_two_sides() {
    for (wall, noise, points) in [
        (0.06, 0.006, 20_000),
        (0.02, 0.002, 10_000),
        (0.01, 0.0, 5000),
    ] {
        let mut random = Random::new(4);
        let mut point = |i: u32| {
            let off = noise * normal(&mut random);
            let r = off + if i.is_multiple_of(2) { 0.5 } else { 0.5 - wall };
            let t = TAU * random.unit();
            [r * t.cos(), r * t.sin(), 2.0 * random.unit()]
        };
        let found = recognised((0..points).map(&mut point).collect());
        assert_eq!(found.entities.len(), 2, "{wall}: {:?}", found.entities);
        assert!(
            (found.noise - noise).abs() < 0.1 * noise + 1e-8,
            "{}",
            found.noise
        );
    }
}

/// The caps of a thin rod are hidden from the neighbours of a point by the noise, a sixth of the
/// radius; all points of a cap together are far off the cylinder.
#[test]
fn a_noisy_rod_has_an_end() {
    let (radius, height, noise) = (1.0, 30.0, 0.16);
    let mut random = Random::new(11);
    let wall = TAU * radius * height;
    let cap = 0.5 * TAU * radius * radius;
    let mut point = || -> Point3 {
        let place = random.unit() * (wall + 2.0 * cap);
        let (angle, share) = (TAU * random.unit(), random.unit());
        let (r, z) = match place - wall {
            on if on < 0.0 => (radius, height * share),
            on if on < cap => (radius * share.sqrt(), 0.0),
            _ => (radius * share.sqrt(), height),
        };
        let at = [r * angle.cos(), r * angle.sin(), z];
        at.map(|x| x + noise * normal(&mut random))
    };
    let found = recognised((0..10_000).map(|_| point()).collect());
    let count = |of: fn(&Quadric) -> bool| found.entities.iter().filter(|e| of(&e.surface)).count();
    assert_eq!(count(|s| matches!(s, Quadric::Cylinder { .. })), 1);
    assert!(found.entities.len() >= 3, "{:?}", found.entities);
}

/// A plate of levels at −0.1, 0 and 0.02, thinner than the spacing of its points: neighbourhoods
/// hold points of several levels, and its sides are strips of some twenty points.
#[test]
fn levels_thinner_than_the_spacing_are_found() {
    let mut random = Random::new(6);
    let mut between = |lo: f64, hi: f64| lo + random.unit() * (hi - lo);
    let mut point = || -> Point3 {
        let (x, y) = (between(0.0, 30.0), between(0.0, 20.0));
        let top = if x < 12.0 { 0.02 } else { 0.0 };
        let z = between(-0.1, top);
        match between(0.0, 1210.0) {
            w if w < 600.0 => [x, y, -0.1],
            w if w < 1200.0 => [x, y, top],
            w if w < 1203.0 => [x, 0.0, z],
            w if w < 1206.0 => [x, 20.0, z],
            w if w < 1208.0 => [0.0, y, z],
            _ => [30.0, y, z],
        }
    };
    let found = recognised((0..8000).map(|_| point()).collect());
    let is_at = |axis: usize, height: f64| {
        found.entities.iter().any(|e| match e.surface {
            Quadric::Plane { normal, offset } => {
                (normal[axis].abs() - 1.0).abs() < 1e-9
                    && (offset * normal[axis].signum() - height).abs() < 1e-9
            }
            _ => false,
        })
    };
    let planes = [
        (2, -0.1),
        (2, 0.0),
        (2, 0.02),
        (0, 0.0),
        (0, 30.0),
        (1, 0.0),
        (1, 20.0),
    ];
    for (axis, height) in planes {
        assert!(is_at(axis, height), "{axis} {height}: {:?}", found.entities);
    }
}

/// A flat is milled into a shaft by 1.7 deviations of the noise; the cylinder explains each of its
/// points, but not all of them together.
#[test]
fn a_flat_in_the_noise_of_a_shaft_is_found() {
    let (depth, noise) = (0.05, 0.03);
    let mut random = Random::new(12);
    let point = |random: &mut Random| -> Point3 {
        let (t, z) = (TAU * random.unit(), 6.0 * random.unit());
        let [x, y] = [t.cos(), t.sin()];
        let at = match x > 1.0 - depth && z < 2.0 {
            true => [1.0 - depth, y, z],
            false => [x, y, z],
        };
        at.map(|v| v + noise * normal(random))
    };
    let found = recognised((0..9000).map(|_| point(&mut random)).collect());
    let is_flat = |s: Quadric| match s {
        Quadric::Plane { normal, offset } => {
            normal[0].abs() > 0.98 && (offset.abs() - (1.0 - depth)).abs() < 0.02
        }
        _ => false,
    };
    assert!(
        found.entities.iter().any(|e| is_flat(e.surface)),
        "{:?}",
        found.entities
    );
}
