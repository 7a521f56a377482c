//! Whether kinks inside a formula cancel: tested at pseudo-random places.
//!
//! A smooth maximum such as max(u, v) + max(k − |u − v|, 0)²/(4k) is written with functions that
//! have kinks, and has none itself. Between two places where a kink is decided differently it is
//! found by bisection; there the gradients of both sides must agree. A wrong answer takes a kink
//! that none of the places tells apart, and costs a crease on a piece that is taken to be smooth.

use crate::graph::{Graph, Node, NodeId};
use crate::ops::{Binary, Ops, SetOp, Unary};
use crate::tape::Tape;
use isoform_num::Jet1;

/// Pairs of places. Each tells a kink apart with probability near 1/2 at the scales that suit it,
/// which are a quarter of them.
const PAIRS: usize = 160;
/// Decades of scales about 1 on each side: sizes of models and widths of blends.
const DECADES: f64 = 3.0;
/// Further decades in which kinks are sought that were not met: models in coordinates of a map.
const FAR: f64 = 5.0;
/// Gradients of two sides count as equal within this, relative to 1 and the gradient; jumps of real
/// models are of the order of 1.
const SAME: f64 = 1e-4;
/// Steps of the bisection: the two sides are then some 1e-12 of the segment apart.
const HALVINGS: usize = 40;
/// Formulas with more kinks are not asked about: blends have a handful.
const MOST_KINKS: usize = 48;
/// Derivatives computed at once.
const AT_ONCE: usize = 4;

/// Pseudo-random numbers from 0 to 1 with a fixed seed (Marsaglia's xorshift).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new() -> Self {
        Self(0x2545_F491_4F6C_DD1D)
    }
    pub(crate) fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
    /// A place in a cube about 0 whose size is random, too.
    pub(crate) fn place(&mut self, n: usize) -> Vec<f64> {
        let decade = DECADES * (2.0 * self.next() - 1.0);
        self.scaled(n, decade)
    }
    fn scaled(&mut self, n: usize, decade: f64) -> Vec<f64> {
        let scale = 10f64.powf(decade);
        (0..n).map(|_| scale * (2.0 * self.next() - 1.0)).collect()
    }
}

/// A formula of n inputs, with the values that its kinks are decided by.
struct Kinked {
    tape: Tape,
    n: usize,
}

impl Kinked {
    /// None where the formula jumps by itself, or has too many kinks to ask.
    fn new(mut graph: Graph, root: NodeId, n: usize) -> Option<Self> {
        let root = graph.lowered(root);
        let need = graph.reachable(&[root]);
        let mut roots = vec![root];
        for (i, _) in need.iter().enumerate().filter(|(_, need)| **need) {
            let decided = match *graph.node(NodeId(i as u32)) {
                Node::Set(SetOp::Min | SetOp::Max, u, v)
                | Node::Binary(Binary::Less | Binary::LessEq, u, v) => graph.sub(&u, &v),
                Node::Unary(Unary::Abs, u) => u,
                Node::Unary(Unary::Floor | Unary::Ceil | Unary::Trunc | Unary::Sign, _) => {
                    return None;
                }
                _ => continue,
            };
            roots.push(decided);
        }
        if roots.len() > MOST_KINKS + 1 {
            return None;
        }
        Some(Self {
            tape: Tape::new(&graph, &roots, n, 0),
            n,
        })
    }

    fn values(&self, at: &[f64]) -> Vec<f64> {
        self.tape.eval_all(at, &[], &mut Vec::new())
    }

    /// Value and gradient; none where they are not finite.
    fn gradient(&self, at: &[f64]) -> Option<(f64, Vec<f64>)> {
        let (mut value, mut gradient) = (0.0, Vec::with_capacity(self.n));
        let mut scratch = Vec::new();
        for from in (0..self.n).step_by(AT_ONCE) {
            let x: Vec<Jet1<AT_ONCE>> = at
                .iter()
                .enumerate()
                .map(|(i, &v)| match i.checked_sub(from) {
                    Some(k) if k < AT_ONCE => Jet1::variable(v, k),
                    _ => isoform_num::Real::constant(v),
                })
                .collect();
            let jet = self.tape.eval(&x, &[], &mut scratch);
            value = jet.v;
            gradient.extend_from_slice(&jet.g[..AT_ONCE.min(self.n - from)]);
        }
        (value.is_finite() && gradient.iter().all(|g| g.is_finite())).then_some((value, gradient))
    }

    /// Two places on the segment that lie closely on the two sides of where value k changes its
    /// sign.
    fn crossing(
        &self,
        k: usize,
        p: &[f64],
        q: &[f64],
        positive_at_p: bool,
    ) -> (Vec<f64>, Vec<f64>) {
        let at = |t: f64| -> Vec<f64> { p.iter().zip(q).map(|(p, q)| p + t * (q - p)).collect() };
        let (mut lo, mut hi) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let t = 0.5 * (lo + hi);
            let v = self.values(&at(t))[k];
            // Exactly between the sides derivatives are those of neither.
            if v == 0.0 {
                break;
            }
            *(if (v > 0.0) == positive_at_p {
                &mut lo
            } else {
                &mut hi
            }) = t;
        }
        (at(lo), at(hi))
    }
}

/// What was seen of a formula.
struct Seen {
    rising: Vec<bool>,
    falling: Vec<bool>,
    /// By kink: met on its two sides.
    crossed: Vec<bool>,
}

impl Seen {
    /// None once a further input was seen both to rise and to fall.
    fn slopes(&mut self, gradient: &[f64]) -> Option<()> {
        let size = gradient.iter().fold(1.0, |m: f64, g| m.max(g.abs()));
        for (i, (rising, falling)) in self.rising.iter_mut().zip(&mut self.falling).enumerate() {
            // Below this it is rounding.
            let g = gradient[3 + i];
            *rising |= g > 1e-9 * size;
            *falling |= g < -1e-9 * size;
            if *rising && *falling {
                return None;
            }
        }
        Some(())
    }

    /// The kinks between two places; none where one of them does not cancel.
    fn kinks(&mut self, formula: &Kinked, p: &[f64], q: &[f64]) -> Option<()> {
        let (dp, dq) = (formula.values(p), formula.values(q));
        for k in (1..dp.len()).filter(|&k| dp[k] * dq[k] < 0.0) {
            self.crossed[k] = true;
            let (a, b) = formula.crossing(k, p, q, dp[k] > 0.0);
            let (Some((va, ga)), Some((vb, gb))) = (formula.gradient(&a), formula.gradient(&b))
            else {
                continue;
            };
            let size = ga.iter().chain(&gb).fold(1.0, |m: f64, g| m.max(g.abs()));
            let apart = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum::<f64>();
            let jumps = (va - vb).abs() > SAME * (va.abs() + 1.0) + 2.0 * size * apart;
            if jumps || ga.iter().zip(&gb).any(|(a, b)| (a - b).abs() > SAME * size) {
                return None;
            }
            self.slopes(&ga)?;
            self.slopes(&gb)?;
        }
        Some(())
    }
}

/// Whether `root`, a formula of x, y, z and the further inputs X(3), …, is C¹ and monotone in each
/// of the further ones: for each of these whether it rises. None where it is not.
pub(crate) fn smooth_and_monotone(graph: Graph, root: NodeId, further: usize) -> Option<Vec<bool>> {
    let n = 3 + further;
    let formula = Kinked::new(graph, root, n)?;
    let mut seen = Seen {
        rising: vec![false; further],
        falling: vec![false; further],
        crossed: vec![false; formula.tape.n_results()],
    };
    let mut random = Random::new();
    let mut usable = 0;
    for _ in 0..PAIRS {
        let (p, q) = (random.place(n), random.place(n));
        let (Some((_, gp)), Some((_, gq))) = (formula.gradient(&p), formula.gradient(&q)) else {
            continue;
        };
        usable += 1;
        seen.slopes(&gp)?;
        seen.slopes(&gq)?;
        seen.kinks(&formula, &p, &q)?;
    }
    // A kink in space alone may lie far away; those of a blend are where its arguments are alike.
    if further == 0 && seen.crossed[1..].contains(&false) {
        let near = random.place(n);
        for _ in 0..PAIRS {
            let decade = DECADES + random.next() * FAR;
            let far = random.scaled(n, decade);
            seen.kinks(&formula, &near, &far)?;
        }
    }
    // Where the formula is hardly ever defined, nothing was tested.
    (usable >= PAIRS / 8).then_some(seen.falling.iter().map(|f| !f).collect())
}
