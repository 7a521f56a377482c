//! What hides between lattice points: thin walls, narrow gaps and links, and sheets that face each
//! other closely.

use super::Refiner;
use super::curvature::curvature;
use crate::complex::{Complex, Ring};
use crate::points::{along, unit};
use crate::surface::Surface;
use isoform_geom::{Point3, dot, norm, sub};
use rayon::prelude::*;

/// Places on an edge where the sign is looked at: a wall or gap as thin as a quarter of the edge is
/// seen.
const LOOKS: [f64; 3] = [0.25, 0.5, 0.75];
/// The surface counts if it reaches across an edge by this share of the edge's length; less is the
/// sagitta of a curved surface.
const DEPTH: f64 = 0.08;
/// How far behind an edge that cuts off a ridge the body is looked at, and how deep it is there, in
/// lengths of the edge: a ridge of 40 degrees is 1.4 deep. What is less deep anywhere, as a needle
/// or a wall, is less than two edges thick, which the lattice need not follow.
const BEHIND: f64 = 4.0;
const DEEPER: f64 = 1.1;
/// Steps in which that way is gone, along the normals.
const WAY: usize = 16;
/// Times that edges are halved in search of what hides between lattice points.
const ROUNDS: usize = 4;

/// Two sheets that face each other may meet if they are nearer to each other than this many times
/// the sum of their sagittas.
const CLOSE: f64 = 2.0;
/// A piece may pass through a tetrahedron if its distance from the tetrahedron's middle is less
/// than this many lengths of the edges.
const NEAR: f64 = 0.7;
/// Two pieces face each other if the cosine between their normals is below this.
const FACING: f64 = -0.8;

/// A piece that passes near the middle of a tetrahedron.
struct Sheet {
    piece: u32,
    /// Distance to first order.
    distance: f64,
    normal: Point3,
}

/// Whether two pieces face each other in a tetrahedron so closely that straight edges cannot tell
/// whether they meet.
fn is_close_call(surface: &Surface<'_>, complex: &Complex, t: u32) -> bool {
    let (c, middle) = (complex.corners(t), complex.middle(t));
    let Some(reduced) = surface.reduced_in(surface.focus, middle) else {
        return false;
    };
    if reduced.pieces.len() < 2 {
        return false;
    }
    let length = norm(sub(c[0], c[1])).max(norm(sub(c[2], c[3])));
    let near: Vec<Sheet> = reduced
        .pieces
        .iter()
        .filter_map(|&piece| {
            let (g, d) = surface.solid.gradient(piece, middle);
            let l = norm(d);
            (l > 0.0 && g.abs() < NEAR * length * l).then(|| Sheet {
                piece,
                distance: g / l,
                normal: d.map(|v| v / l),
            })
        })
        .collect();
    let bend = |sheet: &Sheet| curvature(&surface.solid.jet(sheet.piece, middle));
    let too_close = |a: &Sheet, b: &Sheet| {
        let gap = (a.distance + b.distance).abs();
        dot(a.normal, b.normal) < FACING
            && gap > surface.zero
            && gap < length
            // The sagitta of a chord of length s on a circle of curvature κ is κ s²/8.
            && gap < CLOSE * (bend(a) + bend(b)) * length * length / 8.0
    };
    near.iter()
        .enumerate()
        .any(|(k, a)| near[..k].iter().any(|b| too_close(a, b)))
}

/// A tetrahedron with its vertices. Slots are reused by the halves, which are looked at in the
/// next round: what is found of a tetrahedron counts as long as its vertices are the same.
type Found = (u32, [u32; 4]);

/// The search for what hides between lattice points, from round to round.
struct Search<'s> {
    surface: &'s Surface<'s>,
    /// The solid's value at each vertex.
    values: Vec<f64>,
    /// Tetrahedra of the round before: they need not be looked at again, except for edges that
    /// could not be halved.
    before: Vec<[u32; 4]>,
    /// Edges that a piece crosses twice, sorted.
    twice: Vec<[u32; 2]>,
    /// Tetrahedra in which two pieces face each other closely.
    close: Vec<Found>,
}

impl Search<'_> {
    /// Looks at all that is new.
    fn look(&mut self, complex: &Complex) {
        let (surface, known) = (self.surface, self.values.len());
        self.values.par_extend(
            complex.points[known..]
                .par_iter()
                .map(|&p| surface.value(p).0),
        );
        let fresh: Vec<u32> = complex
            .live()
            .filter(|&t| self.before.get(t as usize) != Some(&complex.tets[t as usize]))
            .collect();
        let edges = self.edges(complex, &fresh);
        self.close = fresh
            .into_par_iter()
            .filter(|&t| !surface.control.is_stopped() && is_close_call(surface, complex, t))
            .map(|t| (t, complex.tets[t as usize]))
            .collect();
        self.twice = edges
            .into_par_iter()
            .filter(|&ends| !surface.control.is_stopped() && self.is_crossed_twice(complex, ends))
            .collect();
    }

    /// Edges that may be crossed twice: edges of new tetrahedra, and edges that could not be halved.
    fn edges(&self, complex: &Complex, fresh: &[u32]) -> Vec<[u32; 2]> {
        let mut edges: Vec<[u32; 2]> = fresh
            .iter()
            .flat_map(|&t| complex.edges(t))
            .filter(|&ends| self.may_be_crossed_twice(complex, ends))
            .collect();
        let mut ring = Ring::default();
        let left = self.twice.iter();
        edges.extend(left.filter(|e| complex.ring_of(e[0], e[1], &mut ring)));
        edges.par_sort_unstable();
        edges.dedup();
        edges
    }

    /// Values are distances, nearly: ends farther from the surface than the edge is long cannot see
    /// it twice.
    fn may_be_crossed_twice(&self, complex: &Complex, [a, b]: [u32; 2]) -> bool {
        let (f, g) = (self.values[a as usize], self.values[b as usize]);
        f * g > 0.0 && f.is_finite() && g.is_finite() && {
            let [p, q] = complex.points_of([a, b]);
            let d = sub(p, q);
            (f.abs() + g.abs()).powi(2) < dot(d, d)
        }
    }

    /// Whether one piece crosses an edge twice. Two pieces, one at each crossing, are told apart by
    /// their signs at the ends and cut one by one.
    fn is_crossed_twice(&self, complex: &Complex, [a, b]: [u32; 2]) -> bool {
        let [p, q] = complex.points_of([a, b]);
        let length = norm(sub(p, q));
        LOOKS.iter().any(|&t| {
            let (v, piece) = self.surface.value(along(p, q, t));
            v * self.values[a as usize] < 0.0
                && v.abs() > DEPTH * length
                && v * self.surface.distance(piece, p) < 0.0
                && v * self.surface.distance(piece, q) < 0.0
        })
    }

    /// Whether an edge that is crossed twice cuts off no more than a ridge, or a groove: from there
    /// on the body, or the gap, gets as deep as a sharp edge would. What is lost is the chamfer.
    fn is_ridge(&self, complex: &Complex, [a, b]: [u32; 2]) -> bool {
        let [p, q] = complex.points_of([a, b]);
        let length = norm(sub(p, q));
        let side = -self.values[a as usize].signum();
        let places = LOOKS.map(|t| along(p, q, t));
        let depth = |p: Point3| side * self.surface.value(p).0;
        let deepest = places
            .into_iter()
            .max_by(|x, y| depth(*x).total_cmp(&depth(*y)));
        deepest.is_some_and(|mut at| {
            for _ in 0..WAY {
                let (value, piece) = self.surface.value(at);
                // A cell that is decided is as deep as can be.
                if value.is_infinite() {
                    break;
                }
                let inwards = unit(self.surface.gradient(piece, at).1);
                let step = side * BEHIND * length / WAY as f64;
                at = std::array::from_fn(|i| at[i] + step * inwards[i]);
            }
            depth(at) > DEEPER * length
        })
    }

    /// Whether a tetrahedron is to be halved.
    fn is_wanted(&self, complex: &Complex, t: u32) -> bool {
        let found = (t, complex.tets[t as usize]);
        self.close.binary_search(&found).is_ok()
            || complex
                .edges(t)
                .iter()
                .any(|ends| self.twice.binary_search(ends).is_ok())
    }
}

impl Refiner<'_> {
    /// Halves edges that a piece of the surface crosses twice (both ends inside, or both outside,
    /// and a place between that is not), so that thin walls, gaps and narrow links are met by the
    /// lattice. Returns places where the last round still found such an edge, but for those that cut
    /// off a ridge.
    pub(crate) fn resolve(&mut self, surface: &Surface<'_>) -> Vec<Point3> {
        let mut search = Search {
            surface,
            values: Vec::new(),
            before: Vec::new(),
            twice: Vec::new(),
            close: Vec::new(),
        };
        for round in 0..=ROUNDS {
            search.look(&self.complex);
            if search.twice.is_empty() && search.close.is_empty() {
                return Vec::new();
            }
            let is_full = self.complex.tets.len() > self.limit;
            if round == ROUNDS || is_full || surface.control.is_stopped() {
                break;
            }
            search.before.clone_from(&self.complex.tets);
            self.bisect(|complex, t| match search.is_wanted(complex, t) {
                true => 0.0,
                false => f64::INFINITY,
            });
        }
        let left = search.twice.iter();
        let left = left.filter(|ends| !search.is_ridge(&self.complex, **ends));
        left.map(|&[a, _]| self.complex.point(a)).collect()
    }
}
