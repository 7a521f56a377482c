//! Formulas written with operators: [`E`] is a value together with its machine.

use super::machine::Machine;
use crate::library::{Library, Native};
use crate::ops::{Binary, SetOp, Unary};
use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Value in a formula.
pub(crate) struct E<'c, M: Machine> {
    machine: &'c RefCell<M>,
    pub(crate) v: M::V,
}

impl<M: Machine> Clone for E<'_, M> {
    fn clone(&self) -> Self {
        Self {
            machine: self.machine,
            v: self.v.clone(),
        }
    }
}

impl<'c, M: Machine> E<'c, M> {
    pub(crate) fn new(machine: &'c RefCell<M>, v: M::V) -> Self {
        Self { machine, v }
    }
    fn with(&self, f: impl FnOnce(&mut M, &M::V) -> M::V) -> Self {
        let v = f(&mut self.machine.borrow_mut(), &self.v);
        Self {
            machine: self.machine,
            v,
        }
    }
    pub(crate) fn constant(&self, c: f64) -> Self {
        self.with(|m, _| m.constant(c))
    }
    /// Returns the value if it is known.
    pub(crate) fn known(&self) -> Option<f64> {
        self.machine.borrow().known(&self.v)
    }
    pub(crate) fn unary(&self, op: Unary) -> Self {
        self.with(|m, v| m.unary(op, v))
    }
    pub(crate) fn binary(&self, op: Binary, o: &Self) -> Self {
        self.with(|m, v| m.binary(op, v, &o.v))
    }
    fn set(&self, op: SetOp, o: &Self) -> Self {
        self.with(|m, v| m.set(op, v, &o.v))
    }
    pub(crate) fn sqrt(&self) -> Self {
        self.unary(Unary::Sqrt)
    }
    pub(crate) fn square(&self) -> Self {
        self.unary(Unary::Square)
    }
    pub(crate) fn abs(&self) -> Self {
        self.unary(Unary::Abs)
    }
    pub(crate) fn exp(&self) -> Self {
        self.unary(Unary::Exp)
    }
    pub(crate) fn sin(&self) -> Self {
        self.unary(Unary::Sin)
    }
    pub(crate) fn cos(&self) -> Self {
        self.unary(Unary::Cos)
    }
    pub(crate) fn atan(&self) -> Self {
        self.unary(Unary::Atan)
    }
    pub(crate) fn floor(&self) -> Self {
        self.unary(Unary::Floor)
    }
    pub(crate) fn trunc(&self) -> Self {
        self.unary(Unary::Trunc)
    }
    pub(crate) fn powi(&self, n: i32) -> Self {
        self.with(|m, v| m.powi(v, n))
    }
    pub(crate) fn min(&self, o: &Self) -> Self {
        self.set(SetOp::Min, o)
    }
    pub(crate) fn max(&self, o: &Self) -> Self {
        self.set(SetOp::Max, o)
    }
    pub(crate) fn union(&self, o: &Self) -> Self {
        self.set(SetOp::RUnion, o)
    }
    pub(crate) fn intersection(&self, o: &Self) -> Self {
        self.set(SetOp::RIntersection, o)
    }
    /// Returns 1 where self < o, else 0.
    pub(crate) fn less(&self, o: &Self) -> Self {
        self.with(|m, v| {
            let c = m.less(v, &o.v);
            m.boolean(c)
        })
    }
    /// Returns 1 where self ≤ o, else 0.
    pub(crate) fn less_eq(&self, o: &Self) -> Self {
        self.with(|m, v| {
            let c = m.less_eq(v, &o.v);
            m.boolean(c)
        })
    }
    pub(crate) fn below(&self, c: f64) -> Self {
        self.less(&self.constant(c))
    }
    pub(crate) fn at_most(&self, c: f64) -> Self {
        self.less_eq(&self.constant(c))
    }
    /// Returns `a` where this condition is not 0, else `b`.
    pub(crate) fn select(&self, a: &Self, b: &Self) -> Self {
        self.with(|m, v| m.select(v, &a.v, &b.v))
    }
    /// Returns the conjunction of two conditions.
    pub(crate) fn and(&self, o: &Self) -> Self {
        self * o
    }
    /// Clamps the value to [lo, hi].
    pub(crate) fn clamp(&self, lo: f64, hi: f64) -> Self {
        self.max(&self.constant(lo)).min(&self.constant(hi))
    }
    pub(crate) fn native(&self, f: Native, rest: &[&Self]) -> Self {
        let mut arguments = vec![self.v.clone()];
        arguments.extend(rest.iter().map(|e| e.v.clone()));
        self.with(|m, _| m.native(f, &arguments))
    }
    pub(crate) fn library(&self, f: Library, rest: &[&Self]) -> Self {
        let mut arguments = vec![self.v.clone()];
        arguments.extend(rest.iter().map(|e| e.v.clone()));
        self.with(|m, _| m.library(f, &arguments))
    }
}

macro_rules! operators {
    ($($name:ident $method:ident $op:ident;)*) => {$(
        impl<'c, M: Machine> $name<&E<'c, M>> for &E<'c, M> {
            type Output = E<'c, M>;
            fn $method(self, o: &E<'c, M>) -> E<'c, M> { self.binary(Binary::$op, o) }
        }
        impl<'c, M: Machine> $name<E<'c, M>> for &E<'c, M> {
            type Output = E<'c, M>;
            fn $method(self, o: E<'c, M>) -> E<'c, M> { self.binary(Binary::$op, &o) }
        }
        impl<'c, M: Machine> $name<&E<'c, M>> for E<'c, M> {
            type Output = Self;
            fn $method(self, o: &Self) -> Self { self.binary(Binary::$op, o) }
        }
        impl<M: Machine> $name for E<'_, M> {
            type Output = Self;
            fn $method(self, o: Self) -> Self { self.binary(Binary::$op, &o) }
        }
        impl<M: Machine> $name<f64> for E<'_, M> {
            type Output = Self;
            fn $method(self, c: f64) -> Self { self.binary(Binary::$op, &self.constant(c)) }
        }
        impl<'c, M: Machine> $name<f64> for &E<'c, M> {
            type Output = E<'c, M>;
            fn $method(self, c: f64) -> E<'c, M> { self.binary(Binary::$op, &self.constant(c)) }
        }
        impl<'c, M: Machine> $name<E<'c, M>> for f64 {
            type Output = E<'c, M>;
            fn $method(self, o: E<'c, M>) -> E<'c, M> { o.constant(self).binary(Binary::$op, &o) }
        }
        impl<'c, M: Machine> $name<&E<'c, M>> for f64 {
            type Output = E<'c, M>;
            fn $method(self, o: &E<'c, M>) -> E<'c, M> { o.constant(self).binary(Binary::$op, o) }
        }
    )*};
}

operators! {
    Add add Add;
    Sub sub Sub;
    Mul mul Mul;
    Div div Div;
}

impl<M: Machine> Neg for E<'_, M> {
    type Output = Self;
    fn neg(self) -> Self {
        self.unary(Unary::Neg)
    }
}
impl<'c, M: Machine> Neg for &E<'c, M> {
    type Output = E<'c, M>;
    fn neg(self) -> E<'c, M> {
        self.unary(Unary::Neg)
    }
}

/// Point or vector in a formula.
pub(crate) type E3<'c, M> = [E<'c, M>; 3];

pub(crate) fn dot<'c, M: Machine>(u: &E3<'c, M>, v: &E3<'c, M>) -> E<'c, M> {
    &u[0] * &v[0] + &u[1] * &v[1] + &u[2] * &v[2]
}

pub(crate) fn minus<'c, M: Machine>(u: &E3<'c, M>, v: &E3<'c, M>) -> E3<'c, M> {
    std::array::from_fn(|i| &u[i] - &v[i])
}

pub(crate) fn cross<'c, M: Machine>(u: &E3<'c, M>, v: &E3<'c, M>) -> E3<'c, M> {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        &u[j] * &v[k] - &u[k] * &v[j]
    })
}

/// Returns u₁² + u₂² + u₃².
pub(crate) fn norm2<'c, M: Machine>(u: &E3<'c, M>) -> E<'c, M> {
    u[0].square() + u[1].square() + u[2].square()
}
