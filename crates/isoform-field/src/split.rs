//! Splitting an expression of space into smooth pieces, joined by minima and maxima.
//!
//! Two readings go hand in hand. By *sign*: only where the expression is ≥ 0 counts, so R-functions
//! are maxima and minima, primitives their closed-form sides, positive factors nothing. By *value*:
//! the tree has the expression's value everywhere, so that what is computed from it passes through:
//! a function that rises in an argument is, of a minimum, the minimum of the function. Values pass
//! through |u| = max(u, −u), sums, signed factors and quotients, monotone functions of one
//! argument, R-functions, and blends.
//!
//! A smooth maximum is mostly written with minima, maxima and |u| of its own: max(u, v) + max(k −
//! |u − v|, 0)²/(4k). Where the kinks of such a formula cancel ([`crate::smooth`]) it is one
//! function of the expressions that it uses more than once (u and v here), and distributed over
//! their pieces: smooth(min(a, b), c) = min(smooth(a, c), smooth(b, c)).

use crate::graph::{Graph, Node, NodeId};
use crate::library::Library;
use crate::ops::{Binary, Ops, SetOp, Unary};
use crate::smooth::{Random, smooth_and_monotone};
use crate::tape::Tape;
use isoform_geom::Csg;
use isoform_num::{Interval, Real};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;

/// Blends of many-sided shapes have a piece for each pair of sides; beyond so many pieces a blend
/// stays one piece.
const MOST_PRODUCTS: usize = 4096;
/// Pieces of a whole solid, counted where they stand in the tree.
const MOST_PIECES: usize = 1 << 16;
/// Minima in maxima in minima …: the readings recurse, and 2 MiB of stack must suffice.
const DEEPEST: usize = 400;
/// A smooth function of more shapes than this is not looked for,
pub(crate) const MOST_INPUTS: usize = 5;
/// nor where more candidates stand side by side,
const MOST_FOUND: usize = 24;
/// nor after so many failures: the search looks at all that is below a node.
const MOST_FAILURES: usize = 2000;

/// The sign of a parameter without a value: sizes are positive, and names of faces are to be those
/// that they have for such values. The ends are far from what overflows in products of a few.
const POSITIVE: [f64; 2] = [1e-9, 1e9];
/// The value of parameter i where kinks are sought and it has none: positive, and different for
/// each, so that terms do not cancel by chance.
fn stand_in(i: u32) -> f64 {
    0.5 + (0.618_033_988_749_895 * f64::from(i + 1)).fract()
}

/// Why an expression has no pieces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SplitError {
    /// Its sign does not change.
    Constant { inside: bool },
    /// Too deeply nested, or too many pieces.
    TooLarge,
}

/// An expression as smooth pieces.
pub(crate) struct Split {
    pub(crate) names: Vec<String>,
    pub(crate) pieces: Vec<NodeId>,
    pub(crate) tree: Csg,
    /// What is known to be a monotone function of other expressions.
    pub(crate) monotone: HashMap<NodeId, Monotone>,
}

/// An expression as a monotone function of others.
#[derive(Clone, Debug)]
pub(crate) struct Monotone {
    pub(crate) function: Rc<Function>,
    pub(crate) inputs: Vec<NodeId>,
}

impl Monotone {
    /// A blend, by itself.
    pub(crate) fn of_blend(graph: &Graph, id: NodeId) -> Option<Self> {
        let Node::Library(
            f @ (Library::DistanceBlendUnion | Library::DistanceBlendIntersection),
            args,
        ) = graph.node(id)
        else {
            return None;
        };
        let radius = graph.constant_value(args[2])?;
        let mut alone = Graph::new();
        let arguments = [alone.x(3), alone.x(4), alone.constant(radius)];
        let root = alone.library(*f, &arguments);
        let function = Rc::new(Function {
            graph: alone,
            root,
            rises: vec![true; 2],
        });
        Some(Self {
            function,
            inputs: args[..2].to_vec(),
        })
    }
}

/// A function of X(3), X(4), …, and for each of these whether it rises.
#[derive(Debug)]
pub(crate) struct Function {
    pub(crate) graph: Graph,
    pub(crate) root: NodeId,
    pub(crate) rises: Vec<bool>,
}

/// Reads the expression `root`, of x alone; the graph grows by the pieces.
pub(crate) fn split(graph: &mut Graph, root: NodeId) -> Result<Split, SplitError> {
    let mut reader = Reader::new(graph, root);
    let tree = reader.whole().ok_or(SplitError::TooLarge)?;
    let monotone = std::mem::take(&mut reader.monotone);
    let tree = without_constants(graph, &tree).map_err(|inside| SplitError::Constant { inside })?;
    let mut numbering = Numbering::new(graph);
    let tree = numbering.tree(&tree);
    Ok(Split {
        names: numbering.names,
        pieces: numbering.pieces,
        tree,
        monotone,
    })
}

/// A smooth piece with what its name is made of.
#[derive(Clone, Debug)]
struct Leaf {
    value: NodeId,
    /// Of the expression itself, or of the next one above that has a name; may be empty.
    name: Rc<str>,
    /// The name says it all; else it is of something that has other pieces, too.
    is_own: bool,
    /// Which side of an |u|; may be empty.
    side: Rc<str>,
}

#[derive(Clone, Debug)]
enum Tree {
    Leaf(Leaf),
    Join(Rc<Join>),
}

#[derive(Debug)]
struct Join {
    is_min: bool,
    children: Vec<Tree>,
    leaves: usize,
}

impl Tree {
    fn join(is_min: bool, parts: impl IntoIterator<Item = Self>) -> Self {
        let mut children = Vec::new();
        for part in parts {
            match part {
                Self::Join(join) if join.is_min == is_min => {
                    children.extend(join.children.iter().cloned())
                }
                part => children.push(part),
            }
        }
        if children.len() == 1 {
            return children.remove(0);
        }
        let leaves = children
            .iter()
            .fold(0usize, |n, c| n.saturating_add(c.leaves()));
        Self::Join(Rc::new(Join {
            is_min,
            children,
            leaves,
        }))
    }

    fn leaves(&self) -> usize {
        match self {
            Self::Leaf(_) => 1,
            Self::Join(join) => join.leaves,
        }
    }

    /// The tree of a function of the value that rises, or (`falls`) falls.
    fn map(&self, falls: bool, f: &mut impl FnMut(&Leaf) -> Leaf) -> Self {
        match self {
            Self::Leaf(leaf) => Self::Leaf(f(leaf)),
            Self::Join(join) => Self::join(
                join.is_min != falls,
                join.children
                    .iter()
                    .map(|c| c.map(falls, f))
                    .collect::<Vec<_>>(),
            ),
        }
    }
}

/// The name to be used below a node.
#[derive(Clone, Debug, Default)]
struct Context {
    name: Rc<str>,
    is_own: bool,
}

/// What is known of a node's parity: f(−u) = −f(u), and f rises.
fn is_odd_and_rising(op: Unary) -> bool {
    matches!(op, Unary::Sinh | Unary::Tanh | Unary::Atan)
}

struct Reader<'a> {
    graph: &'a mut Graph,
    root: NodeId,
    /// By node: whether its value may have kinks.
    kinked: Vec<bool>,
    /// By node: bounds over all space.
    ranges: Vec<Interval>,
    values: HashMap<NodeId, Tree>,
    signs: HashMap<NodeId, Tree>,
    monotone: HashMap<NodeId, Monotone>,
    /// Trees of the sides of primitives.
    sides: HashMap<NodeId, Vec<Tree>>,
    /// Number of parameters without a value.
    params: usize,
    depth: usize,
    failures: usize,
    too_large: bool,
}

/// A node to be distributed over the pieces of its inputs.
struct Product<'a> {
    id: NodeId,
    /// The nodes that depend on the inputs, up to `id`.
    above: &'a [NodeId],
    inputs: &'a [NodeId],
    function: Option<Rc<Function>>,
    context: &'a Context,
}

/// The minimum or maximum that a node is, whichever way it is written.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Join2 {
    Min(NodeId, NodeId),
    Max(NodeId, NodeId),
}

impl<'a> Reader<'a> {
    fn new(graph: &'a mut Graph, root: NodeId) -> Self {
        let (_, params) = graph.inputs(root);
        Self {
            graph,
            root,
            kinked: Vec::new(),
            ranges: Vec::new(),
            values: HashMap::new(),
            signs: HashMap::new(),
            monotone: HashMap::new(),
            sides: HashMap::new(),
            params,
            depth: 0,
            failures: 0,
            too_large: false,
        }
    }

    /// The tree of the whole expression; none where it is too large.
    fn whole(&mut self) -> Option<Tree> {
        let tree = self.sign(self.root, &Context::default());
        (!self.too_large && tree.leaves() <= MOST_PIECES).then_some(tree)
    }

    // ---- by sign

    fn sign(&mut self, id: NodeId, above: &Context) -> Tree {
        if let Some(tree) = self.signs.get(&id) {
            return tree.clone();
        }
        let context = self.context(id, above);
        self.depth += 1;
        let tree = if self.depth > DEEPEST {
            self.too_large = true;
            self.leaf(id, &context)
        } else {
            self.sign_of(id, &context)
        };
        self.depth -= 1;
        if tree.leaves() > MOST_PIECES {
            self.too_large = true;
        }
        if self.too_large {
            return self.leaf(id, &context);
        }
        self.signs.insert(id, tree.clone());
        tree
    }

    fn sign_of(&mut self, id: NodeId, context: &Context) -> Tree {
        if let Some(join) = self.sign_join(id) {
            let is_min = matches!(join, Join2::Min(..));
            let operands = self.operands(id, context, |reader, id| reader.sign_join(id), is_min);
            let parts: Vec<Tree> = operands
                .into_iter()
                .map(|(id, context)| self.sign(id, &context))
                .collect();
            return Tree::join(is_min, parts);
        }
        match self.graph.node(id).clone() {
            Node::Unary(Unary::Neg, u) => {
                let tree = self.sign(u, context);
                self.negated(&tree)
            }
            Node::Unary(op, u) if is_odd_and_rising(op) => self.sign(u, context),
            Node::PowI(u, n) if n > 0 && n % 2 == 1 => self.sign(u, context),
            Node::Binary(Binary::Mul, u, v) => match (self.strict_sign(u), self.strict_sign(v)) {
                (Some(positive), _) => self.signed(v, positive, context),
                (_, Some(positive)) => self.signed(u, positive, context),
                _ => self.by_value(id, context),
            },
            Node::Binary(Binary::Div, u, v) => match self.strict_sign(v) {
                Some(positive) => self.signed(u, positive, context),
                None => self.by_value(id, context),
            },
            Node::Library(f, args) if f.is_primitive() => self.primitive(id, f, &args, context),
            _ => self.by_value(id, context),
        }
    }

    fn signed(&mut self, u: NodeId, positive: bool, context: &Context) -> Tree {
        let tree = self.sign(u, context);
        if positive { tree } else { self.negated(&tree) }
    }

    /// What is a minimum or maximum as far as signs go.
    fn sign_join(&mut self, id: NodeId) -> Option<Join2> {
        match self.graph.node(id) {
            Node::Set(SetOp::RUnion, u, v) => Some(Join2::Max(*u, *v)),
            Node::Set(SetOp::RIntersection, u, v) => Some(Join2::Min(*u, *v)),
            Node::Library(f, args) => {
                let (u, v) = (args[0], args[1]);
                // A blend without width is none.
                let is_zero = |at: usize| {
                    args.get(at)
                        .and_then(|&c| self.graph.constant_value(c))
                        .is_some_and(|c| c <= 0.0)
                };
                match f {
                    Library::SardfUnion => Some(Join2::Max(u, v)),
                    Library::SardfIntersection => Some(Join2::Min(u, v)),
                    Library::DistanceBlendUnion if is_zero(2) => Some(Join2::Max(u, v)),
                    Library::DistanceBlendIntersection if is_zero(2) => Some(Join2::Min(u, v)),
                    _ => None,
                }
            }
            _ => self.value_join(id),
        }
    }

    /// The sides of a primitive, an intersection.
    fn primitive(&mut self, id: NodeId, f: Library, args: &[NodeId], context: &Context) -> Tree {
        let sides = match f {
            // Its distance is an iteration; the quadric has the same zero set.
            Library::DistanceEllipsoid => vec![("", self.graph.library(Library::Ellipsoid, args))],
            _ => f.metric(&mut Sizes(self.graph), args),
        };
        if sides.is_empty() {
            return self.by_value(id, context);
        }
        let is_whole = sides.len() == 1;
        let parts: Vec<Tree> = sides
            .into_iter()
            .map(|(side, value)| {
                let context = match &*context.name {
                    _ if is_whole => context.clone(),
                    "" => Context {
                        name: side.into(),
                        is_own: true,
                    },
                    name => Context {
                        name: format!("{name}.{side}").into(),
                        is_own: true,
                    },
                };
                if self.is_kinked(value) {
                    self.value(value, &context)
                } else {
                    self.leaf(value, &context)
                }
            })
            .collect();
        self.sides.insert(id, parts.clone());
        Tree::join(true, parts)
    }

    fn by_value(&mut self, id: NodeId, context: &Context) -> Tree {
        let tree = self.value(id, context);
        if let Tree::Leaf(_) = tree {
            return tree;
        }
        // What is left of factors in the pieces does not move the surface.
        tree.map(false, &mut |leaf| Leaf {
            value: self.without_factor(leaf.value),
            ..leaf.clone()
        })
    }

    fn without_factor(&mut self, id: NodeId) -> NodeId {
        match self.graph.node(id).clone() {
            Node::Binary(Binary::Div, u, v) if self.strict_sign(v) == Some(true) => u,
            Node::Binary(Binary::Mul, u, v) if self.strict_sign(u) == Some(true) => v,
            Node::Binary(Binary::Mul, u, v) if self.strict_sign(v) == Some(true) => u,
            _ => id,
        }
    }

    // ---- by value

    fn value(&mut self, id: NodeId, above: &Context) -> Tree {
        let context = self.context(id, above);
        if !self.is_kinked(id) {
            return self.leaf(id, &context);
        }
        if let Some(tree) = self.values.get(&id) {
            return tree.clone();
        }
        self.depth += 1;
        let tree = if self.depth > DEEPEST {
            self.too_large = true;
            self.leaf(id, &context)
        } else {
            self.value_of(id, &context)
        };
        self.depth -= 1;
        let tree = if tree.leaves() > MOST_PIECES {
            self.leaf(id, &context)
        } else {
            tree
        };
        self.values.insert(id, tree.clone());
        tree
    }

    fn value_of(&mut self, id: NodeId, context: &Context) -> Tree {
        if let Some(join) = self.value_join(id) {
            let is_min = matches!(join, Join2::Min(..));
            let operands = self.operands(id, context, |reader, id| reader.value_join(id), is_min);
            let parts: Vec<Tree> = operands
                .into_iter()
                .map(|(id, context)| self.value(id, &context))
                .collect();
            return Tree::join(is_min, parts);
        }
        if let Some(u) = self.absolute(id) {
            return self.sides(u, context);
        }
        // Where kinks cancel altogether a cut at them would only be a seam.
        if !self.shows_kinks(id) && self.failures <= MOST_FAILURES {
            match self.blended(id, &[], context) {
                Some(tree) => return tree,
                None => self.failures += 1,
            }
        }
        match self.graph.node(id).clone() {
            Node::Unary(op, u) => self.unary(id, op, u, context),
            Node::PowI(u, n) => self.power(id, u, n, context),
            Node::Binary(op, u, v) => self.binary(id, op, u, v, context),
            Node::Set(_, u, v) => self.passed(id, &[(u, true), (v, true)], context),
            Node::Library(
                Library::DistanceBlendUnion | Library::DistanceBlendIntersection,
                args,
            ) => {
                // Both, kinks or not: a blend is named after both.
                self.distributed(id, &[id], &[(args[0], true), (args[1], true)], context)
            }
            Node::Library(f, _) if f.is_primitive() => {
                let formula = self.graph.lowered(id);
                if self.graph.node(formula) == self.graph.node(id) {
                    self.leaf(id, context)
                } else {
                    self.value(formula, context)
                }
            }
            Node::Library(Library::BlendUnion | Library::BlendIntersection, args) => {
                let kinked: Vec<NodeId> = args[..2]
                    .iter()
                    .copied()
                    .filter(|&u| self.is_kinked(u))
                    .collect();
                self.blended(id, &kinked, context)
                    .unwrap_or_else(|| self.leaf(id, context))
            }
            _ => self
                .blend(id, context)
                .unwrap_or_else(|| self.leaf(id, context)),
        }
    }

    /// |u| as max(u, −u), with u's own pieces.
    fn sides(&mut self, u: NodeId, context: &Context) -> Tree {
        if self.ranges_of(u).lo() >= 0.0 {
            return self.value(u, context);
        }
        let below = self.below(context);
        let tree = self.value(u, &below);
        let is_one = matches!(tree, Tree::Leaf(_));
        let side = |tree: &Tree, sign: &str, is_upper: bool| {
            tree.map(false, &mut |leaf| {
                let (name, side) = match along_axis(self.graph, leaf.value) {
                    Some((axis, rises)) if is_one => {
                        (&below.name, axis_side(axis, rises != is_upper))
                    }
                    _ if leaf.is_own => (&below.name, format!("{}{sign}", leaf.name)),
                    _ => (&leaf.name, format!("{}{sign}", side_of(self.graph, leaf))),
                };
                Leaf {
                    value: leaf.value,
                    name: name.clone(),
                    is_own: false,
                    side: side.into(),
                }
            })
        };
        // The side where u is positive is the upper one of an axis, if u rises along it.
        let upper = side(&tree, "+", true);
        let lower = side(&tree, "-", false);
        let lower = self.negated(&lower);
        Tree::join(false, [upper, lower])
    }

    fn unary(&mut self, id: NodeId, op: Unary, u: NodeId, context: &Context) -> Tree {
        match op {
            Unary::Neg => {
                let tree = self.value(u, context);
                self.negated(&tree)
            }
            Unary::Exp | Unary::Sinh | Unary::Tanh | Unary::Atan => {
                self.passed(id, &[(u, true)], context)
            }
            Unary::Sqrt | Unary::Ln | Unary::Asin => self.passed_in_domain(id, u, true, context),
            Unary::Acos => self.passed_in_domain(id, u, false, context),
            Unary::Square => self.power(id, u, 2, context),
            _ => self
                .blend(id, context)
                .unwrap_or_else(|| self.leaf(id, context)),
        }
    }

    fn power(&mut self, id: NodeId, u: NodeId, n: i32, context: &Context) -> Tree {
        if n > 0 && n % 2 == 1 {
            return self.passed(id, &[(u, true)], context);
        }
        if let Some(tree) = self.blend(id, context) {
            return tree;
        }
        if n == 2 && self.ranges_of(u).lo() >= 0.0 {
            // u² = u |u| for u ≥ 0, which rises everywhere and is C¹: the pieces of u may be
            // negative where they do not decide.
            let tree = self.value(u, context);
            return tree.map(false, &mut |leaf| {
                let size = self.graph.abs(&leaf.value);
                Leaf {
                    value: self.graph.mul(&leaf.value, &size),
                    ..leaf.clone()
                }
            });
        }
        self.leaf(id, context)
    }

    fn binary(&mut self, id: NodeId, op: Binary, u: NodeId, v: NodeId, context: &Context) -> Tree {
        let both = self.is_kinked(u) && self.is_kinked(v);
        if both && let Some(tree) = self.blend(id, context) {
            return tree;
        }
        let inputs = match op {
            Binary::Add => Some(vec![(u, true), (v, true)]),
            Binary::Sub => Some(vec![(u, true), (v, false)]),
            Binary::Mul if !both => {
                let (kinked, factor) = if self.is_kinked(u) { (u, v) } else { (v, u) };
                self.strict_sign(factor)
                    .map(|positive| vec![(kinked, positive)])
            }
            Binary::Div if !self.is_kinked(v) => {
                self.strict_sign(v).map(|positive| vec![(u, positive)])
            }
            Binary::Pow => match self.graph.constant_value(v) {
                Some(c) if c != 0.0 => return self.passed_in_domain(id, u, c > 0.0, context),
                _ => None,
            },
            _ => None,
        };
        match inputs {
            Some(inputs) => self.passed(id, &inputs, context),
            None if both => self.leaf(id, context),
            None => self
                .blend(id, context)
                .unwrap_or_else(|| self.leaf(id, context)),
        }
    }

    /// The node passed through the trees of its inputs, in each of which it rises (true) or falls.
    fn passed(&mut self, id: NodeId, inputs: &[(NodeId, bool)], context: &Context) -> Tree {
        let inputs: Vec<(NodeId, bool)> = inputs
            .iter()
            .copied()
            .filter(|(u, _)| self.is_kinked(*u))
            .collect();
        self.distributed(id, &[id], &inputs, context)
    }

    /// The same for a function that is not defined everywhere: a piece of its argument may leave
    /// the domain where it does not decide.
    fn passed_in_domain(&mut self, id: NodeId, u: NodeId, rises: bool, context: &Context) -> Tree {
        let tree = self.passed(id, &[(u, rises)], context);
        let mut pieces = vec![id];
        let _ = tree.map(false, &mut |leaf| {
            pieces.push(leaf.value);
            leaf.clone()
        });
        if pieces.len() == 2 {
            return tree;
        }
        let a: Vec<f64> = (0..self.params).map(|i| stand_in(i as u32)).collect();
        let tape = Tape::new(self.graph, &pieces, 3, a.len());
        let (mut random, mut scratch) = (Random::new(), Vec::new());
        for _ in 0..64 {
            let values = tape.eval_all(&random.place(3), &a, &mut scratch);
            if !values[0].is_nan() && values.iter().any(|v| v.is_nan()) {
                return self
                    .blend(id, context)
                    .unwrap_or_else(|| self.leaf(id, context));
            }
        }
        tree
    }

    // ---- blends

    /// The node as a smooth function of expressions with kinks that it uses more than once, passed
    /// through their trees. None where it is no such function.
    fn blend(&mut self, id: NodeId, context: &Context) -> Option<Tree> {
        if self.failures > MOST_FAILURES {
            return None;
        }
        let shared = self.shared(id);
        let tree = if shared.is_empty() || shared.len() > MOST_INPUTS {
            None
        } else {
            self.blended(id, &shared, context)
        };
        self.failures += usize::from(tree.is_none());
        tree
    }

    fn blended(&mut self, id: NodeId, of: &[NodeId], context: &Context) -> Option<Tree> {
        let interior = self.interior(id, of);
        let (alone, root) = self.alone(id, &interior, of);
        let rises = smooth_and_monotone(alone, root, of.len())?;
        if of.is_empty() {
            return Some(self.leaf(id, context));
        }
        let inputs: Vec<(NodeId, bool)> = of.iter().copied().zip(rises).collect();
        let mut dependent: HashSet<NodeId> = of.iter().copied().collect();
        let above: Vec<NodeId> = interior
            .into_iter()
            .filter(|&i| {
                let depends = self
                    .graph
                    .arguments(i)
                    .iter()
                    .any(|a| dependent.contains(a));
                depends && dependent.insert(i)
            })
            .collect();
        Some(self.distributed(id, &above, &inputs, context))
    }

    /// Whether the node surely has kinks: linear in one expression that is a minimum, a maximum or
    /// an |u|.
    fn shows_kinks(&mut self, mut id: NodeId) -> bool {
        loop {
            let (u, v) = match self.graph.node(id).clone() {
                Node::Unary(Unary::Neg, _) => return true,
                Node::Binary(Binary::Add | Binary::Sub | Binary::Mul, u, v) => (u, v),
                Node::Binary(Binary::Div, u, v) if !self.is_kinked(v) => (u, v),
                _ => return false,
            };
            id = match (self.is_kinked(u), self.is_kinked(v)) {
                (true, false) => u,
                (false, true) => v,
                _ => return false,
            };
            if self.value_join(id).is_some() || self.absolute(id).is_some() {
                return true;
            }
        }
    }

    /// The topmost nodes with kinks below `id` that are used more than once there, none within
    /// another.
    fn shared(&mut self, id: NodeId) -> Vec<NodeId> {
        let need = self.graph.reachable(&[id]);
        let mut uses: HashMap<NodeId, u32> = HashMap::new();
        for (i, _) in need.iter().enumerate().filter(|(_, need)| **need) {
            for a in self.graph.arguments(NodeId(i as u32)) {
                *uses.entry(a).or_default() += 1;
            }
        }
        // Arguments have smaller numbers: the largest one pending is below none of the others.
        let mut found = Vec::new();
        let mut opened: HashSet<NodeId> = HashSet::new();
        loop {
            found.clear();
            let mut pending: BTreeSet<NodeId> = [id].into();
            while let Some(node) = pending.pop_last() {
                if !self.is_kinked(node) {
                    continue;
                }
                if node != id && uses[&node] > 1 && !opened.contains(&node) {
                    found.push(node);
                } else {
                    pending.extend(self.graph.arguments(node));
                }
            }
            if found.len() > MOST_FOUND {
                break;
            }
            // One that contains another is no input of its own.
            let outer = found.iter().copied().find(|&u| {
                let below = self.graph.reachable(&[u]);
                found.iter().any(|&v| v != u && below[v.at()])
            });
            match outer {
                Some(u) => opened.insert(u),
                None => break,
            };
        }
        found.sort_unstable();
        found
    }

    /// The nodes from `id` down to, without, `inputs`, in the order of computation.
    fn interior(&self, id: NodeId, inputs: &[NodeId]) -> Vec<NodeId> {
        let mut pending: BTreeSet<NodeId> = [id].into();
        let mut nodes = Vec::new();
        while let Some(node) = pending.pop_last() {
            if !inputs.contains(&node) {
                nodes.push(node);
                pending.extend(self.graph.arguments(node));
            }
        }
        nodes.reverse();
        nodes
    }

    /// A copy of the interior with the inputs as further coordinates.
    fn alone(&self, id: NodeId, interior: &[NodeId], inputs: &[NodeId]) -> (Graph, NodeId) {
        let mut graph = Graph::new();
        let mut copy: HashMap<NodeId, NodeId> = HashMap::new();
        for (k, &input) in inputs.iter().enumerate() {
            copy.insert(input, graph.x(3 + k));
        }
        for &node in interior {
            let new = match self.graph.node(node) {
                Node::Param(i) => graph.constant(stand_in(*i)),
                other => rebuilt(&mut graph, other, &copy),
            };
            copy.insert(node, new);
        }
        (graph, copy[&id])
    }

    /// `id`, computed by the nodes `above` from the inputs, as a tree over the inputs' pieces.
    fn distributed(
        &mut self,
        id: NodeId,
        above: &[NodeId],
        inputs: &[(NodeId, bool)],
        context: &Context,
    ) -> Tree {
        // One input: its pieces are pieces of the whole. Several: each pair has a name of its own.
        let below = if inputs.len() > 1 {
            Context::default()
        } else {
            self.below(context)
        };
        let trees: Vec<(Tree, bool)> = inputs
            .iter()
            .map(|&(u, rises)| (self.value(u, &below), rises))
            .collect();
        let products = trees
            .iter()
            .fold(1usize, |n, (t, _)| n.saturating_mul(t.leaves()));
        if products == 1 || products > MOST_PRODUCTS {
            return self.leaf(id, context);
        }
        let (inputs, rises): (Vec<NodeId>, Vec<bool>) = inputs.iter().copied().unzip();
        let function = (inputs.len() > 1)
            .then(|| self.function(id, &inputs, rises))
            .flatten();
        let product = Product {
            id,
            above,
            inputs: &inputs,
            function,
            context,
        };
        self.product(&product, &trees, &mut Vec::with_capacity(trees.len()))
    }

    /// The node as a function of the inputs alone; none where it depends on space besides.
    fn function(&self, id: NodeId, inputs: &[NodeId], rises: Vec<bool>) -> Option<Rc<Function>> {
        let (graph, root) = self.alone(id, &self.interior(id, inputs), inputs);
        let need = graph.reachable(&[root]);
        let in_space = need
            .iter()
            .enumerate()
            .any(|(i, need)| *need && matches!(graph.node(NodeId(i as u32)), Node::X(0..3)));
        (!in_space).then(|| Rc::new(Function { graph, root, rises }))
    }

    fn product(
        &mut self,
        of: &Product<'_>,
        trees: &[(Tree, bool)],
        chosen: &mut Vec<Leaf>,
    ) -> Tree {
        match trees.split_first() {
            Some(((Tree::Leaf(leaf), _), rest)) => {
                chosen.push(leaf.clone());
                let tree = self.product(of, rest, chosen);
                chosen.pop();
                tree
            }
            Some(((Tree::Join(join), rises), rest)) => {
                let with = |child: &Tree| {
                    std::iter::once((child.clone(), *rises))
                        .chain(rest.iter().cloned())
                        .collect::<Vec<_>>()
                };
                let parts: Vec<Tree> = join
                    .children
                    .iter()
                    .map(|child| self.product(of, &with(child), chosen))
                    .collect();
                Tree::join(join.is_min == *rises, parts)
            }
            None => {
                let value = self.product_value(of, chosen);
                if let Some(function) = &of.function {
                    let inputs = chosen.iter().map(|l| l.value).collect();
                    self.monotone.entry(value).or_insert(Monotone {
                        function: function.clone(),
                        inputs,
                    });
                }
                Tree::Leaf(self.product_leaf(value, chosen, of.context))
            }
        }
    }

    /// The node computed from one piece of each input.
    fn product_value(&mut self, of: &Product<'_>, chosen: &[Leaf]) -> NodeId {
        let mut copy: HashMap<NodeId, NodeId> = of
            .inputs
            .iter()
            .copied()
            .zip(chosen.iter().map(|l| l.value))
            .collect();
        for &id in of.above {
            for a in self.graph.arguments(id) {
                copy.entry(a).or_insert(a);
            }
            let node = self.graph.node(id).clone();
            let new = one_sided(self.graph, &node, &copy)
                .unwrap_or_else(|| rebuilt(self.graph, &node, &copy));
            copy.insert(id, new);
        }
        copy[&of.id]
    }

    fn product_leaf(&self, value: NodeId, of: &[Leaf], context: &Context) -> Leaf {
        let with_names: Vec<&Leaf> = of
            .iter()
            .filter(|l| !l.name.is_empty() || !l.side.is_empty())
            .collect();
        match with_names[..] {
            [] => Leaf {
                value,
                name: self.below(context).name,
                is_own: false,
                side: "".into(),
            },
            [one] => Leaf {
                value,
                ..one.clone()
            },
            _ => {
                let name = with_names
                    .iter()
                    .map(|l| named(self.graph, l))
                    .collect::<Vec<_>>()
                    .join("+");
                Leaf {
                    value,
                    name: name.into(),
                    is_own: true,
                    side: "".into(),
                }
            }
        }
    }

    // ---- nodes

    /// The context of a node. A variable that the node is part of says more than a name that is
    /// only suggested for it.
    fn context(&self, id: NodeId, above: &Context) -> Context {
        let is_better = !above.name.is_empty() && self.graph.has_suggested_name(id);
        match self.graph.name(id) {
            Some(name) if !is_better => Context {
                name: name.into(),
                is_own: true,
            },
            _ => above.clone(),
        }
    }

    /// The context of one part of several. The name of the whole solid says nothing of a part.
    fn below(&self, context: &Context) -> Context {
        let is_root = self.graph.name(self.root) == Some(&*context.name);
        Context {
            name: if is_root {
                "".into()
            } else {
                context.name.clone()
            },
            is_own: false,
        }
    }

    fn leaf(&self, id: NodeId, context: &Context) -> Tree {
        Tree::Leaf(Leaf {
            value: id,
            name: context.name.clone(),
            is_own: context.is_own,
            side: "".into(),
        })
    }

    /// −u. A side keeps its name: a cut with a slab leaves the slab's upper face, which is a lower
    /// one of what is left.
    fn negated(&mut self, tree: &Tree) -> Tree {
        tree.map(true, &mut |leaf| {
            let side = side_of(self.graph, leaf);
            Leaf {
                value: negative(self.graph, leaf.value),
                side,
                ..leaf.clone()
            }
        })
    }

    /// The operands of a chain of the same operation, each with the context that it is read in.
    fn operands(
        &mut self,
        id: NodeId,
        context: &Context,
        mut join: impl FnMut(&mut Self, NodeId) -> Option<Join2>,
        is_min: bool,
    ) -> Vec<(NodeId, Context)> {
        let mut pending = vec![(id, context.clone())];
        let (mut found, mut known) = (Vec::new(), HashSet::new());
        while let Some((node, context)) = pending.pop() {
            match join(self, node) {
                Some(Join2::Min(u, v)) if is_min => self.open(&mut pending, &context, u, v),
                Some(Join2::Max(u, v)) if !is_min => self.open(&mut pending, &context, u, v),
                // min(u, u) is u: a second way to the same operand adds nothing.
                _ => {
                    if known.insert(node) {
                        found.push((node, context));
                    }
                }
            }
        }
        found
    }

    fn open(&self, pending: &mut Vec<(NodeId, Context)>, context: &Context, u: NodeId, v: NodeId) {
        let below = self.below(context);
        pending.push((v, self.context(v, &below)));
        pending.push((u, self.context(u, &below)));
    }

    /// The node as a minimum or maximum in value: as such, or as a choice of the smaller or larger
    /// of two.
    fn value_join(&self, id: NodeId) -> Option<Join2> {
        match *self.graph.node(id) {
            Node::Set(SetOp::Max, u, v) => Some(Join2::Max(u, v)),
            Node::Set(SetOp::Min, u, v) => Some(Join2::Min(u, v)),
            Node::Select(condition, u, v) => match *self.graph.node(condition) {
                Node::Binary(Binary::Less | Binary::LessEq, a, b) if (a, b) == (u, v) => {
                    Some(Join2::Min(u, v))
                }
                Node::Binary(Binary::Less | Binary::LessEq, a, b) if (a, b) == (v, u) => {
                    Some(Join2::Max(u, v))
                }
                _ => None,
            },
            _ => None,
        }
    }

    /// u where the node is |u|: as such, or as u < 0 ? −u : u.
    fn absolute(&self, id: NodeId) -> Option<NodeId> {
        match *self.graph.node(id) {
            Node::Unary(Unary::Abs, u) => Some(u),
            Node::Select(condition, u, v) => {
                let Node::Binary(Binary::Less | Binary::LessEq, a, b) = *self.graph.node(condition)
                else {
                    return None;
                };
                let zero = |id| self.graph.constant_value(id) == Some(0.0);
                let is_negative =
                    |of: NodeId, id: NodeId| self.graph.node(id) == &Node::Unary(Unary::Neg, of);
                let found = (zero(b) && a == v && is_negative(v, u))
                    || (zero(a) && b == u && is_negative(u, v));
                found.then_some(if zero(b) { v } else { u })
            }
            _ => None,
        }
    }

    fn is_kinked(&mut self, id: NodeId) -> bool {
        for i in self.kinked.len()..=id.at() {
            let own = match self.graph.node(NodeId(i as u32)) {
                Node::Set(op, ..) => matches!(op, SetOp::Min | SetOp::Max),
                Node::Unary(op, _) => matches!(
                    op,
                    Unary::Abs | Unary::Floor | Unary::Ceil | Unary::Trunc | Unary::Sign
                ),
                Node::Binary(op, ..) => matches!(op, Binary::Less | Binary::LessEq),
                Node::Select(..) => true,
                Node::Library(f, _) => {
                    matches!(
                        f,
                        Library::DistanceCone(_)
                            | Library::Superellipsoid
                            | Library::SardfUnion
                            | Library::SardfIntersection
                    )
                }
                _ => false,
            };
            let arguments = self.graph.arguments(NodeId(i as u32));
            let below = || arguments.iter().any(|a| self.kinked[a.at()]);
            // What depends on parameters alone has no kinks in space.
            self.kinked
                .push(self.graph.is_in_space(NodeId(i as u32)) && (own || below()));
        }
        self.kinked[id.at()]
    }

    /// Whether the node is positive (or negative) everywhere.
    fn strict_sign(&mut self, id: NodeId) -> Option<bool> {
        let range = self.ranges_of(id);
        if range.lo() > 0.0 {
            Some(true)
        } else if range.hi() < 0.0 {
            Some(false)
        } else {
            None
        }
    }

    fn ranges_of(&mut self, id: NodeId) -> Interval {
        for i in self.ranges.len()..=id.at() {
            let of = |id: &NodeId| &self.ranges[id.at()];
            let range = match self.graph.node(NodeId(i as u32)) {
                Node::Constant(bits) => Interval::constant(f64::from_bits(*bits)),
                Node::Unary(op, u) => op.apply(of(u)),
                Node::Binary(op, u, v) => op.apply(of(u), of(v)),
                Node::Set(op, u, v) => op.apply(of(u), of(v)),
                Node::PowI(u, n) => of(u).powi(*n),
                Node::Select(c, u, v) => of(c).select(of(u), of(v)),
                Node::Param(_) => Interval::new(POSITIVE[0], POSITIVE[1]),
                Node::X(_) | Node::Library(..) | Node::Native(..) => Interval::ALL,
            };
            self.ranges.push(range);
        }
        self.ranges[id.at()]
    }
}

/// Builds into a graph, with sizes taken for positive: |a| is a, and a − a is 0, for sizes that are
/// parameters. Sides that are the same for positive sizes are then the same node.
struct Sizes<'a>(&'a mut Graph);

impl Sizes<'_> {
    /// Whether the node is a parameter, or the product of positive numbers.
    fn is_size(&self, id: NodeId) -> bool {
        match self.0.node(id) {
            Node::Param(_) => true,
            Node::Constant(bits) => f64::from_bits(*bits) > 0.0,
            Node::Binary(Binary::Add | Binary::Mul | Binary::Div, u, v) => {
                self.is_size(*u) && self.is_size(*v)
            }
            _ => false,
        }
    }
}

impl Ops for Sizes<'_> {
    type V = NodeId;
    fn constant(&mut self, c: f64) -> NodeId {
        self.0.constant(c)
    }
    fn unary(&mut self, op: Unary, a: &NodeId) -> NodeId {
        if op == Unary::Abs && self.is_size(*a) {
            return *a;
        }
        self.0.unary(op, a)
    }
    fn binary(&mut self, op: Binary, a: &NodeId, b: &NodeId) -> NodeId {
        if op == Binary::Sub && a == b && self.is_size(*a) {
            return self.0.constant(0.0);
        }
        self.0.binary(op, a, b)
    }
    fn powi(&mut self, a: &NodeId, n: i32) -> NodeId {
        self.0.powi(a, n)
    }
    fn set(&mut self, op: SetOp, a: &NodeId, b: &NodeId) -> NodeId {
        self.0.set(op, a, b)
    }
    fn select(&mut self, condition: &NodeId, a: &NodeId, b: &NodeId) -> NodeId {
        self.0.select(condition, a, b)
    }
    fn library(&mut self, f: Library, args: &[NodeId]) -> NodeId {
        self.0.library(f, args)
    }
    fn native(&mut self, f: crate::library::Native, args: &[NodeId]) -> NodeId {
        self.0.native(f, args)
    }
    fn known(&self, v: &NodeId) -> Option<f64> {
        self.0.known(v)
    }
}

/// The node with other arguments; those that are not in `copy` must not occur.
fn rebuilt(graph: &mut Graph, node: &Node, copy: &HashMap<NodeId, NodeId>) -> NodeId {
    let at = |id: &NodeId| copy[id];
    match node {
        Node::Constant(bits) => graph.constant(f64::from_bits(*bits)),
        Node::X(i) => graph.x(*i as usize),
        Node::Param(i) => graph.param(*i as usize),
        Node::Unary(op, u) => graph.unary(*op, &at(u)),
        Node::Binary(op, u, v) => graph.binary(*op, &at(u), &at(v)),
        Node::PowI(u, n) => graph.powi(&at(u), *n),
        Node::Set(op, u, v) => graph.set(*op, &at(u), &at(v)),
        Node::Select(c, u, v) => graph.select(&at(c), &at(u), &at(v)),
        Node::Library(f, args) => {
            let args: Vec<NodeId> = args.iter().map(at).collect();
            graph.library(*f, &args)
        }
        Node::Native(f, args) => {
            let args: Vec<NodeId> = args.iter().map(at).collect();
            graph.native(*f, &args)
        }
    }
}

/// A node with a kink within a smooth function, such that where u = v derivatives are those of one
/// side, the same for max(u, v), min(u, v) and |u − v|: only then do they cancel there, too.
/// Derivatives of minima and maxima are those of the first of two equal ones.
fn one_sided(graph: &mut Graph, node: &Node, copy: &HashMap<NodeId, NodeId>) -> Option<NodeId> {
    let sorted = |u: &NodeId, v: &NodeId| (copy[u].min(copy[v]), copy[u].max(copy[v]));
    match node {
        Node::Set(SetOp::Max, u, v) => {
            let (u, v) = sorted(u, v);
            Some(graph.max(&u, &v))
        }
        Node::Set(SetOp::Min, u, v) => {
            let (u, v) = sorted(u, v);
            Some(graph.min(&v, &u))
        }
        Node::Unary(Unary::Abs, d) => {
            let Node::Binary(Binary::Sub, u, v) = *graph.node(copy[d]) else {
                return None;
            };
            let (u, v) = (u.min(v), u.max(v));
            let (more, less) = (graph.sub(&u, &v), graph.sub(&v, &u));
            Some(graph.max(&more, &less))
        }
        _ => None,
    }
}

/// −u, with the sign moved inside where that costs nothing.
fn negative(graph: &mut Graph, id: NodeId) -> NodeId {
    match *graph.node(id) {
        Node::Binary(Binary::Sub, u, v) => graph.sub(&v, &u),
        _ => graph.neg(&id),
    }
}

/// The axis that an expression ±x + c runs along, c without coordinates, and whether it rises.
fn along_axis(graph: &Graph, mut id: NodeId) -> Option<(usize, bool)> {
    let mut rises = true;
    loop {
        let constant = |id: &NodeId| !graph.is_in_space(*id);
        id = match graph.node(id) {
            Node::X(i) if *i < 3 => return Some((*i as usize, rises)),
            Node::Unary(Unary::Neg, u) => {
                rises = !rises;
                *u
            }
            Node::Binary(Binary::Add, u, v) if constant(u) => *v,
            Node::Binary(Binary::Add | Binary::Sub, u, v) if constant(v) => *u,
            Node::Binary(Binary::Sub, u, v) if constant(u) => {
                rises = !rises;
                *v
            }
            _ => return None,
        };
    }
}

fn axis_side(axis: usize, is_lower: bool) -> String {
    format!(
        "{}_{}",
        ["x", "y", "z"][axis],
        if is_lower { "min" } else { "max" }
    )
}

/// Which side of what it is named after a piece is; may be empty.
fn side_of(graph: &Graph, leaf: &Leaf) -> Rc<str> {
    match along_axis(graph, leaf.value) {
        // Inside is where the function is positive: where it rises the face is the lower one.
        Some((axis, rises)) if leaf.side.is_empty() => axis_side(axis, rises).into(),
        _ => leaf.side.clone(),
    }
}

/// The name of a piece, empty where nothing is known.
fn named(graph: &Graph, leaf: &Leaf) -> String {
    if leaf.is_own {
        return leaf.name.to_string();
    }
    match (&*leaf.name, &*side_of(graph, leaf)) {
        ("", "") => argument_name(graph, leaf.value)
            .unwrap_or_default()
            .to_owned(),
        ("", side) => side.to_owned(),
        (name, side @ ("" | "+" | "-")) => format!("{name}{side}"),
        (name, side) => format!("{name}.{side}"),
    }
}

/// The tree without constants; where nothing else is left, whether that is inside.
fn without_constants(graph: &Graph, tree: &Tree) -> Result<Tree, bool> {
    let join = match tree {
        Tree::Leaf(leaf) => {
            return graph
                .constant_value(leaf.value)
                .map_or_else(|| Ok(tree.clone()), |c| Err(c >= 0.0));
        }
        Tree::Join(join) => join,
    };
    let mut children = Vec::with_capacity(join.children.len());
    for child in &join.children {
        match without_constants(graph, child) {
            Ok(child) => children.push(child),
            // Inside everywhere decides a union, and is nothing to an intersection.
            Err(inside) if inside != join.is_min => return Err(inside),
            Err(_) => {}
        }
    }
    if children.is_empty() {
        Err(join.is_min)
    } else {
        Ok(Tree::join(join.is_min, children))
    }
}

/// The name of u in u + c and −u: of a level set; and of a choice.
fn argument_name(graph: &Graph, mut id: NodeId) -> Option<&str> {
    loop {
        if let Some(name) = graph.name(id) {
            return Some(name);
        }
        let constant = |id: &NodeId| !graph.is_in_space(*id);
        id = match graph.node(id) {
            Node::Unary(Unary::Neg, u) => *u,
            Node::Binary(Binary::Add | Binary::Sub | Binary::Mul, c, u) if constant(c) => *u,
            Node::Binary(Binary::Add | Binary::Sub | Binary::Mul | Binary::Div, u, c)
                if constant(c) =>
            {
                *u
            }
            // The two values that an if-statement gives to a variable.
            Node::Select(_, u, v) => {
                return graph.name(*u).filter(|name| graph.name(*v) == Some(name));
            }
            _ => return None,
        };
    }
}

/// The pieces and names of an expression whose parameters have no values: those that the solid has
/// for values that are positive and alike in nothing else.
pub(crate) struct Naming {
    graph: Graph,
    signs: HashMap<NodeId, Tree>,
    sides: HashMap<NodeId, Vec<Tree>>,
    names: HashMap<NodeId, Rc<str>>,
}

/// A node's surface by named pieces. The pieces are nodes of the naming's own graph.
pub(crate) enum Named {
    Piece { value: NodeId, name: Rc<str> },
    Join { is_min: bool, children: Vec<Self> },
}

impl Named {
    pub(crate) fn pieces(&self) -> Vec<NodeId> {
        match self {
            Self::Piece { value, .. } => vec![*value],
            Self::Join { children, .. } => children.iter().flat_map(Self::pieces).collect(),
        }
    }
}

impl Named {
    /// The value of the whole where the pieces have these values, in order.
    pub(crate) fn value(&self, pieces: &mut impl Iterator<Item = f64>) -> f64 {
        match self {
            Self::Piece { .. } => pieces.next().expect("one for each piece"),
            Self::Join { is_min, children } => {
                let join = if *is_min { f64::min } else { f64::max };
                let values: Vec<f64> = children.iter().map(|child| child.value(pieces)).collect();
                values
                    .into_iter()
                    .reduce(join)
                    .expect("a join has children")
            }
        }
    }
}

impl Naming {
    /// None where the expression has too many pieces, or is nested too deeply.
    pub(crate) fn new(graph: &Graph, root: NodeId) -> Option<Self> {
        let mut graph = graph.clone();
        let mut reader = Reader::new(&mut graph, root);
        let tree = reader.whole()?;
        let (signs, sides) = (
            std::mem::take(&mut reader.signs),
            std::mem::take(&mut reader.sides),
        );
        let tree = without_constants(&graph, &tree).unwrap_or(tree);
        let mut numbering = Numbering::new(&graph);
        numbering.tree(&tree);
        let names = numbering.pieces.into_iter().zip(numbering.names);
        Some(Self {
            names: names.map(|(value, name)| (value, name.into())).collect(),
            graph,
            signs,
            sides,
        })
    }

    pub(crate) fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The pieces of a node that is read by sign, of −u where `negative`; none where it is none, or
    /// is inside or outside everywhere.
    pub(crate) fn of(&mut self, id: NodeId, negative: bool) -> Option<Named> {
        let tree = self.signs.get(&id)?.clone();
        self.named(&tree, negative)
    }

    /// The pieces of each side of a primitive.
    pub(crate) fn of_side(&mut self, id: NodeId, side: usize, negative: bool) -> Option<Named> {
        let tree = self.sides.get(&id)?.get(side)?.clone();
        self.named(&tree, negative)
    }

    fn named(&mut self, tree: &Tree, is_negative: bool) -> Option<Named> {
        let tree = without_constants(&self.graph, tree).ok()?;
        self.named_as(&tree, is_negative)
    }

    fn named_as(&mut self, tree: &Tree, is_negative: bool) -> Option<Named> {
        Some(match tree {
            Tree::Leaf(leaf) => {
                let value = if is_negative {
                    negative(&mut self.graph, leaf.value)
                } else {
                    leaf.value
                };
                Named::Piece {
                    value,
                    name: self.names.get(&value)?.clone(),
                }
            }
            Tree::Join(join) => Named::Join {
                is_min: join.is_min != is_negative,
                children: join
                    .children
                    .iter()
                    .map(|child| self.named_as(child, is_negative))
                    .collect::<Option<_>>()?,
            },
        })
    }
}

/// Gives the pieces their numbers, in the order of the tree, and different names.
struct Numbering<'a> {
    graph: &'a Graph,
    names: Vec<String>,
    taken: HashSet<String>,
    pieces: Vec<NodeId>,
    known: HashMap<NodeId, u32>,
}

impl<'a> Numbering<'a> {
    fn new(graph: &'a Graph) -> Self {
        Self {
            graph,
            names: Vec::new(),
            taken: HashSet::new(),
            pieces: Vec::new(),
            known: HashMap::new(),
        }
    }

    fn tree(&mut self, tree: &Tree) -> Csg {
        let join = match tree {
            Tree::Leaf(leaf) => return Csg::Piece(self.piece(leaf)),
            Tree::Join(join) => join,
        };
        let mut known = HashSet::new();
        let mut children: Vec<Csg> = join.children.iter().map(|child| self.tree(child)).collect();
        children.retain(|child| {
            if let Csg::Piece(piece) = child {
                known.insert(*piece)
            } else {
                true
            }
        });
        match children.len() {
            1 => children.remove(0),
            _ if join.is_min => Csg::Min(children),
            _ => Csg::Max(children),
        }
    }

    fn piece(&mut self, leaf: &Leaf) -> u32 {
        if let Some(&known) = self.known.get(&leaf.value) {
            return known;
        }
        let number = self.pieces.len() as u32;
        let mut base = named(self.graph, leaf);
        if base.is_empty() {
            base = format!("piece{}", number + 1);
        }
        let mut name = base.clone();
        for count in 2.. {
            if self.taken.insert(name.clone()) {
                break;
            }
            name = format!("{base}#{count}");
        }
        self.known.insert(leaf.value, number);
        self.pieces.push(leaf.value);
        self.names.push(name);
        number
    }
}
