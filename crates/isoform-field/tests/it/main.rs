//! The integration tests of this crate, as one binary.

mod distance;
mod evaluators;
mod hyperfun_golden;
mod hyperfun_properties;
mod jumps;
mod pieces;
