//! Discontinuous functions: detection of jumps, and an equivalent solid without jumps.
//!
//! `floor(u)` jumps where u is an integer t, a comparison where its sides are equal (u − t = 0 with
//! t = 0). On each side the function equals a continuous one: F below t, G above. The solid {F ≥ 0,
//! u ≤ t} ∪ {G ≥ 0, u ≥ t} has walls on the surface u = t where F and G differ in sign. A plain
//! maximum of minima would vanish on all of u = t; with the intersection of the two as a third term
//! it does not:
//!
//! ```text
//! max(min(F, t − u), min(G, u − t), min(F, G)),
//! ```
//!
//! which has an identical sign wherever u ≠ t. This is repeated for every value that a
//! discontinuous node takes in the box of the solid; operands of minima and maxima are treated
//! separately.

use crate::graph::{Graph, Node, NodeId};
use crate::hyperfun::{SourceToken, TRUTH_TOLERANCE};
use crate::library::Native;
use crate::ops::{Binary, Ops, SetOp, Unary};
use crate::solid::Pieces;
use crate::tape::Tape;
use isoform_geom::{Aabb, Point3, Solid};
use isoform_num::Interval;
use std::cell::OnceCell;
use std::collections::BTreeSet;

/// Number of samples along the longest side of the box in which jumps are sought.
const SAMPLES_PER_SIDE: usize = 32;
/// Maximum number of lattice edges on which jumps are located.
const MAX_SEARCHED_EDGES: usize = 4096;
/// Distance over which the continuous change of a function is measured, to be distinguished from a
/// jump, in diagonals of the box.
const CONTINUITY_DISTANCE: f64 = 1e-7;
/// Maximum number of values of one discontinuous node.
const MAX_STEP_VALUES: usize = 256;
/// Maximum number of functions that are joined; more have too many pieces to be meshed.
const MAX_JOINED_FUNCTIONS: usize = 1024;
/// Number of slabs into which a box is cut to bound the region where a discontinuous node has a
/// given value.
const SLABS_PER_AXIS: usize = 32;
/// Maximum number of boxes that are subdivided to prove that a motif does not leave its cell.
const MAX_SUBDIVIDED_BOXES: usize = 2000;
/// Margin by which the box of the solid is enlarged, in diagonals: the function without jumps is
/// valid only in the enlarged box, whose sides limit it.
const BOX_MARGIN: f64 = 0.125;

/// Point at which a function jumps across 0.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "{} jumps near ({:.4}, {:.4}, {:.4})",
    what.as_ref().map_or("the function".to_owned(), |what| {
        format!("`{}` at {}:{}", what.text, what.line, what.column)
    }),
    at[0],
    at[1],
    at[2]
)]
pub struct Jump {
    /// Point next to the jump.
    pub at: Point3,
    /// Function or operator of the program that is discontinuous there; `None` if unknown.
    pub what: Option<SourceToken>,
}

/// Result of a search for jumps.
struct DetectedJumps {
    /// Nodes at which a piece jumps across 0.
    nodes: BTreeSet<NodeId>,
    /// Point at which the solid's function jumps across 0.
    whole: Option<Jump>,
}

impl Pieces {
    /// Returns true if a piece contains a discontinuous node, which may be continuous in the region
    /// of interest.
    pub fn may_jump(&self) -> bool {
        let (graph, roots) = self.functions();
        !jumping(graph, roots).is_empty()
    }

    /// Returns the solid in a slightly enlarged box without the jumps of its pieces; `None` if it
    /// has none.
    ///
    /// # Errors
    /// [`Jump`], if a jump cannot be replaced by a wall.
    pub fn without_jumps(&self, region: Aabb) -> Result<Option<Self>, Jump> {
        let (graph, roots) = self.functions();
        let nodes = jumping(graph, roots);
        if nodes.is_empty() || region.is_empty() {
            return Ok(None);
        }
        // Steps at which the whole is continuous, as in a repeated pattern, are removed, too:
        // interval bounds of them are wide.
        let has_steps = nodes.iter().any(|id| is_step(graph.node(*id)));
        let found = self.found(&nodes, region);
        if found.nodes.is_empty() && !has_steps {
            return Ok(None);
        }
        let walled = self.walled(&found.nodes, region);
        match (walled, found.whole) {
            (None, Some(jump)) => Err(jump),
            (walled, _) => Ok(walled),
        }
    }

    /// Searches for jumps along the edges of a lattice.
    fn found(&self, nodes: &[NodeId], region: Aabb) -> DetectedJumps {
        let (graph, roots) = self.functions();
        let mut graph = graph.clone();
        let states: Vec<NodeId> = nodes.iter().map(|&id| state(&mut graph, id)).collect();
        let line = LineSampler {
            pieces: Tape::new(&graph, roots, 3, 0),
            states: Tape::new(&graph, &states, 3, 0),
        };
        // The lattice extends beyond the box, so that states at its sides are sampled.
        let edges = line.edges(region.widened(region.diagonal() / SAMPLES_PER_SIDE as f64));
        let mut found = DetectedJumps {
            nodes: BTreeSet::new(),
            whole: None,
        };
        let near = CONTINUITY_DISTANCE * region.diagonal();
        let mut scratch = Vec::new();
        for [p, q] in edges.iter().step_by(edges.len() / MAX_SEARCHED_EDGES + 1) {
            for sides in line.changes(*p, *q, &mut scratch) {
                let jumps = line.jumps(sides, near, self.tree(), &mut scratch);
                if !jumps.piece {
                    continue;
                }
                let [a, b] = &sides.map(|p| line.states.eval_all(&p, &[], &mut scratch));
                let differ = (0..nodes.len()).filter(|i| a[*i] != b[*i]);
                let differ: Vec<NodeId> = differ.map(|i| nodes[i]).collect();
                if jumps.whole && found.whole.is_none() {
                    let place = |id: &NodeId| self.place(*id).cloned();
                    found.whole = Some(Jump {
                        at: sides[0],
                        what: differ.iter().find_map(place),
                    });
                }
                found.nodes.extend(differ);
            }
        }
        found
    }

    /// Replaces the jumps of some nodes by walls, in a slightly enlarged box; `None` if that is
    /// impossible.
    fn walled(&self, nodes: &BTreeSet<NodeId>, region: Aabb) -> Option<Self> {
        let (graph, root) = self.whole();
        let mut walls = WallBuilder {
            graph,
            tests: nodes.clone(),
            cells: 0,
        };
        let wide = region.widened(BOX_MARGIN * region.diagonal());
        let inner = walls.without(root, wide)?;
        let graph = &mut walls.graph;
        let mut all = inner;
        for axis in 0..3 {
            let (x, lo, hi) = (
                graph.x(axis),
                graph.constant(wide.lo[axis]),
                graph.constant(wide.hi[axis]),
            );
            for side in [graph.sub(&x, &lo), graph.sub(&hi, &x)] {
                graph.set_name(side, "limit");
                all = graph.set(SetOp::Min, &all, &side);
            }
        }
        let made = Self::new(&walls.graph, all, &[]).ok()?;
        (self.is_like(&made, region) && !made.is_jumping(region)).then_some(made)
    }

    /// Returns true if a piece jumps across 0 in a box.
    fn is_jumping(&self, region: Aabb) -> bool {
        let (graph, roots) = self.functions();
        let nodes = jumping(graph, roots);
        !nodes.is_empty() && !self.found(&nodes, region).nodes.is_empty()
    }

    /// Returns true if two solids have equal signs at the points of a lattice.
    fn is_like(&self, other: &Self, region: Aabb) -> bool {
        let points: Vec<Point3> = SampleLattice::new(region).points().collect();
        let [mut own, mut others] = [(); 2].map(|()| vec![0.0; points.len()]);
        self.sign_values(&points, &mut own);
        other.sign_values(&points, &mut others);
        // R-functions vanish where both of their arguments do, and so may minima.
        let is_same = |(a, b): (&f64, &f64)| (*a >= 0.0) == (*b >= 0.0) || *a == 0.0 || *b == 0.0;
        own.iter().zip(&others).all(is_same)
    }
}

/// Returns the nodes below some roots that are discontinuous and depend on the coordinates.
fn jumping(graph: &Graph, roots: &[NodeId]) -> Vec<NodeId> {
    let need = graph.reachable(roots);
    let ids = (0..need.len()).filter(|i| need[*i]);
    ids.map(|i| NodeId(i as u32))
        .filter(|id| graph.is_in_space(*id) && jumps(graph.node(*id)))
        .collect()
}

/// Returns true if the operation of a node is discontinuous.
pub(crate) fn jumps(node: &Node) -> bool {
    let is_other = matches!(
        node,
        Node::Binary(Binary::Less | Binary::LessEq | Binary::Atan2, ..)
            | Node::Native(Native::Fmod, _)
    );
    is_step(node) || is_other
}

/// Returns true if the operation of a node is piecewise constant.
fn is_step(node: &Node) -> bool {
    matches!(
        node,
        Node::Unary(Unary::Floor | Unary::Ceil | Unary::Trunc | Unary::Sign, _)
    )
}

/// Returns a node that is constant wherever the given node is continuous.
fn state(graph: &mut Graph, id: NodeId) -> NodeId {
    match graph.node(id).clone() {
        Node::Binary(Binary::Atan2, y, _) => {
            let zero = graph.constant(0.0);
            graph.less(&y, &zero)
        }
        Node::Native(_, args) => {
            let turns = graph.div(&args[0], &args[1]);
            graph.unary(Unary::Trunc, &turns)
        }
        _ => id,
    }
}

/// Regular lattice of points in a box, offset from symmetry planes and round numbers.
struct SampleLattice {
    region: Aabb,
    counts: [usize; 3],
}

impl SampleLattice {
    fn new(region: Aabb) -> Self {
        let size = region.size();
        let longest = size.into_iter().fold(0.0, f64::max);
        let count = |s: f64| {
            ((SAMPLES_PER_SIDE as f64 * s / longest).ceil() as usize).clamp(4, SAMPLES_PER_SIDE)
        };
        Self {
            region,
            counts: size.map(count),
        }
    }
    fn point(&self, at: [usize; 3]) -> Point3 {
        let size = self.region.size();
        std::array::from_fn(|k| {
            self.region.lo[k] + (at[k] as f64 + 0.4142) / self.counts[k] as f64 * size[k]
        })
    }
    fn points(&self) -> impl Iterator<Item = Point3> {
        let [x, y, z] = self.counts;
        (0..x * y * z).map(move |i| self.point([i / z / y, i / z % y, i % z]))
    }
}

/// Evaluator of pieces and states along lines.
struct LineSampler {
    pieces: Tape,
    states: Tape,
}

/// Discontinuities between two neighbouring points.
struct JumpFlags {
    piece: bool,
    whole: bool,
}

impl LineSampler {
    /// Returns the edges of a lattice between whose ends a state changes.
    fn edges(&self, region: Aabb) -> Vec<[Point3; 2]> {
        let lattice = SampleLattice::new(region);
        let mut scratch = Vec::new();
        let of = |p: Point3| self.states.eval_all(&p, &[], &mut scratch);
        let states: Vec<Vec<f64>> = lattice.points().map(of).collect();
        let [x, y, z] = lattice.counts;
        let number = |at: [usize; 3]| (at[0] * y + at[1]) * z + at[2];
        let mut edges = Vec::new();
        for i in 0..x * y * z {
            let at = [i / z / y, i / z % y, i % z];
            for axis in 0..3 {
                let mut next = at;
                next[axis] += 1;
                if next[axis] < lattice.counts[axis] && states[i] != states[number(next)] {
                    edges.push([lattice.point(at), lattice.point(next)]);
                }
            }
        }
        edges
    }

    /// Locates the changes of state between two points, each as the two adjacent points on either
    /// side of it.
    fn changes(&self, from: Point3, to: Point3, scratch: &mut Vec<f64>) -> Vec<[Point3; 2]> {
        let on = |t: f64| -> Point3 { std::array::from_fn(|k| from[k] + t * (to[k] - from[k])) };
        let mut state = |t: f64| self.states.eval_all(&on(t), &[], scratch);
        let (mut found, mut start) = (Vec::new(), 0.0);
        let end = state(1.0);
        // Further changes are found on other edges.
        while found.len() < 4 {
            let first = state(start);
            if first == end {
                break;
            }
            let (mut lo, mut hi) = (start, 1.0);
            loop {
                let middle = f64::midpoint(lo, hi);
                if middle <= lo || middle >= hi {
                    break;
                }
                if state(middle) == first {
                    lo = middle;
                } else {
                    hi = middle;
                }
            }
            found.push([on(lo), on(hi)]);
            start = hi;
        }
        found
    }

    /// Tests if a piece, or the whole, jumps across 0 between two neighbouring points: it changes
    /// by more than it does over the distance `near` on either side.
    fn jumps(
        &self,
        [p, q]: [Point3; 2],
        near: f64,
        tree: &isoform_geom::Csg,
        scratch: &mut Vec<f64>,
    ) -> JumpFlags {
        // The points differ along one axis.
        let axis = (0..3).find(|k| p[*k] != q[*k]).unwrap_or(0);
        let moved = |p: Point3, by: f64| {
            let mut p = p;
            p[axis] += by;
            p
        };
        let way = if q[axis] >= p[axis] { near } else { -near };
        let [a0, a, b, b0] = [moved(p, -way), p, q, moved(q, way)];
        let [a0, a, b, b0] = [a0, a, b, b0].map(|p| self.pieces.eval_all(&p, &[], scratch));
        let is_jump = |[a0, a, b, b0]: [f64; 4]| {
            let own = (a - a0).abs() + (b - b0).abs();
            let rounding = 16.0 * f64::EPSILON * (a.abs() + b.abs());
            (a >= 0.0) != (b >= 0.0) && (a - b).abs() > own + rounding
        };
        let mut pieces = (0..a.len()).map(|k| [a0[k], a[k], b[k], b0[k]]);
        let whole = [&a0, &a, &b, &b0].map(|v| tree.value(&|k| v[k as usize]));
        JumpFlags {
            piece: pieces.any(is_jump),
            whole: is_jump(whole),
        }
    }
}

/// Replacement of jumps by walls.
struct WallBuilder {
    graph: Graph,
    /// Nodes to be removed, in addition to all piecewise constant ones.
    tests: BTreeSet<NodeId>,
    /// Number of functions joined so far.
    cells: usize,
}

/// Values of a piecewise constant node as a function of u: value 0 up to the first limit, value 1
/// up to the second, and so on.
struct StepValues {
    u: NodeId,
    limits: Vec<f64>,
    values: Vec<f64>,
}

impl WallBuilder {
    /// Returns an expression without jumps with the sign of `id` in a region.
    fn without(&mut self, id: NodeId, region: Aabb) -> Option<NodeId> {
        let Some(jump) = self.first_jump(id) else {
            return Some(id);
        };
        match *self.graph.node(id) {
            Node::Set(op, u, v) => {
                let (u, v) = (self.without(u, region)?, self.without(v, region)?);
                return Some(self.graph.set(op, &u, &v));
            }
            Node::Unary(Unary::Neg, u) => {
                let u = self.without(u, region)?;
                return Some(self.graph.neg(&u));
            }
            _ => {}
        }
        let steps = self.steps(jump, region)?;
        self.cells += steps.values.len();
        if self.cells > MAX_JOINED_FUNCTIONS {
            return None;
        }
        let u = Tape::new(&self.graph, &[steps.u], 3, 0);
        let mut cells: Vec<StepCell> = Vec::new();
        for (i, value) in steps.values.iter().enumerate() {
            let lower = i.checked_sub(1).map(|i| steps.limits[i]);
            let upper = steps.limits.get(i).copied();
            let within = contracted(region, &u, lower, upper);
            let function = if within.is_empty() {
                self.graph.constant(-1.0)
            } else {
                let by = self.graph.constant(*value);
                let fixed = self.replaced(id, jump, by);
                let function = self.without(fixed, within)?;
                self.decided(function, within)
            };
            match cells.last_mut() {
                Some(last) if last.function == function => last.upper = upper,
                _ => cells.push(StepCell {
                    function,
                    lower,
                    upper,
                }),
            }
        }
        // Patterns whose motifs do not touch the seams do not need walls.
        let functions: Vec<OnceCell<Tape>> = cells.iter().map(|_| OnceCell::new()).collect();
        for is_min in [true, false] {
            let is_one_sided = |(cell, function): (&StepCell, &OnceCell<Tape>)| {
                let compiled = || Tape::new(&self.graph, &[cell.function], 3, 0);
                cell.is_one_sided(function.get_or_init(compiled), &u, is_min, region)
            };
            if cells.iter().zip(&functions).all(is_one_sided) {
                let op = if is_min { SetOp::Min } else { SetOp::Max };
                let functions = cells.iter().map(|cell| cell.function);
                return functions.reduce(|a, b| self.graph.set(op, &a, &b));
            }
        }
        Some(self.joined(steps.u, &cells))
    }

    /// Returns the first node below another that is to be removed; the nodes below it are
    /// continuous.
    fn first_jump(&self, id: NodeId) -> Option<NodeId> {
        let need = self.graph.reachable(&[id]);
        let ids = (0..need.len())
            .filter(|i| need[*i])
            .map(|i| NodeId(i as u32));
        ids.filter(|id| self.graph.is_in_space(*id))
            .find(|id| is_step(self.graph.node(*id)) || self.tests.contains(id))
    }

    /// Returns the values of a discontinuous node in a region.
    fn steps(&mut self, id: NodeId, region: Aabb) -> Option<StepValues> {
        let (op, u) = match *self.graph.node(id) {
            Node::Unary(op, u) => (op, u),
            Node::Binary(Binary::Less | Binary::LessEq, a, b) if !self.is_guard(a, b) => {
                let u = self.graph.sub(&b, &a);
                return Some(StepValues {
                    u,
                    limits: vec![0.0],
                    values: vec![0.0, 1.0],
                });
            }
            _ => return None,
        };
        if op == Unary::Sign {
            return Some(StepValues {
                u,
                limits: vec![0.0],
                values: vec![-1.0, 1.0],
            });
        }
        let range = self.range(u, region);
        if !(range.lo().is_finite() && range.hi() - range.lo() < MAX_STEP_VALUES as f64) {
            return None;
        }
        let (first, last) = (range.lo().floor(), range.hi().floor());
        let count = (last - first) as usize;
        let limits = (1..=count).map(|i| first + i as f64);
        // Truncation is continuous at 0.
        let limits: Vec<f64> = limits
            .filter(|limit| op != Unary::Trunc || *limit != 0.0)
            .collect();
        let middle = |i: usize| match (i.checked_sub(1).map(|i| limits[i]), limits.get(i)) {
            (Some(lower), _) => lower + 0.5,
            (None, Some(upper)) => upper - 0.5,
            (None, None) => range.middle(),
        };
        let values = (0..=limits.len()).map(|i| op.apply(&middle(i))).collect();
        Some(StepValues { u, limits, values })
    }

    /// Returns true if |w| is compared with the language's tolerance: the layer where the
    /// comparison holds is too thin to be part of a solid.
    fn is_guard(&self, a: NodeId, b: NodeId) -> bool {
        let is_thin = |size: NodeId, limit: NodeId| {
            matches!(self.graph.node(size), Node::Unary(Unary::Abs, _))
                && self
                    .graph
                    .constant_value(limit)
                    .is_some_and(|c| c <= TRUTH_TOLERANCE)
        };
        is_thin(a, b) || is_thin(b, a)
    }

    fn range(&self, id: NodeId, region: Aabb) -> Interval {
        Tape::new(&self.graph, &[id], 3, 0).range(&region.sides(), &[], &mut Vec::new())
    }

    /// Returns the function, or a constant of its sign if intervals prove that the sign is constant
    /// in the region.
    fn decided(&mut self, function: NodeId, region: Aabb) -> NodeId {
        let range = self.range(function, region);
        if range.hi() < 0.0 {
            self.graph.constant(-1.0)
        } else if range.lo() > 0.0 {
            self.graph.constant(1.0)
        } else {
            function
        }
    }

    /// Returns the expression `root` with `node` replaced `by` another.
    fn replaced(&mut self, root: NodeId, node: NodeId, by: NodeId) -> NodeId {
        let new = self.graph.replaced(root, node, by);
        let of = |id: &NodeId| new.get(id.at()).copied().flatten();
        let tests: Vec<NodeId> = self.tests.iter().filter_map(of).collect();
        self.tests.extend(tests);
        of(&root).expect("the root is rebuilt")
    }

    /// Joins the functions of all cells, each in its own cell, with walls between them.
    fn joined(&mut self, u: NodeId, cells: &[StepCell]) -> NodeId {
        let graph = &mut self.graph;
        let mut all: Option<NodeId> = None;
        let mut add = |graph: &mut Graph, part: NodeId| {
            all = Some(all.map_or(part, |all| graph.set(SetOp::Max, &all, &part)));
        };
        for (i, cell) in cells.iter().enumerate() {
            let part = between(graph, cell.function, u, cell.lower, cell.upper);
            add(graph, part);
            if let Some(next) = cells.get(i + 1) {
                let both = graph.set(SetOp::Min, &cell.function, &next.function);
                let part = between(graph, both, u, cell.lower, next.upper);
                add(graph, part);
            }
        }
        all.unwrap_or_else(|| graph.constant(-1.0))
    }
}

/// Returns a box in a region outside of which u does not lie between two limits; it may be empty.
fn contracted(region: Aabb, u: &Tape, lower: Option<f64>, upper: Option<f64>) -> Aabb {
    let (lower, upper) = (
        lower.unwrap_or(f64::NEG_INFINITY),
        upper.unwrap_or(f64::INFINITY),
    );
    let mut scratch = Vec::new();
    let mut inner = region;
    for axis in 0..3 {
        let (from, step) = (inner.lo[axis], inner.size()[axis] / SLABS_PER_AXIS as f64);
        let mut left = Aabb::EMPTY;
        for i in 0..SLABS_PER_AXIS {
            let mut slab = inner;
            slab.lo[axis] = from + i as f64 * step;
            if i + 1 < SLABS_PER_AXIS {
                slab.hi[axis] = from + (i + 1) as f64 * step;
            }
            let range = u.range(&slab.sides(), &[], &mut scratch);
            if range.hi() >= lower && range.lo() <= upper {
                left.add(slab.lo);
                left.add(slab.hi);
            }
        }
        inner = left;
        if inner.is_empty() {
            break;
        }
    }
    inner
}

/// Returns the halves of a box along an axis.
fn halves(b: Aabb, axis: usize) -> [Aabb; 2] {
    let middle = f64::midpoint(b.lo[axis], b.hi[axis]);
    let (mut below, mut above) = (b, b);
    below.hi[axis] = middle;
    above.lo[axis] = middle;
    [below, above]
}

/// Function with the limits of u between which it is valid.
struct StepCell {
    function: NodeId,
    lower: Option<f64>,
    upper: Option<f64>,
}

impl StepCell {
    /// Returns true if intervals prove that the function is positive, or negative, in all of the
    /// region outside of the cell.
    fn is_one_sided(&self, function: &Tape, u: &Tape, positive: bool, region: Aabb) -> bool {
        let mut scratch = Vec::new();
        let mut range = |tape: &Tape, b: Aabb| tape.range(&b.sides(), &[], &mut scratch);
        let (mut boxes, mut left) = (vec![region], MAX_SUBDIVIDED_BOXES);
        while let Some(b) = boxes.pop() {
            let own = range(u, b);
            if self.lower.is_none_or(|t| own.lo() > t) && self.upper.is_none_or(|t| own.hi() < t) {
                continue;
            }
            let values = range(function, b);
            if (positive && values.lo() > 0.0) || (!positive && values.hi() < 0.0) {
                continue;
            }
            if left == 0 {
                return false;
            }
            left -= 1;
            // The box is bisected along the axis on which the two functions depend most.
            let share = |half: Interval, whole: Interval| {
                let share = (half.hi() - half.lo()) / (whole.hi() - whole.lo());
                if share.is_nan() { 1.0 } else { share }
            };
            let mut best: Option<(f64, [Aabb; 2])> = None;
            for axis in 0..3 {
                let parts = halves(b, axis);
                let left =
                    share(range(u, parts[0]), own) + share(range(function, parts[0]), values);
                if best.is_none_or(|best| left < best.0) {
                    best = Some((left, parts));
                }
            }
            boxes.extend(best.map_or([b; 2], |best| best.1));
        }
        true
    }
}

/// Returns the minimum of a function and the differences of u from its limits.
fn between(
    graph: &mut Graph,
    function: NodeId,
    u: NodeId,
    lower: Option<f64>,
    upper: Option<f64>,
) -> NodeId {
    let mut all = function;
    if let Some(limit) = lower {
        let limit = graph.constant(limit);
        let above = graph.sub(&u, &limit);
        graph.set_name(above, "step");
        all = graph.set(SetOp::Min, &all, &above);
    }
    if let Some(limit) = upper {
        let limit = graph.constant(limit);
        let below = graph.sub(&limit, &u);
        graph.set_name(below, "step");
        all = graph.set(SetOp::Min, &all, &below);
    }
    all
}
