//! The integration tests of this crate, as one binary.

mod adapt;
mod blocks;
mod common;
mod features;
mod features_extent;
mod layers;
mod mesh;
mod missed;
mod periodic;
mod regions;
