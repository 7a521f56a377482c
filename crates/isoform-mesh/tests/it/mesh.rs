//! Whole meshes: valid by the certificate, exact on the function, converging as theory predicts,
//! independent of the number of threads.

use crate::common::{PART, SPHERE, solid};
use isoform_check::{self as check, Certificate, certify};
use isoform_geom::{Aabb, Mesh, Point3, Solid, dot, norm, sub};
use isoform_mesh::{
    Control, MeshError, Meshed, Options, Sizes, WarningKind, adapt, mean_edge, mesh,
};

/// Block minus 5 by 4 by z cylinders: 200 − 4 (π 1.25² + the area of the circle of radius 1.5 below
/// y = 1, half a unit above its centre).
fn part_volume() -> f64 {
    let (r, h) = (1.5f64, 0.5f64);
    let cap = r * r * (h / r).acos() - h * (r * r - h * h).sqrt();
    200.0 - 4.0 * (std::f64::consts::PI * 1.25 * 1.25 + std::f64::consts::PI * r * r - cap)
}

fn meshed(text: &str, options: &Options) -> (Meshed, Certificate) {
    let solid = solid(text);
    let meshed = mesh(&solid, options, &Control::default()).expect("a mesh");
    assert_eq!(meshed.warnings, [], "{text}");
    let curves: Vec<Vec<Point3>> = meshed
        .features
        .curves
        .iter()
        .map(|c| c.points.clone())
        .collect();
    let corners: Vec<Point3> = meshed.features.corners.iter().map(|c| c.point).collect();
    let checks = check::Options {
        curves: &curves,
        corners: &corners,
        size: Some(options.size),
        region: options.region,
        ..check::Options::default()
    };
    let certificate = certify(&meshed.mesh, Some(&solid), &checks, &Control::default());
    let failures: Vec<String> = certificate
        .failures()
        .iter()
        .map(ToString::to_string)
        .collect();
    assert!(certificate.is_ok(), "{text}: {failures:?}");
    (meshed, certificate)
}

/// Largest distance of the unit sphere from the middles of a mesh's triangles.
fn sagitta(mesh: &Mesh) -> f64 {
    let off = |f: &[u32; 3]| {
        let p = f.map(|v| mesh.points[v as usize]);
        let middle: Point3 = std::array::from_fn(|i| (p[0][i] + p[1][i] + p[2][i]) / 3.0);
        1.0 - norm(middle)
    };
    mesh.triangles.iter().map(off).fold(0.0, f64::max)
}

/// A boss that is flush with the side of its block, and a post inside of its base.
#[test]
fn a_face_that_runs_out_in_two_cusps_has_a_node_between_them() {
    let boss = "m(x[3], a[1]) { array v[3], p[3]; v = [-10, -5, 0]; p = [7, 0, 0];
        m = hfBlock(x, v, 20, 10, 4) | (hfCylinderZ(x, p, 3) & x[3] & (8 - x[3])); }";
    let post = "m(x[3], a[1]) { array o[3], p[3]; o = [0, 0, 0]; p = [2.4, 1.8, 0];
        m = (hfCylinderZ(x, o, 5) & x[3] & (10 - x[3]))
            | (hfCylinderZ(x, p, 2) & x[3] & (12 - x[3])); }";
    for (text, at) in [(boss, [10.0, 0.0, 4.0]), (post, [4.0, 3.0, 10.0])] {
        let options = Options {
            size: 0.6,
            ..Options::default()
        };
        let (meshed, _) = meshed(text, &options);
        let nodes = meshed.mesh.points.iter();
        let nearest = nodes
            .map(|p| norm(sub(*p, at)))
            .fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-12, "{text}: {nearest}");
    }
}

#[test]
fn the_part_has_its_faces_edges_corners_and_volume() {
    let (meshed, certificate) = meshed(
        PART,
        &Options {
            size: 0.4,
            ..Options::default()
        },
    );
    let surface = certificate.surface.expect("a surface");
    assert_eq!(
        (surface.euler, surface.shells, surface.components),
        (0, 1, 1)
    );
    assert_eq!(
        (
            meshed.mesh.parts.len(),
            meshed.mesh.corners.len(),
            meshed.features.curves.len()
        ),
        (8, 12, 20)
    );
    // The chords of the holes leave them by at most h²/8r.
    assert!(
        (surface.volume / part_volume() - 1.0).abs() < 5e-3,
        "{} {}",
        surface.volume,
        part_volume()
    );
    let tets = certificate.tets.expect("tetrahedra");
    assert!(
        tets.dihedral_min > 20.0 && tets.dihedral_max < 150.0,
        "{} {}",
        tets.dihedral_min,
        tets.dihedral_max
    );
    assert!(certificate.deviation.expect("distances").nodes.max < 1e-12);
}

#[test]
fn faces_of_a_sphere_converge_with_the_square_of_the_size_and_curved_ones_faster() {
    let at = |size: f64, order: u32| {
        meshed(
            SPHERE,
            &Options {
                size,
                order,
                ..Options::default()
            },
        )
    };
    let (coarse, fine) = (at(0.3, 1), at(0.15, 1));
    let rate = (sagitta(&coarse.0.mesh) / sagitta(&fine.0.mesh)).log2();
    assert!((1.5..2.6).contains(&rate), "{rate}");
    let off = |c: &Certificate| c.surface.as_ref().expect("a surface").volume;
    let exact = 4.0 / 3.0 * std::f64::consts::PI;
    assert!((off(&fine.1) / exact - 1.0).abs() < 0.3 * (off(&coarse.1) / exact - 1.0).abs());
    let (curved, certificate) = at(0.3, 2);
    let middles = curved
        .mesh
        .triangle_mids
        .iter()
        .flatten()
        .map(|&m| (norm(curved.mesh.points[m as usize]) - 1.0).abs());
    assert!(middles.fold(0.0, f64::max) < 1e-14);
    assert!(
        certificate
            .curved
            .expect("curved elements")
            .scaled_jacobian_min
            > 0.3
    );
}

#[test]
fn thin_sheets_and_many_corners_stay_manifold() {
    let gyroid = "m(x[3], a[1]) {
        w = 6.283185307179586;
        g = sin(w*x[1])*cos(w*x[2]) + sin(w*x[2])*cos(w*x[3]) + sin(w*x[3])*cos(w*x[1]);
        m = min(0.45 - max(max(abs(x[1]), abs(x[2])), abs(x[3])), (0.6 - abs(g))/(1.5*w));
    }";
    let (meshed, certificate) = meshed(
        gyroid,
        &Options {
            size: 0.06,
            ..Options::default()
        },
    );
    assert!(certificate.tets.expect("tetrahedra").dihedral_min > 12.0);
    assert_eq!(ears(&meshed.mesh), 0);
}

/// Triangles whose corners all lie on one curve, between two parts.
fn ears(mesh: &Mesh) -> usize {
    let mut parts = vec![std::collections::BTreeSet::new(); mesh.points.len()];
    for (t, part) in mesh.triangles.iter().zip(&mesh.triangle_parts) {
        t.iter().for_each(|&v| parts[v as usize].extend([*part]));
    }
    let shared = |t: &[u32; 3]| {
        parts[t[0] as usize]
            .iter()
            .filter(|p| t[1..].iter().all(|&v| parts[v as usize].contains(p)))
            .count()
    };
    mesh.triangles.iter().filter(|t| shared(t) > 1).count()
}

#[test]
fn sizes_follow_the_chordal_error() {
    let (uniform, _) = meshed(
        PART,
        &Options {
            size: 0.3,
            ..Options::default()
        },
    );
    let (graded, certificate) = meshed(
        PART,
        &Options {
            size: 1.2,
            grade: Some(0.02),
            ..Options::default()
        },
    );
    assert!(certificate.deviation.expect("distances").faces.max <= 0.021);
    assert!(
        graded.mesh.tets.len() * 2 < uniform.mesh.tets.len(),
        "{} {}",
        graded.mesh.tets.len(),
        uniform.mesh.tets.len()
    );
}

/// Curvature limits edges to 0.8 radii, which gives some 60 triangles around a ball, and bisection
/// at most twice as many, for any size above that of the ball.
#[test]
fn a_ball_has_the_triangles_that_its_curvature_asks_for() {
    for size in [0.5, 0.9, 1.4, 2.0] {
        let options = Options {
            size,
            ..Options::default()
        };
        let (meshed, _) = meshed(SPHERE, &options);
        let triangles = meshed.mesh.triangles.len();
        assert!((60..200).contains(&triangles), "{triangles} at {size}");
    }
}

#[test]
fn a_box_cuts_the_solid_off() {
    let region = Aabb {
        lo: [-2.0, -2.0, -2.0],
        hi: [2.0, 2.0, 0.25],
    };
    let (meshed, certificate) = meshed(
        SPHERE,
        &Options {
            size: 0.15,
            region: Some(region),
            ..Options::default()
        },
    );
    assert_eq!(meshed.caps, ["cap.z_max"]);
    // A spherical segment of height 1.25.
    let exact = std::f64::consts::PI * 1.25f64.powi(2) * (1.0 - 1.25 / 3.0);
    assert!((certificate.surface.expect("a surface").volume / exact - 1.0).abs() < 0.02);
}

#[test]
fn the_surface_alone_is_the_boundary_of_the_tetrahedra() {
    let options = Options {
        size: 0.5,
        ..Options::default()
    };
    let (volume, _) = meshed(PART, &options);
    let (surface, _) = meshed(
        PART,
        &Options {
            surface_only: true,
            ..options
        },
    );
    assert!(surface.mesh.tets.is_empty());
    let places = |m: &Mesh| {
        let mut all: Vec<[[u64; 3]; 3]> = m
            .triangles
            .iter()
            .map(|t| t.map(|v| m.points[v as usize].map(f64::to_bits)))
            .collect();
        all.sort_unstable();
        all
    };
    assert!(places(&surface.mesh) == places(&volume.mesh));
}

#[test]
fn threads_do_not_change_the_mesh() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| {
            meshed(
                PART,
                &Options {
                    size: 0.5,
                    ..Options::default()
                },
            )
            .0
            .mesh
        })
    };
    assert!(with(1) == with(3));
}

#[test]
fn corners_lie_where_three_planes_meet() {
    // A wedge with an oblique side: the corners are where planes meet, exactly.
    let text = "m(x[3], a[1]) { m = min(min(min(x[1], x[2]), min(x[3], 1 - x[3])), 2 - x[1] - 1.5*x[2]); }";
    let (meshed, _) = meshed(
        text,
        &Options {
            size: 0.2,
            ..Options::default()
        },
    );
    let m = &meshed.mesh;
    assert_eq!(m.corners.len(), 6);
    for want in [[0.0, 0.0], [2.0, 0.0], [0.0, 4.0 / 3.0]] {
        for z in [0.0, 1.0] {
            let p = [want[0], want[1], z];
            assert!(
                m.corners
                    .iter()
                    .any(|&c| norm(sub(m.points[c as usize], p)) < 1e-13),
                "{p:?}"
            );
        }
    }
    assert!(m.tets.iter().all(|t| {
        let p = t.map(|v| m.points[v as usize]);
        dot(
            sub(p[1], p[0]),
            isoform_geom::cross(sub(p[2], p[0]), sub(p[3], p[0])),
        ) > 0.0
    }));
}

#[test]
fn bad_input_is_an_error() {
    let run = |text: &str, options: Options| {
        mesh(&solid(text), &options, &Control::default()).map(|m| m.mesh.tets.len())
    };
    let empty = "m(x[3], a[1]) { m = -1 - x[1]^2 - x[2]^2 - x[3]^2; }";
    assert!(matches!(
        run(empty, Options::default()),
        Err(MeshError::Extent(_))
    ));
    let endless = "m(x[3], a[1]) { m = 1 - x[1]^2 - x[2]^2; }";
    assert!(matches!(
        run(endless, Options::default()),
        Err(MeshError::Extent(_))
    ));
    for size in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(
            matches!(
                run(
                    SPHERE,
                    Options {
                        size,
                        ..Options::default()
                    }
                ),
                Err(MeshError::Option { name: "size", .. })
            ),
            "{size}"
        );
    }
    assert!(matches!(
        run(
            SPHERE,
            Options {
                size: 1e-5,
                ..Options::default()
            }
        ),
        Err(MeshError::Memory { .. })
    ));
    // Whatever is allowed: no machine has 100,000 TB.
    for (size, memory) in [(1e-5, u64::MAX), (1e-9, u64::MAX)] {
        let allowed = Options {
            size,
            memory,
            ..Options::default()
        };
        assert!(matches!(
            run(SPHERE, allowed),
            Err(MeshError::NoMemory { needed }) if needed > 1 << 30
        ));
    }
    let stopped = std::sync::atomic::AtomicBool::new(true);
    let control = Control {
        cancelled: Some(&stopped),
        ..Control::default()
    };
    assert_eq!(
        mesh(&solid(SPHERE), &Options::default(), &control)
            .map(|_| ())
            .unwrap_err(),
        MeshError::Stopped
    );
    assert!(solid(SPHERE).names().len() == 1);
}

#[test]
fn sizes_follow_a_wish() {
    // Half the size in the half space x > 0: eight times the tetrahedra there, about.
    let sizes = Sizes(std::sync::Arc::new(
        |p: Point3| if p[0] > 0.0 { 0.1 } else { 0.2 },
    ));
    let (meshed, _) = meshed(
        SPHERE,
        &Options {
            size: 0.2,
            sizes: Some(sizes),
            ..Options::default()
        },
    );
    let m = &meshed.mesh;
    let right = m
        .tets
        .iter()
        .filter(|t| t.iter().all(|&v| m.points[v as usize][0] > 0.0))
        .count();
    let left = m
        .tets
        .iter()
        .filter(|t| t.iter().all(|&v| m.points[v as usize][0] < 0.0))
        .count();
    assert!((4 * left..16 * left).contains(&right), "{left} {right}");
}

#[test]
fn a_mesh_off_the_model_is_brought_onto_it() {
    let (made, _) = meshed(
        PART,
        &Options {
            size: 0.4,
            ..Options::default()
        },
    );
    let mut rough = Mesh {
        points: made.mesh.points.clone(),
        tets: made.mesh.tets.clone(),
        ..Mesh::default()
    };
    // Up to an eightieth of the size by axis, in pseudo-random directions.
    let mut state = 1u64;
    for v in rough.points.iter_mut().flatten() {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        *v += 0.01 * ((state >> 33) as f64 / f64::from(1u32 << 31) - 0.5);
    }
    let solid = solid(PART);
    let better = adapt(
        &rough,
        &solid,
        &Options {
            size: mean_edge(&rough),
            ..Options::default()
        },
        &Control::default(),
    )
    .expect("a mesh");
    assert_eq!(better.warnings, []);
    let certificate = certify(
        &better.mesh,
        Some(&solid),
        &check::Options::default(),
        &Control::default(),
    );
    let failures: Vec<String> = certificate
        .failures()
        .iter()
        .map(ToString::to_string)
        .collect();
    assert!(certificate.is_ok(), "{failures:?}");
    assert_eq!(
        (better.mesh.parts.len(), better.mesh.corners.len()),
        (8, 12)
    );
    assert!(certificate.tets.expect("tetrahedra").dihedral_min > 15.0);
    // A mesh of another model is refused.
    let other = Mesh {
        points: rough
            .points
            .iter()
            .map(|p| [p[0] + 40.0, p[1], p[2]])
            .collect(),
        ..rough
    };
    assert!(matches!(
        adapt(
            &other,
            &solid,
            &Options {
                size: 0.4,
                ..Options::default()
            },
            &Control::default()
        ),
        Err(MeshError::Input { .. } | MeshError::Extent(_))
    ));
}

/// Two plates with round ends and an elbow, in poses off the lattice: the ends touch the sides
/// without an angle.
const TOUCHING: [&str; 3] = [
    "m(x[3], a[1]) {
        p = 0.6*x[1] - 0.8*x[2] - 0.3; q = 0.48*x[1] + 0.36*x[2] - 0.8*x[3];
        r = 0.64*x[1] + 0.48*x[2] + 0.6*x[3] + 0.1;
        m = (1 - r) & (r + 1) & (((3 - p) & (p + 3) & (1 - q) & (q + 1))
            | ((1 - (p - 3)^2 - q^2) | (1 - (p + 3)^2 - q^2)));
    }",
    "m(x[3], a[1]) {
        p = 0.6*x[1] - 0.8*x[2]; q = 0.8*x[1] + 0.6*x[2] + 0.05; r = x[3] - 0.123;
        m = ((1 - p^2 - q^2) & (r + 2) & (2 - r))
            | ((1 - p^2 - q^2 - (r - 2)^2) | (1 - p^2 - q^2 - (r + 2)^2));
    }",
    "m(x[3], a[1]) {
        p = 0.96*x[1] - 0.28*x[2]; q = 0.28*x[1] + 0.96*x[2]; r = x[3] + 0.04;
        ring = 0.36 - (sqrt(p^2 + q^2) - 2)^2 - r^2;
        m = (ring & p & q) | ((0.36 - (p - 2)^2 - r^2) & (0 - q) & (q + 2))
            | ((0.36 - (q - 2)^2 - r^2) & (0 - p) & (p + 2));
    }",
];

/// A box of half sizes 1.4, 1.3 and 1.2 whose edges are rounded by 0.5, in a pose off the lattice:
/// blocks, cylinders and balls that touch along 48 arcs and lines.
fn rounded_box() -> String {
    let (h, r2) = ([0.9, 0.8, 0.7], 0.25);
    let names = ["p", "q", "w"];
    let slab = |k: usize, e: f64| format!("({e} - {n}) & ({e} + {n})", n = names[k]);
    let off = |k: usize, s: f64| format!("({} - {})^2", names[k], s * h[k]);
    let mut pieces = Vec::new();
    for k in 0..3 {
        let reach = |j: usize| h[j] + if j == k { 0.5 } else { 0.0 };
        let block: Vec<String> = (0..3).map(|j| slab(j, reach(j))).collect();
        pieces.push(block.join(" & "));
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        for (s, t) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let round = format!("({r2} - {} - {})", off(i, s), off(j, t));
            pieces.push(format!("{round} & {}", slab(k, h[k])));
            if k == 0 {
                let ball = |u: f64| format!("{r2} - {} - {} - {}", off(0, u), off(i, s), off(j, t));
                pieces.extend([ball(1.0), ball(-1.0)]);
            }
        }
    }
    format!(
        "m(x[3], a[1]) {{
            p = 0.6*x[1] - 0.8*x[2] - 0.1; q = 0.48*x[1] + 0.36*x[2] - 0.8*x[3];
            w = 0.64*x[1] + 0.48*x[2] + 0.6*x[3] + 0.1;
            m = ({});
        }}",
        pieces.join(") | (")
    )
}

/// Seams about a size apart leave vertices off the surface, which is meshed finer there. The volume
/// is that of the closed form but for the chords of triangles, some h²/(4 r) of the round part.
#[test]
fn a_rounded_box_is_certified_at_sizes_near_its_radius() {
    check_rounded_box(0.3, 0.02);
}

/// Where radii are smaller than the size, cells follow them, and seams are seen by those cells.
#[test]
fn a_rounded_box_is_certified_at_sizes_above_its_radius() {
    check_rounded_box(0.9, 0.05);
}

/// Checks that the certificate holds at a size, and bounds the missing volume.
fn check_rounded_box(size: f64, least: f64) {
    use std::f64::consts::PI;
    let options = Options {
        size,
        ..Options::default()
    };
    let (_, certificate) = meshed(&rounded_box(), &options);
    let (h, r) = ([0.9, 0.8, 0.7], 0.5);
    let faces = h[0] * h[1] + h[1] * h[2] + h[2] * h[0];
    let bars: f64 = h.iter().sum();
    let volume = 8.0 * (h[0] * h[1] * h[2] + r * faces)
        + 2.0 * PI * r * r * bars
        + 4.0 / 3.0 * PI * r.powi(3);
    let off = certificate.surface.expect("a surface").volume / volume - 1.0;
    assert!((-least..0.0).contains(&off), "{off}");
}

/// A node between faces of two parts lies on both, and the middle of an edge between them as well:
/// that is on the piece of the tree that separates them, since the two alone say it to half the
/// digits. The volume of the flat tetrahedra is that in closed form but for the
/// chords, some h²/(4 r²) of it.
#[test]
fn parts_that_touch_have_nodes_where_they_do() {
    use std::f64::consts::PI;
    let volumes = [
        2.0 * (6.0 * 2.0 + PI),
        PI * 4.0 + 4.0 / 3.0 * PI,
        PI * 0.36 * (PI + 4.0),
    ];
    for (text, volume) in TOUCHING.into_iter().zip(volumes) {
        let solid = solid(text);
        let options = Options {
            size: 0.23,
            order: 2,
            ..Options::default()
        };
        let (meshed, certificate) = meshed(text, &options);
        let mesh = &meshed.mesh;
        let mut on: Vec<Vec<u32>> = vec![Vec::new(); mesh.points.len()];
        for (k, &part) in mesh.triangle_parts.iter().enumerate() {
            for v in mesh.triangles[k].into_iter().chain(mesh.triangle_mids[k]) {
                on[v as usize].push(part);
            }
        }
        let names = solid.names();
        let mut between = 0;
        for (p, parts) in mesh.points.iter().zip(&on) {
            between += usize::from(parts.iter().any(|k| *k != parts[0]));
            for &part in parts {
                let piece = names.iter().position(|n| *n == mesh.parts[part as usize]);
                let (v, g) = solid.gradient(piece.expect("a part") as u32, *p);
                assert!(
                    v.abs() <= 1e-11 * norm(g),
                    "{p:?} is {v:e} off {}",
                    mesh.parts[part as usize]
                );
            }
        }
        assert!(between > 40, "{between} nodes between parts");
        let found = certificate.volume.map_or(0.0, |v| v.volume);
        assert!((found / volume - 1.0).abs() < 4e-2, "{found} and {volume}");
    }
}

/// Tips of cones and of drilled holes have a node, whose distance to the tip is rounding.
#[test]
fn tips_of_cones_have_a_node() {
    let tip = [0.013, -0.021, 0.037];
    // Half of the angle of a cone: a drill's, and narrower ones.
    for (degrees, size) in [(59.0f64, 0.07), (45.0, 0.11), (30.0, 0.09)] {
        let slope = degrees.to_radians().tan();
        let [x, y, z] = tip;
        let below = format!(
            "m(x[3], a[1]) {{ array d[3], v[3]; d = [{x}, {y}, {z}]; v = [-1, -1, -0.5];
                cone = min(hfConeZ(x, d, {slope}), {z} - x[3]);"
        );
        let cone = format!("{below} m = min(cone, x[3] + 0.7); }}");
        // From below into a block: the tip of the hole points up.
        let hole = format!("{below} m = hfBlock(x, v, 2, 2, 1.1) \\ cone; }}");
        for text in [cone, hole] {
            let options = Options {
                size,
                ..Options::default()
            };
            let (meshed, _) = meshed(&text, &options);
            let mesh = &meshed.mesh;
            let is_tip = |v: &&u32| norm(sub(mesh.points[**v as usize], tip)) < 1e-9;
            let found = mesh.corners.iter().filter(is_tip).count();
            assert_eq!(found, 1, "{degrees} degrees: {text}");
        }
    }
}

/// A mesh that meets itself, where blended edges are much sharper than the size, is made once more,
/// finer there. Edges of the lattice that cut such an edge off hide nothing.
#[test]
fn what_meets_itself_is_meshed_finer_there() {
    let text = "m(x[3], a[1]) {
        array o[3], q[3];
        o = [-3, -2, 0];
        body = hfBlendUni(hfBlock(x, o, 6, 4, 0.8), hfBlock(x, o, 0.8, 4, 4), 0.4, 0.6, 0.6);
        o = [1.5, 1, 0]; q = [1.5, -1, 0];
        m = (body \\ hfCylinderZ(x, o, 0.4)) \\ hfCylinderZ(x, q, 0.4);
    }";
    for size in [0.4, 0.21].into_iter().take(isoform_testdata::cases(2, 1)) {
        let options = Options {
            size,
            ..Options::default()
        };
        meshed(text, &options);
    }
}

/// The end of a narrow cone that the lattice loses in between is a valid body of its own: a warning
/// reports that the cone is in two pieces, or it is mended. Two balls with a narrow gap are two.
#[test]
fn what_hangs_together_is_not_in_pieces_without_a_word() {
    let cone = "m(x[3], a[1]) { array p[3], d[3]; p[1] = x[1]; p[2] = x[2]; p[3] = x[3];
        t = hfShift3D(p, 0.245342, -0.189202, -0.0258854); t = hfRotate3DX(p, 1.45813);
        t = hfRotate3DY(p, 0.83664); t = hfRotate3DZ(p, 4.35485); d = [0, 0, 0];
        m = min(min(hfConeZ(p, d, 0.16925), 0 - p[3]), p[3] + 1); }";
    for size in [0.04, 0.06, 0.08, 0.1, 0.11532431] {
        let options = Options {
            size,
            ..Options::default()
        };
        let solid = solid(cone);
        let meshed = mesh(&solid, &options, &Control::default()).expect("a mesh");
        let checks = check::Options::default();
        let certificate = certify(&meshed.mesh, Some(&solid), &checks, &Control::default());
        let surface = certificate.surface.expect("a surface");
        let is_told = meshed.warnings.iter().any(|w| w.kind == WarningKind::Torn);
        assert_eq!(is_told, surface.components > 1, "size {size}");
    }
    let balls = "m(x[3], a[1]) { array p[3], q[3]; p = [0, 0, 0]; q = [2.02, 0.1, 0.2];
        m = hfSphere(x, p, 1) | hfSphere(x, q, 1); }";
    let options = Options {
        size: 0.12,
        ..Options::default()
    };
    let (_, certificate) = meshed(balls, &options);
    assert_eq!(certificate.surface.expect("a surface").components, 2);
}
