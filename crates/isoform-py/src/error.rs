//! Errors of the library as Python exceptions with code, position and hint.
//!
//! Codes are those of the command line. Hints name the arguments of Python.

use isoform::field::SolidError;
use isoform::field::hyperfun::SyntaxError;
use isoform::io::{At, ReadError, WriteError};
use isoform::{Stopped, TemplateError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use std::fmt::Display;

/// Reason why a call has no result.
#[derive(Debug)]
pub(crate) struct CallError {
    /// Short stable identifier, for programs.
    code: &'static str,
    /// Description of the problem, with its position.
    message: String,
    /// Suggested remedy; may be empty.
    hint: String,
    /// Line and column in a text, from 1; `None` outside texts.
    place: Option<(usize, usize)>,
}

impl CallError {
    pub(crate) fn new(code: &'static str, message: impl Display) -> Self {
        Self {
            code,
            message: message.to_string(),
            hint: String::new(),
            place: None,
        }
    }
    /// Returns the error for an invalid argument.
    pub(crate) fn usage(message: impl Display) -> Self {
        Self::new("usage", message)
    }
    /// Returns the error for a bug in Isoform.
    pub(crate) fn internal() -> Self {
        Self::new("internal", "isoform made an error of its own")
            .hint("please report it, with the call and its input")
    }
    /// Returns the error for work that was stopped from outside.
    pub(crate) fn stopped(message: impl Display) -> Self {
        Self::new("time-limit", message).hint("a larger time_limit")
    }
    pub(crate) fn hint(mut self, hint: impl Display) -> Self {
        self.hint = hint.to_string();
        self
    }
    /// Adds the position in a text, both numbers from 1.
    pub(crate) fn at(mut self, line: usize, column: usize) -> Self {
        self.place = Some((line, column));
        self
    }
}

/// Exception class, which is defined in the Python half of the package.
static ERROR_CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();

impl From<CallError> for PyErr {
    fn from(trouble: CallError) -> Self {
        Python::attach(|py| {
            let class = match ERROR_CLASS.import(py, "isoform._errors", "IsoformError") {
                Ok(class) => class,
                Err(error) => return error,
            };
            let hint = Some(trouble.hint).filter(|hint| !hint.is_empty());
            let (line, column) = trouble.place.unzip();
            let arguments = (trouble.message, trouble.code, hint, line, column);
            match class.call1(arguments) {
                Ok(raised) => Self::from_value(raised),
                Err(error) => error,
            }
        })
    }
}

impl From<Stopped> for CallError {
    fn from(Stopped: Stopped) -> Self {
        Self::stopped("stopped before there was a result")
    }
}

impl From<&ReadError> for CallError {
    fn from(e: &ReadError) -> Self {
        let trouble = Self::new(e.code(), e).hint(e.hint);
        match e.place.at {
            At::Line { line, column } => trouble.at(line as usize, (column as usize).max(1)),
            _ => trouble,
        }
    }
}

impl From<WriteError> for CallError {
    fn from(e: WriteError) -> Self {
        Self::new(e.code, &e).hint(e.hint)
    }
}

impl From<SyntaxError> for CallError {
    fn from(e: SyntaxError) -> Self {
        let trouble = Self::new("syntax", &e).at(e.line, e.column);
        match e.hint.as_str() {
            "" => trouble,
            expected => trouble.hint(format!("{expected} there")),
        }
    }
}

impl From<SolidError> for CallError {
    fn from(e: SolidError) -> Self {
        match e {
            SolidError::Parameters { .. } => Self::usage(e),
            SolidError::Missing { .. } => {
                Self::usage(e).hint("params={name: value}, or typical= in the program")
            }
            e => Self::new("model", e),
        }
    }
}

impl From<TemplateError> for CallError {
    fn from(e: TemplateError) -> Self {
        Self::new("template", e)
    }
}
