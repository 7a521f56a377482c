//! `parameterize`: rational patches on the surface of a model.

use crate::arrays::rows;
use crate::document;
use crate::error::Trouble;
use crate::fit::named;
use crate::region::{Corners, length, region};
use crate::run::{self, Asked};
use crate::shape::Shape;
use isoform::geom::Point3;
use isoform::io::{
    MeshWriteOptions, StepOptions, write_atomic, write_mesh_path, write_patches, write_step_path,
};
use isoform::patch::{Covering, Error, Method, Options, Parameterized};
use isoform::report::{AboutPatches, PatchesReport, solver_name};
use isoform::{
    Coverage, ImplicitSurface, cover_surface, parameterize_surface, patch_findings, patch_mesh,
    patch_records, step_faces,
};
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// All solvers; reports have their names.
const METHODS: [Method; 3] = [Method::GaussNewton, Method::Frozen, Method::Newton];

/// What patches are wanted, as Python says it.
#[derive(FromPyObject)]
pub(crate) struct Wanted {
    #[pyo3(item)]
    degree: (usize, usize),
    #[pyo3(item)]
    region: Corners,
    #[pyo3(item)]
    tol: Option<f64>,
    #[pyo3(item)]
    cover: bool,
    #[pyo3(item)]
    exact: bool,
    #[pyo3(item)]
    seed: u64,
    #[pyo3(item)]
    seed_point: Option<Point3>,
    #[pyo3(item)]
    margin: Option<f64>,
    #[pyo3(item)]
    singular: Option<f64>,
    #[pyo3(item)]
    most: usize,
    #[pyo3(item)]
    method: String,
}

impl Wanted {
    fn options(&self) -> Result<Options, Trouble> {
        let tolerance = length("tol", self.tol)?;
        if self.cover && tolerance.is_none() {
            return Err(Trouble::usage("cover needs tol").hint("tol=, a length"));
        }
        Ok(Options {
            seed_point: self.seed_point,
            seed: self.seed,
            method: named("method", &self.method, METHODS.map(|m| (solver_name(m), m)))?,
            tolerance,
            exact: self.exact,
            ..Options::paper(self.degree, region(self.region)?)
        })
    }
    fn covering(&self) -> Result<Covering, Trouble> {
        Ok(Covering {
            most: self.most,
            margin: length("margin", self.margin)?,
            apart: length("singular", self.singular)?,
        })
    }
}

/// Rational patches on a surface.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Patches {
    name: String,
    surface: ImplicitSurface,
    pub(crate) patches: Vec<Parameterized>,
    document: String,
}

impl Patches {
    fn patch(&self, i: usize) -> Result<&Parameterized, Trouble> {
        let missing = || Trouble::usage(format!("there is no patch {i}"));
        self.patches.get(i).ok_or_else(missing)
    }
}

#[pymethods]
impl Patches {
    /// The document of `parameterize --json`, as text.
    #[getter]
    fn document(&self) -> &str {
        &self.document
    }
    fn __len__(&self) -> usize {
        self.patches.len()
    }
    /// The degrees of a patch.
    fn degree(&self, i: usize) -> PyResult<(usize, usize)> {
        Ok(self.patch(i)?.grown.patch.degree())
    }
    /// The control points of a patch, one row after the other.
    fn control<'py>(&self, py: Python<'py>, i: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.patch(i)?.grown.patch.control().to_vec())
    }
    /// The proved bound on the distance of a patch from the surface, none where none is proved.
    fn bound(&self, i: usize) -> PyResult<Option<f64>> {
        Ok(self.patch(i)?.distances.bound)
    }
    /// Points of a patch at rows of u and v.
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
    /// Writes the patches as JSON or STEP, else their triangles, by the ending.
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        units: Option<String>,
        grid: usize,
    ) -> PyResult<()> {
        if !(1..=1024).contains(&grid) {
            return Err(Trouble::usage(format!("grid is {grid}: from 1 to 1024")).into());
        }
        run::shortly(py, || self.write(&path, units, grid))??;
        Ok(())
    }
}

impl Patches {
    fn write(&self, path: &Path, units: Option<String>, grid: usize) -> Result<(), Trouble> {
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        let (field, patches) = (self.surface.field.as_ref(), &self.patches);
        match ending.to_ascii_lowercase().as_str() {
            "json" => {
                let bytes = write_patches(&patch_records(patches));
                write_atomic(path, |out| out.write_all(&bytes))?;
            }
            "step" | "stp" => {
                let stem = Path::new(&self.name).file_stem().unwrap_or_default();
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

/// What patches are to lie on.
#[derive(FromPyObject)]
pub(crate) enum Surface {
    /// A polynomial in x, y and z.
    #[pyo3(transparent)]
    Polynomial(String),
    #[pyo3(transparent)]
    Shape(Shape),
}

impl Surface {
    fn surface(self) -> Result<ImplicitSurface, Trouble> {
        let text = match self {
            Self::Shape(shape) => return shape.checked()?.surface(),
            Self::Polynomial(text) => text,
        };
        let parsed = ImplicitSurface::of_polynomial(&text).map_err(|e| {
            Trouble::new("polynomial", format!("F, column {}: {e}", e.column))
                .hint("a polynomial in x, y and z with rational coefficients")
                .at(1, e.column)
        })?;
        parsed.ok_or_else(|| {
            let message = "F is constant, or has a coefficient beyond the largest number";
            Trouble::new("polynomial", message)
        })
    }
}

/// Finds a patch, or all patches of a cover; the name is for the document.
#[pyfunction]
pub(crate) fn parameterize(
    py: Python<'_>,
    surface: Surface,
    name: String,
    wanted: Wanted,
    asked: Asked<'_>,
) -> PyResult<Patches> {
    let (options, covering) = (wanted.options()?, wanted.covering()?);
    let surface = surface.surface()?;
    let cover = wanted.cover;
    let found = run::run(py, &asked, move |control| -> Result<_, Error> {
        if cover {
            let made = cover_surface(&surface, &options, &covering, control)?;
            let (patches, coverage) = Coverage::of(made);
            return Ok((surface, patches, Some(coverage)));
        }
        let patch = parameterize_surface(&surface, &options, control)?;
        Ok((surface, vec![patch], None))
    })?;
    let (surface, patches, coverage) = found.map_err(Trouble::from)?;
    let findings = patch_findings(&patches, coverage.as_ref(), &options);
    let warnings: Vec<String> = findings.iter().map(ToString::to_string).collect();
    let report = PatchesReport::new(&AboutPatches {
        model: &name,
        options: &options,
        patches: &patches,
        coverage: coverage.as_ref(),
        findings: &findings,
        files: &[],
        warnings: &warnings,
        seconds: &[],
    });
    Ok(Patches {
        document: document::text(&report),
        name,
        surface,
        patches,
    })
}
