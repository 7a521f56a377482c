//! The integration tests of this crate, as one binary.

mod elimination;
mod factors;
mod maps;
mod real;
mod referee;
mod ring;
