//! What runs a program: numbers at once ([`Direct`]), or the construction of its expression
//! ([`Symbolic`]).

use super::MOST_NODES;
use crate::graph::{Graph, Node, NodeId};
use crate::jumps::jumps;
use crate::library::{Library, Native};
use crate::ops::{Binary, Direct, Ops, SetOp, Unary};
use isoform_num::Real;
use std::collections::{BTreeMap, HashSet};

/// HyperFun's tolerance: truth is |v| ≥ EPS, equality |u − v| < EPS.
pub(crate) const EPS: f64 = 1e-6;

/// The abilities that the executor needs beyond formulas.
pub(crate) trait Machine: Ops + 'static {
    /// Whether values are at hand, so that run-time errors are found.
    const CHECKED: bool;

    /// Notes that `v` is 0 or 1.
    fn boolean(&mut self, v: Self::V) -> Self::V {
        v
    }
    /// Whether `v` is noted to be 0 or 1.
    fn is_boolean(&self, _v: &Self::V) -> bool {
        false
    }
    /// The nodes that are built next stand at this byte offset of the program.
    fn stands_at(&mut self, _at: u32) {}
    /// `v` was assigned to `name`.
    fn assigned(&mut self, _v: &Self::V, _name: &str) {}
    /// `v` may be called so if nothing better comes with the assignment that it is part of.
    fn suggest(&mut self, _v: &Self::V, _name: impl FnOnce() -> String) {}
    /// Whether what was built so far is larger than it may be (nothing is when computing at once).
    fn is_too_large(&self) -> bool {
        false
    }
    /// Whether both are one and the same value (never claimed when computing at once).
    fn same(&self, _a: &Self::V, _b: &Self::V) -> bool {
        false
    }

    /// 1 where v counts as true, else 0.
    fn truth(&mut self, v: &Self::V) -> Self::V {
        if self.is_boolean(v) {
            return v.clone();
        }
        let (eps, size) = (self.constant(EPS), self.abs(v));
        let t = self.less_eq(&eps, &size);
        self.boolean(t)
    }
}

impl<R: Real + 'static> Machine for Direct<R> {
    const CHECKED: bool = true;
}

/// Builds the expression of a program.
#[derive(Default)]
pub(crate) struct Symbolic {
    pub(crate) graph: Graph,
    /// The nodes that are noted to be 0 or 1.
    booleans: HashSet<NodeId>,
    /// Names that wait for the assignment that their nodes are part of.
    suggested: Vec<(NodeId, String)>,
    /// Byte offset of the function or operator that is built.
    at: u32,
    /// Byte offsets of nodes that jump.
    pub(crate) places: BTreeMap<NodeId, u32>,
}

impl Symbolic {
    /// Builds into a graph.
    pub(crate) fn new(graph: Graph) -> Self {
        Self {
            graph,
            ..Self::default()
        }
    }
}

impl Symbolic {
    /// Takes note of where a node stands that jumps.
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
        // Arithmetic too: a plane or a tapered wall is a piece of the surface as well as a
        // primitive.
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
        self.graph.len() > MOST_NODES
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
