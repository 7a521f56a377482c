//! Compiled expressions: flat lists of operations on numbered slots.
//!
//! Slots are `[constants | x | parameters | operations]`, each written once. Operations that do not
//! depend on x come first; they are computed once per call instead of once per point. Evaluators
//! own their scratch space; the tape is shared between threads. [`Tape::eval`] accepts any number
//! type; the block evaluators process 32 points at a time.

use crate::graph::{Graph, Node, NodeId};
use crate::library::Native;
use crate::ops::{Binary, SetOp, Unary};
use isoform_num::{Interval, Real};
use std::collections::{BTreeSet, HashMap};

/// The kind of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Op {
    /// A function of slot a.
    Unary(Unary),
    /// A function of the slots a and b.
    Binary(Binary),
    /// A set operation on the slots a and b.
    Set(SetOp),
    /// Slot a to the integer power in c.
    PowI,
    /// Slot b where slot a is not 0, else slot c.
    Select,
    /// Entry a of the list of native calls.
    Native,
}

/// One operation; its result goes to the next slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Instruction {
    pub(crate) op: Op,
    pub(crate) a: u32,
    pub(crate) b: u32,
    pub(crate) c: u32,
}

/// A compiled expression with one or more results.
///
/// ```
/// use isoform_field::{Graph, Ops, Tape};
/// use isoform_num::Jet1;
/// let mut graph = Graph::new();
/// let (x, y) = (graph.x(0), graph.x(1));
/// let (x2, y2) = (graph.square(&x), graph.square(&y));
/// let f = graph.sub(&x2, &y2);
/// let tape = Tape::new(&graph, &[f], 2, 0);
/// let mut scratch = Vec::new();
/// assert_eq!(tape.eval(&[3.0, 2.0], &[], &mut scratch), 5.0);
/// // The value with the gradient (2x, −2y).
/// let at = [Jet1::<2>::variable(3.0, 0), Jet1::variable(2.0, 1)];
/// assert_eq!(tape.eval(&at, &[], &mut Vec::new()).g, [6.0, -4.0]);
/// ```
#[derive(Clone, Debug)]
pub struct Tape {
    /// Number of coordinates.
    pub(crate) n_x: usize,
    /// Number of parameters.
    pub(crate) n_params: usize,
    /// The values of the first slots.
    pub(crate) constants: Vec<f64>,
    /// The operations in the order of computation.
    pub(crate) code: Vec<Instruction>,
    /// Number of initial operations of `code` that do not depend on x.
    pub(crate) uniform: usize,
    /// Calls of native functions, each with the slots of its arguments.
    pub(crate) natives: Vec<(Native, Box<[u32]>)>,
    /// The slots of the results.
    pub(crate) roots: Vec<u32>,
}

/// Nodes of an expression in the order of a tape, each kind in the order of creation.
struct NodeOrder {
    /// Constants, coordinates and parameters.
    inputs: Vec<NodeId>,
    /// Operations that do not depend on the coordinates.
    uniform: Vec<NodeId>,
    /// Operations that depend on the coordinates.
    varying: Vec<NodeId>,
}

impl NodeOrder {
    /// Sorts the nodes that `need` marks.
    fn new(graph: &Graph, need: &[bool]) -> Self {
        let nodes = (0..graph.len()).filter(|&i| need[i]);
        let nodes = nodes.map(|i| NodeId(i as u32));
        let (inputs, computed): (Vec<NodeId>, Vec<NodeId>) = nodes.partition(|id| {
            let node = graph.node(*id);
            matches!(node, Node::Constant(_) | Node::X(_) | Node::Param(_))
        });
        let in_space = |id: &NodeId| graph.is_in_space(*id);
        let (varying, uniform) = computed.into_iter().partition(in_space);
        Self {
            inputs,
            uniform,
            varying,
        }
    }
}

impl Tape {
    /// Compiles the expressions `roots`; library functions are expanded. `n_x` coordinates and
    /// `n_params` parameters are inputs, used or not.
    ///
    /// # Panics
    /// If an expression uses an input beyond `n_x` or `n_params`.
    pub fn new(graph: &Graph, roots: &[NodeId], n_x: usize, n_params: usize) -> Self {
        let mut g = graph.clone();
        let roots = g.lowered_all(roots);
        let need = g.reachable(&roots);
        let order = NodeOrder::new(&g, &need);
        let constants = order.inputs.iter().filter_map(|&id| g.constant_value(id));
        let mut tape = Self::with_inputs(n_x, n_params, constants.collect());
        tape.uniform = order.uniform.len();
        let mut slots = tape.slots_of(&g, &order.inputs);
        for id in order.uniform.into_iter().chain(order.varying) {
            let instruction = tape.instruction(&g, id, &slots);
            slots[id.at()] = (tape.first_code() + tape.code.len()) as u32;
            tape.code.push(instruction);
        }
        tape.roots = roots.iter().map(|r| slots[r.at()]).collect();
        tape
    }

    /// Returns the slots of the inputs, by node; [`u32::MAX`] for other nodes.
    fn slots_of(&self, graph: &Graph, inputs: &[NodeId]) -> Vec<u32> {
        let mut slots = vec![u32::MAX; graph.len()];
        let mut next_constant = 0;
        for &id in inputs {
            let slot = match graph.node(id) {
                Node::X(i) => {
                    let (at, most) = (*i as usize, self.n_x);
                    assert!(at < most, "coordinate {} of {most}", at + 1);
                    self.first_x() + at
                }
                Node::Param(i) => {
                    let (at, most) = (*i as usize, self.n_params);
                    assert!(at < most, "parameter {} of {most}", at + 1);
                    self.first_param() + at
                }
                _ => {
                    next_constant += 1;
                    next_constant - 1
                }
            };
            slots[id.at()] = slot as u32;
        }
        slots
    }

    /// Translates a node whose arguments have slots into an operation.
    fn instruction(&mut self, graph: &Graph, id: NodeId, slots: &[u32]) -> Instruction {
        let at = |n: &NodeId| slots[n.at()];
        let (op, a, b, c) = match graph.node(id) {
            Node::Unary(op, u) => (Op::Unary(*op), at(u), 0, 0),
            Node::Binary(op, u, v) => (Op::Binary(*op), at(u), at(v), 0),
            Node::PowI(u, n) => (Op::PowI, at(u), 0, *n as u32),
            Node::Set(op, u, v) => (Op::Set(*op), at(u), at(v), 0),
            Node::Select(k, u, v) => (Op::Select, at(k), at(u), at(v)),
            Node::Native(f, args) => {
                self.natives
                    .push((f.clone(), args.iter().map(at).collect()));
                (Op::Native, self.natives.len() as u32 - 1, 0, 0)
            }
            Node::Library(..) | Node::Constant(_) | Node::X(_) | Node::Param(_) => {
                unreachable!("expanded by lowering or an input")
            }
        };
        Instruction { op, a, b, c }
    }

    /// Returns the number of coordinates.
    pub fn dimension(&self) -> usize {
        self.n_x
    }
    /// Returns the number of parameters.
    pub fn n_params(&self) -> usize {
        self.n_params
    }
    /// Returns the number of operations.
    pub fn len(&self) -> usize {
        self.code.len()
    }
    /// Returns true if the tape has no operations.
    pub fn is_empty(&self) -> bool {
        self.code.is_empty()
    }
    /// Returns true if the tape calls native functions, whose iterations intervals cannot enclose.
    pub(crate) fn has_natives(&self) -> bool {
        !self.natives.is_empty()
    }
    /// Returns the number of results.
    pub fn n_results(&self) -> usize {
        self.roots.len()
    }

    /// Returns the slot of the first coordinate.
    pub(crate) fn first_x(&self) -> usize {
        self.constants.len()
    }
    /// Returns the slot of the first parameter.
    pub(crate) fn first_param(&self) -> usize {
        self.constants.len() + self.n_x
    }
    /// Returns the slot of the first operation.
    pub(crate) fn first_code(&self) -> usize {
        self.constants.len() + self.n_x + self.n_params
    }
    /// Returns the number of slots.
    pub(crate) fn slots(&self) -> usize {
        self.first_code() + self.code.len()
    }

    /// Iterates over the slots of an operation's arguments.
    pub(crate) fn arguments(&self, i: &Instruction) -> impl Iterator<Item = u32> + '_ {
        let (fixed, list): (usize, &[u32]) = match i.op {
            Op::Unary(_) | Op::PowI => (1, &[]),
            Op::Binary(_) | Op::Set(_) => (2, &[]),
            Op::Select => (3, &[]),
            Op::Native => (0, &self.natives[i.a as usize].1),
        };
        let fixed = [i.a, i.b, i.c].into_iter().take(fixed);
        fixed.chain(list.iter().copied())
    }

    /// Calls `each` for the slot of each argument; faster than an iterator on long tapes.
    #[inline(always)]
    pub(crate) fn for_arguments(&self, i: &Instruction, mut each: impl FnMut(u32)) {
        match i.op {
            Op::Unary(_) | Op::PowI => each(i.a),
            Op::Binary(_) | Op::Set(_) => {
                each(i.a);
                each(i.b);
            }
            Op::Select => [i.a, i.b, i.c].into_iter().for_each(each),
            Op::Native => self.natives[i.a as usize].1.iter().copied().for_each(each),
        }
    }

    /// Evaluates the first result at a point, in any number type. `scratch` may be reused between
    /// calls.
    ///
    /// # Panics
    /// If `x` or `a` is shorter than the tape's inputs.
    pub fn eval<R: Real>(&self, x: &[R], a: &[R], scratch: &mut Vec<R>) -> R {
        self.run(x, a, scratch, Native::eval);
        scratch[self.roots[0] as usize].clone()
    }

    /// Evaluates all results at a point, in any number type.
    pub fn eval_all<R: Real>(&self, x: &[R], a: &[R], scratch: &mut Vec<R>) -> Vec<R> {
        self.run(x, a, scratch, Native::eval);
        self.roots
            .iter()
            .map(|&r| scratch[r as usize].clone())
            .collect()
    }

    /// Bounds the first result over a box of inputs.
    pub(crate) fn range(
        &self,
        x: &[Interval],
        a: &[Interval],
        scratch: &mut Vec<Interval>,
    ) -> Interval {
        self.run(x, a, scratch, Native::range);
        scratch[self.roots[0] as usize]
    }

    /// Bounds the computed values of the first result at all points of a box, including rounding;
    /// unbounded if a value may be NaN.
    pub(crate) fn value_range(
        &self,
        x: &[Interval],
        a: &[Interval],
        scratch: &mut Vec<Interval>,
    ) -> Interval {
        let range = self.range(x, a, scratch);
        if self.numbers(scratch)[self.roots[0] as usize] {
            range
        } else {
            Interval::ALL
        }
    }

    /// Computes all slots, the first entries of `s`. The previous contents of `s` are irrelevant,
    /// and it may be longer.
    #[inline]
    fn run<R: Real>(&self, x: &[R], a: &[R], s: &mut Vec<R>, native: impl Fn(&Native, &[R]) -> R) {
        if s.len() < self.slots() {
            s.resize(self.slots(), R::constant(0.0));
        }
        let s = &mut s[..self.slots()];
        let (constants, rest) = s.split_at_mut(self.constants.len());
        for (slot, &c) in constants.iter_mut().zip(&self.constants) {
            *slot = R::constant(c);
        }
        let (to_x, rest) = rest.split_at_mut(self.n_x);
        to_x.clone_from_slice(&x[..self.n_x]);
        rest[..self.n_params].clone_from_slice(&a[..self.n_params]);
        let first = self.first_code();
        for (k, i) in self.code.iter().enumerate() {
            s[first + k] = self.apply(i, s, &native);
        }
    }

    /// Computes an operation from the slots of its arguments.
    #[inline(always)]
    fn apply<R: Real>(&self, i: &Instruction, s: &[R], native: impl Fn(&Native, &[R]) -> R) -> R {
        let (p, q) = (i.a as usize, i.b as usize);
        match i.op {
            Op::Unary(op) => op.apply(&s[p]),
            Op::Binary(op) => op.apply(&s[p], &s[q]),
            Op::Set(op) => op.apply(&s[p], &s[q]),
            Op::PowI => s[p].powi(i.c as i32),
            Op::Select => s[p].select(&s[q], &s[i.c as usize]),
            Op::Native => {
                let (f, args) = &self.natives[p];
                let args: Vec<R> = args.iter().map(|&k| s[k as usize].clone()).collect();
                native(f, &args)
            }
        }
    }

    /// Returns the slots that a slot depends on, including itself.
    fn slots_below(&self, slot: u32) -> BTreeSet<u32> {
        let mut need: BTreeSet<u32> = [slot].into();
        let mut pending = vec![slot];
        while let Some(slot) = pending.pop() {
            if let Some(at) = (slot as usize).checked_sub(self.first_code()) {
                pending.extend(self.arguments(&self.code[at]).filter(|&a| need.insert(a)));
            }
        }
        need
    }

    /// Creates a tape with these inputs and constants and without operations.
    pub(crate) fn with_inputs(n_x: usize, n_params: usize, constants: Vec<f64>) -> Self {
        Self {
            n_x,
            n_params,
            constants,
            code: Vec::new(),
            uniform: 0,
            natives: Vec::new(),
            roots: Vec::new(),
        }
    }

    /// Extracts the tape of result `k` alone, with the operations that it needs.
    pub(crate) fn result(&self, k: usize) -> Self {
        let first = self.first_code();
        let need = self.slots_below(self.roots[k]);
        let inputs = self.first_x() as u32..first as u32;
        let constants: Vec<u32> = need.iter().copied().filter(|&s| s < inputs.start).collect();
        let mut place: HashMap<u32, u32> =
            constants.iter().zip(0..).map(|(&s, to)| (s, to)).collect();
        let n = constants.len() as u32;
        place.extend(inputs.clone().map(|s| (s, s - inputs.start + n)));
        let values = constants.iter().map(|&s| self.constants[s as usize]);
        let mut tape = Self::with_inputs(self.n_x, self.n_params, values.collect());
        for &slot in need.range(inputs.end..) {
            let (k, at) = (slot as usize - first, |s: u32| place[&s]);
            let moved = self.moved(&self.code[k], at, &mut tape.natives);
            place.insert(slot, (tape.first_code() + tape.code.len()) as u32);
            tape.code.push(moved);
            tape.uniform += usize::from(k < self.uniform);
        }
        tape.roots.push(place[&self.roots[k]]);
        tape
    }

    /// Copies an operation into another tape, whose slots of the arguments `at` returns.
    pub(crate) fn moved(
        &self,
        i: &Instruction,
        at: impl Fn(u32) -> u32,
        natives: &mut Vec<(Native, Box<[u32]>)>,
    ) -> Instruction {
        match i.op {
            Op::Unary(_) | Op::PowI => Instruction { a: at(i.a), ..*i },
            Op::Binary(_) | Op::Set(_) => Instruction {
                a: at(i.a),
                b: at(i.b),
                ..*i
            },
            Op::Select => Instruction {
                a: at(i.a),
                b: at(i.b),
                c: at(i.c),
                ..*i
            },
            Op::Native => {
                let (f, args) = &self.natives[i.a as usize];
                natives.push((f.clone(), args.iter().map(|&s| at(s)).collect()));
                Instruction {
                    a: natives.len() as u32 - 1,
                    ..*i
                }
            }
        }
    }
}
