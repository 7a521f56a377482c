//! The measure that meshes are optimised for: the biased minimum sine of the dihedral angles.
//!
//! sin θ for acute angles, 0.7 sin θ for obtuse ones (Klingner and Shewchuk, Aggressive tetrahedral mesh improvement, 2007): one
//! number that falls to 0 for every kind of bad tetrahedron, and holds 20° and 150° equally bad.

use crate::quality::OBTUSE_WEIGHT;
use isoform_geom::{Point3, cross, dot, norm, sub};

/// Edges of a tetrahedron with the two faces (by opposite vertex) that meet there.
const EDGES: [[usize; 4]; 6] = [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 0, 2], [2, 3, 0, 1]];

/// Outward area vectors (twice the area) of the faces opposite to each vertex, and six times the volume.
fn faces(p: [Point3; 4]) -> ([Point3; 4], f64) {
    let (u, v, w) = (sub(p[1], p[0]), sub(p[2], p[0]), sub(p[3], p[0]));
    let (n1, n2, n3) = (cross(w, v), cross(u, w), cross(v, u));
    let n0 = [-(n1[0] + n2[0] + n3[0]), -(n1[1] + n2[1] + n3[1]), -(n1[2] + n2[2] + n3[2])];
    ([n0, n1, n2, n3], -dot(u, n1))
}

/// Smallest biased sine of the six dihedral angles; ≤ 0 for a flat or inverted tetrahedron.
pub(crate) fn biased_sine(p: [Point3; 4]) -> f64 {
    let (n, volume) = faces(p);
    let area = n.map(|n| dot(n, n).sqrt());
    let mut worst = f64::INFINITY;
    for [a, b, k, l] in EDGES {
        let s = volume * norm(sub(p[a], p[b])) / (area[k] * area[l]);
        // Outward normals at less than a right angle: the dihedral angle is obtuse.
        let s = if dot(n[k], n[l]) > 0.0 { OBTUSE_WEIGHT * s } else { s };
        // A repeated vertex gives no number, and must not pass.
        if s.is_nan() || s <= 0.0 {
            return if s < 0.0 { s } else { -1.0 };
        }
        worst = worst.min(s);
    }
    worst
}

/// The six biased sines with their derivatives by the position of vertex `x`.
pub(crate) fn biased_sines(p: [Point3; 4], x: usize) -> [(f64, Point3); 6] {
    let (n, volume) = faces(p);
    let area = n.map(norm);
    // ∇V₆ = minus the outward area vector of the face opposite to x.
    let dv = n[x].map(|v| -v);
    // ∇|n_k| for the faces that hold x: (p − q) × n̂ for its other vertices p, q in the sense of n.
    let mut da = [[0.0; 3]; 4];
    for k in (0..4).filter(|&k| k != x) {
        let f = isoform_geom::TET_FACES[k];
        let at = f.iter().position(|&i| i == x).unwrap_or(0);
        let (q, r) = (p[f[(at + 1) % 3]], p[f[(at + 2) % 3]]);
        let unit = n[k].map(|v| v / area[k]);
        da[k] = cross(sub(q, r), unit);
    }
    EDGES.map(|[a, b, k, l]| {
        let e = sub(p[a], p[b]);
        let length = norm(e);
        let bias = if dot(n[k], n[l]) > 0.0 { OBTUSE_WEIGHT } else { 1.0 };
        let scale = bias * length / (area[k] * area[l]);
        let s = scale * volume;
        let sign = if a == x {
            1.0
        } else if b == x {
            -1.0
        } else {
            0.0
        };
        let g = std::array::from_fn(|i| scale * dv[i] + s * (sign * e[i] / (length * length) - da[k][i] / area[k] - da[l][i] / area[l]));
        (s, g)
    })
}

/// Sine of the smallest angle of a triangle.
pub(crate) fn smallest_sine(p: [Point3; 3]) -> f64 {
    smallest_sine_and_derivative(p).0
}

/// The same with its derivative by the first vertex.
pub(crate) fn smallest_sine_and_derivative(p: [Point3; 3]) -> (f64, Point3) {
    // The smallest angle is opposite to the shortest edge: its sine is twice the area over the product of the other two.
    let n = cross(sub(p[1], p[0]), sub(p[2], p[0]));
    let area = norm(n);
    let e = [sub(p[2], p[1]), sub(p[0], p[2]), sub(p[1], p[0])];
    let l = e.map(norm);
    let short = (0..3).fold(0, |s, i| if l[i] < l[s] { i } else { s });
    let (i, j) = ((short + 1) % 3, (short + 2) % 3);
    let s = area / (l[i] * l[j]);
    if s.is_nan() || s <= 0.0 {
        return (0.0, [0.0; 3]);
    }
    let da = cross(sub(p[1], p[2]), n.map(|v| v / area));
    // d|e|/dp0: e1 = p0 − p2, e2 = p1 − p0.
    let dl = |k: usize| match k {
        1 => e[1].map(|v| v / (l[1] * l[1])),
        2 => e[2].map(|v| -v / (l[2] * l[2])),
        _ => [0.0; 3],
    };
    let (di, dj) = (dl(i), dl(j));
    (s, std::array::from_fn(|k| s * (da[k] / area - di[k] - dj[k])))
}

#[cfg(test)]
mod tests {
    use super::*;

    const P: [Point3; 4] = [[0.1, 0.0, 0.2], [1.0, 0.1, 0.0], [0.2, 0.9, 0.1], [0.3, 0.2, 1.1]];

    #[test]
    fn known_angles() {
        let regular = [[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]];
        assert!((biased_sine(regular) - (8.0f64 / 9.0).sqrt()).abs() < 1e-12);
        // A corner of the cube: three right angles, three of 54.7356 degrees.
        let corner = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!((biased_sine(corner) - (2.0f64 / 3.0).sqrt()).abs() < 1e-12);
        let mut inverted = corner;
        inverted.swap(0, 1);
        assert!(biased_sine(inverted) < 0.0);
        let halves = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert!((smallest_sine(halves) - 0.5f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn derivatives_agree_with_differences() {
        for x in 0..4 {
            let exact = biased_sines(P, x);
            for i in 0..3 {
                let at = |h: f64| {
                    let mut q = P;
                    q[x][i] += h;
                    biased_sines(q, x).map(|s| s.0)
                };
                let (lo, hi) = (at(-1e-6), at(1e-6));
                for k in 0..6 {
                    assert!((exact[k].1[i] - (hi[k] - lo[k]) / 2e-6).abs() < 1e-8, "vertex {x} axis {i} edge {k}");
                }
            }
        }
        let t = [P[0], P[1], P[3]];
        for i in 0..3 {
            let at = |h: f64| {
                let mut q = t;
                q[0][i] += h;
                smallest_sine(q)
            };
            assert!((smallest_sine_and_derivative(t).1[i] - (at(1e-6) - at(-1e-6)) / 2e-6).abs() < 1e-8);
        }
    }
}
