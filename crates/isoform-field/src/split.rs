//! Splitting an expression of space into smooth pieces, joined by minima and maxima.
//!
//! An L, of two slabs, has six pieces:
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
//! - *piece*: a function whose zero set is part of the surface, smooth near it, positive on the side
//!   where it cuts nothing away.
//! - *side*: one of the pieces of a primitive, or of |u|: u and −u.
//! - *kink*: a place where a function is not differentiable, made by minima, maxima, |u| and
//!   selections.
//! - *blend*: a function that is smooth although its formula has kinks.
//! - *product*: a blend of one piece of each of its arguments.
//! - *context*: the name of the variable that a node is part of.
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

/// Largest number of products of a blend. A blend of two shapes has one for each pair of their
/// pieces; a blend with more products stays one piece.
const MOST_PRODUCTS: usize = 4096;
/// Largest number of pieces of a solid, each counted wherever it stands in the tree. Solids with more
/// are refused.
const MOST_PIECES: usize = 1 << 20;
/// Deepest nesting of minima in maxima in minima. The readings recurse once per level, and 2 MiB of
/// stack must suffice; deeper expressions are refused.
const DEEPEST: usize = 400;
/// Largest number of arguments of a blend. The search for blends skips functions of more shapes.
pub(crate) const MOST_INPUTS: usize = 5;
/// Largest number of nodes that are compared to find the arguments of a blend. With more the search
/// gives up, since each pair is compared.
const MOST_FOUND: usize = 24;
/// Number of failures after which no more blends are sought. Each search looks at all nodes below
/// one node.
const MOST_FAILURES: usize = 2000;

/// Range of a parameter without a value: sizes are positive, and faces get the names that they have
/// for such values. The ends are far from what overflows in products of a few parameters.
const POSITIVE: [f64; 2] = [1e-9, 1e9];

/// The value of parameter i for the search for kinks, where it has none. Values are positive, and
/// differ from each other, so that terms do not cancel by chance.
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
}
