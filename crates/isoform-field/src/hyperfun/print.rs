//! Output of programs as text: with fitted values, with new start values, or in a canonical layout.

use super::ast::{Argument, ArrayRef, Expr, HEAD_ARRAYS, Object, Statement};
use super::functions::{self, ArgumentShape, Function};
use super::lexer::{self, TokenKind};
use super::{DEFAULT_OBJECT, Program};
use crate::direct::Direct;
use std::fmt::Write;

/// Similarity transformation of a model: the model's point is p = Rᵀ(x − t)/scale. Values are not
/// rescaled.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// Rotation R, by rows.
    pub rotation: [[f64; 3]; 3],
    /// Translation t.
    pub translation: [f64; 3],
    /// Scale, not 0.
    pub scale: f64,
}

impl Placement {
    /// Returns the point p of the model that corresponds to a point x.
    pub fn framed(&self, x: [f64; 3]) -> [f64; 3] {
        let moved = std::array::from_fn(|i| x[i] - self.translation[i]);
        self.turned_back(moved).map(|v| v / self.scale)
    }

    /// Returns the direction Rᵀd of the model that corresponds to a direction d.
    pub fn turned_back(&self, d: [f64; 3]) -> [f64; 3] {
        let r = &self.rotation;
        std::array::from_fn(|j| (0..3).map(|i| r[i][j] * d[i]).sum())
    }
}

/// Formats a number such that it is read back exactly, in parentheses if it is negative.
fn operand(v: f64) -> String {
    if v < 0.0 {
        format!("({v:?})")
    } else {
        format!("{v:?}")
    }
}

/// Returns `name`, or `name` with a number appended if it is in use.
fn free_name(program: &Program, name: &str) -> String {
    let taken =
        |n: &str| functions::find(n).is_some() || program.objects.iter().any(|o| o.name == n);
    let numbered = (2..).map(|i| format!("{name}{i}"));
    std::iter::once(name.to_owned())
        .chain(numbered)
        .find(|n| !taken(n))
        .unwrap_or_default()
}

/// Returns the program's text followed by an object that is the chosen one with these values, moved
/// by the placement if it has three coordinates.
pub(super) fn fitted(
    program: &Program,
    object: usize,
    values: &[f64],
    placement: Option<&Placement>,
) -> String {
    let chosen = &program.objects[object];
    let has_default = program.objects.iter().any(|o| o.name == DEFAULT_OBJECT);
    let (name, template) = match has_default {
        true => {
            let template = free_name(program, &format!("{}_template", chosen.name));
            (chosen.name.clone(), template)
        }
        false => (DEFAULT_OBJECT.to_owned(), chosen.name.clone()),
    };
    let mut changes = match has_default {
        true => renamed(program, object, &template),
        false => Vec::new(),
    };
    changes.extend(located(program));
    // Defaults of the chosen object are replaced by its parameters, since the new object has
    // defaults of its own.
    let described = match chosen.defaults {
        Some(defaults) => {
            let array = &chosen.arrays[defaults.array.id as usize].name;
            let item = |i: usize| format!("{array}[{i}] = a[{i}]");
            let items: Vec<String> = (1..=chosen.n_params()).map(item).collect();
            changes.push((defaults.assigned, items.join("; ")));
            changes.push((
                (defaults.annotation, defaults.annotation + 1),
                String::new(),
            ));
            program.objects[defaults.of].name.clone()
        }
        None => template.clone(),
    };
    let mut text = changed(program.source.text(), changes);
    if !text.ends_with('\n') {
        text.push('\n');
    }
    let (b, p) = (free_name(program, "b"), free_name(program, "p"));
    let (n, placement) = (
        chosen.n_params(),
        placement.filter(|_| chosen.dimension() == 3),
    );
    let s = match chosen.has_s {
        true => format!(", s[{}]", chosen.n_s()),
        false => String::new(),
    };
    let about = match n {
        0 => "-- the template above as it was found".to_owned(),
        _ => format!(
            "-- the template above with the values that were found; they are the defaults of its \
             parameters\n-- @values {b} of {described}"
        ),
    };
    let _ = writeln!(
        text,
        "\n{about}\n{name}(x[{}], a[{}]{s})\n{{",
        chosen.dimension(),
        n.max(1)
    );
    let arrays = [
        (n > 0).then(|| format!("{b}[{n}]")),
        placement.map(|_| format!("{p}[3]")),
    ];
    let arrays: Vec<String> = arrays.into_iter().flatten().collect();
    if !arrays.is_empty() {
        let _ = writeln!(text, "  array {};", arrays.join(", "));
    }
    if let Some(at) = placement {
        text += &placed(&p, at);
    }
    if n > 0 {
        let value = |i: usize| format!("{:?}", values.get(i).copied().unwrap_or(0.0));
        let list: Vec<String> = (0..n).map(value).collect();
        let _ = writeln!(text, "  {b} = [{}];", list.join(", "));
    }
    let x = if placement.is_some() { p.as_str() } else { "x" };
    let a = if n > 0 { b.as_str() } else { "a" };
    let _ = writeln!(
        text,
        "  {name} = {template}({x}, {a}{});\n}}",
        if chosen.has_s { ", s" } else { "" }
    );
    text
}

/// Returns statements that assign to `p` the point of the placed model: p = Rᵀ (x − t) / scale.
fn placed(p: &str, at: &Placement) -> String {
    let mut text = String::new();
    for i in 0..3 {
        let term = |j: usize| {
            let (r, t) = (operand(at.rotation[j][i]), operand(at.translation[j]));
            format!("{r}*(x[{}] - {t})", j + 1)
        };
        let (terms, scale) = ([0, 1, 2].map(term).join(" + "), operand(at.scale));
        let _ = writeln!(text, "  {p}[{}] = ({terms})/{scale};", i + 1);
    }
    text
}

/// List of replacements of byte ranges of a text.
type TextReplacements = Vec<((u32, u32), String)>;

/// Applies the replacements to a text.
fn changed(text: &str, mut changes: TextReplacements) -> String {
    changes.sort();
    let mut out = String::with_capacity(text.len() + 32 * changes.len());
    let mut done = 0;
    for ((start, end), new) in changes {
        out.push_str(&text[done..start as usize]);
        out.push_str(&new);
        done = end as usize;
    }
    out.push_str(&text[done..]);
    out
}

/// Returns the replacements of names of files by the paths where they were found.
fn located(program: &Program) -> TextReplacements {
    let text = program.source.text();
    let tokens = lexer::tokens(&program.source).0.into_iter();
    let names = tokens.filter(|token| token.kind == TokenKind::Text);
    let changes = names.filter_map(|token| {
        let name = &text[token.start as usize + 1..token.end as usize - 1];
        let term = program.files.iter().find(|term| term.path == name)?;
        let found = term
            .found
            .as_ref()
            .filter(|path| !path.contains(['"', '\n']))?;
        Some(((token.start, token.end), format!("\"{found}\"")))
    });
    changes.collect()
}

/// Returns the replacements that rename an object: in its head, its result and its calls.
fn renamed(program: &Program, object: usize, new: &str) -> TextReplacements {
    let (chosen, text) = (&program.objects[object], program.source.text());
    let tokens = lexer::tokens(&program.source).0;
    let is_place = |pair: &&[lexer::Token]| {
        let word = &text[pair[0].start as usize..pair[0].end as usize];
        let is_name = pair[0].kind == TokenKind::Name && word.eq_ignore_ascii_case(&chosen.name);
        let is_called = pair[1].kind == TokenKind::Symbol("(");
        is_name && (is_called || pair[0].start == chosen.result_at)
    };
    let places = tokens.windows(2).filter(is_place);
    places
        .map(|pair| ((pair[0].start, pair[0].end), new.to_owned()))
        .collect()
}

/// Returns the program's text with these start values in the annotations of the parameters.
pub(super) fn with_start(program: &Program, object: usize, values: &[f64]) -> String {
    let start = |(i, v): (usize, &f64)| {
        let (start, end) = program.annotations.param(object, i)?.start?;
        let space = if start == end { " " } else { "" };
        Some(((start, end), format!("{space}start={v:?}")))
    };
    let changes = values.iter().enumerate().filter_map(start).collect();
    changed(program.source.text(), changes)
}

/// Returns the program in a canonical layout, without comments.
pub(super) fn pretty(program: &Program) -> String {
    let mut printer = Printer {
        program,
        out: String::new(),
        indent: 1,
    };
    for object in &program.objects {
        printer.object(object);
    }
    printer.out
}

/// Writer of a program in a canonical layout.
struct Printer<'p> {
    program: &'p Program,
    /// Text written so far.
    out: String,
    /// Nesting depth of the present block.
    indent: usize,
}

impl Printer<'_> {
    /// Writes a line at the present depth.
    fn line(&mut self, text: &str) {
        let _ = writeln!(self.out, "{:width$}{text}", "", width = 2 * self.indent);
    }

    /// Writes an object: its head, its arrays, its statements and its result.
    fn object(&mut self, object: &Object) {
        let s = if object.has_s {
            format!(", s[{}]", object.n_s())
        } else {
            String::new()
        };
        let _ = writeln!(
            self.out,
            "{}(x[{}], a[{}]{s})\n{{",
            object.name,
            object.dimension(),
            object.n_params()
        );
        let arrays: Vec<String> = object.arrays[HEAD_ARRAYS..]
            .iter()
            .map(|a| format!("{}[{}]", a.name, a.len))
            .collect();
        if !arrays.is_empty() {
            self.line(&format!("array {};", arrays.join(", ")));
        }
        self.block(object, &object.body);
        let result = self.expr(object, &object.result);
        self.line(&format!("{} = {result};", object.name));
        self.out.push_str("}\n");
    }

    /// Writes statements at the present depth.
    fn block(&mut self, object: &Object, statements: &[Statement]) {
        for statement in statements {
            match statement {
                Statement::Assign { slot, value } => {
                    let value = self.expr(object, value);
                    self.line(&format!("{} = {value};", object.variable(*slot)));
                }
                Statement::AssignItem {
                    array,
                    index,
                    value,
                } => {
                    let (index, value) = (self.expr(object, index), self.expr(object, value));
                    self.line(&format!("{}[{index}] = {value};", name(object, *array)));
                }
                Statement::AssignArray { array, values, .. } => {
                    let values: Vec<String> = values.iter().map(|v| format!("{v:?}")).collect();
                    self.line(&format!(
                        "{} = [{}];",
                        name(object, *array),
                        values.join(", ")
                    ));
                }
                Statement::If {
                    condition,
                    then,
                    otherwise,
                    ..
                } => {
                    let condition = self.expr(object, condition);
                    self.line(&format!("if {condition} then"));
                    self.branches(object, then, otherwise.as_deref());
                }
                Statement::While {
                    condition, body, ..
                } => {
                    let condition = self.expr(object, condition);
                    self.line(&format!("while {condition} loop"));
                    self.inner(object, body);
                    self.line("endloop;");
                }
            }
        }
    }
    /// Writes the branches of a conditional statement, after its condition.
    fn branches(&mut self, object: &Object, then: &[Statement], otherwise: Option<&[Statement]>) {
        self.inner(object, then);
        if let Some(otherwise) = otherwise {
            self.line("else");
            self.inner(object, otherwise);
        }
        self.line("endif;");
    }
    /// Writes statements one level deeper.
    fn inner(&mut self, object: &Object, statements: &[Statement]) {
        self.indent += 1;
        self.block(object, statements);
        self.indent -= 1;
    }

    /// Returns an expression as text.
    fn expr(&self, object: &Object, expr: &Expr) -> String {
        let mut text = String::new();
        self.write(object, expr, &mut text);
        text
    }

    /// Appends an expression.
    fn write(&self, object: &Object, expr: &Expr, out: &mut String) {
        match expr {
            Expr::Number { value, .. } => {
                let _ = write!(out, "{value:?}");
            }
            Expr::Variable { slot, .. } => out.push_str(object.variable(*slot)),
            Expr::Item { array, index, .. } => {
                let _ = write!(out, "{}[", name(object, *array));
                self.write(object, index, out);
                out.push(']');
            }
            Expr::Sign { sign, operand, .. } => {
                // Two dashes would begin a comment.
                out.push_str(if out.ends_with('-') { " " } else { "" });
                out.push_str(sign);
                self.write(object, operand, out);
            }
            Expr::Not { operand, .. } => {
                out.push_str("not ");
                self.write(object, operand, out);
            }
            Expr::Group { inner, .. } => {
                out.push('(');
                self.write(object, inner, out);
                out.push(')');
            }
            Expr::Chain { first, rest } => {
                self.write(object, first, out);
                for link in rest {
                    let _ = write!(out, " {} ", link.operator.text());
                    self.write(object, &link.operand, out);
                }
            }
            Expr::Function {
                function,
                arguments,
                ..
            } => {
                let row = functions::entry(*function);
                self.write_function(object, row, arguments, out);
            }
            Expr::Call {
                object: called,
                arguments,
                ..
            } => {
                let called = &self.program.objects[*called as usize].name;
                let names = arguments.iter().map(|(_, array)| name(object, *array));
                let names: Vec<&str> = names.collect();
                let _ = write!(out, "{called}({})", names.join(", "));
            }
        }
    }

    /// Appends a call of a library function.
    fn write_function(
        &self,
        object: &Object,
        row: &Function<Direct<f64>>,
        arguments: &[Argument],
        out: &mut String,
    ) {
        let _ = write!(out, "{}(", row.names[0]);
        for (i, argument) in arguments.iter().enumerate() {
            out.push_str(if i > 0 { ", " } else { "" });
            match argument {
                Argument::Number(Expr::Number { value, .. })
                    if row.arguments[i].1 == ArgumentShape::File =>
                {
                    let _ = write!(out, "\"{}\"", self.program.files[*value as usize].path);
                }
                Argument::Number(expr) => self.write(object, expr, out),
                Argument::Array(_, array) => out.push_str(name(object, *array)),
            }
        }
        out.push(')');
    }
}

/// Returns the name of an array.
fn name(object: &Object, array: ArrayRef) -> &str {
    &object.arrays[array.id as usize].name
}
