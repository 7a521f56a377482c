//! Detection of the parameters that an object uses.

use super::ast::{Argument, ArrayRef, Expr, Object, Statement};

/// Index of the parameters among the arrays of an object.
const PARAMETER_ARRAY: u32 = 1;

impl Expr {
    /// Calls `f` for the expression and all of its subexpressions.
    fn walk(&self, f: &mut impl FnMut(&Self)) {
        f(self);
        match self {
            Self::Number { .. } | Self::Variable { .. } | Self::Call { .. } => {}
            Self::Item { index: inner, .. }
            | Self::Sign { operand: inner, .. }
            | Self::Not { operand: inner, .. }
            | Self::Group { inner, .. } => inner.walk(f),
            Self::Chain { first, rest } => {
                first.walk(f);
                rest.iter().for_each(|link| link.operand.walk(f));
            }
            Self::Function { arguments, .. } => {
                for argument in arguments {
                    if let Argument::Number(number) = argument {
                        number.walk(f);
                    }
                }
            }
        }
    }
}

impl Statement {
    /// Calls `f` for all expressions of the statement.
    fn walk(&self, f: &mut impl FnMut(&Expr)) {
        match self {
            Self::Assign { value, .. } => value.walk(f),
            Self::AssignItem { index, value, .. } => {
                index.walk(f);
                value.walk(f);
            }
            Self::AssignArray { .. } => {}
            Self::If {
                condition,
                then,
                otherwise,
                ..
            } => {
                condition.walk(f);
                let statements = then.iter().chain(otherwise.iter().flatten());
                statements.for_each(|statement| statement.walk(f));
            }
            Self::While {
                condition, body, ..
            } => {
                condition.walk(f);
                body.iter().for_each(|statement| statement.walk(f));
            }
        }
    }
}

/// Returns, by parameter of the object `last`, true if the object uses it in any branch. Objects
/// call only those above them.
pub(super) fn parameters(objects: &[Object], last: usize) -> Vec<bool> {
    let mut uses: Vec<Vec<bool>> = Vec::with_capacity(last + 1);
    for (k, object) in objects[..=last].iter().enumerate() {
        let mut used = vec![false; object.n_params()];
        let defaults = object.defaults.filter(|_| k == last);
        let is_a = |array: &ArrayRef| {
            array.id == PARAMETER_ARRAY || defaults.is_some_and(|d| d.array == *array)
        };
        let mut see = |expr: &Expr| match expr {
            Expr::Item { array, index, .. } if is_a(array) => match **index {
                Expr::Number { value, .. } => {
                    if let Some(used) = used.get_mut(item(value).wrapping_sub(1)) {
                        *used = true;
                    }
                }
                _ => used.fill(true),
            },
            Expr::Function { arguments, .. } => {
                let has_a = |argument: &Argument| matches!(argument, Argument::Array(_, array) if is_a(array));
                if arguments.iter().any(has_a) {
                    used.fill(true);
                }
            }
            Expr::Call {
                object: called,
                arguments,
                ..
            } => {
                for (place, (_, array)) in arguments.iter().enumerate() {
                    if !is_a(array) {
                        continue;
                    }
                    let theirs = &uses[*called as usize];
                    for (i, used) in used.iter_mut().enumerate() {
                        *used |= place as u32 != PARAMETER_ARRAY || theirs[i];
                    }
                }
            }
            _ => {}
        };
        for statement in &object.body {
            statement.walk(&mut see);
        }
        object.result.walk(&mut see);
        uses.push(used);
    }
    uses.pop().unwrap_or_default()
}

/// Rounds an index to the nearest integer, halves up; items count from 1.
fn item(index: f64) -> usize {
    (index + 0.5).floor() as usize
}
