//! Templates proposed for scans of parts with known dimensions.

use isoform::field::hyperfun::{Mode, Model};
use isoform::geom::{Aabb, Point3, PointCloud, cross, dot, norm, sub};
use isoform::num::Random;
use isoform::recognize::Gap;
use isoform::{
    Control, FitOptions, MeshModelOptions, Proposal, RecognizeOptions, ScanFit, brep_model,
    fit_scan, recognize_scan, without_supports,
};

/// Returns points of a plate of 40 × 30 × 10 about its corner with a bore of radius 6 at (15, 12)
/// and a counterbore of radius 9 down to z = 7, rotated and moved; noise is along the normals.
fn plate(count: usize, noise: f64) -> PointCloud {
    let mut random = Random::new(5);
    let mut points = Vec::new();
    while points.len() < count {
        let Some((p, normal)) = on_plate(&mut random) else {
            continue;
        };
        // A sum of twelve uniform deviates is nearly normal, with variance 1.
        let far = noise * ((0..12).map(|_| random.unit()).sum::<f64>() - 6.0);
        points.push(posed(std::array::from_fn(|k| p[k] + far * normal[k])));
    }
    PointCloud::from_points(points)
}

/// Returns a point of one of the faces, chosen by area, and its normal; `None` in a hole.
fn on_plate(random: &mut Random) -> Option<(Point3, Point3)> {
    let [a, b, w] = [random.unit(), random.unit(), random.unit()];
    let end = f64::from(u8::from(random.unit() < 0.5));
    let (sin, cos) = (std::f64::consts::TAU * a).sin_cos();
    let on_bore = |r: f64, z: f64| ([15.0 + r * cos, 12.0 + r * sin, z], [cos, sin, 0.0]);
    let on_face = |p: Point3, axis: usize, hole: f64| {
        let r = (p[0] - 15.0).hypot(p[1] - 12.0);
        let normal = std::array::from_fn(|k| f64::from(u8::from(k == axis)));
        (r >= hole).then_some((p, normal))
    };
    // Areas: two faces of 1200, sides of 800 and 600 (both of each), bores of 264 and 170, and a
    // square of 324 about the ledge.
    match 4558.0 * w {
        w if w < 1200.0 => on_face([40.0 * a, 30.0 * b, 0.0], 2, 6.0),
        w if w < 2400.0 => on_face([40.0 * a, 30.0 * b, 10.0], 2, 9.0),
        w if w < 3200.0 => on_face([40.0 * a, 30.0 * end, 10.0 * b], 1, 0.0),
        w if w < 3800.0 => on_face([40.0 * end, 30.0 * a, 10.0 * b], 0, 0.0),
        w if w < 4064.0 => Some(on_bore(6.0, 7.0 * b)),
        w if w < 4234.0 => Some(on_bore(9.0, 7.0 + 3.0 * b)),
        _ => {
            let p = [6.0 + 18.0 * a, 3.0 + 18.0 * b, 7.0];
            let is_beyond = (p[0] - 15.0).hypot(p[1] - 12.0) > 9.0;
            on_face(p, 2, 6.0).filter(|_| !is_beyond)
        }
    }
}

fn posed(p: Point3) -> Point3 {
    let (s, c) = (0.6, 0.8);
    let q = [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]];
    [
        q[0] + 100.0,
        c * q[1] - s * q[2] - 20.0,
        s * q[1] + c * q[2] + 7.0,
    ]
}

fn proposed(scan: &PointCloud) -> Proposal {
    let control = Control::default();
    let found = recognize_scan(scan, &RecognizeOptions::default(), &control).expect("entities");
    found.template("a test", &control).expect("a template")
}

fn fitted(scan: &PointCloud, proposal: &Proposal) -> ScanFit {
    let model = Model::parse(&proposal.program, Mode::Default).expect("HyperFun");
    fit_scan(scan, &model, &FitOptions::default(), &Control::default()).expect("a fit")
}

/// Returns the value of a parameter that has one of these values.
fn is_there(fit: &ScanFit, value: f64, tolerance: f64) -> bool {
    fit.values()
        .iter()
        .any(|v| (v.abs() - value).abs() < tolerance)
}

#[test]
fn a_plate_comes_back_with_its_dimensions() {
    let scan = plate(6000, 0.0);
    let proposal = proposed(&scan);
    assert_eq!(proposal.gaps, [], "{}", proposal.program);
    assert!(proposal.used.iter().all(|u| *u) && proposal.explained == 1.0);
    let fit = fitted(&scan, &proposal);
    assert!(
        fit.fit.acceptable && fit.fit.rms < 1e-9,
        "{:?}",
        fit.fit.reasons
    );
    for dimension in [40.0, 30.0, 10.0, 6.0, 9.0] {
        assert!(
            is_there(&fit, dimension, 1e-8),
            "{dimension}: {:?}",
            fit.values()
        );
    }
}

#[test]
fn noise_leaves_the_shape_as_it_is() {
    let scan = plate(6000, 0.05);
    let proposal = proposed(&scan);
    let fit = fitted(&scan, &proposal);
    assert!(fit.fit.acceptable, "{}", proposal.program);
    for dimension in [40.0, 30.0, 10.0, 6.0, 9.0] {
        assert!(
            is_there(&fit, dimension, 0.03),
            "{dimension}: {:?}",
            fit.values()
        );
    }
}

/// Returns a random point of a link of 10 × 70 × 10, scattered by 0.36: two bosses of radius 5 with
/// bores of radius 2.5, and a bar of width 8 between them, from z = 3 to 7.
fn on_link(random: &mut Random) -> Option<Point3> {
    let is_inside = |[x, y, z]: Point3| {
        let r = x.hypot(y).min(x.hypot(y - 60.0));
        let is_bar = x.abs() < 4.0 && (0.0..60.0).contains(&y) && (3.0..7.0).contains(&z);
        r > 2.5 && (0.0..10.0).contains(&z) && (r < 5.0 || is_bar)
    };
    let mut between = |lo: f64, hi: f64| lo + random.unit() * (hi - lo);
    let way = if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
    // Areas of the sides of the bar, of planes across the bosses, and of the bosses and bores.
    let (p, normal): (Point3, Point3) = match between(0.0, 4270.0) {
        w if w < 480.0 => (
            [4.0 * way, between(0.0, 60.0), between(3.0, 7.0)],
            [way, 0.0, 0.0],
        ),
        w if w < 3280.0 => {
            let (level, side) = match between(0.0, 1.0) {
                u if u < 0.5 => (5.0 + 5.0 * way, way),
                _ => (5.0 + 2.0 * way, way),
            };
            (
                [between(-5.0, 5.0), between(-5.0, 65.0), level],
                [0.0, 0.0, side],
            )
        }
        w => {
            let (sin, cos) = between(0.0, std::f64::consts::TAU).sin_cos();
            let end = 30.0 + 30.0 * way;
            let (r, side) = if w < 3610.0 { (2.5, -1.0) } else { (5.0, 1.0) };
            (
                [r * cos, end + r * sin, between(0.0, 10.0)],
                [side * cos, side * sin, 0.0],
            )
        }
    };
    let beside = |by: f64| -> Point3 { std::array::from_fn(|k| p[k] + by * normal[k]) };
    let is_on = is_inside(beside(-1e-6)) && !is_inside(beside(1e-6));
    let noisy = p.map(|x| x + 0.36 * ((0..12).map(|_| random.unit()).sum::<f64>() - 6.0));
    is_on.then_some(noisy)
}

/// The sides of the bar are 2.8 deviations of the noise within the bosses, which they do not cut.
#[test]
fn faces_that_noise_hides_bound_the_solid() {
    let mut random = Random::new(9);
    let points = std::iter::from_fn(|| Some(on_link(&mut random)));
    let scan = PointCloud::from_points(points.flatten().take(10_000).collect());
    let proposal = proposed(&scan);
    let fit = fitted(&scan, &proposal);
    let misfit = fit.fit.evidence.systematic_z;
    assert!(
        fit.fit.acceptable && misfit < 5.0,
        "{misfit} {}",
        proposal.program
    );
    for dimension in [5.0, 2.5] {
        assert!(
            is_there(&fit, dimension, 0.05),
            "{dimension}: {:?}",
            fit.values()
        );
    }
}

/// A flat is milled into half of a shaft, 2.8 deviations of the noise deep. The step at its end is
/// too small to be seen, so that no solid has the flat: the template is not complete.
#[test]
fn a_face_that_the_solid_lacks_is_a_fault() {
    let (radius, height, depth, noise) = (12.0, 30.0, 0.09, 0.0326);
    let mut random = Random::new(3);
    let mut point = || -> Point3 {
        let place = random.unit() * (height + radius);
        let (sin, cos) = (std::f64::consts::TAU * random.unit()).sin_cos();
        let (r, z) = match place < height {
            true => (radius, place),
            false => (
                radius * random.unit().sqrt(),
                if place < height + radius / 2.0 {
                    0.0
                } else {
                    height
                },
            ),
        };
        let limit = if z < height / 2.0 {
            radius - depth
        } else {
            radius
        };
        let at = [(r * cos).min(limit), r * sin, z];
        at.map(|x| x + noise * ((0..12).map(|_| random.unit()).sum::<f64>() - 6.0))
    };
    let scan = PointCloud::from_points((0..18_000).map(|_| point()).collect());
    let proposal = proposed(&scan);
    let is_dropped = |g: &&Gap| matches!(g, Gap::Unused { needed: 1, .. });
    assert_eq!(
        proposal.faults(0.0).filter(is_dropped).count(),
        1,
        "{:?}",
        proposal.gaps
    );
}

/// An unscanned side is closed at the end of the data, and reported.
#[test]
fn a_face_that_is_missing_is_said() {
    let mut scan = plate(6000, 0.0);
    let whole = proposed(&scan);
    // All faces except the bottom, which has z = 0 before the pose.
    let bottom = |p: &Point3| {
        let [y, z] = [p[1] + 20.0, p[2] - 7.0];
        (0.8 * z - 0.6 * y).abs() < 1e-9
    };
    scan.points.retain(|p| !bottom(p));
    let open = proposed(&scan);
    assert_eq!(open.used.len() + 1, whole.used.len());
    let is_unseen = |g: &Gap| matches!(g, Gap::Unseen(..) | Gap::Open(_));
    assert!(open.gaps.iter().any(is_unseen), "{:?}", open.gaps);
}

/// Points that lie apart from all others need no entity.
#[test]
fn strays_are_no_fault_of_a_template() {
    let mut scan = plate(6000, 0.01);
    let bounds = Aabb::from_points(&scan.points);
    let mut random = Random::new(5);
    let stray = |random: &mut Random| {
        let at = |k: usize, random: &mut Random| {
            bounds.center()[k] + 1.5 * (random.unit() - 0.5) * bounds.size()[k]
        };
        [0, 1, 2].map(|k| at(k, random))
    };
    let strays = (0..200).map(|_| stray(&mut random));
    let mut points: Vec<Point3> = strays.collect();
    scan.points.append(&mut points);
    let proposal = proposed(&scan);
    let is_left = |g: &&Gap| matches!(g, Gap::Unassigned(_));
    assert_eq!(proposal.faults(0.0).filter(is_left).count(), 1);
    assert_eq!(proposal.faults(0.03).filter(is_left).count(), 0);
}

/// A plate on a table: the plane extends all round it, is removed, and closes the hidden side.
#[test]
fn a_table_is_taken_off_and_closes_the_part() {
    let mut random = Random::new(9);
    // Without the face on the table, and in the table's frame.
    let mut points: Vec<Point3> = (0..30_000)
        .filter_map(|_| on_plate(&mut random))
        .filter(|(p, normal)| !(normal[2] > 0.5 && p[2] < 1e-9))
        .map(|(p, _)| p)
        .take(6000)
        .collect();
    let part = points.len();
    while points.len() < part + 4000 {
        let p = [
            120.0 * random.unit() - 40.0,
            100.0 * random.unit() - 35.0,
            0.0,
        ];
        let is_under = (0.0..=40.0).contains(&p[0]) && (0.0..=30.0).contains(&p[1]);
        points.extend((!is_under).then_some(p));
    }
    for p in &mut points {
        *p = posed(p.map(|x| x + 0.02 * ((0..12).map(|_| random.unit()).sum::<f64>() - 6.0)));
    }
    let scan = PointCloud::from_points(points);
    let control = Control::default();
    let standing = without_supports(&scan, &control)
        .expect("in time")
        .expect("a table");
    assert_eq!(standing.supports.len(), 1);
    assert!(standing.part.points.len() <= part);
    let options = RecognizeOptions::default();
    let mut found = recognize_scan(&standing.part, &options, &control).expect("entities");
    found.supports = standing.supports.clone();
    let proposal = found.template("a plate", &control).expect("a template");
    assert!(proposal.is_complete(), "{:?}", proposal.gaps);
    let is_standing = |g: &Gap| matches!(g, Gap::Standing(..));
    assert!(proposal.gaps.iter().any(is_standing), "{:?}", proposal.gaps);
    let fit = fitted(&standing.part, &proposal);
    for dimension in [40.0, 30.0, 6.0, 9.0] {
        assert!(
            is_there(&fit, dimension, 0.03),
            "{dimension}: {:?}",
            fit.values()
        );
    }
    // The bottom lies on the table.
    assert!(
        is_there(&fit, 10.0, 0.03) || is_there(&fit, 7.0, 0.03),
        "{:?}",
        fit.values()
    );
}

/// A part without a support has none, from whatever side it was scanned.
#[test]
fn faces_of_a_part_are_no_tables() {
    let whole = plate(6000, 0.02);
    let control = Control::default();
    assert!(
        without_supports(&whole, &control)
            .expect("in time")
            .is_none()
    );
    let mut seen = whole.clone();
    let middle = posed([20.0, 15.0, 10.0]);
    seen.points
        .retain(|p| p[0] + p[1] + p[2] > middle[0] + middle[1] + middle[2]);
    assert!(
        without_supports(&seen, &control)
            .expect("in time")
            .is_none()
    );
}

/// Rays cannot orient bores in a scan from one side; given normals do.
#[test]
fn given_normals_decide_what_is_outside() {
    let mut random = Random::new(3);
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    while points.len() < 6000 {
        let Some((p, n)) = on_plate(&mut random) else {
            continue;
        };
        // Normals of the faces of the plate point away from its centre, those of bores to their
        // axis.
        let is_bore = n[2] == 0.0 && (p[0] - 15.0).hypot(p[1] - 12.0) < 9.1;
        let is_out = [20.0, 15.0, 5.0]
            .iter()
            .zip(&p)
            .zip(&n)
            .map(|((m, x), n)| (x - m) * n);
        let out = if is_bore {
            -1.0
        } else {
            is_out.sum::<f64>().signum()
        };
        let out: Point3 = n.map(|x| out * x);
        if out[2] > 0.5 || out[0] > 0.5 || out[1] > 0.5 || is_bore && dot(out, [1.0; 3]) > 0.0 {
            points.push(p);
            normals.push(out);
        }
    }
    for flip in [1.0, -1.0] {
        let scan = PointCloud {
            normals: normals.iter().map(|n| n.map(|x| flip * x)).collect(),
            ..PointCloud::from_points(points.clone())
        };
        let options = RecognizeOptions::default();
        let found = recognize_scan(&scan, &options, &Control::default()).expect("entities");
        for (label, i) in found.recognition.labels.iter().zip(0..) {
            let Some(entity) = label.map(|l| &found.recognition.entities[l as usize]) else {
                continue;
            };
            let side = dot(found.recognition.normals[i], scan.normals[i]);
            assert!(side > 0.0, "{entity:?}");
        }
        let bores = found.recognition.entities.iter();
        let bores: Vec<i8> = bores
            .filter(|e| e.surface.name() == "cylinder")
            .map(|e| e.outward)
            .collect();
        assert!(!bores.is_empty() && bores.iter().all(|o| f64::from(*o) == -flip));
    }
}

/// Returns a box of 30 × 20 × 12 with its upright edges rounded by 3, in a mesh of few facets.
fn rounded_box(steps: u32) -> PointCloud {
    let centres = [[27.0, 17.0], [3.0, 17.0], [3.0, 3.0], [27.0, 3.0]];
    let mut outline: Vec<[f64; 2]> = Vec::new();
    for (k, [x, y]) in (0..).zip(centres) {
        outline.extend((0..=steps).map(|j| {
            let turn = f64::from(k) + f64::from(j) / f64::from(steps);
            let (s, c) = (turn * std::f64::consts::FRAC_PI_2).sin_cos();
            [x + 3.0 * c, y + 3.0 * s]
        }));
    }
    prism(&outline, 12.0)
}

/// Returns the mesh of the prism over a convex outline, in its pose.
fn prism(outline: &[[f64; 2]], height: f64) -> PointCloud {
    let n = outline.len() as u32;
    let ring = |z: f64| outline.iter().map(move |[x, y]| [*x, *y, z]);
    let mut triangles = Vec::new();
    for k in 0..n {
        let next = (k + 1) % n;
        triangles.extend([[k, next, n + next], [k, n + next, n + k]]);
    }
    for k in 1..n - 1 {
        triangles.extend([[0, k + 1, k], [n, n + k, n + k + 1]]);
    }
    as_scan(ring(0.0).chain(ring(height)).collect(), triangles)
}

/// Returns a mesh, posed, in single precision.
fn as_scan(points: Vec<Point3>, triangles: Vec<[u32; 3]>) -> PointCloud {
    let points = points.into_iter().map(posed);
    PointCloud {
        points: points.map(|p| p.map(|x| f64::from(x as f32))).collect(),
        triangles,
        ..PointCloud::default()
    }
}

/// Returns a plate between planes y = 4 and y = 14 with round ends about (5, 9) and (35, 9), 6
/// high.
fn stadium() -> PointCloud {
    let mut outline: Vec<[f64; 2]> = Vec::new();
    for (x, from) in [(35.0, -0.5), (5.0, 0.5)] {
        outline.extend((0..=24).map(|j| {
            let (s, c) = ((from + f64::from(j) / 24.0) * std::f64::consts::PI).sin_cos();
            [x + 5.0 * c, 9.0 + 5.0 * s]
        }));
    }
    prism(&outline, 6.0)
}

/// Returns a block of 40 × 30 × 20 with the edges of its top cut off by 3 at 45°.
fn chamfered() -> PointCloud {
    let ring = |d: f64, z: f64| {
        [
            [d, d, z],
            [40.0 - d, d, z],
            [40.0 - d, 30.0 - d, z],
            [d, 30.0 - d, z],
        ]
    };
    let points = [ring(0.0, 0.0), ring(0.0, 17.0), ring(3.0, 20.0)].concat();
    let mut triangles = vec![[0, 2, 1], [0, 3, 2], [8, 9, 10], [8, 10, 11]];
    for low in [0, 4] {
        for k in 0..4 {
            let next = (k + 1) % 4;
            let [a, b, c, d] = [low + k, low + next, low + 4 + next, low + 4 + k];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    as_scan(points, triangles)
}

/// Returns a block of 60 × 40 × 10 with all edges cut off by 0.6 at 45°: its corners are triangles.
fn chamfered_all_round() -> PointCloud {
    let (sides, leg) = ([60.0, 40.0, 10.0], 0.6);
    let mut points: Vec<Point3> = Vec::new();
    for corner in 0..8 {
        for on in 0..3 {
            points.push(std::array::from_fn(|k| {
                let inset = if k == on { 0.0 } else { leg };
                if corner >> k & 1 == 1 {
                    sides[k] - inset
                } else {
                    inset
                }
            }));
        }
    }
    let mut triangles = Vec::new();
    for n in (0..27).filter(|n| *n != 13) {
        let normal = [n % 3, n / 3 % 3, n / 9].map(|d| f64::from(d) - 1.0);
        let height = |v: &u32| dot(points[*v as usize], normal);
        let top = (0..24).map(|v| height(&v)).fold(f64::MIN, f64::max);
        let mut face: Vec<u32> = (0..24).filter(|v| height(v) > top - 1e-9).collect();
        let count = face.len() as f64;
        let middle: Point3 = std::array::from_fn(|k| {
            face.iter().map(|v| points[*v as usize][k]).sum::<f64>() / count
        });
        let e = sub(points[face[0] as usize], middle);
        let f = cross(normal, e);
        let angle = |v: &u32| {
            let d = sub(points[*v as usize], middle);
            (dot(d, f) / norm(f)).atan2(dot(d, e) / norm(e))
        };
        face.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
        triangles.extend((2..face.len()).map(|k| [face[0], face[k - 1], face[k]]));
    }
    as_scan(points, triangles)
}

/// Tangency of surfaces, and equality of chamfers, holds for all dimensions: radii are tied to
/// planes, chamfers share one leg.
#[test]
fn tangent_faces_and_chamfers_are_tied() {
    let control = Control::default();
    for (scan, names, values) in [
        (
            stadium(),
            vec!["length", "height", "boss_1_x"],
            vec![6.0, 10.0, 30.0],
        ),
        (
            chamfered(),
            vec!["chamfer", "height", "length", "width"],
            vec![3.0, 20.0, 30.0, 40.0],
        ),
        (
            chamfered_all_round(),
            vec!["chamfer", "height", "length", "width"],
            vec![0.6, 10.0, 40.0, 60.0],
        ),
    ] {
        let found = recognize_scan(&scan, &RecognizeOptions::default(), &control);
        let proposal = found
            .expect("entities")
            .template("a part", &control)
            .expect("a template");
        assert!(proposal.used.iter().all(|u| *u), "{}", proposal.program);
        let model = Model::parse(&proposal.program, Mode::Default).expect("HyperFun");
        let free = model.params().iter().filter(|p| p.tie.is_none());
        let free: Vec<&str> = free.map(|p| p.name.as_str()).collect();
        assert_eq!(free.len(), names.len(), "{}", proposal.program);
        let fit = fitted(&scan, &proposal);
        assert!(fit.fit.acceptable, "{:?}", fit.fit.reasons);
        for value in values {
            assert!(is_there(&fit, value, 1e-4), "{value}: {:?}", fit.values());
        }
    }
}

/// Returns points of a tube of 30 × 20 × 6 with walls of 1.5 and corners of radius 4: of both
/// sides, and of the ends.
fn square_tube() -> PointCloud {
    let mut random = Random::new(8);
    let mut points = Vec::new();
    let corners = [[26.0, 16.0], [4.0, 16.0], [4.0, 4.0], [26.0, 4.0]];
    let lengths = [22.0, 12.0, 22.0, 12.0];
    // A point of the outline at the distance `radius` from the centres of its corners.
    let outline = |random: &mut Random, radius: f64| {
        let arc = radius * std::f64::consts::FRAC_PI_2;
        let mut at = random.unit() * (68.0 + 4.0 * arc);
        for (k, ([x, y], length)) in corners.into_iter().zip(lengths).enumerate() {
            let turn = |share: f64| ((k as f64 + share) * std::f64::consts::FRAC_PI_2).sin_cos();
            if at < arc {
                let (s, c) = turn(at / arc);
                return [x + radius * c, y + radius * s];
            }
            at -= arc;
            if at < length {
                let (s, c) = turn(1.0);
                return [x + radius * c - at * s, y + radius * s + at * c];
            }
            at -= length;
        }
        [26.0 + radius, 16.0]
    };
    for k in 0..6000 {
        let side = if k % 2 == 0 { 4.0 } else { 2.5 };
        let (radius, z) = match k % 5 {
            0 => (2.5 + 1.5 * random.unit(), 6.0 * f64::from(k % 2)),
            _ => (side, 6.0 * random.unit()),
        };
        let [x, y] = outline(&mut random, radius);
        points.push(posed([x, y, z]));
    }
    PointCloud::from_points(points)
}

/// Fillets with the centres of rounds are as far from the walls inside as these are from the walls
/// outside: the wall is one parameter, and the solid of the fit is exact.
#[test]
fn each_contact_is_a_tie() {
    let scan = square_tube();
    let proposal = proposed(&scan);
    let model = Model::parse(&proposal.program, Mode::Default).expect("HyperFun");
    let free = model.params().iter().filter(|p| p.tie.is_none());
    assert_eq!(free.count(), 5, "{}", proposal.program);
    let fit = fitted(&scan, &proposal);
    assert!(fit.fit.acceptable, "{:?}", fit.fit.reasons);
    for value in [30.0, 20.0, 6.0, 1.5, 4.0] {
        assert!(is_there(&fit, value, 1e-5), "{value}: {:?}", fit.values());
    }
    let model = Model::parse(&fit.program(), Mode::Default).expect("HyperFun");
    let control = Control::default();
    let made = brep_model(&model, &[], &MeshModelOptions::default(), None, &control);
    let certificate = made.expect("a solid").certificate;
    assert_eq!(certificate.failures, []);
    let corners = 4.0 - std::f64::consts::PI;
    let volume = 6.0 * (30.0 * 20.0 - 16.0 * corners - 27.0 * 17.0 + 6.25 * corners);
    assert!((certificate.total.volume / volume - 1.0).abs() < 1e-5);
    let middle = posed([15.0, 10.0, 3.0]);
    assert!(norm(sub(certificate.centroid(), middle)) < 1e-4);
}

/// A template states the pose of its part, and fits another scan of it elsewhere.
#[test]
fn a_template_fits_the_part_in_another_place() {
    let proposal = proposed(&plate(6000, 0.0));
    assert!(proposal.program.contains("-- @pose rigid at "));
    let turned = |p: &Point3| posed(posed([p[1] - 3.0, p[2] + 50.0, p[0]]));
    let mut elsewhere = plate(6000, 0.0);
    elsewhere.points = elsewhere.points.iter().map(turned).collect();
    let fit = fitted(&elsewhere, &proposal);
    assert!(
        fit.fit.acceptable && fit.fit.rms < 1e-9,
        "{:?}",
        fit.fit.reasons
    );
    // The part has its true size in its own frame, and lies elsewhere in the scan's.
    let mut sides = fit.own_extent().size();
    sides.sort_by(f64::total_cmp);
    for (side, made) in sides.into_iter().zip([10.0, 30.0, 40.0]) {
        assert!((side - made).abs() < 0.01 * made, "{sides:?}");
    }
    let extent = fit.extent();
    assert_eq!(extent, Aabb::from_points(&elsewhere.points));
}

/// Rounds of a coarse CAD mesh, whose vertices all lie on edges, bound the solid and are tied.
#[test]
fn rounds_of_a_mesh_are_tied_to_their_faces() {
    for steps in [3, 6, 24] {
        let scan = rounded_box(steps);
        let control = Control::default();
        let found = recognize_scan(&scan, &RecognizeOptions::default(), &control);
        let proposal = found
            .expect("entities")
            .template("a box", &control)
            .expect("a template");
        assert!(
            proposal.is_complete() && proposal.used.iter().all(|u| *u),
            "{steps}"
        );
        assert_eq!(proposal.used.len(), 10);
        assert!(proposal.program.contains("tie="), "{}", proposal.program);
        let fit = fitted(&scan, &proposal);
        assert!(fit.fit.acceptable, "{steps}: {:?}", fit.fit.reasons);
        // Single precision is recognised from the coordinates: the interval contains the radius.
        let radius = fit.template.index("round_radius").expect("a radius");
        let (low, high) = fit.fit.parameters[radius].ci95.expect("an interval");
        assert!(
            low <= 3.0 && 3.0 <= high && high - low < 1e-3,
            "{steps}: {low} {high}"
        );
    }
}

#[test]
fn the_order_of_the_points_changes_nothing() {
    let scan = plate(3000, 0.02);
    let mut turned = scan.clone();
    turned.points.reverse();
    assert_eq!(proposed(&scan).program, proposed(&turned).program);
}
