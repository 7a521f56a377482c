//! Machines that run a program: immediate evaluation ([`Direct`]) or construction of its expression
//! ([`Symbolic`]).

use super::MAX_EXPRESSION_NODES;
use crate::direct::Direct;
use crate::graph::{Graph, Node, NodeId};
use crate::jumps::jumps;
use crate::library::{Library, Native};
use crate::ops::{Binary, Ops, SetOp, Unary};
use isoform_num::Real;
use std::collections::{BTreeMap, HashSet};

/// HyperFun's tolerance: truth is |v| ≥ TRUTH_TOLERANCE, equality |u − v| < TRUTH_TOLERANCE.
pub(crate) const TRUTH_TOLERANCE: f64 = 1e-6;

/// Operations that the executor needs in addition to formulas.
pub(crate) trait Machine: Ops + 'static {
    /// True if values are available, so that run-time errors are detected.
    const CHECKED: bool;

    /// Marks `v` as a truth value, 0 or 1.
    fn boolean(&mut self, v: Self::V) -> Self::V {
        v
    }
    /// Returns true if `v` is marked as a truth value.
    fn is_boolean(&self, _v: &Self::V) -> bool {
        false
    }
    /// Sets the byte offset in the program of the nodes built next.
    fn stands_at(&mut self, _at: u32) {}
    /// Records the assignment of `v` to the variable `name`.
    fn assigned(&mut self, _v: &Self::V, _name: &str) {}
    /// Suggests a name for `v`, used unless the enclosing assignment gives a better one.
    fn suggest(&mut self, _v: &Self::V, _name: impl FnOnce() -> String) {}
    /// Returns true if the expression built so far exceeds its size limit; always false in
    /// immediate evaluation.
    fn is_too_large(&self) -> bool {
        false
    }
    /// Returns true if both are known to be equal, which immediate evaluation never claims.
    fn same(&self, _a: &Self::V, _b: &Self::V) -> bool {
        false
    }

    /// Returns 1 where v counts as true, else 0.
    fn truth(&mut self, v: &Self::V) -> Self::V {
        if self.is_boolean(v) {
            return v.clone();
        }
        let (eps, size) = (self.constant(TRUTH_TOLERANCE), self.abs(v));
        let t = self.less_eq(&eps, &size);
        self.boolean(t)
    }
}

impl<R: Real + 'static> Machine for Direct<R> {
    const CHECKED: bool = true;
}

/// Machine that builds the expression of a program.
#[derive(Default)]
pub(crate) struct Symbolic {
    pub(crate) graph: Graph,
    /// Nodes marked as truth values.
    booleans: HashSet<NodeId>,
    /// Suggested names, pending the assignment that contains their nodes.
    suggested: Vec<(NodeId, String)>,
    /// Byte offset of the function or operator under construction.
    at: u32,
    /// Byte offsets of discontinuous nodes.
    pub(crate) places: BTreeMap<NodeId, u32>,
}

impl Symbolic {
    /// Creates a machine that builds into a graph.
    pub(crate) fn new(graph: Graph) -> Self {
        Self {
            graph,
            ..Self::default()
        }
    }
}

impl Symbolic {
    /// Records the byte offset of a discontinuous node.
    fn placed(&mut self, id: NodeId) -> NodeId {
        if jumps(self.graph.node(id)) {
            self.places.entry(id).or_insert(self.at);
        }
        id
    }
}

impl Machine for Symbolic {
    const CHECKED: bool = false;

    fn stands_at(&mut self, at: u32) {
        self.at = at;
    }

    fn boolean(&mut self, v: NodeId) -> NodeId {
        self.booleans.insert(v);
        v
    }
    fn is_boolean(&self, v: &NodeId) -> bool {
        self.booleans.contains(v)
    }
    fn assigned(&mut self, v: &NodeId, name: &str) {
        // Arithmetic nodes, too: a plane or a tapered wall is a piece of the surface as a primitive
        // is.
        if !matches!(
            self.graph.node(*v),
            Node::Constant(_) | Node::X(_) | Node::Param(_)
        ) {
            self.graph.set_name(*v, name);
        }
        for (id, name) in self.suggested.drain(..) {
            self.graph.suggest_name(id, &name);
        }
    }
    fn suggest(&mut self, v: &NodeId, name: impl FnOnce() -> String) {
        if matches!(self.graph.node(*v), Node::Library(..)) && self.graph.name(*v).is_none() {
            self.suggested.push((*v, name()));
        }
    }
    fn is_too_large(&self) -> bool {
        self.graph.len() > MAX_EXPRESSION_NODES
    }
    fn same(&self, a: &NodeId, b: &NodeId) -> bool {
        a == b
    }
}

impl Ops for Symbolic {
    type V = NodeId;

    fn constant(&mut self, c: f64) -> NodeId {
        self.graph.constant(c)
    }
    fn unary(&mut self, op: Unary, a: &NodeId) -> NodeId {
        let id = self.graph.unary(op, a);
        self.placed(id)
    }
    fn binary(&mut self, op: Binary, a: &NodeId, b: &NodeId) -> NodeId {
        let id = self.graph.binary(op, a, b);
        self.placed(id)
    }
    fn powi(&mut self, a: &NodeId, n: i32) -> NodeId {
        self.graph.powi(a, n)
    }
    fn set(&mut self, op: SetOp, a: &NodeId, b: &NodeId) -> NodeId {
        self.graph.set(op, a, b)
    }
    fn select(&mut self, condition: &NodeId, a: &NodeId, b: &NodeId) -> NodeId {
        self.graph.select(condition, a, b)
    }
    fn library(&mut self, f: Library, args: &[NodeId]) -> NodeId {
        self.graph.library(f, args)
    }
    fn native(&mut self, f: Native, args: &[NodeId]) -> NodeId {
        let id = self.graph.native(f, args);
        self.placed(id)
    }
    fn known(&self, v: &NodeId) -> Option<f64> {
        self.graph.known(v)
    }
}
