//! The HyperFun language: programs that define f ≥ 0 inside (Adzhiev, Cartwright, Fausett, Ossipov,
//! Pasko, Savchenko: HyperFun project: a framework for collaborative multidimensional F-rep
//! modeling, 1999). What we read and how it differs from the documentation and from the reference
//! implementation stands in docs/hyperfun.md.
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

pub use annotations::{Amount, FileInfo, Fixed, Kind, ParamInfo, Pose, Tie};
pub use functions::{FunctionHelp, library};
pub use print::Placement;
pub use source::{SyntaxError, Warning};

use crate::graph::{Graph, NodeId};
use crate::ops::Direct;
use annotations::Annotations;
use ast::Object;
use execute::{Executor, Stop};
use isoform_num::Real;
pub(crate) use machine::EPS;
use machine::Symbolic;
use source::Source;
use std::fmt;

/// How deep expressions, statements and calls of objects may nest together. The executor recurses
/// as deep; this fits a thread with 2 MiB of stack, and is far more than programs need.
pub(crate) const MAX_DEPTH: u32 = 200;

/// How many items the arrays of a program may have in all: 16 MB of memory for an evaluation.
pub(crate) const MAX_ITEMS: u64 = 1_000_000;

/// The largest program.
const MAX_SOURCE: usize = 1 << 26;

/// Steps (operations and statements) after which an evaluation, or the construction of an
/// expression, is stopped, unless [`Model::set_step_limit`] says otherwise: less than a second, or
/// a few. A primitive takes one to five hundred.
pub const STEP_LIMIT: u64 = 50_000_000;

/// Nodes of an expression beyond which compiling is given up, some 2 GB of memory: a primitive has
/// some ten, a loop that does not end makes them as fast as the memory takes them.
pub(crate) const MOST_NODES: usize = 12_000_000;

/// The object that is evaluated when no other is named.
pub const DEFAULT_OBJECT: &str = "my_model";

/// Which meaning programs have where the reference implementation is at odds with its documentation
/// or with reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// What is documented and useful.
    #[default]
    Default,
    /// What the reference implementation computes.
    Strict,
}

/// How set operators bind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precedence {
    /// As + and −, from left to right: what the reference implementation does, with which models
    /// were made.
    #[default]
    Flat,
    /// Below + and −, as the documentation says.
    Documented,
}

/// A checked program.
#[derive(Clone, Debug)]
pub(crate) struct Program {
    pub(crate) source: Source,
    pub(crate) objects: Vec<Object>,
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

/// Why an evaluation failed. Lines and columns count from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunError {
    /// Line.
    pub line: usize,
    /// Column in characters.
    pub column: usize,
    /// What happened there.
    pub message: String,
}

/// Why a program is no expression: it must be run statement by statement.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotCompilable {
    /// Line.
    pub line: usize,
    /// Column in characters.
    pub column: usize,
    /// What stands in the way.
    pub why: String,
    /// True if a run would end there as well, at every point: the program is at fault.
    pub fails: bool,
}

/// A word or an operator of a program. Lines and columns count from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: usize,
    /// Column in characters.
    pub column: usize,
    /// The word or the operator.
    pub text: String,
}

/// There is no object of the name that was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownObject {
    /// The name.
    pub name: String,
    /// The objects that there are.
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
    /// [`Model::parse`] with a choice of how set operators bind.
    pub fn parse_with(text: &str, mode: Mode, precedence: Precedence) -> Result<Self, SyntaxError> {
        if text.len() > MAX_SOURCE {
            return Err(Source::new("").error(
                0,
                format!("the program is longer than {MAX_SOURCE} bytes"),
                "",
            ));
        }
        let source = Source::new(text);
        let (tokens, comments) = lexer::tokens(&source);
        let (mut objects, mut warnings) =
            parser::parse(&source, (&tokens, &comments), mode, precedence)?;
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

    /// The program with another of its objects as the model; letters fold. `None` leaves the
    /// choice as it is.
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

    /// Stops evaluations, and the construction of expressions, after so many steps (operations and
    /// statements).
    pub fn set_step_limit(&mut self, steps: u64) {
        self.step_limit = steps;
    }
    /// The text of the program.
    pub fn source(&self) -> &str {
        self.program.source.text()
    }
    /// The text of a line (from 1), for messages.
    pub fn line(&self, line: usize) -> &str {
        self.program.source.line(line)
    }
    /// The names of all objects, lower case, in their order.
    pub fn objects(&self) -> impl Iterator<Item = &str> {
        self.program.objects.iter().map(|o| o.name.as_str())
    }
    /// The name of the model's object, lower case.
    pub fn name(&self) -> &str {
        &self.chosen().name
    }
    /// Number of coordinates.
    pub fn dimension(&self) -> usize {
        self.chosen().dimension()
    }
    /// Number of parameters a\[i\].
    pub fn n_params(&self) -> usize {
        self.chosen().n_params()
    }
    /// Number of attributes s\[i\]; 0 where the object declares none.
    pub fn n_attributes(&self) -> usize {
        if self.chosen().has_s {
            self.chosen().n_s()
        } else {
            0
        }
    }
    /// What the annotations say of each parameter.
    pub fn params(&self) -> &[ParamInfo] {
        &self.params
    }
    /// By parameter, whether the model's program, or an object that it calls, has it anywhere.
    pub(crate) fn used_params(&self) -> Vec<bool> {
        uses::parameters(&self.program.objects, self.object)
    }
    /// What the annotations say of the program.
    pub fn info(&self) -> &FileInfo {
        &self.program.annotations.file
    }
    /// What is legal but probably not meant.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// An evaluator with its own memory, for many points.
    pub fn evaluator<R: Real + 'static>(&self) -> Evaluator<'_, R> {
        let s = vec![R::constant(0.0); self.chosen().n_s()];
        Evaluator {
            model: self,
            executor: Executor::new(&self.program, Direct::new(), self.step_limit),
            s,
        }
    }

    /// An evaluator of blocks of points, with its own memory.
    pub fn block_evaluator(&self) -> BlockEvaluator<'_> {
        let evaluator = |_| self.evaluator();
        BlockEvaluator {
            model: self,
            each: (0..BlockEvaluator::POINTS).map(evaluator).collect(),
        }
    }

    /// Why a run ended, with its place in the program.
    fn run_error(&self, stop: Stop) -> RunError {
        let (Stop::Error { at, message } | Stop::Unknown { at, why: message }) = stop;
        let (line, column) = self.program.source.position(at);
        RunError {
            line,
            column,
            message,
        }
    }

    /// f and the attributes at `x`. Attributes start as `s`, missing ones as 0.
    ///
    /// # Panics
    /// If `x` or `a` has not the size of the object's head.
    pub fn eval(&self, x: &[f64], a: &[f64], s: &[f64]) -> Result<Evaluation, RunError> {
        let mut evaluator = self.evaluator();
        let f = evaluator.eval(x, a, s)?;
        Ok(Evaluation {
            f,
            s: evaluator.attributes().to_vec(),
        })
    }

    /// f at `x` in any number type; run-time errors are found on its values.
    ///
    /// # Panics
    /// If `x` or `a` has not the size of the object's head.
    pub fn eval_with<R: Real + 'static>(&self, x: &[R], a: &[R]) -> Result<R, RunError> {
        self.evaluator().eval(x, a, &[])
    }

    /// Builds f as an expression of x and a; attributes start as 0. The expression has no run-time
    /// errors: where the program would stop with one, its value is NaN or, where a limit of the
    /// language is not one of the formula, that of the formula.
    pub fn compile(&self, graph: &mut Graph) -> Result<NodeId, NotCompilable> {
        self.compile_with_places(graph).map(|(root, _)| root)
    }

    /// The same, with the places in the program of nodes that jump.
    pub(crate) fn compile_with_places(
        &self,
        graph: &mut Graph,
    ) -> Result<(NodeId, Vec<(NodeId, Place)>), NotCompilable> {
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
            let fails = is_certain && matches!(*stop, Stop::Error { .. });
            let (Stop::Error { at, message: why } | Stop::Unknown { at, why }) = *stop;
            let (line, column) = self.program.source.position(at);
            NotCompilable {
                line,
                column,
                why,
                fails,
            }
        })
    }

    /// The program with the values fixed: the text as it is, comments and all, and a further object
    /// that calls the model with
    /// `values` for a\[\] and, if there is a placement, with the point moved back. See
    /// [`Placement`].
    ///
    /// The new object takes the model's name and the model becomes `NAME_template`; if the program
    /// has no `my_model`, the new object is `my_model` and nothing is renamed.
    pub fn print_fitted(&self, values: &[f64], placement: Option<&Placement>) -> String {
        print::fitted(&self.program, self.object, values, placement)
    }
    /// The text with `start=` of each `@param` line set to the value.
    pub fn print_with_start(&self, values: &[f64]) -> String {
        print::with_start(&self.program, self.object, values)
    }
    /// The program in one layout, without comments.
    pub fn pretty(&self) -> String {
        print::pretty(&self.program)
    }
}

/// Evaluates a model at many points.
pub struct Evaluator<'m, R: Real + 'static> {
    model: &'m Model,
    executor: Executor<'m, Direct<R>>,
    s: Vec<R>,
}

impl<R: Real + 'static> Evaluator<'_, R> {
    /// f at `x`; attributes start as `s`, missing ones as 0, and can be asked for afterwards.
    ///
    /// # Panics
    /// If `x` or `a` has not the size of the object's head.
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
    /// The attributes after the last evaluation; empty where the object declares none.
    pub fn attributes(&self) -> &[R] {
        &self.s[..self.model.n_attributes()]
    }
}

/// Evaluates a model at many points, statement by statement for a block of points at a time.
///
/// A program of thousands of statements does not fit into a processor's caches. Run from begin to
/// end for one point after the other it would be read from memory for each.
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
    /// Number of points for which a statement is run before the next one: their frames fit into a
    /// cache beside the statement.
    pub const POINTS: usize = 32;

    /// f and the attributes at each of up to [`BlockEvaluator::POINTS`] points, as
    /// [`Evaluator::eval`] gives them; attributes start as 0.
    ///
    /// # Panics
    /// If there are more points, or a point or `a` has not the size of the object's head.
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
        let mut stopped: Vec<Option<Box<Stop>>> = points.iter().map(|_| None).collect();
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
    /// What a run whose statements are done comes to.
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
