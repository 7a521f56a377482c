//! Scalar expressions as HyperFun programs: a variable for each subexpression that is used more
//! than once, and a branch for each choice and for each operation that may be undefined.

use super::domain::Guard;
use super::graph::{ScalarFunction as F, ScalarGraph, ScalarId, ScalarNode, ScalarOperation as O};
use std::collections::HashMap;
use std::fmt::Write;

/// Maximum nesting depth of a printed expression, which keeps lines readable.
const MAX_DEPTH: u32 = 6;
/// Difference up to which HyperFun takes an exponent for the integer below it.
const EXPONENT_TOLERANCE: f64 = 1e-6;

/// Printer of a program.
struct Printer<'g> {
    graph: &'g ScalarGraph,
    guards: &'g HashMap<ScalarId, Guard>,
    names: &'g HashMap<ScalarId, String>,
    /// Text and nesting depth of the nodes that are printed so far.
    texts: HashMap<ScalarId, (String, u32)>,
    /// Number of variables.
    variables: usize,
    body: String,
}

/// Returns the statements that compute `root`, and the expression that it becomes.
pub(super) fn statements(
    graph: &ScalarGraph,
    guards: &HashMap<ScalarId, Guard>,
    names: &HashMap<ScalarId, String>,
    root: ScalarId,
) -> (String, String) {
    let mut uses = vec![0_u32; graph.len()];
    let mut needed = vec![false; graph.len()];
    needed[root.at()] = true;
    // Nodes come after their arguments; the sides of guards are arguments, too.
    for id in graph.ids().rev().filter(|id| id.at() <= root.at()) {
        if !needed[id.at()] {
            continue;
        }
        let mut used = |u: ScalarId| {
            uses[u.at()] += 1;
            needed[u.at()] = true;
        };
        graph.node(id).for_arguments(&mut used);
        if let Some(guard) = guards.get(&id) {
            // A side is not printed before the node in general: it is of the arguments.
            for u in side_arguments(graph, guard) {
                used(u);
            }
        }
    }
    let mut printer = Printer {
        graph,
        guards,
        names,
        texts: HashMap::new(),
        variables: 0,
        body: String::new(),
    };
    for id in graph.ids().take(root.at() + 1) {
        if needed[id.at()] {
            printer.print(id, uses[id.at()]);
        }
    }
    let result = printer.texts.remove(&root);
    let text = result.map_or_else(|| "0".to_owned(), |(text, _)| text);
    (printer.body, text)
}

/// Returns the nodes that the sides of a guard are made of, which precede the guarded node.
fn side_arguments(graph: &ScalarGraph, guard: &Guard) -> Vec<ScalarId> {
    let mut found = Vec::new();
    for side in guard.sides {
        match *graph.node(side) {
            ScalarNode::Constant(_) => {}
            ScalarNode::Unary(F::Abs, u) => found.push(u),
            _ => found.push(side),
        }
    }
    found
}

/// Returns a number that reads back to identical bits.
fn number(c: f64) -> String {
    let size = c.abs();
    let text = if c == 0.0 || (1e-5..1e15).contains(&size) {
        format!("{c}")
    } else {
        format!("{c:e}")
    };
    match c < 0.0 {
        true => format!("({text})"),
        false => text,
    }
}

impl Printer<'_> {
    /// Returns the text of a printed node or a constant.
    fn text(&self, id: ScalarId) -> &str {
        self.texts.get(&id).map_or("0", |(text, _)| text)
    }

    fn depth(&self, id: ScalarId) -> u32 {
        self.texts.get(&id).map_or(0, |(_, depth)| *depth)
    }

    /// Returns the text of a side of a guard.
    fn side(&self, id: ScalarId) -> String {
        match *self.graph.node(id) {
            ScalarNode::Constant(bits) => number(f64::from_bits(bits)),
            ScalarNode::Unary(F::Abs, u) => format!("abs({})", self.text(u)),
            _ => self.text(id).to_owned(),
        }
    }

    /// Returns the name of a new variable for a node.
    fn variable(&mut self, id: ScalarId) -> String {
        self.variables += 1;
        let name = self.names.get(&id).map_or("t", String::as_str);
        format!("{name}_{}", self.variables)
    }

    /// Prints a node that is used so often.
    fn print(&mut self, id: ScalarId, uses: u32) {
        if let Some(guard) = self.guards.get(&id) {
            let (below, above) = match self.graph.node(id) {
                ScalarNode::Constant(_) => ("0".to_owned(), "0".to_owned()),
                _ if guard.is_defined_below => (self.expression(id), "0".to_owned()),
                _ => ("0".to_owned(), self.expression(id)),
            };
            let sides = guard.sides.map(|side| self.side(side));
            return self.branch(id, &sides, &below, &above);
        }
        if let ScalarNode::Choice([a, b, then, otherwise]) = *self.graph.node(id) {
            let sides = [a, b].map(|side| self.text(side).to_owned());
            let (then, otherwise) = (self.text(then).to_owned(), self.text(otherwise).to_owned());
            return self.branch(id, &sides, &then, &otherwise);
        }
        let text = self.expression(id);
        let mut depth = 0;
        self.graph
            .node(id)
            .for_arguments(|u| depth = depth.max(self.depth(u) + 1));
        let is_leaf = depth == 0;
        if is_leaf || (uses < 2 && depth < MAX_DEPTH && !self.names.contains_key(&id)) {
            self.texts.insert(id, (text, depth));
            return;
        }
        let variable = self.variable(id);
        let _ = writeln!(self.body, "  {variable} = {};", inner(&text));
        self.texts.insert(id, (variable, 0));
    }

    /// Prints a branch that assigns one of two values to a variable.
    fn branch(&mut self, id: ScalarId, sides: &[String; 2], then: &str, otherwise: &str) {
        let variable = self.variable(id);
        let _ = writeln!(
            self.body,
            "  if {} < {} then {variable} = {}; else {variable} = {}; endif;",
            sides[0],
            sides[1],
            inner(then),
            inner(otherwise)
        );
        self.texts.insert(id, (variable, 0));
    }

    /// Returns the expression of a node, in parentheses where it is a sum or product.
    fn expression(&self, id: ScalarId) -> String {
        match *self.graph.node(id) {
            ScalarNode::Constant(bits) => number(f64::from_bits(bits)),
            ScalarNode::Coordinate(i) => format!("x[{}]", i + 1),
            ScalarNode::Unary(f, u) => format!("{}({})", function_name(f), inner(self.text(u))),
            ScalarNode::Binary(f, u, v) => self.operation(f, u, v),
            ScalarNode::Choice(_) => unreachable!("choices are branches"),
        }
    }

    /// Returns the expression of a function of two arguments.
    fn operation(&self, f: O, u: ScalarId, v: ScalarId) -> String {
        if let Some((operator, [a, b])) = self.set_operation(f, u, v) {
            return format!("({} {operator} {})", self.text(a), self.text(b));
        }
        let (a, b) = (self.text(u), self.text(v));
        match f {
            O::Add => format!("({a} + {b})"),
            O::Sub if self.graph.value(u) == Some(0.0) => format!("(-{b})"),
            O::Sub => format!("({a} - {b})"),
            O::Mul => format!("({a} * {b})"),
            O::Div => format!("({a} / {b})"),
            O::Pow => {
                // HyperFun rounds exponents that are close to integers from above.
                let exponent = self.graph.value(v);
                let is_rounded = |c: f64| c > c.floor() && c - c.floor() <= EXPONENT_TOLERANCE;
                if exponent.is_some_and(is_rounded) {
                    format!("exp({b} * log({a}))")
                } else {
                    format!("({a} ^ {b})")
                }
            }
            O::Atan2 => format!("atan2({}, {})", inner(a), inner(b)),
            O::Min => format!("min({}, {})", inner(a), inner(b)),
            O::Max => format!("max({}, {})", inner(a), inner(b)),
        }
    }
}

impl Printer<'_> {
    /// Returns the operator of HyperFun and its operands if u ± v is a + b ± √(a² + b²): a union or
    /// an intersection, whose sides stay parts of the model.
    fn set_operation(
        &self,
        f: O,
        u: ScalarId,
        v: ScalarId,
    ) -> Option<(&'static str, [ScalarId; 2])> {
        let operator = match f {
            O::Add => "|",
            O::Sub => "&",
            _ => return None,
        };
        let ScalarNode::Binary(O::Add, a, b) = *self.graph.node(u) else {
            return None;
        };
        let ScalarNode::Unary(F::Sqrt, squares) = *self.graph.node(v) else {
            return None;
        };
        let ScalarNode::Binary(O::Add, p, q) = *self.graph.node(squares) else {
            return None;
        };
        let is_square =
            |of: ScalarId, w: ScalarId| *self.graph.node(of) == ScalarNode::Binary(O::Mul, w, w);
        (is_square(p, a) && is_square(q, b)).then_some((operator, [a, b]))
    }
}

/// Returns an expression without the parentheses that enclose all of it.
fn inner(text: &str) -> &str {
    let Some(bare) = text.strip_prefix('(').and_then(|t| t.strip_suffix(')')) else {
        return text;
    };
    let mut depth = 0_i32;
    for b in bare.bytes() {
        depth += match b {
            b'(' => 1,
            b')' => -1,
            _ => 0,
        };
        if depth < 0 {
            return text;
        }
    }
    bare
}

/// Returns the name of a function in HyperFun.
fn function_name(f: F) -> &'static str {
    match f {
        F::Abs => "abs",
        F::Sqrt => "sqrt",
        F::Exp => "exp",
        F::Ln => "log",
        F::Sin => "sin",
        F::Cos => "cos",
        F::Tan => "tan",
        F::Asin => "asin",
        F::Acos => "acos",
        F::Atan => "atan",
        F::Sinh => "sinh",
        F::Cosh => "cosh",
        F::Tanh => "tanh",
        F::Floor => "floor",
        F::Ceil => "ceil",
        F::Trunc => "int",
        F::Sign => "sign",
    }
}

#[cfg(test)]
mod tests {
    use super::inner;

    #[test]
    fn outer_parentheses_are_taken_off() {
        assert_eq!(inner("(a + b)"), "a + b");
        assert_eq!(inner("(a) + (b)"), "(a) + (b)");
        assert_eq!(inner("f(a)"), "f(a)");
    }
}
