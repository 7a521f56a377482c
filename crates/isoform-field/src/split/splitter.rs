//! State and elementary operations of splitting an expression.

use super::monotone::MonotoneFunction;
use super::name::{NameContext, side_of};
use super::nodes::{BinaryJoin, has_kink, negative};
use super::tree::{PieceLeaf, PieceTree};
use crate::graph::{Graph, Node, NodeId};
use crate::ops::{Binary, SetOp, Unary};
use isoform_num::{Interval, Real};
use std::collections::{HashMap, HashSet};

/// Maximum number of leaves of a solid's tree, over which a piece may be counted several times.
/// Larger solids are rejected.
pub(super) const MAX_LEAVES: usize = 1 << 20;
/// Maximum nesting depth of alternating minima and maxima. Splitting recurses once per level,
/// within 2 MiB of stack; deeper expressions are rejected.
pub(super) const MAX_SPLIT_DEPTH: usize = 400;
/// Maximum number of failed searches for blends, each of which visits all nodes below one node.
pub(super) const MAX_FAILED_SEARCHES: usize = 2000;

/// Range of a parameter without a value: sizes are positive, and faces are named as for positive
/// values. Products of a few parameters from this range do not overflow.
pub(super) const PARAMETER_RANGE: [f64; 2] = [1e-9, 1e9];

/// Returns a substitute for the value of parameter i in the search for kinks. Substitutes are
/// positive and distinct, so that terms do not cancel by chance.
pub(super) fn parameter_substitute(i: u32) -> f64 {
    0.5 + (0.618_033_988_749_895 * f64::from(i + 1)).fract()
}

/// State of splitting an expression.
pub(super) struct Splitter<'a> {
    pub(super) graph: &'a mut Graph,
    pub(super) root: NodeId,
    /// True for nodes whose value may have kinks.
    kinked: Vec<bool>,
    /// Bounds of the nodes over all space.
    ranges: Vec<Interval>,
    pub(super) values: HashMap<NodeId, PieceTree>,
    pub(super) signs: HashMap<NodeId, PieceTree>,
    pub(super) monotone: HashMap<NodeId, MonotoneFunction>,
    /// Trees of the sides of primitives.
    pub(super) sides: HashMap<NodeId, Vec<PieceTree>>,
    /// Number of parameters without a value.
    pub(super) params: usize,
    pub(super) depth: usize,
    pub(super) failures: usize,
    pub(super) too_large: bool,
}

impl<'a> Splitter<'a> {
    pub(super) fn new(graph: &'a mut Graph, root: NodeId) -> Self {
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

    /// Returns the context of a node. A variable that contains the node takes precedence over a
    /// suggested name.
    pub(super) fn context(&self, id: NodeId, above: &NameContext) -> NameContext {
        let is_better = !above.name.is_empty() && self.graph.has_suggested_name(id);
        match self.graph.name(id) {
            Some(name) if !is_better => NameContext {
                name: name.into(),
                is_own: true,
            },
            _ => above.clone(),
        }
    }

    /// Returns the context of one part of several, without the name of the whole solid.
    pub(super) fn below(&self, context: &NameContext) -> NameContext {
        let is_root = self.graph.name(self.root) == Some(&*context.name);
        NameContext {
            name: if is_root {
                "".into()
            } else {
                context.name.clone()
            },
            is_own: false,
        }
    }

    pub(super) fn leaf(&self, id: NodeId, context: &NameContext) -> PieceTree {
        PieceTree::Leaf(PieceLeaf {
            value: id,
            name: context.name.clone(),
            is_own: context.is_own,
            side: "".into(),
        })
    }

    /// Negates a tree. Sides keep their names: after subtraction of a slab, its upper face is a
    /// lower face of the remainder.
    pub(super) fn negated(&mut self, tree: &PieceTree) -> PieceTree {
        tree.map(true, &mut |leaf| {
            let side = side_of(self.graph, leaf);
            PieceLeaf {
                value: negative(self.graph, leaf.value),
                side,
                ..leaf.clone()
            }
        })
    }

    /// Returns the operands of a chain of minima, or of maxima, each with its context.
    pub(super) fn operands(
        &mut self,
        id: NodeId,
        context: &NameContext,
        mut join: impl FnMut(&mut Self, NodeId) -> Option<BinaryJoin>,
        is_min: bool,
    ) -> Vec<(NodeId, NameContext)> {
        let mut pending = vec![(id, context.clone())];
        let (mut found, mut known) = (Vec::new(), HashSet::new());
        while let Some((node, context)) = pending.pop() {
            match join(self, node) {
                Some(BinaryJoin::Min(u, v)) if is_min => self.open(&mut pending, &context, u, v),
                Some(BinaryJoin::Max(u, v)) if !is_min => self.open(&mut pending, &context, u, v),
                // min(u, u) is u: repeated operands are redundant.
                _ => {
                    if known.insert(node) {
                        found.push((node, context));
                    }
                }
            }
        }
        found
    }

    fn open(
        &self,
        pending: &mut Vec<(NodeId, NameContext)>,
        context: &NameContext,
        u: NodeId,
        v: NodeId,
    ) {
        let below = self.below(context);
        pending.push((v, self.context(v, &below)));
        pending.push((u, self.context(u, &below)));
    }

    /// Returns the minimum or maximum with the value of the node: an operation, or a selection of
    /// the smaller or larger of two values.
    pub(super) fn value_join(&self, id: NodeId) -> Option<BinaryJoin> {
        match *self.graph.node(id) {
            Node::Set(SetOp::Max, u, v) => Some(BinaryJoin::Max(u, v)),
            Node::Set(SetOp::Min, u, v) => Some(BinaryJoin::Min(u, v)),
            Node::Select(condition, u, v) => match *self.graph.node(condition) {
                Node::Binary(Binary::Less | Binary::LessEq, a, b) if (a, b) == (u, v) => {
                    Some(BinaryJoin::Min(u, v))
                }
                Node::Binary(Binary::Less | Binary::LessEq, a, b) if (a, b) == (v, u) => {
                    Some(BinaryJoin::Max(u, v))
                }
                _ => None,
            },
            _ => None,
        }
    }

    /// Returns u if the node is |u|: an operation, or u < 0 ? −u : u.
    pub(super) fn absolute(&self, id: NodeId) -> Option<NodeId> {
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

    pub(super) fn is_kinked(&mut self, id: NodeId) -> bool {
        for i in self.kinked.len()..=id.at() {
            let own = has_kink(self.graph.node(NodeId(i as u32)));
            let arguments = self.graph.arguments(NodeId(i as u32));
            let below = || arguments.iter().any(|a| self.kinked[a.at()]);
            // Functions of parameters alone do not have kinks in space.
            self.kinked
                .push(self.graph.is_in_space(NodeId(i as u32)) && (own || below()));
        }
        self.kinked[id.at()]
    }

    /// Returns true if the node is positive everywhere, false if it is negative everywhere, else
    /// `None`.
    pub(super) fn strict_sign(&mut self, id: NodeId) -> Option<bool> {
        let range = self.ranges_of(id);
        if range.lo() > 0.0 {
            Some(true)
        } else if range.hi() < 0.0 {
            Some(false)
        } else {
            None
        }
    }

    pub(super) fn ranges_of(&mut self, id: NodeId) -> Interval {
        for i in self.ranges.len()..=id.at() {
            let of = |id: &NodeId| &self.ranges[id.at()];
            let range = match self.graph.node(NodeId(i as u32)) {
                Node::Constant(bits) => Interval::constant(f64::from_bits(*bits)),
                Node::Unary(op, u) => op.apply(of(u)),
                Node::Binary(op, u, v) => op.apply(of(u), of(v)),
                Node::Set(op, u, v) => op.apply(of(u), of(v)),
                Node::PowI(u, n) => of(u).powi(*n),
                Node::Select(c, u, v) => of(c).select(of(u), of(v)),
                Node::Param(_) => Interval::new(PARAMETER_RANGE[0], PARAMETER_RANGE[1]),
                Node::X(_) | Node::Library(..) | Node::Native(..) => Interval::ALL,
            };
            self.ranges.push(range);
        }
        self.ranges[id.at()]
    }
}
