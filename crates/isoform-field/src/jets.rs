//! 2-jets in blocks: value, gradient and Hessian in x, y, z, eight points at a time.
//!
//! The derivatives of a slot by a coordinate that it does not depend on vanish, and so do the
//! second derivatives of an affine one: the entries that can be non-zero are determined when the
//! block is created, and only these are computed.

use crate::block::Lane;
use crate::ops::{Binary, SetOp, Unary};
use crate::tape::{Instruction, Op, Tape};
use isoform_geom::Point3;
use isoform_num::{Jet2, Real, dispatch};

/// Number of points in a block; smaller than for values, since ten numbers per slot and point fill
/// the first-level cache sooner.
pub(crate) const LANES: usize = 8;

/// Values at the points of a block.
type Row = Lane<LANES>;

/// Pairs of axes of the second derivatives: xx, xy, xz, yy, yz, zz.
const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// The jets of one slot.
#[derive(Clone, Copy, Debug)]
struct JetSlot {
    /// Values.
    v: Row,
    /// Gradients.
    g: [Row; 3],
    /// Hessians, in the order of [`PAIRS`].
    h: [Row; 6],
}

const ZERO: Row = Lane([0.0; LANES]);
/// A slot without derivatives and with the value 0.
const EMPTY: JetSlot = JetSlot {
    v: ZERO,
    g: [ZERO; 3],
    h: [ZERO; 6],
};

/// Set of the entries of a slot that can differ from zero: bits 0 to 2 for the gradient, bits 3 to
/// 8 for the Hessian.
type Mask = u16;

/// Evaluator of jets with scratch space, for one tape and one thread.
#[derive(Clone, Debug)]
pub(crate) struct JetBlock<'t> {
    tape: &'t Tape,
    slots: Vec<JetSlot>,
    /// Computed entries, by slot.
    masks: Vec<Mask>,
}

impl<'t> JetBlock<'t> {
    /// Creates a block with bound parameters and evaluates the operations that depend on these
    /// alone.
    pub(crate) fn new(tape: &'t Tape, a: &[f64]) -> Self {
        let mut slots = vec![EMPTY; tape.slots()];
        for (slot, &c) in slots.iter_mut().zip(&tape.constants) {
            slot.v.0 = [c; LANES];
        }
        for (slot, &v) in slots[tape.first_param()..]
            .iter_mut()
            .zip(&a[..tape.n_params])
        {
            slot.v.0 = [v; LANES];
        }
        for axis in 0..tape.n_x.min(3) {
            slots[tape.first_x() + axis].g[axis].0 = [1.0; LANES];
        }
        let masks = masks(tape);
        run(tape, &masks, 0, tape.uniform, &mut slots);
        Self { tape, slots, masks }
    }

    /// Computes jets of the first result at up to eight points.
    pub(crate) fn eval(&mut self, points: &[Point3], out: &mut [Jet2]) {
        let first = self.tape.first_x();
        for axis in 0..self.tape.n_x.min(3) {
            for l in 0..LANES {
                self.slots[first + axis].v.0[l] = points[l.min(points.len() - 1)][axis];
            }
        }
        run(
            self.tape,
            &self.masks,
            self.tape.uniform,
            self.tape.code.len(),
            &mut self.slots,
        );
        let s = &self.slots[self.tape.roots[0] as usize];
        for (l, jet) in out.iter_mut().enumerate().take(points.len()) {
            *jet = Jet2 {
                v: s.v.0[l],
                g: std::array::from_fn(|i| s.g[i].0[l]),
                h: std::array::from_fn(|k| s.h[k].0[l]),
            };
        }
    }
}

/// Returns the second derivatives to which a product of the two gradients can contribute.
fn products(a: Mask, b: Mask) -> Mask {
    PAIRS.iter().enumerate().fold(0, |m, (k, &(i, j))| {
        let touched = (a >> i & 1 == 1 && b >> j & 1 == 1) || (a >> j & 1 == 1 && b >> i & 1 == 1);
        m | u16::from(touched) << (3 + k)
    })
}

/// Determines the entries that can differ from zero, by slot.
fn masks(tape: &Tape) -> Vec<Mask> {
    let mut m: Vec<Mask> = vec![0; tape.slots()];
    for axis in 0..tape.n_x.min(3) {
        m[tape.first_x() + axis] = 1 << axis;
    }
    for (k, i) in tape.code.iter().enumerate() {
        m[tape.first_code() + k] = mask_of(tape, i, &m);
    }
    m
}

/// Returns the mask of an operation, from the masks `m` of the slots before it.
fn mask_of(tape: &Tape, i: &Instruction, m: &[Mask]) -> Mask {
    let (a, b) = (m[i.a as usize % m.len()], m[i.b as usize % m.len()]);
    match i.op {
        Op::Unary(Unary::Floor | Unary::Ceil | Unary::Trunc | Unary::Sign)
        | Op::Binary(Binary::Less | Binary::LessEq) => 0,
        Op::Unary(Unary::Neg | Unary::Abs) => a,
        Op::Binary(Binary::Add | Binary::Sub) | Op::Set(SetOp::Max | SetOp::Min) => a | b,
        Op::Binary(Binary::Mul) => a | b | products(a, b),
        Op::Unary(_) | Op::PowI => a | products(a, a),
        Op::Binary(_) | Op::Set(_) => a | b | products(a | b, a | b),
        Op::Select => b | m[i.c as usize],
        Op::Native => {
            let all = tape.arguments(i).fold(0, |s, k| s | m[k as usize]);
            all | products(all, all)
        }
    }
}

dispatch! { fn run(tape: &Tape, masks: &[Mask], from: usize, to: usize, slots: &mut [JetSlot]) = run_body }

/// Computes h(u) from its value and first two derivatives per lane.
#[inline(always)]
fn chain(out: &mut JetSlot, mask: Mask, u: &JetSlot, f: &[Row; 3]) {
    out.v = f[0];
    for i in 0..3 {
        if mask >> i & 1 == 1 {
            for l in 0..LANES {
                out.g[i].0[l] = f[1].0[l] * u.g[i].0[l];
            }
        }
    }
    for (k, &(i, j)) in PAIRS.iter().enumerate() {
        if mask >> (3 + k) & 1 == 1 {
            for l in 0..LANES {
                out.h[k].0[l] = f[1].0[l] * u.h[k].0[l] + f[2].0[l] * u.g[i].0[l] * u.g[j].0[l];
            }
        }
    }
}

/// Computes u + q v with a constant q.
#[inline(always)]
fn linear(out: &mut JetSlot, mask: Mask, u: &JetSlot, v: &JetSlot, q: f64) {
    for l in 0..LANES {
        out.v.0[l] = u.v.0[l] + q * v.v.0[l];
    }
    for i in 0..3 {
        if mask >> i & 1 == 1 {
            for l in 0..LANES {
                out.g[i].0[l] = u.g[i].0[l] + q * v.g[i].0[l];
            }
        }
    }
    for k in 0..6 {
        if mask >> (3 + k) & 1 == 1 {
            for l in 0..LANES {
                out.h[k].0[l] = u.h[k].0[l] + q * v.h[k].0[l];
            }
        }
    }
}

/// Computes u v by the product rule.
#[inline(always)]
fn product(out: &mut JetSlot, mask: Mask, u: &JetSlot, v: &JetSlot) {
    for l in 0..LANES {
        out.v.0[l] = u.v.0[l] * v.v.0[l];
    }
    for i in 0..3 {
        if mask >> i & 1 == 1 {
            for l in 0..LANES {
                out.g[i].0[l] = u.v.0[l] * v.g[i].0[l] + u.g[i].0[l] * v.v.0[l];
            }
        }
    }
    for (k, &(i, j)) in PAIRS.iter().enumerate() {
        if mask >> (3 + k) & 1 == 1 {
            for l in 0..LANES {
                out.h[k].0[l] = u.v.0[l] * v.h[k].0[l]
                    + u.g[i].0[l] * v.g[j].0[l]
                    + u.g[j].0[l] * v.g[i].0[l]
                    + u.h[k].0[l] * v.v.0[l];
            }
        }
    }
}

/// Computes u + v ± √(u² + v²): with n = (u, v)/h, the gradient is ∇u + ∇v ± n·(∇u, ∇v), and the
/// root's Hessian n·(Hu, Hv) + (∇u∇uᵀ + ∇v∇vᵀ − ∇h∇hᵀ)/h. At u = v = 0 the root's derivatives are
/// set to 0.
#[inline(always)]
fn r_function(out: &mut JetSlot, mask: Mask, u: &JetSlot, v: &JetSlot, sign: f64) {
    let (mut r, mut p, mut q) = (ZERO, ZERO, ZERO);
    for l in 0..LANES {
        let h = (u.v.0[l] * u.v.0[l] + v.v.0[l] * v.v.0[l]).sqrt();
        out.v.0[l] = u.v.0[l] + v.v.0[l] + sign * h;
        r.0[l] = if h > 0.0 { 1.0 / h } else { 0.0 };
        p.0[l] = u.v.0[l] * r.0[l];
        q.0[l] = v.v.0[l] * r.0[l];
    }
    let mut root = [ZERO; 3];
    for i in 0..3 {
        if mask >> i & 1 == 1 {
            for l in 0..LANES {
                root[i].0[l] = p.0[l] * u.g[i].0[l] + q.0[l] * v.g[i].0[l];
                out.g[i].0[l] = u.g[i].0[l] + v.g[i].0[l] + sign * root[i].0[l];
            }
        }
    }
    for (k, &(i, j)) in PAIRS.iter().enumerate() {
        if mask >> (3 + k) & 1 == 1 {
            for l in 0..LANES {
                let bend = u.g[i].0[l] * u.g[j].0[l] + v.g[i].0[l] * v.g[j].0[l]
                    - root[i].0[l] * root[j].0[l];
                let h = p.0[l] * u.h[k].0[l] + q.0[l] * v.h[k].0[l] + r.0[l] * bend;
                out.h[k].0[l] = u.h[k].0[l] + v.h[k].0[l] + sign * h;
            }
        }
    }
}

/// Selects v in the lanes where `second` holds, else u.
#[inline(always)]
fn choose(out: &mut JetSlot, mask: Mask, u: &JetSlot, v: &JetSlot, second: impl Fn(usize) -> bool) {
    let mut take = [false; LANES];
    for (l, t) in take.iter_mut().enumerate() {
        *t = second(l);
    }
    let pick = |out: &mut Row, u: &Row, v: &Row| {
        for l in 0..LANES {
            out.0[l] = if take[l] { v.0[l] } else { u.0[l] };
        }
    };
    pick(&mut out.v, &u.v, &v.v);
    for i in 0..3 {
        if mask >> i & 1 == 1 {
            pick(&mut out.g[i], &u.g[i], &v.g[i]);
        }
    }
    for k in 0..6 {
        if mask >> (3 + k) & 1 == 1 {
            pick(&mut out.h[k], &u.h[k], &v.h[k]);
        }
    }
}

/// Returns the jet in one lane.
fn jet_of(s: &JetSlot, l: usize) -> Jet2 {
    Jet2 {
        v: s.v.0[l],
        g: std::array::from_fn(|i| s.g[i].0[l]),
        h: std::array::from_fn(|k| s.h[k].0[l]),
    }
}

/// Computes a function by scalar jets, lane by lane, for want of a vectorized formula.
#[inline(never)]
fn by_lane(out: &mut JetSlot, f: impl Fn(usize) -> Jet2) {
    for l in 0..LANES {
        let j = f(l);
        out.v.0[l] = j.v;
        for i in 0..3 {
            out.g[i].0[l] = j.g[i];
        }
        for k in 0..6 {
            out.h[k].0[l] = j.h[k];
        }
    }
}

/// Computes the value and two derivatives of a function of one argument, lane by lane.
#[inline(always)]
fn unary(op: Unary, u: &Row) -> [Row; 3] {
    let mut f = [ZERO; 3];
    for l in 0..LANES {
        let v = u.0[l];
        let d = match op {
            Unary::Neg => [-v, -1.0, 0.0],
            Unary::Abs => [v.abs(), Real::sign(&v), 0.0],
            Unary::Square => [v * v, 2.0 * v, 2.0],
            Unary::Sqrt => {
                let s = v.sqrt();
                let r = if s == 0.0 { 0.0 } else { 0.5 / s };
                [s, r, if s == 0.0 { 0.0 } else { -0.5 * r / v }]
            }
            _ => {
                // A jet in one variable: seeded along x, its first and second derivative along x
                // are h' and h''.
                let j = op.apply(&Jet2::variable(v, 0));
                [j.v, j.g[0], j.h[0]]
            }
        };
        for k in 0..3 {
            f[k].0[l] = d[k];
        }
    }
    f
}

/// Computes the operations `from..to` of the tape.
#[inline(always)]
fn run_body(tape: &Tape, masks: &[Mask], from: usize, to: usize, slots: &mut [JetSlot]) {
    let first = tape.first_code();
    for (k, i) in tape.code[from..to].iter().enumerate() {
        let at = first + from + k;
        let (s, rest) = slots.split_at_mut(at);
        let (out, mask) = (&mut rest[0], masks[at]);
        let (a, b) = (i.a as usize, i.b as usize);
        match i.op {
            Op::Binary(Binary::Add) => linear(out, mask, &s[a], &s[b], 1.0),
            Op::Binary(Binary::Sub) => linear(out, mask, &s[a], &s[b], -1.0),
            Op::Binary(Binary::Mul) => product(out, mask, &s[a], &s[b]),
            Op::Binary(op) => by_lane(out, |l| op.apply(&jet_of(&s[a], l), &jet_of(&s[b], l))),
            Op::Set(SetOp::RUnion) => r_function(out, mask, &s[a], &s[b], 1.0),
            Op::Set(SetOp::RIntersection) => r_function(out, mask, &s[a], &s[b], -1.0),
            Op::Set(SetOp::Max) => choose(out, mask, &s[a], &s[b], |l| s[b].v.0[l] > s[a].v.0[l]),
            Op::Set(SetOp::Min) => choose(out, mask, &s[a], &s[b], |l| s[b].v.0[l] < s[a].v.0[l]),
            Op::Select => choose(out, mask, &s[b], &s[i.c as usize], |l| s[a].v.0[l] == 0.0),
            Op::Unary(op) => chain(out, mask, &s[a], &unary(op, &s[a].v)),
            Op::PowI => by_lane(out, |l| jet_of(&s[a], l).powi(i.c as i32)),
            Op::Native => {
                let (f, args) = &tape.natives[a];
                by_lane(out, |l| {
                    f.eval(
                        &args
                            .iter()
                            .map(|&n| jet_of(&s[n as usize], l))
                            .collect::<Vec<_>>(),
                    )
                });
            }
        }
    }
}
