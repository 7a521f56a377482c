//! The surface to parameterize: a HyperFun program or a polynomial.

use crate::context::Context;
use crate::disk;
use crate::failure::Failure;
use crate::kind::{self, Kind};
use crate::language::Language;
use crate::memory::{self, Object};
use crate::model;
use crate::parameters::{self, Given};
use crate::{gallery, spline};
use isoform::ImplicitSurface;
use isoform::algebra::ParseError;
use isoform::field::SolidError;
use serde_json::Value;
use std::path::Path;

/// A surface with its name for messages.
pub(super) struct PatchInput {
    pub(super) name: String,
    pub(super) surface: ImplicitSurface,
    pub(super) warnings: Vec<String>,
}

/// Reads a model: a JSON file, or one of stdin that begins as such, holds a polynomial or a function
/// fitted to points, and any other file, or a name out of the gallery, a program.
pub(super) fn read(
    path: &Path,
    language: &Language,
    given: &Given,
    context: &Context,
) -> Result<PatchInput, Failure> {
    let is_json = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("json"));
    let name = memory::name(path);
    if !is_json && path != Path::new("-") {
        let model = gallery::template(path, language, context)?;
        return program(&model, given, name, context);
    }
    if let Some(Object::Function(function)) = memory::find(path) {
        return Ok(PatchInput {
            name,
            surface: function.0.clone().into(),
            warnings: Vec::new(),
        });
    }
    let text = disk::text(disk::read_file(path)?);
    if !is_json && !text.trim_start().starts_with('{') {
        let model = model::parse(path, &text, language, context)?;
        return program(&model, given, name, context);
    }
    if let Ok(json) = serde_json::from_str::<Value>(&text)
        && kind::is_fitted(&json)
    {
        return Ok(PatchInput {
            name,
            surface: spline::of_document(path, &json)?.into(),
            warnings: Vec::new(),
        });
    }
    if !given.is_empty() {
        let failure = Failure::usage("a polynomial has no parameters");
        return Err(failure.hint("leave out --params and --set"));
    }
    Ok(PatchInput {
        name,
        surface: polynomial(path, &text)?,
        warnings: Vec::new(),
    })
}

/// The surface of a HyperFun program.
fn program(
    model: &isoform::field::hyperfun::Model,
    given: &Given,
    name: String,
    context: &Context,
) -> Result<PatchInput, Failure> {
    let values = parameters::values(model, given, context)?;
    let surface = ImplicitSurface::of_model(model, &values).map_err(|e| {
        let failure = Failure::input("model", format!("{name}: {e}"));
        if matches!(e, SolidError::Dimension { .. }) {
            failure.hint("--object with one of three coordinates")
        } else {
            failure
        }
    })?;
    let warning = "the program is no expression: it is run statement by statement, and nothing is proved of it";
    let warnings = if surface.is_run {
        vec![warning.to_owned()]
    } else {
        Vec::new()
    };
    Ok(PatchInput {
        name,
        surface,
        warnings,
    })
}

/// An example of the JSON that is read, for hints.
const EXAMPLE: &str = r#"{"F": "x^2 + y^2 + z^2 - 1/4"}"#;

/// The polynomial of a JSON object's key F.
fn polynomial(path: &Path, text: &str) -> Result<ImplicitSurface, Failure> {
    let shown = if path == Path::new("-") {
        Path::new("stdin")
    } else {
        path
    };
    let json: Value = serde_json::from_str(text).map_err(|e| not_json(shown, text, &e))?;
    let Some(formula) = json.get("F").and_then(Value::as_str) else {
        return Err(
            match Kind::detect(path, kind::head(text.as_bytes()), text) {
                Some(kind) if !matches!(kind, Kind::Json | Kind::Polynomial) => {
                    kind.instead_of("a polynomial, a program or a fitted function", shown)
                }
                _ => {
                    let message = "there is no text under the key F".to_owned();
                    wrong(shown, "key", message).hint(EXAMPLE)
                }
            },
        );
    };
    let parsed = ImplicitSurface::of_polynomial(formula).map_err(|e| not_parsed(shown, &e))?;
    parsed.ok_or_else(|| {
        let message = "F is constant, or has a coefficient beyond the largest number".to_owned();
        wrong(shown, "polynomial", message).hint(EXAMPLE)
    })
}

/// Makes the failure of an invalid JSON text, with its place marked.
fn not_json(path: &Path, text: &str, error: &serde_json::Error) -> Failure {
    let (line, column) = (error.line().max(1), error.column().max(1));
    let drawn = text.lines().nth(line - 1).unwrap_or_default();
    Failure::input("json", format!("not JSON: {error}"))
        .at(path, line, column)
        .drawn(drawn)
        .hint(EXAMPLE)
}

/// Makes the failure of a formula that is not a polynomial.
fn not_parsed(path: &Path, error: &ParseError) -> Failure {
    let message = format!("F, column {}: {error}", error.column);
    let mut failure = wrong(path, "polynomial", message)
        .hint("a polynomial in x, y and z with rational coefficients");
    failure.place.column = Some(error.column);
    failure
}

/// Something is wrong with the value of the key F.
fn wrong(path: &Path, code: &'static str, message: String) -> Failure {
    let mut failure = Failure::input(code, format!("{}: {message}", path.display()));
    failure.place.file = Some(path.to_owned());
    failure.place.key = Some("F");
    failure
}
