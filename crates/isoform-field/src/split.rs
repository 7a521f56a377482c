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
use crate::library::Library;
use crate::ops::Ops;
use isoform_geom::Csg;
use isoform_num::Interval;
use std::collections::HashMap;
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
