//! Points at which an expression is undefined: roots of negative numbers, divisions by zero and the
//! like. Bounds of all subexpressions prove for most of them that they are defined everywhere.
//!
//! Bounds are computed with the operations of the evaluation itself, rounded to nearest, which are
//! monotone: they hold for the numbers that an evaluation gives.

use super::graph::{ScalarFunction as F, ScalarGraph, ScalarId, ScalarNode, ScalarOperation as O};
use std::collections::HashMap;

/// Condition under which an operation is defined, on its arguments.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guard {
    /// The two sides of a comparison.
    pub(super) sides: [ScalarId; 2],
    /// True if the operation is defined where the first side is less than the second, else it is
    /// defined where it is not.
    pub(super) is_defined_below: bool,
}

/// Least and greatest value.
type Bounds = (f64, f64);

const ALL: Bounds = (f64::NEG_INFINITY, f64::INFINITY);

/// Returns the guards of the operations below some nodes that may be undefined at some points.
pub(super) fn guards(graph: &mut ScalarGraph) -> HashMap<ScalarId, Guard> {
    let mut bounds: Vec<Bounds> = Vec::with_capacity(graph.len());
    for id in graph.ids() {
        let found = node_bounds(graph, &bounds, id);
        bounds.push(found);
    }
    let mut guards = HashMap::new();
    for id in graph.ids().take(bounds.len()) {
        if let Some(guard) = guard(graph, &bounds, id) {
            guards.insert(id, guard);
        }
    }
    guards
}

/// Returns the guard of a node; `None` if it is defined wherever its arguments are.
fn guard(graph: &mut ScalarGraph, bounds: &[Bounds], id: ScalarId) -> Option<Guard> {
    let of = |id: ScalarId| bounds[id.at()];
    match *graph.node(id) {
        // Constants that overflow, or stand for an operation that is undefined.
        ScalarNode::Constant(bits) if !f64::from_bits(bits).is_finite() => {
            let zero = graph.constant(0.0);
            Some(Guard {
                sides: [zero, zero],
                is_defined_below: true,
            })
        }
        ScalarNode::Unary(F::Sqrt, u) if of(u).0 < 0.0 => Some(Guard {
            sides: [u, graph.constant(0.0)],
            is_defined_below: false,
        }),
        ScalarNode::Unary(F::Ln, u) if of(u).0 <= 0.0 => Some(Guard {
            sides: [graph.constant(0.0), u],
            is_defined_below: true,
        }),
        ScalarNode::Unary(F::Asin | F::Acos, u) if of(u).0 < -1.0 || of(u).1 > 1.0 => {
            let size = graph.unary(F::Abs, u);
            Some(Guard {
                sides: [graph.constant(1.0), size],
                is_defined_below: false,
            })
        }
        ScalarNode::Binary(O::Div, _, v) if contains_zero(of(v)) => Some(nonzero(graph, v)),
        ScalarNode::Binary(O::Pow, u, v) => {
            let zero = graph.constant(0.0);
            let is_whole = |c: f64| c == c.trunc();
            match graph.value(v) {
                Some(c) if is_whole(c) && c >= 0.0 => None,
                Some(c) if is_whole(c) => contains_zero(of(u)).then(|| nonzero(graph, u)),
                Some(c) if c > 0.0 => (of(u).0 < 0.0).then_some(Guard {
                    sides: [u, zero],
                    is_defined_below: false,
                }),
                _ => (of(u).0 <= 0.0).then_some(Guard {
                    sides: [zero, u],
                    is_defined_below: true,
                }),
            }
        }
        _ => None,
    }
}

/// Returns the guard of an operation that needs u ≠ 0.
fn nonzero(graph: &mut ScalarGraph, u: ScalarId) -> Guard {
    let size = graph.unary(F::Abs, u);
    Guard {
        sides: [graph.constant(0.0), size],
        is_defined_below: true,
    }
}

fn contains_zero((lo, hi): Bounds) -> bool {
    lo <= 0.0 && hi >= 0.0
}

/// Returns bounds; all numbers if one is none.
fn sound((lo, hi): Bounds) -> Bounds {
    if lo.is_nan() || hi.is_nan() || lo > hi {
        ALL
    } else {
        (lo, hi)
    }
}

/// Returns the bounds of a node from those of its arguments.
fn node_bounds(graph: &ScalarGraph, bounds: &[Bounds], id: ScalarId) -> Bounds {
    let of = |id: ScalarId| bounds[id.at()];
    match *graph.node(id) {
        ScalarNode::Constant(bits) => {
            let c = f64::from_bits(bits);
            if c.is_nan() { ALL } else { (c, c) }
        }
        ScalarNode::Coordinate(_) => ALL,
        ScalarNode::Unary(f, u) => sound(function_bounds(f, of(u))),
        ScalarNode::Binary(O::Mul, u, v) if u == v => {
            let (lo, hi) = function_bounds(F::Abs, of(u));
            sound((lo * lo, hi * hi))
        }
        ScalarNode::Binary(f, u, v) => sound(operation_bounds(f, of(u), of(v))),
        ScalarNode::Choice([_, _, u, v]) => {
            let (u, v) = (of(u), of(v));
            (u.0.min(v.0), u.1.max(v.1))
        }
    }
}

/// Returns the bounds of a function of one argument.
fn function_bounds(f: F, (lo, hi): Bounds) -> Bounds {
    use std::f64::consts::PI;
    match f {
        F::Abs if lo >= 0.0 => (lo, hi),
        F::Abs if hi <= 0.0 => (-hi, -lo),
        F::Abs => (0.0, hi.max(-lo)),
        F::Sqrt => (lo.max(0.0).sqrt(), hi.max(0.0).sqrt()),
        F::Exp => (0.0, f64::INFINITY),
        F::Sin | F::Cos | F::Tanh | F::Sign => (-1.0, 1.0),
        F::Cosh => (1.0, f64::INFINITY),
        F::Floor | F::Ceil | F::Trunc => (f.apply(lo), f.apply(hi)),
        F::Atan | F::Asin => (-PI, PI),
        F::Acos => (0.0, PI),
        F::Ln | F::Tan | F::Sinh => ALL,
    }
}

/// Returns the bounds of a function of two arguments.
fn operation_bounds(f: O, u: Bounds, v: Bounds) -> Bounds {
    let corners = |apply: fn(f64, f64) -> f64| {
        // Bounds stand for finite numbers: 0 times infinity is 0, and so is infinity's share of
        // itself, which other corners enclose.
        let all = [(u.0, v.0), (u.0, v.1), (u.1, v.0), (u.1, v.1)].map(|(a, b)| {
            let c = apply(a, b);
            if c.is_nan() { 0.0 } else { c }
        });
        let lo = all.iter().copied().fold(f64::INFINITY, f64::min);
        (lo, all.iter().copied().fold(f64::NEG_INFINITY, f64::max))
    };
    match f {
        O::Add => (u.0 + v.0, u.1 + v.1),
        O::Sub => (u.0 - v.1, u.1 - v.0),
        O::Mul => corners(|a, b| a * b),
        O::Div if !contains_zero(v) => corners(|a, b| a / b),
        O::Div if u.0 >= 0.0 && v.0 >= 0.0 => (0.0, f64::INFINITY),
        O::Pow if u.0 >= 0.0 => (0.0, f64::INFINITY),
        O::Div | O::Pow => ALL,
        O::Atan2 => (-4.0, 4.0),
        O::Min => (u.0.min(v.0), u.1.min(v.1)),
        O::Max => (u.0.max(v.0), u.1.max(v.1)),
    }
}

/// Returns, for the nodes that may be undefined, a number that is 1 where they are and 0 elsewhere.
pub(super) fn undefined(
    graph: &mut ScalarGraph,
    guards: &HashMap<ScalarId, Guard>,
) -> HashMap<ScalarId, ScalarId> {
    let (zero, one) = (graph.constant(0.0), graph.constant(1.0));
    let mut found: HashMap<ScalarId, ScalarId> = HashMap::new();
    for id in graph.ids() {
        let node = *graph.node(id);
        let of = |id: ScalarId| found.get(&id).copied().unwrap_or(zero);
        // Reasons to be undefined, each of which suffices.
        let mut reasons = Vec::new();
        if let ScalarNode::Choice([a, b, then, otherwise]) = node {
            let chosen = graph.choice([a, b], of(then), of(otherwise));
            reasons.extend([chosen, of(a), of(b)]);
        } else {
            node.for_arguments(|u| reasons.push(of(u)));
        }
        if let Some(guard) = guards.get(&id) {
            let (below, above) = match guard.is_defined_below {
                true => (zero, one),
                false => (one, zero),
            };
            reasons.push(graph.choice(guard.sides, below, above));
        }
        reasons.retain(|reason| *reason != zero);
        let all = reasons
            .into_iter()
            .reduce(|u, v| graph.binary(O::Max, u, v));
        found.extend(all.map(|all| (id, all)));
    }
    found
}
