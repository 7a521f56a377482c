//! Evaluators that run a tape over blocks of points: values forward, derivatives in reverse mode.
//!
//! Each slot holds one value per lane. The loops over lanes are compiled for the baseline, AVX2 and
//! AVX-512, and one version is selected at run time. They use no fused multiply-add: every
//! evaluator rounds like the oracle, on every machine.
//!
//! The reverse sweep propagates the adjoint ∂f/∂w of a slot w to its arguments: ∂f/∂u += ∂f/∂w ·
//! ∂w/∂u. A [`Plan`] determines in advance which adjoints contribute to a requested derivative, and
//! which contribution to a slot is the first, so that adjoints need not be cleared.

use crate::library::Native;
use crate::ops::{Binary, SetOp, Unary};
use crate::tape::{Op, Tape};
use isoform_geom::Point3;
use isoform_num::{Jet1, Real, dispatch};
use std::cell::Cell;

/// Number of points in a block. With 32 lanes the values and adjoints of some sixty slots fit into
/// the first-level cache; 64 lanes were slower by 40 %.
pub(crate) const LANES: usize = 32;

/// Values of all lanes, aligned to a cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Lane<const L: usize>(pub(crate) [f64; L]);

/// Values at the points of a block.
pub(crate) type Row = Lane<LANES>;
const ZERO: Row = Lane([0.0; LANES]);

/// Derivatives that a reverse sweep computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GradientInputs {
    /// Derivatives ∂f/∂a by the parameters.
    Params,
    /// Derivatives ∂f/∂x by the coordinates.
    Space,
    /// Derivatives by coordinates and parameters.
    All,
}

/// Plan of the reverse sweep for one operation.
#[derive(Clone, Copy, Debug, Default)]
struct AdjointStep {
    /// True if the operation has an adjoint that is used.
    live: bool,
    /// Bit k is set if argument k depends on an input whose derivative is requested.
    active: u8,
    /// Bit k is set if the contribution to the adjoint of argument k is the first in the sweep,
    /// which is stored instead of added.
    first: u8,
}

/// Plan of a reverse sweep over a tape.
#[derive(Clone, Debug, Default)]
pub(crate) struct Plan {
    /// Plan of each operation of the tape.
    steps: Vec<AdjointStep>,
    /// Slots of the requested inputs on which the result does not depend: their adjoints are 0.
    unreached: Vec<u32>,
    /// True if an adjoint of 0 stays 0 also when it is multiplied by an infinite derivative.
    guard: bool,
}

impl Plan {
    /// Plans the sweep that computes the requested derivatives of the first result.
    pub(crate) fn new(tape: &Tape, wanted: GradientInputs) -> Self {
        let (steps, unreached) = plan(tape, wanted);
        // Operations of a branch that is not taken may be singular: 0 · ∞ must be 0 there.
        let guard = tape
            .code
            .iter()
            .any(|i| matches!(i.op, Op::Select | Op::Set(SetOp::Max | SetOp::Min)));
        Self {
            steps,
            unreached,
            guard,
        }
    }

    /// Returns slopes to be computed, one for each operation that depends on the parameters alone.
    fn slopes(&self, tape: &Tape) -> Vec<f64> {
        let is_swept = self.steps[..tape.uniform].iter().any(|step| step.live);
        vec![0.0; if is_swept { tape.uniform } else { 0 }]
    }
}

thread_local! {
    /// Rows of finished blocks of this thread, for reuse.
    static ROWS: Cell<Vec<Row>> = const { Cell::new(Vec::new()) };
}

/// Scratch space of the block evaluators for one tape and one thread.
#[derive(Clone, Debug)]
pub(crate) struct Block<'t> {
    tape: &'t Tape,
    /// Values of the tape's slots.
    slots: Vec<Row>,
    /// Derivatives of the first result by the slots; empty if only values are computed.
    adjoints: Vec<Row>,
    /// Derivatives of the unary operations that depend on the parameters alone, by operation, and 0
    /// for others; empty if no such operation is in the sweep. They are equal at all points.
    slopes: Vec<f64>,
    plan: Option<&'t Plan>,
}

impl<'t> Block<'t> {
    /// Returns a block that computes values only.
    pub(crate) fn values(tape: &'t Tape) -> Self {
        Self {
            tape,
            slots: vec![ZERO; tape.slots()],
            adjoints: Vec::new(),
            slopes: Vec::new(),
            plan: None,
        }
        .with_constants()
    }

    /// Runs `run` with a block for values whose rows this thread keeps for reuse. New rows would
    /// have to be fetched into the caches, which costs more than evaluating a short tape for some
    /// blocks. A nested call on this thread allocates its own rows.
    pub(crate) fn with_kept_rows<R>(tape: &'t Tape, run: impl FnOnce(&mut Self) -> R) -> R {
        let mut slots = ROWS.take();
        if slots.len() < tape.slots() {
            slots.resize(tape.slots(), ZERO);
        }
        let mut block = Self {
            tape,
            slots,
            adjoints: Vec::new(),
            slopes: Vec::new(),
            plan: None,
        }
        .with_constants();
        let result = run(&mut block);
        ROWS.set(block.slots);
        result
    }

    /// Returns a block that computes values and the planned derivatives of the first result.
    pub(crate) fn gradients(tape: &'t Tape, plan: &'t Plan) -> Self {
        let rows = || vec![ZERO; tape.slots()];
        Self {
            tape,
            slots: rows(),
            adjoints: rows(),
            slopes: plan.slopes(tape),
            plan: Some(plan),
        }
        .with_constants()
    }

    /// Fills the slots of the constants.
    fn with_constants(mut self) -> Self {
        for (slot, &c) in self.slots.iter_mut().zip(&self.tape.constants) {
            slot.0 = [c; LANES];
        }
        self
    }

    /// Sets the parameters and computes the operations that depend on them alone, with their
    /// slopes. Call it before loading points.
    ///
    /// # Panics
    /// If `a` is shorter than the tape's parameters.
    pub(crate) fn bind(&mut self, a: &[f64]) {
        let first = self.tape.first_param();
        for (slot, &v) in self.slots[first..].iter_mut().zip(&a[..self.tape.n_params]) {
            slot.0 = [v; LANES];
        }
        forward(self.tape, 0, self.tape.uniform, &mut self.slots);
        for (slope, i) in self.slopes.iter_mut().zip(&self.tape.code) {
            if let Op::Unary(op) = i.op {
                *slope = unary_slope(op, self.slots[i.a as usize].0[0]);
            }
        }
    }

    /// Loads up to [`LANES`] points; the last one is repeated in the remaining lanes.
    pub(crate) fn load(&mut self, points: &[Point3]) {
        let first = self.tape.first_x();
        for (axis, slot) in self.slots[first..first + self.tape.n_x.min(3)]
            .iter_mut()
            .enumerate()
        {
            if let Ok(full) = <&[Point3; LANES]>::try_from(points) {
                for (v, p) in slot.0.iter_mut().zip(full) {
                    *v = p[axis];
                }
            } else {
                for (l, v) in slot.0.iter_mut().enumerate() {
                    *v = points[l.min(points.len() - 1)][axis];
                }
            }
        }
    }

    /// Loads one point per lane, given by coordinates.
    pub(crate) fn load_rows(&mut self, rows: &[Row; 3]) {
        let first = self.tape.first_x();
        self.slots[first..first + self.tape.n_x.min(3)]
            .copy_from_slice(&rows[..self.tape.n_x.min(3)]);
    }

    /// Computes and returns the values of the first result at the loaded points.
    pub(crate) fn forward(&mut self) -> &[f64; LANES] {
        forward(
            self.tape,
            self.tape.uniform,
            self.tape.code.len(),
            &mut self.slots,
        );
        self.result(0)
    }

    /// Returns result `k` at the loaded points, after [`Block::forward`].
    pub(crate) fn result(&self, k: usize) -> &[f64; LANES] {
        &self.slots[self.tape.roots[k] as usize].0
    }

    /// Computes the derivatives of the first result at the loaded points, after [`Block::forward`].
    pub(crate) fn reverse(&mut self) {
        let plan = self.plan.expect("the block was made for gradients");
        for &slot in &plan.unreached {
            self.adjoints[slot as usize] = ZERO;
        }
        if !self.tape.natives.is_empty() {
            // Native calls add to the adjoints of their arguments, which must start from zero.
            self.adjoints.fill(ZERO);
        }
        self.adjoints[self.tape.roots[0] as usize] = Lane([1.0; LANES]);
        if plan.guard {
            reverse_guarded(
                self.tape,
                &plan.steps,
                &self.slopes,
                &self.slots,
                &mut self.adjoints,
            );
        } else {
            reverse_plain(
                self.tape,
                &plan.steps,
                &self.slopes,
                &self.slots,
                &mut self.adjoints,
            );
        }
    }

    /// Returns ∂f/∂a, one row per parameter, after [`Block::reverse`].
    pub(crate) fn by_params(&self) -> &[Row] {
        let first = self.tape.first_param();
        &self.adjoints[first..first + self.tape.n_params]
    }

    /// Returns ∂f/∂x, one row per coordinate, after [`Block::reverse`].
    pub(crate) fn by_space(&self) -> &[Row] {
        let first = self.tape.first_x();
        &self.adjoints[first..first + self.tape.n_x]
    }
}

/// Returns the slots of the inputs whose derivatives are requested.
fn wanted_inputs(tape: &Tape, wanted: GradientInputs) -> std::ops::Range<usize> {
    let (x, p, code) = (tape.first_x(), tape.first_param(), tape.first_code());
    match wanted {
        GradientInputs::Params => p..code,
        GradientInputs::Space => x..p,
        GradientInputs::All => x..code,
    }
}

/// Returns, for each slot, true if it depends on one of the inputs.
fn active_slots(tape: &Tape, inputs: std::ops::Range<usize>) -> Vec<bool> {
    let mut active = vec![false; tape.slots()];
    active[inputs].fill(true);
    for (k, i) in tape.code.iter().enumerate() {
        active[tape.first_code() + k] = tape.arguments(i).any(|a| active[a as usize]);
    }
    active
}

/// Returns the steps of the reverse sweep for the requested inputs, and the slots of those inputs
/// that it does not reach.
fn plan(tape: &Tape, wanted: GradientInputs) -> (Vec<AdjointStep>, Vec<u32>) {
    let code = tape.first_code();
    let inputs = wanted_inputs(tape, wanted);
    let active = active_slots(tape, inputs.clone());
    let mut reached = vec![false; tape.slots()];
    reached[tape.roots[0] as usize] = true;
    let mut steps = vec![AdjointStep::default(); tape.code.len()];
    for (k, i) in tape.code.iter().enumerate().rev() {
        if !(reached[code + k] && active[code + k]) {
            continue;
        }
        let step = &mut steps[k];
        step.live = true;
        // The derivative of a selection by its condition is 0.
        for (n, a) in tape
            .arguments(i)
            .enumerate()
            .filter(|(n, _)| !(i.op == Op::Select && *n == 0))
        {
            if active[a as usize] {
                if i.op != Op::Native {
                    step.active |= 1 << n;
                    step.first |= u8::from(!reached[a as usize]) << n;
                }
                reached[a as usize] = true;
            }
        }
    }
    let unreached = inputs.filter(|&i| !reached[i]).map(|i| i as u32).collect();
    (steps, unreached)
}

/// Computes out = f(a), lane by lane.
#[inline(always)]
fn map1(out: &mut Row, a: &Row, f: impl Fn(f64) -> f64) {
    for l in 0..LANES {
        out.0[l] = f(a.0[l]);
    }
}

/// Computes out = f(a, b), lane by lane.
#[inline(always)]
fn map2(out: &mut Row, a: &Row, b: &Row, f: impl Fn(f64, f64) -> f64) {
    for l in 0..LANES {
        out.0[l] = f(a.0[l], b.0[l]);
    }
}

dispatch! { fn forward(tape: &Tape, from: usize, to: usize, slots: &mut [Row]) = forward_body }

/// Computes the operations `from..to` of the tape, one row of lanes each.
#[inline(always)]
fn forward_body(tape: &Tape, from: usize, to: usize, slots: &mut [Row]) {
    let first = tape.first_code();
    for (k, i) in tape.code[from..to].iter().enumerate() {
        let (s, rest) = slots.split_at_mut(first + from + k);
        let out = &mut rest[0];
        let a = i.a as usize;
        match i.op {
            Op::Binary(op) => {
                let (a, b) = (&s[a], &s[i.b as usize]);
                match op {
                    Binary::Add => map2(out, a, b, |u, v| u + v),
                    Binary::Sub => map2(out, a, b, |u, v| u - v),
                    Binary::Mul => map2(out, a, b, |u, v| u * v),
                    Binary::Div => map2(out, a, b, |u, v| u / v),
                    Binary::Less => map2(out, a, b, |u, v| if u < v { 1.0 } else { 0.0 }),
                    Binary::LessEq => map2(out, a, b, |u, v| if u <= v { 1.0 } else { 0.0 }),
                    Binary::Pow => map2(out, a, b, f64::powf),
                    Binary::Atan2 => map2(out, a, b, f64::atan2),
                }
            }
            Op::Set(op) => {
                let (a, b) = (&s[a], &s[i.b as usize]);
                match op {
                    SetOp::RUnion => map2(out, a, b, |u, v| u + v + (u * u + v * v).sqrt()),
                    SetOp::RIntersection => map2(out, a, b, |u, v| u + v - (u * u + v * v).sqrt()),
                    SetOp::Max => map2(out, a, b, |u, v| if v > u { v } else { u }),
                    SetOp::Min => map2(out, a, b, |u, v| if v < u { v } else { u }),
                }
            }
            Op::Unary(op) => {
                let a = &s[a];
                match op {
                    Unary::Neg => map1(out, a, |u| -u),
                    Unary::Abs => map1(out, a, f64::abs),
                    Unary::Square => map1(out, a, |u| u * u),
                    Unary::Sqrt => map1(out, a, f64::sqrt),
                    _ => map1(out, a, |u| op.apply(&u)),
                }
            }
            Op::PowI => powi(out, &s[a], i.c as i32),
            Op::Select => {
                let (c, u, v) = (&s[a], &s[i.b as usize], &s[i.c as usize]);
                for l in 0..LANES {
                    out.0[l] = if c.0[l] != 0.0 { u.0[l] } else { v.0[l] };
                }
            }
            Op::Native => {
                let (f, args) = &tape.natives[a];
                native_values(f, args, s, out);
            }
        }
    }
}

/// Computes a native function, lane by lane.
#[inline(never)]
fn native_values(f: &Native, args: &[u32], s: &[Row], out: &mut Row) {
    if let (Native::Imported(of), [x, y, z]) = (f, args) {
        let at = [x, y, z].map(|k| &s[*k as usize].0);
        return of.values(at, &mut out.0);
    }
    let mut at = vec![0.0; args.len()];
    for l in 0..LANES {
        for (v, &k) in at.iter_mut().zip(args) {
            *v = s[k as usize].0[l];
        }
        out.0[l] = f.eval(&at);
    }
}

/// Computes powers by squaring: the products of `f64`'s [`Real::powi`], in the order used there.
#[inline(always)]
fn powi(out: &mut Row, a: &Row, n: i32) {
    let mut base = *a;
    out.0 = [1.0; LANES];
    let mut k = n.unsigned_abs();
    while k > 0 {
        for l in 0..LANES {
            if k & 1 == 1 {
                out.0[l] *= base.0[l];
            }
            base.0[l] *= base.0[l];
        }
        k >>= 1;
    }
    if n < 0 {
        for v in &mut out.0 {
            *v = 1.0 / *v;
        }
    }
}

dispatch! {
    fn reverse_guarded(
        tape: &Tape,
        plan: &[AdjointStep],
        slopes: &[f64],
        slots: &[Row],
        adjoints: &mut [Row]
    ) = reverse_body::<true>
}
dispatch! {
    fn reverse_plain(
        tape: &Tape,
        plan: &[AdjointStep],
        slopes: &[f64],
        slots: &[Row],
        adjoints: &mut [Row]
    ) = reverse_body::<false>
}

/// Adds `g · d` to an adjoint, or stores it if it is the first contribution. With GUARD, g = 0
/// contributes 0 also if d is infinite or NaN.
#[inline(always)]
fn pass<const GUARD: bool>(to: &mut Row, first: bool, g: &Row, d: impl Fn(usize) -> f64) {
    let term = |l: usize| {
        let v = g.0[l] * d(l);
        if GUARD && g.0[l] == 0.0 { 0.0 } else { v }
    };
    if first {
        for l in 0..LANES {
            to.0[l] = term(l);
        }
    } else {
        for l in 0..LANES {
            to.0[l] += term(l);
        }
    }
}

/// Propagates the adjoint of each live operation to its active arguments, from the last operation
/// to the first. With GUARD, an adjoint of 0 contributes 0 also if a derivative is infinite.
#[inline(always)]
fn reverse_body<const GUARD: bool>(
    tape: &Tape,
    plan: &[AdjointStep],
    slopes: &[f64],
    s: &[Row],
    adjoints: &mut [Row],
) {
    let first_code = tape.first_code();
    for (k, (i, step)) in tape.code.iter().zip(plan).enumerate().rev() {
        if !step.live {
            continue;
        }
        let (low, high) = adjoints.split_at_mut(first_code + k);
        let g = &high[0];
        let w = &s[first_code + k];
        let (ia, ib, ic) = (i.a as usize, i.b as usize, i.c as usize);
        let (first_a, first_b, first_c) = (
            step.first & 1 != 0,
            step.first & 2 != 0,
            step.first & 4 != 0,
        );
        let (to_a, to_b, to_c) = (
            step.active & 1 != 0,
            step.active & 2 != 0,
            step.active & 4 != 0,
        );
        match i.op {
            Op::Binary(op) => {
                let (a, b) = (&s[ia].0, &s[ib].0);
                match op {
                    Binary::Add | Binary::Sub => {
                        let sign = if op == Binary::Add { 1.0 } else { -1.0 };
                        if to_a {
                            pass::<false>(&mut low[ia], first_a, g, |_| 1.0);
                        }
                        if to_b {
                            pass::<false>(&mut low[ib], first_b, g, |_| sign);
                        }
                    }
                    Binary::Mul => {
                        if to_a {
                            pass::<GUARD>(&mut low[ia], first_a, g, |l| b[l]);
                        }
                        if to_b {
                            pass::<GUARD>(&mut low[ib], first_b, g, |l| a[l]);
                        }
                    }
                    Binary::Div => {
                        if to_a {
                            pass::<GUARD>(&mut low[ia], first_a, g, |l| 1.0 / b[l]);
                        }
                        if to_b {
                            pass::<GUARD>(&mut low[ib], first_b, g, |l| -w.0[l] / b[l]);
                        }
                    }
                    Binary::Pow => {
                        if to_a {
                            pass::<true>(&mut low[ia], first_a, g, |l| {
                                if w.0[l] == 0.0 {
                                    0.0
                                } else {
                                    b[l] * w.0[l] / a[l]
                                }
                            });
                        }
                        if to_b {
                            pass::<true>(&mut low[ib], first_b, g, |l| {
                                if w.0[l] == 0.0 {
                                    0.0
                                } else {
                                    a[l].ln() * w.0[l]
                                }
                            });
                        }
                    }
                    Binary::Atan2 => {
                        let r = |l: usize| a[l] * a[l] + b[l] * b[l];
                        if to_a {
                            pass::<true>(&mut low[ia], first_a, g, |l| b[l] / r(l));
                        }
                        if to_b {
                            pass::<true>(&mut low[ib], first_b, g, |l| -a[l] / r(l));
                        }
                    }
                    Binary::Less | Binary::LessEq => {
                        clear(low, [(to_a && first_a, ia), (to_b && first_b, ib)])
                    }
                }
            }
            Op::Set(op) => {
                let (a, b) = (&s[ia].0, &s[ib].0);
                match op {
                    SetOp::RUnion | SetOp::RIntersection => {
                        // The derivative is 1 ± u/h, with h recovered from the value; the root's
                        // derivative is taken as 0 at u = v = 0.
                        let sign = if op == SetOp::RUnion { 1.0 } else { -1.0 };
                        let mut r = ZERO;
                        for l in 0..LANES {
                            let h = sign * (w.0[l] - (a[l] + b[l]));
                            r.0[l] = if h > 0.0 { sign / h } else { 0.0 };
                        }
                        if to_a {
                            pass::<GUARD>(&mut low[ia], first_a, g, |l| 1.0 + a[l] * r.0[l]);
                        }
                        if to_b {
                            pass::<GUARD>(&mut low[ib], first_b, g, |l| 1.0 + b[l] * r.0[l]);
                        }
                    }
                    SetOp::Max | SetOp::Min => {
                        let second = |l: usize| {
                            if op == SetOp::Max {
                                b[l] > a[l]
                            } else {
                                b[l] < a[l]
                            }
                        };
                        if to_a {
                            pass::<true>(&mut low[ia], first_a, g, |l| {
                                if second(l) { 0.0 } else { 1.0 }
                            });
                        }
                        if to_b {
                            pass::<true>(&mut low[ib], first_b, g, |l| {
                                if second(l) { 1.0 } else { 0.0 }
                            });
                        }
                    }
                }
            }
            Op::Unary(op) => {
                if !to_a {
                    continue;
                }
                let (a, to) = (&s[ia].0, &mut low[ia]);
                match op {
                    Unary::Neg => pass::<false>(to, first_a, g, |_| -1.0),
                    Unary::Square => pass::<GUARD>(to, first_a, g, |l| 2.0 * a[l]),
                    Unary::Sqrt => pass::<GUARD>(to, first_a, g, |l| {
                        if w.0[l] == 0.0 { 0.0 } else { 0.5 / w.0[l] }
                    }),
                    Unary::Abs => pass::<GUARD>(to, first_a, g, |l| Real::sign(&a[l])),
                    _ => match slopes.get(k) {
                        Some(slope) => pass::<true>(to, first_a, g, |_| *slope),
                        None => pass::<true>(to, first_a, g, |l| unary_slope(op, a[l])),
                    },
                }
            }
            Op::PowI => {
                if to_a {
                    let n = i.c as i32;
                    let mut p = ZERO;
                    powi(&mut p, &s[ia], n - 1);
                    pass::<GUARD>(&mut low[ia], first_a, g, |l| f64::from(n) * p.0[l]);
                }
            }
            Op::Select => {
                let c = &s[ia].0;
                if to_b {
                    pass::<true>(&mut low[ib], first_b, g, |l| {
                        if c[l] != 0.0 { 1.0 } else { 0.0 }
                    });
                }
                if to_c {
                    pass::<true>(&mut low[ic], first_c, g, |l| {
                        if c[l] != 0.0 { 0.0 } else { 1.0 }
                    });
                }
            }
            Op::Native => {
                let (f, args) = &tape.natives[ia];
                native_adjoints(f, args, s, g, low);
            }
        }
    }
}

/// Returns the derivative of a unary operation.
fn unary_slope(op: Unary, a: f64) -> f64 {
    op.apply(&Jet1::<1>::variable(a, 0)).g[0]
}

/// Contributes the derivative 0 of comparisons: clears the slots whose first contribution it is.
#[inline(always)]
fn clear<const N: usize>(low: &mut [Row], slots: [(bool, usize); N]) {
    for (first, slot) in slots {
        if first {
            low[slot] = ZERO;
        }
    }
}

/// Maximum number of arguments of a native function.
const NATIVE_ARGUMENTS: usize = 6;

/// Propagates the adjoint of a native function to its arguments, lane by lane.
#[inline(never)]
fn native_adjoints(f: &Native, args: &[u32], s: &[Row], g: &Row, low: &mut [Row]) {
    for l in 0..LANES {
        if g.0[l] == 0.0 {
            continue;
        }
        let at: Vec<Jet1<NATIVE_ARGUMENTS>> = args
            .iter()
            .enumerate()
            .map(|(n, &k)| Jet1::variable(s[k as usize].0[l], n))
            .collect();
        let d = f.eval(&at).g;
        for (n, &k) in args.iter().enumerate() {
            low[k as usize].0[l] += g.0[l] * d[n];
        }
    }
}
