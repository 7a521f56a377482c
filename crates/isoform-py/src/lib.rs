//! Compiled half of the Python package.
//!
//! The public interface (signatures, documentation, results with names) lies in `python/isoform`.
//! Verbs are those of the command line: `call` passes their arguments, with Python objects in place
//! of files, and returns the document of `--json` and the result. `run` releases Python's lock
//! meanwhile, handles Ctrl-C and reports progress; `error` converts failures to exceptions.
#![forbid(unsafe_code)]

mod arrays;
mod blocks;
mod call;
mod error;
mod implicitize;
mod large;
mod mesh;
mod model;
mod parameterize;
mod points;
mod results;
mod run;

use pyo3::prelude::pymodule;

/// Compiled half of the package isoform.
#[pymodule(name = "_isoform")]
mod native {
    #[pymodule_export]
    use crate::blocks::{BlocksWork, block_task};
    #[pymodule_export]
    use crate::call::{Input, Output, run_verb, schema};
    #[pymodule_export]
    use crate::implicitize::{Fitted, sample};
    #[pymodule_export]
    use crate::large::{answer, fit_large};
    #[pymodule_export]
    use crate::mesh::MeshData;
    #[pymodule_export]
    use crate::model::{Program, template, templates};
    #[pymodule_export]
    use crate::parameterize::Patches;
    #[pymodule_export]
    use crate::points::{Cloud, read_points};
    #[pymodule_export]
    use crate::results::{Entities, Fit, Solids, Triangulation};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
