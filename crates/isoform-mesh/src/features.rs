//! Feature curves and corners of a solid, and its box.

mod extent;

pub use extent::{Extent, ExtentError, START, extent};
