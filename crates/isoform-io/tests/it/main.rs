//! Integration tests of this crate, as one binary.

mod common;
mod corpus;
mod formats;
mod hostile;
mod level_sets;
mod meshes;
mod round_trip;
mod solids;
mod step;
mod tables;
mod three_mf;
