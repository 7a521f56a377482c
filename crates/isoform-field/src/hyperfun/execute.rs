//! Executor of programs, which defines the semantics of the language for every machine.

use super::ast::{Argument, ArrayRef, Expr, Link, Object, Operator, Statement};
use super::functions::{
    ArgumentShape, Arguments, Call, Formula, Function, Implementation, SENTINEL, Sentinel,
};
use super::machine::{Machine, TRUTH_TOLERANCE};
use super::{MAX_EXPRESSION_NODES, Mode, Program};
use crate::library::Library;
use crate::ops::{Binary, SetOp, Unary};
use std::cell::RefCell;

/// Cause of the early end of a run, with a byte offset in the program.
#[derive(Debug)]
pub(crate) enum RunStop {
    /// The program is in error.
    Error { at: u32, message: String },
    /// A value is required that the machine does not know.
    Unknown { at: u32, why: String },
}

type Outcome<T> = Result<T, Box<RunStop>>;

fn error<T>(at: u32, message: impl Into<String>) -> Outcome<T> {
    Err(Box::new(RunStop::Error {
        at,
        message: message.into(),
    }))
}
fn unknown<T>(at: u32, why: impl Into<String>) -> Outcome<T> {
    Err(Box::new(RunStop::Unknown {
        at,
        why: why.into(),
    }))
}

/// Executor of the objects of one program on a machine, with memory reused between runs.
pub(crate) struct Executor<'p, M: Machine> {
    program: &'p Program,
    machine: RefCell<M>,
    /// Frames of the objects under evaluation; unset items are `None`.
    memory: Vec<Option<M::V>>,
    /// Start of the frame of the innermost object.
    base: usize,
    /// Operands of chains under evaluation.
    operands: Vec<M::V>,
    /// Arguments of the function under evaluation.
    flat: Vec<M::V>,
    /// Number of steps of the present run.
    steps: u64,
    /// Maximum number of steps of a run.
    limit: u64,
    /// Nesting depth of branches under evaluation whose condition is unknown.
    branches: u32,
    /// True once such a branch has been run, since its steps are counted, too.
    has_branched: bool,
}

impl<'p, M: Machine> Executor<'p, M> {
    /// Creates an executor.
    pub(crate) fn new(program: &'p Program, machine: M, limit: u64) -> Self {
        Self {
            program,
            machine: RefCell::new(machine),
            memory: Vec::new(),
            base: 0,
            operands: Vec::new(),
            flat: Vec::new(),
            steps: 0,
            limit,
            branches: 0,
            has_branched: false,
        }
    }
    /// Returns true if the last run ended outside of branches with unknown conditions.
    pub(crate) fn is_certain(&self) -> bool {
        self.branches == 0
    }
    /// Returns the machine in its state after the runs.
    pub(crate) fn into_machine(self) -> M {
        self.machine.into_inner()
    }
    /// Returns the machine.
    fn m(&mut self) -> &mut M {
        self.machine.get_mut()
    }
    /// Returns true if the reference implementation is followed strictly.
    fn is_strict(&self) -> bool {
        self.program.mode == Mode::Strict
    }

    /// Evaluates f at x with parameters a, and updates the attributes `s`. The slices must have the
    /// lengths in the object's head.
    pub(crate) fn run(
        &mut self,
        object: usize,
        x: &[M::V],
        a: &[M::V],
        s: &mut [M::V],
    ) -> Outcome<M::V> {
        self.begin(object, x, a, s);
        for statement in 0..self.program.objects[object].body.len() {
            self.advance(object, statement)?;
        }
        self.end(object, s)
    }

    /// Initializes the frame of an object, see [`Executor::run`].
    pub(crate) fn begin(&mut self, object: usize, x: &[M::V], a: &[M::V], s: &[M::V]) {
        let object = &self.program.objects[object];
        debug_assert_eq!(
            (x.len(), a.len(), s.len()),
            (object.dimension(), object.n_params(), object.n_s())
        );
        self.base = 0;
        self.steps = 0;
        self.operands.clear();
        self.memory.clear();
        self.memory
            .extend(x.iter().chain(a).chain(s.iter()).cloned().map(Some));
        self.memory.resize(object.memory(), None);
    }

    /// Runs one statement of the object whose frame was initialized.
    pub(crate) fn advance(&mut self, object: usize, statement: usize) -> Outcome<()> {
        let object = &self.program.objects[object];
        self.statement(object, &object.body[statement])
    }

    /// Returns f of the object whose statements have been run, and stores its attributes in `s`.
    pub(crate) fn end(&mut self, object: usize, s: &mut [M::V]) -> Outcome<M::V> {
        let object = &self.program.objects[object];
        let f = self.result(object)?;
        let from = object.dimension() + object.n_params();
        for (out, item) in s.iter_mut().zip(&self.memory[from..]) {
            if let Some(item) = item {
                *out = item.clone();
            }
        }
        if !self.is_strict() && M::CHECKED && !self.m().known(&f).is_none_or(f64::is_finite) {
            return error(object.result_at, "the result is not a finite number");
        }
        Ok(f)
    }

    /// Evaluates the object whose frame is initialized.
    fn object(&mut self, object: &'p Object) -> Outcome<M::V> {
        self.block(object, &object.body)?;
        self.result(object)
    }

    /// Returns the value of an object whose statements have been run.
    fn result(&mut self, object: &'p Object) -> Outcome<M::V> {
        let f = self.eval(object, &object.result)?;
        self.m().assigned(&f, &object.name);
        Ok(f)
    }

    /// Counts `cost` steps; stops the run beyond the limit.
    fn step(&mut self, at: u32, cost: usize) -> Outcome<()> {
        self.steps += cost as u64;
        if self.m().is_too_large() {
            return unknown(
                at,
                format!("the expression has more than {MAX_EXPRESSION_NODES} nodes"),
            );
        }
        if self.steps <= self.limit {
            return Ok(());
        }
        let message = format!("stopped after {} steps: does this end?", self.limit);
        // Steps counted in branches that are not taken would not stop a direct run.
        if M::CHECKED || !self.has_branched {
            error(at, message)
        } else {
            unknown(at, message)
        }
    }

    /// Runs statements in order.
    fn block(&mut self, object: &'p Object, statements: &'p [Statement]) -> Outcome<()> {
        for statement in statements {
            self.statement(object, statement)?;
        }
        Ok(())
    }

    /// Runs one statement.
    #[inline(always)]
    fn statement(&mut self, object: &'p Object, statement: &'p Statement) -> Outcome<()> {
        match statement {
            Statement::Assign { slot, value } => {
                let v = self.assigned(object, value, object.variable(*slot))?;
                let at = self.base + *slot as usize;
                self.memory[at] = Some(v);
            }
            Statement::AssignItem {
                array,
                index,
                value,
            } => {
                let v = self.assigned(object, value, "")?;
                let at = self.item(object, *array, index)?;
                self.memory[at] = Some(v);
            }
            Statement::AssignArray { array, values, .. } => {
                self.steps += values.len() as u64;
                let start = self.base + array.start as usize;
                // Defaults are replaced by the parameters in the model itself, but not in objects
                // that it calls.
                if self.base == 0 && object.defaults.is_some_and(|d| d.array == *array) {
                    for k in 0..values.len() {
                        self.memory[start + k] = self.memory[object.dimension() + k].clone();
                    }
                    return Ok(());
                }
                let machine = self.machine.get_mut();
                for (item, v) in self.memory[start..].iter_mut().zip(values) {
                    *item = Some(machine.constant(*v));
                }
            }
            Statement::If {
                at,
                condition,
                then,
                otherwise,
            } => {
                self.step(*at, 1)?;
                let otherwise = otherwise.as_deref().unwrap_or(&[]);
                let condition = self.condition(object, condition)?;
                match self.m().known(&condition) {
                    Some(c) => self.block(object, if c != 0.0 { then } else { otherwise })?,
                    None => self.both(object, *at, &condition, then, otherwise)?,
                }
            }
            Statement::While {
                at,
                condition,
                body,
            } => self.repeated(object, *at, condition, body)?,
        }
        Ok(())
    }

    /// Returns the value that is assigned to a variable, which receives its name.
    #[inline]
    fn assigned(&mut self, object: &'p Object, value: &'p Expr, name: &str) -> Outcome<M::V> {
        let v = self.eval(object, value)?;
        self.steps += 1;
        self.m().assigned(&v, name);
        Ok(v)
    }

    /// Runs a loop while its condition holds; stops the run if the condition is unknown.
    fn repeated(
        &mut self,
        object: &'p Object,
        at: u32,
        condition: &'p Expr,
        body: &'p [Statement],
    ) -> Outcome<()> {
        loop {
            self.step(at, 1)?;
            let c = self.condition(object, condition)?;
            match self.m().known(&c) {
                Some(c) if c != 0.0 => self.block(object, body)?,
                Some(_) => return Ok(()),
                None => {
                    let why = "whether the loop goes on depends on the point or the parameters";
                    return unknown(at, why);
                }
            }
        }
    }

    /// Runs both branches and selects item by item.
    fn both(
        &mut self,
        object: &'p Object,
        at: u32,
        c: &M::V,
        then: &'p [Statement],
        otherwise: &'p [Statement],
    ) -> Outcome<()> {
        self.step(at, object.memory())?;
        let before = self.memory[self.base..].to_vec();
        self.branches += 1;
        self.has_branched = true;
        self.block(object, then)?;
        let after_then: Vec<Option<M::V>> = self.memory.drain(self.base..).collect();
        self.memory.extend(before);
        self.block(object, otherwise)?;
        self.branches -= 1;
        let machine = self.machine.get_mut();
        for (item, chosen) in self.memory[self.base..].iter_mut().zip(after_then) {
            if let (Some(a), Some(b)) = (&chosen, &*item)
                && machine.same(a, b)
            {
                continue;
            }
            if chosen.is_none() && item.is_none() {
                continue;
            }
            let unset = machine.constant(f64::NAN);
            let (a, b) = (
                chosen.unwrap_or_else(|| unset.clone()),
                item.clone().unwrap_or(unset),
            );
            *item = Some(machine.select(c, &a, &b));
        }
        Ok(())
    }

    /// Evaluates a condition as 0 or 1.
    fn condition(&mut self, object: &'p Object, condition: &'p Expr) -> Outcome<M::V> {
        let v = self.eval(object, condition)?;
        self.m().stands_at(condition.at());
        Ok(self.m().truth(&v))
    }

    /// Returns the memory position of an array's item.
    fn item(&mut self, object: &'p Object, array: ArrayRef, index: &'p Expr) -> Outcome<usize> {
        let value = match index {
            Expr::Number { value, .. } => *value,
            _ => {
                let v = self.eval(object, index)?;
                match self.m().known(&v) {
                    Some(value) => value,
                    None => {
                        return unknown(
                            index.at(),
                            "the index depends on the point or the parameters",
                        );
                    }
                }
            }
        };
        let i = (value + 0.5).floor();
        if i >= 1.0 && i <= f64::from(array.len) {
            return Ok(self.base + array.start as usize + i as usize - 1);
        }
        let message = out_of_range(object, array, i);
        if M::CHECKED || self.branches == 0 {
            error(index.at(), message)
        } else {
            unknown(index.at(), message)
        }
    }

    /// Reads an item of the memory; an unset one is an error, or NaN if the machine does not detect
    /// errors.
    fn read(&mut self, at: u32, place: usize, name: impl FnOnce() -> String) -> Outcome<M::V> {
        match &self.memory[place] {
            Some(v) => Ok(v.clone()),
            None if M::CHECKED => error(at, format!("{} has no value yet", name())),
            None => Ok(self.m().constant(f64::NAN)),
        }
    }

    /// Evaluates an expression.
    fn eval(&mut self, object: &'p Object, expr: &'p Expr) -> Outcome<M::V> {
        self.steps += 1;
        match expr {
            Expr::Number { value, .. } => Ok(self.m().constant(*value)),
            Expr::Variable { at, slot } => self.read(*at, self.base + *slot as usize, || {
                format!("`{}`", object.variable(*slot))
            }),
            Expr::Item { at, array, index } => {
                let place = self.item(object, *array, index)?;
                let number = place - (self.base + array.start as usize) + 1;
                let name = &object.arrays[array.id as usize].name;
                self.read(*at, place, || format!("`{name}[{number}]`"))
            }
            Expr::Group { inner, .. } => self.eval(object, inner),
            Expr::Sign { sign, operand, .. } => {
                let v = self.eval(object, operand)?;
                Ok(if *sign == "+" { v } else { self.m().neg(&v) })
            }
            Expr::Not { operand, .. } => {
                let v = self.condition(object, operand)?;
                Ok(negation(self.m(), &v))
            }
            Expr::Chain { first, rest } => self.chain(object, first, rest),
            Expr::Function {
                at,
                function,
                arguments,
            } => self.function(object, *at, *function, arguments),
            Expr::Call {
                at,
                object: called,
                arguments,
            } => self.call(object, *at, *called, arguments),
        }
    }

    /// Evaluates the operands of a chain from last to first, as the reference implementation does
    /// (relevant for functions that modify their arguments), then applies the operators from left
    /// to right.
    fn chain(&mut self, object: &'p Object, first: &'p Expr, rest: &'p [Link]) -> Outcome<M::V> {
        if let [link] = rest {
            let right = self.eval(object, &link.operand)?;
            let left = self.eval(object, first)?;
            return self.operator(link, &left, &right);
        }
        let bottom = self.operands.len();
        for link in rest.iter().rev() {
            let v = self.eval(object, &link.operand)?;
            self.operands.push(v);
        }
        let mut left = self.eval(object, first)?;
        for link in rest {
            let Some(right) = self.operands.pop() else {
                break;
            };
            left = self.operator(link, &left, &right)?;
        }
        debug_assert_eq!(self.operands.len(), bottom);
        Ok(left)
    }

    /// Applies one operator of a chain.
    fn operator(&mut self, link: &Link, u: &M::V, v: &M::V) -> Outcome<M::V> {
        let strict = self.is_strict();
        let m = self.machine.get_mut();
        m.stands_at(link.at);
        let compare = |m: &mut M, op: Binary, u: &M::V, v: &M::V| {
            let c = m.binary(op, u, v);
            m.boolean(c)
        };
        Ok(match link.operator {
            Operator::Add => m.add(u, v),
            Operator::Subtract => m.sub(u, v),
            Operator::Multiply => m.mul(u, v),
            Operator::Divide => return quotient(m, link.at, strict, u, v),
            Operator::Power => return power(m, link.at, strict, u, v, link.operand.is_literal()),
            Operator::Union => m.set(SetOp::RUnion, u, v),
            Operator::Intersection | Operator::Cartesian => m.set(SetOp::RIntersection, u, v),
            Operator::Difference => {
                let v = m.neg(v);
                m.set(SetOp::RIntersection, u, &v)
            }
            Operator::Less => compare(m, Binary::Less, u, v),
            Operator::LessEq => compare(m, Binary::LessEq, u, v),
            Operator::Greater => compare(m, Binary::Less, v, u),
            Operator::GreaterEq => compare(m, Binary::LessEq, v, u),
            Operator::Equal | Operator::NotEqual => {
                let d = m.sub(u, v);
                let (d, eps) = (m.abs(&d), m.constant(TRUTH_TOLERANCE));
                if link.operator == Operator::Equal {
                    compare(m, Binary::Less, &d, &eps)
                } else {
                    compare(m, Binary::LessEq, &eps, &d)
                }
            }
            Operator::And => both_hold(m, u, v),
            Operator::Or => one_holds(m, u, v),
        })
    }

    /// Calls an object in a new frame after the caller's; arguments are copied in and `s` is copied
    /// back.
    fn call(
        &mut self,
        object: &'p Object,
        at: u32,
        called: u32,
        arguments: &'p [(u32, ArrayRef)],
    ) -> Outcome<M::V> {
        let program = self.program;
        let callee = &program.objects[called as usize];
        self.step(at, 1 + callee.memory())?;
        for (at, array) in arguments.iter().rev() {
            self.require_set(object, *at, *array)?;
        }
        let (caller, base) = (self.base, self.memory.len());
        for (_, array) in arguments {
            let from = caller + array.start as usize;
            self.memory
                .extend_from_within(from..from + array.len as usize);
        }
        if arguments.len() < 3 {
            let zero = self.m().constant(0.0);
            self.memory.push(Some(zero));
        }
        self.memory.resize(base + callee.memory(), None);
        self.base = base;
        let f = self.object(callee)?;
        self.base = caller;
        if let Some((_, array)) = arguments.get(2) {
            let from = base + callee.dimension() + callee.n_params();
            let to = caller + array.start as usize;
            self.take_back(from, to, array.len as usize);
        }
        self.memory.truncate(base);
        Ok(f)
    }

    /// Moves items within the memory.
    fn take_back(&mut self, from: usize, to: usize, n: usize) {
        for i in 0..n {
            self.memory[to + i] = self.memory[from + i].take();
        }
    }

    /// Requires that all items of an array are set; if the machine does not detect errors, unset
    /// ones become NaN.
    fn require_set(&mut self, object: &Object, at: u32, array: ArrayRef) -> Outcome<()> {
        let start = self.base + array.start as usize;
        let Some(i) = self.memory[start..start + array.len as usize]
            .iter()
            .position(Option::is_none)
        else {
            return Ok(());
        };
        if M::CHECKED {
            let name = &object.arrays[array.id as usize].name;
            return error(
                at,
                format!(
                    "`{name}` goes to a function, but `{name}[{}]` has no value yet",
                    i + 1
                ),
            );
        }
        let unset = self.m().constant(f64::NAN);
        for item in self.memory[start..start + array.len as usize]
            .iter_mut()
            .filter(|i| i.is_none())
        {
            *item = Some(unset.clone());
        }
        Ok(())
    }

    /// Calls a function of the library.
    fn function(
        &mut self,
        object: &'p Object,
        at: u32,
        function: u16,
        arguments: &'p [Argument],
    ) -> Outcome<M::V> {
        let entry = &Function::<M>::TABLE[function as usize];
        let mut args = Arguments::<M::V>::default();
        let items = self.arguments(object, arguments, &mut args)?;
        // Each item of an array causes a formula, whose expression remains in memory.
        self.step(
            at,
            if M::CHECKED {
                items
            } else {
                STEPS_PER_ITEM * items
            },
        )?;
        // In the default mode the parser rejects such arguments.
        if self.is_strict() && entry.has_wrong_point(arguments) {
            return Ok(self.m().constant(SENTINEL));
        }
        self.m().stands_at(at);
        let v = match entry.run {
            Implementation::Primitive(library, sentinel) => {
                let v = self.primitive(entry, &args, library, sentinel);
                self.m()
                    .suggest(&v, || part_name(object, entry.names[0], arguments));
                v
            }
            Implementation::Formula(run) => self.formula(at, run, &args)?,
        };
        if M::CHECKED && !self.is_strict() && self.is_unusable(entry, &args, &v) {
            let name = entry.names[0];
            let message = format!("`{name}` gives no finite number for these arguments");
            return error(at, message);
        }
        Ok(v)
    }

    /// Evaluates the arguments of a function, from last to first as the reference implementation
    /// does; returns the number of items in their arrays.
    #[inline]
    fn arguments(
        &mut self,
        object: &'p Object,
        arguments: &'p [Argument],
        args: &mut Arguments<M::V>,
    ) -> Outcome<usize> {
        let mut items = 0;
        for (i, argument) in arguments.iter().enumerate().rev() {
            match argument {
                Argument::Number(expr) => args.numbers[i] = Some(self.eval(object, expr)?),
                Argument::Array(at, array) => {
                    self.require_set(object, *at, *array)?;
                    items += array.len as usize;
                    args.arrays[i] = (self.base + array.start as usize, array.len as usize);
                }
            }
        }
        Ok(items)
    }

    /// Evaluates a library function that is one node, with flat arguments.
    #[inline]
    fn primitive(
        &mut self,
        entry: &Function<M>,
        args: &Arguments<M::V>,
        library: Library,
        sentinel: Sentinel,
    ) -> M::V {
        let mut flat = std::mem::take(&mut self.flat);
        flat.clear();
        for (i, (_, shape)) in entry.arguments.iter().enumerate() {
            match &args.numbers[i] {
                Some(v) if *shape == ArgumentShape::Number => flat.push(v.clone()),
                _ => {
                    let start = args.arrays[i].0;
                    flat.extend(self.memory[start..start + 3].iter().flatten().cloned());
                }
            }
        }
        let mut v = self.m().library(library, &flat);
        if self.is_strict() {
            v = sentinel.apply(self.m(), &flat, v);
        }
        self.flat = flat;
        v
    }

    /// Evaluates a library function that is a formula, within the remaining steps.
    #[inline]
    fn formula(&mut self, at: u32, run: Formula<M>, args: &Arguments<M::V>) -> Outcome<M::V> {
        let left = self.limit.saturating_sub(self.steps);
        let mut call = Call::new(&self.machine, &mut self.memory, args, self.program, left);
        match run(&mut call) {
            Ok(v) => {
                let spent = call.spent;
                let v = v.v;
                self.step(at, spent as usize)?;
                Ok(v)
            }
            Err(fault) if fault.unknown => unknown(at, fault.message),
            Err(fault) => error(at, fault.message),
        }
    }

    /// Returns true if a function's value, or an item that it wrote, is NaN or an inadmissible
    /// infinity.
    #[inline]
    fn is_unusable(&mut self, entry: &Function<M>, args: &Arguments<M::V>, v: &M::V) -> bool {
        let m = self.machine.get_mut();
        let is_bad = |v: &M::V| {
            m.known(v).is_some_and(|v| {
                if entry.may_overflow {
                    v.is_nan()
                } else {
                    !v.is_finite()
                }
            })
        };
        let is_written_badly = |&i: &usize| {
            let (start, len) = args.arrays[i];
            self.memory[start..start + len].iter().flatten().any(is_bad)
        };
        is_bad(v) || entry.writes.filter(is_written_badly).is_some()
    }
}

/// Number of steps charged per array item passed to a function in the construction of an
/// expression: about the number of nodes that it creates. The maximum is 150 nodes per 9 items, for
/// triangles.
const STEPS_PER_ITEM: usize = 16;

/// Returns the name of an inline primitive: that of its centre if it is a local array, else that of
/// the function without "hf".
fn part_name(object: &Object, function: &str, arguments: &[Argument]) -> String {
    match arguments.get(1) {
        Some(Argument::Array(_, array)) if array.id >= 3 => {
            object.arrays[array.id as usize].name.clone()
        }
        _ => function
            .strip_prefix("hf")
            .unwrap_or(function)
            .to_ascii_lowercase(),
    }
}

/// Returns u / v; an error if v is known to be 0, in strict mode if |v| < TRUTH_TOLERANCE.
fn quotient<M: Machine>(m: &mut M, at: u32, strict: bool, u: &M::V, v: &M::V) -> Outcome<M::V> {
    let least = if strict {
        TRUTH_TOLERANCE
    } else {
        f64::MIN_POSITIVE
    };
    if M::CHECKED && m.known(v).is_some_and(|v| v.abs() < least) {
        return error(at, "division by zero");
    }
    Ok(m.div(u, v))
}

/// Returns 1 where u and v are true, else 0.
fn both_hold<M: Machine>(m: &mut M, u: &M::V, v: &M::V) -> M::V {
    let (u, v) = (m.truth(u), m.truth(v));
    let zero = m.constant(0.0);
    let c = m.select(&u, &v, &zero);
    m.boolean(c)
}

/// Returns 1 where u or v is true, else 0.
fn one_holds<M: Machine>(m: &mut M, u: &M::V, v: &M::V) -> M::V {
    let (u, v) = (m.truth(u), m.truth(v));
    let one = m.constant(1.0);
    let c = m.select(&u, &one, &v);
    m.boolean(c)
}

/// Returns 0 where the condition holds, else 1.
fn negation<M: Machine>(m: &mut M, condition: &M::V) -> M::V {
    let (zero, one) = (m.constant(0.0), m.constant(1.0));
    let n = m.select(condition, &zero, &one);
    m.boolean(n)
}

/// Returns u ^ v: an integer power if v − ⌊v⌋ < TRUTH_TOLERANCE, else exp(v ln u). In strict mode u
/// counts as 0 if |u| < TRUTH_TOLERANCE.
fn power<M: Machine>(
    m: &mut M,
    at: u32,
    strict: bool,
    u: &M::V,
    v: &M::V,
    literal: bool,
) -> Outcome<M::V> {
    let Some(exponent) = m.known(v) else {
        return Ok(open_power(m, strict, u, v));
    };
    let whole = exponent - exponent.floor() < TRUTH_TOLERANCE;
    if M::CHECKED
        && let Some(base) = m.known(u)
    {
        let is_zero = if strict {
            base.abs() < TRUTH_TOLERANCE
        } else {
            base == 0.0
        };
        if is_zero && exponent <= TRUTH_TOLERANCE {
            return error(at, "power of zero with an exponent that is not positive");
        }
        if is_zero && strict {
            return Ok(m.constant(0.0));
        }
        if !is_zero && base < 0.0 && !whole {
            return error(
                at,
                "power of a negative number with an exponent that is not an integer",
            );
        }
    }
    let n = (exponent.abs() + 0.5).floor().copysign(exponent);
    let p = if !whole {
        m.binary(Binary::Pow, u, v)
    } else if n.abs() <= f64::from(i32::MAX) {
        let p = m.powi(u, n as i32);
        if literal || !m.known(u).is_some_and(|u| u > 0.0) {
            p
        } else {
            with_slope(m, u, v, exponent, &p)
        }
    } else {
        let size = m.abs(u);
        m.binary(Binary::Pow, &size, v)
    };
    if M::CHECKED || !strict {
        return Ok(p);
    }
    Ok(flattened(m, u, &p))
}

/// Returns p + p ln u (v − `value`): the value p, with the correct derivative by an exponent v that
/// happens to be an integer.
fn with_slope<M: Machine>(m: &mut M, u: &M::V, v: &M::V, value: f64, p: &M::V) -> M::V {
    let (ln, value) = (m.unary(Unary::Ln, u), m.constant(value));
    let change = m.sub(v, &value);
    let change = m.mul(&ln, &change);
    let change = m.mul(p, &change);
    m.add(p, &change)
}

/// Returns 0 where |u| < TRUTH_TOLERANCE, else p.
fn flattened<M: Machine>(m: &mut M, u: &M::V, p: &M::V) -> M::V {
    let (size, eps, zero) = (m.abs(u), m.constant(TRUTH_TOLERANCE), m.constant(0.0));
    let c = m.less(&size, &eps);
    m.select(&c, &zero, p)
}

/// Returns u ^ v for an unknown exponent: u^v for u > 0, else ±|u|^v for an integer v, NaN for
/// another.
fn open_power<M: Machine>(m: &mut M, strict: bool, u: &M::V, v: &M::V) -> M::V {
    let (zero, one, nan, eps) = (
        m.constant(0.0),
        m.constant(1.0),
        m.constant(f64::NAN),
        m.constant(TRUTH_TOLERANCE),
    );
    let positive = m.less(&zero, u);
    let size = m.abs(u);
    let nothing = m.less_eq(&size, &zero);
    let safe = m.select(&nothing, &one, &size);
    let p = m.binary(Binary::Pow, &safe, v);
    let n = m.unary(Unary::Floor, v);
    let rest = m.sub(v, &n);
    let whole = m.less(&rest, &eps);
    let half = m.scale(0.5, &n);
    let even = m.unary(Unary::Floor, &half);
    let even = m.scale(2.0, &even);
    let odd = m.less(&even, &n);
    let minus = m.neg(&p);
    let signed = m.select(&odd, &minus, &p);
    let negative = m.select(&whole, &signed, &nan);
    let rising = m.less(&eps, v);
    let at_zero = m.select(&rising, &zero, &nan);
    let other = m.select(&nothing, &at_zero, &negative);
    let p = m.select(&positive, &p, &other);
    if strict { flattened(m, u, &p) } else { p }
}

/// Returns the message that an index is out of the range of its array.
fn out_of_range(object: &Object, array: ArrayRef, index: f64) -> String {
    let (own, name) = (&object.name, &object.arrays[array.id as usize].name);
    let (owner, item) = match array.id {
        0 => (own, "coordinate"),
        1 => (own, "parameter"),
        2 => (own, "attribute"),
        _ => (name, "item"),
    };
    let many = if array.len == 1 { "" } else { "s" };
    let from = if index < 1.0 { ", counted from 1" } else { "" };
    format!(
        "{name}[{index}]: {owner} has {} {item}{many}{from}",
        array.len
    )
}
