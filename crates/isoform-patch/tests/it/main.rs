//! The integration tests of this crate, as one binary.

mod common;
mod control;
mod covers;
mod growing;
mod objective;
mod parts;
