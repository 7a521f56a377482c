//! Numbers that Isoform computes with, beyond plain `f64`.
//!
//! - [`Real`]: what a function must know of its number type, so that one formula serves values,
//!   jets and intervals.
//! - [`Interval`]: outward rounded, so that a bound is a proof.
//! - [`Jet1`], [`Jet2`], [`Jet3`]: a value with its derivatives to order 1, 2 or 3 (forward mode).
//! - [`IntervalJet`]: intervals for all derivatives to order 3 over a box.
//! - [`DoubleDouble`]: twice the digits, where they cancel.
//! - [`gauss_legendre`]: nodes and weights of Gauss quadrature.
//! - [`dispatch!`]: functions compiled for several instruction sets.
//! - [`linalg`]: the few dense solvers of small symmetric systems that fitting needs; [`Svd`]:
//!   singular values of small matrices.
//! - [`Random`]: pseudo-random streams that are the same in every run.
#![forbid(unsafe_code)]

mod dispatch;
mod double_double;
mod interval;
mod interval_jet;
mod jet;
pub mod linalg;
mod quadrature;
mod random;
mod real;
mod svd;

pub use double_double::DoubleDouble;
pub use interval::Interval;
pub use interval_jet::IntervalJet;
pub use jet::{Jet1, Jet2, Jet3, ORDERS, PAIRS, SECOND, THIRD, TRIPLES, hessian};
pub use quadrature::gauss_legendre;
pub use random::Random;
pub use real::Real;
pub use svd::Svd;
