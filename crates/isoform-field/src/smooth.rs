//! A test of whether the kinks inside a formula cancel, at pseudo-random places.
//!
//! A smooth maximum such as max(u, v) + max(k − |u − v|, 0)²/(4k) is written with functions that
//! have kinks, and has none itself. Between two places where a kink is decided differently it is
//! found by bisection; there the gradients of both sides must agree. A wrong answer takes a kink
//! that none of the places tells apart, and costs a crease on a piece that is taken to be smooth.

use crate::graph::{Graph, Node, NodeId};
use crate::ops::{Binary, Ops, SetOp, Unary};
use crate::tape::Tape;
use isoform_num::Jet1;

/// Number of pairs of places. A pair tells a kink apart with probability near 1/2 at the scales that
/// suit the kink, which are a quarter of all.
const PAIRS: usize = 160;
/// Decades of scales on each side of 1, which cover sizes of models and widths of blends.
const DECADES: f64 = 3.0;
/// Further decades in which kinks are sought that were not met, for models in map coordinates.
const FAR: f64 = 5.0;
/// The difference of two sides' gradients, relative to 1 and the gradient, up to which they count as
/// equal; jumps of real models are of the order of 1.
const SAME: f64 = 1e-4;
/// Number of halvings: the two sides are then some 1e-12 of the segment apart.
const HALVINGS: usize = 40;
/// The largest number of kinks that are asked about: blends have a handful.
const MOST_KINKS: usize = 48;
/// Number of derivatives that are computed at once.
const AT_ONCE: usize = 4;

/// Pseudo-random numbers from 0 to 1 with a fixed seed (Marsaglia's xorshift).
pub(crate) struct Random(u64);

impl Random {
    /// The numbers from the beginning.
    pub(crate) fn new() -> Self {
        Self(0x2545_F491_4F6C_DD1D)
    }
    /// The next number.
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
    /// A place in a cube of half size 10^decade about 0.
    fn scaled(&mut self, n: usize, decade: f64) -> Vec<f64> {
        let scale = 10f64.powf(decade);
        (0..n).map(|_| scale * (2.0 * self.next() - 1.0)).collect()
    }
}

/// A formula of n inputs, with the values that its kinks are decided by.
struct Kinked {
    /// The formula, then the values.
    tape: Tape,
    n: usize,
}

impl Kinked {
    /// The compiled formula; `None` where the formula jumps by itself, or has too many kinks to ask.
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

    /// The formula's value, then the values that decide its kinks.
    fn values(&self, at: &[f64]) -> Vec<f64> {
        self.tape.eval_all(at, &[], &mut Vec::new())
    }

    /// Value and gradient; `None` where they are not finite.
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
            // Exactly on the kink the derivatives belong to neither side.
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

/// The observations of a formula.
struct Seen {
    /// By further input, whether the formula rose in it somewhere.
    rising: Vec<bool>,
    /// By further input, whether the formula fell in it somewhere.
    falling: Vec<bool>,
    /// By kink, whether places on both of its sides were met.
    crossed: Vec<bool>,
}

impl Seen {
    /// Adds a gradient; `None` once the formula was seen both to rise and to fall in an input.
    fn slopes(&mut self, gradient: &[f64]) -> Option<()> {
        let size = gradient.iter().fold(1.0, |m: f64, g| m.max(g.abs()));
        for (i, (rising, falling)) in self.rising.iter_mut().zip(&mut self.falling).enumerate() {
            // A slope below 1e-9 of the gradient is rounding.
            let g = gradient[3 + i];
            *rising |= g > 1e-9 * size;
            *falling |= g < -1e-9 * size;
            if *rising && *falling {
                return None;
            }
        }
        Some(())
    }

    /// Looks at pairs of random places. Returns the number of pairs at which the formula is defined;
    /// `None` where it has a kink or is not monotone.
    fn pairs(&mut self, formula: &Kinked, random: &mut Random) -> Option<usize> {
        let mut usable = 0;
        for _ in 0..PAIRS {
            let (p, q) = (random.place(formula.n), random.place(formula.n));
            let (Some((_, gp)), Some((_, gq))) = (formula.gradient(&p), formula.gradient(&q))
            else {
                continue;
            };
            usable += 1;
            self.slopes(&gp)?;
            self.slopes(&gq)?;
            self.kinks(formula, &p, &q)?;
        }
        Some(usable)
    }

    /// Looks for kinks between a place and places far away; `None` where one does not cancel.
    fn far_kinks(&mut self, formula: &Kinked, random: &mut Random) -> Option<()> {
        let near = random.place(formula.n);
        for _ in 0..PAIRS {
            let decade = DECADES + random.next() * FAR;
            let far = random.scaled(formula.n, decade);
            self.kinks(formula, &near, &far)?;
        }
        Some(())
    }

    /// Looks at the kinks between two places; `None` where one of them does not cancel.
    fn kinks(&mut self, formula: &Kinked, p: &[f64], q: &[f64]) -> Option<()> {
        let (dp, dq) = (formula.values(p), formula.values(q));
        for k in (1..dp.len()).filter(|&k| dp[k] * dq[k] < 0.0) {
            self.crossed[k] = true;
            let (a, b) = formula.crossing(k, p, q, dp[k] > 0.0);
            let (Some((va, ga)), Some((vb, gb))) = (formula.gradient(&a), formula.gradient(&b))
            else {
                continue;
            };
            let apart = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum::<f64>();
            if !is_smooth_across((va, &ga), (vb, &gb), apart) {
                return None;
            }
            self.slopes(&ga)?;
            self.slopes(&gb)?;
        }
        Some(())
    }
}

/// Whether the values and gradients on the two sides of a kink agree, at places that are `apart`.
fn is_smooth_across((va, ga): (f64, &[f64]), (vb, gb): (f64, &[f64]), apart: f64) -> bool {
    let size = ga.iter().chain(gb).fold(1.0, |m: f64, g| m.max(g.abs()));
    let jumps = (va - vb).abs() > SAME * (va.abs() + 1.0) + 2.0 * size * apart;
    !jumps && !ga.iter().zip(gb).any(|(a, b)| (a - b).abs() > SAME * size)
}

/// Whether `root`, a formula of x, y, z and the further inputs X(3), …, is C¹ and monotone in each
/// of the further inputs: for each of them whether it rises. `None` where it is not.
pub(crate) fn smooth_and_monotone(graph: Graph, root: NodeId, further: usize) -> Option<Vec<bool>> {
    let formula = Kinked::new(graph, root, 3 + further)?;
    let mut seen = Seen {
        rising: vec![false; further],
        falling: vec![false; further],
        crossed: vec![false; formula.tape.n_results()],
    };
    let mut random = Random::new();
    let usable = seen.pairs(&formula, &mut random)?;
    // A kink in space alone may lie far away; a kink of a blend is where its arguments are alike.
    if further == 0 && seen.crossed[1..].contains(&false) {
        seen.far_kinks(&formula, &mut random)?;
    }
    // Where the formula is hardly ever defined, nothing was tested.
    (usable >= PAIRS / 8).then_some(seen.falling.iter().map(|f| !f).collect())
}
