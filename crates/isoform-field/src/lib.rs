//! Implicit functions: expressions, their decomposition into smooth parts, their evaluators, and
//! the HyperFun language.
//!
//! - [`Graph`]: the expression of a model, built by hand or from a HyperFun program ([`hyperfun`]).
//! - [`Tape`]: the compiled expression, with values, gradients, jets and intervals in blocks of
//!   points.

mod block;
mod branches;
mod direct;
mod distance;
mod formulas;
pub mod graph;
pub mod hyperfun;
mod imported;
mod interpreted;
mod jets;
mod jumps;
pub mod library;
mod listing;
mod native;
pub mod ops;
mod partition;
mod placed;
mod polynomial;
mod residual;
mod shape;
mod similar;
mod simplify;
mod smooth;
mod solid;
mod split;
mod tape;

pub use branches::{parts_of, parts_of_pieces, parts_up_to};
pub use direct::Direct;
pub use distance::Distance;
pub use graph::{Graph, Name, Node, NodeId};
pub use imported::Imported;
pub use interpreted::Interpreted;
pub use jumps::Jump;
pub use library::{Axis, Library, Native};
pub use listing::TapeStep;
pub use ops::{Binary, Ops, SetOp, Unary};
pub use placed::Placed;
pub use polynomial::Polynomial;
pub use residual::{Bound, Residual};
pub use shape::{Join, Part, Shape};
pub use similar::{similar, suggestion};
pub use solid::{Pieces, RunField, SolidError, parameter_values};
pub use tape::Tape;
