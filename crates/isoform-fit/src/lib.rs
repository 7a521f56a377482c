//! Templates fitted to points.
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate self as isoform_fit;

pub mod lm;
#[cfg(test)]
mod testing;
mod objective;
mod space;
mod template;

pub use objective::{Objective, Residuals};
pub use space::Space;
pub use template::{Kind, Parameter, Template, Tie};

/// Why there is no fit.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// A parameter's bounds are in the wrong order, equal or not numbers.
    #[error("bounds of {name} are not an interval: {lo} to {hi}")]
    Bounds {
        /// Parameter.
        name: String,
        /// Lower bound.
        lo: f64,
        /// Upper bound.
        hi: f64,
    },
    /// A tie runs in a circle, names a parameter that does not exist, or has a factor that is not finite.
    #[error("{name} is tied in a circle or to a parameter that does not exist")]
    Tie {
        /// Parameter.
        name: String,
    },
    /// Every parameter is fixed or tied to fixed ones.
    #[error("no parameter is free")]
    NothingFree,
    /// A number at the door is NaN or infinite.
    #[error("{what} is not finite (index {index})")]
    NotFinite {
        /// Which input.
        what: &'static str,
        /// Where in it.
        index: usize,
    },
}
