//! Meshing in blocks for `distributed.mesh_blocks`: the job, and a single task of it.

use crate::call::object;
use crate::error::CallError;
use crate::model::Program;
use crate::run::{self, CallLimits};
use isoform::geom::Solid;
use isoform::{
    BlockReport, BlockTask, BlocksError, BlocksJob, MeshModelError, MeshModelOptions,
    run_block_task, solid_of,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// Program with the values of its first parameters.
type ProgramWithValues = (Py<Program>, Vec<f64>);

/// Parses the options of a mesh.
fn options(arguments: &Bound<'_, PyDict>) -> PyResult<MeshModelOptions> {
    Ok(isoform_verbs::mesh_options(&object(arguments)?).map_err(CallError::from)?)
}

/// Returns the solid of a program with values.
fn solid((program, given): &ProgramWithValues, has_box: bool) -> Result<Box<dyn Solid>, CallError> {
    let program = program.get();
    let values = program.values_of(given)?;
    let (solid, is_run) =
        solid_of(program.model(), &values).map_err(|e| BlocksError::Mesh(e.into()))?;
    if is_run && !has_box {
        return Err(BlocksError::Mesh(MeshModelError::NoBox).into());
    }
    Ok(solid)
}

/// Job that meshes a model in blocks.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct BlocksWork(Mutex<Option<BlocksJob>>);

impl BlocksWork {
    /// Calls a function on the job; an error after the job has ended.
    fn ask<T>(&self, question: impl FnOnce(&mut BlocksJob) -> T) -> PyResult<T> {
        let mut job = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let job = job.as_mut();
        Ok(question(
            job.ok_or_else(|| CallError::usage("the job is over"))?,
        ))
    }
}

#[pymethods]
impl BlocksWork {
    /// Plans the blocks.
    #[new]
    fn new(
        py: Python<'_>,
        shape: ProgramWithValues,
        counts: [usize; 3],
        out: PathBuf,
        arguments: &Bound<'_, PyDict>,
        asked: CallLimits<'_>,
    ) -> PyResult<Self> {
        let options = options(arguments)?;
        let solid = solid(&shape, options.mesh.region.is_some())?;
        let job = run::run(py, &asked, move |control| {
            BlocksJob::new(solid.as_ref(), counts, &out, &options, control)
        })?;
        Ok(Self(Mutex::new(Some(job.map_err(CallError::from)?))))
    }
    /// Returns the name of the present step.
    #[getter]
    fn step(&self) -> PyResult<&'static str> {
        self.ask(|job| job.step_name())
    }
    /// Returns the length of edges.
    #[getter]
    fn size(&self) -> PyResult<f64> {
        self.ask(|job| job.options().mesh.size)
    }
    /// Returns the tasks of the present step, serialised as text.
    fn tasks(&self) -> PyResult<Vec<String>> {
        let text = |task| serde_json::to_string(&task).expect("tasks are plain");
        self.ask(|job| job.tasks().into_iter().map(text).collect())
    }
    /// Evaluates the reports of all tasks of the step and proceeds to the next step.
    fn advance(&self, py: Python<'_>, reports: Vec<String>) -> PyResult<()> {
        let reports: Result<Vec<BlockReport>, _> = reports
            .iter()
            .map(|text| serde_json::from_str(text))
            .collect();
        let reports = reports.map_err(|e| CallError::new("task", e))?;
        let done = run::shortly(py, || self.ask(|job| job.advance(reports)))??;
        Ok(done.map_err(CallError::from)?)
    }
    /// Ends the job and returns the document of `mesh --blocks --json`.
    fn finish(&self) -> PyResult<String> {
        let job = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        let job = job.ok_or_else(|| CallError::usage("the job is over"))?;
        let report = job.finish().map_err(CallError::from)?;
        let report = serde_json::to_value(report).expect("reports have texts for keys");
        Ok(isoform_verbs::document(0, report))
    }
    /// Ends the job without a result.
    fn close(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
    }
}

/// Executes a task and returns its report as text.
#[pyfunction]
pub(crate) fn block_task(
    py: Python<'_>,
    shape: ProgramWithValues,
    arguments: &Bound<'_, PyDict>,
    task: &str,
    asked: CallLimits<'_>,
) -> PyResult<String> {
    let options = options(arguments)?;
    let solid = solid(&shape, options.mesh.region.is_some())?;
    let task: BlockTask = serde_json::from_str(task).map_err(|e| CallError::new("task", e))?;
    let report = run::run(py, &asked, move |control| {
        run_block_task(solid.as_ref(), &options, &task, control)
    })?;
    let report = report.map_err(CallError::from)?;
    Ok(serde_json::to_string(&report).expect("reports are plain"))
}

impl From<BlocksError> for CallError {
    fn from(e: BlocksError) -> Self {
        match e {
            BlocksError::Mesh(e) => isoform_verbs::mesh_failure(&e, "model").into(),
            BlocksError::Write(e) => e.into(),
            BlocksError::Ending { .. } => Self::usage(e).hint("out='big.pvtu'"),
            BlocksError::Folder { .. } => Self::new("not-writable", e),
            e => Self::new("unreadable", e),
        }
    }
}
