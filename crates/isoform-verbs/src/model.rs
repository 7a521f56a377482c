//! Reading models: HyperFun programs, level sets of 3MF as programs, and formulas.

use crate::context::Context;
use crate::disk;
use crate::failure::Failure;
use crate::formula::{self, StatedFormula};
use crate::kind::{self, Kind, is_fitted};
use crate::language::{self, Language};
use crate::memory::{self, Object};
use crate::parameters::{self, Given};
use crate::{scan, spline, terms};
use isoform::Implicit;
use isoform::field::hyperfun::{Model, SyntaxError};
use isoform::geom::Aabb;
use isoform::io::{Source, read_implicit};
use serde_json::Value;
use std::path::Path;

/// Code of the failures of programs that do not parse.
const SYNTAX: &str = "syntax";

/// Model as it was given.
pub(crate) enum GivenModel {
    /// Object of a program.
    Program(Box<Model>),
    /// Formula, whose inside is still to be chosen.
    Formula(Box<StatedFormula>),
    /// Function fitted to points.
    Fitted(Box<Implicit>),
}

/// Solid of a model.
pub(crate) struct SolidModel {
    pub(crate) model: Model,
    /// Values of its parameters.
    pub(crate) values: Vec<f64>,
    /// Region that cuts it.
    pub(crate) region: Option<Aabb>,
    /// True if the surface is meant, not the solid.
    pub(crate) is_surface: bool,
}

impl GivenModel {
    /// Returns the program of a model, with the inside that a formula states, or that is usual.
    pub(crate) fn into_stated(self, path: &Path) -> Result<Model, Failure> {
        match self {
            Self::Program(model) => Ok(*model),
            Self::Formula(formula) => formula.stated(),
            Self::Fitted(_) => Err(without_program(path)),
        }
    }

    /// Returns the program of a model, with the function as written.
    pub(crate) fn into_written(self, path: &Path) -> Result<Model, Failure> {
        match self {
            Self::Formula(formula) => formula.as_written(),
            other => other.into_stated(path),
        }
    }

    /// Returns the solid of a program for the given values; of a formula the bounded one, or the
    /// one in a region, which is chosen and named if none is given.
    pub(crate) fn solid(
        self,
        path: &Path,
        given: &Given,
        region: Option<Aabb>,
        context: &Context,
    ) -> Result<SolidModel, Failure> {
        if let Self::Formula(formula) = self {
            return formula.solid(given, region, context);
        }
        let model = self.into_stated(path)?;
        Ok(SolidModel {
            values: parameters::values(&model, given, context)?,
            model,
            region,
            is_surface: false,
        })
    }
}

/// Returns the failure of a verb that takes programs, and was given a fitted function.
fn without_program(path: &Path) -> Failure {
    Kind::Fitted.instead_of("a HyperFun program", path)
}

/// Reads a model, chooses the object of a program and says what is doubtful in it.
pub(crate) fn read(
    path: &Path,
    language: &Language,
    context: &Context,
) -> Result<GivenModel, Failure> {
    let program = |model| GivenModel::Program(Box::new(model));
    match memory::find(path) {
        Some(Object::Program(model)) if language.is_default() => {
            return Ok(program(Model::clone(&model)));
        }
        Some(Object::Program(model)) => {
            return parse(path, model.source(), language, context).map(program);
        }
        Some(Object::Function(function)) => {
            return Ok(GivenModel::Fitted(Box::new(function.0.clone())));
        }
        Some(Object::Bytes { .. }) | None => {}
        Some(other) => return Err(other.instead_of("a model", path)),
    }
    let bytes = disk::read_file(path)?;
    if let Some(text) = level_sets(path, &bytes, context)? {
        return parse(path, &text, language, context).map(program);
    }
    let head = kind::head(&bytes).to_vec();
    let text = disk::text(bytes);
    if text.trim_start().starts_with('{') {
        return document(path, &text);
    }
    let parsed = parse(path, &text, language, context);
    parsed.map(program).map_err(|failure| {
        let kind = match failure.code {
            SYNTAX => Kind::detect(path, &head, &text),
            _ => None,
        };
        kind.map_or(failure, |kind| kind.instead_of("a model", path))
    })
}

/// Reads a model from JSON: a formula or a function fitted to points.
fn document(path: &Path, text: &str) -> Result<GivenModel, Failure> {
    let json: Value = serde_json::from_str(text).map_err(|e| {
        let (line, column) = (e.line().max(1), e.column().max(1));
        let drawn = text.lines().nth(line - 1).unwrap_or_default();
        Failure::input("json", format!("not JSON: {e}"))
            .at(path, line, column)
            .drawn(drawn)
    })?;
    if is_fitted(&json) {
        return Ok(GivenModel::Fitted(Box::new(spline::of_document(
            path, &json,
        )?)));
    }
    match formula::of_document(path, &json)? {
        Some(formula) => Ok(GivenModel::Formula(Box::new(formula))),
        None => {
            let kind = Kind::of_json(&json);
            let failure = kind.instead_of("a model", path);
            Err(match kind {
                Kind::Json => failure.hint(formula::EXAMPLE),
                _ => failure,
            })
        }
    }
}

/// Returns the program of the level sets that a 3MF package builds; `None` for other files.
fn level_sets(path: &Path, bytes: &[u8], context: &Context) -> Result<Option<String>, Failure> {
    let name = memory::name(path);
    let source = Source::Bytes { name: &name, bytes };
    let found = read_implicit(source).map_err(|e| scan::unreadable(path, &e))?;
    let Some(program) = found else {
        return Ok(None);
    };
    for warning in &program.warnings {
        context.warn(format_args!("{}: {warning}", path.display()));
    }
    Ok(Some(program.text))
}

/// Reads a program from text; the path is for messages.
pub(crate) fn parse(
    path: &Path,
    text: &str,
    language: &Language,
    context: &Context,
) -> Result<Model, Failure> {
    let mut model = language::parse(text, language).map_err(|e| misspelled(&e, path, text))?;
    terms::read(&mut model, path, context)?;
    for w in model.warnings() {
        context.warn(format_args!(
            "{}:{}:{}: {}",
            path.display(),
            w.line,
            w.column,
            w.message
        ));
    }
    model.object(language.object.as_deref()).map_err(|e| {
        let failure = Failure::usage(format!(
            "{}: no object is called `{}`",
            path.display(),
            e.name
        ));
        failure.hint(format!("--object with one of: {}", e.objects.join(", ")))
    })
}

/// The failure of a program that is not HyperFun, with its line drawn.
fn misspelled(error: &SyntaxError, path: &Path, text: &str) -> Failure {
    let line = text
        .strip_prefix('\u{feff}')
        .unwrap_or(text)
        .split('\n')
        .nth(error.line - 1)
        .unwrap_or_default();
    let failure = Failure::input(SYNTAX, &error.message)
        .at(path, error.line, error.column)
        .drawn(line);
    failure.hint(error.hint.clone())
}
