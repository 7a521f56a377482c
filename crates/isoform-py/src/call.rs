//! Calls of verbs: converts Python arguments to a request, and returns the document and the result.

use crate::error::CallError;
use crate::implicitize::Fitted;
use crate::mesh::MeshData;
use crate::model::Program;
use crate::parameterize::Patches;
use crate::points::Cloud;
use crate::results::{Entities, Fit, Solids, Triangulation};
use crate::run::{self, CallLimits};
use isoform::io::{SolidFile, write_patches, write_solids};
use isoform::patch_records;
use isoform_verbs::memory::{Mounted, Object};
use isoform_verbs::{Answer, Failure, Product, call};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyDict, PyMapping, PySet, PyString};
use serde_json::{Map, Number, Value};
use std::path::PathBuf;

/// Python object that stands for an input file.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Input(Mounted);

/// Python objects that a verb accepts in place of a file.
#[derive(FromPyObject)]
pub(crate) enum CallArgument<'py> {
    #[pyo3(transparent)]
    Program(PyRef<'py, Program>),
    /// Program with the values of its first parameters.
    Fixed(PyRef<'py, Program>, Vec<f64>),
    #[pyo3(transparent)]
    Points(PyRef<'py, Cloud>),
    #[pyo3(transparent)]
    Mesh(PyRef<'py, MeshData>),
    #[pyo3(transparent)]
    Function(PyRef<'py, Fitted>),
    #[pyo3(transparent)]
    Patches(PyRef<'py, Patches>),
    #[pyo3(transparent)]
    Map(PyRef<'py, Triangulation>),
    #[pyo3(transparent)]
    Solids(PyRef<'py, Solids>),
    /// Document as JSON text.
    #[pyo3(transparent)]
    Json(String),
}

impl CallArgument<'_> {
    fn object(&self) -> Result<Object, CallError> {
        Ok(match self {
            Self::Program(program) => Object::Program(program.shared()),
            Self::Fixed(program, values) => {
                let values = program.values_of(values)?;
                Object::text("hf", program.model().print_fitted(&values, None))
            }
            Self::Points(cloud) => Object::Points(cloud.cloud.clone(), cloud.report.clone()),
            Self::Mesh(mesh) => Object::Mesh(mesh.mesh.clone(), mesh.unit.clone()),
            Self::Function(function) => Object::Function(function.metric.clone()),
            Self::Patches(patches) => {
                Object::text("json", write_patches(&patch_records(&patches.patches)))
            }
            Self::Map(drawn) => match &drawn.map {
                Some(map) => Object::Map(map.clone()),
                // A surface of patches is passed as triangles.
                None => Object::Mesh(drawn.mesh.clone(), None),
            },
            Self::Solids(solids) => Object::text(
                "brep.json",
                write_solids(&SolidFile {
                    brep: solids.made.built.brep.clone(),
                    name: solids.statement.name.clone(),
                    unit: solids.statement.unit.clone(),
                    properties: solids.made.properties(),
                }),
            ),
            Self::Json(text) => Object::text("json", text.as_str()),
        })
    }
}

#[pymethods]
impl Input {
    /// Registers an object under the name of a file.
    #[new]
    fn new(name: &str, object: CallArgument<'_>) -> PyResult<Self> {
        Ok(Self(Mounted::new(name, object.object()?)))
    }
}

/// File in memory that a verb writes.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Output(Mounted);

#[pymethods]
impl Output {
    /// Creates an empty file for a page (html) or a picture (png, svg).
    #[new]
    fn new(ending: &str) -> PyResult<Self> {
        let known = ["html", "png", "svg"].into_iter().find(|e| *e == ending);
        let ending = known.ok_or_else(CallError::internal)?;
        Ok(Self(Mounted::new(ending, Object::text(ending, ""))))
    }

    /// Returns the content.
    fn content<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.0.bytes())
    }
}

/// Maximum nesting depth of lists; corners of a polygon need two levels.
const MAX_NESTING_DEPTH: usize = 8;

/// Returns the exception for an invalid argument.
fn refused(what: impl std::fmt::Display) -> PyErr {
    CallError::usage(format!("an argument is {what}")).into()
}

/// Converts a Python value to JSON; objects are replaced by their paths.
fn json(value: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
    if value.is_none() {
        return Ok(Value::Null);
    }
    if let Some(text) = text(value)? {
        return Ok(text.into());
    }
    if value.is_instance_of::<PyBool>() {
        return Ok(value.extract::<bool>()?.into());
    }
    if let Some(items) = items(value, depth)? {
        return Ok(items);
    }
    number(value)
}

/// Converts a text, a path, or a file in memory to a string; `None` for any other value.
fn text(value: &Bound<'_, PyAny>) -> PyResult<Option<String>> {
    let path = |mounted: &Mounted| Some(mounted.path().to_string_lossy().into_owned());
    if let Ok(input) = value.cast::<Input>() {
        return Ok(path(&input.get().0));
    }
    if let Ok(output) = value.cast::<Output>() {
        return Ok(path(&output.get().0));
    }
    if !value.is_instance_of::<PyString>() && !value.hasattr("__fspath__")? {
        return Ok(None);
    }
    let path = value.extract::<PathBuf>()?;
    let text = path.to_str().map(str::to_owned);
    text.map(Some)
        .ok_or_else(|| refused("no text: it is not UTF-8"))
}

/// Converts a list or a mapping; `None` for any other value.
fn items(value: &Bound<'_, PyAny>, depth: usize) -> PyResult<Option<Value>> {
    let is_odd = value.is_instance_of::<PyBytes>() || value.is_instance_of::<PySet>();
    if is_odd {
        return Err(refused(format!("a {}", value.get_type().name()?)));
    }
    let is_mapping = value.cast::<PyMapping>().is_ok();
    if !is_mapping && value.len().is_err() {
        return Ok(None);
    }
    if depth > MAX_NESTING_DEPTH {
        return Err(refused("a list within lists within lists"));
    }
    if let Ok(fields) = value.cast::<PyMapping>() {
        let mut map = Map::new();
        for pair in fields.items()?.iter() {
            let (key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>) = pair.extract()?;
            map.insert(key.str()?.to_string(), json(&value, depth + 1)?);
        }
        return Ok(Some(Value::Object(map)));
    }
    let items = value.try_iter()?.map(|item| json(&item?, depth + 1));
    Ok(Some(Value::Array(items.collect::<PyResult<_>>()?)))
}

/// Converts a number; fractions and decimal numbers keep their written form.
fn number(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    if let Ok(whole) = value.extract::<i64>() {
        return Ok(whole.into());
    }
    let module: String = value.get_type().getattr("__module__")?.extract()?;
    if ["fractions", "decimal"].contains(&module.as_str()) {
        return Ok(value.str()?.to_string().into());
    }
    let number = value.extract::<f64>();
    let number = number.map_err(|_| match value.get_type().name() {
        Ok(kind) => refused(format!("a {kind}: numbers and texts are expected")),
        Err(error) => error,
    })?;
    let finite = Number::from_f64(number);
    Ok(finite.map_or_else(|| number.to_string().into(), Value::Number))
}

/// Converts keyword arguments to a request.
pub(crate) fn object(fields: &Bound<'_, PyDict>) -> PyResult<Map<String, Value>> {
    let mut map = Map::new();
    for (key, value) in fields {
        map.insert(key.extract()?, json(&value, 0)?);
    }
    Ok(map)
}

/// Document, warnings, result in memory, `None` if the verb has none, and true if the result is all
/// that was asked for.
type CallOutcome = (String, Vec<String>, Option<Py<PyAny>>, bool);

/// Runs a verb.
#[pyfunction]
pub(crate) fn run_verb(
    py: Python<'_>,
    verb: String,
    arguments: &Bound<'_, PyDict>,
    asked: CallLimits<'_>,
) -> PyResult<CallOutcome> {
    let mut arguments = object(arguments)?;
    if let Some(seconds) = asked.time_limit {
        arguments.insert("time_limit".to_owned(), seconds.to_string().into());
    }
    let done = run::listened(py, &asked, move |listener| {
        call(&verb, &arguments, listener)
    })?;
    let Answer {
        outcome,
        product,
        warnings,
    } = done.map_err(CallError::from)?;
    let is_as_asked = outcome.exit == 0;
    let document = isoform_verbs::document(outcome.exit, outcome.json);
    let warnings = warnings.iter().map(|warning| in_python(warning)).collect();
    let native = product.map(|product| native(py, product)).transpose()?;
    Ok((document, warnings, native, is_as_asked))
}

/// Returns the JSON schema of requests.
#[pyfunction]
pub(crate) fn schema() -> String {
    isoform_verbs::schema()
}

/// Wraps a result as a Python object.
fn native(py: Python<'_>, product: Product) -> PyResult<Py<PyAny>> {
    Ok(match product {
        Product::Points(cloud, report) => Py::new(py, Cloud::from_parts(cloud, report))?.into_any(),
        Product::Fit(fitted) => Py::new(py, Fit::new(*fitted))?.into_any(),
        Product::Mesh(mesh, unit) => Py::new(py, MeshData::new(mesh, unit))?.into_any(),
        Product::Solids(made, statement) => Py::new(py, Solids::new(*made, statement))?.into_any(),
        Product::Patches(surface, patches) => {
            Py::new(py, Patches::new(surface, patches))?.into_any()
        }
        Product::Map {
            mesh,
            parameters,
            report,
            map,
        } => Py::new(py, Triangulation::new(mesh, parameters, report, map))?.into_any(),
        Product::Function(function) => Py::new(py, Fitted::new(function))?.into_any(),
        Product::Entities(found) => Py::new(py, Entities::new(*found))?.into_any(),
    })
}

impl From<Failure> for CallError {
    fn from(failure: Failure) -> Self {
        let Failure {
            code,
            message,
            place,
            why,
            hint,
            ..
        } = failure;
        let mut text = in_python(&message);
        if let (Some(file), Some(line), Some(column)) = (&place.file, place.line, place.column) {
            text = format!("{}:{line}:{column}: {text}", file.display());
        }
        let because = if why.is_empty() { "" } else { ": " };
        let trouble = Self::new(code, text + because + &in_python(&why)).hint(in_python(&hint));
        match (place.line, place.column) {
            (Some(line), Some(column)) => trouble.at(line, column),
            _ => trouble,
        }
    }
}

/// Rewrites a text of the command line for Python: `--time-limit` becomes `time_limit`. Dashes
/// within words, as in names of files, are kept.
fn in_python(text: &str) -> String {
    if text == "isoform --help" {
        return "help(isoform)".to_owned();
    }
    let mut plain = String::new();
    let mut rest = text;
    while let Some(at) = rest.find("--") {
        let (before, option) = (&rest[..at], &rest[at + 2..]);
        let is_name = |c: char| c.is_ascii_lowercase() || c == '-';
        let end = option.find(|c| !is_name(c)).unwrap_or(option.len());
        let is_start = |c: char| c.is_whitespace() || "'`\"([<".contains(c);
        let is_option = before.chars().next_back().is_none_or(is_start) && end > 1;
        plain += before;
        match is_option {
            true => plain += &option[..end].replace('-', "_"),
            false => plain += &rest[at..at + 2 + end],
        }
        rest = &option[end..];
    }
    plain + rest
}
