//! Properties of single nodes: kinks, axes, negation.

use crate::graph::{Graph, Node, NodeId};
use crate::ops::{Binary, Ops, SetOp, Unary};

/// Minimum or maximum that is equivalent to a node.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum BinaryJoin {
    Min(NodeId, NodeId),
    Max(NodeId, NodeId),
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
pub(super) fn has_kink(node: &Node) -> bool {
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
