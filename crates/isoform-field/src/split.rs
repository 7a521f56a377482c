//! Splitting an expression of space into smooth pieces, joined by minima and maxima.
//!
//! An L-shaped profile of two slabs has six pieces:
//!
//! ```text
//!    y_max                     max
//!    +----+ x_max            /     \
//!    |    |  y_max         min     min
//!    |    +------+        / | \   / | \
//!    |           | x_max   sides   sides
//!    +-----------+
//! ```
//!
//! - *piece*: a function whose zero set contains part of the surface, smooth near it, and
//!   nonnegative where it does not exclude points.
//! - *side*: one of the pieces of a primitive, or of |u|: u and −u.
//! - *kink*: a place where a function is not differentiable, made by minima, maxima, |u| and
//!   selections.
//! - *blend*: a function that is smooth although its formula has kinks.
//! - *product*: a blend of one piece of each of its arguments.
//! - *context*: the name of the variable whose value contains a node.
//!
//! An expression is split in two ways. By *sign*: the tree has the sign of the expression only, so
//! that R-functions are maxima and minima, primitives are the intersections of their closed-form
//! sides, and positive factors are dropped. By *value*: the tree has the expression's value
//! everywhere, and functions of it are distributed over its pieces: an increasing function of a
//! minimum is the minimum of the function's values. This applies to |u| = max(u, −u), sums, factors
//! and divisors of constant sign, monotone functions of one argument, R-functions, and blends.
//!
//! A smooth maximum is usually written with further minima, maxima and |u|: max(u, v) + max(k − |u
//! − v|, 0)²/(4k). If the kinks of such a formula cancel ([`crate::smooth`]), it is treated as one
//! function of the expressions that it uses more than once (here u and v) and distributed over
//! their pieces: smooth(min(a, b), c) = min(smooth(a, c), smooth(b, c)).

mod blend;
mod name;
mod naming;
mod nodes;
mod sign;
mod tree;
mod value;

use self::name::{Context, Numbering};
pub(crate) use self::naming::{Named, Naming};
use self::tree::{Tree, without_constants};
use crate::graph::{Graph, Node, NodeId};
use crate::library::Family;
use crate::ops::Ops;
use isoform_geom::Csg;
use isoform_num::Interval;
use std::collections::HashMap;
use std::rc::Rc;

/// Maximum number of products of a blend, one for each combination of pieces of its arguments; a
/// blend with more products is not split.
const MOST_PRODUCTS: usize = 4096;
/// Maximum number of leaves of a solid's tree, over which a piece may be counted several times.
/// Larger solids are rejected.
const MOST_PIECES: usize = 1 << 20;
/// Maximum nesting depth of alternating minima and maxima. Splitting recurses once per level,
/// within 2 MiB of stack; deeper expressions are rejected.
const DEEPEST: usize = 400;
/// Maximum number of arguments of a blend; functions of more arguments are not tested for blends.
pub(crate) const MOST_INPUTS: usize = 5;
/// Maximum number of candidate nodes for the arguments of a blend. The search is aborted with more,
/// since it compares all pairs.
const MOST_FOUND: usize = 24;
/// Maximum number of failed searches for blends, each of which visits all nodes below one node.
const MOST_FAILURES: usize = 2000;

/// Range of a parameter without a value: sizes are positive, and faces are named as for positive
/// values. Products of a few parameters from this range do not overflow.
const POSITIVE: [f64; 2] = [1e-9, 1e9];

/// Returns a substitute for the value of parameter i in the search for kinks. Substitutes are
/// positive and distinct, so that terms do not cancel by chance.
fn stand_in(i: u32) -> f64 {
    0.5 + (0.618_033_988_749_895 * f64::from(i + 1)).fract()
}

/// Error of splitting an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SplitError {
    /// The sign is constant.
    Constant { inside: bool },
    /// The expression is nested too deeply or has too many pieces.
    TooLarge,
}

/// Result of splitting an expression into smooth pieces.
pub(crate) struct Split {
    pub(crate) names: Vec<String>,
    pub(crate) pieces: Vec<NodeId>,
    pub(crate) tree: Csg,
    /// Expressions known to be monotone functions of other expressions.
    pub(crate) monotone: HashMap<NodeId, Monotone>,
}

/// Representation of an expression as a monotone function of others.
#[derive(Clone, Debug)]
pub(crate) struct Monotone {
    pub(crate) function: Rc<Function>,
    pub(crate) inputs: Vec<NodeId>,
}

impl Monotone {
    /// Represents a circular blend as a monotone function of its two arguments; `None` for other
    /// nodes.
    pub(crate) fn of_blend(graph: &Graph, id: NodeId) -> Option<Self> {
        let Node::Library(f, args) = graph.node(id) else {
            return None;
        };
        if !matches!(f.family(), Family::Circular { .. }) {
            return None;
        }
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

/// Function of X(3), X(4), …, and for each of these true if the function is increasing in it.
#[derive(Debug)]
pub(crate) struct Function {
    pub(crate) graph: Graph,
    pub(crate) root: NodeId,
    pub(crate) rises: Vec<bool>,
}

/// Splits the expression `root`, of x alone; the pieces are added to the graph.
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

struct Reader<'a> {
    graph: &'a mut Graph,
    root: NodeId,
    /// True for nodes whose value may have kinks.
    kinked: Vec<bool>,
    /// Bounds of the nodes over all space.
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

    /// Splits the whole expression by sign; `None` if it is too large.
    fn whole(&mut self) -> Option<Tree> {
        let tree = self.sign(self.root, &Context::default());
        (!self.too_large && tree.leaves() <= MOST_PIECES).then_some(tree)
    }
}
