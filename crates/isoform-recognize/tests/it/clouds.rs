//! Clouds with known surfaces, constructed here.

use isoform_control::Control;
use isoform_geom::{Point3, PointCloud, Quadric};
use isoform_recognize::{Error, Options, Recognition, recognize};

/// A fixed sequence of numbers in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        let state = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = state.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns a nearly normal deviate: the sum of twelve uniform ones.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() - 6.0
    }
}

/// Returns a square plate at z = 0 and a ball of radius 0.4 above it.
fn plate_and_ball(noise: f64) -> Vec<Point3> {
    let mut random = Random(3);
    let mut points = Vec::new();
    for _ in 0..2500 {
        let (x, y) = (2.0 * random.next() - 1.0, 2.0 * random.next() - 1.0);
        points.push([x, y, noise * random.normal()]);
        let (z, turn) = (
            2.0 * random.next() - 1.0,
            std::f64::consts::TAU * random.next(),
        );
        let (across, r) = ((1.0 - z * z).sqrt(), 0.4 + noise * random.normal());
        points.push([
            r * across * turn.cos(),
            r * across * turn.sin(),
            0.7 + r * z,
        ]);
    }
    points
}

fn run(points: Vec<Point3>) -> Result<Recognition, Error> {
    let scan = PointCloud {
        points,
        ..PointCloud::default()
    };
    recognize(&scan, &Options::default(), &Control::default())
}

/// Returns the radius of the only ball next to the only plane.
fn radius(found: &Recognition) -> f64 {
    assert_eq!(found.entities.len(), 2, "{:?}", found.entities);
    let surfaces = found.entities.iter().map(|e| e.surface);
    let radii: Vec<f64> = surfaces
        .filter_map(|s| match s {
            Quadric::Sphere { radius, .. } => Some(radius),
            _ => None,
        })
        .collect();
    assert_eq!(radii.len(), 1);
    radii[0]
}

#[test]
fn exact_points_give_a_plane_and_a_sphere_to_rounding() {
    let found = run(plate_and_ball(0.0)).expect("a scan");
    assert!((radius(&found) - 0.4).abs() < 1e-12);
    assert!(found.labels.iter().all(Option::is_some));
}

#[test]
fn noise_is_measured_and_the_radius_is_within_its_deviations() {
    let found = run(plate_and_ball(0.003)).expect("a scan");
    let deviation = 0.003 / 2500_f64.sqrt();
    assert!((radius(&found) - 0.4).abs() < 4.0 * deviation);
    assert!((found.noise / 0.003 - 1.0).abs() < 0.1, "{}", found.noise);
}

#[test]
fn order_unit_and_place_change_nothing_but_numbers() {
    let points = plate_and_ball(0.003);
    let found = run(points.clone()).expect("a scan");
    let mut flipped = points.clone();
    flipped.reverse();
    let mut other = run(flipped).expect("a scan");
    other.labels.reverse();
    assert_eq!(found.labels, other.labels);
    assert_eq!(found.entities, other.entities);
    let small = points.iter().map(|p| p.map(|x| 1e-6 * x)).collect();
    assert!((radius(&run(small).expect("a scan")) - 0.4e-6).abs() < 1e-9);
    let far = points.iter().map(|p| p.map(|x| x + 1e6)).collect();
    assert!((radius(&run(far).expect("a scan")) - 0.4).abs() < 1e-3);
}

#[test]
fn points_in_a_volume_are_no_surface() {
    let mut random = Random(5);
    let points = (0..4000).map(|_| [(); 3].map(|()| random.next())).collect();
    assert!(run(points).expect("a scan").entities.is_empty());
}

#[test]
fn bad_input_is_said() {
    assert_eq!(run(vec![]), Err(Error::Few { points: 0 }));
    assert_eq!(run(vec![[1.0; 3]; 500]), Err(Error::Few { points: 1 }));
    let line = (0..500).map(|k| [1.0, 2.0, 3.0].map(|x| x * f64::from(k)));
    assert_eq!(run(line.collect()), Err(Error::Line));
    assert_eq!(run(vec![[f64::NAN; 3]; 50]), Err(Error::NotFinite));
}
