//! Fitting of a template to a cloud in chunks, for `fit_large`.
//!
//! The chunks belong to Python, on this machine or others. Python receives a list of messages, one
//! per chunk or None, and yields the answers in that order; [`answer`] computes them.

use crate::arrays::{PointRows, PointsArg};
use crate::call::object;
use crate::error::CallError;
use crate::model::Program;
use crate::results::Fit;
use crate::run::{self, CallLimits};
use isoform::io::ReadReport;
use isoform::{AnswerError, ChunkSource, fit_chunks};
use isoform_verbs::FittedScan;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};
use std::sync::{Arc, Mutex, PoisonError};

/// Access to the chunks held by Python.
struct PythonChunks {
    /// Callable from a list of messages to an iterator of answers.
    ask: Py<PyAny>,
    count: usize,
    /// Exception that left a chunk without an answer.
    raised: Mutex<Option<PyErr>>,
}

impl PythonChunks {
    fn raised(&self) -> std::sync::MutexGuard<'_, Option<PyErr>> {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn pass_on(
        &self,
        py: Python<'_>,
        message: &mut dyn FnMut(usize) -> Option<Vec<u8>>,
        each: &mut dyn FnMut(usize, &[u8]),
    ) -> PyResult<()> {
        let mut messages: Vec<Option<Bound<'_, PyBytes>>> = Vec::with_capacity(self.count);
        for chunk in 0..self.count {
            let next = message(chunk);
            // Most chunks receive an identical message, which is stored once.
            let last = messages.iter().rev().flatten().next();
            let next = next.map(|next| match last {
                Some(last) if last.as_bytes() == next => last.clone(),
                _ => PyBytes::new(py, &next),
            });
            messages.push(next);
        }
        let asked: Vec<usize> = (0..self.count).filter(|k| messages[*k].is_some()).collect();
        let mut answers = self
            .ask
            .bind(py)
            .call1((PyList::new(py, messages)?,))?
            .try_iter()?;
        for chunk in asked {
            let answer = answers.next().ok_or_else(CallError::internal)??;
            each(chunk, answer.cast::<PyBytes>()?.as_bytes());
        }
        Ok(())
    }
}

impl ChunkSource for PythonChunks {
    fn len(&self) -> usize {
        self.count
    }
    fn ask(
        &self,
        message: &mut dyn FnMut(usize) -> Option<Vec<u8>>,
        each: &mut dyn FnMut(usize, &[u8]),
    ) -> bool {
        if self.raised().is_some() {
            return false;
        }
        let passed = Python::attach(|py| self.pass_on(py, message, each));
        let is_whole = passed.is_ok();
        if let Err(raised) = passed {
            *self.raised() = Some(raised);
        }
        is_whole
    }
}

/// Fits a template to chunks; `ask` maps a list of `count` messages to an iterator of the answers
/// to those that are not None.
#[pyfunction]
pub(crate) fn fit_large(
    py: Python<'_>,
    ask: Py<PyAny>,
    count: usize,
    program: Py<Program>,
    names: (String, String),
    arguments: &Bound<'_, PyDict>,
    asked: CallLimits<'_>,
) -> PyResult<(String, Fit)> {
    let options = isoform_verbs::fit_options(&object(arguments)?).map_err(CallError::from)?;
    let (seed, method) = (options.fit.seed, options.fit.method);
    let chunks = Arc::new(PythonChunks {
        ask,
        count,
        raised: Mutex::new(None),
    });
    let theirs = chunks.clone();
    let found = run::run(py, &asked, move |control| {
        fit_chunks(&*theirs, program.get().model(), &options, control)
    })?;
    if let Some(raised) = chunks.raised().take() {
        return Err(raised);
    }
    let failed = |e| CallError::from(isoform_verbs::fit_failure(&e, &names.0, &names.1));
    let found = found.map_err(failed)?;
    let read = ReadReport::of_memory("chunks", found.fit.n_points);
    let fitted = FittedScan::new(found, names, read, (method, seed));
    let document = isoform_verbs::document(0, fitted.document());
    Ok((document, Fit::new(fitted)))
}

/// Computes the answer of a chunk of points to a message: on the threads of the fit if called from
/// its process, else on one thread.
#[pyfunction]
pub(crate) fn answer<'py>(
    py: Python<'py>,
    program: Py<Program>,
    points: PointsArg<'py>,
    message: &[u8],
) -> PyResult<Bound<'py, PyBytes>> {
    let points = PointRows::new(&points)?.to_points()?;
    let reader = program.get().chunk_reader();
    let work = || reader.answer(message, points);
    let answer = if rayon::current_thread_index().is_some() {
        run::shortly(py, work)?
    } else {
        let alone = CallLimits {
            threads: Some(1),
            ..CallLimits::default()
        };
        run::scoped(py, &alone, |_| work())?
    };
    let answer = answer.map_err(|e| match e {
        AnswerError::Template(e) => CallError::from(e),
        AnswerError::Changed { .. } => CallError::new("changed", e)
            .hint("a chunk is loaded many times, and has to give the same points each time"),
        AnswerError::Message => CallError::usage(e).hint("one version of isoform everywhere"),
    })?;
    Ok(PyBytes::new(py, &answer))
}
