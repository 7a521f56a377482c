//! Properties of single nodes: equivalence to a minimum or maximum, kinks, signs.

use super::name::Context;
use super::{POSITIVE, Reader};
use crate::graph::{Graph, Node, NodeId};
use crate::ops::{Binary, Ops, SetOp, Unary};
use isoform_num::{Interval, Real};
use std::collections::HashSet;

/// Minimum or maximum that is equivalent to a node.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Join2 {
    Min(NodeId, NodeId),
    Max(NodeId, NodeId),
}

impl Reader<'_> {
    /// Returns the operands of a chain of minima, or of maxima, each with its context.
    pub(super) fn operands(
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

    fn open(&self, pending: &mut Vec<(NodeId, Context)>, context: &Context, u: NodeId, v: NodeId) {
        let below = self.below(context);
        pending.push((v, self.context(v, &below)));
        pending.push((u, self.context(u, &below)));
    }

    /// Returns the minimum or maximum with the value of the node: an operation, or a selection of
    /// the smaller or larger of two values.
    pub(super) fn value_join(&self, id: NodeId) -> Option<Join2> {
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
                Node::Param(_) => Interval::new(POSITIVE[0], POSITIVE[1]),
                Node::X(_) | Node::Library(..) | Node::Native(..) => Interval::ALL,
            };
            self.ranges.push(range);
        }
        self.ranges[id.at()]
    }
}

/// Returns −u, as v − w for a difference w − v.
pub(super) fn negative(graph: &mut Graph, id: NodeId) -> NodeId {
    match *graph.node(id) {
        Node::Binary(Binary::Sub, u, v) => graph.sub(&v, &u),
        _ => graph.neg(&id),
    }
}

/// Returns the axis of an expression ±x + c, c without coordinates, and true for +x.
pub(super) fn along_axis(graph: &Graph, mut id: NodeId) -> Option<(usize, bool)> {
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

/// Returns true if the operation of a node has kinks in its arguments.
fn has_kink(node: &Node) -> bool {
    match node {
        Node::Set(op, ..) => match op {
            SetOp::Min | SetOp::Max => true,
            SetOp::RUnion | SetOp::RIntersection => false,
        },
        Node::Unary(op, _) => op.has_kink(),
        Node::Binary(op, ..) => op.has_kink(),
        Node::Select(..) => true,
        Node::Library(f, _) => f.has_kink(),
        // The root of the SARDF operations occurs in their own nodes only, and fmod has jumps
        // rather than kinks.
        Node::Constant(_) | Node::X(_) | Node::Param(_) | Node::PowI(..) | Node::Native(..) => {
            false
        }
    }
}
