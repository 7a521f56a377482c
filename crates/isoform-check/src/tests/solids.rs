//! Meshes compared with their solids.

use super::*;
use isoform_geom::{Csg, Curve, Field, OnePiece, cross, dot, norm, sub};
use isoform_num::{Interval, Jet2};

/// (1 − |p|²)/2 times a factor: not a distance, but its first-order distance is accurate to second
/// order with the factor 1.
struct Ball(f64);

impl Field for Ball {
    fn value(&self, p: Point3) -> f64 {
        0.5 * self.0 * (1.0 - dot(p, p))
    }
    fn jet(&self, p: Point3) -> Jet2 {
        let h = -self.0;
        Jet2 {
            v: self.value(p),
            g: p.map(|v| -self.0 * v),
            h: [h, 0.0, 0.0, h, 0.0, h],
        }
    }
}

/// The upper half of the unit ball: pieces "ball" and "floor".
struct Dome {
    names: Vec<String>,
    tree: Csg,
}

impl Dome {
    fn new() -> Self {
        Self {
            names: vec!["ball".into(), "floor".into()],
            tree: Csg::Min(vec![Csg::Piece(0), Csg::Piece(1)]),
        }
    }
}

impl Solid for Dome {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn tree(&self) -> &Csg {
        &self.tree
    }
    fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
        for (&piece, out) in which.iter().zip(out.chunks_mut(points.len().max(1))) {
            out.iter_mut()
                .zip(points)
                .for_each(|(v, p)| *v = self.gradient(piece, *p).0);
        }
    }
    fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
        match piece {
            0 => (Ball(5.0).value(p), p.map(|v| -5.0 * v)),
            _ => (0.1 * p[2], [0.0, 0.0, 0.1]),
        }
    }
    fn jet(&self, piece: u32, p: Point3) -> Jet2 {
        let (v, g) = self.gradient(piece, p);
        Jet2 { v, g, h: [0.0; 6] }
    }
    fn bounds(&self, which: &[u32], _: Aabb, out: &mut [Interval]) {
        out[..which.len()].fill(Interval::new(f64::NEG_INFINITY, f64::INFINITY));
    }
    fn sign_values(&self, points: &[Point3], out: &mut [f64]) {
        out.iter_mut()
            .zip(points)
            .for_each(|(v, p)| *v = Ball(1.0).value(*p).min(p[2]));
    }
}

/// Runs all checks at once, on an arbitrary mesh.
pub(super) fn against_everything(mesh: &Mesh) -> Certificate {
    let curves = vec![
        vec![[0.0; 3], [1.0, 1.0, 0.0]],
        vec![[f64::NAN; 3]; 2],
        vec![[1.0; 3]; 3],
        vec![],
    ];
    let options = Options {
        curves: &curves,
        corners: &[[1.0; 3], [f64::NAN; 3]],
        ..Options::default()
    };
    certify(mesh, Some(&Dome::new()), &options, &Control::default())
}

/// The octahedron, its triangles cut into four `levels` times with the nodes moved to the unit
/// sphere.
fn sphere(levels: u32) -> Mesh {
    let points = vec![
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ];
    let triangles = vec![
        [0, 2, 4],
        [2, 1, 4],
        [1, 3, 4],
        [3, 0, 4],
        [2, 0, 5],
        [1, 2, 5],
        [3, 1, 5],
        [0, 3, 5],
    ];
    let mut mesh = Mesh::from_triangles(points, triangles);
    for _ in 0..levels {
        let fine = on_sphere(second_order(mesh));
        mesh = Mesh::from_triangles(fine.points, Vec::new());
        for ([a, b, c], [x, y, z]) in fine.triangles.into_iter().zip(fine.triangle_mids) {
            mesh.triangles
                .extend([[a, x, z], [x, b, y], [z, y, c], [x, y, z]]);
        }
    }
    mesh
}

fn on_sphere(mut mesh: Mesh) -> Mesh {
    for p in &mut mesh.points {
        *p = p.map(|v| v / norm(*p));
    }
    mesh
}

fn distances(mesh: &Mesh, solid: &dyn Solid) -> (Deviation, Certificate) {
    let c = certify(mesh, Some(solid), &Options::default(), &Control::default());
    (c.deviation.clone().expect("a solid"), c)
}

/// The chord error of a sphere's mesh is at the centres of the circumscribed circles; on the
/// octahedron these are the centroids, 1 − 1/√3 below the sphere.
#[test]
fn sagitta_of_an_octahedron() {
    let (d, c) = distances(&sphere(0), &OnePiece::new(Ball(1.0), "ball"));
    assert!(c.is_ok(), "{:?}", c.failures());
    assert_eq!((d.nodes.count, d.nodes.max, d.faces.count), (6, 0.0, 8 * 7));
    // A Newton step leads from the distance ρ to (ρ + 1/ρ)/2. It is 1/√3 for the octahedron, too
    // far for the secant.
    let step = |rho: f64| 0.5 * (rho + 1.0 / rho);
    let rho = 1.0 / 3f64.sqrt();
    assert!(
        (d.faces.max - (step(step(rho)) - rho)).abs() < 1e-14
            && (d.faces.max / (1.0 - rho) - 1.0).abs() < 0.03
    );
    // Cut in four, the inner faces are √(2/3) away: a step s, then the secant.
    let (d, _) = distances(&sphere(1), &OnePiece::new(Ball(1.0), "ball"));
    let rho = (2.0f64 / 3.0).sqrt();
    let (v, w) = (0.5 * (1.0 - rho * rho), 0.5 * (1.0 - step(rho) * step(rho)));
    assert!(
        (d.faces.max - (step(rho) - rho) * v / (v - w)).abs() < 1e-14
            && (d.faces.max / (1.0 - rho) - 1.0).abs() < 0.012
    );
}

/// Against the exact distance 1 − |p| at the samples, for fields of any scale; and the rate of the
/// rms is 2.
#[test]
fn sagitta_of_a_sphere() {
    let mut last: Option<f64> = None;
    for level in 2..6 {
        let mesh = sphere(level);
        let (d, c) = distances(&mesh, &OnePiece::new(Ball(1e3), "ball"));
        assert!(c.is_ok() && d.nodes.max < 1e-15, "{:?}", c.failures());
        let (mut max, mut squares, mut weight) = (0.0f64, 0.0, 0.0);
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.points[i as usize]);
            let area = 0.5 * norm(cross(sub(b, a), sub(c, a)));
            for [u, v, w] in [
                [1.0, 1.0, 1.0],
                [1.5, 1.5, 0.0],
                [0.0, 1.5, 1.5],
                [1.5, 0.0, 1.5],
                [2.0, 0.5, 0.5],
                [0.5, 2.0, 0.5],
                [0.5, 0.5, 2.0],
            ] {
                let p: Point3 = std::array::from_fn(|i| (u * a[i] + v * b[i] + w * c[i]) / 3.0);
                let s = 1.0 - norm(p);
                (max, squares, weight) = (max.max(s), squares + area * s * s, weight + area);
            }
        }
        let (rms, size) = ((squares / weight).sqrt(), 1.0 / f64::from(1 << level));
        // Relative errors of the two steps along one normal per face: of the order of the angle of
        // the face, squared.
        assert!(
            (d.faces.max / max - 1.0).abs() < size * size
                && (d.faces.rms / rms - 1.0).abs() < size * size,
            "{d:?} {max} {rms}"
        );
        if let Some(coarse) = last {
            assert!(
                (coarse / d.faces.rms - 4.0).abs() < 0.3,
                "{}",
                coarse / d.faces.rms
            );
        }
        last = Some(d.faces.rms);
        assert_eq!(d.parts[0].faces, d.faces);
    }
}

/// Faces through mid nodes on the sphere are truer by two orders.
#[test]
fn curved_faces_and_their_mid_nodes() {
    let flat = sphere(3);
    let curved = on_sphere(second_order(flat.clone()));
    let solid = OnePiece::new(Ball(1.0), "ball");
    let ((f, _), (d, c)) = (distances(&flat, &solid), distances(&curved, &solid));
    assert!(c.is_ok() && d.mids.count == 3 * flat.triangles.len() / 2 && d.mids.max < 1e-15);
    assert!(
        d.faces.max < 0.02 * f.faces.max,
        "{} {}",
        d.faces.max,
        f.faces.max
    );
    let mut off = curved;
    let node = off.triangle_mids[10][1] as usize;
    off.points[node] = off.points[node].map(|v| 1.001 * v);
    let (d, c) = distances(&off, &solid);
    assert!(
        (d.mids.max - 1e-3).abs() < 1e-6 && d.mids.worst.is_some_and(|p| p.nodes == [node as u32])
    );
    assert_eq!(codes(&c), [("mid-node-off-surface", 1)]);
}

/// The upper half of a sphere's mesh and its floor, labelled; edges along the rim.
fn dome(levels: u32) -> Mesh {
    let ball = sphere(levels);
    let up = |t: &&[u32; 3]| t.iter().all(|&i| ball.points[i as usize][2] >= 0.0);
    let mut mesh = Mesh::from_triangles(
        ball.points.clone(),
        ball.triangles.iter().filter(up).copied().collect(),
    );
    mesh.triangle_parts = vec![0; mesh.triangles.len()];
    mesh.points.push([0.0; 3]);
    let centre = mesh.points.len() as u32 - 1;
    for k in 0..mesh.triangles.len() {
        let t = mesh.triangles[k];
        for i in 0..3 {
            let (a, b) = (t[i], t[(i + 1) % 3]);
            if mesh.points[a as usize][2] == 0.0 && mesh.points[b as usize][2] == 0.0 {
                mesh.triangles.push([b, a, centre]);
                mesh.triangle_parts.push(1);
                mesh.edges.push([a, b]);
            }
        }
    }
    mesh.edge_curves = vec![0; mesh.edges.len()];
    mesh.parts = vec!["ball".into(), "floor".into()];
    mesh.curves = vec![Curve {
        name: "rim".into(),
        parts: [0, 1],
    }];
    mesh
}

#[test]
fn labels_curves_and_misclassified_nodes() {
    let good = dome(3);
    let (d, c) = distances(&good, &Dome::new());
    assert!(c.is_ok(), "{:?}", c.failures());
    assert_eq!(
        (d.curves.count, d.parts[1].faces.max, d.parts.len()),
        (2 * good.edges.len(), 0.0, 2)
    );
    assert!(
        d.parts[0].faces.max == d.faces.max
            && d.parts[0].nodes.count + d.parts[1].nodes.count == d.nodes.count
    );

    // A lifted node of the rim is neither on the ball nor on the floor.
    let mut lifted = good.clone();
    let node = lifted.edges[5][0];
    lifted.points[node as usize][2] += 1e-3;
    let (d, c) = distances(&lifted, &Dome::new());
    assert!(
        (d.curves.max - 1e-3).abs() < 1e-9 && d.curves.worst.is_some_and(|p| p.nodes == [node])
    );
    assert_eq!(
        codes(&c).iter().map(|c| c.0).collect::<Vec<_>>(),
        [
            "node-off-surface",
            "curve-node-off-surface",
            "misclassified-node"
        ]
    );

    // The whole sphere is not the dome's surface below the floor, though all of its nodes are on
    // the ball.
    let whole = Mesh {
        parts: vec!["ball".into()],
        ..sphere(2)
    };
    let whole = Mesh {
        triangle_parts: vec![0; whole.triangles.len()],
        ..whole
    };
    let (d, c) = distances(&whole, &Dome::new());
    let below = whole.points.iter().filter(|p| p[2] < 0.0).count();
    assert!(
        d.nodes.max < 1e-15 && codes(&c) == [("misclassified-node", below)],
        "{:?}",
        codes(&c)
    );
    assert!(
        d.misclassified
            .places
            .iter()
            .all(|p| (p.value - p.at[2]).abs() < 1e-15)
    );

    let mut renamed = good.clone();
    renamed.parts[1] = "roof".into();
    let (d, c) = distances(&renamed, &Dome::new());
    assert_eq!(
        (d.unknown_parts, codes(&c)),
        (vec!["roof".to_owned()], vec![("unknown-part", 1)])
    );
    // Without labels the deciding pieces are used.
    let bare = Mesh::from_triangles(good.points, good.triangles);
    let (d, c) = distances(&bare, &Dome::new());
    assert!(
        c.is_ok() && d.parts[1].faces.count == 7 * good.edges.len(),
        "{:?}",
        c.failures()
    );
}

/// A solid cut off at a box is compared with the box's sides, too.
#[test]
fn a_solid_that_was_cut_off() {
    let mut mesh = dome(3);
    mesh.parts[1] = "cap.z_min".into();
    let region = Aabb {
        lo: [-2.0, -2.0, 0.0],
        hi: [2.0; 3],
    };
    let solid = OnePiece::new(Ball(1.0), "ball");
    let c = certify(
        &mesh,
        Some(&solid),
        &Options {
            region: Some(region),
            ..Options::default()
        },
        &Control::default(),
    );
    assert!(c.is_ok(), "{:?}", c.failures());
    assert!(
        !certify(
            &mesh,
            Some(&solid),
            &Options::default(),
            &Control::default()
        )
        .is_ok()
    );
}

#[test]
fn chords_can_be_limited() {
    let limits = Limits {
        chord: 1e-3,
        ..Limits::default()
    };
    let c = certify(
        &dome(2),
        Some(&Dome::new()),
        &Options {
            limits,
            ..Options::default()
        },
        &Control::default(),
    );
    assert_eq!(codes(&c), [("chord", 1)]);
}

/// A cube with feature edges along its edges.
fn edged_cube() -> (Mesh, Vec<Vec<Point3>>) {
    let mut mesh = cube([0.0; 3]);
    for axis in 0..3 {
        mesh.edges.extend(
            (0..8u32)
                .filter(|k| k >> axis & 1 == 0)
                .map(|k| [k, k | 1 << axis]),
        );
    }
    mesh.corners = (0..8).collect();
    let curves = mesh
        .edges
        .iter()
        .map(|e| e.map(|i| mesh.points[i as usize]).to_vec())
        .collect();
    (mesh, curves)
}

#[test]
fn curves_with_and_without_edges() {
    let (mut mesh, curves) = edged_cube();
    let corners = mesh.points.clone();
    let options = Options {
        curves: &curves,
        corners: &corners,
        size: Some(0.1),
        ..Options::default()
    };
    let look = |mesh: &Mesh| certify(mesh, None, &options, &Control::default());
    let c = look(&mesh);
    assert!(c.is_ok(), "{:?}", c.failures());
    assert!(c.coverage.is_some_and(|f| f.covered == 1.0
        && (f.length - 12.0).abs() < 1e-12
        && f.corner_max == 0.0
        && f.uncovered.is_empty()));

    let e = mesh.edges.remove(4);
    mesh.corners.remove(7);
    let c = look(&mesh);
    assert_eq!(
        codes(&c).iter().map(|c| c.0).collect::<Vec<_>>(),
        ["uncovered-curve", "missed-corner"]
    );
    let f = c.coverage.expect("curves");
    // Within the tolerance of the ends, other edges are near.
    assert!(
        (f.covered - (12.0 - 0.97) / 12.0).abs() < 1e-3 * 12.0
            && f.uncovered.count == 1
            && f.corner_max == 1.0,
        "{f:?}"
    );
    let middle: Point3 =
        std::array::from_fn(|i| 0.5 * (corners[e[0] as usize][i] + corners[e[1] as usize][i]));
    assert!(norm(sub(f.uncovered.places[0].at, middle)) < 0.02, "{f:?}");
    assert_eq!(
        (
            f.missed_corners.places[0].at,
            f.missed_corners.places[0].value
        ),
        ([1.0; 3], 1.0)
    );

    // Edges 1 % off are along the curve, those 10 % off are not.
    for (off, wanted) in [(0.001, true), (0.01, true), (0.1, false)] {
        let (mut mesh, _) = edged_cube();
        mesh.points.iter_mut().for_each(|p| p[0] += off);
        assert_eq!(
            look(&mesh).coverage.is_some_and(|f| f.covered > 0.999),
            wanted,
            "{off}"
        );
    }
    let c = look(&cube([0.0; 3]));
    assert!(
        c.coverage
            .is_some_and(|f| f.covered == 0.0 && f.uncovered.count == 12 && f.corner_max == 0.0)
    );
    let c = look(&Mesh {
        points: cube([0.0, 0.0, 0.01]).points,
        ..cube([0.0; 3])
    });
    assert!(
        c.coverage
            .is_some_and(|f| f.missed_corners.count == 8 && (f.corner_max - 0.01).abs() < 1e-15)
    );
    mesh.edges.push([0, 7]);
    assert!(codes(&look(&mesh)).contains(&("loose-edge", 1)));
}
