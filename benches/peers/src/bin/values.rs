//! Values of a union of many primitives: `values balls|blocks N EVALUATOR POINTS` writes one JSON
//! object.
//!
//! Evaluators are fidget-vm and fidget-jit (single precision) and isoform-tape, isoform-pieces and
//! isoform-eval (double precision). Measured are what it takes to make the evaluator, from the tree
//! in memory for fidget and from the program's text for isoform, the values at random points of the
//! whole box, and those at a dense grid in the cube of one primitive, with everything that is done
//! for the cube: intervals, a shorter function, its compilation.

use fidget::context::Tree;
use fidget::eval::{BulkEvaluator, Function, MathFunction, TracingEvaluator};
use fidget::jit::JitFunction;
use fidget::shape::{EzShape, Shape, ShapeTape};
use fidget::vm::VmFunction;
use isoform::field::hyperfun::{BlockEvaluator, Mode, Model};
use isoform::field::{Bound, Graph, Pieces, Residual, Tape};
use isoform::geom::{Aabb, Field, Point3, Solid};
use isoform::num::Interval;
use peers::primitives::{Kind, Union};

/// Points along each edge of a cube's grid.
const PER_EDGE: usize = 16;
/// Cubes whose grids are computed, evenly spread.
const CUBES: usize = 5;
/// Points for which fidget is called once, as many as in a cube of 8³ points, and a multiple of its
/// vectors.
const SLICE: usize = 512;
/// Processor seconds that a round of measuring takes at least: fifty ticks of the clock.
const ROUND: f64 = 0.2;
/// Rounds of which the best counts; fewer where one takes long.
const ROUNDS: usize = 3;
/// Processor seconds after which no further round begins.
const LONG: f64 = 4.0;
/// Bytes of stack, as a main thread has: fidget's JIT of 100,000 primitives ends with a
/// segmentation fault in the 2 MiB of other threads.
const STACK: usize = 8 << 20;

type Failure = Box<dyn std::error::Error>;

/// A union, ready to be computed.
trait Values {
    fn values(&mut self, points: &[Point3], out: &mut [f64]) -> Result<(), Failure>;
    /// Values at points of a box of which many are asked for.
    fn values_in(&mut self, _: Aabb, points: &[Point3], out: &mut [f64]) -> Result<(), Failure> {
        self.values(points, out)
    }
}

type FloatTape<F> = ShapeTape<<<F as Function>::FloatSliceEval as BulkEvaluator>::Tape>;
type IntervalTape<F> = ShapeTape<<<F as Function>::IntervalEval as TracingEvaluator>::Tape>;

struct Fidget<F: Function> {
    shape: Shape<F>,
    values: FloatTape<F>,
    intervals: IntervalTape<F>,
    /// Memory of shorter functions, used again as fidget's own renderers do.
    workspace: F::Workspace,
    storage: F::Storage,
    tapes: F::TapeStorage,
}

/// The union as a tree whose inside is where it is negative, as fidget has it.
fn tree(union: &Union) -> Tree {
    let (x, y, z) = Tree::axes();
    let c = |v: f64| Tree::constant(v as f32);
    let each = union.primitives.iter().map(|one| {
        let [x, y, z] = [&x, &y, &z].map(|x| x.clone());
        let [u, v, w] = one.center;
        let off = [x - c(u), y - c(v), z - c(w)];
        let [x, y, z] = off.each_ref().map(Tree::square);
        let away = (x + y + z).sqrt();
        match union.kind {
            Kind::Ball => away - c(one.radius),
            Kind::Block => {
                let [x, y, z] = off.each_ref().map(Tree::abs);
                let [u, v, w] = one.half.map(c);
                let block = (x - u).max((y - v).max(z - w));
                block.max(c(one.radius) - away)
            }
        }
    });
    each.reduce(|all, one| all.min(one)).expect("primitives")
}

impl<F: MathFunction + Function> Fidget<F> {
    fn new(union: &Tree) -> Self {
        let shape = Shape::from(union.clone());
        Self {
            values: shape.ez_float_slice_tape(),
            intervals: shape.ez_interval_tape(),
            shape,
            workspace: F::Workspace::default(),
            storage: F::Storage::default(),
            tapes: F::TapeStorage::default(),
        }
    }
}

/// Values by a tape, slice by slice.
fn values_by<F: Function>(
    tape: &FloatTape<F>,
    points: &[Point3],
    out: &mut [f64],
) -> Result<(), Failure> {
    let mut evaluator = Shape::<F>::new_float_slice_eval();
    for (points, out) in points.chunks(SLICE).zip(out.chunks_mut(SLICE)) {
        let axis = |k: usize| points.iter().map(|p| p[k] as f32).collect::<Vec<f32>>();
        let found = evaluator.eval(tape, &axis(0), &axis(1), &axis(2))?;
        for (out, &v) in out.iter_mut().zip(found) {
            *out = -f64::from(v);
        }
    }
    Ok(())
}

impl<F: Function> Values for Fidget<F> {
    fn values(&mut self, points: &[Point3], out: &mut [f64]) -> Result<(), Failure> {
        values_by::<F>(&self.values, points, out)
    }

    fn values_in(&mut self, cell: Aabb, points: &[Point3], out: &mut [f64]) -> Result<(), Failure> {
        let [x, y, z] = [0, 1, 2].map(|i| {
            let ends = [cell.lo[i], cell.hi[i]].map(|v| v as f32);
            fidget::types::Interval::new(ends[0], ends[1])
        });
        let mut evaluator = Shape::<F>::new_interval_eval();
        let (_, Some(trace)) = evaluator.eval(&self.intervals, x, y, z)? else {
            return values_by::<F>(&self.values, points, out);
        };
        let storage = std::mem::take(&mut self.storage);
        let shorter = self.shape.simplify(trace, storage, &mut self.workspace)?;
        let tape = shorter.float_slice_tape(std::mem::take(&mut self.tapes));
        values_by::<F>(&tape, points, out)?;
        self.tapes = tape.recycle().unwrap_or_default();
        self.storage = shorter.recycle().unwrap_or_default();
        Ok(())
    }
}

/// isoform's compiled function; in a box, one without what intervals decide.
struct Compiled(Bound);

impl Values for Compiled {
    fn values(&mut self, points: &[Point3], out: &mut [f64]) -> Result<(), Failure> {
        self.0.values(points, out);
        Ok(())
    }

    fn values_in(&mut self, cell: Aabb, points: &[Point3], out: &mut [f64]) -> Result<(), Failure> {
        let shorter = self.0.bounds_and_rest(cell).1;
        shorter.as_ref().unwrap_or(&self.0).values(points, out);
        Ok(())
    }
}

impl Values for Pieces {
    fn values(&mut self, points: &[Point3], out: &mut [f64]) -> Result<(), Failure> {
        self.sign_values(points, out);
        Ok(())
    }

    /// As the mesher does it: what cannot decide in the box is left out of the tree.
    fn values_in(&mut self, cell: Aabb, points: &[Point3], out: &mut [f64]) -> Result<(), Failure> {
        let all: Vec<u32> = (0..self.names().len() as u32).collect();
        let mut ranges = vec![Interval::ALL; all.len()];
        self.value_bounds(&all, cell, &mut ranges);
        let rest = self.tree().deciding(&|piece| ranges[piece as usize]);
        let mut pieces = rest.pieces();
        pieces.sort_unstable();
        pieces.dedup();
        let mut values = vec![0.0; pieces.len() * points.len()];
        Solid::values(self, &pieces, points, &mut values);
        let at = |piece: u32| pieces.binary_search(&piece).expect("a piece of the tree");
        for (k, out) in out.iter_mut().enumerate() {
            *out = rest.value(&|piece| values[at(piece) * points.len() + k]);
        }
        Ok(())
    }
}

/// isoform's program, run statement by statement.
struct Run(Model);

impl Values for Run {
    fn values(&mut self, points: &[Point3], out: &mut [f64]) -> Result<(), Failure> {
        let mut evaluator = self.0.block_evaluator();
        let blocks = points.chunks(BlockEvaluator::POINTS);
        for (points, out) in blocks.zip(out.chunks_mut(BlockEvaluator::POINTS)) {
            for (out, found) in out.iter_mut().zip(evaluator.eval(points, &[0.0])) {
                *out = found?.f;
            }
        }
        Ok(())
    }
}

/// The expression of a program.
fn expression(text: &str) -> Result<(Graph, isoform::field::NodeId), Failure> {
    let mut graph = Graph::new();
    let root = Model::parse(text, Mode::Default)?.compile(&mut graph)?;
    Ok((graph, root))
}

/// What makes the evaluator of this name.
fn maker(name: &str, union: &Union) -> Option<Box<dyn Fn() -> Result<Box<dyn Values>, Failure>>> {
    let (tree, text) = (tree(union), union.program());
    Some(match name {
        "fidget-vm" => Box::new(move || Ok(Box::new(Fidget::<VmFunction>::new(&tree)))),
        "fidget-jit" => Box::new(move || Ok(Box::new(Fidget::<JitFunction>::new(&tree)))),
        "isoform-tape" => Box::new(move || {
            let (graph, root) = expression(&text)?;
            let residual = Residual::new(Tape::new(&graph, &[root], 3, 1));
            Ok(Box::new(Compiled(Bound::new(residual, &[0.0]))))
        }),
        "isoform-pieces" => Box::new(move || {
            let (graph, root) = expression(&text)?;
            Ok(Box::new(Pieces::new(&graph, root, &[0.0])?))
        }),
        "isoform-eval" => Box::new(move || Ok(Box::new(Run(Model::parse(&text, Mode::Default)?)))),
        _ => return None,
    })
}

/// Processor seconds of this thread.
fn processor() -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat");
    let told = told.expect("Linux tells a thread's time");
    let nanoseconds = told.split(' ').next().and_then(|n| n.parse::<f64>().ok());
    nanoseconds.expect("a number") * 1e-9
}

/// Processor seconds of some work: the best round's mean.
fn seconds(mut work: impl FnMut() -> Result<(), Failure>) -> Result<f64, Failure> {
    let (begin, mut least) = (processor(), f64::INFINITY);
    for _ in 0..ROUNDS {
        let (from, mut runs) = (processor(), 0.0);
        while processor() < from + ROUND {
            work()?;
            runs += 1.0;
        }
        least = least.min((processor() - from) / runs);
        if processor() > begin + LONG {
            break;
        }
    }
    Ok(least)
}

/// Everything of one evaluator, as JSON.
fn measured(union: &Union, name: &str, n: usize) -> Result<String, Failure> {
    let make = maker(name, union).ok_or("no evaluator is called so")?;
    let ready = seconds(|| make().map(drop))?;
    let mut evaluator = make()?;
    let points = union.random_points(n);
    let mut out = vec![0.0; n];
    let random = seconds(|| evaluator.values(&points, &mut out))?;
    let (mut values, mut cube) = (out[..CUBES].to_vec(), None);
    if name != "isoform-eval" {
        cube = Some(in_cubes(union, evaluator.as_mut(), &mut values)?);
    }
    let cube = cube.map_or("null".to_owned(), |seconds| format!("{seconds:e}"));
    let per_cube = PER_EDGE.pow(3);
    Ok(format!(
        "{{\"ready\": {ready:e}, \"random\": {random:e}, \"cube\": {cube}, \
         \"cube_points\": {per_cube}, \"values\": {values:?}}}"
    ))
}

/// Processor seconds of the values in one cube, the mean of some; a value of each is told, too.
fn in_cubes(
    union: &Union,
    evaluator: &mut dyn Values,
    values: &mut Vec<f64>,
) -> Result<f64, Failure> {
    let (told, mut out) = (values.len(), vec![0.0; PER_EDGE.pow(3)]);
    let cube = |i: usize| union.cell(i * union.primitives.len() / CUBES, PER_EDGE);
    let cubes: Vec<_> = (0..CUBES).map(cube).collect();
    let all = seconds(|| {
        values.truncate(told);
        for (lo, points) in &cubes {
            let hi = lo.map(|v| v + 1.0);
            evaluator.values_in(Aabb { lo: *lo, hi }, points, &mut out)?;
            values.push(out[out.len() / 3]);
        }
        Ok(())
    })?;
    Ok(all / CUBES as f64)
}

fn main() -> Result<(), Failure> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [kind, n, name, points] = args.as_slice() else {
        return Err("values balls|blocks N EVALUATOR POINTS".into());
    };
    let kind = Kind::named(kind).ok_or("the kinds are balls and blocks")?;
    let union = Union::new(kind, n.parse()?);
    let points = points.parse()?;
    // Everything runs in the thread whose time is read.
    let one = rayon::ThreadPoolBuilder::new().num_threads(1);
    let one = one.stack_size(STACK).build()?;
    let told = one.install(|| measured(&union, name, points).map_err(|e| e.to_string()))?;
    println!("{told}");
    Ok(())
}
