//! The integration tests of this crate, as one binary.

mod breaks;
mod brep;
mod common;
mod compare;
mod domains;
mod eval;
mod fit;
mod formulas;
mod implicitize;
mod kinds;
mod mesh;
mod parameterize;
mod recognize;
mod render;
mod serve;
mod solids;
mod studio;
mod terms;
mod triangulate;
mod view;
