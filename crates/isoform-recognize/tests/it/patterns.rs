//! Rows, circles and symmetries of plates with holes, in several poses, with noise and without.

use crate::parts::{Plate, circle, recognised};
use isoform_recognize::{Layout, Pattern, Recognition, SymmetryKind};
use std::f64::consts::TAU;

/// Noise as a share of the diagonal.
const NOISES: [f64; 2] = [0.0, 0.001];

/// Returns a flange with a bore and holes on a circle.
fn flange(holes: usize) -> Plate {
    let places = circle(holes, 0.7, 0.1);
    Plate::disk(1.0)
        .with([[0.0, 0.0, 0.3]])
        .with(places.map(|[x, y]| [x, y, 0.1]))
}

/// Returns a plate with a grid of holes.
fn grid(columns: u32, rows: u32) -> Plate {
    let at = |k: u32| 0.3 + 0.4 * f64::from(k);
    let cells = (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j)));
    Plate::rectangle(at(columns) - 0.1, at(rows) - 0.1)
        .with(cells.map(|(i, j)| [at(i), at(j), 0.1]))
}

/// Returns adjacent teeth with a longer end.
fn rack(teeth: u32, end: f64) -> Plate {
    let length = 0.4 * f64::from(teeth) + end;
    let mut outline = vec![[0.0, 0.0], [length, 0.0], [length, 0.3]];
    for k in (0..teeth).rev() {
        let x = 0.4 * f64::from(k);
        outline.extend([
            [x + 0.3, 0.3],
            [x + 0.3, 0.7],
            [x + 0.1, 0.7],
            [x + 0.1, 0.3],
        ]);
    }
    outline.push([0.0, 0.3]);
    Plate {
        thickness: 0.4,
        ..Plate::of(outline)
    }
}

/// Returns a plate whose holes have nothing in common but their radius.
fn scattered() -> Plate {
    let holes = [
        [0.31, 0.28],
        [0.82, 0.47],
        [1.31, 1.03],
        [1.52, 0.4],
        [0.4, 1.1],
    ];
    Plate::rectangle(1.8, 1.4).with(holes.map(|[x, y]| [x, y, 0.1]))
}

fn spacing(p: &Pattern) -> Option<(f64, f64)> {
    match p.layout {
        Layout::Row {
            spacing,
            spacing_deviation,
            ..
        } => Some((spacing, spacing_deviation)),
        Layout::Circle { .. } => None,
    }
}

/// Returns the number of rows with this number of members.
fn rows(found: &Recognition, members: usize) -> usize {
    let is_row = |p: &&Pattern| spacing(p).is_some() && p.members.len() == members;
    found.patterns.iter().filter(is_row).count()
}

/// Returns the number of mirrors, and the orders of the rotations.
fn symmetries(found: &Recognition) -> (usize, Vec<Option<u32>>) {
    let mirrors = found.symmetries.iter();
    let mirrors = mirrors.filter(|s| matches!(s.kind, SymmetryKind::Mirror { .. }));
    let orders = found.symmetries.iter().filter_map(|s| match s.kind {
        SymmetryKind::Rotation { order, .. } => Some(order),
        SymmetryKind::Mirror { .. } => None,
    });
    (mirrors.count(), orders.collect())
}

/// Checks a plate at every noise with these seeds.
fn each(plate: &Plate, seeds: std::ops::Range<u64>, check: impl Fn(&Recognition, f64)) {
    for noise in NOISES {
        for seed in seeds.clone() {
            check(&plate.recognised(noise, seed), noise);
        }
    }
}

/// Returns the number of holes, the radius, and the closedness of each circle of holes.
fn circles(found: &Recognition) -> Vec<(usize, f64, bool)> {
    let circle = |p: &Pattern| match p.layout {
        Layout::Circle {
            radius, is_closed, ..
        } => Some((p.members.len(), radius, is_closed)),
        Layout::Row { .. } => None,
    };
    found.patterns.iter().filter_map(circle).collect()
}

/// Returns the number of entities without an image in any symmetry.
fn unmatched(found: &Recognition) -> usize {
    let without = |s: &isoform_recognize::Symmetry| s.images.iter().filter(|i| i.is_none()).count();
    found.symmetries.iter().map(without).sum()
}

#[test]
fn holes_on_a_circle_are_a_circle_and_nothing_else() {
    let counts = [3, 8, 5, 6].into_iter();
    for holes in counts.take(isoform_testdata::cases(4, 2)) {
        each(&flange(holes), 1..3, |found, noise| {
            let [(members, radius, true)] = circles(found)[..] else {
                panic!("{holes} {noise}: {:?}", found.patterns);
            };
            assert_eq!((members, found.patterns.len()), (holes, 1));
            assert!((radius - 0.7).abs() < 1e-9 + 5.0 * noise / 10.0, "{radius}");
            // A mirror across, and as many along as there are holes.
            let (mirrors, orders) = symmetries(found);
            assert_eq!((mirrors, orders), (holes + 1, vec![Some(holes as u32)]));
            assert!(
                unmatched(found) <= usize::from(noise > 0.0),
                "{:?}",
                found.symmetries
            );
        });
    }
}

#[test]
fn a_grid_is_its_rows_and_columns() {
    each(&grid(4, 3), 1..3, |found, noise| {
        assert_eq!(
            (rows(found, 4), rows(found, 3), found.patterns.len()),
            (3, 4, 7)
        );
        for (spacing, deviation) in found.patterns.iter().filter_map(spacing) {
            assert!(
                (spacing - 0.4).abs() <= 5.0 * deviation,
                "{noise}: {spacing} {deviation}"
            );
        }
        assert_eq!(symmetries(found), (3, vec![]));
    });
    each(&grid(5, 2), 1..3, |found, _| {
        assert_eq!(
            (rows(found, 5), found.patterns.len()),
            (2, 2),
            "{:?}",
            found.patterns
        );
    });
}

#[test]
fn walls_of_equal_slots_are_two_rows_of_planes() {
    for (teeth, end) in [(6, 0.6), (4, 0.1)] {
        each(&rack(teeth, end), 1..3, |found, _| {
            let all = (rows(found, teeth as usize), found.patterns.len());
            assert_eq!(all, (2, 2), "{:?}", found.patterns);
            // Its ends differ.
            assert_eq!((symmetries(found).0, unmatched(found)), (1, 0));
        });
    }
}

#[test]
fn what_has_no_pattern_gets_none() {
    each(&scattered(), 1..4, |found, _| {
        assert_eq!(found.patterns, [], "none of five holes");
        // A plate has a middle.
        assert_eq!((symmetries(found), unmatched(found)), ((1, vec![]), 0));
    });
}

/// Moves one hole of a plate by some standard deviations of its place at a noise of 0.1 %.
fn moved(mut plate: Plate, hole: usize, deviations: f64) -> Plate {
    let sigma = 0.001 * 2.3;
    // 900 points for a unit of area, of which half tell about one direction.
    let points = 900.0 * TAU * plate.holes[hole][2] * plate.thickness;
    plate.holes[hole][0] += deviations * sigma * (2.0 / points).sqrt();
    plate
}

#[test]
fn a_hole_out_of_place_is_no_member() {
    // In the middle of a column, and the second of a row.
    each(&moved(grid(4, 3), 4, 25.0), 1..3, |found, noise| {
        let all = (rows(found, 4), rows(found, 3), found.patterns.len());
        assert_eq!(all, (2, 3, 5), "{noise} {:?}", found.patterns);
    });
    each(&moved(flange(6), 2, 25.0), 1..3, |found, noise| {
        assert!(
            matches!(circles(found)[..], [(5, _, false)]),
            "{noise} {:?}",
            found.patterns
        );
        assert_eq!(found.patterns.len(), 1);
    });
}

#[test]
fn what_is_out_of_place_has_no_image() {
    // Off centre lengthwise: the mirror across the plate is whole, that along it lacks the hole.
    let plate = grid(4, 3);
    each(&moved(plate, 4, 10.0), 1..3, |found, _| {
        // The hole, and the one that it should be the image of.
        assert_eq!((symmetries(found).0, unmatched(found)), (3, 2));
    });
    // With a longer side nothing but the plate's own middle is left.
    let l = vec![
        [0.0, 0.0],
        [1.6, 0.0],
        [1.6, 0.5],
        [0.5, 0.5],
        [0.5, 1.2],
        [0.0, 1.2],
    ];
    each(&Plate::of(l), 1..3, |found, _| {
        assert_eq!((symmetries(found), unmatched(found)), ((1, vec![]), 0));
    });
}

#[test]
fn a_prism_of_six_sides_has_an_axis() {
    let prism = Plate {
        thickness: 0.6,
        ..Plate::of(circle(6, 0.8, 0.3).collect())
    };
    each(&prism, 1..3, |found, _| {
        assert_eq!(symmetries(found), (7, vec![Some(6)]));
        assert_eq!((found.patterns.len(), unmatched(found)), (0, 0));
    });
}

#[test]
fn a_body_of_revolution_is_one() {
    let washer = Plate::disk(1.0).with([[0.0, 0.0, 0.4]]);
    each(&washer, 1..3, |found, _| {
        assert_eq!((symmetries(found), unmatched(found)), ((1, vec![None]), 0));
    });
    // Not with the bore out of the middle, but that has a mirror.
    let eccentric = Plate::disk(1.0).with([[0.1, 0.0, 0.4]]);
    each(&eccentric, 1..3, |found, _| {
        assert_eq!((symmetries(found), unmatched(found)), ((2, vec![]), 0));
    });
}

#[test]
fn the_order_of_points_changes_nothing() {
    let scan = flange(6).scan(0.001, 7);
    let found = recognised(&scan);
    let mut turned = scan.clone();
    turned.reverse();
    turned.rotate_left(1234);
    let other = recognised(&turned);
    assert_eq!(found.patterns, other.patterns);
    assert_eq!(found.symmetries, other.symmetries);
}

/// Normals of neighbours lead round the edges of a thin wall to the wrong side.
#[test]
fn the_faces_of_thin_walls_face_outwards() {
    // An angle of two thin walls.
    let l = vec![
        [0.0, 0.0],
        [1.6, 0.0],
        [1.6, 0.05],
        [0.05, 0.05],
        [0.05, 1.2],
        [0.0, 1.2],
    ];
    let angle = Plate {
        thickness: 1.0,
        ..Plate::of(l)
    };
    each(&angle, 1..3, |found, noise| {
        for (i, e) in found
            .entities
            .iter()
            .enumerate()
            .filter(|e| e.1.points > 300)
        {
            let isoform_geom::Quadric::Plane { normal, offset } = e.surface else {
                panic!("{e:?}");
            };
            // Its own plane across the wall is the nearest behind it.
            let behind = found
                .entities
                .iter()
                .enumerate()
                .filter_map(|(j, o)| match o.surface {
                    isoform_geom::Quadric::Plane {
                        normal: n,
                        offset: d,
                    } if j != i && isoform_geom::dot(n, normal).abs() > 0.99 => {
                        Some(isoform_geom::dot(n, normal).signum() * d - offset)
                    }
                    _ => None,
                });
            let way = behind
                .min_by(|a, b| a.abs().total_cmp(&b.abs()))
                .expect("a wall");
            assert_eq!(f64::from(e.outward), -way.signum(), "{noise} {i} {way}");
        }
    });
}
