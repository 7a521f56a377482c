//! Listing of a tape as steps, for evaluators outside of this crate such as a page or a shader.
//!
//! The slots are numbered as in the tape: constants, coordinates, parameters, then one for each
//! step.

use crate::library::Native;
use crate::ops::{Binary, SetOp, Unary};
use crate::tape::{Op, Tape};

/// Step of a tape; its arguments are slots.
#[derive(Clone, Debug, PartialEq)]
pub enum TapeStep {
    /// A function of one argument.
    Unary(Unary, u32),
    /// A function of two arguments.
    Binary(Binary, u32, u32),
    /// A set operation.
    Set(SetOp, u32, u32),
    /// An integer power.
    PowI(u32, i32),
    /// The second argument where the first is not 0, else the third.
    Select(u32, u32, u32),
    /// A function computed by iteration.
    Native(Native, Vec<u32>),
}

impl TapeStep {
    /// Returns the slots of the arguments.
    pub fn arguments(&self) -> Vec<u32> {
        match self {
            Self::Unary(_, u) | Self::PowI(u, _) => vec![*u],
            Self::Binary(_, u, v) | Self::Set(_, u, v) => vec![*u, *v],
            Self::Select(u, v, w) => vec![*u, *v, *w],
            Self::Native(_, list) => list.clone(),
        }
    }
}

impl Tape {
    /// Returns the values of the first slots.
    pub fn constants(&self) -> &[f64] {
        &self.constants
    }

    /// Lists the steps in the order of computation. The first [`Self::uniform_steps`] do not depend
    /// on the coordinates.
    ///
    /// ```
    /// use isoform_field::{Binary, Graph, Ops, Tape, TapeStep};
    /// let mut graph = Graph::new();
    /// let (x, a) = (graph.x(0), graph.param(0));
    /// let f = graph.sub(&a, &x);
    /// let tape = Tape::new(&graph, &[f], 3, 1);
    /// // Slots 0 to 2 are x, y and z, slot 3 is the parameter; the result is slot 4.
    /// assert_eq!(tape.steps().collect::<Vec<_>>(), [TapeStep::Binary(Binary::Sub, 3, 0)]);
    /// assert_eq!((tape.results(), tape.uniform_steps()), (&[4][..], 0));
    /// ```
    pub fn steps(&self) -> impl Iterator<Item = TapeStep> + '_ {
        self.code.iter().map(|i| match i.op {
            Op::Unary(op) => TapeStep::Unary(op, i.a),
            Op::Binary(op) => TapeStep::Binary(op, i.a, i.b),
            Op::Set(op) => TapeStep::Set(op, i.a, i.b),
            Op::PowI => TapeStep::PowI(i.a, i.c as i32),
            Op::Select => TapeStep::Select(i.a, i.b, i.c),
            Op::Native => {
                let (function, arguments) = &self.natives[i.a as usize];
                TapeStep::Native(function.clone(), arguments.to_vec())
            }
        })
    }

    /// Returns the number of initial steps that do not depend on the coordinates.
    pub fn uniform_steps(&self) -> usize {
        self.uniform
    }

    /// Returns the slots of the results.
    pub fn results(&self) -> &[u32] {
        &self.roots
    }
}
