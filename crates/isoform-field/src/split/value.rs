//! Splitting by value: the tree has the expression's value everywhere.
//!
//! A monotone function is distributed over the tree of its argument: an increasing function of a
//! minimum is the minimum of its values, a decreasing one the maximum.

use super::name::{NameContext, axis_side, side_of};
use super::nodes::{BinaryJoin, along_axis};
use super::splitter::{
    MAX_FAILED_SEARCHES, MAX_LEAVES, MAX_SPLIT_DEPTH, Splitter, parameter_substitute,
};
use super::tree::{PieceLeaf, PieceTree};
use crate::graph::{Node, NodeId};
use crate::library::{Family, Library};
use crate::ops::{Binary, Ops, Unary};
use crate::smooth::Random;
use crate::tape::Tape;

impl Splitter<'_> {
    pub(super) fn value(&mut self, id: NodeId, above: &NameContext) -> PieceTree {
        let context = self.context(id, above);
        if !self.is_kinked(id) {
            return self.leaf(id, &context);
        }
        if let Some(tree) = self.values.get(&id) {
            return tree.clone();
        }
        self.depth += 1;
        let tree = if self.depth > MAX_SPLIT_DEPTH {
            self.too_large = true;
            self.leaf(id, &context)
        } else {
            self.value_of(id, &context)
        };
        self.depth -= 1;
        let tree = if tree.leaves() > MAX_LEAVES {
            self.leaf(id, &context)
        } else {
            tree
        };
        self.values.insert(id, tree.clone());
        tree
    }

    fn value_of(&mut self, id: NodeId, context: &NameContext) -> PieceTree {
        if let Some(join) = self.value_join(id) {
            let is_min = matches!(join, BinaryJoin::Min(..));
            let operands =
                self.operands(id, context, |splitter, id| splitter.value_join(id), is_min);
            let parts: Vec<PieceTree> = operands
                .into_iter()
                .map(|(id, context)| self.value(id, &context))
                .collect();
            return PieceTree::join(is_min, parts);
        }
        if let Some(u) = self.absolute(id) {
            return self.sides(u, context);
        }
        // If all kinks cancel, a cut at them would only be a superfluous seam.
        if !self.shows_kinks(id) && self.failures <= MAX_FAILED_SEARCHES {
            match self.blended(id, &[], context) {
                Some(tree) => return tree,
                None => self.failures += 1,
            }
        }
        match self.graph.node(id).clone() {
            Node::Unary(op, u) => self.unary(id, op, u, context),
            Node::PowI(u, n) => self.power(id, u, n, context),
            Node::Binary(op, u, v) => self.binary(id, op, u, v, context),
            Node::Set(_, u, v) => self.passed(id, &[(u, true), (v, true)], context),
            Node::Library(f, args) => self.library(id, f, &args, context),
            _ => self
                .blend(id, context)
                .unwrap_or_else(|| self.leaf(id, context)),
        }
    }

    fn library(
        &mut self,
        id: NodeId,
        f: Library,
        args: &[NodeId],
        context: &NameContext,
    ) -> PieceTree {
        match f.family() {
            // Both arguments are split, with or without kinks: a blend is named after both.
            Family::Circular { .. } => {
                self.distributed(id, &[id], &[(args[0], true), (args[1], true)], context)
            }
            Family::Displaced => {
                let of = args[..2].iter().copied();
                let kinked: Vec<NodeId> = of.filter(|&u| self.is_kinked(u)).collect();
                self.blended(id, &kinked, context)
                    .unwrap_or_else(|| self.leaf(id, context))
            }
            Family::Primitive => {
                let formula = self.graph.lowered(id);
                if self.graph.node(formula) == self.graph.node(id) {
                    self.leaf(id, context)
                } else {
                    self.value(formula, context)
                }
            }
            Family::Sardf { .. } => self
                .blend(id, context)
                .unwrap_or_else(|| self.leaf(id, context)),
        }
    }

    /// Splits |u| as max(u, −u), over the pieces of u.
    fn sides(&mut self, u: NodeId, context: &NameContext) -> PieceTree {
        if self.ranges_of(u).lo() >= 0.0 {
            return self.value(u, context);
        }
        let below = self.below(context);
        let tree = self.value(u, &below);
        let is_one = matches!(tree, PieceTree::Leaf(_));
        let side = |tree: &PieceTree, sign: &str, is_upper: bool| {
            tree.map(false, &mut |leaf| {
                let (name, side) = match along_axis(self.graph, leaf.value) {
                    Some((axis, rises)) if is_one => {
                        (&below.name, axis_side(axis, rises != is_upper))
                    }
                    _ if leaf.is_own => (&below.name, format!("{}{sign}", leaf.name)),
                    _ => (&leaf.name, format!("{}{sign}", side_of(self.graph, leaf))),
                };
                PieceLeaf {
                    value: leaf.value,
                    name: name.clone(),
                    is_own: false,
                    side: side.into(),
                }
            })
        };
        // The side where u is positive is the upper one of an axis along which u increases.
        let upper = side(&tree, "+", true);
        let lower = side(&tree, "-", false);
        let lower = self.negated(&lower);
        PieceTree::join(false, [upper, lower])
    }

    pub(super) fn unary(
        &mut self,
        id: NodeId,
        op: Unary,
        u: NodeId,
        context: &NameContext,
    ) -> PieceTree {
        match op {
            Unary::Neg => {
                let tree = self.value(u, context);
                self.negated(&tree)
            }
            Unary::Exp | Unary::Sinh | Unary::Tanh | Unary::Atan => {
                self.passed(id, &[(u, true)], context)
            }
            Unary::Sqrt | Unary::Ln | Unary::Asin => self.passed_in_domain(id, u, true, context),
            Unary::Acos => self.passed_in_domain(id, u, false, context),
            Unary::Square => self.power(id, u, 2, context),
            _ => self
                .blend(id, context)
                .unwrap_or_else(|| self.leaf(id, context)),
        }
    }

    fn power(&mut self, id: NodeId, u: NodeId, n: i32, context: &NameContext) -> PieceTree {
        if n > 0 && n % 2 == 1 {
            return self.passed(id, &[(u, true)], context);
        }
        if let Some(tree) = self.blend(id, context) {
            return tree;
        }
        if n == 2 && self.ranges_of(u).lo() >= 0.0 {
            // For u ≥ 0, u² = u |u|, which is increasing and C¹ everywhere: the pieces of u may be
            // negative where they do not decide.
            let tree = self.value(u, context);
            return tree.map(false, &mut |leaf| {
                let size = self.graph.abs(&leaf.value);
                PieceLeaf {
                    value: self.graph.mul(&leaf.value, &size),
                    ..leaf.clone()
                }
            });
        }
        self.leaf(id, context)
    }

    pub(super) fn binary(
        &mut self,
        id: NodeId,
        op: Binary,
        u: NodeId,
        v: NodeId,
        context: &NameContext,
    ) -> PieceTree {
        let both = self.is_kinked(u) && self.is_kinked(v);
        if both && let Some(tree) = self.blend(id, context) {
            return tree;
        }
        let inputs = match op {
            Binary::Add => Some(vec![(u, true), (v, true)]),
            Binary::Sub => Some(vec![(u, true), (v, false)]),
            Binary::Mul if !both => {
                let (kinked, factor) = if self.is_kinked(u) { (u, v) } else { (v, u) };
                self.strict_sign(factor)
                    .map(|positive| vec![(kinked, positive)])
            }
            Binary::Div if !self.is_kinked(v) => {
                self.strict_sign(v).map(|positive| vec![(u, positive)])
            }
            Binary::Pow => match self.graph.constant_value(v) {
                Some(c) if c != 0.0 => return self.passed_in_domain(id, u, c > 0.0, context),
                _ => None,
            },
            _ => None,
        };
        match inputs {
            Some(inputs) => self.passed(id, &inputs, context),
            None if both => self.leaf(id, context),
            None => self
                .blend(id, context)
                .unwrap_or_else(|| self.leaf(id, context)),
        }
    }

    /// Distributes the node over the trees of its inputs, in each of which it increases (true) or
    /// decreases.
    fn passed(
        &mut self,
        id: NodeId,
        inputs: &[(NodeId, bool)],
        context: &NameContext,
    ) -> PieceTree {
        let inputs: Vec<(NodeId, bool)> = inputs
            .iter()
            .copied()
            .filter(|(u, _)| self.is_kinked(*u))
            .collect();
        self.distributed(id, &[id], &inputs, context)
    }

    /// Distributes a function that is not defined everywhere over the tree of its argument, unless
    /// a sample shows a piece outside of the domain at a point where the function is defined.
    fn passed_in_domain(
        &mut self,
        id: NodeId,
        u: NodeId,
        rises: bool,
        context: &NameContext,
    ) -> PieceTree {
        let tree = self.passed(id, &[(u, rises)], context);
        let mut pieces = vec![id];
        let _ = tree.map(false, &mut |leaf| {
            pieces.push(leaf.value);
            leaf.clone()
        });
        if pieces.len() == 2 {
            return tree;
        }
        let a: Vec<f64> = (0..self.params)
            .map(|i| parameter_substitute(i as u32))
            .collect();
        let tape = Tape::new(self.graph, &pieces, 3, a.len());
        let (mut random, mut scratch) = (Random::new(), Vec::new());
        for _ in 0..64 {
            let values = tape.eval_all(&random.place(3), &a, &mut scratch);
            if !values[0].is_nan() && values.iter().any(|v| v.is_nan()) {
                return self
                    .blend(id, context)
                    .unwrap_or_else(|| self.leaf(id, context));
            }
        }
        tree
    }
}
