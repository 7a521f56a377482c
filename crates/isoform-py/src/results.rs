//! Results of verbs: fits, solids, entities and triangulated surfaces.

use crate::arrays::rows;
use crate::error::CallError;
use crate::mesh::MeshData;
use crate::points::Cloud;
use crate::run::{self, CallLimits};
use isoform::geom::Mesh;
use isoform::io::{
    ReadReport, SolidFile, SolidOptions, StepOptions, write_atomic, write_solids, write_step_solids,
};
use isoform::{ModelBrep, Recognized};
use isoform_verbs::memory::MapObject;
use isoform_verbs::{FittedScan, Statement};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Template fitted to points.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Fit(Arc<FittedScan>);

impl Fit {
    pub(crate) fn new(fitted: FittedScan) -> Self {
        Self(Arc::new(fitted))
    }
}

#[pymethods]
impl Fit {
    /// Returns the signed deviations of the points, positive outside.
    fn deviation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.0.found().deviation())
    }
    /// Returns an outlier flag for each point.
    fn outliers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_slice(py, &self.0.found().fit.outliers)
    }
    /// Returns the fitted points, including those added on the faces of a CAD mesh.
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let cloud = &self.0.found().cloud;
        let place = |i| cloud.absolute(i);
        rows(py, (0..cloud.points.len()).map(place).collect())
    }
    /// Returns the points with their deviations, for pages and pictures.
    fn cloud(&self) -> Cloud {
        let cloud = self.0.cloud();
        let report = ReadReport::of_memory("ply", cloud.points.len());
        Cloud::from_parts(cloud, report)
    }
    /// Returns the fitted program.
    fn program(&self) -> String {
        self.0.found().program()
    }
    /// Writes a file in the form given by its ending.
    fn save(&self, py: Python<'_>, path: PathBuf, asked: CallLimits<'_>) -> PyResult<()> {
        let fitted = self.0.clone();
        let saved = run::listened(py, &asked, move |listener| fitted.save(&path, listener))?;
        Ok(saved.map_err(CallError::from)?)
    }
}

/// Solids of exact faces.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Solids {
    pub(crate) made: ModelBrep,
    /// Name, unit and properties stated in files.
    pub(crate) statement: Statement,
}

#[pymethods]
impl Solids {
    /// Writes STEP, or the native form if the name ends in .brep.json.
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        units: Option<String>,
        ap214: bool,
    ) -> PyResult<()> {
        run::shortly(py, || self.write(&path, units, ap214))??;
        Ok(())
    }
}

impl Solids {
    pub(crate) fn new(made: ModelBrep, statement: Statement) -> Self {
        Self { made, statement }
    }
    fn write(&self, path: &Path, units: Option<String>, ap214: bool) -> Result<(), CallError> {
        if !self.made.is_closed() {
            return Err(CallError::new("open", "a shell is not closed").hint("a smaller size"));
        }
        let (brep, properties) = (&self.made.built.brep, self.made.properties());
        let unit = units.or_else(|| self.statement.unit.clone());
        let file = path.to_string_lossy().to_ascii_lowercase();
        if file.ends_with(".brep.json") {
            let bytes = write_solids(&SolidFile {
                brep: brep.clone(),
                name: self.statement.name.clone(),
                unit,
                properties,
            });
            return Ok(write_atomic(path, |out| out.write_all(&bytes))?);
        }
        if !(file.ends_with(".step") || file.ends_with(".stp")) {
            let message = format!(
                "{}: solids are not written with this ending",
                path.display()
            );
            return Err(CallError::usage(message).hint("a name that ends in .step or .brep.json"));
        }
        let step = StepOptions {
            units: unit,
            name: self.statement.name.clone(),
            time: None,
        };
        write_step_solids(brep, &properties, path, &SolidOptions { step, ap214 })?;
        Ok(())
    }
}

/// Entities recognised in points.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Entities {
    found: Recognized<'static>,
}

impl Entities {
    pub(crate) fn new(found: Recognized<'static>) -> Self {
        Self { found }
    }
}

#[pymethods]
impl Entities {
    /// Returns the index of the entity of each point; -1 for none.
    fn labels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        indices(py, &self.found.recognition.labels)
    }
    /// Returns the index of the face of each point; -1 for none.
    fn face_labels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        indices(py, &self.found.recognition.face_labels)
    }
    /// Returns the points examined, including those added on the faces of a CAD mesh.
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let scan = &self.found.scan;
        let place = |i| scan.absolute(i);
        rows(py, (0..scan.points.len()).map(place).collect())
    }
    /// Returns a program of the entities, as a template for fits, and a list of its gaps.
    fn template(&self, py: Python<'_>, title: &str) -> PyResult<(String, Vec<String>)> {
        let asked = CallLimits::default();
        let proposal = run::scoped(py, &asked, |control| self.found.template(title, control))?;
        let proposal = proposal.map_err(|e| CallError::new("no-template", e))?;
        let gaps = proposal.gaps.iter().map(ToString::to_string).collect();
        Ok((proposal.program, gaps))
    }
}

/// Converts optional indices to an array, with -1 for none.
fn indices<'py>(py: Python<'py>, of: &[Option<u32>]) -> Bound<'py, PyArray1<i64>> {
    PyArray1::from_iter(py, of.iter().map(|l| l.map_or(-1, i64::from)))
}

/// Triangulated rational surface.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Triangulation {
    pub(crate) mesh: Arc<Mesh>,
    parameters: Vec<[f64; 2]>,
    report: String,
    /// Rational map; `None` for a surface of patches.
    pub(crate) map: Option<Arc<MapObject>>,
}

impl Triangulation {
    pub(crate) fn new(
        mesh: Mesh,
        parameters: Vec<[f64; 2]>,
        report: String,
        map: Option<Arc<MapObject>>,
    ) -> Self {
        Self {
            mesh: Arc::new(mesh),
            parameters,
            report,
            map,
        }
    }
}

#[pymethods]
impl Triangulation {
    /// Returns the triangles.
    fn mesh(&self) -> MeshData {
        MeshData {
            mesh: self.mesh.clone(),
            unit: None,
        }
    }
    /// Returns the parameters s and t of the vertices.
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.parameters.clone())
    }
    /// Returns the document of `triangulate --report` as text.
    #[getter]
    fn report(&self) -> &str {
        &self.report
    }
}
