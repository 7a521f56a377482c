//! Warnings of sums and differences of solids in place of unions and set differences.
//!
//! `body - hole` subtracts values: its zero set is unrelated to both surfaces. An expression is a
//! solid here if it is a primitive of the library, a set operation, a minimum or maximum of solids,
//! or one of these offset by a number, as in `body - 0.1`. A sum of two solids is reported only if
//! it is used as a solid: as the result, or in a set operation. Sums with other functions of space,
//! as in `u + v + sqrt(u^2 + v^2)`, products, as in `t*u + (1 - t)*v`, and sums inside a root, a
//! power, an absolute value or a comparison are taken to be intended.

use super::ast::{Argument, Expr, Link, Object, Operator, Statement};
use super::functions::{self, Implementation};
use super::source::{Source, Warning};
use std::collections::BTreeMap;

/// The kind of an expression.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ExprKind {
    /// Constant in space.
    Number,
    /// A function of space.
    Field,
    /// A function that is positive inside of a solid.
    Solid,
    /// A sum of solids, with the place and the text of its operator.
    Sum(u32, &'static str),
}

impl ExprKind {
    /// Returns the kind of a value that either of two branches assigned.
    fn or(self, other: Self) -> Self {
        match (self, other) {
            (a, b) if a == b => a,
            (sum @ Self::Sum(..), _) | (_, sum @ Self::Sum(..)) => sum,
            _ => Self::Field,
        }
    }
}

/// Warns of sums of solids that are used as solids.
pub(super) fn warn(source: &Source, objects: &[Object], warnings: &mut Vec<Warning>) {
    let mut results: Vec<ExprKind> = Vec::with_capacity(objects.len());
    let mut called = vec![false; objects.len()];
    let mut found: Vec<(u32, &'static str)> = Vec::new();
    for object in objects {
        let mut reader = SumAnalysis {
            results: &results,
            called: &mut called,
            variables: BTreeMap::new(),
            arrays: BTreeMap::new(),
            found: &mut found,
            is_in_loop: false,
        };
        reader.block(&object.body);
        let result = reader.kind(&object.result);
        results.push(result);
    }
    for (result, _) in results.iter().zip(&called).filter(|(_, called)| !**called) {
        if let ExprKind::Sum(at, operator) = result {
            found.push((*at, operator));
        }
    }
    found.sort_unstable();
    found.dedup();
    for (at, operator) in found {
        let (line, column) = source.position(at);
        let message = match operator {
            "+" => "`+` adds the numbers of two solids: their union is `u | v`",
            _ => {
                "`-` subtracts the numbers of two solids: the difference of solids is `u \\ v`, a \
                 backslash, and their union `u | v`"
            }
        };
        warnings.push(Warning {
            line,
            column,
            message: message.to_owned(),
        });
    }
}

/// Analysis of the statements of an object, in their order.
struct SumAnalysis<'a> {
    /// Kinds of the objects above.
    results: &'a [ExprKind],
    /// True for objects that others call.
    called: &'a mut [bool],
    /// Kinds of the variables, by slot.
    variables: BTreeMap<u32, ExprKind>,
    /// Common kind of the items of each array.
    arrays: BTreeMap<u32, ExprKind>,
    /// Sums that were used as solids.
    found: &'a mut Vec<(u32, &'static str)>,
    /// True within the body of a loop.
    is_in_loop: bool,
}

impl SumAnalysis<'_> {
    fn block(&mut self, statements: &[Statement]) {
        for statement in statements {
            self.statement(statement);
        }
    }

    fn statement(&mut self, statement: &Statement) {
        match statement {
            Statement::Assign { slot, value } => {
                let kind = self.kind(value);
                self.variables.insert(*slot, kind);
            }
            Statement::AssignItem { array, value, .. } => {
                let kind = self.kind(value);
                let before = self.arrays.get(&array.id).copied();
                let kind = before.map_or(kind, |before| before.or(kind));
                self.arrays.insert(array.id, kind);
            }
            Statement::AssignArray { .. } => {}
            Statement::If {
                condition,
                then,
                otherwise,
                ..
            } => {
                self.kind(condition);
                let before = self.variables.clone();
                self.block(then);
                let after_then = std::mem::replace(&mut self.variables, before);
                self.block(otherwise.as_deref().unwrap_or(&[]));
                for (slot, kind) in after_then {
                    let other = self.variables.get(&slot).copied();
                    self.variables
                        .insert(slot, other.map_or(kind, |other| other.or(kind)));
                }
            }
            // A sum accumulated by a loop appears in the second pass; inner loops are covered by
            // both passes of the outer one.
            Statement::While {
                condition, body, ..
            } => {
                self.kind(condition);
                let is_outermost = !std::mem::replace(&mut self.is_in_loop, true);
                self.block(body);
                if is_outermost {
                    self.block(body);
                    self.is_in_loop = false;
                }
            }
        }
    }

    /// Records an expression of this kind that is used as a solid.
    fn used_as_solid(&mut self, kind: ExprKind) {
        if let ExprKind::Sum(at, operator) = kind {
            self.found.push((at, operator));
        }
    }

    fn kind(&mut self, expr: &Expr) -> ExprKind {
        match expr {
            Expr::Number { .. } => ExprKind::Number,
            Expr::Variable { slot, .. } => *self.variables.get(slot).unwrap_or(&ExprKind::Field),
            Expr::Item { array, index, .. } => {
                self.kind(index);
                match array.id {
                    0 => ExprKind::Field,
                    1 => ExprKind::Number,
                    id => *self.arrays.get(&id).unwrap_or(&ExprKind::Number),
                }
            }
            Expr::Group { inner, .. } => self.kind(inner),
            Expr::Sign { sign, operand, .. } => {
                let kind = self.kind(operand);
                if *sign == "~" {
                    self.used_as_solid(kind);
                    return ExprKind::Solid;
                }
                kind
            }
            Expr::Not { operand, .. } => {
                self.kind(operand);
                ExprKind::Field
            }
            Expr::Chain { first, rest } => self.chain(first, rest),
            Expr::Function {
                function,
                arguments,
                ..
            } => self.function(*function, arguments),
            Expr::Call { object, .. } => {
                self.called[*object as usize] = true;
                self.results[*object as usize]
            }
        }
    }

    fn function(&mut self, function: u16, arguments: &[Argument]) -> ExprKind {
        let mut kinds = Vec::with_capacity(arguments.len());
        for argument in arguments {
            kinds.push(match argument {
                Argument::Number(number) => self.kind(number),
                Argument::Array(..) => ExprKind::Field,
            });
        }
        let is_sum = |kind: &&ExprKind| matches!(kind, ExprKind::Sum(..));
        let row = functions::entry(function);
        let is_solid = matches!(row.run, Implementation::Primitive(..)) || row.reads_file();
        if is_solid || row.names[0] == "hfDSub" {
            kinds.iter().for_each(|kind| self.used_as_solid(*kind));
            return ExprKind::Solid;
        }
        let all = |kind: ExprKind| kinds.iter().all(|k| *k == kind);
        match row.names[0] {
            // max(u - v, 0) is part of a formula.
            "min" | "max" if !kinds.contains(&ExprKind::Number) => {
                match kinds.iter().find(is_sum) {
                    Some(sum) => *sum,
                    None if kinds.contains(&ExprKind::Solid) => ExprKind::Solid,
                    None => ExprKind::Field,
                }
            }
            _ if all(ExprKind::Number) => ExprKind::Number,
            _ => ExprKind::Field,
        }
    }

    fn chain(&mut self, first: &Expr, rest: &[Link]) -> ExprKind {
        let mut left = self.kind(first);
        // Number of solids added since the last set operation.
        let mut solids = usize::from(matches!(left, ExprKind::Solid | ExprKind::Sum(..)));
        for link in rest {
            let right = self.kind(&link.operand);
            left = match link.operator {
                Operator::Add | Operator::Subtract => {
                    solids += usize::from(matches!(right, ExprKind::Solid | ExprKind::Sum(..)));
                    match (left, right) {
                        (ExprKind::Field, _) | (_, ExprKind::Field) => ExprKind::Field,
                        (ExprKind::Number, ExprKind::Number) => ExprKind::Number,
                        (sum @ ExprKind::Sum(..), _) => sum,
                        (ExprKind::Number, sum @ ExprKind::Sum(..)) => sum,
                        _ if solids > 1 => ExprKind::Sum(link.at, link.operator.text()),
                        _ => ExprKind::Solid,
                    }
                }
                _ if link.operator.is_set_operator() => {
                    self.used_as_solid(left);
                    self.used_as_solid(right);
                    solids = 1;
                    ExprKind::Solid
                }
                _ if (left, right) == (ExprKind::Number, ExprKind::Number) => ExprKind::Number,
                _ => ExprKind::Field,
            };
        }
        left
    }
}
