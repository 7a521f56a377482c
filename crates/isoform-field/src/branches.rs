//! Smooth parts of a model: its pieces, divided at every kink of their formulas.
//!
//! A blend such as max(u, v) + max(k − |u − v|, 0)²/(4k) is one piece, smooth except for its second
//! derivatives. Replacing each minimum, maximum and |u| by either of its branches gives functions
//! without kinks (here u, v and the fillet between them), each valid in the part of space in which
//! the conditions of its branches hold.

use crate::graph::{Graph, Node, NodeId};
use crate::hyperfun::Model;
use crate::library::{Library, Native};
use crate::ops::{Binary, Ops, SetOp, Unary};
use crate::residual::{Bound, Residual};
use crate::smooth::Random;
use crate::solid::{Pieces, SolidError};
use crate::tape::Tape;
use isoform_geom::{Field, Parts, SmoothPart, Solid};
use std::collections::HashMap;
use std::sync::Arc;

/// Maximum number of parts of a piece; a piece with more is not divided.
const MAX_PARTS_PER_PIECE: usize = 32;

/// Returns the smooth parts of a model with the values `a` of its parameters. A piece of more than
/// 32 parts is not divided.
pub fn parts_of(model: &Model, a: &[f64]) -> Result<Parts, SolidError> {
    parts_up_to(model, a, MAX_PARTS_PER_PIECE)
}

/// Returns the smooth parts of a model with the values `a` of its parameters. A piece of more than
/// `most` parts is not divided.
///
/// # Errors
/// Returns the errors of [`Pieces::of_model`].
pub fn parts_up_to(model: &Model, a: &[f64], most: usize) -> Result<Parts, SolidError> {
    Ok(parts_of_pieces(&Pieces::of_model(model, a)?, most))
}

/// Returns the smooth parts of a solid's pieces, like [`parts_up_to`].
pub fn parts_of_pieces(pieces: &Pieces, most: usize) -> Parts {
    let (graph, roots) = pieces.functions();
    let mut graph = graph.clone();
    // Conditions that compare with 0 share this node, so that equal ones are decided once.
    graph.constant(0.0);
    let (mut parts, mut known) = (Vec::new(), KnownFunctions::default());
    for (piece, root) in roots.iter().enumerate() {
        let root = graph.lowered(*root);
        let branches = branches(&mut graph, root, most).unwrap_or_else(|| vec![(root, Vec::new())]);
        for (root, limits) in branches {
            let field = known.field(&graph, root);
            let limits = limits.into_iter().map(|l| known.field(&graph, l)).collect();
            let function = known.function(field.as_ref(), parts.len());
            parts.push(SmoothPart {
                piece: piece as u32,
                field,
                limits,
                function,
            });
        }
    }
    Parts {
        tree: pieces.tree().clone(),
        parts,
    }
}

/// Functions of parts and their values at random points: different decisions often lead to equal
/// functions in different notation.
#[derive(Default)]
struct KnownFunctions {
    /// Compiled functions.
    by_node: HashMap<NodeId, Arc<dyn Field>>,
    /// Values of each distinct function, and the first part that has the function.
    by_values: Vec<(Vec<f64>, usize)>,
}

/// Number of random points at which functions are compared.
const COMPARISON_POINTS: usize = 24;
/// Minimum number of points at which both functions are defined for them to count as equal: roots
/// are not defined everywhere.
const MIN_COMPARED_POINTS: usize = 6;
/// Largest difference of two equal values, relative to 1 + |value|: above the rounding errors of a
/// formula in two notations.
const EQUAL_VALUE_TOLERANCE: f64 = 1e-12;

impl KnownFunctions {
    /// Returns the function of a node, compiled once.
    fn field(&mut self, graph: &Graph, root: NodeId) -> Arc<dyn Field> {
        let new = || {
            Arc::new(Bound::new(
                Residual::new(Tape::new(graph, &[root], 3, 0)),
                &[],
            )) as Arc<dyn Field>
        };
        self.by_node.entry(root).or_insert_with(new).clone()
    }

    /// Returns the first part whose function agrees with the function `field` of this part.
    fn function(&mut self, field: &dyn Field, part: usize) -> usize {
        let mut random = Random::new();
        let values: Vec<f64> = (0..COMPARISON_POINTS)
            .map(|_| {
                let p = random.place(3);
                field.value([p[0], p[1], p[2]])
            })
            .collect();
        let numbers = values.iter().filter(|v| v.is_finite()).count();
        let same = |other: &[f64]| {
            let near = |(a, b): (&f64, &f64)| {
                (a - b).abs() <= EQUAL_VALUE_TOLERANCE * (1.0 + a.abs().max(b.abs()))
                    || a.is_nan() && b.is_nan()
            };
            numbers >= MIN_COMPARED_POINTS && values.iter().zip(other).all(near)
        };
        let found = self
            .by_values
            .iter()
            .find(|(other, _)| same(other))
            .map(|(_, first)| *first);
        found.unwrap_or_else(|| {
            self.by_values.push((values, part));
            part
        })
    }
}

/// Condition u ≥ v that decides a kink, as (u, v).
type KinkCondition = (NodeId, NodeId);

/// Returns the functions of which a lowered expression consists, each with the limits that are ≥ 0
/// where it is valid; `None` if there are more than `most`.
fn branches(graph: &mut Graph, root: NodeId, most: usize) -> Option<Vec<(NodeId, Vec<NodeId>)>> {
    let (mut pending, mut done) = (vec![(root, Vec::new())], Vec::new());
    while let Some((root, limits)) = pending.pop() {
        let Some(condition) = first_condition(graph, root) else {
            // Constants are parts as well: without them the other functions would seem valid in the
            // region of a constant.
            done.push((root, limits));
            continue;
        };
        if pending.len() + done.len() >= most {
            return None;
        }
        for (yes, difference) in [(true, condition), (false, (condition.1, condition.0))] {
            let limit = graph.sub(&difference.0, &difference.1);
            // A condition on constants holds always or never.
            if graph.constant_value(limit).is_some_and(|v| v < 0.0) {
                continue;
            }
            let decided = decided(graph, root, condition, yes);
            let mut limits = limits.clone();
            limits.push(limit);
            pending.push((decided, limits));
        }
    }
    Some(done)
}

/// Returns the expression with one condition set to true or false.
fn decided(graph: &mut Graph, root: NodeId, condition: KinkCondition, yes: bool) -> NodeId {
    let (x, a) = graph.input_nodes(graph.inputs(root));
    let source = graph.clone();
    let mut target = BranchBuilder {
        graph,
        condition,
        yes,
    };
    source.rewrite(root, &mut target, &x, &a, |_, _, _| {})
}

/// Returns the first condition of an expression, which does not depend on other conditions.
fn first_condition(graph: &Graph, root: NodeId) -> Option<KinkCondition> {
    let need = graph.reachable(&[root]);
    need.iter()
        .enumerate()
        .filter(|(_, need)| **need)
        .find_map(|(i, _)| kink_condition(graph, graph.node(NodeId(i as u32))).map(|q| q.0))
}

/// Returns the condition of a node with a kink, and true if the node uses its reverse. |u − v|,
/// max(u − v, v − u) and max(u, v) share one condition: separate ones could contradict each other,
/// which gives parts that are valid only where u = v and make proofs fail there.
fn kink_condition(graph: &Graph, node: &Node) -> Option<(KinkCondition, bool)> {
    let ordered = |u: NodeId, v: NodeId| {
        if u <= v {
            ((u, v), false)
        } else {
            ((v, u), true)
        }
    };
    let of_sign = |u: NodeId| match *graph.node(u) {
        Node::Binary(Binary::Sub, u, v) => Some(ordered(u, v)),
        _ => Some(ordered(u, graph.zero()?)),
    };
    match *node {
        Node::Set(SetOp::Min | SetOp::Max, u, v)
        | Node::Binary(Binary::Less | Binary::LessEq, u, v) => {
            if is_negative(graph, u, v) {
                of_sign(u)
            } else {
                Some(ordered(u, v))
            }
        }
        Node::Unary(Unary::Abs, u) => of_sign(u),
        _ => None,
    }
}

/// Returns true if v is recognized as −u by its form.
fn is_negative(graph: &Graph, u: NodeId, v: NodeId) -> bool {
    match (graph.node(u), graph.node(v)) {
        (Node::Binary(Binary::Sub, a, b), Node::Binary(Binary::Sub, c, d)) => a == d && b == c,
        (_, Node::Unary(Unary::Neg, w)) => *w == u,
        _ => false,
    }
}

/// Builder of an expression with one condition set to true or false.
struct BranchBuilder<'g> {
    graph: &'g mut Graph,
    condition: KinkCondition,
    yes: bool,
}

impl BranchBuilder<'_> {
    /// Returns true if u ≥ v, false if not; `None` if the condition is another one.
    fn is_at_least(&self, node: &Node) -> Option<bool> {
        let (found, reversed) = kink_condition(self.graph, node)?;
        (found == self.condition).then_some(self.yes != reversed)
    }
}

impl Ops for BranchBuilder<'_> {
    type V = NodeId;
    fn constant(&mut self, c: f64) -> NodeId {
        self.graph.constant(c)
    }
    fn unary(&mut self, op: Unary, a: &NodeId) -> NodeId {
        match self.is_at_least(&Node::Unary(op, *a)) {
            Some(true) => *a,
            Some(false) => self.graph.unary(Unary::Neg, a),
            None => self.graph.unary(op, a),
        }
    }
    fn binary(&mut self, op: Binary, a: &NodeId, b: &NodeId) -> NodeId {
        match self.is_at_least(&Node::Binary(op, *a, *b)) {
            Some(at_least) => self.graph.constant(if at_least { 0.0 } else { 1.0 }),
            None => self.graph.binary(op, a, b),
        }
    }
    fn powi(&mut self, a: &NodeId, n: i32) -> NodeId {
        self.graph.powi(a, n)
    }
    fn set(&mut self, op: SetOp, a: &NodeId, b: &NodeId) -> NodeId {
        match self.is_at_least(&Node::Set(op, *a, *b)) {
            Some(at_least) => {
                if at_least == (op == SetOp::Max) {
                    *a
                } else {
                    *b
                }
            }
            None => self.graph.set(op, a, b),
        }
    }
    fn select(&mut self, condition: &NodeId, a: &NodeId, b: &NodeId) -> NodeId {
        match self.graph.constant_value(*condition) {
            Some(c) => {
                if c == 0.0 {
                    *b
                } else {
                    *a
                }
            }
            None => self.graph.select(condition, a, b),
        }
    }
    fn library(&mut self, f: Library, args: &[NodeId]) -> NodeId {
        self.graph.library(f, args)
    }
    fn native(&mut self, f: Native, args: &[NodeId]) -> NodeId {
        self.graph.native(f, args)
    }
    fn known(&self, v: &NodeId) -> Option<f64> {
        self.graph.constant_value(*v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hyperfun::Mode;

    #[test]
    fn a_blend_falls_into_its_sides_and_the_fillet() {
        let text = "my_model(x[3], a[1]) { u = x[1]; v = x[2]; k = 0.5; h = max(k - abs(u - v), 0)/k; my_model = max(u, v) + h*h*k/4; }";
        let parts =
            parts_of(&Model::parse(text, Mode::Default).expect("a model"), &[0.0]).expect("parts");
        assert_eq!(parts.parts.len(), 4);
        for (p, want) in [
            ([2.0, 1.0, 0.0], 2.0),
            ([1.0, 2.0, 0.0], 2.0),
            ([1.0, 1.0, 0.0], 1.125),
            ([1.0, 1.25, 0.0], 1.25 + 0.03125),
        ] {
            let holds = |part: &&SmoothPart| part.limits.iter().all(|l| l.value(p) >= 0.0);
            let values: Vec<f64> = parts
                .parts
                .iter()
                .filter(holds)
                .map(|part| part.field.value(p))
                .collect();
            assert!(
                !values.is_empty() && values.iter().all(|v| (v - want).abs() < 1e-15),
                "{p:?}: {values:?}"
            );
        }
    }

    /// Checks that one condition in two notations is decided once: parts that are valid only where
    /// u = v make proofs fail there.
    #[test]
    fn equal_conditions_are_decided_once() {
        let count = |size: &str| {
            let text = format!(
                "my_model(x[3], a[1]) {{ u = x[1]; v = x[2]; k = 0.5; h = max(k - {size}, 0)/k; my_model = max(u, v) + h*h*k/4; }}"
            );
            parts_of(
                &Model::parse(&text, Mode::Default).expect("a model"),
                &[0.0],
            )
            .expect("parts")
            .parts
            .len()
        };
        assert_eq!(["abs(u - v)", "max(u - v, v - u)"].map(count), [4; 2]);
    }

    /// Checks that the valid parts have the value of the model everywhere, also in the region of a
    /// constant.
    #[test]
    fn constants_are_parts() {
        let text = "my_model(x[3], a[1]) { my_model = cos(43*max(x[1], 0.1)) + 0.42; }";
        let parts =
            parts_of(&Model::parse(text, Mode::Default).expect("a model"), &[0.0]).expect("parts");
        for (x, want) in [
            (1.0, 43f64.cos() + 0.42),
            (0.01, 4.3f64.cos() + 0.42),
            (-1.0, 4.3f64.cos() + 0.42),
        ] {
            let p = [x, 0.3, 0.7];
            let holds = |part: &&SmoothPart| part.limits.iter().all(|l| l.value(p) >= 0.0);
            let values: Vec<f64> = parts
                .parts
                .iter()
                .filter(holds)
                .map(|part| part.field.value(p))
                .collect();
            assert!(
                !values.is_empty() && values.iter().all(|v| (v - want).abs() < 1e-15),
                "{x}: {values:?}"
            );
        }
    }
}
