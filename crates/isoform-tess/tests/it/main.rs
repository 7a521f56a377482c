//! The integration tests of this crate, as one binary.

mod analysis;
mod claims;
mod common;
mod control;
mod domains;
mod double;
mod improper;
mod maps;
mod patches;
mod surfaces;
mod winding;
mod zoo;
