//! The signed distance to the surface of a solid, by foot points.
//!
//! A solid is a tree of minima and maxima over smooth pieces g ≥ 0 ([`Shape`]). The point q of its
//! surface nearest to a point p lies on one piece, on an edge (two pieces) or at a corner (three):
//! q is the limit of an iteration to the point nearest to p on the intersection of the tangent
//! planes,
//!
//! q ← p + Gᵀ (G Gᵀ)⁻¹ (G (q − p) − g(q)),  G = rows ∇gᵢ(q),
//!
//! which converges linearly with the factor distance × curvature. q lies on the surface if the tree
//! over the pieces' first-order distances takes both signs at a small distance from q, in the
//! sectors between the pieces. The derivative by the parameters follows from the envelope theorem
//! (to first order the foot point moves along the surface): ∂d/∂a = Σ λᵢ (∂gᵢ/∂a)(q)/|∇gᵢ(q)|,
//! where the unit vector (p − q)/d is Σ λᵢ ∇gᵢ/|∇gᵢ|.
//!
//! After Ahn, Rauh, Cho, Warnecke (2002), *Orthogonal distance fitting of implicit curves and
//! surfaces*, IEEE PAMI 24:620–638, who treat smooth surfaces; edges and corners are an extension
//! of Isoform.

mod blocks;
mod nearby;

use self::blocks::Nearest;
use crate::block::{Block, LANES, Lane, Plan, Row, Wanted};
use crate::graph::Graph;
use crate::shape::{Join, Shape};
use crate::tape::Tape;
use isoform_geom::{
    Aabb, DistanceField, Foot, Frame, Nearby, ParamField, Point3, add_normal_equations,
    distance_squared, dot, normal_equations_of, sub,
};
use rayon::prelude::*;

/// Maximum number of pieces of a solid with foot points.
const MOST_PIECES: usize = 256;
/// Maximum number of points in a unit of work. More points fill blocks better, fewer keep the table
/// of their distances from all pieces in the cache.
const PIECE: usize = 2048;
/// Maximum number of entries of that table, which bounds memory for solids with many pieces.
const TABLE: usize = 1 << 17;
/// Maximum number of steps to a foot point. Each reduces the error by the factor distance ×
/// curvature: if that is 1/10, eight steps reach rounding.
const STEPS: usize = 12;
/// Ratio of the last step to the distance at or below which a foot point counts as converged.
const SETTLED: f64 = 1e-6;
/// Rounding error relative to the size of coordinates; a step below it counts as converged as well.
const ROUNDING: f64 = 1e-14;
/// Ratio of the last step to the distance at or below which a foot point is accepted without
/// convergence: the relative error of the distance is then about the square of this.
const NEARLY: f64 = 1e-2;
/// Ratio of the distance of a foot point to the first-order distance above which it is rejected.
/// Near an axis, the first-order distance is meaningless and the iteration leads to wrong points
/// farther away.
const STRAYED: f64 = 4.0;
/// Ratio of first-order distances above which all other faces are ignored. With less than 2 the
/// foot point could lie beyond an edge; more only sends more points to the slower search over
/// several pieces.
const CLEARLY: f64 = 2.5;
/// Maximum number of pieces near a point that are combined to edges and corners. A corner of more
/// faces is found as that of its nearest triple.
const NEAR: usize = 5;
/// Length of the step from a foot point at which the sign of the tree is tested, relative to the
/// size of coordinates: above the rounding errors of foot points, below any detail.
const ASIDE: f64 = 1e-8;
/// Half thickness of the shell about a piece whose random points are projected to the piece, in
/// diagonals of the region. A thicker shell gives more samples per round, a thinner one makes them
/// more uniform on curved pieces.
const SHELL: f64 = 0.02;
/// Root of x⁴ = x + 1. Its negative powers are the steps of a low-discrepancy sequence in a box
/// (Roberts).
const SPREAD: f64 = 1.220_744_084_605_759_5;
/// Maximum number of rounds of random points, which bounds the search on a very small surface.
const MOST_ROUNDS: usize = 200;
/// Gram determinant of unit normals below which they count as parallel and do not form an edge.
const PARALLEL: f64 = 1e-6;

/// Compiled smooth piece.
#[derive(Clone, Debug)]
struct Sheet {
    /// Function g of the piece.
    tape: Tape,
    /// Plan of ∇g.
    by_space: Plan,
    /// Plan of the derivatives by coordinates and parameters.
    by_all: Plan,
}

/// Signed distance from a compiled solid, positive inside. It is exact up to rounding near the
/// surface, at distances well below the radii of curvature; farther away, if no foot point is
/// found, it is the first-order distance of [`Shape::distance`].
///
/// ```
/// use isoform_field::{Distance, Graph, Shape, hyperfun::{Mode, Model}};
/// use isoform_geom::ParamField;
///
/// // A cube of side 2a about the origin.
/// let text = "my_model(x[3], a[1]) {
///   my_model = min(a[1] - abs(x[1]), min(a[1] - abs(x[2]), a[1] - abs(x[3])));
/// }";
/// let mut graph = Graph::new();
/// let root = Model::parse(text, Mode::Default)?.compile(&mut graph).expect("an expression");
/// let shape = Shape::new(&mut graph, root);
/// let mut same = graph.clone();
/// let distance = Distance::new(&shape, &mut same, 1, |_, id| id).expect("few pieces");
/// let mut out = [0.0; 2];
/// // Beyond a face by 1, and beyond a corner by 1 along each axis.
/// distance.values(&[[3.0, 0.0, 0.0], [3.0, 3.0, 3.0]], &[2.0], &mut out);
/// assert!((out[0] + 1.0).abs() < 1e-12 && (out[1] + 3_f64.sqrt()).abs() < 1e-12);
/// # Ok::<(), isoform_field::hyperfun::SyntaxError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Distance {
    /// Pieces, compiled.
    sheets: Vec<Sheet>,
    /// Minima and maxima of the pieces, in the order of computation.
    tree: Vec<Join>,
    n_params: usize,
}

impl Distance {
    /// Returns the distance from the solid of `shape`, moved by `place`, which maps each piece's
    /// expression into the graph `posed`, with `n_params` parameters. `None` for solids of more
    /// than 256 pieces, since every piece is evaluated at every point.
    pub fn new(
        shape: &Shape,
        posed: &mut Graph,
        n_params: usize,
        mut place: impl FnMut(&mut Graph, crate::NodeId) -> crate::NodeId,
    ) -> Option<Self> {
        if shape.pieces.len() > MOST_PIECES {
            return None;
        }
        let sheets = shape
            .pieces
            .iter()
            .map(|&piece| {
                let root = place(posed, piece);
                let tape = Tape::new(posed, &[root], 3, n_params);
                Sheet {
                    by_space: Plan::new(&tape, Wanted::Space),
                    by_all: Plan::new(&tape, Wanted::All),
                    tape,
                }
            })
            .collect();
        Some(Self {
            sheets,
            tree: shape.tree.clone(),
            n_params,
        })
    }

    /// Returns the tree's value if the pieces have the values `v`.
    fn value(&self, stack: &mut Vec<f64>, v: impl Fn(u32) -> f64) -> f64 {
        self.fold(stack, v, f64::min, f64::max)
    }

    /// Returns the lanes, as bits, that are inside if each piece is positive in its lanes `leaves`.
    fn is_inside(&self, stack: &mut Vec<u32>, leaves: &[u32]) -> u32 {
        self.fold(stack, |k| leaves[k as usize], |u, v| u & v, |u, v| u | v)
    }

    /// Evaluates the tree over leaves of any type.
    fn fold<T: Copy>(
        &self,
        stack: &mut Vec<T>,
        leaf: impl Fn(u32) -> T,
        min: impl Fn(T, T) -> T,
        max: impl Fn(T, T) -> T,
    ) -> T {
        stack.clear();
        for join in &self.tree {
            if let Join::Part(k) = join {
                stack.push(leaf(*k));
                continue;
            }
            let second = stack.pop().expect("a join has two inputs");
            let first = stack.pop().expect("a join has two inputs");
            stack.push(match join {
                Join::Min => min(first, second),
                _ => max(first, second),
            });
        }
        stack.pop().expect("a tree has a root")
    }

    /// Returns the number of points in a unit of work.
    fn piece(&self) -> usize {
        (TABLE / (4 * self.sheets.len().max(1))).clamp(LANES, PIECE)
    }
}

impl DistanceField for Distance {
    fn feet(&self, points: &[Point3], a: &[f64], out: &mut [Foot]) {
        let piece = self.piece();
        let out = &mut out[..points.len()];
        let work = |(points, out): (&[Point3], &mut [Foot])| {
            Finder::new(self, a).feet(points, out);
        };
        if points.len() <= piece {
            work((points, out));
        } else {
            points
                .par_chunks(piece)
                .zip(out.par_chunks_mut(piece))
                .for_each(work);
        }
    }

    fn jacobian_of(&self, feet: &[Foot], a: &[f64], jac: &mut [f64]) {
        let (piece, m) = (self.piece(), self.n_params);
        let jac = &mut jac[..feet.len() * m];
        if m == 0 {
            return;
        }
        feet.par_chunks(piece)
            .zip(jac.par_chunks_mut(piece * m))
            .for_each(|(feet, jac)| Finder::new(self, a).by_params(feet, jac));
    }

    fn normal_equations_at(
        &self,
        feet: &[Foot],
        weights: &[f64],
        a: &[f64],
        gradient: &mut [f64],
        hessian: &mut [f64],
    ) -> f64 {
        let (piece, m) = (self.piece(), self.n_params);
        let sums = |(k, feet): (usize, &[Foot])| {
            let mut jac = vec![0.0; feet.len() * m];
            Finder::new(self, a).by_params(feet, &mut jac);
            let f: Vec<f64> = feet.iter().map(|foot| foot.distance).collect();
            let weights = weights.get(k * piece..).unwrap_or_default();
            let (mut g, mut h) = (vec![0.0; m], vec![0.0; m * m]);
            let sum = normal_equations_of(&f, &jac, weights, &mut g, &mut h);
            (sum, g, h)
        };
        let pieces: Vec<_> = feet.par_chunks(piece).enumerate().map(sums).collect();
        add_normal_equations(pieces, &mut gradient[..m], &mut hessian[..m * m])
    }

    fn nearby(&self, places: &[Foot], a: &[f64], reach: f64, strip: f64) -> Vec<Nearby> {
        let mut out = vec![Nearby::Much; places.len()];
        let piece = self.piece();
        places
            .par_chunks(piece)
            .zip(out.par_chunks_mut(piece))
            .for_each(|(places, out)| Finder::new(self, a).nearby(places, reach, strip, out));
        out
    }

    fn bends(&self, places: &[Foot], a: &[f64], step: f64) -> Vec<f64> {
        let mut out = vec![0.0; places.len()];
        let piece = self.piece();
        places
            .par_chunks(piece)
            .zip(out.par_chunks_mut(piece))
            .for_each(|(places, out)| Finder::new(self, a).bends(places, step, out));
        out
    }

    /// Projects random points near each piece to it, and keeps those on the surface. On a smooth
    /// piece they are uniform up to its edges, with an error of the square of shell thickness times
    /// curvature.
    fn area_samples(
        &self,
        a: &[f64],
        frame: &Frame,
        region: Aabb,
        wanted: usize,
        seed: u64,
    ) -> Vec<Foot> {
        let mut random = fastrand::Rng::with_seed(seed);
        // A Kronecker sequence is as independent of the faces as random points, and more uniform.
        let mut even: Point3 = std::array::from_fn(|_| random.f64());
        let mut finder = Finder::new(self, a);
        let shell = SHELL * region.diagonal();
        let size = region.size();
        let mut found = Vec::with_capacity(wanted);
        if !(shell > 0.0 && shell.is_finite()) {
            return found;
        }
        let mut points = vec![[0.0; 3]; self.piece()];
        for _ in 0..MOST_ROUNDS {
            for p in &mut points {
                spread(&mut even);
                let at = std::array::from_fn(|i| region.lo[i] + even[i] * size[i]);
                *p = frame.out(at);
            }
            finder.area_samples(&points, shell, &mut found);
            if found.len() >= wanted {
                break;
            }
        }
        found
    }
}

impl ParamField for Distance {
    fn dim(&self) -> usize {
        self.n_params
    }

    fn values(&self, points: &[Point3], a: &[f64], out: &mut [f64]) {
        let piece = self.piece();
        let work = |(points, out): (&[Point3], &mut [f64])| {
            Finder::new(self, a).distances(points, out);
        };
        points
            .par_chunks(piece)
            .zip(out[..points.len()].par_chunks_mut(piece))
            .for_each(work);
    }

    fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], jac: &mut [f64]) {
        let (piece, m) = (self.piece(), self.n_params);
        if points.is_empty() {
            return;
        }
        let (out, jac) = (&mut out[..points.len()], &mut jac[..points.len() * m]);
        let work = |((points, out), jac): ((&[Point3], &mut [f64]), &mut [f64])| {
            let mut finder = Finder::new(self, a);
            let feet = finder.distances(points, out);
            finder.by_params(&feet, jac);
        };
        if points.len() <= piece || m == 0 {
            work(((points, out), jac));
        } else {
            points
                .par_chunks(piece)
                .zip(out.par_chunks_mut(piece))
                .zip(jac.par_chunks_mut(piece * m))
                .for_each(work);
        }
    }

    fn normal_equations(
        &self,
        points: &[Point3],
        weights: &[f64],
        a: &[f64],
        gradient: &mut [f64],
        hessian: &mut [f64],
    ) -> f64 {
        let mut feet = vec![Foot::NONE; points.len()];
        self.feet(points, a, &mut feet);
        self.normal_equations_at(&feet, weights, a, gradient, hessian)
    }

    fn gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], gradients: &mut [Point3]) {
        let mut feet = vec![Foot::NONE; points.len()];
        self.feet(points, a, &mut feet);
        for ((o, g), f) in out.iter_mut().zip(gradients).zip(&feet) {
            (*o, *g) = (f.distance, f.inward);
        }
    }
}

/// Search of a foot point on one to three pieces, with its state.
#[derive(Clone, Copy, Debug)]
struct Try {
    /// Index of the point.
    point: u32,
    /// Pieces; the first `order` entries are used.
    pieces: [u32; 3],
    /// Number of pieces: 1 for a face, 2 for an edge, 3 for a corner.
    order: u8,
    /// Current position of the foot point.
    q: Point3,
    /// Distance beyond which the foot point is not useful.
    most: f64,
    /// Values of the pieces at q.
    g: [f64; 3],
    /// Gradients of the pieces at q.
    grad: [Point3; 3],
    /// True if the search has ended.
    done: bool,
    /// True if the foot point is accurate enough.
    good: bool,
}

/// First-order feet of points.
struct FirstFeet {
    /// First-order distances: that of point i from piece k has the index k · points + i.
    off: Vec<f64>,
    /// For each piece, the points with this piece as the clearly nearest face.
    lone: Vec<Vec<u32>>,
    /// Points with several near faces.
    crowded: Vec<usize>,
}

/// Request to evaluate a piece: index of the [`Try`] or foot, and index of the piece among its
/// pieces.
type Asked = (u32, u8);

/// Point with several near pieces.
struct Crowd {
    /// Index of the point.
    point: usize,
    /// Nearest pieces, nearest first; the first `first` are used.
    near: Vec<u32>,
    first: usize,
    /// Distance to the nearest point found on the surface so far.
    best: f64,
}

impl Crowd {
    /// Selects the nearest of `count` pieces by their first-order distances `off`; at first only
    /// the pieces within reach are used.
    fn new(point: usize, count: u32, reach: f64, off: impl Fn(u32) -> f64) -> Self {
        let mut near: Vec<u32> = (0..count).collect();
        near.sort_by(|j, k| off(*j).total_cmp(&off(*k)));
        near.truncate(NEAR);
        Self {
            point,
            first: near.iter().filter(|k| off(**k) <= reach).count(),
            near,
            best: f64::INFINITY,
        }
    }
}

/// Search for foot points with the pieces at given parameters.
struct Finder<'t> {
    solid: &'t Distance,
    /// Values of the parameters.
    a: &'t [f64],
    /// Scratch memory of the tree over values.
    stack: Vec<f64>,
    /// Evaluator of each piece, created at its first use.
    blocks: Vec<Option<Block<'t>>>,
    /// First-order distances of a block of points from each piece.
    off: Vec<Row>,
    /// Scratch memory of the tree over blocks of values.
    nearest: Vec<Nearest>,
}

impl<'t> Finder<'t> {
    /// Returns a finder at the parameters `a`.
    fn new(solid: &'t Distance, a: &'t [f64]) -> Self {
        Self {
            solid,
            a,
            stack: Vec::new(),
            blocks: solid.sheets.iter().map(|_| None).collect(),
            off: vec![Lane([0.0; LANES]); solid.sheets.len()],
            nearest: Vec::new(),
        }
    }

    /// Returns the evaluator of piece k.
    fn block(&mut self, k: usize) -> &mut Block<'t> {
        let (sheet, a) = (&self.solid.sheets[k], self.a);
        self.blocks[k].get_or_insert_with(|| {
            let mut block = Block::gradients(&sheet.tape, &sheet.by_space);
            block.bind(a);
            block
        })
    }

    /// Evaluates g and ∇g of piece k at the points.
    fn evaluate(&mut self, k: usize, points: &[Point3], mut each: impl FnMut(usize, f64, Point3)) {
        let block = self.block(k);
        for (c, chunk) in points.chunks(LANES).enumerate() {
            block.load(chunk);
            let value = *block.forward();
            block.reverse();
            let rows = block.by_space();
            for l in 0..chunk.len() {
                each(
                    c * LANES + l,
                    value[l],
                    [rows[0].0[l], rows[1].0[l], rows[2].0[l]],
                );
            }
        }
    }

    /// Returns the feet of the points, and writes their distances.
    fn distances(&mut self, points: &[Point3], out: &mut [f64]) -> Vec<Foot> {
        let mut feet = vec![Foot::NONE; points.len()];
        self.feet(points, &mut feet);
        out.iter_mut().zip(&feet).for_each(|(o, f)| *o = f.distance);
        feet
    }

    /// Computes the feet of the points. A point whose nearest face is clearly the nearest is
    /// projected to that face only.
    fn feet(&mut self, points: &[Point3], out: &mut [Foot]) {
        let first = self.first_feet(points, out);
        for (k, wanted) in first.lone.iter().enumerate() {
            for wanted in wanted.chunks(LANES) {
                self.feet_on_face(k, wanted, points, out);
            }
        }
        if !first.crowded.is_empty() {
            self.crowded(points, &first.crowded, &first.off, out);
        }
    }

    /// Writes the first-order feet of the points, and separates the points with one near face from
    /// those with several.
    fn first_feet(&mut self, points: &[Point3], out: &mut [Foot]) -> FirstFeet {
        let (n, count) = (points.len(), self.solid.sheets.len());
        let mut found = FirstFeet {
            off: vec![0.0; n * count],
            lone: vec![Vec::new(); count],
            crowded: Vec::new(),
        };
        for (c, chunk) in points.chunks(LANES).enumerate() {
            let first = c * LANES;
            self.first_order(chunk);
            let (nearest, alone) = self.nearest_faces(chunk);
            for k in 0..count {
                let at = k * n + first;
                found.off[at..at + chunk.len()].copy_from_slice(&self.off[k].0[..chunk.len()]);
            }
            for (l, p) in chunk.iter().enumerate() {
                let piece = nearest.piece[l];
                out[first + l] = self.first_order_foot(piece, l, *p);
                if alone[l] {
                    found.lone[piece as usize].push((first + l) as u32);
                } else {
                    found.crowded.push(first + l);
                }
            }
        }
        found
    }

    /// Returns, for each piece, the points within twice the half thickness `shell` and their
    /// first-order feet.
    fn within_shells(&mut self, points: &[Point3], shell: f64) -> Vec<(Vec<Foot>, Vec<Point3>)> {
        let mut near = vec![(Vec::new(), Vec::new()); self.solid.sheets.len()];
        for chunk in points.chunks(LANES) {
            self.first_order(chunk);
            for (k, (near, from)) in near.iter_mut().enumerate() {
                for (l, p) in chunk.iter().enumerate() {
                    if self.off[k].0[l].abs() < 2.0 * shell {
                        near.push(self.first_order_foot(k as u32, l, *p));
                        from.push(*p);
                    }
                }
            }
        }
        near
    }

    /// Appends the projections to each piece of the points in its shell that lie on the surface.
    fn area_samples(&mut self, points: &[Point3], shell: f64, found: &mut Vec<Foot>) {
        let shells = self.within_shells(points, shell);
        for (k, (mut near, from)) in shells.into_iter().enumerate() {
            let all: Vec<u32> = (0..near.len() as u32).collect();
            for wanted in all.chunks(LANES) {
                self.feet_on_face(k, wanted, &from, &mut near);
            }
            near.retain(|f| f.order == 1 && f.distance.abs() < shell);
            let tries: Vec<Try> = near.iter().map(Try::met).collect();
            let sound = self.on_surface(&tries);
            for (foot, _) in near.iter().zip(&sound).filter(|(_, s)| **s) {
                found.push(Foot {
                    distance: 0.0,
                    ..*foot
                });
            }
        }
    }

    /// Computes foot points of points with several near pieces. The pieces within [`CLEARLY`]
    /// first-order distances are tried first: a farther piece matters only if all of them fail.
    fn crowded(&mut self, points: &[Point3], crowded: &[usize], d: &[f64], out: &mut [Foot]) {
        let (n, count) = (points.len(), self.solid.sheets.len() as u32);
        let case = |&i: &usize| {
            let reach = CLEARLY * out[i].distance.abs() + aside(points[i]);
            Crowd::new(i, count, reach, |k| d[k as usize * n + i].abs())
        };
        let mut cases: Vec<Crowd> = crowded.iter().map(case).collect();
        self.combine(points, &mut cases, d, out);
        cases.retain(|c| c.best.is_infinite() && c.first < c.near.len());
        for case in &mut cases {
            case.first = case.near.len();
        }
        self.combine(points, &mut cases, d, out);
    }

    /// Tries faces, nearest first, then edges, then corners of the first pieces of each point, as
    /// long as they can be nearer than the nearest point found so far.
    fn combine(&mut self, points: &[Point3], cases: &mut [Crowd], d: &[f64], out: &mut [Foot]) {
        for face in 0..NEAR {
            self.combine_some(points, cases, d, out, |near, each| {
                if let Some(&k) = near.get(face) {
                    each([k; 3], 1);
                }
            });
        }
        for order in 2..=3 {
            self.combine_some(points, cases, d, out, |near, each| {
                combinations(near, order, &mut |pieces| each(pieces, order));
            });
        }
    }

    /// Tries the combinations that `choose` forms of the first pieces of each point.
    fn combine_some(
        &mut self,
        points: &[Point3],
        cases: &mut [Crowd],
        d: &[f64],
        out: &mut [Foot],
        choose: impl Fn(&[u32], &mut dyn FnMut([u32; 3], usize)),
    ) {
        let (mut tries, whose) = useful_tries(points, cases, d, choose);
        self.descend(points, &mut tries);
        let sound = self.on_surface(&tries);
        for ((t, &c), sound) in tries.iter().zip(&whose).zip(&sound) {
            let away = distance_squared(points[t.point as usize], t.q).sqrt();
            if *sound && away < cases[c].best {
                cases[c].best = away;
                t.settle(points, out);
            }
        }
    }
    /// Iterates all searches to their foot points, in blocks by piece.
    fn descend(&mut self, points: &[Point3], tries: &mut [Try]) {
        let mut by_piece: Vec<Vec<Asked>> = vec![Vec::new(); self.solid.sheets.len()];
        let mut at = Vec::new();
        for _ in 0..STEPS {
            by_piece.iter_mut().for_each(Vec::clear);
            for (t, one) in tries.iter().enumerate().filter(|(_, t)| !t.done) {
                for c in 0..one.order {
                    by_piece[one.pieces[c as usize] as usize].push((t as u32, c));
                }
            }
            if by_piece.iter().all(Vec::is_empty) {
                break;
            }
            for (k, wanted) in by_piece.iter().enumerate().filter(|(_, w)| !w.is_empty()) {
                at.clear();
                at.extend(wanted.iter().map(|w| tries[w.0 as usize].q));
                self.evaluate(k, &at, |i, g, grad| {
                    let (t, c) = wanted[i];
                    let one = &mut tries[t as usize];
                    (one.g[c as usize], one.grad[c as usize]) = (g, grad);
                });
            }
            for t in tries.iter_mut().filter(|t| !t.done) {
                t.step(points[t.point as usize]);
            }
        }
    }

    /// Computes ∂d/∂a by the envelope theorem, one row per foot.
    fn by_params(&mut self, feet: &[Foot], jac: &mut [f64]) {
        jac.fill(0.0);
        let mut wanted: Vec<Vec<Asked>> = vec![Vec::new(); self.solid.sheets.len()];
        for (i, foot) in feet.iter().enumerate() {
            for c in 0..foot.order.max(1) {
                wanted[foot.pieces[c as usize] as usize].push((i as u32, c));
            }
        }
        for (k, wanted) in wanted.iter().enumerate().filter(|(_, w)| !w.is_empty()) {
            self.add_shares(k, wanted, feet, jac);
        }
    }

    /// Adds λ ∂g/∂a/|∇g| of piece k at the feet in which it has the coefficient λ.
    fn add_shares(&self, k: usize, wanted: &[Asked], feet: &[Foot], jac: &mut [f64]) {
        let (sheet, m) = (&self.solid.sheets[k], self.solid.n_params);
        let at: Vec<Point3> = wanted.iter().map(|w| feet[w.0 as usize].at).collect();
        let mut block = Block::gradients(&sheet.tape, &sheet.by_all);
        block.bind(self.a);
        for (chunk, wanted) in at.chunks(LANES).zip(wanted.chunks(LANES)) {
            block.load(chunk);
            block.forward();
            block.reverse();
            let by_space = block.by_space();
            for (l, (i, s)) in wanted.iter().enumerate() {
                let gradient: Point3 = std::array::from_fn(|x| by_space[x].0[l]);
                let length = dot(gradient, gradient).sqrt();
                let share = feet[*i as usize].shares[*s as usize] / length.max(1e-300);
                let row = &mut jac[*i as usize * m..(*i as usize + 1) * m];
                for (v, by) in row.iter_mut().zip(block.by_params()) {
                    *v += share * by.0[l];
                }
            }
        }
    }
}

/// Returns searches for the combinations that `choose` forms of the first pieces of each point, if
/// they can be nearer than the nearest point found so far; and the index of the point of each.
fn useful_tries(
    points: &[Point3],
    cases: &[Crowd],
    d: &[f64],
    choose: impl Fn(&[u32], &mut dyn FnMut([u32; 3], usize)),
) -> (Vec<Try>, Vec<usize>) {
    let n = points.len();
    let (mut tries, mut whose) = (Vec::new(), Vec::new());
    for (c, case) in cases.iter().enumerate() {
        let p = points[case.point];
        let off = |k: u32| d[k as usize * n + case.point].abs();
        choose(&case.near[..case.first], &mut |pieces, order| {
            // The foot on a combination is not nearer than its farthest piece.
            let least = pieces[..order].iter().map(|&k| off(k)).fold(0.0, f64::max);
            if least < case.best {
                let most = case.best.min(STRAYED * least + aside(p));
                tries.push(Try {
                    most,
                    ..Try::new(case.point, pieces, order as u8, p)
                });
                whose.push(c);
            }
        });
    }
    (tries, whose)
}

impl Try {
    /// Returns a search that starts at q.
    fn new(point: usize, pieces: [u32; 3], order: u8, q: Point3) -> Self {
        Self {
            point: point as u32,
            pieces,
            order,
            q,
            most: f64::INFINITY,
            g: [0.0; 3],
            grad: [[0.0; 3]; 3],
            done: false,
            good: false,
        }
    }

    /// Returns a finished search for a foot point on one face.
    fn met(foot: &Foot) -> Self {
        Self {
            good: true,
            ..Self::new(0, foot.pieces, 1, foot.at)
        }
    }

    /// Makes one step to the foot point of p, from the values and gradients at q.
    fn step(&mut self, p: Point3) {
        let order = self.order as usize;
        let away = sub(self.q, p);
        let wanted: [f64; 3] = std::array::from_fn(|c| {
            if c < order {
                dot(self.grad[c], away) - self.g[c]
            } else {
                0.0
            }
        });
        let Some(shares) = solve(&self.grad[..order], &wanted) else {
            (self.done, self.good) = (true, false);
            return;
        };
        let q: Point3 = std::array::from_fn(|x| {
            p[x] + (0..order).map(|c| shares[c] * self.grad[c][x]).sum::<f64>()
        });
        let moved = distance_squared(q, self.q).sqrt();
        let far = distance_squared(q, p).sqrt();
        let size = p.iter().fold(0.0_f64, |s, v| s.max(v.abs()));
        self.q = q;
        // The last evaluation was at the previous position, near the present one after convergence.
        // A search may take a detour, but is abandoned beyond twice the useful distance.
        let is_lost = !far.is_finite() || far > 2.0 * self.most;
        self.done = moved <= SETTLED * far + ROUNDING * size || is_lost;
        self.good = !is_lost && moved <= NEARLY * far + 1e3 * ROUNDING * size;
    }

    /// Writes the foot point if it is accurate enough.
    fn settle(&self, points: &[Point3], out: &mut [Foot]) {
        if !self.good {
            return;
        }
        let i = self.point as usize;
        let (p, foot) = (points[i], &mut out[i]);
        let normals: [Point3; 3] = std::array::from_fn(|c| first_order(1.0, self.grad[c]).1);
        let away = sub(p, self.q);
        let far = dot(away, away).sqrt();
        let sign = if foot.distance < 0.0 { -1.0 } else { 1.0 };
        let order = self.order as usize;
        let is_of_own_face = order == 1 && foot.order == 0 && foot.pieces[0] == self.pieces[0];
        foot.distance = if is_of_own_face {
            dot(away, normals[0])
        } else {
            sign * far
        };
        (foot.inward, foot.shares) = if order > 1 && far > aside(p) {
            let inward = away.map(|v| v / foot.distance);
            (inward, shares_of(inward, &normals[..order]))
        } else {
            (normals[0], [1.0, 0.0, 0.0])
        };
        (foot.at, foot.pieces, foot.order) = (self.q, self.pieces, self.order);
    }
}

/// Advances a low-discrepancy sequence in the unit cube.
fn spread(even: &mut Point3) {
    let mut step = 1.0;
    for v in even {
        step /= SPREAD;
        *v = (*v + step).fract();
    }
}

/// Returns the coefficients of unit normals in a direction that lies in their span.
fn shares_of(direction: Point3, normals: &[Point3]) -> [f64; 3] {
    let wanted: [f64; 3] =
        std::array::from_fn(|c| normals.get(c).map_or(0.0, |n| dot(*n, direction)));
    solve(normals, &wanted).unwrap_or([1.0, 0.0, 0.0])
}

/// Returns the length of the step that tests the sign on either side of p.
fn aside(p: Point3) -> f64 {
    ASIDE * p.iter().fold(1e-300, |s: f64, v| s.max(v.abs()))
}

/// Returns g/|∇g| and ∇g/|∇g|; a very large distance if the gradient vanishes or is not finite.
fn first_order(g: f64, grad: Point3) -> (f64, Point3) {
    let length = dot(grad, grad).sqrt();
    if length > 0.0 && length.is_finite() && g.is_finite() {
        let d = g / length;
        (d.clamp(-1e150, 1e150), grad.map(|v| v / length))
    } else {
        (if g < 0.0 { -1e150 } else { 1e150 }, [0.0; 3])
    }
}

/// Calls `each` with every combination of `order` pieces.
fn combinations(near: &[u32], order: usize, each: &mut impl FnMut([u32; 3])) {
    for (i, &u) in near.iter().enumerate() {
        if order == 1 {
            each([u; 3]);
            continue;
        }
        for (j, &v) in near.iter().enumerate().skip(i + 1) {
            if order == 2 {
                each([u, v, v]);
                continue;
            }
            for &w in &near[j + 1..] {
                each([u, v, w]);
            }
        }
    }
}

/// Solves G Gᵀ x = b for one to three rows G; `None` if they are nearly parallel.
fn solve(rows: &[Point3], b: &[f64; 3]) -> Option<[f64; 3]> {
    match *rows {
        [u] => {
            let uu = dot(u, u);
            (uu > 0.0).then(|| [b[0] / uu, 0.0, 0.0])
        }
        [u, v] => {
            let (uu, uv, vv) = (dot(u, u), dot(u, v), dot(v, v));
            let det = uu * vv - uv * uv;
            (det > PARALLEL * uu * vv).then(|| {
                [
                    (b[0] * vv - b[1] * uv) / det,
                    (b[1] * uu - b[0] * uv) / det,
                    0.0,
                ]
            })
        }
        [u, v, w] => solve_three([u, v, w], b),
        _ => None,
    }
}

/// Returns x = G⁻ᵀ G⁻¹ b for three rows G, by the reciprocal basis.
fn solve_three([u, v, w]: [Point3; 3], b: &[f64; 3]) -> Option<[f64; 3]> {
    let cross = isoform_geom::cross;
    let det = dot(u, cross(v, w));
    let sizes = dot(u, u) * dot(v, v) * dot(w, w);
    (det * det > PARALLEL * sizes).then(|| {
        let dual = [cross(v, w), cross(w, u), cross(u, v)].map(|c| c.map(|x| x / det));
        let y: Point3 = std::array::from_fn(|x| (0..3).map(|c| b[c] * dual[c][x]).sum());
        std::array::from_fn(|c| dot(dual[c], y))
    })
}
