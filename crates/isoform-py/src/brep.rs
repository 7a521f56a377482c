//! `brep`: solids of exact faces for CAD, with a certificate.

use crate::document;
use crate::error::Trouble;
use crate::model::Program;
use crate::region::{Corners, length, some_region};
use crate::run::{self, Asked};
use isoform::io::{
    SolidFile, SolidOptions, StepOptions, write_atomic, write_solids, write_step_solids,
};
use isoform::report::{BrepReport, ModelName, Seconds};
use isoform::{MeshModelOptions, ModelBrep, brep_model};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// Solids of exact faces.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Solids {
    pub(crate) made: ModelBrep,
    /// What files call it.
    name: String,
    unit: Option<String>,
    document: String,
}

#[pymethods]
impl Solids {
    /// The document of `brep --json`, as text.
    #[getter]
    fn document(&self) -> &str {
        &self.document
    }
    /// Writes STEP, or our own form where the name ends in .brep.json.
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
    fn write(&self, path: &Path, units: Option<String>, ap214: bool) -> Result<(), Trouble> {
        if !self.made.is_closed() {
            return Err(Trouble::new("open", "a shell is not closed").hint("a smaller size"));
        }
        let (brep, properties) = (&self.made.built.brep, self.made.properties());
        let unit = units.or_else(|| self.unit.clone());
        let file = path.to_string_lossy().to_ascii_lowercase();
        if file.ends_with(".brep.json") {
            let bytes = write_solids(&SolidFile {
                brep: brep.clone(),
                name: self.name.clone(),
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
            return Err(Trouble::usage(message).hint("a name that ends in .step or .brep.json"));
        }
        let step = StepOptions {
            units: unit,
            name: self.name.clone(),
            time: None,
        };
        write_step_solids(brep, &properties, path, &SolidOptions { step, ap214 })?;
        Ok(())
    }
}

/// The solids of a model with the values of its parameters; the name is for documents and files.
#[pyfunction]
pub(crate) fn brep(
    py: Python<'_>,
    program: Py<Program>,
    given: Vec<f64>,
    name: String,
    wanted: (Option<f64>, Option<f64>, Option<Corners>),
    asked: Asked<'_>,
) -> PyResult<Solids> {
    let (size, tol, corners) = wanted;
    let values = program.get().values_of(&given)?;
    let mut options = MeshModelOptions {
        size: length("size", size)?,
        ..MeshModelOptions::default()
    };
    options.mesh.region = some_region(corners)?;
    let tolerance = length("tol", tol)?;
    let (theirs, a) = (program.clone_ref(py), values.clone());
    let made = run::run(py, &asked, move |control| {
        brep_model(theirs.get().model(), &a, &options, tolerance, control)
    })?;
    let model = program.get().model();
    let made = made.map_err(Trouble::from)?;
    let stem = Path::new(&name).file_stem().unwrap_or_default();
    let stem = stem.to_string_lossy().into_owned();
    let unit = model.info().unit.clone();
    let about = ModelName {
        file: name,
        object: model.name().to_owned(),
        parameters: values,
        unit: unit.clone(),
    };
    let report = BrepReport::new(&made, about, Vec::new(), Seconds::default());
    Ok(Solids {
        document: document::text(&report),
        made,
        name: stem,
        unit,
    })
}
