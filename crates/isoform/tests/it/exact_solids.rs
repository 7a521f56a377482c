//! Solids from damaged files are read, measured, triangulated and compared, or refused, but never
//! cause a panic; and the distances of an intact solid are those of its function.

use isoform::field::hyperfun::{Mode, Model};
use isoform::geom::PointCloud;
use isoform::io::{SolidFile, SolidProperties, read_solids, write_solids};
use isoform::{
    Control, ExactSolid, MeshModelOptions, Side, brep_model, compare, measure_solid, solid_gap,
};

/// A part with planes, cylinders, a cone, a sphere, a torus and an ellipsoid, far from one another.
const ZOO: &str = "m(x[3], a[1]) { r = sqrt(x[1]^2 + x[2]^2);
    can = min(1 - r, min(x[3], 2 - x[3]));
    tip = min((1 - x[3])/2 - sqrt((x[1] - 4)^2 + x[2]^2), x[3]);
    ball = 1 - sqrt((x[1] - 8)^2 + x[2]^2 + x[3]^2);
    ring = 0.3 - sqrt((sqrt((x[1] - 12)^2 + x[2]^2) - 1)^2 + x[3]^2);
    egg = 1 - (x[1] - 16)^2 - x[2]^2/0.5 - x[3]^2/0.25;
    m = max(can, max(tip, max(ball, max(ring, egg)))); }";

fn zoo() -> SolidFile {
    let model = Model::parse(ZOO, Mode::Default).expect("a program");
    let options = MeshModelOptions {
        size: Some(0.2),
        ..MeshModelOptions::default()
    };
    let made = brep_model(&model, &[], &options, None, &Control::default()).expect("solids");
    let total = &made.certificate.total;
    SolidFile {
        name: String::new(),
        unit: None,
        properties: SolidProperties {
            volume: total.volume,
            area: total.area,
            centroid: made.certificate.centroid(),
            gap: made.certificate.gap,
        },
        brep: made.built.brep,
    }
}

/// Runs all operations on a file of solids.
fn use_it(file: &SolidFile, cloud: &PointCloud) {
    measure_solid(&file.brep);
    if let Ok(solid) = ExactSolid::new(file.brep.clone(), None, &Control::default()) {
        let mesh = solid.mesh();
        let nodes = mesh.points.len() as u32;
        assert!(mesh.triangles.as_flattened().iter().all(|v| *v < nodes));
        let _ = compare(Side::Points(cloud), Side::Solid(&solid), None, 200);
    }
}

#[test]
fn what_is_measured_is_what_the_certificate_says() {
    let file = zoo();
    let kinds: Vec<&str> = file.brep.faces.iter().map(|f| f.surface.name()).collect();
    for kind in ["plane", "cylinder", "cone", "sphere", "torus", "ellipsoid"] {
        assert!(kinds.contains(&kind), "{kind}");
    }
    let found = measure_solid(&file.brep);
    assert_eq!(
        (found.volume, found.area),
        (file.properties.volume, file.properties.area)
    );
    assert_eq!(found.centroid, file.properties.centroid);
    assert!(found.gap < 1e-12 && found.euler == 8, "{found:?}");
    // An edge that is moved leaves its faces by that distance.
    let mut moved = file.brep;
    moved.vertices[0][2] += 0.125;
    let gap = solid_gap(&moved);
    assert!((0.05..=0.125 + 1e-12).contains(&gap), "{gap}");
}

#[test]
fn damaged_solids_are_refused_or_survived() {
    let file = zoo();
    let text = String::from_utf8(write_solids(&file)).expect("text");
    let cloud = PointCloud::from_points(vec![[0.0; 3], [4.0, 1.0, 0.5], [1e3, -1e3, 5.0]]);
    let numbers: Vec<(usize, usize)> = numbers(&text);
    let mut random = fastrand::Rng::with_seed(5);
    let (mut survived, mut refused) = (0, 0);
    let count = isoform_testdata::cases(150, 15);
    for _ in 0..count {
        let mut broken = text.clone();
        let mut places: Vec<_> = (0..1 + random.usize(..3))
            .map(|_| random.choice(&numbers))
            .collect();
        places.sort_unstable_by(|a, b| b.cmp(a));
        places.dedup();
        for &(from, to) in places.into_iter().flatten() {
            let value: f64 = text[from..to].parse().unwrap_or(1.0);
            let other = match random.u32(..7) {
                0 => format!("{:?}", -value),
                1 => format!("{:?}", value * 1e30),
                2 => format!("{:?}", value * 1e-30),
                3 => format!("{:?}", value + 1e-3),
                4 => random.u32(..20).to_string(),
                5 => format!("{:?}", value * (1.0 + 1e-9)),
                _ => "1e90".to_owned(),
            };
            broken.replace_range(from..to, &other);
        }
        match read_solids(&serde_json::from_str(&broken).expect("still JSON")) {
            Ok(file) => {
                use_it(&file, &cloud);
                survived += 1;
            }
            Err(e) => {
                assert!(!e.problem.is_empty());
                refused += 1;
            }
        }
    }
    assert!(
        survived > count / 6 && refused > count / 6,
        "{survived} {refused}"
    );
}

/// Returns the positions of numbers in a text.
fn numbers(text: &str) -> Vec<(usize, usize)> {
    let is_part = |b: u8| b.is_ascii_digit() || b"+-.e".contains(&b);
    let bytes = text.as_bytes();
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let end = (at..bytes.len())
            .find(|i| !is_part(bytes[*i]))
            .unwrap_or(bytes.len());
        if end > at && text[at..end].parse::<f64>().is_ok() {
            found.push((at, end));
        }
        at = end.max(at) + 1;
    }
    found
}
