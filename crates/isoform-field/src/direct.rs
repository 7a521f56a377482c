//! Immediate evaluation of formulas.

use crate::library::{Library, Native};
use crate::ops::{Binary, Ops, SetOp, Unary};
use isoform_num::Real;
use std::marker::PhantomData;

/// Immediate evaluation in the number type `R`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Direct<R>(PhantomData<R>);

impl<R> Direct<R> {
    /// Creates the evaluator, which is stateless.
    pub fn new() -> Self {
        Self(PhantomData)
    }
}

impl<R: Real> Ops for Direct<R> {
    type V = R;

    fn constant(&mut self, c: f64) -> R {
        R::constant(c)
    }
    fn unary(&mut self, op: Unary, a: &R) -> R {
        op.apply(a)
    }
    fn binary(&mut self, op: Binary, a: &R, b: &R) -> R {
        op.apply(a, b)
    }
    fn powi(&mut self, a: &R, n: i32) -> R {
        a.powi(n)
    }
    fn set(&mut self, op: SetOp, a: &R, b: &R) -> R {
        op.apply(a, b)
    }
    fn select(&mut self, condition: &R, a: &R, b: &R) -> R {
        condition.select(a, b)
    }
    fn library(&mut self, f: Library, args: &[R]) -> R {
        f.algebraic(self, args)
    }
    fn native(&mut self, f: Native, args: &[R]) -> R {
        f.eval(args)
    }
    fn known(&self, v: &R) -> Option<f64> {
        Some(v.value())
    }
}
