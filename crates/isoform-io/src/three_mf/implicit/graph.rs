//! Scalar expressions in x, y and z as hash-consed graphs: the common form of functions that are
//! read from 3MF and written to it.

use std::collections::HashMap;

/// Maximum number of nodes of a graph, some 100 MB. Functions that people make have some thousand;
/// calls nested in calls can double it with every level.
const MAX_NODES: usize = 1_000_000;

/// Number of a node of a [`ScalarGraph`]. Arguments have smaller numbers than their users.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ScalarId(u32);

impl ScalarId {
    /// Returns the place of the node in the order of creation.
    pub(super) fn at(self) -> usize {
        self.0 as usize
    }
}

/// Functions of one argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "each is the function of its name")]
pub enum ScalarFunction {
    Abs,
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Floor,
    Ceil,
    Trunc,
    Sign,
}

/// Functions of two arguments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ScalarOperation {
    /// a + b
    Add,
    /// a − b
    Sub,
    /// a · b
    Mul,
    /// a / b
    Div,
    /// a^b
    Pow,
    /// Angle of the point (x = b, y = a)
    Atan2,
    /// Smaller one of a and b
    Min,
    /// Larger one of a and b
    Max,
}

/// Operation of a node with its arguments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ScalarNode {
    /// A constant, represented by its bits.
    Constant(u64),
    /// Coordinate i of space, from 0 to 2.
    Coordinate(usize),
    /// A function of one argument.
    Unary(ScalarFunction, ScalarId),
    /// A function of two arguments.
    Binary(ScalarOperation, ScalarId, ScalarId),
    /// The third argument where the first is less than the second, else the fourth.
    Choice([ScalarId; 4]),
}

impl ScalarNode {
    /// Calls a function with each argument.
    pub(super) fn for_arguments(&self, mut visit: impl FnMut(ScalarId)) {
        match *self {
            Self::Constant(_) | Self::Coordinate(_) => {}
            Self::Unary(_, u) => visit(u),
            Self::Binary(_, u, v) => {
                visit(u);
                visit(v);
            }
            Self::Choice(all) => all.into_iter().for_each(visit),
        }
    }
}

impl ScalarFunction {
    /// Evaluates the function.
    pub(super) fn apply(self, u: f64) -> f64 {
        match self {
            Self::Abs => u.abs(),
            Self::Sqrt => u.sqrt(),
            Self::Exp => u.exp(),
            Self::Ln => u.ln(),
            Self::Sin => u.sin(),
            Self::Cos => u.cos(),
            Self::Tan => u.tan(),
            Self::Asin => u.asin(),
            Self::Acos => u.acos(),
            Self::Atan => u.atan(),
            Self::Sinh => u.sinh(),
            Self::Cosh => u.cosh(),
            Self::Tanh => u.tanh(),
            Self::Floor => u.floor(),
            Self::Ceil => u.ceil(),
            Self::Trunc => u.trunc(),
            Self::Sign if u > 0.0 => 1.0,
            Self::Sign if u < 0.0 => -1.0,
            Self::Sign => 0.0,
        }
    }
}

impl ScalarOperation {
    /// Evaluates the function.
    pub(super) fn apply(self, u: f64, v: f64) -> f64 {
        match self {
            Self::Add => u + v,
            Self::Sub => u - v,
            Self::Mul => u * v,
            Self::Div => u / v,
            Self::Pow => u.powf(v),
            Self::Atan2 => u.atan2(v),
            Self::Min if v < u => v,
            Self::Max if v > u => v,
            Self::Min | Self::Max => u,
        }
    }
}

/// An expression in x, y and z, with equal subexpressions stored once.
///
/// ```
/// use isoform_io::{ScalarGraph, ScalarOperation};
/// let mut graph = ScalarGraph::new();
/// let (x, one) = (graph.coordinate(0), graph.constant(1.0));
/// let f = graph.binary(ScalarOperation::Sub, x, one);
/// assert_eq!(graph.eval(f, [3.0, 0.0, 0.0]), 2.0);
/// ```
#[derive(Clone, Debug, Default)]
pub struct ScalarGraph {
    nodes: Vec<ScalarNode>,
    known: HashMap<ScalarNode, ScalarId>,
    /// True for the nodes whose values are finite numbers at all points.
    are_total: Vec<bool>,
    /// True if nodes were left out because there were too many.
    is_full: bool,
}

impl ScalarGraph {
    /// Creates an empty graph.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns true if there were more nodes than are kept; what is built then is meaningless.
    pub fn is_full(&self) -> bool {
        self.is_full
    }

    /// Returns the number of nodes.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Returns the operation of a node.
    pub(super) fn node(&self, id: ScalarId) -> &ScalarNode {
        &self.nodes[id.at()]
    }

    /// Returns the nodes in the order of creation.
    pub(super) fn ids(&self) -> impl DoubleEndedIterator<Item = ScalarId> + use<> {
        (0..self.nodes.len() as u32).map(ScalarId)
    }

    /// Returns an equal node, which is created if necessary.
    fn insert(&mut self, node: ScalarNode) -> ScalarId {
        if let Some(&id) = self.known.get(&node) {
            return id;
        }
        if self.nodes.len() >= MAX_NODES {
            self.is_full = true;
            return ScalarId(0);
        }
        let id = ScalarId(self.nodes.len() as u32);
        let is_total = self.is_total(&node);
        self.are_total.push(is_total);
        self.nodes.push(node);
        self.known.insert(node, id);
        id
    }

    /// Returns true if a node is a finite number wherever its arguments are, which are.
    fn is_total(&self, node: &ScalarNode) -> bool {
        use {ScalarFunction as F, ScalarOperation as O};
        let is_safe = match *node {
            ScalarNode::Constant(bits) => f64::from_bits(bits).is_finite(),
            ScalarNode::Unary(f, _) => !matches!(
                f,
                F::Sqrt | F::Exp | F::Ln | F::Tan | F::Asin | F::Acos | F::Sinh | F::Cosh
            ),
            ScalarNode::Binary(f, ..) => !matches!(f, O::Div | O::Pow),
            ScalarNode::Coordinate(_) | ScalarNode::Choice(_) => true,
        };
        let mut are_total = true;
        node.for_arguments(|u| are_total &= self.are_total[u.at()]);
        is_safe && are_total
    }

    /// Returns the value of a constant; `None` for other nodes.
    pub fn value(&self, id: ScalarId) -> Option<f64> {
        match *self.node(id) {
            ScalarNode::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// Returns the sides of a comparison whose result is 0 or 1, and true if it is 1 where the
    /// first is less; `None` for other nodes.
    pub fn comparison(&self, id: ScalarId) -> Option<([ScalarId; 2], bool)> {
        let ScalarNode::Choice([u, v, then, otherwise]) = *self.node(id) else {
            return None;
        };
        match (self.value(then)?, self.value(otherwise)?) {
            (1.0, 0.0) => Some(([u, v], true)),
            (0.0, 1.0) => Some(([u, v], false)),
            _ => None,
        }
    }

    /// Returns a constant.
    pub fn constant(&mut self, c: f64) -> ScalarId {
        // Both zeros are one constant.
        self.insert(ScalarNode::Constant((c + 0.0).to_bits()))
    }

    /// Returns coordinate `i`, from 0 to 2.
    pub fn coordinate(&mut self, i: usize) -> ScalarId {
        self.insert(ScalarNode::Coordinate(i))
    }

    /// Applies a function of one argument.
    pub fn unary(&mut self, function: ScalarFunction, u: ScalarId) -> ScalarId {
        match self.value(u) {
            Some(c) => self.constant(function.apply(c)),
            None => self.insert(ScalarNode::Unary(function, u)),
        }
    }

    /// Applies a function of two arguments.
    pub fn binary(&mut self, operation: ScalarOperation, u: ScalarId, v: ScalarId) -> ScalarId {
        use ScalarOperation as O;
        match (operation, self.value(u), self.value(v)) {
            (_, Some(a), Some(b)) => self.constant(operation.apply(a, b)),
            (O::Add, Some(0.0), _) | (O::Mul, Some(1.0), _) => v,
            (O::Add | O::Sub, _, Some(0.0)) | (O::Mul | O::Div | O::Pow, _, Some(1.0)) => u,
            (O::Mul, Some(0.0), _) if self.are_total[v.at()] => u,
            (O::Mul, _, Some(0.0)) if self.are_total[u.at()] => v,
            (O::Min | O::Max, ..) if u == v => u,
            _ => self.insert(ScalarNode::Binary(operation, u, v)),
        }
    }

    /// Returns `then` where u < v, else `otherwise`.
    pub fn choice(
        &mut self,
        [u, v]: [ScalarId; 2],
        then: ScalarId,
        otherwise: ScalarId,
    ) -> ScalarId {
        match (self.value(u), self.value(v)) {
            (Some(a), Some(b)) if a < b => then,
            (Some(_), Some(_)) => otherwise,
            _ if then == otherwise => then,
            _ => self.insert(ScalarNode::Choice([u, v, then, otherwise])),
        }
    }

    /// Returns the sum of products of two lists, from the first to the last.
    pub(super) fn dot(&mut self, u: &[ScalarId], v: &[ScalarId]) -> ScalarId {
        let mut sum = self.constant(0.0);
        for (a, b) in u.iter().zip(v) {
            let product = self.binary(ScalarOperation::Mul, *a, *b);
            sum = self.binary(ScalarOperation::Add, sum, product);
        }
        sum
    }

    /// Returns −u.
    pub(super) fn negative(&mut self, u: ScalarId) -> ScalarId {
        let zero = self.constant(0.0);
        match *self.node(u) {
            ScalarNode::Binary(ScalarOperation::Sub, z, v) if z == zero => v,
            ScalarNode::Binary(ScalarOperation::Sub, a, b) => {
                self.binary(ScalarOperation::Sub, b, a)
            }
            _ => self.binary(ScalarOperation::Sub, zero, u),
        }
    }

    /// Returns, by node, true for the nodes on which `root` depends, itself included.
    pub(super) fn reachable(&self, root: ScalarId) -> Vec<bool> {
        let mut needed = vec![false; self.nodes.len()];
        needed[root.at()] = true;
        for id in self.ids().rev() {
            if needed[id.at()] {
                self.node(id).for_arguments(|u| needed[u.at()] = true);
            }
        }
        needed
    }

    /// Evaluates a node at a point.
    pub fn eval(&self, root: ScalarId, x: [f64; 3]) -> f64 {
        let mut values: Vec<f64> = Vec::with_capacity(root.at() + 1);
        for node in &self.nodes[..=root.at()] {
            let of = |id: ScalarId| values[id.at()];
            let value = match *node {
                ScalarNode::Constant(bits) => f64::from_bits(bits),
                ScalarNode::Coordinate(i) => x[i],
                ScalarNode::Unary(f, u) => f.apply(of(u)),
                ScalarNode::Binary(f, u, v) => f.apply(of(u), of(v)),
                ScalarNode::Choice([u, v, then, _]) if of(u) < of(v) => of(then),
                ScalarNode::Choice([.., otherwise]) => of(otherwise),
            };
            values.push(value);
        }
        values[root.at()]
    }
}
