//! The measure that meshes are optimised for: the biased minimum sine of the dihedral angles.
//!
//! sin θ for acute angles, 0.7 sin θ for obtuse ones (Klingner and Shewchuk, Aggressive tetrahedral
//! mesh improvement, 2007): one number that falls to 0 for every kind of bad tetrahedron, and rates
//! 20° and 150° equally bad.

use isoform_check::quality::OBTUSE_WEIGHT;
use isoform_geom::{Point3, TET_FACES, cross, dot, norm, sub};

/// Edges of a tetrahedron with the two faces (by opposite vertex) that meet there.
const EDGES: [[usize; 4]; 6] = [
    [0, 1, 2, 3],
    [0, 2, 1, 3],
    [0, 3, 1, 2],
    [1, 2, 0, 3],
    [1, 3, 0, 2],
    [2, 3, 0, 1],
];

/// Returns the outward area vectors (twice the area) of the faces opposite to each vertex, and six
/// times the volume.
fn faces(p: [Point3; 4]) -> ([Point3; 4], f64) {
    let (u, v, w) = (sub(p[1], p[0]), sub(p[2], p[0]), sub(p[3], p[0]));
    let (n1, n2, n3) = (cross(w, v), cross(u, w), cross(v, u));
    let n0 = [
        -(n1[0] + n2[0] + n3[0]),
        -(n1[1] + n2[1] + n3[1]),
        -(n1[2] + n2[2] + n3[2]),
    ];
    ([n0, n1, n2, n3], -dot(u, n1))
}

/// Returns the smallest biased sine of the six dihedral angles; ≤ 0 for a flat or inverted
/// tetrahedron.
pub(crate) fn biased_sine(p: [Point3; 4]) -> f64 {
    OppositeFace::new([p[1], p[2], p[3]]).biased_sine(p[0])
}

/// Returns the squared weight of a dihedral angle, from the dot product of the outward normals:
/// [`OBTUSE_WEIGHT`] squared if it is positive, as the angle is obtuse.
fn weight(normals: f64) -> f64 {
    if normals > 0.0 {
        OBTUSE_WEIGHT * OBTUSE_WEIGHT
    } else {
        1.0
    }
}

/// The face of a tetrahedron opposite to the vertex that is to be placed, with all quantities that
/// do not depend on the vertex.
#[derive(Clone, Copy, Debug)]
struct OppositeFace {
    q: [Point3; 3],
    /// Outward area vector, twice the area long.
    n: Point3,
    area: f64,
    /// Squared lengths of the edges opposite to the corners.
    edges: [f64; 3],
}

impl OppositeFace {
    /// Creates the face opposite to a vertex. The tetrahedron is positive with the vertex before
    /// the three corners.
    fn new(q: [Point3; 3]) -> Self {
        let (e, f, g) = (sub(q[1], q[0]), sub(q[2], q[0]), sub(q[2], q[1]));
        let n = cross(e, f);
        Self {
            q,
            n,
            area: dot(n, n),
            edges: [dot(g, g), dot(f, f), dot(e, e)],
        }
    }

    /// Returns the square of the smallest biased sine, with the sign of the volume; −1 where it is
    /// not a number.
    ///
    /// Squares avoid roots, and the common denominator of the six needs only one division: sin²θ =
    /// V² |e|²/(a_k a_l), where a are the squared areas.
    fn square(&self, p: Point3) -> f64 {
        let [u, v, w] = self.q.map(|q| sub(q, p));
        let volume = dot(u, self.n);
        let (n1, n2, n3) = (cross(w, v), cross(u, w), cross(v, u));
        let (a0, a1, a2, a3) = (self.area, dot(n1, n1), dot(n2, n2), dot(n3, n3));
        let least = |a: f64, b: f64| if a < b { a } else { b };
        let (a01, a02, a03, a12, a13, a23) = (a0 * a1, a0 * a2, a0 * a3, a1 * a2, a1 * a3, a2 * a3);
        // Edges at the vertex lie between two of its faces, the others between one and the opposite
        // face.
        let x = weight(dot(n2, n3)) * dot(u, u) * a01;
        let y = weight(dot(n1, n3)) * dot(v, v) * a02;
        let z = weight(dot(n1, n2)) * dot(w, w) * a03;
        let r = weight(dot(self.n, n1)) * self.edges[0] * a23;
        let s = weight(dot(self.n, n2)) * self.edges[1] * a13;
        let t = weight(dot(self.n, n3)) * self.edges[2] * a12;
        let worst = least(least(least(x, y), least(z, r)), least(s, t)) * volume * volume.abs()
            / (a01 * a23);
        // A repeated vertex gives NaN, and must not pass.
        if worst.is_nan() || worst == 0.0 {
            -1.0
        } else {
            worst
        }
    }

    fn biased_sine(&self, p: Point3) -> f64 {
        root(self.square(p))
    }
}

/// Returns the square root of the absolute value, with the sign of the argument.
fn root(s: f64) -> f64 {
    s.abs().sqrt().copysign(s)
}

/// Tetrahedra and faces of the surface around a vertex, while positions for it are tried.
#[derive(Default)]
pub(crate) struct VertexStar {
    tets: Vec<OppositeFace>,
    /// Other two corners of each face of the surface, in its orientation.
    faces: Vec<[Point3; 2]>,
    /// Measures that are not far above the worst one, with their gradients.
    terms: Vec<(f64, Point3)>,
    /// Gradients of the measures that are nearly as bad as the worst one.
    active: Vec<Point3>,
}

/// Distance from the worst term within which terms decide the direction of a move together with it.
const ACTIVE_TERM_RANGE: f64 = 0.04;
/// Distance from the worst term within which terms limit the length of a move.
const LIMITING_TERM_RANGE: f64 = 0.25;

impl VertexStar {
    pub(crate) fn clear(&mut self) {
        self.tets.clear();
        self.faces.clear();
    }

    /// Adds a tetrahedron with corners `p`, of which the one at `x` is to be placed.
    pub(crate) fn push(&mut self, p: [Point3; 4], x: usize) {
        // Even permutations that bring x to the front.
        const OTHERS: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
        self.tets.push(OppositeFace::new(OTHERS[x].map(|k| p[k])));
    }

    /// Adds a face of the surface, by its other two corners.
    pub(crate) fn push_face(&mut self, others: [Point3; 2]) {
        self.faces.push(others);
    }

    /// Returns the mean of the tetrahedra's centroids, weighted by their volumes: the optimum of
    /// Chen's optimal Delaunay triangulations, but with centroids in place of circumcentres, which
    /// run off in flat tetrahedra.
    pub(crate) fn centre(&self, p: Point3) -> Point3 {
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for t in &self.tets {
            let volume = dot(sub(t.q[0], p), t.n);
            total += volume;
            for i in 0..3 {
                sum[i] += volume * (t.q[0][i] + t.q[1][i] + t.q[2][i] - 3.0 * p[i]);
            }
        }
        std::array::from_fn(|i| p[i] + 0.25 * sum[i] / total)
    }

    /// Returns the worst measure with the vertex at `p`; any value up to `bound` if the worst is
    /// not above that.
    pub(crate) fn worst(&mut self, p: Point3, bound: f64) -> f64 {
        let limit = bound * bound.abs();
        let mut worst = f64::INFINITY;
        for (k, t) in self.tets.iter().enumerate() {
            let s = t.square(p);
            if s <= limit {
                // Most likely also the first one to fail the next time.
                self.tets.swap(0, k);
                return root(s);
            }
            worst = if s < worst { s } else { worst };
        }
        let mut worst = root(worst);
        for f in &self.faces {
            worst = worst.min(smallest_sine([p, f[0], f[1]]));
            if worst <= bound {
                break;
            }
        }
        worst
    }

    /// Returns the direction in which the worst terms all grow (the shortest vector in the convex
    /// hull of their gradients), and a length to try; `None` at a maximum. Gradients are projected
    /// by `tangent` onto the directions in which the vertex may move.
    pub(crate) fn direction(
        &mut self,
        p: Point3,
        worst: f64,
        tangent: impl Fn(Point3) -> Point3,
    ) -> Option<(Point3, f64)> {
        let shortest = self.collect_terms(p, worst, tangent);
        let d = shortest_in_hull(&self.active);
        let slope = dot(d, d);
        // The worst terms would hardly grow over the length of the shortest edge: the vertex stays.
        if slope.is_nan() || slope.sqrt() * shortest < 1e-4 {
            return None;
        }
        // As far as no other term falls below the active ones in the linear model.
        let mut step = 0.5 * shortest / slope.sqrt();
        for (s, g) in &self.terms {
            let rate = slope - dot(*g, d);
            if *s > worst + ACTIVE_TERM_RANGE && rate > 0.0 {
                step = step.min((s - worst) / rate);
            }
        }
        Some((d, step))
    }

    /// Collects the terms that are not far above the worst one, and the gradients of those that are
    /// nearly as bad. Returns the length of the shortest edge at the vertex.
    fn collect_terms(&mut self, p: Point3, worst: f64, tangent: impl Fn(Point3) -> Point3) -> f64 {
        let Self {
            tets,
            faces,
            terms,
            active,
        } = self;
        terms.clear();
        active.clear();
        let mut push = |s: f64, g: Point3| {
            if s < worst + LIMITING_TERM_RANGE {
                let g = tangent(g);
                terms.push((s, g));
                if s <= worst + ACTIVE_TERM_RANGE {
                    active.push(g);
                }
            }
        };
        let mut shortest = f64::INFINITY;
        let limit = (worst + LIMITING_TERM_RANGE) * (worst + LIMITING_TERM_RANGE).abs();
        for t in tets.iter() {
            for q in t.q {
                let e = sub(q, p);
                shortest = dot(e, e).min(shortest);
            }
            if t.square(p) < limit {
                for (s, g) in biased_sines([p, t.q[0], t.q[1], t.q[2]], 0) {
                    push(s, g);
                }
            }
        }
        for f in faces.iter() {
            let (s, g) = smallest_sine_and_derivative([p, f[0], f[1]]);
            push(s, g);
        }
        shortest.sqrt()
    }
}

/// Returns approximately the shortest vector in the convex hull of the gradients, by Gilbert's
/// iteration: along it all of them grow.
fn shortest_in_hull(gradients: &[Point3]) -> Point3 {
    let mut d: Point3 = [0.0; 3];
    let mut least = f64::INFINITY;
    for g in gradients {
        let n = dot(*g, *g);
        if n < least {
            (d, least) = (*g, n);
        }
    }
    // A rough answer suffices.
    for _ in 0..16 {
        let (mut lowest, mut g) = (f64::INFINITY, d);
        for h in gradients {
            let k = dot(*h, d);
            if k < lowest {
                (lowest, g) = (k, *h);
            }
        }
        // No gradient falls far short of the vector: it is nearly the shortest.
        if lowest >= 0.95 * dot(d, d) {
            break;
        }
        let e = sub(g, d);
        let t = (-dot(d, e) / dot(e, e).max(1e-300)).clamp(0.0, 1.0);
        d = std::array::from_fn(|i| d[i] + t * e[i]);
    }
    d
}

/// Returns the six biased sines with their derivatives by the position of vertex `x`.
pub(crate) fn biased_sines(p: [Point3; 4], x: usize) -> [(f64, Point3); 6] {
    let (n, volume) = faces(p);
    let area = n.map(norm);
    // ∇V₆ = minus the outward area vector of the face opposite to x.
    let dv = n[x].map(|v| -v);
    let da = area_gradients(p, x, n, area);
    EDGES.map(|[a, b, k, l]| {
        let e = sub(p[a], p[b]);
        let length = norm(e);
        let bias = if dot(n[k], n[l]) > 0.0 {
            OBTUSE_WEIGHT
        } else {
            1.0
        };
        let scale = bias * length / (area[k] * area[l]);
        let s = scale * volume;
        let sign = if a == x {
            1.0
        } else if b == x {
            -1.0
        } else {
            0.0
        };
        let g = std::array::from_fn(|i| {
            scale * dv[i]
                + s * (sign * e[i] / (length * length) - da[k][i] / area[k] - da[l][i] / area[l])
        });
        (s, g)
    })
}

/// Returns ∇|n_k| for the faces that hold vertex `x`: (q − r) × n̂ for its other vertices q, r in
/// the orientation of n.
#[inline]
fn area_gradients(p: [Point3; 4], x: usize, n: [Point3; 4], area: [f64; 4]) -> [Point3; 4] {
    let mut da = [[0.0; 3]; 4];
    for k in (0..4).filter(|&k| k != x) {
        let f = TET_FACES[k];
        let at = f.iter().position(|&i| i == x).unwrap_or(0);
        let (q, r) = (p[f[(at + 1) % 3]], p[f[(at + 2) % 3]]);
        let unit = n[k].map(|v| v / area[k]);
        da[k] = cross(sub(q, r), unit);
    }
    da
}

/// Returns the sine of the smallest angle of a triangle.
pub(crate) fn smallest_sine(p: [Point3; 3]) -> f64 {
    smallest_sine_and_derivative(p).0
}

/// Returns the sine of the smallest angle of a triangle, with its derivative by the first vertex.
pub(crate) fn smallest_sine_and_derivative(p: [Point3; 3]) -> (f64, Point3) {
    // The smallest angle is opposite to the shortest edge: its sine is twice the area over the
    // product of the other two.
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
    (
        s,
        std::array::from_fn(|k| s * (da[k] / area - di[k] - dj[k])),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const P: [Point3; 4] = [
        [0.1, 0.0, 0.2],
        [1.0, 0.1, 0.0],
        [0.2, 0.9, 0.1],
        [0.3, 0.2, 1.1],
    ];

    #[test]
    fn known_angles() {
        let regular = [
            [1.0, 1.0, 1.0],
            [-1.0, 1.0, -1.0],
            [1.0, -1.0, -1.0],
            [-1.0, -1.0, 1.0],
        ];
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
                    assert!(
                        (exact[k].1[i] - (hi[k] - lo[k]) / 2e-6).abs() < 1e-8,
                        "vertex {x} axis {i} edge {k}"
                    );
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
            assert!(
                (smallest_sine_and_derivative(t).1[i] - (at(1e-6) - at(-1e-6)) / 2e-6).abs() < 1e-8
            );
        }
    }
}
