//! Numbers that Isoform computes with, beyond plain `f64`.
//!
//! - [`Real`]: what a function must know of its number type, so that one formula serves values, jets and intervals.
//! - [`Interval`]: outward rounded, so that a bound is a proof.
//! - [`Jet1`], [`Jet2`], [`Jet3`]: a value with its derivatives to order 1, 2 or 3 (forward mode).
//! - [`linalg`]: the few dense solvers of small symmetric systems that fitting needs.
#![forbid(unsafe_code)]

mod interval;
mod jet;
pub mod linalg;
mod real;

pub use interval::Interval;
pub use jet::{Jet1, Jet2, Jet3};
pub use real::Real;
