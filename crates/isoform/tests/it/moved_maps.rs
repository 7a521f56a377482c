//! Surfaces whose parameters are changed by a projectivity: everything is proved, and the surface
//! agrees with closed forms.

use isoform::Control;
use isoform::triangulate_map;
use isoform_algebra::RBig;
use isoform_tess::{Budget, Map, MeshOptions, Mode, Surface, TriangulateOptions};
use std::collections::BTreeSet;

/// Triangulates the surface of forms in A, B and C for s, t and w, in other parameters, with joined
/// sheets; asserts that everything is proved.
fn certified(forms: [&str; 4], half_width: i32) -> Surface {
    let moved = |t: &str| {
        t.replace('A', "(-4*s - 9*t - 9)")
            .replace('B', "(9*s + 12*t - 9)")
            .replace('C', "(-12*s + 4*t - 8)")
    };
    let texts = forms.map(moved);
    let map = Map::parse(texts.each_ref().map(String::as_str), Default::default()).expect("a map");
    let size = f64::from(half_width);
    let options = TriangulateOptions {
        half_width: RBig::from(half_width),
        domain: None,
        mode: Mode::Glued,
        mesh: MeshOptions {
            tolerance: 5e-4 * size,
            longest: 0.25 * size,
            triangles: 400_000,
        },
        budget: Budget::default(),
    };
    let (surface, _) = triangulate_map(&map, &options, &Control::default()).expect("not stopped");
    assert!(surface.is_certified(), "{:?}", surface.findings);
    surface
}

fn cross(a: [f64; 3], b: [f64; 3]) -> f64 {
    let c = [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);
    c.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn area(surface: &Surface) -> f64 {
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| surface.points[v as usize]);
        0.5 * cross(minus(b, a), minus(c, a))
    };
    surface.triangles.iter().map(of).sum()
}

/// Returns the area within the box of the surface (s, t) ↦ point, over s = tan α, t = tan β: that
/// of small cells, half the product of the diagonals each, whose centres are in the box.
fn area_of_cells(point: impl Fn(f64, f64) -> [f64; 3], half_width: f64) -> f64 {
    const N: usize = 1500;
    let at = |i: f64, j: f64| {
        let angle = |k: f64| std::f64::consts::PI * (k / N as f64 - 0.5);
        point(angle(i).tan(), angle(j).tan())
    };
    let mut area = 0.0;
    for i in 0..N {
        for j in 0..N {
            let (i, j) = (i as f64, j as f64);
            if at(i + 0.5, j + 0.5).iter().all(|x| x.abs() <= half_width) {
                // Inside of the cell, as its corners may be poles.
                let (near, far) = (0.25, 0.75);
                let diagonals = [
                    minus(at(i + far, j + far), at(i + near, j + near)),
                    minus(at(i + far, j + near), at(i + near, j + far)),
                ];
                area += 4.0 * 0.5 * cross(diagonals[0], diagonals[1]);
            }
        }
    }
    area
}

/// Returns V − E + F of the vertices in use.
fn euler(surface: &Surface) -> i64 {
    let (mut vertices, mut edges) = (BTreeSet::new(), BTreeSet::new());
    for t in &surface.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            vertices.insert(a);
            edges.insert([a.min(b), a.max(b)]);
        }
    }
    vertices.len() as i64 - edges.len() as i64 + surface.triangles.len() as i64
}

/// Bohemian dome, on which a line is contracted to a point of a seam: strips next to the seam are
/// narrower there than the sagitta of their chords, unless these are short.
///
/// The dome is x = cos a, y = sin a + cos b, z = sin b: a torus (χ = 0) whose points (a, b) and
/// (−a, π − b) coincide on y = 0. There sin a = −cos b, two circles of the torus that cross in two
/// points (χ = −2); their image is two segments that cross (χ = 1). So χ of the image is 0 + 2 + 1.
#[test]
fn narrow_strips_at_a_seam() {
    let surface = certified(
        [
            "(C^2 - A^2)*(C^2 + B^2)",
            "2*A*C*(C^2 + B^2) + (C^2 + A^2)*(C^2 - B^2)",
            "2*B*C*(C^2 + A^2)",
            "(C^2 + A^2)*(C^2 + B^2)",
        ],
        3,
    );
    assert_eq!(euler(&surface), 3);
    for [x, y, z] in &surface.points {
        let f = (y * y - x * x + z * z).powi(2) - 4.0 * y * y * (1.0 - x * x);
        assert!(f.abs() < 1e-12, "{f} at {x} {y} {z}");
    }
    let exact = area_of_cells(
        |s, t| {
            let (p, q) = (1.0 + s * s, 1.0 + t * t);
            [
                (1.0 - s * s) / p,
                2.0 * s / p + (1.0 - t * t) / q,
                2.0 * t / q,
            ]
        },
        3.0,
    );
    let share = area(&surface) / exact;
    assert!((share - 1.0).abs() < 5e-3, "{share} of {exact}");
}

/// X, Y and Z vanish to second order along a line. Derivatives do not show that its image is
/// straight, and vertices once crowded on it.
///
/// x = s / d², y = t / d², z = (s² + 1) / d² with d = s² + t² − 1. So q = d² satisfies x² q² − z q
/// + 1 = 0 and ((x² + y²) q² − 1)² = q.
#[test]
fn vertices_on_a_line_contracted_to_second_order() {
    let surface = certified(
        ["A*C^3", "B*C^3", "A^2*C^2 + C^4", "(A^2 + B^2 - C^2)^2"],
        3,
    );
    for [x, y, z] in &surface.points {
        // The line's image, where q is infinite.
        if [x, y, z].iter().all(|c| **c == 0.0) {
            continue;
        }
        let root = (z * z - 4.0 * x * x).max(0.0).sqrt();
        let off = [2.0 / (z + root), 2.0 / (z - root)].map(|q| {
            let r = (x * x + y * y) * q * q;
            ((r - 1.0).powi(2) - q).abs() / ((r + 1.0).powi(2) + q)
        });
        let least = off[0].min(off[1]);
        assert!(least < 1e-7, "{least} at {x} {y} {z}");
    }
    let exact = area_of_cells(
        |s, t| {
            let q = (s * s + t * t - 1.0).powi(2);
            [s / q, t / q, (s * s + 1.0) / q]
        },
        3.0,
    );
    let share = area(&surface) / exact;
    assert!((share - 1.0).abs() < 5e-3, "{share} of {exact}");
}
