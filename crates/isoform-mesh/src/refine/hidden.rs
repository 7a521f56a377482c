//! Detection of features hidden between lattice points: thin walls, narrow gaps and links, and
//! close sheets facing each other.

use super::Refiner;
use super::curvature::curvature;
use crate::complex::{Complex, Ring};
use crate::points::{lerp, unit};
use crate::surface::Surface;
use isoform_geom::{Point3, dot, norm, sub};
use rayon::prelude::*;

/// Fractions of an edge at which the sign is sampled: walls or gaps thicker than a quarter of the
/// edge are detected.
const PROBE_FRACTIONS: [f64; 3] = [0.25, 0.5, 0.75];
/// Number of steps of the walk behind an edge, along the normals.
const RIDGE_WALK_STEPS: usize = 16;
/// Maximum number of bisections of an edge in search of hidden features.
const MAX_RESOLVE_ROUNDS: usize = 4;

/// A piece that passes near the centroid of a tetrahedron.
struct PieceSheet {
    piece: u32,
    /// First-order distance.
    distance: f64,
    normal: Point3,
}

/// Returns true if two pieces face each other in a tetrahedron so closely that straight edges
/// cannot tell if they meet.
fn is_close_call(surface: &Surface<'_>, complex: &Complex, t: u32) -> bool {
    let (c, middle) = (complex.corners(t), complex.middle(t));
    let Some(reduced) = surface.reduced_in(surface.focus, middle) else {
        return false;
    };
    if reduced.pieces.len() < 2 {
        return false;
    }
    let length = norm(sub(c[0], c[1])).max(norm(sub(c[2], c[3])));
    let near: Vec<PieceSheet> = reduced
        .pieces
        .iter()
        .filter_map(|&piece| {
            let (g, d) = surface.solid.gradient(piece, middle);
            let l = norm(d);
            // A piece farther away than 0.7 edge lengths does not pass through the tetrahedron.
            (l > 0.0 && g.abs() < 0.7 * length * l).then(|| PieceSheet {
                piece,
                distance: g / l,
                normal: d.map(|v| v / l),
            })
        })
        .collect();
    let bend = |sheet: &PieceSheet| curvature(&surface.solid.jet(sheet.piece, middle));
    let too_close = |a: &PieceSheet, b: &PieceSheet| {
        let gap = (a.distance + b.distance).abs();
        // Two pieces face each other if the angle between their normals is above 143 degrees.
        dot(a.normal, b.normal) < -0.8
            && gap > surface.zero
            && gap < length
            // Two sheets facing each other may meet if their gap is below twice the sum of their
            // sagittas. The sagitta of a chord of length s on a circle of curvature κ is κ s²/8.
            && gap < 2.0 * (bend(a) + bend(b)) * length * length / 8.0
    };
    near.iter()
        .enumerate()
        .any(|(k, a)| near[..k].iter().any(|b| too_close(a, b)))
}

/// A tetrahedron with its vertices. Slots are reused by halves, which are searched in the next
/// round: a result is valid as long as the vertices are unchanged.
type TetSnapshot = (u32, [u32; 4]);

/// Search for features hidden between lattice points, from round to round.
struct HiddenSearch<'s> {
    surface: &'s Surface<'s>,
    /// Value of the solid at each vertex.
    values: Vec<f64>,
    /// Tetrahedra of the previous round, which are not searched again, except for edges that could
    /// not be bisected.
    before: Vec<[u32; 4]>,
    /// Edges that a piece crosses twice, sorted.
    twice: Vec<[u32; 2]>,
    /// Tetrahedra in which two pieces face each other closely.
    close: Vec<TetSnapshot>,
}

impl HiddenSearch<'_> {
    /// Searches all new tetrahedra and edges.
    fn search_new(&mut self, complex: &Complex) {
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

    /// Returns the edges that may be crossed twice: edges of new tetrahedra, and edges that could
    /// not be bisected.
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

    /// Returns true if a piece may cross an edge twice. Since values are approximate distances,
    /// ends together farther from the surface than the edge is long exclude it.
    fn may_be_crossed_twice(&self, complex: &Complex, [a, b]: [u32; 2]) -> bool {
        let (f, g) = (self.values[a as usize], self.values[b as usize]);
        f * g > 0.0 && f.is_finite() && g.is_finite() && {
            let [p, q] = complex.points_of([a, b]);
            let d = sub(p, q);
            (f.abs() + g.abs()).powi(2) < dot(d, d)
        }
    }

    /// Returns true if one piece crosses an edge twice. Two pieces with one crossing each are
    /// separated by their signs at the ends and cut one by one.
    fn is_crossed_twice(&self, complex: &Complex, [a, b]: [u32; 2]) -> bool {
        let [p, q] = complex.points_of([a, b]);
        let length = norm(sub(p, q));
        PROBE_FRACTIONS.iter().any(|&t| {
            let (v, piece) = self.surface.value(lerp(p, q, t));
            v * self.values[a as usize] < 0.0
                // A smaller depth is the sagitta of a curved surface.
                && v.abs() > 0.08 * length
                && v * self.surface.distance(piece, p) < 0.0
                && v * self.surface.distance(piece, q) < 0.0
        })
    }

    /// Returns true if an edge that is crossed twice cuts off only a ridge or a groove: behind it
    /// the body, or the gap, becomes as deep as at a sharp edge. The mesh then loses only the
    /// chamfer.
    fn is_ridge(&self, complex: &Complex, [a, b]: [u32; 2]) -> bool {
        let [p, q] = complex.points_of([a, b]);
        let length = norm(sub(p, q));
        let side = -self.values[a as usize].signum();
        let places = PROBE_FRACTIONS.map(|t| lerp(p, q, t));
        let depth = |p: Point3| side * self.surface.value(p).0;
        let deepest = places
            .into_iter()
            .max_by(|x, y| depth(*x).total_cmp(&depth(*y)));
        deepest.is_some_and(|mut at| {
            for _ in 0..RIDGE_WALK_STEPS {
                let (value, piece) = self.surface.value(at);
                // A decided cell counts as infinitely deep.
                if value.is_infinite() {
                    break;
                }
                let inwards = unit(self.surface.gradient(piece, at).1);
                // The walk goes four edge lengths inward; a ridge of 40 degrees is 1.4 deep there.
                // Anything shallower, such as a needle or a wall, is less than two edges thick,
                // which the lattice need not follow.
                let step = side * 4.0 * length / RIDGE_WALK_STEPS as f64;
                at = std::array::from_fn(|i| at[i] + step * inwards[i]);
            }
            depth(at) > 1.1 * length
        })
    }

    /// Returns true if a tetrahedron is to be bisected.
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
    /// Bisects edges that a piece of the surface crosses twice (both ends inside, or both outside,
    /// and a point in between that is not), so that the lattice meets thin walls, gaps and narrow
    /// links. Returns points where the last round still found such an edge, except those that cut
    /// off a ridge.
    pub(crate) fn resolve(&mut self, surface: &Surface<'_>) -> Vec<Point3> {
        let mut search = HiddenSearch {
            surface,
            values: Vec::new(),
            before: Vec::new(),
            twice: Vec::new(),
            close: Vec::new(),
        };
        for round in 0..=MAX_RESOLVE_ROUNDS {
            search.search_new(&self.complex);
            if search.twice.is_empty() && search.close.is_empty() {
                return Vec::new();
            }
            let is_full = self.complex.tets.len() > self.limit;
            if round == MAX_RESOLVE_ROUNDS || is_full || surface.control.is_stopped() {
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
