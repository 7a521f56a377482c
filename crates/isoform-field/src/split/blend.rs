//! Blends: smooth functions of expressions with kinks, distributed over the pieces of these.
//!
//! The arguments of a blend are the nodes with kinks that its formula uses more than once, u and v
//! in `max(u, v) + max(k − |u − v|, 0)²/(4k)`. The formula is copied with variables in place of the
//! arguments and tested at pseudo-random points ([`crate::smooth`]): it must be C¹, and monotone in
//! each argument.

use super::monotone::{BlendFunction, MAX_BLEND_ARGUMENTS, MonotoneFunction};
use super::name::{NameContext, named};
use super::splitter::{MAX_FAILED_SEARCHES, Splitter, parameter_substitute};
use super::tree::{PieceLeaf, PieceTree};
use crate::graph::{Graph, Node, NodeId};
use crate::ops::{Binary, Ops, SetOp, Unary};
use crate::smooth::smooth_and_monotone;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;

/// Maximum number of products of a blend, one for each combination of pieces of its arguments; a
/// blend with more products is not split.
const MAX_PRODUCTS: usize = 4096;
/// Maximum number of candidate nodes for the arguments of a blend. The search is aborted with more,
/// since it compares all pairs.
const MAX_CANDIDATES: usize = 24;

/// Node to be distributed over the pieces of its inputs.
struct BlendProduct<'a> {
    id: NodeId,
    /// The nodes that depend on the inputs, up to `id`.
    above: &'a [NodeId],
    inputs: &'a [NodeId],
    function: Option<Rc<BlendFunction>>,
    context: &'a NameContext,
}

impl Splitter<'_> {
    /// Distributes the node over the trees of the expressions with kinks that it uses more than
    /// once; `None` unless it is a smooth function of these.
    pub(super) fn blend(&mut self, id: NodeId, context: &NameContext) -> Option<PieceTree> {
        if self.failures > MAX_FAILED_SEARCHES {
            return None;
        }
        let shared = self.shared(id);
        let tree = if shared.is_empty() || shared.len() > MAX_BLEND_ARGUMENTS {
            None
        } else {
            self.blended(id, &shared, context)
        };
        self.failures += usize::from(tree.is_none());
        tree
    }

    pub(super) fn blended(
        &mut self,
        id: NodeId,
        of: &[NodeId],
        context: &NameContext,
    ) -> Option<PieceTree> {
        let interior = self.interior(id, of);
        let (alone, root) = self.alone(id, &interior, of);
        let rises = smooth_and_monotone(alone, root, of.len())?;
        if of.is_empty() {
            return Some(self.leaf(id, context));
        }
        let inputs: Vec<(NodeId, bool)> = of.iter().copied().zip(rises).collect();
        let mut dependent: HashSet<NodeId> = of.iter().copied().collect();
        let above: Vec<NodeId> = interior
            .into_iter()
            .filter(|&i| {
                let depends = self
                    .graph
                    .arguments(i)
                    .iter()
                    .any(|a| dependent.contains(a));
                depends && dependent.insert(i)
            })
            .collect();
        Some(self.distributed(id, &above, &inputs, context))
    }

    /// Returns true if the node certainly has kinks: it is linear in one expression that is a
    /// minimum, a maximum or an absolute value.
    pub(super) fn shows_kinks(&mut self, mut id: NodeId) -> bool {
        loop {
            let (u, v) = match self.graph.node(id).clone() {
                Node::Unary(Unary::Neg, _) => return true,
                Node::Binary(Binary::Add | Binary::Sub | Binary::Mul, u, v) => (u, v),
                Node::Binary(Binary::Div, u, v) if !self.is_kinked(v) => (u, v),
                _ => return false,
            };
            id = match (self.is_kinked(u), self.is_kinked(v)) {
                (true, false) => u,
                (false, true) => v,
                _ => return false,
            };
            if self.value_join(id).is_some() || self.absolute(id).is_some() {
                return true;
            }
        }
    }

    /// Returns the topmost nodes with kinks below `id` that are used more than once there, none of
    /// which depends on another.
    fn shared(&mut self, id: NodeId) -> Vec<NodeId> {
        let need = self.graph.reachable(&[id]);
        let mut uses: HashMap<NodeId, u32> = HashMap::new();
        for (i, _) in need.iter().enumerate().filter(|(_, need)| **need) {
            for a in self.graph.arguments(NodeId(i as u32)) {
                *uses.entry(a).or_default() += 1;
            }
        }
        // Arguments precede their users: the pending node with the largest index is not an argument
        // of the others.
        let mut found = Vec::new();
        let mut opened: HashSet<NodeId> = HashSet::new();
        loop {
            found.clear();
            let mut pending: BTreeSet<NodeId> = [id].into();
            while let Some(node) = pending.pop_last() {
                if !self.is_kinked(node) {
                    continue;
                }
                if node != id && uses[&node] > 1 && !opened.contains(&node) {
                    found.push(node);
                } else {
                    pending.extend(self.graph.arguments(node));
                }
            }
            if found.len() > MAX_CANDIDATES {
                break;
            }
            // A node that depends on another one is not an input.
            let outer = found.iter().copied().find(|&u| {
                let below = self.graph.reachable(&[u]);
                found.iter().any(|&v| v != u && below[v.at()])
            });
            match outer {
                Some(u) => opened.insert(u),
                None => break,
            };
        }
        found.sort_unstable();
        found
    }

    /// Returns the nodes from `id` down to the `inputs`, without these, in the order of
    /// computation.
    fn interior(&self, id: NodeId, inputs: &[NodeId]) -> Vec<NodeId> {
        let mut pending: BTreeSet<NodeId> = [id].into();
        let mut nodes = Vec::new();
        while let Some(node) = pending.pop_last() {
            if !inputs.contains(&node) {
                nodes.push(node);
                pending.extend(self.graph.arguments(node));
            }
        }
        nodes.reverse();
        nodes
    }

    /// Copies the interior, with the inputs as further coordinates.
    fn alone(&self, id: NodeId, interior: &[NodeId], inputs: &[NodeId]) -> (Graph, NodeId) {
        let mut graph = Graph::new();
        let mut copy: HashMap<NodeId, NodeId> = HashMap::new();
        for (k, &input) in inputs.iter().enumerate() {
            copy.insert(input, graph.x(3 + k));
        }
        for &node in interior {
            let new = match self.graph.node(node) {
                Node::Param(i) => graph.constant(parameter_substitute(*i)),
                other => rebuilt(&mut graph, other, &copy),
            };
            copy.insert(node, new);
        }
        (graph, copy[&id])
    }

    /// Distributes `id`, computed by the nodes `above` from the inputs, over the inputs' pieces.
    pub(super) fn distributed(
        &mut self,
        id: NodeId,
        above: &[NodeId],
        inputs: &[(NodeId, bool)],
        context: &NameContext,
    ) -> PieceTree {
        // The pieces of a single input inherit the context; combinations of pieces of several
        // inputs have names of their own.
        let below = if inputs.len() > 1 {
            NameContext::default()
        } else {
            self.below(context)
        };
        let trees: Vec<(PieceTree, bool)> = inputs
            .iter()
            .map(|&(u, rises)| (self.value(u, &below), rises))
            .collect();
        let products = trees
            .iter()
            .fold(1usize, |n, (t, _)| n.saturating_mul(t.leaves()));
        if products == 1 || products > MAX_PRODUCTS {
            return self.leaf(id, context);
        }
        let (inputs, rises): (Vec<NodeId>, Vec<bool>) = inputs.iter().copied().unzip();
        let function = (inputs.len() > 1)
            .then(|| self.function(id, &inputs, rises))
            .flatten();
        let product = BlendProduct {
            id,
            above,
            inputs: &inputs,
            function,
            context,
        };
        self.product(&product, &trees, &mut Vec::with_capacity(trees.len()))
    }

    /// Returns the node as a function of the inputs alone; `None` if it also depends on the
    /// coordinates directly.
    fn function(
        &self,
        id: NodeId,
        inputs: &[NodeId],
        rises: Vec<bool>,
    ) -> Option<Rc<BlendFunction>> {
        let (graph, root) = self.alone(id, &self.interior(id, inputs), inputs);
        let need = graph.reachable(&[root]);
        let in_space = need
            .iter()
            .enumerate()
            .any(|(i, need)| *need && matches!(graph.node(NodeId(i as u32)), Node::X(0..3)));
        (!in_space).then(|| Rc::new(BlendFunction { graph, root, rises }))
    }

    fn product(
        &mut self,
        of: &BlendProduct<'_>,
        trees: &[(PieceTree, bool)],
        chosen: &mut Vec<PieceLeaf>,
    ) -> PieceTree {
        match trees.split_first() {
            Some(((PieceTree::Leaf(leaf), _), rest)) => {
                chosen.push(leaf.clone());
                let tree = self.product(of, rest, chosen);
                chosen.pop();
                tree
            }
            Some(((PieceTree::Join(join), rises), rest)) => {
                let with = |child: &PieceTree| {
                    std::iter::once((child.clone(), *rises))
                        .chain(rest.iter().cloned())
                        .collect::<Vec<_>>()
                };
                let parts: Vec<PieceTree> = join
                    .children
                    .iter()
                    .map(|child| self.product(of, &with(child), chosen))
                    .collect();
                PieceTree::join(join.is_min == *rises, parts)
            }
            None => {
                let value = self.product_value(of, chosen);
                if let Some(function) = &of.function {
                    let inputs = chosen.iter().map(|l| l.value).collect();
                    self.monotone.entry(value).or_insert(MonotoneFunction {
                        function: function.clone(),
                        inputs,
                    });
                }
                PieceTree::Leaf(self.product_leaf(value, chosen, of.context))
            }
        }
    }

    /// Computes the node from one piece of each input.
    fn product_value(&mut self, of: &BlendProduct<'_>, chosen: &[PieceLeaf]) -> NodeId {
        let mut copy: HashMap<NodeId, NodeId> = of
            .inputs
            .iter()
            .copied()
            .zip(chosen.iter().map(|l| l.value))
            .collect();
        for &id in of.above {
            for a in self.graph.arguments(id) {
                copy.entry(a).or_insert(a);
            }
            let node = self.graph.node(id).clone();
            let new = one_sided(self.graph, &node, &copy)
                .unwrap_or_else(|| rebuilt(self.graph, &node, &copy));
            copy.insert(id, new);
        }
        copy[&of.id]
    }

    fn product_leaf(&self, value: NodeId, of: &[PieceLeaf], context: &NameContext) -> PieceLeaf {
        let with_names: Vec<&PieceLeaf> = of
            .iter()
            .filter(|l| !l.name.is_empty() || !l.side.is_empty())
            .collect();
        match with_names[..] {
            [] => PieceLeaf {
                value,
                name: self.below(context).name,
                is_own: false,
                side: "".into(),
            },
            [one] => PieceLeaf {
                value,
                ..one.clone()
            },
            _ => {
                let name = with_names
                    .iter()
                    .map(|l| named(self.graph, l))
                    .collect::<Vec<_>>()
                    .join("+");
                PieceLeaf {
                    value,
                    name: name.into(),
                    is_own: true,
                    side: "".into(),
                }
            }
        }
    }
}

/// Rebuilds a node with the arguments replaced by their copies, all of which must exist.
fn rebuilt(graph: &mut Graph, node: &Node, copy: &HashMap<NodeId, NodeId>) -> NodeId {
    let at = |id: &NodeId| copy[id];
    match node {
        Node::Constant(bits) => graph.constant(f64::from_bits(*bits)),
        Node::X(i) => graph.x(*i as usize),
        Node::Param(i) => graph.param(*i as usize),
        Node::Unary(op, u) => graph.unary(*op, &at(u)),
        Node::Binary(op, u, v) => graph.binary(*op, &at(u), &at(v)),
        Node::PowI(u, n) => graph.powi(&at(u), *n),
        Node::Set(op, u, v) => graph.set(*op, &at(u), &at(v)),
        Node::Select(c, u, v) => graph.select(&at(c), &at(u), &at(v)),
        Node::Library(f, args) => {
            let args: Vec<NodeId> = args.iter().map(at).collect();
            graph.library(*f, &args)
        }
        Node::Native(f, args) => {
            let args: Vec<NodeId> = args.iter().map(at).collect();
            graph.native(f.clone(), &args)
        }
    }
}

/// Rebuilds a node with a kink inside a smooth function such that, where u = v, the derivatives of
/// max(u, v), min(u, v) and |u − v| are those of one common side, so that the kinks cancel there,
/// too. Derivatives of minima and maxima are those of the first of two equal arguments.
fn one_sided(graph: &mut Graph, node: &Node, copy: &HashMap<NodeId, NodeId>) -> Option<NodeId> {
    let sorted = |u: &NodeId, v: &NodeId| (copy[u].min(copy[v]), copy[u].max(copy[v]));
    match node {
        Node::Set(SetOp::Max, u, v) => {
            let (u, v) = sorted(u, v);
            Some(graph.max(&u, &v))
        }
        Node::Set(SetOp::Min, u, v) => {
            let (u, v) = sorted(u, v);
            Some(graph.min(&v, &u))
        }
        Node::Unary(Unary::Abs, d) => {
            let Node::Binary(Binary::Sub, u, v) = *graph.node(copy[d]) else {
                return None;
            };
            let (u, v) = (u.min(v), u.max(v));
            let (more, less) = (graph.sub(&u, &v), graph.sub(&v, &u));
            Some(graph.max(&more, &less))
        }
        _ => None,
    }
}
