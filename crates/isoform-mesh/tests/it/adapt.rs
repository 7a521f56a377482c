//! Meshes from elsewhere brought onto the model: surfaces and tetrahedra.

use crate::common::{PART, SPHERE, solid};
use isoform_check::quality::six_volume;
use isoform_check::{self as check, Certificate, certify};
use isoform_geom::{Mesh, Point3, TRIANGLE_EDGES, norm, sub};
use isoform_mesh::{Control, MeshError, Meshed, Options, adapt, mean_edge, mesh, own_sizes};
use std::collections::HashMap;

const CUBE: &str = "m(x[3], a[1]) { array c[3]; c = [-1, -1, -1]; m = hfBlock(x, c, 2, 2, 2); }";

/// Pseudo-random numbers in [−1, 1].
fn random() -> impl FnMut() -> f64 {
    let mut state = 1u64;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        2.0 * (state >> 33) as f64 / f64::from(1u32 << 31) - 1.0
    }
}

/// Returns a regular icosahedron whose faces are split in four `times` times, on the unit sphere.
fn icosphere(times: usize) -> Mesh {
    let t = 0.5 * (1.0 + 5f64.sqrt());
    let mut points: Vec<Point3> = Vec::new();
    for s in [-1.0, 1.0] {
        for u in [-t, t] {
            points.extend([[s, u, 0.0], [0.0, s, u], [u, 0.0, s]]);
        }
    }
    let near = |p: Point3, q: Point3| (norm(sub(p, q)) - 2.0).abs() < 1e-9;
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [a, b, c].map(|v| points[v]);
                if near(p, q) && near(q, r) && near(r, p) {
                    let n = isoform_geom::cross(sub(q, p), sub(r, p));
                    let f = [a as u32, b as u32, c as u32];
                    faces.push(if isoform_geom::dot(n, p) > 0.0 {
                        f
                    } else {
                        [f[0], f[2], f[1]]
                    });
                }
            }
        }
    }
    let unit = |p: Point3| p.map(|x| x / norm(p));
    points.iter_mut().for_each(|p| *p = unit(*p));
    for _ in 0..times {
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let mut finer = Vec::new();
        for f in faces {
            let m = [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]].map(|[a, b]| {
                *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                    let (p, q) = (points[a as usize], points[b as usize]);
                    points.push(unit(std::array::from_fn(|i| 0.5 * (p[i] + q[i]))));
                    points.len() as u32 - 1
                })
            });
            finer.extend([
                [f[0], m[0], m[2]],
                [m[0], f[1], m[1]],
                [m[2], m[1], f[2]],
                m,
            ]);
        }
        faces = finer;
    }
    Mesh::from_triangles(points, faces)
}

/// Returns the faces of the cube from −1 to 1 as n × n squares of two triangles each.
fn grid_cube(n: usize) -> Mesh {
    let mut known: HashMap<[usize; 3], u32> = HashMap::new();
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for side in [0, n] {
            for i in 0..n {
                for j in 0..n {
                    let mut corner = |di: usize, dj: usize| {
                        let mut k = [0; 3];
                        (k[axis], k[(axis + 1) % 3], k[(axis + 2) % 3]) = (side, i + di, j + dj);
                        *known.entry(k).or_insert_with(|| {
                            mesh.points.push(k.map(|v| 2.0 * v as f64 / n as f64 - 1.0));
                            mesh.points.len() as u32 - 1
                        })
                    };
                    let q = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    let two = [[q[0], q[1], q[2]], [q[0], q[2], q[3]]];
                    mesh.triangles
                        .extend(two.map(|f| if side == n { f } else { [f[0], f[2], f[1]] }));
                }
            }
        }
    }
    mesh
}

fn turned(mesh: &Mesh, angle: f64) -> Mesh {
    let (s, c) = angle.sin_cos();
    let turn = |p: Point3| {
        let [x, y, z] = [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]];
        [x, c * y - s * z, s * y + c * z]
    };
    Mesh {
        points: mesh.points.iter().map(|p| turn(*p)).collect(),
        ..mesh.clone()
    }
}

fn bare(mesh: &Mesh) -> Mesh {
    Mesh::from_triangles(mesh.points.clone(), mesh.triangles.clone())
}

fn options(size: f64) -> Options {
    Options {
        size,
        ..Options::default()
    }
}

/// Adapts a mesh and certifies the result with the model's curves and corners.
fn adapted(text: &str, given: &Mesh, options: &Options) -> (Meshed, Certificate) {
    let solid = solid(text);
    let made = adapt(given, &solid, options, &Control::default()).expect("a mesh");
    assert!(
        made.warnings.is_empty(),
        "{} warnings: {:?}",
        made.warnings.len(),
        &made.warnings[..3.min(made.warnings.len())]
    );
    let curves: Vec<Vec<Point3>> = made
        .features
        .curves
        .iter()
        .map(|c| c.points.clone())
        .collect();
    let corners: Vec<Point3> = made.features.corners.iter().map(|c| c.point).collect();
    let checks = check::Options {
        curves: &curves,
        corners: &corners,
        size: Some(options.size),
        ..check::Options::default()
    };
    let certificate = certify(&made.mesh, Some(&solid), &checks, &Control::default());
    let failures: Vec<String> = certificate
        .failures()
        .iter()
        .map(ToString::to_string)
        .collect();
    assert!(
        certificate.is_ok(),
        "{:?}",
        failures
            .iter()
            .map(|f| f.chars().take(200).collect::<String>())
            .collect::<Vec<_>>()
    );
    (made, certificate)
}

fn smallest_angle(mesh: &Mesh) -> f64 {
    let bare = bare(mesh);
    certify(&bare, None, &check::Options::default(), &Control::default())
        .triangles
        .expect("triangles")
        .angle_min
}

fn refused(text: &str, given: &Mesh) -> String {
    match adapt(
        given,
        &solid(text),
        &options(mean_edge(given)),
        &Control::default(),
    ) {
        Err(MeshError::Input { why }) => why,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_rough_sphere_comes_back() {
    let mut rough = icosphere(4);
    let mut random = random();
    rough
        .points
        .iter_mut()
        .flatten()
        .for_each(|x| *x += 0.02 * random());
    // And out by a twentieth, so that every vertex is off.
    rough.points.iter_mut().flatten().for_each(|x| *x *= 1.05);
    let (made, certificate) = adapted(SPHERE, &rough, &options(mean_edge(&rough)));
    let off = made
        .mesh
        .points
        .iter()
        .map(|p| (norm(*p) - 1.0).abs())
        .fold(0.0, f64::max);
    assert!(off < 1e-12, "{off}");
    assert_eq!(certificate.surface.expect("a surface").euler, 2);
    let (before, after) = (smallest_angle(&rough), smallest_angle(&made.mesh));
    assert!(after > 30.0 && after > before, "{before} to {after}");
}

#[test]
fn edges_of_a_cube_are_kept_and_found_again() {
    let aligned = grid_cube(8);
    let mut rough = aligned.clone();
    let mut random = random();
    rough
        .points
        .iter_mut()
        .flatten()
        .for_each(|x| *x += 0.05 * 0.25 * random());
    for given in [&aligned, &rough] {
        for size in [0.25, 0.15, 0.5] {
            let (made, certificate) = adapted(CUBE, given, &options(size));
            assert_eq!(
                (
                    made.mesh.curves.len(),
                    made.mesh.corners.len(),
                    made.mesh.parts.len()
                ),
                (12, 8, 6)
            );
            let surface = certificate.surface.expect("a surface");
            assert!(
                surface.euler == 2 && (surface.volume - 8.0).abs() < 1e-12,
                "{}",
                surface.volume
            );
            assert!(
                smallest_angle(&made.mesh) > 28.0,
                "{}",
                smallest_angle(&made.mesh)
            );
            let mean = mean_edge(&made.mesh);
            assert!((0.7..1.3).contains(&(mean / size)), "{mean} for {size}");
        }
    }
}

/// The edges of the given mesh do not run along those of the cube.
#[test]
fn a_sphere_becomes_a_cube() {
    let mut round = icosphere(4);
    // Pressed against the faces of the cube, with round edges.
    for p in &mut round.points {
        let m = p.iter().map(|x| x.powi(6)).sum::<f64>().powf(1.0 / 6.0);
        *p = p.map(|x| x / m);
    }
    let given = turned(&round, 0.0);
    let (made, certificate) = adapted(CUBE, &given, &options(mean_edge(&given)));
    assert_eq!(
        (
            made.mesh.curves.len(),
            made.mesh.corners.len(),
            made.mesh.parts.len()
        ),
        (12, 8, 6)
    );
    assert!((certificate.surface.expect("a surface").volume - 8.0).abs() < 1e-12);
    assert!(
        smallest_angle(&made.mesh) > 20.0,
        "{}",
        smallest_angle(&made.mesh)
    );
}

#[test]
fn the_part_at_another_size_from_its_own_surface_in_single_precision() {
    let solid = solid(PART);
    let first = mesh(
        &solid,
        &Options {
            size: 0.5,
            surface_only: true,
            ..Options::default()
        },
        &Control::default(),
    )
    .expect("a mesh");
    let mut given = bare(&first.mesh);
    given
        .points
        .iter_mut()
        .flatten()
        .for_each(|x| *x = f64::from(*x as f32));
    for size in [0.3, 0.5, 0.8] {
        let (made, certificate) = adapted(PART, &given, &options(size));
        assert_eq!(
            (
                made.mesh.parts.len(),
                made.mesh.corners.len(),
                made.features.curves.len()
            ),
            (8, 12, 20)
        );
        assert_eq!(certificate.surface.expect("a surface").euler, 0);
        assert!(
            smallest_angle(&made.mesh) > 25.0,
            "{}",
            smallest_angle(&made.mesh)
        );
    }
    // Its own sizes keep the number of triangles.
    let own = Options {
        size: 1.0,
        sizes: Some(own_sizes(&given)),
        ..Options::default()
    };
    let (made, _) = adapted(PART, &given, &own);
    let share = made.mesh.triangles.len() as f64 / given.triangles.len() as f64;
    assert!((0.6..1.6).contains(&share), "{share}");
}

#[test]
fn second_order_and_chordal_errors() {
    let (made, certificate) = adapted(
        SPHERE,
        &icosphere(2),
        &Options {
            size: 0.4,
            grade: Some(0.005),
            order: 2,
            ..Options::default()
        },
    );
    assert_eq!(made.mesh.order(), 2);
    let (off, said) = (
        curved_off_sphere(&made.mesh),
        certificate.deviation.expect("distances").faces.max,
    );
    assert!(off < 0.005 && said <= 1.01 * off, "{off} {said}");
    let (flat, certificate) = adapted(
        SPHERE,
        &icosphere(2),
        &Options {
            size: 0.4,
            grade: Some(0.005),
            ..Options::default()
        },
    );
    let (off, said) = (
        flat_off_sphere(&flat.mesh),
        certificate.deviation.expect("distances").faces.max,
    );
    assert!(off < 0.005 && said <= 1.000_001 * off, "{off} {said}");
}

/// Returns the largest depth of flat triangles with corners on the unit sphere: where all angles
/// are acute their nearest point to the centre is the circumcentre, else the midpoint of the
/// longest edge.
fn flat_off_sphere(mesh: &Mesh) -> f64 {
    let depth = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.points[v as usize]);
        let mut edges = [sub(b, a), sub(c, b), sub(a, c)].map(norm);
        edges.sort_by(f64::total_cmp);
        let [short, middle, long] = edges;
        let nearest = if short * short + middle * middle > long * long {
            let n = isoform_geom::cross(sub(b, a), sub(c, a));
            isoform_geom::dot(a, n).abs() / norm(n)
        } else {
            (1.0 - 0.25 * long * long).sqrt()
        };
        1.0 - nearest
    };
    mesh.triangles.iter().map(depth).fold(0.0, f64::max)
}

/// Returns the largest distance of triangles of second order from the unit sphere, from many
/// samples of each.
fn curved_off_sphere(mesh: &Mesh) -> f64 {
    const N: usize = 12;
    let mut worst: f64 = 0.0;
    for (corners, middles) in mesh.triangles.iter().zip(&mesh.triangle_mids) {
        let nodes: Vec<Point3> = corners
            .iter()
            .chain(middles)
            .map(|v| mesh.points[*v as usize])
            .collect();
        for i in 0..=N {
            for j in 0..=N - i {
                let l = [i, j, N - i - j].map(|k| k as f64 / N as f64);
                // Lagrange's polynomials: at the corners, then at the middles in TRIANGLE_EDGES.
                let shape: Vec<f64> = l
                    .iter()
                    .map(|x| x * (2.0 * x - 1.0))
                    .chain(TRIANGLE_EDGES.map(|[a, b]| 4.0 * l[a] * l[b]))
                    .collect();
                let p: Point3 = std::array::from_fn(|k| {
                    shape.iter().zip(&nodes).map(|(s, node)| s * node[k]).sum()
                });
                worst = worst.max((norm(p) - 1.0).abs());
            }
        }
    }
    worst
}

#[test]
fn bad_surfaces_are_refused_with_a_place() {
    let ball = icosphere(2);
    let mut open = ball.clone();
    open.triangles.pop();
    assert!(refused(SPHERE, &open).contains("not closed"));
    let mut turned_over = ball.clone();
    turned_over.triangles[0].swap(0, 1);
    assert!(refused(SPHERE, &turned_over).contains("not oriented"));
    let mut crossing = ball.clone();
    crossing.points[0] = crossing.points[0].map(|x| -1.5 * x);
    assert!(refused(SPHERE, &crossing).contains("intersects itself at ("));
    let inside_out = Mesh {
        triangles: ball.triangles.iter().map(|f| [f[0], f[2], f[1]]).collect(),
        ..ball.clone()
    };
    assert!(refused(SPHERE, &inside_out).contains("inside out"));
    assert!(
        refused(PART, &ball).contains("near"),
        "{}",
        refused(PART, &ball)
    );
    let far = Mesh {
        points: ball
            .points
            .iter()
            .map(|p| [p[0] + 40.0, p[1], p[2]])
            .collect(),
        ..ball.clone()
    };
    assert!(refused(SPHERE, &far).contains("near"));
    // One of two balls.
    let two = "m(x[3], a[1]) { array c[3], d[3]; c = [0, 0, 0]; d = [3, 0, 0]; m = hfSphere(x, c, 1) | hfSphere(x, d, 1); }";
    assert!(
        refused(two, &ball).contains("leaves out"),
        "{}",
        refused(two, &ball)
    );
    let nothing = adapt(
        &Mesh::default(),
        &solid(SPHERE),
        &options(0.1),
        &Control::default(),
    );
    assert!(
        matches!(nothing, Err(MeshError::Input { .. })),
        "{nothing:?}"
    );
}

/// Tetrahedra of the cube on a rotated lattice: none of their edges is an edge of the cube.
#[test]
fn tetrahedra_whose_edges_miss_those_of_the_model() {
    let round = "m(x[3], a[1]) { m = 1 - (x[1]^6 + x[2]^6 + x[3]^6)^(1/6); }";
    let first = mesh(
        &solid(round),
        &Options {
            size: 0.25,
            ..Options::default()
        },
        &Control::default(),
    )
    .expect("a mesh");
    let given = Mesh {
        points: first.mesh.points.clone(),
        tets: first.mesh.tets.clone(),
        ..Mesh::default()
    };
    let (made, certificate) = adapted(CUBE, &given, &options(mean_edge(&given)));
    assert_eq!(
        (
            made.mesh.curves.len(),
            made.mesh.corners.len(),
            made.mesh.parts.len()
        ),
        (12, 8, 6)
    );
    let tets = certificate.tets.expect("tetrahedra");
    assert!((certificate.surface.expect("a surface").volume - 8.0).abs() < 1e-12);
    assert!(tets.dihedral_min > 10.0, "{}", tets.dihedral_min);
}

/// A mesh with errors of up to a twentieth of the edge length in every coordinate: often the face
/// of a neighbour is the nearest.
#[test]
fn tetrahedra_with_rough_edges() {
    let first = mesh(
        &solid(PART),
        &Options {
            size: 0.5,
            ..Options::default()
        },
        &Control::default(),
    )
    .expect("a mesh");
    let mut given = Mesh {
        points: first.mesh.points.clone(),
        tets: first.mesh.tets.clone(),
        ..Mesh::default()
    };
    let mut random = random();
    given
        .points
        .iter_mut()
        .flatten()
        .for_each(|x| *x += 0.025 * random());
    // Not where that would turn a tetrahedron over: such meshes are refused.
    let volume = |points: &[Point3], t: [u32; 4]| six_volume(t.map(|v| points[v as usize]));
    while let Some(&t) = given
        .tets
        .iter()
        .find(|t| volume(&given.points, **t) < 0.2 * volume(&first.mesh.points, **t))
    {
        t.iter()
            .for_each(|&v| given.points[v as usize] = first.mesh.points[v as usize]);
    }
    let (made, certificate) = adapted(PART, &given, &options(mean_edge(&given)));
    assert_eq!((made.mesh.parts.len(), made.mesh.corners.len()), (8, 12));
    assert!(certificate.tets.expect("tetrahedra").dihedral_min > 12.0);
}
