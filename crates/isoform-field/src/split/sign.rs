//! Splitting by sign: the tree has the sign of the expression.
//!
//! R-functions are minima and maxima here, factors of constant sign are dropped, and primitives are
//! the intersections of their sides. Other expressions are split by value.

use super::name::NameContext;
use super::nodes::BinaryJoin;
use super::splitter::{MAX_LEAVES, MAX_SPLIT_DEPTH, Splitter};
use super::tree::{PieceLeaf, PieceTree};
use crate::graph::{Graph, Node, NodeId};
use crate::library::{Family, Library, Native};
use crate::ops::{Binary, Ops, SetOp, Unary};

/// Returns true for odd increasing functions, which have the sign of their argument.
fn is_odd_and_rising(op: Unary) -> bool {
    matches!(op, Unary::Sinh | Unary::Tanh | Unary::Atan)
}

impl Splitter<'_> {
    /// Splits the whole expression by sign; `None` if it is too large.
    pub(super) fn whole(&mut self) -> Option<PieceTree> {
        let tree = self.sign(self.root, &NameContext::default());
        (!self.too_large && tree.leaves() <= MAX_LEAVES).then_some(tree)
    }

    pub(super) fn sign(&mut self, id: NodeId, above: &NameContext) -> PieceTree {
        if let Some(tree) = self.signs.get(&id) {
            return tree.clone();
        }
        let context = self.context(id, above);
        self.depth += 1;
        let tree = if self.depth > MAX_SPLIT_DEPTH {
            self.too_large = true;
            self.leaf(id, &context)
        } else {
            self.sign_of(id, &context)
        };
        self.depth -= 1;
        if tree.leaves() > MAX_LEAVES {
            self.too_large = true;
        }
        if self.too_large {
            return self.leaf(id, &context);
        }
        self.signs.insert(id, tree.clone());
        tree
    }

    fn sign_of(&mut self, id: NodeId, context: &NameContext) -> PieceTree {
        if let Some(join) = self.sign_join(id) {
            let is_min = matches!(join, BinaryJoin::Min(..));
            let operands =
                self.operands(id, context, |splitter, id| splitter.sign_join(id), is_min);
            let parts: Vec<PieceTree> = operands
                .into_iter()
                .map(|(id, context)| self.sign(id, &context))
                .collect();
            return PieceTree::join(is_min, parts);
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

    fn signed(&mut self, u: NodeId, positive: bool, context: &NameContext) -> PieceTree {
        let tree = self.sign(u, context);
        if positive { tree } else { self.negated(&tree) }
    }

    /// Returns the minimum or maximum with the sign of the node.
    fn sign_join(&mut self, id: NodeId) -> Option<BinaryJoin> {
        match self.graph.node(id) {
            Node::Set(SetOp::RUnion, u, v) => Some(BinaryJoin::Max(*u, *v)),
            Node::Set(SetOp::RIntersection, u, v) => Some(BinaryJoin::Min(*u, *v)),
            Node::Library(f, args) => {
                let (u, v) = (args[0], args[1]);
                // A blend of width 0 is a plain minimum or maximum.
                let is_zero = |at: usize| {
                    args.get(at)
                        .and_then(|&c| self.graph.constant_value(c))
                        .is_some_and(|c| c <= 0.0)
                };
                match f.family() {
                    Family::Circular { .. } if !is_zero(2) => None,
                    Family::Circular { is_union: true } | Family::Sardf { is_union: true } => {
                        Some(BinaryJoin::Max(u, v))
                    }
                    Family::Circular { is_union: false } | Family::Sardf { is_union: false } => {
                        Some(BinaryJoin::Min(u, v))
                    }
                    Family::Displaced | Family::Primitive => None,
                }
            }
            _ => self.value_join(id),
        }
    }

    /// Splits a primitive into its sides, whose intersection it is.
    fn primitive(
        &mut self,
        id: NodeId,
        f: Library,
        args: &[NodeId],
        context: &NameContext,
    ) -> PieceTree {
        let sides = match f {
            // The distance is computed by iteration; the quadric has an identical zero set.
            Library::DistanceEllipsoid => vec![("", self.graph.library(Library::Ellipsoid, args))],
            _ => f.metric(&mut PositiveSizes(self.graph), args),
        };
        if sides.is_empty() {
            return self.by_value(id, context);
        }
        let is_whole = sides.len() == 1;
        let parts: Vec<PieceTree> = sides
            .into_iter()
            .map(|(side, value)| {
                let context = match &*context.name {
                    _ if is_whole => context.clone(),
                    "" => NameContext {
                        name: side.into(),
                        is_own: true,
                    },
                    name => NameContext {
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
        PieceTree::join(true, parts)
    }

    fn by_value(&mut self, id: NodeId, context: &NameContext) -> PieceTree {
        let tree = self.value(id, context);
        if let PieceTree::Leaf(_) = tree {
            return tree;
        }
        // Positive factors left in the pieces do not affect the surface.
        tree.map(false, &mut |leaf| PieceLeaf {
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
}

/// Builder of a graph that assumes sizes to be positive: |a| is a, and a − a is 0. Sides that
/// coincide for positive sizes are then one node.
struct PositiveSizes<'a>(&'a mut Graph);

impl PositiveSizes<'_> {
    /// Returns true for parameters, positive constants, and their sums, products and quotients.
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

impl Ops for PositiveSizes<'_> {
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
    fn native(&mut self, f: Native, args: &[NodeId]) -> NodeId {
        self.0.native(f, args)
    }
    fn known(&self, v: &NodeId) -> Option<f64> {
        self.0.known(v)
    }
}
