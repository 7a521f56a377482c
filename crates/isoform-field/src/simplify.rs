//! Simplification of a tape for a box of inputs, without the branches that are never selected
//! there.
//!
//! Intervals show which arguments of a minimum, maximum or selection cannot be its value (Duff,
//! Interval arithmetic and recursive subdivision, SIGGRAPH 1992). From the results downwards each
//! operation passes the relevant range of values to its arguments: in max(max(a, b), c) values of
//! the inner maximum below the least value of c are irrelevant. A chain of maxima is thus
//! simplified as one maximum of all arguments, independently of their order in the program.

use crate::library::Native;
use crate::ops::{Binary, SetOp, Unary};
use crate::tape::{Instruction, Op, Tape};
use isoform_num::Interval;

/// Part of an operation that is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum KeptBranch {
    /// Nothing: the result is not used.
    Neither,
    /// The first branch only.
    First,
    /// The second branch only.
    Second,
    /// The whole operation.
    Both,
}

/// Range in which a slot's exact value is relevant; values outside of it may be replaced by any
/// others on that side.
#[derive(Clone, Copy)]
struct RelevantRange {
    floor: f64,
    ceiling: f64,
}

impl RelevantRange {
    /// Empty range of an unused slot.
    const NONE: Self = Self {
        floor: f64::INFINITY,
        ceiling: f64::NEG_INFINITY,
    };
    /// Unbounded range.
    const ALL: Self = Self {
        floor: f64::NEG_INFINITY,
        ceiling: f64::INFINITY,
    };

    /// Returns true if the slot is used. With the floor above the ceiling all values are
    /// equivalent, but one is required.
    fn is_any(self) -> bool {
        self.floor < f64::INFINITY || self.ceiling > f64::NEG_INFINITY
    }

    /// Adds another use of the slot.
    fn add(&mut self, other: Self) {
        self.floor = self.floor.min(other.floor);
        self.ceiling = self.ceiling.max(other.ceiling);
    }

    /// Returns the relevant range of u if this is the one of −u.
    fn mirrored(self) -> Self {
        Self {
            floor: -self.ceiling,
            ceiling: -self.floor,
        }
    }

    /// Returns the branch that decides a maximum of two numbers, and the relevant range of the
    /// arguments.
    fn of_maximum(self, [a, b]: [Interval; 2]) -> (KeptBranch, Self) {
        let floor = self.floor.max(a.lo()).max(b.lo());
        let choice = if b.hi() < floor {
            KeptBranch::First
        } else if a.hi() < floor {
            KeptBranch::Second
        } else {
            KeptBranch::Both
        };
        (choice, Self { floor, ..self })
    }

    /// Returns the branch that decides a minimum of two numbers, and the relevant range of the
    /// arguments.
    fn of_minimum(self, both: [Interval; 2]) -> (KeptBranch, Self) {
        let (choice, matter) = self.mirrored().of_maximum(both.map(|range| -range));
        (choice, matter.mirrored())
    }
}

/// Returns the branch that a condition selects.
fn of_selection(condition: Interval) -> KeptBranch {
    if !condition.contains(0.0) {
        KeptBranch::First
    } else if condition.lo() == 0.0 && condition.hi() == 0.0 {
        KeptBranch::Second
    } else {
        KeptBranch::Both
    }
}

impl Tape {
    /// Bounds the first result over a box of inputs; also returns a shorter tape, if there is one,
    /// that computes bitwise identical results in the box. R-functions depend on both arguments
    /// everywhere and are kept.
    pub fn bounds(&self, x: &[Interval], a: &[Interval]) -> (Interval, Option<Self>) {
        let mut s = Vec::new();
        let range = self.range(x, a, &mut s);
        let numbers = self.numbers(&s);
        let (choices, matter) = self.choices(&s, &numbers);
        let is_shorter = choices.iter().any(|choice| *choice != KeptBranch::Both);
        (
            range,
            is_shorter.then(|| self.simplified(&choices, &matter)),
        )
    }

    /// Returns the kept part of each operation and the relevant range of each slot, given the
    /// ranges `s` of the slots and the slots that are certainly not NaN, `numbers`. Ranges do not
    /// account for NaN: max(3, NaN) is 3.
    fn choices(&self, s: &[Interval], numbers: &[bool]) -> (Vec<KeptBranch>, Vec<RelevantRange>) {
        let first = self.first_code();
        let mut matter = vec![RelevantRange::NONE; self.slots()];
        for &root in &self.roots {
            matter[root as usize] = RelevantRange::ALL;
        }
        let mut choices = vec![KeptBranch::Neither; self.code.len()];
        for (k, i) in self.code.iter().enumerate().rev() {
            let of = matter[first + k];
            if of.is_any() {
                choices[k] = self.choice(i, of, (s, numbers), &mut matter);
            }
        }
        (choices, matter)
    }

    /// Returns the kept part of an operation with the relevant range `of`, and adds the relevant
    /// ranges of its arguments.
    fn choice(
        &self,
        i: &Instruction,
        of: RelevantRange,
        (s, numbers): (&[Interval], &[bool]),
        matter: &mut [RelevantRange],
    ) -> KeptBranch {
        let [a, b, c] = [i.a, i.b, i.c].map(|slot| slot as usize);
        let ((choice, passed), [one, two]) = match i.op {
            Op::Set(SetOp::Max) if numbers[a] && numbers[b] => {
                (of.of_maximum([s[a], s[b]]), [a, b])
            }
            Op::Set(SetOp::Min) if numbers[a] && numbers[b] => {
                (of.of_minimum([s[a], s[b]]), [a, b])
            }
            Op::Select if numbers[a] => ((of_selection(s[a]), of), [b, c]),
            Op::Unary(Unary::Neg) => {
                matter[a].add(of.mirrored());
                return KeptBranch::Both;
            }
            _ => {
                self.for_arguments(i, |slot| matter[slot as usize] = RelevantRange::ALL);
                return KeptBranch::Both;
            }
        };
        if i.op == Op::Select && choice == KeptBranch::Both {
            matter[a] = RelevantRange::ALL;
        }
        if choice != KeptBranch::Second {
            matter[one].add(passed);
        }
        if choice != KeptBranch::First {
            matter[two].add(passed);
        }
        choice
    }

    /// Returns true for slots whose computed value is certainly not NaN, given the ranges `s` of
    /// the slots ([`Tape::range`]).
    ///
    /// Ranges enclose defined values only: √u over \[−1, 1\] has the range \[0, 1\] and is NaN at
    /// −1. If the arguments are not NaN and the range is finite, a sum or product is not NaN.
    pub(crate) fn numbers(&self, s: &[Interval]) -> Vec<bool> {
        let first = self.first_code();
        let is_finite = |r: &Interval| r.lo().is_finite() && r.hi().is_finite();
        let mut known: Vec<ValueFacts> = s[..first]
            .iter()
            .map(|r| ValueFacts {
                number: is_finite(r),
                positive: is_finite(r) && r.lo() >= 0.0,
            })
            .collect();
        for (k, i) in self.code.iter().enumerate() {
            let mut all = true;
            self.for_arguments(i, |a| all &= known[a as usize].number);
            let number = all && is_finite(&s[first + k]) && self.is_defined(i, s, &known);
            let positive = number && (s[first + k].lo() >= 0.0 || is_positive(i, &known));
            known.push(ValueFacts { number, positive });
        }
        known.into_iter().map(|sure| sure.number).collect()
    }

    /// Returns true if an operation is defined for all arguments in their ranges.
    fn is_defined(&self, i: &Instruction, s: &[Interval], known: &[ValueFacts]) -> bool {
        let within = |a: u32, lo: f64, hi: f64| {
            let r = &s[a as usize];
            lo <= r.lo() && r.hi() <= hi
        };
        match i.op {
            Op::Native => matches!(self.natives[i.a as usize].0, Native::Imported(_)),
            // Ranges of sums of squares begin slightly below 0.
            Op::Unary(Unary::Sqrt) => known[i.a as usize].positive,
            Op::Unary(op) => match op.domain() {
                (f64::NEG_INFINITY, f64::INFINITY) => true,
                (lo, hi) => within(i.a, lo, hi),
            },
            Op::Binary(op) => match op {
                Binary::Pow => within(i.a, f64::MIN_POSITIVE, f64::INFINITY),
                Binary::Div => !s[i.b as usize].contains(0.0),
                Binary::Add
                | Binary::Sub
                | Binary::Mul
                | Binary::Atan2
                | Binary::Less
                | Binary::LessEq => true,
            },
            Op::PowI => i.c as i32 >= 0 || !s[i.a as usize].contains(0.0),
            Op::Set(_) | Op::Select => true,
        }
    }

    /// Builds the tape of the kept operations.
    fn simplified(&self, choices: &[KeptBranch], matter: &[RelevantRange]) -> Self {
        let (first, inputs) = (self.first_code(), self.first_x());
        let constants: Vec<usize> = (0..inputs).filter(|&s| matter[s].is_any()).collect();
        let values = constants.iter().map(|&s| self.constants[s]);
        let mut tape = Self::with_inputs(self.n_x, self.n_params, values.collect());
        let mut place = vec![u32::MAX; self.slots()];
        for (to, from) in constants.into_iter().chain(inputs..first).enumerate() {
            place[from] = to as u32;
        }
        for (k, (i, choice)) in self.code.iter().zip(choices).enumerate() {
            let branches = match i.op {
                Op::Select => [i.b, i.c],
                _ => [i.a, i.b],
            };
            place[first + k] = match choice {
                KeptBranch::Neither => continue,
                KeptBranch::First => place[branches[0] as usize],
                KeptBranch::Second => place[branches[1] as usize],
                KeptBranch::Both => {
                    let moved = self.moved(i, |s| place[s as usize], &mut tape.natives);
                    tape.code.push(moved);
                    tape.uniform += usize::from(k < self.uniform);
                    (tape.slots() - 1) as u32
                }
            };
        }
        tape.roots = self.roots.iter().map(|&r| place[r as usize]).collect();
        tape
    }
}

/// Certain properties of the value in a slot.
#[derive(Clone, Copy, Debug)]
struct ValueFacts {
    /// True if the value is finite.
    number: bool,
    /// True if the value is finite and nonnegative.
    positive: bool,
}

/// Returns true if an operation on finite numbers is nonnegative for any rounding; ranges of sums
/// of squares begin slightly below 0.
fn is_positive(i: &Instruction, known: &[ValueFacts]) -> bool {
    let both = || known[i.a as usize].positive && known[i.b as usize].positive;
    match i.op {
        Op::Unary(Unary::Abs | Unary::Square | Unary::Sqrt | Unary::Exp | Unary::Cosh) => true,
        Op::PowI => (i.c as i32) % 2 == 0,
        Op::Binary(Binary::Add | Binary::Mul) => both(),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Graph, NodeId, Ops};
    use isoform_num::Random;

    /// Returns the tape for a box; the whole one if it cannot be simplified.
    fn rest(tape: &Tape, [lo, hi]: [[f64; 3]; 2]) -> Tape {
        let x: [Interval; 3] = std::array::from_fn(|i| Interval::new(lo[i], hi[i]));
        tape.bounds(&x, &[]).1.unwrap_or_else(|| tape.clone())
    }

    /// Builds the function of a ball about (k, 0, 0).
    fn ball(graph: &mut Graph, k: usize) -> NodeId {
        let [x, y, z] = [0, 1, 2].map(|i| graph.x(i));
        let x = graph.offset(&x, -(k as f64));
        let [x, y, z] = [x, y, z].map(|x| graph.square(&x));
        let sum = graph.add(&x, &y);
        let sum = graph.add(&sum, &z);
        let away = graph.sqrt(&sum);
        let radius = graph.constant(0.3);
        graph.sub(&radius, &away)
    }

    /// Checks that of a row of balls only those near a box are kept, for any order of the chain,
    /// also if the union is subtracted or written as the complement of an intersection.
    #[test]
    fn the_order_of_a_chain_does_not_matter() {
        for order in [1, 37, 99] {
            for form in 0..3 {
                let mut graph = Graph::new();
                let mut all = ball(&mut graph, 0);
                for k in 1..100 {
                    let one = ball(&mut graph, k * order % 100);
                    all = match form {
                        0 => graph.max(&all, &one),
                        _ => {
                            let both = [&all, &one].map(|u| graph.neg(u));
                            let neither = graph.min(&both[0], &both[1]);
                            graph.neg(&neither)
                        }
                    };
                }
                if form == 2 {
                    let outside = graph.neg(&all);
                    let x = graph.x(1);
                    all = graph.min(&outside, &x);
                }
                let tape = Tape::new(&graph, &[all], 3, 0);
                let short = rest(&tape, [[40.0, 0.0, 0.0], [41.0, 0.5, 0.5]]);
                assert!(
                    short.len() < tape.len() / 15,
                    "{} of {} operations, order {order}, form {form}",
                    short.len(),
                    tape.len()
                );
            }
        }
    }

    /// Builds a random expression with many shared subexpressions, some of which are NaN at some
    /// points.
    fn expression(random: &mut Random, graph: &mut Graph) -> NodeId {
        let mut nodes: Vec<NodeId> = (0..3).map(|i| graph.x(i)).collect();
        for _ in 0..60 {
            let mut any = || nodes[(random.unit() * nodes.len() as f64) as usize];
            let (a, b, c) = (any(), any(), any());
            let by = random.symmetric();
            let node = match (random.unit() * 24.0) as usize {
                0..8 => graph.max(&a, &b),
                8..16 => graph.min(&a, &b),
                16..18 => graph.neg(&a),
                18..20 => graph.offset(&a, by),
                20 => graph.select(&a, &b, &c),
                21 => {
                    let less = graph.less(&a, &b);
                    graph.select(&less, &b, &c)
                }
                22 => graph.add(&a, &b),
                _ if by < 0.0 => graph.sqrt(&a),
                _ => graph.square(&a),
            };
            nodes.push(node);
        }
        nodes[nodes.len() - 1]
    }

    /// Simplification preserves values bitwise, including NaN and signed zeros.
    #[test]
    fn what_is_left_computes_the_same_bits() {
        let mut random = Random::new(11);
        let (mut left_out, mut all) = (0, 0);
        for _ in 0..3000 {
            let mut graph = Graph::new();
            let root = expression(&mut random, &mut graph);
            let tape = Tape::new(&graph, &[root], 3, 0);
            let lo = [(); 3].map(|()| random.symmetric());
            let size = 2.0 * random.unit().powi(2);
            let short = rest(&tape, [lo, lo.map(|v| v + size)]);
            (left_out, all) = (left_out + tape.len() - short.len(), all + tape.len());
            for _ in 0..20 {
                let p = lo.map(|v| v + size * random.unit());
                let [whole, part] = [&tape, &short].map(|t| t.eval(&p, &[], &mut Vec::new()));
                assert!(
                    whole.to_bits() == part.to_bits() || whole.is_nan() && part.is_nan(),
                    "{part} for {whole} at {p:?}"
                );
            }
        }
        assert!(
            4 * left_out > all,
            "{left_out} of {all} operations left out"
        );
    }
}
