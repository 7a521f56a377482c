//! Implicit functions: expressions, their decomposition into smooth parts, their evaluators, and
//! the HyperFun language.
//!
//! - [`Graph`]: the expression of a model, built by hand or from a HyperFun program ([`hyperfun`]).
//! - [`Tape`]: the compiled expression, with values, gradients, jets and intervals in blocks of
//!   points.

mod block;
mod branches;
mod distance;
pub mod graph;
pub mod hyperfun;
mod interpreted;
mod jets;
mod jumps;
pub mod library;
mod listing;
mod native;
pub mod ops;
mod parted;
mod placed;
mod polynomial;
mod residual;
mod shape;
mod shorter;
mod smooth;
mod solid;
mod split;
mod tape;

pub use branches::{parts_of, parts_of_pieces, parts_up_to};
pub use distance::Distance;
pub use graph::{Graph, Name, Node, NodeId};
pub use interpreted::Interpreted;
pub use jumps::Jump;
pub use library::{Axis, Library, Native};
pub use listing::Step;
pub use ops::{Binary, Direct, Ops, SetOp, Unary};
pub use placed::Placed;
pub use polynomial::Polynomial;
pub use residual::{Bound, Residual};
pub use shape::{Join, Part, Shape};
pub use solid::{Pieces, RunField, SolidError, parameter_values};
pub use tape::Tape;
