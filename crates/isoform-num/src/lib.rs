//! Numbers that Isoform computes with, beyond plain `f64`.
//!
//! - [`Real`]: the operations of a number type, so that one formula serves values, jets and
//!   intervals.
//! - [`Interval`]: intervals rounded outward, so that their bounds are proofs.
//! - [`Jet1`], [`Jet2`], [`Jet3`]: a value with its derivatives to order 1, 2 or 3 (forward mode).
//! - [`IntervalJet`]: intervals for all derivatives to order 3 over a box.
//! - [`DoubleDouble`]: twice the digits of a double, against cancellation.
//! - [`gauss_legendre`]: nodes and weights of Gauss quadrature.
//! - [`dispatch!`]: functions compiled for several instruction sets.
//! - [`linalg`]: dense solvers of small symmetric systems, for fitting; [`Svd`]: singular values of
//!   small matrices.
//! - [`Random`]: reproducible streams of pseudo-random numbers.
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
