//! A compiled model with fixed parameters as a solid of smooth pieces.
//!
//! The parameters are substituted before the expression is split, so that factors have known signs
//! and subexpressions independent of space are computed once. Each piece has a tape of its own; for
//! several pieces at once a common tape shares their subexpressions.

use crate::block::{Block, LANES};
use crate::graph::{Graph, Node, NodeId};
use crate::hyperfun::{Amount, Fixed, Model, NotCompilable, ParamInfo, RunError, SourceToken};
use crate::ops::{Ops, Unary};
use crate::split::{MAX_BLEND_ARGUMENTS, MonotoneFunction, Split, SplitError, split};
use crate::tape::Tape;
use isoform_geom::{Aabb, Csg, Field, Point3, Solid};
use isoform_num::{Interval, IntervalJet, Jet1, Jet2, Real};
use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::rc::Rc;
use std::sync::Arc;

/// Error of the conversion of a model into a solid of pieces.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SolidError {
    /// The program cannot be compiled to an expression.
    #[error("the program is no expression (line {}: {}); it can only be run statement by statement", .0.line, .0.why)]
    NoExpression(NotCompilable),
    /// Runs of the program end with an error at every tested point.
    #[error(transparent)]
    Fails(#[from] RunError),
    /// The object does not have three coordinates.
    #[error("the model has {found} coordinates, a solid has 3")]
    Dimension {
        /// Number of coordinates of the object.
        found: usize,
    },
    /// More values than parameters ([`parameter_values`]), or fewer than the expression uses
    /// ([`Pieces::new`]).
    #[error("{found} values for {expected} parameters")]
    Parameters {
        /// Number of parameters of the model.
        expected: usize,
        /// Number of given values.
        found: usize,
    },
    /// Parameters without a value.
    #[error("{} {} no value{}", names.join(", "), if names.len() == 1 { "has" } else { "have" },
        if names.len() == 1 { "" } else { "s" })]
    Missing {
        /// Labels of the parameters: as written, with their names.
        names: Vec<String>,
    },
    /// The function's sign is constant.
    #[error("the model has no surface: {}", if *.inside { "all of space is inside" } else { "nothing is inside" })]
    NoSurface {
        /// True if all of space is inside.
        inside: bool,
    },
    /// The expression is nested too deeply or has too many pieces.
    #[error("the model has too many pieces, or they are nested too deeply")]
    TooLarge,
}

impl From<NotCompilable> for SolidError {
    fn from(error: NotCompilable) -> Self {
        if !error.fails {
            return Self::NoExpression(error);
        }
        Self::Fails(RunError {
            line: error.line,
            column: error.column,
            message: error.why,
        })
    }
}

impl From<SplitError> for SolidError {
    fn from(error: SplitError) -> Self {
        match error {
            SplitError::Constant { inside } => Self::NoSurface { inside },
            SplitError::TooLarge => Self::TooLarge,
        }
    }
}

/// Compiled model with fixed parameters, as minima and maxima over smooth pieces.
///
/// ```
/// use isoform_field::{Pieces, hyperfun::{Mode, Model}};
/// use isoform_geom::Solid;
///
/// let text = "my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = min(hfSphere(x, c, a[1]), 0.5 - abs(x[3])); }";
/// let model = Model::parse(text, Mode::Default)?;
/// let disc = Pieces::of_model(&model, &[1.0]).expect("an expression");
/// assert_eq!(disc.names(), ["c", "z_max", "z_min"]);
/// let (value, gradient) = disc.gradient(1, [0.0, 0.0, 0.25]);
/// assert_eq!((value, gradient), (0.25, [0.0, 0.0, -1.0]));
/// # Ok::<(), isoform_field::hyperfun::SyntaxError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Pieces {
    names: Vec<String>,
    tree: Csg,
    each: Vec<Arc<Tape>>,
    all: Tape,
    own: Tape,
    ranges: PieceRanges,
    /// Graph of the functions of the pieces, and of the whole expression.
    graph: Graph,
    roots: Vec<NodeId>,
    root: NodeId,
    /// Positions in the program of discontinuous nodes.
    places: Vec<(NodeId, SourceToken)>,
}

impl Pieces {
    /// Splits the expression `root` of three coordinates, with the values `a` of its parameters.
    pub fn new(graph: &Graph, root: NodeId, a: &[f64]) -> Result<Self, SolidError> {
        Self::with_places(graph, root, &[], a)
    }

    /// Splits an expression as [`Pieces::new`] does, with the positions in the program of
    /// discontinuous nodes.
    fn with_places(
        graph: &Graph,
        root: NodeId,
        places: &[(NodeId, SourceToken)],
        a: &[f64],
    ) -> Result<Self, SolidError> {
        let (nx, na) = graph.inputs(root);
        if nx > 3 {
            return Err(SolidError::Dimension { found: nx });
        }
        if na > a.len() {
            return Err(SolidError::Parameters {
                expected: na,
                found: a.len(),
            });
        }
        let mut bound = Graph::new();
        let x: Vec<NodeId> = (0..3).map(|i| bound.x(i)).collect();
        let a: Vec<NodeId> = a.iter().map(|&v| bound.constant(v)).collect();
        let need = graph.reachable(&[root]);
        let placed: Vec<&(NodeId, SourceToken)> =
            places.iter().filter(|(id, _)| need[id.at()]).collect();
        let ids: Vec<NodeId> = std::iter::once(root)
            .chain(placed.iter().map(|(id, _)| *id))
            .collect();
        let ids = graph.rewrite_all(&ids, &mut bound, &x, &a, |g, id, name| {
            g.name_as(*id, name);
        });
        let places = placed.into_iter().zip(&ids[1..]);
        let places = places
            .map(|((_, place), id)| (*id, place.clone()))
            .collect();
        let root = ids[0];
        let own = Tape::new(&bound, &[root], 3, 0);
        let Split {
            names,
            pieces,
            tree,
            monotone,
        } = split(&mut bound, root)?;
        let all = Tape::new(&bound, &pieces, 3, 0);
        let each: Vec<Arc<Tape>> = (0..pieces.len()).map(|k| all.result(k).into()).collect();
        let ranges = PieceRanges::new(&bound, &pieces, &each, &monotone);
        Ok(Self {
            names,
            tree,
            each,
            all,
            own,
            ranges,
            graph: bound,
            roots: pieces,
            root,
            places,
        })
    }

    /// Compiles and splits a model with the values `a` of its parameters; missing ones are those of
    /// [`parameter_values`].
    ///
    /// # Errors
    /// [`SolidError`].
    pub fn of_model(model: &Model, a: &[f64]) -> Result<Self, SolidError> {
        let a = values_in_space(model, a)?;
        let mut graph = Graph::new();
        let (root, places) = model.compile_with_places(&mut graph)?;
        if let Some(error) = common_error(model, &a) {
            return Err(error.into());
        }
        Self::with_places(&graph, root, &places, &a)
    }

    /// Returns the functions of all pieces as expressions of the coordinates.
    pub(crate) fn functions(&self) -> (&Graph, &[NodeId]) {
        (&self.graph, &self.roots)
    }

    /// Returns the whole expression, of the coordinates.
    pub(crate) fn whole(&self) -> (Graph, NodeId) {
        (self.graph.clone(), self.root)
    }

    /// Returns the position in the program of a discontinuous node.
    pub(crate) fn place(&self, id: NodeId) -> Option<&SourceToken> {
        let found = self.places.iter().find(|(of, _)| *of == id)?;
        Some(&found.1)
    }

    /// Returns the number of operations of a piece's function, the cost of its evaluation.
    pub fn cost(&self, piece: u32) -> usize {
        self.each[piece as usize].len()
    }
}

/// Returns the error with which runs of a program end wherever they are tried, if their messages
/// are equal: it depends on the parameters alone.
fn common_error(model: &Model, a: &[f64]) -> Option<RunError> {
    // Multiples of these numbers are evenly distributed modulo 1; sizes grow by decades.
    let at = |k: u32, step: f64| 2.0 * (f64::from(k + 1) * step).fract() - 1.0;
    let point = |k: u32| {
        let size = 10_f64.powi(k as i32 % 8 - 3);
        [0.819, 0.671, 0.549].map(|step| size * at(k, step))
    };
    let mut evaluator = model.evaluator();
    let first = evaluator.eval(&point(0), a, &[]).err()?;
    let is_same = |k| evaluator.eval(&point(k), a, &[]).is_err_and(|e| e == first);
    // Six points of each size.
    (1..48).all(is_same).then_some(first)
}

/// Computation of ranges of the pieces. Interval arithmetic treats the arguments of a blend as
/// independent and overestimates its range; since a blend is monotone in each argument, the ends of
/// their ranges determine the ends of its own.
#[derive(Clone, Debug)]
struct PieceRanges {
    steps: Vec<RangeStep>,
    functions: Vec<Tape>,
    /// Steps of each piece's range, in the order of computation; the last one is the piece itself.
    pieces: Vec<Vec<usize>>,
}

#[derive(Clone, Debug)]
enum RangeStep {
    Tape(Arc<Tape>),
    Negative(usize),
    /// A function of steps; true for those in which it is increasing.
    Monotone(usize, Vec<(usize, bool)>),
}

impl RangeStep {
    /// Returns the steps on which it depends.
    fn inputs(&self) -> Vec<usize> {
        match self {
            Self::Tape(_) => Vec::new(),
            Self::Negative(u) => vec![*u],
            Self::Monotone(_, inputs) => inputs.iter().map(|i| i.0).collect(),
        }
    }
}

impl PieceRanges {
    /// Determines the steps for pieces with given tapes.
    fn new(
        graph: &Graph,
        pieces: &[NodeId],
        each: &[Arc<Tape>],
        monotone: &HashMap<NodeId, MonotoneFunction>,
    ) -> Self {
        let need = needed(graph, pieces, monotone);
        let step: HashMap<NodeId, usize> =
            need.keys().enumerate().map(|(k, &id)| (id, k)).collect();
        let tapes = tapes_of(graph, &need, pieces, each);
        let (mut functions, mut compiled) = (Vec::new(), HashMap::new());
        let steps: Vec<RangeStep> = need
            .iter()
            .map(|(id, known)| match (known, graph.node(*id)) {
                (Some(MonotoneFunction { function, inputs }), _) => {
                    let at = *compiled.entry(Rc::as_ptr(function)).or_insert_with(|| {
                        functions.push(Tape::new(
                            &function.graph,
                            &[function.root],
                            3 + inputs.len(),
                            0,
                        ));
                        functions.len() - 1
                    });
                    RangeStep::Monotone(
                        at,
                        inputs
                            .iter()
                            .map(|u| step[u])
                            .zip(function.rises.iter().copied())
                            .collect(),
                    )
                }
                (None, Node::Unary(Unary::Neg, u)) => RangeStep::Negative(step[u]),
                _ => RangeStep::Tape(tapes[id].clone()),
            })
            .collect();
        let pieces = pieces.iter().map(|id| order(&steps, step[id])).collect();
        Self {
            steps,
            functions,
            pieces,
        }
    }

    /// Computes the range of a piece. The steps are computed iteratively, since recursion over a
    /// long chain of them could overflow the stack.
    fn bounds(&self, piece: usize, x: &[Interval; 3], scratch: &mut Vec<Interval>) -> Interval {
        let order = &self.pieces[piece];
        if let [only] = order[..] {
            return self.step(only, &[], &[], x, scratch);
        }
        let mut ranges = Vec::with_capacity(order.len());
        for &step in order {
            ranges.push(self.step(step, order, &ranges, x, scratch));
        }
        ranges[order.len() - 1]
    }

    /// Computes the range of a step from those of the steps before it in the order.
    fn step(
        &self,
        step: usize,
        order: &[usize],
        ranges: &[Interval],
        x: &[Interval; 3],
        scratch: &mut Vec<Interval>,
    ) -> Interval {
        let of = |step: &usize| {
            let at = order.binary_search(step);
            ranges[at.expect("what a step uses is in its piece's order")]
        };
        match &self.steps[step] {
            RangeStep::Tape(tape) => tape.range(x, &[], scratch),
            RangeStep::Negative(u) => -of(u),
            RangeStep::Monotone(function, inputs) => {
                let mut ends = [[Interval::ALL; 3 + MAX_BLEND_ARGUMENTS]; 2];
                for (k, (input, rises)) in inputs.iter().enumerate() {
                    let range = of(input);
                    let (low, high) = if *rises {
                        (range.lo(), range.hi())
                    } else {
                        (range.hi(), range.lo())
                    };
                    ends[0][3 + k] = Interval::new(low, low);
                    ends[1][3 + k] = Interval::new(high, high);
                }
                let [low, high] =
                    ends.map(|ends| self.functions[*function].range(&ends, &[], scratch));
                Interval::new(low.lo(), high.hi().max(low.lo()))
            }
        }
    }
}

/// Collects the pieces and the expressions from which their ranges are computed, with the monotone
/// function that represents each, if any.
///
/// A monotone function is used only if its inputs precede it in the graph: of r - min(q, 0) the
/// piece for 0 is r, a function of r and 0, and its range would depend on itself.
fn needed(
    graph: &Graph,
    pieces: &[NodeId],
    monotone: &HashMap<NodeId, MonotoneFunction>,
) -> BTreeMap<NodeId, Option<MonotoneFunction>> {
    let mut need: BTreeMap<NodeId, Option<MonotoneFunction>> = BTreeMap::new();
    let mut pending: Vec<NodeId> = pieces.to_vec();
    while let Some(id) = pending.pop() {
        if need.contains_key(&id) {
            continue;
        }
        let known = monotone
            .get(&id)
            .filter(|of| of.inputs.iter().all(|&u| u < id))
            .cloned()
            .or_else(|| MonotoneFunction::of_blend(graph, id));
        match (&known, graph.node(id)) {
            (Some(of), _) => pending.extend(&of.inputs),
            (None, Node::Unary(Unary::Neg, u)) => pending.push(*u),
            _ => {}
        }
        need.insert(id, known);
    }
    need
}

/// Returns the tapes of the expressions without a special form: given for pieces, compiled for
/// others.
fn tapes_of(
    graph: &Graph,
    need: &BTreeMap<NodeId, Option<MonotoneFunction>>,
    pieces: &[NodeId],
    each: &[Arc<Tape>],
) -> HashMap<NodeId, Arc<Tape>> {
    let mut tapes: HashMap<NodeId, Arc<Tape>> =
        pieces.iter().copied().zip(each.iter().cloned()).collect();
    let is_tape = |id: &NodeId, known: &Option<MonotoneFunction>| {
        known.is_none() && !matches!(graph.node(*id), Node::Unary(Unary::Neg, _))
    };
    let of_tapes = need.iter().filter(|(id, known)| is_tape(id, known));
    let others: Vec<NodeId> = of_tapes
        .map(|(id, _)| *id)
        .filter(|id| !tapes.contains_key(id))
        .collect();
    if !others.is_empty() {
        let together = Tape::new(graph, &others, 3, 0);
        let compiled = (0..others.len()).map(|k| together.result(k).into());
        tapes.extend(others.iter().copied().zip(compiled));
    }
    tapes
}

/// Returns a step and all steps on which it depends, in the order of computation.
fn order(steps: &[RangeStep], last: usize) -> Vec<usize> {
    let (mut found, mut pending) = (BTreeSet::new(), vec![last]);
    while let Some(step) = pending.pop() {
        if found.insert(step) {
            pending.extend(steps[step].inputs());
        }
    }
    found.into_iter().collect()
}

/// Returns the values of all parameters of a model, of which the first ones, or some, are given.
/// Tied parameters follow their tie, even if a value is given. For the others the annotated typical
/// value is used, else the value at which they are held, else the start value. Parameters that the
/// program does not use, such as those of the program of a fit, need no value and are 0.
///
/// ```
/// use isoform_field::{hyperfun::{Mode, Model}, parameter_values};
/// let text = "-- @param a[2] height start=3
///     -- @param a[3] depth tie=2*a[1] + height
///     my_model(x[3], a[4]) { my_model = a[1] + a[2] + a[3] - x[1]; }";
/// let model = Model::parse(text, Mode::Default)?;
/// assert_eq!(parameter_values(&model, &[1.0]), Ok(vec![1.0, 3.0, 5.0, 0.0]));
/// assert_eq!(parameter_values(&model, &[Some(1.0), None, None, Some(2.0)]).map(|a| a[3]), Ok(2.0));
/// let missing = parameter_values::<f64>(&model, &[]).map_err(|e| e.to_string());
/// assert_eq!(missing, Err("a[1] has no value".to_owned()));
/// assert!(parameter_values(&model, &[0.0; 5]).is_err());
/// # Ok::<(), isoform_field::hyperfun::SyntaxError>(())
/// ```
///
/// # Errors
/// [`SolidError::Parameters`] if there are more values than parameters, [`SolidError::Missing`] if
/// a parameter that is used has no value.
pub fn parameter_values<V: Into<Option<f64>> + Copy>(
    model: &Model,
    given: &[V],
) -> Result<Vec<f64>, SolidError> {
    let (expected, found) = (model.n_params(), given.len());
    if found > expected {
        return Err(SolidError::Parameters { expected, found });
    }
    let infos = model.params();
    let annotated = |info: &ParamInfo| {
        let start = info.start.and_then(Amount::value);
        let held = match info.fixed {
            Some(Fixed::At(value)) => Some(value),
            _ => None,
        };
        info.typical.or(held).or(start)
    };
    let of = |info: &ParamInfo| {
        let given = given.get(info.index).and_then(|&value| value.into());
        given.or_else(|| annotated(info))
    };
    let mut values: Vec<Option<f64>> = infos.iter().map(of).collect();
    let is_missing = |info: &&ParamInfo| info.tie.is_none() && values[info.index].is_none();
    if infos.iter().any(|info| is_missing(&info)) {
        let mut needed = model.used_params();
        for info in infos {
            // Ties depend on free parameters only.
            if let Some(tie) = info.tie.as_ref().filter(|_| needed[info.index]) {
                tie.terms.iter().for_each(|(i, _)| needed[*i] = true);
            }
        }
        let missing = infos.iter().filter(is_missing);
        let names: Vec<String> = missing
            .filter(|info| needed[info.index])
            .map(ParamInfo::label)
            .collect();
        if !names.is_empty() {
            return Err(SolidError::Missing { names });
        }
    }
    for info in infos {
        if let Some(tie) = &info.tie {
            let term = |(i, factor): &(usize, f64)| factor * values[*i].unwrap_or(0.0);
            values[info.index] = Some(tie.terms.iter().fold(tie.constant, |v, t| v + term(t)));
        }
    }
    Ok(values.into_iter().map(|v| v.unwrap_or(0.0)).collect())
}

/// Returns the values of all parameters of a model with three coordinates.
fn values_in_space(model: &Model, given: &[f64]) -> Result<Vec<f64>, SolidError> {
    match model.dimension() {
        3 => parameter_values(model, given),
        found => Err(SolidError::Dimension { found }),
    }
}

thread_local! {
    static NUMBERS: Cell<Vec<f64>> = const { Cell::new(Vec::new()) };
    static SLOPES: Cell<Vec<Jet1<3>>> = const { Cell::new(Vec::new()) };
    static JETS: Cell<Vec<Jet2>> = const { Cell::new(Vec::new()) };
    static RANGES: Cell<Vec<Interval>> = const { Cell::new(Vec::new()) };
    static EXPANSIONS: Cell<Vec<IntervalJet<1>>> = const { Cell::new(Vec::new()) };
}

/// Calls `run` with this thread's scratch space, which is taken out meanwhile, so that a nested use
/// on this thread starts with an empty one.
fn with<T, R>(
    scratch: &'static std::thread::LocalKey<Cell<Vec<T>>>,
    run: impl FnOnce(&mut Vec<T>) -> R,
) -> R {
    let mut space = scratch.take();
    let result = run(&mut space);
    scratch.set(space);
    result
}

/// Number of points below which evaluation one by one is cheaper than in a block.
const MIN_BLOCK_POINTS: usize = 4;

/// Evaluates results of a tape at the points: row r of `out` is result `result(r)`.
fn values(
    tape: &Tape,
    points: &[Point3],
    rows: usize,
    result: impl Fn(usize) -> usize,
    out: &mut [f64],
) {
    let n = points.len();
    if n < MIN_BLOCK_POINTS {
        return with(&NUMBERS, |scratch| {
            for (i, p) in points.iter().enumerate() {
                tape.eval(p, &[], scratch);
                for row in 0..rows {
                    out[row * n + i] = scratch[tape.roots[result(row)] as usize];
                }
            }
        });
    }
    Block::with_kept_rows(tape, |block| {
        block.bind(&[]);
        for (c, chunk) in points.chunks(LANES).enumerate() {
            block.load(chunk);
            block.forward();
            for row in 0..rows {
                out[row * n + c * LANES..][..chunk.len()]
                    .copy_from_slice(&block.result(result(row))[..chunk.len()]);
            }
        }
    });
}

impl Solid for Pieces {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn tree(&self) -> &Csg {
        &self.tree
    }
    fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
        if self.all.len() < which.iter().map(|&piece| self.cost(piece)).sum() {
            return values(
                &self.all,
                points,
                which.len(),
                |row| which[row] as usize,
                out,
            );
        }
        for (row, &piece) in which.iter().enumerate() {
            values(
                &self.each[piece as usize],
                points,
                1,
                |_| 0,
                &mut out[row * points.len()..],
            );
        }
    }
    fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
        let x = [
            Jet1::variable(p[0], 0),
            Jet1::variable(p[1], 1),
            Jet1::variable(p[2], 2),
        ];
        let jet = with(&SLOPES, |scratch| {
            self.each[piece as usize].eval(&x, &[], scratch)
        });
        (jet.v, jet.g)
    }
    fn jet(&self, piece: u32, p: Point3) -> Jet2 {
        let x = [
            Jet2::variable(p[0], 0),
            Jet2::variable(p[1], 1),
            Jet2::variable(p[2], 2),
        ];
        with(&JETS, |scratch| {
            self.each[piece as usize].eval(&x, &[], scratch)
        })
    }
    fn bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        if region.is_empty() {
            return out[..which.len()].fill(Interval::ALL);
        }
        let x: [Interval; 3] = std::array::from_fn(|i| Interval::new(region.lo[i], region.hi[i]));
        with(&RANGES, |scratch| {
            for (&piece, out) in which.iter().zip(out) {
                *out = self.ranges.bounds(piece as usize, &x, scratch);
            }
        });
    }
    fn value_bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        if region.is_empty() {
            return out[..which.len()].fill(Interval::ALL);
        }
        let x: [Interval; 3] = std::array::from_fn(|i| Interval::new(region.lo[i], region.hi[i]));
        with(&RANGES, |scratch| {
            for (&piece, out) in which.iter().zip(out) {
                *out = self.each[piece as usize].value_range(&x, &[], scratch);
            }
        });
    }
    fn slopes(&self, piece: u32, region: Aabb) -> Option<[Interval; 3]> {
        let tape = &self.each[piece as usize];
        if region.is_empty() || tape.has_natives() {
            return None;
        }
        let x: [IntervalJet<1>; 3] = std::array::from_fn(|i| {
            IntervalJet::variable(Interval::new(region.lo[i], region.hi[i]), i)
        });
        Some(with(&EXPANSIONS, |scratch| tape.eval(&x, &[], scratch).g))
    }
    fn sign_values(&self, points: &[Point3], out: &mut [f64]) {
        values(&self.own, points, 1, |_| 0, out);
    }
}

/// Function of space that runs a program statement by statement, for models that cannot be compiled
/// to an expression; a solid of one piece by [`isoform_geom::OnePiece`]. About a hundred times
/// slower than [`Pieces`]; NaN where the program stops with an error.
#[derive(Clone, Debug)]
pub struct RunField {
    model: Model,
    a: Vec<f64>,
}

impl RunField {
    /// Creates the function of a model with the values `a` of its parameters; missing ones are
    /// those of [`parameter_values`].
    ///
    /// # Errors
    /// [`SolidError::Dimension`], [`SolidError::Parameters`].
    pub fn new(model: &Model, a: &[f64]) -> Result<Self, SolidError> {
        Ok(Self {
            model: model.clone(),
            a: values_in_space(model, a)?,
        })
    }

    /// Returns the first error if the program fails at each of the points, else `None`.
    pub fn fault(&self, points: &[Point3]) -> Option<RunError> {
        let mut evaluator = self.model.evaluator();
        let mut first = None;
        for p in points {
            match evaluator.eval(p, &self.a, &[]) {
                Ok(_) => return None,
                Err(error) => drop(first.get_or_insert(error)),
            }
        }
        first
    }

    fn run<R: Real + 'static>(
        &self,
        points: impl Iterator<Item = [R; 3]>,
        mut each: impl FnMut(R),
    ) {
        let a: Vec<R> = self.a.iter().map(|&v| R::constant(v)).collect();
        let mut evaluator = self.model.evaluator::<R>();
        for p in points {
            each(
                evaluator
                    .eval(&p, &a, &[])
                    .unwrap_or_else(|_| R::constant(f64::NAN)),
            );
        }
    }
}

impl Field for RunField {
    fn value(&self, p: Point3) -> f64 {
        let mut out = [0.0];
        self.values(&[p], &mut out);
        out[0]
    }
    fn jet(&self, p: Point3) -> Jet2 {
        let mut jet = Jet2::constant(f64::NAN);
        self.run(
            std::iter::once(std::array::from_fn(|i| Jet2::variable(p[i], i))),
            |v| jet = v,
        );
        jet
    }
    fn values(&self, points: &[Point3], out: &mut [f64]) {
        let mut out = out.iter_mut();
        self.run(points.iter().copied(), |v| {
            *out.next().expect("as many values as points") = v
        });
    }
}
