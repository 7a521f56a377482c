//! The integration tests of this crate, as one binary.

mod sphere;
mod support;
mod testpart;
