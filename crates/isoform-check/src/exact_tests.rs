//! Tests of the exact predicates against a reference in rational arithmetic, which clips one
//! triangle by the other.

use super::*;
use proptest::prelude::*;

/// A rational point (x, y, z)/w with w > 0, in lowest terms.
type Rational = [i128; 4];

fn gcd(a: i128, b: i128) -> i128 {
    if b == 0 { a.abs() } else { gcd(b, a % b) }
}

fn lowest(p: Rational) -> Rational {
    let g = p.iter().fold(0, |g, &v| gcd(g, v)) * p[3].signum();
    p.map(|v| v / g)
}

fn cross_i(a: [i128; 3], b: [i128; 3]) -> [i128; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn minus(a: [i128; 3], b: [i128; 3]) -> [i128; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Returns the part of a convex polygon (also a segment or a point) where n · x ≥ n · o.
fn clip(polygon: &[Rational], n: [i128; 3], o: [i128; 3]) -> Vec<Rational> {
    let height = |p: &Rational| (0..3).map(|i| n[i] * (p[i] - o[i] * p[3])).sum::<i128>();
    let mut out = Vec::new();
    for (i, p) in polygon.iter().enumerate() {
        let q = &polygon[(i + 1) % polygon.len()];
        let (s, t) = (height(p), height(q));
        if s >= 0 {
            out.push(*p);
        }
        if s.signum() * t.signum() < 0 {
            // p/w₀ and q/w₁ have the heights s/w₀ and t/w₁; the point of height 0 is (t p − s q)/(t
            // w₀ − s w₁).
            out.push(lowest(std::array::from_fn(|k| t * p[k] - s * q[k])));
        }
    }
    out
}

/// Returns all corners of the intersection of two triangles.
fn intersection(a: [[i128; 3]; 3], b: [[i128; 3]; 3]) -> Vec<Rational> {
    let mut polygon: Vec<Rational> = a.iter().map(|p| [p[0], p[1], p[2], 1]).collect();
    let n = cross_i(minus(b[1], b[0]), minus(b[2], b[0]));
    polygon = clip(&polygon, n, b[0]);
    polygon = clip(&polygon, n.map(|v| -v), b[0]);
    for k in 0..3 {
        polygon = clip(&polygon, cross_i(n, minus(b[(k + 1) % 3], b[k])), b[k]);
    }
    polygon
}

/// Returns true if the triangles have a common point outside of what they share by index.
fn reference(points: &[[i128; 3]], a: [u32; 3], b: [u32; 3]) -> bool {
    let at = |t: [u32; 3]| t.map(|i| points[i as usize]);
    let shared: Vec<[i128; 3]> = a
        .iter()
        .filter(|i| b.contains(i))
        .map(|&i| points[i as usize])
        .collect();
    intersection(at(a), at(b)).iter().any(|p| match shared[..] {
        [] => true,
        [v] => (0..3).any(|i| p[i] != v[i] * p[3]),
        [v, w] => {
            let (e, d) = (minus(w, v), std::array::from_fn(|i| p[i] - v[i] * p[3]));
            cross_i(e, d) != [0; 3]
        }
        _ => false,
    })
}

fn doubles(points: &[[i128; 3]]) -> Vec<Point3> {
    points.iter().map(|p| p.map(|v| v as f64)).collect()
}

/// Generates six nodes on a small grid, and two triangles over them with zero, one or two corners
/// in common, in any order.
fn two_triangles(size: i128) -> impl Strategy<Value = (Vec<[i128; 3]>, [u32; 3], [u32; 3])> {
    let second = prop::sample::select(vec![[3u32, 4, 5], [0, 3, 4], [0, 1, 3]]);
    let order = || Just([0usize, 1, 2]).prop_shuffle();
    (
        prop::collection::vec([0..size, 0..size, 0..size], 6),
        second,
        order(),
        order(),
    )
        .prop_map(|(points, b, i, j)| (points, i.map(|k| k as u32), j.map(|k| b[k])))
}

fn agree(points: &[[i128; 3]], a: [u32; 3], b: [u32; 3]) -> Result<(), TestCaseError> {
    let p = doubles(points);
    let flat = |t: [u32; 3]| {
        let [u, v, w] = t.map(|i| points[i as usize]);
        cross_i(minus(v, u), minus(w, u)) == [0; 3]
    };
    for t in [a, b] {
        prop_assert_eq!(is_flat(t.map(|i| p[i as usize])), flat(t));
    }
    if !flat(a) && !flat(b) {
        prop_assert_eq!(triangles_meet(&p, a, b), reference(points, a, b));
        prop_assert_eq!(triangles_meet(&p, b, a), reference(points, a, b));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, ..ProptestConfig::default() })]

    /// Uses a grid so small that nearly all cases are degenerate.
    #[test]
    fn on_the_smallest_grid((points, a, b) in two_triangles(2)) {
        agree(&points, a, b)?;
    }
    #[test]
    fn on_a_small_grid((points, a, b) in two_triangles(4)) {
        agree(&points, a, b)?;
    }
    #[test]
    fn on_a_larger_grid((points, a, b) in two_triangles(40)) {
        agree(&points, a, b)?;
    }
    /// Uses one slanted plane: x + 2y + 3z = 0, spanned by the lattice vectors (2, −1, 0) and (1,
    /// 1, −1).
    #[test]
    fn in_one_plane((points, a, b) in two_triangles(5)) {
        let flat: Vec<_> = points.iter().map(|p| [2 * p[0] + p[1], p[1] - p[0], -p[1]]).collect();
        agree(&flat, a, b)?;
    }
}

/// Tests a triangle inside another one in its plane, where no edges cross.
#[test]
fn one_within_the_other() {
    let points = [
        [0, 0, 0],
        [9, 9, 0],
        [0, 9, 9],
        [3, 5, 2],
        [2, 5, 3],
        [4, 6, 2],
    ];
    for (a, b) in [([0, 1, 2], [3, 4, 5]), ([3, 4, 5], [0, 1, 2])] {
        assert!(reference(&points, a, b) && triangles_meet(&doubles(&points), a, b));
    }
}

/// Tests grids so far from the origin that rounding would decide.
#[test]
fn far_from_the_origin() {
    let mut random = 1u64;
    let mut next = || {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        i128::from(random >> 60)
    };
    let (mut hits, mut misses) = (0, 0);
    for _ in 0..5000 {
        let offset = [1i128 << 50, 3 << 48, 5 << 47];
        let points: Vec<[i128; 3]> = (0..6).map(|_| std::array::from_fn(|_| next())).collect();
        let moved: Vec<Point3> = points
            .iter()
            .map(|p| std::array::from_fn(|i| (p[i] + offset[i]) as f64))
            .collect();
        for (a, b) in [
            ([0, 1, 2], [3, 4, 5]),
            ([0, 1, 2], [0, 3, 4]),
            ([0, 1, 2], [1, 0, 3]),
        ] {
            if [a, b]
                .iter()
                .any(|t: &[u32; 3]| is_flat(t.map(|i| moved[i as usize])))
            {
                continue;
            }
            let truth = reference(&points, a, b);
            assert_eq!(
                triangles_meet(&moved, a, b),
                truth,
                "{points:?} {a:?} {b:?}"
            );
            *if truth { &mut hits } else { &mut misses } += 1;
        }
    }
    assert!(hits > 500 && misses > 500, "{hits} {misses}");
}

/// Checks that the quick tests separate most triangles around a node.
#[test]
fn quick_answers_for_neighbours() {
    // Six triangles around a node, in a plane that contains no double exactly.
    let ring: Vec<Point3> = (0..6)
        .map(|k| {
            let (s, c) = (f64::from(k) * 1.047).sin_cos();
            [c, s, 0.3 * c - 0.7 * s]
        })
        .collect();
    for k in 0..6 {
        let triangle = |k: usize| [[0.0; 3], ring[k % 6], ring[(k + 1) % 6]];
        for other in k + 2..(k + 5).min(6) {
            assert!(corner_apart(triangle(k), triangle(other)), "{k} {other}");
        }
    }
}
