//! The compiled half of the Python package: one file for each verb, each a call of the façade crate.
//!
//! What Python users see (signatures, pages, results with names) lies in `python/isoform`; here are
//! arrays in, one call of the library, arrays and the document of `--json` out. [`run`] releases
//! Python's lock meanwhile, listens to Ctrl-C and tells of progress; [`error`] makes exceptions of
//! what the library refuses.
#![forbid(unsafe_code)]

mod arrays;
mod document;
mod error;
mod fit;
mod model;
mod points;
mod run;

use pyo3::prelude::pymodule;

/// The compiled half of the package isoform.
#[pymodule(name = "_isoform")]
mod native {
    #[pymodule_export]
    use crate::fit::{Fit, fit};
    #[pymodule_export]
    use crate::model::{Program, template};
    #[pymodule_export]
    use crate::points::{Cloud, read_points};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
