//! Foot points on solids whose signed distance has a closed form.

use isoform_field::{Axis, Distance, Graph, Library, NodeId, Ops, SetOp, Shape};
use isoform_geom::{
    Aabb, DistanceField, Edge, Foot, Frame, Nearby, ParamField, Point3, distance_squared,
};

/// Distance of an unmoved solid with parameters.
fn distance(build: impl Fn(&mut Graph) -> NodeId, n_params: usize) -> Distance {
    let mut graph = Graph::new();
    let root = build(&mut graph);
    let shape = Shape::new(&mut graph, root);
    let mut posed = graph.clone();
    Distance::new(&shape, &mut posed, n_params, |_, id| id).expect("few pieces")
}

/// The block |x| ≤ a₁/2, |y| ≤ a₂/2, |z| ≤ a₃/2, each pair of faces written as one product.
fn product_block(g: &mut Graph) -> NodeId {
    let slabs: Vec<NodeId> = (0..3)
        .map(|i| {
            let (x, a) = (g.x(i), g.param(i));
            let half = g.scale(0.5, &a);
            let (low, high) = (g.add(&half, &x), g.sub(&half, &x));
            g.mul(&low, &high)
        })
        .collect();
    let two = g.set(SetOp::RIntersection, &slabs[0], &slabs[1]);
    g.set(SetOp::RIntersection, &two, &slabs[2])
}

/// Positive inside.
fn block_distance(p: Point3, a: &[f64]) -> f64 {
    let q: Point3 = std::array::from_fn(|i| p[i].abs() - 0.5 * a[i]);
    let outside = q.iter().map(|v| v.max(0.0).powi(2)).sum::<f64>().sqrt();
    -(outside + q.iter().copied().fold(f64::MIN, f64::max).min(0.0))
}

fn random_points(n: usize, half: Point3, seed: u64) -> Vec<Point3> {
    let mut random = fastrand::Rng::with_seed(seed);
    (0..n)
        .map(|_| std::array::from_fn(|i| half[i] * (2.0 * random.f64() - 1.0)))
        .collect()
}

#[test]
fn a_block_of_products_has_its_exact_distance_and_derivatives() {
    let d = distance(product_block, 3);
    let a = [7.0, 4.0, 2.0];
    // Points at which one face is clearly nearer than the opposite one.
    let points: Vec<Point3> = random_points(4000, [4.5, 3.0, 2.0], 1)
        .into_iter()
        .filter(|p| block_distance(*p, &a) < 0.6)
        .collect();
    let (mut f, mut jac) = (vec![0.0; points.len()], vec![0.0; 3 * points.len()]);
    d.jacobian(&points, &a, &mut f, &mut jac);
    for ((p, f), row) in points.iter().zip(&f).zip(jac.chunks(3)) {
        let truth = block_distance(*p, &a);
        assert!((f - truth).abs() < 1e-9, "{p:?}: {f} for {truth}");
        for i in 0..3 {
            let h = 1e-6;
            let moved = |s: f64| {
                let mut b = a;
                b[i] += s * h;
                block_distance(*p, &b)
            };
            let slope = (moved(1.0) - moved(-1.0)) / (2.0 * h);
            // At ridges of the distance the two one-sided derivatives differ.
            let ridge = (moved(1.0) + moved(-1.0) - 2.0 * moved(0.0)).abs() > 1e-9;
            assert!(
                ridge || (row[i] - slope).abs() < 1e-5,
                "{p:?}: {row:?} {slope}"
            );
        }
    }
}

#[test]
fn normal_equations_are_the_sums_of_rows() {
    let d = distance(product_block, 3);
    let a = [7.0, 4.0, 2.0];
    // Several batches, the last one not full.
    let points = random_points(5003, [4.5, 3.0, 2.0], 5);
    let weights: Vec<f64> = (0..points.len()).map(|i| (i % 4) as f64).collect();
    let (mut f, mut jac) = (vec![0.0; points.len()], vec![0.0; 3 * points.len()]);
    d.jacobian(&points, &a, &mut f, &mut jac);
    let sum_of = |term: &dyn Fn(usize) -> f64| (0..points.len()).map(term).sum::<f64>();
    let (mut gradient, mut hessian) = ([1.0; 3], [1.0; 9]);
    let sum = d.normal_equations(&points, &weights, &a, &mut gradient, &mut hessian);
    let is_near = |found: f64, wanted: f64| (found - wanted).abs() < 1e-9 * (1.0 + wanted.abs());
    assert!(is_near(sum, sum_of(&|i| weights[i] * f[i] * f[i])));
    for j in 0..3 {
        let wanted = sum_of(&|i| weights[i] * f[i] * jac[3 * i + j]);
        assert!(is_near(gradient[j], wanted), "{} {wanted}", gradient[j]);
        for k in 0..3 {
            let wanted = sum_of(&|i| weights[i] * jac[3 * i + j] * jac[3 * i + k]);
            let found = hessian[3 * j + k];
            assert!(is_near(found, wanted), "{found} {wanted}");
        }
    }
}

#[test]
fn a_seam_between_stacked_cylinders_is_no_surface() {
    // Radius 2 for z in [0, 1], radius 1 for z in [1, 2].
    let d = distance(
        |g| {
            let section = |g: &mut Graph, r: f64, lo: f64, hi: f64| {
                let mut args: Vec<NodeId> = (0..3).map(|i| g.x(i)).collect();
                args.extend([0.0, 0.0, 0.0, r].map(|v| g.constant(v)));
                let round = g.library(Library::Cylinder(Axis::Z), &args);
                let (lo, hi, z) = (g.constant(lo), g.constant(hi), g.x(2));
                let (low, high) = (g.sub(&z, &lo), g.sub(&hi, &z));
                let slab = g.mul(&low, &high);
                g.set(SetOp::RIntersection, &round, &slab)
            };
            let (wide, slim) = (section(g, 2.0, 0.0, 1.0), section(g, 1.0, 1.0, 2.0));
            g.set(SetOp::RUnion, &wide, &slim)
        },
        0,
    );
    let truth = |r: f64, z: f64| {
        // Distances to the five segments of the profile; inside positive.
        let segments = [
            ((0.0, 0.0), (2.0, 0.0)),
            ((2.0, 0.0), (2.0, 1.0)),
            ((2.0, 1.0), (1.0, 1.0)),
            ((1.0, 1.0), (1.0, 2.0)),
            ((1.0, 2.0), (0.0, 2.0)),
        ];
        let off = |((a, b), (c, e)): ((f64, f64), (f64, f64))| {
            let t = ((r - a) * (c - a) + (z - b) * (e - b)) / ((c - a).powi(2) + (e - b).powi(2));
            let t = t.clamp(0.0, 1.0);
            (r - a - t * (c - a)).hypot(z - b - t * (e - b))
        };
        let least = segments.into_iter().map(off).fold(f64::MAX, f64::min);
        let inside = (0.0..=1.0).contains(&z) && r <= 2.0 || (1.0..=2.0).contains(&z) && r <= 1.0;
        if inside { least } else { -least }
    };
    let points: Vec<Point3> = random_points(6000, [2.5, 2.5, 2.5], 2);
    let mut feet = vec![Foot::NONE; points.len()];
    d.feet(&points, &[], &mut feet);
    let mut asked = 0;
    for (p, foot) in points.iter().zip(&feet) {
        let t = truth(p[0].hypot(p[1]), p[2]);
        // Near the surface, as points of a scan are; slabs written as products have no medial
        // plane.
        if t.abs() < 0.35 {
            asked += 1;
            assert!((foot.distance - t).abs() < 1e-7, "{p:?}: {foot:?} for {t}");
            assert!(foot.order > 0);
        }
    }
    assert!(asked > 1000, "{asked}");
}

#[test]
fn samples_of_the_surface_are_even_by_area() {
    let d = distance(product_block, 3);
    let a = [7.0, 4.0, 2.0];
    let region = Aabb {
        lo: [-4.0, -2.5, -1.5],
        hi: [4.0, 2.5, 1.5],
    };
    let samples = d.area_samples(&a, &Frame::SPACE, region, 20_000, 3);
    assert!(samples.len() >= 20_000);
    let n = samples.len() as f64;
    // Fractions of the area on the pairs of faces: 8, 14 and 28 of 50; and on a strip along an
    // edge. A product is two pieces, one per face.
    for (pair, share) in [(0, 8.0), (1, 14.0), (2, 28.0)] {
        let count = samples.iter().filter(|s| s.pieces[0] / 2 == pair).count() as f64;
        let p = share / 50.0;
        assert!(
            (count / n - p).abs() < 5.0 * (p * (1.0 - p) / n).sqrt(),
            "{pair}: {count}"
        );
    }
    let strip = samples
        .iter()
        .filter(|s| s.pieces[0] / 2 == 2 && s.at[0] > 3.4)
        .count() as f64;
    let p = 2.0 * 0.1 * 4.0 / 100.0;
    assert!((strip / n - p).abs() < 5.0 * (p / n).sqrt(), "{strip}");
}

#[test]
fn edges_are_met_along_their_length_with_their_angle() {
    let d = distance(product_block, 3);
    let a = [7.0, 4.0, 2.0];
    let region = Aabb {
        lo: [-4.0, -2.5, -1.5],
        hi: [4.0, 2.5, 1.5],
    };
    let places = d.area_samples(&a, &Frame::SPACE, region, 40_000, 3);
    let (reach, strip, area) = (0.1, 0.3, 100.0);
    let mut length = 0.0;
    for (place, nearby) in places.iter().zip(d.nearby(&places, &a, reach, strip)) {
        let mut from_edges: Point3 = std::array::from_fn(|i| 0.5 * a[i] - place.at[i].abs());
        from_edges.sort_by(f64::total_cmp);
        match nearby {
            Nearby::Face => assert!(from_edges[1] > 0.99 * reach, "{place:?}"),
            Nearby::Much => assert!(from_edges[2] < 2.0 * strip, "{place:?}"),
            Nearby::Edge(edge) => {
                assert!((edge.angle - std::f64::consts::FRAC_PI_2).abs() < 1e-6);
                let away = distance_squared(edge.at, place.at).sqrt();
                assert!((away - from_edges[1]).abs() < 1e-6, "{place:?} {edge:?}");
                assert_eq!(edge.is_near, from_edges[1] <= reach);
                if away < edge.width {
                    // Both faces of the edge have strips of this width.
                    length += area / places.len() as f64 / (2.0 * edge.width);
                }
            }
        }
    }
    // All of the edges except the parts nearer to corners than twice the minimum width.
    let wanted = 4.0 * (7.0 + 4.0 + 2.0) - 24.0 * 2.0 * Edge::MIN_WIDTH_RATIO * reach;
    assert!(
        (length / wanted - 1.0).abs() < 0.03,
        "{length} for {wanted}"
    );
}

#[test]
fn hollow_edges_have_more_than_half_a_turn() {
    // Both x < 0 and y < 0 are solid: the material takes three quarters of a turn.
    let d = distance(
        |g| {
            let (x, y) = (g.x(0), g.x(1));
            let (x, y) = (g.neg(&x), g.neg(&y));
            g.set(SetOp::RUnion, &x, &y)
        },
        0,
    );
    let mut feet = [Foot::NONE];
    d.feet(&[[0.001, 0.05, 3.0]], &[], &mut feet);
    let nearby = d.nearby(&feet, &[], 0.1, 0.3);
    let Nearby::Edge(edge) = nearby[0] else {
        panic!("{nearby:?}");
    };
    assert!((edge.angle - 1.5 * std::f64::consts::PI).abs() < 1e-9);
    assert!(distance_squared(edge.at, [0.0, 0.0, 3.0]) < 1e-18);
}

#[test]
fn faces_bend_by_their_radius() {
    // A cylinder of radius a₁ about z.
    let d = distance(
        |g| {
            let mut args: Vec<NodeId> = (0..3).map(|i| g.x(i)).collect();
            args.extend([0.0; 3].map(|v| g.constant(v)));
            args.push(g.param(0));
            g.library(Library::Cylinder(Axis::Z), &args)
        },
        1,
    );
    let a = [2.0];
    let points = random_points(50, [2.5, 2.5, 1.0], 5);
    let points: Vec<Point3> = points
        .into_iter()
        .filter(|p| p[0].hypot(p[1]) > 1.0)
        .collect();
    let mut feet = vec![Foot::NONE; points.len()];
    d.feet(&points, &a, &mut feet);
    for bend in d.bends(&feet, &a, 0.01) {
        assert!((bend + 0.5).abs() < 1e-4, "{bend}");
    }
    let mut jac = vec![0.0; feet.len()];
    d.jacobian_of(&feet, &a, &mut jac);
    assert!(jac.iter().all(|v| (v - 1.0).abs() < 1e-6), "{jac:?}");
}
