//! Known meshes, and the defects that must be found in them.

mod solids;

use super::*;
use proptest::prelude::*;
use std::sync::atomic::AtomicBool;

fn look(mesh: &Mesh) -> Certificate {
    certify(mesh, None, &Options::default(), &Control::default())
}

fn codes(c: &Certificate) -> Vec<(&'static str, usize)> {
    c.failures().iter().map(|f| (f.code, f.count)).collect()
}

fn surface(mesh: &Mesh) -> Surface {
    look(mesh).surface.expect("a surface")
}

/// A cube of edge 1 at `o`, its nodes numbered by bits from the lowest corner.
fn cube(o: Point3) -> Mesh {
    let points = (0..8)
        .map(|k| std::array::from_fn(|i| o[i] + f64::from(k >> i & 1)))
        .collect();
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    Mesh::from_triangles(
        points,
        quads
            .iter()
            .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
            .collect(),
    )
}

/// Returns both meshes, with coincident nodes merged.
fn welded(a: &Mesh, b: &Mesh) -> Mesh {
    let mut mesh = a.clone();
    let new: Vec<u32> = b
        .points
        .iter()
        .map(|p| {
            mesh.points.iter().position(|q| q == p).unwrap_or_else(|| {
                mesh.points.push(*p);
                mesh.points.len() - 1
            }) as u32
        })
        .collect();
    mesh.triangles
        .extend(b.triangles.iter().map(|t| t.map(|i| new[i as usize])));
    mesh
}

/// Both meshes without a common node.
fn beside(a: &Mesh, b: &Mesh) -> Mesh {
    let mut mesh = a.clone();
    let offset = a.points.len() as u32;
    mesh.points.extend(&b.points);
    mesh.triangles
        .extend(b.triangles.iter().map(|t| t.map(|i| i + offset)));
    mesh
}

fn inside_out(mesh: &Mesh) -> Mesh {
    Mesh::from_triangles(
        mesh.points.clone(),
        mesh.triangles.iter().map(|t| [t[0], t[2], t[1]]).collect(),
    )
}

/// A torus of radii 3 and 1, by a grid of n × n quadrilaterals.
fn torus(n: u32) -> Mesh {
    let angle = |k: u32| f64::from(k) * std::f64::consts::TAU / f64::from(n);
    let point = |k: u32| {
        let ((s, c), (t, d)) = (angle(k / n).sin_cos(), angle(k % n).sin_cos());
        [(3.0 + d) * c, (3.0 + d) * s, t]
    };
    let at = |i: u32, j: u32| i % n * n + j % n;
    let quads = (0..n * n).flat_map(|k| {
        let (i, j) = (k / n, k % n);
        [
            [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
            [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
        ]
    });
    Mesh::from_triangles((0..n * n).map(point).collect(), quads.collect())
}

/// An n × n × n grid of cubes of edge 1 cut into six tetrahedra each along the diagonals, with its
/// boundary.
fn block(n: u32) -> Mesh {
    let m = n + 1;
    let at = |p: [u32; 3]| (p[2] * m + p[1]) * m + p[0];
    let points = (0..m * m * m)
        .map(|k| {
            [
                f64::from(k % m),
                f64::from(k / m % m),
                f64::from(k / (m * m)),
            ]
        })
        .collect();
    let mut mesh = Mesh {
        points,
        ..Mesh::default()
    };
    for k in 0..n * n * n {
        let o = [k % n, k / n % n, k / (n * n)];
        for [a, b, c] in [
            [0, 1, 2],
            [1, 2, 0],
            [2, 0, 1],
            [1, 0, 2],
            [2, 1, 0],
            [0, 2, 1],
        ] {
            let (mut p, mut q) = (o, o);
            p[a] += 1;
            q[a] += 1;
            q[b] += 1;
            let far = o.map(|v| v + 1);
            // The first three orders are even permutations of the axes, the others odd.
            let even = (b + 3 - a) % 3 == 1 && c == (b + 1) % 3;
            let (p, q) = (at(p), at(q));
            mesh.tets.push(if even {
                [at(o), p, q, at(far)]
            } else {
                [at(o), q, p, at(far)]
            });
        }
    }
    mesh.triangles = volume::examine(&mesh, &Options::default()).1;
    mesh
}

#[test]
fn a_cube() {
    let c = look(&cube([0.0; 3]));
    assert!(
        c.is_ok() && c.complete && c.volume.is_none() && c.tets.is_none() && c.deviation.is_none(),
        "{:?}",
        c.failures()
    );
    let s = c.surface.expect("a surface");
    assert_eq!(
        (
            s.nodes,
            s.edges,
            s.triangles,
            s.euler,
            s.shells,
            s.components
        ),
        (8, 18, 12, 2, 1, 1)
    );
    assert_eq!((s.largest[0].genus, s.volume, s.area), (Some(0), 1.0, 6.0));
    assert_eq!(c.triangles.map(|t| t.angle_min.round()), Some(45.0));
}

#[test]
fn a_torus_has_one_handle() {
    let mesh = torus(12);
    let c = look(&mesh);
    assert!(c.is_ok(), "{:?}", c.failures());
    let s = c.surface.expect("a surface");
    assert_eq!((s.euler, s.components, s.largest[0].genus), (0, 1, Some(1)));
    let smooth = 2.0 * std::f64::consts::PI.powi(2) * 3.0;
    assert!(s.volume < smooth && s.volume > 0.8 * smooth);
}

#[test]
fn a_missing_triangle_leaves_open_edges() {
    let mut mesh = cube([0.0; 3]);
    mesh.triangles.remove(0);
    let c = look(&mesh);
    assert_eq!(codes(&c), [("open-edge", 3)]);
    let s = c.surface.expect("a surface");
    assert_eq!((s.euler, s.largest[0].genus), (1, None));
    assert_eq!(
        s.open_edges
            .places
            .iter()
            .map(|p| p.nodes.clone())
            .collect::<Vec<_>>(),
        [vec![0, 2], vec![0, 3], vec![2, 3]]
    );
    assert_eq!(s.open_edges.places[0].at, [0.0, 0.5, 0.0]);
}

#[test]
fn a_flipped_triangle_is_misoriented() {
    let mut mesh = cube([0.0; 3]);
    mesh.triangles[4].swap(0, 1);
    assert_eq!(codes(&look(&mesh)), [("misoriented-edge", 3)]);
}

/// Seven triangles in a band with half a twist.
#[test]
fn a_moebius_band_has_no_orientation() {
    let angle = |k: u32| f64::from(k) * std::f64::consts::PI / 7.0;
    let points = (0..7)
        .map(|k| {
            [
                (2.0 * angle(2 * k)).cos(),
                (2.0 * angle(2 * k)).sin(),
                f64::from(k) * 0.1,
            ]
        })
        .collect();
    let mesh = Mesh::from_triangles(
        points,
        (0..7)
            .map(|k| {
                if k % 2 == 0 {
                    [k, k + 1, k + 2]
                } else {
                    [k + 1, k, k + 2]
                }
            })
            .map(|t| t.map(|i| i % 7))
            .collect(),
    );
    let s = surface(&mesh);
    assert_eq!(
        (
            s.open_edges.count,
            s.misoriented_edges.count,
            s.euler,
            s.pinched_nodes.count
        ),
        (7, 1, 0, 0)
    );
    assert_eq!(s.misplaced_shells.count, 0);
}

#[test]
fn two_cubes_at_an_edge() {
    let c = look(&welded(&cube([0.0; 3]), &cube([1.0, 1.0, 0.0])));
    assert_eq!(codes(&c), [("crowded-edge", 1), ("pinched-node", 2)]);
    let s = c.surface.expect("a surface");
    assert_eq!(
        (
            s.shells,
            s.crowded_edges.places[0].at,
            s.crowded_edges.places[0].elements.len()
        ),
        (1, [1.0, 1.0, 0.5], 4)
    );
}

/// Three triangles at one edge, like pages of a book, are not connected across it.
#[test]
fn three_triangles_at_an_edge() {
    let points = vec![
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0],
        [-1.0, 1.0, 0.0],
        [-1.0, -1.0, 0.0],
    ];
    let s = surface(&Mesh::from_triangles(
        points,
        vec![[0, 1, 2], [0, 1, 3], [1, 0, 4]],
    ));
    assert_eq!(
        (
            s.crowded_edges.count,
            s.open_edges.count,
            s.misoriented_edges.count
        ),
        (1, 6, 0)
    );
    assert_eq!(
        s.pinched_nodes
            .places
            .iter()
            .map(|p| p.value)
            .collect::<Vec<_>>(),
        [3.0, 3.0]
    );
}

#[test]
fn two_cubes_at_a_node() {
    let c = look(&welded(&cube([0.0; 3]), &cube([1.0; 3])));
    assert_eq!(codes(&c), [("pinched-node", 1)]);
    assert_eq!(
        c.surface.expect("a surface").pinched_nodes.places[0].at,
        [1.0; 3]
    );
}

/// Coincident nodes with different indices touch.
#[test]
fn two_cubes_that_touch() {
    for (at, pairs) in [([1.0; 3], 1), ([1.0, 0.25, 0.25], 1), ([3.0, 0.0, 0.0], 0)] {
        let found = look(&beside(&cube([0.0; 3]), &cube(at)))
            .intersections
            .expect("a surface")
            .pairs
            .count;
        assert!(
            (found >= pairs) && (found == 0) == (pairs == 0),
            "{at:?}: {found}"
        );
    }
}

#[test]
fn a_cube_in_a_cube() {
    let small = Mesh {
        points: cube([0.0; 3])
            .points
            .iter()
            .map(|p| p.map(|v| 0.25 + 0.5 * v))
            .collect(),
        ..cube([0.0; 3])
    };
    let cavity = look(&beside(&cube([0.0; 3]), &inside_out(&small)));
    assert!(cavity.is_ok(), "{:?}", cavity.failures());
    let s = cavity.surface.expect("a surface");
    assert_eq!(
        (s.shells, s.components, s.euler, s.volume),
        (2, 1, 4, 0.875)
    );
    assert_eq!(
        s.largest
            .iter()
            .map(|shell| shell.volume)
            .collect::<Vec<_>>(),
        [1.0, -0.125]
    );

    let twice = look(&beside(&cube([0.0; 3]), &small));
    assert_eq!(codes(&twice), [("misplaced-shell", 1)]);
    assert_eq!(
        twice.surface.expect("a surface").misplaced_shells.places[0].value,
        1.0
    );
    assert_eq!(codes(&look(&inside_out(&small))), [("misplaced-shell", 1)]);
    // A cube in the cavity again is a component.
    let core = Mesh {
        points: small
            .points
            .iter()
            .map(|p| p.map(|v| 0.25 + 0.5 * v))
            .collect(),
        ..small.clone()
    };
    let three = look(&beside(
        &beside(&cube([0.0; 3]), &inside_out(&small)),
        &core,
    ));
    assert!(three.is_ok() && three.surface.is_some_and(|s| s.components == 2));
}

#[test]
fn repeated_degenerate_and_flat_triangles() {
    let mut mesh = cube([0.0; 3]);
    mesh.triangles.push([2, 3, 0]);
    mesh.triangles.push([5, 5, 6]);
    mesh.points.push([0.5, 0.0, 0.0]);
    mesh.triangles.push([0, 8, 1]);
    let c = look(&mesh);
    let s = c.surface.as_ref().expect("a surface");
    assert_eq!(
        (
            s.repeated_triangles.count,
            s.degenerate_triangles.count,
            s.flat_triangles.count
        ),
        (1, 1, 1)
    );
    assert_eq!(s.repeated_triangles.places[0].elements, [0, 12]);
    assert!(!c.is_ok() && c.intersections.is_some_and(|i| i.pairs.is_empty()));
}

#[test]
fn a_block_of_tetrahedra() {
    let c = look(&block(3));
    assert!(c.is_ok(), "{:?}", c.failures());
    let (v, s) = (c.volume.expect("tets"), c.surface.expect("a surface"));
    assert_eq!(
        (
            v.tets,
            v.nodes,
            v.volume,
            v.size_ratio,
            s.volume,
            s.area,
            s.euler
        ),
        (162, 64, 27.0, 1.0, 27.0, 54.0, 2)
    );
    // Euler: nodes − edges + faces − tetrahedra = 1 for a ball.
    assert_eq!(v.nodes + v.faces, 1 + v.edges + v.tets);
    let q = c.tets.expect("tets");
    assert!((q.dihedral_min - 45.0).abs() < 1e-12 && (q.dihedral_max - 90.0).abs() < 1e-12);
    assert_eq!(q.histogram.iter().sum::<u64>(), 6 * 162);
}

#[test]
fn what_can_be_wrong_with_tetrahedra() {
    let good = block(2);
    let broken = |change: fn(&mut Mesh)| {
        let mut mesh = good.clone();
        change(&mut mesh);
        codes(&look(&mesh))
    };
    assert_eq!(broken(|m| m.triangles.clear()), []);
    assert_eq!(
        broken(|m| m.triangles[5].swap(0, 1)),
        [("misoriented-edge", 3), ("inward-triangle", 1)]
    );
    assert_eq!(
        broken(|m| m.triangles.truncate(47)),
        [("open-edge", 3), ("uncovered-face", 1)]
    );
    // With the middle node beyond the block, tetrahedra around it are inverted.
    assert!(
        broken(|m| m.points[13][0] = 9.0)
            .iter()
            .any(|c| c.0 == "inverted-tet" && c.1 > 3)
    );
    assert!(
        broken(|m| m.points[13] = [0.0, 1.0, 1.0])
            .iter()
            .any(|c| c.0 == "flat-tet")
    );
    // A hole within: the four faces around it are the boundary, too.
    assert_eq!(
        broken(|m| {
            m.tets.swap_remove(20);
        })
        .iter()
        .find(|c| c.0 == "uncovered-face")
        .map(|c| c.1 > 0),
        Some(true)
    );
    assert!(
        broken(|m| m.tets.push(m.tets[20])).contains(&("crowded-face", 4))
            || broken(|m| m.tets.push(m.tets[20]))
                .iter()
                .any(|c| c.0 == "crowded-face")
    );
    assert!(
        broken(|m| m.tets[20].swap(0, 1))
            .iter()
            .any(|c| c.0 == "inverted-tet")
    );
    assert!(
        broken(|m| m.tets[20].swap(0, 1))
            .iter()
            .any(|c| c.0 == "folded-face")
    );
    let inner = broken(|m| {
        let t = m.tets.iter().find_map(|t| {
            let f = [t[0], t[2], t[3]];
            f.contains(&13).then_some(f)
        });
        m.triangles.extend(t);
    });
    assert!(inner.contains(&("inner-triangle", 1)), "{inner:?}");
    let loose = broken(|m| m.triangles.push([0, 13, 26]));
    assert!(
        loose
            .iter()
            .any(|c| c.0 == "loose-triangle" || c.0 == "inner-triangle"),
        "{loose:?}"
    );
}

/// The mesh with a node in the middle of every edge.
fn second_order(mut mesh: Mesh) -> Mesh {
    let mut known: std::collections::BTreeMap<[u32; 2], u32> = std::collections::BTreeMap::new();
    let points = &mut mesh.points;
    let mut mid = |a: u32, b: u32| {
        *known.entry([a.min(b), a.max(b)]).or_insert_with(|| {
            let (p, q) = (points[a as usize], points[b as usize]);
            points.push(std::array::from_fn(|i| 0.5 * (p[i] + q[i])));
            points.len() as u32 - 1
        })
    };
    mesh.tet_mids = mesh
        .tets
        .iter()
        .map(|t| isoform_geom::TET_EDGES.map(|[a, b]| mid(t[a], t[b])))
        .collect();
    mesh.triangle_mids = mesh
        .triangles
        .iter()
        .map(|t| isoform_geom::TRIANGLE_EDGES.map(|[a, b]| mid(t[a], t[b])))
        .collect();
    mesh
}

#[test]
fn meshes_of_second_order() {
    let good = second_order(block(2));
    let c = look(&good);
    assert!(c.is_ok() && c.unused_nodes == 0, "{:?}", c.failures());
    assert_eq!(
        c.curved.map(|q| (q.curved, q.scaled_jacobian_min)),
        Some((0, 1.0))
    );

    // The mid node of an edge from the middle node, moved along the edge by d of its length: the
    // scaled Jacobian of the tetrahedra around is (1 − 4d)/(1 + 4d).
    let far = |d: f64| {
        let mut mesh = good.clone();
        let t = mesh
            .tets
            .iter()
            .position(|t| t[0] == 13)
            .expect("a tetrahedron that begins in the middle");
        let (a, b, m) = (
            mesh.tets[t][0] as usize,
            mesh.tets[t][1] as usize,
            mesh.tet_mids[t][0] as usize,
        );
        let e = isoform_geom::sub(mesh.points[b], mesh.points[a]);
        mesh.points[m] = std::array::from_fn(|i| mesh.points[m][i] + d * e[i]);
        look(&mesh)
    };
    let c = far(0.125);
    assert!(c.is_ok(), "{:?}", c.failures());
    let q = c.curved.expect("mid nodes");
    assert!(
        q.curved >= 4 && (q.scaled_jacobian_min - 1.0 / 3.0).abs() < 1e-12 && q.unproved.is_empty(),
        "{q:?}"
    );
    let c = far(0.3);
    let q = c.curved.as_ref().expect("mid nodes");
    assert_eq!(codes(&c), [("negative-jacobian", q.curved)]);

    let mut mesh = good.clone();
    let copy = mesh.tet_mids[7][0];
    mesh.points.push(mesh.points[copy as usize]);
    mesh.tet_mids[7][0] = mesh.points.len() as u32 - 1;
    assert_eq!(codes(&look(&mesh)), [("mid-node", 1)]);
    let mut mesh = good;
    let taken = mesh.tet_mids[7][0];
    for m in mesh
        .tet_mids
        .iter_mut()
        .flatten()
        .chain(mesh.triangle_mids.iter_mut().flatten())
    {
        if *m == taken {
            *m = 13;
        }
    }
    assert!(codes(&look(&mesh)).contains(&("mid-node", 1)));
}

/// A torus with nodes moved at random: the tree of boxes must lose no pair.
#[test]
fn intersections_of_a_crumpled_torus() {
    let mut mesh = torus(16);
    let mut seed = 3u64;
    for v in mesh.points.iter_mut().flatten() {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        *v += ((seed >> 40) as f64 / (1u64 << 24) as f64 - 0.5) * 1.6;
    }
    let n = mesh.triangles.len();
    let pairs: Vec<[u32; 2]> = (0..n)
        .flat_map(|a| (a + 1..n).map(move |b| (a, b)))
        .filter(|&(a, b)| triangles_meet(&mesh.points, mesh.triangles[a], mesh.triangles[b]))
        .map(|(a, b)| [a as u32, b as u32])
        .collect();
    let all = Options {
        places: usize::MAX,
        ..Options::default()
    };
    let found = certify(&mesh, None, &all, &Control::default())
        .intersections
        .expect("a surface");
    assert!(found.complete && pairs.len() > 100);
    assert_eq!(
        found
            .pairs
            .places
            .iter()
            .map(|p| p.elements.clone())
            .collect::<Vec<_>>(),
        pairs
    );
    let mut hit: Vec<u32> = pairs.into_iter().flatten().collect();
    hit.sort_unstable();
    hit.dedup();
    assert_eq!(found.triangles, hit.len());
}

/// Triangles through one axis, of which all 44,850 pairs cross: the search ends soon after the
/// requested number of pairs.
#[test]
fn no_more_intersections_than_asked_for() {
    let mut mesh = Mesh::default();
    for k in 0..300u32 {
        let angle = f64::from(k) * 0.01;
        let (x, y) = (angle.cos(), angle.sin());
        mesh.points
            .extend([[x, y, 0.0], [-x, -y, 0.1], [-x, -y, -0.1]]);
        mesh.triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
    }
    let few = Options {
        pairs: 10,
        ..Options::default()
    };
    let found = certify(&mesh, None, &few, &Control::default())
        .intersections
        .expect("a surface");
    assert!(
        !found.complete && (11..1000).contains(&found.pairs.count),
        "{}",
        found.pairs.count
    );
}

#[test]
fn a_stop_and_an_empty_mesh() {
    let now = AtomicBool::new(true);
    let stopped = certify(
        &block(1),
        None,
        &Options::default(),
        &Control {
            cancelled: Some(&now),
            ..Control::default()
        },
    );
    assert_eq!(codes(&stopped), [("incomplete", 1)]);
    assert_eq!(codes(&look(&Mesh::default())), [("empty", 1)]);
}

#[test]
fn limits_of_shape() {
    let limits = Limits {
        dihedral_min: 50.0,
        dihedral_max: 80.0,
        angle_min: 50.0,
        ..Limits::default()
    };
    let c = certify(
        &block(1),
        None,
        &Options {
            limits,
            ..Options::default()
        },
        &Control::default(),
    );
    assert_eq!(
        codes(&c),
        [
            ("small-dihedral-angle", 1),
            ("large-dihedral-angle", 1),
            ("small-angle", 1)
        ]
    );
    assert_eq!(
        c.failures()[0].message,
        "the smallest dihedral angle is 45.000000, below 50"
    );
}

#[test]
fn places_are_capped_and_counts_are_not() {
    let mut mesh = torus(20);
    mesh.triangles.truncate(400);
    let c = certify(
        &mesh,
        None,
        &Options {
            places: 3,
            ..Options::default()
        },
        &Control::default(),
    );
    let open = c.surface.expect("a surface").open_edges;
    assert_eq!((open.count, open.places.len()), (40, 3));
}

#[test]
fn any_number_of_threads_gives_the_same() {
    let mut mesh = second_order(block(9));
    for (k, v) in mesh.points.iter_mut().flatten().enumerate() {
        *v += 0.01 * (k as f64).sin();
    }
    let with = |threads: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads")
            .install(|| look(&mesh))
    };
    assert_eq!(with(1), with(5));
}

proptest! {
    /// The certificate does not panic on arbitrary meshes.
    #[test]
    fn nonsense_is_survived(
        mut points in prop::collection::vec(prop::array::uniform3(-2i32..3), 1..9),
        triangles in prop::collection::vec(prop::array::uniform3(0u32..9), 0..12),
        tets in prop::collection::vec(prop::array::uniform4(0u32..9), 0..8),
        labels in prop::collection::vec(0u32..3, 0..4),
        nan in 0usize..40,
        second in 0u8..3,
    ) {
        points.resize(points.len() + 1, [0; 3]);
        let mut mesh = Mesh::from_triangles(points.iter().map(|p| p.map(f64::from)).collect(), triangles);
        mesh.tets = tets;
        if nan < 3 {
            mesh.points[0][nan] = [f64::NAN, f64::INFINITY, 1e308][nan];
        }
        mesh.edges = labels.iter().map(|&l| [l, l + 1]).collect();
        mesh.corners.clone_from(&labels);
        if second == 1 {
            mesh.tet_mids = mesh.tets.iter().map(|t| [t[1], t[2], t[3], t[0], t[1], t[2]]).collect();
        }
        if second == 2 {
            mesh.triangle_mids = mesh.triangles.iter().map(|t| [t[1], t[2], t[0]]).collect();
        }
        mesh.triangle_parts = labels;
        let c = solids::against_everything(&mesh);
        prop_assert!(c.malformed.is_empty() || !c.is_ok());
    }
}
