//! CAD meshes with known surfaces, constructed here with given numbers of sides and rounded to
//! single precision.

use isoform_control::Control;
use isoform_geom::{Point3, PointCloud, Quadric};
use isoform_recognize::{FacetRecognition, Options, recognize_facets};
use std::f64::consts::TAU;

/// Number of points requested inside faces.
const WANTED: usize = 2000;

/// Returns a mesh rotated into a general pose and rounded to single precision.
fn mesh(points: Vec<Point3>, triangles: Vec<[u32; 3]>) -> PointCloud {
    let (s, c) = 0.7_f64.sin_cos();
    let turned = |[x, y, z]: Point3| {
        let [y, z] = [c * y - s * z, s * y + c * z];
        [c * x - s * y + 3.0, s * x + c * y - 1.0, z]
    };
    let points = points.into_iter().map(turned);
    PointCloud {
        points: points.map(|p| p.map(|x| f64::from(x as f32))).collect(),
        triangles,
        ..PointCloud::default()
    }
}

/// Returns a point of a mesh, rotated back to the axes.
fn upright([x, y, z]: Point3) -> Point3 {
    let (s, c) = 0.7_f64.sin_cos();
    let [x, y] = [x - 3.0, y + 1.0];
    let [x, y] = [c * x + s * y, c * y - s * x];
    [x, c * y + s * z, c * z - s * y]
}

/// Returns the surface that a profile of (radius, height) sweeps about an axis, with `sides` sides;
/// closed profiles join their ends, open ones get flat caps.
fn turned(profile: &[[f64; 2]], sides: u32, is_closed: bool) -> PointCloud {
    let rings = profile.len() as u32;
    let at = |k: u32, r: f64| {
        let (s, c) = (TAU * f64::from(k) / f64::from(sides)).sin_cos();
        [r * c, r * s]
    };
    let mut points: Vec<Point3> = Vec::new();
    for [r, h] in profile {
        points.extend((0..sides).map(|k| {
            let [x, y] = at(k, *r);
            [x, y, *h]
        }));
    }
    let mut triangles = Vec::new();
    for i in 0..if is_closed { rings } else { rings - 1 } {
        for k in 0..sides {
            let [a, b] = [k, (k + 1) % sides].map(|k| i * sides + k);
            let [c, d] = [k, (k + 1) % sides].map(|k| (i + 1) % rings * sides + k);
            triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    if !is_closed {
        for k in 1..sides - 1 {
            let top = (rings - 1) * sides;
            triangles.extend([[0, k + 1, k], [top, top + k, top + k + 1]]);
        }
    }
    mesh(points, triangles)
}

fn found(mesh: &PointCloud) -> FacetRecognition {
    recognize_facets(mesh, WANTED, &Options::default(), &Control::default())
        .expect("a mesh")
        .expect("a CAD mesh")
}

/// Returns the number of entities of a kind.
fn count(found: &FacetRecognition, kind: &str) -> usize {
    let entities = found.recognition.entities.iter();
    entities.filter(|e| e.surface.name() == kind).count()
}

fn radii(found: &FacetRecognition) -> Vec<f64> {
    let of = |q: &Quadric| match q {
        Quadric::Cylinder { radius, .. } | Quadric::Sphere { radius, .. } => Some(*radius),
        _ => None,
    };
    let entities = found.recognition.entities.iter();
    entities.filter_map(|e| of(&e.surface)).collect()
}

#[test]
fn cylinders_of_few_and_many_sides_have_one_bent_face() {
    for sides in [12, 48, 200] {
        let found = found(&turned(&[[2.0, 0.0], [2.0, 7.0]], sides, false));
        assert_eq!([count(&found, "cylinder"), count(&found, "plane")], [1, 2]);
        assert!((radii(&found)[0] - 2.0).abs() < 1e-6, "{sides}");
        assert_eq!(found.recognition.entities.len(), 3, "{sides} sides");
    }
}

#[test]
fn prisms_have_planes() {
    for sides in [4, 6, 8, 9] {
        let found = found(&turned(&[[2.0, 0.0], [2.0, 7.0]], sides, false));
        assert_eq!(count(&found, "plane"), sides as usize + 2);
        assert_eq!(found.recognition.entities.len(), sides as usize + 2);
    }
}

#[test]
fn a_frustum_is_a_cone_with_its_angle() {
    let found = found(&turned(&[[3.0, 0.0], [1.0, 2.0]], 24, false));
    assert_eq!([count(&found, "cone"), count(&found, "plane")], [1, 2]);
    let cone = |q: &Quadric| match q {
        Quadric::Cone { half_angle, .. } => Some(*half_angle),
        _ => None,
    };
    let mut surfaces = found.recognition.entities.iter().map(|e| &e.surface);
    let angle = surfaces.find_map(cone).expect("a cone");
    assert!((angle - 0.25 * std::f64::consts::PI).abs() < 1e-6);
}

#[test]
fn the_facets_at_the_tip_of_a_cone_are_of_it() {
    // The ring at the tip is one point in space.
    for (angle, sides) in [(0.3, 24), (0.8, 30), (1.2, 16)] {
        let profile = [4.0, 2.0, 0.0].map(|r| [r, (4.0 - r) / f64::tan(angle)]);
        let found = found(&turned(&profile, sides, false));
        assert_eq!(
            [count(&found, "cone"), count(&found, "plane")],
            [1, 1],
            "{angle}"
        );
        let labels = &found.recognition.labels;
        assert!(labels.iter().all(Option::is_some), "{angle}");
    }
}

#[test]
fn a_dome_is_a_sphere() {
    let ring = |k: u32| {
        let (s, c) = (f64::from(k) * 0.15).sin_cos();
        [4.0 * c, 4.0 * s]
    };
    let profile: Vec<[f64; 2]> = (0..10).map(ring).collect();
    let found = found(&turned(&profile, 36, false));
    assert_eq!([count(&found, "sphere"), count(&found, "plane")], [1, 2]);
    assert!((radii(&found)[0] - 4.0).abs() < 1e-6);
}

#[test]
fn a_torus_is_one_face_although_its_top_is_flat() {
    // Rings on both sides of the top and the bottom: flat between them.
    let ring = |k: u32| {
        let (s, c) = ((f64::from(k) + 0.5) * TAU / 24.0).sin_cos();
        [5.0 + 2.0 * c, 2.0 * s]
    };
    let profile: Vec<[f64; 2]> = (0..24).map(ring).collect();
    let found = found(&turned(&profile, 40, true));
    assert_eq!(found.recognition.entities.len(), 1);
    let Quadric::Torus { major, minor, .. } = found.recognition.entities[0].surface else {
        panic!("{:?}", found.recognition.entities);
    };
    assert!((major - 5.0).abs() < 1e-6 && (minor - 2.0).abs() < 1e-6);
}

/// Returns a pin of radius 5 and height 8 whose upper edge is rounded by 2, in `steps` steps.
fn pin(steps: u32, sides: u32) -> PointCloud {
    let at = |k: u32| {
        let (s, c) = (0.25 * TAU * f64::from(k) / f64::from(steps)).sin_cos();
        [3.0 + 2.0 * c, 6.0 + 2.0 * s]
    };
    let profile: Vec<[f64; 2]> = std::iter::once([5.0, 0.0])
        .chain((0..=steps).map(at))
        .collect();
    turned(&profile, sides, false)
}

#[test]
fn a_round_and_the_plane_that_it_touches_are_two_faces() {
    // All corners of the plane's facets are on the torus, which has an equal normal there.
    for (steps, sides) in [(12, 60), (6, 48), (3, 24)] {
        let found = found(&pin(steps, sides));
        let counts = ["plane", "cylinder", "torus"].map(|kind| count(&found, kind));
        assert_eq!(counts, [2, 1, 1], "{steps} steps, {sides} sides");
        assert_eq!(found.recognition.blends.len(), 1, "{steps} steps");
    }
}

#[test]
fn two_steps_of_a_round_are_enough_between_the_faces_that_it_touches() {
    let at = |degrees: f64, along: f64| {
        let (s, c) = degrees.to_radians().sin_cos();
        [3.0 + 2.0 * c - along * s, 6.0 + 2.0 * s + along * c]
    };
    let foot = [5.0, 0.0];
    let round = [at(0.0, 0.0), at(30.0, 0.0), at(60.0, 0.0)];
    let of = |last: [f64; 2]| {
        let found = found(&turned(&[&[foot], &round[..], &[last]].concat(), 32, false));
        ["plane", "cylinder", "torus", "cone"].map(|kind| count(&found, kind))
    };
    assert_eq!(of(at(60.0, 2.0)), [2, 1, 1, 1]);
    // Any three circles lie on a torus: one that meets the next face at an edge may be two cones.
    assert_eq!(of([1.0, 9.0]), [2, 1, 0, 3]);
}

#[test]
fn points_inside_faces_are_on_them() {
    let found = found(&tube());
    let (mut flat, mut bent) = (0, 0);
    for p in found.inside.iter().map(|p| upright(*p)) {
        let radius = p[0].hypot(p[1]);
        if p[2].abs() < 1e-6 || (p[2] - 5.0).abs() < 1e-6 {
            // The chords of the bore reach into it.
            assert!(
                (1.0 - 1e-6..=3.0 + 1e-6).contains(&radius),
                "{p:?} {radius}"
            );
            flat += 1;
        } else {
            let off = (radius - 1.0).abs().min((radius - 3.0).abs());
            assert!(off < 1e-6, "{p:?}");
            bent += 1;
        }
    }
    assert!(flat > 100 && bent > 100, "{flat} {bent}");
}

/// Returns a tube: a bore in a cylinder, with flat rings between them.
fn tube() -> PointCloud {
    turned(&[[3.0, 0.0], [3.0, 5.0], [1.0, 5.0], [1.0, 0.0]], 32, true)
}

#[test]
fn a_bore_faces_inwards_and_is_coaxial() {
    let found = found(&tube());
    assert_eq!([count(&found, "cylinder"), count(&found, "plane")], [2, 2]);
    for e in &found.recognition.entities {
        if let Quadric::Cylinder { radius, .. } = e.surface {
            assert_eq!(e.outward, if radius > 2.0 { 1 } else { -1 });
        }
    }
    let kinds = found.recognition.relations.iter().map(|r| r.kind);
    let coaxial = kinds.filter(|k| *k == isoform_recognize::RelationKind::Coaxial);
    assert_eq!(coaxial.count(), 1);
    assert!(found.recognition.labels.iter().all(Option::is_some));
}

#[test]
fn labels_are_those_of_points_on_their_surface() {
    let mesh = tube();
    let found = found(&mesh);
    let all: Vec<Point3> = [&mesh.points[..], &found.inside].concat();
    assert_eq!(found.recognition.labels.len(), all.len());
    assert!(found.inside.len() > WANTED / 4);
    for (p, label) in all.iter().zip(&found.recognition.labels) {
        let entity = &found.recognition.entities[label.expect("a label") as usize];
        if let Quadric::Plane { normal, offset } = entity.surface {
            let d: f64 = (0..3).map(|k| normal[k] * p[k]).sum();
            assert!((d - offset).abs() < 2e-6, "{p:?}");
        }
    }
}

#[test]
fn disorder_changes_nothing() {
    let mesh = tube();
    let clean = found(&mesh);
    let mut messy = mesh.clone();
    let twice: Vec<[u32; 3]> = mesh.triangles.iter().step_by(3).copied().collect();
    messy.triangles.extend(twice);
    for t in messy.triangles.iter_mut().step_by(4) {
        t.swap(0, 1);
    }
    messy.triangles.push([0, 0, 1]);
    let messy = found(&messy);
    let kinds = |f: &FacetRecognition| {
        let of = f.recognition.entities.iter();
        let mut kinds: Vec<(String, i8)> = of
            .map(|e| (e.surface.name().to_owned(), e.outward))
            .collect();
        kinds.sort();
        // A plane's normal may point either way.
        kinds.retain(|k| k.0 != "plane");
        kinds
    };
    assert_eq!(kinds(&clean), kinds(&messy));
    assert_eq!(count(&clean, "plane"), count(&messy, "plane"));
}

#[test]
fn a_scan_is_no_cad_mesh() {
    let mut mesh = turned(&[[2.0, 0.0], [2.0, 2.0], [2.0, 4.0], [2.0, 7.0]], 60, false);
    for (k, p) in mesh.points.iter_mut().enumerate() {
        for (i, x) in p.iter_mut().enumerate() {
            *x += 1e-3 * ((7 * k + 3 * i) as f64).sin();
        }
    }
    let found = recognize_facets(&mesh, WANTED, &Options::default(), &Control::default());
    assert!(found.expect("a mesh").is_none());
}
