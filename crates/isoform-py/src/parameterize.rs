//! Rational patches: control points, evaluation, and files.

use crate::arrays::rows;
use crate::error::CallError;
use crate::run;
use isoform::io::{
    MeshWriteOptions, StepOptions, write_atomic, write_mesh_path, write_patches, write_step_path,
};
use isoform::patch::Parameterized;
use isoform::{ImplicitSurface, patch_mesh, patch_records, step_faces};
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// Rational patches on a surface.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Patches {
    surface: ImplicitSurface,
    pub(crate) patches: Vec<Parameterized>,
}

impl Patches {
    pub(crate) fn new(surface: ImplicitSurface, patches: Vec<Parameterized>) -> Self {
        Self { surface, patches }
    }
    fn patch(&self, i: usize) -> Result<&Parameterized, CallError> {
        let missing = || CallError::usage(format!("there is no patch {i}"));
        self.patches.get(i).ok_or_else(missing)
    }
}

#[pymethods]
impl Patches {
    fn __len__(&self) -> usize {
        self.patches.len()
    }
    /// Returns the degrees of a patch.
    fn degree(&self, i: usize) -> PyResult<(usize, usize)> {
        Ok(self.patch(i)?.grown.patch.degree())
    }
    /// Returns the control points of a patch, row by row.
    fn control<'py>(&self, py: Python<'py>, i: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.patch(i)?.grown.patch.control().to_vec())
    }
    /// Returns the proved bound on the distance of a patch from the surface; `None` without a
    /// proof.
    fn bound(&self, i: usize) -> PyResult<Option<f64>> {
        Ok(self.patch(i)?.distances.bound)
    }
    /// Evaluates a patch at rows of u and v.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        i: usize,
        at: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let patch = &self.patch(i)?.grown.patch;
        let at = at.as_array();
        let points = run::shortly(py, || {
            at.outer_iter()
                .map(|uv| patch.point(uv[0], uv[1]))
                .collect()
        })?;
        rows(py, points)
    }
    /// Writes the patches as JSON or STEP, or their triangles, depending on the ending.
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        units: Option<String>,
        grid: usize,
    ) -> PyResult<()> {
        if !(1..=1024).contains(&grid) {
            return Err(CallError::usage(format!("grid is {grid}: from 1 to 1024")).into());
        }
        run::shortly(py, || self.write(&path, units, grid))??;
        Ok(())
    }
}

impl Patches {
    fn write(&self, path: &Path, units: Option<String>, grid: usize) -> Result<(), CallError> {
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        let (field, patches) = (self.surface.field.as_ref(), &self.patches);
        match ending.to_ascii_lowercase().as_str() {
            "json" => {
                let bytes = write_patches(&patch_records(patches));
                write_atomic(path, |out| out.write_all(&bytes))?;
            }
            "step" | "stp" => {
                let stem = path.file_stem().unwrap_or_default();
                let options = StepOptions {
                    units,
                    name: stem.to_string_lossy().into_owned(),
                    time: None,
                };
                write_step_path(&step_faces(field, patches), path, &options)?;
            }
            _ => {
                let options = MeshWriteOptions {
                    units,
                    ..MeshWriteOptions::default()
                };
                write_mesh_path(&patch_mesh(field, patches, grid), path, None, &options)?;
            }
        }
        Ok(())
    }
}
