//! The HyperFun language: programs that define f ≥ 0 inside (Adzhiev, Cartwright, Fausett, Ossipov,
//! Pasko, Savchenko: HyperFun project: a framework for collaborative multidimensional F-rep
//! modeling, 1999). docs/hyperfun.md describes the accepted language and its differences from the
//! documentation and the reference implementation.
//!
//! ```
//! use isoform_field::hyperfun::{Mode, Model};
//!
//! let ball = "my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, a[1]); }";
//! let model = Model::parse(ball, Mode::Default)?;
//! assert_eq!(model.eval(&[1.0, 0.0, 0.0], &[2.0], &[])?.f, 3.0);
//!
//! let mut graph = isoform_field::Graph::new();
//! let root = model.compile(&mut graph)?;
//! assert_eq!(graph.eval(root, &[1.0, 0.0, 0.0], &[2.0]), 3.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod annotations;
mod ast;
mod execute;
mod files;
mod formula;
mod functions;
mod lexer;
mod machine;
mod parser;
mod placed;
mod print;
mod source;
mod sums;
mod uses;

pub use annotations::{Amount, FileInfo, Fixed, ParamInfo, Pose, QuantityKind, Tie};
pub use files::{FileKind, FileTerm};
pub use functions::{FunctionHelp, library};
pub use print::Placement;
pub use source::{SyntaxError, Warning};

use crate::direct::Direct;
use crate::graph::{Graph, NodeId};
use crate::imported::Imported;
use annotations::Annotations;
use ast::Object;
use execute::{Executor, RunStop};
use isoform_num::Real;
use machine::Symbolic;
pub(crate) use machine::TRUTH_TOLERANCE;
use parser::Parsed;
use source::Source;
use std::fmt;

/// Maximum nesting depth of expressions, statements and calls of objects together. The executor
/// recurses to this depth, which fits into 2 MiB of stack and far exceeds what programs need.
pub(crate) const MAX_NESTING_DEPTH: u32 = 200;

/// Maximum number of items in all arrays of a program: 16 MB of memory per evaluation.
pub(crate) const MAX_ARRAY_ITEMS: u64 = 1_000_000;

/// Maximum length of a program, in bytes.
const MAX_SOURCE_LENGTH: usize = 1 << 26;

/// Default limit on the steps (operations and statements) of an evaluation, or of the construction
/// of an expression ([`Model::set_step_limit`]). An evaluation reaches it in less than a second, a
/// construction in a few seconds; a primitive takes one to five hundred steps.
pub const STEP_LIMIT: u64 = 50_000_000;

/// Maximum number of nodes of an expression, about 2 GB of memory, beyond which compilation is
/// aborted. A primitive has about ten nodes; an endless loop creates nodes until memory is
/// exhausted.
pub(crate) const MAX_EXPRESSION_NODES: usize = 12_000_000;

/// Name of the object that is evaluated by default.
pub const DEFAULT_OBJECT: &str = "my_model";

/// Interpretation of programs where the reference implementation contradicts its documentation or
/// is unreasonable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// The documented, useful meaning.
    #[default]
    Default,
    /// The results of the reference implementation.
    Strict,
}

/// Precedence of set operators.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precedence {
    /// Equal to that of + and −, from left to right, as in the reference implementation, for which
    /// existing models were written.
    #[default]
    Flat,
    /// Lower than that of + and −, as documented.
    Documented,
}

/// A checked program.
#[derive(Clone, Debug)]
pub(crate) struct Program {
    pub(crate) source: Source,
    pub(crate) objects: Vec<Object>,
    /// Files whose functions are terms of the program.
    pub(crate) files: Vec<FileTerm>,
    pub(crate) mode: Mode,
    pub(crate) annotations: Annotations,
}

/// A program and the object of it that is the model.
///
/// ```
/// use isoform_field::{Graph, hyperfun::{Mode, Model}};
/// let text = "-- @param a[1] radius length start=2
/// my_model(x[3], a[1]) { my_model = a[1]^2 - x[1]^2 - x[2]^2 - x[3]^2; }";
/// let ball = Model::parse(text, Mode::Default)?;
/// assert_eq!((ball.dimension(), ball.params()[0].name.as_str()), (3, "radius"));
/// // Run statement by statement, and as an expression.
/// assert_eq!(ball.eval(&[1.0, 1.0, 1.0], &[2.0], &[]).map(|e| e.f), Ok(1.0));
/// let mut graph = Graph::new();
/// let root = ball.compile(&mut graph).expect("no loop depends on the point");
/// assert_eq!(graph.eval(root, &[1.0, 1.0, 1.0], &[2.0]), 1.0);
/// // Errors have a place.
/// let error = Model::parse("my_model(x[3], a[1]) { my_model = ; }", Mode::Default);
/// assert_eq!(error.map_err(|e| (e.line, e.column)).err(), Some((1, 35)));
/// # Ok::<(), isoform_field::hyperfun::SyntaxError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Model {
    program: Program,
    object: usize,
    params: Vec<ParamInfo>,
    warnings: Vec<Warning>,
    step_limit: u64,
}

/// f and the attributes s at a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluation {
    /// The value; inside is f ≥ 0.
    pub f: f64,
    /// The attributes after the evaluation; empty where the object declares none.
    pub s: Vec<f64>,
}

/// Error of an evaluation. Lines and columns count from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunError {
    /// Line number.
    pub line: usize,
    /// Column number, in characters.
    pub column: usize,
    /// Description of the error.
    pub message: String,
}

/// Obstacle to compiling a program into an expression; the program must be run statement by
/// statement.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotCompilable {
    /// Line number.
    pub line: usize,
    /// Column number, in characters.
    pub column: usize,
    /// Description of the obstacle.
    pub why: String,
    /// True if runs end there as well, at every point: the program itself is in error.
    pub fails: bool,
}

/// Word or operator of a program with its position. Lines and columns count from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceToken {
    /// Line number.
    pub line: usize,
    /// Column number, in characters.
    pub column: usize,
    /// The word or the operator.
    pub text: String,
}

/// Error: the program does not contain the requested object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownObject {
    /// Requested name.
    pub name: String,
    /// Names of the existing objects.
    pub objects: Vec<String>,
}

impl fmt::Display for RunError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.line, self.column, self.message)
    }
}
impl std::error::Error for RunError {}

impl fmt::Display for NotCompilable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.line, self.column, self.why)
    }
}
impl std::error::Error for NotCompilable {}

impl fmt::Display for UnknownObject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "no object `{}`; there are {}",
            self.name,
            self.objects.join(", ")
        )
    }
}
impl std::error::Error for UnknownObject {}

impl Model {
    /// Reads and checks a program. The model is its object `my_model`, else its first one;
    /// [`Model::object`] chooses another.
    pub fn parse(text: &str, mode: Mode) -> Result<Self, SyntaxError> {
        Self::parse_with(text, mode, Precedence::Flat)
    }
    /// Reads and checks a program as [`Model::parse`] does, with a given precedence of set
    /// operators.
    pub fn parse_with(text: &str, mode: Mode, precedence: Precedence) -> Result<Self, SyntaxError> {
        if text.len() > MAX_SOURCE_LENGTH {
            return Err(Source::new("").error(
                0,
                format!("the program is longer than {MAX_SOURCE_LENGTH} bytes"),
                "",
            ));
        }
        let source = Source::new(text);
        let (tokens, comments) = lexer::tokens(&source);
        let Parsed {
            mut objects,
            files,
            mut warnings,
        } = parser::parse(&source, (&tokens, &comments), mode, precedence)?;
        sums::warn(&source, &objects, &mut warnings);
        let annotations = annotations::read(&source, &mut objects, &comments, &mut warnings)?;
        let object = objects
            .iter()
            .position(|o| o.name == DEFAULT_OBJECT)
            .unwrap_or(0);
        let mut model = Self {
            program: Program {
                source,
                objects,
                files,
                mode,
                annotations,
            },
            object,
            params: Vec::new(),
            warnings,
            step_limit: STEP_LIMIT,
        };
        model.choose(object);
        Ok(model)
    }

    /// Selects another object of the program as the model, by its name in upper or lower case;
    /// `None` keeps the present one.
    pub fn object(mut self, name: Option<&str>) -> Result<Self, UnknownObject> {
        let Some(name) = name else { return Ok(self) };
        let Some(object) = self
            .program
            .objects
            .iter()
            .position(|o| o.name.eq_ignore_ascii_case(name))
        else {
            return Err(UnknownObject {
                name: name.to_owned(),
                objects: self.objects().map(str::to_owned).collect(),
            });
        };
        self.choose(object);
        Ok(self)
    }
    fn choose(&mut self, object: usize) {
        self.object = object;
        self.params = self
            .program
            .annotations
            .params(object, self.chosen().n_params());
    }
    fn chosen(&self) -> &Object {
        &self.program.objects[self.object]
    }

    /// Sets the number of steps (operations and statements) after which evaluations, and the
    /// construction of expressions, are stopped.
    pub fn set_step_limit(&mut self, steps: u64) {
        self.step_limit = steps;
    }
    /// Returns the text of the program.
    pub fn source(&self) -> &str {
        self.program.source.text()
    }
    /// Returns the text of a line (from 1), for messages.
    pub fn line(&self, line: usize) -> &str {
        self.program.source.line(line)
    }
    /// Returns the names of all objects, lower case, in their order.
    pub fn objects(&self) -> impl Iterator<Item = &str> {
        self.program.objects.iter().map(|o| o.name.as_str())
    }
    /// Returns the name of the model's object, lower case.
    pub fn name(&self) -> &str {
        &self.chosen().name
    }
    /// Returns the number of coordinates.
    pub fn dimension(&self) -> usize {
        self.chosen().dimension()
    }
    /// Returns the number of parameters a\[i\].
    pub fn n_params(&self) -> usize {
        self.chosen().n_params()
    }
    /// Returns the number of attributes s\[i\]; 0 where the object declares none.
    pub fn n_attributes(&self) -> usize {
        if self.chosen().has_s {
            self.chosen().n_s()
        } else {
            0
        }
    }
    /// Returns the annotations of each parameter.
    pub fn params(&self) -> &[ParamInfo] {
        &self.params
    }
    /// Returns, by parameter, true if the model's object, or an object that it calls, uses it
    /// anywhere.
    pub(crate) fn used_params(&self) -> Vec<bool> {
        uses::parameters(&self.program.objects, self.object)
    }
    /// Returns the annotations of the whole program.
    pub fn info(&self) -> &FileInfo {
        &self.program.annotations.file
    }
    /// Returns the files whose functions are terms of the program. Where the program calls one, it
    /// fails until [`Model::set_file`] has provided its function.
    pub fn files(&self) -> &[FileTerm] {
        &self.program.files
    }
    /// Sets the function of a file, and the absolute path where it was found, if there is one.
    ///
    /// # Panics
    /// If there are fewer files.
    pub fn set_file(&mut self, file: usize, function: Imported, found: Option<String>) {
        let term = &mut self.program.files[file];
        (term.function, term.found) = (Some(function), found);
    }
    /// Returns warnings of constructs that are legal but probably unintended.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Creates an evaluator with its own memory, for many points.
    pub fn evaluator<R: Real + 'static>(&self) -> Evaluator<'_, R> {
        let s = vec![R::constant(0.0); self.chosen().n_s()];
        Evaluator {
            model: self,
            executor: Executor::new(&self.program, Direct::new(), self.step_limit),
            s,
        }
    }

    /// Creates an evaluator of blocks of points, with its own memory.
    pub fn block_evaluator(&self) -> BlockEvaluator<'_> {
        let evaluator = |_| self.evaluator();
        BlockEvaluator {
            model: self,
            each: (0..BlockEvaluator::POINTS).map(evaluator).collect(),
        }
    }

    /// Converts the cause of a run's end into an error with its position in the program.
    fn run_error(&self, stop: RunStop) -> RunError {
        let (RunStop::Error { at, message } | RunStop::Unknown { at, why: message }) = stop;
        let (line, column) = self.program.source.position(at);
        RunError {
            line,
            column,
            message,
        }
    }

    /// Evaluates f and the attributes at `x`. Attributes start as `s`, missing ones as 0.
    ///
    /// # Panics
    /// If the length of `x` or `a` differs from the one in the object's head.
    pub fn eval(&self, x: &[f64], a: &[f64], s: &[f64]) -> Result<Evaluation, RunError> {
        let mut evaluator = self.evaluator();
        let f = evaluator.eval(x, a, s)?;
        Ok(Evaluation {
            f,
            s: evaluator.attributes().to_vec(),
        })
    }

    /// Evaluates f at `x` in any number type; run-time errors are detected by its values.
    ///
    /// # Panics
    /// If the length of `x` or `a` differs from the one in the object's head.
    pub fn eval_with<R: Real + 'static>(&self, x: &[R], a: &[R]) -> Result<R, RunError> {
        self.evaluator().eval(x, a, &[])
    }

    /// Builds f as an expression of x and a; attributes start as 0. The expression never fails:
    /// where the program would stop with an error, its value is NaN, or that of the formula if only
    /// the language forbids the argument.
    pub fn compile(&self, graph: &mut Graph) -> Result<NodeId, NotCompilable> {
        self.compile_with_places(graph).map(|(root, _)| root)
    }

    /// Builds f as [`Model::compile`] does, and returns the positions in the program of
    /// discontinuous nodes.
    pub(crate) fn compile_with_places(
        &self,
        graph: &mut Graph,
    ) -> Result<(NodeId, Vec<(NodeId, SourceToken)>), NotCompilable> {
        let (nx, na, ns) = (self.dimension(), self.n_params(), self.chosen().n_s());
        let x: Vec<NodeId> = (0..nx).map(|i| graph.x(i)).collect();
        let a: Vec<NodeId> = (0..na).map(|i| graph.param(i)).collect();
        let mut s = vec![crate::ops::Ops::constant(graph, 0.0); ns];
        let machine = Symbolic::new(std::mem::take(graph));
        let mut executor = Executor::new(&self.program, machine, self.step_limit);
        let result = executor.run(self.object, &x, &a, &mut s);
        let is_certain = executor.is_certain();
        let Symbolic {
            graph: made,
            places,
            ..
        } = executor.into_machine();
        *graph = made;
        let placed = |(id, at): (NodeId, u32)| (id, self.program.source.place(at));
        let result = result.map(|root| (root, places.into_iter().map(placed).collect()));
        result.map_err(|stop| {
            let fails = is_certain && matches!(*stop, RunStop::Error { .. });
            let (RunStop::Error { at, message: why } | RunStop::Unknown { at, why }) = *stop;
            let (line, column) = self.program.source.position(at);
            NotCompilable {
                line,
                column,
                why,
                fails,
            }
        })
    }

    /// Returns the program with fixed parameter values: its text, including the comments, and a
    /// further object that calls the model with `values` for a\[\] and, given a [`Placement`], with
    /// the point moved back. Names of files are the paths where they were found.
    ///
    /// The new object takes the model's name and the model becomes `NAME_template`; if the program
    /// has no `my_model`, the new object is `my_model` and nothing is renamed.
    pub fn print_fitted(&self, values: &[f64], placement: Option<&Placement>) -> String {
        print::fitted(&self.program, self.object, values, placement)
    }
    /// Returns the text with `start=` of each `@param` line set to the parameter's value.
    pub fn print_with_start(&self, values: &[f64]) -> String {
        print::with_start(&self.program, self.object, values)
    }
    /// Returns the program in a canonical layout, without comments.
    pub fn pretty(&self) -> String {
        print::pretty(&self.program)
    }
}

/// Evaluator of a model at many points.
pub struct Evaluator<'m, R: Real + 'static> {
    model: &'m Model,
    executor: Executor<'m, Direct<R>>,
    s: Vec<R>,
}

impl<R: Real + 'static> Evaluator<'_, R> {
    /// Evaluates f at `x`; attributes start as `s`, missing ones as 0, and are returned by
    /// [`Self::attributes`] afterwards.
    ///
    /// # Panics
    /// If the length of `x` or `a` differs from the one in the object's head.
    pub fn eval(&mut self, x: &[R], a: &[R], s: &[R]) -> Result<R, RunError> {
        assert_eq!(
            (x.len(), a.len()),
            (self.model.dimension(), self.model.n_params()),
            "sizes of x and a"
        );
        for (i, item) in self.s.iter_mut().enumerate() {
            *item = s.get(i).cloned().unwrap_or_else(|| R::constant(0.0));
        }
        self.executor
            .run(self.model.object, x, a, &mut self.s)
            .map_err(|stop| self.model.run_error(*stop))
    }
    /// Returns the attributes after the last evaluation; empty where the object declares none.
    pub fn attributes(&self) -> &[R] {
        &self.s[..self.model.n_attributes()]
    }
}

/// Evaluator of a model at many points, which runs each statement for a block of points before the
/// next statement.
///
/// A program of thousands of statements exceeds a processor's caches; run from beginning to end for
/// one point after another, it would be read from memory for each point.
///
/// ```
/// use isoform_field::hyperfun::{Mode, Model};
///
/// let text = "my_model(x[3], a[1]) { q = 1/x[1]; my_model = a[1] - q; }";
/// let model = Model::parse(text, Mode::Default)?;
/// let mut block = model.block_evaluator();
/// let found = block.eval(&[[1.0, 0.0, 0.0], [0.0; 3], [2.0, 0.0, 0.0]], &[3.0]);
/// let values: Vec<Option<f64>> = found.iter().map(|e| e.as_ref().ok().map(|e| e.f)).collect();
/// assert_eq!(values, [Some(2.0), None, Some(2.5)]);
/// # Ok::<(), isoform_field::hyperfun::SyntaxError>(())
/// ```
pub struct BlockEvaluator<'m> {
    model: &'m Model,
    /// One evaluator for each point of a block.
    each: Vec<Evaluator<'m, f64>>,
}

impl BlockEvaluator<'_> {
    /// Number of points of a block; their frames and a statement fit into a cache together.
    pub const POINTS: usize = 32;

    /// Evaluates f and the attributes at each of up to [`BlockEvaluator::POINTS`] points, as
    /// [`Evaluator::eval`] does; attributes start as 0.
    ///
    /// # Panics
    /// If there are more points, or if the length of a point or of `a` differs from the one in the
    /// object's head.
    pub fn eval<X: AsRef<[f64]>>(
        &mut self,
        points: &[X],
        a: &[f64],
    ) -> Vec<Result<Evaluation, RunError>> {
        let (model, object) = (self.model, self.model.object);
        let each = &mut self.each[..points.len()];
        for (evaluator, x) in each.iter_mut().zip(points) {
            let sizes = (x.as_ref().len(), a.len());
            assert_eq!(
                sizes,
                (model.dimension(), model.n_params()),
                "sizes of x and a"
            );
            evaluator.s.fill(0.0);
            evaluator
                .executor
                .begin(object, x.as_ref(), a, &evaluator.s);
        }
        let mut stopped: Vec<Option<Box<RunStop>>> = points.iter().map(|_| None).collect();
        for statement in 0..model.chosen().body.len() {
            for (evaluator, stopped) in each.iter_mut().zip(&mut stopped) {
                if stopped.is_none() {
                    *stopped = evaluator.executor.advance(object, statement).err();
                }
            }
        }
        let ends = each.iter_mut().zip(stopped);
        ends.map(|(evaluator, stopped)| match stopped {
            Some(stop) => Err(model.run_error(*stop)),
            None => evaluator.ended(),
        })
        .collect()
    }
}

impl Evaluator<'_, f64> {
    /// Returns the result of a run whose statements are finished.
    fn ended(&mut self) -> Result<Evaluation, RunError> {
        let f = self.executor.end(self.model.object, &mut self.s);
        f.map_err(|stop| self.model.run_error(*stop))
            .map(|f| Evaluation {
                f,
                s: self.attributes().to_vec(),
            })
    }
}

#[cfg(test)]
mod tests;
