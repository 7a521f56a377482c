//! Test for the cancellation of the kinks inside a formula, at pseudo-random points.
//!
//! A smooth maximum such as max(u, v) + max(k − |u − v|, 0)²/(4k) is smooth, although it is
//! composed of functions with kinks. A kink between two points on different sides of it is located
//! by bisection; there the gradients of both sides must agree. The test fails to detect a kink if
//! no two points lie on different sides of it; a piece then has a crease although it is taken to be
//! smooth.

use crate::graph::{Graph, Node, NodeId};
use crate::ops::{Binary, Ops, SetOp, Unary};
use crate::tape::Tape;
use isoform_num::Jet1;

/// Number of pairs of sample points. A pair separates the sides of a kink with probability near 1/2
/// at scales suited to the kink, about a quarter of all scales.
const SAMPLE_PAIRS: usize = 160;
/// Range of scales in decades, on each side of 1, which covers sizes of models and widths of
/// blends.
const SCALE_DECADES: f64 = 3.0;
/// Additional range of scales in decades in the search for kinks not found before, for models in
/// map coordinates.
const FAR_SCALE_DECADES: f64 = 5.0;
/// Tolerance on the difference of the gradients on two sides, relative to the larger of 1 and the
/// gradient; jumps in real models are of order 1.
const GRADIENT_TOLERANCE: f64 = 1e-4;
/// Number of bisection steps, after which the two sides are about 1e-12 of the segment apart.
const KINK_BISECTIONS: usize = 40;
/// Maximum number of kinks of a formula; blends have a handful.
const MAX_KINKS: usize = 48;
/// Number of derivatives computed at once.
const DERIVATIVES_PER_RUN: usize = 4;

/// Pseudo-random numbers from 0 to 1 with a fixed seed (Marsaglia's xorshift).
pub(crate) struct Random(u64);

impl Random {
    /// Creates the generator in its initial state.
    pub(crate) fn new() -> Self {
        Self(0x2545_F491_4F6C_DD1D)
    }
    /// Returns the next number.
    pub(crate) fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
    /// Returns a point in a cube about 0 of random size.
    pub(crate) fn place(&mut self, n: usize) -> Vec<f64> {
        let decade = SCALE_DECADES * (2.0 * self.next() - 1.0);
        self.scaled(n, decade)
    }
    /// Returns a point in a cube about 0 with half the edge length 10^decade.
    fn scaled(&mut self, n: usize, decade: f64) -> Vec<f64> {
        let scale = 10f64.powf(decade);
        (0..n).map(|_| scale * (2.0 * self.next() - 1.0)).collect()
    }
}

/// Formula of n inputs, with the expressions whose signs determine the sides of its kinks.
struct KinkedFormula {
    /// Tape of the formula and these expressions.
    tape: Tape,
    n: usize,
}

impl KinkedFormula {
    /// Compiles the formula; `None` if it contains jumps, or too many kinks.
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
        if roots.len() > MAX_KINKS + 1 {
            return None;
        }
        Some(Self {
            tape: Tape::new(&graph, &roots, n, 0),
            n,
        })
    }

    /// Evaluates the formula and the expressions that determine the sides of its kinks.
    fn values(&self, at: &[f64]) -> Vec<f64> {
        self.tape.eval_all(at, &[], &mut Vec::new())
    }

    /// Computes the value and gradient; `None` if they are not finite.
    fn gradient(&self, at: &[f64]) -> Option<(f64, Vec<f64>)> {
        let (mut value, mut gradient) = (0.0, Vec::with_capacity(self.n));
        let mut scratch = Vec::new();
        for from in (0..self.n).step_by(DERIVATIVES_PER_RUN) {
            let x: Vec<Jet1<DERIVATIVES_PER_RUN>> = at
                .iter()
                .enumerate()
                .map(|(i, &v)| match i.checked_sub(from) {
                    Some(k) if k < DERIVATIVES_PER_RUN => Jet1::variable(v, k),
                    _ => isoform_num::Real::constant(v),
                })
                .collect();
            let jet = self.tape.eval(&x, &[], &mut scratch);
            value = jet.v;
            gradient.extend_from_slice(&jet.g[..DERIVATIVES_PER_RUN.min(self.n - from)]);
        }
        (value.is_finite() && gradient.iter().all(|g| g.is_finite())).then_some((value, gradient))
    }

    /// Finds two close points of the segment between which value k changes its sign.
    fn crossing(
        &self,
        k: usize,
        p: &[f64],
        q: &[f64],
        positive_at_p: bool,
    ) -> (Vec<f64>, Vec<f64>) {
        let at = |t: f64| -> Vec<f64> { p.iter().zip(q).map(|(p, q)| p + t * (q - p)).collect() };
        let (mut lo, mut hi) = (0.0, 1.0);
        for _ in 0..KINK_BISECTIONS {
            let t = 0.5 * (lo + hi);
            let v = self.values(&at(t))[k];
            // Exactly on the kink the derivatives do not belong to either side.
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

/// Observed behaviour of a formula.
struct FormulaObservations {
    /// True for further inputs in which the formula was increasing at some sample.
    rising: Vec<bool>,
    /// True for further inputs in which the formula was decreasing at some sample.
    falling: Vec<bool>,
    /// True for kinks with samples on both sides.
    crossed: Vec<bool>,
}

impl FormulaObservations {
    /// Records a gradient; `None` if the formula was both increasing and decreasing in one input.
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

    /// Tests pairs of random points. Returns the number of pairs at which the formula is defined;
    /// `None` if it has a kink or is not monotone.
    fn pairs(&mut self, formula: &KinkedFormula, random: &mut Random) -> Option<usize> {
        let mut usable = 0;
        for _ in 0..SAMPLE_PAIRS {
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

    /// Tests kinks between a point and points far away; `None` if one does not cancel.
    fn far_kinks(&mut self, formula: &KinkedFormula, random: &mut Random) -> Option<()> {
        let near = random.place(formula.n);
        for _ in 0..SAMPLE_PAIRS {
            let decade = SCALE_DECADES + random.next() * FAR_SCALE_DECADES;
            let far = random.scaled(formula.n, decade);
            self.kinks(formula, &near, &far)?;
        }
        Some(())
    }

    /// Tests the kinks between two points; `None` if one does not cancel.
    fn kinks(&mut self, formula: &KinkedFormula, p: &[f64], q: &[f64]) -> Option<()> {
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

/// Returns true if the values and gradients on the two sides of a kink agree, at points at the
/// distance `apart`.
fn is_smooth_across((va, ga): (f64, &[f64]), (vb, gb): (f64, &[f64]), apart: f64) -> bool {
    let size = ga.iter().chain(gb).fold(1.0, |m: f64, g| m.max(g.abs()));
    let jumps = (va - vb).abs() > GRADIENT_TOLERANCE * (va.abs() + 1.0) + 2.0 * size * apart;
    !jumps
        && !ga
            .iter()
            .zip(gb)
            .any(|(a, b)| (a - b).abs() > GRADIENT_TOLERANCE * size)
}

/// Tests if `root`, a formula of x, y, z and the further inputs X(3), …, is C¹ and monotone in each
/// further input. Returns true for those in which it increases; `None` if the test fails.
pub(crate) fn smooth_and_monotone(graph: Graph, root: NodeId, further: usize) -> Option<Vec<bool>> {
    let formula = KinkedFormula::new(graph, root, 3 + further)?;
    let mut seen = FormulaObservations {
        rising: vec![false; further],
        falling: vec![false; further],
        crossed: vec![false; formula.tape.n_results()],
    };
    let mut random = Random::new();
    let usable = seen.pairs(&formula, &mut random)?;
    // A kink in space alone may lie far away; a kink of a blend lies where its arguments are equal.
    if further == 0 && seen.crossed[1..].contains(&false) {
        seen.far_kinks(&formula, &mut random)?;
    }
    // A formula that is rarely defined was not tested.
    (usable >= SAMPLE_PAIRS / 8).then_some(seen.falling.iter().map(|f| !f).collect())
}
