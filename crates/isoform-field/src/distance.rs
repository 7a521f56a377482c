//! The signed distance to the surface of a solid, by foot points.
//!
//! A solid is a tree of minima and maxima over smooth pieces g ≥ 0 ([`Shape`]). The point q of its
//! surface nearest to a point p lies on one piece, on an edge (two pieces) or at a corner (three):
//! q is the limit of the point of the tangent planes' common flat that is nearest to p,
//!
//! q ← p + Gᵀ (G Gᵀ)⁻¹ (G (q − p) − g(q)),  G = rows ∇gᵢ(q),
//!
//! which converges at the rate of distance times curvature. The tree over the pieces' first-order
//! distances, a small step away from q in every sector between the pieces, tells whether q lies on
//! the surface. The derivative by the parameters follows from the envelope theorem (the foot point
//! moves along the surface only): ∂d/∂a = Σ λᵢ (∂gᵢ/∂a)(q)/|∇gᵢ(q)|, where the unit vector (p − q)/d
//! is Σ λᵢ ∇gᵢ/|∇gᵢ|.
//!
//! After Ahn, Rauh, Cho, Warnecke (2002), *Orthogonal distance fitting of implicit curves and
//! surfaces*, IEEE PAMI 24:620–638, who treat smooth surfaces; edges and corners are ours.

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

/// The largest number of pieces of a solid with foot points.
const MOST_PIECES: usize = 256;
/// Number of points whose feet are sought together, for few pieces. More fill the blocks better,
/// fewer keep the tables of all pieces' distances in the cache.
const PIECE: usize = 2048;
/// Bound of the numbers in such a table, which bounds the memory of solids with many pieces.
const TABLE: usize = 1 << 17;
/// Number of steps towards a foot point. Each gains the factor distance × curvature: at a tenth,
/// eight reach rounding.
const STEPS: usize = 12;
/// Share of the distance below which the last step must be for a foot point to have settled.
const SETTLED: f64 = 1e-6;
/// Share of the coordinates' size that counts as rounding; a step below it has settled, too.
const ROUNDING: f64 = 1e-14;
/// Share of the distance below which the last step must be for a foot point that did not settle to
/// be taken: the distance is then good to the square of the share.
const NEARLY: f64 = 1e-2;
/// Number of first-order distances beyond which a foot point is not believed. Near an axis, where
/// the first-order distance means nothing, foot points stray farther.
const STRAYED: f64 = 4.0;
/// Factor by which all other faces must be farther for a face to be the nearest one beyond doubt.
/// Less than 2 could let the foot point lie beyond an edge; more only sends more points the long
/// way.
const CLEARLY: f64 = 2.5;
/// Number of pieces near a point that are combined to edges and corners. A corner of more faces is
/// met at the nearest of their triples.
const NEAR: usize = 5;
/// The step from a foot point that tells whether it lies on the surface, as a share of the
/// coordinates' size: above the rounding of foot points, below any detail.
const ASIDE: f64 = 1e-8;
/// Half thickness of the shell about a piece from which random points are drawn to the piece, as a
/// share of the region's diagonal. A thicker shell finds more samples in a round, a thinner one
/// makes them more uniform on curved pieces.
const SHELL: f64 = 0.02;
/// The root of x⁴ = x + 1. Steps of its powers spread points evenly in a box (Roberts).
const SPREAD: f64 = 1.220_744_084_605_759_5;
/// Number of rounds of random points, which ends the search for a surface that is hardly there.
const MOST_ROUNDS: usize = 200;
/// Determinant of unit normals below which they count as parallel: they make no edge.
const PARALLEL: f64 = 1e-6;

/// A smooth piece, compiled.
#[derive(Clone, Debug)]
struct Sheet {
    /// The function g of the piece.
    tape: Tape,
    /// The plan of ∇g.
    by_space: Plan,
    /// The plan of the derivatives by coordinates and parameters.
    by_all: Plan,
}

/// The signed distance to a compiled solid, positive inside, exact near the surface to what its
/// curvature allows; farther off, where no foot point is found, the first-order distance of
/// [`Shape::distance`].
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
    /// The pieces.
    sheets: Vec<Sheet>,
    /// The pieces' minima and maxima, in the order of computation.
    tree: Vec<Join>,
    n_params: usize,
}

impl Distance {
    /// The distance to the solid that `shape` reads from the graph, placed by `place`, which maps
    /// each piece's expression into `posed`, with `n_params` parameters. None for solids of more
    /// than `MOST_PIECES`: every piece is asked at every point.
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

    /// The tree's value where the pieces have the values `v`.
    fn value(&self, stack: &mut Vec<f64>, v: impl Fn(u32) -> f64) -> f64 {
        self.fold(stack, v, f64::min, f64::max)
    }

    /// The lanes that are inside where the pieces are positive in the lanes `leaves`.
    fn is_inside(&self, stack: &mut Vec<u32>, leaves: &[u32]) -> u32 {
        self.fold(stack, |k| leaves[k as usize], |u, v| u & v, |u, v| u | v)
    }

    /// Computes the tree over leaves of any kind.
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

    /// Number of points in a piece of work.
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

    /// Random points near each piece are drawn to it, and kept where it belongs to the surface:
    /// uniform on a smooth piece to the square of `SHELL` times its curvature, up to its edges.
    fn area_samples(
        &self,
        a: &[f64],
        frame: &Frame,
        region: Aabb,
        wanted: usize,
        seed: u64,
    ) -> Vec<Foot> {
        let mut random = fastrand::Rng::with_seed(seed);
        // A sequence of Kronecker: as random points for any face, and more even.
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

/// The pieces that a foot point is sought on, and how far the search is.
#[derive(Clone, Copy, Debug)]
struct Try {
    /// Index of the point.
    point: u32,
    /// The pieces; the first `order` of them count.
    pieces: [u32; 3],
    /// 1 for a face, 2 for an edge, 3 for a corner.
    order: u8,
    /// The present place of the foot point.
    q: Point3,
    /// The distance beyond which a foot point is of no use.
    most: f64,
    /// Values of the pieces at q.
    g: [f64; 3],
    /// Gradients of the pieces at q.
    grad: [Point3; 3],
    /// Whether the search has ended.
    done: bool,
    /// Whether the foot point may be taken.
    good: bool,
}

/// The first-order feet of some points.
struct FirstFeet {
    /// First-order distances: piece k from point i at k · points + i.
    off: Vec<f64>,
    /// By piece, the points whose nearest face it is beyond doubt.
    lone: Vec<Vec<u32>>,
    /// The other points.
    crowded: Vec<usize>,
}

/// A question to a piece: the try or foot that asks, and the place of the piece among its pieces.
type Asked = (u32, u8);

/// A point with several pieces near.
struct Crowd {
    /// Index of the point.
    point: usize,
    /// The nearest pieces, nearest first; the first `first` are asked.
    near: Vec<u32>,
    first: usize,
    /// Distance to the best place found on the surface.
    best: f64,
}

impl Crowd {
    /// The nearest of `count` pieces by their first-order distances `off`; the pieces within reach
    /// are asked first.
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

/// Evaluates the pieces at given parameters, and finds foot points with them.
struct Finder<'t> {
    solid: &'t Distance,
    /// The values of the parameters.
    a: &'t [f64],
    /// Scratch of the tree over values.
    stack: Vec<f64>,
    /// The evaluator of each piece, made when it is first asked.
    blocks: Vec<Option<Block<'t>>>,
    /// First-order distances of a block of points from each piece.
    off: Vec<Row>,
    /// Scratch of the tree over blocks of values.
    nearest: Vec<Nearest>,
}

impl<'t> Finder<'t> {
    /// A finder at the parameters `a`.
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

    /// The evaluator of piece k.
    fn block(&mut self, k: usize) -> &mut Block<'t> {
        let (sheet, a) = (&self.solid.sheets[k], self.a);
        self.blocks[k].get_or_insert_with(|| {
            let mut block = Block::gradients(&sheet.tape, &sheet.by_space);
            block.bind(a);
            block
        })
    }

    /// g and ∇g of piece k at the points.
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

    /// The feet of the points; writes their distances.
    fn distances(&mut self, points: &[Point3], out: &mut [f64]) -> Vec<Foot> {
        let mut feet = vec![Foot::NONE; points.len()];
        self.feet(points, &mut feet);
        out.iter_mut().zip(&feet).for_each(|(o, f)| *o = f.distance);
        feet
    }

    /// The feet of the points. Faces come first: where the nearest one is near beyond doubt, nothing
    /// else is asked.
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

    /// Writes the first-order feet of the points, and tells the points with one near face from the
    /// points with several.
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

    /// By piece, the first-order feet of the points within twice the shell about it, and the points.
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

    /// Appends the places of the surface that points within the shell about a piece are drawn to.
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

    /// Foot points where several pieces are near. The pieces within [`CLEARLY`] first-order
    /// distances are asked first: no farther piece can matter unless none of them is met.
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

    /// Faces, nearest first, then edges, then corners of the first pieces of each case, as long as
    /// a nearer place than the best so far is possible.
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

    /// The combinations that `choose` makes of the first pieces of each case.
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
    /// Draws all tries to their foot points, in blocks by piece.
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

    /// ∂d/∂a by the envelope theorem, one row per foot.
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

    /// Adds λ ∂g/∂a/|∇g| of piece k at the feet that have a share λ of it.
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

/// The tries at the combinations that `choose` makes of the first pieces of each case, as far as
/// they can lead nearer than the best place so far; and the case of each.
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
            // No place of the combination is nearer than its farthest piece.
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
    /// A try from q, before the first evaluation.
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

    /// A foot point that was found on one face.
    fn met(foot: &Foot) -> Self {
        Self {
            good: true,
            ..Self::new(0, foot.pieces, 1, foot.at)
        }
    }

    /// One step towards the foot point of p, from values and gradients at q.
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
        // The last evaluation was at the place before, which a settled step is near to. A try may be
        // far away on its way; twice the useful distance is given up.
        let is_lost = !far.is_finite() || far > 2.0 * self.most;
        self.done = moved <= SETTLED * far + ROUNDING * size || is_lost;
        self.good = !is_lost && moved <= NEARLY * far + 1e3 * ROUNDING * size;
    }

    /// Writes the foot point that was found, if it is good.
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

/// The next point of an even sequence in the unit cube.
fn spread(even: &mut Point3) {
    let mut step = 1.0;
    for v in even {
        step /= SPREAD;
        *v = (*v + step).fract();
    }
}

/// Shares of the unit normals in a direction that lies in their span.
fn shares_of(direction: Point3, normals: &[Point3]) -> [f64; 3] {
    let wanted: [f64; 3] =
        std::array::from_fn(|c| normals.get(c).map_or(0.0, |n| dot(*n, direction)));
    solve(normals, &wanted).unwrap_or([1.0, 0.0, 0.0])
}

/// The step that tells sides apart, at coordinates of p's size.
fn aside(p: Point3) -> f64 {
    ASIDE * p.iter().fold(1e-300, |s: f64, v| s.max(v.abs()))
}

/// g/|∇g| and ∇g/|∇g|; where the gradient vanishes or is not finite, a distance far off.
fn first_order(g: f64, grad: Point3) -> (f64, Point3) {
    let length = dot(grad, grad).sqrt();
    if length > 0.0 && length.is_finite() && g.is_finite() {
        let d = g / length;
        (d.clamp(-1e150, 1e150), grad.map(|v| v / length))
    } else {
        (if g < 0.0 { -1e150 } else { 1e150 }, [0.0; 3])
    }
}

/// Calls `each` with every choice of two or three of the pieces.
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

/// x with G Gᵀ x = b for one to three rows G; `None` where they are nearly parallel.
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

/// x = G⁻ᵀ G⁻¹ b for three rows G, by the reciprocal basis.
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
