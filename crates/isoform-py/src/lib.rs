//! The compiled half of the Python package: one file for each verb, each a call of the façade.
//!
//! What Python users see (signatures, pages, results with names) lies in `python/isoform`; here are
//! arrays in, one call of the library, arrays and the document of `--json` out. `run` releases
//! Python's lock meanwhile, listens to Ctrl-C and tells of progress; `error` makes exceptions of
//! what the library refuses.
#![forbid(unsafe_code)]

mod arrays;
mod blocks;
mod brep;
mod compare;
mod document;
mod error;
mod fit;
mod implicitize;
mod large;
mod mesh;
mod model;
mod parameterize;
mod points;
mod recognize;
mod region;
mod render;
mod run;
mod shape;
mod triangulate;
mod view;

use pyo3::prelude::pymodule;

/// The compiled half of the package isoform.
#[pymodule(name = "_isoform")]
mod native {
    #[pymodule_export]
    use crate::blocks::{BlocksWork, block_task};
    #[pymodule_export]
    use crate::brep::{Solids, brep};
    #[pymodule_export]
    use crate::compare::compare;
    #[pymodule_export]
    use crate::fit::{Fit, fit};
    #[pymodule_export]
    use crate::implicitize::{Fitted, implicitize};
    #[pymodule_export]
    use crate::large::{answer, fit_large};
    #[pymodule_export]
    use crate::mesh::{MeshData, mesh};
    #[pymodule_export]
    use crate::model::{Program, template};
    #[pymodule_export]
    use crate::parameterize::{Patches, parameterize};
    #[pymodule_export]
    use crate::points::{Cloud, read_points};
    #[pymodule_export]
    use crate::recognize::{Entities, recognize};
    #[pymodule_export]
    use crate::render::picture;
    #[pymodule_export]
    use crate::triangulate::{Triangulation, triangulate};
    #[pymodule_export]
    use crate::view::page;
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
