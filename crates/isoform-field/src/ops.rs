//! Operations of formulas, abstracted from their evaluation.
//!
//! Library functions and the HyperFun executor are written against [`Ops`]. With [`crate::Direct`] they
//! compute immediately, in any [`Real`] number type (the reference with which every evaluator must
//! agree); with a [`crate::Graph`] they build the expression.

use crate::library::{Library, Native};
use isoform_num::Real;

/// Functions of one argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs, reason = "each is the function of its name")]
pub enum Unary {
    Neg,
    Abs,
    Square,
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Floor,
    Ceil,
    Trunc,
    Sign,
}

/// Functions of two arguments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Binary {
    /// a + b
    Add,
    /// a − b
    Sub,
    /// a · b
    Mul,
    /// a / b
    Div,
    /// a^b for a > 0
    Pow,
    /// Angle of the point (x = b, y = a)
    Atan2,
    /// 1 where a < b, else 0
    Less,
    /// 1 where a ≤ b, else 0
    LessEq,
}

/// Set operations on functions with f ≥ 0 inside. Subtraction is the intersection with the negated
/// function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SetOp {
    /// u + v + √(u² + v²), the R0-function (Rvachev 1963)
    RUnion,
    /// u + v − √(u² + v²)
    RIntersection,
    /// max(u, v)
    Max,
    /// min(u, v)
    Min,
}

impl Unary {
    /// Returns true if the function has a kink or a jump.
    pub(crate) fn has_kink(self) -> bool {
        match self {
            Self::Abs | Self::Floor | Self::Ceil | Self::Trunc | Self::Sign => true,
            Self::Neg
            | Self::Square
            | Self::Sqrt
            | Self::Exp
            | Self::Ln
            | Self::Sin
            | Self::Cos
            | Self::Tan
            | Self::Asin
            | Self::Acos
            | Self::Atan
            | Self::Sinh
            | Self::Cosh
            | Self::Tanh => false,
        }
    }
    /// Returns the least and the greatest argument of the function's domain.
    pub(crate) fn domain(self) -> (f64, f64) {
        match self {
            Self::Sqrt => (0.0, f64::INFINITY),
            Self::Ln => (f64::MIN_POSITIVE, f64::INFINITY),
            Self::Asin | Self::Acos => (-1.0, 1.0),
            Self::Neg
            | Self::Abs
            | Self::Square
            | Self::Exp
            | Self::Sin
            | Self::Cos
            | Self::Tan
            | Self::Atan
            | Self::Sinh
            | Self::Cosh
            | Self::Tanh
            | Self::Floor
            | Self::Ceil
            | Self::Trunc
            | Self::Sign => (f64::NEG_INFINITY, f64::INFINITY),
        }
    }
    /// Evaluates the function in any number type.
    pub fn apply<R: Real>(self, a: &R) -> R {
        match self {
            Self::Neg => -a.clone(),
            Self::Abs => a.abs(),
            Self::Square => a.square(),
            Self::Sqrt => a.sqrt(),
            Self::Exp => a.exp(),
            Self::Ln => a.ln(),
            Self::Sin => a.sin(),
            Self::Cos => a.cos(),
            Self::Tan => a.tan(),
            Self::Asin => a.asin(),
            Self::Acos => a.acos(),
            Self::Atan => a.atan(),
            Self::Sinh => a.sinh(),
            Self::Cosh => a.cosh(),
            Self::Tanh => a.tanh(),
            Self::Floor => a.floor(),
            Self::Ceil => a.ceil(),
            Self::Trunc => a.trunc(),
            Self::Sign => a.sign(),
        }
    }
}

impl Binary {
    /// Returns true if the function has a kink or a jump.
    pub(crate) fn has_kink(self) -> bool {
        match self {
            Self::Less | Self::LessEq => true,
            Self::Add | Self::Sub | Self::Mul | Self::Div | Self::Pow | Self::Atan2 => false,
        }
    }
    /// Evaluates the function in any number type.
    pub fn apply<R: Real>(self, a: &R, b: &R) -> R {
        match self {
            Self::Add => a.clone() + b.clone(),
            Self::Sub => a.clone() - b.clone(),
            Self::Mul => a.clone() * b.clone(),
            Self::Div => a.clone() / b.clone(),
            Self::Pow => a.powf(b),
            Self::Atan2 => a.atan2(b),
            Self::Less => a.less(b),
            Self::LessEq => a.less_eq(b),
        }
    }
}

impl SetOp {
    /// Evaluates the function in any number type.
    pub fn apply<R: Real>(self, a: &R, b: &R) -> R {
        match self {
            Self::RUnion => a.r_union(b),
            Self::RIntersection => a.r_intersection(b),
            Self::Max => a.max(b),
            Self::Min => a.min(b),
        }
    }
}

/// Operations of which formulas are composed. Conditions are numbers: 0 is false, everything else
/// true.
pub trait Ops {
    /// Type of values: numbers, or nodes of the expression under construction.
    type V: Clone;

    /// Returns the constant `c`.
    fn constant(&mut self, c: f64) -> Self::V;
    /// Applies a function of one argument.
    fn unary(&mut self, op: Unary, a: &Self::V) -> Self::V;
    /// Applies a function of two arguments.
    fn binary(&mut self, op: Binary, a: &Self::V, b: &Self::V) -> Self::V;
    /// Returns a^n for an integer n.
    fn powi(&mut self, a: &Self::V, n: i32) -> Self::V;
    /// Applies a set operation, which stays one node of an expression.
    fn set(&mut self, op: SetOp, a: &Self::V, b: &Self::V) -> Self::V;
    /// Returns `a` where `condition` ≠ 0, else `b`.
    fn select(&mut self, condition: &Self::V, a: &Self::V, b: &Self::V) -> Self::V;
    /// Applies a primitive or blend of the library, which stays one node of an expression. The
    /// arguments are flat, in the order of [`Library`].
    fn library(&mut self, f: Library, args: &[Self::V]) -> Self::V;
    /// Applies a function that is computed by iteration rather than by a formula.
    fn native(&mut self, f: Native, args: &[Self::V]) -> Self::V;
    /// Returns the value if it is known: always in immediate evaluation, for constants only in the
    /// construction of an expression.
    fn known(&self, v: &Self::V) -> Option<f64>;

    /// Returns a + b.
    fn add(&mut self, a: &Self::V, b: &Self::V) -> Self::V {
        self.binary(Binary::Add, a, b)
    }
    /// Returns a − b.
    fn sub(&mut self, a: &Self::V, b: &Self::V) -> Self::V {
        self.binary(Binary::Sub, a, b)
    }
    /// Returns a · b.
    fn mul(&mut self, a: &Self::V, b: &Self::V) -> Self::V {
        self.binary(Binary::Mul, a, b)
    }
    /// Returns a / b.
    fn div(&mut self, a: &Self::V, b: &Self::V) -> Self::V {
        self.binary(Binary::Div, a, b)
    }
    /// Returns −a.
    fn neg(&mut self, a: &Self::V) -> Self::V {
        self.unary(Unary::Neg, a)
    }
    /// Returns a².
    fn square(&mut self, a: &Self::V) -> Self::V {
        self.unary(Unary::Square, a)
    }
    /// Returns √a.
    fn sqrt(&mut self, a: &Self::V) -> Self::V {
        self.unary(Unary::Sqrt, a)
    }
    /// Returns |a|.
    fn abs(&mut self, a: &Self::V) -> Self::V {
        self.unary(Unary::Abs, a)
    }
    /// Returns c · a.
    fn scale(&mut self, c: f64, a: &Self::V) -> Self::V {
        let c = self.constant(c);
        self.mul(&c, a)
    }
    /// Returns a + c.
    fn offset(&mut self, a: &Self::V, c: f64) -> Self::V {
        let c = self.constant(c);
        self.add(a, &c)
    }
    /// Returns min(a, b) as a set operation.
    fn min(&mut self, a: &Self::V, b: &Self::V) -> Self::V {
        self.set(SetOp::Min, a, b)
    }
    /// Returns max(a, b) as a set operation.
    fn max(&mut self, a: &Self::V, b: &Self::V) -> Self::V {
        self.set(SetOp::Max, a, b)
    }
    /// Returns 1 where a < b, else 0.
    fn less(&mut self, a: &Self::V, b: &Self::V) -> Self::V {
        self.binary(Binary::Less, a, b)
    }
    /// Returns 1 where a ≤ b, else 0.
    fn less_eq(&mut self, a: &Self::V, b: &Self::V) -> Self::V {
        self.binary(Binary::LessEq, a, b)
    }
}
